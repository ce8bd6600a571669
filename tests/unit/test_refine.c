/* The refinement thread: what it finishes are the cuts that were asked for, coarse to fine; what is not wanted any more is let go
 * of. Runs under the thread sanitizer. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include <time.h>

#include "cameras.h"
#include "lod/lod.h"
#include "lod/refine.h"

enum { MANY = 150000, MEDIUM = 100000, FEW = 2000 };
static const double PATIENCE = 0.03;

struct bench {
    struct host host;
    pbr_instance *instance;
    pbr_lod *large, *small;
    struct refiner *refiner;
};

static pbr_lod *build(pbr_instance *instance, size_t count) {
    const struct kind kind = {"a sphere", SPHERE, count, 0};
    struct surface surface = make_surface(&kind);
    pbr_lod *lod = surface_lod(instance, &surface);
    free_surface(&surface);
    return lod;
}

static int set_up(void **state) {
    struct bench *bench = calloc(1, sizeof *bench);
    assert_non_null(bench);
    bench->instance = host_start(&bench->host, 2);
    bench->large = build(bench->instance, MANY);
    bench->small = build(bench->instance, FEW);
    assert_int_equal(refiner_create(bench->instance, &bench->refiner), PBR_OK);
    *state = bench;
    return 0;
}

static int tear_down(void **state) {
    struct bench *bench = *state;
    refiner_destroy(&bench->refiner);
    assert_null(bench->refiner);
    refiner_destroy(&bench->refiner); /* nothing to do */
    pbr_lod_release(&bench->large);
    pbr_lod_release(&bench->small);
    host_stop(&bench->host, bench->instance);
    free(bench);
    return 0;
}

/* Seen from a direction, all of it, 500 pixels large. */
static struct cut_view view_from(const pbr_lod *lod, double angle, double threshold) {
    const double radius = lod_radius(lod), c = cos(angle), s = sin(angle);
    struct cut_view view;
    memset(&view, 0, sizeof view);
    view.viewport[0] = view.viewport[1] = 1000;
    view.size_minimum = 1, view.size_maximum = 1e18, view.point_limit = 64;
    perspective(2, 1, 1, 10, view.projection);
    const double to_eye[16] = {c / radius, 0, -s / radius, 0, 0, 1 / radius, 0, 0, s / radius, 0, c / radius, 0, 0, 0, -4, 1};
    memcpy(view.to_eye, to_eye, sizeof to_eye);
    matrix_multiply(view.projection, view.to_eye, view.to_clip);
    view.reach_per_radius = 1 / radius;
    view.size_per_radius = view.node_size_per_radius = 2 * 1000 / radius;
    view.threshold = threshold;
    view.edge = 8;
    return view;
}

/* The next finished one. Ends: a test that would hang fails instead. */
static struct refined *await(struct refinement *refinement) {
    for (int tries = 0; tries < 100000; tries++) {
        struct refined *refined = refinement_take(refinement);
        if (refined) return refined;
        nanosleep(&(struct timespec){0, 1000000}, NULL);
    }
    fail_msg("nothing comes");
    return NULL;
}

static struct refinement *refine(struct bench *bench, const pbr_lod *lod) {
    struct refinement *refinement = NULL;
    assert_int_equal(refinement_create(bench->refiner, lod, &refinement), PBR_OK);
    assert_null(refinement_take(refinement));
    return refinement;
}

/* As a cut made here and now is. */
static void expect_cut(struct bench *bench, const pbr_lod *lod, const struct refined *refined) {
    struct cut wanted = {0};
    assert_int_equal(refined->result, PBR_OK);
    assert_int_equal(lod_cut(lod, &refined->view, NULL, NULL, &wanted), PBR_OK);
    assert_int_equal(wanted.count, refined->cut.count);
    assert_int_equal(wanted.points_only, refined->cut.points_only);
    assert_int_equal(wanted.visited, refined->cut.visited);
    struct splat *records[2] = {calloc(wanted.count + 1, sizeof(struct splat)), calloc(wanted.count + 1, sizeof(struct splat))};
    assert_true(records[0] && records[1]);
    cut_gather(bench->instance, &wanted, records[0]);
    cut_gather(bench->instance, &refined->cut, records[1]);
    assert_memory_equal(records[0], records[1], (wanted.count + 1) * sizeof(struct splat));
    free(records[0]), free(records[1]);
    cut_free(bench->instance, &wanted);
}

static void cuts_come_coarse_to_fine_and_end_with_what_was_asked_for(void **state) {
    struct bench *bench = *state;
    static const double thresholds[] = {0, 0.7, 1, 3};
    for (size_t t = 0; t < COUNT(thresholds); t++) {
        struct refinement *refinement = refine(bench, bench->large);
        const struct cut_view view = view_from(bench->large, 1, thresholds[t]);
        double last = INFINITY;
        int steps = 0;
        refinement_ask(refinement, &view, NULL, PATIENCE, 0);
        for (bool is_final = false; !is_final; steps++) {
            struct refined *refined = await(refinement);
            const double threshold = refined->view.threshold;
            if (steps == 0) assert_true(threshold >= 32 && refined->cut.visited < MANY / 10); /* something soon */
            assert_true(threshold < last);
            last = threshold;
            expect_cut(bench, bench->large, refined);
            is_final = memcmp(&refined->view, &view, sizeof view) == 0;
            assert_int_equal(is_final, threshold == thresholds[t]);
            struct cut_view same = refined->view;
            same.threshold = view.threshold;
            assert_memory_equal(&same, &view, offsetof(struct cut_view, threshold));
            /* Edges coarsen with thresholds, below a quarter pixel as if that were asked for: doubles' powers of two. */
            assert_true(same.edge == (is_final ? 8 : 8 * threshold / fmax(thresholds[t], 0.25)));
            refinement_return(refinement);
        }
        assert_true(steps >= 1);
        nanosleep(&(struct timespec){0, 20000000}, NULL);
        assert_null(refinement_take(refinement)); /* and no more */
        refinement_destroy(&refinement);
        assert_null(refinement);
    }
}

static void a_small_hierarchy_is_cut_at_once(void **state) {
    struct bench *bench = *state;
    struct refinement *refinement = refine(bench, bench->small);
    const struct cut_view view = view_from(bench->small, 0, 1);
    refinement_ask(refinement, &view, NULL, PATIENCE, 0);
    struct refined *refined = await(refinement);
    assert_memory_equal(&refined->view, &view, sizeof view);
    expect_cut(bench, bench->small, refined);
    refinement_return(refinement);
    refinement_destroy(&refinement);
}

/* A camera that never stops: pictures come all the same, and the last one is that of where it ends. */
static void what_is_asked_last_comes_in_the_end(void **state) {
    struct bench *bench = *state;
    struct refinement *refinements[2] = {refine(bench, bench->large), refine(bench, bench->small)};
    const pbr_lod *lods[2] = {bench->large, bench->small};
    struct cut_view views[2];
    int taken = 0;
    for (int frame = 0; frame < 300; frame++) {
        for (int i = 0; i < 2; i++) {
            struct refined *refined = refinement_take(refinements[i]);
            if (refined) {
                taken++;
                if (frame % 64 == 0) expect_cut(bench, lods[i], refined); /* whole, whatever goes on */
                refinement_return(refinements[i]);
            }
            views[i] = view_from(lods[i], 0.01 * frame, 0.5);
            refinement_ask(refinements[i], &views[i], NULL, PATIENCE, 0);
        }
        nanosleep(&(struct timespec){0, 200000}, NULL);
    }
    assert_true(taken > 0);
    for (int i = 0; i < 2; i++) {
        for (bool is_final = false; !is_final;) {
            struct refined *refined = await(refinements[i]);
            is_final = memcmp(&refined->view, &views[i], sizeof views[i]) == 0;
            if (is_final) expect_cut(bench, lods[i], refined);
            refinement_return(refinements[i]);
        }
        refinement_destroy(&refinements[i]);
    }
}

/* By the time that the last cut took, its square of pixels, and what there is time for. */
static void levels_are_those_that_are_expected_in_time(void **unused) {
    (void)unused;
    static const struct {
        struct refine_history history;
        double asked, seconds;
        int level;
    } cases[] = {{{0, 0, 0}, 1, 0.03, 0},     {{0, 0, 64}, 1, 0.03, 6},      {{0, 0, 64}, 0, 0.03, 8},
                 {{0, 0, 64}, 3, 0.03, 5},    {{4, 0.01, 0}, 1, 0.03, 2},    {{4, 0.01, 0}, 1, 0.05, 1},
                 {{4, 0.01, 0}, 1, 9, 1},     {{4, 0.01, 16}, 1, 9, 4},      {{4, 0.05, 0}, 1, 0.03, 2},
                 {{4, 0.07, 0}, 1, 0.03, 3},  {{1, 1, 0}, 1, 0.03, 3},       {{1, 1, 0}, 8, 0.03, 0},
                 {{1, 1, 0}, 0, 0.03, 5},     {{0.25, 0.02, 0}, 0, 0.03, 0}, {{1, 1e9, 0}, 1, 0.03, 10},
                 {{1, 1, 0}, 1, INFINITY, 0}, {{2.8, 1, 0}, 2, INFINITY, 0}};
    for (size_t i = 0; i < COUNT(cases); i++)
        assert_int_equal(refine_first_level(&cases[i].history, cases[i].asked, cases[i].seconds), cases[i].level);
}

enum { DIRECTIONS = 16 };

static void make_views(const pbr_lod *lod, struct cut_view views[DIRECTIONS]) {
    for (int i = 0; i < DIRECTIONS; i++) views[i] = view_from(lod, 0.01 * i, 0);
}

static bool is_of(const struct cut_view *made, const struct cut_view *asked) {
    struct cut_view same = *made;
    same.threshold = asked->threshold;
    return memcmp(&same, asked, offsetof(struct cut_view, threshold)) == 0;
}

/* A cut of all leaves takes as long as some thousand asks: without patience none would be finished. */
static void who_asks_all_the_time_gets_cuts_for_it(void **state) {
    struct bench *bench = *state;
    struct refinement *refinement = refine(bench, bench->large);
    static struct cut_view views[DIRECTIONS];
    bool is_old = false;
    make_views(bench->large, views);
    refinement_ask(refinement, &views[0], NULL, PATIENCE, 0);
    for (bool is_final = false; !is_final; refinement_return(refinement)) is_final = await(refinement)->view.threshold == 0;
    for (uint64_t tag = 1; !is_old && tag < 3000000; tag++) {
        const struct refined *refined = refinement_take(refinement);
        if (refined) {
            is_old = refined->tag > 0 && refined->tag + 1000 < tag && refined->view.threshold == 0;
            assert_true(is_of(&refined->view, &views[refined->tag % DIRECTIONS]));
            refinement_return(refinement);
        }
        refinement_ask(refinement, &views[tag % DIRECTIONS], NULL, 1000, tag);
    }
    assert_true(is_old);
    refinement_destroy(&refinement);
}

/* The first cut of what has few leaves is the finest, unless it takes longer than is waited for. One in twenty must be overtaken.
 */
static void patience_ends(void **state) {
    struct bench *bench = *state;
    pbr_lod *lod = build(bench->instance, MEDIUM);
    static struct cut_view views[DIRECTIONS];
    bool is_coarser = false;
    make_views(lod, views);
    for (int i = 0; i < 20 && !is_coarser; i++) {
        struct refinement *refinement = refine(bench, lod);
        const struct refined *refined = NULL;
        for (uint64_t tag = 1; !refined; tag++) {
            refinement_ask(refinement, &views[tag % DIRECTIONS], NULL, 1e-5, tag);
            refined = refinement_take(refinement);
        }
        is_coarser = refined->view.threshold > 0;
        refinement_return(refinement);
        refinement_destroy(&refinement);
    }
    assert_true(is_coarser);
    pbr_lod_release(&lod);
}

/* What is being read stays as it is while the thread goes on, as far as it has room. */
static void a_taken_cut_is_left_alone(void **state) {
    struct bench *bench = *state;
    struct refinement *refinement = refine(bench, bench->large);
    struct cut_view view = view_from(bench->large, 0, 0.5);
    refinement_ask(refinement, &view, NULL, PATIENCE, 0);
    struct refined *refined = await(refinement);
    for (int i = 0; i < 4; i++) {
        view = view_from(bench->large, i, 0.5);
        refinement_ask(refinement, &view, NULL, PATIENCE, 0);
        nanosleep(&(struct timespec){0, 3000000}, NULL);
        expect_cut(bench, bench->large, refined);
    }
    refinement_return(refinement);
    for (bool is_final = false; !is_final; refinement_return(refinement)) {
        refined = await(refinement);
        is_final = memcmp(&refined->view, &view, sizeof view) == 0;
    }
    refinement_destroy(&refinement);
}

/* A wall before all of the hierarchy, or behind it, as its last picture's depth. */
static struct occlusion wall_of(struct bench *bench, const struct cut_view *view, float depth) {
    struct occlusion occlusion = {.reach = {1, 1}};
    assert_int_equal(occluders_create(bench->instance, 64, 64, &occlusion.by), PBR_OK);
    occlusion.by->sign = 1;
    for (int32_t i = 0; i < occlusion.by->columns[0] * occlusion.by->rows[0]; i++) occlusion.by->levels[0][i] = depth;
    occluders_finish(occlusion.by);
    memcpy(occlusion.to_clip, view->to_clip, sizeof view->to_clip);
    return occlusion;
}

/* Whoever asks may let go of it at once; it is freed when the last cut that asked it is gone. */
static void what_hides_is_held_as_long_as_it_is_asked(void **state) {
    struct bench *bench = *state;
    const struct cut_view view = view_from(bench->large, 0, 0.5);
    struct refinement *refinement = refine(bench, bench->large);
    uint64_t counts[2] = {0, 0};
    for (int i = 0; i < 40; i++) {
        const bool before = i % 2 == 0, finishes = i >= 38;
        struct occlusion occlusion = wall_of(bench, &view, before ? -1 : 1);
        const struct occluders *by = occlusion.by;
        refinement_ask(refinement, &view, &occlusion, PATIENCE, 0);
        occluders_release(&occlusion.by);
        for (bool is_final = !finishes; !is_final; refinement_return(refinement)) {
            const struct refined *refined = await(refinement);
            is_final = refined->hidden_by == by && memcmp(&refined->view, &view, sizeof view) == 0;
            if (is_final) counts[before] = refined->cut.count;
            if (is_final) assert_true(before == (refined->cut.hidden > 0));
        }
        if (i % 5 == 0) nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
    assert_true(counts[1] > 0 && counts[1] < counts[0] / 4);
    refinement_destroy(&refinement);
}

/* In the middle of a cut, too. */
static void what_is_destroyed_lets_go_of_its_hierarchy(void **state) {
    struct bench *bench = *state;
    const long before = atomic_load(&bench->host.live);
    for (int i = 0; i < 50; i++) {
        struct refinement *refinements[2] = {refine(bench, bench->large), refine(bench, bench->large)};
        const struct cut_view view = view_from(bench->large, i, 0);
        for (int k = 0; k < 2; k++) refinement_ask(refinements[k], &view, NULL, PATIENCE, 0);
        nanosleep(&(struct timespec){0, i * 50000}, NULL);
        for (int k = 0; k < 2; k++) refinement_destroy(&refinements[k]);
        refiner_settle(bench->refiner);
        assert_int_equal(atomic_load(&bench->host.live), before);
        assert_int_equal(atomic_load(&bench->large->references), 1);
    }
    /* And some are still there, at work, when all ends. */
    struct refinement *left = refine(bench, bench->large);
    const struct cut_view view = view_from(bench->large, 0, 0);
    refinement_ask(left, &view, NULL, PATIENCE, 0);
}

static void without_memory_a_cut_fails_and_the_next_one_does_not(void **state) {
    struct bench *bench = *state;
    struct refinement *refinement = refine(bench, bench->small);
    struct cut_view view = view_from(bench->small, 0, 1);
    atomic_store(&bench->host.fail_at, 1);
    refinement_ask(refinement, &view, NULL, PATIENCE, 0);
    struct refined *refined = await(refinement);
    assert_int_equal(refined->result, PBR_ERROR_OUT_OF_MEMORY);
    assert_int_equal(refined->cut.count, 0);
    refinement_return(refinement);
    atomic_store(&bench->host.fail_at, 0);
    view = view_from(bench->small, 1, 1);
    refinement_ask(refinement, &view, NULL, PATIENCE, 0);
    refined = await(refinement);
    expect_cut(bench, bench->small, refined);
    refinement_return(refinement);
    refinement_destroy(&refinement);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(cuts_come_coarse_to_fine_and_end_with_what_was_asked_for, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_small_hierarchy_is_cut_at_once, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_is_asked_last_comes_in_the_end, set_up, tear_down),
        cmocka_unit_test(levels_are_those_that_are_expected_in_time),
        cmocka_unit_test_setup_teardown(who_asks_all_the_time_gets_cuts_for_it, set_up, tear_down),
        cmocka_unit_test_setup_teardown(patience_ends, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_taken_cut_is_left_alone, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_hides_is_held_as_long_as_it_is_asked, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_is_destroyed_lets_go_of_its_hierarchy, set_up, tear_down),
        cmocka_unit_test_setup_teardown(without_memory_a_cut_fails_and_the_next_one_does_not, set_up, tear_down)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
