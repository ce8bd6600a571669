/* What goes wrong around libpbr stays contained: memory, missing functions, lost contexts, objects destroyed too early, budgets and
 * limits. SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 32, PIXELS = SIZE * SIZE, MOST_NAMES = 4000 };

/* Names of GL objects that exist, among the first few hundred of each kind: drivers hand out small numbers first. */
static int count_objects(void) {
    int count = 0;
    for (GLuint i = 1; i < 400; i++)
        count += glIsBuffer(i) + glIsTexture(i) + glIsVertexArray(i) + glIsProgram(i) + glIsShader(i) + glIsFramebuffer(i) +
                 glIsRenderbuffer(i) + glIsSampler(i) + glIsQuery(i);
    return count;
}

static pbr_frame make_frame(void) {
    static const int32_t viewport[4] = {0, 0, SIZE, SIZE};
    pbr_frame frame = PBR_FRAME_INIT;
    matrix_perspective(1, 1, 0.5, 20, frame.projection);
    matrix_translation(0, 0, -4, frame.view);
    memcpy(frame.viewport, viewport, sizeof(viewport));
    return frame;
}

/* `count` points in a ball, with normals and colours; the seed tells sets apart. */
static pbr_result make_points(pbr_instance *instance, uint64_t count, uint64_t seed, pbr_points **out) {
    float(*positions)[3] = calloc(count, sizeof(*positions));
    assert_non_null(positions);
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)random_between(&seed, -1, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = count;
    desc.positions = desc.normals = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.1f;
    pbr_result result = pbr_points_create(instance, &desc, out);
    free(positions);
    return result;
}

static pbr_points *points_of(struct host *host, uint64_t count, uint64_t seed) {
    pbr_points *points = NULL;
    assert_int_equal(make_points(host->instance, count, seed, &points), PBR_OK);
    return points;
}

static pbr_item make_item(const pbr_points *points) {
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    return item;
}

static void open_target(struct target *target) {
    assert_true(target_create(target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(target);
    target_clear(target, (const float[4]){0, 0, 0, 0}, 1);
}

static void close_target(struct target *target) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(target);
}

static void draw(struct host *host, const struct target *target, const pbr_item *items, size_t count, uint8_t (*pixels)[4],
                 pbr_stats *stats) {
    pbr_frame frame = make_frame();
    target_clear(target, (const float[4]){0, 0, 0, 0}, 1);
    pbr_stats drawn = render(host, &frame, items, count);
    if (stats) *stats = drawn;
    target_read(target, pixels);
}

static bool is_empty(const uint8_t (*pixels)[4]) {
    for (int i = 0; i < PIXELS; i++)
        if (pixels[i][3]) return false;
    return true;
}

/* ---- Memory ---- */

/* Everything a host does, from instance to instance; the first error, or PBR_OK. */
static pbr_result whole_life(struct host *host, const struct target *target) {
    pbr_instance *instance = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    pbr_points *points = NULL;
    pbr_stats stats = PBR_STATS_INIT;
    pbr_instance_desc instance_desc = host_instance_desc(host);
    pbr_renderer_desc renderer_desc = host_renderer_desc();
    pbr_frame frame = make_frame();
    target_bind(target);
    pbr_result result = pbr_instance_create(&instance_desc, &instance);
    if (result) assert_null(instance);
    if (!result) result = make_points(instance, 3000, 1, &points);
    if (!result) result = pbr_renderer_create(instance, &renderer_desc, &renderer);
    if (!result) result = pbr_view_create(renderer, NULL, &view);
    pbr_item item = make_item(points);
    if (!result) result = pbr_render(view, &frame, &item, 1, &stats);
    if (!result) result = pbr_render(view, &frame, &item, 1, &stats);
    pbr_view_destroy(&view);
    assert_int_equal(pbr_renderer_destroy(&renderer), PBR_OK);
    pbr_points_release(&points);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    return result;
}

/* Bindings that a render in the middle of which memory ran out might have left. */
static void expect_bindings(const struct target *target) {
    static const GLenum bindings[] = {GL_CURRENT_PROGRAM,        GL_VERTEX_ARRAY_BINDING,      GL_ARRAY_BUFFER_BINDING,
                                      GL_UNIFORM_BUFFER_BINDING, GL_COPY_WRITE_BUFFER_BINDING, GL_COPY_READ_BUFFER_BINDING,
                                      GL_TEXTURE_BINDING_2D};
    GLint bound = 0;
    for (size_t i = 0; i < sizeof(bindings) / sizeof(bindings[0]); i++) {
        glGetIntegerv(bindings[i], &bound);
        assert_int_equal(bound, 0);
    }
    glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &bound);
    assert_int_equal(bound, target->framebuffer);
    assert_false(glIsEnabled(GL_DEPTH_TEST));
}

static void check_allocation_failures(struct host *host, bool only_one) {
    struct target target;
    open_target(&target);
    assert_int_equal(whole_life(host, &target), PBR_OK);
    int objects = count_objects();
    size_t blocks = host->memory.blocks, n = 0;
    for (bool failed = true; failed; n++) {
        size_t start = host->memory.allocations, errors = host->errors;
        host->memory.fail_first = start + n + 1;
        host->memory.fail_last = only_one ? host->memory.fail_first : SIZE_MAX;
        pbr_result result = whole_life(host, &target);
        failed = host->memory.allocations >= host->memory.fail_first;
        host->memory.fail_first = 0;
        if (result != (failed ? PBR_ERROR_OUT_OF_MEMORY : PBR_OK))
            fail_msg("allocation %zu fails: %s", n + 1, pbr_result_name(result));
        if (failed) assert_true(host->errors > errors); /* explained in the log */
        assert_int_equal(host->memory.blocks, blocks);
        assert_int_equal(count_objects(), objects);
        expect_bindings(&target);
        expect_no_gl_error("out of memory");
    }
    assert_true(n > 5);
    close_target(&target);
}

static void every_allocation_may_fail_alone(void **state) {
    check_allocation_failures(*state, true);
}
static void memory_may_run_out_anywhere(void **state) {
    check_allocation_failures(*state, false);
}

/* A renderer goes on after a frame that ran out of memory. */
static void a_failed_frame_can_be_drawn_again(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    open_target(&target);
    pbr_points *points = points_of(host, 3000, 1);
    pbr_item item = make_item(points);
    pbr_frame frame = make_frame();
    draw(host, &target, &item, 1, wanted, NULL);
    int failures = 0;
    for (size_t n = 1; n < 100; n++) {
        pbr_renderer_evict(host->renderer, NULL);
        host->memory.fail_first = host->memory.allocations + n;
        host->memory.fail_last = SIZE_MAX;
        pbr_result result = pbr_render(host->view, &frame, &item, 1, NULL);
        host->memory.fail_first = 0;
        if (result == PBR_OK) break;
        failures++;
        assert_int_equal(result, PBR_ERROR_OUT_OF_MEMORY);
        draw(host, &target, &item, 1, got, NULL);
        assert_memory_equal(wanted, got, sizeof(wanted));
    }
    assert_true(failures > 0);
    pbr_points_release(&points);
    close_target(&target);
}

static void steady_state_allocates_compiles_and_uploads_nothing(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    double models[3][16];
    pbr_stats stats;
    pbr_renderer_info before = PBR_RENDERER_INFO_INIT, after = PBR_RENDERER_INFO_INIT;
    open_target(&target);
    pbr_points *sets[2] = {points_of(host, 5000, 1), points_of(host, 100, 2)};
    pbr_item items[5] = {make_item(sets[0]), make_item(sets[1]), make_item(sets[1]), make_item(sets[0]), make_item(sets[0])};
    for (int i = 0; i < 3; i++) matrix_translation(0.5 * i, 0, 0, models[i]);
    items[1].transforms = models[0];
    items[1].transform_count = 3;
    items[1].splat = PBR_SPLAT_SQUARE;
    items[1].id = 1;
    items[2].splat = PBR_SPLAT_GAUSSIAN;
    items[3].splat = PBR_SPLAT_EWA;
    items[3].shading = PBR_SHADE_DEFERRED;
    items[4].blending = PBR_BLEND_FILL;
    draw(host, &target, items, 5, pixels, &stats);
    assert_true(stats.upload_bytes > 0 && stats.programs_compiled > 0);
    assert_int_equal(stats.points, 15400);
    size_t allocations = host->memory.allocations;
    pbr_renderer_get_info(host->renderer, &before);
    for (int frame = 0; frame < 4; frame++) {
        draw(host, &target, items, 5, pixels, &stats);
        assert_int_equal(stats.upload_bytes, 0);
        assert_int_equal(stats.programs_compiled, 0);
        assert_int_equal(stats.is_final, 1);
        assert_int_equal(host->memory.allocations, allocations);
    }
    pbr_renderer_get_info(host->renderer, &after);
    assert_int_equal(before.gpu_object_count, after.gpu_object_count);
    assert_int_equal(before.gpu_memory_bytes, after.gpu_memory_bytes);
    pbr_points_release(&sets[0]);
    pbr_points_release(&sets[1]);
    close_target(&target);
}

/* ---- Functions ---- */

struct lookup {
    const char *missing;
    char (*names)[48];
    size_t count;
};

static void *record(void *user, const char *name) {
    struct lookup *lookup = user;
    if (lookup->names && lookup->count < MOST_NAMES) snprintf(lookup->names[lookup->count++], sizeof(*lookup->names), "%s", name);
    return lookup->missing && !strcmp(lookup->missing, name) ? NULL : context_get_proc(NULL, name);
}

static void only_functions_of_the_version_are_asked_for(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    open_target(&target);
    size_t refused = context_refused_count();
    pbr_renderer_desc desc = host_renderer_desc();
    host_use_renderer(host, &desc);
    pbr_points *points = points_of(host, 100, 1);
    pbr_item item = make_item(points);
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_EWA_MAX; kind++) {
        item.splat = kind;
        item.shading = PBR_SHADE_DEFERRED;
        draw(host, &target, &item, 1, pixels, NULL);
    }
    for (uint32_t kind = PBR_SPLAT_CIRCLE; kind <= PBR_SPLAT_ELLIPSE; kind++) {
        item.splat = kind;
        item.blending = PBR_BLEND_FILL;
        draw(host, &target, &item, 1, pixels, NULL);
    }
    assert_int_equal(context_refused_count(), refused);
    pbr_points_release(&points);
    close_target(&target);
}

static void functions_are_looked_up_only_at_creation(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    struct lookup lookup = {.names = calloc(MOST_NAMES, 48)};
    assert_non_null(lookup.names);
    open_target(&target);
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    desc.get_proc_address = record;
    desc.get_proc_address_user = &lookup;
    host_use_renderer(host, &desc);
    size_t count = lookup.count;
    assert_true(count > 30);
    pbr_points *points = points_of(host, 100, 1);
    pbr_item item = make_item(points);
    draw(host, &target, &item, 1, pixels, NULL);
    host_drop_renderer(host);
    assert_int_equal(lookup.count, count);
    pbr_points_release(&points);
    close_target(&target);
    free(lookup.names);
}

/* Each is either needed, and creation says so by name, or not needed, and the same picture is drawn without it. */
static void each_missing_function_is_named_or_not_needed(void **state) {
    struct host *host = *state;
    struct target target;
    struct lookup lookup = {.names = calloc(MOST_NAMES, 48)};
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    assert_non_null(lookup.names);
    open_target(&target);
    pbr_points *points = points_of(host, 200, 1);
    pbr_item item = make_item(points);
    draw(host, &target, &item, 1, wanted, NULL);
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    desc.get_proc_address = record;
    desc.get_proc_address_user = &lookup;
    host_use_renderer(host, &desc);
    struct lookup without = {NULL, NULL, 0};
    desc.get_proc_address_user = &without;
    size_t needed = 0;
    host_drop_renderer(host);
    int objects = count_objects();
    for (size_t i = 0; i < lookup.count; i++) {
        without.missing = lookup.names[i];
        pbr_result result = pbr_renderer_create(host->instance, &desc, &host->renderer);
        if (result == PBR_OK) {
            assert_int_equal(pbr_view_create(host->renderer, NULL, &host->view), PBR_OK);
            draw(host, &target, &item, 1, got, NULL);
            if (memcmp(wanted, got, sizeof(wanted))) fail_msg("another picture without %s", without.missing);
            host_drop_renderer(host);
        } else {
            needed++;
            assert_null(host->renderer);
            if (result != PBR_ERROR_UNSUPPORTED || !strstr(host->log, without.missing))
                fail_msg("without %s: %s: %s", without.missing, pbr_result_name(result), host->log);
        }
        assert_int_equal(count_objects(), objects);
    }
    assert_true(needed > 20);
    pbr_points_release(&points);
    close_target(&target);
    free(lookup.names);
}

static void libepoxy_is_the_default_lookup(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    open_target(&target);
    pbr_points *points = points_of(host, 500, 1);
    pbr_item item = make_item(points);
    draw(host, &target, &item, 1, wanted, NULL);
    host_use_renderer(host, NULL);
    draw(host, &target, &item, 1, got, NULL);
    assert_memory_equal(wanted, got, sizeof(wanted));
    pbr_points_release(&points);
    close_target(&target);
}

/* ---- The context ---- */

static void without_a_context_no_renderer_is_made(void **state) {
    struct host *host = *state;
    pbr_renderer *renderer = NULL;
    pbr_renderer_desc desc = host_renderer_desc();
    context_release();
    assert_int_equal(pbr_renderer_create(host->instance, &desc, &renderer), PBR_ERROR_CONTEXT);
    assert_null(renderer);
    assert_int_equal(pbr_renderer_create(host->instance, NULL, &renderer), PBR_ERROR_CONTEXT);
    assert_null(renderer);
    context_restore();
}

/* With the context still current, a deleting call would be seen in what exists. */
static void an_abandoned_renderer_makes_no_gl_call(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_view *view = NULL;
    float cost;
    open_target(&target);
    pbr_points *points = points_of(host, 500, 1);
    pbr_item item = make_item(points);
    pbr_frame frame = make_frame();
    draw(host, &target, &item, 1, pixels, NULL);
    int objects = count_objects();
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    pbr_renderer_abandon(host->renderer);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, NULL), PBR_ERROR_CONTEXT);
    assert_int_equal(pbr_prepare(host->view, &frame, &item, 1, NULL), PBR_ERROR_CONTEXT);
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &item, &cost), PBR_ERROR_CONTEXT);
    assert_int_equal(pbr_view_create(host->renderer, NULL, &view), PBR_ERROR_CONTEXT);
    pbr_renderer_evict(host->renderer, points);
    pbr_renderer_evict(host->renderer, NULL);
    pbr_view_destroy(&host->view);
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_OK);
    assert_int_equal(count_objects(), objects);
    target_read(&target, pixels);
    assert_true(is_empty((const uint8_t(*)[4])pixels));
    pbr_points_release(&points);
    close_target(&target);
}

/* As after the loss of a context: there is none to call. */
static void an_abandoned_renderer_is_destroyed_without_a_context(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    open_target(&target);
    pbr_points *points = points_of(host, 500, 1);
    pbr_item item = make_item(points);
    draw(host, &target, &item, 1, pixels, NULL);
    context_release();
    pbr_renderer_abandon(host->renderer);
    pbr_renderer_evict(host->renderer, points);
    pbr_view_destroy(&host->view);
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_OK);
    context_restore();
    pbr_points_release(&points);
    close_target(&target);
}

static void destroying_deletes_every_gl_object(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_renderer_desc desc = host_renderer_desc();
    open_target(&target);
    pbr_points *points = points_of(host, 500, 1);
    pbr_item item = make_item(points);
    host_drop_renderer(host);
    int objects = count_objects();
    host_use_renderer(host, &desc);
    draw(host, &target, &item, 1, pixels, NULL);
    assert_true(count_objects() > objects);
    host_drop_renderer(host);
    assert_int_equal(count_objects(), objects);
    pbr_points_release(&points);
    close_target(&target);
}

/* The window's framebuffer does not exist in a context without a surface. */
static void an_incomplete_target_is_an_error(void **state) {
    struct host *host = *state;
    pbr_frame frame = make_frame();
    GLuint empty = 0;
    pbr_points *points = points_of(host, 50, 1);
    pbr_item item = make_item(points);
    glGenFramebuffers(1, &empty);
    glBindFramebuffer(GL_FRAMEBUFFER, empty);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, NULL), PBR_ERROR_GL);
    expect_no_gl_error("an incomplete framebuffer");
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glDeleteFramebuffers(1, &empty);
    pbr_points_release(&points);
}

/* ---- Lifetimes ---- */

static void what_has_children_is_busy(void **state) {
    struct host *host = *state;
    pbr_renderer *renderer = host->renderer;
    pbr_instance *instance = host->instance;
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_ERROR_BUSY);
    assert_ptr_equal(host->renderer, renderer);
    assert_int_equal(pbr_instance_destroy(&host->instance), PBR_ERROR_BUSY);
    assert_ptr_equal(host->instance, instance);
    pbr_points *points = points_of(host, 10, 1);
    host_drop_renderer(host);
    assert_int_equal(pbr_instance_destroy(&host->instance), PBR_ERROR_BUSY);
    pbr_points_release(&points);
    assert_null(host->renderer);
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_OK);
    assert_int_equal(pbr_renderer_destroy(NULL), PBR_OK);
    pbr_view_destroy(&host->view);
    pbr_view_destroy(NULL);
}

static void drawn_points_live_until_evicted(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    pbr_stats stats;
    open_target(&target);
    pbr_points *points = points_of(host, 500, 1);
    pbr_item item = make_item(points);
    draw(host, &target, &item, 1, wanted, &stats);
    pbr_renderer_get_info(host->renderer, &info);
    uint64_t held = info.gpu_memory_bytes;
    assert_true(held >= stats.upload_bytes);

    pbr_renderer_evict(host->renderer, points);
    pbr_renderer_get_info(host->renderer, &info);
    assert_true(info.gpu_memory_bytes <= held - stats.upload_bytes);
    draw(host, &target, &item, 1, got, &stats);
    assert_true(stats.upload_bytes > 0);
    assert_memory_equal(wanted, got, sizeof(wanted));

    const pbr_points *name = points; /* the renderer's reference keeps it alive */
    size_t blocks = host->memory.blocks;
    pbr_points_release(&points);
    assert_true(host->memory.blocks == blocks);
    item.points = name;
    draw(host, &target, &item, 1, got, &stats);
    assert_int_equal(stats.upload_bytes, 0);
    assert_memory_equal(wanted, got, sizeof(wanted));
    pbr_renderer_evict(host->renderer, name);
    assert_true(host->memory.blocks < blocks);
    close_target(&target);
}

/* ---- Budget ---- */

static void the_budget_drops_what_was_drawn_longest_ago(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[3][PIXELS][4], got[PIXELS][4];
    pbr_points *sets[3];
    pbr_item items[3];
    pbr_stats stats;
    uint64_t bytes = 0;
    open_target(&target);
    for (uint64_t i = 0; i < 3; i++) {
        sets[i] = points_of(host, 20000, i);
        items[i] = make_item(sets[i]);
        items[i].id = i;
        draw(host, &target, &items[i], 1, wanted[i], &stats);
        if (i == 0) bytes = stats.upload_bytes;
    }
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = bytes * 5 / 2; /* two of the three */
    host_use_renderer(host, &desc);
    static const struct {
        int set;
        bool uploads;
    } steps[] = {{0, true}, {1, true}, {0, false}, {2, true}, {0, false}, {1, true}, {0, false}, {1, false}, {2, true}, {1, false}};
    for (size_t i = 0; i < sizeof(steps) / sizeof(steps[0]); i++) {
        draw(host, &target, &items[steps[i].set], 1, got, &stats);
        if ((stats.upload_bytes > 0) != steps[i].uploads)
            fail_msg("step %zu: set %d: %d bytes", i, steps[i].set, (int)stats.upload_bytes);
        assert_memory_equal(wanted[steps[i].set], got, sizeof(got));
        assert_true(stats.gpu_memory_bytes < 3 * bytes);
    }
    for (int i = 0; i < 3; i++) pbr_points_release(&sets[i]);
    close_target(&target);
}

static void what_a_frame_draws_must_fit_the_budget(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    pbr_stats stats = PBR_STATS_INIT;
    pbr_frame frame = make_frame();
    open_target(&target);
    pbr_points *sets[2] = {points_of(host, 20000, 1), points_of(host, 20000, 2)};
    pbr_item items[2] = {make_item(sets[0]), make_item(sets[1])};
    items[1].id = 1;
    draw(host, &target, items, 1, wanted, &stats);
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = stats.upload_bytes * 3 / 2;
    host_use_renderer(host, &desc);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    assert_int_equal(pbr_render(host->view, &frame, items, 2, &stats), PBR_ERROR_OUT_OF_GPU_MEMORY);
    assert_true(host->errors > 0);
    target_read(&target, got);
    assert_true(is_empty((const uint8_t(*)[4])got)); /* nothing was drawn */
    draw(host, &target, items, 1, got, &stats);
    assert_memory_equal(wanted, got, sizeof(wanted));
    pbr_points_release(&sets[0]);
    pbr_points_release(&sets[1]);
    close_target(&target);
}

/* ---- Limits and arguments ---- */

static void expect_refused(struct host *host, const pbr_frame *frame, const pbr_item *items, size_t count, pbr_result wanted,
                           const char *what) {
    size_t errors = host->errors;
    pbr_result result = pbr_render(host->view, frame, items, count, NULL);
    if (result != wanted || host->errors != errors + 1)
        fail_msg("%s: %s, %zu messages (%s)", what, pbr_result_name(result), host->errors - errors, host->log);
}

static void limits_are_errors_that_name_them(void **state) {
    struct host *host = *state;
    struct target target;
    double identity[16], planes[PBR_MAX_CLIP_PLANES + 1][4] = {{0}};
    pbr_light lights[PBR_MAX_LIGHTS + 1];
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    open_target(&target);
    matrix_identity(identity);
    pbr_points *points = points_of(host, 10, 1);
    pbr_item item = make_item(points);
    pbr_frame frame = make_frame();
    pbr_renderer_get_info(host->renderer, &info);
    assert_int_equal(info.max_lights, PBR_MAX_LIGHTS);
    assert_int_equal(info.max_clip_planes, PBR_MAX_CLIP_PLANES);
    assert_int_equal(info.max_items, PBR_MAX_ITEMS);
    assert_int_equal(info.max_transforms, PBR_MAX_TRANSFORMS);

    expect_refused(host, &frame, &item, PBR_MAX_ITEMS + 1, PBR_ERROR_LIMIT, "items");
    assert_non_null(strstr(host->log, "65536"));
    item.transforms = identity;
    item.transform_count = PBR_MAX_TRANSFORMS + 1;
    expect_refused(host, &frame, &item, 1, PBR_ERROR_LIMIT, "transforms");
    assert_non_null(strstr(host->log, "1048576"));
    item = make_item(points);
    item.clip_planes = planes[0];
    item.clip_plane_count = PBR_MAX_CLIP_PLANES + 1;
    expect_refused(host, &frame, &item, 1, PBR_ERROR_LIMIT, "clip planes");
    item = make_item(points);
    for (int i = 0; i <= PBR_MAX_LIGHTS; i++) {
        lights[i] = (pbr_light)PBR_LIGHT_INIT;
        lights[i].vector[0] = 1;
    }
    frame.lights = lights;
    frame.light_count = PBR_MAX_LIGHTS + 1;
    expect_refused(host, &frame, &item, 1, PBR_ERROR_LIMIT, "lights");
    frame = make_frame();
    frame.viewport[2] = (int32_t)info.max_viewport[0] + 1;
    expect_refused(host, &frame, &item, 1, PBR_ERROR_LIMIT, "viewport");
    pbr_points_release(&points);
    close_target(&target);
}

static void arguments_outside_their_contract_are_refused(void **state) {
    struct host *host = *state;
    struct target target;
    double affine[16], projective[16], nan_plane[4] = {0, NAN, 0, 0};
    pbr_light light = PBR_LIGHT_INIT;
    open_target(&target);
    matrix_identity(affine);
    matrix_perspective(1, 1, 1, 2, projective);
    pbr_points *points = points_of(host, 10, 1);
    const pbr_frame good_frame = make_frame();
    const pbr_item good = make_item(points);
    assert_int_equal(pbr_render(host->view, &good_frame, &good, 1, NULL), PBR_OK);

    for (int i = 0; i < 29; i++) {
        pbr_frame frame = good_frame;
        pbr_item item = good;
        char what[16];
        snprintf(what, sizeof(what), "case %d", i);
        light.vector[0] = 1;
        switch (i) {
        case 0: frame.projection[5] = NAN; break;
        case 1: frame.view[12] = INFINITY; break;
        case 2: memset(frame.projection, 0, sizeof(frame.projection)); break;
        case 3: frame.projection[5] = 0; break; /* not invertible */
        case 4: frame.view[3] = 1; break;       /* not affine */
        case 5: frame.target = 7; break;
        case 6: frame.encoding = 7; break;
        case 7: frame.flags = 1u << 20; break;
        case 8: frame.depth_function = 17; break;
        case 9: frame.jitter[0] = NAN; break;
        case 10: frame.light_count = 1; break; /* lights is NULL */
        case 11: frame.lights = &light, frame.light_count = 1, light.vector[0] = 0; break;
        case 12: item.points = NULL; break;
        case 13: item.transforms = projective, item.transform_count = 1; break;
        case 14: item.transform_count = 1; break; /* transforms is NULL */
        case 15: item.splat = 9; break;
        case 16: item.shading = 9; break;
        case 17: item.colour_source = 9; break;
        case 18: item.flags = 1u << 20; break;
        case 19: item.radius_scale = NAN; break;
        case 20: item.colour_source = PBR_COLOUR_SCALAR; break; /* the set has none */
        case 21: item.clip_planes = nan_plane, item.clip_plane_count = 1; break;
        case 22: item.struct_size = 8; break;
        case 23: item.blending = 2; break;
        case 24: item.blending = PBR_BLEND_FILL, item.splat = PBR_SPLAT_GAUSSIAN; break;
        case 25: item.low_pass = -1; break;
        case 26: item.low_pass = 16.5f; break;
        case 27: item.low_pass = NAN; break;
        case 28: item.point_cost = -1; break;
        default: break;
        }
        expect_refused(host, &frame, &item, 1, PBR_ERROR_INVALID_ARGUMENT, what);
    }
    pbr_instance *other = NULL;
    pbr_points *foreign = NULL;
    assert_int_equal(pbr_instance_create(NULL, &other), PBR_OK);
    assert_int_equal(make_points(other, 10, 1, &foreign), PBR_OK);
    pbr_item item_of_another = make_item(foreign);
    expect_refused(host, &good_frame, &item_of_another, 1, PBR_ERROR_INVALID_ARGUMENT, "points of another instance");
    pbr_points_release(&foreign);
    assert_int_equal(pbr_instance_destroy(&other), PBR_OK);
    assert_int_equal(pbr_render(host->view, &good_frame, NULL, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_render(host->view, NULL, &good, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_render(NULL, &good_frame, &good, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_render(host->view, &good_frame, &good, 1, NULL), PBR_OK);
    pbr_points_release(&points);
    close_target(&target);
}

/* Structures of a later version, with members that this one does not know. */
static void longer_structures_are_read_when_their_rest_is_zero(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    struct {
        pbr_item item;
        uint64_t later;
    } items[2];
    struct {
        pbr_frame frame;
        uint64_t later;
    } frame = {make_frame(), 0};
    open_target(&target);
    pbr_points *sets[2] = {points_of(host, 100, 1), points_of(host, 100, 2)};
    pbr_item plain[2] = {make_item(sets[0]), make_item(sets[1])};
    plain[1].id = 1;
    draw(host, &target, plain, 2, wanted, NULL);
    for (int i = 0; i < 2; i++) {
        items[i].item = plain[i];
        items[i].item.struct_size = sizeof(items[i]);
        items[i].later = 0;
    }
    frame.frame.struct_size = sizeof(frame);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    render(host, &frame.frame, &items[0].item, 2);
    target_read(&target, got);
    assert_memory_equal(wanted, got, sizeof(wanted));
    items[1].later = 1;
    expect_refused(host, &frame.frame, &items[0].item, 2, PBR_ERROR_INVALID_ARGUMENT, "an unknown member of an item");
    items[1].later = 0;
    frame.later = 1;
    expect_refused(host, &frame.frame, &items[0].item, 2, PBR_ERROR_INVALID_ARGUMENT, "an unknown member of the frame");
    pbr_points_release(&sets[0]);
    pbr_points_release(&sets[1]);
    close_target(&target);
}

static void nothing_to_draw_draws_nothing(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_points *empty = NULL, *points = points_of(host, 100, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    open_target(&target);
    assert_int_equal(pbr_points_create(host->instance, &desc, &empty), PBR_OK);
    pbr_item items[2] = {make_item(empty), make_item(points)};
    items[1].flags = PBR_ITEM_HIDDEN;
    draw(host, &target, NULL, 0, pixels, NULL);
    assert_true(is_empty((const uint8_t(*)[4])pixels));
    draw(host, &target, items, 2, pixels, NULL);
    assert_true(is_empty((const uint8_t(*)[4])pixels));
    pbr_points_release(&empty);
    pbr_points_release(&points);
    close_target(&target);
}

/* ---- The host's own errors ---- */

static void an_error_of_the_hosts_is_handed_over_or_left(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_stats stats = PBR_STATS_INIT;
    pbr_frame frame = make_frame();
    open_target(&target);
    pbr_points *points = points_of(host, 100, 1);
    pbr_item item = make_item(points);
    glEnable(GL_RGBA);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, &stats), PBR_OK); /* allocates, so it asks for errors */
    assert_int_equal(stats.host_gl_error, GL_INVALID_ENUM);
    assert_int_equal(glGetError(), 0);
    glEnable(GL_RGBA);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, &stats), PBR_OK); /* allocates nothing */
    assert_int_equal(stats.host_gl_error, 0);
    assert_int_equal(glGetError(), GL_INVALID_ENUM);
    context_forget_errors();
    pbr_points_release(&points);
    close_target(&target);
}

/* ---- Threads ---- */

struct thread {
    enum headless_kind kind;
    const char *error;
    uint8_t first[PIXELS][4], pixels[PIXELS][4];
};

static const char *draw_in_own_context(struct thread *thread) {
    pbr_instance *instance = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    pbr_points *points = NULL;
    struct target target;
    pbr_renderer_desc desc = host_renderer_desc();
    pbr_frame frame = make_frame();
    if (!target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0)) return "no target";
    target_bind(&target);
    if (pbr_instance_create(NULL, &instance)) return "no instance";
    if (make_points(instance, 5000, 3, &points)) return "no points";
    if (pbr_renderer_create(instance, &desc, &renderer)) return "no renderer";
    if (pbr_view_create(renderer, NULL, &view)) return "no view";
    pbr_item item = make_item(points);
    for (int i = 0; i < 10; i++) {
        const float nothing[4] = {0, 0, 0, 0};
        const float depth = 1;
        glClearBufferfv(GL_COLOR, 0, nothing);
        glClearBufferfv(GL_DEPTH, 0, &depth);
        if (i % 3 == 2) pbr_renderer_evict(renderer, NULL);
        if (pbr_render(view, &frame, &item, 1, NULL)) return "pbr_render failed";
        glReadPixels(0, 0, SIZE, SIZE, GL_RGBA, GL_UNSIGNED_BYTE, i ? thread->pixels : thread->first);
        if (i && memcmp(thread->first, thread->pixels, sizeof(thread->first))) return "the picture changes";
    }
    pbr_view_destroy(&view);
    if (pbr_renderer_destroy(&renderer)) return "the renderer stays";
    pbr_points_release(&points);
    if (pbr_instance_destroy(&instance)) return "the instance stays";
    target_destroy(&target);
    return glGetError() ? "an OpenGL error" : NULL;
}

static void *run_thread(void *user) {
    struct thread *thread = user;
    struct headless own;
    thread->error = headless_create(&own, thread->kind, false);
    if (thread->error) return NULL;
    thread->error = draw_in_own_context(thread);
    headless_destroy(&own);
    return NULL;
}

static void two_renderers_in_two_threads_do_not_meet(void **state) {
    (void)state;
    pthread_t handles[2];
    struct thread *threads = calloc(2, sizeof(*threads));
    assert_non_null(threads);
    for (int i = 0; i < 2; i++) {
        threads[i].kind = context_kind();
        assert_int_equal(pthread_create(&handles[i], NULL, run_thread, &threads[i]), 0);
    }
    for (int i = 0; i < 2; i++) pthread_join(handles[i], NULL);
    for (int i = 0; i < 2; i++)
        if (threads[i].error) fail_msg("thread %d: %s", i, threads[i].error);
    assert_memory_equal(threads[0].first, threads[1].first, sizeof(threads[0].first));
    assert_false(is_empty((const uint8_t(*)[4])threads[0].first));
    free(threads);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(every_allocation_may_fail_alone),
        GL_TEST(memory_may_run_out_anywhere),
        GL_TEST(a_failed_frame_can_be_drawn_again),
        GL_TEST(steady_state_allocates_compiles_and_uploads_nothing),
        GL_TEST(only_functions_of_the_version_are_asked_for),
        GL_TEST(functions_are_looked_up_only_at_creation),
        GL_TEST(each_missing_function_is_named_or_not_needed),
        GL_TEST(libepoxy_is_the_default_lookup),
        GL_TEST(without_a_context_no_renderer_is_made),
        GL_TEST(an_abandoned_renderer_makes_no_gl_call),
        GL_TEST(an_abandoned_renderer_is_destroyed_without_a_context),
        GL_TEST(destroying_deletes_every_gl_object),
        GL_TEST(an_incomplete_target_is_an_error),
        GL_TEST(what_has_children_is_busy),
        GL_TEST(drawn_points_live_until_evicted),
        GL_TEST(the_budget_drops_what_was_drawn_longest_ago),
        GL_TEST(what_a_frame_draws_must_fit_the_budget),
        GL_TEST(limits_are_errors_that_name_them),
        GL_TEST(arguments_outside_their_contract_are_refused),
        GL_TEST(longer_structures_are_read_when_their_rest_is_zero),
        GL_TEST(nothing_to_draw_draws_nothing),
        GL_TEST(an_error_of_the_hosts_is_handed_over_or_left),
        GL_TEST(two_renderers_in_two_threads_do_not_meet),
    };
    return RUN_GL_TESTS("failures", tests);
}
