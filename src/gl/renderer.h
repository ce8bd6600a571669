/* The inside of renderers and views. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_RENDERER_H
#define PBR_GL_RENDERER_H

#include "context.h"
#include "lod/draw_list.h"
#include "program.h"
#include "resident.h"

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

/* Everything a renderer holds on the GPU is in `programs`, `residents`, `targets` and `quad_array`. */
struct pbr_renderer {
    pbr_instance *instance;
    struct gl gl;
    bool abandoned, keep_state;
    size_t views;   /* alive */
    uint64_t frame; /* serial number of the current frame */
    struct programs programs;
    struct residents residents;
    struct targets targets;
    GLuint empty_array;            /* vertex array without attributes, for passes over the whole picture */
    GLuint quad_array;             /* vertex array of the quad path: instanced, pointed at each range in turn */
    uint64_t quad_array_evictions; /* residents.evictions when it was made: past that it may keep deleted buffers alive */
};

struct pbr_view {
    pbr_renderer *renderer;
    struct draw_list list;
    struct prepared_item *items; /* of the current frame; item.h */
    size_t item_capacity;
};

/* With gl NULL (abandoned context) no GL call is made. */
void targets_free(const struct gl *gl, struct targets *targets);

#endif
