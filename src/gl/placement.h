/* One item under one of its transforms: its matrices, and what its cut depends on. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_PLACEMENT_H
#define PBR_GL_PLACEMENT_H

#include "frame.h"
#include "item.h"
#include "lod/sight.h"

struct placement {
    const struct prepared_item *prepared;
    const struct frame_setup *setup;
    double to_eye[16];  /* object space relative to the item's origin -> eye */
    double to_clip[16]; /* the same -> clip */
    double to_world[16];
    double stretch;
};

void placement_make(const struct prepared_item *prepared, const struct frame_setup *setup, uint32_t transform,
                    struct placement *out);

/* Diameter in pixels of a splat of radius 1 at w = 1. */
double placement_size_per_radius(const struct placement *placement);

/* What a pass has to draw. A cut for the accumulation pass will do for the visibility pass, too: splats reach farther there. All
 * bytes of `out` are set, so that equal views compare equal. */
void placement_view(const struct placement *placement, const struct gl *gl, enum pass pass, struct cut_view *out);

#endif
