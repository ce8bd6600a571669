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
    double mean_covering;          /* of triangles, triangles_covering_radius */
    bool given_normals;
};

#endif
