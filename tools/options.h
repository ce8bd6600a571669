/* Command lines: walking over options and operands in any order, and numbers that are numbers. Unlike getopt_long it takes no
 * abbreviations, so that a later option cannot change what a script means. SPDX-License-Identifier: MIT */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct option_rule {
    const char *name; /* "--size"; a letter ("-o") takes its value attached, too. A NULL name ends the rules. */
    bool takes_value;
};

enum { OPTION_END = -1, OPTION_OPERAND = -2, OPTION_BAD = -3 };

struct option_scan {
    int argc;
    char **argv; /* without the command's name */
    int next;
    bool operands_only; /* "--" was seen */
    const char *value;  /* of the option or the operand itself; NULL without one */
    char error[256];    /* after OPTION_BAD */
};

/* The next option's index in `rules`, or OPTION_... */
int option_next(struct option_scan *scan, const struct option_rule *rules);

/* Whole text or nothing: no blanks, no trailing characters, finite. `out` is written only on success. */
bool parse_number(const char *text, double *out);
bool parse_number_within(const char *text, double least, double most, double *out);
bool parse_count(const char *text, uint32_t least, uint32_t most, uint32_t *out);
bool parse_large_count(const char *text, uint64_t least, uint64_t most, uint64_t *out); /* `most` < 2^60 */
/* A --memory: megabytes for building out of core. NULL if it was taken, else what it should have been. */
const char *parse_memory(const char *text, uint32_t *megabytes);
/* "1280x720", each 1..most. */
bool parse_size(const char *text, uint32_t most, uint32_t size[2]);
/* Numbers with commas between. Returns how many there were, 0 if it is no such list or has more than `capacity`. */
size_t parse_list(const char *text, double *out, size_t capacity);
/* "R,G,B", or with `most` 4 also "R,G,B,A", each 0..1. An A that is not given leaves `out[3]` as it is. */
bool parse_rgb(const char *text, size_t most, float *out);
/* Does it end so, and begin with something else? */
bool has_ending(const char *text, const char *ending);
/* Is that ending .png or .exr? */
bool is_picture_name(const char *text);
/* Index of `text` in a list of words ended by NULL, or -1. */
int parse_word(const char *text, const char *const *words);

#endif
