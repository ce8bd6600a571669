/* Building sequential point trees: what the parts of it share. The steps:
 *
 *   order     points along a Morton curve, cut into chunks               spt_build.c
 *   tree      of a chunk: octree cells by prefixes of the keys           spt_tree.c
 *   errors    nodes from their children                                  spt_error.c
 *   sequence  a tree as sorted, quantised entries and their table        spt_sequence.c
 *   fields    of the entries, from the points' and the children's        spt_fields.c
 *
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_SPT_BUILD_H
#define PBR_LOD_SPT_BUILD_H

#include "core/normal_field.h"
#include "core/sort.h"
#include "spt.h"

enum { SPT_CHILDREN_MOST = SPT_LEAF_POINTS_MOST };

/* The smallest and largest part of the extent that counts as a radius in averages. */
#define SPT_WEIGHT_LEAST 1e-9f
#define SPT_WEIGHT_MOST 1e3f

/* Positions are relative to the hierarchy's centre. */
struct spt_node {
    double position[3];
    float normal[3]; /* unit, or 0 0 0 */
    float radius;    /* rounded up */
    float error;     /* lengths as diameters; rounded up; 0 of leaves, and where children coincide */
    float weight;    /* area of the leaves */
    float colour[3]; /* linear */
    uint32_t parent; /* UINT32_MAX: none */
    uint32_t point;  /* of a leaf */
    uint16_t children;
    uint16_t height; /* above the deepest leaf below; 0: a leaf */
};

/* Position, normal, radius: before the errors. 1 to SPT_CHILDREN_MOST children. */
void spt_average(const struct spt_node *const *children, uint32_t count, struct spt_node *node);

/* The errors of a node with a normal. */
double spt_perpendicular_error(const struct spt_node *node, const struct spt_node *const *children, uint32_t count);
double spt_tangential_error(const struct spt_node *node, const struct spt_node *const *children, uint32_t count);

/* All of a node but its place in the tree. */
void spt_combine(const struct spt_node *const *children, uint32_t count, struct spt_node *node);

/* ---- Trees ---- */

struct spt_run { /* of the order */
    size_t first, count;
};

struct spt_builder {
    pbr_instance *instance;
    const pbr_points *points;
    const struct progress *progress;
    double centre[3], extent;
    uint32_t leaf_points;
    const struct normal_field *fields; /* of the points; NULL: none are made */
    float linear[256];                 /* of sRGB */
    struct sort_entry *order;
    struct spt_run *chunks;
    size_t chunk_count, chunk_capacity;
};

/* Orders the points and cuts them into chunks. What the builder has down to `fields` is the caller's, but for centre and extent. */
pbr_result spt_builder_start(struct spt_builder *builder);
void spt_builder_end(struct spt_builder *builder);

/* A node's children: runs of the order, which may get finer keys. */
pbr_result spt_split(const struct spt_builder *builder, uint32_t threads, struct spt_run run,
                     struct spt_run parts[SPT_CHILDREN_MOST], uint32_t *count);

/* Children come before their parents, in Morton order; the root is last. */
struct spt_tree {
    struct spt_node *nodes;
    uint32_t count, capacity;
};

/* Of a chunk; memory that the tree has is used again. Reorders the chunk's part of the order. */
pbr_result spt_make_tree(const struct spt_builder *builder, size_t chunk, struct spt_tree *tree);
void spt_tree_free(pbr_instance *instance, struct spt_tree *tree);

/* A tree as a sequence: fills in the chunk but for `first`, and makes its entries and table. order: which node each entry is, as
 * long as there are nodes; may be NULL. */
pbr_result spt_sequence(pbr_instance *instance, const struct spt_tree *tree, struct spt_chunk *chunk,
                        const struct spt_entry **entries, const struct spt_step **steps, uint32_t *order);

/* A field for each entry of a sequence, of the points' fields; order: of spt_sequence. */
pbr_result spt_make_fields(const struct spt_builder *builder, const struct spt_tree *tree, const struct spt_chunk *chunk,
                           const struct spt_entry *entries, const uint32_t *order, struct normal_field *out);

#endif
