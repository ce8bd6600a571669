/* Ordering leaves in space: halves across the longest side. SPDX-License-Identifier: MIT */
#include <string.h>

#include "qsplat_build.h"

static int longest_axis(const struct leaf *leaves, size_t count) {
    float low[3], high[3];
    memcpy(low, leaves->sphere.centre, sizeof low);
    memcpy(high, low, sizeof high);
    for (size_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const float c = leaves[i].sphere.centre[k];
            low[k] = c < low[k] ? c : low[k];
            high[k] = c > high[k] ? c : high[k];
        }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    return axis;
}

static void swap_leaves(struct leaf *a, struct leaf *b) {
    const struct leaf t = *a;
    *a = *b;
    *b = t;
}

/* FIND (Hoare 1961): the `rank` least along the axis come first. */
static void select_least(struct leaf *leaves, size_t count, size_t rank, int axis) {
    ptrdiff_t low = 0, high = (ptrdiff_t)count - 1, k = (ptrdiff_t)rank;
    while (low < high) {
        const float pivot = leaves[k].sphere.centre[axis];
        ptrdiff_t i = low, j = high;
        while (i <= j) {
            while (leaves[i].sphere.centre[axis] < pivot) i++;
            while (leaves[j].sphere.centre[axis] > pivot) j--;
            if (i <= j) swap_leaves(&leaves[i++], &leaves[j--]);
        }
        if (j < k) low = i;
        if (k < i) high = j;
    }
}

/* Where so many leaves, more than one node's children, are halved: at a multiple of the largest whole subtrees. */
static size_t half_of(size_t count) {
    size_t whole = QSPLAT_CHILDREN;
    while (whole < (count + 3) / 4) whole *= 4;
    return ((count + whole - 1) / whole + 1) / 2 * whole;
}

static void halve(struct leaf *leaves, size_t count, size_t half) {
    select_least(leaves, count, half, longest_axis(leaves, count));
}

void order_leaves(struct leaf *leaves, size_t count) {
    if (count <= QSPLAT_CHILDREN) return;
    const size_t half = half_of(count);
    halve(leaves, count, half);
    order_leaves(leaves, half);
    order_leaves(leaves + half, count - half);
}

/* All that is longer than a run, by as many threads as there are pieces. */
struct pieces {
    struct leaf *leaves;
    size_t *starts; /* of the pieces, and the end */
};

static pbr_result halve_pieces(void *user, size_t begin, size_t end) {
    const struct pieces *pieces = user;
    for (size_t i = begin; i < end; i++) {
        const size_t count = pieces->starts[i + 1] - pieces->starts[i];
        if (count > RUN) halve(pieces->leaves + pieces->starts[i], count, half_of(count));
    }
    return PBR_OK;
}

/* After a round of halves. Returns how many pieces there are now. */
static size_t cut_pieces(struct pieces *pieces, size_t count, size_t *spare) {
    size_t cut = 0;
    for (size_t i = 0; i < count; i++) {
        const size_t start = pieces->starts[i], length = pieces->starts[i + 1] - start;
        spare[cut++] = start;
        if (length > RUN) spare[cut++] = start + half_of(length);
    }
    spare[cut] = pieces->starts[count];
    memcpy(pieces->starts, spare, (cut + 1) * sizeof *spare);
    return cut;
}

pbr_result order_runs(pbr_instance *instance, struct leaf *leaves, size_t leaf_count, const struct progress *progress) {
    const size_t runs = (leaf_count + RUN - 1) / RUN;
    struct pieces pieces = {leaves, pbr_allocate(instance, runs + 1, sizeof *pieces.starts)};
    size_t *spare = pbr_allocate(instance, runs + 1, sizeof *spare), count = 1, before = 0;
    pbr_result result = pieces.starts && spare ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) pieces.starts[1] = leaf_count;
    while (result == PBR_OK && count > before) {
        result = progress_report(progress, "sorting", (double)(count - 1) / (double)runs);
        if (result == PBR_OK) result = pbr_parallel(instance, count, 1, halve_pieces, &pieces);
        before = count;
        count = cut_pieces(&pieces, count, spare);
    }
    pbr_free(instance, pieces.starts);
    pbr_free(instance, spare);
    return result == PBR_OK ? progress_report(progress, "sorting", 1) : result;
}
