/* Keeps what is resident of a mapped file within a budget: chunks that have not been touched for long are given back to the system.
 * Which come again from the file when they are touched next. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_RESIDENCY_H
#define PBR_LOD_RESIDENCY_H

#include <pbr/support.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A fault brings in as much as this around it at most, at such an address (Linux' fault-around); so chunks are counted truly. */
enum { RESIDENCY_CHUNK_BITS = 16, RESIDENCY_CHUNK = 1 << RESIDENCY_CHUNK_BITS };

enum { CHUNK_ABSENT, CHUNK_OLD, CHUNK_RECENT };

struct residency {
    uintptr_t first;           /* chunk number of the mapping's first byte */
    const unsigned char *data; /* the mapping */
    size_t size;
    uintptr_t page_size;           /* the system's */
    size_t chunk_count, limit;     /* chunks; how many may be present */
    _Atomic unsigned char *chunks; /* CHUNK_... of each */
    atomic_size_t present;
    pthread_mutex_t lock; /* of who makes room */
    size_t hand;          /* where chunks are looked at next */
};

/* For a mapping of `size` bytes. Of the instance's memory; NULL for lack of it. */
struct residency *residency_create(pbr_instance *instance, const unsigned char *data, size_t size, uint64_t budget);
void residency_free(pbr_instance *instance, struct residency *residency);

void residency_bring(struct residency *residency, size_t chunk);

/* Before bytes of the mapping are read. Any thread. */
static inline void residency_touch(struct residency *residency, const unsigned char *p, size_t size) {
    const size_t first = ((uintptr_t)p >> RESIDENCY_CHUNK_BITS) - residency->first;
    const size_t last = (((uintptr_t)p + size - 1) >> RESIDENCY_CHUNK_BITS) - residency->first;
    for (size_t i = first; i <= last; i++)
        if (atomic_load_explicit(&residency->chunks[i], memory_order_relaxed) != CHUNK_RECENT) residency_bring(residency, i);
}

/* Bytes that are going to be read soon: where they are not present, the system may begin to fetch them. Any thread. */
void residency_fetch(const struct residency *residency, const unsigned char *p);
static inline void residency_expect(const struct residency *residency, const unsigned char *p) {
    const size_t chunk = ((uintptr_t)p >> RESIDENCY_CHUNK_BITS) - residency->first;
    if (atomic_load_explicit(&residency->chunks[chunk], memory_order_relaxed) == CHUNK_ABSENT) residency_fetch(residency, p);
}

/* Bytes that count as present. */
uint64_t residency_bytes(const struct residency *residency);

#endif
