/* Building a QSplat tree from points, in memory. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/points.h"
#include "lod.h"
#include "qsplat_build.h"

void builder_start(struct builder *builder, double extent) {
    builder->extent = extent > 0 ? (float)extent : 1;
    for (int i = 0; i < 64; i++) {
        builder->linear[0][i] = linear_from_srgb((float)(i & 31) / 31);
        builder->linear[1][i] = linear_from_srgb((float)i / 63);
    }
}

/* Room for so many, or NULL, and all is as before. */
static void *grow(pbr_instance *instance, void *array, size_t size, size_t wanted, size_t *capacity) {
    const size_t ample = *capacity + *capacity / 2, grown_capacity = wanted > ample ? wanted : ample;
    if (wanted <= *capacity) return array;
    void *grown = pbr_reallocate(instance, array, *capacity, grown_capacity, size);
    if (grown) *capacity = grown_capacity;
    return grown;
}

pbr_result builder_grow(struct builder *builder, size_t runs, size_t branches) {
    const size_t run_count = builder->run_count + runs, branch_count = builder->branch_count + branches;
    if (run_count >= TIP || branch_count >= TIP)
        return pbr_log(builder->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "a QSplat tree of so many points cannot be addressed");
    if (run_count > 0) {
        struct run *grown = grow(builder->instance, builder->runs, sizeof *grown, run_count, &builder->run_capacity);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        builder->runs = grown;
    }
    if (branch_count > 0) {
        struct branch *grown = grow(builder->instance, builder->branches, sizeof *grown, branch_count, &builder->branch_capacity);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        builder->branches = grown;
    }
    return PBR_OK;
}

void builder_end(struct builder *builder) {
    pbr_free(builder->instance, builder->runs);
    pbr_free(builder->instance, builder->branches);
}

struct leaf builder_make_leaf(const struct builder *builder, const double position[3], const float normal[3], const uint8_t *colour,
                              float radius) {
    struct leaf leaf;
    for (int k = 0; k < 3; k++) leaf.sphere.centre[k] = (float)(position[k] - builder->tree->centre[k]);
    leaf.sphere.radius = !(radius > 0) ? 0 : radius < (float)LOD_EXTENT_MOST ? radius : (float)LOD_EXTENT_MOST;
    leaf.normal = qsplat_encode_normal(builder->codes, normal);
    leaf.colour = colour ? qsplat_encode_colour(colour) : 0;
    return leaf;
}

/* ---- In memory ---- */

struct in_memory {
    struct builder builder;
    const pbr_points *points;
    struct leaf *leaves;
    struct node **run_nodes; /* of each run */
    uint8_t *nodes;
};

static pbr_result read_leaves(void *user, size_t begin, size_t end) {
    const struct in_memory *all = user;
    const pbr_points *points = all->points;
    for (size_t i = begin; i < end; i++) {
        double position[3];
        float normal[3] = {0, 0, 0};
        points_position(points, i, position);
        for (int k = 0; k < 3; k++) position[k] += points->origin[k];
        if (points->normals) splat_decode_normal(points->normals[i], normal);
        all->leaves[i] = builder_make_leaf(&all->builder, position, normal, points->colours ? points->colours[i] : NULL,
                                           points->radii ? points->radii[i] : 0);
    }
    return PBR_OK;
}

static pbr_result make_runs(void *user, size_t begin, size_t end) {
    struct in_memory *all = user;
    pbr_instance *instance = all->builder.instance;
    struct node *nodes = allocate_unset(instance, RUN, sizeof *nodes);
    pbr_result result = nodes ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end && result == PBR_OK; i++) {
        struct run *run = &all->builder.runs[i];
        const size_t count = make_run(&all->builder, all->leaves + run->first, nodes, run);
        if (count == 0) continue;
        all->run_nodes[i] = allocate_unset(instance, count, sizeof *nodes);
        if (all->run_nodes[i]) memcpy(all->run_nodes[i], nodes, count * sizeof *nodes);
        else result = PBR_ERROR_OUT_OF_MEMORY;
    }
    pbr_free(instance, nodes);
    return result;
}

static pbr_result write_pages(void *user, size_t begin, size_t end) {
    const struct in_memory *all = user;
    const struct builder *builder = &all->builder;
    struct pending *queue = allocate_unset(builder->instance, RUN, sizeof *queue);
    if (!queue) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = begin; i < end; i++) {
        const struct run *run = &builder->runs[i];
        write_page(builder, run, all->leaves + run->first, all->run_nodes[i], queue, all->nodes + run->page_at);
    }
    pbr_free(builder->instance, queue);
    return PBR_OK;
}

static pbr_result encode(struct in_memory *all, place root, struct qsplat_blob *blob) {
    struct builder *builder = &all->builder;
    struct qsplat *tree = builder->tree;
    const struct qsplat_sphere sphere = make_branches(builder, root);
    pbr_result result = plan_pages(builder, root);
    if (result != PBR_OK) return result;
    tree->radius = sphere.radius;
    tree->nodes = all->nodes = blob->nodes = pbr_allocate(builder->instance, (size_t)tree->size, 1);
    tree->links = blob->links = pbr_allocate(builder->instance, (size_t)tree->link_count, 8);
    if (!blob->nodes || !blob->links) return PBR_ERROR_OUT_OF_MEMORY;
    result = write_upper(builder, root, &sphere, blob->nodes);
    if (result != PBR_OK) return result;
    store_links(builder, blob->links);
    return parallel_reporting(builder->instance, builder->run_count, 1, write_pages, all, builder->progress, "encoding");
}

static pbr_result build(struct in_memory *all, struct qsplat_blob *blob) {
    struct builder *builder = &all->builder;
    const pbr_points *points = all->points;
    const size_t count = (size_t)points->count;
    double minimum[3], maximum[3], extent;
    place root = 0;
    for (int k = 0; k < 3; k++) {
        minimum[k] = points->minimum[k] + points->origin[k];
        maximum[k] = points->maximum[k] + points->origin[k];
    }
    pbr_result result = lod_choose_centre(builder->instance, minimum, maximum, builder->tree->centre, &extent);
    if (result != PBR_OK) return result;
    builder_start(builder, extent);
    all->leaves = allocate_unset(builder->instance, count, sizeof *all->leaves);
    if (!all->leaves) return PBR_ERROR_OUT_OF_MEMORY;
    result = parallel_reporting(builder->instance, count, RUN, read_leaves, all, builder->progress, "reading points");
    if (result == PBR_OK) result = order_runs(builder, all->leaves, count, 0, builder->progress, &root);
    if (result != PBR_OK) return result;
    all->run_nodes = pbr_allocate(builder->instance, builder->run_count, sizeof *all->run_nodes);
    if (!all->run_nodes) return PBR_ERROR_OUT_OF_MEMORY;
    result = parallel_reporting(builder->instance, builder->run_count, 1, make_runs, all, builder->progress, "building");
    return result == PBR_OK ? encode(all, root, blob) : result;
}

pbr_result qsplat_build(pbr_instance *instance, const pbr_points *points, const struct progress *progress, struct qsplat *tree,
                        struct qsplat_blob *blob) {
    struct in_memory all = {.builder = {.instance = instance, .progress = progress, .tree = tree, .codes = tree->codes},
                            .points = points};
    tree->own = true;
    tree->has_colours = points->colours != NULL;
    if (points->count == 0) return progress_report(progress, "building", 1);
    const pbr_result result = build(&all, blob);
    for (size_t i = 0; all.run_nodes && i < all.builder.run_count; i++) pbr_free(instance, all.run_nodes[i]);
    pbr_free(instance, all.run_nodes);
    pbr_free(instance, all.leaves);
    builder_end(&all.builder);
    return result;
}
