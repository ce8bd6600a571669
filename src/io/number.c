/* Numbers from text, whatever the locale: the nearest double, by the cheapest of three ways that is exact.
 *
 * 1. Up to 2^53 and a power of ten up to 22 (Clinger 1990): both factors are doubles, so one operation rounds once.
 * 2. Up to 19 digits and a power of ten up to 27: 5^27 fits 64 bits, so product and quotient are exact in 128.
 * 3. Anything else: a decimal number of up to 800 digits is halved and doubled until it is in [1/2, 1). Halfway points of doubles
 * have at most 767 digits, so what lies beyond matters only as "more than nothing". SPDX-License-Identifier: MIT */
#include "number.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static const double TENS[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static const uint32_t POWERS[9] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000};

enum { MOST_SCANNED = 19, MOST_EXACT_TENS = 22, MOST_EXACT_FIVES = 27, MOST_DIGITS = 800, MOST_SHIFT = 60, MOST_NEW_DIGITS = 20 };

/* A scanned number: mantissa * 10^exponent, its first 19 significant digits; `more`: non-zero digits follow those. */
struct scan {
    uint64_t mantissa;
    int64_t exponent;
    int digits;
    bool any, more;
};

static const char *scan_digits(const char *p, const char *end, bool fraction, struct scan *s) {
    uint32_t value;
    int count;
    do {
        count = number_digits(p, end, &value);
        s->any |= count > 0;
        if (s->digits + count <= MOST_SCANNED) { /* zeros before the first digit that is none may count: then there is `more` */
            s->mantissa = s->mantissa * POWERS[count] + (count ? value : 0);
            s->digits += s->mantissa != 0 ? count : 0;
            s->exponent -= fraction ? count : 0;
            p += count;
            continue;
        }
        for (int i = 0; i < count; i++) {
            unsigned digit = (unsigned)(*p++ - '0');
            if (s->digits < MOST_SCANNED) {
                s->mantissa = s->mantissa * 10 + digit;
                s->digits += s->mantissa != 0;
                s->exponent -= fraction;
            } else {
                s->more |= digit != 0;
                s->exponent += !fraction;
            }
        }
    } while (count == 8);
    return p;
}

static const char *scan_exponent(const char *p, const char *end, int64_t *exponent) {
    if (p == end || (*p != 'e' && *p != 'E')) return p;
    const char *q = p + 1;
    bool negative = false;
    if (q < end && (*q == '-' || *q == '+')) negative = *q++ == '-';
    if (q == end || !is_digit(*q)) return p;
    int64_t value = 0;
    for (; q < end && is_digit(*q); q++)
        if (value < INT64_C(1000000000000000)) value = value * 10 + (*q - '0');
    *exponent += negative ? -value : value;
    return q;
}

/* ---- second way ---- */

/* top * 2^exponent, plus less than one unit of `top` if `sticky`. Only for results that are normal doubles. */
static double round_to_double(uint64_t top, int exponent, bool sticky) {
    int lead = __builtin_clzll(top);
    top <<= lead;
    exponent -= lead;
    uint64_t kept = top >> 11, rest = top & 0x7ff;
    if (rest > 0x400 || (rest == 0x400 && (sticky || (kept & 1)))) kept++;
    return ldexp((double)kept, exponent + 11);
}

static double times_power_of_five(uint64_t mantissa, uint64_t five, int exponent) {
    uint64_t al = mantissa & UINT32_MAX, ah = mantissa >> 32, bl = five & UINT32_MAX, bh = five >> 32;
    uint64_t low = al * bl, middle = ah * bl + (low >> 32), cross = al * bh + (middle & UINT32_MAX);
    uint64_t high = ah * bh + (middle >> 32) + (cross >> 32);
    low = (cross << 32) | (low & UINT32_MAX);
    if (high == 0) return round_to_double(low, exponent, false);
    int lead = __builtin_clzll(high);
    uint64_t top = lead ? (high << lead) | (low >> (64 - lead)) : high;
    return round_to_double(top, exponent + 64 - lead, (low << lead) != 0);
}

/* The next 32 bits of a quotient, and *rest, which is less than the divisor before and after; the divisor's highest bit is set
 * (Knuth, The Art of Computer Programming 2, algorithm D, with digits of 32 bits). */
static uint64_t divide_further(uint64_t *rest, uint32_t next, uint64_t divisor) {
    const uint64_t high = divisor >> 32, low = divisor & UINT32_MAX;
    uint64_t digit = *rest / high, left = *rest % high;
    while (left <= UINT32_MAX && (digit > UINT32_MAX || digit * low > (left << 32 | next))) { /* twice at most */
        digit--;
        left += high;
    }
    *rest = (*rest << 32 | next) - digit * divisor; /* what is beyond 64 bits is in both */
    return digit;
}

static double over_power_of_five(uint64_t mantissa, uint64_t five, int exponent) {
    int a = __builtin_clzll(mantissa), b = __builtin_clzll(five);
    mantissa <<= a;
    five <<= b;
    /* mantissa * 2^63 / five: the quotient has 63 or 64 bits. */
    uint64_t rest = mantissa >> 1;
    const uint64_t first = divide_further(&rest, (uint32_t)(mantissa & 1) << 31, five);
    const uint64_t quotient = first << 32 | divide_further(&rest, 0, five);
    return round_to_double(quotient, exponent + b - a - 63, rest != 0);
}

static double scale_exactly(uint64_t mantissa, int exponent) {
    uint64_t five = 1;
    for (int i = exponent < 0 ? -exponent : exponent; i > 0; i--) five *= 5;
    return exponent < 0 ? over_power_of_five(mantissa, five, exponent) : times_power_of_five(mantissa, five, exponent);
}

/* ---- third way ---- */

/* 0.d1 d2 d3 ... * 10^point, d1 not 0; `more`: non-zero digits were cut off. */
struct decimal {
    unsigned char digit[MOST_DIGITS + MOST_NEW_DIGITS];
    int count;
    int64_t point;
    bool more;
};

static void decimal_put(struct decimal *d, unsigned digit) {
    if (d->count == 0 && digit == 0) d->point--;
    else if (d->count < MOST_DIGITS) d->digit[d->count++] = (unsigned char)digit;
    else d->more |= digit != 0;
}

/* The digits of a number's text [p, end), sign excluded, `point` not counting its exponent. */
static void decimal_read(const char *p, const char *end, struct decimal *d) {
    bool fraction = false;
    memset(d, 0, sizeof *d);
    for (; p < end && (is_digit(*p) || *p == '.'); p++) {
        if (*p == '.') {
            fraction = true;
            continue;
        }
        decimal_put(d, (unsigned)(*p - '0'));
        d->point += !fraction;
    }
}

static void decimal_halve(struct decimal *d, int times) {
    uint64_t rest = 0, mask = (UINT64_C(1) << times) - 1;
    struct decimal out = {.point = d->point, .more = d->more};
    for (int i = 0; i < d->count || rest != 0; i++) {
        rest = rest * 10 + (i < d->count ? d->digit[i] : 0u);
        decimal_put(&out, (unsigned)(rest >> times));
        rest &= mask;
    }
    *d = out;
}

static void decimal_double(struct decimal *d, int times) {
    uint64_t carry = 0;
    for (int i = d->count - 1; i >= 0; i--) {
        carry += (uint64_t)d->digit[i] << times;
        d->digit[i] = (unsigned char)(carry % 10);
        carry /= 10;
    }
    int added = 0;
    for (uint64_t c = carry; c != 0; c /= 10) added++;
    memmove(d->digit + added, d->digit, (size_t)d->count);
    for (int i = added - 1; i >= 0; i--, carry /= 10) d->digit[i] = (unsigned char)(carry % 10);
    d->count += added;
    d->point += added;
    for (; d->count > MOST_DIGITS; d->count--) d->more |= d->digit[d->count - 1] != 0;
    while (d->count > 0 && d->digit[d->count - 1] == 0) d->count--;
}

static uint64_t decimal_round(const struct decimal *d) {
    uint64_t value = 0;
    int64_t i = 0;
    for (; i < d->point; i++) value = value * 10 + (i < d->count ? d->digit[i] : 0u);
    if (d->point < 0 || d->point >= d->count) return value;
    unsigned next = d->digit[d->point];
    bool beyond = d->count > d->point + 1 || d->more;
    return value + (next > 5 || (next == 5 && (beyond || (value & 1))));
}

static double decimal_to_double(struct decimal *d) {
    if (d->count == 0 || d->point < -330) return 0;
    if (d->point > 310) return HUGE_VAL;
    int exponent = 0;
    while (d->point > 0) {
        int times = d->point > MOST_SHIFT / 3 ? MOST_SHIFT : (int)d->point * 3;
        decimal_halve(d, times);
        exponent += times;
    }
    while (d->point < 0 || d->digit[0] < 5) {
        int times = d->point == 0 ? 1 : -d->point > MOST_SHIFT / 3 ? MOST_SHIFT : (int)-d->point * 3;
        decimal_double(d, times);
        exponent -= times;
    }
    /* Bits that the result has: 53, fewer below the smallest normal double, 2^-1022 = 1/2 * 2^-1021. */
    int bits = exponent >= -1021 ? 53 : 53 + 1021 + exponent;
    if (bits < 0) return 0;
    if (bits > 0) decimal_double(d, bits);
    return ldexp((double)decimal_round(d), exponent - bits);
}

/* ---- tokens ---- */

static bool starts_with(const char *p, const char *end, const char *lower_case) {
    for (; *lower_case; p++, lower_case++)
        if (p == end || (*p | 0x20) != *lower_case) return false;
    return true;
}

static const char *word_end(const char *p, const char *end) {
    while (p < end && !is_space(*p)) p++;
    return p;
}

static const char *parse_special(const char *p, const char *end, double *out) {
    if (starts_with(p, end, "inf")) {
        *out = HUGE_VAL;
        return p + (starts_with(p, end, "infinity") ? 8 : 3);
    }
    if (!starts_with(p, end, "nan")) return NULL;
    *out = NAN;
    return p + 3 < end && p[3] == '(' ? word_end(p, end) : p + 3;
}

const char *number_parse(const char *p, const char *end, double *out) {
    bool negative = false;
    if (p < end && (*p == '-' || *p == '+')) negative = *p++ == '-';
    const char *text = p;
    struct scan s = {0};
    uint32_t whole, part = 0;
    const int before = number_digits(p, end, &whole);
    p += before;
    if (before > 0 && before < 8 && p < end && *p == '.') { /* as most do: the first way, as a rule, without what others need */
        const int after = number_digits(++p, end, &part);
        p += after;
        s.mantissa = (uint64_t)whole * POWERS[after] + part;
        if (after < 8 && !(p < end && (*p == 'e' || *p == 'E' || *p == '#'))) {
            *out = (double)s.mantissa / (negative ? -TENS[after] : TENS[after]);
            return p;
        }
        s.any = true;
        s.digits = s.mantissa != 0 ? before + after : 0;
        s.exponent = -after;
        if (after == 8) p = scan_digits(p, end, true, &s);
    } else {
        p = scan_digits(text, end, false, &s);
        if (p < end && *p == '.') p = scan_digits(p + 1, end, true, &s);
    }
    double value = 0;
    if (!s.any) {
        p = parse_special(text, end, &value);
        if (!p) return NULL;
        *out = negative ? -value : value;
        return p;
    }
    if (p < end && *p == '#') {
        *out = !starts_with(p + 1, end, "inf") ? NAN : negative ? -HUGE_VAL : HUGE_VAL;
        return word_end(p, end);
    }
    int64_t exponent = 0;
    p = scan_exponent(p, end, &exponent);
    s.exponent += exponent;
    int64_t tens = s.exponent < 0 ? -s.exponent : s.exponent;
    if (s.mantissa == 0) {
        value = 0; /* whatever the exponent */
    } else if (!s.more && s.mantissa <= UINT64_C(1) << 53 && tens <= MOST_EXACT_TENS) {
        value = s.exponent < 0 ? (double)s.mantissa / TENS[tens] : (double)s.mantissa * TENS[tens];
    } else {
        bool known = tens <= MOST_EXACT_FIVES;
        if (known) value = scale_exactly(s.mantissa, (int)s.exponent);
        /* Cut digits lie between these two neighbours; if both give the same double, so does what lies between. */
        if (known && s.more) known = value == scale_exactly(s.mantissa + 1, (int)s.exponent);
        if (!known) {
            struct decimal d;
            decimal_read(text, p, &d);
            d.point += exponent;
            value = decimal_to_double(&d);
        }
    }
    *out = negative ? -value : value;
    return p;
}

const char *number_parse_unsigned(const char *p, const char *end, uint64_t *out) {
    uint64_t value = 0;
    if (p == end || !is_digit(*p)) return NULL;
    for (; p < end && is_digit(*p); p++)
        if (__builtin_mul_overflow(value, (uint64_t)10, &value) || __builtin_add_overflow(value, (uint64_t)(*p - '0'), &value))
            return NULL;
    *out = value;
    return p;
}
