/* A JSON writer. SPDX-License-Identifier: MIT */
#include "json.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "utf8.h"

static void put_text(FILE *file, const char *text) {
    putc('"', file);
    for (const unsigned char *at = (const unsigned char *)text; *at;) {
        size_t length = utf8_length((const char *)at);
        if (length == 0) fputs("\\ufffd", file);
        else if (*at == '"' || *at == '\\') fprintf(file, "\\%c", *at);
        else if (*at < 0x20) fprintf(file, "\\u%04x", *at);
        else fwrite(at, 1, length, file);
        at += length ? length : 1;
    }
    putc('"', file);
}

void json_number_text(double value, char text[JSON_NUMBER]) {
    snprintf(text, JSON_NUMBER, "null");
    for (int digits = 6; isfinite(value) && digits <= 17; digits++) {
        snprintf(text, JSON_NUMBER, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
}

static void put_number(FILE *file, double value) {
    char text[JSON_NUMBER];
    json_number_text(value, text);
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
