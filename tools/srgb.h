/* sRGB (IEC 61966-2-1) and linear light, for what sees the public headers only. SPDX-License-Identifier: MIT */
#ifndef SRGB_H
#define SRGB_H

#include <math.h>

/* Clamped to 0..1; NaN gives 0. */
static inline float srgb_from_linear(float c) {
    if (!(c > 0)) return 0;
    if (c >= 1) return 1;
    return c <= 0.0031308f ? 12.92f * c : 1.055f * powf(c, 1 / 2.4f) - 0.055f;
}

static inline float linear_from_srgb(float c) {
    return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}

#endif
