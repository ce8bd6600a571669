/* Smallest enclosing balls. SPDX-License-Identifier: MIT */
#include "pop_sphere.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "core/matrix.h"

enum { MOST = 4 };

static void subtract(const double a[3], const double b[3], double out[3]) {
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

/* Of an acute triangle the circumcentre, else the middle of its longest side. The circumcentre's barycentric weights are
 * a (b + c - a) with a, b, c the squared sides opposite to the corners: none is negative in an acute triangle. */
void ball_centre_of_triangle(const double corners[3][3], double centre[3]) {
    double squared[3], weights[3], sum = 0;
    int longest = 0;
    for (int i = 0; i < 3; i++) {
        double side[3];
        subtract(corners[(i + 1) % 3], corners[(i + 2) % 3], side);
        squared[i] = dot3(side, side);
        if (squared[i] > squared[longest]) longest = i;
    }
    const double all = squared[0] + squared[1] + squared[2];
    const bool acute = all > 2 * squared[longest] * (1 + 1e-12);
    for (int i = 0; i < 3; i++) {
        weights[i] = acute ? squared[i] / all * (1 - 2 * squared[i] / all) : i != longest;
        sum += weights[i];
    }
    for (int k = 0; k < 3; k++) {
        const double a = corners[0][k];
        centre[k] = a + (weights[1] * (corners[1][k] - a) + weights[2] * (corners[2][k] - a)) / sum;
    }
}

double ball_radius_around(const double centre[3], const struct ball *balls, int count) {
    double radius = 0;
    for (int i = 0; i < count; i++) {
        double d[3];
        subtract(balls[i].centre, centre, d);
        radius = fmax(radius, length3(d) + balls[i].radius);
    }
    return radius * (1 + 1e-14);
}

/* Solves the symmetric g x = b of n <= 3 unknowns by Cramer's rule; false if g is singular for what the numbers are worth. */
static bool solve(const double g[3][3], const double b[3], int n, double x[3]) {
    double scale = 1;
    for (int i = 0; i < n; i++) scale *= g[i][i];
    if (n == 1) {
        x[0] = b[0] / g[0][0];
        return scale > 0;
    }
    if (n == 2) {
        const double det = g[0][0] * g[1][1] - g[0][1] * g[0][1];
        x[0] = (b[0] * g[1][1] - b[1] * g[0][1]) / det;
        x[1] = (b[1] * g[0][0] - b[0] * g[0][1]) / det;
        return det > 1e-14 * scale;
    }
    double m[9], inverse[3][3];
    for (int i = 0; i < 9; i++) m[i] = g[i / 3][i % 3];
    cross3(m + 3, m + 6, inverse[0]);
    cross3(m + 6, m, inverse[1]);
    cross3(m, m + 3, inverse[2]);
    const double det = dot3(m, inverse[0]);
    for (int i = 0; i < 3; i++) x[i] = dot3(inverse[i], b) / det;
    return det > 1e-14 * scale;
}

/* The balls that touch all of the `support` from outside, centre in the span of their centres: up to two. With x the centre and d_i
 * the other centres, relative to the first, |x| = R - r_0 and |x - d_i| = R - r_i; subtracting squares,
 *     x.d_i = (|d_i|^2 + r_0^2 - r_i^2) / 2 + R (r_i - r_0),
 * linear in x and R, so x = p + R q, and |p + R q|^2 = (R - r_0)^2. (Fischer and Gaertner 2003, section 3.) */
static int touching_balls(const struct ball *const *support, int count, struct ball out[2]) {
    const double r0 = support[0]->radius;
    const int n = count - 1;
    double d[3][3], g[3][3], constant[3], linear[3], a[3], b[3], p[3] = {0, 0, 0}, q[3] = {0, 0, 0};
    for (int i = 0; i < n; i++) {
        const double r = support[i + 1]->radius;
        subtract(support[i + 1]->centre, support[0]->centre, d[i]);
        constant[i] = (dot3(d[i], d[i]) + (r0 - r) * (r0 + r)) / 2;
        linear[i] = r - r0;
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) g[i][j] = dot3(d[i], d[j]);
    if (!solve((const double(*)[3])g, constant, n, a) || !solve((const double(*)[3])g, linear, n, b)) return 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) {
            p[k] += a[i] * d[i][k];
            q[k] += b[i] * d[i][k];
        }
    const double A = dot3(q, q) - 1, B = dot3(p, q) + r0, C = dot3(p, p) - r0 * r0;
    const double root = sqrt(fmax(B * B - A * C, 0)), far = -(B < 0 ? B - root : B + root);
    const double radii[2] = {far / A, C / far};
    int found = 0;
    for (int i = 0; i < 2; i++) {
        if (!isfinite(radii[i])) continue;
        out[found].radius = radii[i];
        for (int k = 0; k < 3; k++) out[found].centre[k] = support[0]->centre[k] + p[k] + radii[i] * q[k];
        found++;
    }
    return found;
}

/* Supports as sets of bits, small ones first: of the first so many balls, those below 1 << count. */
static const unsigned char supports[] = {1, 2, 4, 8, 3, 5, 6, 9, 10, 12, 7, 11, 13, 14, 15};

/* The smallest ball around some of them touches those from outside and holds the others. Supports are tried; of each what counts is
 * the centre, and the radius that this needs: so rounding and degenerate cases cannot make it too small. A ball that is the
 * smallest around one or two, and holds all, is what is sought. */
struct ball ball_around(const struct ball *balls, int count) {
    const double exact = 1 + 1e-12;
    struct ball best = {.radius = INFINITY};
    for (size_t s = 0; s < sizeof supports; s++) {
        const struct ball *support[MOST] = {balls};
        struct ball tried[2];
        int members = 0, found = 1;
        if (supports[s] >= 1u << count) continue;
        for (int i = 0; i < count; i++)
            if (supports[s] >> i & 1) support[members++] = &balls[i];
        if (members == 1) tried[0] = *support[0];
        else found = touching_balls(support, members, tried);
        for (int i = 0; i < found; i++) {
            const double needed = ball_radius_around(tried[i].centre, balls, count);
            if (!(needed < best.radius)) continue;
            best = tried[i];
            best.radius = needed;
            if (members <= 2 && needed <= tried[i].radius * exact) return best;
        }
    }
    return best;
}
