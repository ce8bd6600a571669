/* The shape of POP hierarchies, and the codes of their nodes. SPDX-License-Identifier: MIT */
#include "pop.h"

/* ---- Shape ---- */

/* The first of n nodes in part j of 2^splits. Products of two numbers below 2^32. */
static uint64_t part_begin(uint64_t n, uint64_t j, uint32_t splits) {
    return j * n >> splits;
}

/* The part that node i is in: the last one that does not begin after it. */
static uint64_t part_of(uint64_t n, uint64_t i, uint32_t splits) {
    return (((i + 1) << splits) - 1) / n;
}

/* Parts have floor or ceiling of n / 2^splits nodes: 2 to 4, or 4 and 5. */
static void set_groups(struct pop_level *level) {
    while (level->count > UINT64_C(5) << level->splits) level->splits++;
    level->has_fives = level->count > UINT64_C(4) << level->splits;
}

static uint64_t group_count(const struct pop_level *level) {
    const uint64_t parts = UINT64_C(1) << level->splits;
    return level->has_fives ? level->count - 3 * parts : parts;
}

void pop_shape_of(uint64_t count, struct pop_shape *shape) {
    uint64_t before = 0;
    *shape = (struct pop_shape){0};
    for (; count > 0; count = count > 1 ? group_count(&shape->levels[shape->level_count - 1]) : 0) {
        struct pop_level *level = &shape->levels[shape->level_count++];
        level->count = count;
        if (count > 1) set_groups(level);
        shape->nodes += count;
    }
    for (uint32_t l = shape->level_count; l-- > 0; before += shape->levels[l].count) shape->levels[l].first = before;
}

/* A group of five becomes one of two and one of three, so before part j there are as many groups more as there are fives. */
uint32_t pop_children(const struct pop_shape *shape, uint32_t level, uint64_t index, uint64_t *first) {
    const struct pop_level *below = &shape->levels[level - 1];
    const uint64_t n = below->count, groups = shape->levels[level].count;
    const uint64_t part = below->has_fives ? part_of(groups, index, below->splits) : index;
    uint64_t begin = part_begin(n, part, below->splits), end = part_begin(n, part + 1, below->splits);
    if (end - begin > POP_CHILDREN) {
        const uint64_t middle = part_begin(n, 2 * part + 1, below->splits + 1);
        if (index == part_begin(groups, part, below->splits)) end = middle;
        else begin = middle;
    }
    *first = begin;
    return (uint32_t)(end - begin);
}

uint64_t pop_parent(const struct pop_shape *shape, uint32_t level, uint64_t index) {
    const struct pop_level *own = &shape->levels[level];
    const uint64_t n = own->count, part = part_of(n, index, own->splits);
    if (!own->has_fives) return part;
    const bool is_five = part_begin(n, part + 1, own->splits) - part_begin(n, part, own->splits) > POP_CHILDREN;
    return part_begin(shape->levels[level + 1].count, part, own->splits) +
           (is_five && index >= part_begin(n, 2 * part + 1, own->splits + 1));
}

/* ---- Codes ---- */

int16_t pop_encode_coordinate(const struct pop *pop, double coordinate) {
    const double code = rint(coordinate / (double)pop->position_step), most = POP_POSITION_CODES;
    return (int16_t)fmin(fmax(code, -most), most);
}

uint32_t pop_encode_radius(const struct pop *pop, double radius) {
    const uint32_t last = (1u << POP_RADIUS_BITS) - 1;
    const double steps = ceil(radius / (double)pop->radius_step);
    if (!(steps < (double)pop_decode_size(last))) return last;
    uint32_t whole = (uint32_t)steps, exponent = 0;
    if (whole < 1024) return whole;
    while (whole >> exponent >= 2048) exponent++;
    const uint32_t rounded = (whole >> exponent) + (whole & ((1u << exponent) - 1) ? 1 : 0); /* to 2048 at most */
    return ((exponent + 1) << 10) + rounded - 1024;
}

void pop_encode_normal(const double n[3], int8_t out[2]) {
    const double sum = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
    if (!(sum > 0) || !isfinite(sum)) {
        out[0] = out[1] = POP_NO_NORMAL;
        return;
    }
    double u = n[0] / sum, v = n[1] / sum;
    if (n[2] < 0) {
        const double folded = (1 - fabs(v)) * (u < 0 ? -1 : 1);
        v = (1 - fabs(u)) * (v < 0 ? -1 : 1);
        u = folded;
    }
    out[0] = (int8_t)lrint(u * 127);
    out[1] = (int8_t)lrint(v * 127);
    if (out[0] == -127 && out[1] == -127) out[0] = out[1] = 127; /* that is how struct splat says -z */
}

uint32_t pop_encode_cone(double half_angle) {
    static const double sines[] = POP_CONE_SINES;
    const double room = 1e-5; /* for cuts, which compute in float */
    for (uint32_t code = 0; code < POP_NO_CONE; code++)
        if (half_angle + room <= asin(sines[code])) return code;
    return POP_NO_CONE;
}
