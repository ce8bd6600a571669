/* From matrices to planes. SPDX-License-Identifier: MIT */
#include "sight.h"

#include <string.h>

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

/* ---- Guards ---- */

/* f + widen w + shift */
static void loosen(struct affine *f, const struct affine *w, double widen, double shift) {
    for (int k = 0; k < 3; k++) f->normal[k] += widen * w->normal[k];
    f->offset += widen * w->offset + shift;
    f->slope = length3(f->normal);
}

/* Largest distance from the eye over w, of what lies within the view and half of its size around it. */
static double reach_of_view(const double projection[16]) {
    double inverse[16], longest = 0;
    if (!matrix_inverse(projection, inverse)) return INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        const double clip[4] = {corner & 1 ? 1.5 : -1.5, corner & 2 ? 1.5 : -1.5, corner & 4 ? 1 : -1, 1};
        double eye[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 4; c++) eye[k] += inverse[4 * c + k] * clip[c];
        longest = fmax(longest, length3(eye));
    }
    return longest;
}

/* w shrinks by no more than this fraction when the eye space turns. */
static double w_turned(const struct cut_view *view, double turn) {
    return turn == 0 ? 0 : turn * reach_of_view(view->projection) * plane(view->projection, view, 6, 0).slope;
}

/* A point p of eye space moves by at most turn |p| + move, and |p| <= reach w, now as w was then, at least (1 - e) of which is
 * left: e = w_turned. A plane's value changes by its slope times that. A disc of radius R is seen by a point q of it, so its centre
 * is within |q| + R, where w(q) <= w + slope of w times R. */
static void apply_guard(const struct cut_view *view, struct sight *sight) {
    const struct cut_guard *guard = &view->guard;
    const double turned = w_turned(view, guard->turn), left = fmax(1 - turned, 0.5), turn = guard->turn;
    const double widen = turn > 0 ? turn * reach_of_view(view->projection) / left : 0, shift = guard->move / left;
    const double w_slope = plane(view->projection, view, 6, 0).slope;
    const struct affine *w = &sight->rows[3];
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double side = i < 4 ? 2 * guard->jitter[i / 2] / view->viewport[i / 2] : 0;
        const double slope = /* convex in how far it is widened, which is less than half the view */
            fmax(plane(view->projection, view, i, -1e-3).slope, plane(view->projection, view, i, 0.5).slope);
        loosen(&sight->outside[i], w, slope * widen + side, slope * shift);
        loosen(&sight->wider[i], w, slope * widen + side, slope * shift);
        sight->per_radius[i] += slope * (2 * turn + widen * (1 + turn) * w_slope) * view->reach_per_radius;
        if (i < sight->inside_count) loosen(&sight->inside[i], w, -slope * widen - side, -slope * shift);
        if (i < INSIDE_TESTS) sight->inside_per_w[i] /= left;
    }
    sight->w_kept = left;
    sight->w_lost = w_slope * guard->move;
}

void sight_prepare(const struct cut_view *view, struct sight *sight) {
    const double well = -2e-4; /* within the vertex stage's own margin, with float error to spare */
    *sight = (struct sight){0};
    sight->inside_count = view->spread > 0 ? INSIDE_TESTS : 4;
    for (int i = 0; i < sight->inside_count; i++) sight->inside[i] = plane(view->to_clip, view, i, i < 4 ? well : 0);
    for (int i = 0; i < 4; i++) sight->rows[i] = combine(view->to_clip, i, i < 3, i == 3);
    if (view->discs) prepare_discs(view, sight);
    else prepare_billboards(view, sight);
    static const struct cut_guard none;
    sight->w_kept = 1;
    if (memcmp(&view->guard, &none, sizeof none) != 0) apply_guard(view, sight);
}

/* Equal but for the rounding of a camera's matrices; then `a` becomes `b`. */
static void unite(double *a, double b) {
    if (fabs(*a - b) <= 1e-5 * fabs(b)) *a = b;
}

/* The motion from one view to another: as its guard must be that lets the first one's cut serve the second. `near`: how far splats
 * move at most. False if they do not keep their distances, or differ in something else than the threshold and its edge. */
static bool find_motion(const struct cut_view *from, const struct cut_view *to, double radius, struct cut_guard *motion,
                        double *near) {
    struct cut_view a, b;
    double back[16], m[16], squared = 0, error = 0, eye[3], centre[3], normal[3];
    memcpy(&a, from, sizeof a), memcpy(&b, to, sizeof b); /* padding included */
    memset(a.to_clip, 0, sizeof a.to_clip), memset(b.to_clip, 0, sizeof b.to_clip);
    memset(a.to_eye, 0, sizeof a.to_eye), memset(b.to_eye, 0, sizeof b.to_eye);
    memset(a.eye, 0, 3 * sizeof *a.eye), memset(b.eye, 0, 3 * sizeof *b.eye);
    a.guard = b.guard = (struct cut_guard){0};
    a.threshold = b.threshold, a.edge = b.edge;
    unite(&a.size_per_radius, b.size_per_radius);
    unite(&a.reach_per_radius, b.reach_per_radius);
    unite(&a.node_size_per_radius, b.node_size_per_radius);
    if (memcmp(&a, &b, sizeof a) != 0) return false;
    *motion = (struct cut_guard){.jitter = {to->guard.jitter[0], to->guard.jitter[1]}};
    *near = 0;
    if (memcmp(from->to_eye, to->to_eye, sizeof from->to_eye) == 0) return true;
    if (!matrix_inverse(from->to_eye, back)) return false;
    matrix_multiply(to->to_eye, back, m);
    for (int c = 0; c < 3; c++) {
        for (int d = 0; d <= c; d++) error = fmax(error, fabs(dot3(m + 4 * c, m + 4 * d) - (c == d)));
        for (int r = 0; r < 3; r++) squared += (m[4 * c + r] - (c == r)) * (m[4 * c + r] - (c == r));
        eye[c] = to->eye[c] - from->eye[c];
        centre[c] = to->to_eye[12 + c] - from->to_eye[12 + c];
    }
    cross3(m, m + 4, normal);
    if (!(error <= 1e-5) || !(dot3(normal, m + 8) > 0)) return false;
    /* |R - I| of a turn by t: 2 sin(t / 2) as a factor of lengths, and 8 sin(t / 2)^2 as the sum of all squares. */
    motion->turn = sqrt(squared / 2) + 2 * error;
    motion->move = length3(m + 12);
    motion->eye = length3(eye);
    *near = length3(centre) + motion->turn * sqrt(3) * radius * matrix_largest_stretch(from->to_eye);
    return true;
}

bool cut_view_covers(const struct cut_view *made, const struct cut_view *now, double radius) {
    const struct cut_guard *guard = &made->guard;
    struct cut_guard motion;
    double near;
    if (!find_motion(made, now, radius, &motion, &near)) return false;
    if (motion.eye > guard->eye || motion.jitter[0] > guard->jitter[0] || motion.jitter[1] > guard->jitter[1]) return false;
    return near <= guard->move || (motion.turn <= guard->turn && motion.move <= guard->move);
}

/* Whether half of the view around it is room enough for what splats and jitter reach beyond it. */
static bool is_wide_enough(const struct cut_view *view) {
    const double beyond = 2 * view->spread + view->size_minimum + 2 * fmax(view->guard.jitter[0], view->guard.jitter[1]);
    return beyond <= 0.25 * fmin(view->viewport[0], view->viewport[1]);
}

double cut_view_foresee(const struct cut_view *last, double radius, double nearness, int most_frames, struct cut_view *now) {
    const double most = 0.2; /* of the picture's size, that the guard adds on each side */
    struct cut_guard motion;
    const double distance = length3(now->to_eye + 12);
    double near, steepest = 0;
    if (!is_wide_enough(now) || !find_motion(last, now, radius, &motion, &near)) return 0;
    /* Around the hierarchy, rather than around the eye. */
    if (near < motion.move + motion.turn * distance) motion.turn = 0, motion.move = near;
    for (int i = 0; i < 4; i++) steepest = fmax(steepest, plane(now->projection, now, i, 0).slope);
    const double a_frame =
        steepest * (motion.turn > 0 ? motion.turn * reach_of_view(now->projection) : 0) + steepest * motion.move * nearness;
    const double frames = a_frame * most_frames > most ? most / a_frame : most_frames;
    if (!(frames >= 1.5) || w_turned(now, frames * motion.turn) > most) return 0;
    const double rounding = 1e-6; /* a pure turn moves by some, too */
    now->guard.turn = frames * motion.turn;
    now->guard.move = frames * motion.move + rounding * (distance + radius * matrix_largest_stretch(now->to_eye));
    now->guard.eye = frames * motion.eye + rounding * (length3(now->eye) + radius);
    return frames;
}
