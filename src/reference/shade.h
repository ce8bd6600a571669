/* Colour before light, and light. All linear. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_SHADE_H
#define PBR_REFERENCE_SHADE_H

#include "scene.h"

/* What of a point or a vertex a colour may be made of. */
struct colouring {
    const uint8_t *colour;   /* sRGB, or NULL */
    const double *normal;    /* object space, unit or 0 */
    double scalar, distance; /* distance: along the view axis */
};

/* Sets the ranges of colour maps that the items leave open. */
pbr_result shade_find_ranges(struct scene *scene);

/* By the item's colour source. */
void shade_albedo(const struct scene_item *item, const struct colouring *from, double out[3]);

/* Phong at a point with a unit normal, eye space; of a normal of 0 the albedo as it is. The side of the normal that the eye sees is
 * lit. */
void shade_phong(const struct scene *scene, const pbr_material *material, const double albedo[3], const double point[3],
                 const double normal[3], double out[3]);

#endif
