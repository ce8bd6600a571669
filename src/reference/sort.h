/* Sorting without memory of its own (the C library's qsort may take some from malloc): heapsort. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_SORT_H
#define PBR_REFERENCE_SORT_H

#include <stddef.h>
#include <string.h>

enum { SORT_MOST_BYTES = 128 }; /* of an element */

typedef int (*sort_compare)(const void *, const void *);

/* Puts `element` into the heap [root, count), whose place `root` is free. */
static inline void sort_sift(char *base, size_t root, size_t count, size_t size, const char *element, sort_compare compare) {
    for (size_t child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && compare(base + child * size, base + (child + 1) * size) < 0) child++;
        if (compare(element, base + child * size) >= 0) break;
        memcpy(base + root * size, base + child * size, size);
    }
    memcpy(base + root * size, element, size);
}

/* Not stable: no two elements may compare as equal where their order matters. */
static inline void sort_in_place(void *array, size_t count, size_t size, sort_compare compare) {
    char *base = array, element[SORT_MOST_BYTES];
    for (size_t root = count / 2; root-- > 0;) {
        memcpy(element, base + root * size, size);
        sort_sift(base, root, count, size, element, compare);
    }
    for (size_t last = count; last-- > 1;) {
        memcpy(element, base + last * size, size);
        memcpy(base + last * size, base, size);
        sort_sift(base, 0, last, size, element, compare);
    }
}

#endif
