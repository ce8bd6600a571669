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

/* To first order in their tilt, the radius at which three equal discs across these normals (of any length) hide the triangle from
 * every direction up to 75 degrees off its own, but at most 1.3 times the smallest circle around its corners; that of covering
 * alone where a normal is more than 50 degrees off it. */
double triangle_hiding_radius(const double edges[3][3], const double normals[3][3]);

#endif
