/* Writing JSON (RFC 8259): objects and arrays of strings, numbers and truth values, one member a line. SPDX-License-Identifier: MIT
 */
#ifndef JSON_H
#define JSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct json {
    FILE *file;
    int depth;
    bool has_members; /* the innermost open object or array holds something */
};

/* `key` is NULL in arrays and at the top. */
void json_open_object(struct json *json, const char *key);
void json_open_array(struct json *json, const char *key);
void json_close_object(struct json *json);
void json_close_array(struct json *json);

/* Bytes that are not UTF-8 become U+FFFD. NULL text is null. */
void json_string(struct json *json, const char *key, const char *text);
void json_integer(struct json *json, const char *key, uint64_t value);
enum { JSON_NUMBER = 40 };
/* As few digits as give the same double back; null where not finite, which JSON cannot say. */
void json_number_text(double value, char text[JSON_NUMBER]);
void json_number(struct json *json, const char *key, double value);
void json_numbers(struct json *json, const char *key, const double *values, size_t count);
void json_truth(struct json *json, const char *key, bool value);

#endif
