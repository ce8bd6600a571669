/* One splat on the screen: which pixels it may touch, and what it is at each. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_SURFEL_H
#define PBR_REFERENCE_SURFEL_H

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
    uint32_t kind;   /* as which it is drawn: an ewa may be a gaussian */
    double centre[3], a[3], b[3];
    double normal[3];                                             /* unit, or 0 */
    double turn_u[3], turn_v[3];                                  /* phong-field: the change of the normal by u, by v */
    double distance;                                              /* the centre's, along the view axis */
    double window[2];                                             /* the centre's pixel, where its w is positive */
    double half;                                                  /* square, circle: half the side, the radius in pixels */
    double x[3], y[3], w[3], depth[3], near[3], far[3], along[3]; /* the lens's rows (along: its axis), for (u, v, 1) */
    double blurred[3], cover[3]; /* ewa: q and c of docs/splats.md, as [0] dx^2 + 2 [1] dx dy + [2] dy^2 */
    double peak;                 /* ewa: weight at the centre */
    double to_disc[2][2];        /* ewa: u, v by pixels, to first order */
    double slope[2], reach;      /* ewa: change of depth / w by pixels, and the most that it changes by */
    double set_back;             /* blended kinds: how far a fragment is moved back, in perspective as a part of its distance */
    int32_t box[4];              /* pixels [0] <= x < [2], [1] <= y < [3] that hold all that it covers */
    double colour[3];            /* linear; lit if the splat is shaded once */
};

/* What a splat is at a pixel. */
struct fragment {
    const struct surfel *surfel;
    double distance; /* along the view axis */
    double depth;    /* clip z / w */
    double weight;   /* 1 of opaque kinds */
    double u, v;     /* where the pixel's ray meets the disc's plane, if it does */
    bool covers;     /* may hide others; it may have a weight without */
};

/* False if the splat covers no pixel. */
bool surfel_place(const struct scene *scene, const struct walk *at, const struct sample *sample, struct surfel *out);

/* Gives a placed one its colour. */
void surfel_shade(const struct scene *scene, const struct sample *sample, struct surfel *surfel);

/* At the pixel whose centre is (x, y). False if the splat has no part in it. */
bool surfel_fragment(const struct lens *lens, const struct surfel *surfel, double x, double y, struct fragment *out);

#endif
