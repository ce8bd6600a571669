/* Remembering cuts, and making those that are new. SPDX-License-Identifier: MIT */
#include "cuts.h"

#include <string.h>

#include "renderer.h"

/* A cut that so many frames of its view did not name is dropped: its item is gone. */
enum { FRAMES_KEPT = 64 };

void cuts_begin(struct cuts *cuts) {
    cuts->claimed = cuts->next = 0;
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
    }
    return PBR_OK;
}

static pbr_result make_cut(pbr_view *view, const struct placement *placement, struct placed_cut *entry, pbr_stats *stats) {
    const pbr_item *item = &placement->prepared->item;
    struct cut_view wanted;
    /* One cut for all passes. */
    placement_view(placement, &view->renderer->gl, item_is_blended(item) ? PASS_ACCUMULATION : PASS_OPAQUE, &wanted);
    if (entry->is_valid && memcmp(&entry->view, &wanted, sizeof wanted) == 0) return PBR_OK;
    entry->is_valid = entry->is_uploaded = false;
    const double start = renderer_seconds();
    pbr_result result = lod_cut(item->lod, &wanted, &entry->cut);
    stats->cut_seconds += renderer_seconds() - start;
    if (result != PBR_OK) return result;
    stats->nodes_visited += entry->cut.visited;
    memcpy(&entry->view, &wanted, sizeof wanted);
    entry->is_valid = true;
    return PBR_OK;
}

pbr_result cuts_update(pbr_view *view, const struct placement *placement, size_t i, pbr_stats *stats) {
    struct placed_cut *entry = view->cuts.entries[i];
    pbr_result result = make_cut(view, placement, entry, stats);
    const bool is_uploaded = entry->is_uploaded && entry->stream.filled;
    if (result != PBR_OK || is_uploaded || entry->cut.count == 0) return result;
    if (entry->cut.count > INT32_MAX) /* OpenGL counts so far */
        return pbr_log(view->renderer->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT,
                       "pbr_item %zu: %zu splats of its hierarchy are in view, the limit is %d; a larger threshold gives fewer",
                       (size_t)(placement->prepared - view->items), entry->cut.count, INT32_MAX);
    result = stream_fill(view->renderer, &entry->stream, entry->cut.records, entry->cut.count, &stats->host_gl_error,
                         &stats->buffers_orphaned);
    entry->is_uploaded = result == PBR_OK;
    return result;
}

static void drop(pbr_view *view, size_t i) {
    struct cuts *cuts = &view->cuts;
    struct placed_cut *entry = cuts->entries[i];
    pbr_instance *instance = view->renderer->instance;
    cuts->entries[i] = cuts->entries[--cuts->count];
    stream_free(view->renderer, &entry->stream);
    cut_free(instance, &entry->cut);
    pbr_lod_release(&entry->lod);
    pbr_free(instance, entry);
}

void cuts_end(pbr_view *view) {
    struct cuts *cuts = &view->cuts;
    for (size_t i = cuts->count; i-- > cuts->claimed;)
        if (++cuts->entries[i]->unused > FRAMES_KEPT) drop(view, i);
}

pbr_result cuts_list(pbr_instance *instance, const struct placed_cut *entry, struct draw_list *list) {
    const uint32_t count = (uint32_t)entry->cut.count, points_only = (uint32_t)entry->cut.points_only;
    pbr_result result = PBR_OK;
    if (points_only > 0) result = draw_list_add(instance, list, (struct draw_range){0, 0, points_only, false});
    if (result == PBR_OK && count > points_only)
        result = draw_list_add(instance, list, (struct draw_range){0, points_only, count - points_only, true});
    return result;
}

void cuts_evict(pbr_view *view, const pbr_lod *lod) {
    struct cuts *cuts = &view->cuts;
    cuts_begin(cuts);
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
