/* Loops that are compiled for AVX2, too, give the same numbers. SPDX-License-Identifier: MIT */
#include "support.h"

#define EXPORT(name, parameters, arguments) /* as it is, for any processor */
#include "core/triangles.c"

static void random_triangles(uint64_t *random, lanes corners[3][3], lanes normals[3][3]) {
    for (size_t l = 0; l < LANES; l++) {
        const double flat = l % 4 == 1 ? 1e-9 : 1, size = exp2(20 * uniform(random) - 10);
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) {
                corners[i][k][l] = size * uniform(random) * (k > 0 ? flat : 1);
                normals[i][k][l] = l % 4 == 2 ? 0 : (k == 2) + (l % 2 ? 0.1 : 2) * (uniform(random) - 0.5);
            }
        }
        for (int k = 0; k < 3 && l % 8 == 3; k++) corners[2][k][l] = corners[0][k][l]; /* a line */
    }
}

static void numbers_do_not_depend_on_the_processor(void **state) {
    (void)state;
    uint64_t random = 5;
    int large = 0, degenerate = 0;
    for (int t = 0; t < 2000; t++) {
        lanes corners[3][3], normals[3][3], angles[2][3], covering[2], hiding[2];
        struct triangles triangles[2];
        random_triangles(&random, corners, normals);
        triangles_measure((const lanes(*)[3])corners, &triangles[0]);
        triangles_angles(&triangles[0], angles[0]);
        triangles_covering_radius(&triangles[0], covering[0]);
        triangles_hiding_radius(&triangles[0], (const lanes(*)[3])normals, covering[0], hiding[0]);
        triangles_measure_loops((const lanes(*)[3])corners, &triangles[1]);
        triangles_angles_loops(&triangles[1], angles[1]);
        triangles_covering_radius_loops(&triangles[1], covering[1]);
        triangles_hiding_radius_loops(&triangles[1], (const lanes(*)[3])normals, covering[1], hiding[1]);
        assert_memory_equal(&triangles[0], &triangles[1], sizeof triangles[0]);
        assert_memory_equal(angles[0], angles[1], sizeof angles[0]);
        assert_memory_equal(covering[0], covering[1], sizeof covering[0]);
        assert_memory_equal(hiding[0], hiding[1], sizeof hiding[0]);
        for (size_t l = 0; l < LANES; l++) {
            large += hiding[0][l] > covering[0][l];
            degenerate += triangles[0].is_degenerate[l];
        }
    }
    assert_true(large > 1000 && degenerate >= 2000);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_do_not_depend_on_the_processor),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
