/* What follows from a frame's projection and viewport. SPDX-License-Identifier: MIT */
#include "lens.h"

/* Clip to window: pixel = size / 2 (clip / w + 1) + jitter, from above if `flip`. */
static void window_row(const double clip[4], const double w[4], double size, bool flip, double jitter, double out[4]) {
    for (int k = 0; k < 4; k++) out[k] = size / 2 * ((flip ? -clip[k] : clip[k]) + w[k]) + jitter * w[k];
}

/* The null vector of the rows x, y and w (a point where they vanish is seen everywhere) is the centre of projection; its fourth
 * component vanishes where rays are parallel. */
static void find_eye(const double x[4], const double y[4], const double w[4], bool near_is_high, struct lens *lens) {
    const double all_w = det3(x, y, w);
    double direction[3], across[3];
    vec_cross(x, y, direction);
    lens->is_parallel = all_w == 0;
    if (!lens->is_parallel) {
        const double constants[3] = {-x[3], -y[3], -w[3]};
        solve3(x, y, w, constants, lens->eye);
        return;
    }
    /* Rays lie in the planes of constant x / w and y / w; w is constant along each. */
    if (vec_dot(w, w) > 0) {
        vec_cross(w, x, across);
        vec_cross(w, y, direction);
        if (vec_dot(across, across) > vec_dot(direction, direction)) memcpy(direction, across, sizeof direction);
    }
    vec_normalise(direction);
    const bool grows = row_direction(lens->depth, direction) > 0;
    for (int k = 0; k < 3; k++) lens->eye[k] = grows == near_is_high ? direction[k] : -direction[k];
}

/* Distance grows with w, or in a parallel projection away from the eye. */
static void find_axis(const double w[4], struct lens *lens) {
    const double steepness = vec_length(w);
    for (int k = 0; k < 4; k++) {
        if (lens->is_parallel) lens->axis[k] = k < 3 ? -lens->eye[k] : 0;
        else lens->axis[k] = w[k] / steepness;
    }
}

/* The growth of a clip coordinate across the axis. */
static double growth(const double clip[4], const double axis[4]) {
    const double along = vec_dot(clip, axis);
    double across[3];
    for (int k = 0; k < 3; k++) across[k] = clip[k] - along * axis[k];
    return vec_length(across);
}

static void find_box(const pbr_frame *frame, struct lens *lens) {
    const int64_t size[2] = {lens->width, lens->height};
    for (int k = 0; k < 2; k++) {
        int64_t low = 0, high = size[k];
        if (frame->flags & PBR_FRAME_SCISSOR) {
            const int64_t first = (int64_t)frame->scissor[k] - frame->viewport[k], end = first + frame->scissor[2 + k];
            low = first > 0 ? first : 0;
            high = end < size[k] ? end : size[k];
        }
        lens->box[k] = (int32_t)(low < size[k] ? low : size[k]);
        lens->box[2 + k] = (int32_t)(high > lens->box[k] ? high : lens->box[k]);
    }
}

void lens_set_up(const pbr_frame *frame, struct lens *lens) {
    double x[4], y[4];
    *lens = (struct lens){.width = frame->viewport[2], .height = frame->viewport[3]};
    mat_row(frame->projection, 0, x);
    mat_row(frame->projection, 1, y);
    mat_row(frame->projection, 2, lens->depth);
    mat_row(frame->projection, 3, lens->w);
    for (int k = 0; k < 4; k++) {
        lens->near[k] = lens->depth[k] + (frame->flags & PBR_FRAME_CLIP_ZERO_TO_ONE ? 0 : lens->w[k]);
        lens->far[k] = lens->w[k] - lens->depth[k];
    }
    window_row(x, lens->w, lens->width, false, frame->jitter[0], lens->x);
    window_row(y, lens->w, lens->height, (frame->flags & PBR_FRAME_CLIP_UPPER_LEFT) != 0, frame->jitter[1], lens->y);
    /* Nearer is larger in clip z, if it is so in the window and the depth range keeps the order. */
    const bool reversed = (frame->flags & PBR_FRAME_REVERSED_Z) != 0, swapped = frame->depth_range[0] > frame->depth_range[1];
    find_eye(x, y, lens->w, reversed != swapped, lens);
    find_axis(lens->w, lens);
    lens->focal = fmax(lens->width / 2.0 * growth(x, lens->axis), lens->height / 2.0 * growth(y, lens->axis));
    find_box(frame, lens);
}

void lens_to_eye(const struct lens *lens, const double point[3], double out[3]) {
    for (int k = 0; k < 3; k++) out[k] = lens->is_parallel ? lens->eye[k] : lens->eye[k] - point[k];
    vec_normalise(out);
}

/* Where three planes meet. */
bool lens_unproject(const struct lens *lens, double x, double y, double depth, double out[3]) {
    double right[4], up[4], in[4];
    for (int k = 0; k < 4; k++) {
        right[k] = lens->x[k] - x * lens->w[k];
        up[k] = lens->y[k] - y * lens->w[k];
        in[k] = lens->depth[k] - depth * lens->w[k];
    }
    const double wanted[3] = {-right[3], -up[3], -in[3]};
    return solve3(right, up, in, wanted, out);
}

/* A pixel's centre is at its number and a half. The margin covers rounding; what is drawn is tested exactly. */
bool lens_pixels(const struct lens *lens, const double low[2], const double high[2], int32_t box[4]) {
    const double margin = 1e-6;
    for (int k = 0; k < 2; k++) {
        const double first = ceil(low[k] - 0.5 - margin), last = floor(high[k] - 0.5 + margin);
        box[k] = first > lens->box[k] ? (int32_t)fmin(first, lens->box[2 + k]) : lens->box[k];
        box[2 + k] = last + 1 < lens->box[2 + k] ? (int32_t)fmax(last + 1, lens->box[k]) : lens->box[2 + k];
    }
    return box[0] < box[2] && box[1] < box[3];
}
