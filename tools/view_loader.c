/* The thread that reads files. SPDX-License-Identifier: MIT */
#include "view_loader.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct done {
    struct input input;
    bool loaded;
    char message[SESSION_LINE];
};

struct loader {
    struct session *session;
    const char *const *paths;
    uint32_t count;
    unsigned wanted; /* INPUT_... */
    void (*notify)(void);
    pthread_t thread;
    pthread_mutex_t lock; /* of all that follows */
    pthread_cond_t ended; /* is_running has become false */
    bool is_running, is_cancelled;
    uint32_t done_count, taken_count; /* files read or failed; told of */
    const char *stage;
    double fraction;
    struct done done[];
};

static int receive_progress(void *user, const char *stage, double fraction) {
    struct loader *loader = user;
    pthread_mutex_lock(&loader->lock);
    bool goes_on = !loader->is_cancelled;
    loader->stage = stage;
    loader->fraction = fraction;
    if (goes_on) loader->notify();
    pthread_mutex_unlock(&loader->lock);
    return goes_on;
}

/* False if there is no more to read. */
static bool read_next(struct loader *loader) {
    struct done *done = &loader->done[loader->done_count];
    const char *path = loader->paths[loader->done_count];
    bool loaded = input_load(loader->session, path, loader->wanted, receive_progress, loader, &done->input);
    if (!loaded) session_last_error(loader->session, done->message, sizeof done->message);
    pthread_mutex_lock(&loader->lock);
    done->loaded = loaded;
    loader->done_count++;
    loader->stage = NULL;
    loader->fraction = 0;
    loader->is_running = !loader->is_cancelled && loader->done_count < loader->count;
    if (!loader->is_running) pthread_cond_signal(&loader->ended);
    if (!loader->is_cancelled) loader->notify();
    bool goes_on = loader->is_running;
    pthread_mutex_unlock(&loader->lock);
    return goes_on;
}

static void *read_all(void *user) {
    while (read_next(user)) {
    }
    return NULL;
}

static void destroy(struct loader *loader) {
    for (uint32_t i = 0; i < loader->done_count; i++) input_release(&loader->done[i].input);
    pthread_cond_destroy(&loader->ended);
    pthread_mutex_destroy(&loader->lock);
    free(loader);
}

struct loader *loader_start(struct session *session, const char *const *paths, uint32_t count, unsigned wanted,
                            void (*notify)(void)) {
    struct loader *loader = calloc(1, sizeof *loader + count * sizeof loader->done[0]);
    if (!loader) {
        session_fail(session, "no memory to read %u files", (unsigned)count);
        return NULL;
    }
    loader->session = session;
    loader->paths = paths;
    loader->count = count;
    loader->wanted = wanted;
    loader->notify = notify;
    loader->is_running = true;
    pthread_condattr_t clock;
    pthread_condattr_init(&clock);
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
    pthread_cond_init(&loader->ended, &clock);
    pthread_condattr_destroy(&clock);
    pthread_mutex_init(&loader->lock, NULL);
    int error = pthread_create(&loader->thread, NULL, read_all, loader);
    if (error == 0) return loader;
    session_fail(session, "no thread to read files: %s", strerror(error));
    destroy(loader);
    return NULL;
}

struct loader_progress loader_progress(struct loader *loader) {
    struct loader_progress progress = {0};
    pthread_mutex_lock(&loader->lock);
    progress.is_running = loader->is_running;
    progress.index = loader->done_count;
    if (loader->is_running) progress.path = loader->paths[loader->done_count];
    progress.stage = loader->stage;
    progress.fraction = loader->fraction;
    pthread_mutex_unlock(&loader->lock);
    return progress;
}

enum loader_news loader_take(struct loader *loader, struct input *input, char *message, size_t capacity) {
    enum loader_news news = LOADER_NOTHING;
    pthread_mutex_lock(&loader->lock);
    if (loader->taken_count < loader->done_count) {
        struct done *done = &loader->done[loader->taken_count++];
        news = done->loaded ? LOADER_INPUT : LOADER_FAILURE;
        *input = input_move(&done->input);
        snprintf(message, capacity, "%s", done->message);
        if (!done->loaded) input_release(input);
    }
    pthread_mutex_unlock(&loader->lock);
    return news;
}

bool loader_stop(struct loader **loader_pointer) {
    enum { PATIENCE = 2 }; /* seconds; readers ask far more often whether they may go on */
    struct loader *loader = *loader_pointer;
    struct timespec limit;
    int error = 0;
    if (!loader) return true;
    clock_gettime(CLOCK_MONOTONIC, &limit);
    limit.tv_sec += PATIENCE;
    pthread_mutex_lock(&loader->lock);
    loader->is_cancelled = true;
    while (loader->is_running && error != ETIMEDOUT) error = pthread_cond_timedwait(&loader->ended, &loader->lock, &limit);
    bool has_ended = !loader->is_running;
    pthread_mutex_unlock(&loader->lock);
    if (!has_ended) return false;
    pthread_join(loader->thread, NULL);
    destroy(loader);
    *loader_pointer = NULL;
    return true;
}
