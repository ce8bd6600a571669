/* A plain Fourier transform and a separable filter. SPDX-License-Identifier: MIT */
#include "filter.h"

#include <math.h>
#include <pbr/support.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

struct wave {
    double real, imaginary;
};

/* ---- Spectrum ---- */

static double hann(uint32_t i, uint32_t count) {
    return 0.5 - 0.5 * cos(2 * pi * (i + 0.5) / count);
}

/* The mean that is left is that under the window. Returns the sum of the squared weights. */
static double apply_window(const double *samples, uint32_t columns, uint32_t rows, double *out) {
    double sum = 0, weights = 0, squares = 0;
    for (int pass = 0; pass < 2; pass++) {
        const double mean = pass ? sum / weights : 0;
        for (uint32_t y = 0; y < rows; y++)
            for (uint32_t x = 0; x < columns; x++) {
                const size_t i = (size_t)y * columns + x;
                const double weight = hann(x, columns) * hann(y, rows);
                out[i] = weight * (samples[i] - mean);
                if (pass) continue;
                sum += out[i];
                weights += weight;
                squares += weight * weight;
            }
    }
    return squares;
}

/* Frequency k of `count` values that lie `stride` apart. `turns`: the roots of unity. */
static struct wave transform(const struct wave *values, uint32_t count, size_t stride, const struct wave *turns, uint32_t k) {
    struct wave sum = {0, 0};
    for (uint32_t i = 0, at = 0; i < count; i++, at = (at + k) % count) {
        const struct wave v = values[i * stride], t = turns[at];
        sum.real += v.real * t.real - v.imaginary * t.imaginary;
        sum.imaginary += v.real * t.imaginary + v.imaginary * t.real;
    }
    return sum;
}

static void fill_turns(struct wave *turns, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) turns[i] = (struct wave){cos(2 * pi * i / count), -sin(2 * pi * i / count)};
}

/* Is the frequency k of `count` above half a cycle a pixel? */
static bool is_above(uint32_t k, uint32_t count, uint32_t per_pixel) {
    const uint32_t steps = k <= count / 2 ? k : count - k;
    return 2 * (uint64_t)steps * per_pixel > count;
}

bool spectrum_measure(const double *samples, uint32_t columns, uint32_t rows, uint32_t per_pixel, struct spectrum *out) {
    const uint32_t half = columns / 2 + 1; /* the rest mirrors them: samples are real */
    const size_t count = (size_t)columns * rows;
    double *windowed = calloc(count, sizeof *windowed), energy = 0, above = 0, squares = 0;
    struct wave *line = calloc(columns, sizeof *line), *waves = calloc((size_t)half * rows, sizeof *waves);
    struct wave *across = calloc(columns, sizeof *across), *down = calloc(rows, sizeof *down);
    const bool done = windowed && line && waves && across && down;
    if (done) {
        squares = apply_window(samples, columns, rows, windowed);
        fill_turns(across, columns);
        fill_turns(down, rows);
    }
    for (uint32_t y = 0; done && y < rows; y++) {
        for (uint32_t x = 0; x < columns; x++) line[x] = (struct wave){windowed[(size_t)y * columns + x], 0};
        for (uint32_t k = 0; k < half; k++) waves[(size_t)y * half + k] = transform(line, columns, 1, across, k);
    }
    for (uint32_t kx = 0; done && kx < half; kx++)
        for (uint32_t ky = 0; ky < rows; ky++) {
            const struct wave w = transform(waves + kx, rows, half, down, ky);
            const bool is_mirrored = kx > 0 && 2 * kx < columns;
            const double part = (is_mirrored ? 2 : 1) * (w.real * w.real + w.imaginary * w.imaginary);
            energy += part;
            if (is_above(kx, columns, per_pixel) || is_above(ky, rows, per_pixel)) above += part;
        }
    if (done) *out = (struct spectrum){energy > 0 ? above / energy : 0, sqrt(above / ((double)count * squares))};
    free(windowed);
    free(line);
    free(waves);
    free(across);
    free(down);
    return done;
}

/* ---- Filter ---- */

struct kernel {
    uint32_t reach; /* samples on either side of a pixel's centre that count */
    double weights[2 * 4 * 16];
};

/* One line, `step` numbers from pixel to pixel. The fourth of a pixel's numbers is its alpha. `least`: the smallest alpha that
 * counts, 0 where the line ends; `from`, of the line's samples, may be NULL. */
static void filter_line(const struct kernel *kernel, uint32_t per_pixel, const float *in, size_t in_step, uint32_t in_count,
                        const float *from, size_t from_step, float *out, size_t out_step, float *least, size_t least_step) {
    for (uint32_t x = 0; x < in_count / per_pixel; x++) {
        double sums[4] = {0, 0, 0, 0}, weights = 0;
        float smallest = 1;
        for (uint32_t i = 0; i < 2 * kernel->reach; i++) {
            const int64_t at = (int64_t)x * per_pixel + per_pixel / 2 + i - kernel->reach;
            const bool is_inside = at >= 0 && at < in_count;
            if (!is_inside) smallest = 0;
            if (!is_inside) continue;
            const float *pixel = in + (size_t)at * in_step;
            const float alpha = from ? from[(size_t)at * from_step] : pixel[3];
            for (int k = 0; k < 4; k++) sums[k] += kernel->weights[i] * (double)pixel[k];
            weights += kernel->weights[i];
            smallest = fminf(smallest, alpha);
        }
        for (int k = 0; k < 4; k++) out[x * out_step + (size_t)k] = (float)(sums[k] / weights);
        least[x * least_step] = smallest;
    }
}

pbr_result filter_gaussian(pbr_instance *instance, const pbr_image *fine, uint32_t per_pixel, pbr_image *out, uint8_t *whole) {
    const size_t width = fine->width / per_pixel, height = fine->height / per_pixel;
    struct kernel kernel = {.reach = 4 * per_pixel};
    float *lines = NULL, *least = NULL, *all = NULL;
    pbr_result result = per_pixel > 0 && per_pixel <= 16 && per_pixel % 2 == 0
                            ? pbr_image_create(instance, (uint32_t)width, (uint32_t)height, 0, out)
                            : PBR_ERROR_INVALID_ARGUMENT;
    if (result != PBR_OK) return result;
    for (uint32_t i = 0; i < 2 * kernel.reach; i++) {
        const double distance = (i + 0.5 - kernel.reach) / per_pixel;
        kernel.weights[i] = exp(-distance * distance / 2);
    }
    lines = pbr_allocate(instance, width * fine->height, 4 * sizeof *lines);
    least = pbr_allocate(instance, width * fine->height, sizeof *least);
    all = pbr_allocate(instance, width * height, sizeof *all);
    if (lines && least && all) {
        for (size_t y = 0; y < fine->height; y++)
            filter_line(&kernel, per_pixel, fine->rgba + 4 * y * fine->width, 4, fine->width, NULL, 0, lines + 4 * y * width, 4,
                        least + y * width, 1);
        for (size_t x = 0; x < width; x++)
            filter_line(&kernel, per_pixel, lines + 4 * x, 4 * width, fine->height, least + x, width, out->rgba + 4 * x, 4 * width,
                        all + x, width);
        for (size_t i = 0; i < width * height; i++) whole[i] = all[i] >= 1;
    } else {
        result = PBR_ERROR_OUT_OF_MEMORY;
        pbr_image_destroy(instance, out);
    }
    pbr_free(instance, lines);
    pbr_free(instance, least);
    pbr_free(instance, all);
    return result;
}
