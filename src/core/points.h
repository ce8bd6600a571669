/* The inside of a point set. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_POINTS_H
#define PBR_CORE_POINTS_H

#include <pbr/points.h>

#include <string.h>

#include "instance.h"

struct scalar {
    char name[64];
    float *values;
    float minimum, maximum; /* over the finite values; 0, 0 if there are none */
};

/* Arrays of `count` elements in the host's order; NULL where absent. Immutable once created. */
struct pbr_points {
    pbr_instance *instance;
    atomic_size_t references;
    uint64_t count, dropped;
    double origin[3];
    /* Exactly one of the two, relative to `origin`. Wide is kept where float would move a point by more than 1/128 of its radius.
     */
    float (*narrow)[3];
    double (*wide)[3];
    int16_t (*normals)[2]; /* as in struct splat */
    uint8_t (*colours)[4];
    float *radii;
    struct scalar *scalars;
    uint32_t scalar_count;
    double minimum[3], maximum[3]; /* relative to origin */
    double bounding_radius;        /* of the sphere around the box's centre */
    float radius_minimum, radius_mean, radius_maximum;
    uint64_t memory_bytes;
};

/* Largest shift of a coordinate, in radii of the splat, that rounding to float may cause. */
#define POSITION_TOLERANCE (1.0 / 128)

/* Position i relative to the set's origin. */
static inline void points_position(const pbr_points *points, uint64_t i, double out[3]) {
    if (points->wide)
        for (int k = 0; k < 3; k++) out[k] = points->wide[i][k];
    else
        for (int k = 0; k < 3; k++) out[k] = points->narrow[i][k];
}

/* As pbr_points_create. With `keep_all`, points without finite coordinates stay in place as (0, 0, 0) and are only counted. */
pbr_result points_create(pbr_instance *instance, const pbr_points_desc *desc, bool keep_all, pbr_points **out);

/* A new set of the points `chosen[0 .. count)` of another, with all their attributes but the radii, which are given (copied). */
pbr_result points_select(const pbr_points *source, const uint32_t *chosen, uint64_t count, const float *radii, pbr_points **out);

/* An origin near the box's centre for float positions. Per axis: 0 where the box lies around or near 0, so that positions stay as
 * they are; else the centre rounded to few bits. Subtracting it from a float position in the box is exact in float. */
void box_origin(const double minimum[3], const double maximum[3], double out[3]);

/* The least float >= v, for v within float's range: radii that must enclose are rounded up. */
static inline float float_above(double v) {
    float f = (float)v;
    uint32_t bits;
    memcpy(&bits, &f, sizeof f);
    if ((double)f < v) bits += bits >> 31 ? -1u : 1u; /* the next one up, as nextafterf, but without a call */
    memcpy(&f, &bits, sizeof f);
    return f;
}

#endif
