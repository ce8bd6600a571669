/* Building sequential point trees: the order, the chunks, and all of them. SPDX-License-Identifier: MIT */
#include "spt_build.h"

#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/matrix.h"
#include "lod.h"

/* Chunks are cut for precision, too: where of a sample of radii more than one in FINE_PART is less than FINE_RADIUS times what
 * codes of positions may be off; but not into pieces with fewer leaves. */
enum { CHUNK_FEWEST = 1 << 13, SAMPLES = 1024, FINE_RADIUS = 32, FINE_PART = 16 };

/* ---- Chunks ---- */

static pbr_result add_chunk(struct spt_builder *builder, struct spt_run run) {
    if (builder->chunk_count == builder->chunk_capacity) {
        const size_t capacity = builder->chunk_capacity ? 2 * builder->chunk_capacity : 64;
        struct spt_run *grown = pbr_reallocate(builder->instance, builder->chunks, builder->chunk_count, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        builder->chunks = grown;
        builder->chunk_capacity = capacity;
    }
    builder->chunks[builder->chunk_count++] = run;
    return PBR_OK;
}

static double longest_side(const struct spt_builder *builder, struct spt_run run) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, side = 0;
    for (size_t i = 0; i < run.count; i++) {
        double p[3];
        points_position(builder->points, builder->order[run.first + i].value, p);
        for (int k = 0; k < 3; k++) {
            low[k] = p[k] < low[k] ? p[k] : low[k];
            high[k] = p[k] > high[k] ? p[k] : high[k];
        }
    }
    for (int k = 0; k < 3; k++) side = fmax(side, high[k] - low[k]);
    return side;
}

static bool is_exact_enough(const struct spt_builder *builder, struct spt_run run) {
    if (run.count <= CHUNK_FEWEST || !builder->points->radii) return true;
    const double shift = longest_side(builder, run) / SPT_CODES * sqrt(3) / 2;
    int small = 0;
    for (size_t i = 0; i < SAMPLES; i++) {
        const float radius = builder->points->radii[builder->order[run.first + i * run.count / SAMPLES].value];
        small += radius > 0 && (double)radius < FINE_RADIUS * shift;
    }
    return small <= SAMPLES / FINE_PART;
}

/* A chunk is a cell, or siblings that follow one another, so that there are few small ones. */
static pbr_result cut_chunks(struct spt_builder *builder, struct spt_run run) {
    const bool small = run.count <= SPT_CHUNK_LEAVES;
    if (small && is_exact_enough(builder, run)) return add_chunk(builder, run);
    struct spt_run parts[SPT_CHILDREN_MOST];
    uint32_t count;
    pbr_result result = spt_split(builder, pbr_instance_threads(builder->instance), run, parts, &count);
    for (uint32_t i = 0; i < count && result == PBR_OK;) {
        struct spt_run some = parts[i++];
        while (!small && i < count && some.count + parts[i].count <= SPT_CHUNK_LEAVES) some.count += parts[i++].count;
        result = cut_chunks(builder, some);
    }
    return result;
}

pbr_result spt_builder_start(struct spt_builder *builder) {
    const pbr_points *points = builder->points;
    const size_t count = (size_t)points->count;
    double minimum[3], maximum[3];
    for (int k = 0; k < 3; k++) {
        minimum[k] = points->minimum[k] + points->origin[k];
        maximum[k] = points->maximum[k] + points->origin[k];
    }
    for (int i = 0; i < 256; i++) builder->linear[i] = linear_from_srgb((float)i / 255);
    pbr_result result = lod_choose_centre(builder->instance, minimum, maximum, builder->centre, &builder->extent);
    if (result != PBR_OK) return result;
    builder->order = pbr_allocate(builder->instance, count, sizeof *builder->order);
    if (!builder->order) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = 0; i < count; i++) builder->order[i].value = (uint32_t)i;
    result = progress_report(builder->progress, "sorting", 0);
    if (result == PBR_OK)
        result =
            morton_sort(points, pbr_instance_threads(builder->instance), points->minimum, builder->extent, builder->order, count);
    if (result == PBR_OK) result = cut_chunks(builder, (struct spt_run){0, count});
    return result == PBR_OK ? progress_report(builder->progress, "sorting", 1) : result;
}

void spt_builder_end(struct spt_builder *builder) {
    pbr_free(builder->instance, builder->order);
    pbr_free(builder->instance, builder->chunks);
}

/* ---- All of it ---- */

struct making {
    const struct spt_builder *builder;
    struct spt *spt;
};

static pbr_result make_chunk(const struct making *making, size_t i, struct spt_tree *tree) {
    const struct spt_builder *builder = making->builder;
    struct spt *spt = making->spt;
    pbr_result result = spt_make_tree(builder, i, tree);
    if (result != PBR_OK) return result;
    uint32_t *order = NULL;
    struct normal_field *fields = NULL;
    if (builder->fields) {
        order = pbr_allocate(builder->instance, tree->count, sizeof *order);
        spt->fields[i] = fields = pbr_allocate(builder->instance, tree->count, sizeof *fields);
        if (!order || !fields) result = PBR_ERROR_OUT_OF_MEMORY;
    }
    if (result == PBR_OK) result = spt_sequence(builder->instance, tree, &spt->chunks[i], &spt->entries[i], &spt->steps[i], order);
    if (result == PBR_OK && fields) result = spt_make_fields(builder, tree, &spt->chunks[i], spt->entries[i], order, fields);
    pbr_free(builder->instance, order);
    return result;
}

static pbr_result make_chunks(void *user, size_t begin, size_t end) {
    const struct making *making = user;
    struct spt_tree tree = {0};
    pbr_result result = PBR_OK;
    for (size_t i = begin; i < end && result == PBR_OK; i++) result = make_chunk(making, i, &tree);
    spt_tree_free(making->builder->instance, &tree);
    return result;
}

static pbr_result allocate_chunks(pbr_instance *instance, size_t count, bool fields, struct spt *spt) {
    spt->owns = true;
    spt->chunks = pbr_allocate(instance, count, sizeof *spt->chunks);
    spt->entries = pbr_allocate(instance, count, sizeof *spt->entries);
    spt->steps = pbr_allocate(instance, count, sizeof *spt->steps);
    if (fields) spt->fields = pbr_allocate(instance, count, sizeof *spt->fields);
    if (!spt->chunks || !spt->entries || !spt->steps || (fields && !spt->fields)) return PBR_ERROR_OUT_OF_MEMORY;
    spt->chunk_count = (uint32_t)count;
    return PBR_OK;
}

/* What is said of all chunks together. */
static void sum_up(const pbr_points *points, struct spt *spt) {
    for (uint32_t i = 0; i < spt->chunk_count; i++) {
        struct spt_chunk *chunk = &spt->chunks[i];
        double centre[3];
        for (int k = 0; k < 3; k++) centre[k] = chunk->origin[k] + (double)chunk->centre[k];
        spt->radius = fmax(spt->radius, (length3(centre) + (double)chunk->radius) * (1 + 1e-9));
        chunk->first = spt->count;
        spt->count += chunk->count;
        spt->leaves += chunk->leaves;
    }
    double squared = 0;
    for (uint64_t i = 0; i < points->count; i++) {
        double p[3];
        points_position(points, i, p);
        for (int k = 0; k < 3; k++) p[k] += points->origin[k] - spt->centre[k];
        squared = fmax(squared, dot3(p, p));
    }
    spt->span = sqrt(squared);
}

/* The points' fields, before what else takes memory. */
static pbr_result fit_fields(struct spt_builder *builder) {
    const pbr_points *points = builder->points;
    struct normal_field *fields = pbr_allocate(builder->instance, (size_t)points->count, sizeof *fields);
    builder->fields = fields;
    return fields ? normal_field_fit(points, 0, builder->progress, fields) : PBR_ERROR_OUT_OF_MEMORY;
}

pbr_result spt_build(pbr_instance *instance, const pbr_points *points, uint32_t leaf_points, bool fields,
                     const struct progress *progress, struct spt *spt) {
    struct spt_builder builder = {.instance = instance, .points = points, .progress = progress, .leaf_points = leaf_points};
    *spt = (struct spt){.has_normals = points->normals != NULL, .has_colours = points->colours != NULL};
    if (points->count == 0) return progress_report(progress, "building", 1);
    pbr_result result = fields && points->normals ? fit_fields(&builder) : PBR_OK;
    if (result == PBR_OK) result = spt_builder_start(&builder);
    if (result == PBR_OK) result = allocate_chunks(instance, builder.chunk_count, builder.fields != NULL, spt);
    struct making making = {&builder, spt};
    if (result == PBR_OK) result = parallel_reporting(instance, builder.chunk_count, 1, make_chunks, &making, progress, "building");
    memcpy(spt->centre, builder.centre, sizeof spt->centre);
    if (result == PBR_OK) sum_up(points, spt);
    else spt_free(instance, spt);
    spt_builder_end(&builder);
    pbr_free(instance, (void *)(uintptr_t)builder.fields);
    return result;
}
