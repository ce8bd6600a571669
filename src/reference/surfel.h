/* One splat on the screen: which pixels it may touch, and what it is at each. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_SURFEL_H
#define PBR_REFERENCE_SURFEL_H

#include "core/kernel.h"
#include "core/normal_field.h"
#include "scene.h"

/* A point as pbr_points_copy gives it. */
struct sample {
    double position[3]; /* object space */
    float normal[3], radius, scalar;
    uint8_t colour[4];
    const struct normal_field *field; /* NULL: the normal is the same all over the splat */
};

/* In eye space. The point of the disc at the coordinates u, v is centre + u a + v b. */
struct surfel {
    const struct scene_item *item;
    uint64_t number; /* of the scene's elements */
    uint32_t kind;   /* as which it is drawn: an ewa or ewa-max may be a gaussian */
    double centre[3], a[3], b[3];
    double normal[3];                                             /* unit, or 0 */
    double turn_u[3], turn_v[3];                                  /* phong-field: the change of the normal by u, by v */
    double distance;                                              /* the centre's, along the view axis */
    double window[2];                                             /* the centre's pixel, where its w is positive */
    double radius;                                                /* pixels, seen face on, where its w is positive */
    double x[3], y[3], w[3], depth[3], near[3], far[3], along[3]; /* the lens's rows (along: its axis), for (u, v, 1) */
    double filter[3];     /* ewa, ewa-max: q, e of docs/splats.md, as [0] dx^2 + 2 [1] dx dy + [2] dy^2 */
    double peak;          /* the same: weight at the centre */
    double to_disc[2][2]; /* the same: u, v by pixels, to first order */
    double middle[2];     /* the same: around which the filter lies, pixels */
    double slope[2];      /* the same: change of depth / w by pixels */
    double shift,
        reach;        /* the same: of the disc's depths, the middle's less the centre's, and how far they reach from the middle */
    double set_back;  /* layers: how far a fragment is moved back, in perspective as a part of its distance */
    int32_t box[4];   /* pixels [0] <= x < [2], [1] <= y < [3] that hold all that it has a part in */
    int32_t home[2];  /* filling: the pixel that it brings its colour to, which holds its centre; -1: none */
    double colour[3]; /* linear; lit if the splat is shaded once */
};

/* What a splat is at a pixel. */
struct fragment {
    const struct surfel *surfel;
    double distance; /* along the view axis */
    double depth;    /* clip z / w */
    double weight;   /* 1 of opaque kinds */
    double u, v;     /* where the pixel's ray meets the disc's plane, if it does */
    bool covers;     /* may hide others; it may have a weight without, or cover without a weight */
};

/* The weight at a distance from a Gaussian's centre, in radii, squared. */
static inline double surfel_weight(double squared) {
    return exp(-KERNEL_SIGMAS * KERNEL_SIGMAS / 2 * squared);
}

/* False if the splat has no part in any pixel. */
bool surfel_place(const struct scene *scene, const struct walk *at, const struct sample *sample, struct surfel *out);

/* Gives a placed one its colour. */
void surfel_shade(const struct scene *scene, const struct sample *sample, struct surfel *surfel);

/* At the pixel whose centre is (x, y). False if the splat has no part in it. */
bool surfel_fragment(const struct lens *lens, const struct surfel *surfel, double x, double y, struct fragment *out);

#endif
