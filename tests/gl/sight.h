/* What a viewing ray sees of a disc in space by docs/splats.md: where it meets the disc's plane, in double.
 * SPDX-License-Identifier: MIT */
#ifndef TESTS_GL_SIGHT_H
#define TESTS_GL_SIGHT_H

#include "support.h"

#include "../turned.h"
#include "core/matrix.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Pixels this near to a rim may be on either side of it: as in test_closed_form.c. */
static const double SLACK = 1.0 / 64;

/* A GL point's outline comes from the squares of its axes, which a float knows to some 2^-22 of the larger: of a disc of `size`
 * pixels that is seen nearly from its edge, at this cosine, the width may be wrong by that much. */
static inline double slack_of(double size, double cosine) {
    return SLACK + fmin(size, 2048) / 2 * (hypot(cosine, 0x1p-11) - fabs(cosine));
}

/* Window depth is wrong by a few units in the last place of the clip coordinates that it comes from. */
static const double DEPTH_ERROR = 2e-6;

struct surfel {
    double position[3], normal[3], radius; /* object space; no normal = 0, 0, 0 */
};

/* A disc as seen from the window. Forms are affine in window coordinates: f[0] + f[1] x + f[2] y. */
struct sight {
    double offset[3][3]; /* of the point on the ray from the disc's centre, times its weight */
    double weight[3];    /* > 0 before the eye */
    double depth[3];     /* of that point: 0 at the near plane, 1 at the far plane; reversed with reversed clip depth */
    double radius;       /* rho = |offset| / (weight radius) */
    double scale, shift; /* window depth = scale depth + shift */
    double slack;        /* pixels: how far off a rasteriser may see it */
    double room;         /* and how far off in depth for that */
};

static inline double at(const double form[3], double x, double y) {
    return form[0] + form[1] * x + form[2] * y;
}

static inline double rho(const struct sight *sight, double x, double y) {
    double offset[3], weight = at(sight->weight, x, y);
    for (int k = 0; k < 3; k++) offset[k] = at(sight->offset[k], x, y);
    return weight > 0 ? length3(offset) / (weight * sight->radius) : INFINITY;
}

static inline double window_depth(const struct sight *sight, double x, double y) {
    return sight->scale * at(sight->depth, x, y) + sight->shift;
}

static inline void matrices_of(const pbr_frame *frame, const double model[16], double to_eye[16], double to_clip[16]) {
    double view[16];
    matrix_identity(view);
    if (frame->view[15] != 0) memcpy(view, frame->view, sizeof(view));
    matrix_multiply(view, model, to_eye);
    matrix_multiply(frame->projection, to_eye, to_clip);
}

/* Pixels of a unit length across the view axis at w = 1. */
static inline double pixels_per_unit(const pbr_frame *frame) {
    const double *p = frame->projection, w[3] = {p[3], p[7], p[11]};
    double largest = 0;
    for (int i = 0; i < 2; i++) {
        double row[3] = {p[i], p[4 + i], p[8 + i]};
        if (dot3(w, w) > 0) {
            double along = dot3(row, w) / dot3(w, w);
            for (int k = 0; k < 3; k++) row[k] -= along * w[k];
        } else row[2] = 0;
        largest = fmax(largest, frame->viewport[2 + i] / 2.0 * length3(row));
    }
    return largest;
}

/* r of the table: object units. */
static inline double radius_of(const pbr_frame *frame, const pbr_item *item, double stretch, double w, double radius) {
    const double unit = 2 * stretch * pixels_per_unit(frame);
    double r = radius * (item->radius_scale != 0 ? (double)item->radius_scale : 1);
    if (!(w > 0)) return r;
    if (item->size_minimum > 0) r = fmax(r, (double)item->size_minimum * w / unit);
    if (item->size_maximum > 0) r = fmin(r, (double)item->size_maximum * w / unit);
    return r;
}

/* Where the disc lies, in the space that `inverse` leads to from clip coordinates: object space, or eye space without a normal. */
struct placed_disc {
    double inverse[16], centre[3], normal[3], radius;
    double size; /* pixels; 0 behind the eye */
};

static inline void place_disc(const pbr_frame *frame, const pbr_item *item, const double model[16], const struct surfel *surfel,
                              struct placed_disc *disc) {
    double to_eye[16], to_clip[16], eye[4], clip[4], from[3];
    const double p[4] = {surfel->position[0], surfel->position[1], surfel->position[2], 1};
    matrices_of(frame, model, to_eye, to_clip);
    matrix_apply(to_eye, p, eye);
    matrix_apply(to_clip, p, clip);
    const double stretch = matrix_largest_stretch(to_eye);
    disc->radius = radius_of(frame, item, stretch, clip[3], surfel->radius);
    disc->size = clip[3] > 0 ? 2 * disc->radius * stretch * pixels_per_unit(frame) / clip[3] : 0;
    memcpy(disc->centre, surfel->position, sizeof(disc->centre));
    memcpy(disc->normal, surfel->normal, sizeof(disc->normal));
    const bool has_normal = length3(surfel->normal) > 0;
    assert_true(matrix_invert(has_normal ? to_clip : frame->projection, disc->inverse));
    /* The third column of the inverse is what projects to x = y = w = 0: the eye, homogeneous. */
    for (int k = 0; k < 3; k++) {
        if (!has_normal) disc->centre[k] = eye[k];
        from[k] = disc->inverse[8 + k] - disc->centre[k] * disc->inverse[11];
    }
    if (has_normal) {
        turn_from_edge(from, disc->size, disc->normal);
        return;
    }
    memcpy(disc->normal, from, sizeof(disc->normal));
    disc->radius *= stretch;
}

/* The point of clip depth 0 on the ray of a window position, homogeneous: affine in the position. */
static inline void zero_depth_points(const pbr_frame *frame, const double inverse[16], double out[4][3]) {
    /* Window to normalised device coordinates, per axis: a + b window. */
    double a[2], b[2];
    for (int k = 0; k < 2; k++) {
        b[k] = 2.0 / frame->viewport[2 + k];
        a[k] = -1 - b[k] * (frame->viewport[k] + frame->jitter[k]);
    }
    if (frame->flags & PBR_FRAME_CLIP_UPPER_LEFT) a[1] = -a[1], b[1] = -b[1];
    for (int r = 0; r < 4; r++) {
        out[r][0] = inverse[12 + r] + a[0] * inverse[r] + a[1] * inverse[4 + r];
        out[r][1] = b[0] * inverse[r];
        out[r][2] = b[1] * inverse[4 + r];
    }
}

/* A ray holds the eye E and its point Z of clip depth 0. With the plane's values e, z there it meets the plane at Z e - E z, which
 * is of clip depth -z / e and before the eye where its weight has the sign of e. */
static inline struct sight see(const pbr_frame *frame, const pbr_item *item, const double model[16], const struct surfel *surfel) {
    struct placed_disc disc;
    double zero[4][3], of_eye = 0, of_zero[3] = {0, 0, 0};
    place_disc(frame, item, model, surfel, &disc);
    zero_depth_points(frame, disc.inverse, zero);
    const double *eye = disc.inverse + 8;
    const double plane[4] = {disc.normal[0], disc.normal[1], disc.normal[2], -dot3(disc.normal, disc.centre)};
    for (int r = 0; r < 4; r++) {
        of_eye += plane[r] * eye[r];
        for (int f = 0; f < 3; f++) of_zero[f] += plane[r] * zero[r][f];
    }
    double to_eye[3];
    for (int k = 0; k < 3; k++) to_eye[k] = eye[k] - eye[3] * disc.centre[k];
    const double cosine = of_eye / (length3(plane) * length3(to_eye));
    /* Edge-on is as good as turned by less than a float can say. */
    const double least = FLT_EPSILON / 8 * length3(plane) * (length3(eye) + fabs(eye[3]) * length3(disc.centre));
    if (fabs(of_eye) < least) of_eye = least;
    const double sign = of_eye < 0 ? -1 : 1;
    const bool zero_to_one = frame->flags & PBR_FRAME_CLIP_ZERO_TO_ONE;
    struct sight sight = {.radius = disc.radius, .slack = slack_of(disc.size, cosine)};
    for (int f = 0; f < 3; f++) {
        sight.weight[f] = sign * (zero[3][f] * of_eye - eye[3] * of_zero[f]);
        for (int k = 0; k < 3; k++)
            sight.offset[k][f] = sign * (zero[k][f] * of_eye - eye[k] * of_zero[f]) - disc.centre[k] * sight.weight[f];
        sight.depth[f] = -of_zero[f] / of_eye;
        if (!zero_to_one) sight.depth[f] = (sight.depth[f] + (f == 0)) / 2;
    }
    sight.room = hypot(sight.depth[1], sight.depth[2]) * sight.slack + DEPTH_ERROR;
    const double near = frame->depth_range[0], far = frame->depth_range[1];
    sight.scale = near == 0 && far == 0 ? 1 : far - near;
    sight.shift = near;
    return sight;
}

enum verdict { OUTSIDE, EITHER, INSIDE };

/* |offset|^2 - (weight radius)^2: below 0 where rho < 1, before and behind the eye. `change`: the most it changes within `slack`.
 */
static inline double conic(const struct sight *sight, double x, double y, double *change) {
    double value = 0, slope[2] = {0, 0}, bend = 0;
    for (int k = 0; k < 4; k++) {
        const double *form = k < 3 ? sight->offset[k] : sight->weight, v = at(form, x, y);
        const double factor = k < 3 ? 1 : -sight->radius * sight->radius;
        value += factor * v * v;
        for (int i = 0; i < 2; i++) {
            slope[i] += 2 * factor * v * form[1 + i];
            bend += fabs(factor) * form[1 + i] * form[1 + i];
        }
    }
    *change = sight->slack * (fabs(slope[0]) + fabs(slope[1]) + sight->slack * bend);
    return value;
}

/* Whether some and all points within `slack` of a pixel's centre see the disc's inside, along lines through it. On each the conic
 * is a parabola, and the inside before the eye an interval. */
static inline void look_around(const struct sight *sight, double x, double y, bool *some, bool *all) {
    enum { LINES = 8 };
    double change;
    const double middle = conic(sight, x, y, &change);
    *some = *all = middle <= 0 && at(sight->weight, x, y) > 0;
    if (fabs(middle) > change) return;
    for (int i = 0; i < LINES; i++) {
        const double turn = acos(-1) * i / LINES, dx = sight->slack * cos(turn), dy = sight->slack * sin(turn);
        const double before = conic(sight, x - dx, y - dy, &change), after = conic(sight, x + dx, y + dy, &change);
        const double bend = (before + after) / 2 - middle, slope = (after - before) / 2; /* middle + slope t + bend t^2 */
        const double t[3] = {-1, 1, bend > 0 ? fmax(-1, fmin(1, -slope / (2 * bend))) : 0};
        for (int k = 0; k < 3; k++) {
            const bool inside = middle + t[k] * (slope + t[k] * bend) <= 0 && at(sight->weight, x + t[k] * dx, y + t[k] * dy) > 0;
            *some |= inside;
            *all &= inside;
        }
    }
}

static inline enum verdict judge(const struct sight *sight, double x, double y) {
    bool some, all;
    const double depth = at(sight->depth, x, y), room = sight->room;
    if (depth < -room || depth > 1 + room) return OUTSIDE;
    look_around(sight, x, y, &some, &all);
    if (!some) return OUTSIDE;
    return all && depth >= room && depth <= 1 - room ? INSIDE : EITHER;
}

#endif
