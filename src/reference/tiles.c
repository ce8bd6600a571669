/* Elements are listed by tile in two passes, counting and filling, for as many tiles at a time as a bounded list holds.
 * SPDX-License-Identifier: MIT */
#include "tiles.h"

#include <stdatomic.h>

#include "sort.h"

enum {
    RUN = 512,             /* elements whose boxes are found at a time */
    MOST_LISTED = 1 << 25, /* elements listed at once (a single tile may have more): 256 MiB */
    REPORTS = 32
};

struct work {
    const struct tiling *tiling;
    size_t columns, rows;
    atomic_size_t *counts; /* elements of each tile; while the lists are filled, how many are in */
    size_t *ends;          /* of each tile's list in `elements`, since the first tile of the batch */
    uint64_t *elements;
    size_t first, end; /* tiles of the batch */
    size_t slice;      /* first tile or element of those being worked on */
};

/* Calls back for each tile of the batch that an element may touch. */
static pbr_result visit(struct work *work, size_t first, size_t end, void (*with)(struct work *, size_t tile, uint64_t element)) {
    int32_t boxes[RUN][4];
    pbr_result result = work->tiling->find_boxes(work->tiling->user, first, end - first, boxes);
    for (size_t i = first; i < end && result == PBR_OK; i++) {
        const int32_t *box = boxes[i - first];
        if (box[0] >= box[2] || box[1] >= box[3]) continue;
        for (size_t row = (size_t)box[1] / TILE_SIDE; row <= (size_t)(box[3] - 1) / TILE_SIDE; row++)
            for (size_t column = (size_t)box[0] / TILE_SIDE; column <= (size_t)(box[2] - 1) / TILE_SIDE; column++) {
                const size_t tile = row * work->columns + column;
                if (tile >= work->first && tile < work->end) with(work, tile, i);
            }
    }
    return result;
}

static void count_one(struct work *work, size_t tile, uint64_t element) {
    (void)element;
    atomic_fetch_add_explicit(&work->counts[tile], 1, memory_order_relaxed);
}
static pbr_result count_run(void *user, size_t begin, size_t end) {
    struct work *work = user;
    return visit(work, work->slice + begin, work->slice + end, count_one);
}

static void list_one(struct work *work, size_t tile, uint64_t element) {
    const size_t before = tile > work->first ? work->ends[tile - 1] : 0;
    work->elements[before + atomic_fetch_add_explicit(&work->counts[tile], 1, memory_order_relaxed)] = element;
}
static pbr_result list_run(void *user, size_t begin, size_t end) {
    struct work *work = user;
    return visit(work, work->slice + begin, work->slice + end, list_one);
}

static int compare(const void *a, const void *b) {
    const uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return (p > q) - (p < q);
}

static pbr_result draw_tiles(void *user, size_t begin, size_t end) {
    const struct work *work = user;
    const struct tiling *tiling = work->tiling;
    for (size_t tile = work->slice + begin; tile < work->slice + end; tile++) {
        const size_t before = tile > work->first ? work->ends[tile - 1] : 0, count = work->ends[tile] - before;
        const int32_t x = (int32_t)(tile % work->columns * TILE_SIDE), y = (int32_t)(tile / work->columns * TILE_SIDE);
        const int32_t right = tiling->width - x < TILE_SIDE ? tiling->width : x + TILE_SIDE;
        const int32_t top = tiling->height - y < TILE_SIDE ? tiling->height : y + TILE_SIDE;
        if (count == 0) continue;
        sort_in_place(work->elements + before, count, sizeof *work->elements, compare);
        const pbr_result result = tiling->draw(tiling->user, (const int32_t[4]){x, y, right, top}, work->elements + before, count);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* Calls `run` over the tiles or elements [first, end), so often that the calling thread can report. Listing is a part of drawing,
 * which stands still meanwhile. */
static pbr_result in_slices(struct work *work, size_t first, size_t end, size_t grain, pbr_range_fn run) {
    const struct tiling *tiling = work->tiling;
    const size_t tiles = work->columns * work->rows, slice = (run == draw_tiles ? tiles : (size_t)tiling->count) / REPORTS + grain;
    for (work->slice = first; work->slice < end; work->slice += slice) {
        const size_t rest = end - work->slice;
        const char *stage = run == count_run ? "sorting into tiles" : "drawing";
        const double fraction = run == count_run  ? (double)work->slice / (double)tiling->count
                                : run == list_run ? (double)work->first / (double)tiles
                                                  : (double)work->slice / (double)tiles;
        if (tiling->progress && !tiling->progress(tiling->progress_user, stage, fraction)) return PBR_ERROR_CANCELLED;
        const pbr_result result = pbr_parallel(tiling->instance, rest < slice ? rest : slice, grain, run, work);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* The tiles from work->first on whose lists fit together. Returns how long they are. */
static size_t choose_batch(struct work *work) {
    const size_t tiles = work->columns * work->rows;
    size_t listed = 0;
    for (work->end = work->first; work->end < tiles; work->end++) {
        const size_t count = atomic_load(&work->counts[work->end]);
        if (work->end > work->first && (listed >= MOST_LISTED || count > MOST_LISTED - listed)) break;
        work->ends[work->end] = listed += count;
        atomic_store(&work->counts[work->end], 0);
    }
    return listed;
}

static pbr_result draw_batch(struct work *work) {
    const size_t listed = choose_batch(work);
    if (listed == 0) return PBR_OK;
    work->elements = pbr_allocate(work->tiling->instance, listed, sizeof *work->elements);
    pbr_result result = work->elements ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = in_slices(work, 0, (size_t)work->tiling->count, RUN, list_run);
    if (result == PBR_OK) result = in_slices(work, work->first, work->end, 1, draw_tiles);
    pbr_free(work->tiling->instance, work->elements);
    return result;
}

pbr_result tiles_draw(const struct tiling *tiling) {
    struct work work = {.tiling = tiling,
                        .columns = ((size_t)tiling->width + TILE_SIDE - 1) / TILE_SIDE,
                        .rows = ((size_t)tiling->height + TILE_SIDE - 1) / TILE_SIDE};
    const size_t tiles = work.columns * work.rows;
    work.end = tiles;
    work.counts = pbr_allocate(tiling->instance, tiles, sizeof *work.counts);
    work.ends = pbr_allocate(tiling->instance, tiles, sizeof *work.ends);
    pbr_result result = work.counts && work.ends ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = in_slices(&work, 0, (size_t)tiling->count, RUN, count_run);
    for (; result == PBR_OK && work.first < tiles; work.first = work.end) result = draw_batch(&work);
    if (result == PBR_OK && tiling->progress && !tiling->progress(tiling->progress_user, "drawing", 1))
        result = PBR_ERROR_CANCELLED;
    pbr_free(tiling->instance, work.counts);
    pbr_free(tiling->instance, work.ends);
    return result;
}
