/* What the tests of cuts share: random cameras, and by the exact rule what of a splat a view shows. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_UNIT_CAMERAS_H
#define PBR_TESTS_UNIT_CAMERAS_H

#include <stdint.h>
#include <string.h>

#include "core/matrix.h"
#include "lod/sight.h"

/* Uniform in [0, 1), the same in every run. */
static inline double random_number(void) {
    static uint32_t state = 1;
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
}

static inline void perspective(double focal, double aspect, double near_plane, double far_plane, double out[16]) {
    memset(out, 0, 16 * sizeof *out);
    out[0] = focal / aspect;
    out[5] = focal;
    out[10] = -(far_plane + near_plane) / (far_plane - near_plane);
    out[11] = -1;
    out[14] = -2 * far_plane * near_plane / (far_plane - near_plane);
}

static inline void random_view(double out[16]) {
    double a = 6.2831853 * random_number(), b = 3 * random_number() - 1.5;
    const double rotation[16] = {cos(a),
                                 sin(a) * sin(b),
                                 sin(a) * cos(b),
                                 0,
                                 0,
                                 cos(b),
                                 -sin(b),
                                 0,
                                 -sin(a),
                                 cos(a) * sin(b),
                                 cos(a) * cos(b),
                                 0,
                                 3 * (random_number() - 0.5),
                                 3 * (random_number() - 0.5),
                                 -3 * random_number(),
                                 1};
    memcpy(out, rotation, sizeof rotation);
}

struct splat_fate {
    int visible, needs_quad; /* for certain, by the exact rule of the vertex stage */
};

static inline struct splat_fate fate_of(const struct cut_view *view, const double p[3], double radius) {
    const double *m = view->to_clip;
    double clip[4];
    for (int r = 0; r < 4; r++) clip[r] = m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
    double w = clip[3], size = fmin(fmax(radius * view->size_per_radius / w, view->size_minimum), view->size_maximum);
    const double z = view->zero_to_one ? 2 * clip[2] - w : clip[2];
    struct splat_fate fate = {0, 0};
    fate.visible = w > 0 && fabs(z) <= w && fabs(clip[0]) - size * w / view->viewport[0] <= w &&
                   fabs(clip[1]) - size * w / view->viewport[1] <= w;
    fate.needs_quad = fate.visible && (size > view->point_limit || fabs(clip[0]) > w || fabs(clip[1]) > w);
    return fate;
}

struct disc_camera {
    struct cut_view cut;
    double to_eye[16];
    double stretch, pixels_per_unit, radius_scale;
};

/* Perspective, off the axis, to infinity, 0..1, reversed, parallel; all along -z. */
static inline void random_projection(int kind, struct disc_camera *camera) {
    double *p = camera->cut.projection;
    const double *size = camera->cut.viewport;
    perspective(1 + 3 * random_number(), size[0] / size[1], 0.01 + 0.5 * random_number(), 2 + 2 * random_number(), p);
    camera->cut.zero_to_one = kind == 3 || kind == 4;
    if (kind == 1) p[8] = random_number() - 0.5, p[9] = random_number() - 0.5;
    if (kind == 2) p[10] = -1, p[14] = -2 * (0.01 + random_number());
    if (kind == 3 || kind == 4)
        for (int c = 0; c < 4; c++) p[4 * c + 2] = (p[4 * c + 3] + (kind == 3 ? 1 : -1) * p[4 * c + 2]) / 2;
    if (kind == 5) {
        const double width = 0.3 + random_number(), depth = 0.5 + 2 * random_number();
        const double parallel[16] = {1 / width, 0, 0, 0, 0, size[0] / size[1] / width, 0, 0, 0.1, 0, -2 / depth, 0, 0, 0, -1.5, 1};
        memcpy(p, parallel, sizeof parallel);
    }
    camera->pixels_per_unit = fmax(size[0] * fabs(p[0]), size[1] * fabs(p[5])) / 2;
}

static inline void random_camera(int number, struct disc_camera *camera) {
    static const double limits[][2] = {{0, 1e18}, {9, 1e18}, {0, 20}, {3, 40}};
    *camera = (struct disc_camera){.radius_scale = number % 7 == 3 ? 1.6 : 1};
    struct cut_view *cut = &camera->cut;
    cut->viewport[0] = 640, cut->viewport[1] = 360;
    cut->point_limit = number % 3 ? 64 : 255;
    cut->size_minimum = limits[number % 4][0], cut->size_maximum = limits[number % 4][1];
    cut->spread = number % 5 < 2 ? 2 : 0;
    cut->largest_spread = cut->spread > 0 ? 1.0 / 64 : 0.8;
    cut->discs = true;
    random_projection(number % 6, camera);
    double view[16], model[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    random_view(view);
    if (number % 8 >= 5) model[0] = -0.4 - random_number(), model[4] = 0.5 * random_number(), model[10] = 0.3 + random_number();
    matrix_multiply(view, model, camera->to_eye);
    matrix_multiply(cut->projection, camera->to_eye, cut->to_clip);
    camera->stretch = matrix_largest_stretch(camera->to_eye);
    cut->reach_per_radius = camera->stretch * camera->radius_scale;
    cut->size_per_radius = 2 * camera->pixels_per_unit * cut->reach_per_radius;
}

/* Clip coordinates of a disc's points: centre + u across[0] + v across[1]. */
struct clip_disc {
    double centre[4], across[2][4];
};

static inline void transform(const double m[16], const double v[3], double w, double out[4]) {
    for (int r = 0; r < 4; r++) out[r] = m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r] * w;
}

static inline void random_unit(double out[3]) {
    do
        for (int k = 0; k < 3; k++) out[k] = 2 * random_number() - 1;
    while (!(length3(out) > 0.1 && length3(out) < 1));
    const double length = length3(out);
    for (int k = 0; k < 3; k++) out[k] /= length;
}

/* A disc along two unit vectors at right angles, of object space or of eye space, as splats without normals lie. */
static inline struct clip_disc disc_along(const struct disc_camera *camera, const double position[3], double radius,
                                          bool in_eye_space, double along[2][3]) {
    struct clip_disc disc;
    double axes[2][3];
    transform(camera->cut.to_clip, position, 1, disc.centre);
    const double w = disc.centre[3], unit = 2 * camera->pixels_per_unit * camera->stretch;
    double r = radius * camera->radius_scale;
    if (w > 0) r = fmin(fmax(r, camera->cut.size_minimum * w / unit), camera->cut.size_maximum * w / unit);
    if (in_eye_space) r *= camera->stretch;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++) axes[i][k] = along[i][k] * r;
        transform(in_eye_space ? camera->cut.projection : camera->cut.to_clip, axes[i], 0, disc.across[i]);
    }
    return disc;
}

/* A disc of any direction. */
static inline struct clip_disc random_disc(const struct disc_camera *camera, const double position[3], double radius,
                                           bool in_eye_space) {
    double axes[2][3], any[3];
    random_unit(axes[0]);
    random_unit(any);
    cross3(axes[0], any, axes[1]);
    const double length = length3(axes[1]);
    for (int k = 0; k < 3; k++) axes[1][k] /= length;
    return disc_along(camera, position, radius, in_eye_space, axes);
}

/* Whether some of its points are in the view, or beside it by no more than the spread. */
static inline bool disc_is_visible(const struct cut_view *view, const struct clip_disc *disc) {
    enum { RINGS = 4, TURNS = 24 };
    const double room[2] = {1 + 2 * view->spread / view->viewport[0], 1 + 2 * view->spread / view->viewport[1]};
    for (int ring = 0; ring <= RINGS; ring++)
        for (int turn = 0; turn < (ring ? TURNS : 1); turn++) {
            const double u = (double)ring / RINGS * cos(6.283185307179586 * turn / TURNS);
            const double v = (double)ring / RINGS * sin(6.283185307179586 * turn / TURNS);
            double clip[4];
            for (int k = 0; k < 4; k++) clip[k] = disc->centre[k] + u * disc->across[0][k] + v * disc->across[1][k];
            const double w = clip[3], z = view->zero_to_one ? 2 * clip[2] - w : clip[2];
            if (w > 0 && fabs(clip[0]) <= w * room[0] && fabs(clip[1]) <= w * room[1] && fabs(z) <= w) return true;
        }
    return false;
}

/* The extremes of x / w over a disc before the eye: l is one if x - l w = 0 touches the disc. */
static inline void disc_extent(const struct clip_disc *disc, int axis, double out[2]) {
    const double *c = disc->centre, *u = disc->across[0], *v = disc->across[1];
    const double a = c[3] * c[3] - u[3] * u[3] - v[3] * v[3];
    const double b = c[axis] * c[3] - u[axis] * u[3] - v[axis] * v[3];
    const double root = sqrt(fmax(b * b - a * (c[axis] * c[axis] - u[axis] * u[axis] - v[axis] * v[axis]), 0));
    out[0] = (b - root) / a;
    out[1] = (b + root) / a;
}

/* Whether a GL point draws it: OpenGL drops those whose centre is outside the view, and bounds their size. */
static inline bool disc_fits_a_point(const struct cut_view *view, const struct clip_disc *disc) {
    const double w = disc->centre[3], spread = hypot(disc->across[0][3], disc->across[1][3]) / w;
    if (!(w > 0) || spread * spread >= view->largest_spread) return false;
    for (int axis = 0; axis < 2; axis++) {
        double extent[2];
        disc_extent(disc, axis, extent);
        if (fabs(extent[0] + extent[1]) / 2 >= 1) return false;
        if ((extent[1] - extent[0]) / 2 * view->viewport[axis] + 2 * view->spread >= view->point_limit) return false;
    }
    return true;
}

#endif
