/* Loops over the instance's threads. Workers live as long as the loop, so a host never finds a thread of ours, or one that takes
 * its signals. SPDX-License-Identifier: MIT */
#include "instance.h"

#include <pthread.h>
#include <signal.h>

struct loop {
    pbr_range_fn work;
    void *user;
    size_t count, grain;
    atomic_size_t next;
    _Atomic pbr_result result;
};

static void run(struct loop *loop) {
    for (;;) {
        size_t begin = atomic_fetch_add(&loop->next, loop->grain);
        if (begin >= loop->count || atomic_load_explicit(&loop->result, memory_order_relaxed) != PBR_OK) return;
        size_t end = loop->count - begin < loop->grain ? loop->count : begin + loop->grain;
        pbr_result result = loop->work(loop->user, begin, end), none = PBR_OK;
        if (result != PBR_OK) atomic_compare_exchange_strong(&loop->result, &none, result);
    }
}

static void *worker(void *loop) {
    run(loop);
    return NULL;
}

pbr_result pbr_parallel(pbr_instance *instance, size_t count, size_t grain, pbr_range_fn work, void *user) {
    enum { MOST = 64 };
    if (grain == 0) grain = 1;
    size_t pieces = count / grain + (count % grain != 0);
    size_t wanted = pbr_instance_threads(instance);
    if (wanted > pieces) wanted = pieces;
    if (wanted > MOST) wanted = MOST;
    struct loop loop = {.work = work, .user = user, .count = count, .grain = grain};

    pthread_t threads[MOST];
    size_t started = 0;
    if (wanted > 1) {
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before);
        while (started + 1 < wanted && pthread_create(&threads[started], NULL, worker, &loop) == 0) started++;
        pthread_sigmask(SIG_SETMASK, &before, NULL);
    }
    run(&loop);
    for (size_t i = 0; i < started; i++) pthread_join(threads[i], NULL);
    return atomic_load(&loop.result);
}

struct reporting {
    pbr_range_fn work;
    void *user;
    pthread_t caller;
    size_t count;
    atomic_size_t done;
    double told; /* fraction; the caller's thread alone looks at it */
    const struct progress *progress;
    const char *stage;
};

static pbr_result work_and_report(void *user, size_t begin, size_t end) {
    struct reporting *reporting = user;
    const pbr_result result = reporting->work(reporting->user, begin, end);
    const size_t done = atomic_fetch_add(&reporting->done, end - begin) + (end - begin);
    const double fraction = (double)done / (double)reporting->count;
    if (result != PBR_OK || done == reporting->count || !pthread_equal(reporting->caller, pthread_self())) return result;
    return progress_report_some(reporting->progress, reporting->stage, fraction, &reporting->told);
}

pbr_result parallel_reporting(pbr_instance *instance, size_t count, size_t grain, pbr_range_fn work, void *user,
                              const struct progress *progress, const char *stage) {
    struct reporting reporting = {
        .work = work, .user = user, .caller = pthread_self(), .count = count, .progress = progress, .stage = stage};
    pbr_result result = progress_report(progress, stage, 0);
    if (result == PBR_OK) result = pbr_parallel(instance, count, grain, work_and_report, &reporting);
    return result == PBR_OK ? progress_report(progress, stage, 1) : result;
}
