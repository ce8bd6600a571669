/* What the file tests share: an instance that counts its memory and keeps its last message. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_IO_SUPPORT_H
#define PBR_TESTS_IO_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <pbr/support.h>

struct host {
    atomic_size_t live, peak; /* bytes */
    atomic_int warnings, errors;
    char error[512]; /* last */
};

/* Each block carries its size before it, within the alignment that the library asks for. */
enum { HOST_HEADER = 64 };

static inline void *host_allocate(void *user, size_t size, size_t alignment) {
    struct host *host = user;
    (void)alignment;
    if (size > SIZE_MAX / 2) return NULL;
    char *block = malloc(size + HOST_HEADER);
    if (!block) return NULL;
    memcpy(block, &size, sizeof size);
    size_t live = atomic_fetch_add(&host->live, size) + size, peak = atomic_load(&host->peak);
    while (live > peak && !atomic_compare_exchange_weak(&host->peak, &peak, live)) continue;
    return block + HOST_HEADER;
}

static inline void host_release(void *user, void *memory) {
    struct host *host = user;
    size_t size;
    memcpy(&size, (char *)memory - HOST_HEADER, sizeof size);
    atomic_fetch_sub(&host->live, size);
    free((char *)memory - HOST_HEADER);
}

static inline void host_log(void *user, int32_t level, pbr_result code, const char *text) {
    struct host *host = user;
    (void)code;
    if (level == PBR_LOG_WARNING) atomic_fetch_add(&host->warnings, 1);
    if (level != PBR_LOG_ERROR) return;
    atomic_fetch_add(&host->errors, 1);
    snprintf(host->error, sizeof host->error, "%s", text);
}

static inline pbr_instance *host_instance_of_threads(struct host *host, uint32_t threads) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    desc.thread_count = threads;
    memset(host, 0, sizeof *host);
    desc.allocate = host_allocate;
    desc.release = host_release;
    desc.memory_user = host;
    desc.log = host_log;
    desc.log_user = host;
    assert_int_equal(pbr_instance_create(&desc, &instance), PBR_OK);
    return instance;
}

static inline pbr_instance *host_instance(struct host *host) {
    return host_instance_of_threads(host, 0);
}

/* Destroys the instance; nothing may be left. */
static inline void host_finish(struct host *host, pbr_instance *instance) {
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    assert_int_equal(atomic_load(&host->live), 0);
}

static inline const char *test_data(void) {
    const char *path = getenv("PBR_TEST_DATA");
    return path ? path : "../shared/data";
}

/* xorshift64 (Marsaglia 2003), the same numbers in every run. */
static inline uint64_t random_next(uint64_t *state) {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

#endif
