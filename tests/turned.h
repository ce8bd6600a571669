/* How a disc is drawn that is nearly seen from its edge: docs/splats.md, by angles. SPDX-License-Identifier: MIT */
#ifndef TESTS_TURNED_H
#define TESTS_TURNED_H

#include <math.h>

#include "core/matrix.h"

/* A disc whose normal is more than 82 degrees off the direction to the eye is drawn half as high again, or as at 82, or two pixels
 * higher: its normal turns in the plane of both. size: in pixels; not above 0: not before the eye. */
static inline void turn_from_edge(const double to_eye[3], double size, double normal[3]) {
    const double most = acos(-1) * 82 / 180, lengths = length3(to_eye) * length3(normal);
    const double cosine = dot3(to_eye, normal) / lengths, slant = acos(fmin(fabs(cosine), 1));
    if (!(slant > most && size > 0)) return;
    const double drawn = fmax(most, acos(cos(slant) + fmin(cos(slant) / 2, 2 / size))), side = cosine < 0 ? -1 : 1;
    double axis[3], across[3];
    cross3(to_eye, normal, axis);
    cross3(axis, to_eye, across); /* from the direction to the eye towards the normal */
    for (int k = 0; k < 3; k++)
        normal[k] = side * cos(drawn) * to_eye[k] / length3(to_eye) + sin(drawn) * across[k] / length3(across);
}

#endif
