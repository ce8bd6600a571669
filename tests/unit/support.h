/* What the unit tests share: an instance whose memory is counted and can fail on request, its last message, random numbers.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_UNIT_SUPPORT_H
#define PBR_TESTS_UNIT_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <pbr/pbr.h>
#include <pbr/support.h>

#define COUNT(array) (sizeof(array) / sizeof *(array))

struct host {
    atomic_long live;    /* allocations not yet released */
    atomic_long fail_at; /* counts down with each allocation; the one that finds 1 fails. 0 = never */
    int32_t level;       /* of the last message */
    pbr_result code;
    int messages;
    char text[512];
};

static inline void *host_allocate(void *user, size_t size, size_t alignment) {
    struct host *host = user;
    (void)alignment; /* malloc's is enough for what libpbr asks */
    if (atomic_load(&host->fail_at) > 0 && atomic_fetch_sub(&host->fail_at, 1) == 1) return NULL;
    void *memory = malloc(size);
    if (!memory) return NULL;
    atomic_fetch_add(&host->live, 1);
    return memset(memory, 0xa5, size); /* what nobody sets shows */
}

static inline void host_release(void *user, void *memory) {
    struct host *host = user;
    assert_non_null(memory);
    atomic_fetch_sub(&host->live, 1);
    free(memory);
}

static inline void host_log(void *user, int32_t level, pbr_result code, const char *text) {
    struct host *host = user;
    host->level = level;
    host->code = code;
    host->messages++;
    strncpy(host->text, text, sizeof host->text - 1);
}

static inline pbr_instance *host_start(struct host *host, uint32_t threads) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance;
    memset(host, 0, sizeof *host);
    desc.allocate = host_allocate;
    desc.release = host_release;
    desc.memory_user = desc.log_user = host;
    desc.log = host_log;
    desc.thread_count = threads;
    assert_int_equal(pbr_instance_create(&desc, &instance), PBR_OK);
    return instance;
}

/* Everything made from the instance is gone, and every byte given back. */
static inline void host_stop(struct host *host, pbr_instance *instance) {
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    assert_int_equal(atomic_load(&host->live), 0);
}

/* Uniform in [0, 1), the same in every run. */
static inline double uniform(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) / 9007199254740992.0;
}

/* Runs `work` with its 1st, 2nd, ... allocation failing until it passes: each failure is an error that leaves nothing behind. */
static inline void fail_every_allocation(struct host *host, pbr_instance *instance, pbr_result (*work)(pbr_instance *, void *),
                                         void *user) {
    long before = atomic_load(&host->live);
    for (long n = 1;; n++) {
        atomic_store(&host->fail_at, n);
        pbr_result result = work(instance, user);
        bool failed = atomic_exchange(&host->fail_at, 0) == 0;
        assert_int_equal(atomic_load(&host->live), before);
        assert_int_equal(result, failed ? PBR_ERROR_OUT_OF_MEMORY : PBR_OK);
        if (!failed) break;
        assert_true(n < 1000);
    }
}

#endif
