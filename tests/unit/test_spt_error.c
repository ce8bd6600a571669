/* Nodes of sequential point trees against their children, by brute force. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"
#include "lod/spt_build.h"

enum { FAMILIES = 2000, MOST = SPT_CHILDREN_MOST };

/* Doubles compared after some dozen operations on floats that are unit only nearly. */
static const double TOLERANCE = 1e-6;

struct family {
    struct spt_node nodes[MOST], parent;
    const struct spt_node *children[MOST];
    uint32_t count;
};

static void direction(uint64_t *state, double out[3]) {
    const double z = 2 * uniform(state) - 1, turn = 2 * acos(-1) * uniform(state), s = sqrt(1 - z * z);
    out[0] = s * cos(turn), out[1] = s * sin(turn), out[2] = z;
}

/* Children near a plane, their normals spread by about `spread`; in every fifth family one has none. */
static void make_family(struct family *family, uint64_t *state, double spread) {
    double normal[3], n[3], d[3];
    memset(family, 0, sizeof *family);
    family->count = 1 + (uint32_t)(uniform(state) * MOST);
    const bool lacks = uniform(state) < 0.2;
    direction(state, normal);
    for (uint32_t i = 0; i < family->count; i++) {
        struct spt_node *node = &family->nodes[i];
        direction(state, n);
        direction(state, d);
        const double flat = dot3(d, normal);
        for (int k = 0; k < 3; k++) {
            n[k] = normal[k] + spread * n[k];
            node->position[k] = 5 + d[k] - (1 - spread) * flat * normal[k];
        }
        const double length = length3(n);
        for (int k = 0; k < 3; k++) node->normal[k] = lacks && i == 1 ? 0 : (float)(n[k] / length);
        node->radius = (float)(uniform(state) < 0.1 ? 0 : 0.1 + uniform(state));
        node->weight = node->radius * node->radius + 1e-18f;
        node->error = uniform(state) < 0.5 ? 0 : node->radius * (float)uniform(state);
        for (int k = 0; k < 3; k++) node->colour[k] = (float)uniform(state);
        family->children[i] = node;
    }
    spt_combine(family->children, family->count, &family->parent);
}

static bool has_normal(const struct spt_node *node) {
    return node->normal[0] != 0 || node->normal[1] != 0 || node->normal[2] != 0;
}

static void unit_normal(const struct spt_node *node, double out[3]) {
    double length;
    for (int k = 0; k < 3; k++) out[k] = (double)node->normal[k];
    length = length3(out);
    for (int k = 0; k < 3; k++) out[k] /= length;
}

static void axes_across(const double n[3], double u[3], double v[3]) {
    const double other[3] = {fabs(n[0]) < 0.6, fabs(n[0]) >= 0.6, 0};
    cross3(n, other, u);
    const double length = length3(u);
    for (int k = 0; k < 3; k++) u[k] /= length;
    cross3(n, u, v);
}

/* A point of the rim of a disc, or of the circle around a point without normal that faces along `facing`. */
static void rim_point(const struct spt_node *node, const double facing[3], double turn, double out[3]) {
    double n[3], u[3], v[3];
    if (has_normal(node)) unit_normal(node, n);
    else memcpy(n, facing, sizeof n);
    axes_across(n, u, v);
    for (int k = 0; k < 3; k++) out[k] = node->position[k] + (double)node->radius * (cos(turn) * u[k] + sin(turn) * v[k]);
}

static void for_each_family(void (*check)(const struct family *family, uint64_t *state)) {
    uint64_t state = 3;
    for (int i = 0; i < FAMILIES; i++) {
        struct family family;
        make_family(&family, &state, i % 4 == 0 ? 0 : i % 4 == 1 ? 0.05 : i % 4 == 2 ? 0.4 : 3);
        check(&family, &state);
    }
}

/* ---- Discs ---- */

static void check_encloses(const struct family *family, uint64_t *state) {
    const struct spt_node *parent = &family->parent;
    for (uint32_t i = 0; i < family->count; i++)
        for (int t = 0; t < 16; t++) {
            double facing[3], point[3], along = 0, n[3] = {0, 0, 0};
            direction(state, facing);
            rim_point(family->children[i], facing, 2 * acos(-1) * uniform(state), point);
            if (has_normal(parent)) unit_normal(parent, n);
            for (int k = 0; k < 3; k++) point[k] -= parent->position[k];
            along = dot3(point, n);
            for (int k = 0; k < 3; k++) point[k] -= along * n[k];
            assert_true(length3(point) <= (double)parent->radius * (1 + TOLERANCE));
        }
}

static void discs_enclose_their_childrens(void **unused) {
    (void)unused;
    for_each_family(check_encloses);
}

static void check_average(const struct family *family, uint64_t *state) {
    (void)state;
    double weight = 0, position[3] = {0, 0, 0}, normal[3] = {0, 0, 0}, colour[3] = {0, 0, 0};
    for (uint32_t i = 0; i < family->count; i++) {
        const struct spt_node *child = family->children[i];
        const double w = (double)child->weight;
        weight += w;
        for (int k = 0; k < 3; k++) {
            position[k] += w * child->position[k];
            normal[k] += w * (double)child->normal[k];
            colour[k] += w * (double)child->colour[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(family->parent.position[k] - position[k] / weight) < TOLERANCE);
        assert_true(fabs((double)family->parent.colour[k] - colour[k] / weight) < TOLERANCE);
        if (has_normal(&family->parent))
            assert_true(fabs((double)family->parent.normal[k] - normal[k] / length3(normal)) < TOLERANCE);
    }
}

static void nodes_are_their_childrens_averages_by_area(void **unused) {
    (void)unused;
    for_each_family(check_average);
}

static void normals_that_cancel_are_none(void **unused) {
    (void)unused;
    struct spt_node nodes[2] = {{.normal = {0, 0, 1}, .radius = 1, .weight = 1}, {.normal = {0, 0, -1}, .radius = 1, .weight = 1}};
    struct spt_node parent;
    nodes[1].position[0] = 3;
    spt_combine((const struct spt_node *const[]){&nodes[0], &nodes[1]}, 2, &parent);
    assert_false(has_normal(&parent));
    assert_float_equal(parent.radius, 2.5, TOLERANCE);
    assert_float_equal(parent.error, 5, 2 * TOLERANCE);
}

/* ---- Errors ---- */

static void check_perpendicular(const struct family *family, uint64_t *state) {
    (void)state;
    enum { TURNS = 720 };
    const struct spt_node *parent = &family->parent;
    double n[3], high = -INFINITY, low = INFINITY;
    if (!has_normal(parent)) return;
    unit_normal(parent, n);
    for (uint32_t i = 0; i < family->count; i++)
        for (int t = 0; t < TURNS; t++) {
            double facing[3], other[3], point[3]; /* edge-on: reaches farthest */
            axes_across(n, facing, other);
            rim_point(family->children[i], facing, 2 * acos(-1) * t / TURNS, point);
            for (int k = 0; k < 3; k++) point[k] -= parent->position[k];
            high = fmax(high, dot3(point, n));
            low = fmin(low, dot3(point, n));
        }
    const double error = spt_perpendicular_error(parent, family->children, family->count);
    assert_true(error >= high - low - TOLERANCE);
    /* Two rims, each missed by r (1 - cos of half a step) at most. */
    assert_true(error <= high - low + 2 * 1.1 * (1 - cos(acos(-1) / TURNS)) + TOLERANCE);
}

static void the_perpendicular_error_is_the_discs_thickness(void **unused) {
    (void)unused;
    for_each_family(check_perpendicular);
}

enum { DIRECTIONS = 3600 };

/* The smallest of the widths across many directions: above the true one, by no more than 2 r for each radian of half a step. */
static double sampled_width(const struct family *family, double *looseness) {
    const struct spt_node *parent = &family->parent;
    double n[3], u[3], v[3], least = INFINITY;
    unit_normal(parent, n);
    axes_across(n, u, v);
    *looseness = 0;
    for (int t = 0; t < DIRECTIONS; t++) {
        const double turn = acos(-1) * t / DIRECTIONS;
        double high = -INFINITY, low = INFINITY, d[3];
        for (int k = 0; k < 3; k++) d[k] = cos(turn) * u[k] + sin(turn) * v[k];
        for (uint32_t i = 0; i < family->count; i++) {
            const struct spt_node *child = family->children[i];
            double m[3], from[3], reach = (double)child->radius;
            if (has_normal(child)) {
                unit_normal(child, m);
                reach *= sqrt(fmax(0, 1 - dot3(m, d) * dot3(m, d)));
                *looseness = fmax(*looseness, 2 * (double)child->radius * (1 - fmin(1, fabs(dot3(m, n)))));
            }
            for (int k = 0; k < 3; k++) from[k] = child->position[k] - parent->position[k];
            high = fmax(high, dot3(from, d) + reach);
            low = fmin(low, dot3(from, d) - reach);
        }
        least = fmin(least, high - low);
    }
    return least;
}

static void check_tangential(const struct family *family, uint64_t *state) {
    (void)state;
    double looseness;
    if (!has_normal(&family->parent)) return;
    const double width = sampled_width(family, &looseness), whole = 2 * (double)family->parent.radius;
    const double exact = fmax(0, whole - width), error = spt_tangential_error(&family->parent, family->children, family->count);
    assert_true(error >= exact - TOLERANCE);
    assert_true(error <= exact + looseness + whole * acos(-1) / 2 / DIRECTIONS + TOLERANCE);
}

static void the_tangential_error_is_never_too_small_and_by_little_too_large(void **unused) {
    (void)unused;
    for_each_family(check_tangential);
}

static void check_combined(const struct family *family, uint64_t *state) {
    (void)state;
    const struct spt_node *parent = &family->parent;
    const double whole = 2 * (double)parent->radius;
    double largest = whole;
    if (has_normal(parent)) {
        const double p = spt_perpendicular_error(parent, family->children, family->count);
        const double t = spt_tangential_error(parent, family->children, family->count);
        largest = 0;
        for (int a = 0; a <= 900; a++) largest = fmax(largest, p * sin(a * acos(-1) / 1800) + t * cos(a * acos(-1) / 1800));
        largest = fmin(largest, whole);
    }
    double children = 0;
    for (uint32_t i = 0; i < family->count; i++) children = fmax(children, (double)family->children[i]->error);
    assert_true((double)parent->error >= largest - TOLERANCE);
    assert_true((double)parent->error >= children);
    /* 900 angles miss the largest by 1 - cos of half a step. */
    assert_true((double)parent->error <= fmax(largest * (1 + 1e-5), children) + TOLERANCE);
}

static void the_error_is_the_largest_over_all_angles_and_no_childs_is_larger(void **unused) {
    (void)unused;
    for_each_family(check_combined);
}

static void children_in_one_place_leave_no_error(void **unused) {
    (void)unused;
    struct spt_node nodes[3] = {{.position = {1, 2, 3}, .normal = {0, 1, 0}, .radius = 0.5f, .weight = 1}}, parent;
    nodes[1] = nodes[2] = nodes[0];
    spt_combine((const struct spt_node *const[]){&nodes[0], &nodes[1], &nodes[2]}, 3, &parent);
    assert_memory_equal(parent.position, nodes[0].position, sizeof parent.position);
    assert_float_equal(parent.radius, 0.5, TOLERANCE);
    assert_float_equal(parent.error, 0, TOLERANCE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(discs_enclose_their_childrens),
        cmocka_unit_test(nodes_are_their_childrens_averages_by_area),
        cmocka_unit_test(normals_that_cancel_are_none),
        cmocka_unit_test(the_perpendicular_error_is_the_discs_thickness),
        cmocka_unit_test(the_tangential_error_is_never_too_small_and_by_little_too_large),
        cmocka_unit_test(the_error_is_the_largest_over_all_angles_and_no_childs_is_larger),
        cmocka_unit_test(children_in_one_place_leave_no_error),
    };
    return cmocka_run_group_tests_name("spt_error", tests, NULL, NULL);
}
