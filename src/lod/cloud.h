/* The cut of a whole cloud: which of its blocks a view needs. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_CLOUD_H
#define PBR_LOD_CLOUD_H

#include "core/blocks.h"
#include "draw_list.h"
#include "sight.h"

/* Appends the ranges of all blocks that may touch the view. Conservative: a splat that covers a pixel is never left out, and one
 * that a GL point cannot draw is always in a range marked `quads`. */
pbr_result cloud_cut(pbr_instance *instance, const struct blocks *blocks, const struct cut_view *view, struct draw_list *list);

#endif
