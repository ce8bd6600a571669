/* Block culling of a whole cloud. SPDX-License-Identifier: MIT */
#include "cloud.h"

#include <float.h>

#include "core/matrix.h"

enum { OUTSIDE_TESTS = 7, INSIDE_TESTS = 4 };

/* value(p) = normal . p + offset, affine in object space. */
struct affine {
    double normal[3], offset, slope; /* slope = |normal| */
};

struct tests {
    /* A block is outside if one of these is below 0 in all of its sphere; the side planes have room for the splats' size. */
    struct affine outside[OUTSIDE_TESTS];
    double per_radius[OUTSIDE_TESTS]; /* added per unit of splat radius */
    /* Every centre is well inside the side planes if all of these are above 0 in all of its sphere. */
    struct affine inside[INSIDE_TESTS];
    struct affine rows[4]; /* x, y, z, w */
};

/* a row_i + b row_w of the clip matrix. */
static struct affine combine(const double m[16], int i, double a, double b) {
    struct affine f;
    for (int k = 0; k < 3; k++) f.normal[k] = a * m[4 * k + i] + b * m[4 * k + 3];
    f.offset = a * m[12 + i] + b * m[15];
    f.slope = length3(f.normal);
    return f;
}

/* A splat at p of diameter d(p) = clamp(s r / w, lo, hi) pixels reaches the view's right side iff x - w <= d w / width; d w <= s r
 * + lo w. All of it is affine in p, so over a sphere the extremes are at the centre -+ radius * slope. */
static void prepare(const struct cut_view *view, struct tests *tests) {
    const double *m = view->to_clip;
    const double well = 1 - 2e-4; /* within the vertex stage's own margin, with float error to spare */
    for (int axis = 0; axis < 2; axis++)
        for (int side = 0; side < 2; side++) {
            int i = 2 * axis + side;
            double sign = side ? -1 : 1;
            tests->outside[i] = combine(m, axis, sign, 1 + view->size_minimum / view->viewport[axis] + 1e-5);
            tests->per_radius[i] = view->size_per_radius / view->viewport[axis];
            tests->inside[i] = combine(m, axis, sign, well);
        }
    /* Screen-parallel splats lie at their centre's depth: near and far need no room. */
    tests->outside[4] = combine(m, 2, 1, (view->zero_to_one ? 0 : 1) + 1e-5);
    tests->outside[5] = combine(m, 2, -1, 1 + 1e-5);
    for (int i = 0; i < 4; i++) tests->rows[i] = combine(m, i, i < 3, i == 3);
    tests->outside[6] = tests->rows[3];
    tests->per_radius[4] = tests->per_radius[5] = tests->per_radius[6] = 0;
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

static enum where classify(const struct tests *tests, const struct cut_view *view, const struct block *block,
                           const struct chunk *chunk) {
    const double *c = block->centre;
    const double error = float_error(tests, block, chunk);
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const struct affine *f = &tests->outside[i];
        if (dot3(f->normal, c) + f->offset + f->slope * block->radius + tests->per_radius[i] * block->largest_splat + error < 0)
            return OUTSIDE;
    }
    for (int i = 0; i < INSIDE_TESTS; i++) {
        const struct affine *f = &tests->inside[i];
        if (dot3(f->normal, c) + f->offset - f->slope * block->radius - error < 0) return NEEDS_QUADS;
    }
    const struct affine *w = &tests->rows[3];
    const double nearest_w = dot3(w->normal, c) + w->offset - w->slope * block->radius - error;
    if (!(nearest_w > 0)) return NEEDS_QUADS;
    double largest = fmin(fmax(view->size_per_radius * block->largest_splat / nearest_w, view->size_minimum), view->size_maximum);
    return largest < view->point_limit * (1 - 1e-4) ? POINTS_ONLY : NEEDS_QUADS;
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
