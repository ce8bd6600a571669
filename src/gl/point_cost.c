/* What a splat may cost, by timing an item drawn with several point costs (in the way of Cohen, Aliaga, Zhang 2001, who choose
 * between points and triangles by what they cost). SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/render.h>

#include "lod/balance.h"
#include "lod/lod.h"
#include "renderer.h"

enum { ROUNDS = 4 }; /* frames of a cost; the first one cuts, sends and compiles */

struct trial {
    pbr_view *view;
    pbr_frame frame; /* the caller's, but that it waits */
    pbr_item item;
    uint32_t frames; /* so far */
};

/* Each frame lies in a slice of the depth range of its own, before all earlier ones', which then hide nothing of it: nothing has to
 * be cleared. */
static void choose_slice(const struct trial *trial, float range[2]) {
    const bool given = trial->frame.depth_range[0] != 0 || trial->frame.depth_range[1] != 0;
    const float whole[2] = {given ? trial->frame.depth_range[0] : 0, given ? trial->frame.depth_range[1] : 1};
    const float low = fminf(whole[0], whole[1]), height = fabsf(whole[1] - whole[0]), slices = ROUNDS * BALANCE_TRIES;
    const bool nearer_is_larger = trial->frame.flags & PBR_FRAME_REVERSED_Z;
    const float slice = nearer_is_larger ? (float)trial->frames : slices - 1 - (float)trial->frames;
    for (int i = 0; i < 2; i++) range[i] = low + (slice * height + (whole[i] - low)) / slices;
}

/* The quickest of some frames, to the end of the GPU's work. */
static pbr_result time_cost(void *user, float point_cost, double *seconds, uint64_t *splats) {
    struct trial *trial = user;
    const struct gl *gl = &trial->view->renderer->gl;
    pbr_frame frame = trial->frame;
    pbr_stats stats = PBR_STATS_INIT;
    pbr_result result = PBR_OK;
    trial->item.point_cost = point_cost;
    *seconds = INFINITY;
    for (int round = 0; round < ROUNDS && result == PBR_OK; round++, trial->frames++) {
        choose_slice(trial, frame.depth_range);
        (*gl->Finish)();
        const double start = renderer_seconds();
        result = pbr_render(trial->view, &frame, &trial->item, 1, &stats);
        (*gl->Finish)();
        if (round > 0) *seconds = fmin(*seconds, renderer_seconds() - start);
    }
    *splats = stats.splats_drawn;
    return result;
}

pbr_result pbr_view_measure_point_cost(pbr_view *view, const pbr_frame *frame, const pbr_item *item, float *point_cost) {
    if (!view) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = view->renderer->instance;
    struct trial trial = {.view = view};
    if (!frame || !item || !point_cost)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_view_measure_point_cost: frame, item or point_cost is NULL");
    pbr_result result = read_desc(instance, "pbr_frame", frame, sizeof trial.frame, &trial.frame, sizeof trial.frame);
    if (result == PBR_OK) result = read_desc(instance, "pbr_item", item, sizeof trial.item, &trial.item, sizeof trial.item);
    if (result != PBR_OK) return result;
    if (!trial.item.lod || trial.item.lod->kind->kind != PBR_LOD_POP || trial.item.flags & PBR_ITEM_HIDDEN)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_view_measure_point_cost: the item has no hierarchy over a mesh, or is hidden");
    trial.frame.flags |= PBR_FRAME_WAIT;
    trial.frame.time_budget = 0;
    return balance_find(time_cost, &trial, point_cost);
}
