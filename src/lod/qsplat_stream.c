/* Building a QSplat tree out of core, into a file.
 *
 * The source is read twice: to count points in the cells of a grid, and to distribute them, as leaves, over a temporary file, in
 * which buckets of cells along a Morton curve lie one after the other. Each bucket fits into memory, is ordered there, and goes
 * back in front of what is still to be read; what is over a multiple of TAKE leaves waits for the next. Of each run only its root
 * and a few levels below are kept. Once the upper levels are written, runs are read again, and their pages written. With a source
 * that gives the same points, every number of threads makes the same file. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "container.h"
#include "core/file.h"
#include "lod.h"
#include "qsplat_build.h"

enum {
    BATCH = 1 << 16, /* points that the source is asked for at a time */
    GRID_BITS = 7,   /* of the cells, per axis */
    CELLS = 1 << (3 * GRID_BITS),
    TAKE = RUN << 4, /* leaves: subtrees two levels above runs stay whole */
    THREADS_MOST = 64
};

static const uint64_t MEMORY_DEFAULT = UINT64_C(1) << 30, MEMORY_LEAST = UINT64_C(32) << 20;
static const uint32_t LEFT_OUT = UINT32_MAX;

/* What a thread needs for a batch. */
struct slot {
    uint64_t first, count; /* of the source */
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
    uint32_t *cells;           /* or buckets; LEFT_OUT */
    struct leaf *leaves;       /* by bucket */
    uint32_t *counts, *starts; /* per bucket */
    uint64_t *places;          /* per bucket: leaf in the temporary file */
    double minimum[3], maximum[3];
};

struct stream {
    struct builder builder;
    struct qsplat tree;
    const pbr_lod_build_desc *desc;
    const char *path;
    struct output output;
    int scratch;
    struct slot *slots;
    size_t slot_count;
    double minimum[3], maximum[3], scale; /* of the grid; cells per unit */
    _Atomic uint64_t *cell_counts;
    uint32_t *cell_buckets;
    uint64_t *bucket_starts, *bucket_nexts; /* leaves in the temporary file, and the end; where the next one goes */
    uint32_t bucket_count;
    struct leaf *leaves; /* of a bucket, and what was over before */
    uint64_t leaf_capacity;
    uint64_t first_run;             /* of those that threads work on */
    const struct page **page_order; /* by their first leaf */
    uint64_t *run_pages;            /* per run: the first of its pages in that order, and the end */
};

/* ---- Reading the source ---- */

static pbr_result create_slots(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    const size_t threads = pbr_instance_threads(instance);
    stream->slot_count = 2 * (threads < THREADS_MOST ? threads : THREADS_MOST);
    stream->slots = pbr_allocate(instance, stream->slot_count, sizeof *stream->slots);
    bool done = stream->slots != NULL;
    for (size_t i = 0; i < stream->slot_count && done; i++) {
        struct slot *slot = &stream->slots[i];
        slot->positions = pbr_allocate(instance, BATCH, sizeof *slot->positions);
        slot->normals = pbr_allocate(instance, BATCH, sizeof *slot->normals);
        slot->radii = pbr_allocate(instance, BATCH, sizeof *slot->radii);
        slot->colours = pbr_allocate(instance, BATCH, sizeof *slot->colours);
        slot->cells = pbr_allocate(instance, BATCH, sizeof *slot->cells);
        slot->leaves = pbr_allocate(instance, BATCH, sizeof *slot->leaves);
        done = slot->positions && slot->normals && slot->radii && slot->colours && slot->cells && slot->leaves;
    }
    return done ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

static void free_slots(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    for (size_t i = 0; stream->slots && i < stream->slot_count; i++) {
        struct slot *slot = &stream->slots[i];
        void *const all[] = {slot->positions, slot->normals, slot->radii,  slot->colours, slot->cells,
                             slot->leaves,    slot->counts,  slot->starts, slot->places};
        for (size_t k = 0; k < sizeof all / sizeof *all; k++) pbr_free(instance, all[k]);
    }
    pbr_free(instance, stream->slots);
    stream->slots = NULL;
}

static pbr_result read_batch(const struct stream *stream, struct slot *slot) {
    const bool colours = (stream->desc->flags & PBR_LOD_BUILD_COLOURS) != 0;
    memset(slot->normals, 0, sizeof *slot->normals * (size_t)slot->count);
    memset(slot->radii, 0, sizeof *slot->radii * (size_t)slot->count);
    const pbr_lod_batch batch = {sizeof batch, slot->positions[0], slot->normals[0], colours ? slot->colours[0] : NULL,
                                 slot->radii};
    return stream->desc->source(stream->desc->source_user, slot->first, slot->count, &batch);
}

static bool is_usable(const double p[3]) {
    return fabs(p[0]) <= FLT_MAX && fabs(p[1]) <= FLT_MAX && fabs(p[2]) <= FLT_MAX;
}

/* All of the source: `work` on slots that hold the next batches, then `merge` on each in order, then `after` on all. */
static pbr_result read_source(struct stream *stream, const char *stage, pbr_range_fn work,
                              void (*merge)(struct stream *stream, struct slot *slot), pbr_range_fn after) {
    const uint64_t count = stream->desc->point_count;
    pbr_result result = progress_report(stream->builder.progress, stage, 0);
    for (uint64_t done = 0; done < count && result == PBR_OK;) {
        size_t used = 0;
        for (; used < stream->slot_count && done < count; used++) {
            struct slot *slot = &stream->slots[used];
            slot->first = done;
            slot->count = count - done < BATCH ? count - done : BATCH;
            done += slot->count;
        }
        result = pbr_parallel(stream->builder.instance, used, 1, work, stream);
        for (size_t i = 0; i < used && result == PBR_OK && merge; i++) merge(stream, &stream->slots[i]);
        if (result == PBR_OK && after) result = pbr_parallel(stream->builder.instance, used, 1, after, stream);
        if (result == PBR_OK) result = progress_report(stream->builder.progress, stage, (double)done / (double)count);
    }
    return result;
}

/* ---- The box ---- */

static pbr_result measure_batches(void *user, size_t begin, size_t end) {
    const struct stream *stream = user;
    for (size_t i = begin; i < end; i++) {
        struct slot *slot = &stream->slots[i];
        const pbr_result result = read_batch(stream, slot);
        if (result != PBR_OK) return result;
        for (int k = 0; k < 3; k++) slot->minimum[k] = INFINITY, slot->maximum[k] = -INFINITY;
        for (uint64_t p = 0; p < slot->count; p++)
            for (int k = 0; k < 3 && is_usable(slot->positions[p]); k++) {
                slot->minimum[k] = fmin(slot->minimum[k], slot->positions[p][k]);
                slot->maximum[k] = fmax(slot->maximum[k], slot->positions[p][k]);
            }
    }
    return PBR_OK;
}

static void merge_box(struct stream *stream, struct slot *slot) {
    for (int k = 0; k < 3; k++) {
        stream->minimum[k] = fmin(stream->minimum[k], slot->minimum[k]);
        stream->maximum[k] = fmax(stream->maximum[k], slot->maximum[k]);
    }
}

static pbr_result find_box(struct stream *stream) {
    const pbr_lod_build_desc *desc = stream->desc;
    bool given = false;
    for (int k = 0; k < 3; k++) given |= desc->minimum[k] != 0 || desc->maximum[k] != 0;
    memcpy(stream->minimum, desc->minimum, sizeof stream->minimum);
    memcpy(stream->maximum, desc->maximum, sizeof stream->maximum);
    if (given) return PBR_OK;
    for (int k = 0; k < 3; k++) stream->minimum[k] = INFINITY, stream->maximum[k] = -INFINITY;
    const pbr_result result = read_source(stream, "measuring", measure_batches, merge_box, NULL);
    for (int k = 0; k < 3 && !(stream->minimum[0] <= stream->maximum[0]); k++) stream->minimum[k] = stream->maximum[k] = 0;
    return result;
}

/* ---- Cells and buckets ---- */

/* Moves bit i to bit 3 i, for few bits. */
static uint32_t spread_bits(uint32_t v) {
    uint32_t out = 0;
    for (int i = 0; i < GRID_BITS; i++) out |= (v >> i & 1) << 3 * i;
    return out;
}

static uint32_t cell_of(const struct stream *stream, const uint32_t spread[1 << GRID_BITS], const double p[3]) {
    uint32_t cell = 0;
    if (!is_usable(p)) return LEFT_OUT;
    for (int k = 0; k < 3; k++) {
        const double at = fmax((p[k] - stream->minimum[k]) * stream->scale, 0);
        cell |= spread[(uint32_t)fmin(at, (1 << GRID_BITS) - 1)] << k;
    }
    return cell;
}

static pbr_result find_cells(const struct stream *stream, struct slot *slot) {
    uint32_t spread[1 << GRID_BITS];
    const pbr_result result = read_batch(stream, slot);
    if (result != PBR_OK) return result;
    for (uint32_t i = 0; i < 1 << GRID_BITS; i++) spread[i] = spread_bits(i);
    for (uint64_t p = 0; p < slot->count; p++) slot->cells[p] = cell_of(stream, spread, slot->positions[p]);
    return PBR_OK;
}

static pbr_result count_batches(void *user, size_t begin, size_t end) {
    struct stream *stream = user;
    for (size_t i = begin; i < end; i++) {
        struct slot *slot = &stream->slots[i];
        const pbr_result result = find_cells(stream, slot);
        if (result != PBR_OK) return result;
        for (uint64_t p = 0; p < slot->count; p++)
            if (slot->cells[p] != LEFT_OUT)
                atomic_fetch_add_explicit(&stream->cell_counts[slot->cells[p]], 1, memory_order_relaxed);
    }
    return PBR_OK;
}

/* Leaves of a bucket: three quarters of the memory, whatever the number of threads. */
static uint64_t bucket_most(const struct stream *stream) {
    const uint64_t asked = stream->desc->memory_bytes ? stream->desc->memory_bytes : MEMORY_DEFAULT;
    return (asked > MEMORY_LEAST ? asked : MEMORY_LEAST) / 4 * 3 / sizeof(struct leaf);
}

static pbr_result plan_buckets(struct stream *stream, uint64_t *count) {
    const uint64_t most = bucket_most(stream);
    uint64_t in_bucket = 0, largest = 0;
    stream->bucket_count = 1;
    *count = 0;
    for (uint32_t cell = 0; cell < CELLS; cell++) {
        const uint64_t points = atomic_load_explicit(&stream->cell_counts[cell], memory_order_relaxed);
        if (in_bucket > 0 && in_bucket + points > most) {
            stream->bucket_count++;
            in_bucket = 0;
        }
        stream->cell_buckets[cell] = stream->bucket_count - 1;
        in_bucket += points;
        *count += points;
        largest = in_bucket > largest ? in_bucket : largest;
    }
    if (largest > most)
        pbr_log(stream->builder.instance, PBR_LOG_WARNING, PBR_OK,
                "%s: %llu points crowd into a %d-th of the box: %llu MB more than asked for are needed", stream->path,
                (unsigned long long)largest, 1 << GRID_BITS, (unsigned long long)((largest - most) * sizeof(struct leaf) >> 20));
    stream->bucket_starts = pbr_allocate(stream->builder.instance, stream->bucket_count + 1, sizeof *stream->bucket_starts);
    stream->bucket_nexts = pbr_allocate(stream->builder.instance, stream->bucket_count, sizeof *stream->bucket_nexts);
    stream->leaf_capacity = largest + TAKE;
    if (!stream->bucket_starts || !stream->bucket_nexts) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint32_t cell = 0; cell < CELLS; cell++)
        stream->bucket_starts[stream->cell_buckets[cell] + 1] +=
            atomic_load_explicit(&stream->cell_counts[cell], memory_order_relaxed);
    for (uint32_t b = 0; b < stream->bucket_count; b++) stream->bucket_starts[b + 1] += stream->bucket_starts[b];
    memcpy(stream->bucket_nexts, stream->bucket_starts, stream->bucket_count * sizeof *stream->bucket_nexts);
    return PBR_OK;
}

static pbr_result count_cells(struct stream *stream, uint64_t *count) {
    pbr_instance *instance = stream->builder.instance;
    double extent = 0;
    for (int k = 0; k < 3; k++) extent = fmax(extent, stream->maximum[k] - stream->minimum[k]);
    stream->scale = extent > DBL_MIN ? (1 << GRID_BITS) / extent : 0;
    stream->cell_counts = pbr_allocate(instance, CELLS, sizeof *stream->cell_counts);
    stream->cell_buckets = pbr_allocate(instance, CELLS, sizeof *stream->cell_buckets);
    if (!stream->cell_counts || !stream->cell_buckets) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = read_source(stream, "counting", count_batches, NULL, NULL);
    if (result == PBR_OK) result = plan_buckets(stream, count);
    pbr_free(instance, (void *)stream->cell_counts);
    stream->cell_counts = NULL;
    return result;
}

/* ---- Distributing ---- */

/* Leaves of the batch, sorted by bucket. */
static pbr_result sort_batches(void *user, size_t begin, size_t end) {
    const struct stream *stream = user;
    const bool colours = (stream->desc->flags & PBR_LOD_BUILD_COLOURS) != 0;
    for (size_t i = begin; i < end; i++) {
        struct slot *slot = &stream->slots[i];
        const pbr_result result = find_cells(stream, slot);
        if (result != PBR_OK) return result;
        memset(slot->counts, 0, stream->bucket_count * sizeof *slot->counts);
        for (uint64_t p = 0; p < slot->count; p++)
            if (slot->cells[p] != LEFT_OUT) slot->counts[slot->cells[p] = stream->cell_buckets[slot->cells[p]]]++;
        uint32_t next = 0;
        for (uint32_t b = 0; b < stream->bucket_count; b++) {
            slot->starts[b] = next;
            next += slot->counts[b];
        }
        for (uint64_t p = 0; p < slot->count; p++)
            if (slot->cells[p] != LEFT_OUT)
                slot->leaves[slot->starts[slot->cells[p]]++] = builder_make_leaf(
                    &stream->builder, slot->positions[p], slot->normals[p], colours ? slot->colours[p] : NULL, slot->radii[p]);
    }
    return PBR_OK;
}

static void place_batch(struct stream *stream, struct slot *slot) {
    for (uint32_t b = 0; b < stream->bucket_count; b++) {
        slot->places[b] = stream->bucket_nexts[b];
        stream->bucket_nexts[b] += slot->counts[b];
    }
}

static pbr_result write_batches(void *user, size_t begin, size_t end) {
    const struct stream *stream = user;
    for (size_t i = begin; i < end; i++) {
        const struct slot *slot = &stream->slots[i];
        for (uint32_t b = 0; b < stream->bucket_count; b++) {
            const uint32_t count = slot->counts[b];
            if (count == 0) continue;
            const pbr_result result =
                scratch_write(stream->builder.instance, stream->path, stream->scratch, slot->leaves + (slot->starts[b] - count),
                              count * sizeof *slot->leaves, slot->places[b] * sizeof *slot->leaves);
            if (result != PBR_OK) return result;
        }
    }
    return PBR_OK;
}

static pbr_result distribute(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    for (size_t i = 0; i < stream->slot_count; i++) {
        struct slot *slot = &stream->slots[i];
        slot->counts = pbr_allocate(instance, stream->bucket_count, sizeof *slot->counts);
        slot->starts = pbr_allocate(instance, stream->bucket_count, sizeof *slot->starts);
        slot->places = pbr_allocate(instance, stream->bucket_count, sizeof *slot->places);
        if (!slot->counts || !slot->starts || !slot->places) return PBR_ERROR_OUT_OF_MEMORY;
    }
    pbr_result result = read_source(stream, "distributing", sort_batches, place_batch, write_batches);
    for (uint32_t b = 0; b < stream->bucket_count && result == PBR_OK; b++)
        if (stream->bucket_nexts[b] != stream->bucket_starts[b + 1])
            result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                             "pbr_lod_build_file: the source gave other points when it was read again");
    return result;
}

/* ---- Runs ---- */

/* A thread's own. */
struct run_scratch {
    struct window window;
    union {
        struct sums sums[RUN_SUMS];
        struct pending queue[PAGE_GROUPS];
    } as;
    uint8_t *page;
    size_t page_capacity;
};

static void free_run(struct stream *stream, struct run_scratch *run) {
    if (!run) return;
    window_free(&stream->builder, &run->window);
    pbr_free(stream->builder.instance, run->page);
    pbr_free(stream->builder.instance, run);
}

static struct run_scratch *create_run(struct stream *stream) {
    struct run_scratch *run = pbr_allocate(stream->builder.instance, 1, sizeof *run);
    if (!run) return NULL;
    if (window_create(&stream->builder, RUN, &run->window) == PBR_OK) return run;
    free_run(stream, run);
    return NULL;
}

static size_t run_length(const struct stream *stream, uint64_t run) {
    const uint64_t left = stream->builder.count - run * RUN;
    return left < RUN ? (size_t)left : RUN;
}

/* Orders runs, makes their nodes, and puts the leaves back. */
static pbr_result make_runs(void *user, size_t begin, size_t end) {
    struct stream *stream = user;
    struct run_scratch *scratch = create_run(stream);
    pbr_result result = scratch ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end && result == PBR_OK; i++) {
        const uint64_t run = stream->first_run + i;
        const size_t count = run_length(stream, run);
        struct leaf *leaves = stream->leaves + i * RUN;
        order_leaves(leaves, count);
        memcpy(scratch->window.leaves, leaves, count * sizeof *leaves);
        scratch->window.first = run * RUN;
        make_run(&stream->builder, &scratch->window, run, scratch->as.sums);
        result = scratch_write(stream->builder.instance, stream->path, stream->scratch, leaves, count * sizeof *leaves,
                               run * RUN * sizeof *leaves);
    }
    free_run(stream, scratch);
    return result;
}

/* What is in memory, down to runs; as many of these as are whole, or all. *held: leaves; those that are left move to the front. */
static pbr_result build_bucket(struct stream *stream, uint64_t *held, bool last) {
    pbr_instance *instance = stream->builder.instance;
    const uint64_t taken = last ? *held : *held / TAKE * TAKE;
    const size_t runs = (size_t)((taken + RUN - 1) / RUN), grain = runs / (4 * pbr_instance_threads(instance)) + 1;
    pbr_result result = order_runs(instance, stream->leaves, (size_t)*held, NULL);
    if (result == PBR_OK) result = pbr_parallel(instance, runs, grain, make_runs, stream);
    stream->first_run += runs;
    *held -= taken;
    memmove(stream->leaves, stream->leaves + taken, (size_t)*held * sizeof *stream->leaves);
    return result;
}

static pbr_result build_buckets(struct stream *stream) {
    const size_t size = sizeof *stream->leaves;
    uint64_t held = 0;
    stream->leaves = pbr_allocate(stream->builder.instance, (size_t)stream->leaf_capacity, size);
    pbr_result result = stream->leaves ? progress_report(stream->builder.progress, "building", 0) : PBR_ERROR_OUT_OF_MEMORY;
    for (uint32_t b = 0; b < stream->bucket_count && result == PBR_OK; b++) {
        const uint64_t start = stream->bucket_starts[b], count = stream->bucket_starts[b + 1] - start;
        const bool last = b + 1 == stream->bucket_count;
        result = scratch_read(stream->builder.instance, stream->path, stream->scratch, stream->leaves + held, (size_t)count * size,
                              start * size);
        held += count;
        if (result == PBR_OK && (last || held >= TAKE)) result = build_bucket(stream, &held, last);
        if (result == PBR_OK)
            result = progress_report(stream->builder.progress, "building", (double)(start + count) / (double)stream->builder.count);
    }
    pbr_free(stream->builder.instance, stream->leaves);
    stream->leaves = NULL;
    return result;
}

/* ---- Writing ---- */

/* A run's leaves and nodes again. What is kept of it for the whole tree is made again, too, and the same. */
static pbr_result load_run(struct stream *stream, uint64_t run, struct run_scratch *scratch) {
    const size_t count = run_length(stream, run);
    const pbr_result result = scratch_read(stream->builder.instance, stream->path, stream->scratch, scratch->window.leaves,
                                           count * sizeof *scratch->window.leaves, run * RUN * sizeof *scratch->window.leaves);
    if (result != PBR_OK) return result;
    scratch->window.first = run * RUN;
    make_run(&stream->builder, &scratch->window, run, scratch->as.sums);
    return PBR_OK;
}

static uint64_t section_place(const struct stream *stream, uint64_t node) {
    return CONTAINER_DATA + QSPLAT_SECTION_HEADER + 8 * stream->tree.link_count + node;
}

static uint64_t first_leaf(const struct page *page) {
    return page->parents[0].place.index << 2 * page->parents[0].place.level;
}

static int compare_pages(const void *a, const void *b) {
    const struct page *const *p = a, *const *q = b;
    const uint64_t x = first_leaf(*p), y = first_leaf(*q);
    return x < y ? -1 : x > y;
}

static pbr_result write_run_pages(struct stream *stream, struct run_scratch *scratch, uint64_t run) {
    pbr_instance *instance = stream->builder.instance;
    for (uint64_t i = stream->run_pages[run]; i < stream->run_pages[run + 1]; i++) {
        const struct page *page = stream->page_order[i];
        if (page->size > scratch->page_capacity) {
            pbr_free(instance, scratch->page);
            scratch->page_capacity = 0;
            scratch->page = pbr_allocate(instance, (size_t)page->size, 1);
            if (!scratch->page) return PBR_ERROR_OUT_OF_MEMORY;
            scratch->page_capacity = (size_t)page->size;
        }
        write_page(&stream->builder, &scratch->window, page, scratch->as.queue, scratch->page);
        output_write(&stream->output, scratch->page, (size_t)page->size, section_place(stream, page->at));
    }
    return PBR_OK;
}

static pbr_result write_pages(void *user, size_t begin, size_t end) {
    struct stream *stream = user;
    struct run_scratch *scratch = create_run(stream);
    pbr_result result = scratch ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end && result == PBR_OK; i++) {
        const uint64_t run = stream->first_run + i;
        result = load_run(stream, run, scratch);
        if (result == PBR_OK) result = write_run_pages(stream, scratch, run);
    }
    free_run(stream, scratch);
    return result;
}

/* Which pages lie in which run. */
static pbr_result sort_pages(struct stream *stream) {
    const uint64_t pages = stream->tree.link_count, runs = level_count(&stream->builder, RUN_LEVEL);
    stream->page_order = pbr_allocate(stream->builder.instance, (size_t)pages, sizeof *stream->page_order);
    stream->run_pages = pbr_allocate(stream->builder.instance, (size_t)runs + 1, sizeof *stream->run_pages);
    if (!stream->page_order || !stream->run_pages) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < pages; i++) stream->page_order[i] = &stream->builder.pages[i];
    qsort(stream->page_order, (size_t)pages, sizeof *stream->page_order, compare_pages);
    uint64_t page = 0;
    for (uint64_t run = 0; run < runs; run++) {
        stream->run_pages[run] = page;
        while (page < pages && first_leaf(stream->page_order[page]) / RUN == run) page++;
    }
    stream->run_pages[runs] = page;
    return PBR_OK;
}

static pbr_result write_upper_levels(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    const uint64_t runs = level_count(&stream->builder, RUN_LEVEL);
    const struct qsplat_sphere root = make_upper_levels(&stream->builder);
    struct run_scratch *end = create_run(stream);
    stream->tree.radius = root.radius;
    pbr_result result = end ? plan_pages(&stream->builder) : PBR_ERROR_OUT_OF_MEMORY;
    uint8_t *nodes = NULL, *links = NULL, header[QSPLAT_SECTION_HEADER];
    if (result == PBR_OK) {
        nodes = pbr_allocate(instance, (size_t)stream->builder.upper_size, 1);
        links = pbr_allocate(instance, (size_t)stream->tree.link_count, 8);
        result = nodes && links ? load_run(stream, runs - 1, end) : PBR_ERROR_OUT_OF_MEMORY;
    }
    if (result == PBR_OK) result = write_upper(&stream->builder, &end->window, &root, nodes);
    if (result == PBR_OK) {
        const struct container_part first = {header, sizeof header};
        const uint64_t size = sizeof header + 8 * stream->tree.link_count + stream->tree.size;
        store_links(&stream->builder, links);
        qsplat_section_header(&stream->tree, header);
        container_write_header(&stream->output, QSPLAT_SECTION, &first, size);
        output_write(&stream->output, header, sizeof header, CONTAINER_DATA);
        output_write(&stream->output, links, (size_t)(8 * stream->tree.link_count), CONTAINER_DATA + sizeof header);
        output_write(&stream->output, nodes, (size_t)stream->builder.upper_size, section_place(stream, 0));
    }
    free_run(stream, end);
    pbr_free(instance, nodes);
    pbr_free(instance, links);
    return result;
}

static pbr_result write_tree(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    const uint64_t runs = level_count(&stream->builder, RUN_LEVEL), slice = 64 * (uint64_t)pbr_instance_threads(instance);
    pbr_result result = write_upper_levels(stream);
    if (result == PBR_OK) result = sort_pages(stream);
    for (uint64_t done = 0; done < runs && result == PBR_OK; done += slice) {
        const size_t some = runs - done < slice ? (size_t)(runs - done) : (size_t)slice;
        stream->first_run = done;
        result = pbr_parallel(instance, some, 16, write_pages, stream);
        if (result == PBR_OK) result = progress_report(stream->builder.progress, "encoding", (double)(done + some) / (double)runs);
    }
    return result;
}

/* ---- All of it ---- */

static pbr_result stream_all(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    uint64_t count = 0;
    double extent;
    pbr_result result = create_slots(stream);
    if (result == PBR_OK) result = find_box(stream);
    if (result == PBR_OK) result = lod_choose_centre(instance, stream->minimum, stream->maximum, stream->tree.centre, &extent);
    if (result == PBR_OK) result = count_cells(stream, &count);
    if (result == PBR_OK && count < stream->desc->point_count)
        pbr_log(instance, PBR_LOG_WARNING, PBR_OK, "%s: %llu points without finite coordinates were left out", stream->path,
                (unsigned long long)(stream->desc->point_count - count));
    if (result == PBR_OK && count == 0)
        result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: the source has no points", stream->path);
    if (result == PBR_OK) result = builder_start(&stream->builder, count, extent);
    if (result == PBR_OK) result = scratch_open(instance, stream->path, &stream->scratch);
    if (result == PBR_OK) result = distribute(stream);
    free_slots(stream);
    if (result == PBR_OK) result = build_buckets(stream);
    if (result == PBR_OK) result = output_open(instance, stream->path, &stream->output);
    return result == PBR_OK ? write_tree(stream) : result;
}

pbr_result qsplat_stream(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path,
                         const struct qsplat_codes *codes) {
    const struct progress progress = {desc->progress, desc->progress_user};
    struct stream stream = {.desc = desc, .path = path, .scratch = -1};
    stream.tree.own = true;
    stream.tree.has_colours = (desc->flags & PBR_LOD_BUILD_COLOURS) != 0;
    stream.builder = (struct builder){.instance = instance, .progress = &progress, .tree = &stream.tree, .codes = codes};
    const pbr_result result = stream_all(&stream);
    const pbr_result closed = output_close(&stream.output, result == PBR_OK);
    free_slots(&stream);
    builder_end(&stream.builder);
    scratch_close(stream.scratch);
    pbr_free(instance, (void *)stream.cell_counts);
    pbr_free(instance, stream.cell_buckets);
    pbr_free(instance, stream.bucket_starts);
    pbr_free(instance, stream.bucket_nexts);
    pbr_free(instance, stream.leaves);
    pbr_free(instance, stream.page_order);
    pbr_free(instance, stream.run_pages);
    return result == PBR_OK ? closed : result;
}
