/* The k-d tree against brute force. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/neighbours.h"

enum { POINTS = 1500 };

struct candidate {
    double squared;
    uint64_t index;
};

static int nearer(const void *a, const void *b) {
    const struct candidate *x = a, *y = b;
    if (x->squared != y->squared) return x->squared < y->squared ? -1 : 1;
    return x->index < y->index ? -1 : 1;
}

static pbr_points *make_points(pbr_instance *instance, const double (*positions)[3], uint64_t count) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

static uint32_t brute_force(const pbr_points *points, const double q[3], uint64_t skip, uint32_t k, struct candidate *sorted) {
    uint32_t n = 0;
    for (uint64_t i = 0; i < points->count; i++) {
        double p[3];
        if (i == skip) continue;
        points_position(points, i, p);
        for (int c = 0; c < 3; c++) p[c] -= q[c];
        sorted[n++] = (struct candidate){p[0] * p[0] + p[1] * p[1] + p[2] * p[2], i};
    }
    qsort(sorted, n, sizeof *sorted, nearer);
    return n < k ? n : k;
}

static struct candidate scratch[POINTS];

static void check_query(const pbr_points *points, const struct kd_tree *tree, const double q[3], uint32_t k, uint64_t skip) {
    double squared[NEIGHBOURS_MOST];
    uint64_t indices[NEIGHBOURS_MOST];
    uint32_t wanted = brute_force(points, q, skip, k, scratch);
    assert_int_equal(kd_tree_nearest(tree, q, k, skip, squared, indices), wanted);
    for (uint32_t i = 0; i < wanted; i++) {
        double p[3];
        points_position(points, indices[i], p);
        for (int c = 0; c < 3; c++) p[c] -= q[c];
        assert_true(squared[i] == scratch[i].squared && indices[i] != skip);
        assert_true(squared[i] == p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        for (uint32_t j = 0; j < i; j++) assert_true(indices[j] != indices[i]);
    }
}

/* The distances exactly; of equal distances any point will do, but none twice. */
static void check_cloud(const double (*positions)[3], uint64_t count) {
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_points *points = make_points(instance, positions, count);
    struct kd_tree *tree;
    uint64_t random = 11;
    const uint32_t ks[] = {1, 3, 8, NEIGHBOURS_MOST};
    assert_int_equal(kd_tree_create(points, NULL, &tree), PBR_OK);
    for (uint64_t i = 0; i < count; i += 1 + count / 150) {
        double q[3];
        points_position(points, i, q);
        check_query(points, tree, q, ks[i % COUNT(ks)], i);
        for (int c = 0; c < 3; c++) q[c] += uniform(&random) - 0.5;
        check_query(points, tree, q, ks[i % COUNT(ks)], UINT64_MAX);
    }
    kd_tree_destroy(points, tree);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static double cloud[POINTS][3];

static void nearest_neighbours_equal_brute_force_on_random_points(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) cloud[i][k] = uniform(&random);
    check_cloud((const double(*)[3])cloud, POINTS);
    for (uint64_t few = 1; few < 40; few++) check_cloud((const double(*)[3])cloud, few);
}

static void nearest_neighbours_equal_brute_force_on_a_grid(void **state) {
    (void)state;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0, rest = i * 7 % POINTS; k < 3; k++, rest /= 11) cloud[i][k] = rest % 11;
    check_cloud((const double(*)[3])cloud, POINTS);
}

static void nearest_neighbours_equal_brute_force_on_coincident_points(void **state) {
    (void)state;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) cloud[i][k] = i % 5 == 0 && k == 0 ? i % 3 : 0.25;
    check_cloud((const double(*)[3])cloud, POINTS);
}

static void nearest_neighbours_equal_brute_force_on_a_line(void **state) {
    (void)state;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) cloud[i][k] = k == 1 ? i * 0.1 : 3;
    check_cloud((const double(*)[3])cloud, POINTS);
}

struct sweep {
    const pbr_points *points;
    atomic_int visited[POINTS];
    atomic_int wrong;
};

static void sweep_visit(void *user, uint64_t point, uint32_t found, const double *squared, const uint64_t *indices) {
    struct sweep *sweep = user;
    atomic_fetch_add(&sweep->visited[point], 1);
    if (found != 4) atomic_fetch_add(&sweep->wrong, 1);
    for (uint32_t i = 0; i < found; i++)
        if (indices[i] == point || (i > 0 && squared[i] < squared[i - 1])) atomic_fetch_add(&sweep->wrong, 1);
}

static int cancel(void *user, const char *stage, double fraction) {
    (void)user;
    (void)stage;
    return fraction > 0 ? 0 : 1;
}

static void every_point_is_visited_once_and_never_its_own_neighbour(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    uint64_t random = 2;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) cloud[i][k] = uniform(&random);
    pbr_points *points = make_points(instance, (const double(*)[3])cloud, POINTS);
    struct kd_tree *tree;
    struct sweep *sweep = calloc(1, sizeof *sweep);
    struct progress stop = {cancel, NULL};
    assert_int_equal(kd_tree_create(points, NULL, &tree), PBR_OK);
    assert_int_equal(kd_tree_for_each(tree, 4, NULL, sweep_visit, sweep), PBR_OK);
    for (int i = 0; i < POINTS; i++) assert_int_equal(atomic_load(&sweep->visited[i]), 1);
    assert_int_equal(atomic_load(&sweep->wrong), 0);
    assert_int_equal(kd_tree_for_each(tree, 4, &stop, sweep_visit, sweep), PBR_ERROR_CANCELLED);
    kd_tree_destroy(points, tree);
    assert_int_equal(kd_tree_create(points, &stop, &tree), PBR_ERROR_CANCELLED);
    assert_null(tree);
    free(sweep);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void count_visit(void *user, uint64_t point, uint32_t found, const double *squared, const uint64_t *indices) {
    (void)point;
    (void)squared;
    (void)indices;
    if (found == 8) atomic_fetch_add((atomic_size_t *)user, 1);
}

/* Scanners write missing points as (0, 0, 0). In quadratic time so many would take hours. */
static void many_coincident_points_are_built_and_searched_in_n_log_n(void **state) {
    (void)state;
    enum { MANY = 400000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    double(*same)[3] = calloc(MANY, sizeof *same);
    pbr_points *points = make_points(instance, (const double(*)[3])same, MANY);
    struct kd_tree *tree;
    assert_int_equal(kd_tree_create(points, NULL, &tree), PBR_OK);
    atomic_size_t visited = 0;
    assert_int_equal(kd_tree_for_each(tree, 8, NULL, count_visit, &visited), PBR_OK);
    assert_int_equal(visited, MANY);
    kd_tree_destroy(points, tree);
    free(same);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nearest_neighbours_equal_brute_force_on_random_points),
        cmocka_unit_test(nearest_neighbours_equal_brute_force_on_a_grid),
        cmocka_unit_test(nearest_neighbours_equal_brute_force_on_coincident_points),
        cmocka_unit_test(nearest_neighbours_equal_brute_force_on_a_line),
        cmocka_unit_test(every_point_is_visited_once_and_never_its_own_neighbour),
        cmocka_unit_test(many_coincident_points_are_built_and_searched_in_n_log_n),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
