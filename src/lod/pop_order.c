/* The order of a POP hierarchy's leaves: splits at the median along the longest side, down to groups. SPDX-License-Identifier: MIT
 */
#include <string.h>

#include "pop_build.h"

/* Part j of 2^splits of the items. */
struct part {
    uint64_t number;
    uint32_t splits;
};

struct ordering {
    struct pop_item *items;
    uint64_t count;
    uint32_t splits; /* of the parts to be worked on */
};

static uint64_t begin_of(const struct ordering *ordering, struct part part) {
    return part.number * ordering->count >> part.splits;
}

static int longest_axis(const struct pop_item *items, uint64_t count) {
    int32_t low[3], high[3];
    int longest = 0;
    memcpy(low, items[0].at, sizeof low);
    memcpy(high, items[0].at, sizeof high);
    for (uint64_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const int32_t v = items[i].at[k];
            low[k] = v < low[k] ? v : low[k];
            high[k] = v > high[k] ? v : high[k];
        }
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[longest] - low[longest]) longest = k;
    return longest;
}

/* ---- Selection ---- */

static inline void swap(struct pop_item *a, struct pop_item *b) {
    const struct pop_item kept = *a;
    *a = *b;
    *b = kept;
}

static int32_t middle_of(int32_t a, int32_t b, int32_t c) {
    const int32_t low = a < b ? a : b, high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

/* Of three, or of nine where that costs little. */
static int32_t guess_median(const struct pop_item *items, uint64_t count, int axis) {
    int32_t guess[3];
    if (count < 64) return middle_of(items[0].at[axis], items[count / 2].at[axis], items[count - 1].at[axis]);
    for (uint64_t i = 0; i < 3; i++)
        guess[i] = middle_of(items[(3 * i) * (count - 1) / 8].at[axis], items[(3 * i + 1) * (count - 1) / 8].at[axis],
                             items[(3 * i + 2) * (count - 1) / 8].at[axis]);
    return middle_of(guess[0], guess[1], guess[2]);
}

/* The value of the item of a rank, by halving the range of values: slow, but the same for any input. */
static int32_t find_value(const struct pop_item *items, uint64_t count, uint64_t rank, int axis) {
    int64_t low = -(int64_t)POP_ITEM_EXTENT, high = POP_ITEM_EXTENT;
    while (low < high) { /* the least value that more than `rank` items do not exceed */
        const int64_t middle = low + (high - low) / 2;
        uint64_t below = 0;
        for (uint64_t i = 0; i < count; i++) below += items[i].at[axis] <= middle;
        if (below > rank) high = middle;
        else low = middle + 1;
    }
    return (int32_t)low;
}

/* Those below the value first, then those equal to it, then those above. */
static void divide(struct pop_item *items, uint64_t count, int axis, int32_t value, uint64_t *equal, uint64_t *above) {
    uint64_t low = 0, high = count;
    for (uint64_t i = 0; i < high;) {
        const int32_t v = items[i].at[axis];
        if (v < value) swap(&items[i++], &items[low++]);
        else if (v > value) swap(&items[i], &items[--high]);
        else i++;
    }
    *equal = low;
    *above = high;
}

/* The first `rank` items become those with the smallest coordinates. Quickselect, which hostile inputs may make slow: after some
 * work the value is found the other way. */
static void split_at(struct pop_item *items, uint64_t count, uint64_t rank, int axis) {
    enum { PATIENCE = 8 }; /* some three are usual */
    const uint64_t most = PATIENCE * count;
    for (uint64_t work = 0; count > 1;) {
        uint64_t equal, above;
        const int32_t value = work > most ? find_value(items, count, rank, axis) : guess_median(items, count, axis);
        work += count;
        divide(items, count, axis, value, &equal, &above);
        if (rank >= equal && rank <= above) return;
        if (rank < equal) count = equal;
        else items += above, rank -= above, count -= above;
    }
}

/* ---- Splits ---- */

/* False where the part is a group: it was not to be split. */
static bool split(const struct ordering *ordering, struct part part) {
    const uint64_t begin = begin_of(ordering, part), end = begin_of(ordering, (struct part){part.number + 1, part.splits});
    if (end - begin <= POP_CHILDREN) return false;
    const uint64_t middle = begin_of(ordering, (struct part){2 * part.number + 1, part.splits + 1});
    struct pop_item *items = ordering->items + begin;
    split_at(items, end - begin, middle - begin, longest_axis(items, end - begin));
    return true;
}

static void split_all(const struct ordering *ordering, struct part part) {
    if (!split(ordering, part)) return;
    split_all(ordering, (struct part){2 * part.number, part.splits + 1});
    split_all(ordering, (struct part){2 * part.number + 1, part.splits + 1});
}

static pbr_result split_once_work(void *user, size_t begin, size_t end) {
    const struct ordering *ordering = user;
    for (size_t i = begin; i < end; i++) split(ordering, (struct part){i, ordering->splits});
    return PBR_OK;
}

static pbr_result split_all_work(void *user, size_t begin, size_t end) {
    const struct ordering *ordering = user;
    for (size_t i = begin; i < end; i++) split_all(ordering, (struct part){i, ordering->splits});
    return PBR_OK;
}

/* The first splits level by level, since only their parts can be shared out. */
pbr_result pop_order(pbr_instance *instance, struct pop_item *items, uint64_t count, const struct progress *progress) {
    enum { SHARED = 6, FEW = 1 << 12 /* items, that no thread is started for */ };
    struct ordering ordering = {.items = items, .count = count};
    pbr_result result = PBR_OK;
    if (count <= FEW) {
        split_all(&ordering, (struct part){0, 0});
        return PBR_OK;
    }
    for (; ordering.splits < SHARED && result == PBR_OK; ordering.splits++) {
        result = progress_report(progress, "splitting", ordering.splits / 20.0);
        if (result == PBR_OK) result = pbr_parallel(instance, (size_t)1 << ordering.splits, 1, split_once_work, &ordering);
    }
    if (result == PBR_OK) result = pbr_parallel(instance, (size_t)1 << ordering.splits, 1, split_all_work, &ordering);
    return result == PBR_OK ? progress_report(progress, "splitting", 1) : result;
}
