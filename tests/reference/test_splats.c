/* Each kind of splat covers the pixels, at the depths, that docs/splats.md says: closed forms, and rays cast without the library.
 * SPDX-License-Identifier: MIT */
#include "support.h"

/* Normals are stored to 6.5e-5 rad: along the axes exactly. Depths of pictures are floats. */
static const double DEPTH_TOLERANCE = 1e-6;

static const double origin[3];

static void expect_disc(const struct stage *stage, double cx, double cy, double radius, double depth) {
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            const bool covered = hypot(x + 0.5 - cx, y + 0.5 - cy) <= radius;
            assert_int_equal(is_covered(stage, x, y), covered);
            if (covered) assert_true(fabs(depth_at(stage, x, y) - depth) < DEPTH_TOLERANCE * depth);
            else assert_true(isinf(depth_at(stage, x, y)));
        }
}

static void a_disc_seen_face_on_is_a_disc_of_its_projected_radius(void **state) {
    static const struct surfel_data disc = {{0.31, -0.22, -4}, {0, 0, 1}, 1.7f, {1, 1, 1}};
    static const uint32_t kinds[] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE, PBR_SPLAT_GAUSSIAN};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        const pbr_item item = plain_item(points, kinds[i]);
        draw(&stage, &item, 1);
        expect_disc(&stage, 32 + 32 * 0.31 / 4, 32 - 32 * 0.22 / 4, 32 * (double)1.7f / 4, 4);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

static void a_square_has_its_projected_side_and_its_centres_depth(void **state) {
    static const struct surfel_data disc = {{0.31, -0.22, -4}, {1, 0, 0}, 1, {1, 1, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    const pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    draw(&stage, &item, 1);
    const double cx = 32 + 32 * 0.31 / 4, cy = 32 - 32 * 0.22 / 4, half = 32.0 / 4;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            const bool covered = fabs(x + 0.5 - cx) <= half && fabs(y + 0.5 - cy) <= half;
            assert_int_equal(is_covered(&stage, x, y), covered);
            if (covered) assert_true(fabs(depth_at(&stage, x, y) - 4) < 4 * DEPTH_TOLERANCE);
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* The least sizes: a square of one pixel covers exactly one centre wherever it is, and so does a circle, which fills it. */
static void points_without_extent_never_fall_between_pixels(void **state) {
    struct stage stage;
    uint64_t random = 5;
    (void)state;
    stage_open(&stage, 1);
    for (int i = 0; i < 50; i++) {
        const struct surfel_data dot_ = {{uniform(&random) - 0.5, uniform(&random) - 0.5, -2}, {0, 0, 0}, 0, {1, 1, 1}};
        pbr_points *points = make_points(stage.instance, &dot_, 1);
        pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), 1);
        item.size_minimum = 0.25f; /* OpenGL has no smaller points */
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), 1);
        item.splat = PBR_SPLAT_CIRCLE;
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), 1);
        item.size_minimum = 0;
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), 1);
        item.splat = PBR_SPLAT_ELLIPSE;
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), 0);
        item.size_minimum = 3;
        draw(&stage, &item, 1);
        assert_in_range(count_covered(&stage), 4, 9);
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* The disc, of no less than sqrt 2 across, cut to the square: one to four pixels at the least, and a disc from sqrt 2 on. */
static void a_circle_covers_a_pixel_and_no_more_than_a_square(void **state) {
    static const float diameters[] = {1, 1.1f, 1.25f, 1.4f, 1.4143f, 1.5f, 2, 3.7f};
    struct stage stage;
    uint64_t random = 6;
    (void)state;
    stage_open(&stage, 1);
    for (size_t i = 0; i < 30 * COUNT(diameters); i++) {
        const double cx = 28 + 8 * uniform(&random), cy = 28 + 8 * uniform(&random), half = (double)diameters[i / 30] / 2;
        const struct surfel_data disc = {{(cx - 32) / 16, (cy - 32) / 16, -2}, {0, 0, 0}, (float)(half / 16), {1, 1, 1}};
        pbr_points *points = make_points(stage.instance, &disc, 1);
        pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
        item.size_minimum = diameters[i / 30];
        draw(&stage, &item, 1);
        assert_true(count_covered(&stage) >= 1);
        for (int y = 24; y < 40; y++)
            for (int x = 24; x < 40; x++) {
                const double dx = x + 0.5 - cx, dy = y + 0.5 - cy;
                const bool in_disc = hypot(dx, dy) <= fmax(half, sqrt(0.5) + 1e-9), in_square = fmax(fabs(dx), fabs(dy)) < half;
                assert_int_equal(is_covered(&stage, x, y), in_disc && (half > 0.7072 || in_square));
            }
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

static void sizes_are_held_within_their_limits(void **state) {
    static const struct surfel_data disc = {{0, 0, -2}, {0, 0, 1}, 0.5f, {1, 1, 1}}; /* 16 pixels */
    static const struct {
        float scale, low, high;
        double diameter;
    } cases[] = {{0, 0, 0, 16}, {2, 0, 0, 32}, {0.5f, 0, 0, 8}, {0, 20, 0, 20}, {0, 0, 10, 10}, {2, 0, 30, 30}, {1, 5, 50, 16}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    for (size_t i = 0; i < COUNT(cases); i++)
        for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_GAUSSIAN; kind++) {
            pbr_item item = plain_item(points, kind);
            item.radius_scale = cases[i].scale;
            item.size_minimum = cases[i].low;
            item.size_maximum = cases[i].high;
            draw(&stage, &item, 1);
            if (kind != PBR_SPLAT_SQUARE) expect_disc(&stage, 32, 32, cases[i].diameter / 2, 2);
            else assert_int_equal(count_covered(&stage), (int)(cases[i].diameter * cases[i].diameter));
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* Expects the pixels that rays from the eye hit; those within rounding of the rim (the stored normal's error moves it) may differ.
 */
static void expect_cast(const struct stage *stage, double f, const struct surfel_data *disc) {
    const double rim = 5e-4;
    int hits = 0;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            double along[3];
            pixel_ray(f, x, y, along);
            const struct hit hit = cast(origin, along, disc);
            const bool covered = hit.t >= 0.5 && hit.t <= 1000 && hit.rho <= 1;
            if (fabs(hit.rho - 1) < rim || fabs(hit.t - 0.5) < rim) continue;
            assert_int_equal(is_covered(stage, x, y), covered);
            if (covered) assert_true(fabs(depth_at(stage, x, y) - hit.t) < 1e-3 * hit.t);
            hits += covered;
        }
    assert_true(hits > 20);
}

static void tilted_discs_are_where_rays_meet_them(void **state) {
    struct surfel_data discs[] = {
        {{0.4, 0.3, -2}, {1, 0.3, 0.8}, 0.8f, {1, 1, 1}}, {{-1.5, 1.2, -2}, {-1, 1, 0.2}, 1, {1, 1, 1}},
        {{0, -1, -3}, {0, 1, 0.05}, 6, {1, 1, 1}},       /* a floor through the eye's plane and the near plane */
        {{0, -0.8, 0}, {0.02, 1, 0}, 5, {1, 1, 1}},      /* one whose centre is below the eye */
        {{3, 0, 5}, {1, 0.1, 0.03}, 30, {1, 1, 1}},      /* a wall whose centre is behind it */
        {{0, 0, -1.2}, {0.4, -0.2, -1}, 0.9f, {1, 1, 1}} /* from behind */
    };
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (size_t i = 0; i < COUNT(discs); i++) {
        unit(discs[i].normal);
        pbr_points *points = make_points(stage.instance, &discs[i], 1);
        for (uint32_t kind = PBR_SPLAT_ELLIPSE; kind <= PBR_SPLAT_GAUSSIAN; kind++) {
            const pbr_item item = plain_item(points, kind);
            draw(&stage, &item, 1);
            expect_cast(&stage, 32, &discs[i]);
        }
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* It faces the eye, not the picture: off the axis it is an ellipse. */
static void a_disc_without_a_normal_faces_the_eye(void **state) {
    struct surfel_data disc = {{1.4, -1.1, -2}, {0, 0, 0}, 0.6f, {1, 1, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    const pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
    draw(&stage, &item, 1);
    for (int k = 0; k < 3; k++) disc.normal[k] = -disc.position[k];
    expect_cast(&stage, 32, &disc);
    pbr_points_release(&points);
    stage_close(&stage);
}

static void the_nearest_opaque_splat_is_seen(void **state) {
    struct surfel_data discs[] = {{{0, 0, -3}, {0, 0, 1}, 2, {1, 0, 0}}, {{0, 0, -3}, {0.6, 0, 0.8}, 2, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, discs, 2);
    const pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
    draw(&stage, &item, 1);
    for (int x = 20; x < 44; x++) { /* they cross in the middle; to the right the tilted one is behind */
        const bool right = x >= 32;
        assert_true(colour_at(&stage, x, 32)[right ? 1 : 0] < 0.01f);
        assert_true(colour_at(&stage, x, 32)[right ? 0 : 1] > 0.99f);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* More points than are held at once, in one corner of the picture: each is a pixel, and the nearest is seen. */
static void a_crowd_is_drawn_as_few_are(void **state) {
    enum { CROWD = 300000, CORNER = 20 };
    struct surfel_data *dots = calloc(CROWD, sizeof *dots);
    double nearest[CORNER][CORNER];
    struct stage stage;
    uint64_t random = 8;
    (void)state;
    stage_open(&stage, 2);
    look_parallel(&stage, 1);
    assert_non_null(dots);
    for (int i = 0; i < CORNER * CORNER; i++) nearest[i / CORNER][i % CORNER] = INFINITY;
    for (int i = 0; i < CROWD; i++) {
        const double x = CORNER * uniform(&random), y = CORNER * uniform(&random), z = 1 + (int)(1000 * uniform(&random)) / 8.0;
        dots[i].position[0] = x - SIZE / 2;
        dots[i].position[1] = y - SIZE / 2;
        dots[i].position[2] = -z;
        nearest[(int)y][(int)x] = fmin(nearest[(int)y][(int)x], z);
    }
    pbr_points *points = make_points(stage.instance, dots, CROWD);
    const pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    draw(&stage, &item, 1);
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            if (x >= CORNER || y >= CORNER) assert_false(is_covered(&stage, x, y));
            else assert_true(depth_at(&stage, x, y) == nearest[y][x]);
        }
    pbr_points_release(&points);
    free(dots);
    stage_close(&stage);
}

/* ---- ewa ---- */

static const uint32_t filtered[] = {PBR_SPLAT_EWA, PBR_SPLAT_EWA_MAX};

/* A disc alone, from far below a pixel on, at every tilt: the same pixels at the same depths, whatever the low-pass. */
static void a_filtered_splat_covers_its_disc_as_a_gaussian_does(void **state) {
    static const double radii[] = {0.05, 0.2, 0.6, 1.5, 8};
    static struct pixels usual;
    struct stage stage;
    uint64_t random = 77;
    int covered = 0;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 800);
    for (int i = 0; i < 100; i++) {
        struct surfel_data disc = {
            {uniform(&random) - 0.5, uniform(&random) - 0.5, -100}, {0}, (float)(radii[i % 5] / 8), {1, 1, 1}};
        for (int k = 0; k < 3; k++) disc.normal[k] = uniform(&random) - 0.5;
        pbr_points *points = make_points(stage.instance, &disc, 1);
        pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
        draw(&stage, &item, 1);
        covered += count_covered(&stage);
        keep_pixels(&stage, &usual);
        for (size_t k = 0; k < 3 * COUNT(filtered); k++) {
            item.splat = filtered[k % 2];
            item.low_pass = (float[]){0, 0.1f, 16}[k / 2];
            draw(&stage, &item, 1);
            expect_pixels(&stage, &usual);
        }
        pbr_points_release(&points);
    }
    assert_true(covered > 1000);
    stage_close(&stage);
}

/* Large, near and aslant, where an ellipse around the projected centre would fall short of the disc by more than the low-pass. */
static void an_ewa_splat_has_weight_wherever_it_covers(void **state) {
    struct surfel_data disc = {{0, 0, -4}, {0.8, 0, 0.6}, 0.45f, {1, 1, 1}};
    struct stage stage;
    int beyond = 0;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 250);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    const pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    draw(&stage, &item, 1);
    const double tall = 250 * (double)disc.radius / 4, wide = 0.6 * tall;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            double along[3];
            pixel_ray(250, x, y, along);
            const double dx = x + 0.5 - 32, dy = y + 0.5 - 32, rho = cast(origin, along, &disc).rho;
            if (fabs(rho - 1) < 1e-3) continue; /* the stored normal's rounding */
            assert_int_equal(is_covered(&stage, x, y), rho < 1);
            beyond += rho < 1 && dx * dx / (wide * wide + 4) + dy * dy / (tall * tall + 4) > 1;
        }
    assert_true(beyond > 5);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* Of two discs in one plane the second one's colour over the first's, at the pixel (32, 32). */
static double ratio_of_two(struct stage *stage, const struct surfel_data discs[2], const pbr_item *like) {
    pbr_points *points = make_points(stage->instance, discs, 2);
    pbr_item item = *like;
    item.points = points;
    draw(stage, &item, 1);
    pbr_points_release(&points);
    return (double)(colour_at(stage, 32, 32)[1] / colour_at(stage, 32, 32)[0]);
}

/* The weight of a disc of that radius in pixels seen face on, so far from its centre, times 1 / that of a gaussian of 1000 pixels,
 * read from the two blended. The latter is so near that it is a gaussian. */
static void expect_weights(uint32_t splat, double (*weight)(double radius, double away, double low_pass)) {
    static const double radii[] = {0.1, 0.6, 1, 2.5}, low_passes[] = {0, 0.04, 0.25, 4, 16};
    struct stage stage;
    stage_open(&stage, 1);
    look(&stage, 320);
    stage.frame.jitter[1] = 0.5;
    for (size_t i = 0; i < COUNT(radii) * COUNT(low_passes); i++) {
        const double radius = radii[i % COUNT(radii)], low_pass = low_passes[i / COUNT(radii)];
        const struct surfel_data discs[] = {{{0, 0, -4}, {0, 0, 1}, (float)(1000 / 80.0), {1, 0, 0}},
                                            {{0, 0, -4}, {0, 0, 1}, (float)(radius / 80), {0, 1, 0}}};
        pbr_item item = plain_item(NULL, splat);
        item.low_pass = (float)low_pass;
        for (double away = 0.013; away < 9; away += 0.21) {
            stage.frame.jitter[0] = 0.5 - away;
            const double wanted = weight(radius, away, low_pass == 0 ? 1 : low_pass) / exp(-2 * away * away / 1e6);
            /* Radii, the low-pass and colours are floats. */
            assert_true(fabs(ratio_of_two(&stage, discs, &item) - wanted) < 1e-6 + 1e-5 * wanted);
        }
    }
    stage_close(&stage);
}

static double ewa_weight(double radius, double away, double low_pass) {
    const double v = radius * radius, blurred = v + 4 * low_pass;
    return away * away <= blurred ? v / blurred * exp(-2 * away * away / blurred) : 0;
}
static void ewa_is_convolved_with_a_low_pass_of_its_variance(void **state) {
    (void)state;
    expect_weights(PBR_SPLAT_EWA, ewa_weight);
}

static double ewa_max_weight(double radius, double away, double low_pass) {
    const double least = fmin(away * away / (radius * radius), away * away / (4 * low_pass));
    return least <= 1 ? exp(-2 * least) : 0;
}
static void ewa_max_is_the_larger_of_the_disc_and_the_low_pass(void **state) {
    (void)state;
    expect_weights(PBR_SPLAT_EWA_MAX, ewa_max_weight);
}

/* Tilted, with a part between the planes: the centre lies just before the near plane at 0.5, or behind the far one at 1000. */
static void filtered_splats_with_centres_outside_the_planes_are_gaussians(void **state) {
    static const struct { double focal, distance, radius; } cases[] = {{200, 0.48, 0.05}, {8000, 1000.5, 3}};
    static struct pixels usual;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (size_t i = 0; i < COUNT(cases); i++) {
        const double z = -cases[i].distance, shift = 0.4 * cases[i].radius;
        struct surfel_data discs[] = {{{0, 0, z}, {0.7, 0.1, 0.7}, (float)cases[i].radius, {1, 0, 0}},
                                      {{0, shift, z}, {0.7, 0.1, 0.7}, (float)cases[i].radius, {0, 1, 0}}};
        look(&stage, cases[i].focal);
        for (int k = 0; k < 2; k++) unit(discs[k].normal);
        pbr_points *points = make_points(stage.instance, discs, 2);
        pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
        draw(&stage, &item, 1);
        assert_true(count_covered(&stage) > 100);
        keep_pixels(&stage, &usual);
        for (size_t k = 0; k < COUNT(filtered); k++) {
            item.splat = filtered[k];
            draw(&stage, &item, 1);
            expect_pixels(&stage, &usual);
        }
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* However large against its distance, which a parallel projection does not know: 0.65 pixel from its centre a disc of 0.6 pixel has
 * no weight but by the low-pass. */
static void in_a_parallel_projection_filtered_splats_never_turn_gaussian(void **state) {
    const struct surfel_data discs[] = {{{0, 0, -1}, {0, 0, 1}, 3, {1, 0, 0}}, {{0, 0, -1}, {0, 0, 1}, 0.6f, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look_parallel(&stage, 1);
    stage.frame.jitter[0] = 0.5 + 0.65;
    stage.frame.jitter[1] = 0.5;
    for (uint32_t splat = PBR_SPLAT_GAUSSIAN; splat <= PBR_SPLAT_EWA_MAX; splat++) {
        const pbr_item item = plain_item(NULL, splat);
        assert_int_equal(ratio_of_two(&stage, discs, &item) > 0.05, splat != PBR_SPLAT_GAUSSIAN);
    }
    stage_close(&stage);
}

/* On a wide plane whose weights are known, a splat's own can be read from the colours. Their sum over the pixels, averaged over
 * positions between them, is their integral: that of h exp(-2 q) up to q = 1, of a disc of area A seen face on, A (1 - exp(-2))
 * / 2. */
static void the_weights_of_a_small_ewa_splat_add_up_to_its_area(void **state) {
    static const double radii[] = {0.1, 0.5, 1, 2.5};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 320);
    for (size_t i = 0; i < COUNT(radii); i++) {
        const struct surfel_data discs[] = {{{0, 0, -4}, {0, 0, 1}, (float)(1000 / 80.0), {1, 0, 0}},
                                            {{0, 0, -4}, {0, 0, 1}, (float)(radii[i] / 80), {0, 1, 0}}};
        pbr_points *points = make_points(stage.instance, discs, 2);
        const pbr_item item = plain_item(points, PBR_SPLAT_EWA);
        double sum = 0;
        for (int j = 0; j < 64; j++) {
            stage.frame.jitter[0] = j % 8 / 8.0;
            stage.frame.jitter[1] = j / 8 / 8.0;
            draw(&stage, &item, 1);
            for (int y = 0; y < SIZE; y++)
                for (int x = 0; x < SIZE; x++) {
                    const float *c = colour_at(&stage, x, y);
                    const double away = hypot(x + 0.5 - 32 - stage.frame.jitter[0], y + 0.5 - 32 - stage.frame.jitter[1]);
                    sum += (double)(c[1] / c[0]) * exp(-2 * away * away / 1e6) / 64;
                }
        }
        /* The grid of positions has its own error at the cut. */
        const double wanted = 3.14159265 * radii[i] * radii[i] * (1 - exp(-2)) / 2;
        assert_true(fabs(sum - wanted) < 0.01 * wanted);
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* Ten discs in a plane, some 100 pixels wide: the low-pass adds 4 px^2 to 2500. */
static void a_magnified_ewa_splat_is_a_gaussian(void **state) {
    struct surfel_data discs[10];
    struct stage stage;
    uint64_t random = 3;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 2000);
    for (int i = 0; i < 10; i++) {
        discs[i] = (struct surfel_data){{0.04 * uniform(&random) - 0.02, 0.04 * uniform(&random) - 0.02, -2},
                                        {0, 0, 1},
                                        0.05f,
                                        {(float)(i % 2), (float)(i / 5), 0.5f}};
    }
    pbr_points *points = make_points(stage.instance, discs, 10);
    pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
    draw(&stage, &item, 1);
    float *gaussian = malloc((size_t)4 * SIZE * SIZE * sizeof *gaussian);
    memcpy(gaussian, stage.image.rgba, (size_t)4 * SIZE * SIZE * sizeof *gaussian);
    item.splat = PBR_SPLAT_EWA;
    draw(&stage, &item, 1);
    int rims = 0; /* pixels that a rim passed, which lies 0.04 pixel farther out */
    for (int i = 0; i < 4 * SIZE * SIZE; i++) rims += fabsf(gaussian[i] - stage.image.rgba[i]) > 0.002f;
    assert_true(rims < 4 * SIZE * SIZE / 20);
    assert_memory_not_equal(gaussian, stage.image.rgba, (size_t)4 * SIZE * SIZE * sizeof *gaussian);

    /* From an eighth of its distance on it is exactly that. */
    item.radius_scale = 5;
    draw(&stage, &item, 1);
    memcpy(gaussian, stage.image.rgba, (size_t)4 * SIZE * SIZE * sizeof *gaussian);
    item.splat = PBR_SPLAT_GAUSSIAN;
    draw(&stage, &item, 1);
    assert_memory_equal(gaussian, stage.image.rgba, (size_t)4 * SIZE * SIZE * sizeof *gaussian);
    free(gaussian);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* A disc aslant, whose low-pass of 8 pixels reaches far beyond it, 6 pixels from its centre, where its plane lies at a distance of
 * 4 / (1 - 6 / 48) = 4.57 already. Its rim is 0.8 x 0.4 farther than its centre, at 4.32. A surface before it that reaches back
 * just so far shows it. */
static void beyond_its_disc_a_filtered_splat_is_no_farther_than_the_disc_reaches(void **state) {
    const double farthest = 4.32;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 64);
    stage.frame.jitter[0] = 0.5 - 6;
    stage.frame.jitter[1] = 0.5;
    for (size_t i = 0; i < 2 * COUNT(filtered); i++) {
        const bool reaches = i / 2;
        /* Its epsilon is half of its radius, 1. */
        const struct surfel_data before = {{0, 0, -(farthest * (reaches ? 1.001 : 0.999) - 0.5)}, {0, 0, 1}, 1, {1, 0, 0}};
        const struct surfel_data disc = {{0, 0, -4}, {0.8, 0, 0.6}, 0.4f, {0, 1, 0}};
        pbr_points *points[] = {make_points(stage.instance, &before, 1), make_points(stage.instance, &disc, 1)};
        pbr_item items[] = {plain_item(points[0], PBR_SPLAT_GAUSSIAN), plain_item(points[1], filtered[i % 2])};
        items[1].low_pass = 16;
        draw(&stage, items, 2);
        assert_int_equal(colour_at(&stage, 32, 32)[1] > 0.05f, reaches);
        for (int k = 0; k < 2; k++) pbr_points_release(&points[k]);
    }
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_disc_seen_face_on_is_a_disc_of_its_projected_radius),
        cmocka_unit_test(a_square_has_its_projected_side_and_its_centres_depth),
        cmocka_unit_test(points_without_extent_never_fall_between_pixels),
        cmocka_unit_test(a_circle_covers_a_pixel_and_no_more_than_a_square),
        cmocka_unit_test(sizes_are_held_within_their_limits),
        cmocka_unit_test(tilted_discs_are_where_rays_meet_them),
        cmocka_unit_test(a_disc_without_a_normal_faces_the_eye),
        cmocka_unit_test(the_nearest_opaque_splat_is_seen),
        cmocka_unit_test(a_crowd_is_drawn_as_few_are),
        cmocka_unit_test(a_filtered_splat_covers_its_disc_as_a_gaussian_does),
        cmocka_unit_test(an_ewa_splat_has_weight_wherever_it_covers),
        cmocka_unit_test(ewa_is_convolved_with_a_low_pass_of_its_variance),
        cmocka_unit_test(ewa_max_is_the_larger_of_the_disc_and_the_low_pass),
        cmocka_unit_test(filtered_splats_with_centres_outside_the_planes_are_gaussians),
        cmocka_unit_test(in_a_parallel_projection_filtered_splats_never_turn_gaussian),
        cmocka_unit_test(the_weights_of_a_small_ewa_splat_add_up_to_its_area),
        cmocka_unit_test(a_magnified_ewa_splat_is_a_gaussian),
        cmocka_unit_test(beyond_its_disc_a_filtered_splat_is_no_farther_than_the_disc_reaches),
    };
    return cmocka_run_group_tests_name("splats", tests, NULL, NULL);
}
