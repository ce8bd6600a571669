/* The ground truth covers exactly what triangles cover, once, and lights it as Phong's formula does. SPDX-License-Identifier: MIT
 */
#include "support.h"

static pbr_mesh *make_mesh(pbr_instance *instance, const float *positions, const uint8_t *colours, uint32_t vertex_count,
                           const uint32_t *triangles, uint32_t triangle_count) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    desc.vertex_count = vertex_count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = triangle_count;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    return mesh;
}

static void draw_mesh(struct stage *stage, const pbr_mesh *mesh, const pbr_item *item, uint32_t samples) {
    pbr_image_destroy(stage->instance, &stage->image);
    assert_int_equal(pbr_ground_truth(stage->instance, &stage->frame, item, &mesh, 1, samples, NULL, &stage->image), PBR_OK);
}

static double sum_alpha(const struct stage *stage) {
    double sum = 0;
    for (size_t i = 0; i < SIZE * SIZE; i++) sum += (double)stage->image.rgba[4 * i + 3];
    return sum;
}

/* One unit is one pixel; the lower left is (0, 0). */
static void look_flat(struct stage *stage) {
    look_parallel(stage, 1);
    stage->frame.projection[12] = stage->frame.projection[13] = -1;
}

static const uint32_t one[3] = {0, 1, 2};

/* The error of n x n samples is some sample per 1 / n pixel of the outline, and much less where they even out. */
static void coverage_converges_to_the_area(void **state) {
    struct stage stage;
    uint64_t random = 9;
    double errors[17] = {0};
    (void)state;
    stage_open(&stage, 1);
    look_flat(&stage);
    const pbr_item item = plain_item(NULL, 0);
    for (int i = 0; i < 20; i++) {
        float corners[3][3];
        for (int k = 0; k < 3; k++) {
            corners[k][0] = (float)(SIZE * uniform(&random));
            corners[k][1] = (float)(SIZE * uniform(&random));
            corners[k][2] = (float)(-1 - 5 * uniform(&random));
        }
        const double area = fabs((double)(corners[1][0] - corners[0][0]) * (double)(corners[2][1] - corners[0][1]) -
                                 (double)(corners[2][0] - corners[0][0]) * (double)(corners[1][1] - corners[0][1])) /
                            2;
        pbr_mesh *mesh = make_mesh(stage.instance, corners[0], NULL, 3, one, 1);
        for (uint32_t n = 1; n <= 16; n *= 4) {
            draw_mesh(&stage, mesh, &item, n);
            errors[n] += fabs(sum_alpha(&stage) - area) / 20;
        }
        pbr_mesh_release(&mesh);
    }
    assert_true(errors[4] < errors[1] / 2 && errors[16] < errors[4] / 2);
    assert_true(errors[16] < 0.1); /* pixels, of triangles of some 300 */
    stage_close(&stage);
}

/* Sample by sample: the sum of alphas is that of the triangles alone, where they share an edge or a corner, also where these pass
 * through samples: corners on multiples of 1/4 of a pixel, samples at odd multiples of 1/8 and, with 2 x 2, of 1/4. */
static void triangles_that_touch_leave_no_gap_and_no_double(void **state) {
    enum { SIDE = 9, CELLS = (SIDE - 1) * (SIDE - 1) };
    float positions[SIDE * SIDE][3];
    uint32_t triangles[2 * CELLS][3];
    struct stage stage;
    uint64_t random = 4;
    (void)state;
    stage_open(&stage, 1);
    look_flat(&stage);
    const pbr_item item = plain_item(NULL, 0);
    for (int round = 0; round < 6; round++) {
        for (int i = 0; i < SIDE * SIDE; i++) { /* a grid from 8 to 56, its inner corners moved by up to 1.25 pixels */
            const bool inner = i % SIDE % (SIDE - 1) && i / SIDE % (SIDE - 1);
            for (int k = 0; k < 2; k++)
                positions[i][k] = (float)(8 + 6 * (k ? i / SIDE : i % SIDE) + (inner ? floor(11 * uniform(&random) - 5) / 4 : 0));
            positions[i][2] = (float)(-1 - uniform(&random));
        }
        for (int i = 0; i < CELLS; i++) {
            const uint32_t a = (uint32_t)(i / (SIDE - 1) * SIDE + i % (SIDE - 1)), b = a + 1, c = a + SIDE, d = c + 1;
            const uint32_t cell[2][2][3] = {{{a, b, c}, {d, b, c}}, {{a, b, d}, {a, c, d}}}; /* of both orientations */
            memcpy(triangles[2 * i], cell[uniform(&random) < 0.5], sizeof cell[0]);
        }
        for (uint32_t n = 1; n <= 4; n++) {
            double sum = 0;
            pbr_mesh *mesh = make_mesh(stage.instance, positions[0], NULL, SIDE * SIDE, triangles[0], 2 * CELLS);
            draw_mesh(&stage, mesh, &item, n);
            pbr_mesh_release(&mesh);
            for (int y = 0; y < SIZE; y++)
                for (int x = 0; x < SIZE; x++) {
                    const bool in = x >= 8 && x < 56 && y >= 8 && y < 56;
                    assert_true(colour_at(&stage, x, y)[3] == (in ? 1 : 0));
                }
            for (int i = 0; i < 2 * CELLS; i++) {
                mesh = make_mesh(stage.instance, positions[0], NULL, SIDE * SIDE, triangles[i], 1);
                draw_mesh(&stage, mesh, &item, n);
                pbr_mesh_release(&mesh);
                sum += sum_alpha(&stage);
            }
            assert_true(fabs(sum - 48 * 48) < 1e-3);
        }
    }
    stage_close(&stage);
}

/* Two triangles of a floor that reaches behind the eye, against rays. */
static void what_passes_the_eye_is_drawn_as_far_as_it_is_before_it(void **state) {
    static const float corners[4][3] = {{-3, -1, 20}, {5, -1.2f, 10}, {2, -0.7f, -9}, {-8, -1, -7}};
    static const uint32_t halves[2][3] = {{0, 1, 2}, {0, 2, 3}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_mesh *mesh = make_mesh(stage.instance, corners[0], NULL, 4, halves[0], 2);
    const pbr_item item = plain_item(NULL, 0);
    draw_mesh(&stage, mesh, &item, 1);
    int hits = 0;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            double along[3], nearest = INFINITY;
            pixel_ray(32, x, y, along);
            for (int i = 0; i < 2; i++) { /* Moeller & Trumbore 1997 */
                double a[3], e[3], g[3], p[3], q[3];
                for (int k = 0; k < 3; k++) {
                    a[k] = -(double)corners[halves[i][0]][k];
                    e[k] = (double)corners[halves[i][1]][k] + a[k];
                    g[k] = (double)corners[halves[i][2]][k] + a[k];
                }
                for (int k = 0; k < 3; k++) {
                    p[k] = along[(k + 1) % 3] * g[(k + 2) % 3] - along[(k + 2) % 3] * g[(k + 1) % 3];
                    q[k] = a[(k + 1) % 3] * e[(k + 2) % 3] - a[(k + 2) % 3] * e[(k + 1) % 3];
                }
                const double det = dot(e, p), u = dot(a, p) / det, v = dot(along, q) / det, t = dot(g, q) / det;
                if (u >= 0 && v >= 0 && u + v <= 1 && t >= 0.5 && t < nearest) nearest = t;
            }
            assert_int_equal(is_covered(&stage, x, y), isfinite(nearest));
            if (isfinite(nearest)) assert_true(fabs(depth_at(&stage, x, y) - nearest) < 1e-5 * nearest);
            hits += isfinite(nearest);
        }
    assert_true(hits > 500);
    pbr_mesh_release(&mesh);
    stage_close(&stage);
}

/* Of a crossing pair each sample sees the nearer; the depth is the nearest sample's. */
static void visibility_is_decided_by_sample(void **state) {
    static const float corners[6][3] = {{0, 0, -2}, {64, 0, -6}, {32, 128, -4}, {0, 0, -6}, {64, 0, -2}, {32, 128, -4}};
    static const uint8_t colours[6][3] = {{255, 0, 0}, {255, 0, 0}, {255, 0, 0}, {0, 255, 0}, {0, 255, 0}, {0, 255, 0}};
    static const uint32_t both[2][3] = {{0, 1, 2}, {3, 4, 5}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look_flat(&stage);
    stage.frame.jitter[0] = 0.25; /* the cross is a quarter into pixel 32 */
    pbr_mesh *mesh = make_mesh(stage.instance, corners[0], colours[0], 6, both[0], 2);
    const pbr_item item = plain_item(NULL, 0);
    draw_mesh(&stage, mesh, &item, 8);
    for (int x = 20; x < 44; x++) {
        const float red = x < 32 ? 1 : x > 32 ? 0 : 0.25f;
        assert_true(fabsf(colour_at(&stage, x, 10)[0] - red) < 1e-6f && fabsf(colour_at(&stage, x, 10)[1] - (1 - red)) < 1e-6f);
        /* The sample farthest from the cross. */
        const double away = x < 32 ? 32.25 - x - 1 / 16.0 : x + 1 - 1 / 16.0 - 32.25;
        assert_true(fabs(depth_at(&stage, x, 10) - (4 - away / 16)) < 1e-5);
    }
    pbr_mesh_release(&mesh);
    stage_close(&stage);
}

/* Black to white in sRGB is 0 to 1 in linear light; in perspective, along the triangle. */
static void colours_are_interpolated_in_linear_light(void **state) {
    static const float corners[4][3] = {{-1, -1, -1}, {4, -1, -4}, {4, 1, -4}, {-1, 1, -1}};
    static const uint8_t colours[4][3] = {{0, 0, 0}, {255, 255, 255}, {255, 255, 255}, {0, 0, 0}};
    static const uint32_t halves[2][3] = {{0, 1, 2}, {0, 2, 3}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_mesh *mesh = make_mesh(stage.instance, corners[0], colours[0], 4, halves[0], 2);
    pbr_item item = plain_item(NULL, 0);
    draw_mesh(&stage, mesh, &item, 1);
    for (int x = 0; x < SIZE; x++) {
        const double slope = (x + 0.5 - 32) / 32, s = (1 + slope) / (5 - 3 * slope); /* where slope (1 + 3 s) = -1 + 5 s */
        assert_true(fabs((double)colour_at(&stage, x, 32)[0] - s) < 1e-6);
    }
    item.colour_source = PBR_COLOUR_CONSTANT;
    item.colour[1] = 0.25f;
    draw_mesh(&stage, mesh, &item, 2);
    assert_true(colour_at(&stage, 20, 32)[0] == 0 && colour_at(&stage, 20, 32)[1] == 0.25f && colour_at(&stage, 20, 32)[3] == 1);
    pbr_mesh_release(&mesh);
    stage_close(&stage);
}

enum { RINGS = 96, SECTORS = 192, BALL_VERTICES = RINGS * SECTORS + 2, BALL_TRIANGLES = 2 * RINGS * SECTORS };

/* A ball of radius 1. */
static pbr_mesh *make_ball(pbr_instance *instance, bool inside_out) {
    static float positions[BALL_VERTICES][3];
    static uint32_t triangles[BALL_TRIANGLES][3];
    const double pi = 3.14159265358979323846;
    uint32_t count = 0;
    for (uint32_t i = 0; i < RINGS * SECTORS; i++) {
        const double latitude = pi * (i / SECTORS + 1) / (RINGS + 1), longitude = 2 * pi * (i % SECTORS) / SECTORS;
        positions[i][0] = (float)(sin(latitude) * cos(longitude));
        positions[i][1] = (float)(sin(latitude) * sin(longitude));
        positions[i][2] = (float)cos(latitude);
    }
    positions[BALL_VERTICES - 2][2] = 1;
    positions[BALL_VERTICES - 1][2] = -1;
    for (uint32_t s = 0; s < SECTORS; s++) {
        const uint32_t next = (s + 1) % SECTORS, last = (RINGS - 1) * SECTORS;
        memcpy(triangles[count++], (uint32_t[]){BALL_VERTICES - 2, s, next}, sizeof triangles[0]);
        memcpy(triangles[count++], (uint32_t[]){BALL_VERTICES - 1, last + next, last + s}, sizeof triangles[0]);
        for (uint32_t r = 0; r + 1 < RINGS; r++) {
            const uint32_t a = r * SECTORS + s, b = r * SECTORS + next;
            memcpy(triangles[count++], (uint32_t[]){a, a + SECTORS, b}, sizeof triangles[0]);
            memcpy(triangles[count++], (uint32_t[]){b, a + SECTORS, b + SECTORS}, sizeof triangles[0]);
        }
    }
    for (uint32_t i = 0; i < count && inside_out; i++) {
        const uint32_t kept = triangles[i][1];
        triangles[i][1] = triangles[i][2];
        triangles[i][2] = kept;
    }
    return make_mesh(instance, positions[0], NULL, BALL_VERTICES, triangles[0], count);
}

/* Phong (1975) with a point light and dim ambient light, against the ball that rays meet. An inside-out ball looks the same. */
static void a_ball_is_lit_as_phong_says(void **state) {
    static const double identity_back[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1};
    pbr_light light = PBR_LIGHT_INIT;
    struct stage stage;
    (void)state;
    stage_open(&stage, 2);
    light.kind = PBR_LIGHT_POINT;
    memcpy(light.vector, (double[]){2, 3, 1}, sizeof light.vector);
    memcpy(light.colour, (float[]){0.9f, 0.6f, 0.3f}, sizeof light.colour);
    stage.frame.lights = &light;
    stage.frame.light_count = 1;
    for (int k = 0; k < 3; k++) stage.frame.ambient[k] = 0.5f;
    look(&stage, 90);
    for (int inside_out = 0; inside_out < 2; inside_out++) {
        pbr_mesh *mesh = make_ball(stage.instance, inside_out);
        pbr_item item = PBR_ITEM_INIT;
        item.transforms = identity_back;
        item.transform_count = 1;
        item.material = (pbr_material){0.2f, 0.7f, 0.3f, 20};
        draw_mesh(&stage, mesh, &item, 1);
        int compared = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double d[3], n[3], l[3], e[3], m[3];
                pixel_ray(90, x, y, d);
                const double a = dot(d, d), b = 3, root = b * b - a * 8; /* |t d - (0, 0, -3)| = 1 */
                if (root < 0.15) { /* by the outline normals differ much from pixel to pixel */
                    if (root < -0.1) assert_false(is_covered(&stage, x, y));
                    continue;
                }
                const double t = (b - sqrt(root)) / a;
                for (int k = 0; k < 3; k++) {
                    n[k] = t * d[k] + (k == 2 ? 3 : 0);
                    l[k] = light.vector[k] - t * d[k];
                    e[k] = -d[k];
                }
                unit(l);
                unit(e);
                for (int k = 0; k < 3; k++) m[k] = 2 * dot(n, e) * n[k] - e[k];
                for (int k = 0; k < 3; k++) {
                    const double wanted = 0.8 * (0.2 * 0.5 + 0.7 * fmax(dot(n, l), 0) * (double)light.colour[k]) +
                                          0.3 * pow(fmax(dot(m, l), 0), 20) * (double)light.colour[k];
                    assert_true(fabs((double)colour_at(&stage, x, y)[k] - wanted) < 2e-3);
                }
                assert_true(fabs(depth_at(&stage, x, y) - t) < 1e-3);
                compared++;
            }
        assert_true(compared > 1000);
        /* From within, it shows its other side alone. */
        item.flags = PBR_ITEM_CULL_BACK_FACES;
        draw_mesh(&stage, mesh, &item, 1);
        assert_true(fabs(depth_at(&stage, 32, 32) - (inside_out ? 4 : 2)) < 1e-3);
        pbr_mesh_release(&mesh);
    }
    stage_close(&stage);
}

static void clip_planes_cut_by_sample(void **state) {
    static const float corners[3][3] = {{-100, -100, -3}, {100, -100, -3}, {0, 200, -3}};
    static const double plane[4] = {1, 0, 0, -10.25};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    look_flat(&stage);
    pbr_mesh *mesh = make_mesh(stage.instance, corners[0], NULL, 3, one, 1);
    pbr_item item = plain_item(NULL, 0);
    item.clip_planes = plane;
    item.clip_plane_count = 1;
    draw_mesh(&stage, mesh, &item, 4);
    for (int x = 0; x < 20; x++) assert_true(colour_at(&stage, x, 20)[3] == (x < 10 ? 0 : x > 10 ? 1 : 0.75f));
    pbr_mesh_release(&mesh);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coverage_converges_to_the_area),
        cmocka_unit_test(triangles_that_touch_leave_no_gap_and_no_double),
        cmocka_unit_test(what_passes_the_eye_is_drawn_as_far_as_it_is_before_it),
        cmocka_unit_test(visibility_is_decided_by_sample),
        cmocka_unit_test(colours_are_interpolated_in_linear_light),
        cmocka_unit_test(a_ball_is_lit_as_phong_says),
        cmocka_unit_test(clip_planes_cut_by_sample),
    };
    return cmocka_run_group_tests_name("ground_truth", tests, NULL, NULL);
}
