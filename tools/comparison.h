/* How far two pictures are apart. Colours are compared as seen over black, each channel sRGB-encoded and clamped to 0..1, unless
 * said otherwise. SPDX-License-Identifier: MIT */
#ifndef COMPARISON_H
#define COMPARISON_H

#include <pbr/image.h>
#include <stdbool.h>

/* SSIM's window, pixels wide and high: Wang, Bovik, Sheikh & Simoncelli 2004. */
enum { SSIM_WINDOW = 11 };

struct comparison {
    double mean_square;        /* over pixels and the channels R, G, B */
    double mean_square_linear; /* of linear colours, not clamped */
    double ssim;               /* NaN for pictures smaller than the window */
    uint64_t far_apart;        /* pixels of which a channel differs by more than `levels` of 255 */
    double largest;            /* difference in one channel ... */
    uint32_t x, y, channel;    /* ... where: from the upper left; 0 = red */
    double values[2];          /* ... and what the two pictures have there */
    bool by_alpha;             /* covered means: alpha above 0; else: of another colour than the background */
    float background[3];       /* that colour */
    uint64_t covered[2];       /* pixels */
    uint64_t covered_only[2];  /* in this picture and not in the other */
    uint64_t not_finite;       /* numbers of both pictures: they count as 0 */
};

/* Compares pictures of one size; replaces numbers in them that are not finite by 0. `background` tells pixels that are not covered
 * in pictures without transparency; NULL = the colour of picture 0's upper left pixel. */
pbr_result comparison_make(pbr_instance *instance, pbr_image pictures[2], const float background[3], double levels,
                           struct comparison *comparison);

/* PSNR in dB; infinite if nothing differs. */
double comparison_psnr(const struct comparison *comparison);

/* Makes an opaque picture of the differences: linear ones with their sign (for OpenEXR), or magnitudes of sRGB-encoded ones
 * with the largest stretched to white. */
pbr_result comparison_picture(pbr_instance *instance, const pbr_image pictures[2], const struct comparison *comparison,
                              bool is_linear, pbr_image *out);

#endif
