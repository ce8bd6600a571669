/* Renderers and views: creation, destruction, what they hold. SPDX-License-Identifier: MIT */
#include "renderer.h"

#include <pbr/render.h>

pbr_result pbr_renderer_create(pbr_instance *instance, const pbr_renderer_desc *desc, pbr_renderer **out) {
    if (!instance || !out) return PBR_ERROR_INVALID_ARGUMENT;
    *out = NULL;
    pbr_renderer_desc d;
    pbr_result result = read_desc(instance, "pbr_renderer_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (d.flags & ~(uint32_t)PBR_RENDERER_KEEP_NO_STATE || !(d.point_size_limit >= 0))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_renderer_desc: unknown flags or a negative point_size_limit");
    pbr_renderer *renderer = pbr_allocate(instance, 1, sizeof *renderer);
    if (!renderer) return PBR_ERROR_OUT_OF_MEMORY;
    result = gl_load(instance, &d, &renderer->gl);
    if (result != PBR_OK) {
        pbr_free(instance, renderer);
        return result;
    }
    renderer->instance = instance;
    renderer->keep_state = !(d.flags & PBR_RENDERER_KEEP_NO_STATE);
    renderer->residents.budget = d.gpu_memory_budget ? d.gpu_memory_budget : UINT64_MAX;
    instance_add_child(instance);
    *out = renderer;
    return PBR_OK;
}

pbr_result pbr_renderer_destroy(pbr_renderer **out) {
    if (!out || !*out) return PBR_OK;
    pbr_renderer *renderer = *out;
    pbr_instance *instance = renderer->instance;
    if (renderer->views > 0)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_BUSY, "pbr_renderer_destroy: %zu views of the renderer are still alive",
                       renderer->views);
    const struct gl *gl = renderer->abandoned ? NULL : &renderer->gl;
    residents_evict(instance, gl, &renderer->residents, NULL);
    programs_free(instance, gl, &renderer->programs);
    targets_free(gl, &renderer->targets);
    if (gl) {
        (*gl->DeleteVertexArrays)(1, &renderer->quad_array);
        (*gl->DeleteVertexArrays)(1, &renderer->empty_array);
    }
    pbr_free(instance, renderer);
    instance_drop_child(instance);
    *out = NULL;
    return PBR_OK;
}

void pbr_renderer_abandon(pbr_renderer *renderer) {
    if (renderer) renderer->abandoned = true;
}

void pbr_renderer_evict(pbr_renderer *renderer, const pbr_points *points) {
    if (!renderer) return;
    const struct gl *gl = renderer->abandoned ? NULL : &renderer->gl;
    residents_evict(renderer->instance, gl, &renderer->residents, points);
    if (!points) targets_free(gl, &renderer->targets);
    if (gl) (*gl->DeleteVertexArrays)(1, &renderer->quad_array); /* it may keep the deleted buffers alive */
    renderer->quad_array = 0;
}

pbr_result pbr_renderer_get_info(const pbr_renderer *renderer, pbr_renderer_info *info) {
    if (!renderer || !info) return PBR_ERROR_INVALID_ARGUMENT;
    const struct gl *gl = &renderer->gl;
    uint64_t objects = residents_object_count(&renderer->residents) + (renderer->quad_array != 0) + (renderer->empty_array != 0);
    if (renderer->targets.depth) objects += renderer->targets.second ? 8 : 5;
    for (uint32_t i = 0; i < renderer->programs.count; i++) objects += renderer->programs.entries[i].name != 0;
    pbr_renderer_info full = {
        .gl_version = (uint32_t)gl->version,
        .is_es = gl->es,
        .is_compatibility = gl->compatibility,
        .has_clip_control = gl->ClipControl != NULL,
        .point_size_limit = gl->point_size_limit,
        .max_lights = PBR_MAX_LIGHTS,
        .max_clip_planes = PBR_MAX_CLIP_PLANES,
        .max_items = PBR_MAX_ITEMS,
        .max_transforms = PBR_MAX_TRANSFORMS,
        .max_points = PBR_MAX_POINTS,
        .max_viewport = {(uint32_t)gl->max_viewport[0], (uint32_t)gl->max_viewport[1]},
        .gpu_memory_budget = renderer->residents.budget,
        .gpu_memory_bytes = renderer->residents.bytes + renderer->targets.bytes,
        .gpu_object_count = objects,
    };
    return write_info(renderer->instance, "pbr_renderer_info", &full, sizeof full, info, sizeof full);
}

pbr_result pbr_view_create(pbr_renderer *renderer, const pbr_view_desc *desc, pbr_view **out) {
    if (!renderer || !out) return PBR_ERROR_INVALID_ARGUMENT;
    *out = NULL;
    pbr_view_desc d;
    pbr_result result = read_desc(renderer->instance, "pbr_view_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (d.flags || d.reserved)
        return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_view_desc: flags and reserved must be 0");
    if (renderer->abandoned)
        return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT, "pbr_view_create: the renderer was abandoned");
    pbr_view *view = pbr_allocate(renderer->instance, 1, sizeof *view);
    if (!view) return PBR_ERROR_OUT_OF_MEMORY;
    view->renderer = renderer;
    renderer->views++;
    *out = view;
    return PBR_OK;
}

void pbr_view_destroy(pbr_view **out) {
    if (!out || !*out) return;
    pbr_view *view = *out;
    pbr_instance *instance = view->renderer->instance;
    view->renderer->views--;
    pbr_free(instance, view->list.ranges);
    pbr_free(instance, view->items);
    pbr_free(instance, view);
    *out = NULL;
}
