/* Phong splats (Botsch, Spernat, Kobbelt 2004): normals that vary linearly over a splat's disc.
 *
 * At the disc coordinates u, v (the offset r (u t + v b) from the centre, turned with the disc where that is nearly seen from its
 * edge; the disc is u^2 + v^2 <= 1) the normal is N = n + u A + v B, not unit, with n the record's normal as it decodes, t and b
 * its tangents, and A = a0 t + a1 b, B = b0 t + b1 b. u and v count in the point's own radius: for a disc drawn f times as large, A
 * and B are f times as long. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_NORMAL_FIELD_H
#define PBR_CORE_NORMAL_FIELD_H

#include "points.h"

/* 8 bytes, a0 a1 b0 b1 in NORMAL_FIELD_UNITs. Rounding turns N by at most one unit, 6.1e-5 rad, at the rim: as much as the
 * octahedral normal. (Signed bytes for the same range: 0.014 rad.) Read them as plain integers: "signed normalised"
 * is not the same on every OpenGL. */
struct normal_field {
    int16_t a[2], b[2];
};

#define NORMAL_FIELD_UNIT (1.0 / 16384)
#define NORMAL_FIELD_MOST 1.7320508075688772 /* of |uA + vB| over the disc: tan 60 degrees */

/* Two unit vectors that span the plane across the unit vector n (Duff et al. 2017, with the seam moved from the equator, where the
 * normals of walls lie); `tangents` of disc.glsl must choose the same. */
static inline void disc_tangents(const double n[3], double t[3], double b[3]) {
    const double s = n[2] >= -0.7 ? 1 : -1, a = -1 / (s + n[2]), c = n[0] * n[1] * a;
    t[0] = 1 + s * n[0] * n[0] * a;
    t[1] = s * c;
    t[2] = -s * n[0];
    b[0] = c;
    b[1] = s + n[1] * n[1] * a;
    b[2] = -n[1];
}

/* a and b: finite, along t and b. A field that turns the normal too far is made smaller as a whole, so that it keeps its shape in
 * whatever frame. */
void normal_field_encode(const double a[2], const double b[2], struct normal_field *out);
static inline void normal_field_decode(const struct normal_field *field, double a[2], double b[2]) {
    for (int k = 0; k < 2; k++) {
        a[k] = field->a[k] * NORMAL_FIELD_UNIT;
        b[k] = field->b[k] * NORMAL_FIELD_UNIT;
    }
}

/* Sums over what a field is fitted to, each of weight w, at x over the tangent plane, with y the tangential part of its normal:
 * w x x^T, and w x times each component of y. */
struct normal_moments {
    double xx, xy, yy, t[2], b[2];
};

/* The field by the rule in normal_field.c, of a splat `ratio` times as large as the unit of x. */
void normal_field_solve(const struct normal_moments *moments, double ratio, struct normal_field *out);

/* Between a splat's normal and those of what counts: 78 degrees. */
#define NORMAL_FIELD_LEAST_COSINE 0.2

/* Writes points->count fields, in the points' order: see normal_field.c for the rule. `neighbours`: how many nearest ones are
 * looked at, 0 = 12. Points that have no normal, or no radius, or no neighbours on their surface, get a field of zeros. */
pbr_result normal_field_fit(const pbr_points *points, uint32_t neighbours, const struct progress *progress,
                            struct normal_field *out);

#endif
