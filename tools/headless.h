/* An offscreen OpenGL context through EGL: what the tool, the benchmarks and the tests draw in. There is no default framebuffer to
 * rely on: draw into framebuffer objects. SPDX-License-Identifier: MIT */
#ifndef HEADLESS_H
#define HEADLESS_H

#include <stdbool.h>

enum headless_kind { HEADLESS_GL_33, HEADLESS_GL_45, HEADLESS_GL_COMPAT, HEADLESS_ES_30, HEADLESS_ES_32 };

/* Zero when there is no context. */
struct headless {
    enum headless_kind kind;
    void *display, *context; /* EGLDisplay, EGLContext */
    void *surface;           /* EGLSurface; NULL where a context can be current without one */
};

/* "3.3", "4.5" (core profiles), "compat" (3.3 or later, compatibility profile), "es3.0", "es3.2". False for anything else. */
bool headless_kind_parse(const char *text, enum headless_kind *kind);
const char *headless_kind_name(enum headless_kind kind);
bool headless_kind_is_es(enum headless_kind kind);
/* The least version, major and minor. */
void headless_kind_version(enum headless_kind kind, int version[2]);

/* Creates a context of at least the kind's version (drivers give their newest compatible one) and makes it current on the calling
 * thread. With `debug` it reports through KHR_debug. NULL on success; else why not, in static storage, and nothing is held. */
const char *headless_create(struct headless *headless, enum headless_kind kind, bool debug);

/* A context is current on one thread at a time: release it on one before another makes it current. False if EGL refuses. */
bool headless_make_current(const struct headless *headless);
void headless_release_current(const struct headless *headless);

/* From any thread where the context is current, or nowhere current. The display stays initialised: contexts of the process share
 * it. */
void headless_destroy(struct headless *headless);

/* Address of an OpenGL function, as pbr_renderer_desc::get_proc_address wants it; `user` is not used. A driver may return addresses
 * for functions that the context lacks. */
void *headless_get_proc(void *user, const char *name);

#endif
