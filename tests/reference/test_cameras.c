/* The same surface under every projection, transform, viewport and sub-pixel shift. SPDX-License-Identifier: MIT */
#include "support.h"

enum { SURFELS = 400 };

/* A ball of overlapping coloured discs around (0, 0, -4). */
static pbr_points *make_ball(pbr_instance *instance) {
    static struct surfel_data surfels[SURFELS];
    for (int i = 0; i < SURFELS; i++) {
        const double z = 1 - 2 * (i + 0.5) / SURFELS, turn = 2.399963 * i, ring = sqrt(1 - z * z);
        const double direction[3] = {ring * cos(turn), ring * sin(turn), z};
        surfels[i] = (struct surfel_data){{1.3 * direction[0], 1.3 * direction[1], 1.3 * direction[2] - 4},
                                          {direction[0], direction[1], direction[2]},
                                          0.15f,
                                          {(float)(i % 2), (float)(i / 2 % 2), (float)(i / 4 % 2)}};
    }
    return make_points(instance, surfels, SURFELS);
}

static void keep(const struct stage *stage, pbr_image *out) {
    *out = (pbr_image)PBR_IMAGE_INIT;
    assert_int_equal(pbr_image_create(stage->instance, stage->image.width, stage->image.height, 1, out), PBR_OK);
    const size_t pixels = (size_t)out->width * out->height;
    memcpy(out->rgba, stage->image.rgba, 4 * pixels * sizeof *out->rgba);
    memcpy(out->depth, stage->image.depth, pixels * sizeof *out->depth);
}

/* Pixels in which two pictures differ by more than rounding. */
static int count_differences(const pbr_image *a, const pbr_image *b, float tolerance) {
    int differences = 0;
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (size_t i = 0; i < (size_t)a->width * a->height; i++) {
        bool differs = isinf(a->depth[i]) != isinf(b->depth[i]) || fabsf(a->depth[i] - b->depth[i]) > tolerance * a->depth[i];
        for (size_t k = 4 * i; k < 4 * i + 4; k++) differs |= fabsf(a->rgba[k] - b->rgba[k]) > tolerance;
        differences += differs;
    }
    return differences;
}

static void depth_conventions_change_nothing(void **state) {
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    for (int parallel = 0; parallel < 2; parallel++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
            pbr_item item = plain_item(points, splat);
            pbr_image usual;
            item.shading = PBR_SHADE_DEFERRED;
            item.flags = PBR_ITEM_CULL_BACK_FACES;
            stage.frame.flags = 0;
            if (parallel) look_parallel(&stage, 12);
            else look(&stage, 48);
            draw(&stage, &item, 1);
            assert_true(count_covered(&stage) > 300);
            keep(&stage, &usual);
            for (int i = 0; i < 4; i++) {
                double *p = stage.frame.projection;
                const double scale = i & 1 ? 0.5 : 1, sign = i & 2 ? -1 : 1; /* z' = scale (sign z + w) or sign z */
                double z[4], w[4];
                if (parallel) look_parallel(&stage, 12);
                else look(&stage, 48);
                for (int c = 0; c < 4; c++) {
                    z[c] = sign * p[4 * c + 2];
                    w[c] = p[4 * c + 3];
                    p[4 * c + 2] = scale * (z[c] + (i & 1 ? w[c] : 0));
                }
                stage.frame.flags = (i & 1 ? PBR_FRAME_CLIP_ZERO_TO_ONE : 0) | (i & 2 ? PBR_FRAME_REVERSED_Z : 0);
                draw(&stage, &item, 1);
                assert_int_equal(count_differences(&usual, &stage.image, 1e-5f), 0);
            }
            pbr_image_destroy(stage.instance, &usual);
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* In a parallel projection it is the window's depth that tells on which side the eye is: nearer is larger there, if reversed. */
static void a_reversed_depth_range_leaves_the_eye_where_it_is(void **state) {
    const struct surfel_data disc = {{0, 0, -4}, {0, 0, 1}, 0.5f, {1, 0, 0}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look_parallel(&stage, 20);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
    item.flags = PBR_ITEM_CULL_BACK_FACES;
    stage.frame.flags = PBR_FRAME_REVERSED_Z;
    stage.frame.depth_range[0] = 1;
    draw(&stage, &item, 1);
    assert_true(is_covered(&stage, 32, 32));
    assert_true(fabs(depth_at(&stage, 32, 32) - 4) < 1e-5);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* An infinite far plane shows what a far one does. */
static void an_infinite_far_plane_shows_the_same(void **state) {
    struct stage stage;
    pbr_image usual;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    const pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    draw(&stage, &item, 1);
    keep(&stage, &usual);
    stage.frame.projection[10] = -1;
    stage.frame.projection[14] = -1;
    draw(&stage, &item, 1);
    assert_int_equal(count_differences(&usual, &stage.image, 1e-5f), 0);
    pbr_image_destroy(stage.instance, &usual);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* From 4e5 away the ball's depth of 2.6 changes its size by 1e-5 of it. */
static void a_parallel_projection_is_the_limit_of_far_perspective(void **state) {
    const double distance = 4e5;
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
        pbr_item item = plain_item(points, splat);
        double *p = stage.frame.projection;
        pbr_image parallel;
        item.shading = PBR_SHADE_DEFERRED;
        look_parallel(&stage, 20);
        draw(&stage, &item, 1);
        keep(&stage, &parallel);
        look(&stage, 20 * distance);
        p[10] = -2 * distance / 8, p[14] = -2 * (distance * distance - 16) / 8; /* from distance - 4 to distance + 4 */
        for (int k = 0; k < 4; k++) stage.frame.view[5 * k] = 1;
        stage.frame.view[14] = 4 - distance;
        draw(&stage, &item, 1);
        for (size_t i = 0; i < SIZE * SIZE; i++) stage.image.depth[i] -= (float)(distance - 4);
        /* Depths were floats near 4e5. */
        assert_int_equal(count_differences(&parallel, &stage.image, 0.02f), 0);
        memset(stage.frame.view, 0, sizeof stage.frame.view);
        pbr_image_destroy(stage.instance, &parallel);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* A window of 64 x 64 pixels of a larger picture, by an off-centre projection, by the viewport and the scissor box. */
static void a_part_of_a_picture_is_a_picture_of_the_part(void **state) {
    enum { LARGE = 160, X = 70, Y = 22 };
    struct stage stage;
    pbr_image large;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
        pbr_item item = plain_item(points, splat);
        stage.frame.viewport[2] = stage.frame.viewport[3] = LARGE;
        look(&stage, 200);
        draw(&stage, &item, 1);
        keep(&stage, &large);

        stage.frame.viewport[2] = stage.frame.viewport[3] = SIZE;
        look(&stage, 200);
        stage.frame.projection[8] = -(LARGE / 2.0 - X - SIZE / 2) * 2 / SIZE;
        stage.frame.projection[9] = -(LARGE / 2.0 - Y - SIZE / 2) * 2 / SIZE;
        draw(&stage, &item, 1);
        int differences = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++)
                for (int k = 0; k < 4; k++)
                    differences +=
                        fabsf(colour_at(&stage, x, y)[k] - large.rgba[4 * pixel_at(&large, x + X, y + Y) + (size_t)k]) > 1e-5f;
        assert_int_equal(differences, 0);

        stage.frame.viewport[0] = 1000, stage.frame.viewport[1] = -50;
        stage.frame.viewport[2] = stage.frame.viewport[3] = LARGE;
        memcpy(stage.frame.scissor, (int32_t[]){1000 + X, Y - 50, SIZE, SIZE / 2}, sizeof stage.frame.scissor);
        look(&stage, 200);
        stage.frame.flags = PBR_FRAME_SCISSOR;
        draw(&stage, &item, 1);
        for (int y = 0; y < LARGE; y++)
            for (int x = 0; x < LARGE; x++) {
                const bool in = x >= X && x < X + SIZE && y >= Y && y < Y + SIZE / 2;
                const size_t at = pixel_at(&large, x, y);
                if (in) assert_memory_equal(stage.image.rgba + 4 * at, large.rgba + 4 * at, 4 * sizeof *large.rgba);
                else assert_true(stage.image.rgba[4 * at + 3] == 0 && isinf(stage.image.depth[at]));
            }
        stage.frame.flags = 0;
        memset(stage.frame.viewport, 0, 2 * sizeof stage.frame.viewport[0]);
        pbr_image_destroy(stage.instance, &large);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

static void jitter_shifts_the_picture_right_and_up(void **state) {
    struct stage stage;
    pbr_image still;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    for (int flipped = 0; flipped < 2; flipped++) {
        const pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
        stage.frame.flags = flipped ? PBR_FRAME_CLIP_UPPER_LEFT : 0;
        memset(stage.frame.jitter, 0, sizeof stage.frame.jitter);
        draw(&stage, &item, 1);
        keep(&stage, &still);
        stage.frame.jitter[0] = 3, stage.frame.jitter[1] = -2;
        draw(&stage, &item, 1);
        int differences = 0;
        for (int y = 0; y < SIZE - 2; y++)
            for (int x = 3; x < SIZE; x++)
                for (int k = 0; k < 4; k++)
                    differences +=
                        fabsf(colour_at(&stage, x, y)[k] - still.rgba[4 * pixel_at(&still, x - 3, y + 2) + (size_t)k]) > 1e-5f;
        assert_int_equal(differences, 0);
        pbr_image_destroy(stage.instance, &still);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* With the clip origin at the upper left, a projection whose y is turned around shows what the usual one does. */
static void an_upper_left_origin_turns_the_picture_over(void **state) {
    struct stage stage;
    pbr_image usual;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    item.shading = PBR_SHADE_DEFERRED;
    draw(&stage, &item, 1);
    keep(&stage, &usual);
    stage.frame.flags = PBR_FRAME_CLIP_UPPER_LEFT;
    stage.frame.projection[5] = -stage.frame.projection[5];
    draw(&stage, &item, 1);
    assert_int_equal(count_differences(&usual, &stage.image, 1e-6f), 0);
    pbr_image_destroy(stage.instance, &usual);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* The view's rotation may be in the projection: sizes, depth and light stay. */
static void a_rotation_may_be_within_the_projection(void **state) {
    static const double turn[16] = {0.36, -0.48, 0.8, 0, 0.8, 0.6, 0, 0, -0.48, 0.64, 0.6, 0, 0, 0, 0, 1};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_ball(stage.instance);
    for (int parallel = 0; parallel < 2; parallel++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
            pbr_item item = plain_item(points, splat);
            double straight[16];
            pbr_image usual;
            item.flags = PBR_ITEM_CULL_BACK_FACES;
            memset(stage.frame.view, 0, sizeof stage.frame.view);
            if (parallel) look_parallel(&stage, 15);
            else look(&stage, 60);
            draw(&stage, &item, 1);
            keep(&stage, &usual);
            memcpy(straight, stage.frame.projection, sizeof straight);
            for (int c = 0; c < 4; c++)
                for (int r = 0; r < 4; r++) {
                    stage.frame.projection[4 * c + r] = 0;
                    stage.frame.view[4 * c + r] = turn[4 * r + c]; /* the inverse */
                    for (int k = 0; k < 4; k++) stage.frame.projection[4 * c + r] += straight[4 * k + r] * turn[4 * c + k];
                }
            draw(&stage, &item, 1);
            assert_int_equal(count_differences(&usual, &stage.image, 1e-5f), 0);
            pbr_image_destroy(stage.instance, &usual);
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* ---- transforms ---- */

static void invert_affine(const double m[16], double out[16]) {
    const double *a = m, *b = m + 4, *c = m + 8, *t = m + 12;
    const double cofactors[3][3] = {{b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]},
                                    {c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]},
                                    {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}};
    const double det = dot(a, cofactors[0]);
    memset(out, 0, 16 * sizeof *out);
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++) out[4 * k + r] = cofactors[r][k] / det;
        out[12 + r] = -dot(cofactors[r], t) / det;
    }
    out[15] = 1;
}

static void apply(const double m[16], const double v[3], double w, double out[3]) {
    for (int r = 0; r < 3; r++) out[r] = m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r] * w;
}

/* Rays taken back into object space meet the disc itself; so does its facing, whatever the transform mirrors. */
static void uneven_and_mirroring_transforms_move_the_disc_itself(void **state) {
    static const double transforms[][16] = {
        {1.2, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1, 0, 0.3, 0.1, -3, 1},
        {-1, 0, 0, 0, 0, 1.4, 0, 0, 0, 0, 0.7, 0, 0, 0.2, -3, 1},                 /* mirrors */
        {0.6, 0.9, -0.2, 0, -0.4, 0.8, 0.5, 0, 0.3, 0.1, 2, 0, -0.4, 0, -3.5, 1}, /* shears */
        {-0.5, 0.7, 0.1, 0, 0.2, -1.1, 0.3, 0, 0.5, 0.2, -1.3, 0, 0, 0, -3, 1},
    };
    struct surfel_data disc = {{0.1, -0.2, 0.15}, {0.3, 0.5, 0.7}, 0.8f, {1, 1, 1}};
    struct stage stage;
    int culled = 0;
    (void)state;
    stage_open(&stage, 1);
    unit(disc.normal);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    for (size_t i = 0; i < 2 * COUNT(transforms); i++) {
        double inverse[16], eye[3], towards[3];
        pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
        item.transforms = transforms[i / 2];
        item.transform_count = 1;
        item.flags = i % 2 ? PBR_ITEM_CULL_BACK_FACES : 0;
        invert_affine(transforms[i / 2], inverse);
        apply(inverse, (const double[3]){0, 0, 0}, 1, eye);
        for (int k = 0; k < 3; k++) towards[k] = eye[k] - disc.position[k];
        const bool dropped = i % 2 && dot(towards, disc.normal) < 0;
        draw(&stage, &item, 1);
        culled += dropped;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double along[3], back[3];
                pixel_ray(32, x, y, along);
                apply(inverse, along, 0, back);
                const struct hit hit = cast(eye, back, &disc);
                if (fabs(hit.rho - 1) < 1e-3) continue;
                assert_int_equal(is_covered(&stage, x, y), hit.rho < 1 && hit.t > 0.5 && !dropped);
                if (is_covered(&stage, x, y)) assert_true(fabs(depth_at(&stage, x, y) - hit.t) < 1e-3);
            }
    }
    assert_in_range(culled, 1, 3);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* The largest stretch, here 3 along an oblique axis that is turned into another, is what squares and circles grow by. */
static void billboards_grow_by_the_largest_stretch(void **state) {
    static const double a[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}},
                        b[3][3] = {{0.6, 0.8, 0}, {0, 0, 1}, {0.8, -0.6, 0}};
    static const double stretches[3] = {3, 2.5, -0.5};
    const struct surfel_data disc = {{0, 0, 0}, {0, 0, 1}, 0.25f, {1, 1, 1}};
    struct stage stage;
    double transform[16] = {0};
    (void)state;
    stage_open(&stage, 1);
    look(&stage, 96);
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 3; k++) transform[4 * c + r] += stretches[k] * a[k][c] * b[k][r];
    transform[14] = -3;
    transform[15] = 1;
    pbr_points *points = make_points(stage.instance, &disc, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    item.transforms = transform;
    item.transform_count = 1;
    for (int i = 0; i < 2; i++) { /* 48 pixels, the outermost centres just within and just without */
        item.radius_scale = (float)(i ? 1 + 1.0 / 48 + 1e-5 : 1 + 1.0 / 48 - 1e-5);
        draw(&stage, &item, 1);
        assert_int_equal(count_covered(&stage), i ? 50 * 50 : 48 * 48);
    }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* Item by item and transform by transform, as the same points given one after another. */
static void copies_are_drawn_at_their_places(void **state) {
    const struct surfel_data disc = {{0, 0, -2}, {0, 0, 1}, 0.2f, {1, 0, 0}};
    double transforms[3][16];
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    memset(transforms, 0, sizeof transforms);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 4; k++) transforms[i][5 * k] = 1;
        transforms[i][12] = i - 1;
    }
    pbr_item items[3] = {plain_item(points, PBR_SPLAT_ELLIPSE), plain_item(points, PBR_SPLAT_ELLIPSE),
                         plain_item(points, PBR_SPLAT_ELLIPSE)};
    items[0].flags = PBR_ITEM_HIDDEN;
    items[1].transforms = transforms[0];
    items[1].transform_count = 3;
    items[2].flags = PBR_ITEM_HIDDEN;
    draw(&stage, items, 3);
    for (int i = 0; i < 3; i++) assert_true(is_covered(&stage, 16 + 16 * i, 32));
    assert_false(is_covered(&stage, 24, 32));
    const double planes[8] = {1, 0, 0, -0.5, 0, 0, 1, 3};
    items[1].clip_planes = planes;
    items[1].clip_plane_count = 2;
    draw(&stage, items, 3);
    for (int i = 0; i < 3; i++) assert_int_equal(is_covered(&stage, 16 + 16 * i, 32), i == 2);
    pbr_points_release(&points);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_conventions_change_nothing),
        cmocka_unit_test(a_reversed_depth_range_leaves_the_eye_where_it_is),
        cmocka_unit_test(an_infinite_far_plane_shows_the_same),
        cmocka_unit_test(a_parallel_projection_is_the_limit_of_far_perspective),
        cmocka_unit_test(a_part_of_a_picture_is_a_picture_of_the_part),
        cmocka_unit_test(jitter_shifts_the_picture_right_and_up),
        cmocka_unit_test(an_upper_left_origin_turns_the_picture_over),
        cmocka_unit_test(a_rotation_may_be_within_the_projection),
        cmocka_unit_test(uneven_and_mirroring_transforms_move_the_disc_itself),
        cmocka_unit_test(billboards_grow_by_the_largest_stretch),
        cmocka_unit_test(copies_are_drawn_at_their_places),
    };
    return cmocka_run_group_tests_name("cameras", tests, NULL, NULL);
}
