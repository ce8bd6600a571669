/* The picture in the viewer's window: what pbr render would draw, kept for showing it again under another overlay and for
 * screenshots. SPDX-License-Identifier: MIT */
#ifndef VIEW_PICTURE_H
#define VIEW_PICTURE_H

#include <pbr/pbr.h>

#include "scene.h"
#include "target.h"

enum { PICTURE_TIMES = 64 };

struct picture {
    struct session *session;
    pbr_renderer *renderer;
    pbr_view *view;
    struct target target;
    uint32_t samples;
    bool is_es;
    pbr_stats stats;             /* of the last frame */
    bool is_final;               /* drawn again it would look the same */
    uint64_t frame_count;        /* drawn with something in them */
    double times[PICTURE_TIMES]; /* of the last ones, milliseconds, in a ring */
    struct picture_kind {
        bool is_known;
        uint32_t splat, blending, shading;
    } measured; /* of what --point-cost auto was found */
};

/* In the current context, whose functions are found by `get_proc`. False with a message; to be destroyed either way. */
bool picture_create(struct picture *picture, struct session *session, const struct scene_options *options,
                    void *(*get_proc)(void *user, const char *name));
void picture_destroy(struct picture *picture);

/* Of another size it is empty afterwards. False with a message. */
bool picture_resize(struct picture *picture, const uint32_t size[2]);

/* Uploads and compiles what drawing the scene takes. False with a message. */
bool picture_prepare(struct picture *picture, struct scene *scene);
/* `waits`: as fine as asked for at once; else within the time budget, and to be drawn again while it is not is_final. */
bool picture_draw(struct picture *picture, struct scene *scene, bool waits);
/* Lets go of an item's points or hierarchy. */
void picture_forget(struct picture *picture, const pbr_item *item);

/* Writes what was drawn last; false with a message. */
bool picture_write(struct picture *picture, const char *name);

/* The median of the last frames' times, from the clear to the end of the GPU's work; 0 before the first one. */
double picture_milliseconds(const struct picture *picture);

#endif
