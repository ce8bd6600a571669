/* Sequential point trees (Dachsbacher, Vogelgsang, Stamminger 2003): the nodes of a tree of discs as one sequence, of which a view
 * needs a part, and of that part what a test of each node by itself keeps. No walk, nothing sent from frame to frame.
 *
 * A node is fine enough at depth z if s e <= z, e its error, s = focal length in pixels / threshold in pixels. It is drawn if it is
 * and its parent, of error E, is not: s e <= z < s E + D, where D, the distance to the parent, stands for the depths that differ
 * between the two. Sorted by E, what may be drawn from a nearest depth on is a prefix.
 *
 * Large trees are cut into chunks, each a tree and a sequence of its own. docs/spt.md. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_SPT_H
#define PBR_LOD_SPT_H

#include <pbr/lod.h>
#include <stdbool.h>

#include "core/instance.h"
#include "core/normal_field.h"
#include "core/splat.h"

enum {
    SPT_STEP = 256,             /* entries for each line of a chunk's table */
    SPT_CHUNK_LEAVES = 1 << 14, /* at most */
    SPT_LEAF_POINTS_MOST = 16,
    SPT_CODES = 65535, /* steps of a 16-bit code */
    SPT_NO_PARENT = SPT_CODES,
    SPT_ENTRIES_MOST = 1 << 22 /* of a chunk in a file: 80 MiB, below the 128 MiB of a storage block */
};

/* The parent's error of a chunk's root: above all that is compared with it. (Shaders ask for the code: s times this may overflow.)
 */
#define SPT_ENDLESS 1e30f

/* A node as it lies in files and on the GPU, little-endian. */
struct spt_entry {
    uint16_t position[3]; /* in steps from the chunk's origin */
    uint16_t radius;
    int16_t normal[2]; /* as in struct splat; SPLAT_NO_NORMAL twice: none */
    uint8_t colour[3]; /* sRGB */
    uint8_t distance;  /* to the parent; logarithmic, 0 = none */
    uint16_t error;    /* 0: a leaf, and no other */
    uint16_t parent_error;
};
_Static_assert(sizeof(struct spt_entry) == 20, "entries lie in files as they are");

/* Of SPT_STEP entries, or the last ones. */
struct spt_step {
    float error;    /* the parent's, of the first of them, which is the largest */
    float distance; /* largest of them and of all that follow */
    float least;    /* smallest own error of them and of all before */
};
_Static_assert(sizeof(struct spt_step) == 12, "tables lie in files as they are");

/* As it lies in files. Floats are relative to the origin and, as decoding and bounds, of what entries decode to. */
struct spt_chunk {
    double origin[3]; /* relative to the hierarchy's centre */
    float position_step, radius_step, error_step;
    float largest_distance;
    float minimum[3], maximum[3]; /* around all splats, inner nodes' too, whichever way they face */
    float centre[3], radius;      /* a sphere likewise */
    float axis[3], cone; /* of all normals: unit, and the cosine of the largest angle to it; 0 and -1: they have none in common */
    uint64_t first;      /* entry, in the file */
    uint32_t count, leaves;
    uint32_t levels; /* of the deepest leaf; the chunk's root is level 0 */
    uint32_t reserved[3];
};
_Static_assert(sizeof(struct spt_chunk) == 128, "chunks lie in files as they are");

struct spt {
    double centre[3]; /* object space */
    double radius;    /* of all splats around the centre */
    double span;      /* farthest point from the centre */
    uint64_t leaves, count;
    bool has_normals, has_colours;
    uint32_t chunk_count;
    struct spt_chunk *chunks;
    const struct spt_entry **entries; /* per chunk */
    const struct spt_step **steps;
    const struct normal_field **fields; /* as the entries; NULL: there are none */
    bool owns;                          /* entries, steps and fields are of the instance's memory; else in a file */
};

void spt_free(pbr_instance *instance, struct spt *spt);

static inline uint32_t spt_step_count(const struct spt_chunk *chunk) {
    return chunk->count / SPT_STEP + (chunk->count % SPT_STEP != 0);
}

/* ---- Decoding, as shaders do it: in float ---- */

static inline void spt_decode_position(const struct spt_chunk *chunk, const struct spt_entry *entry, float out[3]) {
    for (int k = 0; k < 3; k++) out[k] = (float)entry->position[k] * chunk->position_step;
}
static inline float spt_decode_radius(const struct spt_chunk *chunk, const struct spt_entry *entry) {
    return (float)entry->radius * chunk->radius_step;
}
/* Own and parents' alike: a child's parent_error is its parent's error. */
static inline float spt_decode_error(const struct spt_chunk *chunk, uint16_t code) {
    return code == SPT_NO_PARENT ? SPT_ENDLESS : (float)code * chunk->error_step;
}
/* 16 codes an octave. */
static inline float spt_decode_distance(const struct spt_chunk *chunk, uint8_t code) {
    return code == 0 ? 0 : chunk->largest_distance * exp2f((float)(code - 255) / 16);
}

/* What a shader's depths may be off, relative to them: sums of four products in float. */
#define SPT_DEPTH_ROOM 0x1p-20f

/* Whether a node is drawn: e, E: its error and its parent's, D: their distance; z > 0: its depth along the view axis, or 1 where
 * the projection has no depth; s: pixels that a unit covers at depth 1, by the threshold in pixels. s infinite (threshold 0): the
 * leaves. Those are always fine enough, also where z is not positive. Where the parent is elsewhere, its depth has room for what
 * both were rounded. The shaders' reference: float, and no operation that they have not. */
static inline bool spt_is_drawn(float e, float E, float D, float s, float z) {
    if (isinf(s)) return e == 0;
    return (e == 0 || s * e <= z) && z - (D > 0 ? SPT_DEPTH_ROOM * z : 0) < s * E + D;
}

/* Entries [*first, *end) of a chunk that may be drawn where all depths are within z_near..z_far; for a projection without depth
 * both are 1. What spt_is_drawn keeps is never left out. */
void spt_range(const struct spt_chunk *chunk, const struct spt_step *steps, double s, double z_near, double z_far, uint32_t *first,
               uint32_t *end);

/* Whether nothing from the step's first entry on is drawn: all parents are fine enough. */
bool spt_step_ends(const struct spt_step *step, double s, double z_near);

/* ---- Making, and all else that lod.h asks for ---- */

/* leaf_points: 1 to SPT_LEAF_POINTS_MOST. fields: to be made, where there are normals. */
pbr_result spt_build(pbr_instance *instance, const pbr_points *points, uint32_t leaf_points, bool fields,
                     const struct progress *progress, struct spt *spt);

pbr_result spt_measure(const struct spt *spt, const struct progress *progress, pbr_lod_statistics *statistics);
pbr_result spt_to_points(pbr_instance *instance, const struct spt *spt, const struct progress *progress, pbr_points **out);

/* ---- Files: a section of our container ---- */

#define SPT_SECTION "SPT\0\0\0\0"
pbr_result spt_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct spt *spt);
pbr_result spt_section_write(pbr_instance *instance, const char *path, const struct spt *spt, const struct progress *progress);

#endif
