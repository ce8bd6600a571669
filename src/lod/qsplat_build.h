/* Building QSplat trees: what the parts of it share. A tree's shape follows from the number of its leaves alone. The steps:
 *
 *   order   halves the leaves across their longest side, again and again      qsplat_order.c
 *   nodes   spheres, cones and averages, from the leaves up                   qsplat_nodes.c
 *   encode  codes and places in the file, from the root down                  qsplat_encode.c
 *
 * qsplat_build.c does so in memory, qsplat_stream.c with what fits into it. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_QSPLAT_BUILD_H
#define PBR_LOD_QSPLAT_BUILD_H

#include "qsplat.h"

enum {
    RUN_LEVEL = 7,
    RUN = 1 << (2 * RUN_LEVEL), /* leaves of a subtree that one thread works on, and all of a page's are in */
    KEPT_LEVEL = 6,             /* lowest level that is kept for the whole tree: of QSPLAT_PAGE_LEAVES */
    LEVELS = 24
};

/* How much wider the spheres of inner nodes are made. Codes lie within the parent's cube: a leaf that touches the rim of its
 * parent, and a tight sphere has such, would have no code but the parent's own. (Measured: of 1/32 some leaves come out 4 times as
 * large, of 1/16 all less than twice, more gains nothing.) */
#define NODE_ROOM (1 + 1.0f / 16)

/* As it is coded: averages are made of what codes stand for, so that nothing else need be kept. */
struct leaf {
    struct qsplat_sphere sphere;
    uint16_t normal, colour; /* codes */
};

struct node {
    struct qsplat_sphere sphere;
    float angle; /* half, of a cone around the decoded normal that holds those of all leaves; pi and more: any */
    uint16_t normal, colour;
};

/* A node, or a leaf at level 0: node i of level k has the leaves [i 4^k, (i + 1) 4^k), as far as there are so many; one with a
 * single child is that child. */
struct place {
    uint64_t index;
    uint32_t level;
};

/* What averages are made of, per node while its parent needs them. */
struct sums {
    float normal[3], colour[3], weight; /* by area; colours linear */
    float reach, span;                  /* from the root's centre: of the spheres, of their centres */
};

/* A range of leaves that are in memory, from a multiple of RUN on, and the nodes above below KEPT_LEVEL. */
struct window {
    uint64_t first, count;
    struct leaf *leaves;
    struct node *levels[KEPT_LEVEL]; /* from 1 on */
};

/* A group of siblings that is still to be written, and its parent. */
struct pending {
    struct qsplat_sphere sphere; /* as it decodes */
    struct place place;
    uint64_t at;
};

/* What is below the siblings of one group, as far as they have children. All in one run. */
struct page {
    struct pending parents[QSPLAT_CHILDREN];
    uint64_t count, at, size;
};

struct builder {
    pbr_instance *instance;
    const struct progress *progress;
    struct qsplat *tree;
    const struct qsplat_codes *codes;
    uint64_t count;
    float extent;                      /* of the points: radii are weighed by it */
    float linear[2][64];               /* of 5 bits, of 6 bits of an sRGB colour */
    uint32_t top;                      /* level of the root */
    struct node *levels[LEVELS];       /* from KEPT_LEVEL to top, to RUN_LEVEL at least */
    struct sums *sums;                 /* of the highest level that is done, from RUN_LEVEL on */
    uint64_t upper_groups, upper_size; /* of the levels above pages: groups, bytes */
    struct page *pages;                /* tree->link_count of them */
};

/* Prepares what follows from the number of leaves and their extent. The tree's codes, centre and has_colours are set. */
pbr_result builder_start(struct builder *builder, uint64_t count, double extent);
void builder_end(struct builder *builder);

/* position: object space; normal: any length, zero for none; colour: sRGB, may be NULL. Any thread. */
struct leaf builder_make_leaf(const struct builder *builder, const double position[3], const float normal[3], const uint8_t *colour,
                              float radius);

/* ---- Shape ---- */

uint64_t level_count(const struct builder *builder, uint32_t level);
uint64_t leaves_below(const struct builder *builder, struct place place);
/* The children of a node that has more than one leaf. Returns how many. */
uint32_t children_of(const struct builder *builder, struct place parent, struct place out[QSPLAT_CHILDREN]);

/* At level 1 and above. */
struct node *node_at(const struct builder *builder, const struct window *window, uint32_t level, uint64_t index);

/* ---- Order ---- */

/* Down to runs, by all threads. Then within one. */
pbr_result order_runs(pbr_instance *instance, struct leaf *leaves, size_t count, const struct progress *progress);
void order_leaves(struct leaf *leaves, size_t count);

/* ---- Nodes ---- */

/* Of one run of the window: those up to RUN_LEVEL. sums: scratch of RUN_SUMS. */
enum { RUN_SUMS = RUN / QSPLAT_CHILDREN };
void make_run(struct builder *builder, const struct window *window, uint64_t run, struct sums *sums);
/* Of all levels above, once all runs are made; and the root's sphere, whose centre is the origin. */
struct qsplat_sphere make_upper_levels(struct builder *builder);

pbr_result window_create(const struct builder *builder, uint64_t count, struct window *window);
void window_free(const struct builder *builder, struct window *window);

/* ---- Encoding ---- */

/* Sets what of the tree follows from its shape, its size among it, and makes `pages`. */
pbr_result plan_pages(struct builder *builder);
/* Writes the upper levels to `nodes`, upper_size bytes, and where pages begin. end: a window that holds the last leaf. */
pbr_result write_upper(struct builder *builder, const struct window *end, const struct qsplat_sphere *root, uint8_t *nodes);
/* Of tree->link_count links, 8 bytes each. */
void store_links(const struct builder *builder, uint8_t *links);
/* Writes a page. queue: scratch. */
enum {
    /* Inner nodes of a page: of all but the last on each level four children, of those two. */
    PAGE_GROUPS = QSPLAT_CHILDREN * QSPLAT_PAGE_LEAVES / 3 + 2 * RUN_LEVEL
};
void write_page(const struct builder *builder, const struct window *window, const struct page *page, struct pending *queue,
                uint8_t *out);

#endif
