/* The cut of a whole cloud, against a test of every splat. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "core/matrix.h"
#include "lod/cloud.h"

enum { POINTS = 160000, VIEWS = 60 };

static uint32_t state = 1;
static double uniform(void) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
}

static void perspective(double focal, double aspect, double near_plane, double far_plane, double out[16]) {
    memset(out, 0, 16 * sizeof *out);
    out[0] = focal / aspect;
    out[5] = focal;
    out[10] = -(far_plane + near_plane) / (far_plane - near_plane);
    out[11] = -1;
    out[14] = -2 * far_plane * near_plane / (far_plane - near_plane);
}

static void random_view(double out[16]) {
    double a = 6.2831853 * uniform(), b = 3 * uniform() - 1.5;
    const double rotation[16] = {cos(a),
                                 sin(a) * sin(b),
                                 sin(a) * cos(b),
                                 0,
                                 0,
                                 cos(b),
                                 -sin(b),
                                 0,
                                 -sin(a),
                                 cos(a) * sin(b),
                                 cos(a) * cos(b),
                                 0,
                                 3 * (uniform() - 0.5),
                                 3 * (uniform() - 0.5),
                                 -3 * uniform(),
                                 1};
    memcpy(out, rotation, sizeof rotation);
}

struct splat_fate {
    int visible, needs_quad; /* for certain, by the exact rule of the vertex stage */
};

static struct splat_fate fate_of(const struct cut_view *view, const double p[3], double radius) {
    const double *m = view->to_clip;
    double clip[4];
    for (int r = 0; r < 4; r++) clip[r] = m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
    double w = clip[3], size = fmin(fmax(radius * view->size_per_radius / w, view->size_minimum), view->size_maximum);
    struct splat_fate fate = {0, 0};
    fate.visible = w > 0 && fabs(clip[2]) <= w && fabs(clip[0]) - size * w / view->viewport[0] <= w &&
                   fabs(clip[1]) - size * w / view->viewport[1] <= w;
    fate.needs_quad = fate.visible && (size > view->point_limit || fabs(clip[0]) > w || fabs(clip[1]) > w);
    return fate;
}

static pbr_points *make_points(pbr_instance *instance) {
    float(*positions)[3] = malloc(POINTS * sizeof *positions);
    float *radii = malloc(POINTS * sizeof *radii);
    for (int i = 0; i < POINTS; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = (float)(2 * uniform() - 1);
        radii[i] = (float)(0.002 + (i % 20000 == 0 ? 0.2 : 0.01) * uniform());
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    pbr_points *points = NULL;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    free(positions);
    free(radii);
    return points;
}

/* Marks what the cut hands over: 1 = in a range, 3 = in a range that quads draw too. Returns the number of records. */
static uint64_t mark(const struct blocks *blocks, const struct draw_list *list, uint8_t *marks) {
    uint64_t records = 0;
    memset(marks, 0, POINTS);
    for (size_t i = 0; i < list->count; i++) {
        const struct draw_range *range = &list->ranges[i];
        records += range->count;
        for (uint32_t k = 0; k < range->count; k++) {
            uint32_t point = blocks->order[blocks->chunks[range->chunk].first + range->first + k];
            assert_int_equal(marks[point], 0); /* no record twice */
            marks[point] = range->quads ? 3 : 1;
        }
    }
    return records;
}

static void cut_keeps_every_visible_splat_and_quads_where_needed(void **unused) {
    (void)unused;
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    pbr_points *points = make_points(instance);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    uint8_t *marks = malloc(POINTS);
    struct draw_list list = {0};
    uint64_t culled = 0, points_only = 0;
    for (int v = 0; v < VIEWS; v++) {
        struct cut_view view = {
            .size_minimum = v % 3 ? 1 : 12, .size_maximum = v % 5 ? 1e18 : 30, .point_limit = 64, .viewport = {640, 360}};
        double eye[16], projection[16];
        random_view(eye);
        perspective(4, 640.0 / 360, 0.01 + uniform(), 2 + uniform(), projection);
        matrix_multiply(projection, eye, view.to_clip);
        view.size_per_radius = 2 * 360.0 / 2 * 4; /* a diameter: twice half the height times the focal length */
        list.count = 0;
        list.culled = 0;
        assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
        assert_int_equal(mark(&blocks, &list, marks) + list.culled, POINTS);
        culled += list.culled;
        for (uint64_t i = 0; i < POINTS; i++) {
            double p[3];
            points_position(points, i, p);
            struct splat_fate fate = fate_of(&view, p, points->radii[i]);
            if (fate.visible) assert_true(marks[i] & 1);
            if (fate.needs_quad) assert_true(marks[i] & 2);
            points_only += marks[i] == 1;
        }
    }
    /* The cut is not merely conservative: it leaves out a good part, and keeps blocks within the view to GL points alone. */
    assert_true(culled > POINTS * VIEWS / 5);
    assert_true(points_only > 0);
    pbr_free(instance, list.ranges);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(marks);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

static void a_cloud_well_within_the_view_is_one_range_of_points(void **unused) {
    (void)unused;
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    pbr_points *points = make_points(instance);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    const double from_afar[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -40, 1};
    struct cut_view view = {
        .size_per_radius = 1440, .size_minimum = 1, .size_maximum = 1e18, .point_limit = 64, .viewport = {640, 360}};
    double projection[16];
    perspective(4, 640.0 / 360, 1, 100, projection);
    matrix_multiply(projection, from_afar, view.to_clip);
    struct draw_list list = {0};
    assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
    assert_int_equal(list.count, 1);
    assert_int_equal(list.ranges[0].count, POINTS);
    assert_false(list.ranges[0].quads);
    assert_int_equal(list.visited, blocks.block_count);
    pbr_free(instance, list.ranges);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* The vertex stage computes in float. Near the camera, in a cloud that reaches far, its x is off by more than any fixed margin: a
 * block at the view's edge must go to the quads too wherever that may put a centre outside. */
static void float_error_at_the_edge_never_loses_a_splat(void **unused) {
    (void)unused;
    enum { FRAMES = 400 };
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    int outside_in_float = 0;
    for (int i = 0; i < FRAMES; i++) {
        const float place[3] = {(float)(4e4 * uniform()), (float)(4e4 * uniform()), (float)(4e4 * uniform())};
        struct splat record = {.position = {place[0], place[1], place[2]}, .radius = 0.5f};
        struct block block = {.centre = {place[0], place[1], place[2]}, .largest_splat = 0.5f, .count = 1};
        struct chunk chunk = {.count = 1, .block_count = 1};
        struct blocks blocks = {.blocks = &block, .chunks = &chunk, .block_count = 1, .chunk_count = 1};
        struct cut_view view = {
            .size_per_radius = 720, .size_minimum = 1, .size_maximum = 1e18, .point_limit = 1024, .viewport = {640, 360}};
        /* The centre is between 2e-4 and 1e-2 of the view's half width inside its right edge, 1 before the eye. */
        const double half = 640.0 / 360 / 2, turn = 6.2831853 * uniform(), c = cos(turn), s = sin(turn);
        const double at[3] = {half * (1 - 2.1e-4 - 5e-3 * uniform()), 0, -1}; /* in eye space, which is turned about y */
        const double moved[3] = {at[0] - c * place[0] - s * place[2], at[1] - place[1], at[2] + s * place[0] - c * place[2]};
        const double matrix[16] = {c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, moved[0], moved[1], moved[2], 1};
        double projection[16];
        perspective(2, 640.0 / 360, 0.1, 1000, projection);
        matrix_multiply(projection, matrix, view.to_clip);
        struct draw_list list = {0};
        assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
        assert_int_equal(list.count, 1);
        float clip[4];
        for (int r = 0; r < 4; r++)
            clip[r] = (float)view.to_clip[r] * record.position[0] + (float)view.to_clip[4 + r] * record.position[1] +
                      (float)view.to_clip[8 + r] * record.position[2] + (float)view.to_clip[12 + r];
        outside_in_float += fabsf(clip[0]) > clip[3];
        if (fabsf(clip[0]) > clip[3]) assert_true(list.ranges[0].quads);
        pbr_free(instance, list.ranges);
    }
    assert_true(outside_in_float > 0); /* else this showed nothing */
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(cut_keeps_every_visible_splat_and_quads_where_needed),
                                       cmocka_unit_test(a_cloud_well_within_the_view_is_one_range_of_points),
                                       cmocka_unit_test(float_error_at_the_edge_never_loses_a_splat)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
