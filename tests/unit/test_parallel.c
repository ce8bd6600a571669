/* Loops over threads. SPDX-License-Identifier: MIT */
#include "support.h"

#include <limits.h>
#include <pthread.h>

#include "core/instance.h"

enum { ITEMS = 100003, GRAIN = 17 };

struct visits {
    atomic_int count[ITEMS];
    size_t bad; /* this item makes its piece fail */
};

static pbr_result visit(void *user, size_t begin, size_t end) {
    struct visits *visits = user;
    if (begin >= end || end > ITEMS || end - begin > GRAIN) return PBR_ERROR_LIMIT;
    for (size_t i = begin; i < end; i++) {
        if (i == visits->bad) return PBR_ERROR_IO;
        atomic_fetch_add(&visits->count[i], 1);
    }
    return PBR_OK;
}

static struct visits *new_visits(size_t bad) {
    struct visits *visits = calloc(1, sizeof *visits);
    assert_non_null(visits);
    visits->bad = bad;
    return visits;
}

static void every_item_is_visited_once(void **state) {
    (void)state;
    const uint32_t threads[] = {1, 2, 7, 4096};
    for (size_t t = 0; t < COUNT(threads); t++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads[t]);
        struct visits *visits = new_visits(SIZE_MAX);
        assert_int_equal(pbr_parallel(instance, ITEMS, GRAIN, visit, visits), PBR_OK);
        for (size_t i = 0; i < ITEMS; i++) assert_int_equal(atomic_load(&visits->count[i]), 1);
        assert_int_equal(pbr_parallel(instance, 0, GRAIN, visit, visits), PBR_OK);
        free(visits);
        host_stop(&host, instance);
    }
}

static void an_error_ends_the_loop_and_is_returned(void **state) {
    (void)state;
    for (uint32_t threads = 1; threads <= 3; threads++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads);
        struct visits *visits = new_visits(100);
        assert_int_equal(pbr_parallel(instance, ITEMS, GRAIN, visit, visits), PBR_ERROR_IO);
        /* One thread stops there and then; others finish the piece they are in. */
        if (threads == 1)
            for (size_t i = 100; i < ITEMS; i++) assert_int_equal(atomic_load(&visits->count[i]), 0);
        free(visits);
        host_stop(&host, instance);
    }
}

/* What the host was told, and on which thread it has to be. */
struct reports {
    pthread_t caller;
    int count, left; /* left: before it cancels */
    double last;
    bool is_wrong;
};

static int hear(void *user, const char *stage, double fraction) {
    struct reports *reports = user;
    reports->is_wrong |= !pthread_equal(reports->caller, pthread_self()) || strcmp(stage, "visiting") != 0;
    reports->is_wrong |= fraction < reports->last || (reports->count == 0) != (fraction == 0);
    reports->last = fraction;
    reports->count++;
    return reports->left-- > 1;
}

static void the_caller_is_told_how_far_it_is(void **state) {
    (void)state;
    for (uint32_t threads = 1; threads <= 3; threads++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads);
        struct visits *visits = new_visits(SIZE_MAX);
        struct reports reports = {.caller = pthread_self(), .left = INT_MAX};
        const struct progress progress = {hear, &reports};
        assert_int_equal(parallel_reporting(instance, ITEMS, GRAIN, visit, visits, &progress, "visiting"), PBR_OK);
        for (size_t i = 0; i < ITEMS; i++) assert_int_equal(atomic_load(&visits->count[i]), 1);
        assert_false(reports.is_wrong);
        assert_true(reports.last >= 1 && reports.count >= 2 && reports.count <= 34);
        if (threads == 1) assert_true(reports.count > 30);
        free(visits);
        host_stop(&host, instance);
    }
}

static void the_host_can_cancel_between_pieces(void **state) {
    (void)state;
    for (uint32_t threads = 1; threads <= 3; threads++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads);
        bool is_done = false;
        for (int left = 1; !is_done; left++) {
            struct visits *visits = new_visits(SIZE_MAX);
            struct reports reports = {.caller = pthread_self(), .left = left};
            const struct progress progress = {hear, &reports};
            int visited = 0;
            is_done = parallel_reporting(instance, ITEMS, GRAIN, visit, visits, &progress, "visiting") == PBR_OK;
            for (size_t i = 0; i < ITEMS; i++) visited += atomic_load(&visits->count[i]);
            if (is_done) assert_true(reports.count < left && reports.last >= 1);
            else assert_int_equal(reports.count, left); /* it is not asked again */
            if (left == 1) assert_int_equal(visited, 0);
            if (threads == 1 && left == 3) assert_true(visited > 0 && visited < ITEMS / 8);
            free(visits);
        }
        host_stop(&host, instance);
    }
}

static void errors_are_not_followed_by_reports(void **state) {
    (void)state;
    for (uint32_t threads = 1; threads <= 3; threads++) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads);
        struct visits *visits = new_visits(100);
        struct reports reports = {.caller = pthread_self(), .left = INT_MAX};
        const struct progress progress = {hear, &reports};
        assert_int_equal(parallel_reporting(instance, ITEMS, GRAIN, visit, visits, &progress, "visiting"), PBR_ERROR_IO);
        assert_true(reports.last < 1);
        reports = (struct reports){.caller = pthread_self(), .left = INT_MAX};
        assert_int_equal(parallel_reporting(instance, 0, GRAIN, visit, visits, &progress, "visiting"), PBR_OK);
        assert_true(reports.count == 2 && !reports.is_wrong);
        free(visits);
        host_stop(&host, instance);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_item_is_visited_once),         cmocka_unit_test(an_error_ends_the_loop_and_is_returned),
        cmocka_unit_test(the_caller_is_told_how_far_it_is),   cmocka_unit_test(the_host_can_cancel_between_pieces),
        cmocka_unit_test(errors_are_not_followed_by_reports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
