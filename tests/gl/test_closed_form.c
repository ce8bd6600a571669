/* Squares and circles cover the pixels, and leave the depth, that the projection of their centre and radius says.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = PICTURE_WIDTH, HEIGHT = PICTURE_HEIGHT, PIXELS = WIDTH * HEIGHT };

/* Pixels this near to an edge may be on either side of it: OpenGL snaps corners to a grid of subpixels (1/256 pixel is common) and
 * computes in float. */
static const double SLACK = 1.0 / 64;

struct scene {
    struct host *host;
    struct target target;
    uint8_t (*pixels)[4];
    float *depth;
};

static void scene_open(struct scene *scene, struct host *host, GLenum depth_format) {
    scene->host = host;
    scene->pixels = malloc(PIXELS * sizeof(*scene->pixels));
    scene->depth = malloc(PIXELS * sizeof(*scene->depth));
    assert_non_null(scene->pixels);
    assert_non_null(scene->depth);
    assert_true(target_create(&scene->target, WIDTH, HEIGHT, GL_RGBA8, depth_format, 0));
    target_bind(&scene->target);
}

static void scene_close(struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&scene->target);
    free(scene->pixels);
    free(scene->depth);
}

static pbr_stats draw(struct scene *scene, const pbr_frame *frame, const pbr_item *items, size_t count) {
    static const float nothing[4] = {0, 0, 0, 0};
    target_clear(&scene->target, nothing, frame->flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
    pbr_stats stats = render(scene->host, frame, items, count);
    target_read(&scene->target, scene->pixels);
    return stats;
}

static int count_covered(const struct scene *scene) {
    int covered = 0;
    for (int i = 0; i < PIXELS; i++) covered += scene->pixels[i][3] != 0;
    return covered;
}

static bool is_inside(const int32_t box[4], int x, int y) {
    return x >= box[0] && x < box[0] + box[2] && y >= box[1] && y < box[1] + box[3];
}

/* Draws one splat and compares every pixel of the target. */
static void check_splat(struct scene *scene, const char *what, const pbr_frame *frame, const pbr_item *base, const double *model,
                        const double position[3], double radius) {
    pbr_points *points = one_point(scene->host, position, (float)radius);
    pbr_item item = *base;
    item.points = points;
    item.transforms = model;
    item.transform_count = model ? 1 : 0;
    struct placed expected = place(frame, &item, model, position, (float)radius);
    draw(scene, frame, &item, 1);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            bool covered = scene->pixels[y * WIDTH + x][3] > 127;
            double distance = edge_distance(&expected, item.splat, x, y);
            bool may = expected.is_drawn && is_inside(frame->viewport, x, y) &&
                       (!(frame->flags & PBR_FRAME_SCISSOR) || is_inside(frame->scissor, x, y));
            if (may && fabs(distance) <= SLACK) continue;
            if (covered != (may && distance < 0)) {
                picture_save("closed_form", (const uint8_t(*)[4])scene->pixels, WIDTH, HEIGHT);
                fail_msg("%s, %s of %.9g px at (%.9g, %.9g), depth %.9g: pixel (%d, %d), %.6f px from the edge, is %s", what,
                         item.splat == PBR_SPLAT_SQUARE ? "square" : "circle", expected.size, expected.x, expected.y,
                         expected.depth, x, y, distance, covered ? "covered" : "not covered");
            }
        }
    pbr_renderer_evict(scene->host->renderer, points);
    pbr_points_release(&points);
}

/* ---- All cameras ---- */

static void check_cameras(struct host *host, uint32_t kind, uint64_t seed) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    double position[3];
    pbr_item item = plain_item(NULL, kind);
    scene_open(&scene, host, GL_DEPTH_COMPONENT32F);
    make_cameras(cameras);
    for (int i = 0; i < CAMERAS; i++)
        for (int n = 0; n < 16; n++) {
            random_position(&cameras[i], &seed, position);
            double radius = radius_for(&cameras[i], position, random_log(&seed, 0.7, 70));
            check_splat(&scene, cameras[i].name, &cameras[i].frame, &item, cameras[i].model, position, radius);
        }
    scene_close(&scene);
}

static void squares_cover_the_pixels_of_their_projection(void **state) {
    check_cameras(*state, PBR_SPLAT_SQUARE, 1);
}
static void circles_cover_the_pixels_of_their_projection(void **state) {
    check_cameras(*state, PBR_SPLAT_CIRCLE, 2);
}

static void squares_as_quads_cover_the_same_pixels(void **state) {
    host_use_quads(*state);
    check_cameras(*state, PBR_SPLAT_SQUARE, 1);
}

static void circles_as_quads_cover_the_same_pixels(void **state) {
    host_use_quads(*state);
    check_cameras(*state, PBR_SPLAT_CIRCLE, 2);
}

/* ---- Both primitives ---- */

enum { MANY = 200 };

struct many {
    double positions[MANY][3];
    float radii[MANY];
    uint8_t colours[MANY][3];
};

static pbr_points *make_many(struct host *host, const struct camera *camera, struct many *many) {
    pbr_points *points = NULL;
    uint64_t seed = 7;
    for (int i = 0; i < MANY; i++) {
        random_position(camera, &seed, many->positions[i]);
        many->radii[i] = (float)radius_for(camera, many->positions[i], random_log(&seed, 0.7, 40));
        for (int k = 0; k < 3; k++) many->colours[i][k] = (uint8_t)random_between(&seed, 20, 255);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = MANY;
    desc.positions = (pbr_attribute){many->positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){many->radii, 0, PBR_FORMAT_FLOAT32, 1};
    desc.colours = (pbr_attribute){many->colours, 0, PBR_FORMAT_UINT8, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    return points;
}

/* Whether some splat's edge passes through this pixel's centre. */
static bool is_on_an_edge(const struct camera *camera, const pbr_item *item, const struct many *many, int x, int y) {
    for (int i = 0; i < MANY; i++) {
        struct placed splat = place(&camera->frame, item, NULL, many->positions[i], many->radii[i]);
        if (fabs(edge_distance(&splat, item->splat, x, y)) <= SLACK) return true;
    }
    return false;
}

static void check_paths_agree(struct host *host, uint32_t kind, float limit) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    struct many many;
    pbr_renderer_desc desc = host_renderer_desc();
    uint8_t(*as_points)[4] = malloc(PIXELS * sizeof(*as_points));
    assert_non_null(as_points);
    make_cameras(cameras);
    scene_open(&scene, host, GL_DEPTH_COMPONENT24);
    pbr_points *points = make_many(host, &cameras[0], &many);
    pbr_item item = plain_item(points, kind);
    item.colour_source = PBR_COLOUR_POINTS;
    draw(&scene, &cameras[0].frame, &item, 1);
    memcpy(as_points, scene.pixels, PIXELS * sizeof(*as_points));
    picture_save("paths_points", (const uint8_t(*)[4])as_points, WIDTH, HEIGHT);

    desc.point_size_limit = limit;
    host_use_renderer(host, &desc);
    pbr_stats stats = draw(&scene, &cameras[0].frame, &item, 1);
    assert_true(stats.splats_as_quads > 0);
    picture_save("paths_quads", (const uint8_t(*)[4])scene.pixels, WIDTH, HEIGHT);
    for (int i = 0; i < PIXELS; i++)
        if (memcmp(as_points[i], scene.pixels[i], 4) && !is_on_an_edge(&cameras[0], &item, &many, i % WIDTH, i / WIDTH))
            fail_msg("pixel (%d, %d) differs", i % WIDTH, i / WIDTH);
    pbr_points_release(&points);
    scene_close(&scene);
    free(as_points);
}

static void points_and_quads_draw_the_same_squares(void **state) {
    check_paths_agree(*state, PBR_SPLAT_SQUARE, 0.5f);
}
static void points_and_quads_draw_the_same_circles(void **state) {
    check_paths_agree(*state, PBR_SPLAT_CIRCLE, 0.5f);
}
static void a_mixture_of_points_and_quads_draws_the_same_circles(void **state) {
    check_paths_agree(*state, PBR_SPLAT_CIRCLE, 12);
}

static void sizes_around_the_point_limit_are_exact(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    pbr_renderer_desc desc = host_renderer_desc();
    desc.point_size_limit = 16;
    host_use_renderer(*state, &desc);
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_SQUARE; kind++) {
        pbr_item item = plain_item(NULL, kind);
        for (int step = -8; step <= 8; step++) {
            const double ndc[3] = {0.013 * step, 0.1, 0.5};
            double position[3];
            unproject(&cameras[0], ndc, position);
            check_splat(&scene, "around the limit", &cameras[0].frame, &item, NULL, position,
                        radius_for(&cameras[0], position, 16 + step / 4.0));
        }
    }
    scene_close(&scene);
}

/* ---- Sizes ---- */

static void sizes_stay_between_minimum_and_maximum(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    uint64_t seed = 3;
    double position[3];
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_SQUARE; kind++)
        for (int n = 0; n < 12; n++) {
            pbr_item item = plain_item(NULL, kind);
            item.size_minimum = 3.3f;
            item.size_maximum = 9.7f;
            item.radius_scale = 1.7f;
            random_position(&cameras[0], &seed, position);
            check_splat(&scene, "limited", &cameras[0].frame, &item, NULL, position,
                        radius_for(&cameras[0], position, n % 2 ? 0.1 : 50));
        }
    scene_close(&scene);
}

/* Just the one that its centre is in. */
static void a_radius_of_zero_still_covers_a_pixel(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    uint64_t seed = 4;
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    for (int n = 0; n < 24; n++) {
        pbr_item item = plain_item(NULL, n % 2 ? PBR_SPLAT_SQUARE : PBR_SPLAT_CIRCLE);
        const double ndc[3] = {random_between(&seed, -0.9, 0.9), random_between(&seed, -0.9, 0.9), 0.5};
        double position[3];
        unproject(&cameras[0], ndc, position);
        check_splat(&scene, "no radius", &cameras[0].frame, &item, NULL, position, 0);
        assert_int_equal(count_covered(&scene), 1);
    }
    scene_close(&scene);
}

static void splats_over_the_point_range_of_opengl_are_whole(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    GLfloat range[2] = {0, 0};
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    assert_int_equal(pbr_renderer_get_info(scene.host->renderer, &info), PBR_OK);
    glGetFloatv(context_is_es() ? GL_ALIASED_POINT_SIZE_RANGE : GL_POINT_SIZE_RANGE, range);
    assert_true(info.point_size_limit <= range[1]);
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_SQUARE; kind++) {
        pbr_item item = plain_item(NULL, kind);
        double size = 2.5 * (double)range[1], position[3];
        /* The centre lies so far to the left that the right edge crosses the picture. */
        const double ndc[3] = {(2 * (40.3 - size / 2) / WIDTH) - 1, 0.11, 0.5};
        unproject(&cameras[0], ndc, position);
        check_splat(&scene, "over the range", &cameras[0].frame, &item, NULL, position, radius_for(&cameras[0], position, size));
    }
    scene_close(&scene);
}

/* ---- The view volume ---- */

static void a_centre_outside_the_view_draws_the_part_inside(void **state) {
    static const double corners[8][2] = {{-1.2, 0.1},  {1.2, -0.2}, {0.3, 1.25}, {-0.1, -1.25},
                                         {-1.15, 1.1}, {1.1, 1.2},  {1.2, -1.1}, {-1.1, -1.2}};
    struct scene scene;
    struct camera cameras[CAMERAS];
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int i = 0; i < 16; i++) {
            pbr_item item = plain_item(NULL, i < 8 ? PBR_SPLAT_CIRCLE : PBR_SPLAT_SQUARE);
            const double ndc[3] = {corners[i % 8][0], corners[i % 8][1], 0.3};
            double position[3];
            unproject(&cameras[8], ndc, position);
            check_splat(&scene, "centre outside", &cameras[8].frame, &item, NULL, position, radius_for(&cameras[8], position, 30));
            assert_true(count_covered(&scene) > 20);
        }
    }
    scene_close(&scene);
}

/* Splats have one depth, so the near and far planes take or leave them whole, however large. */
static void near_and_far_planes_clip_by_the_centre(void **state) {
    static const struct {
        double depth;
        bool is_drawn;
    } cases[] = {{-0.001, false}, {0.001, true}, {0.999, true}, {1.001, false}};
    struct scene scene;
    struct camera cameras[CAMERAS];
    make_cameras(cameras);
    scene_open(&scene, *state, GL_DEPTH_COMPONENT32F);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int camera = 0; camera < CAMERAS; camera++)
            for (size_t i = 0; i < 4; i++) {
                bool zero_to_one = cameras[camera].frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE;
                if (camera == 10 && i >= 3) continue; /* nothing is beyond infinity */
                pbr_item item = plain_item(NULL, PBR_SPLAT_CIRCLE);
                const double ndc[3] = {0.1, 0.2, zero_to_one ? cases[i].depth : 2 * cases[i].depth - 1};
                double position[3];
                unproject(&cameras[camera], ndc, position);
                check_splat(&scene, cameras[camera].name, &cameras[camera].frame, &item, cameras[camera].model, position,
                            radius_for(&cameras[camera], position, 40));
                assert_int_equal(count_covered(&scene) > 0, cases[i].is_drawn);
            }
    }
    scene_close(&scene);
}

static void splats_behind_the_eye_are_not_drawn(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    pbr_item item = plain_item(NULL, PBR_SPLAT_CIRCLE);
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        static const double positions[4][3] = {{0, 0, 3}, {0, 0, 0}, {0.1, 0.1, 0.5}, {0, 0, -0.5}};
        for (int i = 0; i < 4; i++) check_splat(&scene, "behind", &cameras[0].frame, &item, NULL, positions[i], 10);
    }
    scene_close(&scene);
}

static void the_scissor_box_of_the_frame_cuts(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    pbr_item item = plain_item(NULL, PBR_SPLAT_SQUARE);
    const double ndc[3] = {0.1, 0, 0.5};
    const int32_t box[4] = {20, 5, 30, 44};
    double position[3];
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    pbr_frame frame = cameras[8].frame;
    frame.flags |= PBR_FRAME_SCISSOR;
    memcpy(frame.scissor, box, sizeof(box));
    unproject(&cameras[8], ndc, position);
    check_splat(&scene, "scissor", &frame, &item, NULL, position, radius_for(&cameras[8], position, 90));
    scene_close(&scene);
}

static void a_viewport_of_zeros_is_the_bound_one(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    pbr_points *points = one_point(*state, (const double[3]){0.2, 0.1, -4}, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    uint8_t(*expected)[4] = malloc(PIXELS * sizeof(*expected));
    assert_non_null(expected);
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    pbr_frame frame = cameras[8].frame;
    draw(&scene, &frame, &item, 1);
    memcpy(expected, scene.pixels, PIXELS * sizeof(*expected));
    glViewport(frame.viewport[0], frame.viewport[1], frame.viewport[2], frame.viewport[3]);
    frame_set_viewport(&frame, 0, 0, 0, 0);
    draw(&scene, &frame, &item, 1);
    assert_memory_equal(expected, scene.pixels, PIXELS * sizeof(*expected));
    pbr_points_release(&points);
    scene_close(&scene);
    free(expected);
}

static void clip_planes_keep_or_drop_whole_splats(void **state) {
    static const double planes[2][4] = {{1, 0, 0, -0.25}, {0, -2, 0, 1}}; /* x >= 0.25 and y <= 0.5, world space */
    struct scene scene;
    struct camera cameras[CAMERAS];
    double model[16];
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    matrix_translation(0.2, 0, 0, model);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int i = 0; i < 16; i++) {
            double x = -0.3 + 0.2 * (i % 4), y = -0.05 + 0.3 * (i / 4);
            pbr_points *points = one_point(*state, (const double[3]){x, y, -5}, 0.7f);
            pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
            item.transforms = model;
            item.transform_count = 1;
            item.clip_planes = planes[0];
            item.clip_plane_count = 2;
            draw(&scene, &cameras[0].frame, &item, 1);
            int covered = count_covered(&scene);
            assert_int_equal(covered > 0, x + 0.2 >= 0.25 && y <= 0.5);
            if (covered) {
                item.clip_planes = NULL;
                item.clip_plane_count = 0;
                draw(&scene, &cameras[0].frame, &item, 1);
                assert_int_equal(count_covered(&scene), covered);
            }
            pbr_renderer_evict(scene.host->renderer, points);
            pbr_points_release(&points);
        }
    }
    scene_close(&scene);
}

static void transforms_draw_a_copy_each(void **state) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    double models[3][16];
    const double position[3] = {0.1, 0.2, -6};
    make_cameras(cameras);
    scene_open(&scene, *state, 0);
    pbr_points *points = one_point(*state, position, 0.4f);
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    matrix_translation(-1.5, 0, 0, models[0]);
    matrix_scaling(1.5, 1.5, 1, models[1]);
    matrix_translation(1.4, -0.8, 1, models[2]);
    item.transforms = models[0];
    item.transform_count = 3;
    pbr_stats stats = draw(&scene, &cameras[0].frame, &item, 1);
    assert_int_equal(stats.points, 3);
    for (int i = 0; i < PIXELS; i++) {
        double nearest = INFINITY;
        for (int k = 0; k < 3; k++) {
            struct placed splat = place(&cameras[0].frame, &item, models[k], position, 0.4f);
            nearest = fmin(nearest, edge_distance(&splat, item.splat, i % WIDTH, i / WIDTH));
        }
        if (fabs(nearest) > SLACK) assert_int_equal(scene.pixels[i][3] != 0, nearest < 0);
    }
    pbr_points_release(&points);
    scene_close(&scene);
}

/* ---- Depth ---- */

/* A depth of d in float clip coordinates has an error of a few units in the last place of the clip z and w that it is divided from;
 * a 24-bit buffer rounds to 6e-8 besides. */
static const double DEPTH_ERROR = 1.5e-6;

static void check_depth(struct host *host, GLenum format) {
    struct scene scene;
    struct camera cameras[CAMERAS];
    static const float ranges[3][2] = {{0, 0}, {0.25f, 0.5f}, {0.9f, 0.2f}};
    scene_open(&scene, host, format);
    make_cameras(cameras);
    for (int camera = 0; camera < CAMERAS; camera++)
        for (int range = 0; range < 3; range++)
            for (int n = 0; n < 3; n++) {
                pbr_frame frame = cameras[camera].frame;
                pbr_item item = plain_item(NULL, PBR_SPLAT_SQUARE);
                double depth = 0.1 + 0.4 * n, position[3];
                const double ndc[3] = {0.3, -0.2, frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE ? depth : 2 * depth - 1};
                memcpy(frame.depth_range, ranges[range], sizeof(frame.depth_range));
                unproject(&cameras[camera], ndc, position);
                check_splat(&scene, cameras[camera].name, &frame, &item, cameras[camera].model, position,
                            radius_for(&cameras[camera], position, 11));
                target_read_depth(&scene.target, scene.depth);
                struct placed splat = place(&frame, &item, cameras[camera].model, position, 1);
                double read = (double)scene.depth[(int)splat.y * WIDTH + (int)splat.x];
                if (!(fabs(read - splat.depth) <= DEPTH_ERROR))
                    fail_msg("%s, range %d: depth %.9g, not %.9g", cameras[camera].name, range, read, splat.depth);
            }
    scene_close(&scene);
}

static void float_depth_is_the_centres(void **state) {
    check_depth(*state, GL_DEPTH_COMPONENT32F);
}
static void integer_depth_is_the_centres(void **state) {
    check_depth(*state, GL_DEPTH_COMPONENT24);
}

static void depth_of_quads_is_the_centres(void **state) {
    host_use_quads(*state);
    check_depth(*state, GL_DEPTH_COMPONENT32F);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(squares_cover_the_pixels_of_their_projection),
        GL_TEST(circles_cover_the_pixels_of_their_projection),
        GL_TEST(squares_as_quads_cover_the_same_pixels),
        GL_TEST(circles_as_quads_cover_the_same_pixels),
        GL_TEST(points_and_quads_draw_the_same_squares),
        GL_TEST(points_and_quads_draw_the_same_circles),
        GL_TEST(a_mixture_of_points_and_quads_draws_the_same_circles),
        GL_TEST(sizes_around_the_point_limit_are_exact),
        GL_TEST(sizes_stay_between_minimum_and_maximum),
        GL_TEST(a_radius_of_zero_still_covers_a_pixel),
        GL_TEST(splats_over_the_point_range_of_opengl_are_whole),
        GL_TEST(a_centre_outside_the_view_draws_the_part_inside),
        GL_TEST(near_and_far_planes_clip_by_the_centre),
        GL_TEST(splats_behind_the_eye_are_not_drawn),
        GL_TEST(the_scissor_box_of_the_frame_cuts),
        GL_TEST(a_viewport_of_zeros_is_the_bound_one),
        GL_TEST(clip_planes_keep_or_drop_whole_splats),
        GL_TEST(transforms_draw_a_copy_each),
        GL_TEST(float_depth_is_the_centres),
        GL_TEST(integer_depth_is_the_centres),
        GL_TEST(depth_of_quads_is_the_centres),
    };
    return RUN_GL_TESTS("closed form", tests);
}
