/* Measures of triangles, several at a time. SPDX-License-Identifier: MIT */
#include "triangles.h"

#include <float.h>
#include <math.h>

#include "minmax.h"

/* Growth of radii for tilted discs. Discs that are grown where they jut out are seen at silhouettes, so it stops at sharp edges and
 * at triangles that are large for their mesh. The numbers are a trade, tried on the scans. */
static const double SEEN_FROM = 3.7320508075688773; /* tan 75 degrees: from how far off the face normal */
static const double MOST_BENT = 0.6427876096865394; /* cos 50 degrees: between vertex and face normal */
static const double MOST_GROWTH = 1.3;

static const double PI = 3.14159265358979323846;

/* Loops are compiled twice: where the processor has AVX2 a version for that runs, which takes two thirds of the time. Neither fuses
 * operations, so both give the same numbers (unit.triangles, which has its own EXPORT). The thread sanitizer's build is without
 * (PBR_PLAIN_LOOPS), so that on any machine one of the builds that are tested has them, and one has not. */
#define LOOPS static inline __attribute__((always_inline))
#if defined(EXPORT)
#elif defined(__x86_64__) && !defined(PBR_PLAIN_LOOPS)
#define EXPORT(name, parameters, arguments)                                                                                        \
    __attribute__((target("avx2"))) static void name##_avx2 parameters {                                                           \
        name##_loops arguments;                                                                                                    \
    }                                                                                                                              \
    void name parameters {                                                                                                         \
        if (__builtin_cpu_supports("avx2")) name##_avx2 arguments;                                                                 \
        else name##_loops arguments;                                                                                               \
    }
#else
#define EXPORT(name, parameters, arguments)                                                                                        \
    void name parameters {                                                                                                         \
        name##_loops arguments;                                                                                                    \
    }
#endif

LOOPS double dot(double ax, double ay, double az, double bx, double by, double bz) {
    return ax * bx + ay * by + az * bz;
}

LOOPS void triangles_measure_loops(const lanes corners[3][3], struct triangles *out) {
    for (int i = 0; i < 3; i++) {
        const lanes *from = corners[i], *to = corners[(i + 1) % 3];
        lanes *e = out->edges[i];
        for (int k = 0; k < 3; k++)
            for (int l = 0; l < LANES; l++) e[k][l] = to[k][l] - from[k][l];
        for (int l = 0; l < LANES; l++) out->sides[i][l] = dot(e[0][l], e[1][l], e[2][l], e[0][l], e[1][l], e[2][l]);
    }
    for (int k = 0; k < 3; k++) {
        const double *a = out->edges[0][(k + 1) % 3], *b = out->edges[0][(k + 2) % 3];
        const double *c = out->edges[1][(k + 1) % 3], *d = out->edges[1][(k + 2) % 3];
        for (int l = 0; l < LANES; l++) out->normal[k][l] = a[l] * d[l] - b[l] * c[l];
    }
    lanes *n = out->normal, *side = out->sides;
    lanes least;
    for (int l = 0; l < LANES; l++) {
        out->length[l] = sqrt(dot(n[0][l], n[1][l], n[2][l], n[0][l], n[1][l], n[2][l]));
        least[l] = 8 * DBL_EPSILON * larger(side[0][l], larger(side[1][l], side[2][l]));
    }
    for (int l = 0; l < LANES; l++) out->is_degenerate[l] = !(out->length[l] > least[l]);
}

EXPORT(triangles_measure, (const lanes corners[3][3], struct triangles *out), (corners, out))

/* The angle between the x axis and (x, y), y >= 0, to 1.2e-5 (Hastings 1955, sheet 11). */
LOOPS double angle_of(double y, double x) {
    const double flat = fabs(x), most = larger(y, flat), t = lesser(y, flat) / (most > 0 ? most : 1), s = t * t;
    const double low = t * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))));
    const double acute = y > flat ? PI / 2 - low : low;
    return x < 0 ? PI - acute : acute;
}

LOOPS void triangles_angles_loops(const struct triangles *triangles, lanes out[3]) {
    for (int i = 0; i < 3; i++) {
        const lanes *a = triangles->edges[i], *b = triangles->edges[(i + 2) % 3];
        for (int l = 0; l < LANES; l++)
            out[i][l] = angle_of(triangles->length[l], -dot(a[0][l], a[1][l], a[2][l], b[0][l], b[1][l], b[2][l]));
    }
}

EXPORT(triangles_angles, (const struct triangles *triangles, lanes out[3]), (triangles, out))

/* Of sides that squared are a, b and c, the longest: in an acute triangle the radius of the circumcircle. In an obtuse one the last
 * point covered lies on the longest side, as far from either end as half the other side there over the cosine between them, here by
 * the law of cosines; that of b is the farther one. */
LOOPS void triangles_covering_radius_loops(const struct triangles *triangles, lanes out) {
    const lanes *side = triangles->sides;
    for (int l = 0; l < LANES; l++) {
        const double p = side[0][l], q = side[1][l], r = side[2][l];
        const double a = lesser(p, lesser(q, r)), b = larger(lesser(p, q), lesser(larger(p, q), r)), c = larger(p, larger(q, r));
        const double acute = sqrt(a * b), longest = sqrt(c), twice = 2 * triangles->length[l], obtuse = b + (c - a);
        const bool is_obtuse = a + b <= c;
        const double over = longest * (is_obtuse ? b : acute), under = is_obtuse ? obtuse : twice;
        out[l] = under > 0 ? over / under : 0;
    }
}

EXPORT(triangles_covering_radius, (const struct triangles *triangles, lanes out), (triangles, out))

/* The smallest circle around the corners: the barycentric weights of its centre, and where that is relative to each corner. */
LOOPS void find_centre(const struct triangles *triangles, lanes weights[3], lanes to_centre[3][3]) {
    const lanes *side = triangles->sides;
    for (int l = 0; l < LANES; l++) {
        /* The circumcentre's weights; the side opposite to corner i is the next edge. */
        const double p = side[0][l], q = side[1][l], r = side[2][l];
        const double a = q * (p + r - q), b = r * (p + q - r), c = p * (q + r - p);
        /* In an obtuse triangle the middle of the longest side; of a needle of which rounding leaves one weight, that corner. */
        const bool is_acute = a > 0 && b > 0 && c > 0;
        const double u = is_acute ? a : (a > 0 ? 1 : 0), v = is_acute ? b : (b > 0 ? 1 : 0), w = is_acute ? c : (c > 0 ? 1 : 0);
        const double sum = u + v + w, scale = 1 / (sum > 0 ? sum : 1);
        weights[0][l] = u * scale, weights[1][l] = v * scale, weights[2][l] = w * scale;
    }
    for (int i = 0; i < 3; i++) {
        const int next = (i + 1) % 3, last = (i + 2) % 3;
        for (int k = 0; k < 3; k++)
            for (int l = 0; l < LANES; l++)
                to_centre[i][k][l] = weights[next][l] * triangles->edges[i][k][l] - weights[last][l] * triangles->edges[last][k][l];
    }
}

/* Discs across vertex normals do not lie in the triangle's plane. Let the normal n at the corner p be along m + t, m the face
 * normal and t in the plane; seen along a direction at an angle to m of tangent T, coming from the side of the unit vector w of the
 * plane, a disc of radius r hides x of the triangle iff |P(x - p)| <= r, with P the projection along that direction onto the disc's
 * plane:
 *
 *     |P(x - p)| = |x - p| (1 - T (t.v) (v.w) + O(t^2)), v the unit vector from p to x.
 *
 * Take for x the centre of the smallest circle around the corners, R its radius, l_i its barycentric coordinates: the l_i v_i sum
 * up to 0. Near it, x + e is missed by all discs only if v_i.e > r - |P_i(x - p_i)| for all i. The mean by l_i of the left sides is
 * 0, so r need only be the mean of the right sides' ratios, and for the worst w that is
 *
 *     r / R = 1 + T |sum l_i (t_i.v_i) v_i| + O(t^2).
 *
 * Normals that bend alike, as on a sphere, cancel out: what turns one disc away from the eye turns another towards it. There the
 * discs have a point in common at the mean of 1 / cos of the bends, taken to second order, and no direction sees between them. */
LOOPS void triangles_hiding_radius_loops(const struct triangles *triangles, const lanes normals[3][3], const lanes covering,
                                         lanes out) {
    const lanes *m = triangles->normal;
    lanes weights[3], to_centre[3][3], shift[3] = {{0}}, second = {0}, squared_radius = {0}, straight;
    for (int l = 0; l < LANES; l++) straight[l] = DBL_MAX;
    find_centre(triangles, weights, to_centre);
    for (int i = 0; i < 3; i++) {
        const lanes *n = normals[i];
        lanes *v = to_centre[i];
        for (int l = 0; l < LANES; l++) {
            const double along = dot(n[0][l], n[1][l], n[2][l], m[0][l], m[1][l], m[2][l]);
            const double squared_normal = dot(n[0][l], n[1][l], n[2][l], n[0][l], n[1][l], n[2][l]);
            const double squared = dot(v[0][l], v[1][l], v[2][l], v[0][l], v[1][l], v[2][l]);
            const double aside = dot(n[0][l], n[1][l], n[2][l], v[0][l], v[1][l], v[2][l]);
            const double length = triangles->length[l], weight = weights[i][l], under = along * squared;
            /* (t.v) / |v|: without a weight, and where it is not asked for, anything. */
            const double bend = weight > 0 ? aside * length / (fabs(under) > 0 ? under : 1) : 0;
            straight[l] = lesser(along * along - MOST_BENT * MOST_BENT * squared_normal * length * length, straight[l]);
            for (int k = 0; k < 3; k++) shift[k][l] += weight * bend * v[k][l];
            second[l] += weight * bend * bend * squared / 2;
            squared_radius[l] = larger(weight > 0 ? squared : 0, squared_radius[l]);
        }
    }
    for (int l = 0; l < LANES; l++) {
        const double shifted = sqrt(dot(shift[0][l], shift[1][l], shift[2][l], shift[0][l], shift[1][l], shift[2][l]));
        out[l] = sqrt(squared_radius[l]) * lesser(1 + SEEN_FROM * shifted + second[l], MOST_GROWTH);
    }
    for (int l = 0; l < LANES; l++)
        if (triangles->is_degenerate[l] || !(straight[l] > 0)) out[l] = covering[l];
}

EXPORT(triangles_hiding_radius, (const struct triangles *triangles, const lanes normals[3][3], const lanes covering, lanes out),
       (triangles, normals, covering, out))
