/* What a pointer does to the camera of --view: a model is turned, moved and zoomed as if held by it. Distances in pixels count
 * right and down. Results are rounded to what is worth telling, so that the numbers shown are the numbers drawn with.
 * SPDX-License-Identifier: MIT */
#ifndef ORBIT_H
#define ORBIT_H

#include "camera.h"

/* Bounds of zooming; a --view outside of them stays until it is zoomed towards them. */
#define ORBIT_LEAST_ZOOM 0.01
#define ORBIT_MOST_ZOOM 10000
/* Degrees that a drag by one logical pixel (1/96 inch or so) turns. */
#define ORBIT_DEGREES_PER_PIXEL 0.25

/* `view`: yaw, pitch, zoom. Dragged to the right the model's front goes to the right, dragged down its top comes forward; pitch
 * ends at straight up and down. Degrees. */
void orbit_turn(double view[3], double right, double down);
/* `value` times 2^(1/4) for each step, to so many digits, and so that as many whole steps back end where they began. */
double orbit_step(double value, double steps, int digits);
/* A step, one notch of a wheel, is a factor of 2^(1/4) nearer. */
void orbit_zoom(double view[3], double steps);
/* The same picture of the same place when the sphere that zoom refers to changes its radius. */
void orbit_rescale(double view[3], double radius_before, double radius_after);
/* `light`: yaw, pitch, as --light. The light goes where it is dragged. Degrees. */
void orbit_light(double light[2], double right, double down);

/* How far one pixel is at the distance of `centre`, which the camera looks at; world. */
double orbit_pixel(const struct camera *camera, const double centre[3]);
/* Moves the centre, world, so that what is as far away as it follows a pointer; in the camera's pixels. */
void orbit_pan(const struct camera *camera, double right, double down, double centre[3]);
/* Rounds a coordinate to the power of ten that is a hundredth of `pixel` or less. */
double orbit_round(double coordinate, double pixel);

#endif
