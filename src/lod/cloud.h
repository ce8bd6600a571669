/* The cut of a whole cloud: which of its blocks a view needs. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_CLOUD_H
#define PBR_LOD_CLOUD_H

#include "core/blocks.h"
#include "draw_list.h"

/* What decides a cut. */
struct cut_view {
    double to_clip[16];                /* object space relative to the points' origin -> clip, jitter included */
    double size_per_radius;            /* diameter in pixels of a splat of radius 1 at w = 1 */
    double size_minimum, size_maximum; /* diameters, pixels */
    double point_limit;                /* largest diameter of a GL point */
    double viewport[2];                /* pixels */
    bool zero_to_one;                  /* clip depth 0..w */
    bool culls;                        /* back faces are dropped: those of normals n at p with n.(eye - p) < 0 */
    double eye[4];                     /* object space relative to the points' origin, homogeneous; w = 0: the direction to it */
    /* Splats that are discs in space, not parallel to the screen: */
    bool discs;
    double projection[16];   /* eye -> clip, jitter included */
    double reach_per_radius; /* eye units that a splat of radius 1 reaches from its centre at most */
    double spread;           /* pixels that a splat reaches beyond its disc on each side; points draw those between near and far */
    double largest_spread;   /* of log w over a disc, its square: points draw those below */
};

/* Appends the ranges of all blocks that may touch the view. Conservative: a splat that covers a pixel is never left out, and one
 * that a GL point cannot draw is always in a range marked `quads`. */
pbr_result cloud_cut(pbr_instance *instance, const struct blocks *blocks, const struct cut_view *view, struct draw_list *list);

#endif
