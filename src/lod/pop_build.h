/* Building POP hierarchies: what the parts of it share. The steps:
 *
 *   order   the triangles, by median splits   pop_order.c
 *   nodes   from the leaves up                pop_build.c, pop_sphere.c, pop_nodes.c
 *
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_POP_BUILD_H
#define PBR_LOD_POP_BUILD_H

#include "pop.h"

/* A triangle on its way to its place. */
struct pop_item {
    int32_t at[3]; /* its ball's centre; any units, the same along all axes */
    uint32_t triangle;
};

/* Coordinates are below it: differences do not overflow. */
#define POP_ITEM_EXTENT (1 << 29)

/* Puts the items into the order of the leaves. */
pbr_result pop_order(pbr_instance *instance, struct pop_item *items, uint64_t count, const struct progress *progress);

#endif
