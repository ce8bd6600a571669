/* Triangles, several at a time: every number is an array with one of each, and what is computed for all is without branches, so that
 * compilers make vector instructions of it. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_TRIANGLES_H
#define PBR_CORE_TRIANGLES_H

#include <stdbool.h>

enum { LANES = 8 /* triangles at a time */ };

typedef double lanes[LANES];

struct triangles {
    lanes edges[3][3];         /* lead around it: from corner i to the next one */
    lanes sides[3];            /* their squared lengths */
    lanes normal[3], length;   /* of the triangle; its length is twice the area */
    bool is_degenerate[LANES]; /* no more than what rounding makes of a straight line */
};

void triangles_measure(const lanes corners[3][3], struct triangles *out);

/* The angle at each corner, to 1.2e-5, and above 0 unless the triangle is degenerate. */
void triangles_angles(const struct triangles *triangles, lanes out[3]);

/* The smallest radius at which three equal discs around a triangle's corners cover it; see pbr_mesh_to_points. */
void triangles_covering_radius(const struct triangles *triangles, lanes out);

/* To first order in their tilt, the radius at which three equal discs across these normals (of any length) hide the triangle from
 * every direction up to 75 degrees off its own, but at most 1.3 times the smallest circle around its corners; `covering`, that of
 * covering alone, where a normal is more than 50 degrees off it. */
void triangles_hiding_radius(const struct triangles *triangles, const lanes normals[3][3], const lanes covering, lanes out);

#endif
