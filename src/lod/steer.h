/* Steering the threshold so that frames take a given time while something moves, and refining it when all rests. Without GL, clock
 * or memory of its own. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_STEER_H
#define PBR_LOD_STEER_H

#include <stdbool.h>

/* Frames that must agree before the threshold changes. With times that seem off by up to 15 % it turns five times less often than
 * with three. */
enum { STEER_VOTES = 4 };

/* Pixels. Where a view starts: nothing is known then, and some frames that are too coarse are better than one of a second. And the
 * coarsest, unless the host asks for more: a full HD picture of nodes of 64 pixels is about 500 of them. */
#define STEER_FIRST 4.0
#define STEER_LARGEST 64.0

/* Of a view; zero at the start. */
struct steer {
    double moving;            /* pixels: the threshold in motion, kept while the view rests; 0 = not known yet */
    double drawn;             /* pixels: the last frame's */
    double need[STEER_VOTES]; /* pixels x sqrt(seconds): by the last measurements, the threshold for a target of one second */
    int votes, next;          /* how many there are; the place of the next */
};

struct steer_input {
    double finest; /* pixels, > 0: what the host asks for */
    double target; /* seconds, > 0 */
    bool moves;    /* anything that the picture depends on has changed since the last frame */
    /* The newest measurement of an earlier frame that is not older than the last one given. Both 0: none. What cannot be one (not
     * finite, not above 0) is ignored. */
    double seconds;
    double tag; /* steer_output.tag of that frame */
};

struct steer_output {
    double threshold; /* pixels: at least the finest, and at most the larger of that and STEER_LARGEST */
    double tag;       /* to be kept with the frame until its time is known: the threshold, or 0 if its time is to tell nothing */
    bool is_finest;   /* all is drawn as finely as it was asked for */
};

/* What the last frame was drawn at, or the first one will be. */
double steer_threshold(const struct steer *state, double finest);

/* Once a frame, in the frames' order. */
struct steer_output steer(struct steer *state, const struct steer_input *input);

#endif
