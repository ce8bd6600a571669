/* POP hierarchies: their shape, balls, codes, and what is built of meshes. SPDX-License-Identifier: MIT */
#include "pop_meshes.h"

#include "core/points.h"
#include "lod/pop_build.h"
#include "lod/pop_sphere.h"
#include "lod/qsplat.h"

/* ---- Shape ---- */

static void node_counts_are_those_of_the_thesis(void **unused) {
    (void)unused;
    static const uint64_t expected[][2] = {{96966, 140657},
                                           {654666, 1003497},
                                           {871414, 1220939},
                                           {1000000, 1349525},
                                           {4000000, 5398101},
                                           {0, 0},
                                           {1, 1},
                                           {2, 3},
                                           {4, 5},
                                           {5, 8}};
    for (size_t i = 0; i < COUNT(expected); i++) {
        struct pop_shape shape;
        pop_shape_of(expected[i][0], &shape);
        assert_int_equal(shape.nodes, expected[i][1]);
    }
}

/* Of n nodes, by halving into floor and ceiling until no more than four are together. */
static uint64_t count_groups(uint64_t n) {
    return n <= 4 ? 1 : count_groups(n / 2) + count_groups(n - n / 2);
}

static void check_links(const struct pop_shape *shape, uint32_t level, uint64_t begin, uint64_t end) {
    uint64_t next = 0;
    for (uint64_t i = begin; i < end; i++) {
        uint64_t first;
        const uint32_t count = pop_children(shape, level, i, &first);
        if (i > begin) assert_int_equal(first, next);
        assert_true(count >= 2 && count <= POP_CHILDREN);
        for (uint32_t c = 0; c < count; c++) assert_int_equal(pop_parent(shape, level - 1, first + c), i);
        next = first + count;
        if (i == 0) assert_int_equal(first, 0);
        if (i + 1 == shape->levels[level].count) assert_int_equal(next, shape->levels[level - 1].count);
    }
}

static void children_and_parents_are_found_from_numbers_alone(void **unused) {
    (void)unused;
    for (uint64_t n = 1; n < 3000; n++) {
        struct pop_shape shape;
        pop_shape_of(n, &shape);
        assert_int_equal(shape.levels[shape.level_count - 1].count, 1);
        assert_int_equal(shape.levels[shape.level_count - 1].first, 0);
        for (uint32_t l = 1; l < shape.level_count; l++) {
            assert_int_equal(shape.levels[l].count, count_groups(shape.levels[l - 1].count));
            assert_int_equal(shape.levels[l - 1].first, shape.levels[l].first + shape.levels[l].count);
            check_links(&shape, l, 0, shape.levels[l].count);
        }
    }
}

static void links_hold_where_numbers_are_largest(void **unused) {
    (void)unused;
    static const uint64_t counts[] = {POP_TRIANGLES_MOST, POP_TRIANGLES_MOST - 1, UINT64_C(5) << 28, (UINT64_C(9) << 27) + 1};
    for (size_t c = 0; c < COUNT(counts); c++) {
        struct pop_shape shape;
        pop_shape_of(counts[c], &shape);
        assert_true(shape.nodes <= UINT32_MAX);
        for (uint32_t l = 1; l < shape.level_count; l++) {
            const uint64_t count = shape.levels[l].count, some = count < 1000 ? count : 1000;
            check_links(&shape, l, 0, some);
            check_links(&shape, l, count / 3, count / 3 + some < count ? count / 3 + some : count);
            check_links(&shape, l, count - some, count);
        }
    }
}

/* The splits of a level cut the leaves where they are split as often: that is why one order serves all levels. */
static void splits_of_levels_are_splits_of_the_leaves(void **unused) {
    (void)unused;
    for (uint64_t n = 2; n < 1200; n++) {
        struct pop_shape shape;
        pop_shape_of(n, &shape);
        for (uint32_t l = 1; l + 1 < shape.level_count; l++)
            for (uint64_t j = 0; j < UINT64_C(1) << shape.levels[l].splits; j++) {
                uint64_t first = j * shape.levels[l].count >> shape.levels[l].splits;
                for (uint32_t below = l; below > 0; below--) pop_children(&shape, below, first, &first);
                assert_int_equal(first, j * n >> shape.levels[l].splits);
            }
    }
}

/* ---- Balls ---- */

static double needed_radius(const double centre[3], const struct ball *balls, int count) {
    double radius = 0;
    for (int i = 0; i < count; i++) {
        const double d[3] = {balls[i].centre[0] - centre[0], balls[i].centre[1] - centre[1], balls[i].centre[2] - centre[2]};
        radius = fmax(radius, length3(d) + balls[i].radius);
    }
    return radius;
}

/* The radius is convex in the centre: if no step of any of many directions makes it less, nor a shorter one, it is the least. The
 * directions are not all there are, so a little is left. */
static void check_least(const struct ball *balls, int count, const struct ball *around, uint64_t *state) {
    const double least = needed_radius(around->centre, balls, count);
    assert_true(around->radius >= least && around->radius <= least * (1 + 1e-12));
    for (double step = 1; step > 1e-4; step /= 3)
        for (int i = 0; i < 60; i++) {
            double moved[3];
            for (int k = 0; k < 3; k++) moved[k] = around->centre[k] + step * around->radius * (2 * uniform(state) - 1);
            assert_true(needed_radius(moved, balls, count) >= least * (1 - 1e-9));
        }
}

static void balls_around_balls_are_the_smallest(void **unused) {
    (void)unused;
    uint64_t state = 3;
    for (int n = 0; n < 4000; n++) {
        struct ball balls[4];
        const int count = 1 + n % 4;
        for (int i = 0; i < count; i++) {
            for (int k = 0; k < 3; k++) balls[i].centre[k] = 2 * uniform(&state) - 1;
            if (n % 5 == 1) balls[i].centre[2] = 0;                                                    /* in a plane */
            if (n % 5 == 2) balls[i].centre[1] = balls[i].centre[2] = balls[i].centre[0];              /* on a line */
            if (n % 5 == 3 && i > 0) memcpy(balls[i].centre, balls[0].centre, sizeof balls[i].centre); /* in one place */
            if (n % 5 == 4)
                for (int k = 0; k < 3; k++) balls[i].centre[k] = balls[i].centre[k] < 0 ? -1 : 1; /* a box's corners */
            balls[i].radius = n % 7 == 0 ? 0 : n % 7 == 1 ? 0.5 : (n % 7 < 4 ? 0.2 : 1.5) * uniform(&state);
        }
        const struct ball around = ball_around(balls, count);
        check_least(balls, count, &around, &state);
    }
}

static void balls_around_triangles_are_the_smallest(void **unused) {
    (void)unused;
    uint64_t state = 4;
    for (int n = 0; n < 1000; n++) {
        struct ball points[3] = {{{0}, 0}};
        double corners[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) corners[i][k] = 2 * uniform(&state) - 1;
        if (n % 4 == 1) memcpy(corners[2], corners[n / 4 % 2], sizeof corners[2]);
        if (n % 4 == 2)
            for (int k = 0; k < 3; k++) corners[n / 4 % 3][k] = (corners[(n / 4 + 1) % 3][k] + corners[(n / 4 + 2) % 3][k]) / 2;
        for (int i = 0; i < 3; i++) memcpy(points[i].centre, corners[i], sizeof corners[i]);
        struct ball around;
        ball_centre_of_triangle((const double(*)[3])corners, around.centre);
        around.radius = ball_radius_around(around.centre, points, 3);
        check_least(points, 3, &around, &state);
    }
    const double place[3][3] = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
    double centre[3];
    ball_centre_of_triangle(place, centre);
    for (int k = 0; k < 3; k++) assert_true(centre[k] == place[0][k]);
}

/* ---- Codes ---- */

static void radii_are_rounded_up_and_no_further_than_need_be(void **unused) {
    (void)unused;
    const struct pop pop = {.radius_step = 0x1p-10f, .position_step = 1};
    struct pop_node node = {.size = 0};
    double before = -1;
    for (uint32_t code = 0; code < 1u << POP_RADIUS_BITS; code++) {
        node.size = (uint16_t)code;
        const double radius = (double)pop_decode_ball(&pop, &node).radius;
        assert_true(radius > before);
        assert_int_equal(pop_encode_radius(&pop, radius), code);
        if (code > 0) assert_int_equal(pop_encode_radius(&pop, before + (radius - before) * 1e-3), code);
        if (code > 0) assert_true(radius - before <= fmax(0x1p-10, radius / 1024));
        before = radius;
    }
    assert_int_equal(pop_encode_radius(&pop, 2 * before), (1u << POP_RADIUS_BITS) - 1);
}

/* Largest at the middle of the octahedron's faces: sqrt(18) / 2 steps of 1 / 127. */
static void normals_are_as_exact_as_their_bits(void **unused) {
    (void)unused;
    uint64_t state = 9;
    double worst = 0;
    for (int n = 0; n < 20000; n++) {
        double v[3];
        float decoded[3];
        struct pop_node node = {.size = 0};
        int16_t code[2];
        for (int k = 0; k < 3; k++) v[k] = n < 27 ? (double)(n / (k == 0 ? 1 : k == 1 ? 3 : 9) % 3 - 1) : 2 * uniform(&state) - 1;
        const double length = length3(v);
        pop_encode_normal(v, node.normal);
        pop_decode_normal(&node, code);
        splat_decode_normal(code, decoded);
        if (!(length > 0)) {
            assert_true(code[0] == SPLAT_NO_NORMAL && code[1] == SPLAT_NO_NORMAL);
            continue;
        }
        double squared = 0;
        for (int k = 0; k < 3; k++) squared += pow(v[k] / length - (double)decoded[k], 2);
        worst = fmax(worst, 2 * asin(sqrt(squared) / 2));
    }
    assert_true(worst > 0.01 && worst < sqrt(18) / 2 / 127);
}

static void cones_are_the_smallest_that_hold_the_angle(void **unused) {
    (void)unused;
    assert_int_equal(pop_encode_cone(0), 0);
    assert_int_equal(pop_encode_cone(asin(1.0 / 16) - 2e-5), 0);
    assert_int_equal(pop_encode_cone(asin(1.0 / 16)), 1);
    assert_int_equal(pop_encode_cone(0.5), 2);
    assert_int_equal(pop_encode_cone(asin(9.0 / 16)), POP_NO_CONE);
    assert_int_equal(pop_encode_cone(3.2), POP_NO_CONE);
}

/* ---- Building ---- */

/* What doubles make of sums of squares. */
static const double ROUNDING = 1e-13;

static bool holds(const struct pop_ball *ball, const double p[3], double radius) {
    double squared = 0;
    for (int k = 0; k < 3; k++) squared += pow(p[k] - (double)ball->centre[k], 2);
    return sqrt(squared) + radius <= (double)ball->radius * (1 + ROUNDING);
}

static void check_nested(const struct pop *pop, const char *name) {
    const struct pop_shape *shape = &pop->shape;
    for (uint64_t t = 0; t < shape->levels[0].count; t++) {
        const struct pop_ball ball = pop_decode_ball(pop, pop_node_at(pop, 0, t));
        for (int c = 0; c < 3; c++) {
            double p[3];
            pop_vertex(pop, pop->triangles[t][c], p);
            if (!holds(&ball, p, 0)) fail_msg("%s: a corner of triangle %llu is outside", name, (unsigned long long)t);
        }
    }
    for (uint32_t l = 1; l < shape->level_count; l++)
        for (uint64_t i = 0; i < shape->levels[l].count; i++) {
            uint64_t first;
            const uint32_t count = pop_children(shape, l, i, &first);
            const struct pop_ball ball = pop_decode_ball(pop, pop_node_at(pop, l, i));
            for (uint32_t c = 0; c < count; c++) {
                const struct pop_ball child = pop_decode_ball(pop, pop_node_at(pop, l - 1, first + c));
                const double p[3] = {(double)child.centre[0], (double)child.centre[1], (double)child.centre[2]};
                if (!holds(&ball, p, (double)child.radius))
                    fail_msg("%s: a child of %u, %llu is outside", name, l, (unsigned long long)i);
            }
        }
}

/* Balls around balls exceed what these hold, over all levels by less than a half. Leaves are too large by no more than two steps:
 * what their centre moved, and the radius' code. */
static void check_tight(const struct pop *pop, const pbr_mesh *mesh, const char *name) {
    double half[3];
    for (int k = 0; k < 3; k++) half[k] = (mesh->maximum[k] - mesh->minimum[k]) / 2;
    const double step = (double)pop->position_step;
    const double root = (double)pop_decode_ball(pop, &pop->nodes[0]).radius;
    if (!(root <= 1.5 * length3(half) + 4 * step)) fail_msg("%s: a root of radius %g, the box has %g", name, root, length3(half));
    for (uint64_t t = 0; t < pop->shape.levels[0].count; t++) {
        struct ball points[3];
        double centre[3], corners[3][3];
        for (int c = 0; c < 3; c++) {
            pop_vertex(pop, pop->triangles[t][c], corners[c]);
            memcpy(points[c].centre, corners[c], sizeof corners[c]);
            points[c].radius = 0;
        }
        ball_centre_of_triangle((const double(*)[3])corners, centre);
        const double radius = needed_radius(centre, points, 3);
        assert_true((double)pop_decode_ball(pop, pop_node_at(pop, 0, t)).radius <= radius * (1 + 1.0 / 1024) + 2 * step);
    }
}

static int compare_triangles(const void *a, const void *b) {
    return memcmp(a, b, sizeof(uint32_t[3]));
}

static void check_triangles(const struct pop *pop, const pbr_mesh *mesh) {
    const size_t count = (size_t)mesh->triangle_count;
    uint32_t(*sorted[2])[3];
    assert_int_equal(pop->shape.level_count > 0 ? pop->shape.levels[0].count : 0, count);
    for (int i = 0; i < 2; i++) {
        sorted[i] = calloc(count + 1, sizeof **sorted);
        assert_non_null(sorted[i]);
        if (count > 0) memcpy(sorted[i], i ? (const void *)pop->triangles : mesh->triangles, count * sizeof **sorted);
        qsort(sorted[i], count, sizeof **sorted, compare_triangles);
    }
    assert_memory_equal(sorted[0], sorted[1], (count + 1) * sizeof **sorted);
    free(sorted[0]);
    free(sorted[1]);
}

/* Records of the mesh's vertices; radii are those of the triangles around, or none. */
static void check_vertices(const struct pop *pop, const pbr_mesh *mesh) {
    const pbr_points *points = mesh->vertices;
    if (mesh->triangle_count == 0) return;
    double *sums = calloc(2 * (size_t)points->count, sizeof *sums);
    assert_non_null(sums);
    assert_int_equal(pop->vertex_count, points->count);
    for (uint64_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            sums[2 * pop->triangles[t][c]] += (double)pop_decode_ball(pop, pop_node_at(pop, 0, t)).radius;
            sums[2 * pop->triangles[t][c] + 1]++;
        }
    for (uint32_t i = 0; i < points->count; i++) {
        double p[3];
        points_position(points, i, p);
        for (int k = 0; k < 3; k++) {
            const double wanted = points->origin[k] + p[k], got = pop->centre[k] + (double)pop->vertices[i].position[k];
            assert_true(fabs(got - wanted) <= 1e-7 * (fabs(wanted - pop->centre[k]) + fabs(pop->centre[k]) * 1e-8));
        }
        const double mean = sums[2 * i + 1] > 0 ? sums[2 * i] / sums[2 * i + 1] : 0;
        assert_true(fabs((double)pop->vertices[i].radius - mean) <= 1e-5 * mean);
        if (points->normals) assert_memory_equal(pop->vertices[i].normal, points->normals[i], sizeof points->normals[i]);
        if (points->colours) assert_memory_equal(pop->vertices[i].colour, points->colours[i], sizeof points->colours[i]);
    }
    free(sums);
}

static void check_cones(const struct pop *pop, const char *name) {
    static const double sines[] = POP_CONE_SINES;
    for (uint64_t t = 0; t < pop->shape.levels[0].count; t++) {
        uint64_t index = t;
        for (uint32_t l = 0; l < pop->shape.level_count; l++) {
            const struct pop_node *node = pop_node_at(pop, l, index);
            int16_t code[2];
            float axis[3];
            pop_decode_normal(node, code);
            splat_decode_normal(code, axis);
            for (int c = 0; c < 3 && pop_cone(node) != POP_NO_CONE; c++) {
                float n[3];
                splat_decode_normal(pop->vertices[pop->triangles[t][c]].normal, n);
                const double dot = (double)(n[0] * axis[0]) + (double)(n[1] * axis[1]) + (double)(n[2] * axis[2]);
                /* Floats; at the narrowest cone 1e-6 of the cosine are 2e-5 radians. */
                if (!(dot >= cos(asin(sines[pop_cone(node)])) - 1e-6)) fail_msg("%s: a normal is outside a cone", name);
            }
            if (l + 1 < pop->shape.level_count) index = pop_parent(&pop->shape, l, index);
        }
    }
}

/* With averages in linear light, by area, 5-6-5 and sRGB: of the root, whose colour is all triangles'. */
static void check_colour(const struct pop *pop, const char *name) {
    double sum[3] = {0, 0, 0}, weight = 0, extent = 0;
    for (int k = 0; k < 3; k++) extent = fmax(extent, (double)pop->position_step * 2 * POP_POSITION_CODES);
    for (uint64_t t = 0; pop->has_colours && t < pop->shape.levels[0].count; t++) {
        double p[3][3], u[3], v[3], cross[3];
        for (int c = 0; c < 3; c++) pop_vertex(pop, pop->triangles[t][c], p[c]);
        for (int k = 0; k < 3; k++) u[k] = (p[1][k] - p[0][k]) / extent, v[k] = (p[2][k] - p[0][k]) / extent;
        cross3(u, v, cross);
        const double area = fmax(length3(cross), 1e-15);
        weight += 3 * area;
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) {
                const double srgb = pop->vertices[pop->triangles[t][c]].colour[k] / 255.0;
                sum[k] += area * (srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4));
            }
    }
    uint8_t colour[4];
    qsplat_decode_colour(pop->nodes[0].colour, colour);
    for (int k = 0; k < 3; k++) {
        const double linear = sum[k] / weight;
        const double srgb = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
        /* Half a step of five bits, and rounding to 8 bits on the way. */
        if (pop->has_colours && !(fabs(colour[k] / 255.0 - srgb) <= 0.5 / 31 + 1.5 / 255)) fail_msg("%s: the root's colour", name);
        if (!pop->has_colours) assert_int_equal(colour[k], 255);
    }
}

static void check_built(const struct pop *pop, const pbr_mesh *mesh, const char *name) {
    check_triangles(pop, mesh);
    if (mesh->triangle_count == 0) return;
    check_nested(pop, name);
    check_tight(pop, mesh, name);
    check_cones(pop, name);
    check_colour(pop, name);
    static const double centre[3] = {0, 0, 0};
    const struct pop_ball root = pop_decode_ball(pop, &pop->nodes[0]);
    const struct pop_ball all = {{(float)centre[0], (float)centre[1], (float)centre[2]}, float_above(pop->radius)};
    const double p[3] = {(double)root.centre[0], (double)root.centre[1], (double)root.centre[2]};
    assert_true(holds(&all, p, (double)root.radius));
}

static void hierarchies_of_any_mesh_hold_it(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(pop_mesh_kinds); i++) {
        struct pop pop;
        pbr_mesh *mesh = make_pop_mesh(instance, &pop_mesh_kinds[i]);
        assert_int_equal(pop_build(mesh, NULL, &pop), PBR_OK);
        check_built(&pop, mesh, pop_mesh_kinds[i].name);
        check_vertices(&pop, mesh);
        pbr_mesh_release(&mesh);
        pop_free(instance, &pop);
    }
    host_stop(&host, instance);
}

static void large_hierarchies_have_the_nodes_of_the_thesis(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kinds[] = {{"96,966", TORUS, 96966, 0}, {"654,666", GRID, 654666, 0}};
    static const uint64_t expected[] = {140657, 1003497};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct pop pop;
        pbr_mesh *mesh = make_pop_mesh(instance, &kinds[i]);
        assert_int_equal(pop_build(mesh, NULL, &pop), PBR_OK);
        assert_int_equal(pop.shape.nodes, expected[i]);
        check_nested(&pop, kinds[i].name);
        check_tight(&pop, mesh, kinds[i].name);
        pop_free(instance, &pop);
        pbr_mesh_release(&mesh);
    }
    host_stop(&host, instance);
}

/* Neighbours are together: a group's ball is some leaves wide, not as wide as the mesh. */
static void groups_are_of_neighbours(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a grid", GRID, 20000, 0};
    struct host host;
    struct pop pop;
    pbr_instance *instance = host_start(&host, 2);
    pbr_mesh *mesh = make_pop_mesh(instance, &kind);
    assert_int_equal(pop_build(mesh, NULL, &pop), PBR_OK);
    double means[POP_LEVELS] = {0};
    for (uint32_t l = 0; l < pop.shape.level_count; l++)
        for (uint64_t i = 0; i < pop.shape.levels[l].count; i++)
            means[l] += (double)pop_decode_ball(&pop, pop_node_at(&pop, l, i)).radius / (double)pop.shape.levels[l].count;
    /* Four squares side by side have twice the radius; long groups somewhat more. */
    for (uint32_t l = 1; l < pop.shape.level_count; l++) assert_true(means[l] < 2.3 * means[l - 1]);
    pop_free(instance, &pop);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

static void threads_do_not_matter(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kinds[] = {{"a torus", TORUS, 30011, WITH_COLOURS}, {"any", SOUP, 9000, 0}};
    static const uint32_t threads[] = {1, 2, 5};
    for (size_t k = 0; k < COUNT(kinds); k++) {
        struct host hosts[COUNT(threads)];
        pbr_instance *instances[COUNT(threads)];
        struct pop pops[COUNT(threads)];
        for (size_t i = 0; i < COUNT(threads); i++) {
            instances[i] = host_start(&hosts[i], threads[i]);
            pbr_mesh *mesh = make_pop_mesh(instances[i], &kinds[k]);
            assert_int_equal(pop_build(mesh, NULL, &pops[i]), PBR_OK);
            pbr_mesh_release(&mesh);
            assert_memory_equal(pops[i].nodes, pops[0].nodes, pops[0].shape.nodes * sizeof *pops->nodes);
            assert_memory_equal(pops[i].triangles, pops[0].triangles, kinds[k].count * sizeof *pops->triangles);
        }
        for (size_t i = 0; i < COUNT(threads); i++) {
            pop_free(instances[i], &pops[i]);
            host_stop(&hosts[i], instances[i]);
        }
    }
}

static pbr_result build_once(pbr_instance *instance, void *mesh) {
    struct pop pop;
    const pbr_result result = pop_build(mesh, NULL, &pop);
    pop_free(instance, &pop);
    return result;
}

static void failing_allocations_leave_nothing_behind(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a torus", TORUS, 6000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_mesh *mesh = make_pop_mesh(instance, &kind);
    fail_every_allocation(&host, instance, build_once, mesh);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

static int32_t stop_at(void *user, const char *stage, double fraction) {
    int *left = user;
    (void)stage;
    assert_true(fraction >= 0 && fraction <= 1);
    return --*left > 0;
}

static void building_can_be_cancelled_anywhere(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a torus", TORUS, 6000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_mesh *mesh = make_pop_mesh(instance, &kind);
    int reports = 1;
    for (pbr_result result = PBR_ERROR_CANCELLED; result != PBR_OK; reports++) {
        int left = reports;
        const struct progress progress = {stop_at, &left};
        struct pop pop;
        result = pop_build(mesh, &progress, &pop);
        assert_int_equal(result, left > 0 ? PBR_OK : PBR_ERROR_CANCELLED);
        pop_free(instance, &pop);
    }
    assert_true(reports > 4);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

/* Values for which each guess of the median by nine items, wherever the guesses before left them, is among the smallest there are.
 * The other values are random. */
static void make_guesses_poor(struct pop_item *items, uint32_t count, uint64_t *state) {
    enum { GUESSES = 12, GAS = 1 << 20 };
    uint32_t *place = calloc(count, sizeof *place); /* of each place, which item is there */
    int32_t next = 0;
    assert_non_null(place);
    for (uint32_t i = 0; i < count; i++) place[i] = i, items[i].at[0] = GAS;
    for (uint32_t guess = 0, first = 0; guess < GUESSES; guess++) {
        const uint32_t left = count - first;
        int32_t sampled[9];
        for (uint32_t s = 0; s < 9; s++) {
            struct pop_item *item = &items[place[first + (uint32_t)((uint64_t)s * (left - 1) / 8)]];
            if (item->at[0] == GAS) item->at[0] = next++;
            sampled[s] = item->at[0];
        }
        int32_t middles[3];
        for (int g = 0; g < 3; g++) {
            const int32_t *v = sampled + 3 * g, low = v[0] < v[1] ? v[0] : v[1], high = v[0] < v[1] ? v[1] : v[0];
            middles[g] = v[2] < low ? low : v[2] > high ? high : v[2];
        }
        const int32_t low = middles[0] < middles[1] ? middles[0] : middles[1],
                      high = middles[0] < middles[1] ? middles[1] : middles[0];
        const int32_t value = middles[2] < low ? low : middles[2] > high ? high : middles[2];
        uint32_t below = first, above = count;
        for (uint32_t i = first; i < above;) { /* as the division swaps them */
            const int32_t v = items[place[i]].at[0];
            const uint32_t to = v < value ? below : above - 1, kept = place[i];
            if (v == value) {
                i++;
                continue;
            }
            place[i] = place[to];
            place[to] = kept;
            if (v < value) i++, below++;
            else above--;
        }
        first = above;
    }
    for (uint32_t i = 0; i < count; i++)
        if (items[i].at[0] == GAS) items[i].at[0] = next + (int32_t)(1000000 * uniform(state));
    free(place);
}

/* Of a pattern for which guesses of the median are poor. Every split is at the median of a longest side, however ties fall. */
static void orders_split_at_medians(void **unused) {
    (void)unused;
    enum { N = 10007 };
    static struct pop_item items[N];
    struct host host;
    uint64_t state = 8;
    pbr_instance *instance = host_start(&host, 1);
    for (int pattern = 0; pattern < 6; pattern++) {
        for (int32_t i = 0; i < N; i++) {
            const int32_t organ = i % 2 ? i : N - i, any = (int32_t)(1000000 * uniform(&state));
            const int32_t x = pattern == 0   ? 7
                              : pattern == 1 ? organ
                              : pattern == 2 ? i / 100
                              : pattern == 3 ? any
                              : i < N / 2    ? i
                                             : N - i;
            items[i] = (struct pop_item){{x, pattern == 3 ? any / 7 : 0, 0}, (uint32_t)i};
        }
        if (pattern == 5) make_guesses_poor(items, N, &state);
        assert_int_equal(pop_order(instance, items, N, NULL), PBR_OK);
        bool seen[N] = {false};
        for (int32_t i = 0; i < N; i++) {
            assert_false(seen[items[i].triangle]);
            seen[items[i].triangle] = true;
        }
        for (uint32_t splits = 0; N >> splits > 4; splits++)
            for (uint64_t j = 0; j < UINT64_C(1) << splits; j++) {
                const uint64_t begin = j * N >> splits, middle = (2 * j + 1) * N >> (splits + 1), end = (j + 1) * N >> splits;
                int32_t low = INT32_MAX, high = INT32_MIN;
                for (uint64_t i = begin; i < middle; i++) high = items[i].at[0] > high ? items[i].at[0] : high;
                for (uint64_t i = middle; i < end; i++) low = items[i].at[0] < low ? items[i].at[0] : low;
                if (pattern != 3 || splits < 2) assert_true(high <= low); /* there the other side gets longer */
            }
    }
    host_stop(&host, instance);
}

static void too_large_meshes_are_an_error(void **unused) {
    (void)unused;
    struct host host;
    struct pop pop;
    pbr_instance *instance = host_start(&host, 1);
    const double positions[3][3] = {{0, 0, 0}, {3e18, 0, 0}, {0, 1, 0}};
    const uint32_t indices[3] = {0, 1, 2};
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    desc.vertex_count = 3;
    desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT64, .components = 3};
    desc.indices = indices;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = 1;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    assert_int_equal(pop_build(mesh, NULL, &pop), PBR_ERROR_LIMIT);
    pop_free(instance, &pop);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(node_counts_are_those_of_the_thesis),
        cmocka_unit_test(children_and_parents_are_found_from_numbers_alone),
        cmocka_unit_test(links_hold_where_numbers_are_largest),
        cmocka_unit_test(splits_of_levels_are_splits_of_the_leaves),
        cmocka_unit_test(balls_around_balls_are_the_smallest),
        cmocka_unit_test(balls_around_triangles_are_the_smallest),
        cmocka_unit_test(radii_are_rounded_up_and_no_further_than_need_be),
        cmocka_unit_test(normals_are_as_exact_as_their_bits),
        cmocka_unit_test(cones_are_the_smallest_that_hold_the_angle),
        cmocka_unit_test(hierarchies_of_any_mesh_hold_it),
        cmocka_unit_test(large_hierarchies_have_the_nodes_of_the_thesis),
        cmocka_unit_test(groups_are_of_neighbours),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
        cmocka_unit_test(building_can_be_cancelled_anywhere),
        cmocka_unit_test(orders_split_at_medians),
        cmocka_unit_test(too_large_meshes_are_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
