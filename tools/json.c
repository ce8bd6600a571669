/* A JSON writer. SPDX-License-Identifier: MIT */
#include "json.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

/* Length of the UTF-8 sequence at `text` (RFC 3629: shortest form, no surrogates), or 0 if there is none. */
static size_t utf8_length(const unsigned char *text) {
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

static void put_text(FILE *file, const char *text) {
    putc('"', file);
    for (const unsigned char *at = (const unsigned char *)text; *at;) {
        size_t length = utf8_length(at);
        if (length == 0) fputs("\\ufffd", file);
        else if (*at == '"' || *at == '\\') fprintf(file, "\\%c", *at);
        else if (*at < 0x20) fprintf(file, "\\u%04x", *at);
        else fwrite(at, 1, length, file);
        at += length ? length : 1;
    }
    putc('"', file);
}

static void put_number(FILE *file, double value) {
    char text[40];
    if (!isfinite(value)) {
        fputs("null", file);
        return;
    }
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    fputs(text, file);
}

/* Comma, line and key: whatever stands before a member. */
static void begin_member(struct json *json, const char *key) {
    if (json->depth > 0) fprintf(json->file, "%s\n%*s", json->has_members ? "," : "", 2 * json->depth, "");
    json->has_members = true;
    if (!key) return;
    put_text(json->file, key);
    fputs(": ", json->file);
}

static void open_level(struct json *json, const char *key, char bracket) {
    begin_member(json, key);
    putc(bracket, json->file);
    json->depth++;
    json->has_members = false;
}

static void close_level(struct json *json, char bracket) {
    json->depth--;
    if (json->has_members) fprintf(json->file, "\n%*s", 2 * json->depth, "");
    putc(bracket, json->file);
    json->has_members = true;
    if (json->depth == 0) putc('\n', json->file);
}

void json_open_object(struct json *json, const char *key) {
    open_level(json, key, '{');
}
void json_open_array(struct json *json, const char *key) {
    open_level(json, key, '[');
}
void json_close_object(struct json *json) {
    close_level(json, '}');
}
void json_close_array(struct json *json) {
    close_level(json, ']');
}

void json_string(struct json *json, const char *key, const char *text) {
    begin_member(json, key);
    if (text) put_text(json->file, text);
    else fputs("null", json->file);
}

void json_integer(struct json *json, const char *key, uint64_t value) {
    begin_member(json, key);
    fprintf(json->file, "%" PRIu64, value);
}

void json_number(struct json *json, const char *key, double value) {
    begin_member(json, key);
    put_number(json->file, value);
}

void json_numbers(struct json *json, const char *key, const double *values, size_t count) {
    begin_member(json, key);
    putc('[', json->file);
    for (size_t i = 0; i < count; i++) {
        if (i) fputs(", ", json->file);
        put_number(json->file, values[i]);
    }
    putc(']', json->file);
}

void json_truth(struct json *json, const char *key, bool value) {
    begin_member(json, key);
    fputs(value ? "true" : "false", json->file);
}
