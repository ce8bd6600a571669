/* The numbers of docs/splats.md, for C and GLSL alike. Only numbers: how they are used is written once for each side, so that one
 * can judge the other. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_KERNEL_H
#define PBR_CORE_KERNEL_H

/* A Gaussian splat's radius, and where every kernel is cut off, in standard deviations. */
#define KERNEL_SIGMAS 2.0

/* Variance of the screen's low-pass filter, px^2, unless an item has its own; the most that it may have. */
#define KERNEL_LOW_PASS 1.0
#define KERNEL_MOST_LOW_PASS 16.0

/* ewa, ewa-max: a splat whose radius is this part of its distance, or more, is a gaussian. */
#define KERNEL_NEAR_RADIUS 0.125

/* ewa: least height of a splat, so that half floats hold the weight of what is seen from its edge. */
#define KERNEL_LEAST_HEIGHT 1e-4

/* Discs that are seen from near their edge are drawn so many times as high, at most, and by so many pixels of half their height;
 * the cosine of the slant that is high enough, 82 degrees. */
#define KERNEL_EDGE_HIGHER 1.5
#define KERNEL_EDGE_PIXELS 1.0
#define KERNEL_EDGE_COSINE 0.1391731

/* Layers: how far splats are moved back, in radii, across the surface; the most that 1 / cos counts. */
#define KERNEL_EPSILON 0.5
#define KERNEL_MOST_SLOPE 4.0

/* Filling holes: the largest radius over which centres are averaged, pixels; what marks of splats that are parallel to the screen
 * count as their radius when they are moved back, in radii. */
#define KERNEL_MOST_FILLED 16.0
#define KERNEL_FILL_REACH 4.0

#endif
