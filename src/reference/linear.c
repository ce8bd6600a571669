/* The two functions on matrices that are more than a formula. SPDX-License-Identifier: MIT */
#include "linear.h"

#include <float.h>

bool mat_is_invertible(const double m[16]) {
    double rows[4][4];
    for (int r = 0; r < 4; r++) {
        double largest = 0;
        mat_row(m, r, rows[r]);
        for (int c = 0; c < 4; c++) largest = fmax(largest, fabs(rows[r][c]));
        if (!(largest > 0) || !isfinite(largest)) return false;
        for (int c = 0; c < 4; c++) rows[r][c] /= largest;
    }
    /* Full pivoting: far planes 1e9 times as far as near ones are fine. */
    for (int step = 0; step < 4; step++) {
        int at_row = step, at_column = step;
        for (int r = step; r < 4; r++)
            for (int c = step; c < 4; c++)
                if (fabs(rows[r][c]) > fabs(rows[at_row][at_column])) at_row = r, at_column = c;
        const double pivot = rows[at_row][at_column];
        if (!(fabs(pivot) > 4 * DBL_EPSILON)) return false;
        for (int c = 0; c < 4; c++) {
            const double kept = rows[step][c];
            rows[step][c] = rows[at_row][c];
            rows[at_row][c] = kept;
        }
        for (int r = 0; r < 4; r++) {
            const double kept = rows[r][step];
            rows[r][step] = rows[r][at_column];
            rows[r][at_column] = kept;
        }
        for (int r = step + 1; r < 4; r++) {
            const double factor = rows[r][step] / pivot;
            for (int c = step; c < 4; c++) rows[r][c] -= factor * rows[step][c];
        }
    }
    return true;
}

/* One rotation of Jacobi's method: makes element (p, q) of the symmetric matrix 0. */
static void rotate(double a[3][3], int p, int q) {
    if (a[p][q] == 0) return;
    const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    const double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 3; k++) {
        const double kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < 3; k++) {
        const double pk = a[p][k], qk = a[q][k];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
    }
}

/* The eigenvalues of M^T M by Jacobi's method; eight sweeps are more than it needs to converge in double. */
double mat_largest_stretch(const double m[16]) {
    double a[3][3], largest = 0;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++) largest = fmax(largest, fabs(m[4 * c + r]));
    if (!(largest > 0)) return 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            a[i][j] = 0;
            for (int r = 0; r < 3; r++) a[i][j] += m[4 * i + r] / largest * (m[4 * j + r] / largest);
        }
    for (int sweep = 0; sweep < 8; sweep++) {
        rotate(a, 0, 1);
        rotate(a, 0, 2);
        rotate(a, 1, 2);
    }
    return largest * sqrt(fmax(a[0][0], fmax(a[1][1], a[2][2])));
}
