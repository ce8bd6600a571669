/* Block culling of a whole cloud. SPDX-License-Identifier: MIT */
#include "cloud.h"

#include <float.h>

#include "core/matrix.h"

/* How far the vertex stage's float clip coordinates may be off in a block: it computes with the chunk's matrix and positions
 * relative to the chunk's origin, each rounded, in sums of four products. */
static double float_error(const struct sight *sight, const struct block *block, const struct chunk *chunk) {
    double offset[3], sum = 0;
    for (int k = 0; k < 3; k++) offset[k] = block->centre[k] - chunk->origin[k];
    const double reach = length3(offset) + block->radius;
    for (int i = 0; i < 4; i++) {
        const struct affine *row = &sight->rows[i];
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
static double largest_size(const struct sight *sight, const struct cut_view *view, const struct block *block, double nearest_w) {
    if (!view->discs)
        return fmin(fmax(view->size_per_radius * block->largest_splat / nearest_w, view->size_minimum), view->size_maximum);
    const double radius = fmax(view->reach_per_radius * block->largest_splat / nearest_w, sight->radius_per_w); /* at w = 1 */
    const double spread = radius * radius * sight->w_slope * sight->w_slope;
    return spread < view->largest_spread ? radius * sight->size_slope / (1 - spread) + 2 * view->spread + 0.2 : INFINITY;
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

enum cloud_where cloud_classify(const struct sight *sight, const struct cut_view *view, const struct block *block,
                                const struct chunk *chunk) {
    const double error = float_error(sight, block, chunk);
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double room = sight->per_radius[i] * block->largest_splat + error;
        if (largest(&sight->outside[i], block) + room < 0 && largest(&sight->wider[i], block) + room < 0) return CLOUD_OUTSIDE;
    }
    if (view->culls && faces_away(view, block)) return CLOUD_OUTSIDE;
    const double nearest_w = smallest(&sight->rows[3], block) - error;
    if (!(nearest_w > 0)) return CLOUD_NEEDS_QUADS;
    const double farthest_w = largest(&sight->rows[3], block);
    for (int i = 0; i < sight->inside_count; i++) {
        const double room = sight->inside_per_radius[i] * block->largest_splat + sight->inside_per_w[i] * farthest_w + error;
        if (smallest(&sight->inside[i], block) - room < 0) return CLOUD_NEEDS_QUADS;
    }
    return largest_size(sight, view, block, nearest_w) < view->point_limit * (1 - 1e-4) ? CLOUD_POINTS_ONLY : CLOUD_NEEDS_QUADS;
}

pbr_result cloud_cut(pbr_instance *instance, const struct blocks *blocks, const struct cut_view *view, struct draw_list *list) {
    struct sight sight;
    sight_prepare(view, &sight);
    for (uint32_t i = 0; i < blocks->block_count; i++) {
        const struct block *block = &blocks->blocks[i];
        const enum cloud_where where = cloud_classify(&sight, view, block, &blocks->chunks[block->chunk]);
        list->visited++;
        if (where == CLOUD_OUTSIDE) {
            list->culled += block->count;
            continue;
        }
        struct draw_range range = {block->chunk, block->first, block->count, where == CLOUD_NEEDS_QUADS};
        pbr_result result = draw_list_add(instance, list, range);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}
