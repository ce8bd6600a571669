/* Lines of numbers, as the text formats share them. SPDX-License-Identifier: MIT */
#include "text.h"

#include <limits.h>

size_t text_begin(const struct reader *reader) {
    return reader->size >= 3 && memcmp(reader->data, "\357\273\277", 3) == 0 ? 3 : 0;
}

char text_line_end(const struct reader *reader) {
    if (reader->size == 0 || memchr(reader->data, '\n', reader->size)) return '\n';
    return memchr(reader->data, '\r', reader->size) ? '\r' : '\n';
}

static inline bool is_mark(char c) {
    return c == ',' || c == ';';
}

const char *text_word_end(const char *p, const char *end) {
    while (p < end && !is_space(*p) && !is_mark(*p) && !text_is_comment(p, end)) p++;
    return p;
}

int text_numbers(const char **p, const char *end, double *values, int most) {
    int count = 0;
    for (;;) {
        *p = text_skip_blanks(*p, end);
        if (count > 0 && *p < end && is_mark(**p)) *p = text_skip_blanks(*p + 1, end);
        if (*p == end || text_is_comment(*p, end)) return count;
        double value;
        const char *after = number_parse(*p, end, &value);
        if (!after || after != text_word_end(after, end)) return -1;
        if (count < most) values[count] = value;
        if (count < INT_MAX) count++;
        *p = after;
    }
}
