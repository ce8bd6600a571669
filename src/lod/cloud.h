/* The cut of a whole cloud: which of its blocks a view needs. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_CLOUD_H
#define PBR_LOD_CLOUD_H

#include "core/blocks.h"
#include "draw_list.h"
#include "sight.h"

/* A block's splats are all out of sight; some of them GL points may not draw; or these draw them all. */
enum cloud_where { CLOUD_OUTSIDE, CLOUD_NEEDS_QUADS, CLOUD_POINTS_ONLY };

/* Of the chunk its origin counts: how far a float may be off. */
enum cloud_where cloud_classify(const struct sight *sight, const struct cut_view *view, const struct block *block,
                                const struct chunk *chunk);

/* Appends the ranges of all blocks that may touch the view. Conservative: a splat that covers a pixel is never left out, and one
 * that a GL point cannot draw is always in a range marked `quads`. */
pbr_result cloud_cut(pbr_instance *instance, const struct blocks *blocks, const struct cut_view *view, struct draw_list *list);

#endif
