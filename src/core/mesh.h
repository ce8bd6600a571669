/* The inside of a mesh. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_MESH_H
#define PBR_CORE_MESH_H

#include <pbr/mesh.h>

#include "points.h"

struct pbr_mesh {
    pbr_instance *instance;
    atomic_size_t references;
    pbr_points *vertices; /* one per vertex of the input, non-finite ones included as (0, 0, 0): indices stay valid */
    uint32_t (*triangles)[3];
    uint64_t triangle_count, dropped, unreferenced, degenerate;
    double minimum[3], maximum[3]; /* of referenced vertices, object space */
    bool given_normals;
};

/* The smallest radius at which three equal discs around a triangle's corners cover it; see pbr_mesh_to_points. The edges lead
 * around it. */
double triangle_covering_radius(const double edges[3][3]);

#endif
