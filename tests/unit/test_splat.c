/* The splat record's normals. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/splat.h"

enum { DIRECTIONS = 3000000 };
#define OCT_ERROR 6.5e-5 /* rad, as splat.h states */

static double angle_between(const double a[3], const float b[3]) {
    double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return atan2(sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

static double round_trip_error(const double n[3]) {
    const float in[3] = {(float)n[0], (float)n[1], (float)n[2]};
    int16_t code[2];
    float out[3];
    splat_encode_normal(in, code);
    splat_decode_normal(code, out);
    assert_true(fabs(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] - 1) < 1e-6);
    return angle_between(n, out);
}

/* Random directions, and finer ones around the worst place found: a face's centre, where the octahedron is nearest to the centre.
 */
static void octahedral_error_bound(void **state) {
    (void)state;
    uint64_t random = 1;
    double worst = 0;
    for (int i = 0; i < DIRECTIONS; i++) {
        double z = 2 * uniform(&random) - 1, a = 6.283185307179586 * uniform(&random), r = sqrt(1 - z * z);
        double n[3] = {r * cos(a), r * sin(a), z};
        if (i & 1) /* near (1, 1, 1) / sqrt(3), up to signs */
            for (int k = 0; k < 3; k++) n[k] = (n[k] < 0 ? -1 : 1) * (1 + 0.05 * uniform(&random));
        worst = fmax(worst, round_trip_error(n));
    }
    print_message("largest octahedral error: %.3e rad\n", worst);
    assert_true(worst <= OCT_ERROR);
    assert_true(worst > 0.98 * OCT_ERROR); /* the bound says something */
}

static void axes_and_corners_survive(void **state) {
    (void)state;
    for (int i = 0; i < 27; i++) {
        double n[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        if (n[0] == 0 && n[1] == 0 && n[2] == 0) continue;
        assert_true(round_trip_error(n) <= OCT_ERROR);
    }
}

static void directions_without_meaning_decode_to_zero(void **state) {
    (void)state;
    const float none[][3] = {{0, 0, 0}, {NAN, 0, 1}, {INFINITY, 0, 0}, {0, -INFINITY, 1}};
    for (size_t i = 0; i < COUNT(none); i++) {
        int16_t code[2];
        float out[3] = {7, 7, 7};
        splat_encode_normal(none[i], code);
        assert_int_equal(code[0], SPLAT_NO_NORMAL);
        assert_int_equal(code[1], SPLAT_NO_NORMAL);
        splat_decode_normal(code, out);
        for (int k = 0; k < 3; k++) assert_true(out[k] == 0);
    }
}

static void record_has_24_bytes(void **state) {
    (void)state;
    assert_int_equal(sizeof(struct splat), 24);
    assert_int_equal(offsetof(struct splat, radius), 12);
    assert_int_equal(offsetof(struct splat, normal), 16);
    assert_int_equal(offsetof(struct splat, colour), 20);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(octahedral_error_bound),
        cmocka_unit_test(axes_and_corners_survive),
        cmocka_unit_test(directions_without_meaning_decode_to_zero),
        cmocka_unit_test(record_has_24_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
