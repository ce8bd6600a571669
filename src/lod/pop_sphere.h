/* Balls around triangles and around balls. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_POP_SPHERE_H
#define PBR_LOD_POP_SPHERE_H

struct ball {
    double centre[3], radius;
};

/* The centre of the smallest ball around a triangle's corners; degenerate ones too. */
void ball_centre_of_triangle(const double corners[3][3], double centre[3]);

/* The radius that a ball around a centre needs in order to hold others. */
double ball_radius_around(const double centre[3], const struct ball *balls, int count);

/* The smallest ball around 1 to 4 balls, but for rounding, which makes it larger: it is never too small to hold them. */
struct ball ball_around(const struct ball *balls, int count);

#endif
