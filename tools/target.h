/* The offscreen framebuffer that pictures are drawn in and read from. SPDX-License-Identifier: MIT */
#ifndef TARGET_H
#define TARGET_H

#include <epoxy/gl.h>
#include <pbr/image.h>
#include <stdbool.h>

/* 8-bit sRGB for people, or 32-bit linear float for measuring; both with 32-bit float depth. */
struct target {
    uint32_t size[2];
    bool is_es, is_float;
    GLuint framebuffer;      /* draw here */
    GLuint resolved;         /* the same framebuffer, or the single-sampled one that multisampling ends in */
    GLuint texture;          /* colour of `resolved` */
    GLuint renderbuffers[3]; /* depth of `resolved`; multisampled colour and depth */
};

/* NULL, or why not, in static storage; the target is to be destroyed either way. `samples` <= 1: not multisampled. */
const char *target_create(struct target *target, const uint32_t size[2], uint32_t samples, bool is_float, bool is_es);
void target_destroy(struct target *target);

/* Binds it and clears it. `background`: sRGB with straight alpha. */
void target_clear(const struct target *target, const float background[4]);

/* Makes `texture` what was drawn last. */
void target_resolve(const struct target *target);

/* Reads the picture as linear premultiplied colour. With depth (which OpenGL ES cannot read) it is what `distance` makes of the
 * window depth. */
pbr_result target_read(const struct target *target, pbr_instance *instance, double (*distance)(const void *user, double depth),
                       const void *user, pbr_image *image);

#endif
