/* Ordering leaves in space: halves across the longest side, at gaps where there are any. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "qsplat_build.h"

struct extent {
    float low, length, least_radius;
    int axis; /* the longest */
};

static struct extent measure(const struct leaf *leaves, size_t count) {
    float low[3], high[3], least = leaves->sphere.radius;
    memcpy(low, leaves->sphere.centre, sizeof low);
    memcpy(high, low, sizeof high);
    for (size_t i = 1; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            const float c = leaves[i].sphere.centre[k];
            low[k] = c < low[k] ? c : low[k];
            high[k] = c > high[k] ? c : high[k];
        }
        least = leaves[i].sphere.radius < least ? leaves[i].sphere.radius : least;
    }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    return (struct extent){low[axis], high[axis] - low[axis], least, axis};
}

static void swap_leaves(struct leaf *a, struct leaf *b) {
    const struct leaf t = *a;
    *a = *b;
    *b = t;
}

enum { LOOKED_AT = 64 /* leaves at once */ };

/* Leaves on the wrong side of a pivot, of some that were looked at; `next` of them comes next. */
struct misplaced {
    struct leaf *leaves[LOOKED_AT];
    size_t next, count;
};

static bool is_empty(const struct misplaced *side) {
    return side->next == side->count;
}

/* From *at upwards, until there is one or `end` is reached. No branch depends on a leaf: of such branches every other one would be
 * mispredicted, which costs more than all else here (Edelkamp & Weiss 2016). */
static void look_up(struct misplaced *side, struct leaf **at, struct leaf *end, int axis, float pivot) {
    struct leaf *leaf = *at;
    while (is_empty(side) && leaf < end) {
        const struct leaf *stop = end - leaf > LOOKED_AT ? leaf + LOOKED_AT : end;
        for (side->next = side->count = 0; leaf < stop; leaf++) {
            side->leaves[side->count] = leaf;
            side->count += !(leaf->sphere.centre[axis] < pivot);
        }
    }
    *at = leaf;
}

/* From what is before *at downwards, likewise. */
static void look_down(struct misplaced *side, struct leaf **at, struct leaf *end, int axis, float pivot) {
    struct leaf *leaf = *at;
    while (is_empty(side) && leaf > end) {
        const struct leaf *stop = leaf - end > LOOKED_AT ? leaf - LOOKED_AT : end;
        for (side->next = side->count = 0; leaf > stop;) {
            side->leaves[side->count] = --leaf;
            side->count += !(leaf->sphere.centre[axis] > pivot);
        }
    }
    *at = leaf;
}

/* Where to part leaves: near the ranked one, and as a rule a little beyond it on the side where more of them are, which is then
 * done with (after Floyd & Rivest 1975). Judged by some from all over, as neighbours are often alike. */
static float choose_pivot(const struct leaf *leaves, size_t count, size_t rank, int axis) {
    enum { MANY = 1024 /* fewer take longer with than without */, MOST = 128 };
    if (count < MANY) return leaves[rank].sphere.centre[axis];
    struct leaf some[MOST];
    const size_t size = count / 16 < MOST ? count / 16 : MOST;
    for (size_t i = 0; i < size; i++) some[i] = leaves[i * (count / size)];
    const float share = (float)rank / (float)count, deviation = sqrtf((float)size * share * (1 - share));
    const float at = (float)size * share + (2 * rank < count ? deviation : -deviation), last = (float)(size - 1);
    const size_t chosen = at > 0 ? (size_t)(at < last ? at : last) : 0;
    select_least(some, size, chosen, axis, USUAL_LOOKS);
    return some[chosen].sphere.centre[axis];
}

/* The median of the medians of fives (Blum, Floyd, Pratt, Rivest & Tarjan 1973): either side of it has three tenths or so, if few
 * are equal to it. Leaves, more than four, are reordered. */
static float choose_sure_pivot(struct leaf *leaves, size_t count, int axis) {
    const size_t fives = count / 5;
    for (size_t i = 0; i < fives; i++) {
        struct leaf *five = leaves + 5 * i;
        for (int k = 1; k < 5; k++)
            for (int j = k; j > 0 && five[j].sphere.centre[axis] < five[j - 1].sphere.centre[axis]; j--)
                swap_leaves(&five[j], &five[j - 1]);
        swap_leaves(&five[2], &leaves[i]); /* of a five that is done with, or its own */
    }
    select_least(leaves, fives, fives / 2, axis, 0);
    return leaves[fives / 2].sphere.centre[axis];
}

/* FIND (Hoare 1961). */
void select_least(struct leaf *leaves, size_t count, size_t rank, int axis, int usual_looks) {
    struct leaf *low = leaves, *high = leaves + count, *const ranked = leaves + rank;
    struct misplaced lower, upper;
    for (size_t looked_at = 0; high - low > 1;) {
        const size_t left = (size_t)(high - low);
        const bool is_sure = left >= 5 && looked_at >= count * (size_t)usual_looks;
        const float pivot = is_sure ? choose_sure_pivot(low, left, axis) : choose_pivot(low, left, (size_t)(ranked - low), axis);
        looked_at += left;
        struct leaf *i = low, *j = high, *bottom = low, *top = high; /* what is outside these two is done */
        lower.next = lower.count = upper.next = upper.count = 0;
        for (;;) {
            look_up(&lower, &i, top, axis, pivot);
            look_down(&upper, &j, bottom, axis, pivot);
            if (is_empty(&lower) || is_empty(&upper) || lower.leaves[lower.next] > upper.leaves[upper.next]) break;
            bottom = lower.leaves[lower.next++];
            top = upper.leaves[upper.next++];
            swap_leaves(bottom++, top);
        }
        /* Before i all are at most the pivot, from j on at least. What was looked at beyond the other may have been swapped. */
        i = is_empty(&lower) || lower.leaves[lower.next] > top ? top : lower.leaves[lower.next];
        j = is_empty(&upper) || upper.leaves[upper.next] < bottom ? bottom : upper.leaves[upper.next] + 1;
        if (bottom > top) i = bottom, j = top;
        if (j <= ranked) low = i;
        if (ranked < i) high = j;
    }
}

/* ---- Halves ---- */

/* Of so many leaves, more than a node has children. */
struct halves {
    size_t whole; /* leaves of a child that lacks none */
    size_t first; /* of the halves: a multiple of that */
};

/* Neither side has less than an eighth. */
static bool is_fair(size_t count, size_t half) {
    return half >= count / 8 && count - half >= count / 8;
}

/* Children are the largest whole subtrees, but where this leaves little for the other half: its leaves would have a sphere as large
 * as all of it not far above them. */
static struct halves halves_of(size_t count) {
    struct halves halves = {QSPLAT_CHILDREN, 0};
    while (halves.whole < (count + 3) / 4) halves.whole *= 4;
    for (;; halves.whole /= 4) {
        halves.first = ((count + halves.whole - 1) / halves.whole + 1) / 2 * halves.whole;
        if (halves.whole == QSPLAT_CHILDREN || is_fair(count, halves.first)) return halves;
    }
}

/* A group of siblings that has leaves on both sides of a gap has a sphere as wide, and no code below has a radius under a 26th of
 * that width. So a gap of so many radii makes leaves too large unless it lies between subtrees, which have levels enough to come
 * down to the leaves' size. Narrower ones are left alone: a cut there leaves subtrees that are not whole, which costs more. So are
 * those that chance makes, of less than so many times what as many leaves on a surface are apart. */
#define GAP_RADII 16
#define GAP_SPACINGS 2

enum { BINS = 64 }; /* one bit each of a word */

static int bin_of(const struct leaf *leaf, const struct extent *extent, float scale) {
    const float bin = (leaf->sphere.centre[extent->axis] - extent->low) * scale;
    return bin < BINS ? (int)bin : BINS - 1;
}

/* How many leaves are below the widest gap along the axis that is fair; 0 if there is none. */
static size_t find_gap(const struct leaf *leaves, size_t count, const struct extent *extent) {
    enum { BINS_LEAST = BINS / 8 /* a power of two */, SAMPLES = 2 * BINS };
    if (!(extent->length > GAP_RADII * extent->least_radius && extent->length <= FLT_MAX)) return 0;
    const float scale = BINS / extent->length, cell = extent->length / BINS;
    /* One cell less than counts. */
    size_t widest = (size_t)fmaxf(BINS_LEAST, GAP_SPACINGS * BINS / sqrtf((float)count)) - 1;
    if (!(scale <= FLT_MAX)) return 0;
    /* As a rule a few of the leaves show that no gap is wide enough. */
    uint64_t empty_from = UINT64_MAX; /* bins that, with as many after them as a gap has, may be empty */
    for (size_t i = 0; i < count; i += count / SAMPLES + 1) empty_from &= ~(UINT64_C(1) << bin_of(&leaves[i], extent, scale));
    for (int k = 1; k < BINS_LEAST; k *= 2) empty_from &= empty_from >> k;
    if (!empty_from) return 0;
    size_t counts[BINS] = {0}, empty = 0, below = 0, at = 0, small = 0;
    for (size_t i = 0; i < count; i++) counts[bin_of(&leaves[i], extent, scale)]++;
    for (int bin = 0; bin < BINS; bin++) {
        if (counts[bin] == 0) {
            empty++;
            continue;
        }
        if (empty > widest && is_fair(count, below)) {
            widest = empty;
            at = below;
        }
        below += counts[bin];
        empty = 0;
    }
    for (size_t i = 0; i < count && at > 0; i++) small += GAP_RADII * leaves[i].sphere.radius < (float)widest * cell;
    return small >= (count + 3) / 4 ? at : 0;
}

/* Where leaves are split follows from which they are, not from their order: runs that are made again must come out the same. */
static size_t split(struct leaf *leaves, size_t count, bool are_ordered) {
    const struct extent extent = measure(leaves, count);
    const size_t gap = find_gap(leaves, count, &extent), at = gap > 0 ? gap : halves_of(count).first;
    if (!are_ordered) select_least(leaves, count, at, extent.axis, USUAL_LOOKS);
    return at;
}

/* ---- Down to runs ---- */

struct piece {
    size_t first, count, before; /* before: of its count, those of its first part, once it is split */
    uint32_t parts;              /* the first of two that follow one another; 0: a run */
};

struct pieces {
    struct leaf *leaves;
    struct piece *all;
    size_t first; /* of a round */
};

static pbr_result halve_pieces(void *user, size_t begin, size_t end) {
    const struct pieces *pieces = user;
    for (size_t i = pieces->first + begin; i < pieces->first + end; i++) {
        struct piece *piece = &pieces->all[i];
        if (piece->count > RUN) piece->before = split(pieces->leaves + piece->first, piece->count, false);
    }
    return PBR_OK;
}

/* Rounds, in which every piece that is longer than a run is parted in two, until there is none. */
static pbr_result halve_all(pbr_instance *instance, struct pieces *pieces, const struct progress *progress, size_t *pieces_count) {
    const double usual = 2 * (double)pieces->all[0].count / RUN;
    size_t count = 1;
    pbr_result result = PBR_OK;
    while (result == PBR_OK && pieces->first < count) {
        const size_t end = count;
        result = progress_report(progress, "sorting", fmin((double)count / usual, 1));
        if (result == PBR_OK) result = pbr_parallel(instance, end - pieces->first, 1, halve_pieces, pieces);
        for (; result == PBR_OK && pieces->first < end; pieces->first++) {
            struct piece *piece = &pieces->all[pieces->first];
            if (piece->count <= RUN) continue;
            piece->parts = (uint32_t)count;
            pieces->all[count++] = (struct piece){.first = piece->first, .count = piece->before};
            pieces->all[count++] = (struct piece){.first = piece->first + piece->before, .count = piece->count - piece->before};
        }
    }
    *pieces_count = count;
    return result == PBR_OK ? progress_report(progress, "sorting", 1) : result;
}

/* A branch has the halves as children, or, of what is larger than a child should be, the halves' halves. */
static place add_piece(struct builder *builder, const struct piece *all, const struct piece *piece, uint64_t first) {
    if (!piece->parts) {
        builder->runs[builder->run_count] = (struct run){.first = first + piece->first, .count = (uint32_t)piece->count};
        return TIP | (place)builder->run_count++;
    }
    struct node node = {.child_count = 0};
    for (uint32_t i = 0; i < 2; i++) {
        const struct piece *half = &all[piece->parts + i];
        const bool is_child = half->count <= halves_of(piece->count).whole || !half->parts;
        for (uint32_t k = 0; k < (is_child ? 1 : 2); k++)
            node.children[node.child_count++] = add_piece(builder, all, is_child ? half : &all[half->parts + k], first);
    }
    builder->branches[builder->branch_count] = (struct branch){.node = node};
    return (place)builder->branch_count++;
}

pbr_result order_runs(struct builder *builder, struct leaf *leaves, size_t count, uint64_t first, const struct progress *progress,
                      place *root) {
    /* What is halved is more than a run, and neither half less than an eighth of it. */
    const size_t most = 2 * (count / (RUN / 8) + 1);
    struct pieces pieces = {leaves, pbr_allocate(builder->instance, most, sizeof *pieces.all), 0};
    size_t piece_count = 0;
    if (!pieces.all) return PBR_ERROR_OUT_OF_MEMORY;
    pieces.all[0].count = count;
    pbr_result result = halve_all(builder->instance, &pieces, progress, &piece_count);
    if (result == PBR_OK) result = builder_grow(builder, piece_count / 2 + 1, piece_count / 2);
    if (result == PBR_OK) *root = add_piece(builder, pieces.all, &pieces.all[0], first);
    pbr_free(builder->instance, pieces.all);
    return result;
}

/* ---- Within runs ---- */

/* As branches do (add_piece): halves are children, or the halves of a half that is larger than a whole child. */
uint32_t split_leaves(struct leaf *leaves, size_t count, bool are_ordered, size_t starts[QSPLAT_CHILDREN + 1]) {
    uint32_t children = 0;
    if (count <= QSPLAT_CHILDREN) {
        while (children < count) starts[children] = children, children++;
    } else {
        const size_t half = split(leaves, count, are_ordered), halves[3] = {0, half, count};
        for (int i = 0; i < 2; i++) {
            const size_t first = halves[i], some = halves[i + 1] - first;
            starts[children++] = first;
            if (some > halves_of(count).whole) starts[children++] = first + split(leaves + first, some, are_ordered);
        }
    }
    starts[children] = count;
    return children;
}
