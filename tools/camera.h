/* The camera of `pbr render --view yaw,pitch,zoom`, defined so that two runs, and two versions, frame a model identically.
 *
 * A bounding sphere of centre c and radius R is seen from c + D (sin yaw cos pitch, sin pitch, cos yaw cos pitch), D = R / sin(25
 * deg) / zoom, towards c, with +y up and a vertical field of view of 50 degrees: at zoom 1 the sphere just fits the picture's
 * height. In a parallel projection the visible height is the one that perspective has at c. SPDX-License-Identifier: MIT */
#ifndef CAMERA_H
#define CAMERA_H

#include <math.h>
#include <pbr/points.h>
#include <stdbool.h>

struct sphere {
    double centre[3], radius;
};

struct camera {
    double view[16], projection[16]; /* column-major */
    double eye[3];
    double pixel_scale; /* pixels that a length of 1 covers: at distance 1 along the view axis; anywhere, if parallel */
    bool is_parallel;
};

static inline double camera_radians(double degrees) {
    return degrees * 3.14159265358979323846 / 180;
}

/* Turns a world whose up is z so that it is y: (x, y, z) -> (x, z, -y). */
static const double camera_z_up[16] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1};

/* The box around several sets' points; false if there are none. */
static inline bool camera_box(const pbr_points_info *infos, size_t count, double low[3], double high[3]) {
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
    }
    for (size_t i = 0; i < count; i++) {
        if (infos[i].count == 0) continue;
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], infos[i].minimum[k]);
            high[k] = fmax(high[k], infos[i].maximum[k]);
        }
    }
    return low[0] <= high[0];
}

/* The sphere around several sets' spheres: the centre of their joint box, and the farthest that any of their spheres reaches from
 * it. */
static inline struct sphere camera_sphere(const pbr_points_info *infos, size_t count, bool z_up) {
    struct sphere sphere = {{0, 0, 0}, 0};
    double low[3], high[3];
    if (!camera_box(infos, count, low, high)) return sphere;
    for (int k = 0; k < 3; k++) sphere.centre[k] = low[k] + (high[k] - low[k]) / 2;
    for (size_t i = 0; i < count; i++) {
        const double *c = infos[i].centre;
        double apart = hypot(hypot(c[0] - sphere.centre[0], c[1] - sphere.centre[1]), c[2] - sphere.centre[2]);
        if (infos[i].count) sphere.radius = fmax(sphere.radius, apart + infos[i].bounding_radius);
    }
    if (z_up) {
        double y = sphere.centre[1];
        sphere.centre[1] = sphere.centre[2];
        sphere.centre[2] = -y;
    }
    return sphere;
}

/* `margin`: how far splats reach out of the sphere, the largest splat's radius. `size`: the picture, pixels. Angles in degrees. */
static inline struct camera camera_look(struct sphere sphere, double yaw, double pitch, double zoom, bool parallel, double margin,
                                        const uint32_t size[2]) {
    const double half_field = camera_radians(25);
    double radius = sphere.radius > 0 ? sphere.radius : margin > 0 ? margin : 1;
    double distance = radius / sin(half_field) / zoom, reach = radius + margin;
    double near = fmax(0.9 * (distance - reach), distance / 1000), far = 1.1 * (distance + reach);
    double sin_yaw = sin(camera_radians(yaw)), cos_yaw = cos(camera_radians(yaw));
    double sin_pitch = sin(camera_radians(pitch)), cos_pitch = cos(camera_radians(pitch));
    double aspect = (double)size[0] / size[1], half_height = distance * tan(half_field);
    /* The camera's axes; no cross product with "up", so that looking straight down is as good as any direction. */
    double axes[3][3] = {{cos_yaw, 0, -sin_yaw},
                         {-sin_yaw * sin_pitch, cos_pitch, -cos_yaw * sin_pitch},
                         {sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch}};
    struct camera camera = {.is_parallel = parallel};

    for (int k = 0; k < 3; k++) camera.eye[k] = sphere.centre[k] + distance * axes[2][k];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            camera.view[4 * c + r] = axes[r][c];
            camera.view[12 + r] -= axes[r][c] * camera.eye[c];
        }
    camera.view[15] = 1;
    if (parallel) {
        near = fmin(near, distance - reach); /* nothing is behind a parallel camera */
        camera.projection[0] = 1 / (half_height * aspect);
        camera.projection[5] = 1 / half_height;
        camera.projection[10] = -2 / (far - near);
        camera.projection[14] = -(far + near) / (far - near);
        camera.projection[15] = 1;
        camera.pixel_scale = size[1] / (2 * half_height);
    } else {
        camera.projection[0] = 1 / (tan(half_field) * aspect);
        camera.projection[5] = 1 / tan(half_field);
        camera.projection[10] = -(far + near) / (far - near);
        camera.projection[11] = -1;
        camera.projection[14] = -2 * far * near / (far - near);
        camera.pixel_scale = size[1] / (2 * tan(half_field));
    }
    return camera;
}

/* Distance along the view axis of a window depth 0..1; infinite at the far end, where nothing is drawn. */
static inline double camera_distance(const struct camera *camera, double depth) {
    const double *p = camera->projection;
    double clip = 2 * depth - 1;
    if (!(depth < 1)) return INFINITY;
    return camera->is_parallel ? (p[14] - clip) / p[10] : p[14] / (clip + p[10]);
}

#endif
