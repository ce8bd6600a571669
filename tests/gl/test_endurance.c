/* What libpbr makes it takes back, however often, and renderers side by side do not meet.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SIZE = 64, PIXELS = SIZE * SIZE, POINTS = 200 };

#if defined(__SANITIZE_ADDRESS__)
#define SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif
#ifndef SANITIZED
#define SANITIZED 0
#endif

/* Under a sanitizer a cycle takes some ten times as long, and a lost block is found after one cycle as well as after ten thousand:
 * 500 are enough there, and in all contexts but one. PBR_TEST_SLOW asks for all. */
static int cycle_count(void) {
    const char *slow = getenv("PBR_TEST_SLOW");
    if (slow && *slow) return 10000;
    return !SANITIZED && context_kind() == HEADLESS_GL_45 ? 10000 : 500;
}

static pbr_frame make_frame(void) {
    pbr_frame frame = PBR_FRAME_INIT;
    frame.flags = PBR_FRAME_WAIT;
    matrix_perspective(1, 1, 0.5, 20, frame.projection);
    matrix_translation(0, 0, -4, frame.view);
    frame.viewport[2] = frame.viewport[3] = SIZE;
    return frame;
}

/* A ball of points with normals and colours; the seed tells sets apart. NULL if there is no memory. */
static pbr_points *make_points(pbr_instance *instance, uint64_t seed) {
    float positions[POINTS][3];
    pbr_points *points = NULL;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)random_between(&seed, -1, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = desc.normals = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.1f;
    return pbr_points_create(instance, &desc, &points) == PBR_OK ? points : NULL;
}

/* ---- Again and again ---- */

/* Objects that exist, counted up to a name that was never given out before: drivers give out each name once, or the lowest free
 * one. */
#define COUNT_KIND(count, kind, make, drop)                                                                                        \
    do {                                                                                                                           \
        GLuint top = 0;                                                                                                            \
        make;                                                                                                                      \
        for (GLuint name = 1; name < top + 100; name++) count += glIs##kind(name);                                                 \
        count -= glIs##kind(top);                                                                                                  \
        drop;                                                                                                                      \
    } while (0)

static long count_objects(void) {
    long count = 0;
    COUNT_KIND(count, Buffer, glGenBuffers(1, &top), glDeleteBuffers(1, &top));
    COUNT_KIND(count, Texture, glGenTextures(1, &top), glDeleteTextures(1, &top));
    COUNT_KIND(count, VertexArray, glGenVertexArrays(1, &top), glDeleteVertexArrays(1, &top));
    COUNT_KIND(count, Framebuffer, glGenFramebuffers(1, &top), glDeleteFramebuffers(1, &top));
    COUNT_KIND(count, Renderbuffer, glGenRenderbuffers(1, &top), glDeleteRenderbuffers(1, &top));
    COUNT_KIND(count, Sampler, glGenSamplers(1, &top), glDeleteSamplers(1, &top));
    COUNT_KIND(count, Query, glGenQueries(1, &top), glDeleteQueries(1, &top));
    COUNT_KIND(count, Program, top = glCreateProgram(), glDeleteProgram(top));
    COUNT_KIND(count, Shader, top = glCreateShader(GL_VERTEX_SHADER), glDeleteShader(top));
    return count;
}

/* KiB of the process that are in memory. */
static long resident_size(void) {
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%*d %ld", &pages), 1);
    fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

/* A host that opens and closes a view of points: each kind of splat in turn. */
static void live_once(struct host *host, int cycle) {
    const uint32_t splats[3] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_SQUARE, PBR_SPLAT_ELLIPSE};
    pbr_renderer_desc desc = host_renderer_desc();
    pbr_frame frame = make_frame();
    pbr_points *points = make_points(host->instance, (uint64_t)cycle);
    pbr_lod *lod = NULL;
    assert_non_null(points);
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    item.splat = splats[cycle % 3];
    if (cycle % 20 == 7) { /* compiles six programs */
        item.splat = cycle % 40 == 7 ? PBR_SPLAT_GAUSSIAN : PBR_SPLAT_EWA;
        item.shading = cycle % 80 == 7 ? PBR_SHADE_DEFERRED : PBR_SHADE_PHONG;
    }
    if (cycle % 80 == 17) item.blending = PBR_BLEND_FILL;
    if (cycle % 20 == 3) {
        pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
        lod_desc.points = points;
        assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
        item.points = NULL;
        item.lod = lod;
    }
    host_use_renderer(host, &desc);
    for (int i = 0; i < (lod ? 4 : 1); i++) { /* a hierarchy's buffers take turns */
        frame.view[14] -= 0.1;
        pbr_stats stats = render(host, &frame, &item, 1);
        assert_int_equal(stats.points, POINTS);
    }
    host_drop_renderer(host);
    pbr_points_release(&points);
    pbr_lod_release(&lod);
}

/* Mesa's software renderer keeps the machine code of the last thousand shader variants, so that memory grows for some 4,000 cycles,
 * also of a program without libpbr; from then on it goes up and down by 5 MiB. A leak of 2 KiB a cycle is more than this. */
enum { SLACK_KIB = 8192 };

static void ten_thousand_lives_leave_nothing(void **state) {
    struct host *host = *state;
    struct target target;
    int cycles = cycle_count(), warm_up = cycles / 2;
    assert_true(target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    target_bind(&target);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    host_drop_renderer(host);
    live_once(host, 0);
    size_t blocks = host->memory.blocks;
    long objects = count_objects(), before = 0;
    for (int i = 0; i < cycles; i++) {
        if (i == warm_up) before = resident_size();
        live_once(host, i);
        assert_int_equal(host->memory.blocks, blocks);
    }
    glFinish();
    long grown = resident_size() - before;
    assert_int_equal(count_objects(), objects);
    printf("%d cycles: resident memory grew by %ld KiB after the first %d\n", cycles, grown, warm_up);
    /* A sanitizer keeps freed memory for a while. */
    if (!SANITIZED && grown > SLACK_KIB) fail_msg("%ld KiB more in %d cycles", grown, cycles - warm_up);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

/* ---- Side by side ---- */

/* What a thread draws, in a context of its own, with points that the other thread draws too. */
struct scene {
    enum headless_kind kind;
    pbr_instance *instance;
    const pbr_points *common;
    uint32_t splat;
    double turn;
    uint64_t seed;
    const char *error;
    uint8_t pixels[PIXELS][4]; /* of the first frame; all others must be the same */
};

static const char *draw_frames(struct scene *scene, pbr_view *view, pbr_renderer *renderer, const pbr_points *own) {
    const float nothing[4] = {0, 0, 0, 0}, far = 1;
    static const double axis[3] = {0, 1, 0};
    double model[16];
    uint8_t pixels[PIXELS][4];
    pbr_frame frame = make_frame();
    pbr_item items[2] = {PBR_ITEM_INIT, PBR_ITEM_INIT};
    matrix_rotation(axis, scene->turn, model);
    for (int i = 0; i < 2; i++) {
        items[i].id = (uint64_t)i;
        items[i].points = i ? own : scene->common;
        items[i].splat = scene->splat;
        items[i].transforms = model;
        items[i].transform_count = 1;
    }
    for (int i = 0; i < 20; i++) {
        glClearBufferfv(GL_COLOR, 0, nothing);
        glClearBufferfv(GL_DEPTH, 0, &far);
        if (i % 3 == 2) pbr_renderer_evict(renderer, NULL);
        if (pbr_render(view, &frame, items, 2, NULL)) return "pbr_render failed";
        glReadPixels(0, 0, SIZE, SIZE, GL_RGBA, GL_UNSIGNED_BYTE, i ? pixels : scene->pixels);
        if (i && memcmp(scene->pixels, pixels, sizeof(pixels))) return "the picture changes";
    }
    return NULL;
}

static const char *draw_scene(struct scene *scene) {
    struct target target;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    pbr_renderer_desc desc = host_renderer_desc();
    if (!target_create(&target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT24, 0)) return "no target";
    target_bind(&target);
    pbr_points *own = make_points(scene->instance, scene->seed);
    if (!own) return "no points";
    if (pbr_renderer_create(scene->instance, &desc, &renderer)) return "no renderer";
    if (pbr_view_create(renderer, NULL, &view)) return "no view";
    const char *error = draw_frames(scene, view, renderer, own);
    pbr_view_destroy(&view);
    if (pbr_renderer_destroy(&renderer)) return "the renderer stays";
    pbr_points_release(&own);
    target_destroy(&target);
    return error ? error : glGetError() ? "an OpenGL error" : NULL;
}

static void *run_scene(void *user) {
    struct scene *scene = user;
    struct headless own;
    scene->error = headless_create(&own, scene->kind, false);
    if (scene->error) return NULL;
    scene->error = draw_scene(scene);
    headless_destroy(&own);
    return NULL;
}

/* Runs scenes at once, each in its thread. */
static void run_scenes(struct scene *scenes, int count) {
    pthread_t threads[2];
    for (int i = 0; i < count; i++) assert_int_equal(pthread_create(&threads[i], NULL, run_scene, &scenes[i]), 0);
    for (int i = 0; i < count; i++) pthread_join(threads[i], NULL);
    for (int i = 0; i < count; i++)
        if (scenes[i].error) fail_msg("scene %d: %s", i, scenes[i].error);
}

/* Of one instance, and with points in common. */
static void scenes_drawn_side_by_side_look_as_alone(void **state) {
    struct host *host = *state;
    struct scene *alone = calloc(2, sizeof(*alone)), *together = calloc(2, sizeof(*together));
    assert_true(alone && together);
    pbr_points *common = make_points(host->instance, 1);
    for (int i = 0; i < 2; i++) {
        alone[i].kind = context_kind();
        alone[i].instance = host->instance;
        alone[i].common = common;
        alone[i].splat = i ? PBR_SPLAT_SQUARE : PBR_SPLAT_CIRCLE;
        alone[i].turn = 1 + i;
        alone[i].seed = (uint64_t)i + 2;
        together[i] = alone[i];
    }
    run_scenes(&alone[0], 1);
    run_scenes(&alone[1], 1);
    run_scenes(together, 2);
    for (int i = 0; i < 2; i++) assert_memory_equal(alone[i].pixels, together[i].pixels, sizeof(alone[i].pixels));
    assert_memory_not_equal(alone[0].pixels, alone[1].pixels, sizeof(alone[0].pixels));
    pbr_points_release(&common);
    free(alone);
    free(together);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(ten_thousand_lives_leave_nothing),
        GL_TEST(scenes_drawn_side_by_side_look_as_alone),
    };
    return RUN_GL_TESTS("endurance", tests);
}
