/* Between libpbr and the driver: counts OpenGL's calls, and lets no more of them through than a measurement is about. Of the whole
 * process, as OpenGL's functions are. SPDX-License-Identifier: MIT */
#ifndef GL_CALLS_H
#define GL_CALLS_H

#include <stdint.h>

enum gl_passage {
    GL_PASS_ALL,
    GL_PASS_STATE, /* not what draws, computes or copies */
    GL_PASS_ASKING /* only what tells something, its time apart */
};

struct gl_calls {
    uint64_t all;
    uint64_t asking;       /* of them: tell something */
    uint64_t working;      /* of them: draw, compute or copy */
    double asking_seconds; /* with GL_PASS_ASKING: the driver's time */
};

/* From now on; the counts begin at 0. */
void gl_calls_begin(enum gl_passage passage);
struct gl_calls gl_calls_end(void);

/* As pbr_renderer_desc::get_proc_address wants it. Functions of extensions are passed by, uncounted. */
void *gl_calls_get_proc(void *user, const char *name);

double gl_calls_seconds(void);

#endif
