/* The cuts of hierarchies that a view remembers from frame to frame, one for each item and transform, with the buffers that hold
 * their records. An unchanged view neither cuts nor uploads. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_CUTS_H
#define PBR_GL_CUTS_H

#include "lod/cut.h"
#include "lod/draw_list.h"
#include "placement.h"
#include "stream.h"

struct placed_cut {
    pbr_lod *lod; /* held */
    uint64_t item;
    uint32_t transform;
    uint32_t unused;     /* frames of the view since one named it */
    uint64_t last_frame; /* serial number of the renderer's last frame that drew it */
    bool is_valid;       /* `cut` is what `view` sees */
    bool is_uploaded;    /* and what `stream` holds, unless it was emptied since */
    struct cut_view view;
    struct cut cut;
    struct stream stream;
};

/* First those of the current frame, in the order of its items and transforms, then the others. */
struct cuts {
    struct placed_cut **entries;
    size_t count, capacity;
    size_t claimed; /* by the current frame */
    size_t next;    /* where the next one is looked for first: frames ask in the same order */
};

/* Starts a frame. */
void cuts_begin(struct cuts *cuts);

/* Finds the cuts of the next item, making those that are new unless it is hidden, so that nothing that the frame draws makes room
 * for the rest. After this prepared->first_cut is the entry of its first transform. */
pbr_result cuts_claim(pbr_view *view, struct prepared_item *prepared);

/* Cuts one that was claimed and uploads it, as far as it changed. */
pbr_result cuts_update(pbr_view *view, const struct placement *placement, size_t entry, pbr_stats *stats);

/* Ends a frame: drops what has not been named for long. */
void cuts_end(pbr_view *view);

/* What to draw of a cut: ranges of the records in cuts_drawable. */
pbr_result cuts_list(pbr_instance *instance, const struct placed_cut *entry, struct draw_list *list);
static inline const struct drawable *cuts_drawable(const struct placed_cut *entry) {
    return &entry->stream.buffers[entry->stream.current];
}

/* Drops those of a hierarchy, or all for NULL. */
void cuts_evict(pbr_view *view, const pbr_lod *lod);

/* Of all the renderer's views, the one with buffers that was drawn longest ago, and not by `frame`; NULL if there is none. */
struct placed_cut *cuts_oldest(const pbr_renderer *renderer, uint64_t frame);

/* Names of GL objects held. */
uint64_t cuts_object_count(const struct cuts *cuts);

#endif
