/* What `pbr render` was asked for. SPDX-License-Identifier: MIT */
#ifndef RENDER_OPTIONS_H
#define RENDER_OPTIONS_H

#include "scene_options.h"

struct render_options {
    struct scene_options scene;
    const char *output, *stats; /* NULL = none */
    uint32_t frames;
    bool orbit, refine, raw, reference;
    uint32_t ground_truth; /* samples along a pixel's side; 0 = no ground truth */
};

extern const char render_usage[];

/* STATUS_OK, or STATUS_USAGE with a message. The strings are those of `argv`. */
int render_options_parse(struct session *session, int argc, char **argv, struct render_options *options);

/* INPUT_... that the files are loaded with. */
unsigned render_options_wanted(const struct render_options *options);

/* The output's name for one frame: a %d or %0Nd in it (N = 1..9 digits) is replaced by the frame's number. Returns false if it has
 * none, or does not fit; `name` then is the output as it stands, cut. */
bool render_frame_name(const char *output, uint32_t frame, char *name, size_t capacity);

#endif
