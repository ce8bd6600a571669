/* Programs: one per combination of splat kind, primitive, shading, colour source and encoding, compiled when first needed.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_GL_PROGRAM_H
#define PBR_GL_PROGRAM_H

#include "context.h"

/* What a draw is for. */
enum pass {
    PASS_OPAQUE,
    PASS_VISIBILITY,   /* what is blended: how far the front layer reaches */
    PASS_ACCUMULATION, /* sums of weighted colours over that layer; filled: of the centres' colours */
    PASS_RESOLVE,      /* their quotient into the host's target; no splats */
    PASS_COUNT,
    PASS_SELECT = PASS_COUNT /* before those that are blended: which entries they draw. Of none of an item's programs */
};

/* What a pass draws by. */
enum primitive { PRIMITIVE_POINTS, PRIMITIVE_QUADS, PRIMITIVE_TRIANGLES, PRIMITIVE_COUNT };

/* A combination: fields, and bits that are each a #define of the shaders. */
enum {
    VARIANT_KIND_SHIFT = 0, /* 3 bits: PBR_SPLAT_... */
    VARIANT_PASS_SHIFT = 3, /* 2 bits: PASS_... */
    VARIANT_QUADS = 1 << 5, /* else GL points */
    VARIANT_LIT = 1 << 6,
    VARIANT_CULL = 1 << 7,
    VARIANT_CLIP_PLANES = 1 << 8,
    VARIANT_ENCODE_SRGB = 1 << 9,
    VARIANT_ONE_LIGHT = 1 << 10, /* with LIT */
    VARIANT_DEFERRED = 1 << 11,  /* accumulation and resolve: lit once a pixel */
    VARIANT_FIELD = 1 << 12,     /* with DEFERRED: normals vary over a splat */
    VARIANT_FILL = 1 << 13,      /* marks, centres, and the picture between them */
    VARIANT_COLOUR_SHIFT = 14,   /* 3 bits: PBR_COLOUR_... */
    VARIANT_SEQUENCE = 1 << 17,  /* entries of sequential point trees instead of records */
    VARIANT_TRIANGLES = 1 << 18, /* between records, instead of splats */
    VARIANT_TILES = 7 << VARIANT_KIND_SHIFT | 3 << VARIANT_PASS_SHIFT, /* PASS_RESOLVE of no splats: depth of tiles */
    VARIANT_SELECT = 6 << VARIANT_KIND_SHIFT | 3 << VARIANT_PASS_SHIFT, /* likewise: the compute program of PASS_SELECT */
    /* Of a pass that has no colours: */
    VARIANT_GEOMETRY = 7 << VARIANT_KIND_SHIFT | VARIANT_QUADS | VARIANT_CULL | VARIANT_CLIP_PLANES | VARIANT_SEQUENCE | VARIANT_TRIANGLES
};

#define PROGRAM_UNIFORMS(U)                                                                                                        \
    U(to_clip)                                                                                                                     \
    U(to_eye)                                                                                                                      \
    U(normal_to_eye)                                                                                                               \
    U(eye)                                                                                                                         \
    U(size)                                                                                                                        \
    U(pixel)                                                                                                                       \
    U(colour)                                                                                                                      \
    U(map)                                                                                                                         \
    U(map_range)                                                                                                                   \
    U(light_count) U(light_vector) U(light_colour) U(ambient) U(material) U(clip_plane_count) U(clip_plane) U(projection) U(ray)   \
        U(radius) U(window) U(depth) U(back) U(filter) U(low_pass) U(colours) U(second) U(front) U(corner) U(box) U(steps) U(cut)  \
        U(clip_origins) U(eye_origins) U(plane_offsets) U(rows) U(ranges) U(rejected)

struct program {
    uint32_t variant;
    GLuint name;    /* 0: refused by the driver */
    uint64_t frame; /* serial number of the frame whose lights it holds */
    bool draws_many; /* of sequences: it tells the draws of one call apart */
#define U(uniform) GLint uniform;
    PROGRAM_UNIFORMS(U)
#undef U
};

/* Those needed so far. */
struct programs {
    struct program *entries;
    uint32_t count, capacity;
};

/* The index of a variant's program, which is compiled and linked if it is new: `*compiled` counts it. The driver's complaints go to
 * the log, once. */
pbr_result programs_need(pbr_instance *instance, const struct gl *gl, struct programs *programs, uint32_t variant, uint32_t *index,
                         uint32_t *compiled);

/* With gl NULL (abandoned context) no GL call is made. */
void programs_free(pbr_instance *instance, const struct gl *gl, struct programs *programs);

#endif
