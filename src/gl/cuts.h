/* The cuts of hierarchies that a view remembers from frame to frame, one for each item and transform, with the buffers that hold
 * their records. An unchanged view neither cuts nor uploads; one that moves does so now and then. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_CUTS_H
#define PBR_GL_CUTS_H

#include "lod/cut.h"
#include "lod/draw_list.h"
#include "lod/occluders.h"
#include "lod/refine.h"
#include "placement.h"
#include "stream.h"

struct placed_cut {
    pbr_lod *lod; /* held */
    uint64_t item;
    uint32_t transform;
    uint32_t unused;     /* frames of the view since one named it */
    uint64_t last_frame; /* serial number of the renderer's last frame that drew it */
    /* What `stream` holds, unless it was emptied since: */
    bool is_valid;
    struct cut_view view;
    size_t count, points_only, between, triangles;
    bool is_exact;      /* the current frame's view is the very one of the cut */
    bool all_triangles; /* of the hierarchy, and no splats: they are not in `stream`, but of the mesh's copy */
    uint64_t culled, hidden, damaged;
    struct occluders *hidden_by; /* held: what they were hidden by; NULL: nothing hid */
    uint64_t shown_at;           /* serial number of the frame that drew it first */
    struct way {                 /* how it was drawn last: how far its splats reach, which is no part of a view */
        uint32_t splat, blending;
        float radius_scale, size_minimum, low_pass;
    } way;
    bool is_exposed; /* what was hidden may be in sight: nothing is to hide in the next cut */
    int settlings;   /* cuts since the view changed, for what hides alone */
    double nearness;
    struct stream stream;
    struct cut cut; /* of cuts that are waited for */
    bool has_cut;   /* it is that of */
    struct cut_view cut_of;
    /* Of those that are not: */
    struct refinement *refinement;
    bool is_asked;
    struct cut_view asked;
    double foreseen;             /* frames that it will do for, if the motion goes on */
    uint64_t asked_at, shown_of; /* the view's frame that asked for that, and the one that asked for what is shown */
    int late;                    /* the view's frames between the latter and the first that showed it */
    bool has_last;
    struct cut_view last; /* the last frame's */
};

/* First those of the current frame, in the order of its items and transforms, then the others. */
struct cuts {
    struct placed_cut **entries;
    size_t count, capacity;
    size_t claimed;      /* by the current frame */
    size_t next;         /* where the next one is looked for first: frames ask in the same order */
    size_t unfinished;   /* ones of the current frame: will look better when they are drawn again */
    uint64_t frame;      /* of the view: how many there were */
    double began;        /* seconds: when the current one did */
    double intervals[2]; /* seconds: from frame to frame, the last two */
    uint64_t changed_at; /* serial number of the last frame that differs from the one before in items, or showed another cut */
    bool has_shown;      /* the current one has */
    uint64_t items;      /* a hash of the last frame's */
    struct {             /* what occluders_cover said last; not held, compared only */
        const struct occluders *newer, *older;
        uint64_t frames[2];
        bool covers;
    } known;
};

/* Starts a frame. */
void cuts_begin(struct cuts *cuts);

/* Finds the cuts of the next item, making those that are new unless it is hidden, so that nothing that the frame draws makes room
 * for the rest. After this prepared->first_cut is the entry of its first transform. */
pbr_result cuts_claim(pbr_view *view, struct prepared_item *prepared);

/* Whether one that was claimed is seen as in the last frame, but for the threshold. */
bool cuts_rests(const pbr_view *view, const struct placement *placement, size_t entry);

/* Brings one that was claimed up to date, as far as the view changed: at once, or asking the renderer's refinement thread and
 * taking what that finished. Uploads what is new. */
pbr_result cuts_update(pbr_view *view, const struct placement *placement, size_t entry, pbr_stats *stats);

/* Pixels: of the cuts of the current frame that are drawn, the smallest threshold. */
double cuts_finest(const pbr_view *view);

/* Ends a frame: drops what has not been named for long. */
void cuts_end(pbr_view *view);

/* What a frame's pass has to draw of a cut: ranges of the records in cuts_drawable. */
pbr_result cuts_list(pbr_instance *instance, const struct placement *placement, const struct placed_cut *entry,
                     struct draw_list *list);
static inline const struct drawable *cuts_drawable(const struct placed_cut *entry) {
    return &entry->stream.buffers[entry->stream.current];
}

/* Drops those of a hierarchy, or all for NULL. What the refinement thread works at is let go of in a moment: refiner_settle. */
void cuts_evict(pbr_view *view, const pbr_lod *lod);

/* Of all the renderer's views, the one with buffers that was drawn longest ago, and not by `frame`; NULL if there is none. */
struct placed_cut *cuts_oldest(const pbr_renderer *renderer, uint64_t frame);

/* Names of GL objects held. */
uint64_t cuts_object_count(const struct cuts *cuts);

#endif
