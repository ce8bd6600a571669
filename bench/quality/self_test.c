/* The measures against what is known in closed form. SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>

#include "filter.h"
#include "parts.h"

static const double pi = 3.14159265358979323846;

enum { PIXELS = 120, HIGH = 16, FINE = 4, COLUMNS = PIXELS * FINE, ROWS = HIGH * FINE };

typedef double signal_fn(double x);

/* 0.3 of one cycle in 6 pixels, 0.1 of three cycles in 4. */
static double two_sines(double x) {
    return 0.5 + 0.3 * sin(2 * pi * x / 6) + 0.1 * sin(2 * pi * 0.75 * x);
}

/* Squares of 1.6 pixels, dark and bright; what folds at four samples a pixel falls on no harmonic. */
static const double period = 120 / 37.0;
static double squares(double x) {
    return fmod(x, period) < period / 2 ? 1 : 0;
}

/* The integral of the squares from 0 on. */
static double squares_sum(double x) {
    const double periods = floor(x / period), rest = x - period * periods;
    return periods * period / 2 + fmin(rest, period / 2);
}

static double squares_in_box(double x) {
    return squares_sum(x + 0.5 + 3 * period) - squares_sum(x - 0.5 + 3 * period);
}

/* The squares' odd harmonics have energies 1 / n^2, in a box of one pixel times sinc^2(n / period). */
static double harmonic_share(bool is_boxed) {
    double above = 0, all = 0;
    for (int n = 1; n < 100000; n += 2) {
        const double x = pi * n / period, sinc = is_boxed ? sin(x) / x : 1, energy = sinc * sinc / ((double)n * n);
        all += energy;
        if (n / period > 0.5) above += energy;
    }
    return above / all;
}

static bool measure(signal_fn *signal, bool is_vertical, struct spectrum *out) {
    double *samples = calloc((size_t)COLUMNS * ROWS, sizeof *samples);
    const uint32_t columns = is_vertical ? ROWS : COLUMNS, rows = is_vertical ? COLUMNS : ROWS;
    bool done = samples != NULL;
    for (uint32_t y = 0; done && y < rows; y++)
        for (uint32_t x = 0; x < columns; x++) samples[(size_t)y * columns + x] = signal(((is_vertical ? y : x) + 0.5) / FINE);
    done = done && spectrum_measure(samples, columns, rows, FINE, out);
    free(samples);
    return done;
}

static bool expect(struct studio *studio, const char *what, double found, double expected, double tolerance) {
    const bool holds = fabs(found - expected) <= tolerance;
    if (!holds) session_fail(&studio->session, "%s: %.6f, not %.6f +- %g", what, found, expected, tolerance);
    return holds;
}

/* The squares' own harmonics fall off slowly: those above two cycles a pixel fold at four samples a pixel, and a few of them below
 * half a cycle. Of their energy, a share of 8 / pi^2 / 12, 1 / 4 may. */
static bool test_spectrum(struct studio *studio) {
    struct spectrum s[5];
    if (!measure(two_sines, false, &s[0]) || !measure(two_sines, true, &s[1]) || !measure(squares_in_box, false, &s[2]) ||
        !measure(squares, false, &s[3]) || !measure(squares, true, &s[4]))
        return false;
    bool holds = expect(studio, "two sines, share", s[0].share, 0.01 / 0.1, 1e-9);
    holds &= expect(studio, "two sines, folded", s[0].folded, 0.1 / sqrt(2), 1e-9);
    holds &= expect(studio, "two sines down, share", s[1].share, 0.01 / 0.1, 1e-9);
    holds &= expect(studio, "squares in boxes, share", s[2].share, harmonic_share(true), 3e-4);
    holds &= expect(studio, "squares, share", s[3].share, harmonic_share(false), 0.02);
    holds &= expect(studio, "squares down, share", s[4].share, harmonic_share(false), 0.02);
    return holds;
}

/* A sine of f cycles a pixel comes out exp(-2 pi^2 f^2) times as high. */
static bool test_filter(struct studio *studio) {
    const double f = 0.2, height = exp(-2 * pi * pi * f * f);
    pbr_instance *instance = studio->session.instance;
    pbr_image fine = PBR_IMAGE_INIT, out = PBR_IMAGE_INIT;
    uint8_t whole[32 * 32];
    double largest = 0, hole = 0;
    if (pbr_image_create(instance, 128, 128, 0, &fine) != PBR_OK) return false;
    for (size_t i = 0; i < (size_t)128 * 128; i++) {
        fine.rgba[4 * i] = (float)(0.5 + 0.5 * sin(2 * pi * f * ((double)(i % 128) + 0.5) / FINE));
        fine.rgba[4 * i + 1] = (float)(0.5 + 0.5 * sin(2 * pi * f * ((double)(i / 128) + 0.5) / FINE));
        fine.rgba[4 * i + 3] = i == 0 ? 0 : 1;
    }
    bool holds = filter_gaussian(instance, &fine, FINE, &out, whole) == PBR_OK;
    for (size_t i = 0; holds && i < (size_t)32 * 32; i++) {
        const size_t x = i % 32, y = i / 32;
        const bool is_inside = x >= 4 && x < 28 && y >= 4 && y < 28;
        hole += whole[i] != is_inside;
        if (!is_inside) continue;
        const double expected[2] = {0.5 + 0.5 * height * sin(2 * pi * f * ((double)x + 0.5)),
                                    0.5 + 0.5 * height * sin(2 * pi * f * ((double)y + 0.5))};
        for (int k = 0; k < 2; k++) largest = fmax(largest, fabs((double)out.rgba[4 * i + (size_t)k] - expected[k]));
    }
    holds = holds && expect(studio, "Gaussian filter", largest, 0, 2e-4); /* cut off at four standard deviations */
    holds = holds && expect(studio, "pixels that are whole", hole, 0, 0);
    pbr_image_destroy(instance, &fine);
    pbr_image_destroy(instance, &out);
    return holds;
}

/* Shifted pictures, put together, are the finer picture: the sign of the jitter, of triangles and of splats. */
static bool test_shifts(struct studio *studio) {
    const uint32_t size[2] = {48, 32}, large[2] = {96, 64};
    pbr_image fine = PBR_IMAGE_INIT;
    struct model model;
    double largest = 0;
    bool done = model_synthesise(studio, SURFACE_SPHERE, 1800, &model);
    const struct view view = view_around("", &model, 30, 20, 1, size), whole = view_around("", &model, 30, 20, 1, large);
    done = done && studio_draw_truth(studio, &model, &whole, 1, PBR_COLOUR_POINTS, &fine);
    for (uint32_t shift = 0; done && shift < 4; shift++) {
        const uint32_t right = shift % 2, down = shift / 2;
        struct view shifted = view;
        pbr_image part = PBR_IMAGE_INIT;
        shifted.jitter[0] = 0.25 - 0.5 * right;
        shifted.jitter[1] = 0.5 * down - 0.25;
        done = studio_draw_truth(studio, &model, &shifted, 1, PBR_COLOUR_POINTS, &part);
        for (size_t i = 0; done && i < (size_t)48 * 32; i++)
            for (size_t k = 0; k < 4; k++) {
                const size_t at = (2 * (i / 48) + down) * 96 + 2 * (i % 48) + right;
                largest = fmax(largest, fabs((double)part.rgba[4 * i + k] - (double)fine.rgba[4 * at + k]));
            }
        pbr_image_destroy(studio->session.instance, &part);
    }
    pbr_image_destroy(studio->session.instance, &fine);
    model_release(&model);
    return done && expect(studio, "shifted pictures", largest, 0, 1e-5);
}

bool quality_self_test(struct studio *studio) {
    const bool spectrum = test_spectrum(studio), filter = test_filter(studio), shifts = test_shifts(studio);
    return spectrum && filter && shifts;
}
