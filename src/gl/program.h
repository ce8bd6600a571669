/* Programs: one per combination of splat kind, primitive, shading, colour source and encoding, compiled when first needed.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_GL_PROGRAM_H
#define PBR_GL_PROGRAM_H

#include "context.h"

/* A combination, as bits; each bit is a #define of the shaders. */
enum {
    VARIANT_CIRCLE = 1 << 0, /* else square */
    VARIANT_QUADS = 1 << 1,  /* else GL points */
    VARIANT_LIT = 1 << 2,
    VARIANT_CULL = 1 << 3,
    VARIANT_CLIP_PLANES = 1 << 4,
    VARIANT_ENCODE_SRGB = 1 << 5,
    VARIANT_ONE_LIGHT = 1 << 6, /* with LIT */
    VARIANT_COLOUR_SHIFT = 7,   /* 3 bits: PBR_COLOUR_... */
    VARIANT_COUNT = 1 << 10
};

#define PROGRAM_UNIFORMS(U)                                                                                                        \
    U(to_clip)                                                                                                                     \
    U(to_eye) U(normal_to_eye) U(eye) U(size) U(pixel) U(colour) U(map) U(map_range) U(light_count) U(light_vector)                \
        U(light_colour) U(ambient) U(material) U(clip_plane_count) U(clip_plane)

struct program {
    GLuint name;    /* 0: not compiled yet */
    bool refused;   /* by the driver */
    uint64_t frame; /* serial number of the frame whose lights it holds */
#define U(uniform) GLint uniform;
    PROGRAM_UNIFORMS(U)
#undef U
};

/* Compiles and links the program of a variant. The driver's complaints go to the log. */
pbr_result program_create(pbr_instance *instance, const struct gl *gl, uint32_t variant, struct program *program);

#endif
