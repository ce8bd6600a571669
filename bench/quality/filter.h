/* What sampling does to pictures: how much of a picture's energy is too fine for its pixels, and the picture that a Gaussian filter
 * makes. SPDX-License-Identifier: MIT */
#ifndef FILTER_H
#define FILTER_H

#include <pbr/image.h>
#include <stdbool.h>
#include <stdint.h>

struct spectrum {
    double share;  /* of the energy but for the mean's, in frequencies above half a cycle a pixel along either axis */
    double folded; /* root mean square of that part */
};

/* `samples`: columns x rows, `per_pixel` of them along each side of a pixel, weighted by a Hann window. False if memory is short.
 */
bool spectrum_measure(const double *samples, uint32_t columns, uint32_t rows, uint32_t per_pixel, struct spectrum *out);

/* Every pixel of `out` becomes the mean of `fine`, which has `per_pixel` pixels along each of its sides, weighted by a Gaussian of
 * a standard deviation of one pixel of `out` around its centre and cut off at four. `whole`, one byte a pixel, receives 1 where all
 * that counts is in the picture and has alpha 1. `out` must hold no pixels. */
pbr_result filter_gaussian(pbr_instance *instance, const pbr_image *fine, uint32_t per_pixel, pbr_image *out, uint8_t *whole);

#endif
