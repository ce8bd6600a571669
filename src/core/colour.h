/* sRGB (IEC 61966-2-1) and linear light. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_COLOUR_H
#define PBR_CORE_COLOUR_H

#include <math.h>
#include <stdint.h>

static inline float linear_from_srgb(float c) {
    return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}
static inline float srgb_from_linear(float c) {
    return c <= 0.0031308f ? c * 12.92f : 1.055f * powf(c, 1 / 2.4f) - 0.055f;
}

/* 0..1 to 0..255, rounded; NaN gives 0. */
static inline uint8_t unorm8(float v) {
    return !(v > 0) ? 0 : v >= 1 ? 255 : (uint8_t)(v * 255 + 0.5f);
}

#endif
