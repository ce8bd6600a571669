/* Reading UTF-8 that may be none: names of files and what stands in them. SPDX-License-Identifier: MIT */
#ifndef UTF8_H
#define UTF8_H

#include <stddef.h>
#include <stdint.h>

enum { UTF8_WRONG = 0xfffd };

/* Bytes of the sequence at `text` (RFC 3629: shortest form, no surrogates), or 0 if there is none. */
size_t utf8_length(const char *text);
/* Reads a character and moves `*text` on; UTF8_WRONG for a byte that begins none; 0 at the end, and stays there. */
uint32_t utf8_next(const char **text);
/* How many times until the end. */
size_t utf8_count(const char *text);

#endif
