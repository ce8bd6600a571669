/* The clock algorithm over a mapping's chunks (Corbato 1968). SPDX-License-Identifier: MIT */
#include "residency.h"

#include <sys/mman.h>
#include <unistd.h>

enum { LEAST = 64 }; /* chunks: each thread needs some at a time */

struct residency *residency_create(pbr_instance *instance, const unsigned char *data, size_t size, uint64_t budget) {
    struct residency *r = pbr_allocate(instance, 1, sizeof *r);
    if (!r) return NULL;
    r->data = data;
    r->size = size;
    r->page_size = (uintptr_t)sysconf(_SC_PAGESIZE);
    r->first = (uintptr_t)data >> RESIDENCY_CHUNK_BITS;
    r->chunk_count = (((uintptr_t)data + size - 1) >> RESIDENCY_CHUNK_BITS) - r->first + 1;
    r->limit = budget >> RESIDENCY_CHUNK_BITS > LEAST ? (size_t)(budget >> RESIDENCY_CHUNK_BITS) : LEAST;
    r->chunks = pbr_allocate(instance, r->chunk_count, sizeof *r->chunks);
    pthread_mutex_init(&r->lock, NULL);
    if (r->chunks) return r;
    residency_free(instance, r);
    return NULL;
}

void residency_free(pbr_instance *instance, struct residency *residency) {
    if (!residency) return;
    pthread_mutex_destroy(&residency->lock);
    pbr_free(instance, (void *)residency->chunks);
    pbr_free(instance, residency);
}

/* Another thread may touch some just now: then their pages come again, and the count is too low for a while. */
static void give_back(struct residency *r, size_t first, size_t end) {
    uintptr_t from = (r->first + first) << RESIDENCY_CHUNK_BITS, to = (r->first + end) << RESIDENCY_CHUNK_BITS;
    const uintptr_t data = (uintptr_t)r->data;
    if (from < data) from = data;
    if (to > data + r->size) to = data + r->size;
#ifdef MADV_DONTNEED /* on Linux: gone at once; posix_madvise would keep them */
    madvise((void *)from, to - from, MADV_DONTNEED);
#endif
}

/* True if it was there, and not touched since the hand passed it last. */
static bool is_old(struct residency *r, size_t chunk) {
    unsigned char state = CHUNK_OLD;
    return atomic_compare_exchange_strong_explicit(&r->chunks[chunk], &state, CHUNK_ABSENT, memory_order_relaxed,
                                                   memory_order_relaxed);
}

static bool was_recent(struct residency *r, size_t chunk) {
    unsigned char state = CHUNK_RECENT;
    return atomic_compare_exchange_strong_explicit(&r->chunks[chunk], &state, CHUNK_OLD, memory_order_relaxed,
                                                   memory_order_relaxed);
}

/* A sixteenth of what may be present goes. Runs of chunks are given back at once: a call costs as much as many chunks. */
static void make_room(struct residency *r) {
    const size_t enough = r->limit - r->limit / 16;
    size_t run = r->hand, found = 0;
    for (size_t looks = 2 * r->chunk_count; looks > 0 && atomic_load(&r->present) > enough; looks--) {
        if (is_old(r, r->hand)) {
            atomic_fetch_sub(&r->present, 1);
            found++;
        } else if (was_recent(r, r->hand)) {
            if (found > 0) give_back(r, run, r->hand);
            run = r->hand + 1;
            found = 0;
        }
        if (++r->hand < r->chunk_count) continue;
        if (found > 0) give_back(r, run, r->hand);
        run = r->hand = found = 0;
    }
    if (found > 0) give_back(r, run, r->hand);
}

void residency_bring(struct residency *r, size_t chunk) {
    const unsigned char before = atomic_exchange_explicit(&r->chunks[chunk], CHUNK_RECENT, memory_order_relaxed);
    if (before != CHUNK_ABSENT || atomic_fetch_add(&r->present, 1) < r->limit) return;
    pthread_mutex_lock(&r->lock);
    if (atomic_load(&r->present) > r->limit) make_room(r);
    pthread_mutex_unlock(&r->lock);
}

/* What a walk reads first of a page of nodes. */
void residency_fetch(const struct residency *r, const unsigned char *p) {
    enum { AHEAD = 16 << 10 };
    const uintptr_t page = (uintptr_t)p & ~(r->page_size - 1), end = (uintptr_t)r->data + r->size;
    posix_madvise((void *)page, end - page < AHEAD ? end - page : AHEAD, POSIX_MADV_WILLNEED);
}

uint64_t residency_bytes(const struct residency *residency) {
    return (uint64_t)atomic_load_explicit(&residency->present, memory_order_relaxed) << RESIDENCY_CHUNK_BITS;
}
