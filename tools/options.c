/* Options, operands and strict numbers. The command never calls setlocale, so strtod reads the "C" locale's numbers.
 * SPDX-License-Identifier: MIT */
#include "options.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int bad_option(struct option_scan *scan, const char *reason, const char *argument) {
    snprintf(scan->error, sizeof scan->error, "%s '%s'", reason, argument);
    return OPTION_BAD;
}

/* Does `argument` name the rule's option? `*value` receives an attached value, or NULL. */
static bool rule_matches(const struct option_rule *rule, const char *argument, const char **value) {
    size_t length = strlen(rule->name);
    *value = NULL;
    if (strncmp(argument, rule->name, length)) return false;
    const char *rest = argument + length;
    if (*rest == '\0') return true;
    if (length > 2 && *rest != '=') return false;
    *value = length > 2 ? rest + 1 : rest;
    return true;
}

int option_next(struct option_scan *scan, const struct option_rule *rules) {
    if (scan->next >= scan->argc) return OPTION_END;
    const char *argument = scan->argv[scan->next++];
    if (!scan->operands_only && !strcmp(argument, "--")) {
        scan->operands_only = true;
        return option_next(scan, rules);
    }
    scan->value = argument;
    if (scan->operands_only || argument[0] != '-' || argument[1] == '\0') return OPTION_OPERAND;
    for (int i = 0; rules[i].name; i++) {
        if (!rule_matches(&rules[i], argument, &scan->value)) continue;
        if (!rules[i].takes_value) return scan->value ? bad_option(scan, "takes no value:", argument) : i;
        if (scan->value) return i;
        if (scan->next >= scan->argc) return bad_option(scan, "a value must follow", argument);
        scan->value = scan->argv[scan->next++];
        return i;
    }
    return bad_option(scan, "unknown option", argument);
}

/* A number at `text`; `*end` stands behind it. strtod alone would also take blanks, hexadecimal, "inf" and "nan". */
static bool read_number(const char *text, double *out, const char **end) {
    size_t span = strspn(text, "0123456789+-.eE");
    char *stop;
    errno = 0;
    double value = strtod(text, &stop);
    if (span == 0 || stop != text + span || errno == ERANGE || !isfinite(value)) return false;
    *out = value;
    *end = stop;
    return true;
}

bool parse_number(const char *text, double *out) {
    return parse_list(text, out, 1) == 1;
}

bool parse_number_within(const char *text, double least, double most, double *out) {
    double value;
    if (!parse_number(text, &value) || value < least || value > most) return false;
    *out = value;
    return true;
}

/* Digits only; `*end` stands behind them. */
static bool read_count(const char *text, uint64_t least, uint64_t most, uint64_t *out, const char **end) {
    uint64_t value = 0;
    const char *at = text;
    for (; isdigit((unsigned char)*at) && value <= most; at++) value = 10 * value + (uint64_t)(*at - '0');
    if (at == text || value < least || value > most) return false;
    *out = value;
    *end = at;
    return true;
}

bool parse_large_count(const char *text, uint64_t least, uint64_t most, uint64_t *out) {
    const char *end;
    uint64_t value;
    if (!read_count(text, least, most, &value, &end) || *end) return false;
    *out = value;
    return true;
}

bool parse_count(const char *text, uint32_t least, uint32_t most, uint32_t *out) {
    uint64_t value;
    if (!parse_large_count(text, least, most, &value)) return false;
    *out = (uint32_t)value;
    return true;
}

const char *parse_memory(const char *text, uint32_t *megabytes) {
    return parse_count(text, 32, 1 << 24, megabytes) ? NULL : "a number of megabytes from 32 to 16777216";
}

bool parse_size(const char *text, uint32_t most, uint32_t size[2]) {
    const char *end;
    uint64_t width;
    uint32_t height;
    if (!read_count(text, 1, most, &width, &end) || *end != 'x') return false;
    if (!parse_count(end + 1, 1, most, &height)) return false;
    size[0] = (uint32_t)width;
    size[1] = height;
    return true;
}

size_t parse_list(const char *text, double *out, size_t capacity) {
    double values[8];
    size_t count = 0;
    for (const char *at = text;; at++) {
        if (count == capacity || count == sizeof values / sizeof values[0] || !read_number(at, &values[count++], &at)) return 0;
        if (*at == '\0') break;
        if (*at != ',') return 0;
    }
    memcpy(out, values, count * sizeof values[0]);
    return count;
}

bool parse_rgb(const char *text, size_t most, float *out) {
    double values[4];
    size_t count = parse_list(text, values, most);
    for (size_t i = 0; i < count; i++)
        if (values[i] < 0 || values[i] > 1) return false;
    for (size_t i = 0; i < count && count >= 3; i++) out[i] = (float)values[i];
    return count >= 3;
}

bool has_ending(const char *text, const char *ending) {
    const size_t length = strlen(text), tail = strlen(ending);
    return length > tail && !strcmp(text + length - tail, ending);
}

bool is_picture_name(const char *text) {
    return has_ending(text, ".png") || has_ending(text, ".exr");
}

int parse_word(const char *text, const char *const *words) {
    for (int i = 0; words[i]; i++)
        if (!strcmp(text, words[i])) return i;
    return -1;
}
