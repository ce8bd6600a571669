/* Filling holes: centres bring colours to the pixels that splats mark. SPDX-License-Identifier: MIT */
#include "support.h"

static pbr_item filled_item(const pbr_points *points, uint32_t splat) {
    pbr_item item = plain_item(points, splat);
    item.blending = PBR_BLEND_FILL;
    return item;
}

static void draw_filled(struct stage *stage, const struct surfel_data *discs, size_t count, uint32_t splat) {
    pbr_points *points = make_points(stage->instance, discs, count);
    const pbr_item item = filled_item(points, splat);
    draw(stage, &item, 1);
    pbr_points_release(&points);
}

static void expect_colour(const struct stage *stage, int x, int y, double red, double green) {
    const float *c = colour_at(stage, x, y);
    /* Colours of pictures are floats. */
    if (fabs((double)c[0] - red) > 1e-6 || fabs((double)c[1] - green) > 1e-6)
        fail_msg("(%d, %d): %g %g, not %g %g", x, y, (double)c[0], (double)c[1], red, green);
}

/* A disc face on, of that centre and radius in pixels, at that distance under look(32). */
static struct surfel_data face_on(double x, double y, double radius, double distance, int channel) {
    struct surfel_data disc = {
        {(x - 32) / 32 * distance, (y - 32) / 32 * distance, -distance}, {0, 0, 1}, (float)(radius / 32 * distance), {0, 0, 0}};
    disc.colour[channel] = 1;
    return disc;
}

/* ---- what is marked ---- */

/* Whether or not its centre lies in a pixel that it covers, in the picture, or before the eye. */
static void one_splat_alone_is_drawn_as_its_kind_is(void **state) {
    struct surfel_data discs[] = {
        {{0.31, -0.22, -4}, {0, 0, 1}, 1.7f, {1, 0, 1}},   {{0.4, 0.3, -2}, {1, 0.3, 0.8}, 0.8f, {1, 0, 1}},
        {{0.4, 0.3, -2}, {1, 0.3, 0.8}, 0.04f, {1, 0, 1}}, {{0.01, 0.02, -2}, {0.3, 0, 1}, 0, {1, 0, 1}},
        {{2.2, -1, -2}, {0.3, 0, 1}, 0.5f, {1, 0, 1}},     {{0, -0.8, 0}, {0.02, 1, 0}, 5, {1, 0, 1}},
        {{0, -0.3, -0.4}, {0.1, 1, 0.4}, 0.3f, {1, 0, 1}}, {{0.55 / 16, 0, -2}, {0, 0, 1}, 0.9f / 16, {1, 0, 1}},
        {{0, 0, -1.2}, {0.4, -0.2, -1}, 0.9f, {1, 0, 1}},  {{-1, 1, -2}, {0, 0, 0}, 0.3f, {1, 0, 1}},
    };
    static struct pixels usual;
    struct stage stage;
    int covered = 0;
    (void)state;
    stage_open(&stage, 1);
    for (size_t i = 0; i < COUNT(discs); i++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++) {
            pbr_points *points = make_points(stage.instance, &discs[i], 1);
            pbr_item item = plain_item(points, splat);
            draw(&stage, &item, 1);
            keep_pixels(&stage, &usual);
            covered += count_covered(&stage) > 0;
            item.blending = PBR_BLEND_FILL;
            draw(&stage, &item, 1);
            expect_pixels(&stage, &usual);
            pbr_points_release(&points);
        }
    assert_in_range(covered, 20, 29); /* some see nothing of it */
    stage_close(&stage);
}

/* The front's: of the surface that is nearer once moved back, which the narrower of two is. */
static void depth_is_the_fronts(void **state) {
    const struct surfel_data discs[] = {face_on(30, 32, 8, 4, 0), face_on(34, 32, 2, 4.1, 1)};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++) {
        draw_filled(&stage, discs, 2, splat);
        for (int x = 24; x < 36; x++) assert_true(fabs(depth_at(&stage, x, 32) - (x < 32 ? 4 : 4.1)) < 1e-6);
    }
    stage_close(&stage);
}

/* ---- means ---- */

/* Of a sample in a pixel that far away. */
static double weight(double dx, double dy, double radius) {
    return dx * dx + dy * dy <= radius * radius ? exp(-2 * (dx * dx + dy * dy) / (radius * radius)) : 0;
}

/* Two centres of green lie in one pixel. The narrower splats are before the wide one, and have their own radius. */
static void pixels_are_gaussian_means_of_the_centres_around_them(void **state) {
    static const double wide = 7.3, narrow = 4.3;
    const struct surfel_data discs[] = {face_on(28.3, 31.8, wide, 4, 0), face_on(36.1, 34.2, narrow, 4, 1),
                                        face_on(36.7, 34.9, narrow, 4, 1)};
    static const uint32_t kinds[] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE};
    struct stage stage;
    int mixed = 0, alone = 0;
    (void)state;
    stage_open(&stage, 1);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        draw_filled(&stage, discs, 3, kinds[i]);
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                const bool red = hypot(x + 0.5 - 28.3, y + 0.5 - 31.8) <= wide;
                const bool green = fmin(hypot(x + 0.5 - 36.1, y + 0.5 - 34.2), hypot(x + 0.5 - 36.7, y + 0.5 - 34.9)) <= narrow;
                const double radius = green ? narrow : wide;
                const double r = weight(x - 28, y - 31, radius), g = 2 * weight(x - 36, y - 34, radius);
                assert_int_equal(is_covered(&stage, x, y), red || green);
                if (!red && !green) continue;
                if (r + g > 0) expect_colour(&stage, x, y, r / (r + g), g / (r + g));
                else expect_colour(&stage, x, y, green ? 0 : 1, green ? 1 : 0);
                mixed += r > 0 && g > 0;
                alone += r + g == 0;
            }
    }
    assert_true(mixed > 20 && alone > 0);
    stage_close(&stage);
}

/* A disc of 0.3 pixel in the corner of a pixel covers no pixel's centre, but brings its colour to the pixel. */
static void a_splat_need_not_cover_the_pixel_that_it_colours(void **state) {
    const struct surfel_data discs[] = {face_on(30.5, 32.5, 3.3, 4, 0), face_on(32.05, 32.05, 0.3, 4, 1)};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    draw_filled(&stage, discs, 2, PBR_SPLAT_ELLIPSE);
    for (int x = 28; x <= 33; x++) {
        const double r = weight(x - 30, 0, 3.3), g = weight(x - 32, 0, 3.3);
        expect_colour(&stage, x, 32, r / (r + g), g / (r + g));
    }
    stage_close(&stage);
}

/* Outside the picture, or outside the scissor box. */
static void centres_outside_bring_no_colour(void **state) {
    const struct surfel_data discs[] = {face_on(3.5, 32.5, 6.3, 4, 0), face_on(-1.5, 32.5, 6.3, 4, 1)};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    draw_filled(&stage, discs, 2, PBR_SPLAT_CIRCLE);
    for (int x = 0; x < 9; x++) expect_colour(&stage, x, 32, 1, 0);
    stage.frame.flags = PBR_FRAME_SCISSOR;
    memcpy(stage.frame.scissor, (int32_t[]){4, 0, SIZE, SIZE}, sizeof stage.frame.scissor);
    const struct surfel_data others[] = {discs[0], face_on(6.5, 32.5, 6.3, 4, 1)};
    draw_filled(&stage, others, 2, PBR_SPLAT_CIRCLE);
    for (int x = 4; x < 12; x++) expect_colour(&stage, x, 32, 0, 1);
    memcpy(stage.frame.scissor, (int32_t[]){0, 0, 6, SIZE}, sizeof stage.frame.scissor);
    draw_filled(&stage, others, 2, PBR_SPLAT_CIRCLE);
    for (int x = 0; x < 6; x++) expect_colour(&stage, x, 32, 1, 0);
    assert_false(is_covered(&stage, 6, 32));
    stage_close(&stage);
}

/* A floor whose centre is behind the eye has no radius in pixels. A centre on it, of nothing that covers, changes nothing. */
static void splats_around_the_eye_keep_their_colour(void **state) {
    const struct surfel_data discs[] = {{{0, -1, 1}, {0, 1, 0}, 6, {1, 0, 0}}, {{0, -1.01, -3}, {0, 1, 0}, 0, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    draw_filled(&stage, discs, 2, PBR_SPLAT_ELLIPSE);
    for (int y = 16; y < 24; y++) expect_colour(&stage, 32, y, 1, 0);
    stage_close(&stage);
}

/* From 16 pixels on splats are seen as they are: the first of those in one plane. */
static void larger_splats_than_16_pixels_keep_their_colour(void **state) {
    const double radii[] = {2, 2.01}; /* of 8 pixels to the unit */
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (int i = 0; i < 2; i++) {
        struct surfel_data discs[] = {face_on(28.5, 32.5, 1, 4, 0), face_on(36.5, 32.5, 1, 4, 1)};
        discs[0].radius = discs[1].radius = (float)radii[i];
        draw_filled(&stage, discs, 2, PBR_SPLAT_ELLIPSE);
        for (int x = 13; x < 52; x++) {
            const double r = weight(x - 28, 0, 16), g = weight(x - 36, 0, 16);
            if (i == 0) expect_colour(&stage, x, 32, r / (r + g), g / (r + g));
            else expect_colour(&stage, x, 32, x < 45 ? 1 : 0, x < 45 ? 0 : 1);
        }
    }
    stage_close(&stage);
}

/* ---- what belongs together ---- */

/* Face on, epsilon is half the radius of ellipses, twice that of what is parallel to the screen. */
static void a_centre_counts_as_far_back_as_epsilon(void **state) {
    struct surfel_data discs[] = {{{0, 0, -4}, {0, 0, 1}, 0.2f, {1, 0, 0}}, {{0, 0, 0}, {0, 0, 1}, 0.4f, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    stage.frame.jitter[0] = stage.frame.jitter[1] = 0.5;
    for (int parallel = 0; parallel < 2; parallel++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++)
            for (int behind = 0; behind < 2; behind++) {
                if (parallel) look_parallel(&stage, 32);
                else look(&stage, 128);
                const double epsilon = splat == PBR_SPLAT_ELLIPSE ? 0.1 : 0.4;
                discs[1].position[2] = -4 - epsilon * (behind ? 1.002 : 0.998);
                draw_filled(&stage, discs, 2, splat);
                expect_colour(&stage, 32, 32, behind ? 1 : 0.5, behind ? 0 : 0.5);
                assert_true(fabs(depth_at(&stage, 32, 32) - 4) < 1e-6);
            }
    stage_close(&stage);
}

/* Two squares side by side, the right one farther: from epsilon on, which is twice the radius without normals, neither takes the
 * other's colour. */
static void pixels_share_centres_where_their_extents_overlap(void **state) {
    static const double radius = 3.2, epsilon = 0.8;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (int apart = 0; apart < 2; apart++) {
        struct surfel_data discs[] = {face_on(20.5, 32.5, radius, 4, 0),
                                      face_on(24.5, 32.5, radius, 4 + epsilon * (apart ? 1.002 : 0.998), 1)};
        for (int i = 0; i < 2; i++) discs[i].normal[2] = 0;
        draw_filled(&stage, discs, 2, PBR_SPLAT_SQUARE);
        for (int x = 17; x <= 27; x++) {
            const double r = weight(x - 20, 0, radius), g = weight(x - 24, 0, radius);
            if (!apart) expect_colour(&stage, x, 32, r / (r + g), g / (r + g));
            else expect_colour(&stage, x, 32, x < 24 ? 1 : 0, x < 24 ? 0 : 1);
        }
    }
    stage_close(&stage);
}

/* A green wall of many centres behind a red disc. */
static void hidden_centres_do_not_bleed(void **state) {
    enum { WALL = 20 };
    static struct surfel_data discs[WALL * WALL + 1];
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (int i = 0; i < WALL * WALL; i++) discs[i] = face_on(12.2 + 2 * (i % WALL), 12.7 + 2 * (i / WALL), 2.6, 6, 1);
    discs[WALL * WALL] = face_on(31.7, 33.1, 6.4, 4, 0);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++) {
        draw_filled(&stage, discs, COUNT(discs), splat);
        for (int y = 14; y < 50; y++)
            for (int x = 14; x < 50; x++) {
                const double dx = fabs(x + 0.5 - 31.7), dy = fabs(y + 0.5 - 33.1);
                const bool red = (splat == PBR_SPLAT_SQUARE ? fmax(dx, dy) : hypot(dx, dy)) < 6.4;
                expect_colour(&stage, x, y, red, !red);
                assert_true(fabs(depth_at(&stage, x, y) - (red ? 4 : 6)) < 1e-5);
            }
    }
    stage_close(&stage);
}

/* Of whatever kind and shading. */
static void all_filled_items_are_one_layer(void **state) {
    const struct surfel_data discs[] = {face_on(30.5, 32.5, 4.3, 4, 0), face_on(33.5, 32.5, 4.3, 4, 1)};
    static struct pixels together;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points[] = {make_points(stage.instance, &discs[0], 1), make_points(stage.instance, &discs[1], 1)};
    draw_filled(&stage, discs, 2, PBR_SPLAT_CIRCLE);
    keep_pixels(&stage, &together);
    pbr_item items[] = {filled_item(points[0], PBR_SPLAT_CIRCLE), filled_item(points[1], PBR_SPLAT_CIRCLE)};
    for (uint32_t shading = PBR_SHADE_PHONG; shading <= PBR_SHADE_PHONG_FIELD; shading++) {
        items[1].shading = shading;
        items[1].material = (pbr_material){1, 0, 0, 1}; /* the colour as it is */
        draw(&stage, items, 2);
        expect_pixels(&stage, &together);
    }
    items[1].splat = PBR_SPLAT_ELLIPSE; /* the same face on, but for its depth's rounding */
    draw(&stage, items, 2);
    for (int x = 26; x < 38; x++)
        expect_colour(&stage, x, 32, (double)together.rgba[4 * pixel_at(&stage.image, x, 32)],
                      (double)together.rgba[4 * pixel_at(&stage.image, x, 32) + 1]);
    pbr_points_release(&points[0]);
    pbr_points_release(&points[1]);
    stage_close(&stage);
}

static void deferred_light_is_light_once_a_splat(void **state) {
    struct surfel_data discs[] = {{{0, 0, -4}, {0.3, -0.2, 1}, 0.7f, {1, 0, 0}}, {{0.2, 0.3, -4}, {-0.3, 0.2, 1}, 0.7f, {0, 1, 0}}};
    static struct pixels usual;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, discs, 2);
    pbr_item item = filled_item(points, PBR_SPLAT_ELLIPSE);
    item.shading = PBR_SHADE_PHONG;
    draw(&stage, &item, 1);
    keep_pixels(&stage, &usual);
    for (uint32_t shading = PBR_SHADE_DEFERRED; shading <= PBR_SHADE_PHONG_FIELD; shading++) {
        item.shading = shading;
        draw(&stage, &item, 1);
        expect_pixels(&stage, &usual);
    }
    item.shading = PBR_SHADE_NONE;
    draw(&stage, &item, 1);
    assert_memory_not_equal(stage.image.rgba, usual.rgba, sizeof usual.rgba);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* ---- among other layers ---- */

/* In whatever order the items come. */
static void filled_items_hide_and_are_hidden_by_depth(void **state) {
    enum { KINDS = PBR_SPLAT_EWA_MAX + 1 };
    const struct surfel_data near = face_on(32, 32, 8, 4, 0), far = face_on(32, 32, 15, 6, 1);
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points[] = {make_points(stage.instance, &near, 1), make_points(stage.instance, &far, 1)};
    for (uint32_t i = 0; i < 3 * KINDS * 4; i++) {
        const uint32_t filled = i % 3, other = i / 3 % KINDS;
        const bool filled_is_far = i / 3 / KINDS % 2, swapped = i / 3 / KINDS / 2;
        pbr_item items[2];
        items[swapped] = filled_item(points[filled_is_far], filled);
        items[!swapped] = plain_item(points[!filled_is_far], other);
        draw(&stage, items, 2);
        expect_colour(&stage, 32, 32, 1, 0);
        expect_colour(&stage, 32 + 12, 32, 0, 1);
        assert_true(fabs(depth_at(&stage, 32, 32) - 4) < 1e-5 && fabs(depth_at(&stage, 32 + 12, 32) - 6) < 1e-5);
    }
    pbr_points_release(&points[0]);
    pbr_points_release(&points[1]);
    stage_close(&stage);
}

/* The layer is filled as it would be alone. */
static void what_another_item_hides_is_a_sample_yet(void **state) {
    const struct surfel_data discs[] = {face_on(30.5, 32.5, 4.3, 4, 0), face_on(33.5, 32.5, 4.3, 4, 1)};
    const struct surfel_data before = face_on(33.5, 32.5, 0.8, 2, 2);
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points[] = {make_points(stage.instance, discs, 2), make_points(stage.instance, &before, 1)};
    const pbr_item items[] = {filled_item(points[0], PBR_SPLAT_CIRCLE), plain_item(points[1], PBR_SPLAT_SQUARE)};
    draw(&stage, items, 2);
    for (int x = 27; x < 38; x++) {
        const double r = weight(x - 30, 0, 4.3), g = weight(x - 33, 0, 4.3);
        if (x == 33) assert_true(colour_at(&stage, x, 32)[2] == 1 && fabs(depth_at(&stage, x, 32) - 2) < 1e-6);
        else expect_colour(&stage, x, 32, r / (r + g), g / (r + g));
    }
    pbr_points_release(&points[0]);
    pbr_points_release(&points[1]);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_splat_alone_is_drawn_as_its_kind_is),
        cmocka_unit_test(depth_is_the_fronts),
        cmocka_unit_test(pixels_are_gaussian_means_of_the_centres_around_them),
        cmocka_unit_test(a_splat_need_not_cover_the_pixel_that_it_colours),
        cmocka_unit_test(centres_outside_bring_no_colour),
        cmocka_unit_test(splats_around_the_eye_keep_their_colour),
        cmocka_unit_test(larger_splats_than_16_pixels_keep_their_colour),
        cmocka_unit_test(a_centre_counts_as_far_back_as_epsilon),
        cmocka_unit_test(pixels_share_centres_where_their_extents_overlap),
        cmocka_unit_test(hidden_centres_do_not_bleed),
        cmocka_unit_test(all_filled_items_are_one_layer),
        cmocka_unit_test(deferred_light_is_light_once_a_splat),
        cmocka_unit_test(filled_items_hide_and_are_hidden_by_depth),
        cmocka_unit_test(what_another_item_hides_is_a_sample_yet),
    };
    return cmocka_run_group_tests_name("fill", tests, NULL, NULL);
}
