/* What a splat may cost, by timing an item drawn with several point costs (in the way of Cohen, Aliaga, Zhang 2001, who choose
 * between points and triangles by what they cost). SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/render.h>

#include "frame.h"
#include "lod/balance.h"
#include "lod/lod.h"
#include "renderer.h"

enum { ROUNDS = 4 }; /* frames of a cost; the first one cuts, sends and compiles */

struct trial {
    pbr_view *view;
    pbr_frame frame; /* the caller's, but that it waits */
    pbr_item item;
    int frames; /* so far */
};

/* Each frame lies in a slice of the depth range of its own, before all earlier ones', which then hide nothing of it: nothing has to
 * be cleared. */
static void choose_slice(const struct trial *trial, float range[2]) {
    const float *whole = trial->frame.depth_range;
    const double low = (double)fminf(whole[0], whole[1]), height = (double)fmaxf(whole[0], whole[1]) - low;
    const bool nearer_is_larger = trial->frame.flags & PBR_FRAME_REVERSED_Z;
    const int slices = ROUNDS * BALANCE_TRIES, slice = nearer_is_larger ? trial->frames : slices - 1 - trial->frames;
    for (int i = 0; i < 2; i++) {
        const float at = (float)(low + (slice * height + ((double)whole[i] - low)) / slices);
        range[i] = fminf(at, fmaxf(whole[0], whole[1])); /* it was rounded */
    }
}

/* The quickest of some frames, to the end of the GPU's work. */
static pbr_result time_cost(void *user, float point_cost, struct balance_sample *out) {
    struct trial *trial = user;
    const struct gl *gl = &trial->view->renderer->gl;
    pbr_frame frame = trial->frame;
    pbr_stats stats = PBR_STATS_INIT;
    pbr_result result = PBR_OK;
    trial->item.point_cost = point_cost;
    out->seconds = INFINITY;
    for (int round = 0; round < ROUNDS && result == PBR_OK; round++, trial->frames++) {
        choose_slice(trial, frame.depth_range);
        (*gl->Finish)();
        const double start = renderer_seconds();
        result = pbr_render(trial->view, &frame, &trial->item, 1, &stats);
        (*gl->Finish)();
        if (round > 0) out->seconds = fmin(out->seconds, renderer_seconds() - start);
    }
    out->splats = stats.splats_drawn;
    out->triangles = stats.triangles_drawn;
    return result;
}

/* As pbr_render would refuse it, but for the item, which that does. */
static pbr_result check_frame(const pbr_renderer *renderer, pbr_frame *frame) {
    struct frame_setup setup;
    const pbr_result result = frame_setup(renderer->instance, &renderer->gl, frame, &setup);
    if (frame->depth_range[0] == 0 && frame->depth_range[1] == 0) frame->depth_range[1] = 1;
    frame->flags |= PBR_FRAME_WAIT;
    frame->time_budget = 0;
    return result;
}

pbr_result pbr_renderer_measure_point_cost(pbr_renderer *renderer, const pbr_frame *frame, const pbr_item *item,
                                           float *point_cost) {
    if (!renderer) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = renderer->instance;
    struct trial trial = {0};
    if (!frame || !item || !point_cost)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_renderer_measure_point_cost: frame, item or point_cost is NULL");
    if (renderer->abandoned)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT, "pbr_renderer_measure_point_cost: the renderer was abandoned");
    pbr_result result = read_desc(instance, "pbr_frame", frame, sizeof trial.frame, &trial.frame, sizeof trial.frame);
    if (result == PBR_OK) result = read_desc(instance, "pbr_item", item, sizeof trial.item, &trial.item, sizeof trial.item);
    if (result == PBR_OK) result = check_frame(renderer, &trial.frame);
    if (result != PBR_OK) return result;
    if (!trial.item.lod || trial.item.lod->kind->kind != PBR_LOD_POP || trial.item.flags & PBR_ITEM_HIDDEN)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_renderer_measure_point_cost: the item has no hierarchy over a mesh, or is hidden");
    result = pbr_view_create(renderer, NULL, &trial.view);
    if (result == PBR_OK) result = balance_find(time_cost, &trial, point_cost);
    pbr_view_destroy(&trial.view);
    return result;
}
