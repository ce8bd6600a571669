/* Every sized structure of drawing is taken in every size that docs/abi.md promises, and in no other.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include "../struct_sizes.h"

enum { SIZE = 16 };

/* Without a point there is nothing to draw, but everything is looked at. */
static pbr_frame frame_of_nothing(void) {
    pbr_frame frame = PBR_FRAME_INIT;
    matrix_perspective(1, 1, 1, 10, frame.projection);
    frame.viewport[2] = frame.viewport[3] = SIZE;
    return frame;
}

static pbr_result use_renderer(void *user, void *desc) {
    struct host *host = user;
    pbr_renderer *renderer = NULL;
    pbr_result result = pbr_renderer_create(host->instance, desc, &renderer);
    assert_int_equal(renderer != NULL, result == PBR_OK);
    assert_int_equal(pbr_renderer_destroy(&renderer), PBR_OK);
    return result;
}

static pbr_result use_view(void *user, void *desc) {
    struct host *host = user;
    pbr_view *view = NULL;
    pbr_result result = pbr_view_create(host->renderer, desc, &view);
    assert_int_equal(view != NULL, result == PBR_OK);
    pbr_view_destroy(&view);
    return result;
}

static pbr_result use_frame(void *user, void *frame) {
    struct host *host = user;
    return pbr_render(host->view, frame, NULL, 0, NULL);
}

static pbr_result use_item(void *user, void *item) {
    struct host *host = user;
    pbr_frame frame = frame_of_nothing();
    return pbr_render(host->view, &frame, item, 1, NULL);
}

static pbr_result use_light(void *user, void *light) {
    struct host *host = user;
    pbr_frame frame = frame_of_nothing();
    frame.lights = light;
    frame.light_count = 1;
    return pbr_render(host->view, &frame, NULL, 0, NULL);
}

static pbr_result use_info(void *user, void *info) {
    struct host *host = user;
    return pbr_renderer_get_info(host->renderer, info);
}

static pbr_result use_stats(void *user, void *structure) {
    struct host *host = user;
    pbr_frame frame = frame_of_nothing();
    pbr_result result = pbr_render(host->view, &frame, NULL, 0, structure);
    if (result != PBR_OK) return result;
    pbr_stats *stats = structure;
    stats->cut_seconds = 0; /* another one each time */
    return result;
}

static void structures_of_every_promised_size_are_taken_and_no_other(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_frame frame = frame_of_nothing();
    pbr_light light = PBR_LIGHT_INIT;
    light.vector[2] = 1;
    const double origin[3] = {0, 0, -3};
    pbr_points *points = one_point(host, origin, 0.5f);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    pbr_renderer_desc renderer = host_renderer_desc();
    const struct sized inputs[] = {
        SIZED(pbr_renderer_desc, flags, &renderer, use_renderer),
        SIZED(pbr_view_desc, reserved, NULL, use_view),
        SIZED(pbr_frame, time_budget, &frame, use_frame),
        SIZED(pbr_item, lod, &item, use_item),
        SIZED(pbr_light, reserved, &light, use_light),
    };
    const struct sized outputs[] = {
        SIZED(pbr_renderer_info, gpu_object_count, NULL, use_info),
        SIZED(pbr_stats, triangles_drawn, NULL, use_stats),
    };
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);
    for (size_t i = 0; i < sizeof inputs / sizeof inputs[0]; i++) check_input_sizes(&inputs[i], host);
    for (size_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) check_output_sizes(&outputs[i], host);
    expect_no_gl_error("structures of many sizes");
    pbr_points_release(&points);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

/* A later version's light. */
struct long_light {
    pbr_light light;
    double unknown[3];
};

static void draw(struct host *host, const struct target *target, const pbr_light *lights, const pbr_item *item,
                 uint8_t (*pixels)[4]) {
    pbr_frame frame = frame_of_nothing();
    frame.lights = lights;
    frame.light_count = 3;
    target_clear(target, (const float[4]){0, 0, 0, 0}, 1);
    render(host, &frame, item, 1);
    target_read(target, pixels);
}

/* Arrays of longer items: test_failures.c. */
static void an_array_of_longer_lights_draws_the_same(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[SIZE * SIZE][4], got[SIZE * SIZE][4];
    pbr_light lights[3];
    struct long_light long_lights[3];
    const float position[3] = {0, 0, -3}, normal[3] = {1, 1, 1};
    memset(long_lights, 0, sizeof long_lights);
    for (int i = 0; i < 3; i++) {
        lights[i] = (pbr_light)PBR_LIGHT_INIT;
        lights[i].vector[i] = 1;
        lights[i].colour[i] = 0.5f; /* red from the right, green from above, blue from the eye */
        long_lights[i].light = lights[i];
        long_lights[i].light.struct_size = sizeof long_lights[i];
    }
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 1;
    desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normal, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.8f;
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);

    draw(host, &target, lights, &item, wanted);
    for (int k = 0; k < 3; k++) {
        int lit = 0;
        for (int i = 0; i < SIZE * SIZE; i++) lit += wanted[i][k] > 0;
        assert_true(lit > 10); /* each light reaches the picture */
    }
    draw(host, &target, &long_lights[0].light, &item, got);
    assert_memory_equal(wanted, got, sizeof wanted);

    pbr_frame frame = frame_of_nothing();
    frame.lights = &long_lights[0].light;
    frame.light_count = 3;
    long_lights[2].unknown[2] = 1;
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    pbr_points_release(&points);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(structures_of_every_promised_size_are_taken_and_no_other),
        GL_TEST(an_array_of_longer_lights_draws_the_same),
    };
    return RUN_GL_TESTS("struct_sizes", tests);
}
