/* From matrices to planes. SPDX-License-Identifier: MIT */
#include "sight.h"

#include "core/matrix.h"

/* a row_i + b row_w of the clip matrix. */
static struct affine combine(const double m[16], int i, double a, double b) {
    struct affine f;
    for (int k = 0; k < 3; k++) f.normal[k] = a * m[4 * k + i] + b * m[4 * k + 3];
    f.offset = a * m[12 + i] + b * m[15];
    f.slope = length3(f.normal);
    return f;
}

/* The side planes' first four, then near, far, and w > 0. */
static struct affine plane(const double m[16], const struct cut_view *view, int i, double widen) {
    if (i == 6) return combine(m, 3, 1, 0);
    const double own = i == 4 && view->zero_to_one ? 0 : 1;
    return combine(m, i / 2, i % 2 ? -1 : 1, own + widen);
}

/* A splat at p of diameter d(p) = clamp(s r / w, lo, hi) pixels reaches the view's right side iff x - w <= d w / width; d w <= s r
 * + lo w. All of it is affine in p, so over a sphere the extremes are at the centre -+ radius * slope. Screen-parallel splats lie
 * at their centre's depth: near and far need no room. */
static void prepare_billboards(const struct cut_view *view, struct sight *sight) {
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double axis = i < 4 ? view->viewport[i / 2] : 0;
        sight->outside[i] = plane(view->to_clip, view, i, (i < 4 ? view->size_minimum / axis : 0) + 1e-5);
        sight->wider[i] = sight->outside[i];
        sight->per_radius[i] = i < 4 ? view->size_per_radius / axis : 0;
    }
}

/* A disc lies in a sphere of radius R = reach r, or lo w / (2 f) where that is more: a plane is not nearer than its value at the
 * centre less R times its slope in eye space. The latter holds before the eye only, w > 0: so both are asked. */
static void prepare_discs(const struct cut_view *view, struct sight *sight) {
    const double pixels = view->size_per_radius / view->reach_per_radius; /* diameter of unit radius in eye space */
    sight->radius_per_w = pixels > 0 ? view->size_minimum / pixels : 0;
    sight->w_slope = plane(view->projection, view, 6, 0).slope;
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double beyond = i < 4 ? 2 * view->spread / view->viewport[i / 2] : 0;
        const double slope = plane(view->projection, view, i, beyond).slope;
        sight->outside[i] = plane(view->to_clip, view, i, 0);
        sight->wider[i] = plane(view->to_clip, view, i, 1e-5 + slope * sight->radius_per_w + beyond);
        sight->per_radius[i] = slope * view->reach_per_radius;
        if (i >= 4) continue; /* of near and far the centres decide */
        sight->inside_per_radius[i] = sight->per_radius[i];
        sight->inside_per_w[i] = slope * sight->radius_per_w + beyond;
        /* Within the view |x| <= w, so a change of x / w is at most the rows' slopes together. */
        if (i % 2 == 0)
            sight->size_slope =
                fmax(sight->size_slope, view->viewport[i / 2] * (combine(view->projection, i / 2, 1, 0).slope + sight->w_slope));
    }
}

void sight_prepare(const struct cut_view *view, struct sight *sight) {
    const double well = -2e-4; /* within the vertex stage's own margin, with float error to spare */
    *sight = (struct sight){0};
    sight->inside_count = view->spread > 0 ? INSIDE_TESTS : 4;
    for (int i = 0; i < sight->inside_count; i++) sight->inside[i] = plane(view->to_clip, view, i, i < 4 ? well : 0);
    for (int i = 0; i < 4; i++) sight->rows[i] = combine(view->to_clip, i, i < 3, i == 3);
    if (view->discs) prepare_discs(view, sight);
    else prepare_billboards(view, sight);
}
