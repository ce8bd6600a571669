/* PBR_FRAME_OCCLUSION: what earlier pictures hid costs less, and no picture that stays shows it.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { SIZE = 128, PIXELS = SIZE * SIZE, POINTS = 12000, SETTLED = 12 /* frames, more than it takes */ };

typedef uint8_t picture[PIXELS][4];

/* A closed sphere: points spread evenly along a spiral, whose discs overlap. */
static pbr_lod *make_sphere(struct host *host) {
    static float positions[POINTS][3], radii[POINTS];
    pbr_points *points = NULL;
    pbr_lod *lod = NULL;
    for (int i = 0; i < POINTS; i++) {
        const double height = 1 - (2 * i + 1) / (double)POINTS, around = 2.39996322972865 * i, width = sqrt(1 - height * height);
        positions[i][0] = (float)(width * cos(around));
        positions[i][1] = (float)height;
        positions[i][2] = (float)(width * sin(around));
        radii[i] = 0.024f; /* the mean distance of neighbours is 0.032 */
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = desc.colours = desc.normals = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    lod_desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
    pbr_points_release(&points);
    return lod;
}

static pbr_frame make_frame(double distance) {
    pbr_frame frame = turned_frame(0, distance, 0.2, 9, SIZE);
    frame.flags |= PBR_FRAME_OCCLUSION;
    frame.threshold = 1;
    return frame;
}

static bool open_target(struct target *target, GLenum depth, int samples) {
    if (!target_create(target, SIZE, SIZE, GL_RGBA8, depth, samples)) return false;
    target_bind(target);
    return true;
}

/* Behind a wall of the host's at this window depth. */
static pbr_stats draw_behind(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *items,
                             size_t count, float wall, picture pixels) {
    static const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    target_clear(target, (const float[4]){0, 0, 0, 0}, 1);
    glViewport(0, 0, SIZE, SIZE);
    glEnable(GL_DEPTH_TEST);
    draw_host_quad(wall, grey);
    glDisable(GL_DEPTH_TEST);
    const pbr_stats stats = render(host, frame, items, count);
    target_read(target, pixels);
    return stats;
}

static pbr_frame without(const pbr_frame *frame) {
    pbr_frame other = *frame;
    other.flags = (other.flags & ~(uint32_t)PBR_FRAME_OCCLUSION) | PBR_FRAME_WAIT;
    return other;
}

/* Each frame shows what is seen without the flag; in the end there is less to draw, and then nothing to do. (Filled splats reach so
 * far that in a picture this small none is hidden.) */
static void expect_same_for_less(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *item,
                                 const char *what) {
    static picture wanted, got;
    const pbr_frame plain = without(frame);
    const pbr_stats all = draw_picture(host, target, &plain, item, 1, wanted);
    pbr_stats stats = all;
    assert_int_equal(all.nodes_hidden, 0);
    for (int i = 0; i < SETTLED; i++) {
        stats = draw_picture(host, target, frame, item, 1, got);
        if (memcmp(wanted, got, sizeof wanted) != 0) fail_msg("%s: frame %d shows something else", what, i);
    }
    if (item->blending != PBR_BLEND_FILL && !(stats.nodes_hidden > 0 && stats.splats_drawn < all.splats_drawn))
        fail_msg("%s, splat %u: nothing was hidden; %llu splats of %llu", what, (unsigned)item->splat,
                 (unsigned long long)stats.splats_drawn, (unsigned long long)all.splats_drawn);
    assert_int_equal(stats.is_final, 1);
    const size_t allocations = host->memory.allocations;
    for (int i = 0; i < 8; i++) {
        stats = draw_picture(host, target, frame, item, 1, got);
        assert_int_equal(stats.nodes_visited, 0);
        assert_int_equal(stats.upload_bytes, 0);
        assert_int_equal(stats.is_final, 1);
    }
    assert_int_equal(host->memory.allocations, allocations);
}

static void what_is_hidden_is_not_seen_with_any_kind(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_lod *lod = make_sphere(host);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++)
        for (int fills = 0; fills < (splat <= PBR_SPLAT_ELLIPSE ? 2 : 1); fills++) {
            pbr_item item = lod_item(lod, splat);
            pbr_frame frame = make_frame(2.5);
            item.blending = fills ? PBR_BLEND_FILL : PBR_BLEND_KIND;
            item.radius_scale = 1.4f; /* a closed surface of any kind */
            expect_same_for_less(host, &target, &frame, &item, fills ? "filled" : "kind");
        }
    pbr_lod_release(&lod);
    target_close(&target);
}

static void it_works_with_any_camera(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT32F, 0));
    pbr_frame frame = make_frame(1.7); /* partly outside */
    expect_same_for_less(host, &target, &frame, &item, "near");
    matrix_ortho(-1.2, 1.2, -1.2, 1.2, 0.5, 9, frame.projection);
    expect_same_for_less(host, &target, &frame, &item, "orthographic");
    frame = make_frame(2.5);
    frame.depth_range[0] = 0.25f, frame.depth_range[1] = 0.75f;
    expect_same_for_less(host, &target, &frame, &item, "depth range");
    frame = make_frame(2.5);
    frame.jitter[0] = 0.4, frame.jitter[1] = -0.3;
    expect_same_for_less(host, &target, &frame, &item, "jitter");
    frame = make_frame(2.5);
    frame_set_viewport(&frame, 30, 11, SIZE - 30, SIZE - 40);
    expect_same_for_less(host, &target, &frame, &item, "viewport");
    for (int upper = 0; upper < 2; upper++) {
        frame = make_frame(2.5);
        matrix_zero_to_one(frame.projection, true);
        frame.flags |= PBR_FRAME_REVERSED_Z | PBR_FRAME_CLIP_ZERO_TO_ONE | (upper ? PBR_FRAME_CLIP_UPPER_LEFT : 0u);
        expect_same_for_less(host, &target, &frame, &item, "reversed");
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

static void it_works_with_any_depth_format(void **state) {
    struct host *host = *state;
    static const GLenum formats[] = {GL_DEPTH_COMPONENT16, GL_DEPTH_COMPONENT24, GL_DEPTH24_STENCIL8, GL_DEPTH_COMPONENT32F};
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    const pbr_frame frame = make_frame(2.5);
    for (int i = 0; i < 4; i++) {
        struct target target;
        assert_true(open_target(&target, formats[i], 0));
        expect_same_for_less(host, &target, &frame, &item, "format");
        target_close(&target);
    }
    pbr_lod_release(&lod);
}

/* As if it was not asked for. */
static void targets_that_cannot_be_copied_are_left_alone(void **state) {
    struct host *host = *state;
    static picture pixels;
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int i = 0; i < 5; i++) {
        struct target target;
        pbr_frame frame = make_frame(2.5);
        pbr_stats stats = PBR_STATS_INIT;
        assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0)); /* where it works before */
        for (int n = 0; n < SETTLED; n++) stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        assert_true(stats.nodes_hidden > 0);
        target_close(&target);
        if (!open_target(&target, i == 0 ? 0 : GL_DEPTH_COMPONENT24, i == 1 ? 4 : 0)) continue;
        if (i == 2) frame.flags |= PBR_FRAME_NO_DEPTH_WRITE;
        if (i == 3) frame.flags |= PBR_FRAME_NO_DEPTH_TEST;
        if (i == 4) frame.depth_function = GL_ALWAYS;
        for (int n = 0; n < SETTLED; n++) stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        assert_int_equal(stats.nodes_hidden, 0);
        assert_int_equal(stats.is_final, 1);
        target_close(&target);
        pbr_renderer_evict(host->renderer, NULL);
    }
    pbr_lod_release(&lod);
}

/* A coarse splat may lack single pixels of an outline: a fine one that lies within it is drawn a pixel wide all the same. */
enum { FEW = PIXELS / 1000 };

/* Pixels that the one covers and the other does not. */
static int count_missing(picture wanted, picture got) {
    int missing = 0;
    for (int i = 0; i < PIXELS; i++) missing += wanted[i][3] > 0 && got[i][3] == 0;
    return missing;
}

static void the_hosts_wall_hides_and_what_is_behind_comes_back(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, walled, got;
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    const pbr_frame frame = make_frame(3.2), plain = without(&frame);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    const pbr_stats all = draw_picture(host, &target, &plain, &item, 1, wanted);
    draw_behind(host, &target, &plain, &item, 1, 0.1f, walled);
    assert_int_equal(walled[PIXELS / 2][0], walled[0][0]); /* of the sphere nothing shows */
    assert_true(walled[0][3] > 0);
    pbr_stats stats = all;
    for (int i = 0; i < SETTLED; i++) {
        stats = draw_behind(host, &target, &frame, &item, 1, 0.1f, got);
        assert_memory_equal(walled, got, sizeof got);
    }
    assert_true(stats.nodes_hidden > 0 && stats.splats_drawn < all.splats_drawn / 4);
    assert_int_equal(stats.is_final, 1);
    int coarse = 0;
    for (int i = 0; i < SETTLED; i++) { /* never a hole; coarse for a few frames, which are not the last word */
        stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_true(count_missing(wanted, got) <= FEW);
        if (memcmp(wanted, got, sizeof got) == 0) continue;
        assert_int_equal(coarse++, i);
    }
    assert_true(coarse > 0 && coarse <= 3); /* drawn; reduced; read, and cut again */
    assert_int_equal(stats.is_final, 1);
    assert_memory_equal(wanted, got, sizeof got);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Two spheres, one before the other, that change places. */
static void things_that_move_hide_each_other_by_turns(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    pbr_lod *lod = make_sphere(host);
    double models[2][16];
    const pbr_frame frame = make_frame(4), plain = without(&frame);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    item.transforms = models[0];
    item.transform_count = 2;
    pbr_stats stats = PBR_STATS_INIT;
    for (int turn = 0; turn < 6; turn++) {
        matrix_translation(0.2, 0.1, turn % 2 ? 1 : -1, models[0]);
        matrix_translation(-0.2, 0, turn % 2 ? -1 : 1, models[1]);
        for (int i = 0; i < SETTLED; i++) {
            stats = draw_picture(host, &target, &frame, &item, 1, got);
            if (i == 0) draw_picture(host, &target, &plain, &item, 1, wanted);
            assert_memory_equal(wanted, got, sizeof got); /* they wait: not even the first one is of what was before */
        }
        assert_memory_equal(wanted, got, sizeof got);
        assert_int_equal(stats.is_final, 1);
        assert_true(stats.nodes_hidden > 0);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A wall of points that libpbr draws itself goes: no picture that is final shows what was hidden by it. */
static void what_items_hid_is_not_final_when_they_go(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted[2], got;
    static const double front[3] = {0, 0, 2};
    host_use_threads(host, 2);
    pbr_points *wall = one_point(host, front, 30);
    pbr_lod *lod = make_sphere(host);
    pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), plain_item(wall, PBR_SPLAT_SQUARE)};
    pbr_frame frame = make_frame(3.2);
    double unturned[16];
    matrix_identity(unturned);
    memcpy(frame.view, unturned, sizeof unturned);
    frame.view[14] = -3.2;
    const pbr_frame plain = without(&frame);
    items[1].id = 2;
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    for (int gone = 0; gone < 2; gone++) {
        items[1].flags = gone ? PBR_ITEM_HIDDEN : 0u;
        draw_picture(host, &target, &plain, items, 2, wanted[gone]);
    }
    frame.flags &= ~(uint32_t)PBR_FRAME_WAIT;
    uint64_t most = 0;
    for (int turn = 0; turn < 6; turn++) {
        items[1].flags = turn % 2 ? PBR_ITEM_HIDDEN : 0u;
        for (int i = 0; i < 200; i++) {
            const pbr_stats stats = draw_picture(host, &target, &frame, items, 2, got);
            if (stats.is_final) assert_memory_equal(wanted[turn % 2], got, sizeof got);
            if (stats.nodes_hidden > most) most = stats.nodes_hidden;
            nanosleep(&(struct timespec){0, 200000}, NULL);
        }
        assert_memory_equal(wanted[turn % 2], got, sizeof got);
    }
    assert_true(most > 0);
    pbr_lod_release(&lod);
    pbr_points_release(&wall);
    target_close(&target);
}

/* A picture that is shifted a little each time hides as the others do, and nothing is cut again for that. */
static void jitter_does_not_expose(void **state) {
    struct host *host = *state;
    struct target target;
    static picture got;
    static const double shifts[][2] = {{0.25, -0.25}, {-0.4, 0.1}, {0, 0.45}, {0.1, 0.3}};
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_frame frame = make_frame(2.5);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    pbr_stats stats = PBR_STATS_INIT;
    uint64_t visited = 0;
    for (int i = 0; i < 60; i++) {
        memcpy(frame.jitter, shifts[i % 4], sizeof frame.jitter);
        stats = draw_picture(host, &target, &frame, &item, 1, got);
        if (i >= SETTLED) visited += stats.nodes_visited;
    }
    assert_true(stats.nodes_hidden > 0);
    assert_int_equal(stats.is_final, 1);
    assert_int_equal(visited, 0);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Splats parallel to the screen stay round where the model is stretched. */
static void a_stretched_model_hides_as_it_is_drawn(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    double models[4][16];
    pbr_lod *lod = make_sphere(host);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT32F, 0));
    matrix_scaling(4, 0.4, 0.4, models[0]);
    matrix_scaling(0.3, 1.1, 0.3, models[1]);
    matrix_scaling(-1, 1, 1, models[2]);
    matrix_scaling(0.9, 0.2, 1.4, models[3]);
    for (int m = 0; m < 4; m++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_ELLIPSE; splat++)
            for (int least = 0; least < 2; least++) {
                const pbr_frame frame = make_frame(3), plain = without(&frame);
                pbr_item item = lod_item(lod, splat);
                item.transforms = models[m];
                item.transform_count = 1;
                item.size_minimum = least ? 12 : 0;
                draw_picture(host, &target, &plain, &item, 1, wanted);
                for (int i = 0; i < SETTLED; i++) {
                    draw_picture(host, &target, &frame, &item, 1, got);
                    if (memcmp(wanted, got, sizeof got) != 0)
                        fail_msg("model %d, splat %u, least %d: frame %d", m, splat, least, i);
                }
            }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Frames that do not wait: whatever the motion, and whatever was hidden on the way, the last picture is right. */
static void refined_pictures_become_right(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    static const double axis[3] = {0.1, 1, 0};
    host_use_threads(host, 2);
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    for (int turn = 0; turn < 3; turn++) {
        pbr_frame frame = make_frame(2.5);
        pbr_stats stats = PBR_STATS_INIT;
        frame.flags &= ~(uint32_t)PBR_FRAME_WAIT;
        for (int i = 0; i < 30; i++) {
            matrix_rotation(axis, 0.02 * i + turn, frame.view);
            frame.view[14] = -2.5 + 0.02 * i;
            stats = draw_picture(host, &target, &frame, &item, 1, got);
        }
        for (int i = 0; i < 5000; i++) {
            stats = draw_picture(host, &target, &frame, &item, 1, got);
            if (stats.is_final && stats.nodes_hidden > 0) break;
            nanosleep(&(struct timespec){0, 1000000}, NULL);
        }
        assert_true(stats.is_final && stats.nodes_hidden > 0);
        const pbr_frame plain = without(&frame);
        draw_picture(host, &target, &plain, &item, 1, wanted);
        assert_memory_equal(wanted, got, sizeof got);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Pictures of other sizes, eviction and the flag's coming and going in between. */
static void what_was_known_is_forgotten_without_harm(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    pbr_lod *lod = make_sphere(host);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_renderer_info before = PBR_RENDERER_INFO_INIT, after = PBR_RENDERER_INFO_INIT;
    assert_true(open_target(&target, GL_DEPTH_COMPONENT24, 0));
    for (int i = 0; i < 24; i++) {
        pbr_frame frame = make_frame(2.5);
        frame.viewport[2] = i % 5 == 0 ? 33 : i % 7 == 0 ? 1 : SIZE;
        if (i % 6 == 0) frame.flags &= ~(uint32_t)PBR_FRAME_OCCLUSION;
        draw_picture(host, &target, &frame, &item, 1, got);
        if (i % 11 == 0) pbr_renderer_evict(host->renderer, NULL);
        const pbr_frame plain = without(&frame);
        if (i % 3 == 0) { /* it has its say on what is drawn next, too */
            draw_picture(host, &target, &plain, &item, 1, wanted);
            assert_memory_equal(wanted, got, sizeof got);
        }
    }
    assert_int_equal(pbr_renderer_get_info(host->renderer, &before), PBR_OK);
    pbr_renderer_evict(host->renderer, NULL);
    assert_int_equal(pbr_renderer_get_info(host->renderer, &after), PBR_OK);
    assert_int_equal(after.gpu_memory_bytes, 0);
    assert_true(after.gpu_object_count < before.gpu_object_count);
    pbr_lod_release(&lod);
    target_close(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(what_is_hidden_is_not_seen_with_any_kind),
        GL_TEST(it_works_with_any_camera),
        GL_TEST(it_works_with_any_depth_format),
        GL_TEST(targets_that_cannot_be_copied_are_left_alone),
        GL_TEST(the_hosts_wall_hides_and_what_is_behind_comes_back),
        GL_TEST(things_that_move_hide_each_other_by_turns),
        GL_TEST(what_items_hid_is_not_final_when_they_go),
        GL_TEST(jitter_does_not_expose),
        GL_TEST(a_stretched_model_hides_as_it_is_drawn),
        GL_TEST(refined_pictures_become_right),
        GL_TEST(what_was_known_is_forgotten_without_harm),
    };
    return RUN_GL_TESTS("occlusion", tests);
}
