/* UTF-8. SPDX-License-Identifier: MIT */
#include "utf8.h"

size_t utf8_length(const char *at) {
    const unsigned char *text = (const unsigned char *)at;
    unsigned char first = text[0], second_least = 0x80, second_most = 0xbf;
    if (first < 0x80) return 1;
    size_t length = first >= 0xc2 && first <= 0xdf   ? 2
                    : first >= 0xe0 && first <= 0xef ? 3
                    : first >= 0xf0 && first <= 0xf4 ? 4
                                                     : 0;
    if (first == 0xe0) second_least = 0xa0;
    if (first == 0xed) second_most = 0x9f;
    if (first == 0xf0) second_least = 0x90;
    if (first == 0xf4) second_most = 0x8f;
    if (length == 0 || text[1] < second_least || text[1] > second_most) return 0;
    for (size_t i = 2; i < length; i++)
        if ((text[i] & 0xc0) != 0x80) return 0;
    return length;
}

uint32_t utf8_next(const char **text) {
    const unsigned char *at = (const unsigned char *)*text;
    const size_t length = utf8_length(*text);
    if (at[0] == 0) return 0;
    *text += length ? length : 1;
    if (length < 2) return length ? at[0] : UTF8_WRONG;
    uint32_t character = at[0] & (0x7fu >> length);
    for (size_t i = 1; i < length; i++) character = character << 6 | (at[i] & 0x3f);
    return character;
}

size_t utf8_count(const char *text) {
    size_t count = 0;
    while (utf8_next(&text)) count++;
    return count;
}
