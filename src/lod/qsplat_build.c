/* Building a QSplat tree from points, in memory. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/points.h"
#include "lod.h"
#include "qsplat_build.h"

pbr_result builder_start(struct builder *builder, uint64_t count, double extent) {
    bool done = true;
    builder->count = count;
    builder->extent = extent > 0 ? (float)extent : 1;
    for (int i = 0; i < 64; i++) {
        builder->linear[0][i] = linear_from_srgb((float)(i & 31) / 31);
        builder->linear[1][i] = linear_from_srgb((float)i / 63);
    }
    while (builder->top < 1 || UINT64_C(1) << 2 * builder->top < count) builder->top++;
    builder->sums = pbr_allocate(builder->instance, (size_t)level_count(builder, RUN_LEVEL), sizeof *builder->sums);
    done = builder->sums != NULL;
    for (uint32_t level = KEPT_LEVEL; done && (level <= builder->top || level <= RUN_LEVEL); level++) {
        const size_t nodes = (size_t)level_count(builder, level);
        builder->levels[level] = pbr_allocate(builder->instance, nodes, sizeof *builder->levels[level]);
        done = builder->levels[level] != NULL;
    }
    return done ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

void builder_end(struct builder *builder) {
    pbr_free(builder->instance, builder->sums);
    pbr_free(builder->instance, builder->pages);
    for (uint32_t level = KEPT_LEVEL; level < LEVELS; level++) pbr_free(builder->instance, builder->levels[level]);
}

struct leaf builder_make_leaf(const struct builder *builder, const double position[3], const float normal[3], const uint8_t *colour,
                              float radius) {
    struct leaf leaf;
    for (int k = 0; k < 3; k++) leaf.sphere.centre[k] = (float)(position[k] - builder->tree->centre[k]);
    leaf.sphere.radius = radius > 0 ? fminf(radius, (float)LOD_EXTENT_MOST) : 0;
    leaf.normal = qsplat_encode_normal(builder->codes, normal);
    leaf.colour = colour ? qsplat_encode_colour(colour) : 0;
    return leaf;
}

/* ---- In memory ---- */

struct in_memory {
    struct builder builder;
    const pbr_points *points;
    struct window window; /* of all leaves */
    uint8_t *nodes;
    pbr_range_fn slice_work; /* of in_slices */
    size_t slice_first;
};

static pbr_result work_in_slice(void *user, size_t begin, size_t end) {
    struct in_memory *all = user;
    return all->slice_work(all, all->slice_first + begin, all->slice_first + end);
}

/* pbr_parallel in slices, with progress between them, which only the caller's thread may report. */
static pbr_result in_slices(struct in_memory *all, size_t count, pbr_range_fn work, const char *stage) {
    enum { SLICES = 4, PIECES = 4 /* a thread and slice */ };
    pbr_instance *instance = all->builder.instance;
    const size_t pieces = PIECES * (size_t)pbr_instance_threads(instance), even = count / SLICES + 1;
    const size_t slice = even < pieces ? pieces : even;
    pbr_result result = progress_report(all->builder.progress, stage, 0);
    all->slice_work = work;
    for (size_t done = 0; done < count && result == PBR_OK; done += slice) {
        const size_t some = count - done < slice ? count - done : slice;
        all->slice_first = done;
        result = pbr_parallel(instance, some, (some + pieces - 1) / pieces, work_in_slice, all);
        if (result == PBR_OK) result = progress_report(all->builder.progress, stage, (double)(done + some) / (double)count);
    }
    return result;
}

static pbr_result read_leaves(void *user, size_t begin, size_t end) {
    const struct in_memory *all = user;
    const pbr_points *points = all->points;
    for (size_t i = begin; i < end; i++) {
        double position[3];
        float normal[3] = {0, 0, 0};
        points_position(points, i, position);
        for (int k = 0; k < 3; k++) position[k] += points->origin[k];
        if (points->normals) splat_decode_normal(points->normals[i], normal);
        all->window.leaves[i] = builder_make_leaf(&all->builder, position, normal, points->colours ? points->colours[i] : NULL,
                                                  points->radii ? points->radii[i] : 0);
    }
    return PBR_OK;
}

static pbr_result make_runs(void *user, size_t begin, size_t end) {
    struct in_memory *all = user;
    struct sums *sums = pbr_allocate(all->builder.instance, RUN_SUMS, sizeof *sums);
    if (!sums) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t run = begin; run < end; run++) {
        const size_t first = run * RUN, left = (size_t)all->builder.count - first;
        order_leaves(all->window.leaves + first, left < RUN ? left : RUN);
        make_run(&all->builder, &all->window, run, sums);
    }
    pbr_free(all->builder.instance, sums);
    return PBR_OK;
}

static pbr_result write_pages(void *user, size_t begin, size_t end) {
    const struct in_memory *all = user;
    const struct builder *builder = &all->builder;
    struct pending *queue = pbr_allocate(builder->instance, PAGE_GROUPS, sizeof *queue);
    if (!queue) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end; i++)
        write_page(builder, &all->window, &builder->pages[i], queue, all->nodes + builder->pages[i].at);
    pbr_free(builder->instance, queue);
    return PBR_OK;
}

static pbr_result encode(struct in_memory *all, struct qsplat_blob *blob) {
    struct builder *builder = &all->builder;
    struct qsplat *tree = builder->tree;
    const struct qsplat_sphere root = make_upper_levels(builder);
    pbr_result result = plan_pages(builder);
    if (result != PBR_OK) return result;
    tree->radius = root.radius;
    tree->nodes = all->nodes = blob->nodes = pbr_allocate(builder->instance, (size_t)tree->size, 1);
    tree->links = blob->links = pbr_allocate(builder->instance, (size_t)tree->link_count, 8);
    if (!blob->nodes || !blob->links) return PBR_ERROR_OUT_OF_MEMORY;
    result = write_upper(builder, &all->window, &root, blob->nodes);
    if (result != PBR_OK) return result;
    store_links(builder, blob->links);
    return in_slices(all, (size_t)tree->link_count, write_pages, "encoding");
}

static pbr_result build(struct in_memory *all, struct qsplat_blob *blob) {
    struct builder *builder = &all->builder;
    const pbr_points *points = all->points;
    double minimum[3], maximum[3], extent;
    for (int k = 0; k < 3; k++) {
        minimum[k] = points->minimum[k] + points->origin[k];
        maximum[k] = points->maximum[k] + points->origin[k];
    }
    pbr_result result = lod_choose_centre(builder->instance, minimum, maximum, builder->tree->centre, &extent);
    if (result == PBR_OK) result = builder_start(builder, points->count, extent);
    if (result == PBR_OK) result = window_create(builder, points->count, &all->window);
    if (result == PBR_OK) result = in_slices(all, (size_t)points->count, read_leaves, "reading points");
    if (result == PBR_OK) result = order_runs(builder->instance, all->window.leaves, (size_t)points->count, builder->progress);
    if (result == PBR_OK) result = in_slices(all, (size_t)level_count(builder, RUN_LEVEL), make_runs, "building");
    return result == PBR_OK ? encode(all, blob) : result;
}

pbr_result qsplat_build(pbr_instance *instance, const pbr_points *points, const struct progress *progress, struct qsplat *tree,
                        struct qsplat_blob *blob) {
    struct in_memory all = {.builder = {.instance = instance, .progress = progress, .tree = tree, .codes = tree->codes},
                            .points = points};
    tree->own = true;
    tree->has_colours = points->colours != NULL;
    if (points->count == 0) return progress_report(progress, "building", 1);
    const pbr_result result = build(&all, blob);
    window_free(&all.builder, &all.window);
    builder_end(&all.builder);
    return result;
}
