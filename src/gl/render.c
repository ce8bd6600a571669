/* pbr_render: items are checked, made resident, and drawn: the opaque ones, then the blended. SPDX-License-Identifier: MIT */
#include <pbr/render.h>
#include <string.h>

#include "blend.h"
#include "draw.h"
#include "sequence_draw.h"

/* How the frame's time steers its threshold. */
struct pace {
    bool is_on;
    bool tells;     /* its time is that of a frame in motion */
    bool is_finest; /* what the host asks for at most is drawn */
};

static pbr_result prepare_items(pbr_view *view, const pbr_item *items, size_t count) {
    pbr_instance *instance = view->renderer->instance;
    if (count > PBR_MAX_ITEMS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_render: %zu items, the limit is %d", count, PBR_MAX_ITEMS);
    if (count > 0 && !items)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_render: items is NULL, item_count is %zu", count);
    if (count > view->item_capacity) {
        const size_t capacity = count > 2 * view->item_capacity ? count : 2 * view->item_capacity;
        struct prepared_item *grown = pbr_reallocate(instance, view->items, 0, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        view->items = grown;
        view->item_capacity = capacity;
    }
    const char *at = (const char *)items;
    for (size_t i = 0; i < count; i++, at += items->struct_size) {
        size_t size;
        memcpy(&size, at, sizeof size);
        if (size != items->struct_size)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                           "pbr_item %zu: struct_size differs from the first item's", i);
        pbr_result result = item_prepare(instance, at, i, view->renderer->gl.point_size_least, &view->items[i]);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* The variant of one of an item's passes. `frame_variant`: what the frame adds. */
static uint32_t pass_variant(const struct prepared_item *prepared, enum pass pass, enum primitive primitive,
                             uint32_t frame_variant) {
    const uint32_t kind_and_pass = 7u << VARIANT_KIND_SHIFT | 3u << VARIANT_PASS_SHIFT;
    uint32_t variant = prepared->variant | frame_variant, kind = prepared->item.splat;
    if (pass == PASS_VISIBILITY && !(variant & VARIANT_FILL)) variant &= VARIANT_GEOMETRY; /* marks are coloured, the others not */
    if (pass == PASS_VISIBILITY && splat_is_disc(kind)) kind = PBR_SPLAT_GAUSSIAN;         /* all of them cover their disc */
    if (pass == PASS_ACCUMULATION && variant & VARIANT_FILL) kind = 0;                     /* a centre has no shape */
    if (pass != PASS_OPAQUE) variant &= ~(uint32_t)VARIANT_ENCODE_SRGB;
    if (!(variant & VARIANT_LIT)) variant &= ~(uint32_t)VARIANT_ONE_LIGHT;
    if (primitive == PRIMITIVE_QUADS) variant |= VARIANT_QUADS;
    if (primitive == PRIMITIVE_TRIANGLES) variant |= VARIANT_TRIANGLES, kind = 0;
    return (variant & ~kind_and_pass) | kind << VARIANT_KIND_SHIFT | (uint32_t)pass << VARIANT_PASS_SHIFT;
}

static pbr_result need_programs(pbr_renderer *renderer, struct prepared_item *prepared, uint32_t frame_variant, pbr_stats *stats) {
    const bool blended = item_is_blended(&prepared->item);
    pbr_result result = PBR_OK;
    for (enum pass pass = blended ? PASS_VISIBILITY : PASS_OPAQUE; pass <= (blended ? PASS_ACCUMULATION : PASS_OPAQUE); pass++)
        for (enum primitive primitive = PRIMITIVE_POINTS; primitive < PRIMITIVE_COUNT && result == PBR_OK; primitive++)
            if (pass_has(prepared, pass, primitive))
                result = programs_need(renderer->instance, &renderer->gl, &renderer->programs,
                                       pass_variant(prepared, pass, primitive, frame_variant), &prepared->programs[pass][primitive],
                                       &stats->programs_compiled);
    return result;
}

/* Also all triangles, where the last frame drew these. */
static void keep_mesh(pbr_view *view, const struct prepared_item *prepared) {
    const bool hidden = prepared->item.flags & PBR_ITEM_HIDDEN;
    bool all = false;
    for (size_t i = prepared->first_cut; i < view->cuts.claimed; i++)
        all = all || (view->cuts.entries[i]->is_valid && view->cuts.entries[i]->all_triangles);
    meshes_touch(&view->renderer->meshes, prepared->item.lod, all, hidden ? view->renderer->frame - 1 : view->renderer->frame);
}

/* What the frame draws must not make room for itself; what it hides goes last of the rest. */
static pbr_result keep_what_is_drawn(pbr_view *view, size_t count) {
    pbr_renderer *renderer = view->renderer;
    pbr_result result = PBR_OK;
    cuts_begin(&view->cuts);
    for (size_t i = 0; i < count && result == PBR_OK; i++) {
        struct prepared_item *prepared = &view->items[i];
        const bool hidden = prepared->item.flags & PBR_ITEM_HIDDEN;
        if (prepared->has_cuts) result = cuts_claim(view, prepared);
        if (prepared->has_triangles && result == PBR_OK) keep_mesh(view, prepared);
        else if (prepared->item.points)
            residents_touch(&renderer->residents, prepared->item.points, hidden ? renderer->frame - 1 : renderer->frame);
    }
    return result;
}

/* What is to be selected of an item, at most. */
static void count_selectable(pbr_view *view, struct prepared_item *prepared) {
    if (!prepared->group || !sequence_can_be_selected(view->renderer, prepared)) return;
    for (size_t i = 0; i < view->list.count; i++) prepared->selectable.entries += view->list.ranges[i].count;
    prepared->selectable.ranges += view->list.count;
}

/* Groups are drawn one after the other: room for the largest is enough. */
static void prepare_selection(pbr_view *view, size_t count, uint32_t groups, pbr_stats *stats) {
    struct selectable most = {0, 0};
    for (uint32_t group = 1; group <= groups; group++) {
        struct selectable sum = {0, 0};
        for (size_t i = 0; i < count; i++) {
            const struct prepared_item *prepared = &view->items[i];
            if (prepared->group != group) continue;
            sum.entries += prepared->selectable.entries;
            sum.ranges += prepared->selectable.ranges;
        }
        if (sum.entries > most.entries) most.entries = sum.entries;
        if (sum.ranges > most.ranges) most.ranges = sum.ranges;
    }
    selection_prepare(view->renderer, most.entries, most.ranges, &stats->host_gl_error, &stats->programs_compiled);
}

/* The chunks that are in view, before room is made for any. */
static pbr_result mark_sequences(pbr_view *view, const struct frame_setup *setup, size_t count, pbr_stats *stats) {
    const uint64_t frame = view->renderer->frame;
    const double start = renderer_seconds();
    pbr_result result = PBR_OK;
    for (size_t i = 0; i < count && result == PBR_OK; i++) {
        struct prepared_item *prepared = &view->items[i];
        if (!prepared->item.lod || prepared->has_cuts) continue;
        result = sequences_claim(view->renderer, prepared->item.lod, &prepared->sequence);
        for (uint32_t t = 0; t < prepared->item.transform_count && result == PBR_OK; t++) {
            struct placement placement;
            placement_make(prepared, setup, t, &placement);
            result = sequence_list(view, &placement);
            const bool hidden = prepared->item.flags & PBR_ITEM_HIDDEN;
            sequences_mark(prepared->sequence, &view->list, hidden ? frame - 1 : frame);
            count_selectable(view, prepared);
        }
    }
    stats->cut_seconds += renderer_seconds() - start;
    return result;
}

static pbr_result upload(pbr_view *view, const struct frame_setup *setup, struct prepared_item *prepared, uint64_t *left,
                         pbr_stats *stats) {
    if (prepared->item.points)
        return residents_acquire(view->renderer, prepared->item.points, item_streams(prepared), &prepared->resident,
                                 &stats->host_gl_error);
    pbr_result result = PBR_OK;
    if (prepared->sequence)
        return sequences_send(view->renderer, prepared->sequence, item_streams(prepared).fields, setup->waits, left,
                              &view->cuts.unfinished, &stats->host_gl_error);
    bool needs_mesh = false, needs_all = false;
    for (uint32_t t = 0; t < prepared->item.transform_count && result == PBR_OK; t++) {
        struct placement placement;
        placement_make(prepared, setup, t, &placement);
        result = cuts_update(view, &placement, prepared->first_cut + t, stats);
        const struct placed_cut *entry = view->cuts.entries[prepared->first_cut + t];
        needs_mesh = needs_mesh || (entry->is_valid && entry->triangles > 0);
        needs_all = needs_all || (entry->is_valid && entry->all_triangles);
    }
    if (result == PBR_OK && needs_mesh)
        result = meshes_acquire(view->renderer, prepared->item.lod, needs_all, &prepared->mesh, &stats->host_gl_error);
    return result;
}

/* FNV-1a */
static const uint64_t FNV_START = UINT64_C(14695981039346656037);

static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t count) {
    const unsigned char *at = bytes;
    for (size_t i = 0; i < count; i++) hash = (hash ^ at[i]) * UINT64_C(1099511628211);
    return hash;
}

/* As cuts_rests compares it: all but the threshold; jitter is no motion. */
static uint64_t hash_view(uint64_t hash, const pbr_view *view, const struct placement *placement) {
    struct cut_view seen;
    placement_view(placement, &view->renderer->gl, PASS_OPAQUE, &seen);
    seen.threshold = seen.edge = 0;
    const uintptr_t lod = (uintptr_t)placement->prepared->item.lod;
    return hash_bytes(hash_bytes(hash, &seen, sizeof seen), &lod, sizeof lod);
}

static bool has_hierarchies(const pbr_view *view, size_t count) {
    bool has = false;
    for (size_t i = 0; i < count; i++) has = has || (view->items[i].item.lod && !(view->items[i].item.flags & PBR_ITEM_HIDDEN));
    return has;
}

/* Whether every hierarchy is seen as in the last frame. */
static bool all_rests(pbr_view *view, const struct frame_setup *setup, size_t count) {
    uint64_t seen = FNV_START;
    bool rests = true;
    for (size_t i = 0; i < count; i++) {
        const struct prepared_item *prepared = &view->items[i];
        if (!prepared->item.lod || prepared->item.flags & PBR_ITEM_HIDDEN) continue;
        for (uint32_t t = 0; t < prepared->item.transform_count; t++) {
            struct placement placement;
            placement_make(prepared, setup, t, &placement);
            if (prepared->has_cuts) rests = rests && cuts_rests(view, &placement, prepared->first_cut + t);
            else seen = hash_view(seen, view, &placement);
        }
    }
    rests = rests && view->seen == seen;
    view->seen = seen;
    return rests;
}

/* Coarser than what is asked for, edges included: the floor that they are to the number of splats rises with it. */
static void set_threshold(struct frame_setup *setup, double threshold) {
    if (threshold > setup->threshold) setup->edge *= threshold / setup->threshold;
    setup->threshold = threshold;
}

/* Chooses the threshold of a frame with a time budget, and starts to time it. */
static void pace_begin(pbr_view *view, struct frame_setup *setup, size_t count, struct pace *pace, pbr_stats *stats) {
    const struct gl *gl = &view->renderer->gl;
    struct steer_input input = {.finest = setup->threshold, .target = setup->time_budget};
    float tag = 0;
    if (timer_take(gl, &view->timer, &stats->frame_seconds, &tag)) {
        input.seconds = stats->frame_seconds;
        input.tag = (double)tag;
    }
    timer_begin(gl, &view->timer);
    input.moves = !all_rests(view, setup, count);
    const struct steer_output output = steer(&view->steer, &input);
    set_threshold(setup, output.threshold);
    *pace = (struct pace){.is_on = true, .tells = output.tag > 0, .is_finest = output.is_finest};
}

/* A frame of cuts that differ much, as when a hierarchy has just arrived, does not tell what a threshold costs. */
static void pace_end(pbr_view *view, size_t count, double threshold, const struct pace *pace, const pbr_stats *stats) {
    double finest = cuts_finest(view);
    for (size_t i = 0; i < count; i++)
        if (view->items[i].sequence) finest = fmin(finest, threshold);
    const bool tells = pace->tells && (double)stats->threshold <= 1.25 * finest;
    if (pace->is_on) timer_end(&view->renderer->gl, &view->timer, tells ? stats->threshold : 0);
}

/* What is drawn, and where; of points and hierarchies, which. */
static uint64_t hash_items(const pbr_view *view, size_t count) {
    uint64_t hash = FNV_START;
    for (size_t i = 0; i < count; i++) {
        pbr_item item = view->items[i].item;
        hash = hash_bytes(hash, item.transforms, item.transform_count * 16 * sizeof(double));
        hash = hash_bytes(hash, item.clip_planes, item.clip_plane_count * 4 * sizeof(double));
        item.transforms = item.clip_planes = NULL;
        hash = hash_bytes(hash, &item, sizeof item);
    }
    return hash;
}

/* What hid before the items changed may not hide now. */
static void note_changes(pbr_view *view, size_t count) {
    const uint64_t items = hash_items(view, count);
    if (items != view->cuts.items) view->cuts.changed_at = view->renderer->frame;
    view->cuts.items = items;
}

static pbr_result make_drawable(pbr_view *view, struct frame_setup *setup, size_t count, uint32_t groups, uint32_t frame_variant,
                                bool draw, struct pace *pace, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    uint64_t left = SEQUENCES_A_FRAME;
    pbr_result result = keep_what_is_drawn(view, count);
    if (setup->occludes) note_changes(view, count);
    if (setup->time_budget > 0 && !draw) {
        const double finest = setup->threshold;
        set_threshold(setup, steer_threshold(&view->steer, finest));
        pace->is_finest = setup->threshold <= finest;
    } else if (setup->time_budget > 0 && result == PBR_OK && has_hierarchies(view, count))
        pace_begin(view, setup, count, pace, stats);
    if (result == PBR_OK) result = mark_sequences(view, setup, count, stats);
    for (size_t i = 0; i < count && result == PBR_OK; i++) {
        struct prepared_item *prepared = &view->items[i];
        if (prepared->item.flags & PBR_ITEM_HIDDEN) continue;
        result = upload(view, setup, prepared, &left, stats);
        if (result == PBR_OK) result = need_programs(renderer, prepared, frame_variant, stats);
    }
    if (result == PBR_OK) cuts_end(view);
    if (result == PBR_OK && setup->wanted.selects) prepare_selection(view, count, groups, stats);
    if (result == PBR_OK) draw_prepare(renderer);
    return result;
}

/* What is known of earlier frames' depth, and what it takes to know this one's. */
static pbr_result find_depth(pbr_view *view, const struct frame_setup *setup, uint32_t *program, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    if (!setup->occludes) {
        depth_forget(&view->depth);
        return PBR_OK;
    }
    if (setup->wanted.reads) depth_poll(view, &stats->host_gl_error);
    if (!renderer->empty_array) (*renderer->gl.GenVertexArrays)(1, &renderer->empty_array);
    return programs_need(renderer->instance, &renderer->gl, &renderer->programs, VARIANT_TILES, program, &stats->programs_compiled);
}

static bool has_selectable(const pbr_view *view, size_t count) {
    bool found = false;
    for (size_t i = 0; i < count; i++) found = found || (view->items[i].group && item_selects(&view->items[i]));
    return found;
}

static bool transform_feedback_runs(const struct gl *gl) {
    GLboolean active = GL_FALSE, paused = GL_FALSE;
    if (!gl->has_transform_feedback_query) return false;
    (*gl->GetBooleanv)(GL_TRANSFORM_FEEDBACK_ACTIVE, &active);
    (*gl->GetBooleanv)(GL_TRANSFORM_FEEDBACK_PAUSED, &paused);
    return active && !paused;
}

static pbr_result render_frame(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t count, bool draw,
                               pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    pbr_instance *instance = renderer->instance;
    const struct gl *gl = &renderer->gl;
    if (renderer->abandoned) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT, "pbr_render: the renderer was abandoned");
    struct frame_setup setup;
    pbr_result result = frame_setup(instance, gl, frame, &setup);
    if (result == PBR_OK) result = prepare_items(view, items, count);
    if (result != PBR_OK) return result;
    setup.waits = setup.waits || !draw;
    if (setup.empty) {
        stats->gpu_memory_bytes = renderer_bytes(renderer);
        stats->is_final = 1;
        return PBR_OK;
    }
    if (setup.wanted.bind_framebuffer && setup.wanted.framebuffer && !(*gl->IsFramebuffer)(setup.wanted.framebuffer))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_frame: %u is not the name of a framebuffer",
                       (unsigned)setup.wanted.framebuffer);
    if (transform_feedback_runs(gl))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_render: transform feedback is active; end or pause it first");

    const uint32_t groups = blend_group(view, count);
    if (groups > 0 && !gl->has_float_targets)
        return pbr_log(
            instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
            "blended and filled splats need a context that draws to half-float colours (GL_EXT_color_buffer_half_float)");
    setup.wanted.blends = groups > 0;
    setup.wanted.reads = setup.occludes && draw;
    setup.wanted.selects = gl->has_selection && has_selectable(view, count);

    renderer->frame++;
    const uint64_t uploaded = renderer->memory.uploaded;
    struct state state;
    struct pace pace = {.is_finest = true};
    bool encode = false;
    state_save(gl, renderer->keep_state, &setup.wanted, &state);
    result = frame_target(instance, gl, &setup, (GLenum)state.draw_buffers[0], &encode, &setup.wanted.framebuffer_srgb,
                          &setup.several_samples);
    const uint32_t variant = (encode ? VARIANT_ENCODE_SRGB : 0u) | (setup.light_count == 1 ? VARIANT_ONE_LIGHT : 0u);
    const GLuint target = setup.wanted.bind_framebuffer ? setup.wanted.framebuffer : (GLuint)state.framebuffer;
    uint32_t tiles = 0;
    if (result == PBR_OK) result = find_depth(view, &setup, &tiles, stats);
    if (result == PBR_OK) result = make_drawable(view, &setup, count, groups, variant, draw, &pace, stats);
    if (result == PBR_OK && groups > 0) {
        result = blend_prepare(view, &setup, count, variant, stats);
        (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, target);
    }
    if (result == PBR_OK && draw) {
        state_set(gl, &setup.wanted, &state);
        result = draw_items(view, &setup, count, PASS_OPAQUE, 0, stats);
        if (result == PBR_OK && groups > 0) result = blend_draw(view, &setup, target, count, groups, stats);
        if (result == PBR_OK && setup.wanted.reads)
            depth_capture(view, &setup, target, &renderer->programs.entries[tiles], &stats->host_gl_error);
    }
    state_restore(gl, &state);
    stats->upload_bytes = renderer->memory.uploaded - uploaded;
    if (result == PBR_OK) pace_end(view, count, setup.threshold, &pace, stats);
    stats->gpu_memory_bytes = renderer_bytes(renderer);
    stats->is_final = result == PBR_OK && view->cuts.unfinished == 0 && pace.is_finest;
    return result;
}

static pbr_result run(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t count, bool draw, pbr_stats *stats) {
    if (!view) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = view->renderer->instance;
    if (!frame) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_render: frame is NULL");
    pbr_stats full = {.struct_size = sizeof full};
    if (stats && write_info(instance, "pbr_stats", &full, sizeof full, stats, sizeof full) != PBR_OK)
        return PBR_ERROR_INVALID_ARGUMENT;
    pbr_result result = render_frame(view, frame, items, count, draw, &full);
    if (stats) write_info(instance, "pbr_stats", &full, sizeof full, stats, sizeof full);
    return result;
}

pbr_result pbr_render(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats) {
    return run(view, frame, items, item_count, true, stats);
}

pbr_result pbr_prepare(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats) {
    return run(view, frame, items, item_count, false, stats);
}
