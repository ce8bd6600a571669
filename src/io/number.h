/* Numbers from text, whatever the locale. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_NUMBER_H
#define PBR_IO_NUMBER_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

static inline bool is_space(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}
static inline bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* The characters at `p` up to `end`, eight at most, the first in the lowest byte; zeros behind them. */
static inline uint64_t number_characters(const char *p, const char *end) {
    uint64_t eight = 0;
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (end - p >= 8) {
        memcpy(&eight, p, 8);
        return eight;
    }
    if (end - p >= 4) { /* two fours that overlap, where they are equal */
        uint32_t first, last;
        memcpy(&first, p, 4);
        memcpy(&last, end - 4, 4);
        return first | (uint64_t)last << 8 * (end - p - 4);
    }
#endif
    for (int i = 0; i < 8 && p < end; i++) eight |= (uint64_t)(unsigned char)*p++ << 8 * i;
    return eight;
}

/* Returns how many of the first eight characters are digits, from the first one on, and their value. */
static inline int number_digits(const char *p, const char *end, uint32_t *value) {
    uint64_t digits = number_characters(p, end) ^ UINT64_C(0x3030303030303030);
    /* The highest bit of a byte is set if it is above 9, or if a carry came to it from one before it that is. */
    const uint64_t others = (digits | (digits + UINT64_C(0x7676767676767676))) & UINT64_C(0x8080808080808080);
    const int count = others ? __builtin_ctzll(others) / 8 : 8;
    if (count == 0) return 0;
    digits <<= 64 - 8 * count; /* zeros before them; what comes after them falls out */
    digits = (digits * 10 + (digits >> 8)) & UINT64_C(0x00ff00ff00ff00ff);
    digits = (digits * 100 + (digits >> 16)) & UINT64_C(0x0000ffff0000ffff);
    *value = (uint32_t)(digits * 10000 + (digits >> 32));
    return count;
}

/* Reads a decimal number, "nan" or "inf" (any case, also "infinity", "nan(...)", and the "1.#INF", "1.#IND" of old C runtimes) at
 * `p`. Returns the place after it, or NULL if none begins there. The result is the double nearest to the text, ties to even. */
const char *number_parse(const char *p, const char *end, double *out);

/* An unsigned decimal integer; NULL if there is none or it passes 64 bits. */
const char *number_parse_unsigned(const char *p, const char *end, uint64_t *out);

#endif
