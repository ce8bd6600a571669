/* Remembering cuts, and making those that are new. SPDX-License-Identifier: MIT */
#include "cuts.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "core/matrix.h"
#include "renderer.h"

/* A cut that so many frames of its view did not name is dropped: its item is gone. */
enum { FRAMES_KEPT = 64 };

static void unclaim(struct cuts *cuts) {
    cuts->claimed = cuts->next = cuts->unfinished = 0;
}

void cuts_begin(struct cuts *cuts) {
    const double now = renderer_seconds();
    unclaim(cuts);
    cuts->intervals[cuts->frame++ % 2] = now - cuts->began;
    cuts->began = now;
}

/* Moves the entry to its place in the frame's order, where it is already as long as the items stay. An item given twice finds two,
 * since what is claimed is not looked at. */
static struct placed_cut *claim(struct cuts *cuts, const pbr_item *item, uint32_t transform) {
    size_t i = cuts->next;
    for (size_t left = cuts->count - cuts->claimed; left > 0; left--, i++) {
        if (i < cuts->claimed || i >= cuts->count) i = cuts->claimed;
        struct placed_cut *entry = cuts->entries[i];
        if (entry->lod != item->lod || entry->item != item->id || entry->transform != transform) continue;
        cuts->entries[i] = cuts->entries[cuts->claimed];
        cuts->entries[cuts->claimed++] = entry;
        cuts->next = i + 1;
        return entry;
    }
    return NULL;
}

static struct placed_cut *add(pbr_instance *instance, struct cuts *cuts, const pbr_item *item, uint32_t transform) {
    if (cuts->count == cuts->capacity) {
        const size_t capacity = cuts->capacity ? 2 * cuts->capacity : 16;
        struct placed_cut **grown = pbr_reallocate(instance, cuts->entries, cuts->capacity, capacity, sizeof(struct placed_cut *));
        if (!grown) return NULL;
        cuts->entries = grown;
        cuts->capacity = capacity;
    }
    struct placed_cut *entry = pbr_allocate(instance, 1, sizeof *entry);
    if (!entry) return NULL;
    /* Reference counts change behind a const pointer; the hierarchy does not. */
    entry->lod = pbr_lod_retain((pbr_lod *)(uintptr_t)item->lod);
    entry->item = item->id;
    entry->transform = transform;
    cuts->entries[cuts->count++] = cuts->entries[cuts->claimed];
    return cuts->entries[cuts->claimed++] = entry;
}

/* Nobody looks at it for now. */
static void pause(struct placed_cut *entry) {
    if (entry->is_asked) refinement_stop(entry->refinement);
    entry->is_asked = false;
}

pbr_result cuts_claim(pbr_view *view, struct prepared_item *prepared) {
    const bool hidden = prepared->item.flags & PBR_ITEM_HIDDEN;
    const uint64_t frame = view->renderer->frame;
    prepared->first_cut = view->cuts.claimed;
    for (uint32_t t = 0; t < prepared->item.transform_count; t++) {
        struct placed_cut *entry = claim(&view->cuts, &prepared->item, t);
        if (!entry && hidden) return PBR_OK; /* it has never been drawn */
        if (!entry) entry = add(view->renderer->instance, &view->cuts, &prepared->item, t);
        if (!entry) return PBR_ERROR_OUT_OF_MEMORY;
        entry->unused = 0;
        entry->last_frame = hidden ? frame - 1 : frame;
        if (hidden) pause(entry);
    }
    return PBR_OK;
}

/* ---- Up to date ---- */

/* As placement_view made them, all bytes. */
static bool is_same(const struct cut_view *a, const struct cut_view *b) {
    return memcmp(a, b, sizeof *a) == 0;
}

static bool is_same_but_for_threshold(const struct cut_view *a, const struct cut_view *b) {
    struct cut_view other;
    memcpy(&other, b, sizeof other);
    other.threshold = a->threshold, other.edge = a->edge;
    return is_same(a, &other);
}

static void find_view(const pbr_view *view, const struct placement *placement, struct cut_view *out) {
    const bool blended = item_is_blended(&placement->prepared->item);
    placement_view(placement, &view->renderer->gl, blended ? PASS_ACCUMULATION : PASS_OPAQUE, out); /* one cut for all passes */
}

bool cuts_rests(const pbr_view *view, const struct placement *placement, size_t i) {
    const struct placed_cut *entry = view->cuts.entries[i];
    struct cut_view wanted;
    find_view(view, placement, &wanted);
    return entry->has_last && is_same_but_for_threshold(&entry->last, &wanted);
}

/* ---- What hides ---- */

/* How often a view that rests is cut again for it, at most: once to hide what is hidden, and twice when things before it have
 * moved. */
enum { MOST_SETTLINGS = 8 };

static bool is_of_camera(const struct occluders *o, const struct frame_setup *setup) {
    return memcmp(o->view, setup->view, sizeof o->view) == 0 && memcmp(o->projection, setup->still, sizeof o->projection) == 0 &&
           o->size[0] == setup->wanted.viewport[2] && o->size[1] == setup->wanted.viewport[3];
}

/* What is drawn of a node lies in its cube, or beyond as the splats are enlarged or wider on the screen than their spheres. What is
 * blended may lie behind the depth that shows, by up to two radii of the splat in front, filled by eight, and no splat in front is
 * much larger than the nodes that are asked about, or it would be one. Frames that wait ask pictures of what they draw only. */
static struct occlusion find_occlusion(const pbr_view *view, const struct placement *placement, const struct placed_cut *entry) {
    const pbr_item *item = &placement->prepared->item;
    const struct frame_setup *setup = placement->setup;
    struct occluders *by = setup->occludes && !entry->is_exposed && entry->settlings < MOST_SETTLINGS ? view->depth.newest : NULL;
    struct occlusion out = {.by = by};
    double to_clip[16];
    if (by && setup->waits && (!is_of_camera(by, setup) || by->frame < view->cuts.changed_at)) out.by = NULL;
    if (!out.by) return out;
    matrix_multiply(by->projection, by->view, to_clip);
    matrix_multiply(to_clip, placement->to_world, out.to_clip);
    const double scale = fmax(1, (double)item->radius_scale);
    out.reach[0] = splat_is_disc(item->splat) ? scale : 1;
    out.reach[1] = item_is_filled(item) ? 9 * scale : item_is_blended(item) ? 3 * scale : scale;
    if (!splat_is_disc(item->splat)) out.parallel = placement_size_per_radius(placement) / 2;
    else out.least = (double)item->size_minimum / (2 * setup->pixels_per_unit * placement->stretch);
    out.pad = 2 + (double)item->size_minimum / 2 + (item_is_filled(item) ? KERNEL_MOST_FILLED : 0);
    out.pad += fmax(fabs(setup->jitter[0]), fabs(setup->jitter[1])) + fmax(fabs(by->jitter[0]), fabs(by->jitter[1]));
    if (splat_is_blurred(item->splat)) out.pad += KERNEL_SIGMAS * sqrt((double)item->low_pass);
    return out;
}

static bool cover(struct cuts *cuts, const struct occluders *newer, const struct occluders *older) {
    if (cuts->known.newer != newer || cuts->known.older != older || cuts->known.frames[0] != newer->frame ||
        cuts->known.frames[1] != older->frame) {
        cuts->known.newer = newer;
        cuts->known.older = older;
        cuts->known.frames[0] = newer->frame;
        cuts->known.frames[1] = older->frame;
        cuts->known.covers = occluders_cover(newer, older);
    }
    return cuts->known.covers;
}

/* Whether a picture that shows the cut, among all else as it is now, is known. */
static bool is_seen(const pbr_view *view, const struct frame_setup *setup, const struct placed_cut *entry) {
    const struct occluders *newest = view->depth.newest;
    return newest && newest->frame >= entry->shown_at && newest->frame >= view->cuts.changed_at && is_of_camera(newest, setup);
}

/* Of a cut for the very view: whether it is to be made again, since what it took for hidden may be in sight, or since it is known
 * now what is hidden. */
static bool wants_settling(pbr_view *view, const struct frame_setup *setup, struct placed_cut *entry) {
    if (lod_triangle_count(entry->lod) > 0) return false; /* nothing hides its nodes */
    if (!setup->occludes || !view->depth.newest || entry->settlings >= MOST_SETTLINGS) return entry->hidden > 0;
    if (entry->is_exposed) return true;
    if (!is_seen(view, setup, entry)) return false;
    if (!entry->hidden_by || !is_of_camera(entry->hidden_by, setup)) return true;
    if (entry->hidden > 0 && !cover(&view->cuts, view->depth.newest, entry->hidden_by)) entry->is_exposed = true;
    if (entry->is_exposed || memcmp(entry->hidden_by->jitter, view->depth.newest->jitter, sizeof entry->hidden_by->jitter) != 0)
        return entry->is_exposed;
    /* It hides as much: so all cuts come to hold the same one, and old ones are free. */
    occluders_release(&entry->hidden_by);
    entry->hidden_by = occluders_retain(view->depth.newest);
    return false;
}

/* What `stream` held is needed, but gone. */
static bool is_lost(const struct placed_cut *entry) {
    return !entry->stream.filled && !entry->all_triangles && entry->count + entry->triangles > 0;
}

/* Uploads what was cut. Where that fails, what was shown before still is, if it is still there. */
static pbr_result show(pbr_view *view, const struct placement *placement, struct placed_cut *entry, const struct cut_view *made,
                       const struct cut *cut, struct occluders *hidden_by, pbr_stats *stats) {
    pbr_result result = PBR_OK;
    const bool all = cut->triangle_count > 0 && cut->count == 0 && cut->triangle_count == lod_triangle_count(entry->lod);
    if (cut->count > INT32_MAX || cut->triangle_count > INT32_MAX / 3) /* OpenGL counts so far */
        return pbr_log(
            view->renderer->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT,
            "pbr_item %zu: %zu splats and %zu triangles of its hierarchy are in view, the limit is %d; a larger threshold gives "
            "fewer",
            (size_t)(placement->prepared - view->items), cut->count, cut->triangle_count, INT32_MAX);
    struct mesh_copy *mesh;
    /* Cuts and all triangles take turns, also where there is room for either alone. */
    if (all && !renderer_has_room(view->renderer, meshes_missing(view->renderer, entry->lod, true))) {
        stream_free(view->renderer, &entry->stream);
        entry->is_valid = false;
    }
    if (!all && entry->all_triangles) meshes_release_triangles(view->renderer, entry->lod);
    if (cut->triangle_count > 0) result = meshes_acquire(view->renderer, entry->lod, all, &mesh, &stats->host_gl_error);
    if (result == PBR_OK && !all && cut->count + cut->triangle_count > 0)
        result = stream_fill(view->renderer, &entry->stream, entry->lod, cut, &stats->host_gl_error, &stats->buffers_orphaned);
    if (result != PBR_OK) {
        entry->is_valid = entry->is_valid && !is_lost(entry);
        return result;
    }
    memcpy(&entry->view, made, sizeof entry->view);
    entry->is_valid = true;
    entry->count = cut->count;
    entry->points_only = cut->points_only;
    entry->between = cut->between;
    entry->triangles = cut->triangle_count;
    entry->all_triangles = all;
    if (all) stream_free(view->renderer, &entry->stream); /* the mesh's copy has them */
    entry->culled = cut->culled;
    entry->hidden = cut->hidden;
    occluders_release(&entry->hidden_by);
    entry->hidden_by = occluders_retain(hidden_by);
    entry->shown_at = view->renderer->frame;
    view->cuts.has_shown = true;
    entry->is_exposed = false;
    entry->damaged = cut->damaged;
    entry->nearness = cut->nearness;
    return PBR_OK;
}

static pbr_result cut_now(pbr_view *view, const struct placement *placement, struct placed_cut *entry,
                          const struct cut_view *wanted, pbr_stats *stats) {
    const struct occlusion occlusion = find_occlusion(view, placement, entry);
    pause(entry);
    if (occlusion.by != entry->hidden_by) entry->has_cut = false; /* it was another that hid, or the same is newer */
    if (!entry->has_cut || !is_same(&entry->cut_of, wanted)) {    /* else only the copy on the GPU is gone */
        const double start = renderer_seconds();
        entry->has_cut = false;
        const pbr_result result = lod_cut(entry->lod, wanted, &occlusion, NULL, &entry->cut);
        stats->cut_seconds += renderer_seconds() - start;
        if (result != PBR_OK) return result;
        stats->nodes_visited += entry->cut.visited;
        memcpy(&entry->cut_of, wanted, sizeof entry->cut_of);
        entry->has_cut = true;
    }
    return show(view, placement, entry, wanted, &entry->cut, occlusion.by, stats);
}

/* Frames that a moving view is foreseen for: some, and twice those that the last cut was late by. */
enum { FORESEEN = 6, MOST_LATE = 60 };

/* Seconds that a first cut may take. Of a view that has a cut and rests: any. Of another that rests: soon. Of one that moves: half
 * of the time for which its motion is foreseen, so that the next one is there before that ends; until the next frame in any case,
 * which is soon, too. */
static const double AT_REST = 1.0 / 30, IN_MOTION = 0.1, MOST_OF_A_FRAME = 0.25;

static double find_patience(const struct cuts *cuts, const struct placed_cut *entry, const struct cut_view *wanted, bool rests) {
    if (entry->is_valid && is_same_but_for_threshold(&entry->view, wanted)) return INFINITY;
    const double interval = fmin(fmax(cuts->intervals[0], cuts->intervals[1]), MOST_OF_A_FRAME);
    return rests ? AT_REST : fmax(interval, fmin(IN_MOTION, entry->foreseen / 2 * interval));
}

/* Whether what was asked for will do until what is asked for now would be there. */
static bool will_do(const struct placed_cut *entry, const struct cut_view *wanted) {
    struct cut_view asked;
    const double left = entry->foreseen > entry->late ? 1 - entry->late / entry->foreseen : 0;
    memcpy(&asked, &entry->asked, sizeof asked);
    asked.guard.turn *= left, asked.guard.move *= left, asked.guard.eye *= left;
    return cut_view_covers(&asked, wanted, lod_radius(entry->lod));
}

/* A moving view asks for some more than it sees, and again when it is about to leave that; one that rests for just what it sees. */
static void ask(const pbr_view *view, const struct placement *placement, struct placed_cut *entry, const struct cut_view *wanted) {
    const double before = entry->asked.threshold;
    const bool rests = entry->has_last && is_same_but_for_threshold(&entry->last, wanted);
    const bool is_near = before <= 1.25 * wanted->threshold && wanted->threshold <= 1.25 * before;
    if (entry->is_asked && is_same(&entry->asked, wanted)) return;
    if (entry->is_asked && !rests && is_near && will_do(entry, wanted)) return;
    memcpy(&entry->asked, wanted, sizeof entry->asked);
    entry->foreseen = 0;
    if (!rests && entry->has_last && entry->is_valid) {
        const int frames = FORESEEN + 2 * entry->late;
        entry->foreseen = cut_view_foresee(&entry->last, lod_radius(entry->lod), entry->nearness, frames, &entry->asked);
    }
    const struct occlusion occlusion = find_occlusion(view, placement, entry);
    entry->asked_at = view->cuts.frame;
    refinement_ask(entry->refinement, &entry->asked, &occlusion, find_patience(&view->cuts, entry, wanted, rests), entry->asked_at);
    entry->is_asked = true;
}

/* Finer cuts than one that does not fit do not either: while the view stays, the coarser one is kept if there is one, else it is
 * asked for. */
static pbr_result show_newest(pbr_view *view, const struct placement *placement, struct placed_cut *entry, pbr_stats *stats) {
    struct refined *newest = refinement_take(entry->refinement);
    if (!newest) return PBR_OK;
    pbr_result result = newest->result;
    if (result == PBR_OK && entry->is_asked) {
        result = show(view, placement, entry, &newest->view, &newest->cut, newest->hidden_by, stats);
        stats->nodes_visited += newest->cut.visited;
        stats->cut_seconds += newest->seconds;
        if (newest->tag != entry->shown_of) { /* the first of those for its view */
            const uint64_t late = view->cuts.frame - newest->tag - 1;
            entry->late = late < MOST_LATE ? (int)late : MOST_LATE;
        }
        entry->shown_of = newest->tag;
    }
    const bool is_refused = result == PBR_ERROR_OUT_OF_GPU_MEMORY || result == PBR_ERROR_LIMIT;
    const bool has_coarser =
        entry->is_valid && is_same_but_for_threshold(&entry->view, &newest->view) && newest->tag == entry->asked_at;
    if (is_refused) refinement_refuse(entry->refinement);
    if (result == PBR_ERROR_OUT_OF_MEMORY || (is_refused && !has_coarser)) pause(entry); /* to be asked for again */
    refinement_return(entry->refinement);
    if (entry->has_cut) cut_free(view->renderer->instance, &entry->cut); /* it has a thread now */
    entry->has_cut = false;
    return result;
}

/* PBR_ERROR_UNSUPPORTED where threads cannot be had, or are not wanted: then every frame waits. */
static pbr_result have_refinement(pbr_renderer *renderer, struct placed_cut *entry) {
    pbr_result result = PBR_OK;
    if (renderer->instance->desc.thread_count == 1) return PBR_ERROR_UNSUPPORTED;
    if (!renderer->refiner) result = refiner_create(renderer->instance, &renderer->refiner);
    if (result != PBR_OK || entry->refinement) return result;
    return refinement_create(renderer->refiner, entry->lod, &entry->refinement);
}

pbr_result cuts_update(pbr_view *view, const struct placement *placement, size_t i, pbr_stats *stats) {
    struct placed_cut *entry = view->cuts.entries[i];
    struct cut_view wanted;
    pbr_result result = PBR_OK;
    find_view(view, placement, &wanted);
    /* Where another cut needed the memory, waiting is better than blinking. */
    const bool lost = entry->is_valid && is_lost(entry);
    if (lost) entry->is_valid = false;
    if (entry->has_last && !is_same(&entry->last, &wanted)) entry->settlings = 0, entry->is_exposed = false;
    const pbr_item *item = &placement->prepared->item;
    const struct way way = {item->splat, item->blending, item->radius_scale, item->size_minimum, item->low_pass};
    if (memcmp(&entry->way, &way, sizeof way) != 0) {
        entry->settlings = 0;
        entry->is_exposed = entry->hidden > 0;
        if (!entry->is_exposed) occluders_release(&entry->hidden_by); /* it may hide more now */
    }
    entry->way = way;
    const bool is_cut = entry->is_valid && is_same(&entry->view, &wanted);
    const bool settles = is_cut && wants_settling(view, placement->setup, entry);
    if (settles && !entry->is_asked) entry->settlings++;
    if (!is_cut || settles) {
        bool waits = placement->setup->waits || lost;
        if (!waits) result = have_refinement(view->renderer, entry);
        if (result == PBR_ERROR_UNSUPPORTED) waits = true;
        else if (result != PBR_OK) return result;
        if (waits) {
            struct cut_view now;
            memcpy(&now, &wanted, sizeof now);
            if (!placement->setup->waits && lost) { /* as it was */
                now.threshold = fmax(now.threshold, entry->view.threshold);
                now.edge = fmax(now.edge, entry->view.edge);
            }
            result = cut_now(view, placement, entry, &now, stats);
        } else {
            result = show_newest(view, placement, entry, stats);
            const bool is_new = entry->shown_at == view->renderer->frame;
            if (entry->is_valid && is_same(&entry->view, &wanted) && (is_new || !settles)) pause(entry);
            else if (result == PBR_OK) ask(view, placement, entry, &wanted);
        }
    } else {
        pause(entry);
    }
    memcpy(&entry->last, &wanted, sizeof entry->last);
    entry->has_last = true;
    const bool is_right = entry->is_valid && is_same(&entry->view, &wanted);
    entry->is_exact = entry->is_valid && is_same_but_for_threshold(&entry->view, &wanted);
    if (!is_right || (entry->hidden > 0 && (!is_seen(view, placement->setup, entry) || settles))) view->cuts.unfinished++;
    return result;
}

double cuts_finest(const pbr_view *view) {
    double finest = INFINITY;
    for (size_t i = 0; i < view->cuts.claimed; i++) {
        const struct placed_cut *entry = view->cuts.entries[i];
        if (entry->is_valid && entry->last_frame == view->renderer->frame) finest = fmin(finest, entry->view.threshold);
    }
    return finest;
}

/* ---- Forgetting ---- */

static void drop(pbr_view *view, size_t i) {
    struct cuts *cuts = &view->cuts;
    struct placed_cut *entry = cuts->entries[i];
    pbr_instance *instance = view->renderer->instance;
    cuts->entries[i] = cuts->entries[--cuts->count];
    stream_free(view->renderer, &entry->stream);
    refinement_destroy(&entry->refinement);
    cut_free(instance, &entry->cut);
    occluders_release(&entry->hidden_by);
    pbr_lod_release(&entry->lod);
    pbr_free(instance, entry);
}

void cuts_end(pbr_view *view) {
    struct cuts *cuts = &view->cuts;
    if (cuts->has_shown) cuts->changed_at = view->renderer->frame;
    cuts->has_shown = false;
    for (size_t i = cuts->count; i-- > cuts->claimed;) {
        pause(cuts->entries[i]);
        if (++cuts->entries[i]->unused > FRAMES_KEPT) drop(view, i);
    }
}

/* Whether the vertex stage would drop all points whose discs hold no pixel's centre, and nothing else shows them. */
static bool needs_pixels(const struct placement *placement) {
    const pbr_item *item = &placement->prepared->item;
    const double *jitter = placement->setup->jitter;
    return (item->splat == PBR_SPLAT_ELLIPSE || item->splat == PBR_SPLAT_GAUSSIAN) && !item_is_filled(item) && jitter[0] == 0 &&
           jitter[1] == 0;
}

pbr_result cuts_list(pbr_instance *instance, const struct placement *placement, const struct placed_cut *entry,
                     struct draw_list *list) {
    const uint32_t count = (uint32_t)entry->count, points_only = (uint32_t)entry->points_only;
    const uint32_t points = points_only - (entry->is_exact && needs_pixels(placement) ? (uint32_t)entry->between : 0);
    pbr_result result = PBR_OK;
    if (!entry->is_valid) return PBR_OK;
    if (points > 0) result = draw_list_add(instance, list, (struct draw_range){0, 0, points, false});
    if (result == PBR_OK && count > points_only)
        result = draw_list_add(instance, list, (struct draw_range){0, points_only, count - points_only, true});
    return result;
}

void cuts_evict(pbr_view *view, const pbr_lod *lod) {
    struct cuts *cuts = &view->cuts;
    unclaim(cuts);
    for (size_t i = cuts->count; i-- > 0;)
        if (!lod || cuts->entries[i]->lod == lod) drop(view, i);
    if (lod) return;
    pbr_free(view->renderer->instance, cuts->entries);
    *cuts = (struct cuts){0};
}

struct placed_cut *cuts_oldest(const pbr_renderer *renderer, uint64_t frame) {
    struct placed_cut *oldest = NULL;
    for (const pbr_view *view = renderer->views; view; view = view->next)
        for (size_t i = 0; i < view->cuts.count; i++) {
            struct placed_cut *entry = view->cuts.entries[i];
            if (entry->last_frame == frame || stream_bytes(&entry->stream) == 0) continue;
            if (!oldest || entry->last_frame < oldest->last_frame) oldest = entry;
        }
    return oldest;
}

uint64_t cuts_object_count(const struct cuts *cuts) {
    uint64_t count = 0;
    for (size_t i = 0; i < cuts->count; i++) count += stream_object_count(&cuts->entries[i]->stream);
    return count;
}
