/* Building a QSplat tree out of core, into a file.
 *
 * The source is read twice: to count points in the cells of a grid, and to distribute them, as leaves, over a temporary file, in
 * which buckets of cells along a Morton curve lie one after the other. Each bucket fits into memory, is ordered there, as a tree of
 * its own, and goes back to its place. Of each run only its root and its children are kept. Once the upper levels are
 * written, runs are read again, their nodes made again, and their pages written. With a source that gives the same points, every
 * number of threads makes the same file. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "container.h"
#include "core/file.h"
#include "lod.h"
#include "qsplat_build.h"

enum {
    BATCH = 1 << 16, /* points that the source is asked for at a time */
    GRID_BITS = 7,   /* of the cells, per axis */
    CELLS = 1 << (3 * GRID_BITS),
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
    struct leaf *leaves; /* of a bucket */
    uint64_t leaf_capacity;
    size_t first_run; /* of those that threads work on */
    place *roots;     /* of the buckets */
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

/* Few leaves by themselves would have a sphere as large as all of the tree not far above them, so no bucket has few. */
static pbr_result plan_buckets(struct stream *stream, uint64_t *count) {
    enum { LEAST = RUN };
    const uint64_t most = bucket_most(stream);
    uint64_t in_bucket = 0, largest = 0, done = 0;
    stream->bucket_count = 1;
    *count = 0;
    for (uint32_t cell = 0; cell < CELLS; cell++) *count += atomic_load_explicit(&stream->cell_counts[cell], memory_order_relaxed);
    for (uint32_t cell = 0; cell < CELLS; cell++) {
        const uint64_t points = atomic_load_explicit(&stream->cell_counts[cell], memory_order_relaxed);
        if (in_bucket + points > most && in_bucket >= LEAST && *count - done >= LEAST) {
            stream->bucket_count++;
            in_bucket = 0;
        }
        stream->cell_buckets[cell] = stream->bucket_count - 1;
        in_bucket += points;
        done += points;
        largest = in_bucket > largest ? in_bucket : largest;
    }
    if (largest > most + 2 * LEAST)
        pbr_log(stream->builder.instance, PBR_LOG_WARNING, PBR_OK,
                "%s: %llu points crowd into a %d-th of the box: %llu MB more than asked for are needed", stream->path,
                (unsigned long long)largest, 1 << GRID_BITS, (unsigned long long)((largest - most) * sizeof(struct leaf) >> 20));
    stream->bucket_starts = pbr_allocate(stream->builder.instance, stream->bucket_count + 1, sizeof *stream->bucket_starts);
    stream->bucket_nexts = pbr_allocate(stream->builder.instance, stream->bucket_count, sizeof *stream->bucket_nexts);
    stream->leaf_capacity = largest;
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
    struct leaf leaves[RUN];
    struct node nodes[RUN];
    struct pending queue[RUN];
    uint8_t *page;
    size_t page_capacity;
};

static void free_run(const struct stream *stream, struct run_scratch *scratch) {
    if (scratch) pbr_free(stream->builder.instance, scratch->page);
    pbr_free(stream->builder.instance, scratch);
}

/* Orders runs, makes what is kept of them, and puts the leaves back. */
static pbr_result make_runs(void *user, size_t begin, size_t end) {
    const struct stream *stream = user;
    const struct builder *builder = &stream->builder;
    struct node *nodes = pbr_allocate(builder->instance, RUN, sizeof *nodes);
    pbr_result result = nodes ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = stream->first_run + begin; i < stream->first_run + end && result == PBR_OK; i++) {
        struct run *run = &builder->runs[i];
        struct leaf *leaves = stream->leaves + (run->first - builder->runs[stream->first_run].first);
        make_run(builder, leaves, nodes, run);
        result = scratch_write(builder->instance, stream->path, stream->scratch, leaves, run->count * sizeof *leaves,
                               run->first * sizeof *leaves);
    }
    pbr_free(builder->instance, nodes);
    return result;
}

static pbr_result build_bucket(struct stream *stream, uint64_t first, uint64_t count, place *root) {
    struct builder *builder = &stream->builder;
    pbr_result result = scratch_read(builder->instance, stream->path, stream->scratch, stream->leaves,
                                     (size_t)count * sizeof *stream->leaves, first * sizeof *stream->leaves);
    stream->first_run = builder->run_count;
    if (result == PBR_OK) result = order_runs(builder, stream->leaves, (size_t)count, first, NULL, root);
    if (result != PBR_OK) return result;
    const size_t runs = builder->run_count - stream->first_run, grain = runs / (4 * pbr_instance_threads(builder->instance)) + 1;
    return pbr_parallel(builder->instance, runs, grain, make_runs, stream);
}

static pbr_result build_buckets(struct stream *stream, place *root) {
    struct builder *builder = &stream->builder;
    stream->leaves = pbr_allocate(builder->instance, (size_t)stream->leaf_capacity, sizeof *stream->leaves);
    stream->roots = pbr_allocate(builder->instance, stream->bucket_count, sizeof *stream->roots);
    if (!stream->leaves || !stream->roots) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = progress_report(builder->progress, "building", 0);
    for (uint32_t b = 0; b < stream->bucket_count && result == PBR_OK; b++) {
        const uint64_t first = stream->bucket_starts[b], end = stream->bucket_starts[b + 1];
        result = build_bucket(stream, first, end - first, &stream->roots[b]);
        if (result == PBR_OK)
            result =
                progress_report(builder->progress, "building", (double)end / (double)stream->bucket_starts[stream->bucket_count]);
    }
    pbr_free(builder->instance, stream->leaves);
    stream->leaves = NULL;
    if (result == PBR_OK) result = join_roots(builder, stream->roots, stream->bucket_count);
    *root = stream->roots[0];
    return result;
}

/* ---- Writing ---- */

static uint64_t section_place(const struct stream *stream, uint64_t node) {
    return CONTAINER_DATA + QSPLAT_SECTION_HEADER + 8 * stream->tree.link_count + node;
}

/* There is room for what was planned. */
static bool is_as_planned(const struct builder *builder, const struct run *run, const struct node *nodes, uint32_t count) {
    if (count == 0) return run->count == 1;
    const struct node *root = &nodes[count - 1];
    bool same = page_size(builder, nodes, count) == run->page_size && root->child_count == run->root.child_count;
    for (uint32_t i = 0; i < run->root.child_count && same; i++) {
        const place child = run->root.children[i];
        same = root->children[i] == child;
        if (!same || child & TIP) continue;
        same = nodes[child].child_count == run->children[i].child_count &&
               nodes[child].has_grandchildren == run->children[i].has_grandchildren;
    }
    return same;
}

static pbr_result write_run(struct stream *stream, const struct run *run, struct run_scratch *scratch) {
    const struct builder *builder = &stream->builder;
    struct sums sums;
    const pbr_result result = scratch_read(builder->instance, stream->path, stream->scratch, scratch->leaves,
                                           run->count * sizeof *scratch->leaves, run->first * sizeof *scratch->leaves);
    if (result != PBR_OK) return result;
    const uint32_t count = make_nodes(builder, scratch->leaves, run->count, true, scratch->nodes, &sums);
    if (!is_as_planned(builder, run, scratch->nodes, count))
        return pbr_log(builder->instance, PBR_LOG_ERROR, PBR_ERROR_IO, "%s: the temporary file beside it has changed",
                       stream->path);
    if (run->page_size > scratch->page_capacity) {
        pbr_free(builder->instance, scratch->page);
        scratch->page_capacity = 0;
        scratch->page = pbr_allocate(builder->instance, (size_t)run->page_size, 1);
        if (!scratch->page) return PBR_ERROR_OUT_OF_MEMORY;
        scratch->page_capacity = (size_t)run->page_size;
    }
    write_page(builder, run, scratch->leaves, scratch->nodes, scratch->queue, scratch->page);
    output_write(&stream->output, scratch->page, (size_t)run->page_size, section_place(stream, run->page_at));
    return PBR_OK;
}

static pbr_result write_pages(void *user, size_t begin, size_t end) {
    struct stream *stream = user;
    struct run_scratch *scratch = pbr_allocate(stream->builder.instance, 1, sizeof *scratch);
    pbr_result result = scratch ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end && result == PBR_OK; i++) result = write_run(stream, &stream->builder.runs[i], scratch);
    free_run(stream, scratch);
    return result;
}

static pbr_result write_upper_levels(struct stream *stream, place root) {
    struct builder *builder = &stream->builder;
    const struct qsplat_sphere sphere = make_branches(builder, root);
    if (!isfinite(sphere.radius))
        return pbr_log(builder->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_lod_build_file: points lie too far outside the box that was given");
    const pbr_result planned = plan_pages(builder, root);
    if (planned != PBR_OK) return planned;
    stream->tree.radius = sphere.radius;
    const uint64_t links_size = 8 * stream->tree.link_count;
    uint8_t *nodes = pbr_allocate(builder->instance, (size_t)builder->upper_size, 1), header[QSPLAT_SECTION_HEADER];
    uint8_t *links = pbr_allocate(builder->instance, (size_t)links_size, 1);
    const pbr_result result = nodes && links ? write_upper(builder, root, &sphere, nodes) : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) {
        const struct container_part first = {header, sizeof header};
        store_links(builder, links);
        qsplat_section_header(&stream->tree, header);
        container_write_header(&stream->output, QSPLAT_SECTION, &first, sizeof header + links_size + stream->tree.size);
        output_write(&stream->output, header, sizeof header, CONTAINER_DATA);
        output_write(&stream->output, links, (size_t)links_size, CONTAINER_DATA + sizeof header);
        output_write(&stream->output, nodes, (size_t)builder->upper_size, section_place(stream, 0));
    }
    pbr_free(builder->instance, nodes);
    pbr_free(builder->instance, links);
    return result;
}

static pbr_result write_tree(struct stream *stream, place root) {
    const struct builder *builder = &stream->builder;
    const pbr_result result = write_upper_levels(stream, root);
    if (result != PBR_OK) return result;
    return parallel_reporting(builder->instance, builder->run_count, 16, write_pages, stream, builder->progress, "encoding");
}

/* ---- All of it ---- */

static pbr_result stream_all(struct stream *stream) {
    pbr_instance *instance = stream->builder.instance;
    uint64_t count = 0;
    double extent;
    place root = 0;
    pbr_result result = create_slots(stream);
    if (result == PBR_OK) result = find_box(stream);
    if (result == PBR_OK) result = lod_choose_centre(instance, stream->minimum, stream->maximum, stream->tree.centre, &extent);
    if (result == PBR_OK) result = count_cells(stream, &count);
    if (result == PBR_OK && count < stream->desc->point_count)
        pbr_log(instance, PBR_LOG_WARNING, PBR_OK, "%s: %llu points without finite coordinates were left out", stream->path,
                (unsigned long long)(stream->desc->point_count - count));
    if (result == PBR_OK && count == 0)
        result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: the source has no points", stream->path);
    if (result == PBR_OK) builder_start(&stream->builder, extent);
    if (result == PBR_OK) result = scratch_open(instance, stream->path, &stream->scratch);
    if (result == PBR_OK) result = distribute(stream);
    free_slots(stream);
    if (result == PBR_OK) result = build_buckets(stream, &root);
    if (result == PBR_OK) result = output_open(instance, stream->path, &stream->output);
    return result == PBR_OK ? write_tree(stream, root) : result;
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
    pbr_free(instance, stream.roots);
    return result == PBR_OK ? closed : result;
}
