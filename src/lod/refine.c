/* The refinement thread (after Jeffers, Jensen & Rausch 2013). SPDX-License-Identifier: MIT */
#include "refine.h"

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <time.h>

enum {
    MOST_LEVELS = 10,
    FIRST_PIXELS = 64, /* of a hierarchy's very first cut: some hundred nodes */
    SMALL = 1 << 17,   /* leaves that are cut in a few milliseconds: such a hierarchy needs no coarse one first */
    NONE = -1
};

struct refinement {
    struct refiner *refiner;
    pbr_lod *lod;                       /* held */
    struct refinement *next, *previous; /* of all */
    struct refinement *later, *earlier; /* of the queue that it is in, if it is */
    bool is_queued;
    bool is_dead; /* destroyed while the thread works for it */
    struct cut_view asked;
    struct occlusion occlusion; /* asked with it; holds what hides */
    uint64_t serial;            /* of what is asked */
    bool has_work;              /* something is asked that is not finished to the finest */
    int level, first, reached;  /* a cut's threshold is 2^level times what is asked: the next one's, the first one's, the last
                                   finished one's (NONE: none yet) for what is asked now */
    struct refined refined;
    enum { FREE, FINISHED, TAKEN } state; /* of that; FREE: the thread's to make */
};

struct refiner {
    pbr_instance *instance;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t work, settled; /* something to do; a dead one gone */
    bool stops, has_spares, is_disposing;
    struct refinement *all, *running;
    struct queue {
        struct refinement *first, *last;
    } queues[MOST_LEVELS + 1]; /* of those that have work and room, by the level of their next cut */
    atomic_bool cancel;        /* the cut that is being made */
};

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* ---- The thread ---- */

static void dispose(struct refinement *r) {
    pbr_instance *instance = r->refiner->instance;
    cut_free(instance, &r->refined.cut);
    occluders_release(&r->refined.hidden_by);
    occluders_release(&r->occlusion.by);
    pbr_lod_release(&r->lod);
    pbr_free(instance, r);
}

static void unlink_one(struct refinement *r) {
    if (r->previous) r->previous->next = r->next;
    else r->refiner->all = r->next;
    if (r->next) r->next->previous = r->previous;
}

static void leave_queue(struct refinement *r) {
    struct queue *queue = &r->refiner->queues[r->level];
    if (!r->is_queued) return;
    if (r->earlier) r->earlier->later = r->later;
    else queue->first = r->later;
    if (r->later) r->later->earlier = r->earlier;
    else queue->last = r->earlier;
    r->earlier = r->later = NULL;
    r->is_queued = false;
}

/* After anything of it has changed but the level, for which it must have left. */
static void join_queue(struct refinement *r) {
    struct queue *queue = &r->refiner->queues[r->level];
    if (r->is_queued || !r->has_work || r->state != FREE || r->refiner->running == r) return;
    r->earlier = queue->last;
    if (queue->last) queue->last->later = r;
    else queue->first = r;
    queue->last = r;
    r->is_queued = true;
    pthread_cond_signal(&r->refiner->work);
}

/* Coarse cuts first, so that everything has some; among equals the one that waits longest. */
static struct refinement *next_one(const struct refiner *refiner) {
    for (int level = MOST_LEVELS; level >= 0; level--)
        if (refiner->queues[level].first) return refiner->queues[level].first;
    return NULL;
}

/* Nodes below half a pixel are as many as the leaves, which 0 asks for: coarser than those are such of half a pixel and more. */
static double threshold_of(double asked, int level) {
    return level == 0 ? asked : ldexp(fmax(asked, 0.25), level);
}

/* With the lock, which is given up meanwhile. */
static void make_one(struct refiner *refiner, struct refinement *r) {
    const int level = r->level;
    const uint64_t serial = r->serial;
    struct refined *refined = &r->refined;
    struct occlusion occlusion = r->occlusion;
    memcpy(&refined->view, &r->asked, sizeof refined->view); /* padding included: views are compared as bytes */
    refined->view.threshold = threshold_of(r->asked.threshold, level);
    occluders_release(&refined->hidden_by);
    refined->hidden_by = occluders_retain(occlusion.by);
    leave_queue(r);
    refiner->running = r;
    atomic_store(&refiner->cancel, false);
    pthread_mutex_unlock(&refiner->lock);
    const double start = now();
    refined->result = lod_cut(r->lod, &refined->view, &occlusion, &refiner->cancel, &refined->cut);
    refined->seconds = now() - start;
    pthread_mutex_lock(&refiner->lock);
    refiner->running = NULL;
    if (r->is_dead) {
        unlink_one(r);
        refiner->is_disposing = true;
        pthread_mutex_unlock(&refiner->lock);
        dispose(r);
        pthread_mutex_lock(&refiner->lock);
        refiner->is_disposing = false;
        pthread_cond_broadcast(&refiner->settled);
        return;
    }
    if (refined->result != PBR_ERROR_CANCELLED) {
        r->state = FINISHED;
        if (serial == r->serial) {
            r->reached = level;
            r->level = level > 0 ? level - 1 : 0;
            r->has_work = r->has_work && level > 0 && refined->result == PBR_OK;
        }
    }
    join_queue(r);
}

/* Whether its memory will not be needed soon: its view rests, and has what it asked for. */
static bool is_spare(const struct refinement *r) {
    enum { LITTLE = 1 << 10 }; /* blocks */
    const struct cut_guard *guard = &r->asked.guard;
    return !r->has_work && r->state == FREE && r->refined.cut.block_count > LITTLE && guard->turn == 0 && guard->move == 0;
}

static struct cut *find_spare(const struct refiner *refiner) {
    for (struct refinement *r = refiner->all; r; r = r->next)
        if (refiner->running != r && is_spare(r)) return &r->refined.cut;
    return NULL;
}

/* With the lock, which is given up meanwhile. */
static void free_spare(struct refiner *refiner, struct cut *spare) {
    struct cut cut = *spare;
    *spare = (struct cut){0};
    pthread_mutex_unlock(&refiner->lock);
    cut_free(refiner->instance, &cut);
    pthread_mutex_lock(&refiner->lock);
}

static void *run(void *user) {
    struct refiner *refiner = user;
    pthread_mutex_lock(&refiner->lock);
    while (!refiner->stops) {
        struct refinement *r = next_one(refiner);
        struct cut *spare = r || !refiner->has_spares ? NULL : find_spare(refiner);
        if (r) make_one(refiner, r);
        else if (spare) free_spare(refiner, spare);
        else refiner->has_spares = false, pthread_cond_wait(&refiner->work, &refiner->lock);
    }
    pthread_mutex_unlock(&refiner->lock);
    return NULL;
}

/* ---- The host's side ---- */

/* Signals are the host's. */
static bool start_thread(struct refiner *refiner) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&refiner->thread, NULL, run, refiner);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return error == 0;
}

static void free_refiner(struct refiner *refiner) {
    pthread_cond_destroy(&refiner->settled);
    pthread_cond_destroy(&refiner->work);
    pthread_mutex_destroy(&refiner->lock);
    pbr_free(refiner->instance, refiner);
}

pbr_result refiner_create(pbr_instance *instance, struct refiner **out) {
    *out = NULL;
    struct refiner *refiner = pbr_allocate(instance, 1, sizeof *refiner);
    if (!refiner) return PBR_ERROR_OUT_OF_MEMORY;
    refiner->instance = instance;
    atomic_init(&refiner->cancel, false);
    pthread_mutex_init(&refiner->lock, NULL);
    pthread_cond_init(&refiner->work, NULL);
    pthread_cond_init(&refiner->settled, NULL);
    if (start_thread(refiner)) {
        *out = refiner;
        return PBR_OK;
    }
    free_refiner(refiner);
    return PBR_ERROR_UNSUPPORTED;
}

void refiner_destroy(struct refiner **out) {
    struct refiner *refiner = *out;
    *out = NULL;
    if (!refiner) return;
    pthread_mutex_lock(&refiner->lock);
    refiner->stops = true;
    atomic_store(&refiner->cancel, true);
    pthread_cond_broadcast(&refiner->work);
    pthread_mutex_unlock(&refiner->lock);
    pthread_join(refiner->thread, NULL);
    while (refiner->all) {
        struct refinement *r = refiner->all;
        refiner->all = r->next;
        dispose(r);
    }
    free_refiner(refiner);
}

void refiner_settle(struct refiner *refiner) {
    pthread_mutex_lock(&refiner->lock);
    while (refiner->is_disposing || (refiner->running && refiner->running->is_dead))
        pthread_cond_wait(&refiner->settled, &refiner->lock);
    pthread_mutex_unlock(&refiner->lock);
}

pbr_result refinement_create(struct refiner *refiner, const pbr_lod *lod, struct refinement **out) {
    struct refinement *r = *out = pbr_allocate(refiner->instance, 1, sizeof *r);
    if (!r) return PBR_ERROR_OUT_OF_MEMORY;
    r->refiner = refiner;
    r->lod = pbr_lod_retain((pbr_lod *)(uintptr_t)lod); /* its count of references is not what const protects */
    r->reached = NONE;
    pthread_mutex_lock(&refiner->lock);
    r->next = refiner->all;
    if (r->next) r->next->previous = r;
    refiner->all = r;
    pthread_mutex_unlock(&refiner->lock);
    return PBR_OK;
}

void refinement_destroy(struct refinement **out) {
    struct refinement *r = *out;
    *out = NULL;
    if (!r) return;
    struct refiner *refiner = r->refiner;
    pthread_mutex_lock(&refiner->lock);
    const bool is_running = refiner->running == r;
    if (is_running) {
        r->is_dead = true;
        r->has_work = false;
        atomic_store(&refiner->cancel, true);
    } else {
        leave_queue(r);
        unlink_one(r);
    }
    pthread_mutex_unlock(&refiner->lock);
    if (!is_running) dispose(r);
}

/* As coarse as what got finished lately: where not even the first cut did, coarser. */
static int first_level(const struct refinement *r) {
    if (r->serial == 0) {
        int level = 0;
        if (lod_point_count(r->lod) <= SMALL) return 0;
        while (level < MOST_LEVELS && threshold_of(r->asked.threshold, level) < FIRST_PIXELS) level++;
        return level;
    }
    if (r->reached != NONE) return r->reached;
    return r->first < MOST_LEVELS ? r->first + 1 : MOST_LEVELS;
}

void refinement_ask(struct refinement *r, const struct cut_view *view, const struct occlusion *occlusion) {
    struct refiner *refiner = r->refiner;
    pthread_mutex_lock(&refiner->lock);
    leave_queue(r);
    memcpy(&r->asked, view, sizeof r->asked);
    occluders_release(&r->occlusion.by);
    if (occlusion) r->occlusion = *occlusion;
    occluders_retain(r->occlusion.by);
    r->first = r->level = first_level(r);
    r->reached = NONE;
    r->serial++;
    r->has_work = true;
    if (refiner->running == r) atomic_store(&refiner->cancel, true);
    join_queue(r);
    pthread_mutex_unlock(&refiner->lock);
}

void refinement_stop(struct refinement *r) {
    struct refiner *refiner = r->refiner;
    pthread_mutex_lock(&refiner->lock);
    leave_queue(r);
    r->has_work = false;
    occluders_release(&r->occlusion.by);
    if (refiner->running == r) atomic_store(&refiner->cancel, true);
    pthread_mutex_unlock(&refiner->lock);
}

void refinement_refuse(struct refinement *r) {
    pthread_mutex_lock(&r->refiner->lock);
    r->has_work = false;
    if (r->reached != NONE) r->first = r->reached;
    r->reached = NONE;
    pthread_mutex_unlock(&r->refiner->lock);
}

struct refined *refinement_take(struct refinement *r) {
    pthread_mutex_lock(&r->refiner->lock);
    const bool is_finished = r->state == FINISHED;
    if (is_finished) r->state = TAKEN;
    pthread_mutex_unlock(&r->refiner->lock);
    return is_finished ? &r->refined : NULL;
}

void refinement_return(struct refinement *r) {
    pthread_mutex_lock(&r->refiner->lock);
    r->state = FREE;
    occluders_release(&r->refined.hidden_by);
    join_queue(r);
    if (is_spare(r)) {
        r->refiner->has_spares = true;
        pthread_cond_signal(&r->refiner->work);
    }
    pthread_mutex_unlock(&r->refiner->lock);
}
