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

/* The least sizes: a square of one pixel covers exactly one centre wherever it is, a circle of diameter sqrt 2 one to four. */
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
        item.size_minimum = 0;
        item.splat = PBR_SPLAT_CIRCLE;
        draw(&stage, &item, 1);
        assert_in_range(count_covered(&stage), 1, 4);
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

/* Face on, a disc of radius r pixels covers sqrt(r^2 + 0.35^2) around its centre. */
static void an_ewa_splat_covers_its_disc_little_widened(void **state) {
    static const double radii[] = {0.05, 0.2, 0.6, 1.5, 3.3};
    struct stage stage;
    uint64_t random = 77;
    (void)state;
    stage_open(&stage, 1);
    for (int i = 0; i < 100; i++) {
        const double cx = 28 + 8 * uniform(&random), cy = 28 + 8 * uniform(&random), radius = radii[i % 5];
        const struct surfel_data disc = {{(cx - 32) / 8, (cy - 32) / 8, -4}, {0, 0, 1}, (float)(radius / 8), {1, 1, 1}};
        pbr_points *points = make_points(stage.instance, &disc, 1);
        const pbr_item item = plain_item(points, PBR_SPLAT_EWA);
        draw(&stage, &item, 1);
        const double cover = hypot(radius, 0.35);
        for (int y = 24; y < 40; y++)
            for (int x = 24; x < 40; x++) {
                const double away = hypot(x + 0.5 - cx, y + 0.5 - cy);
                if (fabs(away - cover) > 1e-6) assert_int_equal(is_covered(&stage, x, y), away < cover);
            }
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* However large against its distance, which a parallel projection does not know. */
static void in_a_parallel_projection_ewa_never_turns_gaussian(void **state) {
    static const struct surfel_data disc = {{0, 0, -1}, {0, 0, 1}, 0.6f, {1, 1, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look_parallel(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    stage.frame.jitter[0] = 0.5 + 0.65;
    stage.frame.jitter[1] = 0.5;
    draw(&stage, &item, 1);
    assert_true(is_covered(&stage, 32, 32)); /* 0.65 pixel from the centre, and sqrt(0.6^2 + 0.35^2) > 0.65 */
    item.splat = PBR_SPLAT_GAUSSIAN;
    draw(&stage, &item, 1);
    assert_false(is_covered(&stage, 32, 32));
    pbr_points_release(&points);
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

/* Seen aslant from afar, where the linearisation is as good as the ray: depths are the plane's, but change by no more than along
 * the disc. */
static void the_depth_of_an_ewa_splat_is_its_planes_as_far_as_the_disc_reaches(void **state) {
    struct surfel_data disc = {{0, 0, -100}, {0.6, 0, 0.8}, 0.1f, {1, 1, 1}}; /* 0.8 pixel, 0.64 across */
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 800);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    const pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    int held = 0;
    stage.frame.jitter[1] = 0.5;
    for (int i = 0; i < 40; i++) {
        stage.frame.jitter[0] = -0.8 + i * 0.04;
        draw(&stage, &item, 1);
        const double dx = 0.5 - stage.frame.jitter[0], change = 0.75 * dx / 8, most = 0.06; /* tan, sin of the angle */
        if (!is_covered(&stage, 32, 32)) continue;
        assert_true(fabs(depth_at(&stage, 32, 32) - 100 - fmax(-most, fmin(most, change))) < 2e-3);
        held += fabs(change) > most;
    }
    assert_true(held > 0);
    pbr_points_release(&points);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_disc_seen_face_on_is_a_disc_of_its_projected_radius),
        cmocka_unit_test(a_square_has_its_projected_side_and_its_centres_depth),
        cmocka_unit_test(points_without_extent_never_fall_between_pixels),
        cmocka_unit_test(sizes_are_held_within_their_limits),
        cmocka_unit_test(tilted_discs_are_where_rays_meet_them),
        cmocka_unit_test(a_disc_without_a_normal_faces_the_eye),
        cmocka_unit_test(the_nearest_opaque_splat_is_seen),
        cmocka_unit_test(a_crowd_is_drawn_as_few_are),
        cmocka_unit_test(an_ewa_splat_covers_its_disc_little_widened),
        cmocka_unit_test(in_a_parallel_projection_ewa_never_turns_gaussian),
        cmocka_unit_test(the_weights_of_a_small_ewa_splat_add_up_to_its_area),
        cmocka_unit_test(a_magnified_ewa_splat_is_a_gaussian),
        cmocka_unit_test(the_depth_of_an_ewa_splat_is_its_planes_as_far_as_the_disc_reaches),
    };
    return cmocka_run_group_tests_name("splats", tests, NULL, NULL);
}
