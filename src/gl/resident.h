/* GPU copies of point sets: one buffer of splat records per chunk, one of numbers per chunk and scalar in use. The renderer holds a
 * reference on each set until the copy is dropped. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_RESIDENT_H
#define PBR_GL_RESIDENT_H

#include "context.h"
#include "core/blocks.h"

/* Vertex attribute locations, as in shaders/splat.glsl. */
enum { ATTRIBUTE_POSITION_RADIUS = 0, ATTRIBUTE_NORMAL = 1, ATTRIBUTE_COLOUR = 2, ATTRIBUTE_SCALAR = 3, ATTRIBUTE_FIELD = 4 };

struct resident_chunk {
    GLuint splats;       /* buffer of struct splat */
    GLuint vertex_array; /* reads `splats`, one vertex a record */
    GLuint *scalars;     /* points->scalar_count buffers of float; 0 = not uploaded */
    GLuint fields;       /* buffer of struct normal_field; 0 = not uploaded */
};

struct resident {
    pbr_points *points;
    struct blocks blocks;
    struct resident_chunk *chunks; /* blocks.chunk_count */
    uint64_t bytes;                /* of GPU memory */
    uint64_t last_frame;           /* serial number of the last frame that drew it */
};

struct residents {
    struct resident **entries;
    size_t count, capacity;
    size_t last_found; /* index: frames ask in the same order */
    uint64_t bytes, budget;
    uint64_t uploaded;  /* bytes sent since the renderer was made */
    uint64_t evictions; /* since the renderer was made */
};

/* What a draw reads besides the records. */
struct streams {
    int64_t scalar; /* index, or -1 */
    bool fields;    /* normal fields, which are fitted when they are first asked for */
};

/* The copy of `points`, made if there is none, with these streams. May drop copies that `frame` does not use to stay
 * within the budget. `*host_error` receives a GL error that was pending before GPU memory was asked for. Leaves GL_ARRAY_BUFFER and
 * the vertex array binding changed. */
pbr_result residents_acquire(pbr_instance *instance, const struct gl *gl, struct residents *residents, const pbr_points *points,
                             struct streams streams, uint64_t frame, struct resident **out, GLenum *host_error);

/* Marks the copy of `points`, if there is one, as used by `frame`. */
void residents_touch(struct residents *residents, const pbr_points *points, uint64_t frame);

/* Drops the copy of `points`, or all for NULL. With gl NULL (abandoned context) no GL call is made. */
void residents_evict(pbr_instance *instance, const struct gl *gl, struct residents *residents, const pbr_points *points);

/* Names of GL objects held. */
uint64_t residents_object_count(const struct residents *residents);

/* Points the attributes of the bound vertex array at record `first` of the buffer bound to GL_ARRAY_BUFFER. */
void resident_point_at(const struct gl *gl, uint32_t first);

#endif
