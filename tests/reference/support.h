/* What the tests of the reference renderer share: a small picture under a simple camera, surfels, and rays cast without the
 * library. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_REFERENCE_SUPPORT_H
#define PBR_TESTS_REFERENCE_SUPPORT_H

#include "../unit/support.h"

#include <pbr/reference.h>

enum { SIZE = 64 };

struct stage {
    struct host host;
    pbr_instance *instance;
    pbr_frame frame;
    pbr_image image; /* of the last drawing */
};

/* A perspective projection with `f` pixels of a unit length at distance 1, and planes at 0.5 and 1000. */
static inline void look(struct stage *stage, double f) {
    double *p = stage->frame.projection;
    memset(p, 0, sizeof stage->frame.projection);
    p[0] = 2 * f / stage->frame.viewport[2];
    p[5] = 2 * f / stage->frame.viewport[3];
    p[10] = -1000.5 / 999.5;
    p[14] = -1000 / 999.5;
    p[11] = -1;
}

/* A parallel one with `f` pixels of a unit length, from 0.5 to 1000. */
static inline void look_parallel(struct stage *stage, double f) {
    double *p = stage->frame.projection;
    memset(p, 0, sizeof stage->frame.projection);
    p[0] = 2 * f / stage->frame.viewport[2];
    p[5] = 2 * f / stage->frame.viewport[3];
    p[10] = -2 / 999.5;
    p[14] = -1000.5 / 999.5;
    p[15] = 1;
}

/* With f = 32: at z = -1 the picture reaches from -1 to 1. */
static inline void stage_open(struct stage *stage, uint32_t threads) {
    stage->instance = host_start(&stage->host, threads);
    stage->frame = (pbr_frame)PBR_FRAME_INIT;
    stage->image = (pbr_image)PBR_IMAGE_INIT;
    stage->frame.viewport[2] = stage->frame.viewport[3] = SIZE;
    look(stage, 32);
}

static inline void stage_close(struct stage *stage) {
    pbr_image_destroy(stage->instance, &stage->image);
    host_stop(&stage->host, stage->instance);
}

static inline void draw(struct stage *stage, const pbr_item *items, size_t count) {
    pbr_image_destroy(stage->instance, &stage->image);
    assert_int_equal(pbr_reference_render(stage->instance, &stage->frame, items, count, NULL, &stage->image), PBR_OK);
    assert_int_equal(stage->image.width, stage->frame.viewport[2]);
    assert_int_equal(stage->image.height, stage->frame.viewport[3]);
}

/* Pixels count from the lower left. */
static inline size_t pixel_at(const pbr_image *image, int x, int y) {
    return (size_t)((int)image->height - 1 - y) * image->width + (size_t)x;
}
static inline const float *colour_at(const struct stage *stage, int x, int y) {
    return stage->image.rgba + 4 * pixel_at(&stage->image, x, y);
}
static inline double depth_at(const struct stage *stage, int x, int y) {
    return (double)stage->image.depth[pixel_at(&stage->image, x, y)];
}
static inline bool is_covered(const struct stage *stage, int x, int y) {
    return colour_at(stage, x, y)[3] > 0;
}
static inline int count_covered(const struct stage *stage) {
    int covered = 0;
    for (size_t i = 0; i < (size_t)stage->image.width * stage->image.height; i++) covered += stage->image.rgba[4 * i + 3] > 0;
    return covered;
}

/* A drawing that another is to give again, bit by bit. */
struct pixels {
    float rgba[4 * SIZE * SIZE], depth[SIZE * SIZE];
};
static inline void keep_pixels(const struct stage *stage, struct pixels *out) {
    memcpy(out->rgba, stage->image.rgba, sizeof out->rgba);
    memcpy(out->depth, stage->image.depth, sizeof out->depth);
}
static inline void expect_pixels(const struct stage *stage, const struct pixels *kept) {
    assert_memory_equal(stage->image.rgba, kept->rgba, sizeof kept->rgba);
    assert_memory_equal(stage->image.depth, kept->depth, sizeof kept->depth);
}

struct surfel_data {
    double position[3], normal[3];
    float radius, colour[3];
};

static inline pbr_points *make_points(pbr_instance *instance, const struct surfel_data *surfels, size_t count) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = count;
    desc.positions = (pbr_attribute){surfels->position, sizeof *surfels, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){surfels->normal, sizeof *surfels, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){&surfels->radius, sizeof *surfels, PBR_FORMAT_FLOAT32, 1};
    desc.colours = (pbr_attribute){surfels->colour, sizeof *surfels, PBR_FORMAT_FLOAT32, 3};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

/* Unlit. */
static inline pbr_item plain_item(const pbr_points *points, uint32_t splat) {
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    item.splat = splat;
    item.shading = PBR_SHADE_NONE;
    return item;
}

static inline double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void unit(double a[3]) {
    const double length = sqrt(dot(a, a));
    for (int k = 0; k < 3; k++) a[k] /= length;
}

/* Where the ray from `from` along `along` meets a disc: how often `along`, and how far from the centre in radii. */
struct hit {
    double t, rho;
};
static inline struct hit cast(const double from[3], const double along[3], const struct surfel_data *disc) {
    double to_centre[3], from_centre[3];
    for (int k = 0; k < 3; k++) to_centre[k] = disc->position[k] - from[k];
    struct hit hit = {dot(to_centre, disc->normal) / dot(along, disc->normal), 0};
    for (int k = 0; k < 3; k++) from_centre[k] = hit.t * along[k] - to_centre[k];
    hit.rho = sqrt(dot(from_centre, from_centre)) / (double)disc->radius;
    return hit;
}

/* The ray through a pixel's centre, 1 long along the axis, in eye space under look(f). */
static inline void pixel_ray(double f, int x, int y, double along[3]) {
    along[0] = (x + 0.5 - SIZE / 2) / f;
    along[1] = (y + 0.5 - SIZE / 2) / f;
    along[2] = -1;
}

#endif
