/* Vectors and 4x4 matrices in double, column-major: element (r, c) is m[4 * c + r]. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_MATRIX_H
#define PBR_CORE_MATRIX_H

#include <math.h>
#include <stdbool.h>

static inline double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline double length3(const double a[3]) {
    return sqrt(dot3(a, a));
}

static inline void cross3(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* out = a b; out may not alias. */
static inline void matrix_multiply(const double a[16], const double b[16], double out[16]) {
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++)
            out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
}

/* out = m translate(t): moves m's origin to the point t of its domain. */
static inline void matrix_translate(const double m[16], const double t[3], double out[16]) {
    for (int i = 0; i < 12; i++) out[i] = m[i];
    for (int r = 0; r < 4; r++) out[12 + r] = m[r] * t[0] + m[4 + r] * t[1] + m[8 + r] * t[2] + m[12 + r];
}

static inline bool matrix_is_finite(const double m[16]) {
    for (int i = 0; i < 16; i++)
        if (!isfinite(m[i])) return false;
    return true;
}

/* False if the bottom row is not (0, 0, 0, 1) but for rounding; else makes it so exactly. */
static inline bool matrix_make_affine(double m[16]) {
    const double tolerance = 1e-6;
    if (fabs(m[3]) > tolerance || fabs(m[7]) > tolerance || fabs(m[11]) > tolerance || fabs(m[15] - 1) > tolerance) return false;
    m[3] = m[7] = m[11] = 0;
    m[15] = 1;
    return true;
}

/* Gauss-Jordan with the largest pivots. False, with `out` undefined, if m is singular. */
static inline bool matrix_inverse(const double m[16], double out[16]) {
    double a[4][8];
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 8; c++) a[r][c] = c < 4 ? m[4 * c + r] : c - 4 == r;
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int r = k + 1; r < 4; r++)
            if (fabs(a[r][k]) > fabs(a[pivot][k])) pivot = r;
        if (!(fabs(a[pivot][k]) > 0)) return false;
        for (int c = 0; c < 8; c++) {
            const double swapped = a[k][c];
            a[k][c] = a[pivot][c];
            a[pivot][c] = swapped;
        }
        for (int c = 7; c >= k; c--) a[k][c] /= a[k][k];
        for (int r = 0; r < 4; r++)
            for (int c = 7; c >= k && r != k; c--) a[r][c] -= a[r][k] * a[k][c];
    }
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) out[4 * c + r] = a[r][c + 4];
    return true;
}

/* Cofactors of the upper 3x3, a 3x3 column-major matrix: det * inverse transpose. It turns normals as the inverse transpose does,
 * up to a positive factor when multiplied by the determinant's sign, and exists for singular matrices too. */
static inline double matrix_cofactors(const double m[16], double out[9]) {
    cross3(m + 4, m + 8, out);
    cross3(m + 8, m, out + 3);
    cross3(m, m + 4, out + 6);
    return dot3(m, out);
}

/* Largest singular value of the upper 3x3: the largest stretch of a unit vector. Closed form for the largest eigenvalue of the
 * symmetric M^T M (Smith 1961). */
static inline double matrix_largest_stretch(const double m[16]) {
    double xx = dot3(m, m), yy = dot3(m + 4, m + 4), zz = dot3(m + 8, m + 8);
    double xy = dot3(m, m + 4), xz = dot3(m, m + 8), yz = dot3(m + 4, m + 8);
    double q = (xx + yy + zz) / 3, off = xy * xy + xz * xz + yz * yz;
    double p = sqrt(((xx - q) * (xx - q) + (yy - q) * (yy - q) + (zz - q) * (zz - q) + 2 * off) / 6);
    if (!(p > 0)) return sqrt(q);
    double a = (xx - q) / p, b = (yy - q) / p, c = (zz - q) / p, d = xy / p, e = xz / p, f = yz / p;
    double half = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2;
    half = half < -1 ? -1 : half > 1 ? 1 : half;
    return sqrt(q + 2 * p * cos(acos(half) / 3));
}

#endif
