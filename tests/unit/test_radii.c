/* Estimated radii. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/radii.h"

enum { SIDE = 60, POINTS = SIDE * SIDE };

static float positions[POINTS][3];

static pbr_points *estimate(pbr_instance *instance, uint64_t count, uint32_t neighbours, float scale) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    desc.radius_neighbours = neighbours;
    desc.radius_scale = scale;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

/* A plane sampled at spacing 0.5 per axis, each sample moved by up to `jitter` spacings. */
static void sample_plane(double jitter) {
    uint64_t random = 5;
    for (int i = 0; i < POINTS; i++) {
        positions[i][0] = (float)(0.5 * (i % SIDE + jitter * (2 * uniform(&random) - 1)));
        positions[i][1] = (float)(0.5 * (i / SIDE + jitter * (2 * uniform(&random) - 1)));
        positions[i][2] = 0;
    }
}

/* Share of the plane, five samples from its border, that no disc covers. */
static double uncovered_share(const pbr_points *points) {
    uint64_t random = 6;
    int bare = 0;
    enum { PROBES = 4000 };
    for (int t = 0; t < PROBES; t++) {
        double x = 2.5 + (SIDE - 11) * 0.5 * uniform(&random), y = 2.5 + (SIDE - 11) * 0.5 * uniform(&random);
        bool covered = false;
        for (int i = 0; i < POINTS && !covered; i++) covered = hypot(positions[i][0] - x, positions[i][1] - y) <= points->radii[i];
        if (!covered) bare++;
    }
    return (double)bare / PROBES;
}

static void estimated_radii_close_even_samples_for_any_k(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0);
    for (uint32_t k = 3; k <= 32; k++) {
        pbr_points *points = estimate(instance, POINTS, k, 0);
        /* In the middle, where neighbours lie on all sides: at least the grid's 0.5 / sqrt(2). */
        assert_true(points->radii[POINTS / 2 + SIDE / 2] >= 0.35355f);
        pbr_points_release(&points);
    }
    pbr_points *points = estimate(instance, POINTS, 0, 0);
    const double expected = 0.5 * sqrt(2) * sqrt(3.14159265358979 / 8); /* the 8th neighbour is a diagonal away */
    assert_true(fabs(points->radii[POINTS / 2 + SIDE / 2] - expected) < 1e-6);
    assert_true(uncovered_share(points) == 0);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void estimated_radii_close_uneven_samples(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double jitters[] = {0.2, 0.35, 0.5}, shares[] = {0, 0.001, 0.01};
    for (size_t i = 0; i < COUNT(jitters); i++) {
        sample_plane(jitters[i]);
        pbr_points *points = estimate(instance, POINTS, 0, 0);
        double share = uncovered_share(points);
        print_message("jitter %.2f: %.4f uncovered\n", jitters[i], share);
        assert_true(share <= shares[i]);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static void isolated_points_are_capped(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0.1);
    positions[7][2] = 1e6f;
    pbr_points *points = estimate(instance, POINTS, 0, 0);
    assert_true(points->radii[7] > 0 && points->radii[7] <= 8 * 0.5f);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void coincident_points_get_the_smallest_positive_radius(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0.1);
    for (int i = 0; i < 20; i++) memcpy(positions[i], positions[0], sizeof positions[i]);
    pbr_points *points = estimate(instance, POINTS, 0, 0);
    float smallest = INFINITY;
    for (int i = 20; i < POINTS; i++) smallest = fminf(smallest, points->radii[i]);
    for (int i = 0; i < 20; i++) assert_true(points->radii[i] == smallest);
    assert_true(smallest > 0);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void tiny_sets_have_finite_radii(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0);
    for (uint64_t count = 0; count <= 10; count++) {
        pbr_points *points = estimate(instance, count, 0, 0);
        for (uint64_t i = 0; i < count; i++)
            assert_true(count == 1 ? points->radii[i] == 0 : points->radii[i] > 0 && isfinite(points->radii[i]));
        pbr_points_release(&points);
    }
    memset(positions, 0, sizeof positions);
    pbr_points *points = estimate(instance, 100, 0, 0);
    for (int i = 0; i < 100; i++) assert_true(points->radii[i] == 0);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void scale_is_a_factor(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0.3);
    pbr_points *plain = estimate(instance, POINTS, 6, 0), *twice = estimate(instance, POINTS, 6, 2);
    for (int i = 0; i < POINTS; i++) assert_true(twice->radii[i] == 2 * plain->radii[i]);
    pbr_points_release(&plain);
    pbr_points_release(&twice);
    host_stop(&host, instance);
}

static pbr_result estimate_again(pbr_instance *instance, void *user) {
    static float radii[POINTS];
    (void)instance;
    return radii_estimate(user, 8, 1, NULL, radii);
}

static void failing_allocations_leave_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0);
    pbr_points *points = estimate(instance, POINTS, 0, 0);
    fail_every_allocation(&host, instance, estimate_again, points);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(estimated_radii_close_even_samples_for_any_k),
        cmocka_unit_test(estimated_radii_close_uneven_samples),
        cmocka_unit_test(isolated_points_are_capped),
        cmocka_unit_test(coincident_points_get_the_smallest_positive_radius),
        cmocka_unit_test(tiny_sets_have_finite_radii),
        cmocka_unit_test(scale_is_a_factor),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
