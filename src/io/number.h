/* Numbers from text, whatever the locale. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_NUMBER_H
#define PBR_IO_NUMBER_H

#include <stdbool.h>
#include <stdint.h>

static inline bool is_space(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}
static inline bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* Reads a decimal number, "nan" or "inf" (any case, also "infinity", "nan(...)", and the "1.#INF", "1.#IND" of old C runtimes) at
 * `p`. Returns the place after it, or NULL if none begins there. The result is the double nearest to the text, ties to even. */
const char *number_parse(const char *p, const char *end, double *out);

/* An unsigned decimal integer; NULL if there is none or it passes 64 bits. */
const char *number_parse_unsigned(const char *p, const char *end, uint64_t *out);

#endif
