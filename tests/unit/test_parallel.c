/* Loops over threads. SPDX-License-Identifier: MIT */
#include "support.h"

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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_item_is_visited_once),
        cmocka_unit_test(an_error_ends_the_loop_and_is_returned),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
