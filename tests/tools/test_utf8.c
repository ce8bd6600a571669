/* Names that may be anything. SPDX-License-Identifier: MIT */
#include "../../tools/utf8.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* As RFC 3629, 3 writes it; 0 for what it excludes. */
static size_t encode(uint32_t c, char text[5]) {
    memset(text, 0, 5);
    if (c >= 0xd800 && c <= 0xdfff) return 0;
    if (c < 0x80) return text[0] = (char)c, 1;
    if (c < 0x800) return text[0] = (char)(0xc0 | c >> 6), text[1] = (char)(0x80 | (c & 0x3f)), 2;
    if (c < 0x10000) {
        text[0] = (char)(0xe0 | c >> 12);
        text[1] = (char)(0x80 | (c >> 6 & 0x3f));
        text[2] = (char)(0x80 | (c & 0x3f));
        return 3;
    }
    text[0] = (char)(0xf0 | c >> 18);
    text[1] = (char)(0x80 | (c >> 12 & 0x3f));
    text[2] = (char)(0x80 | (c >> 6 & 0x3f));
    text[3] = (char)(0x80 | (c & 0x3f));
    return 4;
}

static void every_character_reads_as_itself(void **state) {
    (void)state;
    for (uint32_t c = 1; c < 0x110000; c++) {
        char text[5];
        const char *at = text;
        size_t length = encode(c, text);
        if (length == 0) continue;
        assert_int_equal(utf8_length(text), length);
        assert_int_equal(utf8_next(&at), c);
        assert_ptr_equal(at, text + length);
        assert_int_equal(utf8_next(&at), 0);
        assert_ptr_equal(at, text + length);
    }
}

static void what_is_no_character_is_one_wrong_byte_each(void **state) {
    (void)state;
    const struct {
        const char *text;
        size_t count;
    } wrong[] = {
        {"\x80", 1},             /* a continuation of nothing */
        {"\xc0\x80", 2},         /* too long a form of 0 */
        {"\xc3", 1},             /* cut */
        {"\xe2\x82", 2},         /* cut */
        {"\xe0\x9f\xbf", 3},     /* too long a form */
        {"\xed\xa0\x80", 3},     /* a surrogate */
        {"\xf4\x90\x80\x80", 4}, /* above 10FFFF */
        {"\xf0\x9f\x98", 3},     /* cut */
        {"\xff", 1},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const char *at = wrong[i].text;
        assert_int_equal(utf8_length(at), 0);
        assert_int_equal(utf8_count(at), wrong[i].count);
        assert_int_equal(utf8_next(&at), UTF8_WRONG);
    }
    assert_int_equal(utf8_count("a\xff\xc3\xa4z"), 4);
    assert_int_equal(utf8_count(""), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_character_reads_as_itself),
        cmocka_unit_test(what_is_no_character_is_one_wrong_byte_each),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
