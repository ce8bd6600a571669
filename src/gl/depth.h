/* The depth of a view's pictures, known a frame or two later without waiting: it tells which nodes of hierarchies are hidden.
 *
 * After a frame its depth buffer is copied, and reduced to the farthest pixel of each tile; once the GPU is done with that, it is
 * read into a buffer, and once that is done, mapped. Neither is waited for. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_DEPTH_H
#define PBR_GL_DEPTH_H

#include "frame.h"
#include "lod/occluders.h"
#include "program.h"

enum { DEPTH_FRAMES = 3, DEPTH_POOL = 6 };

/* A frame on its way. */
struct depth_frame {
    enum { DEPTH_FREE, DEPTH_REDUCED, DEPTH_READ } state;
    GLsync fence; /* of the last step */
    GLuint tiles, framebuffer, buffer;
    GLsizei width, height;       /* of the texture of tiles; a texel holds two by two */
    struct occluders *occluders; /* held: what it becomes, without its depths so far; NULL: forgotten */
    double range[2];
    bool zero_to_one;
};

/* Zero at the start. */
struct depth_reader {
    struct depth_frame frames[DEPTH_FRAMES]; /* a ring */
    int first, count;                        /* those on their way, oldest first */
    GLuint copy, copy_framebuffer;
    GLenum format; /* of the copy */
    GLsizei width, height;
    struct occluders *pool[DEPTH_POOL]; /* held, to be written again when nobody else does */
    struct occluders *newest;           /* held; NULL: nothing is known */
    uint64_t bytes;                     /* on the GPU */
};

/* Takes what has become known since. Texture, framebuffer and pixel pack state is left changed: state.h. */
void depth_poll(pbr_view *view, GLenum *host_error);

/* After all was drawn to `target`, which is bound; it is afterwards. Nothing happens where the target has no depth that can be
 * copied (none, several samples), the frame does not use it in the usual way or OpenGL refuses the objects: then all is forgotten;
 * nor where too many frames are on their way. `program`: of VARIANT_TILES. */
void depth_capture(pbr_view *view, const struct frame_setup *setup, GLuint target, const struct program *program,
                   GLenum *host_error);

/* What is known, and what is on its way, is of no use any more. */
void depth_forget(struct depth_reader *reader);

/* Names of GL objects held. */
uint64_t depth_object_count(const struct depth_reader *reader);

/* What is known, and all objects. With gl NULL (abandoned context) no GL call is made. */
void depth_free(const struct gl *gl, struct depth_reader *reader);

#endif
