/* Sorting by integer keys, and Morton order. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_SORT_H
#define PBR_CORE_SORT_H

#include "points.h"

struct sort_entry {
    uint64_t key;
    uint32_t value;
};

/* Sorts by the lowest `bits` of the keys; equal ones keep their order. On `threads` threads; the result does not depend on them.
 * `spare` is as long as `entries`; the result is in one of the two. */
pbr_result sort_by_key(pbr_instance *instance, uint32_t threads, struct sort_entry *entries, struct sort_entry *spare, size_t count,
                       unsigned bits, struct sort_entry **sorted);

enum { MORTON_BITS = 21 /* per axis: 63 in a key */ };

/* Sorts entries, whose values are points, along a Morton curve through the cube of side `extent` at `minimum` (relative to the
 * points' origin), and gives them its keys: axis k has the bits 3 i + k. Points of one cell keep their order. */
pbr_result morton_sort(const pbr_points *points, uint32_t threads, const double minimum[3], double extent,
                       struct sort_entry *entries, size_t count);

#endif
