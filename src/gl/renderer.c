/* Renderers and views: creation, destruction, what they hold. SPDX-License-Identifier: MIT */
#include "renderer.h"

#include <pbr/render.h>
#include <time.h>

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
    renderer->memory.budget = d.gpu_memory_budget ? d.gpu_memory_budget : UINT64_MAX;
    instance_add_child(instance);
    *out = renderer;
    return PBR_OK;
}

pbr_result pbr_renderer_destroy(pbr_renderer **out) {
    if (!out || !*out) return PBR_OK;
    pbr_renderer *renderer = *out;
    pbr_instance *instance = renderer->instance;
    size_t views = 0;
    for (const pbr_view *view = renderer->views; view; view = view->next) views++;
    if (views > 0)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_BUSY, "pbr_renderer_destroy: %zu views of the renderer are still alive",
                       views);
    const struct gl *gl = renderer_gl(renderer);
    residents_evict(renderer, NULL);
    sequences_evict(renderer, NULL);
    meshes_evict(renderer, NULL);
    selection_free(renderer);
    refiner_destroy(&renderer->refiner);
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

/* It may keep deleted buffers alive. */
static void drop_quad_array(pbr_renderer *renderer) {
    const struct gl *gl = renderer_gl(renderer);
    if (gl) (*gl->DeleteVertexArrays)(1, &renderer->quad_array);
    renderer->quad_array = 0;
}

void pbr_renderer_evict(pbr_renderer *renderer, const pbr_points *points) {
    if (!renderer) return;
    const struct gl *gl = renderer_gl(renderer);
    residents_evict(renderer, points);
    for (pbr_view *view = renderer->views; view && !points; view = view->next) {
        cuts_evict(view, NULL);
        depth_free(gl, &view->depth);
    }
    if (renderer->refiner && !points) refiner_settle(renderer->refiner);
    if (!points) sequences_evict(renderer, NULL);
    if (!points) meshes_evict(renderer, NULL);
    if (!points) selection_free(renderer);
    if (!points) targets_free(gl, &renderer->targets);
    drop_quad_array(renderer);
}

void pbr_renderer_evict_lod(pbr_renderer *renderer, const pbr_lod *lod) {
    if (!renderer) return;
    for (pbr_view *view = renderer->views; view; view = view->next) cuts_evict(view, lod);
    sequences_evict(renderer, lod);
    meshes_evict(renderer, lod);
    if (renderer->sequences.count == 0) selection_free(renderer);
    if (renderer->refiner) refiner_settle(renderer->refiner);
    drop_quad_array(renderer);
}

/* Drops what was drawn longest ago of what the current frame does not draw. False: there is nothing. */
static bool drop_oldest(pbr_renderer *renderer) {
    struct residents *residents = &renderer->residents;
    const uint64_t frame = renderer->frame;
    const size_t resident = residents_oldest(residents, frame);
    struct placed_cut *cut = cuts_oldest(renderer, frame);
    struct page *page = sequences_oldest(renderer, frame);
    struct mesh_copy *mesh = meshes_oldest(&renderer->meshes, frame);
    struct mesh_copy *triangles = meshes_oldest_triangles(&renderer->meshes, frame);
    const uint64_t ages[5] = {resident < residents->count ? residents->entries[resident]->last_frame : UINT64_MAX,
                              cut ? cut->last_frame : UINT64_MAX, page ? page->last_frame : UINT64_MAX,
                              mesh ? mesh->last_frame : UINT64_MAX, triangles ? triangles->triangles_frame : UINT64_MAX};
    int oldest = 0;
    for (int i = 1; i < 5; i++)
        if (ages[i] < ages[oldest]) oldest = i;
    if (ages[oldest] == UINT64_MAX) return false;
    if (oldest == 0) residents_evict_at(renderer, resident);
    else if (oldest == 1) stream_free(renderer, &cut->stream);
    else if (oldest == 2) sequences_drop(renderer, page);
    else if (oldest == 3) meshes_evict(renderer, mesh->lod);
    else meshes_drop_triangles(renderer, triangles);
    return true;
}

pbr_result renderer_make_room(pbr_renderer *renderer, uint64_t bytes) {
    const struct memory *memory = &renderer->memory;
    if (!renderer_has_room(renderer, bytes)) selection_drop(renderer); /* which need not be sent again */
    while (!renderer_has_room(renderer, bytes)) {
        if (!drop_oldest(renderer))
            return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_GPU_MEMORY,
                           "the frame needs %llu more bytes of GPU memory, but the renderer's budget of %llu leaves %llu",
                           (unsigned long long)bytes, (unsigned long long)memory->budget,
                           (unsigned long long)(memory->budget - memory->bytes));
    }
    return PBR_OK;
}

GLenum renderer_try_buffer(pbr_renderer *renderer, size_t bytes, const void *data, GLenum usage, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    const GLenum pending = gl_drain_errors(gl);
    if (pending != GL_NO_ERROR)
        pbr_log(renderer->instance, PBR_LOG_WARNING, PBR_OK, "the host had left GL error 0x%04x; it is handed over in pbr_stats",
                (unsigned)pending);
    if (*host_error == GL_NO_ERROR) *host_error = pending;
    (*gl->BufferData)(GL_ARRAY_BUFFER, (GLsizeiptr)bytes, data, usage);
    return gl_drain_errors(gl);
}

pbr_result renderer_allocate_buffer(pbr_renderer *renderer, size_t bytes, const void *data, GLenum usage, GLenum *host_error) {
    const GLenum error = renderer_try_buffer(renderer, bytes, data, usage, host_error);
    if (error == GL_NO_ERROR) return PBR_OK;
    return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_GPU_MEMORY,
                   "OpenGL refuses a buffer of %zu bytes (error 0x%04x)", bytes, (unsigned)error);
}

uint64_t renderer_bytes(const pbr_renderer *renderer) {
    uint64_t bytes = renderer->memory.bytes + renderer->targets.bytes;
    for (const pbr_view *view = renderer->views; view; view = view->next) bytes += view->depth.bytes;
    return bytes;
}

double renderer_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

pbr_result pbr_renderer_get_info(const pbr_renderer *renderer, pbr_renderer_info *info) {
    if (!renderer || !info) return PBR_ERROR_INVALID_ARGUMENT;
    const struct gl *gl = &renderer->gl;
    uint64_t objects = residents_object_count(&renderer->residents) + sequences_object_count(&renderer->sequences) +
                       meshes_object_count(&renderer->meshes) + (renderer->quad_array != 0) + (renderer->empty_array != 0);
    for (const pbr_view *view = renderer->views; view; view = view->next)
        objects += cuts_object_count(&view->cuts) + (uint64_t)timer_object_count(&view->timer) + depth_object_count(&view->depth);
    if (renderer->selection.commands) objects += 3;
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
        .gpu_memory_budget = renderer->memory.budget,
        .gpu_memory_bytes = renderer_bytes(renderer),
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
    view->next = renderer->views;
    renderer->views = view;
    *out = view;
    return PBR_OK;
}

void pbr_view_destroy(pbr_view **out) {
    if (!out || !*out) return;
    pbr_view *view = *out;
    pbr_instance *instance = view->renderer->instance;
    pbr_view **link = &view->renderer->views;
    while (*link != view) link = &(*link)->next;
    *link = view->next;
    cuts_evict(view, NULL);
    if (view->renderer->refiner) refiner_settle(view->renderer->refiner);
    timer_free(renderer_gl(view->renderer), &view->timer);
    depth_free(renderer_gl(view->renderer), &view->depth);
    pbr_free(instance, view->list.ranges);
    pbr_free(instance, view->items);
    pbr_free(instance, view);
    *out = NULL;
}
