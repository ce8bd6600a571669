/* Where the quality programme draws: one offscreen context, the models, and every way to draw them: by OpenGL, by the reference, as
 * triangles. All pictures are linear, premultiplied, over transparent black. SPDX-License-Identifier: MIT */
#ifndef STUDIO_H
#define STUDIO_H

#include <pbr/pbr.h>
#include <pbr/reference.h>

#include "camera.h"
#include "headless.h"
#include "session.h"
#include "surface.h"
#include "target.h"

/* One way to draw points. */
struct method {
    const char *name;
    uint32_t splat, blending, shading;
    float low_pass; /* 0: libpbr's own */
};

/* The kinds that every table has, in the order of their quality as it is expected; then variants. */
enum {
    METHOD_SQUARE,
    METHOD_CIRCLE,
    METHOD_ELLIPSE,
    METHOD_GAUSSIAN,
    METHOD_EWA,
    METHOD_EWA_MAX,
    METHOD_CIRCLE_FILL,
    METHOD_ELLIPSE_FILL,
    KINDS,
    METHOD_GAUSSIAN_DEFERRED = KINDS,
    METHOD_EWA_DEFERRED,
    METHOD_GAUSSIAN_FIELD,
    METHOD_EWA_FIELD,
    METHOD_EWA_HALF, /* low-pass filters narrower than libpbr's own */
    METHOD_EWA_THIRD,
    METHOD_EWA_BOX,
    METHODS
};
extern const struct method methods[METHODS];

struct model {
    const char *name;
    bool is_lit; /* else its colours are seen as they are */
    pbr_mesh *mesh;
    pbr_points *points; /* of the mesh, as pbr render makes them */
    pbr_points_info info;
    struct sphere sphere;
};

struct view {
    const char *name;
    struct camera camera;
    uint32_t size[2];
    double jitter[2]; /* as pbr_frame's */
};

/* Zero at the start. */
struct studio {
    struct session session;
    struct headless headless;
    struct target target;
    pbr_renderer *renderer;
    pbr_view *view;
};

/* False with a message. The studio stays where it is, and is to be closed either way. */
bool studio_open(struct studio *studio);
void studio_close(struct studio *studio);

/* All return false with a message; the model is to be released either way. */
bool model_read(struct studio *studio, const char *name, const char *path, struct model *model);
/* A surface of pbr synth, `triangles` a number that it has a grid for. */
bool model_synthesise(struct studio *studio, enum surface_kind kind, uint64_t triangles, struct model *model);
/* The checkerboard of pbr synth on and on: squares of side 1, 4 x 4 vertices each, at y = 0 from z = 0 to z = -length, as wide as
 * an eye over the origin sees it. Unlit. */
bool model_make_floor(struct studio *studio, double length, struct model *model);
void model_release(struct model *model);

/* As --view of pbr render. */
struct view view_around(const char *name, const struct model *model, double yaw, double pitch, double zoom, const uint32_t size[2]);
/* From `eye`, with the height of the picture `field` degrees. */
struct view view_from(const char *name, const double eye[3], double yaw, double pitch, double field, double near, double far,
                      const uint32_t size[2]);

/* `image` must hold no pixels. False with a message. */
bool studio_draw(struct studio *studio, const struct model *model, const struct method *method, const struct view *view,
                 pbr_image *image);
bool studio_draw_reference(struct studio *studio, const struct model *model, const struct method *method, const struct view *view,
                           pbr_image *image);
/* The triangles, `samples` x `samples` a pixel; `colour_source` as pbr_item has it. */
bool studio_draw_truth(struct studio *studio, const struct model *model, const struct view *view, uint32_t samples,
                       uint32_t colour_source, pbr_image *image);

#endif
