/* One pixel out of its fragments. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_LAYERS_H
#define PBR_REFERENCE_LAYERS_H

#include "surfel.h"

/* Linear, premultiplied; the distance of what hides all behind it, infinite if nothing does. */
struct pixel {
    double rgba[4], distance;
    const struct fragment *mark; /* the front of the layer to be filled, NULL if there is none */
    double mark_end;             /* its distance moved back */
    bool is_mark_seen;           /* in its splat's own colour */
};

/* Sorts the fragments of the pixel whose centre is (x, y) and lays them over `pixel`: opaque ones first, then each layer in the
 * order of its first item, where it is nearer than what hides. The mark is one of those given. */
void layers_resolve(const struct scene *scene, double x, double y, struct fragment *fragments, size_t count, struct pixel *pixel);

#endif
