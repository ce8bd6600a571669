/* Timestamps in a ring. They are not elapsed-time queries, of which a context has one at a time, maybe the host's.
 * SPDX-License-Identifier: MIT */
#include "timer.h"

#include "renderer.h"

static void make_queries(const struct gl *gl, struct timer *timer) {
    GLuint names[2 * TIMER_FRAMES] = {0};
    (*gl->GenQueries)(2 * TIMER_FRAMES, names);
    for (int i = 0; i < TIMER_FRAMES; i++) {
        timer->frames[i].begin = names[2 * i];
        timer->frames[i].end = names[2 * i + 1];
    }
}

static struct timed_frame *next_frame(struct timer *timer) {
    return &timer->frames[(timer->first + timer->count) % TIMER_FRAMES];
}

void timer_begin(const struct gl *gl, struct timer *timer) {
    timer->is_running = timer->count < TIMER_FRAMES;
    if (!timer->is_running) return;
    if (gl->timestamp_bits > 0 && timer_object_count(timer) == 0) make_queries(gl, timer);
    struct timed_frame *frame = next_frame(timer);
    frame->has_timestamps = gl->timestamp_bits > 0 && frame->begin && frame->end;
    frame->called = renderer_seconds();
    if (frame->has_timestamps) (*gl->QueryCounter)(frame->begin, GL_TIMESTAMP);
}

void timer_end(const struct gl *gl, struct timer *timer, float tag) {
    if (!timer->is_running) return;
    struct timed_frame *frame = next_frame(timer);
    if (frame->has_timestamps) (*gl->QueryCounter)(frame->end, GL_TIMESTAMP);
    frame->called = renderer_seconds() - frame->called;
    frame->tag = tag;
    timer->is_running = false;
    timer->count++;
}

static bool is_available(const struct gl *gl, GLuint query) {
    GLuint available = GL_FALSE;
    (*gl->GetQueryObjectuiv)(query, GL_QUERY_RESULT_AVAILABLE, &available);
    return available != GL_FALSE;
}

static bool is_done(const struct gl *gl, const struct timed_frame *frame) {
    return !frame->has_timestamps || (is_available(gl, frame->end) && is_available(gl, frame->begin));
}

/* Of a done frame. Counters of fewer than 64 bits start again from 0, some after a minute. */
static double gpu_seconds(const struct gl *gl, const struct timed_frame *frame) {
    GLuint64 begin = 0, end = 0;
    (*gl->GetQueryObjectui64v)(frame->begin, GL_QUERY_RESULT, &begin);
    (*gl->GetQueryObjectui64v)(frame->end, GL_QUERY_RESULT, &end);
    const GLuint64 mask = gl->timestamp_bits < 64 ? ((GLuint64)1 << gl->timestamp_bits) - 1 : ~(GLuint64)0;
    return 1e-9 * (double)((end - begin) & mask);
}

static bool take(const struct gl *gl, struct timer *timer, double *seconds, float *tag) {
    const struct timed_frame *newest = NULL;
    for (; timer->count > 0 && is_done(gl, &timer->frames[timer->first]); timer->count--) {
        newest = &timer->frames[timer->first];
        timer->first = (timer->first + 1) % TIMER_FRAMES;
    }
    if (!newest) return false;
    const double gpu = newest->has_timestamps ? gpu_seconds(gl, newest) : 0;
    *seconds = gpu > newest->called ? gpu : newest->called;
    *tag = newest->tag;
    return true;
}

/* Where the host has bound a buffer for results, these would go there. One that it deleted since, in another context, cannot be
 * bound again. */
bool timer_take(const struct gl *gl, struct timer *timer, double *seconds, float *tag) {
    GLint buffer = 0;
    if (timer->count == 0) return false;
    if (gl->has_query_buffer) (*gl->GetIntegerv)(GL_QUERY_BUFFER_BINDING, &buffer);
    if (buffer) (*gl->BindBuffer)(GL_QUERY_BUFFER, 0);
    const bool taken = take(gl, timer, seconds, tag);
    if (buffer && (*gl->IsBuffer)((GLuint)buffer)) (*gl->BindBuffer)(GL_QUERY_BUFFER, (GLuint)buffer);
    return taken;
}

int timer_object_count(const struct timer *timer) {
    return timer->frames[0].begin ? 2 * TIMER_FRAMES : 0;
}

void timer_free(const struct gl *gl, struct timer *timer) {
    for (int i = 0; i < TIMER_FRAMES && gl && timer_object_count(timer) > 0; i++) {
        (*gl->DeleteQueries)(1, &timer->frames[i].begin);
        (*gl->DeleteQueries)(1, &timer->frames[i].end);
    }
    *timer = (struct timer){0};
}
