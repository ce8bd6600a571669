/* Cutting a point set into blocks along a Morton curve, and packing its splat records. SPDX-License-Identifier: MIT */
#include "blocks.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "matrix.h"
#include "sort.h"

enum {
    CHUNKS_FEW = 256,
    CHUNK_SPLATS_FEWEST = 1 << 14, /* more chunks than so many, or smaller on average: not worth their precision */
    GRAIN = 1 << 14
};

/* ---- Order ---- */

static pbr_result morton_order(const pbr_points *points, uint32_t *order) {
    pbr_instance *instance = points->instance;
    const size_t count = (size_t)points->count;
    struct sort_entry *entries = pbr_allocate(instance, count, sizeof *entries);
    if (!entries) return PBR_ERROR_OUT_OF_MEMORY;
    double extent = 0;
    for (int k = 0; k < 3; k++) extent = fmax(extent, points->maximum[k] - points->minimum[k]);
    for (size_t i = 0; i < count; i++) entries[i].value = (uint32_t)i;
    const pbr_result result = morton_sort(points, pbr_instance_threads(instance), points->minimum, extent, entries, count);
    for (size_t i = 0; result == PBR_OK && i < count; i++) order[i] = entries[i].value;
    pbr_free(instance, entries);
    return result;
}

/* ---- Blocks and chunks ---- */

struct extent {
    double minimum[3], maximum[3];
    float smallest; /* positive radius; infinity if there is none */
};

struct cutting {
    const pbr_points *points;
    struct blocks *out;
    double tolerance;       /* of float positions, in radii */
    uint32_t *pieces;       /* per run of BLOCK_SPLATS records: how many blocks it makes, then the first of them */
    struct extent *extents; /* per block */
};

static void extent_merge(struct extent *a, const struct extent *b) {
    for (int k = 0; k < 3; k++) {
        a->minimum[k] = fmin(a->minimum[k], b->minimum[k]);
        a->maximum[k] = fmax(a->maximum[k], b->maximum[k]);
    }
    a->smallest = fminf(a->smallest, b->smallest);
}

static const struct extent nothing = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, INFINITY};

static struct extent measure_extent(const struct cutting *cutting, uint64_t first, uint32_t count) {
    const pbr_points *points = cutting->points;
    struct extent extent = nothing;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t point = cutting->out->order[first + i];
        struct extent one = {.smallest = INFINITY};
        points_position(points, point, one.minimum);
        memcpy(one.maximum, one.minimum, sizeof one.maximum);
        if (points->radii && points->radii[point] > 0) one.smallest = points->radii[point];
        extent_merge(&extent, &one);
    }
    return extent;
}

static void measure_block(const struct cutting *cutting, uint64_t first, const struct extent *extent, struct block *block) {
    const pbr_points *points = cutting->points;
    double squared = 0;
    for (int k = 0; k < 3; k++) block->centre[k] = (extent->minimum[k] + extent->maximum[k]) / 2;
    for (uint32_t i = 0; i < block->count; i++) {
        uint32_t point = cutting->out->order[first + i];
        double p[3], from_centre = 0;
        points_position(points, point, p);
        for (int k = 0; k < 3; k++) from_centre += (p[k] - block->centre[k]) * (p[k] - block->centre[k]);
        squared = fmax(squared, from_centre);
        if (points->radii) block->largest_splat = fmaxf(block->largest_splat, points->radii[point]);
    }
    block->radius = float_above(sqrt(squared));
}

/* Around the mean of the normals. A splat without one faces everywhere. */
static void measure_cone(const struct cutting *cutting, uint64_t first, struct block *block) {
    const pbr_points *points = cutting->points;
    double sum[3] = {0, 0, 0};
    float normal[3];
    block->cone = -1;
    for (uint32_t i = 0; points->normals && i < block->count; i++) {
        splat_decode_normal(points->normals[cutting->out->order[first + i]], normal);
        if (normal[0] == 0 && normal[1] == 0 && normal[2] == 0) return;
        for (int k = 0; k < 3; k++) sum[k] += (double)normal[k];
    }
    const double length = length3(sum);
    double least = 1;
    if (!(length > 0)) return;
    for (int k = 0; k < 3; k++) block->axis[k] = (float)(sum[k] / length);
    for (uint32_t i = 0; i < block->count; i++) {
        splat_decode_normal(points->normals[cutting->out->order[first + i]], normal);
        least = fmin(least, (sum[0] * (double)normal[0] + sum[1] * (double)normal[1] + sum[2] * (double)normal[2]) / length);
    }
    block->cone = (float)fmax(least - 4 * FLT_EPSILON, -1);
}

/* Where the chunk's float positions are relative to. Positions that came as float are moved exactly or not at all. */
static void chunk_origin(const pbr_points *points, const struct extent *extent, double out[3]) {
    if (points->narrow) {
        box_origin(extent->minimum, extent->maximum, out);
        return;
    }
    for (int k = 0; k < 3; k++) out[k] = (extent->minimum[k] + extent->maximum[k]) / 2;
}

/* Largest rounding of a coordinate of the box relative to the origin: half a unit in the last of 24 bits. */
static double chunk_rounding(const struct extent *extent, const double origin[3]) {
    double reach = 0;
    for (int k = 0; k < 3; k++) reach = fmax(reach, fmax(extent->maximum[k] - origin[k], origin[k] - extent->minimum[k]));
    return reach * (FLT_EPSILON / 2.0);
}

static bool fits(const struct cutting *cutting, const struct extent *extent) {
    if (cutting->points->narrow) return true;
    double origin[3];
    chunk_origin(cutting->points, extent, origin);
    return chunk_rounding(extent, origin) <= extent->smallest * cutting->tolerance;
}

/* Halves a run of records until each piece is small enough for float positions: neighbours on the curve are neighbours in space, so
 * an outlier costs its run a dozen blocks. Returns how many pieces; with `emit` they become the blocks from `at` on. */
static uint32_t cut_run(const struct cutting *cutting, uint64_t first, uint32_t count, bool emit, uint32_t at) {
    const struct extent extent = measure_extent(cutting, first, count);
    if (count > 1 && !fits(cutting, &extent)) {
        const uint32_t half = count / 2, pieces = cut_run(cutting, first, half, emit, at);
        return pieces + cut_run(cutting, first + half, count - half, emit, at + pieces);
    }
    if (emit) {
        cutting->extents[at] = extent;
        cutting->out->blocks[at].count = count;
        measure_block(cutting, first, &extent, &cutting->out->blocks[at]);
        measure_cone(cutting, first, &cutting->out->blocks[at]);
    }
    return 1;
}

static uint64_t chunks_most(const pbr_points *points) {
    return CHUNKS_FEW + points->count / CHUNK_SPLATS_FEWEST;
}

static uint32_t run_length(const pbr_points *points, size_t run) {
    const uint64_t left = points->count - (uint64_t)run * BLOCK_SPLATS;
    return left < BLOCK_SPLATS ? (uint32_t)left : BLOCK_SPLATS;
}

static pbr_result count_pieces(void *user, size_t begin, size_t end) {
    const struct cutting *cutting = user;
    for (size_t run = begin; run < end; run++)
        cutting->pieces[run] = cut_run(cutting, (uint64_t)run * BLOCK_SPLATS, run_length(cutting->points, run), false, 0);
    return PBR_OK;
}

static pbr_result make_blocks(void *user, size_t begin, size_t end) {
    const struct cutting *cutting = user;
    for (size_t run = begin; run < end; run++)
        cut_run(cutting, (uint64_t)run * BLOCK_SPLATS, run_length(cutting->points, run), true, cutting->pieces[run]);
    return PBR_OK;
}

static void close_chunk(const struct cutting *cutting, struct chunk *chunk, const struct extent *extent) {
    chunk_origin(cutting->points, extent, chunk->origin);
    if (cutting->points->narrow) return;
    /* The spheres are to hold the centres as they are packed. */
    float slack = float_above(2 * chunk_rounding(extent, chunk->origin));
    for (uint32_t b = 0; b < chunk->block_count; b++) {
        struct block *block = &cutting->out->blocks[chunk->first_block + b];
        block->radius = float_above((double)block->radius + slack);
    }
}

/* Runs of blocks, each as long as CHUNK_SPLATS and the precision of its float positions allow; at least one block. */
static void group_blocks(const struct cutting *cutting) {
    struct blocks *out = cutting->out;
    struct extent extent = nothing;
    struct chunk *chunk = NULL;
    uint64_t first = 0;
    for (uint32_t b = 0; b < out->block_count; b++) {
        struct block *block = &out->blocks[b];
        struct extent grown = extent;
        extent_merge(&grown, &cutting->extents[b]);
        if (!chunk || chunk->count + block->count > CHUNK_SPLATS || !fits(cutting, &grown)) {
            if (chunk) close_chunk(cutting, chunk, &extent);
            chunk = &out->chunks[out->chunk_count++];
            chunk->first = first;
            chunk->first_block = b;
            grown = cutting->extents[b];
        }
        extent = grown;
        block->chunk = out->chunk_count - 1;
        block->first = chunk->count;
        chunk->count += block->count;
        chunk->block_count++;
        first += block->count;
    }
    if (chunk) close_chunk(cutting, chunk, &extent);
}

static void free_cut(pbr_instance *instance, struct cutting *cutting) {
    pbr_free(instance, cutting->pieces);
    pbr_free(instance, cutting->extents);
    pbr_free(instance, cutting->out->blocks);
    pbr_free(instance, cutting->out->chunks);
    cutting->pieces = NULL;
    cutting->extents = NULL;
    *cutting->out = (struct blocks){.order = cutting->out->order};
}

/* Blocks and chunks from the order, at the cutting's tolerance. */
static pbr_result cut(struct cutting *cutting) {
    pbr_instance *instance = cutting->points->instance;
    struct blocks *out = cutting->out;
    const size_t runs = (size_t)((cutting->points->count + BLOCK_SPLATS - 1) / BLOCK_SPLATS);
    if (!(cutting->pieces = pbr_allocate(instance, runs, sizeof *cutting->pieces))) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = pbr_parallel(instance, runs, 8, count_pieces, cutting);
    if (result != PBR_OK) return result;
    for (size_t run = 0; run < runs; run++) {
        const uint32_t pieces = cutting->pieces[run];
        cutting->pieces[run] = out->block_count;
        out->block_count += pieces;
    }
    if (!(out->blocks = pbr_allocate(instance, out->block_count, sizeof *out->blocks)) ||
        !(out->chunks = pbr_allocate(instance, out->block_count, sizeof *out->chunks)) ||
        !(cutting->extents = pbr_allocate(instance, out->block_count, sizeof *cutting->extents)))
        return PBR_ERROR_OUT_OF_MEMORY;
    result = pbr_parallel(instance, runs, 8, make_blocks, cutting);
    if (result == PBR_OK) group_blocks(cutting);
    return result;
}

struct rounding_job {
    const struct cutting *cutting;
    double *roundings; /* per run: of its float positions, in its smallest radius */
};

static pbr_result find_roundings(void *user, size_t begin, size_t end) {
    const struct rounding_job *job = user;
    for (size_t run = begin; run < end; run++) {
        const struct extent extent =
            measure_extent(job->cutting, (uint64_t)run * BLOCK_SPLATS, run_length(job->cutting->points, run));
        double origin[3];
        chunk_origin(job->cutting->points, &extent, origin);
        job->roundings[run] = chunk_rounding(&extent, origin) / extent.smallest;
    }
    return PBR_OK;
}

/* Radii far below the points' spacing would ask for a buffer per handful of points. They get less precision instead: so little that
 * runs to be halved are few. */
static pbr_result choose_tolerance(struct cutting *cutting) {
    const pbr_points *points = cutting->points;
    cutting->tolerance = POSITION_TOLERANCE;
    if (points->narrow) return PBR_OK;
    const size_t runs = (size_t)((points->count + BLOCK_SPLATS - 1) / BLOCK_SPLATS);
    struct rounding_job job = {cutting, pbr_allocate(points->instance, runs, sizeof *job.roundings)};
    if (!job.roundings) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = pbr_parallel(points->instance, runs, 8, find_roundings, &job);
    for (uint64_t above = UINT64_MAX; result == PBR_OK && above > chunks_most(points);) {
        above = 0;
        for (size_t run = 0; run < runs; run++) above += job.roundings[run] > cutting->tolerance;
        if (above > chunks_most(points)) cutting->tolerance *= 16;
    }
    pbr_free(points->instance, job.roundings);
    return result;
}

pbr_result blocks_build(const pbr_points *points, struct blocks *out) {
    pbr_instance *instance = points->instance;
    struct cutting cutting = {.points = points, .out = out};
    *out = (struct blocks){0};
    out->order = pbr_allocate(instance, points->count, sizeof *out->order);
    pbr_result result = out->order ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK && (points->wide || points->count > BLOCK_SPLATS)) result = morton_order(points, out->order);
    else
        for (uint32_t i = 0; result == PBR_OK && i < points->count; i++) out->order[i] = i;
    if (result == PBR_OK) result = choose_tolerance(&cutting);
    if (result == PBR_OK) result = cut(&cutting);
    while (result == PBR_OK && out->chunk_count > chunks_most(points)) {
        free_cut(instance, &cutting);
        cutting.tolerance *= 256;
        result = cut(&cutting);
    }
    pbr_free(instance, cutting.pieces);
    pbr_free(instance, cutting.extents);
    if (result != PBR_OK) blocks_free(instance, out);
    return result;
}

void blocks_free(pbr_instance *instance, struct blocks *blocks) {
    pbr_free(instance, blocks->order);
    pbr_free(instance, blocks->blocks);
    pbr_free(instance, blocks->chunks);
    *blocks = (struct blocks){0};
}

/* ---- Packing ---- */

struct packing {
    const pbr_points *points;
    const uint32_t *order; /* of the chunk */
    const double *origin;
    struct splat *out;
};

static pbr_result pack_range(void *user, size_t begin, size_t end) {
    const struct packing *packing = user;
    const pbr_points *points = packing->points;
    for (size_t i = begin; i < end; i++) {
        uint32_t point = packing->order[i];
        struct splat splat = {.normal = {SPLAT_NO_NORMAL, SPLAT_NO_NORMAL}, .colour = {255, 255, 255, 255}};
        double p[3];
        points_position(points, point, p);
        for (int k = 0; k < 3; k++) splat.position[k] = (float)(p[k] - packing->origin[k]);
        if (points->radii) splat.radius = points->radii[point];
        if (points->normals) memcpy(splat.normal, points->normals[point], sizeof splat.normal);
        if (points->colours) memcpy(splat.colour, points->colours[point], sizeof splat.colour);
        packing->out[i] = splat;
    }
    return PBR_OK;
}

void blocks_pack(const pbr_points *points, const struct blocks *blocks, uint32_t chunk, struct splat *out) {
    const struct chunk *c = &blocks->chunks[chunk];
    struct packing packing = {points, blocks->order + c->first, c->origin, out};
    pbr_parallel(points->instance, c->count, GRAIN, pack_range, &packing);
}
