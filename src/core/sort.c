/* Radix sort, and Morton order by it. SPDX-License-Identifier: MIT */
#include "sort.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { DIGIT_BITS = 11, DIGITS = 1 << DIGIT_BITS, PARTS_MOST = 16 /* of a pass */, GRAIN = 1 << 14 };

/* One pass of a radix sort. Each part of the input counts, and later scatters, its own digits: stable, and without locks. */
struct pass {
    const struct sort_entry *from;
    struct sort_entry *to;
    size_t count, part;
    unsigned shift;
    size_t (*places)[DIGITS]; /* per part: the counts, then where its next entry of that digit goes */
};

static uint32_t digit_of(const struct pass *pass, size_t i) {
    return (uint32_t)(pass->from[i].key >> pass->shift) & (DIGITS - 1);
}

static pbr_result count_digits(void *user, size_t begin, size_t end) {
    struct pass *pass = user;
    size_t *counts = pass->places[begin / pass->part];
    for (size_t i = begin; i < end; i++) counts[digit_of(pass, i)]++;
    return PBR_OK;
}

static pbr_result scatter(void *user, size_t begin, size_t end) {
    struct pass *pass = user;
    size_t *places = pass->places[begin / pass->part];
    for (size_t i = begin; i < end; i++) pass->to[places[digit_of(pass, i)]++] = pass->from[i];
    return PBR_OK;
}

/* Turns counts into places. False if all entries have the same digit and the pass would change nothing. */
static bool assign_places(struct pass *pass, size_t parts) {
    size_t next = 0;
    for (uint32_t d = 0; d < DIGITS; d++) {
        size_t before = next;
        for (size_t part = 0; part < parts; part++) {
            size_t count = pass->places[part][d];
            pass->places[part][d] = next;
            next += count;
        }
        if (next - before == pass->count) return false;
    }
    return true;
}

pbr_result sort_by_key(pbr_instance *instance, uint32_t threads, struct sort_entry *entries, struct sort_entry *spare, size_t count,
                       unsigned bits, struct sort_entry **sorted) {
    const size_t parts = threads < 1 ? 1 : threads < PARTS_MOST ? threads : PARTS_MOST;
    struct pass pass = {.from = entries, .to = spare, .count = count, .part = (count + parts - 1) / parts};
    pbr_result result = PBR_OK;
    *sorted = entries;
    pass.places = pbr_allocate(instance, parts, sizeof *pass.places);
    if (!pass.places) return PBR_ERROR_OUT_OF_MEMORY;
    for (; result == PBR_OK && pass.shift < bits; pass.shift += DIGIT_BITS) {
        memset(pass.places, 0, parts * sizeof *pass.places);
        result = pbr_parallel(instance, count, pass.part, count_digits, &pass);
        if (result != PBR_OK || !assign_places(&pass, parts)) continue;
        result = pbr_parallel(instance, count, pass.part, scatter, &pass);
        *sorted = pass.to;
        pass.to = *sorted == entries ? spare : entries;
        pass.from = *sorted;
    }
    pbr_free(instance, pass.places);
    return result;
}

/* ---- Morton order ---- */

struct keys {
    const pbr_points *points;
    struct sort_entry *entries;
    double minimum[3], scale; /* cells per unit, the same along all axes: cells are to be cubes */
};

/* Moves bit i to bit 3 i. */
static uint64_t spread(uint64_t v) {
    v = (v | v << 32) & UINT64_C(0x001f00000000ffff);
    v = (v | v << 16) & UINT64_C(0x001f0000ff0000ff);
    v = (v | v << 8) & UINT64_C(0x100f00f00f00f00f);
    v = (v | v << 4) & UINT64_C(0x10c30c30c30c30c3);
    return (v | v << 2) & UINT64_C(0x1249249249249249);
}

static pbr_result make_keys(void *user, size_t begin, size_t end) {
    const struct keys *keys = user;
    const double last = (1 << MORTON_BITS) - 1;
    for (size_t i = begin; i < end; i++) {
        double p[3];
        points_position(keys->points, keys->entries[i].value, p);
        uint64_t key = 0;
        for (int k = 0; k < 3; k++) key |= spread((uint64_t)fmin((p[k] - keys->minimum[k]) * keys->scale, last)) << k;
        keys->entries[i].key = key;
    }
    return PBR_OK;
}

pbr_result morton_sort(const pbr_points *points, uint32_t threads, const double minimum[3], double extent,
                       struct sort_entry *entries, size_t count) {
    pbr_instance *instance = points->instance;
    struct keys keys = {.points = points, .entries = entries};
    struct sort_entry *spare = pbr_allocate(instance, count, sizeof *spare), *sorted = NULL;
    if (!spare) return PBR_ERROR_OUT_OF_MEMORY;
    memcpy(keys.minimum, minimum, sizeof keys.minimum);
    if (extent > DBL_MIN) keys.scale = (1 << MORTON_BITS) / extent;
    pbr_result result = pbr_parallel(instance, count, threads > 1 ? GRAIN : count, make_keys, &keys);
    if (result == PBR_OK) result = sort_by_key(instance, threads, entries, spare, count, 3 * MORTON_BITS, &sorted);
    if (result == PBR_OK && sorted == spare) memcpy(entries, spare, count * sizeof *spare);
    pbr_free(instance, spare);
    return result;
}
