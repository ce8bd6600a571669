/* Meshes, and the points that cover them. SPDX-License-Identifier: MIT */
#include "support.h"

#include <stdio.h>

#include "core/matrix.h"
#include "core/mesh.h"
#include "core/triangles.h"

static pbr_mesh_desc mesh_desc(const float (*positions)[3], uint64_t vertices, const uint32_t (*triangles)[3], uint64_t count) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    desc.vertex_count = vertices;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = count;
    return desc;
}

static pbr_mesh_info info_of(const pbr_mesh *mesh) {
    pbr_mesh_info info = PBR_MESH_INFO_INIT;
    assert_int_equal(pbr_mesh_get_info(mesh, &info), PBR_OK);
    return info;
}

static void edges_of(const double p[3][3], double edges[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) edges[i][k] = p[(i + 1) % 3][k] - p[i][k];
}

/* In one of the lanes, in turn; the others hold a triangle that is a point. */
static size_t place_triangle(const double edges[3][3], struct triangles *triangles) {
    static size_t turn;
    lanes corners[3][3] = {{{0}}};
    const size_t lane = turn++ % LANES;
    for (int k = 0; k < 3; k++) corners[1][k][lane] = edges[0][k], corners[2][k][lane] = -edges[2][k];
    triangles_measure((const lanes(*)[3])corners, triangles);
    for (size_t l = 0; l < LANES; l++) assert_true(l == lane || triangles->is_degenerate[l]);
    return lane;
}

static double covering_radius(const double edges[3][3]) {
    struct triangles triangles;
    lanes covering;
    const size_t lane = place_triangle(edges, &triangles);
    triangles_covering_radius(&triangles, covering);
    for (size_t l = 0; l < LANES; l++) assert_true(l == lane || (covering[l] >= 0 && covering[l] <= 0));
    return covering[lane];
}

static double hiding_radius(const double edges[3][3], const double normals[3][3]) {
    struct triangles triangles;
    lanes covering, hiding, n[3][3] = {{{0}}};
    const size_t lane = place_triangle(edges, &triangles);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) n[i][k][lane] = normals[i][k];
    triangles_covering_radius(&triangles, covering);
    triangles_hiding_radius(&triangles, (const lanes(*)[3])n, covering, hiding);
    for (size_t l = 0; l < LANES; l++) assert_true(l == lane || (hiding[l] >= 0 && hiding[l] <= 0));
    return hiding[lane];
}

/* Of all shapes, down to needles. */
static void angles_equal_those_of_cosines(void **state) {
    (void)state;
    uint64_t random = 3;
    struct triangles triangles;
    lanes angles[3];
    for (int t = 0; t < 2000; t++) {
        double p[3][3], edges[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) p[i][k] = (k == 1 && t % 2 == 0 ? pow(10, -t % 6) : 1) * uniform(&random);
        edges_of((const double(*)[3])p, edges);
        const size_t lane = place_triangle((const double(*)[3])edges, &triangles);
        triangles_angles(&triangles, angles);
        for (int i = 0; i < 3; i++) {
            const double *a = edges[i], *b = edges[(i + 2) % 3];
            const double cosine = -dot3(a, b) / (length3(a) * length3(b));
            /* An arc cosine near 0 and pi is off by 1e-7. */
            assert_true(fabs(angles[i][lane] - acos(fmax(fmin(cosine, 1), -1))) < 1.17e-5);
        }
    }
}

/* Or a vertex that only they use would have no normal. */
static void tips_of_needles_have_an_angle(void **state) {
    (void)state;
    struct triangles triangles;
    lanes angles[3];
    for (double width = 1e-11; width < 1e-4; width *= 3)
        for (int turn = 0; turn < 3; turn++) {
            const double corner[3][3] = {{0, 0, 0}, {width, 0, 0}, {1, 1, 0}}; /* atan(1) at the first */
            double p[3][3], edges[3][3];
            for (int i = 0; i < 3; i++) memcpy(p[(i + turn) % 3], corner[i], sizeof p[0]);
            edges_of((const double(*)[3])p, edges);
            const size_t lane = place_triangle((const double(*)[3])edges, &triangles);
            assert_false(triangles.is_degenerate[lane]);
            triangles_angles(&triangles, angles);
            assert_true(fabs(angles[(2 + turn) % 3][lane] / (width / 2) - 1) < 2e-4);
        }
}

/* Largest, over a fine set of points of the triangle, distance to the nearest corner. */
static double sampled_radius(const double p[3][3], int steps) {
    double largest = 0;
    for (int i = 0; i <= steps; i++)
        for (int j = 0; i + j <= steps; j++) {
            const double w[3] = {(double)i / steps, (double)j / steps, (double)(steps - i - j) / steps};
            double nearest = INFINITY;
            for (int c = 0; c < 3; c++) {
                double squared = 0;
                for (int k = 0; k < 3; k++) {
                    double q = w[0] * p[0][k] + w[1] * p[1][k] + w[2] * p[2][k] - p[c][k];
                    squared += q * q;
                }
                nearest = fmin(nearest, squared);
            }
            largest = fmax(largest, nearest);
        }
    return sqrt(largest);
}

/* Every sample is covered; and the radius is tight: the worst point is at most half a sampling cell, longest side / steps, from a
 * sample, and the distance changes no faster than the place. */
static void covering_radius_equals_brute_force(void **state) {
    (void)state;
    enum { STEPS = 150 };
    uint64_t random = 1;
    int obtuse = 0;
    for (int t = 0; t < 200; t++) {
        double p[3][3], edges[3][3], longest = 0;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) p[i][k] = (k == 1 && t % 4 == 0 ? 0.02 : 1) * uniform(&random);
        edges_of((const double(*)[3])p, edges);
        for (int i = 0; i < 3; i++) {
            double squared = edges[i][0] * edges[i][0] + edges[i][1] * edges[i][1] + edges[i][2] * edges[i][2];
            longest = fmax(longest, sqrt(squared));
        }
        double radius = covering_radius((const double(*)[3])edges), sampled = sampled_radius((const double(*)[3])p, STEPS);
        assert_true(sampled <= radius * (1 + 1e-12));
        assert_true(radius <= sampled + longest / STEPS);
        if (radius <= longest / 2) obtuse++; /* the circumradius of an acute triangle is more than half its longest side */
    }
    assert_true(obtuse > 40 && obtuse < 180); /* both rules were tried */
}

/* The smallest radius at which one of the discs is met by the ray along `direction` through the point that is `at` relative to the
 * first corner. */
static double radius_met(const double edges[3][3], const double normals[3][3], const double at[3], const double direction[3]) {
    double least = INFINITY;
    for (int i = 0; i < 3; i++) {
        double from[3], met[3];
        for (int k = 0; k < 3; k++) from[k] = at[k] - (i == 1 ? edges[0][k] : i == 2 ? -edges[2][k] : 0);
        const double along = dot3(from, normals[i]) / dot3(direction, normals[i]);
        for (int k = 0; k < 3; k++) met[k] = from[k] - along * direction[k];
        least = fmin(least, length3(met));
    }
    return least;
}

/* From the z axis: up to the angle with the least cosine; every fourth time at that angle, for what is worst there. */
static void random_direction(double cosine, bool extreme, uint64_t *random, double out[3]) {
    const double z = extreme ? cosine : cosine + (1 - cosine) * uniform(random), turn = 6.283185307179586 * uniform(random);
    out[0] = sqrt(fmax(1 - z * z, 0)) * cos(turn);
    out[1] = sqrt(fmax(1 - z * z, 0)) * sin(turn);
    out[2] = z;
}

/* The largest factor on `radius` that a ray needs to meet a disc; directions up to 75 degrees off the z axis, the triangle's
 * normal. */
static double largest_factor(const double edges[3][3], const double normals[3][3], double radius, uint64_t *random) {
    double largest = 0;
    for (int i = 0; i < 400; i++) {
        double at[3], direction[3];
        const double a = sqrt(uniform(random)), b = uniform(random);
        for (int k = 0; k < 3; k++) at[k] = a * (1 - b) * edges[0][k] - a * b * edges[2][k];
        random_direction(0.25881904510252074, i % 4 == 0, random, direction);
        largest = fmax(largest, radius_met(edges, normals, at, direction) / radius);
    }
    return largest;
}

/* Two per cent of them and far fewer of the rays need any of the room, which is for what the radius leaves out: terms of second
 * order in tan 75 times the tilt, with the factor 4. Flat discs get no room but rounding. */
static void tilted_discs_hide_their_triangle_to_first_order(void **state) {
    (void)state;
    enum { TRIANGLES = 3000 };
    uint64_t random = 3;
    for (int degrees = 0; degrees <= 4; degrees += 2) { /* the largest growth cuts off what larger tilts ask for */
        const double cone = degrees * 0.017453292519943295, tilt = tan(cone) * 3.7320508075688773;
        int in_need = 0, in_need_without = 0;
        for (int t = 0; t < TRIANGLES; t++) {
            double p[3][3] = {{0}}, edges[3][3], normals[3][3];
            for (int i = 0; i < 3; i++) {
                for (int k = 0; k < 2; k++) p[i][k] = uniform(&random);
                random_direction(cos(cone), false, &random, normals[i]);
            }
            edges_of((const double(*)[3])p, edges);
            const double(*e)[3] = (const double(*)[3])edges, (*n)[3] = (const double(*)[3])normals;
            const double factor = largest_factor(e, n, hiding_radius(e, n), &random);
            assert_true(factor <= 1 + 1e-9 + 4 * tilt * tilt);
            in_need += factor > 1 + 1e-9;
            in_need_without += largest_factor(e, n, covering_radius(e), &random) > 1 + 1e-9;
        }
        assert_true(in_need <= (degrees == 0 ? 0 : TRIANGLES / 50));
        assert_true(degrees == 0 ? in_need_without == 0 : in_need_without > TRIANGLES / 6); /* the growth is needed */
    }
}

/* Then they form a surface without gaps, which no direction sees through. The tangent planes of the unit sphere at the corners meet
 * at the face normal m divided by m.p; the radius leaves out terms of fourth order, 0.2^4 / 8 of it. */
static void discs_on_a_sphere_have_a_point_in_common(void **state) {
    (void)state;
    uint64_t random = 4;
    for (int t = 0; t < 300; t++) {
        double p[3][3], edges[3][3];
        for (int i = 0; i < 3; i++) {
            const double turn = 2.0943951023931953 * (i + 0.4 * uniform(&random));
            p[i][0] = 0.2 * cos(turn), p[i][1] = 0.2 * sin(turn), p[i][2] = sqrt(1 - 0.04);
        }
        edges_of((const double(*)[3])p, edges);
        const double radius = hiding_radius((const double(*)[3])edges, (const double(*)[3])p);
        const double apart = hypot(0.2, 1 / p[0][2] - p[0][2]);
        assert_true(apart <= radius && radius <= apart * (1 + 0.0003));
    }
}

static void sharp_edges_do_not_grow_discs(void **state) {
    (void)state;
    const double edges[3][3] = {{1, 0, 0}, {-0.5, 0.8, 0}, {-0.5, -0.8, 0}};
    const double cases[][3][3] = {
        {{0, 0, 1}, {0, 0, 1}, {0, 1.43, 1}}, /* 55 degrees off */
        {{0, 0, 1}, {0, 0, 1}, {0, 1, 0}},
        {{0, 0, 1}, {0, 0, 1}, {0, 0, 0}},
        {{0, 0, 2}, {0, 0, -1}, {0, 0, 3}}, /* flat, of any length and on either side */
    };
    for (size_t i = 0; i < COUNT(cases); i++)
        assert_true(fabs(hiding_radius(edges, cases[i]) / covering_radius(edges) - 1) < 1e-12);
    const double bent[3][3] = {{0.8, 0, 1}, {0.8, 0, 1}, {0, -0.8, 1}};
    assert_true(hiding_radius(edges, bent) <= 1.3 * covering_radius(edges) * (1 + 1e-12));
}

static void degenerate_triangles_have_the_radius_of_their_line(void **state) {
    (void)state;
    const struct {
        double p[3][3];
        double radius;
    } cases[] = {
        {{{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}, 0},
        {{{0, 0, 0}, {0, 0, 0}, {4, 0, 0}}, 2},
        {{{0, 0, 0}, {4, 0, 0}, {4, 0, 0}}, 2},
        {{{4, 0, 0}, {0, 0, 0}, {4, 0, 0}}, 2},
        {{{0, 0, 0}, {1, 1, 1}, {4, 4, 4}}, 1.5 * 1.7320508075688772},
        {{{0, 0, 0}, {10, 0, 0}, {3, 0, 0}}, 3.5},
        {{{0, 0, 0}, {3, 0, 0}, {0, 4, 0}}, 2.5}, /* right angle: both rules meet */
        {{{0, 0, 0}, {1, 0, 0}, {1, 1e-9, 0}}, 0.5},
        {{{0, 0, 0}, {1, 0, 0}, {1, 1e-162, 0}}, 0.5},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        double edges[3][3];
        edges_of(cases[i].p, edges);
        assert_true(fabs(covering_radius((const double(*)[3])edges) - cases[i].radius) < 1e-12);
    }
}

static const float square[6][3] = {{9, 9, 9}, {0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {0, 3, 0}, {NAN, 0, 0}};

static void points_are_the_referenced_vertices_in_order(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const uint32_t triangles[][3] = {{1, 2, 3}, {1, 3, 4}, {2, 3, 5}, {1, 1, 2}};
    const float intensity[6] = {0, 1, 2, 3, 4, 5};
    pbr_scalar scalar = {"intensity", {intensity, 0, PBR_FORMAT_FLOAT32, 1}};
    pbr_mesh_desc desc = mesh_desc(square, 6, triangles, 4);
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    desc.origin[0] = 100;
    pbr_mesh *mesh;
    pbr_points *points;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    pbr_mesh_info info = info_of(mesh);
    assert_int_equal(info.vertex_count, 6);
    assert_int_equal(info.triangle_count, 3);
    assert_int_equal(info.dropped_triangle_count, 1);
    assert_int_equal(info.unreferenced_count, 2);
    assert_int_equal(info.degenerate_count, 1);
    assert_false(info.has_normals);
    assert_true(info.minimum[0] == 100 && info.maximum[0] == 103 && info.maximum[1] == 3 && info.maximum[2] == 0);
    double places[6][3];
    pbr_mesh_copy_desc back = PBR_MESH_COPY_DESC_INIT;
    back.vertex_count = 6;
    back.positions = &places[0][0];
    assert_int_equal(pbr_mesh_copy(mesh, &back), PBR_OK);
    assert_true(places[0][0] == 109 && places[0][2] == 9);
    assert_true(places[5][0] == 100 && places[5][1] == 0 && places[5][2] == 0); /* of the vertex that has no place */
    pbr_mesh_to_points_desc convert = PBR_MESH_TO_POINTS_DESC_INIT;
    convert.radius_scale = 2;
    assert_int_equal(pbr_mesh_to_points(mesh, &convert, &points), PBR_OK);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_ERROR_BUSY);
    pbr_mesh_release(&mesh);
    double positions[4][3];
    float normals[4][3], radii[4], values[4];
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = &positions[0][0];
    copy.normals = &normals[0][0];
    copy.radii = radii;
    copy.scalar = values;
    assert_int_equal(points->count, 4);
    assert_string_equal(pbr_points_scalar_name(points, 0), "intensity");
    assert_int_equal(pbr_points_copy(points, 0, 4, &copy), PBR_OK);
    for (int i = 0; i < 4; i++) {
        assert_true(positions[i][0] == 100 + square[i + 1][0] && positions[i][1] == square[i + 1][1]);
        assert_true(values[i] == i + 1);
        assert_true(normals[i][2] > 0.99999f);
        assert_true(fabs(radii[i] - 2 * sqrt(18) / 2) < 1e-5);
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* A cube's corner with one face cut in two: weights by angle make the normal the diagonal all the same. */
static void averaged_normals_do_not_depend_on_how_a_face_is_cut(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float corner[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}};
    const uint32_t triangles[][3] = {{0, 1, 4}, {0, 4, 2}, {0, 2, 3}, {0, 3, 1}};
    pbr_mesh_desc desc = mesh_desc(corner, 5, triangles, 4);
    pbr_mesh *mesh;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    float n[15];
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.normals = n;
    assert_int_equal(pbr_points_copy(mesh->vertices, 0, 5, &copy), PBR_OK);
    for (int k = 0; k < 3; k++) assert_true(fabs(n[k] - 0.57735) < 1e-4);
    assert_true(n[14] > 0.99999f);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

static void given_normals_and_short_indices_are_used(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float normals[6][3] = {{0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {0}};
    const uint16_t triangles[2][3] = {{1, 2, 3}, {1, 3, 4}};
    pbr_mesh_desc desc = mesh_desc(square, 6, NULL, 2);
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT16;
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    pbr_mesh *mesh;
    pbr_points *points;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    assert_true(info_of(mesh).has_normals);
    assert_int_equal(pbr_mesh_to_points(mesh, NULL, &points), PBR_OK);
    float n[12];
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.normals = n;
    assert_int_equal(pbr_points_copy(points, 0, 4, &copy), PBR_OK);
    for (int i = 0; i < 4; i++) assert_true(n[3 * i] > 0.99999f);
    pbr_points_release(&points);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

static void wrong_indices_are_refused_by_name(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const uint32_t triangles[][3] = {{1, 2, 3}, {1, 6, 4}};
    pbr_mesh *mesh;
    pbr_mesh_desc desc = mesh_desc(square, 6, triangles, 2);
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_INVALID_ARGUMENT);
    assert_null(mesh);
    assert_non_null(strstr(host.text, "triangle 1 "));
    desc = mesh_desc(square, 6, triangles, UINT64_MAX / 3);
    assert_int_not_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    desc = mesh_desc(square, 6, NULL, 1);
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_INVALID_ARGUMENT);
    desc = mesh_desc(square, 6, triangles, 1);
    desc.index_format = PBR_FORMAT_INT32;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_INVALID_ARGUMENT);
    desc = mesh_desc(NULL, 0, triangles, 1);
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_INVALID_ARGUMENT);
    host_stop(&host, instance);
}

static void empty_meshes_give_no_points(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_mesh_desc empty = mesh_desc(NULL, 0, NULL, 0), loose = mesh_desc(square, 6, NULL, 0);
    empty.origin[0] = 10; /* which is no place of it */
    const pbr_mesh_desc *cases[] = {&empty, &loose};
    for (size_t i = 0; i < COUNT(cases); i++) {
        pbr_mesh *mesh;
        pbr_points *points;
        assert_int_equal(pbr_mesh_create(instance, cases[i], &mesh), PBR_OK);
        assert_true(info_of(mesh).minimum[0] == 0 && info_of(mesh).maximum[0] == 0);
        assert_int_equal(pbr_mesh_to_points(mesh, NULL, &points), PBR_OK);
        assert_int_equal(points->count, 0);
        pbr_points_release(&points);
        pbr_mesh_release(&mesh);
    }
    host_stop(&host, instance);
}

/* Eight triangles at once are the same as each alone. */
static void lanes_do_not_mix(void **state) {
    (void)state;
    uint64_t random = 11;
    for (int t = 0; t < 200; t++) {
        lanes corners[3][3], normals[3][3], covering, hiding, angles[3];
        struct triangles triangles;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                for (size_t l = 0; l < LANES; l++) {
                    corners[i][k][l] = l % 4 == 0 && k == 2 ? 0 : uniform(&random);
                    normals[i][k][l] = (k == 2) + (l % 2 ? 0.1 : 2) * (uniform(&random) - 0.5);
                }
        triangles_measure((const lanes(*)[3])corners, &triangles);
        triangles_angles(&triangles, angles);
        triangles_covering_radius(&triangles, covering);
        triangles_hiding_radius(&triangles, (const lanes(*)[3])normals, covering, hiding);
        for (size_t l = 0; l < LANES; l++) {
            double p[3][3], edges[3][3], n[3][3];
            struct triangles alone;
            lanes found[3];
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++) p[i][k] = corners[i][k][l], n[i][k] = normals[i][k][l];
            edges_of((const double(*)[3])p, edges);
            const size_t lane = place_triangle((const double(*)[3])edges, &alone);
            triangles_angles(&alone, found);
            /* Corners come from edges again: a few units in the last place. */
            for (int i = 0; i < 3; i++) assert_true(fabs(found[i][lane] - angles[i][l]) < 1e-9);
            assert_true(fabs(covering_radius((const double(*)[3])edges) / covering[l] - 1) < 1e-9);
            assert_true(fabs(hiding_radius((const double(*)[3])edges, (const double(*)[3])n) / hiding[l] - 1) < 1e-9);
        }
    }
}

/* ---- Many triangles ---- */

enum { SIDE = 401, FIELD_VERTICES = SIDE * SIDE, FIELD_TRIANGLES = 2 * (SIDE - 1) * (SIDE - 1) };

/* A bumpy field: more triangles than two batches have, some of them far larger than the mean, some vertices that are no places. */
struct field {
    float (*positions)[3];
    uint32_t (*triangles)[3];
};

static struct field make_field(void) {
    struct field field = {malloc(FIELD_VERTICES * sizeof *field.positions), malloc(FIELD_TRIANGLES * sizeof *field.triangles)};
    uint64_t random = 5;
    assert_true(field.positions && field.triangles);
    for (int i = 0; i < FIELD_VERTICES; i++) {
        const double x = i % SIDE, y = i / SIDE;
        field.positions[i][0] = (float)(x + 0.6 * uniform(&random) + (x > 200 ? (x - 200) * (x - 200) / 40 : 0));
        field.positions[i][1] = (float)(y + 0.6 * uniform(&random));
        field.positions[i][2] = uniform(&random) < 0.001 ? NAN : (float)(3 * sin(x / 9) * cos(y / 7) + 0.3 * uniform(&random));
    }
    for (int t = 0; t < FIELD_TRIANGLES; t += 2) {
        const uint32_t a = (uint32_t)(t / 2 / (SIDE - 1) * SIDE + t / 2 % (SIDE - 1));
        const uint32_t two[2][3] = {{a, a + 1, a + SIDE}, {a + 1, a + SIDE + 1, a + SIDE}};
        memcpy(field.triangles[t], two, sizeof two);
    }
    return field;
}

static bool corners_of_field(const struct field *field, int t, double p[3][3]) {
    bool there = true;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            p[i][k] = (double)field->positions[field->triangles[t][i]][k];
            there &= isfinite(p[i][k]);
        }
    return there;
}

/* One triangle after the other. */
static void expect_normals(const struct field *field, const float (*normals)[3]) {
    double(*sums)[3] = calloc(FIELD_VERTICES, sizeof *sums), p[3][3], edges[3][3], normal[3];
    assert_non_null(sums);
    for (int t = 0; t < FIELD_TRIANGLES; t++) {
        if (!corners_of_field(field, t, p)) continue;
        edges_of((const double(*)[3])p, edges);
        cross3(edges[0], edges[1], normal);
        for (int i = 0; i < 3; i++) {
            const double *a = edges[i], *b = edges[(i + 2) % 3], angle = acos(-dot3(a, b) / (length3(a) * length3(b)));
            for (int k = 0; k < 3; k++) sums[field->triangles[t][i]][k] += angle * normal[k] / length3(normal);
        }
    }
    for (int v = 0; v < FIELD_VERTICES; v++) {
        double off = 0;
        const double length = length3(sums[v]);
        for (int k = 0; k < 3 && length > 0; k++) off = fmax(off, fabs(sums[v][k] / length - (double)normals[v][k]));
        assert_true(off < 1.2e-4); /* 6.5e-5 of the code, and angles of up to six faces that are off by 1.2e-5 */
    }
    free(sums);
}

/* By the functions for one triangle, of the mesh's own normals. */
static void expect_radii(const struct field *field, const float (*normals)[3], const pbr_points *points) {
    float *radii = calloc(FIELD_VERTICES, sizeof *radii);
    double p[3][3], edges[3][3], n[3][3], mean = 0;
    int kept = 0, capped = 0;
    uint64_t at = 0;
    assert_non_null(radii);
    for (int pass = 0; pass < 2; pass++) {
        for (int t = 0; t < FIELD_TRIANGLES; t++) {
            if (!corners_of_field(field, t, p)) continue;
            edges_of((const double(*)[3])p, edges);
            const double covering = covering_radius((const double(*)[3])edges);
            if (pass == 0) mean += covering, kept++;
            if (pass == 0) continue;
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++) n[i][k] = (double)normals[field->triangles[t][i]][k];
            const double hiding = hiding_radius((const double(*)[3])edges, (const double(*)[3])n);
            capped += hiding > 3 * mean && covering < 3 * mean;
            const double radius = 1.5 * fmax(covering, fmin(hiding, 3 * mean));
            for (int i = 0; i < 3; i++) radii[field->triangles[t][i]] = fmaxf(radii[field->triangles[t][i]], (float)radius);
        }
        if (pass == 0) mean /= kept;
    }
    assert_true(capped > 100);
    for (int v = 0; v < FIELD_VERTICES; v++)
        if (radii[v] > 0) assert_true(at < points->count && fabsf(points->radii[at++] / radii[v] - 1) < 1e-6f);
    assert_int_equal(at, points->count);
    free(radii);
}

static void many_triangles_are_the_same_for_any_number_of_threads(void **state) {
    (void)state;
    const uint32_t threads[] = {1, 3, 100};
    const struct field field = make_field();
    float(*normals)[3] = malloc(FIELD_VERTICES * sizeof *normals), *first = NULL;
    assert_non_null(normals);
    for (size_t i = 0; i < COUNT(threads); i++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads[i]);
        const pbr_mesh_desc desc =
            mesh_desc((const float(*)[3])field.positions, FIELD_VERTICES, (const uint32_t(*)[3])field.triangles, FIELD_TRIANGLES);
        pbr_mesh_to_points_desc to = PBR_MESH_TO_POINTS_DESC_INIT;
        pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
        pbr_mesh *mesh;
        pbr_points *points;
        to.radius_scale = 1.5f;
        assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
        assert_int_equal(pbr_mesh_to_points(mesh, &to, &points), PBR_OK);
        copy.normals = normals[0];
        assert_int_equal(pbr_points_copy(mesh->vertices, 0, FIELD_VERTICES, &copy), PBR_OK);
        if (i == 0) {
            expect_normals(&field, (const float(*)[3])normals);
            expect_radii(&field, (const float(*)[3])normals, points);
            first = malloc(4 * FIELD_VERTICES * sizeof *first);
            assert_non_null(first);
            memcpy(first, normals, 3 * FIELD_VERTICES * sizeof *first);
            memcpy(first + 3 * FIELD_VERTICES, points->radii, points->count * sizeof *first);
        }
        assert_memory_equal(first, normals, 3 * FIELD_VERTICES * sizeof *first);
        assert_memory_equal(first + 3 * FIELD_VERTICES, points->radii, points->count * sizeof *first);
        pbr_points_release(&points);
        pbr_mesh_release(&mesh);
        host_stop(&host, instance);
    }
    free(field.positions);
    free(field.triangles);
    free(normals);
    free(first);
}

/* With the normals that they made themselves, triangles that are given normals make the same points. */
static void given_normals_grow_radii_alike(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const struct field field = make_field();
    float(*normals)[3] = malloc(FIELD_VERTICES * sizeof *normals);
    pbr_mesh_desc desc =
        mesh_desc((const float(*)[3])field.positions, FIELD_VERTICES, (const uint32_t(*)[3])field.triangles, FIELD_TRIANGLES);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    pbr_mesh *meshes[2];
    pbr_points *points[2];
    assert_non_null(normals);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(pbr_mesh_create(instance, &desc, &meshes[i]), PBR_OK);
        assert_int_equal(pbr_mesh_to_points(meshes[i], NULL, &points[i]), PBR_OK);
        copy.normals = normals[0];
        assert_int_equal(pbr_points_copy(meshes[0]->vertices, 0, FIELD_VERTICES, &copy), PBR_OK);
        desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    }
    assert_true(meshes[1]->given_normals && points[0]->count == points[1]->count);
    for (uint64_t i = 0; i < points[0]->count; i++) assert_true(fabsf(points[1]->radii[i] / points[0]->radii[i] - 1) < 1e-3f);
    for (int i = 0; i < 2; i++) {
        pbr_points_release(&points[i]);
        pbr_mesh_release(&meshes[i]);
    }
    free(field.positions);
    free(field.triangles);
    free(normals);
    host_stop(&host, instance);
}

/* ---- Progress ---- */

struct told {
    int count[2], left; /* of each stage; reports until it is cancelled */
    double last[2];
};

static int listen(void *user, const char *stage, double fraction) {
    struct told *told = user;
    const int i = strcmp(stage, "covering triangles") == 0;
    if (i == 0 && strcmp(stage, "copying triangles") != 0) return 1;
    assert_true(fraction >= told->last[i] && fraction <= 1);
    told->last[i] = fraction;
    told->count[i]++;
    return told->left-- > 0;
}

/* However many triangles there are; and they can be cancelled at any time. */
static void progress_is_told_a_few_dozen_times(void **state) {
    (void)state;
    enum { MANY = 3 << 20 };
    static const uint32_t corners[3] = {0, 1, 2};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_mesh_desc desc = mesh_desc(square, 3, NULL, MANY);
    pbr_mesh_to_points_desc to = PBR_MESH_TO_POINTS_DESC_INIT;
    uint32_t(*triangles)[3] = malloc(MANY * sizeof *triangles);
    pbr_mesh *mesh = NULL;
    pbr_points *points = NULL;
    assert_non_null(triangles);
    for (int t = 0; t < MANY; t++) memcpy(triangles[t], corners, sizeof corners);
    desc.indices = triangles;
    desc.progress = to.progress = listen;
    struct told told = {.left = 1000};
    desc.progress_user = to.progress_user = &told;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    assert_int_equal(pbr_mesh_to_points(mesh, &to, &points), PBR_OK);
    for (int i = 0; i < 2; i++) assert_true(told.count[i] >= 10 && told.count[i] <= 34 && told.last[i] >= 1);
    pbr_points_release(&points);
    told = (struct told){.left = 5};
    assert_int_equal(pbr_mesh_to_points(mesh, &to, &points), PBR_ERROR_CANCELLED);
    pbr_mesh_release(&mesh);
    told = (struct told){.left = 5};
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_CANCELLED);
    assert_null(mesh);
    free(triangles);
    host_stop(&host, instance);
}

/* Of several in one batch the first, whichever thread meets which. */
static void the_first_of_many_wrong_triangles_is_named(void **state) {
    (void)state;
    static const int wrong[] = {300000, 280001, 280000, 270001};
    struct host host;
    pbr_instance *instance = host_start(&host, 3);
    const struct field field = make_field();
    const pbr_mesh_desc desc =
        mesh_desc((const float(*)[3])field.positions, FIELD_VERTICES, (const uint32_t(*)[3])field.triangles, FIELD_TRIANGLES);
    for (size_t w = 0; w < COUNT(wrong); w++) {
        pbr_mesh *mesh;
        char name[32];
        field.triangles[wrong[w]][w % 3] = FIELD_VERTICES;
        snprintf(name, sizeof name, "triangle %d ", wrong[w]);
        assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_ERROR_INVALID_ARGUMENT);
        assert_non_null(strstr(host.text, name));
    }
    free(field.positions);
    free(field.triangles);
    host_stop(&host, instance);
}

static pbr_result convert_square(pbr_instance *instance, void *user) {
    const uint32_t triangles[][3] = {{1, 2, 3}, {1, 3, 4}, {2, 3, 5}};
    pbr_mesh_desc desc = mesh_desc(square, 6, triangles, 3);
    pbr_mesh *mesh;
    pbr_points *points = NULL;
    (void)user;
    pbr_result result = pbr_mesh_create(instance, &desc, &mesh);
    if (result == PBR_OK) result = pbr_mesh_to_points(mesh, NULL, &points);
    pbr_points_release(&points);
    pbr_mesh_release(&mesh);
    return result;
}

static void failing_allocations_leave_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    fail_every_allocation(&host, instance, convert_square, NULL);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(angles_equal_those_of_cosines),
        cmocka_unit_test(tips_of_needles_have_an_angle),
        cmocka_unit_test(lanes_do_not_mix),
        cmocka_unit_test(covering_radius_equals_brute_force),
        cmocka_unit_test(tilted_discs_hide_their_triangle_to_first_order),
        cmocka_unit_test(discs_on_a_sphere_have_a_point_in_common),
        cmocka_unit_test(sharp_edges_do_not_grow_discs),
        cmocka_unit_test(degenerate_triangles_have_the_radius_of_their_line),
        cmocka_unit_test(points_are_the_referenced_vertices_in_order),
        cmocka_unit_test(averaged_normals_do_not_depend_on_how_a_face_is_cut),
        cmocka_unit_test(given_normals_and_short_indices_are_used),
        cmocka_unit_test(wrong_indices_are_refused_by_name),
        cmocka_unit_test(many_triangles_are_the_same_for_any_number_of_threads),
        cmocka_unit_test(given_normals_grow_radii_alike),
        cmocka_unit_test(progress_is_told_a_few_dozen_times),
        cmocka_unit_test(the_first_of_many_wrong_triangles_is_named),
        cmocka_unit_test(empty_meshes_give_no_points),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
