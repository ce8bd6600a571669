/* The inside of renderers and views. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_RENDERER_H
#define PBR_GL_RENDERER_H

#include "context.h"
#include "lod/draw_list.h"
#include "program.h"
#include "resident.h"

/* Everything a renderer holds on the GPU is in `programs`, `residents` and `quad_array`. */
struct pbr_renderer {
    pbr_instance *instance;
    struct gl gl;
    bool abandoned, keep_state;
    size_t views;   /* alive */
    uint64_t frame; /* serial number of the current frame */
    struct program programs[VARIANT_COUNT];
    struct residents residents;
    GLuint quad_array;             /* vertex array of the quad path: instanced, pointed at each range in turn */
    uint64_t quad_array_evictions; /* residents.evictions when it was made: past that it may keep deleted buffers alive */
};

struct pbr_view {
    pbr_renderer *renderer;
    struct draw_list list;
    struct prepared_item *items; /* of the current frame; render.c */
    size_t item_capacity;
};

#endif
