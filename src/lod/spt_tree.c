/* The octree of a chunk: cells are runs of the Morton order whose keys begin alike. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "lod.h"
#include "spt_build.h"

enum { OCTANTS = 8, OCTANT_BITS = 3 };

/* ---- Cells ---- */

static uint32_t split_singly(struct spt_run run, struct spt_run *parts) {
    for (size_t i = 0; i < run.count; i++) parts[i] = (struct spt_run){run.first + i, 1};
    return (uint32_t)run.count;
}

static uint32_t split_evenly(struct spt_run run, struct spt_run *parts) {
    for (size_t i = 0; i < OCTANTS; i++) {
        const size_t begin = run.count * i / OCTANTS, end = run.count * (i + 1) / OCTANTS;
        parts[i] = (struct spt_run){run.first + begin, end - begin};
    }
    return OCTANTS;
}

/* Where the octant that entry `begin` is in ends. */
static size_t octant_end(const struct sort_entry *order, size_t begin, size_t end, unsigned shift) {
    const uint64_t octant = order[begin].key >> shift;
    while (end - begin > 1) {
        const size_t middle = begin + (end - begin) / 2;
        if (order[middle].key >> shift == octant) begin = middle;
        else end = middle;
    }
    return end;
}

/* At the first level at which there is more than one octant, so that no node has a single child. The keys are not all the same. */
static uint32_t split_octants(const struct sort_entry *order, struct spt_run run, struct spt_run *parts) {
    const size_t last = run.first + run.count;
    const uint64_t differing = order[run.first].key ^ order[last - 1].key;
    unsigned shift = 0;
    uint32_t count = 0;
    while (differing >> (shift + OCTANT_BITS)) shift += OCTANT_BITS;
    for (size_t begin = run.first; begin < last; count++) {
        const size_t end = octant_end(order, begin, last, shift);
        parts[count] = (struct spt_run){begin, end - begin};
        begin = end;
    }
    return count;
}

static bool keys_are_one(const struct sort_entry *order, struct spt_run run) {
    return order[run.first].key == order[run.first + run.count - 1].key;
}

/* Keys of their own box for points that lie in one cell. */
static pbr_result make_finer_keys(const struct spt_builder *builder, uint32_t threads, struct spt_run run) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, extent = 0;
    for (size_t i = 0; i < run.count; i++) {
        double p[3];
        points_position(builder->points, builder->order[run.first + i].value, p);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], p[k]);
            high[k] = fmax(high[k], p[k]);
        }
    }
    for (int k = 0; k < 3; k++) extent = fmax(extent, high[k] - low[k]);
    if (!(extent > 0)) return PBR_OK;
    return morton_sort(builder->points, threads, low, extent, builder->order + run.first, run.count);
}

pbr_result spt_split(const struct spt_builder *builder, uint32_t threads, struct spt_run run,
                     struct spt_run parts[SPT_CHILDREN_MOST], uint32_t *count) {
    const bool one = keys_are_one(builder->order, run);
    if (run.count <= builder->leaf_points || (one && run.count <= SPT_CHILDREN_MOST)) {
        *count = split_singly(run, parts);
        return PBR_OK;
    }
    const pbr_result result = one ? make_finer_keys(builder, threads, run) : PBR_OK;
    *count = keys_are_one(builder->order, run) ? split_evenly(run, parts) : split_octants(builder->order, run, parts);
    return result;
}

/* ---- Nodes ---- */

static void make_leaf(const struct spt_builder *builder, uint32_t point, struct spt_node *node) {
    const pbr_points *points = builder->points;
    const float radius = points->radii ? points->radii[point] : 0;
    node->point = point;
    points_position(points, point, node->position);
    for (int k = 0; k < 3; k++) {
        node->position[k] += points->origin[k] - builder->centre[k];
        node->colour[k] = points->colours ? builder->linear[points->colours[point][k]] : 1;
    }
    if (points->normals) splat_decode_normal(points->normals[point], node->normal);
    node->radius = radius > 0 ? fminf(radius, (float)LOD_EXTENT_MOST) : 0;
    const float part = builder->extent > 0 ? (float)((double)node->radius / builder->extent) : 1;
    const float size = fminf(fmaxf(part, SPT_WEIGHT_LEAST), SPT_WEIGHT_MOST);
    node->weight = size * size;
}

static struct spt_node *next_node(struct spt_tree *tree) {
    struct spt_node *node = &tree->nodes[tree->count++];
    memset(node, 0, sizeof *node);
    node->parent = UINT32_MAX;
    return node;
}

static pbr_result make_node(const struct spt_builder *builder, struct spt_tree *tree, struct spt_run run) {
    if (run.count == 1) {
        make_leaf(builder, builder->order[run.first].value, next_node(tree));
        return PBR_OK;
    }
    struct spt_run parts[SPT_CHILDREN_MOST];
    struct spt_node *children[SPT_CHILDREN_MOST];
    uint32_t count;
    pbr_result result = spt_split(builder, 1, run, parts, &count);
    for (uint32_t i = 0; i < count && result == PBR_OK; i++) {
        result = make_node(builder, tree, parts[i]);
        children[i] = &tree->nodes[tree->count - 1];
    }
    if (result != PBR_OK) return result;
    struct spt_node *node = next_node(tree);
    spt_combine((const struct spt_node *const *)children, count, node);
    node->parent = UINT32_MAX;
    for (uint32_t i = 0; i < count; i++) children[i]->parent = tree->count - 1;
    return PBR_OK;
}

pbr_result spt_make_tree(const struct spt_builder *builder, size_t chunk, struct spt_tree *tree) {
    const struct spt_run run = builder->chunks[chunk];
    const uint32_t most = (uint32_t)(2 * run.count); /* each inner node has two children at least */
    if (most > tree->capacity) {
        spt_tree_free(builder->instance, tree);
        tree->nodes = pbr_allocate(builder->instance, most, sizeof *tree->nodes);
        if (!tree->nodes) return PBR_ERROR_OUT_OF_MEMORY;
        tree->capacity = most;
    }
    tree->count = 0;
    return make_node(builder, tree, run);
}

void spt_tree_free(pbr_instance *instance, struct spt_tree *tree) {
    pbr_free(instance, tree->nodes);
    *tree = (struct spt_tree){0};
}
