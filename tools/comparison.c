/* PSNR, SSIM, largest difference and coverage of two pictures. SPDX-License-Identifier: MIT */
#include "comparison.h"

#include <math.h>
#include <pbr/support.h>
#include <string.h>

#include "srgb.h"

static size_t pixel_count(const pbr_image *picture) {
    return (size_t)picture->width * picture->height;
}

/* Returns how many numbers were not finite. */
static uint64_t make_finite(pbr_image *picture) {
    uint64_t count = 0;
    for (size_t i = 0; i < 4 * pixel_count(picture); i++) {
        if (isfinite(picture->rgba[i])) continue;
        picture->rgba[i] = 0;
        count++;
    }
    return count;
}

/* Three numbers a pixel. */
static void encode(const pbr_image *picture, float *encoded) {
    for (size_t i = 0; i < pixel_count(picture); i++)
        for (size_t k = 0; k < 3; k++) encoded[3 * i + k] = srgb_from_linear(picture->rgba[4 * i + k]);
}

static uint64_t count_far_apart(float *const encoded[2], size_t pixels, double levels) {
    const double most =
        (levels + 0.01) / 255; /* of 8-bit pictures, whole levels: and a little for the conversion to linear and back */
    uint64_t count = 0;
    for (size_t i = 0; i < pixels; i++) {
        bool is_far = false;
        for (size_t k = 3 * i; k < 3 * i + 3; k++) is_far = is_far || fabs((double)encoded[0][k] - (double)encoded[1][k]) > most;
        count += is_far;
    }
    return count;
}

static void measure_differences(const pbr_image pictures[2], float *const encoded[2], struct comparison *comparison) {
    const size_t count = pixel_count(pictures), width = pictures[0].width;
    double sum = 0, sum_linear = 0;
    for (size_t i = 0; i < 3 * count; i++) {
        double difference = fabs((double)encoded[0][i] - (double)encoded[1][i]);
        size_t at = 4 * (i / 3) + i % 3;
        double linear = (double)pictures[0].rgba[at] - (double)pictures[1].rgba[at];
        sum += difference * difference;
        sum_linear += linear * linear;
        if (difference <= comparison->largest) continue;
        comparison->largest = difference;
        comparison->x = (uint32_t)(i / 3 % width);
        comparison->y = (uint32_t)(i / 3 / width);
        comparison->channel = (uint32_t)(i % 3);
    }
    size_t place = 3 * (comparison->y * width + comparison->x) + comparison->channel;
    for (int p = 0; p < 2; p++) comparison->values[p] = (double)encoded[p][place];
    comparison->mean_square = sum / (3 * (double)count);
    comparison->mean_square_linear = sum_linear / (3 * (double)count);
}

static bool is_transparent(const pbr_image *picture) {
    for (size_t i = 0; i < pixel_count(picture); i++)
        if (picture->rgba[4 * i + 3] < 1) return true;
    return false;
}

static bool is_covered(const pbr_image *picture, const float *encoded, size_t i, const struct comparison *comparison) {
    /* Backgrounds went through 8 bits, perhaps: half a step, and a little for the conversion to linear and back. */
    const float tolerance = 0.51f / 255;
    if (comparison->by_alpha) return picture->rgba[4 * i + 3] > 0;
    for (size_t k = 0; k < 3; k++)
        if (fabsf(encoded[3 * i + k] - comparison->background[k]) > tolerance) return true;
    return false;
}

static void measure_coverage(const pbr_image pictures[2], float *const encoded[2], struct comparison *comparison) {
    comparison->by_alpha = is_transparent(&pictures[0]) || is_transparent(&pictures[1]);
    for (size_t i = 0; i < pixel_count(pictures); i++) {
        bool covered[2];
        for (int p = 0; p < 2; p++) covered[p] = is_covered(&pictures[p], encoded[p], i, comparison);
        for (int p = 0; p < 2; p++) {
            comparison->covered[p] += covered[p];
            comparison->covered_only[p] += covered[p] && !covered[1 - p];
        }
    }
}

/* What SSIM needs of each pixel, and after filtering of each window: means of a, b, a a, b b, a b. */
enum { MOMENTS = 5 };

/* Gaussian of sigma 1.5 pixels whose sum is 1. */
static void make_weights(double weights[SSIM_WINDOW]) {
    double sum = 0;
    for (int i = 0; i < SSIM_WINDOW; i++) {
        double offset = i - SSIM_WINDOW / 2;
        weights[i] = exp(-offset * offset / (2 * 1.5 * 1.5));
        sum += weights[i];
    }
    for (int i = 0; i < SSIM_WINDOW; i++) weights[i] /= sum;
}

/* Luma of BT.601, of the encoded channels. */
static double luma(const float *encoded) {
    return 0.299 * (double)encoded[0] + 0.587 * (double)encoded[1] + 0.114 * (double)encoded[2];
}

/* Filters one row: `out` gets MOMENTS for each of the width - 10 windows; `row` is space for MOMENTS of each of its pixels. */
static void filter_row(const float *a, const float *b, size_t width, const double weights[SSIM_WINDOW], double *row, double *out) {
    for (size_t x = 0; x < width; x++) {
        double la = luma(a + 3 * x), lb = luma(b + 3 * x);
        memcpy(row + MOMENTS * x, (double[MOMENTS]){la, lb, la * la, lb * lb, la * lb}, MOMENTS * sizeof(double));
    }
    for (size_t x = 0; x + SSIM_WINDOW <= width; x++)
        for (int m = 0; m < MOMENTS; m++) {
            double sum = 0;
            for (size_t i = 0; i < SSIM_WINDOW; i++) sum += weights[i] * row[MOMENTS * (x + i) + (size_t)m];
            out[MOMENTS * x + (size_t)m] = sum;
        }
}

/* Wang et al. 2004, equation 13, with K1 = 0.01, K2 = 0.03 and a range of 1. */
static double window_ssim(const double m[MOMENTS]) {
    const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    double variances = m[2] - m[0] * m[0] + m[3] - m[1] * m[1], covariance = m[4] - m[0] * m[1];
    return (2 * m[0] * m[1] + c1) * (2 * covariance + c2) / ((m[0] * m[0] + m[1] * m[1] + c1) * (variances + c2));
}

/* The mean over the windows that lie wholly in the picture. The window is the product of two: rows are filtered once and the last
 * 11 kept. */
static pbr_result measure_ssim(pbr_instance *instance, const pbr_image *picture, float *const encoded[2], double *ssim) {
    const size_t width = picture->width, height = picture->height;
    double weights[SSIM_WINDOW], sum = 0;
    *ssim = NAN;
    if (width < SSIM_WINDOW || height < SSIM_WINDOW) return PBR_OK;
    const size_t windows = width - SSIM_WINDOW + 1;
    double *row = pbr_allocate(instance, width * MOMENTS, sizeof(double));
    double *last = pbr_allocate(instance, windows * MOMENTS * SSIM_WINDOW, sizeof(double)); /* row y at y % 11 */
    if (row && last) {
        make_weights(weights);
        for (size_t y = 0; y < height; y++) {
            const size_t from = 3 * y * width;
            filter_row(encoded[0] + from, encoded[1] + from, width, weights, row, last + y % SSIM_WINDOW * windows * MOMENTS);
            if (y + 1 < SSIM_WINDOW) continue;
            for (size_t x = 0; x < windows; x++) {
                double moments[MOMENTS] = {0};
                for (size_t i = 0; i < SSIM_WINDOW; i++) /* the oldest row, y - 10, is in the place after y's */
                    for (size_t m = 0; m < MOMENTS; m++)
                        moments[m] += weights[i] * last[((y + 1 + i) % SSIM_WINDOW * windows + x) * MOMENTS + m];
                sum += window_ssim(moments);
            }
        }
        *ssim = sum / ((double)windows * (double)(height - SSIM_WINDOW + 1));
    }
    pbr_free(instance, row);
    pbr_free(instance, last);
    return row && last ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

pbr_result comparison_make(pbr_instance *instance, pbr_image pictures[2], const float background[3], double levels,
                           struct comparison *comparison) {
    float *encoded[2] = {0};
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    *comparison = (struct comparison){0};
    for (int p = 0; p < 2; p++) {
        comparison->not_finite += make_finite(&pictures[p]);
        encoded[p] = pbr_allocate(instance, pixel_count(&pictures[p]), 3 * sizeof(float));
        if (!encoded[p]) goto cleanup;
        encode(&pictures[p], encoded[p]);
    }
    memcpy(comparison->background, background ? background : encoded[0], sizeof comparison->background);
    measure_differences(pictures, encoded, comparison);
    comparison->far_apart = count_far_apart(encoded, pixel_count(pictures), levels);
    measure_coverage(pictures, encoded, comparison);
    result = measure_ssim(instance, pictures, encoded, &comparison->ssim);
cleanup:
    for (int p = 0; p < 2; p++) pbr_free(instance, encoded[p]);
    return result;
}

double comparison_psnr(const struct comparison *comparison) {
    return comparison->mean_square > 0 ? -10 * log10(comparison->mean_square) : INFINITY;
}

pbr_result comparison_picture(pbr_instance *instance, const pbr_image pictures[2], const struct comparison *comparison,
                              bool is_linear, pbr_image *out) {
    const float stretch = comparison->largest > 0 ? (float)(1 / comparison->largest) : 0;
    pbr_result result = pbr_image_create(instance, pictures[0].width, pictures[0].height, 0, out);
    if (result != PBR_OK) return result;
    for (size_t i = 0; i < 4 * pixel_count(out); i++) {
        float a = pictures[0].rgba[i], b = pictures[1].rgba[i];
        if (i % 4 == 3) out->rgba[i] = 1;
        else if (is_linear) out->rgba[i] = a - b;
        else out->rgba[i] = linear_from_srgb(stretch * fabsf(srgb_from_linear(a) - srgb_from_linear(b)));
    }
    return PBR_OK;
}
