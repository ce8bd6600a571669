/* The measures of `pbr compare` against closed forms. SPDX-License-Identifier: MIT */
#include "../../tools/comparison.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <string.h>

#include <cmocka.h>

/* Floats' rounding in both directions of the sRGB conversion. */
static const double tiny = 1e-6;

static void assert_near(double value, double wanted, double tolerance) {
    if (!(fabs(value - wanted) <= tolerance)) fail_msg("%.12g is not %.12g", value, wanted);
}

static float decode(double c) {
    return (float)(c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4));
}

struct pair {
    pbr_instance *instance;
    pbr_image pictures[2];
};

static struct pair make_pair(uint32_t width, uint32_t height) {
    struct pair pair = {.pictures = {PBR_IMAGE_INIT, PBR_IMAGE_INIT}};
    assert_int_equal(pbr_instance_create(NULL, &pair.instance), PBR_OK);
    for (int p = 0; p < 2; p++) assert_int_equal(pbr_image_create(pair.instance, width, height, 0, &pair.pictures[p]), PBR_OK);
    return pair;
}

static void end_pair(struct pair *pair) {
    for (int p = 0; p < 2; p++) pbr_image_destroy(pair->instance, &pair->pictures[p]);
    assert_int_equal(pbr_instance_destroy(&pair->instance), PBR_OK);
}

static void set_pixel(pbr_image *picture, size_t i, const double srgb[3], float alpha) {
    for (int k = 0; k < 3; k++) picture->rgba[4 * i + k] = decode(srgb[k]) * alpha;
    picture->rgba[4 * i + 3] = alpha;
}

static void fill(pbr_image *picture, double r, double g, double b) {
    for (size_t i = 0; i < (size_t)picture->width * picture->height; i++) set_pixel(picture, i, (double[3]){r, g, b}, 1);
}

/* sRGB values, the same in every run (Park & Miller 1988). */
static void fill_noise(pbr_image *picture, uint64_t seed) {
    for (size_t i = 0; i < (size_t)picture->width * picture->height; i++) {
        double c[3];
        for (int k = 0; k < 3; k++) c[k] = (double)(seed = seed * 48271 % 2147483647) / 2147483647;
        set_pixel(picture, i, c, 1);
    }
}

static struct comparison measure(struct pair *pair, const float *background) {
    struct comparison comparison;
    assert_int_equal(comparison_make(pair->instance, pair->pictures, background, 16, &comparison), PBR_OK);
    return comparison;
}

static void equal_pictures_differ_in_nothing(void **state) {
    (void)state;
    struct pair pair = make_pair(20, 15);
    for (int p = 0; p < 2; p++) fill_noise(&pair.pictures[p], 7);
    struct comparison c = measure(&pair, NULL);
    assert_true(isinf(comparison_psnr(&c)) && comparison_psnr(&c) > 0);
    assert_true(c.mean_square == 0 && c.mean_square_linear == 0 && c.largest == 0);
    assert_near(c.ssim, 1, 1e-12);
    assert_int_equal(c.covered[0], c.covered[1]);
    assert_int_equal(c.covered_only[0] + c.covered_only[1], 0);
    assert_int_equal(c.far_apart, 0);
    end_pair(&pair);
}

/* Levels of 8 bits: more than 16 are 17. One channel is enough, and a pixel counts once. */
static void pixels_far_apart_are_counted(void **state) {
    (void)state;
    struct pair pair = make_pair(16, 12);
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 0.5, 0.5, 0.5);
    for (int level = 0; level < 40; level++)
        for (int p = 0; p < 2; p++)
            set_pixel(&pair.pictures[p], 2 * (size_t)level + 1,
                      (double[3]){0.5, (60 + p * level) / 255.0, (200 - p * level) / 255.0}, 1);
    const struct comparison c = measure(&pair, NULL);
    assert_int_equal(c.far_apart, 39 - 16);
    end_pair(&pair);
}

/* An offset of 0.1 in every encoded channel: 20 dB, 25.5 of 255; SSIM without variance is its luminance term alone. */
static void constant_offset_has_its_closed_form(void **state) {
    (void)state;
    struct pair pair = make_pair(16, 12);
    fill(&pair.pictures[0], 0.5, 0.5, 0.5);
    fill(&pair.pictures[1], 0.6, 0.6, 0.6);
    struct comparison c = measure(&pair, NULL);
    assert_near(comparison_psnr(&c), 20, 1e-4);
    assert_near(255 * sqrt(c.mean_square), 25.5, 1e-3);
    assert_near(sqrt(c.mean_square_linear), (double)decode(0.6) - (double)decode(0.5), tiny);
    assert_near(c.largest, 0.1, tiny);
    assert_near(c.ssim, (2 * 0.5 * 0.6 + 1e-4) / (0.5 * 0.5 + 0.6 * 0.6 + 1e-4), tiny);
    end_pair(&pair);
}

static void one_wrong_channel_is_found_and_weighed(void **state) {
    (void)state;
    struct pair pair = make_pair(30, 20);
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 0.25, 0.25, 0.25);
    set_pixel(&pair.pictures[1], 13 * 30 + 8, (double[3]){0.25, 0.75, 0.25}, 1);
    struct comparison c = measure(&pair, NULL);
    assert_int_equal(c.x, 8);
    assert_int_equal(c.y, 13);
    assert_int_equal(c.channel, 1);
    assert_near(c.values[0], 0.25, tiny);
    assert_near(c.values[1], 0.75, tiny);
    assert_near(c.mean_square, 0.5 * 0.5 / (3 * 30 * 20), tiny * c.mean_square * 10);
    assert_int_equal(c.covered[0], 0);
    assert_int_equal(c.covered_only[1], 1);
    end_pair(&pair);
}

/* Every window summed directly, without splitting it into rows and columns. */
static double direct_ssim(const pbr_image pictures[2]) {
    const uint32_t width = pictures[0].width, height = pictures[0].height;
    double total = 0;
    for (uint32_t y = 0; y + 11 <= height; y++)
        for (uint32_t x = 0; x + 11 <= width; x++) {
            double weight_sum = 0, mean[2] = {0, 0}, square[2] = {0, 0}, product = 0;
            for (int i = 0; i < 121; i++) {
                int dx = i % 11 - 5, dy = i / 11 - 5;
                double weight = exp(-(dx * dx + dy * dy) / 4.5), l[2];
                size_t at = 4 * ((y + 5 + (size_t)dy) * width + x + 5 + (size_t)dx);
                for (int p = 0; p < 2; p++) {
                    double encoded[3];
                    for (int k = 0; k < 3; k++) {
                        double v = (double)pictures[p].rgba[at + (size_t)k];
                        encoded[k] = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
                    }
                    l[p] = 0.299 * encoded[0] + 0.587 * encoded[1] + 0.114 * encoded[2];
                    mean[p] += weight * l[p];
                    square[p] += weight * l[p] * l[p];
                }
                product += weight * l[0] * l[1];
                weight_sum += weight;
            }
            double a = mean[0] / weight_sum, b = mean[1] / weight_sum;
            double va = square[0] / weight_sum - a * a, vb = square[1] / weight_sum - b * b, vab = product / weight_sum - a * b;
            total += (2 * a * b + 1e-4) * (2 * vab + 9e-4) / ((a * a + b * b + 1e-4) * (va + vb + 9e-4));
        }
    return total / ((width - 10) * (height - 10));
}

static void ssim_equals_the_sum_over_whole_windows(void **state) {
    (void)state;
    /* The smallest picture that has a window, wide, high, and larger than the rows that are kept. */
    const uint32_t sizes[][2] = {{11, 11}, {29, 11}, {12, 40}, {33, 27}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct pair pair = make_pair(sizes[i][0], sizes[i][1]);
        fill_noise(&pair.pictures[0], 1 + i);
        fill_noise(&pair.pictures[1], 100 + i);
        /* Half of both: neither equal nor unrelated. */
        for (size_t k = 0; k < 2 * (size_t)sizes[i][0] * sizes[i][1]; k++) pair.pictures[1].rgba[k] = pair.pictures[0].rgba[k];
        struct comparison c = measure(&pair, NULL);
        assert_near(c.ssim, direct_ssim(pair.pictures), tiny);
        assert_true(c.ssim > 0.2 && c.ssim < 0.9);
        end_pair(&pair);
    }
}

static void pictures_smaller_than_the_window_have_no_ssim(void **state) {
    (void)state;
    const uint32_t sizes[][2] = {{1, 1}, {10, 50}, {50, 10}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct pair pair = make_pair(sizes[i][0], sizes[i][1]);
        assert_true(isnan(measure(&pair, NULL).ssim));
        end_pair(&pair);
    }
}

static void transparency_tells_what_is_covered(void **state) {
    (void)state;
    struct pair pair = make_pair(4, 4);
    /* 0..9 in picture 0; 6..12 in picture 1, some of it barely. */
    for (size_t i = 0; i < 10; i++) set_pixel(&pair.pictures[0], i, (double[3]){0, 0, 0}, 1);
    for (size_t i = 6; i < 13; i++) set_pixel(&pair.pictures[1], i, (double[3]){1, 0, 0}, 1 / 255.f);
    struct comparison c = measure(&pair, (float[3]){0, 0, 0});
    assert_true(c.by_alpha);
    assert_int_equal(c.covered[0], 10);
    assert_int_equal(c.covered[1], 7);
    assert_int_equal(c.covered_only[0], 6);
    assert_int_equal(c.covered_only[1], 3);
    end_pair(&pair);
}

static void background_tells_what_is_covered_where_all_is_opaque(void **state) {
    (void)state;
    struct pair pair = make_pair(5, 1);
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 0.1, 0.1, 0.12);
    set_pixel(&pair.pictures[0], 1, (double[3]){0.1, 0.1, 0.12 + 1.0 / 255}, 1);  /* a step of 8 bits */
    set_pixel(&pair.pictures[0], 2, (double[3]){0.1, 0.1, 0.12 + 0.45 / 255}, 1); /* rounding */
    set_pixel(&pair.pictures[1], 4, (double[3]){0.9, 0.1, 0.12}, 1);
    struct comparison c = measure(&pair, NULL);
    assert_false(c.by_alpha);
    assert_near((double)c.background[2], 0.12, tiny);
    assert_int_equal(c.covered_only[0], 1);
    assert_int_equal(c.covered_only[1], 1);
    /* Another background: all but the pixel that has it. */
    c = measure(&pair, (float[3]){0.9f, 0.1f, 0.12f});
    assert_int_equal(c.covered[0], 5);
    assert_int_equal(c.covered[1], 4);
    assert_int_equal(c.covered_only[0], 1);
    end_pair(&pair);
}

static void numbers_that_are_not_finite_count_as_zero(void **state) {
    (void)state;
    struct pair pair = make_pair(12, 12);
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 0, 0, 0);
    pair.pictures[0].rgba[4] = NAN;
    pair.pictures[1].rgba[9] = INFINITY;
    struct comparison c = measure(&pair, NULL);
    assert_int_equal(c.not_finite, 2);
    assert_true(c.mean_square == 0 && c.mean_square_linear == 0);
    end_pair(&pair);
}

static void brighter_than_white_counts_in_linear_only(void **state) {
    (void)state;
    struct pair pair = make_pair(2, 1);
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 1, 1, 1);
    pair.pictures[1].rgba[0] = 4;
    struct comparison c = measure(&pair, NULL);
    assert_true(c.mean_square == 0);
    assert_near(c.mean_square_linear, 9.0 / 6, tiny);
    end_pair(&pair);
}

static void picture_of_differences_shows_them(void **state) {
    (void)state;
    struct pair pair = make_pair(3, 1);
    pbr_image difference = PBR_IMAGE_INIT;
    for (int p = 0; p < 2; p++) fill(&pair.pictures[p], 0.5, 0.5, 0.5);
    set_pixel(&pair.pictures[1], 1, (double[3]){0.5, 0.7, 0.5}, 1); /* the largest: white */
    set_pixel(&pair.pictures[1], 2, (double[3]){0.4, 0.5, 0.5}, 1); /* half of it */
    struct comparison c = measure(&pair, NULL);
    assert_int_equal(comparison_picture(pair.instance, pair.pictures, &c, false, &difference), PBR_OK);
    const double wanted[12] = {0, 0, 0, 1, 0, 1, 0, 1, (double)decode(0.5), 0, 0, 1};
    for (int i = 0; i < 12; i++) assert_near((double)difference.rgba[i], wanted[i], 1e-5);
    pbr_image_destroy(pair.instance, &difference);

    assert_int_equal(comparison_picture(pair.instance, pair.pictures, &c, true, &difference), PBR_OK);
    assert_near((double)difference.rgba[5], (double)decode(0.5) - (double)decode(0.7), tiny);
    assert_near((double)difference.rgba[8], (double)decode(0.5) - (double)decode(0.4), tiny);
    pbr_image_destroy(pair.instance, &difference);
    end_pair(&pair);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_pictures_differ_in_nothing),
        cmocka_unit_test(pixels_far_apart_are_counted),
        cmocka_unit_test(constant_offset_has_its_closed_form),
        cmocka_unit_test(one_wrong_channel_is_found_and_weighed),
        cmocka_unit_test(ssim_equals_the_sum_over_whole_windows),
        cmocka_unit_test(pictures_smaller_than_the_window_have_no_ssim),
        cmocka_unit_test(transparency_tells_what_is_covered),
        cmocka_unit_test(background_tells_what_is_covered_where_all_is_opaque),
        cmocka_unit_test(numbers_that_are_not_finite_count_as_zero),
        cmocka_unit_test(brighter_than_white_counts_in_linear_only),
        cmocka_unit_test(picture_of_differences_shows_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
