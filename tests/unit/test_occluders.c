/* What a picture's depth hides: against each pixel's ray, one by one. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"
#include "lod/occluders.h"

enum { WIDTH = 150, HEIGHT = 90, PIXELS = WIDTH * HEIGHT };

static double between(uint64_t *seed, double low, double high) {
    return low + (high - low) * uniform(seed);
}

static double log_between(uint64_t *seed, double low, double high) {
    return exp(between(seed, log(low), log(high)));
}

/* Window depths of a picture, 0 at the near plane; blocks at random distances, and holes. */
static void make_picture(uint64_t *seed, float depths[PIXELS]) {
    for (int i = 0; i < PIXELS; i++) depths[i] = 1;
    for (int b = 0; b < 40; b++) {
        const int x = (int)between(seed, -40, WIDTH), y = (int)between(seed, -40, HEIGHT);
        const int w = (int)between(seed, 1, 90), h = (int)between(seed, 1, 90);
        const float depth = (float)between(seed, 0.3, 1);
        for (int r = y < 0 ? 0 : y; r < y + h && r < HEIGHT; r++)
            for (int c = x < 0 ? 0 : x; c < x + w && c < WIDTH; c++) depths[r * WIDTH + c] = fminf(depths[r * WIDTH + c], depth);
    }
    for (int i = 0; i < 5; i++) depths[(int)between(seed, 0, PIXELS)] = 1;
}

static struct occluders *make_occluders(pbr_instance *instance, const float depths[PIXELS], double sign) {
    struct occluders *o = NULL;
    assert_int_equal(occluders_create(instance, WIDTH, HEIGHT, &o), PBR_OK);
    o->sign = sign;
    o->error = 1e-6;
    for (int r = 0; r < o->rows[0]; r++)
        for (int c = 0; c < o->columns[0]; c++) {
            float farthest = -INFINITY;
            for (int y = 8 * r; y < 8 * r + 8 && y < HEIGHT; y++)
                for (int x = 8 * c; x < 8 * c + 8 && x < WIDTH; x++) farthest = fmaxf(farthest, 2 * depths[y * WIDTH + x] - 1);
            o->levels[0][r * o->columns[0] + c] = farthest;
        }
    occluders_finish(o);
    return o;
}

/* Eye -> clip, -w..w; `sign` -1: reversed. The camera looks along -z. */
static void make_projection(bool parallel, double sign, double m[16]) {
    const double near = 0.5, far = 20, half = 0.6, aspect = (double)WIDTH / HEIGHT;
    memset(m, 0, 16 * sizeof *m);
    if (parallel) {
        m[0] = 1 / (5 * half * aspect), m[5] = 1 / (5 * half), m[10] = -2 / (far - near), m[14] = -(far + near) / (far - near),
        m[15] = 1;
    } else {
        m[0] = 1 / (half * aspect), m[5] = 1 / half, m[10] = -(far + near) / (far - near), m[14] = -2 * far * near / (far - near);
        m[11] = -1;
    }
    m[10] *= sign, m[14] *= sign;
}

/* Whether the ray through a place of the window meets the sphere before the picture's depth there, by points along the ray. */
static bool is_seen_at(const double from_clip[16], const float depths[PIXELS], double sign, double x, double y,
                       const float centre[3], double radius) {
    double ends[2][3];
    const double depth = 2 * (double)depths[(int)y * WIDTH + (int)x] - 1;
    for (int e = 0; e < 2; e++) { /* at the near plane, and where the picture was */
        const double clip[4] = {2 * x / WIDTH - 1, 2 * y / HEIGHT - 1, sign * (e ? depth : -1), 1};
        double p[4] = {0, 0, 0, 0};
        for (int k = 0; k < 4; k++)
            for (int c = 0; c < 4; c++) p[k] += from_clip[4 * c + k] * clip[c];
        for (int k = 0; k < 3; k++) ends[e][k] = p[k] / p[3] - (double)centre[k];
    }
    /* The segment's nearest point to the centre. */
    double along[3], at = 0, squared = 0, nearest = 0;
    for (int k = 0; k < 3; k++) {
        along[k] = ends[1][k] - ends[0][k];
        at -= ends[0][k] * along[k];
        squared += along[k] * along[k];
    }
    at = squared > 0 ? fmin(fmax(at / squared, 0), 1) : 0;
    for (int k = 0; k < 3; k++) nearest += (ends[0][k] + at * along[k]) * (ends[0][k] + at * along[k]);
    return nearest < radius * radius;
}

static bool is_seen(const double from_clip[16], const float depths[PIXELS], double sign, const float centre[3], double radius) {
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int s = 0; s < 5; s++) { /* the pixel's centre and near its corners */
                const double dx = s == 4 ? 0.5 : s % 2 ? 0.99 : 0.01, dy = s == 4 ? 0.5 : s / 2 ? 0.99 : 0.01;
                if (is_seen_at(from_clip, depths, sign, x + dx, y + dy, centre, radius)) return true;
            }
    return false;
}

static void no_sphere_that_is_hidden_is_seen(void **state) {
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    (void)state;
    static float depths[PIXELS];
    uint64_t seed = 3;
    int hidden = 0, seen = 0;
    for (int picture = 0; picture < 12; picture++) {
        const double sign = picture % 2 ? -1 : 1;
        double from_clip[16] = {0};
        struct occlusion occlusion = {.reach = {1, 1}};
        make_picture(&seed, depths);
        occlusion.by = make_occluders(instance, depths, sign);
        make_projection(picture % 4 >= 2, sign, occlusion.to_clip);
        assert_true(matrix_inverse(occlusion.to_clip, from_clip));
        for (int i = 0; i < 300; i++) {
            const double distance = log_between(&seed, 0.4, 19);
            const float centre[3] = {(float)(between(&seed, -1, 1) * distance), (float)(between(&seed, -0.7, 0.7) * distance),
                                     (float)-distance};
            const double radius = log_between(&seed, 0.01, 1);
            if (!occluders_hide(&occlusion, centre, radius)) continue;
            hidden++;
            seen += is_seen(from_clip, depths, sign, centre, radius);
        }
        occluders_release(&occlusion.by);
    }
    assert_true(hidden > 200); /* else nothing was asked */
    assert_int_equal(seen, 0);
    host_stop(&host, instance);
}

static void whatever_is_right_behind_a_wall_is_hidden(void **state) {
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    (void)state;
    static float depths[PIXELS];
    const float depth = 0.9f;
    for (int i = 0; i < PIXELS; i++) depths[i] = depth;
    for (int parallel = 0; parallel < 2; parallel++) {
        struct occlusion occlusion = {.by = make_occluders(instance, depths, 1), .reach = {1, 1}};
        double from_clip[16] = {0}, p[4] = {0, 0, 0, 0};
        const double clip[4] = {0, 0, 2 * (double)depth - 1, 1};
        make_projection(parallel, 1, occlusion.to_clip);
        assert_true(matrix_inverse(occlusion.to_clip, from_clip));
        for (int k = 0; k < 4; k++)
            for (int c = 0; c < 4; c++) p[k] += from_clip[4 * c + k] * clip[c];
        const double wall = p[2] / p[3];
        for (double radius = 0.001; radius < 0.5; radius *= 2) {
            const float behind[3] = {0, 0, (float)(wall - 1.001 * radius - 1e-3)},
                        before[3] = {0, 0, (float)(wall - 0.99 * radius)};
            assert_true(occluders_hide(&occlusion, behind, radius));
            assert_false(occluders_hide(&occlusion, before, radius));
        }
        const float beside[3] = {40, 0, (float)(wall - 1)}, back[3] = {0, 0, 1};
        assert_false(occluders_hide(&occlusion, beside, 0.1)); /* the picture does not tell */
        assert_true(parallel || !occluders_hide(&occlusion, back, 0.1));
        occlusion.pad = WIDTH;
        const float far[3] = {0, 0, (float)(wall - 1)};
        assert_false(occluders_hide(&occlusion, far, 0.1)); /* there is no room for that around it */
        occluders_release(&occlusion.by);
    }
    host_stop(&host, instance);
}

static void a_picture_covers_another_if_nothing_is_farther(void **state) {
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    (void)state;
    static float depths[PIXELS];
    uint64_t seed = 4;
    make_picture(&seed, depths);
    struct occluders *older = make_occluders(instance, depths, 1);
    depths[PIXELS / 2] = 0.1f;
    struct occluders *nearer = make_occluders(instance, depths, 1);
    for (int i = 0; i < 8; i++) depths[PIXELS / 3 + i] = 1;
    struct occluders *farther = make_occluders(instance, depths, 1);
    assert_true(occluders_cover(nearer, older));
    assert_true(occluders_cover(older, older));
    assert_false(occluders_cover(farther, nearer));
    nearer->view[12] = 1;
    assert_false(occluders_cover(nearer, older)); /* another camera */
    occluders_release(&older);
    occluders_release(&nearer);
    occluders_release(&farther);
    host_stop(&host, instance);
}

static void pictures_of_any_size_have_tiles(void **state) {
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    (void)state;
    static const int32_t sizes[][2] = {{1, 1}, {7, 9}, {8, 8}, {9, 1}, {16384, 16}, {1, 16384}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct occluders *o = NULL;
        assert_int_equal(occluders_create(instance, sizes[i][0], sizes[i][1], &o), PBR_OK);
        for (int32_t t = 0; t < o->columns[0] * o->rows[0]; t++) o->levels[0][t] = (float)t;
        occluders_finish(o);
        const int32_t top = o->level_count - 1;
        assert_true(o->columns[top] == 1 && o->rows[top] == 1);
        assert_true(o->levels[top][0] == (float)(o->columns[0] * o->rows[0] - 1));
        occluders_release(&o);
    }
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_sphere_that_is_hidden_is_seen),
        cmocka_unit_test(whatever_is_right_behind_a_wall_is_hidden),
        cmocka_unit_test(a_picture_covers_another_if_nothing_is_farther),
        cmocka_unit_test(pictures_of_any_size_have_tiles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
