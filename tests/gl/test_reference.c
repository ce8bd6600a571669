/* Every kind of splat, under every kind of camera, looks as the reference renderer draws it, which shares no formula with the
 * shaders. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/colour.h"

#include <math.h>
#include <pbr/reference.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 2500, PIXELS = PICTURE_WIDTH * PICTURE_HEIGHT };

/* Of 8-bit values. Rounding alone gives some 59 dB; LEAST_PSNR leaves room for float arithmetic, half floats and the sRGB
 * polynomials, and for little else. Where splats end within another's colour, which one a pixel's centre falls on is decided by how
 * finely a GPU places points: llvmpipe puts up to 0.6 % of the pixels on the other side than the reference does, an NVIDIA H100
 * 1.9 %. Those are counted by themselves, and LEAST_OF_ALL is theirs, too. */
static const double LEAST_PSNR = 50, LEAST_OF_ALL = 42, MOST_APART = 0.03;
enum { APART = 8 };

struct quality {
    double psnr, of_all;
    int apart, covered;
};

struct scene {
    struct host *host;
    struct target target;
    pbr_points *points;
    uint8_t (*drawn)[4], (*expected)[4];
};

/* A dented ball whose splats close it: coloured, with normals of its own shape, and a few without; smooth: with all. */
static pbr_points *make_ball(struct host *host, int count, bool smooth) {
    float(*positions)[3] = malloc(count * sizeof(*positions)), (*normals)[3] = malloc(count * sizeof(*normals));
    uint8_t(*colours)[3] = malloc(count * sizeof(*colours));
    float *radii = malloc(count * sizeof(*radii));
    assert_true(positions && normals && colours && radii);
    for (int i = 0; i < count; i++) {
        const double z = 1 - 2 * (i + 0.5) / count, turn = 2.39996323 * i, ring = sqrt(1 - z * z);
        const double direction[3] = {ring * cos(turn), ring * sin(turn), z};
        for (int k = 0; k < 3; k++) {
            positions[i][k] = (float)(2.2 * direction[k] + (k == 2 ? -6 : 0));
            normals[i][k] = i % 500 == 7 && !smooth ? 0 : (float)(direction[k] + 0.15 * sin(9 * direction[(k + 1) % 3]));
            colours[i][k] = (uint8_t)(130 + 120 * sin(5 * direction[k] + k));
        }
        radii[i] = (float)(2.2 * sqrt(4 * 3.14159265 / count) * (0.9 + 0.2 * (i % 7) / 7));
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    free(positions);
    free(normals);
    free(colours);
    free(radii);
    return points;
}

static void scene_open(struct scene *scene, struct host *host) {
    *scene = (struct scene){.host = host, .points = make_ball(host, POINTS, false)};
    scene->drawn = malloc(PIXELS * sizeof(*scene->drawn));
    scene->expected = malloc(PIXELS * sizeof(*scene->expected));
    assert_true(scene->drawn && scene->expected);
    assert_true(target_create(&scene->target, PICTURE_WIDTH, PICTURE_HEIGHT, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&scene->target);
}

static void scene_close(struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&scene->target);
    pbr_points_release(&scene->points);
    free(scene->drawn);
    free(scene->expected);
}

/* The reference's picture as the target stores it: bytes of sRGB, rows from the bottom, the viewport within the target. */
static void draw_reference(struct scene *scene, const pbr_frame *frame, const pbr_item *item) {
    pbr_image image = PBR_IMAGE_INIT;
    assert_int_equal(pbr_reference_render(scene->host->instance, frame, item, 1, NULL, &image), PBR_OK);
    memset(scene->expected, 0, PIXELS * sizeof(*scene->expected));
    for (uint32_t y = 0; y < image.height; y++)
        for (uint32_t x = 0; x < image.width; x++) {
            const float *from = image.rgba + 4 * ((size_t)(image.height - 1 - y) * image.width + x);
            uint8_t *to = scene->expected[((int)y + frame->viewport[1]) * PICTURE_WIDTH + (int)x + frame->viewport[0]];
            for (int k = 0; k < 4; k++) to[k] = unorm8(k < 3 ? srgb_from_linear(from[k]) : from[k]);
        }
    pbr_image_destroy(scene->host->instance, &image);
}

static bool is_covered(const uint8_t (*pixels)[4], int x, int y) {
    return x >= 0 && y >= 0 && x < PICTURE_WIDTH && y < PICTURE_HEIGHT && pixels[y * PICTURE_WIDTH + x][3] > 127;
}

/* Whether the outline passes within a pixel. */
static bool is_at_outline(const uint8_t (*pixels)[4], int x, int y) {
    int covered = 0;
    for (int i = 0; i < 9; i++) covered += is_covered(pixels, x + i % 3 - 1, y + i / 3 - 1);
    return covered > 0 && covered < 9;
}

static double decibels(double sum, int count) {
    return sum > 0 ? 10 * log10(255.0 * 255 * count / sum) : INFINITY;
}

static struct quality compare_colours(const struct scene *scene) {
    struct quality out = {0};
    double sum = 0, apart = 0;
    int count = 0;
    for (int i = 0; i < PIXELS; i++) {
        double squared = 0;
        int most = 0;
        out.covered += scene->expected[i][3] > 127;
        if (scene->drawn[i][3] != scene->expected[i][3]) continue; /* counted by themselves */
        for (int k = 0; k < 3; k++) {
            const int difference = abs(scene->drawn[i][k] - scene->expected[i][k]);
            squared += difference * difference;
            most = difference > most ? difference : most;
        }
        count++;
        out.apart += most > APART;
        *(most > APART ? &apart : &sum) += squared / 3;
    }
    out.psnr = decibels(sum, count - out.apart);
    out.of_all = decibels(sum + apart, count);
    return out;
}

static void compare(struct scene *scene, const char *what, const pbr_frame *frame, const pbr_item *item) {
    static const float nothing[4] = {0, 0, 0, 0};
    target_clear(&scene->target, nothing, frame->flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
    render(scene->host, frame, item, 1);
    target_read(&scene->target, scene->drawn);
    draw_reference(scene, frame, item);
    const uint8_t(*drawn)[4] = (const uint8_t(*)[4])scene->drawn, (*expected)[4] = (const uint8_t(*)[4])scene->expected;
    for (int y = 0; y < PICTURE_HEIGHT; y++)
        for (int x = 0; x < PICTURE_WIDTH; x++) {
            if (is_covered(drawn, x, y) == is_covered(expected, x, y) || is_at_outline(expected, x, y)) continue;
            picture_save("reference_drawn", drawn, PICTURE_WIDTH, PICTURE_HEIGHT);
            picture_save("reference_expected", expected, PICTURE_WIDTH, PICTURE_HEIGHT);
            fail_msg("%s, splat %u, shading %u: pixel (%d, %d) is covered only %s", what, (unsigned)item->splat,
                     (unsigned)item->shading, x, y, is_covered(drawn, x, y) ? "as drawn" : "in the reference");
        }
    const struct quality quality = compare_colours(scene);
    char text[200];
    snprintf(text, sizeof text, "%s, splat %u, blending %u, shading %u: %.1f dB, of all %.1f dB, %d of %d pixels apart", what,
             (unsigned)item->splat, (unsigned)item->blending, (unsigned)item->shading, quality.psnr, quality.of_all, quality.apart,
             quality.covered);
    assert_true(quality.covered > 100); /* there is something to compare */
    if (getenv("PBR_TEST_OUT")) print_message("%s\n", text);
    if (quality.psnr >= LEAST_PSNR && quality.of_all >= LEAST_OF_ALL && quality.apart <= MOST_APART * quality.covered) return;
    picture_save("reference_drawn", drawn, PICTURE_WIDTH, PICTURE_HEIGHT);
    picture_save("reference_expected", expected, PICTURE_WIDTH, PICTURE_HEIGHT);
    fail_msg("%s", text);
}

static void compare_under_all_cameras(struct host *host, pbr_item item) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    make_cameras(cameras);
    scene_open(&scene, host);
    item.points = scene.points;
    item.transform_count = 1;
    for (int i = 0; i < CAMERAS; i++) {
        item.transforms = cameras[i].model;
        compare(&scene, cameras[i].name, &cameras[i].frame, &item);
    }
    scene_close(&scene);
}

#define ITEM(...) ((pbr_item){.struct_size = sizeof(pbr_item), __VA_ARGS__})

static void squares(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_SQUARE));
}
static void circles(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_CIRCLE, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void ellipses(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_ELLIPSE));
}
static void ellipses_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_ELLIPSE, .shading = PBR_SHADE_NONE));
}
static void gaussians(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_GAUSSIAN));
}
static void gaussians_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_GAUSSIAN, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void deferred_gaussians(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_DEFERRED));
}
static void ewa_splats(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA));
}
static void ewa_splats_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void ewa_splats_through_a_wide_low_pass(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA, .low_pass = 9));
}
static void deferred_ewa_splats(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_DEFERRED));
}
static void ewa_max_splats(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA_MAX));
}
static void ewa_max_splats_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA_MAX, .low_pass = 0.3f, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void phong_fields_of_gaussians(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_PHONG_FIELD));
}
static void phong_fields_of_ewa_splats(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_PHONG_FIELD));
}
static void phong_fields_of_ewa_max_splats(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_EWA_MAX, .shading = PBR_SHADE_PHONG_FIELD));
}
static void phong_fields_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(
        *state, ITEM(.splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_PHONG_FIELD, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void filled_squares(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_SQUARE, .blending = PBR_BLEND_FILL));
}
static void filled_circles(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_CIRCLE, .blending = PBR_BLEND_FILL, .radius_scale = 0.7f));
}
static void filled_ellipses(void **state) {
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_ELLIPSE, .blending = PBR_BLEND_FILL));
}
static void filled_ellipses_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state,
                              ITEM(.splat = PBR_SPLAT_ELLIPSE, .blending = PBR_BLEND_FILL, .flags = PBR_ITEM_CULL_BACK_FACES));
}
static void filled_circles_as_quads(void **state) {
    host_use_quads(*state);
    compare_under_all_cameras(*state, ITEM(.splat = PBR_SPLAT_CIRCLE, .blending = PBR_BLEND_FILL));
}

/* A sky, all of which is at the far end of depth, where nothing can be moved back, looks as if it were anywhere else. */
static void filled_splats_at_the_end_of_depth(void **state) {
    static const float nothing[4] = {0, 0, 0, 0};
    struct scene scene;
    struct camera cameras[CAMERAS];
    make_cameras(cameras);
    scene_open(&scene, *state);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++) {
        pbr_frame frame = cameras[0].frame;
        const pbr_item item = ITEM(.points = scene.points, .splat = splat, .blending = PBR_BLEND_FILL, .radius_scale = 0.7f);
        frame.depth_function = GL_LEQUAL;
        for (int sky = 0; sky < 2; sky++) {
            frame.depth_range[0] = frame.depth_range[1] = sky ? 1 : 0.5f;
            target_clear(&scene.target, nothing, 1);
            render(scene.host, &frame, &item, 1);
            target_read(&scene.target, sky ? scene.drawn : scene.expected);
        }
        assert_memory_equal(scene.drawn, scene.expected, PIXELS * sizeof(*scene.drawn));
    }
    scene_close(&scene);
}

/* Many blocks, some of which face away as a whole and are not drawn at all. */
static void blocks_that_face_away_are_dropped_and_no_others(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    long dropped = 0;
    make_cameras(cameras);
    scene_open(&scene, *state);
    pbr_points_release(&scene.points);
    scene.points = make_ball(*state, 40000, true);
    pbr_item item =
        ITEM(.points = scene.points, .splat = PBR_SPLAT_ELLIPSE, .flags = PBR_ITEM_CULL_BACK_FACES, .transform_count = 1);
    for (int i = 0; i < CAMERAS; i++) {
        item.transforms = cameras[i].model;
        compare(&scene, cameras[i].name, &cameras[i].frame, &item);
        const uint64_t culled = render(scene.host, &cameras[i].frame, &item, 1).splats_culled;
        item.flags = 0;
        dropped += culled > render(scene.host, &cameras[i].frame, &item, 1).splats_culled;
        item.flags = PBR_ITEM_CULL_BACK_FACES;
    }
    assert_int_equal(dropped, CAMERAS);
    scene_close(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(squares),
        GL_TEST(circles),
        GL_TEST(ellipses),
        GL_TEST(ellipses_as_quads),
        GL_TEST(gaussians),
        GL_TEST(gaussians_as_quads),
        GL_TEST(deferred_gaussians),
        GL_TEST(ewa_splats),
        GL_TEST(ewa_splats_as_quads),
        GL_TEST(ewa_splats_through_a_wide_low_pass),
        GL_TEST(deferred_ewa_splats),
        GL_TEST(ewa_max_splats),
        GL_TEST(ewa_max_splats_as_quads),
        GL_TEST(phong_fields_of_gaussians),
        GL_TEST(phong_fields_of_ewa_splats),
        GL_TEST(phong_fields_of_ewa_max_splats),
        GL_TEST(phong_fields_as_quads),
        GL_TEST(filled_squares),
        GL_TEST(filled_circles),
        GL_TEST(filled_ellipses),
        GL_TEST(filled_ellipses_as_quads),
        GL_TEST(filled_circles_as_quads),
        GL_TEST(filled_splats_at_the_end_of_depth),
        GL_TEST(blocks_that_face_away_are_dropped_and_no_others),
    };
    return RUN_GL_TESTS("reference", tests);
}
