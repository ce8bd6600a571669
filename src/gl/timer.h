/* How long frames take on the GPU, known some frames later, without waiting. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_TIMER_H
#define PBR_GL_TIMER_H

#include "context.h"

/* Frames in flight; while there are so many no further one is timed. */
enum { TIMER_FRAMES = 8 };

struct timed_frame {
    GLuint begin, end; /* queries of timestamps */
    float tag;
    double called;       /* seconds of the clock: when the frame began, then what passed until it was ended */
    bool has_timestamps; /* it asked for them */
};

/* Zero at the start. A ring; of one context. */
struct timer {
    struct timed_frame frames[TIMER_FRAMES];
    int first, count; /* those that wait for their times, oldest first */
    bool is_running;  /* the one after these has begun */
};

/* Around what a frame sends to the GPU; what the tag means is the caller's, and not known before the end. A frame that began and
 * did not end, since it failed, is forgotten when the next one begins. No state is left and no error raised; all queries are made
 * at the first call. */
void timer_begin(const struct gl *gl, struct timer *timer);
void timer_end(const struct gl *gl, struct timer *timer, float tag);

/* The newest frame whose time is known, once; those before it are dropped. The time is the GPU's from begin to end or that of the
 * calling thread, whichever is longer: they go on side by side, so it is the longer one that a frame waits for. Without timestamps
 * it is the thread's. False: nothing new. */
bool timer_take(const struct gl *gl, struct timer *timer, double *seconds, float *tag);

/* Names of GL objects held. */
int timer_object_count(const struct timer *timer);

/* With gl NULL (abandoned context) no GL call is made. */
void timer_free(const struct gl *gl, struct timer *timer);

#endif
