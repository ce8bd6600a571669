/* Frames that do not wait for cuts, and frames with a time budget: what they draw in the end is what a frame that waits draws.
 * SPDX-License-Identifier: MIT */
#include "ball.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PATIENCE = 20000 /* frames, a millisecond apart: a test that would hang fails */ };

static void nap(void) {
    nanosleep(&(struct timespec){0, 1000000}, NULL);
}

/* A renderer that knows nothing yet. */
static void renew(struct host *host) {
    const pbr_renderer_desc desc = host_renderer_desc();
    host_use_renderer(host, &desc);
}

/* A host that lets the renderer have a thread. */
static struct host *start(void **state) {
    host_use_threads(*state, 2);
    return *state;
}

static pbr_frame refined_frame(int turn) {
    pbr_frame frame = make_frame(turn);
    frame.flags &= ~(uint32_t)PBR_FRAME_WAIT;
    return frame;
}

/* Draws on until the picture is final; how many frames that took. */
static int draw_until_final(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *items,
                            size_t count, uint8_t (*pixels)[4]) {
    for (int n = 1; n <= PATIENCE; n++) {
        if (draw_picture(host, target, frame, items, count, pixels).is_final) return n;
        nap();
    }
    fail_msg("no picture is final");
    return 0;
}

static const uint32_t splats[] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE, PBR_SPLAT_EWA};
enum { SPLATS = sizeof splats / sizeof splats[0] };

/* Items of each kind, and one three times. */
static void make_items(const pbr_lod *lod, const double (*models)[16], pbr_item items[SPLATS + 1]) {
    for (int i = 0; i < SPLATS + 1; i++) {
        items[i] = lod_item(lod, splats[i % SPLATS]);
        items[i].id = (uint64_t)i;
        items[i].transforms = models[i];
        items[i].transform_count = i < SPLATS ? 1 : 3;
    }
}

static void make_models(double models[SPLATS + 3][16]) {
    for (int i = 0; i < SPLATS + 3; i++) {
        matrix_scaling(0.4, 0.4, 0.4, models[i]);
        models[i][12] = i % 3 - 1;
        models[i][13] = 0.4 * i - 1;
    }
}

/* ---- Without waiting ---- */

static void the_final_picture_is_that_of_a_frame_that_waits(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    double models[SPLATS + 3][16];
    pbr_item items[SPLATS + 1];
    static const float thresholds[] = {PBR_THRESHOLD_LEAVES, 2, 10};
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 31);
    make_models(models);
    make_items(lod, (const double(*)[16])models, items);
    for (int t = 0; t < 3; t++) {
        pbr_frame frame = make_frame(t);
        frame.threshold = thresholds[t];
        pbr_stats stats = draw_picture(host, &target, &frame, items, SPLATS + 1, wanted);
        assert_int_equal(stats.is_final, 1);
        assert_true(stats.threshold == fmaxf(thresholds[t], 0));
        renew(host);
        frame.flags = 0;
        stats = draw_picture(host, &target, &frame, items, SPLATS + 1, got);
        assert_int_equal(stats.is_final, 0);
        assert_int_equal(stats.splats_drawn, 0); /* nothing was finished before it was asked for */
        draw_until_final(host, &target, &frame, items, SPLATS + 1, got);
        assert_memory_equal(wanted, got, sizeof wanted);
        /* Then it costs nothing. */
        const size_t allocations = host->memory.allocations;
        for (int i = 0; i < 3; i++) {
            stats = draw_picture(host, &target, &frame, items, SPLATS + 1, got);
            assert_int_equal(stats.is_final, 1);
            assert_int_equal(stats.nodes_visited, 0);
            assert_int_equal(stats.upload_bytes, 0);
            assert_memory_equal(wanted, got, sizeof wanted);
        }
        assert_int_equal(host->memory.allocations, allocations);
        /* And a frame that waits has nothing left to do. */
        frame.flags = PBR_FRAME_WAIT;
        stats = draw_picture(host, &target, &frame, items, SPLATS + 1, got);
        assert_int_equal(stats.nodes_visited, 0);
        assert_memory_equal(wanted, got, sizeof wanted);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Frames show something all the time, and where the camera stops at last the picture is right. */
static void a_moving_camera_sees_something_and_comes_to_rest(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 32);
    for (int k = 0; k < SPLATS; k++) {
        pbr_item item = lod_item(lod, splats[k]);
        pbr_frame frame = refined_frame(0);
        draw_until_final(host, &target, &frame, &item, 1, got);
        for (int i = 1; i <= 60; i++) {
            static const double axis[3] = {0.2, 1, 0};
            matrix_rotation(axis, (i < 40 ? 0.01 : 0.3) * i, frame.view); /* slowly, then fast */
            frame.view[14] = -3.1;
            pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
            assert_true(stats.splats_drawn > 0);
            assert_true(covered_pixels(got, PIXELS) > PIXELS / 10);
            if (i % 4 == 0) nap();
        }
        draw_until_final(host, &target, &frame, &item, 1, got);
        frame.flags = PBR_FRAME_WAIT;
        pbr_renderer_evict(host->renderer, NULL);
        draw_picture(host, &target, &frame, &item, 1, wanted);
        assert_memory_equal(wanted, got, sizeof wanted);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A camera that leaps sees what it saw before from where it is now, until there is more. */
static void an_old_cut_is_drawn_from_where_the_camera_is(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 33);
    for (int k = 0; k < SPLATS; k++) {
        pbr_item item = lod_item(lod, splats[k]);
        pbr_frame far = make_frame(0), near = make_frame(5);
        near.view[14] = -2.2;
        draw_picture(host, &target, &near, &item, 1, wanted);
        near.flags = 0;
        renew(host);
        const uint64_t drawn = draw_picture(host, &target, &far, &item, 1, got).splats_drawn;
        assert_true(drawn > POINTS * 3 / 4 && drawn <= POINTS); /* the others lie between the pixels */
        const pbr_stats stats = draw_picture(host, &target, &near, &item, 1, got);
        assert_int_equal(stats.is_final, 0);
        assert_int_equal(stats.splats_drawn, POINTS); /* all, also those between the pixels there */
        int different = 0;                            /* at the border */
        for (int i = 0; i < PIXELS; i++) different += (wanted[i][3] > 127) != (got[i][3] > 127);
        assert_true(different <= PIXELS / 50);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A jittered camera rests: pictures differ, and nothing is cut for them. */
static void jitter_costs_nothing(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t first[PIXELS][4], got[PIXELS][4], wanted[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 34);
    for (int waits = 0; waits < 2; waits++) {
        pbr_frame frame = make_frame(0);
        pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
        item.id = 70 + (uint64_t)waits;
        frame.view[14] = -1.9; /* all sides of the picture are covered */
        frame.flags = waits ? PBR_FRAME_WAIT : 0;
        frame.jitter[0] = 0.3, frame.jitter[1] = -0.4;
        draw_until_final(host, &target, &frame, &item, 1, first);
        for (int i = 0; i < 5; i++) {
            frame.jitter[0] = i == 2 ? 0 : 0.2 * i - 0.5, frame.jitter[1] = i == 2 ? 0 : 0.45 - 0.2 * i; /* none as well */
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
            assert_int_equal(stats.is_final, 1);
            assert_int_equal(stats.nodes_visited, 0);
            assert_int_equal(stats.upload_bytes, 0);
            assert_memory_not_equal(first, got, sizeof got);
            pbr_view *view = NULL; /* a new one cuts for this frame */
            pbr_stats other = PBR_STATS_INIT;
            assert_int_equal(pbr_view_create(host->renderer, NULL, &view), PBR_OK);
            pbr_frame plain = frame;
            plain.flags = PBR_FRAME_WAIT;
            target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
            assert_int_equal(pbr_render(view, &plain, &item, 1, &other), PBR_OK);
            target_read(&target, wanted);
            assert_true(other.nodes_visited > 0);
            assert_memory_equal(wanted, got, sizeof got);
            pbr_view_destroy(&view);
        }
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Frames that wait, for another camera, come between: what is final stays so, and what is not becomes it. */
static void frames_that_wait_may_come_between(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[2][PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 40);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_frame frames[2] = {make_frame(0), make_frame(3)};
    for (int i = 0; i < 2; i++) draw_picture(host, &target, &frames[i], &item, 1, wanted[i]);
    renew(host);
    for (int way = 0; way < 3; way++) {
        pbr_frame here = frames[0], there = frames[1];
        here.flags = there.flags = 0;
        if (way < 2) draw_until_final(host, &target, &here, &item, 1, got);
        else draw_picture(host, &target, &here, &item, 1, got); /* it is being cut */
        if (way == 0) assert_int_equal(pbr_prepare(host->view, &there, &item, 1, NULL), PBR_OK);
        else draw_picture(host, &target, &frames[1], &item, 1, got);
        for (int i = 0; i < 20 && way > 0; i++) {
            assert_int_equal(draw_picture(host, &target, &there, &item, 1, got).is_final, 1);
            assert_memory_equal(wanted[1], got, sizeof got);
            nap();
        }
        draw_until_final(host, &target, &here, &item, 1, got);
        assert_memory_equal(wanted[0], got, sizeof got);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Of a host that keeps its matrices in floats, and has other views, which draw nothing here: a slow turn is cut now and then, not
 * in each frame, and drawn by points. */
static void a_slow_motion_costs_little(void **state) {
    enum { FRAMES = 120, OTHERS = 7 };
    struct host *host = start(state);
    struct target target;
    uint8_t got[PIXELS][4];
    pbr_view *others[OTHERS] = {NULL};
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 41);
    for (int i = 0; i < OTHERS; i++) assert_int_equal(pbr_view_create(host->renderer, NULL, &others[i]), PBR_OK);
    for (int k = 0; k < 2 * SPLATS; k++) {
        const bool with_others = k >= SPLATS;
        pbr_item item = lod_item(lod, splats[k % SPLATS]);
        pbr_frame frame = refined_frame(0);
        int uploads = 0;
        uint64_t drawn = 0, quads = 0;
        double model[16];
        matrix_scaling(0.37, 0.37, 0.37, model);
        item.transforms = model, item.transform_count = 1;
        frame.view[14] = -1.3;
        draw_until_final(host, &target, &frame, &item, 1, got);
        for (int i = 1; i <= FRAMES; i++) {
            static const double axis[3] = {0.2, 1, 0};
            matrix_rotation(axis, (with_others ? 0.015 : 0.003) * i, frame.view);
            frame.view[14] = -1.3;
            for (int m = 0; m < 16; m++) frame.view[m] = (double)(float)frame.view[m];
            for (int v = 0; v < OTHERS && with_others; v++) assert_int_equal(pbr_render(others[v], &frame, NULL, 0, NULL), PBR_OK);
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
            uploads += stats.upload_bytes > 0;
            drawn += stats.splats_drawn, quads += stats.splats_as_quads;
            nap();
        }
        assert_in_range(uploads, 1, FRAMES / 3); /* every sixth frame or so */
        assert_true(with_others || quads < drawn / 3);
    }
    for (int i = 0; i < OTHERS; i++) pbr_view_destroy(&others[i]);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* There is GPU memory for one view at a time: they take turns, and neither shows nothing. */
static void views_that_do_not_fit_together_do_not_blink(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[2][PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 42);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_frame frames[2] = {make_frame(0), make_frame(3)};
    for (int i = 0; i < 2; i++) draw_picture(host, &target, &frames[i], &item, 1, wanted[i]);
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = 24 * POINTS * 3 / 2;
    host_use_renderer(host, &desc);
    pbr_view *views[2] = {host->view, NULL};
    assert_int_equal(pbr_view_create(host->renderer, NULL, &views[1]), PBR_OK);
    for (int i = 0; i < 2; i++) frames[i].flags = 0;
    int finals = 0; /* in a row, of both */
    for (int n = 0; finals < 40; n++) {
        const int i = n % 2;
        pbr_stats stats = PBR_STATS_INIT;
        target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
        assert_int_equal(pbr_render(views[i], &frames[i], &item, 1, &stats), PBR_OK);
        target_read(&target, got);
        nap();
        assert_true(n < PATIENCE);
        if (finals >= 2) assert_int_equal(stats.is_final, 1); /* once it was */
        finals = stats.is_final ? finals + 1 : 0;
        if (stats.is_final) assert_memory_equal(wanted[i], got, sizeof got);
    }
    pbr_view_destroy(&views[1]);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Of what does not fit at all the host is told, once, and what was shown before stays. */
static void what_does_not_fit_leaves_what_was_shown(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t coarse[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 43);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_renderer_desc desc = host_renderer_desc();
    pbr_frame frame = refined_frame(0);
    desc.gpu_memory_budget = 24 * POINTS * 9 / 10;
    host_use_renderer(host, &desc);
    frame.threshold = 12;
    draw_until_final(host, &target, &frame, &item, 1, coarse);
    const uint64_t few = draw_picture(host, &target, &frame, &item, 1, coarse).splats_drawn;
    assert_true(few > 0 && few < POINTS * 9 / 10);
    frame.threshold = PBR_THRESHOLD_LEAVES;
    int after = 0; /* frames after the error */
    for (int n = 0; after < 50; n++) {
        pbr_stats stats = PBR_STATS_INIT;
        target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
        const pbr_result result = pbr_render(host->view, &frame, &item, 1, &stats);
        target_read(&target, got);
        nap();
        assert_true(n < PATIENCE);
        assert_int_equal(stats.is_final, 0);
        if (result == PBR_OK) assert_memory_equal(coarse, got, sizeof got);
        else assert_int_equal(result, after == 0 ? PBR_ERROR_OUT_OF_GPU_MEMORY : PBR_OK);
        if (after > 0 || result != PBR_OK) after++;
    }
    /* From elsewhere a cut is found that fits, coarser and coarser. */
    pbr_frame there = make_frame(4);
    there.flags = 0;
    int good = 0, bad = 0;
    for (int n = 0; bad == 0 || good < 200; n++) {
        const pbr_result result = pbr_render(host->view, &there, &item, 1, NULL);
        nap();
        assert_true(n < PATIENCE);
        good = result == PBR_OK ? good + 1 : 0;
        bad += result != PBR_OK;
    }
    const pbr_stats found = draw_picture(host, &target, &there, &item, 1, got);
    assert_true(found.splats_drawn > 0 && found.threshold > 0);
    there.flags = PBR_FRAME_WAIT;
    there.threshold = found.threshold;
    draw_picture(host, &target, &there, &item, 1, coarse);
    assert_memory_equal(coarse, got, sizeof got);
    frame.threshold = 12;
    draw_until_final(host, &target, &frame, &item, 1, coarse);
    draw_until_final(host, &target, &frame, &item, 1, got);
    assert_memory_equal(coarse, got, sizeof got);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void what_is_being_refined_can_be_dropped(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t got[PIXELS][4];
    target_open(&target, SIZE);
    for (int way = 0; way < 6; way++)
        for (int frames = 0; frames < 3; frames++) {
            renew(host);
            pbr_lod *lod = lod_of(host, 35);
            pbr_frame frame = refined_frame(0);
            pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
            for (int i = 0; i <= frames; i++) {
                frame.view[12] = 0.5 * i;
                draw_picture(host, &target, &frame, &item, 1, got);
            }
            switch (way) {
            case 0: pbr_renderer_evict_lod(host->renderer, lod); break;
            case 1: pbr_renderer_evict(host->renderer, NULL); break;
            case 2:
                pbr_view_destroy(&host->view);
                assert_int_equal(pbr_view_create(host->renderer, NULL, &host->view), PBR_OK);
                break;
            case 3: renew(host); break;
            case 4: /* the item is forgotten by and by */
                for (int i = 0; i < 80; i++) draw_picture(host, &target, &frame, NULL, 0, got);
                break;
            default: pbr_renderer_abandon(host->renderer); renew(host);
            }
            pbr_lod_release(&lod);
        }
    target_close(&target);
}

/* A host that wants no threads gets none: its frames wait. */
static void with_one_thread_every_frame_waits(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 39);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int turn = 0; turn < 3; turn++) {
        pbr_frame frame = make_frame(turn);
        draw_picture(host, &target, &frame, &item, 1, wanted);
        renew(host);
        frame.flags = 0;
        assert_int_equal(draw_picture(host, &target, &frame, &item, 1, got).is_final, 1);
        assert_memory_equal(wanted, got, sizeof got);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- A time budget ---- */

/* More than any frame takes: the first one is at 4 pixels, as nothing is known, and a resting camera gets all it asks for. */
static void at_rest_the_threshold_goes_to_what_is_asked_for(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 36);
    for (int waits = 0; waits < 2; waits++) {
        pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
        pbr_frame frame = make_frame(0);
        renew(host);
        frame.threshold = 0.5f;
        draw_picture(host, &target, &frame, &item, 1, wanted);
        renew(host);
        frame.time_budget = 1000;
        frame.flags = waits ? PBR_FRAME_WAIT : 0;
        pbr_stats stats = PBR_STATS_INIT;
        float last = 4.1f;
        for (int n = 0; !stats.is_final; n++) {
            stats = draw_picture(host, &target, &frame, &item, 1, got);
            assert_true(n < (waits ? 10 : PATIENCE));
            if (!waits) nap(); /* how fine it is meanwhile is the thread's */
            if (waits) assert_true(stats.threshold < last && stats.threshold > 0.65f * last);
            if (waits) assert_int_equal(stats.is_final, stats.threshold == 0.5f);
            last = stats.threshold;
        }
        assert_true(stats.threshold == 0.5f);
        assert_memory_equal(wanted, got, sizeof got);
        assert_int_equal(draw_picture(host, &target, &frame, &item, 1, got).nodes_visited, 0);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Less than any frame takes: the coarsest, in motion; at rest all the same what is asked for. */
static void in_motion_the_threshold_follows_the_time(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 37);
    pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
    pbr_frame frame = make_frame(0);
    renew(host);
    frame.threshold = 1;
    frame.time_budget = 1e-9;
    pbr_stats stats = PBR_STATS_INIT;
    int measured = 0;
    for (int i = 0; i < 80; i++) {
        frame.view[12] = 0.002 * i;
        stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_true(stats.frame_seconds >= 0);
        measured += stats.frame_seconds > 0;
        assert_int_equal(stats.is_final, 0);
        glFinish();
    }
    assert_true(measured > 40);
    assert_true(stats.threshold == 64);
    const pbr_stats coarsest = stats;
    pbr_frame same = frame;
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT, later = PBR_RENDERER_INFO_INIT;
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    frame.time_budget = 1000;
    for (int i = 0; i < 80; i++) {
        frame.view[12] = 0.002 * (80 - i);
        const pbr_stats next = draw_picture(host, &target, &frame, &item, 1, got);
        assert_true(next.threshold >= 1 && next.threshold <= stats.threshold);
        stats = next;
        glFinish();
    }
    assert_true(stats.threshold == 1);
    assert_int_equal(pbr_renderer_get_info(host->renderer, &later), PBR_OK);
    assert_true(later.gpu_object_count <= info.gpu_object_count + 4); /* the ring's other buffers, if they were not made */
    /* Edges coarsened with it: where the host itself asks for as much they stay closed, and that takes more splats. */
    same.threshold = 64;
    same.time_budget = 0;
    assert_true(draw_picture(host, &target, &same, &item, 1, got).splats_drawn > coarsest.splats_drawn);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void leaves_and_points_have_no_budget(void **state) {
    struct host *host = start(state);
    struct target target;
    uint8_t got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 38);
    pbr_points *points = NULL;
    assert_int_equal(make_points(host->instance, 38, &points), PBR_OK);
    pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), PBR_ITEM_INIT};
    items[1].points = points;
    pbr_frame frame = make_frame(0);
    frame.time_budget = 1e-9;
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++) {
            frame.view[12] = 0.1 * i;
            const pbr_stats stats = draw_picture(host, &target, &frame, &items[k], 1, got);
            assert_int_equal(stats.is_final, 1);
            assert_true(stats.threshold == 0 && stats.frame_seconds == 0);
            assert_int_equal(stats.splats_drawn, POINTS);
        }
    static const double wrong[] = {-1, NAN, INFINITY};
    for (int i = 0; i < 3; i++) {
        frame.time_budget = wrong[i];
        assert_int_equal(pbr_render(host->view, &frame, items, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
        assert_non_null(strstr(host->log, "time_budget"));
    }
    pbr_points_release(&points);
    pbr_lod_release(&lod);
    target_close(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(the_final_picture_is_that_of_a_frame_that_waits),
        GL_TEST(a_moving_camera_sees_something_and_comes_to_rest),
        GL_TEST(an_old_cut_is_drawn_from_where_the_camera_is),
        GL_TEST(jitter_costs_nothing),
        GL_TEST(frames_that_wait_may_come_between),
        GL_TEST(a_slow_motion_costs_little),
        GL_TEST(views_that_do_not_fit_together_do_not_blink),
        GL_TEST(what_does_not_fit_leaves_what_was_shown),
        GL_TEST(what_is_being_refined_can_be_dropped),
        GL_TEST(with_one_thread_every_frame_waits),
        GL_TEST(at_rest_the_threshold_goes_to_what_is_asked_for),
        GL_TEST(in_motion_the_threshold_follows_the_time),
        GL_TEST(leaves_and_points_have_no_budget),
    };
    return RUN_GL_TESTS("refine", tests);
}
