/* QSplat (Rusinkiewicz & Levoy 2000): a tree of bounding spheres in 32 bits a node, 48 with colours.
 *
 * Nodes lie in groups of siblings. A node's sphere is one of 7621 within its parent's, as a grid of 13 cells over the parent's cube
 * has them; decoding starts at the root. By induction all that is below a node lies in the cube around its decoded sphere.
 *
 * Groups lie in a file of QSplat 11 breadth first. Ours begins with the upper levels in that order; what is below the children of
 * a subtree of at most 16,384 leaves is a page of its own, so that what is drawn together lies together. Numbers are big-endian in both.
 * docs/qsplat.md. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_QSPLAT_H
#define PBR_LOD_QSPLAT_H

#include <pbr/lod.h>
#include <stdbool.h>

#include "core/instance.h"
#include "core/splat.h"
#include "residency.h"

enum {
    QSPLAT_GRID = 13,
    QSPLAT_SPHERES = 7621,
    QSPLAT_NORMAL_GRID = 52,
    QSPLAT_NORMALS = 6 * QSPLAT_NORMAL_GRID * QSPLAT_NORMAL_GRID,
    QSPLAT_NORMAL_CODES = 1 << 14,
    QSPLAT_NO_NORMAL = QSPLAT_NORMAL_CODES - 1, /* in our files; others decode it to +z */
    QSPLAT_CHILDREN = 4
};

/* What codes stand for. Made with each tree: a library has no tables that it writes once and keeps. */
struct qsplat_codes {
    float spheres[1 << QSPLAT_GRID][4];         /* centre and radius in a parent's units; unused codes: 0, 0, 0, 1/13 */
    float normals[QSPLAT_NORMAL_CODES][3];      /* unit, or 0 0 0 */
    int16_t octahedral[QSPLAT_NORMAL_CODES][2]; /* as of struct splat */
    uint16_t indices[QSPLAT_GRID + 1][QSPLAT_GRID][QSPLAT_GRID][QSPLAT_GRID]; /* size, x, y, z -> code; QSPLAT_SPHERES: none */
    float edges[QSPLAT_NORMAL_GRID + 1];                                      /* of a face's cells */
};

/* own: of trees by qsplat_build, where QSPLAT_NO_NORMAL means none. */
void qsplat_codes_make(bool own, struct qsplat_codes *codes);

uint16_t qsplat_encode_normal(const struct qsplat_codes *codes, const float normal[3]);
uint16_t qsplat_encode_colour(const uint8_t srgb[3]);

/* A sphere as cuts have it: float, relative to the root's centre. */
struct qsplat_sphere {
    float centre[3], radius;
};

static inline struct qsplat_sphere qsplat_decode_sphere(const struct qsplat_codes *codes, uint32_t code,
                                                        const struct qsplat_sphere *parent) {
    const float *s = codes->spheres[code];
    return (struct qsplat_sphere){{parent->centre[0] + s[0] * parent->radius, parent->centre[1] + s[1] * parent->radius,
                                   parent->centre[2] + s[2] * parent->radius},
                                  s[3] * parent->radius};
}

/* The code of the smallest sphere that holds `sphere`, of those tried, and what it decodes to. Where none does, the parent's own: it
 * holds all leaves below. With a unit normal, or zero, one whose disc across it hides what `sphere`'s does, also from aside, if one of
 * at most two sizes more, below the parent's, does; of several of a size the one next to the disc's plane. */
uint16_t qsplat_encode_sphere(const struct qsplat_codes *codes, const struct qsplat_sphere *sphere, const float normal[3],
                              const struct qsplat_sphere *parent, struct qsplat_sphere *decoded);

struct qsplat {
    double centre[3];       /* root, object space */
    float radius;           /* of the root */
    float span;             /* farthest centre of a leaf, as it was before it was coded; of files by others: radius */
    uint32_t root_children; /* 0 to 4; QSplat 11: any number */
    bool has_colours, own;
    uint64_t leaves;
    const uint8_t *nodes; /* groups of siblings */
    uint64_t size;        /* bytes */
    const uint8_t *links; /* own: where pages begin in `nodes`, little-endian 64 bits each */
    uint64_t link_count;
    struct qsplat_codes *codes;
    struct residency *residency; /* of a mapping; NULL: everything is in memory */
};

/* Where a group of siblings lies. */
struct qsplat_group {
    uint64_t at;    /* of its first byte in `nodes` */
    uint32_t count; /* of siblings */
    bool inner;     /* some of them have children: a pointer comes first */
};

static inline uint32_t qsplat_node_size(const struct qsplat *tree) {
    return tree->has_colours ? 6 : 4;
}
static inline uint64_t qsplat_group_size(const struct qsplat *tree, const struct qsplat_group *group) {
    return (uint64_t)group->count * qsplat_node_size(tree) + (group->inner ? 4 : 0);
}
static inline struct qsplat_group qsplat_root_group(const struct qsplat *tree) {
    return (struct qsplat_group){0, tree->root_children, tree->leaves > tree->root_children};
}
static inline bool qsplat_group_is_inside(const struct qsplat *tree, const struct qsplat_group *group) {
    const uint64_t bytes = qsplat_group_size(tree, group);
    return bytes <= tree->size && group->at <= tree->size - bytes;
}

/* Before a group's bytes are read: it is inside. */
static inline void qsplat_touch(const struct qsplat *tree, const struct qsplat_group *group) {
    if (tree->residency && group->count > 0)
        residency_touch(tree->residency, tree->nodes + group->at, qsplat_group_size(tree, group));
}

static inline uint32_t load_big16(const uint8_t *p) {
    return (uint32_t)p[0] << 8 | p[1];
}
static inline uint32_t load_big32(const uint8_t *p) {
    return load_big16(p) << 16 | load_big16(p + 2);
}

struct qsplat_node {
    uint32_t sphere, normal, cone, colour; /* codes; colour 0 where the tree has none */
    uint32_t children;
    bool grandchildren;
};

/* p: within the file. */
static inline struct qsplat_node qsplat_read_node(const uint8_t *p, bool has_colours) {
    const uint32_t bits = load_big32(p), children = bits >> 16 & 3;
    return (struct qsplat_node){.sphere = bits >> 19,
                                .normal = bits >> 2 & (QSPLAT_NORMAL_CODES - 1),
                                .cone = bits & 3,
                                .colour = has_colours ? load_big16(p + 4) : 0,
                                .children = children ? children + 1 : 0,
                                .grandchildren = (bits >> 18 & 1) != 0};
}

/* Where the first of the grandchildren's groups lies; the others follow. Pointers lead onwards, so there are no circles; true
 * unless this one does not. The group is inside. */
static inline bool qsplat_follow(const struct qsplat *tree, const struct qsplat_group *group, uint64_t *next) {
    const uint32_t pointer = load_big32(tree->nodes + group->at);
    *next = group->at + pointer;
    if (pointer >> 31) {
        const uint64_t link = ~pointer;
        if (link >= tree->link_count) return false;
        *next = 0;
        for (int k = 7; k >= 0; k--) *next = *next << 8 | tree->links[8 * link + (uint64_t)k];
    }
    return *next >= group->at + qsplat_group_size(tree, group) && *next < tree->size;
}

static inline void qsplat_decode_colour(uint32_t code, uint8_t out[4]) {
    const uint32_t r = code >> 11 & 31, g = code >> 5 & 63, b = code & 31;
    out[0] = (uint8_t)(r << 3 | r >> 2);
    out[1] = (uint8_t)(g << 2 | g >> 4);
    out[2] = (uint8_t)(b << 3 | b >> 2);
    out[3] = 255;
}

/* Nodes that a walk may meet: as many as fit, so that damaged pointers that lead to the same place cannot make it endless. */
static inline uint64_t qsplat_most_nodes(const struct qsplat *tree) {
    return tree->size / qsplat_node_size(tree);
}

/* ---- Building ---- */

struct qsplat_blob { /* of the instance's memory */
    uint8_t *nodes, *links;
};

/* Fills in `tree`, with what it points at in `blob`; codes: made with own. */
pbr_result qsplat_build(pbr_instance *instance, const pbr_points *points, const struct progress *progress, struct qsplat *tree,
                        struct qsplat_blob *blob);

/* The same out of core, into a file of our own kind; without all of it in memory. docs/qsplat.md, "Building". */
pbr_result qsplat_stream(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path,
                         const struct qsplat_codes *codes);

/* ---- Walking over all ---- */

struct qsplat_visit {
    struct qsplat_node node;
    struct qsplat_sphere sphere;
    const struct qsplat_sphere *parent;
    uint32_t level; /* the root's children: 1 */
};

typedef void (*qsplat_visit_fn)(void *user, const struct qsplat_visit *visit);

/* Every node but the root, depth first. `*damaged` counts groups that could not be followed. */
pbr_result qsplat_walk(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress, const char *stage,
                       qsplat_visit_fn visit, void *user, uint64_t *damaged);

pbr_result qsplat_measure(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress,
                          pbr_lod_statistics *statistics);
pbr_result qsplat_to_points(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress, pbr_points **out);

/* ---- Files ---- */

/* Whether the bytes are a file of QSplat; and the tree in it, which points into them. Errors are logged with the path. */
bool qsplat_file_recognise(const uint8_t *data, uint64_t size);
pbr_result qsplat_file_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct qsplat *tree);
pbr_result qsplat_file_write(pbr_instance *instance, const char *path, const struct qsplat *tree, const struct progress *progress);

/* The same of a section of our container, with its type. */
#define QSPLAT_SECTION "QSPLAT\0"
pbr_result qsplat_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct qsplat *tree);
/* A section: this header, the links, the nodes. */
enum { QSPLAT_SECTION_HEADER = 64 };
void qsplat_section_header(const struct qsplat *tree, uint8_t header[QSPLAT_SECTION_HEADER]);
pbr_result qsplat_section_write(pbr_instance *instance, const char *path, const struct qsplat *tree,
                                const struct progress *progress);

/* ---- Cut ---- */

struct cut;
struct cut_view;
struct occlusion;
pbr_result qsplat_cut(pbr_instance *instance, const struct qsplat *tree, const struct cut_view *view,
                      const struct occlusion *occlusion, const atomic_bool *cancel, struct cut *cut);

#endif
