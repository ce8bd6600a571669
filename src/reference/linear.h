/* Vectors, and matrices in double, column-major, for src/reference alone: it shares no mathematics with what it judges.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_LINEAR_H
#define PBR_REFERENCE_LINEAR_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

static inline double vec_dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline double vec_length(const double a[3]) {
    return sqrt(vec_dot(a, a));
}
static inline void vec_cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
/* Makes it unit; a vector that has no direction becomes 0 and false is returned. */
static inline bool vec_normalise(double a[3]) {
    const double largest = fmax(fabs(a[0]), fmax(fabs(a[1]), fabs(a[2])));
    if (!(largest > 0) || !isfinite(largest)) {
        a[0] = a[1] = a[2] = 0;
        return false;
    }
    for (int k = 0; k < 3; k++) a[k] /= largest;
    const double length = vec_length(a);
    for (int k = 0; k < 3; k++) a[k] /= length;
    return true;
}

/* A row of a 4x4 matrix applied to the point p, and to the direction d. */
static inline double row_point(const double row[4], const double p[3]) {
    return vec_dot(row, p) + row[3];
}
static inline double row_direction(const double row[4], const double d[3]) {
    return vec_dot(row, d);
}
static inline void mat_row(const double m[16], int r, double out[4]) {
    for (int c = 0; c < 4; c++) out[c] = m[4 * c + r];
}

static inline void mat_multiply(const double a[16], const double b[16], double out[16]) {
    double product[16];
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++) {
            double sum = 0;
            for (int k = 0; k < 4; k++) sum += a[4 * k + r] * b[4 * c + k];
            product[4 * c + r] = sum;
        }
    memcpy(out, product, sizeof product);
}
/* Of affine matrices. */
static inline void mat_point(const double m[16], const double p[3], double out[3]) {
    for (int r = 0; r < 3; r++) out[r] = m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
}
static inline void mat_direction(const double m[16], const double d[3], double out[3]) {
    for (int r = 0; r < 3; r++) out[r] = m[r] * d[0] + m[4 + r] * d[1] + m[8 + r] * d[2];
}

static inline double det3(const double a[3], const double b[3], const double c[3]) {
    double cross[3];
    vec_cross(b, c, cross);
    return vec_dot(a, cross);
}

/* Solves a.p = d[0], b.p = d[1], c.p = d[2] (Cramer). False if they have no single solution. */
static inline bool solve3(const double a[3], const double b[3], const double c[3], const double d[3], double p[3]) {
    double bc[3], ca[3], ab[3];
    vec_cross(b, c, bc);
    vec_cross(c, a, ca);
    vec_cross(a, b, ab);
    const double det = vec_dot(a, bc);
    for (int k = 0; k < 3; k++) p[k] = (d[0] * bc[k] + d[1] * ca[k] + d[2] * ab[k]) / det;
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

/* Whether Gaussian elimination with row pivots of the matrix, its rows scaled to 1, meets no pivot of rounding's size. */
bool mat_is_invertible(const double m[16]);

/* The largest singular value of the linear part: the largest stretch. */
double mat_largest_stretch(const double m[16]);

#endif
