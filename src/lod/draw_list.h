/* The draw list: what a cut hands to the GL side, which knows nothing else of levels of detail. Ranges of resident records; growing
 * only, and kept from frame to frame, so that a steady state allocates nothing. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_DRAW_LIST_H
#define PBR_LOD_DRAW_LIST_H

#include "core/instance.h"

struct draw_range {
    uint32_t chunk;
    uint32_t first, count; /* records within the chunk */
    bool quads;            /* some of its splats may be too large for GL points, or reach into the view from outside */
};

struct draw_list {
    struct draw_range *ranges;
    size_t count, capacity;
    uint64_t visited, culled; /* nodes tested; records left out */
};

/* Appends a range, or lengthens the last one if it continues it. */
static inline pbr_result draw_list_add(pbr_instance *instance, struct draw_list *list, struct draw_range range) {
    if (list->count > 0) {
        struct draw_range *last = &list->ranges[list->count - 1];
        if (last->chunk == range.chunk && last->quads == range.quads && last->first + last->count == range.first) {
            last->count += range.count;
            return PBR_OK;
        }
    }
    if (list->count == list->capacity) {
        size_t capacity = list->capacity ? 2 * list->capacity : 64;
        struct draw_range *grown = pbr_reallocate(instance, list->ranges, list->capacity, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        list->ranges = grown;
        list->capacity = capacity;
    }
    list->ranges[list->count++] = range;
    return PBR_OK;
}

#endif
