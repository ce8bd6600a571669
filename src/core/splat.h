/* The splat record: what every source of splats hands to the GL side, and what src/gl/shaders/splat.glsl reads.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_SPLAT_H
#define PBR_CORE_SPLAT_H

#include <math.h>
#include <stdint.h>

/* 24 bytes. */
struct splat {
    float position[3]; /* object space, relative to the origin of the record's chunk */
    float radius;      /* object units, >= 0 */
    int16_t normal[2]; /* octahedral (Meyer 2010), signed normalised; SPLAT_NO_NORMAL twice = none */
    uint8_t colour[4]; /* sRGB, linear alpha */
};

/* Decodes to (-1, -1), which like the square's other corners is -z; the encoder uses the corner (1, 1) for that. */
#define SPLAT_NO_NORMAL INT16_MIN

static inline float oct_sign(float v) {
    return v < 0 ? -1.0f : 1.0f;
}

/* n: any length; zero or non-finite gives "no normal". Largest error 6.5e-5 rad: sqrt(18) / 2 steps of 1/32767, at the
 * centres of the octahedron's faces (test octahedral_error_bound). */
static inline void splat_encode_normal(const float n[3], int16_t out[2]) {
    float sum = fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]);
    if (!(sum > 0) || !isfinite(sum)) {
        out[0] = out[1] = SPLAT_NO_NORMAL;
        return;
    }
    float u = n[0] / sum, v = n[1] / sum;
    if (n[2] < 0) {
        float folded = (1 - fabsf(v)) * oct_sign(u);
        v = (1 - fabsf(u)) * oct_sign(v);
        u = folded;
    }
    out[0] = (int16_t)lrintf(u * 32767);
    out[1] = (int16_t)lrintf(v * 32767);
    if (out[0] == -32767 && out[1] == -32767) out[0] = out[1] = 32767;
}

/* Unit normal, or zero for none. */
static inline void splat_decode_normal(const int16_t in[2], float n[3]) {
    n[0] = n[1] = n[2] = 0;
    if (in[0] <= -32767 && in[1] <= -32767) return;
    /* -32768 is -1, too. */
    float u = (float)(in[0] > -32767 ? in[0] : -32767) / 32767, v = (float)(in[1] > -32767 ? in[1] : -32767) / 32767;
    float w = 1 - fabsf(u) - fabsf(v), fold = w < 0 ? -w : 0;
    u -= fold * oct_sign(u);
    v -= fold * oct_sign(v);
    float length = sqrtf(u * u + v * v + w * w);
    n[0] = u / length;
    n[1] = v / length;
    n[2] = w / length;
}

#endif
