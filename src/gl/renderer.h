/* The inside of renderers and views. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_RENDERER_H
#define PBR_GL_RENDERER_H

#include "context.h"
#include "cuts.h"
#include "depth.h"
#include "lod/draw_list.h"
#include "lod/steer.h"
#include "meshes.h"
#include "program.h"
#include "resident.h"
#include "selection.h"
#include "sequences.h"
#include "timer.h"

/* Texture units of what programs read of the targets. */
enum { UNIT_COLOURS, UNIT_FRONT, UNIT_SECOND };

/* What blended splats are summed up in: as large as the largest picture so far. Zero where there are none. */
struct targets {
    GLsizei width, height;
    /* Textures: moved-back depth; the front's depth as it is and moved back, as bits; weighted sums of colours; once needed, sums
     * of normals, or marks: the front splat's colour and radius. */
    GLuint depth, front, colours, second;
    /* Framebuffers: depth with front, with colours, with colours and normals, with front and marks. */
    GLuint visibility, accumulation, deferred, marks;
    uint64_t bytes;
};

/* GPU memory within the host's budget: buffers of records and of what lies beside them. */
struct memory {
    uint64_t bytes, budget;
    uint64_t uploaded;  /* bytes sent since the renderer was made */
    uint64_t deletions; /* of buffers, likewise */
};

/* Everything a renderer holds on the GPU is in `programs`, `residents`, `sequences`, `meshes`, `selection`, `targets`, two vertex
 * arrays, and its views' `cuts`, `timer`s and `depth`s. */
struct pbr_renderer {
    pbr_instance *instance;
    struct gl gl;
    bool abandoned, keep_state;
    pbr_view *views; /* alive: a list */
    uint64_t frame;  /* serial number of the current frame */
    struct programs programs;
    struct memory memory;
    struct residents residents;
    struct sequences sequences;
    struct meshes meshes;
    struct selection selection;
    struct targets targets;
    struct refiner *refiner;       /* NULL until a frame that does not wait has a hierarchy */
    GLuint empty_array;            /* vertex array without attributes, for passes over the whole picture */
    GLuint quad_array;             /* vertex array of the quad path: instanced, pointed at each range in turn */
    uint64_t quad_array_deletions; /* memory.deletions when it was made: past that it may keep deleted buffers alive */
};

struct pbr_view {
    pbr_renderer *renderer;
    pbr_view *next; /* of the renderer's */
    struct draw_list list;
    const struct sequence *listed; /* what the list is of, as long as it is: then how that was seen; else NULL */
    struct cut_view listed_view;
    uint64_t listed_uploads; /* memory.uploaded then: what was sent since is known better */
    uint64_t seen;           /* how sequential point trees were seen last: a hash */
    struct cuts cuts;
    struct steer steer; /* of frames with a time budget: */
    struct timer timer;
    struct depth_reader depth;   /* of frames with PBR_FRAME_OCCLUSION */
    struct prepared_item *items; /* of the current frame; item.h */
    size_t item_capacity;
};

/* NULL where no GL call may be made. */
static inline const struct gl *renderer_gl(const pbr_renderer *renderer) {
    return renderer->abandoned ? NULL : &renderer->gl;
}

static inline bool renderer_has_room(const pbr_renderer *renderer, uint64_t bytes) {
    return bytes <= renderer->memory.budget - renderer->memory.bytes;
}

/* Drops what was drawn longest ago, but nothing that the current frame draws, until `bytes` more fit. */
pbr_result renderer_make_room(pbr_renderer *renderer, uint64_t bytes);

/* Gives the buffer bound to GL_ARRAY_BUFFER this much memory of its own, with `data` or with anything for NULL. Asks for GL errors:
 * exhaustion shows in no other way. `*host_error` receives one that was pending before. The first one returns that of this buffer;
 * the second logs it. */
GLenum renderer_try_buffer(pbr_renderer *renderer, size_t bytes, const void *data, GLenum usage, GLenum *host_error);
pbr_result renderer_allocate_buffer(pbr_renderer *renderer, size_t bytes, const void *data, GLenum usage, GLenum *host_error);

/* On the GPU, all that is held. */
uint64_t renderer_bytes(const pbr_renderer *renderer);

/* Of a clock that only goes forward. */
double renderer_seconds(void);

/* With gl NULL (abandoned context) no GL call is made. */
void targets_free(const struct gl *gl, struct targets *targets);

#endif
