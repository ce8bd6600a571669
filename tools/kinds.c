/* Lists of names. SPDX-License-Identifier: MIT */
#include "kinds.h"

#include <string.h>

#define KIND_LINE(value, name) {value, name},

const struct kind splat_kinds[] = {SPLAT_KINDS(KIND_LINE){0, NULL}};
const struct kind blending_kinds[] = {BLENDING_KINDS(KIND_LINE){0, NULL}};
const struct kind shading_kinds[] = {SHADING_KINDS(KIND_LINE){0, NULL}};
const struct kind colour_kinds[] = {COLOUR_KINDS(KIND_LINE){0, NULL}};
const struct kind lod_kinds[] = {LOD_KINDS(KIND_LINE){0, NULL}};

/* The end of the list for a value that is not in it. */
static const struct kind *find(const struct kind *kinds, uint32_t value) {
    while (kinds->name && kinds->value != value) kinds++;
    return kinds;
}

const char *kind_name(const struct kind *kinds, uint32_t value) {
    const char *name = find(kinds, value)->name;
    return name ? name : "unknown";
}

bool kind_parse(const struct kind *kinds, const char *name, uint32_t *value) {
    while (kinds->name && strcmp(kinds->name, name)) kinds++;
    if (!kinds->name) return false;
    *value = kinds->value;
    return true;
}

uint32_t kind_count(const struct kind *kinds) {
    uint32_t count = 0;
    while (kinds[count].name) count++;
    return count;
}

uint32_t kind_after(const struct kind *kinds, uint32_t value) {
    const struct kind *at = find(kinds, value);
    return at->name && at[1].name ? at[1].value : kinds->value;
}
