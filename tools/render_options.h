/* What `pbr render` was asked for. SPDX-License-Identifier: MIT */
#ifndef RENDER_OPTIONS_H
#define RENDER_OPTIONS_H

#include <pbr/render.h>

#include "headless.h"
#include "session.h"

enum { MOST_INPUTS = 256 };

struct render_options {
    const char *inputs[MOST_INPUTS];
    uint32_t input_count;
    const char *output, *stats; /* NULL = none */
    uint32_t size[2], frames, samples;
    uint32_t grid[2];                       /* rows, columns of copies */
    uint32_t splat, shading, colour_source; /* PBR_... */
    const char *scalar;                     /* with PBR_COLOUR_SCALAR */
    double view[3];                         /* yaw and pitch in degrees, zoom */
    bool parallel, z_up, orbit, cull, raw;
    enum headless_kind context;
    float background[4];                             /* sRGB, straight alpha */
    double radius_scale, size_minimum, size_maximum; /* 0 = libpbr's default */
};

extern const char render_usage[];

/* STATUS_OK, or STATUS_USAGE with a message. The strings are those of `argv`. */
int render_options_parse(struct session *session, int argc, char **argv, struct render_options *options);

/* "square" or "circle". */
const char *render_splat_name(uint32_t splat);

/* The output's name for one frame: a %d or %0Nd in it (N = 1..9 digits) is replaced by the frame's number. Returns false if it has
 * none, or does not fit; `name` then is the output as it stands, cut. */
bool render_frame_name(const char *output, uint32_t frame, char *name, size_t capacity);

#endif
