/* A function for each of OpenGL's. SPDX-License-Identifier: MIT */
#include "gl_calls.h"

#include <epoxy/gl.h>
#include <stdbool.h>
#include <string.h>
#include <time.h>

#include "headless.h"

/* The driver's functions. */
static struct {
#define RETURNS(type, name, parameters, arguments) type(APIENTRY *name) parameters;
#define ASKS(name, parameters, arguments) RETURNS(void, name, parameters, arguments)
#define WORK ASKS
#define STATE ASKS
#include "gl_functions.h"
#undef RETURNS
#undef ASKS
#undef WORK
#undef STATE
} driver;

static enum gl_passage passage;
static struct gl_calls calls;

double gl_calls_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double begin_asking(void) {
    calls.all++;
    calls.asking++;
    return passage == GL_PASS_ASKING ? gl_calls_seconds() : 0;
}

static void end_asking(double start) {
    if (passage == GL_PASS_ASKING) calls.asking_seconds += gl_calls_seconds() - start;
}

#define RETURNS(type, name, parameters, arguments)                                                                                 \
    static type APIENTRY our_##name parameters {                                                                                   \
        const double start = begin_asking();                                                                                       \
        type result = driver.name arguments;                                                                                       \
        end_asking(start);                                                                                                         \
        return result;                                                                                                             \
    }
#define ASKS(name, parameters, arguments)                                                                                          \
    static void APIENTRY our_##name parameters {                                                                                   \
        const double start = begin_asking();                                                                                       \
        driver.name arguments;                                                                                                     \
        end_asking(start);                                                                                                         \
    }
#define WORK(name, parameters, arguments)                                                                                          \
    static void APIENTRY our_##name parameters {                                                                                   \
        calls.all++;                                                                                                               \
        calls.working++;                                                                                                           \
        if (passage == GL_PASS_ALL) driver.name arguments;                                                                         \
    }
#define STATE(name, parameters, arguments)                                                                                         \
    static void APIENTRY our_##name parameters {                                                                                   \
        calls.all++;                                                                                                               \
        if (passage != GL_PASS_ASKING) driver.name arguments;                                                                      \
    }
#include "gl_functions.h"
#undef RETURNS
#undef ASKS
#undef WORK
#undef STATE

void gl_calls_begin(enum gl_passage allowed) {
    passage = allowed;
    calls = (struct gl_calls){0};
}

struct gl_calls gl_calls_end(void) {
    passage = GL_PASS_ALL;
    return calls;
}

void *gl_calls_get_proc(void *user, const char *name) {
    void *address = headless_get_proc(user, name);
    if (!address || strncmp(name, "gl", 2) != 0) return address;
/* Pointers to functions are no pointers to objects in C, but as bytes. */
#define RETURNS(type, function, parameters, arguments)                                                                             \
    if (!strcmp(name + 2, #function)) {                                                                                            \
        type(APIENTRY *ours) parameters = our_##function;                                                                          \
        memcpy(&driver.function, &address, sizeof address);                                                                        \
        memcpy(&address, &ours, sizeof address);                                                                                   \
        return address;                                                                                                            \
    }
#define ASKS(function, parameters, arguments) RETURNS(void, function, parameters, arguments)
#define WORK ASKS
#define STATE ASKS
#include "gl_functions.h"
    return address;
}
