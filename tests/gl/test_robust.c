/* Clouds, views and matrices at the limits of what the API takes do no harm to any kind of splat: what is drawn is finite and,
 * where the mathematics is exact, exact. What test_disc.c holds for ellipses alone is not repeated. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/colour.h"

#include <math.h>
#include <pbr/reference.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = PICTURE_WIDTH, HEIGHT = PICTURE_HEIGHT, PIXELS = WIDTH * HEIGHT };

/* ---- Every kind ---- */

/* The last kind; after it the opaque ones once more, filled. */
enum { LAST_SPLAT = PBR_SPLAT_EWA_MAX, KINDS = LAST_SPLAT + 1 + 3 };

static pbr_item item_of(int kind, const pbr_points *points) {
    const bool filled = kind > LAST_SPLAT;
    pbr_item item = plain_item(points, (uint32_t)(filled ? kind - LAST_SPLAT - 1 : kind));
    item.blending = filled ? PBR_BLEND_FILL : PBR_BLEND_KIND;
    return item;
}

/* ---- A scene: coloured points, a target of the best precision that the context has, and pixels that are not to be touched ---- */

struct scene {
    struct host *host;
    struct camera cameras[CAMERAS];
    struct target target;
    float (*pixels)[4];
    float *depth;
};

static const float untouched[4] = {0.25f, 0.5f, 0.75f, 0.5f}; /* exact in half floats */

static struct scene scene_open(void **state, int width, int height) {
    struct scene scene = {.host = *state};
    make_cameras(scene.cameras);
    if (!target_create(&scene.target, width, height, GL_RGBA32F, GL_DEPTH_COMPONENT32F, 0) &&
        !target_create(&scene.target, width, height, GL_RGBA16F, GL_DEPTH_COMPONENT32F, 0))
        assert_true(target_create(&scene.target, width, height, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&scene.target);
    scene.pixels = malloc((size_t)width * (size_t)height * sizeof(*scene.pixels));
    scene.depth = malloc((size_t)width * (size_t)height * sizeof(*scene.depth));
    assert_true(scene.pixels && scene.depth);
    return scene;
}

static void scene_close(struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&scene->target);
    free(scene->pixels);
    free(scene->depth);
}

static void draw(struct scene *scene, const pbr_frame *frame, const pbr_item *item, const float clear[4]) {
    target_clear(&scene->target, clear, frame->flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
    render(scene->host, frame, item, 1);
    target_read_float(&scene->target, scene->pixels);
    target_read_depth(&scene->target, scene->depth);
}

static bool is_untouched(const float pixel[4]) {
    for (int k = 0; k < 4; k++)
        if (fabs((double)pixel[k] - (double)untouched[k]) > 1.0 / 255) return false; /* as 8-bit targets store it */
    return true;
}

static long count_touched(const struct scene *scene) {
    long touched = 0;
    for (int i = 0; i < scene->target.width * scene->target.height; i++) touched += !is_untouched(scene->pixels[i]);
    return touched;
}

static void expect_sane(const struct scene *scene, const char *what, int kind) {
    for (int i = 0; i < scene->target.width * scene->target.height; i++) {
        for (int k = 0; k < 4; k++)
            if (!(scene->pixels[i][k] >= 0 && scene->pixels[i][k] <= 1.2f)) /* Phong's coefficients add up to 1.15 */
                fail_msg("%s, kind %d: pixel %d has the value %g", what, kind, i, (double)scene->pixels[i][k]);
        if (!(scene->depth[i] >= 0 && scene->depth[i] <= 1))
            fail_msg("%s, kind %d: pixel %d has depth %g", what, kind, i, (double)scene->depth[i]);
    }
}

struct cloud {
    size_t count;
    const double (*positions)[3], (*normals)[3];
    const float *radii;
};

static pbr_points *make_points(struct host *host, const struct cloud *cloud) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = cloud->count;
    desc.positions = (pbr_attribute){cloud->positions, 0, PBR_FORMAT_FLOAT64, 3};
    if (cloud->normals) desc.normals = (pbr_attribute){cloud->normals, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){cloud->radii, 0, PBR_FORMAT_FLOAT32, 1};
    if (pbr_points_create(host->instance, &desc, &points) != PBR_OK) fail_msg("no points: %s", host->log);
    return points;
}

static void drop(struct scene *scene, pbr_points **points) {
    pbr_renderer_evict(scene->host->renderer, *points);
    pbr_points_release(points);
}

/* ---- What the points say ---- */

static void odd_points_give_finite_pictures(void **state) {
    static const float radii[] = {0, -1, 1e-42f, 0.3f, 1e30f, NAN, INFINITY, -INFINITY};
    static const double normals[][3] = {{0, 0, 0},        {0, 0, 1},      {1, 0, 0},    {NAN, 0, 1},
                                        {INFINITY, 0, 0}, {1e-300, 0, 0}, {0, 1e300, 0}};
    enum { RADII = sizeof(radii) / sizeof(radii[0]), NORMALS = sizeof(normals) / sizeof(normals[0]), AT = 3 };
    static const double at[AT][3] = {{0, 0, -5}, {0, 0, 0}, {NAN, INFINITY, -5}};
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(scene.host);
        for (int r = 0; r < RADII; r++) {
            double positions[NORMALS * AT][3], given[NORMALS * AT][3];
            float all[NORMALS * AT];
            for (int i = 0; i < NORMALS * AT; i++) {
                memcpy(positions[i], at[i % AT], sizeof(positions[i]));
                memcpy(given[i], normals[i / AT], sizeof(given[i]));
                all[i] = radii[r];
            }
            const struct cloud cloud = {NORMALS * AT, (const double(*)[3])positions, (const double(*)[3])given, all};
            pbr_points *points = make_points(scene.host, &cloud);
            for (int kind = 0; kind < KINDS; kind++)
                for (int c = 0; c < CAMERAS; c += 4) {
                    const pbr_item item = item_of(kind, points);
                    draw(&scene, &scene.cameras[c].frame, &item, untouched);
                    expect_sane(&scene, scene.cameras[c].name, kind);
                }
            drop(&scene, &points);
        }
    }
    scene_close(&scene);
}

/* A mean of equal colours is that colour, whatever the sum of weights. Half a step of 8 bits is more than float targets round by.
 */
static void thousands_at_one_place_keep_their_colour(void **state) {
    enum { COUNT = 5000 };
    static const float colour[4] = {0.6f, 0.3f, 0.05f, 1};
    static double positions[COUNT][3], normals[COUNT][3];
    static float radii[COUNT];
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    for (int i = 0; i < COUNT; i++) {
        positions[i][2] = -2;
        normals[i][2] = 1;
        radii[i] = 0.05f;
    }
    const struct cloud cloud = {COUNT, (const double(*)[3])positions, (const double(*)[3])normals, radii};
    pbr_points *points = make_points(scene.host, &cloud);
    pbr_frame frame = scene.cameras[0].frame;
    frame.encoding = PBR_ENCODING_LINEAR;
    for (int kind = 0; kind < KINDS; kind++) {
        pbr_item item = item_of(kind, points);
        memcpy(item.colour, colour, sizeof(colour));
        draw(&scene, &frame, &item, (const float[4]){0, 0, 0, 0});
        expect_sane(&scene, "coincident", kind);
        if (context_kind() == HEADLESS_ES_30 && kind >= PBR_SPLAT_GAUSSIAN) continue; /* half floats stall: docs/internals.md */
        long covered = 0;
        for (int i = 0; i < PIXELS; i++) {
            if (scene.pixels[i][3] == 0) continue;
            covered++;
            for (int k = 0; k < 4; k++)
                if (!(fabs((double)scene.pixels[i][k] - (double)colour[k]) <= 0.5 / 255 + 1e-6))
                    fail_msg("kind %d: pixel %d has %g, not %g", kind, i, (double)scene.pixels[i][k], (double)colour[k]);
        }
        assert_true(covered > 4);
    }
    drop(&scene, &points);
    scene_close(&scene);
}

static void what_is_behind_every_camera_touches_nothing(void **state) {
    enum { COUNT = 27 };
    double positions[COUNT][3], normals[COUNT][3];
    float radii[COUNT];
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    for (int i = 0; i < COUNT; i++) {
        const int step[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        for (int k = 0; k < 3; k++) positions[i][k] = 0.1 * step[k] + (k == 2 ? 60 : 0), normals[i][k] = step[k];
        radii[i] = 0.5f;
    }
    const struct cloud cloud = {COUNT, (const double(*)[3])positions, (const double(*)[3])normals, radii};
    const struct cloud none = {0, (const double(*)[3])positions, (const double(*)[3])normals, radii};
    for (int empty = 0; empty < 2; empty++) {
        pbr_points *points = make_points(scene.host, empty ? &none : &cloud);
        for (int kind = 0; kind < KINDS; kind++)
            for (int c = 0; c < CAMERAS; c++) {
                const pbr_item item = item_of(kind, points);
                draw(&scene, &scene.cameras[c].frame, &item, untouched);
                if (count_touched(&scene) > 0) fail_msg("%s, kind %d: pixels are touched", scene.cameras[c].name, kind);
            }
        drop(&scene, &points);
    }
    scene_close(&scene);
}

/* ---- Viewports ---- */

static void check_viewport(void **state, int width, int height) {
    static const double position[1][3] = {{0, 0, -5}}, normal[1][3] = {{0, 0, 1}};
    static const float radius[1] = {200};
    struct scene scene = scene_open(state, width + 2, height + 2);
    const struct cloud cloud = {1, position, normal, radius};
    pbr_points *points = make_points(scene.host, &cloud);
    for (int kind = 0; kind < KINDS; kind++) {
        pbr_frame frame = scene.cameras[0].frame;
        const pbr_item item = item_of(kind, points);
        frame_set_viewport(&frame, 1, 1, width, height);
        matrix_perspective(1, 1, 1, 100, frame.projection);
        draw(&scene, &frame, &item, untouched);
        for (int y = 0; y < height + 2; y++)
            for (int x = 0; x < width + 2; x++) {
                const bool inside = x > 0 && x <= width && y > 0 && y <= height;
                const float *pixel = scene.pixels[y * (width + 2) + x];
                if (is_untouched(pixel) == inside) fail_msg("kind %d: pixel (%d, %d) of alpha %g", kind, x, y, (double)pixel[3]);
            }
    }
    drop(&scene, &points);
    scene_close(&scene);
}

static void a_viewport_of_one_pixel_is_filled_and_not_left(void **state) {
    check_viewport(state, 1, 1);
}

static void the_widest_viewport_is_filled_and_not_left(void **state) {
    GLint widest[2], texture;
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, widest);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &texture); /* targets of the renderer's own are textures */
    const int most = widest[0] < texture ? widest[0] : texture;
    check_viewport(state, (most < 16384 ? most : 16384) - 2, 16);
}

/* ---- Matrices ---- */

/* A dented ball that its splats close, a metre or two before the first camera. */
static pbr_points *make_ball(struct host *host, double x) {
    enum { COUNT = 1500 };
    static double positions[COUNT][3], normals[COUNT][3];
    static float radii[COUNT];
    for (int i = 0; i < COUNT; i++) {
        const double z = 1 - 2 * (i + 0.5) / COUNT, turn = 2.39996323 * i, ring = sqrt(1 - z * z);
        const double direction[3] = {ring * cos(turn), ring * sin(turn), z};
        for (int k = 0; k < 3; k++) {
            positions[i][k] = direction[k] + (k == 0 ? x : 0);
            normals[i][k] = direction[k] + 0.15 * sin(9 * direction[(k + 1) % 3]);
        }
        radii[i] = (float)(sqrt(4 * 3.14159265 / COUNT) * (0.9 + 0.2 * (i % 7) / 7));
    }
    const struct cloud cloud = {COUNT, (const double(*)[3])positions, (const double(*)[3])normals, radii};
    return make_points(host, &cloud);
}

struct comparison {
    double psnr;  /* of sRGB values, but for those of the pixels: */
    long alone;   /* that one alone covers */
    long apart;   /* or that differ by more than 8 of 255: edges on which rounding decides */
    long covered; /* by the second */
};

static struct comparison compare(const struct scene *scene, const float (*expected)[4], bool mirrored) {
    struct comparison out = {0};
    double sum = 0;
    long count = 0;
    for (int i = 0; i < PIXELS; i++) {
        const float *a = scene->pixels[mirrored ? i / WIDTH * WIDTH + WIDTH - 1 - i % WIDTH : i], *b = expected[i];
        double squared = 0, most = 0;
        for (int k = 0; k < 3; k++) {
            const double off = srgb_from_linear(fminf(a[k], 1)) - srgb_from_linear(fminf(b[k], 1));
            squared += off * off;
            most = fmax(most, fabs(off));
        }
        const bool is_alone = (a[3] > 0) != (b[3] > 0), is_apart = is_alone || most > 8 / 255.0;
        out.covered += b[3] > 0;
        out.alone += is_alone;
        out.apart += is_apart;
        if (is_apart) continue;
        sum += squared / 3;
        count++;
    }
    out.psnr = sum > 0 ? 10 * log10((double)count / sum) : INFINITY;
    return out;
}

/* The tolerances of test_reference.c, and their reasons. */
static bool is_alike(const struct comparison *result) {
    return result->psnr >= 50 && (double)result->apart <= 0.03 * (double)result->covered && result->alone * 100 <= result->covered;
}

/* Mirrored are also the sides of edge pixels that a rounding decides. */
static void a_mirrored_model_is_the_mirrored_picture(void **state) {
    static float first[PIXELS][4];
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    pbr_points *points = make_ball(scene.host, 0.4);
    pbr_frame frame = scene.cameras[0].frame;
    double place[16], mirror[16], both[16];
    frame.encoding = PBR_ENCODING_LINEAR;
    matrix_perspective(0.9, (double)WIDTH / HEIGHT, 1, 100, frame.projection);
    matrix_translation(0, 0, -4, place);
    memcpy(both, place, sizeof(both));
    matrix_scaling(-1, 1, 1, mirror);
    both[0] = mirror[0];
    for (int kind = 0; kind < KINDS; kind++) {
        pbr_item item = item_of(kind, points);
        item.shading = PBR_SHADE_PHONG;
        item.flags = PBR_ITEM_CULL_BACK_FACES;
        item.transform_count = 1;
        item.transforms = place;
        draw(&scene, &frame, &item, (const float[4]){0, 0, 0, 0});
        memcpy(first, scene.pixels, sizeof(first));
        item.transforms = both;
        draw(&scene, &frame, &item, (const float[4]){0, 0, 0, 0});
        const struct comparison result = compare(&scene, (const float(*)[4])first, true);
        assert_true(result.covered > 500);
        if (!is_alike(&result))
            fail_msg("kind %d: %ld of %ld pixels apart, %.1f dB", kind, result.apart, result.covered, result.psnr);
    }
    drop(&scene, &points);
    scene_close(&scene);
}

static void draw_reference(struct scene *scene, const pbr_frame *frame, const pbr_item *item, float (*out)[4]) {
    pbr_image image = PBR_IMAGE_INIT;
    assert_int_equal(pbr_reference_render(scene->host->instance, frame, item, 1, NULL, &image), PBR_OK);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(out[y * WIDTH], image.rgba + (size_t)(HEIGHT - 1 - y) * WIDTH * 4, sizeof(float[4]) * WIDTH);
    pbr_image_destroy(scene->host->instance, &image);
}

static void stretched_and_nearby_models_are_as_the_reference_draws_them(void **state) {
    static float expected[PIXELS][4];
    static const struct {
        const char *what;
        double scale[3], place[3];
    } cases[] = {
        {"stretched", {1.6, 0.5, 1}, {0, 0, -5}},
        {"flat and mirrored", {1.5, -1.2, 0.1}, {0.3, 0, -4}},
        {"through the near plane", {1, 1, 1}, {0.2, 0.1, -1.6}},
    };
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    pbr_points *points = make_ball(scene.host, 0);
    pbr_frame frame = scene.cameras[0].frame;
    frame.encoding = PBR_ENCODING_LINEAR;
    frame_set_viewport(&frame, 0, 0, WIDTH, HEIGHT);
    matrix_perspective(0.9, (double)WIDTH / HEIGHT, 1, 100, frame.projection);
    for (size_t c = 0; c < sizeof(cases) / sizeof(cases[0]); c++) {
        double model[16];
        matrix_scaling(cases[c].scale[0], cases[c].scale[1], cases[c].scale[2], model);
        memcpy(model + 12, cases[c].place, sizeof(cases[c].place));
        for (int kind = 0; kind < KINDS; kind++) {
            pbr_item item = item_of(kind, points);
            item.shading = PBR_SHADE_PHONG;
            item.transforms = model;
            item.transform_count = 1;
            draw(&scene, &frame, &item, (const float[4]){0, 0, 0, 0});
            draw_reference(&scene, &frame, &item, expected);
            const struct comparison result = compare(&scene, (const float(*)[4])expected, false);
            assert_true(result.covered > 200);
            if (!is_alike(&result))
                fail_msg("%s, kind %d: %ld of %ld pixels apart, %.1f dB", cases[c].what, kind, result.apart, result.covered,
                         result.psnr);
        }
    }
    drop(&scene, &points);
    scene_close(&scene);
}

static void singular_and_huge_matrices_give_finite_pictures(void **state) {
    static const double scales[][3] = {{0, 0, 0},          {1, 1, 0},       {0, 1, 1}, {1, 0, 0}, {1e-30, 1e-30, 1e-30},
                                       {1e30, 1e30, 1e30}, {1e15, 1, 1e-15}};
    struct scene scene = scene_open(state, WIDTH, HEIGHT);
    pbr_points *points = make_ball(scene.host, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(scene.host);
        for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++)
            for (int kind = 0; kind < KINDS; kind++)
                for (int c = 0; c < CAMERAS; c += 6) {
                    pbr_item item = item_of(kind, points);
                    double model[16];
                    matrix_scaling(scales[s][0], scales[s][1], scales[s][2], model);
                    model[14] = -5;
                    item.shading = kind % 2 ? PBR_SHADE_PHONG : PBR_SHADE_DEFERRED;
                    item.transforms = model;
                    item.transform_count = 1;
                    draw(&scene, &scene.cameras[c].frame, &item, (const float[4]){0, 0, 0, 0});
                    expect_sane(&scene, scene.cameras[c].name, kind);
                }
    }
    drop(&scene, &points);
    scene_close(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(odd_points_give_finite_pictures),
        GL_TEST(thousands_at_one_place_keep_their_colour),
        GL_TEST(what_is_behind_every_camera_touches_nothing),
        GL_TEST(a_viewport_of_one_pixel_is_filled_and_not_left),
        GL_TEST(the_widest_viewport_is_filled_and_not_left),
        GL_TEST(a_mirrored_model_is_the_mirrored_picture),
        GL_TEST(stretched_and_nearby_models_are_as_the_reference_draws_them),
        GL_TEST(singular_and_huge_matrices_give_finite_pictures),
    };
    return RUN_GL_TESTS("robust", tests);
}
