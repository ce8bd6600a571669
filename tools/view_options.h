/* What `pbr view` was asked for. SPDX-License-Identifier: MIT */
#ifndef VIEW_OPTIONS_H
#define VIEW_OPTIONS_H

#include "scene_options.h"

struct view_options {
    struct scene_options scene;
    const char *screenshots; /* folder */
    bool json;
};

extern const char view_usage[];

/* STATUS_OK, or STATUS_USAGE with a message. The strings are those of `argv`. */
int view_options_parse(struct session *session, int argc, char **argv, struct view_options *options);

#endif
