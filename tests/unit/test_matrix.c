/* Matrices. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"

static void random_matrix(uint64_t *random, double m[16]) {
    for (int i = 0; i < 16; i++) m[i] = 4 * uniform(random) - 2;
    m[3] = m[7] = m[11] = 0;
    m[15] = 1;
}

static void apply3(const double m[16], const double v[3], double out[3]) {
    for (int r = 0; r < 3; r++) out[r] = m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2];
}

/* Largest singular value by power iteration on M^T M, which converges from below; 5000 steps leave less than 1e-3 even for
 * singular values that differ by 1e-4. */
static double stretch_by_iteration(const double m[16]) {
    double v[3] = {0.61, 0.55, 0.57}, w[3], length = 0;
    for (int step = 0; step < 5000; step++) {
        apply3(m, v, w);
        length = length3(w);
        if (!(length > 0)) return 0;
        for (int c = 0; c < 3; c++) v[c] = dot3(m + 4 * c, w);
        double n = length3(v);
        for (int c = 0; c < 3; c++) v[c] /= n;
    }
    apply3(m, v, w);
    return length3(w);
}

static void largest_stretch_equals_power_iteration(void **state) {
    (void)state;
    uint64_t random = 3;
    for (int i = 0; i < 300; i++) {
        double m[16];
        random_matrix(&random, m);
        if (i % 3 == 1) memcpy(m + 4, m, 3 * sizeof *m); /* rank 2 */
        if (i % 3 == 2)
            for (int k = 0; k < 12; k++) m[k] *= k / 4 == 1 ? 1e-6 : 1e5; /* uneven columns */
        double exact = stretch_by_iteration(m);
        assert_true(fabs(matrix_largest_stretch(m) - exact) <= 1e-6 * exact);
    }
}

static void largest_stretch_of_simple_matrices(void **state) {
    (void)state;
    double zero[16] = {0}, scale[16] = {[0] = 3, [5] = -7, [10] = 0, [15] = 1}, equal[16] = {[0] = 5, [5] = 5, [10] = 5, [15] = 1};
    assert_true(matrix_largest_stretch(zero) == 0);
    assert_true(fabs(matrix_largest_stretch(scale) - 7) < 1e-12);
    assert_true(fabs(matrix_largest_stretch(equal) - 5) < 1e-12);
}

/* cofactors^T m = det identity: columns of the one against columns of the other. */
static void cofactors_are_the_inverse_transpose_times_the_determinant(void **state) {
    (void)state;
    uint64_t random = 5;
    for (int i = 0; i < 100; i++) {
        double m[16], c[9];
        random_matrix(&random, m);
        double det = matrix_cofactors(m, c);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) assert_true(fabs(dot3(c + 3 * a, m + 4 * b) - (a == b ? det : 0)) < 1e-12);
    }
}

static void product_applies_the_right_factor_first(void **state) {
    (void)state;
    uint64_t random = 7;
    double a[16], b[16], ab[16], t[3] = {1, -2, 3}, moved[16], translation[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, -2, 3, 1},
                                 same[16];
    random_matrix(&random, a);
    random_matrix(&random, b);
    double v[3] = {0.3, -0.4, 0.9}, bv[3], abv[3], direct[3];
    matrix_multiply(a, b, ab);
    apply3(b, v, bv);
    apply3(a, bv, abv);
    apply3(ab, v, direct);
    for (int k = 0; k < 3; k++) assert_true(fabs(direct[k] - abv[k]) < 1e-12);
    matrix_translate(a, t, moved);
    matrix_multiply(a, translation, same);
    for (int k = 0; k < 16; k++) assert_true(fabs(moved[k] - same[k]) < 1e-12);
    assert_true(matrix_make_affine(ab));
    ab[7] = 0.5;
    assert_false(matrix_make_affine(ab));
    ab[2] = NAN;
    assert_false(matrix_is_finite(ab));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(largest_stretch_equals_power_iteration),
        cmocka_unit_test(largest_stretch_of_simple_matrices),
        cmocka_unit_test(cofactors_are_the_inverse_transpose_times_the_determinant),
        cmocka_unit_test(product_applies_the_right_factor_first),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
