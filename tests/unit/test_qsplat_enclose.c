/* Spheres around siblings' children. SPDX-License-Identifier: MIT */
#include "support.h"

#include "lod/pop_sphere.h"
#include "lod/qsplat_build.h"

/* What the sphere needs to hold its children, in double, relative to its radius; and that of the smallest. */
static void judge(const struct siblings *siblings, uint32_t s, const struct qsplat_sphere *sphere, double *needed, double *least) {
    struct ball balls[QSPLAT_CHILDREN];
    double centre[3];
    for (uint32_t i = 0; i < siblings->child_counts[s]; i++) {
        for (int k = 0; k < 3; k++) balls[i].centre[k] = (double)siblings->children[s][i].centre[k];
        balls[i].radius = (double)siblings->children[s][i].radius;
    }
    for (int k = 0; k < 3; k++) centre[k] = (double)sphere->centre[k];
    *needed = ball_radius_around(centre, balls, (int)siblings->child_counts[s]) / (double)sphere->radius;
    *least = ball_around(balls, (int)siblings->child_counts[s]).radius / (double)sphere->radius;
}

static void spheres_hold_their_children_and_are_hardly_larger(void **state) {
    (void)state;
    enum { TIMES = 20000 };
    uint64_t random = 3;
    double sum = 0, worst = 1;
    int count = 0;
    for (int t = 0; t < TIMES; t++) {
        struct siblings siblings = {.count = 1 + (uint32_t)t % 4};
        struct qsplat_sphere together[QSPLAT_CHILDREN], alone;
        for (uint32_t s = 0; s < siblings.count; s++) {
            siblings.child_counts[s] = 1 + (uint32_t)(t / 4 + (int)s) % 4;
            for (uint32_t i = 0; i < siblings.child_counts[s]; i++) {
                for (int k = 0; k < 3; k++) siblings.children[s][i].centre[k] = (float)(uniform(&random) - 0.5);
                siblings.children[s][i].radius = (float)(uniform(&random) * (t % 3 == 0 ? 1 : 0.2));
            }
        }
        enclose_siblings(&siblings, together);
        for (uint32_t s = 0; s < siblings.count; s++) {
            struct siblings one = {.count = 1, .child_counts = {siblings.child_counts[s]}};
            double needed, least;
            memcpy(one.children[0], siblings.children[s], sizeof one.children[0]);
            enclose_siblings(&one, &alone);
            assert_memory_equal(&alone, &together[s], sizeof alone); /* they do not mix */
            judge(&siblings, s, &together[s], &needed, &least);
            assert_true(needed <= 1); /* rounded up */
            sum += 1 / least, worst = fmax(worst, 1 / least), count++;
        }
    }
    print_message("%.4f times the smallest in the mean, %.4f at most\n", sum / count, worst);
    assert_true(sum / count < 1.005 && worst < 1.04);
}

/* The way to the farthest child, relative to how far it is, leaves the range of float. */
static void the_largest_spheres_that_nearly_coincide_are_held(void **state) {
    (void)state;
    struct siblings siblings = {.count = 1, .child_counts = {4}};
    struct qsplat_sphere sphere;
    double needed, least;
    for (int i = 0; i < 4; i++) {
        siblings.children[0][i].centre[0] = 1e-22f * (float)(i % 2 ? -1 : 1) * (i > 1 ? 6 : 1);
        siblings.children[0][i].radius = 1e18f;
    }
    enclose_siblings(&siblings, &sphere);
    for (int k = 0; k < 3; k++) assert_true(isfinite(sphere.centre[k]));
    judge(&siblings, 0, &sphere, &needed, &least);
    assert_true(needed <= 1 && least > 0.99);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_hold_their_children_and_are_hardly_larger),
        cmocka_unit_test(the_largest_spheres_that_nearly_coincide_are_held),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
