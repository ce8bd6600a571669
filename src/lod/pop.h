/* POP (Chen & Nguyen 2001; Benda 2005): a hierarchy of balls over a triangle mesh. What is small on the screen is drawn as a point,
 * and where a point would be too large, even a single triangle's, the triangle.
 *
 * Shape. The leaves, level 0, are balls around a triangle each. The nodes of a level are split at the median along the longest side
 * until no more than 4 are together, and each group is a node of the next level; odd numbers are split into floor and ceiling. So
 * where groups begin depends on the number of triangles alone: of n nodes split d times, group j begins at floor(j n / 2^d), and
 * where there would be fives, each of them is two groups. The cuts of each level are cuts of the leaves, too: one order of the
 * triangles, from one sequence of median splits, serves all levels. Hence a node's children and its parent are found by a few
 * integer operations (pop_children, pop_parent): no links, counts or tables are stored.
 *
 * Data. Levels one after the other, the root first, 12 bytes a node; as they lie they can be mapped from a file or be a vertex
 * buffer. Leaf i stands for triangle i: triangles are stored again in the order of the leaves, 12 bytes each, as indices into the
 * vertices of the mesh, which are copied as records of the renderer's. The mesh itself may be released. There are 1.33 to 1.53
 * nodes a triangle (of large meshes), 16 to 18.4 bytes beside triangles (12 bytes) and vertices (24 bytes, as a vertex buffer has
 * them).
 *
 * Balls are nested as they decode: a node's holds its children's, a leaf's its triangle. Codes are absolute, so that any node can
 * be decoded without those above it. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_POP_H
#define PBR_LOD_POP_H

#include <math.h>
#include <pbr/lod.h>
#include <stdbool.h>

#include "core/instance.h"
#include "core/mesh.h"
#include "core/splat.h"

enum {
    POP_CHILDREN = 4,
    POP_LEVELS = 20, /* more than 2^31 leaves have */
    POP_POSITION_CODES = 32767,
    POP_RADIUS_BITS = 14,
    POP_NO_NORMAL = -128,
    POP_NO_CONE = 3
};

#define POP_TRIANGLES_MOST UINT64_C(0x7fffffff)

/* As it lies in files and on the GPU, little-endian. */
struct pop_node {
    int16_t position[3]; /* in steps, from the centre */
    uint16_t size;       /* radius code in the lower 14 bits, cone code above */
    int8_t normal[2];    /* octahedral, as in struct splat with 127 for 32767; POP_NO_NORMAL twice: none */
    uint16_t colour;     /* sRGB, 5-6-5 */
};
_Static_assert(sizeof(struct pop_node) == 12, "nodes lie in files as they are");

struct pop_level {
    uint64_t first; /* node: the root is 0 */
    uint64_t count;
    uint32_t splits; /* of the groups that are the next level's nodes: in 2^splits parts, */
    bool has_fives;  /* of which those of five are halved once more */
};

/* Follows from the number of triangles. */
struct pop_shape {
    uint32_t level_count; /* the last one is the root; 0: there are no triangles */
    uint64_t nodes;
    struct pop_level levels[POP_LEVELS];
};

/* Immutable once made. */
struct pop {
    double centre[3]; /* object space; all floats are relative to it */
    double radius;    /* of a ball around the centre that holds all balls */
    float position_step, radius_step;
    bool has_colours;
    struct pop_shape shape;
    const struct pop_node *nodes;
    const uint32_t (*triangles)[3]; /* in the order of the leaves */
    const struct splat *vertices;   /* their radii: the mean of the balls of the triangles around them */
    uint64_t vertex_count;
    double span; /* farthest vertex from the centre */
    bool owns;   /* these are of the instance's memory; else in a file */
};

/* ---- Shape ---- */

/* count: at most POP_TRIANGLES_MOST. */
void pop_shape_of(uint64_t count, struct pop_shape *shape);

/* The children of a node above level 0: `*first` of the level below and those after it; returns how many, 2 to 4. */
uint32_t pop_children(const struct pop_shape *shape, uint32_t level, uint64_t index, uint64_t *first);

/* Of a node that is not the root, in the level above. */
uint64_t pop_parent(const struct pop_shape *shape, uint32_t level, uint64_t index);

static inline const struct pop_node *pop_node_at(const struct pop *pop, uint32_t level, uint64_t index) {
    return &pop->nodes[pop->shape.levels[level].first + index];
}

/* ---- Decoding, as shaders can do it: in float ---- */

struct pop_ball {
    float centre[3], radius;
};

/* The code is a small float, 4 bits of exponent and 10 of fraction. */
static inline uint32_t pop_decode_size(uint32_t code) {
    const uint32_t exponent = code >> 10, fraction = code & 1023;
    return exponent == 0 ? fraction : (1024 + fraction) << (exponent - 1);
}
/* The radius step is a power of two, so that radii are exact. */
static inline struct pop_ball pop_decode_ball(const struct pop *pop, const struct pop_node *node) {
    struct pop_ball ball;
    for (int k = 0; k < 3; k++) ball.centre[k] = (float)node->position[k] * pop->position_step;
    ball.radius = (float)pop_decode_size(node->size & ((1u << POP_RADIUS_BITS) - 1)) * pop->radius_step;
    return ball;
}
/* As struct splat has it. */
static inline void pop_decode_normal(const struct pop_node *node, int16_t out[2]) {
    for (int i = 0; i < 2; i++)
        out[i] = node->normal[i] == POP_NO_NORMAL ? SPLAT_NO_NORMAL : (int16_t)lrintf((float)node->normal[i] * (32767.0f / 127));
}
static inline uint32_t pop_cone(const struct pop_node *node) {
    return node->size >> POP_RADIUS_BITS;
}

/* Sine of a cone's half angle, by its code; the last code is that normals point anywhere. The normals of all corners of all
 * triangles below a node are in its cone around its normal, as both decode. */
#define POP_CONE_SINES                                                                                                             \
    { 1.0 / 16, 4.0 / 16, 9.0 / 16 }

/* ---- Encoding ---- */

/* The nearest code; and the smallest that is no less. What is too large for it gets the largest. */
int16_t pop_encode_coordinate(const struct pop *pop, double coordinate);
uint32_t pop_encode_radius(const struct pop *pop, double radius);
/* n: any length; zero: none. */
void pop_encode_normal(const double n[3], int8_t out[2]);
/* The smallest that holds the half angle, in radians. */
uint32_t pop_encode_cone(double half_angle);

/* ---- Making ---- */

/* The result does not depend on the number of threads. */
pbr_result pop_build(const pbr_mesh *mesh, const struct progress *progress, struct pop *pop);
void pop_free(pbr_instance *instance, struct pop *pop);

/* ---- All else that lod.h asks for ---- */

pbr_result pop_measure(const struct pop *pop, const struct progress *progress, pbr_lod_statistics *statistics);
/* The vertices, with their radii. */
pbr_result pop_to_points(pbr_instance *instance, const struct pop *pop, const struct progress *progress, pbr_points **out);

/* A section of our container. */
#define POP_SECTION "POP\0\0\0\0"
pbr_result pop_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct pop *pop);
pbr_result pop_section_write(pbr_instance *instance, const char *path, const struct pop *pop, const struct progress *progress);

#endif
