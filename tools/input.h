/* One input file, as it was read and as the points that are drawn. SPDX-License-Identifier: MIT */
#ifndef INPUT_H
#define INPUT_H

#include <pbr/io.h>

#include "session.h"

struct input {
    const char *path;
    uint64_t vertex_count, face_count; /* of the file */
    uint32_t format, warning_count;
    char encoding[32];
    bool is_mesh;
    const char *radii;  /* "given", "estimated" or "from faces" */
    pbr_mesh_info mesh; /* zeros for a file of points */
    pbr_points *points;
    pbr_mesh *surface; /* that the points were made of, if it is kept */
    pbr_points_info info;
    double load_ms; /* reading, and making points of a mesh */
};

/* False with a message, or without one if `progress` cancelled it. `input` is to be released either way. */
bool input_load(struct session *session, const char *path, bool keep_surface, pbr_progress_fn progress, void *user,
                struct input *input);
void input_release(struct input *input);

#endif
