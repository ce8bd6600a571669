/* What the viewer's overlay tells, and where. SPDX-License-Identifier: MIT */
#ifndef VIEW_PANELS_H
#define VIEW_PANELS_H

#include "overlay.h"
#include "scene.h"
#include "view_loader.h"
#include "view_state.h"

enum { VIEW_MOST_ERRORS = 6 };

struct view_facts {
    const struct view_state *state;
    const struct scene *scene;
    pbr_stats stats; /* of the last frame */
    double frame_ms; /* 0 = nothing was drawn yet */
    struct loader_progress loading;
    double seconds;                              /* on any clock, for what moves */
    const char *notice;                          /* NULL or a line that goes by itself */
    char errors[VIEW_MOST_ERRORS][SESSION_LINE]; /* the newest last */
    uint32_t error_count;
};

void view_panels_draw(struct overlay *overlay, const struct view_facts *facts);

/* The name without its folders. */
const char *view_file_name(const char *path);

#endif
