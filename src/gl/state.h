/* The host's GL state: saved before libpbr draws, set to what libpbr needs, put back after. Only index 0 of indexed state is
 * touched where the context can, so the other viewports and draw buffers stay as they are. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_STATE_H
#define PBR_GL_STATE_H

#include "context.h"

enum {
    STATE_TOGGLES = 27,
    STATE_CLIP_DISTANCES = 32,
    STATE_DRAW_BUFFERS = 32,
    STATE_TEXTURES = 3,
    STATE_SUMS = 2,
    STATE_PACKS = 5,
    STATE_STORAGES = 3
};

/* What a frame asks of the fixed-function state. */
struct state_wanted {
    bool bind_framebuffer; /* else the bound one */
    GLuint framebuffer;
    GLint viewport[4], scissor[4];
    double depth_range[2];
    GLenum depth_function;
    bool depth_test, depth_write, clip_zero_to_one, framebuffer_srgb;
    bool reversed; /* nearer is larger in window depth */
    bool blends;   /* framebuffers of our own, textures and blending are used besides */
    bool reads;    /* so, and pixels are read into buffers */
    bool selects;  /* storage buffers and draw commands in a buffer are used */
};

struct state {
    bool kept; /* false: nothing was saved, nothing is restored */
    bool framebuffer_changed, draw_buffers_changed;
    GLint framebuffer;
    GLint draw_buffers[STATE_DRAW_BUFFERS];
    GLint program, vertex_array, array_buffer;
    GLfloat viewport[4];
    GLint scissor[4];
    GLdouble depth_range[2];
    GLint depth_function;
    GLboolean depth_mask, colour_mask[4], scissor_test, blend;
    GLboolean toggles[STATE_TOGGLES], clip_distances[STATE_CLIP_DISTANCES];
    GLint polygon_mode[2];
    GLint clip_origin, clip_depth_mode;
    GLint fragment_clamp;
    GLfloat fade_threshold;
    bool blends; /* only then: */
    GLint blend_functions[STATE_SUMS][4], blend_equations[STATE_SUMS][2];
    GLboolean blend_second, mask_second[4]; /* of draw buffer 1 */
    GLint active_texture, textures[STATE_TEXTURES], samplers[STATE_TEXTURES];
    bool reads; /* only then: */
    GLint read_framebuffer, pack_buffer, packs[STATE_PACKS];
    bool selects; /* only then: */
    GLint indirect_buffer, storage_buffer, storages[STATE_STORAGES];
    GLint64 storage_starts[STATE_STORAGES], storage_sizes[STATE_STORAGES];
};

/* Saves all that libpbr changes (unless !keep) and binds the wanted framebuffer, so that it can be asked about. */
void state_save(const struct gl *gl, bool keep, const struct state_wanted *wanted, struct state *state);

/* Sets everything that the picture depends on. After state_save. */
void state_set(const struct gl *gl, const struct state_wanted *wanted, struct state *state);

/* Viewport, scissor box and depth range; of index 0 alone where the version knows others. */
void state_window(const struct gl *gl, const GLfloat viewport[4], const GLint scissor[4], const GLdouble range[2]);

/* Whether draw buffers 0 and 1 add what is drawn to what is there. */
void state_add_up(const struct gl *gl, bool on);

/* Pixels are read as they lie. */
void state_pack_tightly(const struct gl *gl);

void state_restore(const struct gl *gl, const struct state *state);

#endif
