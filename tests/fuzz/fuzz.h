/* What the fuzz targets share: an instance whose memory is counted and bounded, and how a broken promise is reported.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_FUZZ_H
#define PBR_TESTS_FUZZ_H

#include <pbr/instance.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* libFuzzer's entry: called with any bytes. Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A finding: libFuzzer and replay both keep the input that led here. */
static inline void expect(bool promise, const char *text) {
    if (promise) return;
    fprintf(stderr, "broken promise: %s\n", text);
    abort();
}

struct host {
    size_t live, limit; /* bytes */
    bool refused;       /* more than `limit` was asked for */
    int errors;         /* messages of level error */
};

/* Each block carries its size before it, within the alignment that the library asks for. */
enum { HOST_HEADER = 64 };

static inline void *host_allocate(void *user, size_t size, size_t alignment) {
    struct host *host = user;
    char *block = NULL;
    (void)alignment;
    if (size > host->limit - host->live) {
        host->refused = true;
        return NULL;
    }
    if (posix_memalign((void **)&block, HOST_HEADER, size + HOST_HEADER)) return NULL;
    memcpy(block, &size, sizeof size);
    host->live += size;
    return block + HOST_HEADER;
}

static inline void host_release(void *user, void *memory) {
    struct host *host = user;
    size_t size;
    memcpy(&size, (char *)memory - HOST_HEADER, sizeof size);
    host->live -= size;
    free((char *)memory - HOST_HEADER);
}

static inline void host_log(void *user, int32_t level, pbr_result code, const char *text) {
    struct host *host = user;
    (void)code;
    expect(memchr(text, '\n', strlen(text)) == NULL, "a message is one line");
    if (level == PBR_LOG_ERROR) host->errors++;
}

/* One thread, so that a finding repeats and the counters need no care. */
static inline pbr_instance *host_start(struct host *host, size_t limit) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    *host = (struct host){.limit = limit};
    desc.allocate = host_allocate;
    desc.release = host_release;
    desc.log = host_log;
    desc.memory_user = desc.log_user = host;
    desc.thread_count = 1;
    expect(pbr_instance_create(&desc, &instance) == PBR_OK, "an instance can be made");
    return instance;
}

static inline void host_stop(struct host *host, pbr_instance *instance) {
    expect(pbr_instance_destroy(&instance) == PBR_OK, "nothing made from the instance is left");
    expect(host->live == 0, "all memory is given back");
}

#endif
