/* Normal fields by least squares.
 *
 * With x_j = ((p_j - p).t, (p_j - p).b) / h the place of a neighbour over the tangent plane and y_j = (n_j.t, n_j.b) the tangential
 * part of its unit normal, G is the 2x2 matrix for which
 *     sum_j w_j |y_j - G x_j|^2 + DAMPING |G|^2,  w_j = exp(-2 |p_j - p|^2 / h^2),
 * is least; A and B are r/h times its columns. h is the larger of the radius and the distance of the neighbour of middle rank, so
 * half of the neighbours lie within it, however small the radii, and those far beyond it, where samples end, do not count.
 *
 * Why y_j as it is, not divided by n_j.n: on a sphere of radius R a neighbour at the angle a lies at R sin a, where y is sin a. So
 * G is h/R at any distance, and n + offset / R is the normal at the sphere's point nearest to that of the disc: exact, likewise on
 * cylinders. Nor can y exceed 1, however the neighbour leans.
 *
 * Neighbours of another sheet do not count: those whose normals lean away by more than 78 degrees, as on the back of a plate, and
 * those farther than h/2 from the tangent plane.
 *
 * DAMPING is as if a neighbour of this weight, h away on either axis, had the point's own normal. It takes 0.3 % off the field of
 * evenly spread neighbours, makes the equations regular, and lets the field vanish in directions in which neighbours tell nothing:
 * all, where there are none or they coincide; one, where they lie on a line. SPDX-License-Identifier: MIT */
#include "normal_field.h"

#include <math.h>
#include <pbr/support.h>

#include "matrix.h"
#include "neighbours.h"
#include "splat.h"

enum { DEFAULT_NEIGHBOURS = 12 };

#define DAMPING (1.0 / 512)
#define MOST_HEIGHT 0.5 /* of neighbours that count over the tangent plane, in h */

/* ---- Storage ---- */

/* The most by which a 2x2 matrix stretches a vector: its larger singular value. */
static double largest_stretch(const double a[2], const double b[2]) {
    return (hypot(a[0] + b[1], a[1] - b[0]) + hypot(a[0] - b[1], a[1] + b[0])) / 2;
}

void normal_field_encode(const double a[2], const double b[2], struct normal_field *out) {
    const double turn = largest_stretch(a, b), scale = fmin(1, NORMAL_FIELD_MOST / turn) / NORMAL_FIELD_UNIT;
    for (int k = 0; k < 2; k++) {
        out->a[k] = (int16_t)lrint(a[k] * scale);
        out->b[k] = (int16_t)lrint(b[k] * scale);
    }
}

/* ---- Fitting ---- */

struct fit {
    const pbr_points *points;
    struct normal_field *out;
};

/* Zero for none: no cosine of it is enough for NORMAL_FIELD_LEAST_COSINE. */
static void find_normal(const pbr_points *points, uint64_t i, double out[3]) {
    float n[3];
    splat_decode_normal(points->normals[i], n);
    for (int k = 0; k < 3; k++) out[k] = (double)n[k];
}

static void add_neighbour(struct normal_moments *m, double weight, const double x[2], const double y[2]) {
    m->xx += weight * x[0] * x[0];
    m->xy += weight * x[0] * x[1];
    m->yy += weight * x[1] * x[1];
    for (int k = 0; k < 2; k++) {
        m->t[k] += weight * x[k] * y[0];
        m->b[k] += weight * x[k] * y[1];
    }
}

/* Both rows of G by Cramer's rule; the determinant is at least DAMPING^2. */
void normal_field_solve(const struct normal_moments *m, double ratio, struct normal_field *out) {
    const double xx = m->xx + DAMPING, yy = m->yy + DAMPING, scale = ratio / (xx * yy - m->xy * m->xy);
    const double a[2] = {scale * (yy * m->t[0] - m->xy * m->t[1]), scale * (yy * m->b[0] - m->xy * m->b[1])};
    const double b[2] = {scale * (xx * m->t[1] - m->xy * m->t[0]), scale * (xx * m->b[1] - m->xy * m->b[0])};
    normal_field_encode(a, b, out);
}

static void fit_one(void *user, uint64_t point, uint32_t found, const double *squared_distances, const uint64_t *indices) {
    const struct fit *fit = user;
    const pbr_points *points = fit->points;
    const double r = (double)points->radii[point];
    double p[3], n[3], t[3], b[3];
    if (!(r > 0) || found == 0) return;
    points_position(points, point, p);
    find_normal(points, point, n);
    disc_tangents(n, t, b);
    const double h = fmax(r, sqrt(squared_distances[found / 2]));
    struct normal_moments moments = {0};
    for (uint32_t j = 0; j < found; j++) {
        double to[3], other[3];
        points_position(points, indices[j], to);
        for (int k = 0; k < 3; k++) to[k] = (to[k] - p[k]) / h;
        find_normal(points, indices[j], other);
        if (dot3(other, n) <= NORMAL_FIELD_LEAST_COSINE || fabs(dot3(to, n)) > MOST_HEIGHT) continue;
        const double x[2] = {dot3(to, t), dot3(to, b)}, y[2] = {dot3(other, t), dot3(other, b)};
        add_neighbour(&moments, exp(-2 * dot3(to, to)), x, y);
    }
    normal_field_solve(&moments, r / h, &fit->out[point]);
}

pbr_result normal_field_fit(const pbr_points *points, uint32_t neighbours, const struct progress *progress,
                            struct normal_field *out) {
    struct fit fit = {points, out};
    struct kd_tree *tree;
    for (uint64_t i = 0; i < points->count; i++) out[i] = (struct normal_field){{0, 0}, {0, 0}};
    if (!points->normals || !points->radii) return PBR_OK;
    pbr_result result = kd_tree_create(points, progress, &tree);
    if (result == PBR_OK) result = kd_tree_for_each(tree, neighbours ? neighbours : DEFAULT_NEIGHBOURS, progress, fit_one, &fit);
    kd_tree_destroy(points, tree);
    return result;
}

pbr_result pbr_points_fit_fields(const pbr_points *points, pbr_progress_fn progress, void *progress_user, int16_t *fields) {
    const struct progress report = {progress, progress_user};
    if (!points || !fields) return PBR_ERROR_INVALID_ARGUMENT;
    return normal_field_fit(points, 0, &report, (struct normal_field *)fields); /* four of them, and nothing else */
}
