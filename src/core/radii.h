/* Splat radii from the spacing of the points. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_RADII_H
#define PBR_CORE_RADII_H

#include "points.h"

/* Writes points->count radii, such that the splats of a surface sampled at locally even density close it: see radii.c for the rule.
 */
pbr_result radii_estimate(const pbr_points *points, uint32_t neighbours, float scale, const struct progress *progress, float *out);

#endif
