/* GPU copies of point sets: one buffer of splat records per chunk, one of numbers per chunk and scalar in use. The renderer holds a
 * reference on each set until the copy is dropped. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_RESIDENT_H
#define PBR_GL_RESIDENT_H

#include "core/blocks.h"
#include "drawable.h"

struct resident {
    pbr_points *points;
    struct blocks blocks;
    struct drawable *chunks; /* blocks.chunk_count */
    uint64_t bytes;          /* of GPU memory */
    uint64_t last_frame;     /* serial number of the last frame that drew it */
};

struct residents {
    struct resident **entries;
    size_t count, capacity;
    size_t last_found; /* index: frames ask in the same order */
};

/* What a draw reads besides the records. */
struct streams {
    int64_t scalar; /* index, or -1 */
    bool fields;    /* normal fields, which are fitted when they are first asked for */
};

/* The copy of `points`, made if there is none, with these streams. May drop what the current frame does not use to stay within the
 * budget. `*host_error` receives a GL error that was pending before GPU memory was asked for. Leaves GL_ARRAY_BUFFER and the vertex
 * array binding changed. */
pbr_result residents_acquire(pbr_renderer *renderer, const pbr_points *points, struct streams streams, struct resident **out,
                             GLenum *host_error);

/* Marks the copy of `points`, if there is one, as used by `frame`. */
void residents_touch(struct residents *residents, const pbr_points *points, uint64_t frame);

/* Drops the copy of `points`, or all for NULL. */
void residents_evict(pbr_renderer *renderer, const pbr_points *points);
void residents_evict_at(pbr_renderer *renderer, size_t i);

/* Index of what was drawn longest ago and not by `frame`; `count` if there is none. */
size_t residents_oldest(const struct residents *residents, uint64_t frame);

/* Names of GL objects held. */
uint64_t residents_object_count(const struct residents *residents);

#endif
