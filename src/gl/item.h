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

/* Kinds that are convolved with the screen's low-pass. */
static inline bool splat_is_blurred(uint32_t splat) {
    return splat >= PBR_SPLAT_EWA;
}

static inline bool item_is_filled(const pbr_item *item) {
    return item->blending == PBR_BLEND_FILL;
}

/* Drawn in passes over targets of our own; the others are opaque. */
static inline bool item_is_blended(const pbr_item *item) {
    return item->splat >= PBR_SPLAT_GAUSSIAN || item_is_filled(item);
}

/* Lit once a pixel: the others have only one splat a pixel, or are lit before they are filled. */
static inline bool item_is_deferred(const pbr_item *item) {
    return item->splat >= PBR_SPLAT_GAUSSIAN && item->shading >= PBR_SHADE_DEFERRED;
}

struct prepared_item {
    pbr_item item; /* defaults filled in */
    /* Of what is drawn, points or a hierarchy: */
    const double *origin;     /* of its positions, object space */
    double centre[3], radius; /* of a sphere around it, relative to the origin */
    uint64_t point_count;
    struct resident *resident;                      /* points */
    struct sequence *sequence;                      /* sequential point trees */
    bool has_cuts;                                  /* other hierarchies */
    bool has_triangles;                             /* some of those */
    struct mesh_copy *mesh;                         /* of those over meshes */
    size_t first_cut;                               /* of those: index of the first transform's in the view's cuts */
    bool culls;                                     /* back faces are dropped */
    uint32_t variant;                               /* of the pass that colours, without VARIANT_QUADS and what the frame adds */
    uint32_t programs[PASS_COUNT][PRIMITIVE_COUNT]; /* indices; of the passes and primitives that the item has */
    int64_t scalar;                                 /* index, or -1 */
    uint32_t group;                                 /* of blended items that share their passes; 0: it is opaque, or hidden */
    struct selectable {
        uint64_t entries, ranges;
    } selectable; /* of sequential point trees, under all transforms */
    float map_low, map_high;
};

/* Centres, between which is filled, are points; and where triangles are, there is nothing to fill. */
static inline bool pass_has(const struct prepared_item *prepared, enum pass pass, enum primitive primitive) {
    if (primitive == PRIMITIVE_POINTS) return true;
    if (pass == PASS_ACCUMULATION && item_is_filled(&prepared->item)) return false;
    return primitive == PRIMITIVE_QUADS || prepared->has_triangles;
}

static inline struct streams item_streams(const struct prepared_item *prepared) {
    return (struct streams){prepared->scalar, (prepared->variant & VARIANT_FIELD) != 0};
}

/* Whether its entries are selected once for all passes. Fields are not copied with them, so those that have some are asked about in
 * each pass. */
static inline bool item_selects(const struct prepared_item *prepared) {
    return item_is_blended(&prepared->item) && prepared->variant & VARIANT_SEQUENCE && !(prepared->variant & VARIANT_FIELD);
}

/* Checks an item as the host gave it and prepares it. Errors are logged with its index. `least`: diameter of the smallest GL point.
 */
pbr_result item_prepare(pbr_instance *instance, const void *in, size_t index, float least, struct prepared_item *out);

#endif
