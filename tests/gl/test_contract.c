/* Corners of the contract with the host that once were wrong. SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 64, PIXELS = SIZE * SIZE };

struct scene {
    struct host *host;
    struct target target;
    uint8_t (*pixels)[4];
    pbr_frame frame; /* perspective from the origin along -z */
};

static struct scene scene_open(void **state) {
    struct scene scene = {.host = *state, .pixels = calloc(PIXELS, sizeof *scene.pixels), .frame = PBR_FRAME_INIT};
    assert_non_null(scene.pixels);
    assert_true(target_create(&scene.target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&scene.target);
    matrix_perspective(1, 1, 0.5, 100, scene.frame.projection);
    scene.frame.viewport[2] = scene.frame.viewport[3] = SIZE;
    return scene;
}

static void scene_close(struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&scene->target);
    free(scene->pixels);
}

static void clear(const struct scene *scene) {
    static const float nothing[4] = {0, 0, 0, 0};
    target_clear(&scene->target, nothing, 1);
}

static int count_drawn(struct scene *scene) {
    int drawn = 0;
    target_read(&scene->target, scene->pixels);
    for (int i = 0; i < PIXELS; i++) drawn += scene->pixels[i][3] != 0;
    return drawn;
}

static pbr_points *make_points(struct host *host, const float (*positions)[3], uint64_t count, float radius,
                               const float normal[3]) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    float(*normals)[3] = normal ? calloc(count, sizeof *normals) : NULL;
    for (uint64_t i = 0; normals && i < count; i++) memcpy(normals[i], normal, sizeof *normals);
    pbr_points *points = NULL;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = radius;
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    free(normals);
    return points;
}

static void a_name_that_is_no_framebuffer_is_refused_and_nothing_is_drawn(void **state) {
    struct scene scene = scene_open(state);
    pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -2}, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    clear(&scene);
    scene.frame.target = PBR_TARGET_FRAMEBUFFER;
    scene.frame.framebuffer = 4711;
    assert_int_equal(pbr_render(scene.host->view, &scene.frame, &item, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(scene.host->log, "4711"));
    expect_no_gl_error("a bad framebuffer name");
    assert_false(glIsFramebuffer(4711));
    assert_int_equal(count_drawn(&scene), 0);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Depth may be reversed by the projection or by the depth range: the eye is on the same side. */
static void a_reversed_depth_range_does_not_turn_the_eye_around(void **state) {
    struct scene scene = scene_open(state);
    static const float at[1][3] = {{0, 0, -2}}, towards_the_eye[3] = {0, 0, 1};
    pbr_points *points = make_points(scene.host, at, 1, 0.5f, towards_the_eye);
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    item.flags = PBR_ITEM_CULL_BACK_FACES;
    matrix_ortho(-1, 1, -1, 1, 1, 10, scene.frame.projection);
    scene.frame.flags = PBR_FRAME_REVERSED_Z;
    scene.frame.depth_range[0] = 1;
    scene.frame.depth_function = GL_ALWAYS;
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_true(count_drawn(&scene) > 100);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* The camera's rotation may be in the view or in the projection: the splat is as large. */
static void a_rotation_within_the_projection_changes_no_size(void **state) {
    struct scene scene = scene_open(state);
    double turn[16], perspective[16];
    matrix_rotation((const double[3]){0.5, 0.8, 0.1}, 0.7, turn);
    memcpy(perspective, scene.frame.projection, sizeof perspective);
    double inverse[16], position[4];
    assert_true(matrix_invert(turn, inverse));
    matrix_apply(inverse, (const double[4]){0, 0, -2, 1}, position);
    pbr_points *points = one_point(scene.host, position, 0.4f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    memcpy(scene.frame.view, turn, sizeof turn);
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    const int in_view = count_drawn(&scene);
    memset(scene.frame.view, 0, sizeof scene.frame.view);
    for (int c = 0; c < 4; c++) matrix_apply(perspective, turn + 4 * c, scene.frame.projection + 4 * c);
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_true(in_view > 100);
    assert_int_equal(count_drawn(&scene), in_view);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Matrices that come out of a general inverse are affine but for rounding. */
static void matrices_that_are_affine_but_for_rounding_are_taken(void **state) {
    struct scene scene = scene_open(state);
    pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -2}, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    double model[16];
    matrix_identity(scene.frame.view);
    matrix_identity(model);
    scene.frame.view[15] = nextafter(1, 2);
    model[3] = 1e-17;
    item.transforms = model;
    item.transform_count = 1;
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_true(count_drawn(&scene) > 100);
    model[3] = 0.01;
    assert_int_equal(pbr_render(scene.host->view, &scene.frame, &item, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* A budget for two sets; the second frame's first item is new, its second one is there already. */
static void making_room_spares_what_the_frame_draws_later(void **state) {
    struct scene scene = scene_open(state);
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = 2 * 24;
    host_use_renderer(scene.host, &desc);
    pbr_points *sets[3];
    pbr_item items[3];
    for (int i = 0; i < 3; i++) {
        sets[i] = one_point(scene.host, (const double[3]){0, 0, -2 - i}, 0.1f);
        items[i] = plain_item(sets[i], PBR_SPLAT_SQUARE);
    }
    clear(&scene);
    assert_int_equal(render(scene.host, &scene.frame, (const pbr_item[]){items[0], items[1]}, 2).upload_bytes, 48);
    assert_int_equal(render(scene.host, &scene.frame, (const pbr_item[]){items[2], items[0]}, 2).upload_bytes, 24);
    /* Hidden items are dropped last: set 0 stays while set 2, drawn as long ago, goes. */
    items[0].flags = PBR_ITEM_HIDDEN;
    render(scene.host, &scene.frame, (const pbr_item[]){items[0]}, 1);
    render(scene.host, &scene.frame, (const pbr_item[]){items[0]}, 1);
    assert_int_equal(render(scene.host, &scene.frame, (const pbr_item[]){items[1], items[0]}, 2).upload_bytes, 24);
    items[0].flags = 0;
    assert_int_equal(render(scene.host, &scene.frame, &items[0], 1).upload_bytes, 0);
    host_drop_renderer(scene.host);
    for (int i = 0; i < 3; i++) pbr_points_release(&sets[i]);
    scene_close(&scene);
}

static void an_error_of_the_hosts_is_logged_even_without_stats(void **state) {
    struct scene scene = scene_open(state);
    pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -2}, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    scene.host->log[0] = '\0';
    glEnable(0xdead);
    assert_int_equal(pbr_render(scene.host->view, &scene.frame, &item, 1, NULL), PBR_OK);
    assert_non_null(strstr(scene.host->log, "0500"));
    context_forget_errors();
    pbr_points_release(&points);
    scene_close(&scene);
}

static void a_bound_viewport_without_area_draws_nothing(void **state) {
    struct scene scene = scene_open(state);
    pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -2}, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    scene.frame.viewport[2] = scene.frame.viewport[3] = 0;
    glViewport(0, 0, 0, 0);
    render(scene.host, &scene.frame, &item, 1);
    glViewport(0, 0, SIZE, SIZE);
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_true(count_drawn(&scene) > 100);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Lit by ambient light alone: what is decoded, multiplied by 1 and encoded again must be the colour that was given, to the bit. */
static void every_8_bit_colour_survives_decoding_and_encoding(void **state) {
    struct scene scene = scene_open(state);
    float positions[256][3], normals[256][3];
    uint8_t colours[256][3];
    for (int i = 0; i < 256; i++) {
        const float position[3] = {(float)(i % 16 * 4) + 2.5f, (float)(i / 16 * 4) + 2.5f, 0}, normal[3] = {0, 0, 1};
        memcpy(positions[i], position, sizeof position);
        memcpy(normals[i], normal, sizeof normal);
        for (int k = 0; k < 3; k++) colours[i][k] = (uint8_t)(k == 0 ? i : k == 1 ? 255 - i : 7 * i);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = 256;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.radius = 0.5f;
    assert_int_equal(pbr_points_create(scene.host->instance, &desc, &points), PBR_OK);
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    item.splat = PBR_SPLAT_SQUARE;
    item.material = (pbr_material){1, 0, 0, 1};
    matrix_ortho(0, SIZE, 0, SIZE, -1, 1, scene.frame.projection);
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_int_equal(count_drawn(&scene), 256);
    for (int i = 0; i < 256; i++)
        for (int k = 0; k < 3; k++) assert_int_equal(scene.pixels[(i / 16 * 4 + 2) * SIZE + i % 16 * 4 + 2][k], colours[i][k]);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Blended kinds are moved back to find their front layer: past the far plane, too. */
static void blended_splats_near_the_far_plane_are_drawn(void **state) {
    for (uint32_t kind = PBR_SPLAT_ELLIPSE; kind <= PBR_SPLAT_EWA_MAX; kind++)
        for (int reversed = 0; reversed < 2; reversed++) {
            struct scene scene = scene_open(state);
            pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -9.95}, 0.6f);
            pbr_item item = plain_item(points, kind);
            matrix_ortho(-1, 1, -1, 1, 1, 10, scene.frame.projection);
            if (reversed) {
                matrix_zero_to_one(scene.frame.projection, true);
                scene.frame.flags |= PBR_FRAME_REVERSED_Z | PBR_FRAME_CLIP_ZERO_TO_ONE;
                target_clear(&scene.target, (const float[4]){0, 0, 0, 0}, 0);
            } else {
                clear(&scene);
            }
            render(scene.host, &scene.frame, &item, 1);
            assert_true(count_drawn(&scene) > 500);
            pbr_points_release(&points);
            scene_close(&scene);
        }
}

static void an_empty_scissor_box_draws_nothing(void **state) {
    static const int32_t boxes[3][4] = {{5, 5, 0, 0}, {2 * SIZE, 0, 20, SIZE}, {0, 2 * SIZE, SIZE, 20}};
    struct scene scene = scene_open(state);
    pbr_points *points = one_point(scene.host, (const double[3]){0, 0, -2}, 0.5f);
    scene.frame.flags |= PBR_FRAME_SCISSOR;
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_EWA_MAX; kind++)
        for (int i = 0; i < 3; i++) {
            pbr_item item = plain_item(points, kind);
            item.shading = PBR_SHADE_DEFERRED;
            memcpy(scene.frame.scissor, boxes[i], sizeof boxes[i]);
            clear(&scene);
            render(scene.host, &scene.frame, &item, 1);
            assert_int_equal(count_drawn(&scene), 0);
        }
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Sums stall in half floats when each splat adds less than half a step. */
static void a_thousand_splats_a_pixel_keep_their_colour(void **state) {
    enum { COUNT = 60000 };
    if (context_is_es()) skip(); /* may have half floats alone */
    struct scene scene = scene_open(state);
    float(*positions)[3] = malloc(COUNT * sizeof *positions);
    uint64_t seed = 5;
    assert_non_null(positions);
    for (int i = 0; i < COUNT; i++) {
        for (int k = 0; k < 2; k++) positions[i][k] = (float)random_between(&seed, -0.1, 0.1);
        positions[i][2] = -2;
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = COUNT;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.02f;
    assert_int_equal(pbr_points_create(scene.host->instance, &desc, &points), PBR_OK);
    pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    const float colour[4] = {0.6f, 0.3f, 0.05f, 1};
    memcpy(item.colour, colour, sizeof colour);
    scene.frame.encoding = PBR_ENCODING_LINEAR;
    matrix_ortho(-1, 1, -1, 1, 1, 10, scene.frame.projection);
    clear(&scene);
    render(scene.host, &scene.frame, &item, 1);
    assert_true(count_drawn(&scene) > 16);
    for (int k = 0; k < 3; k++)
        assert_in_range(scene.pixels[SIZE / 2 * SIZE + SIZE / 2][k], lround(255.0 * (double)colour[k]) - 1,
                        lround(255.0 * (double)colour[k]) + 1);
    free(positions);
    pbr_points_release(&points);
    scene_close(&scene);
}

/* The normals' target is draw buffer 1, which the host may have masked. */
static void a_masked_second_draw_buffer_does_not_matter(void **state) {
    static const GLboolean all[2] = {GL_FALSE, GL_TRUE};
    uint8_t first[3];
    struct scene scene = scene_open(state);
    pbr_points *points[2] = {NULL, NULL};
    for (int i = 0; i < 2; i++) {
        const double position[3] = {0, 0, -2}, normal[3] = {i, 0, 1};
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        desc.count = 1;
        desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT64, 3};
        desc.normals = (pbr_attribute){normal, 0, PBR_FORMAT_FLOAT64, 3};
        desc.radius = 0.5f;
        assert_int_equal(pbr_points_create(scene.host->instance, &desc, &points[i]), PBR_OK);
    }
    for (int masked = 0; masked < 2; masked++) {
        if (masked && !context_has(30, 32)) break;
        if (masked) glColorMaski(1, all[0], all[0], all[0], all[0]);
        for (int i = 0; i < 3; i++) { /* flat, tilted, flat */
            pbr_item item = PBR_ITEM_INIT;
            item.points = points[i % 2];
            item.splat = PBR_SPLAT_GAUSSIAN;
            item.shading = PBR_SHADE_DEFERRED;
            clear(&scene);
            render(scene.host, &scene.frame, &item, 1);
            assert_true(count_drawn(&scene) > 50);
        }
        const uint8_t *middle = scene.pixels[SIZE / 2 * SIZE + SIZE / 2];
        if (!masked) memcpy(first, middle, sizeof first);
        else assert_memory_equal(first, middle, sizeof first);
        if (masked) glColorMaski(1, all[1], all[1], all[1], all[1]);
    }
    for (int i = 0; i < 2; i++) pbr_points_release(&points[i]);
    scene_close(&scene);
}

/* Mesa's software driver clips slowly, and shades in one corner what is sent there: splats that are not drawn are to cost neither.
 */
static void splats_that_are_not_drawn_are_neither_clipped_nor_shaded(void **state) {
    enum { COUNT = 600, INPUT = 0, OUTPUT = 1, SHADED = 2, QUERIES = 3 };
    static const GLenum targets[QUERIES] = {GL_CLIPPING_INPUT_PRIMITIVES_ARB, GL_CLIPPING_OUTPUT_PRIMITIVES_ARB,
                                            GL_FRAGMENT_SHADER_INVOCATIONS_ARB};
    static const uint32_t kinds[] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE};
    static float positions[COUNT][3], normals[COUNT][3];
    if (context_is_es() || !context_has_extension("GL_ARB_pipeline_statistics_query")) return;
    if (!strstr((const char *)glGetString(GL_RENDERER), "llvmpipe")) return; /* other drivers may count otherwise */
    struct scene scene = scene_open(state);
    uint64_t seed = 5;
    GLuint queries[QUERIES], counted[2][QUERIES];
    glGenQueries(QUERIES, queries);
    for (int i = 0; i < COUNT; i++) { /* the second half faces away */
        for (int k = 0; k < 2; k++) positions[i][k] = (float)random_between(&seed, -0.4, 0.4);
        positions[i][2] = -2;
        normals[i][2] = i < COUNT / 2 ? 1 : -1;
    }
    for (int k = 0; k < 2; k++) {
        for (int all = 0; all < 2; all++) {
            pbr_points_desc desc = PBR_POINTS_DESC_INIT;
            pbr_points *points = NULL;
            desc.count = all ? COUNT : COUNT / 2;
            desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
            desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
            desc.radius = 0.05f;
            assert_int_equal(pbr_points_create(scene.host->instance, &desc, &points), PBR_OK);
            pbr_item item = plain_item(points, kinds[k]);
            item.flags = PBR_ITEM_CULL_BACK_FACES;
            clear(&scene);
            for (int i = 0; i < QUERIES; i++) glBeginQuery(targets[i], queries[i]);
            const pbr_stats stats = render(scene.host, &scene.frame, &item, 1);
            for (int i = 0; i < QUERIES; i++) glEndQuery(targets[i]);
            for (int i = 0; i < QUERIES; i++) glGetQueryObjectuiv(queries[i], GL_QUERY_RESULT, &counted[all][i]);
            assert_int_equal(stats.splats_drawn, desc.count); /* points alone: none is near the border */
            assert_int_equal(counted[all][INPUT], desc.count);
            assert_int_equal(counted[all][OUTPUT], desc.count);
            pbr_points_release(&points);
        }
        assert_true(counted[0][SHADED] > COUNT);
        assert_int_equal(counted[1][SHADED], counted[0][SHADED]);
    }
    glDeleteQueries(QUERIES, queries);
    scene_close(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(a_name_that_is_no_framebuffer_is_refused_and_nothing_is_drawn),
        GL_TEST(a_reversed_depth_range_does_not_turn_the_eye_around),
        GL_TEST(a_rotation_within_the_projection_changes_no_size),
        GL_TEST(matrices_that_are_affine_but_for_rounding_are_taken),
        GL_TEST(making_room_spares_what_the_frame_draws_later),
        GL_TEST(an_error_of_the_hosts_is_logged_even_without_stats),
        GL_TEST(a_bound_viewport_without_area_draws_nothing),
        GL_TEST(every_8_bit_colour_survives_decoding_and_encoding),
        GL_TEST(blended_splats_near_the_far_plane_are_drawn),
        GL_TEST(an_empty_scissor_box_draws_nothing),
        GL_TEST(a_thousand_splats_a_pixel_keep_their_colour),
        GL_TEST(a_masked_second_draw_buffer_does_not_matter),
        GL_TEST(splats_that_are_not_drawn_are_neither_clipped_nor_shaded),
    };
    return RUN_GL_TESTS("contract", tests);
}
