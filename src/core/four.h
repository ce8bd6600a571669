/* Four numbers at once, where loops over so few would become branches: GCC and clang make the vector instructions of any machine of
 * it. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_FOUR_H
#define PBR_CORE_FOUR_H

#include <stdint.h>

/* Without SSE GCC tells how it would return vectors; nothing here is called from elsewhere. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

typedef float four __attribute__((vector_size(16)));
typedef int32_t four_ints __attribute__((vector_size(16)));

/* mask: all bits set or none, as comparisons give. */
static inline four four_choose(four_ints mask, four a, four b) {
    return (four)((mask & (four_ints)a) | (~mask & (four_ints)b));
}
static inline four four_lesser(four a, four b) {
    return four_choose(a < b, a, b);
}
static inline four four_larger(four a, four b) {
    return four_choose(a > b, a, b);
}
static inline four four_magnitude(four a) {
    return (four)((four_ints)a & INT32_MAX);
}

/* A vector, and a zero. */
static inline four four_load3(const float v[3]) {
    return (four){v[0], v[1], v[2], 0};
}
/* Of two vectors, whatever the fourth numbers are. */
static inline float four_dot3(four a, four b) {
    const four product = a * b;
    return product[0] + product[1] + product[2];
}

#endif
