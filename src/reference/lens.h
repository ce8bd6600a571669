/* The camera: from eye space to pixels and back, for any projection. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_LENS_H
#define PBR_REFERENCE_LENS_H

#include <pbr/render.h>

#include "linear.h"

/* Rows are applied to eye-space points. Pixels count from the viewport's lower left, jitter included. */
struct lens {
    double x[4], y[4], w[4]; /* a point is seen at the pixel (x / w, y / w), if w > 0 */
    double near[4], far[4];  /* not negative for a point between the near and the far plane */
    double depth[4];         /* clip z; depth / w is affine over the window on every plane */
    double axis[4];          /* distance along the view axis: from the eye, in a parallel projection from eye space's origin */
    bool is_parallel;        /* the eye is a direction */
    double eye[3];           /* the centre of projection; a parallel one's direction to it, unit */
    double focal;            /* pixels of a unit length across the axis where w is 1 */
    int32_t width, height;   /* pixels */
    int32_t box[4];          /* what may be drawn: least x, y and one past the largest, within the viewport and the scissor box */
};

/* Of a valid frame. */
void lens_set_up(const pbr_frame *frame, struct lens *lens);

/* The unit vector from the point to the eye; 0 at the eye. */
void lens_to_eye(const struct lens *lens, const double point[3], double out[3]);

/* The point seen at (x, y) at that depth / w. False where there is none. */
bool lens_unproject(const struct lens *lens, double x, double y, double depth, double out[3]);

/* A range of pixels [box[0], box[2]) x [box[1], box[3]) that holds all pixels whose centres lie in a rectangle, within the lens's
 * box. The rectangle may have infinite sides. False if there is none. */
bool lens_pixels(const struct lens *lens, const double low[2], const double high[2], int32_t box[4]);

#endif
