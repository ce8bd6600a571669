/* The items of a frame, checked, with their defaults filled in, and what drawing keeps about each. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_ITEM_H
#define PBR_GL_ITEM_H

#include <pbr/render.h>

#include "program.h"
#include "resident.h"

/* Kinds that lie in space, across their normals; the others lie parallel to the screen. */
static inline bool splat_is_disc(uint32_t splat) {
    return splat >= PBR_SPLAT_ELLIPSE;
}

/* Kinds that are blended over the surface, in passes; the others are opaque. */
static inline bool splat_is_blended(uint32_t splat) {
    return splat >= PBR_SPLAT_GAUSSIAN;
}

/* Lit once a pixel: opaque kinds have only one splat a pixel. */
static inline bool item_is_deferred(const pbr_item *item) {
    return splat_is_blended(item->splat) && item->shading >= PBR_SHADE_DEFERRED;
}

struct prepared_item {
    pbr_item item; /* defaults filled in */
    struct resident *resident;
    uint32_t variant;                 /* of the pass that colours, without VARIANT_QUADS and what the frame adds */
    uint32_t programs[PASS_COUNT][2]; /* indices: for points, for quads; of the passes that the kind has */
    int64_t scalar;                   /* index, or -1 */
    uint32_t group;                   /* of blended items that are summed up together */
    float map_low, map_high;
};

static inline struct streams item_streams(const struct prepared_item *prepared) {
    return (struct streams){prepared->scalar, (prepared->variant & VARIANT_FIELD) != 0};
}

/* Checks an item as the host gave it and prepares it. Errors are logged with its index. `least`: diameter of the smallest GL point.
 */
pbr_result item_prepare(pbr_instance *instance, const void *in, size_t index, float least, struct prepared_item *out);

#endif
