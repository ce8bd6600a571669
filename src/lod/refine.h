/* A thread that cuts hierarchies, coarse to fine, so that a frame never waits for a cut or for the file that it reads. Without GL.
 *
 * All functions but refiner_destroy and refiner_settle hold the lock for a moment only; cuts are made without it. One thread at a
 * time calls them, the host's. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_REFINE_H
#define PBR_LOD_REFINE_H

#include "cut.h"

/* The thread, and what it works for. */
struct refiner;

/* One hierarchy as one view sees it. */
struct refinement;

/* A finished cut. */
struct refined {
    pbr_result result;    /* of the cut; unless PBR_OK there is none */
    struct cut_view view; /* what was asked for; its threshold and edge are the cut's own, coarser by a power of two, or the same */
    struct occluders *hidden_by; /* what hid, held; may be NULL */
    struct cut cut;
    double seconds; /* that it took */
    uint64_t tag;   /* of what was asked */
};

/* Fails where no thread can be started. */
pbr_result refiner_create(pbr_instance *instance, struct refiner **out);
/* Ends the thread, in a moment, and all refinements. */
void refiner_destroy(struct refiner **refiner);
/* Waits likewise until nothing is held of refinements that were destroyed. */
void refiner_settle(struct refiner *refiner);

pbr_result refinement_create(struct refiner *refiner, const pbr_lod *lod, struct refinement **out);
void refinement_destroy(struct refinement **refinement);

/* From now on for this view; `occlusion` may be NULL, `tag` is anything. What was wanted before is given up, even half made: at
 * once if it has had a cut, else when the one that is being made has taken `patience` seconds. So who asks all the time gets cuts,
 * of views that are as old. The first cut is as fine as can be expected to take no longer; finer ones follow, to the view's own
 * threshold. */
void refinement_ask(struct refinement *refinement, const struct cut_view *view, const struct occlusion *occlusion, double patience,
                    uint64_t tag);

/* The cut that was taken is of no use, and finer ones would not be either: nothing more is wanted, and what is asked for next
 * begins coarser. */
void refinement_refuse(struct refinement *refinement);

/* Nothing more is wanted, until the next refinement_ask. */
void refinement_stop(struct refinement *refinement);

/* The finished cut, if there is one, else NULL. The thread makes the next one when it has been returned. To be called often: here,
 * too, is looked at how long it takes. */
struct refined *refinement_take(struct refinement *refinement);
void refinement_return(struct refinement *refinement);

/* What the levels of cuts are chosen by. */
struct refine_history {
    double pixels, seconds; /* of the last finished cut, and what it took; 0: there is none */
    double least;           /* pixels: finer ones are not to be tried */
};

/* The level at which what is asked for begins, a cut at 2^level times its threshold: the finest that is expected to take no longer
 * than that. */
int refine_first_level(const struct refine_history *history, double asked, double seconds);

#endif
