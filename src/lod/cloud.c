/* Block culling of a whole cloud. SPDX-License-Identifier: MIT */
#include "cloud.h"

#include <float.h>

#include "core/matrix.h"

enum { OUTSIDE_TESTS = 7, INSIDE_TESTS = 6 };

/* value(p) = normal . p + offset, affine in object space. */
struct affine {
    double normal[3], offset, slope; /* slope = |normal| */
};

struct tests {
    /* A block is outside if one of these, and the same with `wider`, is below 0 in all of its sphere, with room for the splats. */
    struct affine outside[OUTSIDE_TESTS], wider[OUTSIDE_TESTS];
    double per_radius[OUTSIDE_TESTS]; /* added per unit of splat radius */
    /* Every splat is drawn by a point if all of these are above 0 in all of its sphere: the sides, and for splats that spread near
     * and far. */
    struct affine inside[INSIDE_TESTS];
    double inside_per_radius[INSIDE_TESTS], inside_per_w[INSIDE_TESTS];
    int inside_count;
    struct affine rows[4]; /* x, y, z, w */
    double size_slope;     /* discs: pixels x w of a diameter per eye unit, at most, within the view */
    double w_slope;        /* discs: w per eye unit */
    double radius_per_w;   /* discs: smallest radius, eye units, at w = 1 */
};

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
static void prepare_billboards(const struct cut_view *view, struct tests *tests) {
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double axis = i < 4 ? view->viewport[i / 2] : 0;
        tests->outside[i] = plane(view->to_clip, view, i, (i < 4 ? view->size_minimum / axis : 0) + 1e-5);
        tests->wider[i] = tests->outside[i];
        tests->per_radius[i] = i < 4 ? view->size_per_radius / axis : 0;
    }
}

/* A disc lies in a sphere of radius R = reach r, or lo w / (2 f) where that is more: a plane is not nearer than its value at the
 * centre less R times its slope in eye space. The latter holds before the eye only, w > 0: so both are asked. */
static void prepare_discs(const struct cut_view *view, struct tests *tests) {
    const double pixels = view->size_per_radius / view->reach_per_radius; /* diameter of unit radius in eye space */
    tests->radius_per_w = pixels > 0 ? view->size_minimum / pixels : 0;
    tests->w_slope = plane(view->projection, view, 6, 0).slope;
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double beyond = i < 4 ? 2 * view->spread / view->viewport[i / 2] : 0;
        const double slope = plane(view->projection, view, i, beyond).slope;
        tests->outside[i] = plane(view->to_clip, view, i, 0);
        tests->wider[i] = plane(view->to_clip, view, i, 1e-5 + slope * tests->radius_per_w + beyond);
        tests->per_radius[i] = slope * view->reach_per_radius;
        if (i >= 4) continue; /* of near and far the centres decide */
        tests->inside_per_radius[i] = tests->per_radius[i];
        tests->inside_per_w[i] = slope * tests->radius_per_w + beyond;
        /* Within the view |x| <= w, so a change of x / w is at most the rows' slopes together. */
        if (i % 2 == 0)
            tests->size_slope =
                fmax(tests->size_slope, view->viewport[i / 2] * (combine(view->projection, i / 2, 1, 0).slope + tests->w_slope));
    }
}

static void prepare(const struct cut_view *view, struct tests *tests) {
    const double well = -2e-4; /* within the vertex stage's own margin, with float error to spare */
    *tests = (struct tests){0};
    tests->inside_count = view->spread > 0 ? INSIDE_TESTS : 4;
    for (int i = 0; i < tests->inside_count; i++) tests->inside[i] = plane(view->to_clip, view, i, i < 4 ? well : 0);
    for (int i = 0; i < 4; i++) tests->rows[i] = combine(view->to_clip, i, i < 3, i == 3);
    if (view->discs) prepare_discs(view, tests);
    else prepare_billboards(view, tests);
}

enum where { OUTSIDE, NEEDS_QUADS, POINTS_ONLY };

/* How far the vertex stage's float clip coordinates may be off in a block: it computes with the chunk's matrix and positions
 * relative to the chunk's origin, each rounded, in sums of four products. */
static double float_error(const struct tests *tests, const struct block *block, const struct chunk *chunk) {
    double offset[3], sum = 0;
    for (int k = 0; k < 3; k++) offset[k] = block->centre[k] - chunk->origin[k];
    const double reach = length3(offset) + block->radius;
    for (int i = 0; i < 4; i++) {
        const struct affine *row = &tests->rows[i];
        sum += row->slope * reach + fabs(dot3(row->normal, chunk->origin) + row->offset);
    }
    return 8 * FLT_EPSILON * sum;
}

/* The largest value of f in a block's sphere. */
static double largest(const struct affine *f, const struct block *block) {
    return dot3(f->normal, block->centre) + f->offset + f->slope * block->radius;
}
static double smallest(const struct affine *f, const struct block *block) {
    return dot3(f->normal, block->centre) + f->offset - f->slope * block->radius;
}

/* Of a block whose splats all have w >= nearest_w > 0: the largest diameter in pixels, infinite where one may touch the plane of
 * the eye. */
static double largest_size(const struct tests *tests, const struct cut_view *view, const struct block *block, double nearest_w) {
    if (!view->discs)
        return fmin(fmax(view->size_per_radius * block->largest_splat / nearest_w, view->size_minimum), view->size_maximum);
    const double radius = fmax(view->reach_per_radius * block->largest_splat / nearest_w, tests->radius_per_w); /* at w = 1 */
    const double spread = radius * radius * tests->w_slope * tests->w_slope;
    return spread < view->largest_spread ? radius * tests->size_slope / (1 - spread) + 2 * view->spread + 0.2 : INFINITY;
}

/* Whether all splats of the block face away, give or take what the vertex stage's floats may. The largest n.v over a cone around
 * the axis, half angle t, is |v| cos(a - t), a the angle from axis to v; from p to the eye v differs by the radius at most. */
static bool faces_away(const struct cut_view *view, const struct block *block) {
    const double sine = sqrt(fmax(1 - (double)block->cone * (double)block->cone, 0));
    double to_eye[3], along = 0;
    for (int k = 0; k < 3; k++) {
        to_eye[k] = view->eye[3] != 0 ? view->eye[k] / view->eye[3] - block->centre[k] : view->eye[k];
        along += to_eye[k] * (double)block->axis[k];
    }
    double beside[3];
    for (int k = 0; k < 3; k++) beside[k] = to_eye[k] - along * (double)block->axis[k];
    const double distance = length3(to_eye), across = length3(beside);
    const double reach = view->eye[3] != 0 ? (double)block->radius : 0;
    if (!(block->cone > -1) || along >= distance * (double)block->cone) return false;
    return along * (double)block->cone + across * sine + reach < -1e-4 * (distance + reach);
}

static enum where classify(const struct tests *tests, const struct cut_view *view, const struct block *block,
                           const struct chunk *chunk) {
    const double error = float_error(tests, block, chunk);
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double room = tests->per_radius[i] * block->largest_splat + error;
        if (largest(&tests->outside[i], block) + room < 0 && largest(&tests->wider[i], block) + room < 0) return OUTSIDE;
    }
    if (view->culls && faces_away(view, block)) return OUTSIDE;
    const double nearest_w = smallest(&tests->rows[3], block) - error;
    if (!(nearest_w > 0)) return NEEDS_QUADS;
    const double farthest_w = largest(&tests->rows[3], block);
    for (int i = 0; i < tests->inside_count; i++) {
        const double room = tests->inside_per_radius[i] * block->largest_splat + tests->inside_per_w[i] * farthest_w + error;
        if (smallest(&tests->inside[i], block) - room < 0) return NEEDS_QUADS;
    }
    return largest_size(tests, view, block, nearest_w) < view->point_limit * (1 - 1e-4) ? POINTS_ONLY : NEEDS_QUADS;
}

pbr_result cloud_cut(pbr_instance *instance, const struct blocks *blocks, const struct cut_view *view, struct draw_list *list) {
    struct tests tests;
    prepare(view, &tests);
    for (uint32_t i = 0; i < blocks->block_count; i++) {
        const struct block *block = &blocks->blocks[i];
        enum where where = classify(&tests, view, block, &blocks->chunks[block->chunk]);
        list->visited++;
        if (where == OUTSIDE) {
            list->culled += block->count;
            continue;
        }
        struct draw_range range = {block->chunk, block->first, block->count, where == NEEDS_QUADS};
        pbr_result result = draw_list_add(instance, list, range);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}
