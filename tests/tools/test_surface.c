/* The surfaces of `pbr synth`. SPDX-License-Identifier: MIT */
#include "../../tools/surface.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { KINDS = 5 };

static void assert_near(double value, double wanted, double tolerance) {
    if (!(fabs(value - wanted) <= tolerance)) fail_msg("%.12g is not %.12g", value, wanted);
}

static double dot(const float a[3], const float b[3]) {
    return (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
}

static void subtract(const float a[3], const float b[3], float out[3]) {
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

static void cross(const float a[3], const float b[3], float out[3]) {
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Of 0..1, the same in every run. */
static double next_number(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) / (double)(UINT64_C(1) << 53);
}

static void points_lie_on_their_surface(void **state) {
    (void)state;
    for (int kind = 0; kind < SURFACE_TERRAIN; kind++)
        for (uint64_t i = 0; i < 1000; i++) {
            struct surface_point point = surface_spread(&(struct surface){(enum surface_kind)kind, 0}, i, 1000);
            const float *p = point.position;
            if (kind == SURFACE_SPHERE) assert_near(dot(p, p), 1, 1e-6);
            else if (kind == SURFACE_TORUS) assert_near(hypot(hypot((double)p[0], (double)p[2]) - 1, (double)p[1]), 0.4, 1e-6);
            else assert_true(p[1] == 0 && fabsf(p[0]) <= 1 && fabsf(p[2]) <= 1);
        }
}

/* Against differences of neighbours; along ds x dt. */
static void normals_are_those_of_the_surface(void **state) {
    (void)state;
    uint64_t seed = 1;
    for (int kind = 0; kind < KINDS; kind++)
        for (int i = 0; i < 1000; i++) {
            const struct surface surface = {(enum surface_kind)kind, 3};
            /* Steps that floats resolve, over which the normal turns by less than the tolerance. */
            const double step = 1e-3, s = next_number(&seed), t = 0.02 + 0.96 * next_number(&seed);
            struct surface_point point = surface_at(&surface, s, t);
            struct surface_point left = surface_at(&surface, s - step, t), right = surface_at(&surface, s + step, t);
            struct surface_point below = surface_at(&surface, s, t - step), above = surface_at(&surface, s, t + step);
            float along_s[3], along_t[3], normal[3];
            subtract(right.position, left.position, along_s);
            subtract(above.position, below.position, along_t);
            cross(along_s, along_t, normal);
            assert_near(dot(point.normal, point.normal), 1, 1e-6);
            assert_true(dot(point.normal, normal) / sqrt(dot(normal, normal)) > 0.999);
        }
}

/* As many points as area, to one point and what the lattice adds around the axis. */
static void points_are_spread_by_area(void **state) {
    (void)state;
    enum { COUNT = 10000 };
    int below = 0, outer = 0, quarter = 0;
    for (uint64_t i = 0; i < COUNT; i++) {
        struct surface_point sphere = surface_spread(&(struct surface){SURFACE_SPHERE, 0}, i, COUNT);
        struct surface_point torus = surface_spread(&(struct surface){SURFACE_TORUS, 0}, i, COUNT);
        struct surface_point plane = surface_spread(&(struct surface){SURFACE_PLANE, 0}, i, COUNT);
        below += sphere.position[1] < 0.5f;                        /* Archimedes: three quarters */
        outer += hypotf(torus.position[0], torus.position[2]) > 1; /* 1 / 2 + 0.4 / pi */
        quarter += plane.position[0] < 0 && plane.position[2] < 0;
    }
    assert_near(below, 0.75 * COUNT, 1);
    assert_near(outer, (0.5 + 0.4 / 3.14159265358979) * COUNT, 2);
    assert_near(quarter, 0.25 * COUNT, 10);
}

static bool is_near_border(enum surface_kind kind, const float p[3], double spacing) {
    if (kind == SURFACE_SPHERE || kind == SURFACE_TORUS) return false;
    return fmax(fabs((double)p[0]), fabs((double)p[2])) > 1 - 1.5 * spacing;
}

static bool is_inside_a_disc(const struct surface_point *points, size_t count, const float p[3]) {
    for (size_t i = 0; i < count; i++) {
        float away[3];
        subtract(p, points[i].position, away);
        if (dot(away, away) <= (double)points[i].radius * (double)points[i].radius) return true;
    }
    return false;
}

static void radii_close_the_surface(void **state) {
    (void)state;
    const size_t counts[] = {1, 2, 5, 20, 50, 333, 2584};
    uint64_t seed = 9;
    for (int kind = 0; kind < KINDS; kind++)
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++) {
            const struct surface surface = {(enum surface_kind)kind, 0};
            const size_t count = counts[k];
            struct surface_point *points = malloc(count * sizeof *points);
            assert_non_null(points);
            /* The terrain has no shape to speak of where few points sample it. */
            if (kind == SURFACE_TERRAIN && count < 2000) {
                free(points);
                continue;
            }
            for (size_t i = 0; i < count; i++) points[i] = surface_spread(&surface, i, count);
            for (int i = 0; i < 4000; i++) {
                double s = next_number(&seed), t = next_number(&seed);
                /* Every other one where the lattice ends: the poles, the torus's seam. */
                if (i % 2) t = i % 4 == 1 ? t * 2 / (double)count : 1 - t * 2 / (double)count;
                if (t < 0 || t > 1) continue;
                struct surface_point place = surface_at(&surface, s, t);
                if (is_near_border(surface.kind, place.position, 2 / sqrt((double)count))) continue;
                if (!is_inside_a_disc(points, count, place.position))
                    fail_msg("%s of %zu points has a hole at s %g, t %g", surface_names[kind], count, s, t);
            }
            free(points);
        }
}

static void terrain_depends_on_its_seed_alone(void **state) {
    (void)state;
    int equal = 0;
    for (uint64_t i = 0; i < 500; i++) {
        struct surface_point a = surface_spread(&(struct surface){SURFACE_TERRAIN, 5}, i, 500);
        struct surface_point b = surface_spread(&(struct surface){SURFACE_TERRAIN, 5}, i, 500);
        struct surface_point c = surface_spread(&(struct surface){SURFACE_TERRAIN, 6}, i, 500);
        assert_memory_equal(a.position, b.position, sizeof a.position);
        assert_true(fabsf(a.position[1]) < 0.6f); /* 0.3 / (1 - 0.4) */
        equal += a.position[1] == c.position[1];
    }
    assert_true(equal < 5);
}

static void chosen_grids_have_exactly_their_triangles(void **state) {
    (void)state;
    struct surface_grid grid;
    assert_true(grid_choose(SURFACE_SPHERE, 1000000, &grid));
    assert_int_equal(grid.columns, 1000);
    assert_int_equal(grid.rows, 500);
    assert_true(grid_choose(SURFACE_PLANE, 20000, &grid));
    assert_int_equal(grid.columns, 100);
    assert_int_equal(grid.rows, 100);
    for (int kind = 0; kind < KINDS; kind++)
        for (uint64_t count = 1; count < 5000; count++) {
            if (!grid_choose((enum surface_kind)kind, count, &grid)) continue;
            assert_int_equal(grid_triangle_count(&grid), count);
            assert_true(grid_is_possible(&grid));
        }
    assert_true(grid_choose(SURFACE_TORUS, 4000000, &grid));
    assert_int_equal(grid_triangle_count(&grid), 4000000);
    /* Odd; too few; twice a prime, whose only grid is a ribbon. */
    assert_false(grid_choose(SURFACE_PLANE, 20001, &grid));
    assert_false(grid_choose(SURFACE_SPHERE, 4, &grid));
    assert_false(grid_choose(SURFACE_TORUS, 16, &grid));
    assert_false(grid_choose(SURFACE_PLANE, 2 * 10007, &grid));
    assert_false(grid_choose(SURFACE_PLANE, 0, &grid));
}

static int compare_edges(const void *a, const void *b) {
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Directed edges, sorted: 3 a triangle. */
static uint64_t *make_edges(const struct surface_grid *grid) {
    uint64_t count = grid_triangle_count(grid), *edges = malloc(3 * count * sizeof *edges);
    assert_non_null(edges);
    for (uint64_t i = 0; i < count; i++) {
        uint32_t corners[3];
        grid_triangle(grid, i, corners);
        for (int k = 0; k < 3; k++) {
            assert_true(corners[k] < grid_vertex_count(grid));
            edges[3 * i + (uint64_t)k] = (uint64_t)corners[k] << 32 | corners[(k + 1) % 3];
        }
    }
    qsort(edges, 3 * count, sizeof *edges, compare_edges);
    return edges;
}

/* Each edge once in each direction; none twice; the border's in one direction only. */
static void grids_are_closed_where_the_surface_is(void **state) {
    (void)state;
    const uint32_t sizes[][2] = {{3, 1}, {3, 3}, {7, 4}, {20, 30}};
    for (int kind = 0; kind < KINDS; kind++)
        for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
            const struct surface_grid grid = {(enum surface_kind)kind, sizes[i][0], sizes[i][1]};
            if (!grid_is_possible(&grid)) continue;
            uint64_t count = 3 * grid_triangle_count(&grid), border = 0, used = 0, *edges = make_edges(&grid);
            for (uint64_t e = 0; e < count; e++) {
                uint64_t reverse = edges[e] << 32 | edges[e] >> 32;
                assert_true(e == 0 || edges[e] != edges[e - 1]);
                border += !bsearch(&reverse, edges, count, sizeof *edges, compare_edges);
                used += e == 0 || edges[e] >> 32 != edges[e - 1] >> 32;
            }
            bool is_open = kind != SURFACE_SPHERE && kind != SURFACE_TORUS;
            assert_int_equal(border, is_open ? 2 * (grid.columns + grid.rows) : 0);
            assert_int_equal(used, grid_vertex_count(&grid));
            /* Euler's number: 2 for the sphere, 0 for the torus. */
            if (!is_open)
                assert_int_equal((int64_t)used - (int64_t)(count / 2) + (int64_t)(count / 3), kind == SURFACE_SPHERE ? 2 : 0);
            free(edges);
        }
}

static void triangles_have_area_and_face_along_their_normals(void **state) {
    (void)state;
    for (int kind = 0; kind < KINDS; kind++) {
        const struct surface surface = {(enum surface_kind)kind, 0};
        const struct surface_grid grid = {surface.kind, 24, 17};
        for (uint64_t i = 0; i < grid_triangle_count(&grid); i++) {
            uint32_t corners[3];
            struct surface_point points[3];
            float edges[2][3], normal[3];
            grid_triangle(&grid, i, corners);
            for (int k = 0; k < 3; k++) points[k] = grid_vertex(&grid, &surface, corners[k]);
            for (int k = 0; k < 2; k++) subtract(points[k + 1].position, points[0].position, edges[k]);
            cross(edges[0], edges[1], normal);
            /* The sphere's slimmest triangles, at the poles, have 2 (2 pi / 24) (pi / 18)^2 / 2. */
            assert_true(sqrt(dot(normal, normal)) > 1e-3);
            for (int k = 0; k < 3; k++) assert_true(dot(normal, points[k].normal) > 0);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_lie_on_their_surface),
        cmocka_unit_test(normals_are_those_of_the_surface),
        cmocka_unit_test(points_are_spread_by_area),
        cmocka_unit_test(radii_close_the_surface),
        cmocka_unit_test(terrain_depends_on_its_seed_alone),
        cmocka_unit_test(chosen_grids_have_exactly_their_triangles),
        cmocka_unit_test(grids_are_closed_where_the_surface_is),
        cmocka_unit_test(triangles_have_area_and_face_along_their_normals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
