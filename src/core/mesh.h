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

struct triangle {
    double edges[3][3];       /* lead around it: from corner i to the next one */
    double sides[3];          /* their squared lengths */
    double normal[3], length; /* twice the area, and its length */
    bool is_degenerate;       /* no more than what rounding makes of a straight line */
};

void triangle_measure(const double corners[3][3], struct triangle *out);

/* The smallest radius at which three equal discs around a triangle's corners cover it; see pbr_mesh_to_points. */
double triangle_covering_radius(const struct triangle *triangle);

/* To first order in their tilt, the radius at which three equal discs across these normals (of any length) hide the triangle from
 * every direction up to 75 degrees off its own, but at most 1.3 times the smallest circle around its corners; `covering`, that of
 * covering alone, where a normal is more than 50 degrees off it. */
double triangle_hiding_radius(const struct triangle *triangle, const double normals[3][3], double covering);

#endif
