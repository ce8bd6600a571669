/* The refinement thread (after Jeffers, Jensen & Rausch 2013). SPDX-License-Identifier: MIT */
#include "refine.h"

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <time.h>

enum {
    MOST_LEVELS = 10,
    FIRST_PIXELS = 64,        /* of a hierarchy's very first cut: some hundred nodes */
    SMALL = 1 << 17,          /* leaves that are cut in a few milliseconds: such a hierarchy needs no coarse one first */
    HUNGRY = MOST_LEVELS + 1, /* the queue after those of the levels */
    CAUTION = 4               /* cuts after one that was given up, before one as fine is tried again */
};

struct refinement {
    struct refiner *refiner;
    pbr_lod *lod;                       /* held */
    struct refinement *next, *previous; /* of all */
    struct refinement *later, *earlier; /* of the queue that it is in */
    struct queue *queue;                /* that one, or NULL */
    bool is_dead;                       /* destroyed while the thread works for it */
    struct cut_view asked;
    struct occlusion occlusion; /* asked with it; holds what hides */
    double patience;            /* likewise */
    uint64_t tag;               /* likewise */
    uint64_t serial;            /* of what is asked */
    bool has_work;              /* something is asked that is not finished to the finest */
    bool has_some;              /* a cut for it is finished */
    bool is_hungry;             /* it has work and none */
    int level;                  /* unless hungry: the next cut's, whose threshold is 2^level times what is asked */
    struct refine_history history;
    int caution;
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
    uint64_t running_serial;
    double running_since, running_pixels;
    int running_level;
    size_t hungry;
    struct queue {
        struct refinement *first, *last;
    } queues[HUNGRY + 1]; /* of those that have work and room: by the level of their next cut; the last, the hungry ones */
    atomic_bool cancel;   /* the cut that is being made */
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
    struct queue *queue = r->queue;
    if (!queue) return;
    if (r->earlier) r->earlier->later = r->later;
    else queue->first = r->later;
    if (r->later) r->later->earlier = r->earlier;
    else queue->last = r->earlier;
    r->earlier = r->later = NULL;
    r->queue = NULL;
}

/* It must have left its queue before it becomes hungry, or is fed, and before the level of one that is fed changes. */
static void join_queue(struct refinement *r) {
    if (r->queue || !r->has_work || r->state != FREE || r->refiner->running == r) return;
    struct queue *queue = r->queue = &r->refiner->queues[r->is_hungry ? HUNGRY : r->level];
    r->earlier = queue->last;
    if (queue->last) queue->last->later = r;
    else queue->first = r;
    queue->last = r;
    pthread_cond_signal(&r->refiner->work);
}

static void note_hunger(struct refinement *r) {
    const bool is_hungry = r->has_work && !r->has_some;
    r->refiner->hungry += (size_t)is_hungry - (size_t)r->is_hungry;
    r->is_hungry = is_hungry;
}

/* What has nothing yet, in turn; then coarse cuts before fine ones. */
static struct refinement *next_one(const struct refiner *refiner) {
    for (int i = HUNGRY; i >= 0; i--)
        if (refiner->queues[i].first) return refiner->queues[i].first;
    return NULL;
}

/* Nodes below half a pixel are as many as the leaves, which 0 asks for: coarser than those are such of half a pixel and more. */
static double pixels_of(double asked, int level) {
    return ldexp(fmax(asked, 0.25), level);
}

static double threshold_of(double asked, int level) {
    return level == 0 ? asked : pixels_of(asked, level);
}

/* Nodes are as many as 1 / pixels^2, about. As that may be wrong, finer ones are tried one level at a time, and what is as fine as
 * the last is kept until it takes twice the time: else levels would go to and fro. */
int refine_first_level(const struct refine_history *history, double asked, double seconds) {
    int level = 0;
    for (; level < MOST_LEVELS; level++) {
        const double pixels = pixels_of(asked, level) * (1 + 1e-9), finer = history->pixels / pixels;
        const double expected = history->seconds * finer * finer;
        if (pixels >= history->least && finer <= 2 && expected <= (finer > 1 ? seconds : 2 * seconds)) break;
    }
    return level;
}

/* Of a hungry one: they share the time. */
static int first_level(const struct refinement *r) {
    return refine_first_level(&r->history, r->asked.threshold, r->patience / (double)r->refiner->hungry);
}

/* With the lock, which is given up meanwhile. */
static void make_one(struct refiner *refiner, struct refinement *r) {
    const int level = r->is_hungry ? first_level(r) : r->level;
    const uint64_t serial = r->serial;
    struct refined *refined = &r->refined;
    struct occlusion occlusion = r->occlusion;
    memcpy(&refined->view, &r->asked, sizeof refined->view); /* padding included: views are compared as bytes */
    refined->view.threshold = threshold_of(r->asked.threshold, level);
    refined->view.edge = ldexp(r->asked.edge, level);
    refined->tag = r->tag;
    occluders_release(&refined->hidden_by);
    refined->hidden_by = occluders_retain(occlusion.by);
    leave_queue(r);
    refiner->running = r;
    refiner->running_serial = serial;
    refiner->running_level = level;
    refiner->running_pixels = pixels_of(r->asked.threshold, level);
    const double start = refiner->running_since = now();
    atomic_store(&refiner->cancel, false);
    pthread_mutex_unlock(&refiner->lock);
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
    if (refined->result == PBR_OK) {
        if (r->caution > 0) r->caution--;
        r->history = (struct refine_history){refiner->running_pixels, refined->seconds, r->caution > 0 ? r->history.least : 0};
    }
    if (refined->result != PBR_ERROR_CANCELLED) {
        r->state = FINISHED;
        if (serial == r->serial) {
            r->has_some = true;
            r->level = level > 0 ? level - 1 : 0;
            r->has_work = r->has_work && level > 0 && refined->result == PBR_OK;
        }
    }
    note_hunger(r);
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
    r->history.least = lod_point_count(lod) > SMALL ? FIRST_PIXELS : 0;
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
    r->has_work = false;
    note_hunger(r);
    if (is_running) {
        r->is_dead = true;
        atomic_store(&refiner->cancel, true);
    } else {
        leave_queue(r);
        unlink_one(r);
    }
    pthread_mutex_unlock(&refiner->lock);
    if (!is_running) dispose(r);
}

/* Cuts that are as fine as this are not tried for some time. */
static void avoid(struct refinement *r, double pixels) {
    r->history.least = 2 * pixels;
    r->caution = CAUTION;
}

/* Gives up a first cut that takes too long, unless it is the coarsest. */
static void give_up_late(struct refinement *r) {
    const struct refiner *refiner = r->refiner;
    if (refiner->running != r || r->has_some || refiner->running_level == MOST_LEVELS) return;
    if (now() - refiner->running_since < r->patience) return;
    avoid(r, refiner->running_pixels);
    atomic_store(&r->refiner->cancel, true);
}

void refinement_ask(struct refinement *r, const struct cut_view *view, const struct occlusion *occlusion, double patience,
                    uint64_t tag) {
    struct refiner *refiner = r->refiner;
    pthread_mutex_lock(&refiner->lock);
    r->patience = patience;
    give_up_late(r);
    if (refiner->running == r && r->has_some) atomic_store(&refiner->cancel, true);
    if (!r->is_hungry) leave_queue(r); /* else it keeps its place */
    memcpy(&r->asked, view, sizeof r->asked);
    occluders_release(&r->occlusion.by);
    if (occlusion) r->occlusion = *occlusion;
    occluders_retain(r->occlusion.by);
    r->tag = tag;
    r->serial++;
    r->has_work = true;
    r->has_some = false;
    note_hunger(r);
    join_queue(r);
    pthread_mutex_unlock(&refiner->lock);
}

void refinement_stop(struct refinement *r) {
    struct refiner *refiner = r->refiner;
    pthread_mutex_lock(&refiner->lock);
    leave_queue(r);
    r->has_work = false;
    note_hunger(r);
    occluders_release(&r->occlusion.by);
    if (refiner->running == r) atomic_store(&refiner->cancel, true);
    pthread_mutex_unlock(&refiner->lock);
}

void refinement_refuse(struct refinement *r) {
    pthread_mutex_lock(&r->refiner->lock);
    r->has_work = false;
    note_hunger(r);
    avoid(r, pixels_of(r->refined.view.threshold, 0));
    pthread_mutex_unlock(&r->refiner->lock);
}

struct refined *refinement_take(struct refinement *r) {
    pthread_mutex_lock(&r->refiner->lock);
    const bool is_finished = r->state == FINISHED;
    if (is_finished) r->state = TAKEN;
    else if (r->refiner->running_serial != r->serial) give_up_late(r);
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
