/* Point sets. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/points.h"

static pbr_points *create(pbr_instance *instance, const pbr_points_desc *desc) {
    pbr_points *points;
    assert_int_equal(pbr_points_create(instance, desc, &points), PBR_OK);
    return points;
}

static pbr_points_info info_of(const pbr_points *points) {
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    assert_int_equal(pbr_points_get_info(points, &info), PBR_OK);
    return info;
}

static void float_positions_are_kept_to_the_bit(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const float given[3][3] = {{0.1f, -2.5e-7f, 3e20f}, {1, 2, 3}, {-0.3f, 1e-30f, 7}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 3;
    desc.positions = (pbr_attribute){given, 0, PBR_FORMAT_FLOAT32, 3};
    desc.origin[1] = 5e6;
    pbr_points *points = create(instance, &desc);
    assert_non_null(points->narrow);
    assert_memory_equal(points->narrow, given, sizeof given);
    assert_true(points->origin[1] == 5e6);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void doubles_stay_wide_only_where_float_would_move_a_splat(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    double given[1000][3];
    uint64_t random = 1;
    for (int i = 0; i < 1000; i++) {
        given[i][0] = 637000 + 500 * uniform(&random);
        given[i][1] = 851000 + 500 * uniform(&random);
        given[i][2] = 100 + 30 * uniform(&random);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 1000;
    desc.positions = (pbr_attribute){given, 0, PBR_FORMAT_FLOAT64, 3};
    /* Within 250 units of the origin float errs by up to 2^-17 = 7.6e-6, 1/128 of a radius of 9.8e-4. */
    const float radii[] = {0, 1e-4f, 0.9e-3f, 1.1e-3f, 0.5f};
    for (size_t r = 0; r < COUNT(radii); r++) {
        desc.radius = radii[r];
        pbr_points *points = create(instance, &desc);
        double back[1000][3],
            tolerance = radii[r] > 1e-3 ? radii[r] / 128.0 : 1.2e-10 /* half a unit in the last place of 851000 */;
        pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
        copy.positions = &back[0][0];
        assert_true((points->wide != NULL) == (radii[r] < 1e-3));
        assert_true((points->narrow != NULL) == (radii[r] > 1e-3));
        assert_int_equal(pbr_points_copy(points, 0, 1000, &copy), PBR_OK);
        for (int i = 0; i < 1000; i++)
            for (int k = 0; k < 3; k++) assert_true(fabs(back[i][k] - given[i][k]) <= tolerance);
        pbr_points_release(&points);
    }
    double exact[2][3] = {{0.5, 0.25, -1}, {1, 2, 3}};
    desc.count = 2;
    desc.radius = 0;
    desc.positions.data = exact;
    pbr_points *points = create(instance, &desc);
    assert_non_null(points->narrow); /* no radius to measure by, but nothing is lost */
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void non_finite_points_are_dropped_with_their_attributes(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double given[6][3] = {{1, 0, 0}, {NAN, 0, 0}, {2, 0, 0}, {0, INFINITY, 0}, {0, 0, 1e300}, {3, 0, 0}};
    const float radii[6] = {1, 2, -3, 4, 5, INFINITY};
    const uint8_t colours[6][3] = {{10}, {20}, {30}, {40}, {50}, {60}};
    const int32_t classes[6] = {-1, 2, 3, 4, 5, 6};
    pbr_scalar scalar = {"class", {classes, 0, PBR_FORMAT_INT32, 1}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 6;
    desc.positions = (pbr_attribute){given, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    pbr_points *points = create(instance, &desc);
    pbr_points_info info = info_of(points);
    assert_int_equal(info.count, 3);
    assert_int_equal(info.dropped_count, 3);
    double positions[3][3];
    uint8_t colour[3][4];
    float radius[3], class[3];
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = &positions[0][0];
    copy.colours = &colour[0][0];
    copy.radii = radius;
    copy.scalar = class;
    assert_int_equal(pbr_points_copy(points, 0, 3, &copy), PBR_OK);
    const float expected_radius[3] = {1, 0, 0}, expected_class[3] = {-1, 3, 6};
    for (int i = 0; i < 3; i++) {
        assert_true(positions[i][0] == i + 1);
        assert_int_equal(colour[i][0], i == 0 ? 10 : i == 1 ? 30 : 60);
        assert_int_equal(colour[i][3], 255);
        assert_true(radius[i] == expected_radius[i]);
        assert_true(class[i] == expected_class[i]);
    }
    assert_true(info.minimum[0] == 1 && info.maximum[0] == 3 && info.centre[0] == 2 && info.bounding_radius == 1);
    assert_true(info.radius_minimum == 0 && info.radius_maximum == 1);
    assert_true(points->scalars[0].minimum == -1 && points->scalars[0].maximum == 6);
    pbr_points_release(&points);

    /* For meshes they stay, so that indices keep their meaning. */
    assert_int_equal(points_create(instance, &desc, true, &points), PBR_OK);
    assert_int_equal(points->count, 6);
    assert_int_equal(points->dropped, 3);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void colours_become_srgb_bytes(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float position[3] = {0}, linear[4] = {0.21404114f, 2, NAN, 0.5f}; /* sRGB 0.5 is linear 0.21404 (IEC 61966-2-1) */
    const double doubles[3] = {1, 0, -1};
    const uint8_t bytes[4] = {1, 127, 255, 3};
    const uint16_t shorts[3] = {257 * 77, 257 * 77 + 128, 257 * 77 + 129};
    const struct {
        pbr_attribute attribute;
        uint8_t wanted[4];
    } cases[] = {
        {{linear, 0, PBR_FORMAT_FLOAT32, 4}, {128, 255, 0, 128}},
        {{doubles, 0, PBR_FORMAT_FLOAT64, 3}, {255, 0, 0, 255}},
        {{bytes, 0, PBR_FORMAT_UINT8, 4}, {1, 127, 255, 3}},
        {{shorts, 0, PBR_FORMAT_UINT16, 3}, {77, 77, 78, 255}},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        desc.count = 1;
        desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT32, 3};
        desc.colours = cases[i].attribute;
        pbr_points *points = create(instance, &desc);
        assert_memory_equal(points->colours[0], cases[i].wanted, 4);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static void normals_of_any_format_and_length_are_directions(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float position[3] = {0}, f[3] = {3e38f, 0, 3e38f}, nothing[3] = {0, 0, 0}, infinite[3] = {INFINITY, 0, 0};
    const double d[3] = {1e-300, 0, 1e-300}, large[3] = {1e300, 0, 1e300};
    const int8_t bytes[3] = {-128, 0, -127}; /* both are -1 */
    const int16_t shorts[3] = {12000, 0, 12000};
    const double half = 0.70710678118654752;
    const struct {
        pbr_attribute attribute;
        double wanted[3];
    } cases[] = {
        {{f, 0, PBR_FORMAT_FLOAT32, 3}, {half, 0, half}},     {{d, 0, PBR_FORMAT_FLOAT64, 3}, {half, 0, half}},
        {{large, 0, PBR_FORMAT_FLOAT64, 3}, {half, 0, half}}, {{bytes, 0, PBR_FORMAT_INT8, 3}, {-half, 0, -half}},
        {{shorts, 0, PBR_FORMAT_INT16, 3}, {half, 0, half}},  {{nothing, 0, PBR_FORMAT_FLOAT32, 3}, {0, 0, 0}},
        {{infinite, 0, PBR_FORMAT_FLOAT32, 3}, {0, 0, 0}},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        desc.count = 1;
        desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT32, 3};
        desc.normals = cases[i].attribute;
        pbr_points *points = create(instance, &desc);
        float n[3];
        pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
        copy.normals = n;
        assert_int_equal(pbr_points_copy(points, 0, 1, &copy), PBR_OK);
        for (int k = 0; k < 3; k++) assert_true(fabs(n[k] - cases[i].wanted[k]) < 1e-4); /* 16-bit octahedral */
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static void bounds_enclose_every_position(void **state) {
    (void)state;
    enum { MANY = 50000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*given)[3] = calloc(MANY, sizeof *given);
    uint64_t random = 4;
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++) given[i][k] = (float)(uniform(&random) * (k + 1) - 7);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = MANY;
    desc.positions = (pbr_attribute){given, 0, PBR_FORMAT_FLOAT32, 3};
    desc.origin[2] = 1000;
    pbr_points *points = create(instance, &desc);
    pbr_points_info info = info_of(points);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, farthest = 0;
    for (int i = 0; i < MANY; i++) {
        double squared = 0;
        for (int k = 0; k < 3; k++) {
            double p = given[i][k] + (k == 2 ? 1000.0 : 0.0);
            low[k] = fmin(low[k], p);
            high[k] = fmax(high[k], p);
            squared += (p - info.centre[k]) * (p - info.centre[k]);
        }
        farthest = fmax(farthest, sqrt(squared));
    }
    assert_memory_equal(low, info.minimum, sizeof low);
    assert_memory_equal(high, info.maximum, sizeof high);
    assert_true(fabs(farthest - info.bounding_radius) < 1e-12 * 1000);
    assert_true(info.memory_bytes >= sizeof(float[3]) * MANY);
    free(given);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void names_are_cut_between_characters(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    char name[100];
    memset(name, 'a', sizeof name);
    memcpy(name + 62, "\xc3\xa4", 2); /* two bytes, the second past the 63rd */
    name[99] = 0;
    const float value = 1, position[3] = {0};
    pbr_scalar scalar = {name, {&value, 0, PBR_FORMAT_FLOAT32, 1}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 1;
    desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT32, 3};
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    pbr_points *points = create(instance, &desc);
    assert_int_equal(strlen(pbr_points_scalar_name(points, 0)), 62);
    assert_null(pbr_points_scalar_name(points, 1));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void contract_violations_are_refused(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float position[3] = {0};
    pbr_scalar scalars[PBR_MAX_SCALARS + 1] = {{NULL, {position, 0, PBR_FORMAT_FLOAT32, 1}}};
    pbr_points_desc good = PBR_POINTS_DESC_INIT, wrong[12];
    good.count = 1;
    good.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT32, 3};
    for (size_t i = 0; i < COUNT(wrong); i++) wrong[i] = good;
    wrong[0].positions.data = NULL;
    wrong[1].positions.components = 2;
    wrong[2].origin[1] = NAN;
    wrong[3].flags = 1u << 31;
    wrong[4].radius = -1;
    wrong[5].radius_scale = INFINITY;
    wrong[6].radius_neighbours = 33;
    wrong[7].reserved = 1;
    wrong[8].scalar_count = 1;
    wrong[9].scalars = scalars, wrong[9].scalar_count = 1; /* no name */
    wrong[10].struct_size = 8;
    wrong[11].normals = (pbr_attribute){position, 0, PBR_FORMAT_UINT8, 3};
    for (size_t i = 0; i < COUNT(wrong); i++) {
        pbr_points *points = (pbr_points *)&host;
        host.messages = 0;
        assert_int_equal(pbr_points_create(instance, &wrong[i], &points), PBR_ERROR_INVALID_ARGUMENT);
        assert_null(points);
        assert_int_equal(host.messages, 1);
    }
    pbr_points *points;
    pbr_points_desc limit = good;
    limit.count = PBR_MAX_POINTS + 1;
    assert_int_equal(pbr_points_create(instance, &limit, &points), PBR_ERROR_LIMIT);
    limit = good;
    limit.scalars = scalars;
    limit.scalar_count = PBR_MAX_SCALARS + 1;
    assert_int_equal(pbr_points_create(instance, &limit, &points), PBR_ERROR_LIMIT);

    points = create(instance, &good);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    float numbers[4];
    assert_int_equal(pbr_points_copy(points, 1, 1, &copy), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_points_copy(points, 1, UINT64_MAX, &copy), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_points_copy(points, 1, 0, &copy), PBR_OK);
    copy.radii = numbers;
    assert_int_equal(pbr_points_copy(points, 0, 1, &copy), PBR_ERROR_INVALID_ARGUMENT);
    pbr_points_release(&points);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void empty_sets_are_points_too(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    desc.origin[0] = 5;
    pbr_points *points = create(instance, &desc);
    pbr_points_info info = info_of(points);
    assert_int_equal(info.count, 0);
    assert_true(info.minimum[0] == 0 && info.maximum[0] == 0 && info.bounding_radius == 0 && info.radius_mean == 0);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

struct full {
    double positions[3000][3];
    float normals[3000][3], values[3000];
    uint8_t colours[3000][3];
};

static pbr_result create_full(pbr_instance *instance, void *user) {
    const struct full *full = user;
    pbr_scalar scalars[2] = {{"a", {full->values, 0, PBR_FORMAT_FLOAT32, 1}}, {"b", {full->values, 0, PBR_FORMAT_FLOAT32, 1}}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    desc.count = 3000;
    desc.positions = (pbr_attribute){full->positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){full->normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){full->colours, 0, PBR_FORMAT_UINT8, 3};
    desc.scalars = scalars;
    desc.scalar_count = 2;
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    pbr_result result = pbr_points_create(instance, &desc, &points);
    if (result == PBR_OK) assert_non_null(points->narrow);
    assert_true((result == PBR_OK) == (points != NULL));
    pbr_points_release(&points);
    return result;
}

static void failing_allocations_leave_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct full *full = calloc(1, sizeof *full);
    uint64_t random = 9;
    for (int i = 0; i < 3000; i++)
        for (int k = 0; k < 3; k++) full->positions[i][k] = i == 77 ? NAN : 1000 + uniform(&random);
    fail_every_allocation(&host, instance, create_full, full);
    free(full);
    host_stop(&host, instance);
}

static int cancel_at(void *user, const char *stage, double fraction) {
    int *left = user;
    assert_non_null(stage);
    assert_true(fraction >= 0 && fraction <= 1);
    return (*left)-- > 0;
}

static void cancelling_anywhere_leaves_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = calloc(20000, sizeof *positions);
    uint64_t random = 9;
    for (int i = 0; i < 20000; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)uniform(&random);
    pbr_result result = PBR_ERROR_CANCELLED;
    for (int calls = 0; result != PBR_OK; calls++) {
        int left = calls;
        pbr_points *points;
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        desc.count = 20000;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
        desc.flags = PBR_POINTS_ESTIMATE_RADII;
        desc.progress = cancel_at;
        desc.progress_user = &left;
        result = pbr_points_create(instance, &desc, &points);
        assert_true(result == PBR_OK || (result == PBR_ERROR_CANCELLED && !points));
        assert_true(calls < 200);
        pbr_points_release(&points);
    }
    free(positions);
    host_stop(&host, instance);
}

/* More points than one thread looks at: what decides is wherever it is. Positions lose up to 3e-4 as floats, so that the least
 * radius that is not 0 tells whether they may. */
static void radii_are_measured_over_all_points(void **state) {
    (void)state;
    enum { MANY = 70000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 3);
    double(*positions)[3] = calloc(MANY, sizeof *positions);
    float *radii = calloc(MANY, sizeof *radii);
    assert_true(positions && radii);
    for (int i = 0; i < MANY; i++) positions[i][0] = i / 3.0 - MANY / 6.0;
    for (int least = 0; least < MANY; least += 13999) {
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        pbr_points *points;
        for (int i = 0; i < MANY; i++) radii[i] = i % 7 == 0 ? 0 : 2;
        double sum = 2.0 * (MANY - MANY / 7);
        const int most = (least + 30000) % MANY;
        sum += 9 - radii[most] + 0.03f - radii[least];
        radii[least] = 0.03f;
        radii[most] = 9;
        desc.count = MANY;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
        desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
        assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
        assert_true(points->radius_minimum == 0 && points->radius_maximum == 9);
        assert_true(fabs(points->radius_mean - sum / MANY) < 1e-6);
        assert_non_null(points->wide);
        pbr_points_release(&points);
        radii[least] = 2;
        assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
        assert_non_null(points->narrow);
        pbr_points_release(&points);
    }
    free(positions);
    free(radii);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(radii_are_measured_over_all_points),
        cmocka_unit_test(float_positions_are_kept_to_the_bit),
        cmocka_unit_test(doubles_stay_wide_only_where_float_would_move_a_splat),
        cmocka_unit_test(non_finite_points_are_dropped_with_their_attributes),
        cmocka_unit_test(colours_become_srgb_bytes),
        cmocka_unit_test(normals_of_any_format_and_length_are_directions),
        cmocka_unit_test(bounds_enclose_every_position),
        cmocka_unit_test(names_are_cut_between_characters),
        cmocka_unit_test(contract_violations_are_refused),
        cmocka_unit_test(empty_sets_are_points_too),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
        cmocka_unit_test(cancelling_anywhere_leaves_nothing_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
