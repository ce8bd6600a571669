/* What QSplat's codes of spheres hold and hide. SPDX-License-Identifier: MIT */
#include "support.h"

#include "lod/qsplat.h"

static struct qsplat_codes codes;

/* Of the other's centre, off the disc's plane. */
static double height(const struct qsplat_sphere *disc, const struct qsplat_sphere *other, const float normal[3]) {
    double high = 0;
    for (int k = 0; k < 3; k++) high += ((double)other->centre[k] - (double)disc->centre[k]) * (double)normal[k];
    return fabs(high);
}

/* How much more than the disc's radius another one needs, that lies elsewhere, to hide it from up to 63 degrees (tangent 2) off the
 * normal. */
static double needed(const struct qsplat_sphere *disc, const struct qsplat_sphere *other, const float normal[3]) {
    const double high = height(disc, other, normal);
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)other->centre[k] - (double)disc->centre[k];
        squared += d * d;
    }
    return sqrt(fmax(squared - high * high, 0)) + 2 * high;
}

static bool holds(const struct qsplat_sphere *outer, const struct qsplat_sphere *inner) {
    const float none[3] = {0, 0, 0};
    return needed(inner, outer, none) + (double)inner->radius <= (double)outer->radius * (1 + 1e-6);
}

static int size_of(const struct qsplat_sphere *decoded, const struct qsplat_sphere *parent) {
    return (int)lround((double)decoded->radius / (double)parent->radius * QSPLAT_GRID);
}

/* Of a code that holds the sphere and, with a normal, hides its disc; by trying all. QSPLAT_GRID: none. */
static int least_size(const struct qsplat_sphere *sphere, const float normal[3], const struct qsplat_sphere *parent) {
    const double radius = (double)sphere->radius * (1 - 1e-6);
    int least = QSPLAT_GRID;
    for (uint32_t code = 0; code < QSPLAT_SPHERES - 1; code++) {
        const struct qsplat_sphere decoded = qsplat_decode_sphere(&codes, code, parent);
        const int size = size_of(&decoded, parent);
        if (size < least && holds(&decoded, sphere) &&
            (!normal || needed(sphere, &decoded, normal) + radius <= (double)decoded.radius))
            least = size;
    }
    return least;
}

/* Of codes as large as `decoded` that hold the sphere and hide its disc: how near to the disc's plane one lies. By trying all. */
static double least_height(const struct qsplat_sphere *sphere, const float normal[3], const struct qsplat_sphere *parent,
                           const struct qsplat_sphere *decoded) {
    double least = INFINITY;
    for (uint32_t code = 0; code < QSPLAT_SPHERES - 1; code++) {
        const struct qsplat_sphere other = qsplat_decode_sphere(&codes, code, parent);
        if (size_of(&other, parent) == size_of(decoded, parent) && holds(&other, sphere) &&
            needed(sphere, &other, normal) + (double)sphere->radius <= (double)other.radius * (1 + 1e-5))
            least = fmin(least, height(sphere, &other, normal));
    }
    return least;
}

/* As leaves lie in their parents, not at the rim. */
static void codes_of_discs_hide_them_and_are_hardly_larger(void **state) {
    (void)state;
    enum { DISCS = 3000 };
    uint64_t random = 9;
    int held = 0, hidden = 0, hidden_by_spheres = 0;
    long sizes = 0, least_sizes = 0;
    double heights = 0, least_heights = 0;
    qsplat_codes_make(true, &codes);
    for (int t = 0; t < DISCS; t++) {
        struct qsplat_sphere parent = {{0, 0, 0}, (float)(0.5 + uniform(&random))}, sphere, disc, by_sphere;
        float normal[3], squared = 0;
        sphere.radius = parent.radius * (float)(0.25 + 0.25 * uniform(&random));
        for (int k = 0; k < 3; k++) {
            parent.centre[k] = (float)uniform(&random);
            sphere.centre[k] = parent.centre[k]; /* along some axes, as in a plane */
            if (t % 4 != k) sphere.centre[k] += (float)((uniform(&random) - 0.5) * 0.8 * (double)parent.radius);
            normal[k] = (float)(uniform(&random) - 0.5);
            squared += normal[k] * normal[k];
        }
        for (int k = 0; k < 3; k++) normal[k] /= sqrtf(squared);
        const uint16_t code = qsplat_encode_sphere(&codes, &sphere, normal, &parent, &disc);
        const struct qsplat_sphere decoded = qsplat_decode_sphere(&codes, code, &parent);
        qsplat_encode_sphere(&codes, &sphere, NULL, &parent, &by_sphere);
        assert_memory_equal(&decoded, &disc, sizeof disc);
        if (code == QSPLAT_SPHERES - 1) continue;
        const int least = least_size(&sphere, NULL, &parent);
        assert_true(holds(&disc, &sphere) && holds(&by_sphere, &sphere));
        assert_true(size_of(&by_sphere, &parent) >= least && size_of(&disc, &parent) <= size_of(&by_sphere, &parent) + 2);
        held++;
        sizes += size_of(&disc, &parent);
        least_sizes += least_size(&sphere, normal, &parent);
        if (needed(&sphere, &disc, normal) + (double)sphere.radius <= (double)disc.radius * (1 + 1e-5)) {
            hidden++;
            heights += height(&sphere, &disc, normal) / (double)parent.radius;
            least_heights += least_height(&sphere, normal, &parent, &disc) / (double)parent.radius;
        }
        hidden_by_spheres += needed(&sphere, &by_sphere, normal) + (double)sphere.radius <= (double)by_sphere.radius * (1 + 1e-5);
    }
    assert_true(held > DISCS * 9 / 10);
    assert_true((double)sizes < 1.002 * (double)least_sizes); /* few codes are tried, but the right ones */
    assert_true(heights < 1.06 * least_heights);
    assert_true(hidden >= held * 999 / 1000 && hidden_by_spheres < held * 60 / 100);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(codes_of_discs_hide_them_and_are_hardly_larger),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
