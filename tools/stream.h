/* Hierarchies of files that are larger than memory. SPDX-License-Identifier: MIT */
#ifndef STREAM_H
#define STREAM_H

#include "session.h"

struct stream {
    struct session *session;
    const char *input, *output;
    uint32_t memory; /* megabytes; 0 = the library's default */
    /* Of every point, object units; 0 = the file's, or, where it has none, one that is estimated and then stands here. */
    double radius;
    double load_ms, build_ms; /* opening and estimating; building */
    uint64_t points;          /* of the hierarchy */
};

/* Builds and writes a .pbr file. False with a message. */
bool stream_build(struct stream *stream);

#endif
