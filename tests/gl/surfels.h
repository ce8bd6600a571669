/* Discs that are hard to draw, and cameras to see them by. SPDX-License-Identifier: MIT */
#ifndef TESTS_GL_SURFELS_H
#define TESTS_GL_SURFELS_H

#include "sight.h"

/* ---- Cameras ---- */

enum { VIEWS = CAMERAS + 6 };

/* The shared ones, and what matters to discs besides. */
static inline void make_views(struct camera views[VIEWS]) {
    static const double axis[3] = {-2, 1, 0.5};
    double turn[16], projection[16];
    make_cameras(views);
    for (int i = CAMERAS; i < VIEWS; i++) views[i] = views[0];
    struct camera *own = views + CAMERAS;
    own[0].name = "oblique parallel";
    own[0].frame = views[1].frame;
    own[0].frame.projection[8] = 0.1, own[0].frame.projection[9] = -0.07;
    own[1].name = "long pixels";
    own[1].frame.projection[0] /= 4;
    own[2].name = "view axis turned, clip scaled";
    matrix_rotation(axis, 0.8, turn);
    matrix_multiply(own[2].frame.projection, turn, projection);
    for (int k = 0; k < 16; k++) own[2].frame.projection[k] = 3 * projection[k];
    own[3].name = "depth range";
    own[3].frame.depth_range[0] = 0.25f, own[3].frame.depth_range[1] = 0.5f;
    own[4].name = "reversed by depth range";
    own[4].frame.depth_range[0] = 1, own[4].frame.depth_range[1] = 0;
    own[4].frame.flags = PBR_FRAME_REVERSED_Z;
    own[5].name = "reversed, infinite far";
    own[5].frame.projection[10] = 0, own[5].frame.projection[14] = 1;
    own[5].frame.flags = PBR_FRAME_CLIP_ZERO_TO_ONE | PBR_FRAME_REVERSED_Z;
}

/* Eye space. */
struct stand {
    double eye[4];  /* homogeneous; of a parallel projection the direction from the eye, or its opposite */
    double axis[3]; /* unit; of a parallel projection 0 */
};

static inline struct stand stand_of(const struct camera *camera) {
    const double *p = camera->frame.projection;
    struct stand stand = {{0}, {p[3], p[7], p[11]}};
    double inverse[16], length = length3(stand.axis);
    assert_true(matrix_invert(p, inverse));
    memcpy(stand.eye, inverse + 8, sizeof(stand.eye));
    for (int k = 0; k < 3 && length > 0; k++) {
        stand.axis[k] /= length;
        stand.eye[k] /= stand.eye[3];
    }
    if (length > 0) stand.eye[3] = 1;
    return stand;
}

static inline bool is_parallel(const struct camera *camera) {
    return length3(stand_of(camera).axis) == 0;
}

/* ---- Discs, made in eye space ---- */

static inline void unit(double v[3]) {
    const double length = length3(v);
    for (int k = 0; k < 3; k++) v[k] /= length;
}

static inline void random_unit(uint64_t *seed, double out[3]) {
    do
        for (int k = 0; k < 3; k++) out[k] = random_between(seed, -1, 1);
    while (!(length3(out) > 0.1 && length3(out) < 1));
    unit(out);
}

/* Across `v`. */
static inline void random_across(uint64_t *seed, const double v[3], double out[3]) {
    double any[3];
    random_unit(seed, any);
    cross3(v, any, out);
    unit(out);
}

static inline void to_eye(const struct camera *camera, const double position[3], double out[3]) {
    double eye[16], clip[16], at_eye[4];
    const double p[4] = {position[0], position[1], position[2], 1};
    matrices_of(&camera->frame, camera->model, eye, clip);
    matrix_apply(eye, p, at_eye);
    memcpy(out, at_eye, 3 * sizeof(*out));
}

/* Normals come back from eye space by the transpose. */
static inline struct surfel from_eye(const struct camera *camera, const double position[3], const double normal[3], double radius) {
    double eye[16], clip[16], inverse[16], out[4];
    const double p[4] = {position[0], position[1], position[2], 1};
    struct surfel surfel;
    matrices_of(&camera->frame, camera->model, eye, clip);
    assert_true(matrix_invert(eye, inverse));
    matrix_apply(inverse, p, out);
    for (int k = 0; k < 3; k++) {
        surfel.position[k] = out[k];
        surfel.normal[k] = dot3(eye + 4 * k, normal);
    }
    surfel.radius = radius / matrix_largest_stretch(eye);
    return surfel;
}

/* Radius in object units for this size in pixels at the centre. */
static inline double radius_for_size(const struct camera *camera, const double position[3], double size) {
    double eye[16], clip[16], out[4];
    const double p[4] = {position[0], position[1], position[2], 1};
    matrices_of(&camera->frame, camera->model, eye, clip);
    matrix_apply(clip, p, out);
    return size * out[3] / (2 * matrix_largest_stretch(eye) * pixels_per_unit(&camera->frame));
}

static inline struct surfel anywhere(const struct camera *camera, uint64_t *seed, double least, double most) {
    struct surfel surfel;
    random_position(camera, seed, surfel.position);
    random_unit(seed, surfel.normal);
    surfel.radius = radius_for_size(camera, surfel.position, random_log(seed, least, most));
    return surfel;
}

static inline struct surfel of_any_size(const struct camera *camera, uint64_t *seed) {
    return anywhere(camera, seed, 0.7, 90);
}
static inline struct surfel below_a_pixel(const struct camera *camera, uint64_t *seed) {
    return anywhere(camera, seed, 0.05, 2);
}
static inline struct surfel wider_than_the_view(const struct camera *camera, uint64_t *seed) {
    return anywhere(camera, seed, 200, 5000);
}

static inline struct surfel without_a_normal(const struct camera *camera, uint64_t *seed) {
    struct surfel surfel = anywhere(camera, seed, 0.7, 150);
    memset(surfel.normal, 0, sizeof(surfel.normal));
    return surfel;
}

/* Turned so far from the eye that `slope` is the cosine between normal and direction to it. */
static inline struct surfel sloping(const struct camera *camera, uint64_t *seed, double slope) {
    struct stand stand = stand_of(camera);
    struct surfel surfel = anywhere(camera, seed, 5, 150);
    double position[3], to[3], normal[3], size = surfel.radius;
    to_eye(camera, surfel.position, position);
    for (int k = 0; k < 3; k++) to[k] = stand.eye[k] - stand.eye[3] * position[k];
    unit(to);
    random_across(seed, to, normal);
    for (int k = 0; k < 3; k++) normal[k] += slope * to[k];
    surfel = from_eye(camera, position, normal, 1);
    surfel.radius = size;
    return surfel;
}

static inline struct surfel grazing(const struct camera *camera, uint64_t *seed) {
    return sloping(camera, seed, random_log(seed, 0.0005, 0.2));
}
static inline struct surfel nearly_edge_on(const struct camera *camera, uint64_t *seed) {
    return sloping(camera, seed, 0);
}

/* A plane of two object axes through the eye: no rounding turns the normal. */
static inline struct surfel edge_on(const struct camera *camera, uint64_t *seed) {
    struct stand stand = stand_of(camera);
    struct surfel surfel = anywhere(camera, seed, 5, 150), eye = from_eye(camera, stand.eye, stand.eye, 1);
    const int across = random_between(seed, 0, 1) < 0.5;
    for (int k = 0; k < 3; k++) surfel.normal[k] = k == across;
    if (stand.eye[3] != 0) surfel.position[across] = eye.position[across];
    return surfel;
}

static inline struct surfel at_depth(const struct camera *camera, uint64_t *seed, double depth) {
    struct surfel surfel;
    const bool zero_to_one = camera->frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE;
    if (zero_to_one && camera->frame.flags & PBR_FRAME_REVERSED_Z) depth = 1 - depth;
    const double ndc[3] = {random_between(seed, -1, 1), random_between(seed, -1, 1), zero_to_one ? depth : 2 * depth - 1};
    unproject(camera, ndc, surfel.position);
    random_unit(seed, surfel.normal);
    surfel.radius = radius_for_size(camera, surfel.position, random_log(seed, 20, 200));
    return surfel;
}

static inline struct surfel through_the_near_plane(const struct camera *camera, uint64_t *seed) {
    return at_depth(camera, seed, random_between(seed, -0.05, 0.05));
}
static inline struct surfel through_the_far_plane(const struct camera *camera, uint64_t *seed) {
    return at_depth(camera, seed, random_between(seed, 0.997, 0.999));
}

static inline struct surfel from_beside_the_view(const struct camera *camera, uint64_t *seed) {
    struct surfel surfel;
    const double away = random_between(seed, 1, 2.5), other = random_between(seed, -1.5, 1.5);
    const double side = random_between(seed, -1, 1) < 0 ? -away : away;
    const bool zero_to_one = camera->frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE, tall = random_between(seed, -1, 1) < 0;
    const double ndc[3] = {tall ? other : side, tall ? side : other, random_between(seed, zero_to_one ? 0.1 : -0.8, 0.9)};
    unproject(camera, ndc, surfel.position);
    random_unit(seed, surfel.normal);
    surfel.radius = radius_for_size(camera, surfel.position, PICTURE_WIDTH * away * random_between(seed, 0.7, 3));
    return surfel;
}

/* Perspective from here on. Distances from the eye: near = 1, and the view is about as wide as far. */
static inline struct surfel around_the_eye(const struct camera *camera, uint64_t *seed, double along, double across,
                                           double radius) {
    struct stand stand = stand_of(camera);
    double position[3], side[3], normal[3];
    random_across(seed, stand.axis, side);
    random_unit(seed, normal);
    for (int k = 0; k < 3; k++) position[k] = stand.eye[k] + along * stand.axis[k] + across * side[k];
    return from_eye(camera, position, normal, radius);
}

static inline struct surfel through_the_plane_of_the_eye(const struct camera *camera, uint64_t *seed) {
    const double radius = random_log(seed, 2, 50);
    return around_the_eye(camera, seed, radius * random_between(seed, -0.6, 0.6), radius * random_between(seed, -0.7, 0.7), radius);
}

static inline struct surfel centred_by_the_plane_of_the_eye(const struct camera *camera, uint64_t *seed) {
    const double radius = random_log(seed, 3, 50), along = random_log(seed, 1e-9, 1e-2);
    return around_the_eye(camera, seed, random_between(seed, -1, 1) < 0 ? -along : along, radius * random_between(seed, 0, 0.5),
                          radius);
}

/* Through a point that is seen. */
static inline struct surfel from_behind_the_eye(const struct camera *camera, uint64_t *seed) {
    struct stand stand = stand_of(camera);
    struct surfel seen = anywhere(camera, seed, 1, 2);
    double target[3], position[3], side[3], way[3], normal[3];
    const double back = random_log(seed, 0.05, 20);
    to_eye(camera, seen.position, target);
    random_across(seed, stand.axis, side);
    for (int k = 0; k < 3; k++) {
        target[k] = stand.eye[k] + (target[k] - stand.eye[k]) * random_between(seed, 0.5, 0.55);
        position[k] = stand.eye[k] - back * stand.axis[k] + back * side[k];
        way[k] = target[k] - position[k];
    }
    random_across(seed, way, normal);
    return from_eye(camera, position, normal, length3(way) * random_between(seed, 1.05, 3));
}

/* The eye stands on it, as on a floor. */
static inline struct surfel under_the_eye(const struct camera *camera, uint64_t *seed) {
    struct stand stand = stand_of(camera);
    double up[3], any[3], position[3];
    const double height = random_log(seed, 0.05, 2), radius = random_log(seed, 4, 60);
    random_across(seed, stand.axis, up);
    random_unit(seed, any);
    for (int k = 0; k < 3; k++) up[k] += 0.2 * any[k];
    unit(up);
    random_across(seed, up, any);
    for (int k = 0; k < 3; k++) position[k] = stand.eye[k] - height * up[k] + 0.4 * radius * any[k];
    return from_eye(camera, position, up, radius);
}

struct family {
    const char *name;
    struct surfel (*make)(const struct camera *camera, uint64_t *seed);
    bool perspective; /* only */
};

static const struct family families[] = {
    {"of any size", of_any_size, false},
    {"below a pixel", below_a_pixel, false},
    {"wider than the view", wider_than_the_view, false},
    {"without a normal", without_a_normal, false},
    {"grazing", grazing, false},
    {"nearly edge-on", nearly_edge_on, false},
    {"edge-on", edge_on, false},
    {"through the near plane", through_the_near_plane, false},
    {"through the far plane", through_the_far_plane, false},
    {"from beside the view", from_beside_the_view, false},
    {"through the plane of the eye", through_the_plane_of_the_eye, true},
    {"centred by the plane of the eye", centred_by_the_plane_of_the_eye, true},
    {"from behind the eye", from_behind_the_eye, true},
    {"under the eye", under_the_eye, true},
};
enum { FAMILIES = sizeof(families) / sizeof(families[0]) };

#endif
