/* Building QSplat trees: what the parts of it share. The steps:
 *
 *   order   halves the leaves across their longest side, again and again, or at a gap where there is one   qsplat_order.c
 *   nodes   spheres, cones and averages, from the leaves up                              qsplat_nodes.c, qsplat_enclose.c
 *   encode  codes and places in the file, from the root down                                                qsplat_encode.c
 *
 * A tree is one of branches, whose tips are runs; a run is a tree of nodes, whose tips are leaves. qsplat_build.c has all runs in
 * memory, qsplat_stream.c only those of one bucket. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_QSPLAT_BUILD_H
#define PBR_LOD_QSPLAT_BUILD_H

#include "qsplat.h"

enum { RUN = 1 << 14 /* leaves of a run, at most; a power of four, so that whole trees have whole runs */ };

/* How much wider the spheres of inner nodes are made. Codes lie within the parent's cube: a leaf that touches the rim of its
 * parent, and a tight sphere has such, would have no code but the parent's own. (Measured: of 1/32 some leaves come out 4 times as
 * large, of 1/16 all less than twice, more gains nothing.) */
#define NODE_ROOM (1 + 1.0f / 16)

/* As it is coded: averages are made of what codes stand for, so that nothing else need be kept. */
struct leaf {
    struct qsplat_sphere sphere;
    uint16_t normal, colour; /* codes */
};

/* A child's place: in the run's nodes or the tree's branches; with TIP in the run's leaves or the tree's runs. */
typedef uint32_t place;
#define TIP UINT32_C(0x80000000)

struct node {
    struct qsplat_sphere sphere;
    float angle; /* half, of a cone around the decoded normal that holds those of all leaves; pi and more: any */
    uint16_t normal, colour;
    place children[QSPLAT_CHILDREN];
    uint8_t child_count; /* 0: a leaf */
    bool has_grandchildren;
};

/* What averages are made of. */
struct sums {
    float normal[3], colour[3], weight; /* by area; colours linear */
    float reach, span;                  /* from the root's centre: of the spheres, of their centres */
};

/* A subtree that one thread works on. What is below its root's children is a page of the file. */
struct run {
    uint64_t first; /* of its leaves, among those in memory or of the temporary file */
    uint32_t count;
    struct node root, children[QSPLAT_CHILDREN];
    struct qsplat_sphere decoded[QSPLAT_CHILDREN]; /* the children's, once the upper levels are written */
    struct sums sums;
    uint64_t page_at, page_size; /* in the file's nodes */
};

/* A node above runs. */
struct branch {
    struct node node;
    struct sums sums;
};

struct builder {
    pbr_instance *instance;
    const struct progress *progress;
    struct qsplat *tree;
    const struct qsplat_codes *codes;
    float extent;            /* of the points: radii are weighed by it */
    float linear[2][64];     /* of 5 bits, of 6 bits of an sRGB colour */
    struct run *runs;        /* in the order of their leaves */
    struct branch *branches; /* children first */
    size_t run_count, run_capacity, branch_count, branch_capacity;
    uint64_t upper_size; /* of the groups above pages, in bytes */
};

/* The builder's codes, the tree's centre and has_colours are set. */
void builder_start(struct builder *builder, double extent);
/* Makes room for so many runs and branches more. */
pbr_result builder_grow(struct builder *builder, size_t runs, size_t branches);
void builder_end(struct builder *builder);

/* position: object space; normal: any length, zero for none; colour: sRGB, may be NULL. Any thread. */
struct leaf builder_make_leaf(const struct builder *builder, const double position[3], const float normal[3], const uint8_t *colour,
                              float radius);

/* ---- Order ---- */

/* The `rank` least along the axis come first, in any order. As a rule that takes one and a half to three looks at each of them;
 * after `usual_looks` (USUAL_LOOKS, or 0) pivots are chosen that no order of leaves can make bad, and dear. */
enum { USUAL_LOOKS = 24 };
void select_least(struct leaf *leaves, size_t count, size_t rank, int axis, int usual_looks);

/* Orders leaves down to runs, by all threads, and adds the runs, the first of which begins at leaf `first`, and the branches above
 * them, whose root is *root. progress: NULL for one of several times. */
pbr_result order_runs(struct builder *builder, struct leaf *leaves, size_t count, uint64_t first, const struct progress *progress,
                      place *root);

/* Splits some of a run's leaves, two at least, among the children of one node: child i has those from starts[i] to starts[i + 1].
 * are_ordered: they were split like this before, and are still where they came to be. Returns how many children. */
uint32_t split_leaves(struct leaf *leaves, size_t count, bool are_ordered, size_t starts[QSPLAT_CHILDREN + 1]);

/* ---- Nodes ---- */

/* Up to four nodes, at least one, and their children's spheres. */
struct siblings {
    struct qsplat_sphere children[QSPLAT_CHILDREN][QSPLAT_CHILDREN];
    uint32_t child_counts[QSPLAT_CHILDREN], count;
};

/* A sphere around each one's children, not far from the least: steps towards the farthest child, ever shorter, from the middle
 * (Badoiu & Clarkson 2003). The radius is rounded up. */
void enclose_siblings(const struct siblings *siblings, struct qsplat_sphere *out);

/* Of a run, from its leaves, which it orders unless they are; the root comes last. nodes: RUN of them. Returns how many: 0 of one
 * leaf. */
uint32_t make_nodes(const struct builder *builder, struct leaf *leaves, size_t count, bool are_ordered, struct node *nodes,
                    struct sums *sums);
/* The same, of leaves that are not ordered, and sets what the tree holds of the run. */
uint32_t make_run(const struct builder *builder, struct leaf *leaves, struct node *nodes, struct run *run);

/* Puts subtrees, in their order, under one root, roots[0] then. */
pbr_result join_roots(struct builder *builder, place *roots, size_t count);
/* Once all runs are made: the branches' nodes, and the root's sphere, whose centre is the origin. */
struct qsplat_sphere make_branches(struct builder *builder, place root);

/* ---- Encoding ---- */

/* Of a run or a branch. */
static inline struct node *upper_node(const struct builder *builder, place at) {
    return at & TIP ? &builder->runs[at & ~TIP].root : &builder->branches[at].node;
}

static inline struct node node_of_leaf(const struct leaf *leaf) {
    return (struct node){
        .sphere = leaf->sphere, .angle = leaf->normal == QSPLAT_NO_NORMAL ? 4 : 0, .normal = leaf->normal, .colour = leaf->colour};
}

/* Bytes of the page of a run with these nodes. */
uint64_t page_size(const struct builder *builder, const struct node *nodes, uint32_t count);

/* A group of siblings that is still to be written, and its parent. */
struct pending {
    struct qsplat_sphere sphere; /* as it decodes */
    place parent;
    uint64_t at;
};

/* Sets what of the tree follows from its shape, its size among it, and where pages lie. */
pbr_result plan_pages(struct builder *builder, place root);
/* Writes the upper levels to `nodes`, upper_size bytes. */
pbr_result write_upper(struct builder *builder, place root, const struct qsplat_sphere *sphere, uint8_t *nodes);
/* Of tree->link_count links, 8 bytes each. */
void store_links(const struct builder *builder, uint8_t *links);
/* Writes a run's page. queue: scratch, as many as nodes. */
void write_page(const struct builder *builder, const struct run *run, const struct leaf *leaves, const struct node *nodes,
                struct pending *queue, uint8_t *out);

#endif
