/* Normal fields of sequential point trees against closed forms, and as part of hierarchies. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include "core/matrix.h"
#include "core/normal_field.h"
#include "lod/spt_build.h"

/* Of a field at the rim: normals are wrong by 6.5e-5 rad (splat.h), and count twice, as a child's and the node's own; a leaf's
 * field, whose neighbours lie within a radius, by up to six times that (test_normal_field.c). */
#define NOISE (6 * 6.5e-5 + NORMAL_FIELD_UNIT)

/* What damping takes off, as part of the field. It is 1/512 of 12 m, m the least mean of x x^T over the children's discs. Those are
 * a third as large as the node's or larger, so m is 0.028 at least, and a level takes 0.6 % off; its own part of m is a half at
 * most where it is that small, so what levels below took adds up to as much again. */
#define DAMPED 0.012

enum { MOST_POINTS = 60000 };

static double positions[MOST_POINTS][3], normals[MOST_POINTS][3];
static float radii[MOST_POINTS];

static pbr_points *make_points(pbr_instance *instance, uint64_t count) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

/* An entry of a tree with fields. */
struct node {
    double n[3], t[3], b[3], radius;
    bool is_leaf;
    struct normal_field field;
};

static struct node node_of(const struct spt *spt, uint32_t c, uint32_t i) {
    const struct spt_entry *entry = &spt->entries[c][i];
    struct node node = {
        .radius = (double)spt_decode_radius(&spt->chunks[c], entry), .is_leaf = entry->error == 0, .field = spt->fields[c][i]};
    float n[3];
    splat_decode_normal(entry->normal, n);
    for (int k = 0; k < 3; k++) node.n[k] = (double)n[k];
    disc_tangents(node.n, node.t, node.b);
    return node;
}

/* By how much the field changes the normal at `offset` radii from the centre. */
static void change_at(const struct node *node, const double offset[3], double out[3]) {
    double a[2], b[2];
    normal_field_decode(&node->field, a, b);
    const double u = dot3(offset, node->t), v = dot3(offset, node->b);
    for (int k = 0; k < 3; k++) out[k] = (u * a[0] + v * b[0]) * node->t[k] + (u * a[1] + v * b[1]) * node->b[k];
}

/* The change of the normal per unit of length, object space: out = m offset. */
typedef double change[3][3];

/* The farthest that a field is at the rim from a change, in the node's plane. */
static double field_error(const struct node *node, change m) {
    double worst = 0;
    for (int s = 0; s < 8; s++) {
        double offset[3], found[3];
        for (int k = 0; k < 3; k++) offset[k] = cos(0.8 * s) * node->t[k] + sin(0.8 * s) * node->b[k];
        change_at(node, offset, found);
        for (int k = 0; k < 3; k++) found[k] -= node->radius * dot3(m[k], offset);
        worst = fmax(worst, hypot(dot3(found, node->t), dot3(found, node->b)));
    }
    return worst;
}

/* Evenly along a spiral. */
static void sample_sphere(uint64_t count, double radius, double side, double factor) {
    for (uint64_t i = 0; i < count; i++) {
        const double z = 1 - (2 * (double)i + 1) / (double)count, a = 2.399963229728653 * (double)i, r = sqrt(1 - z * z);
        const double n[3] = {r * cos(a), r * sin(a), z};
        for (int k = 0; k < 3; k++) {
            positions[i][k] = radius * n[k];
            normals[i][k] = side * n[k];
        }
        radii[i] = (float)(radius * factor * sqrt(4 * 3.14159265358979 / (double)count));
    }
}

/* Where the change of normals is the same everywhere, and `curvature` at most, each node's field is it: but for damping, noise, and
 * the depth of discs below the surface, r^2 / 4 R in the mean: of children half as large it makes 1 / R larger by its q^2 / 16.
 * Nodes as large as the shape are left out. */
static void expect_change(pbr_instance *instance, uint64_t count, change m, double curvature) {
    pbr_points *points = make_points(instance, count);
    uint64_t inner = 0, checked = 0;
    struct spt spt;
    assert_int_equal(spt_build(instance, points, 1, true, NULL, &spt), PBR_OK);
    for (uint32_t c = 0; c < spt.chunk_count; c++)
        for (uint32_t i = 0; i < spt.chunks[c].count; i++) {
            const struct node node = node_of(&spt, c, i);
            const double q = node.radius * curvature;
            inner += !node.is_leaf;
            if (q > 0.6) continue;
            checked += !node.is_leaf;
            const double error = field_error(&node, m);
            if (error > q * (DAMPED + q * q / 16) + NOISE)
                fail_msg("%s with r / R = %g is off by %g rad", node.is_leaf ? "a leaf" : "a node", q, error);
        }
    assert_true(inner > count / 4 && checked > inner * 9 / 10);
    spt_free(instance, &spt);
    pbr_points_release(&points);
}

static void on_spheres_normals_turn_by_the_curvature(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (int i = 0; i < 8; i++) {
        const uint64_t counts[] = {2000, MOST_POINTS}; /* one chunk, and some */
        const uint64_t count = counts[i % 2];
        const double side = i / 2 % 2 ? -1 : 1, radius = i / 4 ? 1000 : 0.1, k = side / radius;
        change m = {{k, 0, 0}, {0, k, 0}, {0, 0, k}};
        sample_sphere(count, radius, side, 1.2);
        if (i == 4) radii[77] = (float)(400 * radius); /* coarse steps: the others are drawn up to 6 % larger */
        expect_change(instance, count, m, 1 / radius);
    }
    host_stop(&host, instance);
}

/* Some rotation, its rows orthonormal. */
static const double turned[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}};

static void rotate(double v[3]) {
    const double given[3] = {v[0], v[1], v[2]};
    for (int k = 0; k < 3; k++) v[k] = dot3(turned[k], given);
}

static void on_cylinders_they_turn_around_the_axis(void **unused) {
    (void)unused;
    enum { AROUND = 150, ALONG = 200 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double step = 6.283185307179586 / AROUND;
    uint64_t random = 3;
    for (uint64_t i = 0; i < AROUND * ALONG; i++) {
        const double angle = step * ((double)(i % AROUND) + 0.3 * uniform(&random));
        memcpy(normals[i], (double[]){cos(angle), sin(angle), 0}, sizeof *normals);
        memcpy(positions[i], normals[i], sizeof *positions);
        positions[i][2] = step * ((double)(i / AROUND) + 0.3 * uniform(&random));
        rotate(positions[i]);
        rotate(normals[i]);
        radii[i] = (float)step;
    }
    change m; /* 1 - axis axis^T */
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) m[r][c] = (r == c) - turned[r][2] * turned[c][2];
    expect_change(instance, AROUND * ALONG, m, 1);
    host_stop(&host, instance);
}

/* No surface's normals turn so, which tells each number of a field from the others: (0.02 0.1; -0.04 -0.03) in a plane. */
static void any_linear_change_is_kept(void **unused) {
    (void)unused;
    enum { SIDE = 200 };
    static const double g[2][2] = {{0.02, 0.1}, {-0.04, -0.03}};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    uint64_t random = 5;
    for (uint64_t i = 0; i < SIDE * SIDE; i++) {
        const double step = 2.0 / SIDE, x = step * ((double)(i % SIDE) + 0.3 * uniform(&random)) - 1,
                     y = step * ((double)(i / SIDE) + 0.3 * uniform(&random)) - 1;
        memcpy(positions[i], (double[]){x, y, 0}, sizeof *positions);
        memcpy(normals[i], (double[]){g[0][0] * x + g[0][1] * y, g[1][0] * x + g[1][1] * y, 1}, sizeof *normals);
        rotate(positions[i]);
        rotate(normals[i]);
        radii[i] = (float)(1.2 * step);
    }
    change m; /* turned g turned^T */
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            m[r][c] = 0;
            for (int k = 0; k < 4; k++) m[r][c] += turned[r][k / 2] * g[k / 2][k % 2] * turned[c][k % 2];
        }
    expect_change(instance, SIDE * SIDE, m, 0.13); /* at the corners; a normal's own length changes by less than a hundredth */
    host_stop(&host, instance);
}

/* ---- Of anything ---- */

static double largest_change(const struct normal_field *field) {
    double a[2], b[2];
    normal_field_decode(field, a, b);
    return (hypot(a[0] + b[1], a[1] - b[0]) + hypot(a[0] - b[1], a[1] + b[0])) / 2;
}

static bool is_zero(const struct normal_field *field) {
    return field->a[0] == 0 && field->a[1] == 0 && field->b[0] == 0 && field->b[1] == 0;
}

static const struct kind kinds[] = {
    {"1 point", SPHERE, 1, 0},
    {"a torus", TORUS, 5000, 0},
    {"a plane", PLANE, 1000, 0},
    {"a line", LINE, 1000, 0},
    {"points in one place", COINCIDENT, 5000, 0},
    {"points in one place without radii", COINCIDENT, 300, ZERO_RADII},
    {"a sphere without radii", SPHERE, 1000, ZERO_RADII},
    {"a sphere with one huge radius", SPHERE, 1000, ONE_HUGE},
    {"a sphere with some normals", SPHERE, 1000, SOME_NORMALS},
    {"a sphere with any normals", SPHERE, 1000, RANDOM_NORMALS},
    {"a survey", TORUS, 3000, SURVEY},
    {"a survey as small as a float's step", TORUS, 1000, SMALL_SURVEY},
    {"a sphere without normals", SPHERE, 1000, NO_NORMALS},
};

/* What has no normal, or no extent, has no field; in a plane nothing turns. */
static void fields_turn_normals_by_sixty_degrees_at_most(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    for (size_t s = 0; s < COUNT(kinds); s++) {
        struct surface surface = make_surface(&kinds[s]);
        pbr_points *points = surface_points(instance, &surface);
        struct spt spt;
        assert_int_equal(spt_build(instance, points, 1, true, NULL, &spt), PBR_OK);
        assert_int_equal(spt.fields != NULL, !(kinds[s].flags & NO_NORMALS));
        for (uint32_t c = 0; spt.fields && c < spt.chunk_count; c++)
            for (uint32_t i = 0; i < spt.chunks[c].count; i++) {
                const struct node node = node_of(&spt, c, i);
                assert_true(largest_change(&node.field) <= NORMAL_FIELD_MOST + NORMAL_FIELD_UNIT);
                if (kinds[s].shape == PLANE || node.radius == 0 || length3(node.n) == 0) assert_true(is_zero(&node.field));
            }
        spt_free(instance, &spt);
        pbr_points_release(&points);
        free_surface(&surface);
    }
    host_stop(&host, instance);
}

/* The entries are those of a tree without. */
static void fields_change_nothing_else(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct spt spts[2];
    sample_sphere(MOST_POINTS, 1, 1, 1.2);
    pbr_points *points = make_points(instance, MOST_POINTS);
    for (int i = 0; i < 2; i++) assert_int_equal(spt_build(instance, points, 1, i, NULL, &spts[i]), PBR_OK);
    assert_null(spts[0].fields);
    assert_int_equal(spts[0].chunk_count, spts[1].chunk_count);
    for (uint32_t c = 0; c < spts[0].chunk_count; c++) {
        assert_memory_equal(&spts[0].chunks[c], &spts[1].chunks[c], sizeof(struct spt_chunk));
        assert_memory_equal(spts[0].entries[c], spts[1].entries[c], spts[0].chunks[c].count * sizeof(struct spt_entry));
    }
    for (int i = 0; i < 2; i++) spt_free(instance, &spts[i]);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_spheres_normals_turn_by_the_curvature),
        cmocka_unit_test(on_cylinders_they_turn_around_the_axis),
        cmocka_unit_test(any_linear_change_is_kept),
        cmocka_unit_test(fields_turn_normals_by_sixty_degrees_at_most),
        cmocka_unit_test(fields_change_nothing_else),
    };
    return cmocka_run_group_tests_name("spt_fields", tests, NULL, NULL);
}
