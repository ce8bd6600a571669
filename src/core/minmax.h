/* fmin and fmax without calls, of numbers. Of anything else they give `b`, whatever that is. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_MINMAX_H
#define PBR_CORE_MINMAX_H

static inline double lesser(double a, double b) {
    return a < b ? a : b;
}
static inline double larger(double a, double b) {
    return a > b ? a : b;
}
static inline float lesserf(float a, float b) {
    return a < b ? a : b;
}
static inline float largerf(float a, float b) {
    return a > b ? a : b;
}

#endif
