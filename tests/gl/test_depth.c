/* Splats and the host's geometry hide each other through the host's depth buffer. SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 32, PIXELS = SIZE * SIZE, MIDDLE = SIZE / 2 * SIZE + SIZE / 2 };

static const float RED[4] = {1, 0, 0, 1}, NOTHING[4] = {0, 0, 0, 0};
static const uint8_t RED_BYTES[4] = {255, 0, 0, 255}, WHITE_BYTES[4] = {255, 255, 255, 255};

/* Conventions of window depth that a host may keep to. */
struct convention {
    const char *name;
    bool zero_to_one, reversed;
    float range[2]; /* as glDepthRange; 0, 0 = 0, 1 */
    GLenum depth_format;
    int samples;
};

static const struct convention conventions[] = {
    {"usual", false, false, {0, 0}, GL_DEPTH_COMPONENT24, 0},
    {"float buffer", false, false, {0, 0}, GL_DEPTH_COMPONENT32F, 0},
    {"clip 0..1", true, false, {0, 0}, GL_DEPTH_COMPONENT24, 0},
    {"reversed", true, true, {0, 0}, GL_DEPTH_COMPONENT32F, 0},
    {"depth range", false, false, {0.3f, 0.6f}, GL_DEPTH_COMPONENT24, 0},
    {"reversed by depth range", false, true, {1, 0}, GL_DEPTH_COMPONENT24, 0},
    {"multisampled", false, false, {0, 0}, GL_DEPTH_COMPONENT24, 4},
};
enum { CONVENTIONS = sizeof(conventions) / sizeof(conventions[0]) };

static pbr_frame make_frame(const struct convention *convention) {
    static const int32_t viewport[4] = {0, 0, SIZE, SIZE};
    pbr_frame frame = PBR_FRAME_INIT;
    matrix_perspective(1, 1, 1, 50, frame.projection);
    if (convention->zero_to_one) matrix_zero_to_one(frame.projection, convention->reversed);
    memcpy(frame.viewport, viewport, sizeof(viewport));
    memcpy(frame.depth_range, convention->range, sizeof(frame.depth_range));
    if (convention->zero_to_one) frame.flags |= PBR_FRAME_CLIP_ZERO_TO_ONE;
    if (convention->reversed) frame.flags |= PBR_FRAME_REVERSED_Z;
    return frame;
}

/* Window depth of the plane at this distance from the eye. */
static float window_depth(const pbr_frame *frame, double distance) {
    pbr_item item = PBR_ITEM_INIT;
    return (float)place(frame, &item, NULL, (const double[3]){0, 0, -distance}, 1).depth;
}

/* The host draws red over everything at this distance, under its own depth test. */
static void draw_red(const pbr_frame *frame, double distance) {
    glViewport(0, 0, SIZE, SIZE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(frame->flags & PBR_FRAME_REVERSED_Z ? GL_GREATER : GL_LESS);
    draw_host_quad(window_depth(frame, distance), RED);
    glDisable(GL_DEPTH_TEST);
}

static void expect_pixel(const struct target *target, int pixel, const uint8_t wanted[4], const char *what, int line) {
    uint8_t pixels[PIXELS][4];
    target_read(target, pixels);
    if (memcmp(pixels[pixel], wanted, 4))
        fail_msg("%s (line %d): pixel %d is %d %d %d %d, not %d %d %d %d", what, line, pixel, pixels[pixel][0], pixels[pixel][1],
                 pixels[pixel][2], pixels[pixel][3], wanted[0], wanted[1], wanted[2], wanted[3]);
}
#define EXPECT_PIXEL(pixel, wanted, what) expect_pixel(&target, pixel, wanted, what, __LINE__)

static void start(const struct target *target, const pbr_frame *frame) {
    target_clear(target, NOTHING, frame->flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
}

/* A white splat at distance 5, the host's quad behind it (10) or before it (3), in both orders. */
static void check_occlusion(struct host *host, const struct convention *convention, uint32_t kind, uint32_t blending) {
    struct target target;
    pbr_frame frame = make_frame(convention);
    pbr_points *points = one_point(host, (const double[3]){0, 0, -5}, 1);
    pbr_item item = plain_item(points, kind);
    item.blending = blending;
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, convention->depth_format, convention->samples));
    target_bind(&target);

    start(&target, &frame);
    draw_red(&frame, 10);
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, WHITE_BYTES, convention->name);
    EXPECT_PIXEL(0, RED_BYTES, convention->name);

    start(&target, &frame);
    render(host, &frame, &item, 1);
    draw_red(&frame, 10);
    EXPECT_PIXEL(MIDDLE, WHITE_BYTES, convention->name);
    EXPECT_PIXEL(0, RED_BYTES, convention->name);

    start(&target, &frame);
    draw_red(&frame, 3);
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, RED_BYTES, convention->name);

    start(&target, &frame);
    render(host, &frame, &item, 1);
    draw_red(&frame, 3);
    EXPECT_PIXEL(MIDDLE, RED_BYTES, convention->name);

    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

static void splats_and_the_hosts_quad_hide_each_other(void **state) {
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int i = 0; i < CONVENTIONS; i++) {
            for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_EWA_MAX; kind++)
                check_occlusion(*state, &conventions[i], kind, PBR_BLEND_KIND);
            for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_ELLIPSE; kind++)
                check_occlusion(*state, &conventions[i], kind, PBR_BLEND_FILL);
        }
    }
}

/* Two splats of two items, the nearer first and last. */
static void splats_hide_each_other_in_any_order(void **state) {
    struct host *host = *state;
    for (int i = 0; i < CONVENTIONS; i++) {
        struct target target;
        pbr_frame frame = make_frame(&conventions[i]);
        pbr_points *near = one_point(host, (const double[3]){0, 0, -5}, 1),
                   *far = one_point(host, (const double[3]){0, 0, -5.01}, 1);
        pbr_item items[2] = {plain_item(near, PBR_SPLAT_SQUARE), plain_item(far, PBR_SPLAT_CIRCLE)};
        items[1].id = 2;
        memcpy(items[1].colour, RED, sizeof(RED));
        assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, conventions[i].depth_format, conventions[i].samples));
        target_bind(&target);
        for (int order = 0; order < 2; order++) {
            pbr_item swapped[2] = {items[order], items[!order]};
            start(&target, &frame);
            render(host, &frame, swapped, 2);
            EXPECT_PIXEL(MIDDLE, WHITE_BYTES, conventions[i].name);
        }
        glBindFramebuffer(GL_FRAMEBUFFER, 0);
        target_destroy(&target);
        pbr_points_release(&near);
        pbr_points_release(&far);
    }
}

/* Multisampling smooths the border between splats and the background; inside, resolved splats keep their colour. */
static void multisampled_edges_are_between(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_frame frame = make_frame(&conventions[6]);
    pbr_points *points = one_point(host, (const double[3]){0.013, 0.017, -5}, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 4));
    target_bind(&target);
    glEnable(GL_DITHER);
    start(&target, &frame);
    render(host, &frame, &item, 1);
    target_read(&target, pixels);
    struct placed splat = place(&frame, &item, NULL, (const double[3]){0.013, 0.017, -5}, 1);
    for (int i = 0; i < PIXELS; i++) {
        double distance = edge_distance(&splat, PBR_SPLAT_SQUARE, i % SIZE, i / SIZE);
        if (distance < -0.75) assert_int_equal(pixels[i][0], 255);
        if (distance > 0.75) assert_int_equal(pixels[i][0], 0);
    }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

/* Those of which the vertex stage finds that they are not seen go to the view's corner, and there no sample may show them: back
 * faces, and discs that are seen from their rim. One splat in the middle keeps their block from being left out before. */
static void splats_that_are_not_seen_leave_nothing(void **state) {
    enum { COUNT = 300 };
    static const uint32_t kinds[] = {PBR_SPLAT_SQUARE,   PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE,
                                     PBR_SPLAT_GAUSSIAN, PBR_SPLAT_EWA,    PBR_SPLAT_EWA_MAX};
    struct host *host = *state;
    pbr_frame frame = make_frame(&conventions[0]);
    for (int turned = 0; turned < 2; turned++) { /* away; or across the way to the eye */
        float positions[COUNT][3] = {{0, 0, -5}}, normals[COUNT][3] = {{0, 0, 1}};
        for (int i = 1; i < COUNT; i++) {
            positions[i][0] = (float)(i % 17 - 8) * 0.25f, positions[i][1] = (float)(i % 19 - 9) * 0.2f, positions[i][2] = -5;
            normals[i][0] = turned ? 5 : 0.1f, normals[i][1] = 0, normals[i][2] = turned ? positions[i][0] : -1;
        }
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        desc.count = COUNT;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
        desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
        desc.radius = 0.3f;
        pbr_points *points = NULL;
        assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
        for (int samples = 0; samples <= 4; samples += 4)
            for (size_t k = turned ? 2 : 0; k < sizeof(kinds) / sizeof(kinds[0]); k++) {
                struct target target;
                uint8_t pixels[PIXELS][4];
                pbr_item item = plain_item(points, kinds[k]);
                item.flags = turned ? 0 : PBR_ITEM_CULL_BACK_FACES;
                assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, samples));
                target_bind(&target);
                start(&target, &frame);
                render(host, &frame, &item, 1);
                target_read(&target, pixels);
                for (int i = 0; i < PIXELS; i++) {
                    const double x = i % SIZE - SIZE / 2 + 0.5, y = i / SIZE - SIZE / 2 + 0.5, squared = x * x + y * y;
                    if (squared < 1) assert_true(pixels[i][3] > 0); /* its radius is 1.76 pixels, and a low-pass adds to that */
                    if (squared > 16 && pixels[i][3] != 0)
                        fail_msg("kind %u, %s, %d samples: pixel %d, %d is drawn", (unsigned)kinds[k], turned ? "rims" : "backs",
                                 samples, i % SIZE, i / SIZE);
                }
                glBindFramebuffer(GL_FRAMEBUFFER, 0);
                target_destroy(&target);
            }
        pbr_points_release(&points);
    }
}

static void a_target_without_depth_is_drawn_to(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_frame frame = make_frame(&conventions[0]);
    pbr_points *points = one_point(host, (const double[3]){0, 0, -5}, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, 0, 0));
    target_bind(&target);
    start(&target, &frame);
    draw_red(&frame, 3);
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, WHITE_BYTES, "no depth buffer");
    EXPECT_PIXEL(0, RED_BYTES, "no depth buffer");
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

static void without_the_depth_test_everything_is_drawn_and_depth_kept(void **state) {
    struct host *host = *state;
    struct target target;
    float before[PIXELS], after[PIXELS];
    pbr_frame frame = make_frame(&conventions[0]);
    pbr_points *points = one_point(host, (const double[3]){0, 0, -5}, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);
    start(&target, &frame);
    draw_red(&frame, 3);
    target_read_depth(&target, before);
    frame.flags |= PBR_FRAME_NO_DEPTH_TEST;
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, WHITE_BYTES, "no depth test");
    target_read_depth(&target, after);
    assert_memory_equal(before, after, sizeof(before));
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

static void without_depth_writes_the_test_stays(void **state) {
    struct host *host = *state;
    struct target target;
    float before[PIXELS], after[PIXELS];
    pbr_frame frame = make_frame(&conventions[0]);
    pbr_points *points = one_point(host, (const double[3]){0, 0, -5}, 1);
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    frame.flags |= PBR_FRAME_NO_DEPTH_WRITE;
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);
    start(&target, &frame);
    draw_red(&frame, 3);
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, RED_BYTES, "hidden");
    start(&target, &frame);
    target_read_depth(&target, before);
    render(host, &frame, &item, 1);
    EXPECT_PIXEL(MIDDLE, WHITE_BYTES, "seen");
    target_read_depth(&target, after);
    assert_memory_equal(before, after, sizeof(before));
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

/* The depth buffer holds 0.5 everywhere and the splat lies before it, behind it, or (as its own depth drawn twice) just there. */
static void the_depth_function_decides(void **state) {
    static const struct {
        GLenum function;
        bool before, behind, equal;
    } cases[] = {{GL_NEVER, false, false, false}, {GL_LESS, true, false, false},    {GL_EQUAL, false, false, true},
                 {GL_LEQUAL, true, false, true},  {GL_GREATER, false, true, false}, {GL_NOTEQUAL, true, true, false},
                 {GL_GEQUAL, false, true, true},  {GL_ALWAYS, true, true, true}};
    struct host *host = *state;
    struct target target;
    pbr_points *points = one_point(host, (const double[3]){0, 0, -5}, 1);
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
        for (int where = 0; where < 3; where++) {
            pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
            pbr_frame frame = make_frame(&conventions[0]);
            float depth = window_depth(&frame, 5);
            target_clear(&target, NOTHING, where == 0 ? depth + 0.01f : where == 1 ? depth - 0.01f : 1);
            memcpy(item.colour, RED, sizeof(RED));
            if (where == 2) render(host, &frame, &item, 1);
            for (int k = 0; k < 3; k++) item.colour[k] = 1;
            frame.depth_function = cases[i].function;
            render(host, &frame, &item, 1);
            bool drawn = where == 0 ? cases[i].before : where == 1 ? cases[i].behind : cases[i].equal;
            EXPECT_PIXEL(MIDDLE, drawn ? WHITE_BYTES : where == 2 ? RED_BYTES : ((const uint8_t[4]){0, 0, 0, 0}), "depth function");
        }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
    pbr_points_release(&points);
}

/* Reversed depth in a float buffer tells apart what is a ten-thousandth of its distance apart, up to far away: the reason for its
 * use. It needs clip control; without it, depth is converted and only as good as the usual. */
static void reversed_depth_keeps_its_precision(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    pbr_frame frame = make_frame(&conventions[3]);
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    if (!info.has_clip_control) {
        print_message("skipped: no clip control\n");
        skip();
    }
    matrix_perspective(1, 1, 0.1, 1e6, frame.projection);
    matrix_zero_to_one(frame.projection, true);
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&target);
    for (double distance = 1; distance < 1e6; distance *= 10) {
        pbr_points *near = one_point(host, (const double[3]){0, 0, -distance}, (float)distance / 5);
        pbr_points *far = one_point(host, (const double[3]){0, 0, -distance * 1.0001}, (float)distance / 5);
        pbr_item items[2] = {plain_item(near, PBR_SPLAT_SQUARE), plain_item(far, PBR_SPLAT_SQUARE)};
        items[1].id = 2;
        memcpy(items[1].colour, RED, sizeof(RED));
        start(&target, &frame);
        render(host, &frame, items, 2);
        EXPECT_PIXEL(MIDDLE, WHITE_BYTES, "reversed");
        pbr_points_release(&near);
        pbr_points_release(&far);
    }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(splats_and_the_hosts_quad_hide_each_other),
        GL_TEST(splats_hide_each_other_in_any_order),
        GL_TEST(multisampled_edges_are_between),
        GL_TEST(splats_that_are_not_seen_leave_nothing),
        GL_TEST(a_target_without_depth_is_drawn_to),
        GL_TEST(without_the_depth_test_everything_is_drawn_and_depth_kept),
        GL_TEST(without_depth_writes_the_test_stays),
        GL_TEST(the_depth_function_decides),
        GL_TEST(reversed_depth_keeps_its_precision),
    };
    return RUN_GL_TESTS("depth", tests);
}
