/* The inside of a point set. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_POINTS_H
#define PBR_CORE_POINTS_H

#include <pbr/points.h>

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
    /* Exactly one of the two, relative to `origin`. Wide is kept where float would move a point by more than 1/128 of its radius. */
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

/* Position i relative to the set's origin. */
static inline void points_position(const pbr_points *points, uint64_t i, double out[3]) {
    if (points->wide)
        for (int k = 0; k < 3; k++) out[k] = points->wide[i][k];
    else
        for (int k = 0; k < 3; k++) out[k] = points->narrow[i][k];
}

#endif
