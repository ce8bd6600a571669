/* The cut of a POP hierarchy: the points and triangles that a view is to draw. Without GL.
 *
 * Definition. A node stops a walk if it is outside the view, or faces away with all that is below, or is small enough, or is a
 * leaf. Of each path from the root to a leaf the first node that stops is the cut's: culled if it is outside or faces away, else
 * drawn as a point if it is small enough, else, a leaf, as a triangle. Small enough are none that stand for fewer triangles than a
 * point costs. Whether a node stops depends on it and the view alone, so
 * the cut is a function of the view, whichever way it is found.
 *
 * Front. The cut, culled nodes included, is kept in the order of the leaves, and next to each node for how long its being there is
 * certain. All that is asked of a node is whether some function of its ball is negative, and how much such a function may change
 * from one view to the next has a bound for all nodes together: the motion. So a node need not be looked at again before the motion
 * has summed up to the least of its values. The same is true of those above, which did not stop: they are looked at again with the
 * first of the front's nodes that is below them, first the highest. Where all was to be looked at, that is the walk from the root;
 * so a front never visits more than that does, and on a slow way next to nothing.
 *
 * Cost: 16 bytes for each node of the cut, twice. A frame goes once over the front, and asks of those whose time is over.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_POP_CUT_H
#define PBR_LOD_POP_CUT_H

#include "pop.h"
#include "question.h"

enum pop_fate {
    POP_CULLED,
    POP_POINT, /* that GL points can draw for certain, in the sense of cut.points_only */
    POP_QUAD,  /* or may not */
    POP_TRIANGLE,
    POP_FATES
};

/* What is asked of a node: functions of its ball. */
enum {
    POP_ASKS_OUTSIDE = 0, /* planes */
    POP_ASKS_INSIDE = OUTSIDE_TESTS,
    POP_ASKS_DEPTH = POP_ASKS_INSIDE + INSIDE_TESTS, /* sizes, which decide by w */
    POP_ASKS_FACING,
    POP_QUESTIONS
};

/* What a value of such a function is worth: as a length, so that a view that moves changes all of them alike, and what rounding may
 * make of that. */
struct pop_measure {
    float scale, error;
};

/* A node of the front. */
struct pop_front_node {
    uint32_t index; /* in its level */
    uint8_t level, fate;
    double until; /* the motion, summed up, at which it, or one of those above whose first it is, is to be looked at again */
};

/* Zero at the start; kept from frame to frame, so that a steady state allocates nothing. One thread at a time; of one hierarchy. */
struct pop_cut {
    uint64_t counts[POP_FATES];
    uint64_t visited; /* nodes looked at for the last view */
    struct pop_front_node *nodes, *spare;
    size_t node_count, capacity, spare_capacity;
    /* Of the last view: */
    struct question question;
    double motion; /* summed up since the measures were chosen */
    struct pop_measure measures[POP_QUESTIONS];
};

/* Replaces the cut by the view's, from the root. */
pbr_result pop_cut_walk(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                        struct pop_cut *cut);

/* The same cut, from the last one of the same hierarchy. `cancel`, there and here: ends it early with PBR_ERROR_CANCELLED; may be
 * NULL. After an error the cut is empty. */
pbr_result pop_cut_update(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                          struct pop_cut *cut);

/* Writes what is drawn, each in the order of the leaves: counts[POP_POINT] records and counts[POP_QUAD] after them, relative to the
 * hierarchy's centre; the corners of counts[POP_TRIANGLE] triangles. */
void pop_cut_gather(const struct pop *pop, const struct pop_cut *cut, struct splat *records, uint32_t (*triangles)[3]);

/* The mean of 1 / w of what is drawn, as cut.nearness. */
double pop_cut_nearness(const struct pop *pop, const struct pop_cut *cut);

void pop_cut_free(pbr_instance *instance, struct pop_cut *cut);

#endif
