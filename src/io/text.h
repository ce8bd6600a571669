/* Lines of numbers, as the text formats share them. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_TEXT_H
#define PBR_IO_TEXT_H

#include "number.h"
#include "reader.h"

#include <string.h>

/* Where the text begins, past a byte order mark. */
size_t text_begin(const struct reader *reader);

/* '\n', or '\r' in a file that uses nothing else. */
char text_line_end(const struct reader *reader);

/* The end of the line that begins at `p`, at most `end`. */
static inline const char *text_end_of_line(const struct reader *reader, const char *p, const char *end) {
    const char *found = memchr(p, reader->line_end, (size_t)(end - p));
    return found ? found : end;
}

static inline const char *text_skip_blanks(const char *p, const char *end) {
    while (p < end && is_space(*p)) p++;
    return p;
}

/* A comment begins here: # or //. */
static inline bool text_is_comment(const char *p, const char *end) {
    return p < end && (*p == '#' || (*p == '/' && p + 1 < end && p[1] == '/'));
}

/* The end of the word at `p`: at a blank, a comma, a semicolon or a comment. */
const char *text_word_end(const char *p, const char *end);

/* Reads the numbers of a line from `*p` on: parted by blanks, or one comma or semicolon and blanks, up to a comment. The first
 * `most` of them are stored; all are counted. Returns -1 at what is no number, and then `*p` is there; else `*p` is where they end.
 */
int text_numbers(const char **p, const char *end, double *values, int most);

#endif
