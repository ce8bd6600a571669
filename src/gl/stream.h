/* Records that change from frame to frame: a ring of buffers, so that none is written that the GPU still reads, and nobody waits.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_GL_STREAM_H
#define PBR_GL_STREAM_H

#include "drawable.h"
#include "lod/cut.h"

enum { STREAM_BUFFERS = 3 };

/* Zero at the start. */
struct stream {
    struct drawable buffers[STREAM_BUFFERS]; /* made when their turn comes for the first time */
    size_t capacities[STREAM_BUFFERS];       /* bytes */
    bool busy[STREAM_BUFFERS];               /* drawn from and left: the GPU may read it until its fence is passed */
    GLsync fences[STREAM_BUFFERS];           /* NULL: none */
    int current;
    bool filled; /* the current one holds the last records */
};

/* Makes the cut's records, and its triangles behind them, the content of the current buffer, as a rule the next one of the ring:
 * gathered straight into mapped memory where the context can. Where it is still busy, it gets new memory and `*orphaned` counts it.
 * Leaves GL_ARRAY_BUFFER and the vertex array binding changed. `*host_error`: as renderer_allocate_buffer. */
pbr_result stream_fill(pbr_renderer *renderer, struct stream *stream, const pbr_lod *lod, const struct cut *cut, GLenum *host_error,
                       uint32_t *orphaned);

/* Bytes of GPU memory, names of GL objects. */
uint64_t stream_bytes(const struct stream *stream);
uint64_t stream_object_count(const struct stream *stream);

/* Without a GL call where the renderer is abandoned. */
void stream_free(pbr_renderer *renderer, struct stream *stream);

#endif
