/* Numbers from text. SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>

#include "io/number.h"

/* The C library's conversion in the C locale, which this program never leaves, is the reference: it rounds to nearest. */
static void check(const char *text) {
    double ours = -1, theirs = strtod(text, NULL);
    const char *end = text + strlen(text);
    if (number_parse(text, end, &ours) != end) fail_msg("'%s' is not read to its end", text);
    if (memcmp(&ours, &theirs, sizeof ours) != 0 && !(isnan(ours) && isnan(theirs)))
        fail_msg("'%s': %a, expected %a", text, ours, theirs);
}

static void random_numbers_are_the_nearest_double(void **state) {
    (void)state;
    uint64_t r = 88172645463325252u;
    char text[512];
    for (int i = 0; i < 200000; i++) {
        uint64_t bits = random_next(&r), other = random_next(&r);
        double any;
        memcpy(&any, &bits, sizeof any);
        switch (i % 7) {
        case 0: snprintf(text, sizeof text, "%.17g", any); break;
        case 1: snprintf(text, sizeof text, "%.*g", (int)(other % 25) + 1, any); break;
        case 2: snprintf(text, sizeof text, "%.6f", (double)(int64_t)bits / 1e16); break;
        case 3: snprintf(text, sizeof text, "%llue%d", (unsigned long long)bits, (int)(other % 60) - 30); break;
        case 4: snprintf(text, sizeof text, "%.17g", (double)(bits % 1000000007) / 997.0); break;
        case 5:
            snprintf(text, sizeof text, "%.*f", (int)(other % 9), (double)(bits % 2000000000) / (double)(1 + other % 1000));
            break;
        default:
            snprintf(text, sizeof text, "-0.000%llu%llue%d", (unsigned long long)bits, (unsigned long long)other,
                     (int)(other % 700) - 350);
        }
        check(text);
    }
}

static void ties_limits_and_long_texts_are_the_nearest_double(void **state) {
    (void)state;
    static const char *const TEXTS[] = {"0",
                                        "-0",
                                        ".5",
                                        "5.",
                                        "+1.5",
                                        "9007199254740993",
                                        "9007199254740993.000000000000000000000000000000001",
                                        "9007199254740992.99999999999999999999999999999999",
                                        "2.2250738585072012e-308",
                                        "4.9e-324",
                                        "2.4703282292062327208e-324",
                                        "2.4703282292062328e-324",
                                        "1.7976931348623158e308",
                                        "1.7976931348623159e308",
                                        "1e309",
                                        "1e-400",
                                        "0e999999999999999999999",
                                        "1e99999999999999999999",
                                        "00000000000000000000000000000001.5",
                                        "0.00000000000000000000000000000000000000000015e41",
                                        "123456789012345678901234567890",
                                        "3.1415926535897932384626433832795028841971693993751",
                                        "nan",
                                        "-inf",
                                        "+inf",
                                        "INFINITY",
                                        "NaN"};
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) check(TEXTS[i]);
    char text[3000];
    memset(text, '7', sizeof text);
    text[1000] = '.';
    memcpy(text + 2900, "e-1000", 7);
    check(text);
}

/* In a block of its own size, so that reading past it is found. */
static void digits_are_counted_up_to_what_is_none(void **state) {
    (void)state;
    for (int length = 0; length < 12; length++) {
        for (int digits = 0; digits <= length; digits++) {
            for (int next = 0; next < 256; next++) {
                if (is_digit((char)next)) continue;
                char *text = malloc(length > 0 ? (size_t)length : 1);
                assert_non_null(text);
                uint32_t expected = 0, value = 0;
                for (int i = 0; i < length; i++) text[i] = (char)(i < digits ? '0' + (i * 7 + next) % 10 : i > digits ? '5' : next);
                const int counted = digits < 8 ? digits : 8;
                for (int i = 0; i < counted; i++) expected = expected * 10 + (uint32_t)(text[i] - '0');
                assert_int_equal(number_digits(text, text + length, &value), counted);
                assert_true(counted == 0 || value == expected);
                free(text);
            }
        }
    }
}

static void old_c_runtime_tokens_are_read(void **state) {
    (void)state;
    double value = 0;
    const char *text = "-1.#INF";
    assert_ptr_equal(number_parse(text, text + 7, &value), text + 7);
    assert_true(value < 0 && isinf(value));
    text = "1.#QNAN";
    assert_ptr_equal(number_parse(text, text + 7, &value), text + 7);
    assert_true(isnan(value));
}

static void what_is_no_number_is_refused(void **state) {
    (void)state;
    static const char *const TEXTS[] = {"", "-", "+", ".", "e5", "abc", "--1", "in", "na", "-."};
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) {
        double value;
        assert_null(number_parse(TEXTS[i], TEXTS[i] + strlen(TEXTS[i]), &value));
    }
    const char *text = "1e+";
    double value;
    assert_ptr_equal(number_parse(text, text + 3, &value), text + 1);
}

static void unsigned_integers_stop_at_64_bits(void **state) {
    (void)state;
    uint64_t value = 0;
    const char *largest = "18446744073709551615", *past = "18446744073709551616";
    assert_ptr_equal(number_parse_unsigned(largest, largest + 20, &value), largest + 20);
    assert_true(value == UINT64_MAX);
    assert_null(number_parse_unsigned(past, past + 20, &value));
    const char *negative = "-1";
    assert_null(number_parse_unsigned(negative, negative + 2, &value));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_numbers_are_the_nearest_double),
        cmocka_unit_test(ties_limits_and_long_texts_are_the_nearest_double),
        cmocka_unit_test(digits_are_counted_up_to_what_is_none),
        cmocka_unit_test(old_c_runtime_tokens_are_read),
        cmocka_unit_test(what_is_no_number_is_refused),
        cmocka_unit_test(unsigned_integers_stop_at_64_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
