/* From a view to what is asked of nodes. SPDX-License-Identifier: MIT */
#include "question.h"

static float largest_component_sum(const double n[3]) {
    return (float)((fabs(n[0]) + fabs(n[1]) + fabs(n[2])) * (1 + 1e-6));
}

/* per_radius: what a splat of unit radius reaches beyond its centre. A node within has both less room and less radius than its
 * ancestor, so the larger of the two holds for all below. */
static struct side make_side(const struct affine *f, enum question_bound bound, double per_radius, double per_w) {
    struct side s = {.offset = (float)f->offset, .own_reach = (float)(per_radius * (1 + 1e-6)), .per_w = (float)per_w};
    for (int k = 0; k < 3; k++) s.normal[k] = (float)f->normal[k];
    s.reach = fmaxf(bound == BOUND_CUBE ? largest_component_sum(f->normal) : (float)(f->slope * (1 + 1e-6)), s.own_reach);
    return s;
}

/* The largest radius, over w, of which points draw a splat for certain. */
static double largest_point(const struct sight *sight, const struct cut_view *view) {
    const double limit = view->point_limit * (1 - 1e-4);
    if (!view->discs) {
        if (view->size_minimum >= limit) return -1;
        if (view->size_maximum < limit || !(view->size_per_radius > 0)) return FLT_MAX;
        return limit / view->size_per_radius;
    }
    /* As cloud_cut has it: size(R) = R slope / (1 - R^2 w_slope^2) + ..., which grows with R. */
    double low = 0, high = sight->w_slope > 0 ? sqrt(view->largest_spread) / sight->w_slope : FLT_MAX;
    if (!(sight->w_slope > 0)) low = sight->size_slope > 0 ? (limit - 2 * view->spread - 0.2) / sight->size_slope : FLT_MAX;
    for (int i = 0; i < 60 && sight->w_slope > 0; i++) {
        const double middle = (low + high) / 2, spread = middle * middle * sight->w_slope * sight->w_slope;
        const double size = middle * sight->size_slope / (1 - spread) + 2 * view->spread + 0.2;
        if (spread < view->largest_spread && size < limit) low = middle;
        else high = middle;
    }
    if (!(low > sight->radius_per_w)) return -1;
    return view->reach_per_radius > 0 ? low / view->reach_per_radius : FLT_MAX;
}

static void ask_for_pixels(const struct cut_view *view, const struct sight *sight, struct pixels *pixels) {
    const struct cut_guard *guard = &view->guard;
    const double pixels_per_unit = view->node_size_per_radius; /* at w = 1 */
    pixels->are_known = view->discs && view->spread == 0 && guard->turn == 0 && guard->move == 0 && guard->eye == 0;
    for (int i = 0; i < 2; i++) pixels->are_known &= view->viewport[i] >= 1 && view->viewport[i] <= 1 << 20;
    pixels->scale = (float)(view->size_per_radius / pixels_per_unit * (1 + 1e-5));
    pixels->least = (float)(view->size_minimum / pixels_per_unit * (1 + 1e-5));
    pixels->w_slope = (float)(sight->rows[3].slope * (1 + 1e-6));
    for (int i = 0; i < 2; i++) {
        pixels->rows[i] = make_side(&sight->rows[i], BOUND_BALL, 0, 0);
        pixels->half[i] = (float)view->viewport[i] / 2;
    }
}

void question_ask(const struct cut_view *view, double radius, enum question_bound bound, struct question *q) {
    struct sight sight;
    sight_prepare(view, &sight);
    *q = (struct question){.inside_count = sight.inside_count, .culls = view->culls};
    double error = 0;
    for (int i = 0; i < 4; i++) error += sight.rows[i].slope * 2 * radius + fabs(sight.rows[i].offset);
    q->error = (float)(16 * FLT_EPSILON * error);
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        q->outside[i] = make_side(&sight.outside[i], bound, sight.per_radius[i], 0);
        q->wider[i] = make_side(&sight.wider[i], bound, sight.per_radius[i], 0);
    }
    for (int i = 0; i < sight.inside_count; i++) {
        q->inside[i] = make_side(&sight.inside[i], bound, 0, sight.inside_per_w[i]);
        q->inside[i].reach += (float)sight.inside_per_radius[i] * (1 + 1e-6f);
    }
    q->w = make_side(&sight.rows[3], bound, 0, 0);
    q->size = (float)view->node_size_per_radius;
    q->point_cost = (float)view->point_cost;
    q->threshold = view->threshold > 0 ? (float)view->threshold : -1; /* 0: not even nodes without extent */
    q->edge = view->discs && view->edge > 0 ? (float)fmin(view->edge, (double)FLT_MAX) : FLT_MAX;
    q->point = (float)fmin(largest_point(&sight, view), (double)FLT_MAX) * (1 - 1e-5f);
    q->w_kept = (float)sight.w_kept * (1 - 1e-6f);
    q->w_least = (float)sight.w_lost;
    q->w_lost = (float)sight.w_lost * (1 + 1e-6f) + q->error;
    for (int k = 0; k < 4; k++) q->eye[k] = (float)view->eye[k];
    q->eye_room = (float)view->guard.eye * (1 + 1e-6f);
    ask_for_pixels(view, &sight, &q->pixels);
    q->corner = bound == BOUND_CUBE ? 1.7321f : 1 + 1e-6f; /* half the diagonal */
}
