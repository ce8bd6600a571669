/* What the GL tests share: a context of the kind that PBR_TEST_GL names, a host program around libpbr that counts what it hands
 * out, render targets that can be read back, and matrices. SPDX-License-Identifier: MIT */
#ifndef TESTS_GL_SUPPORT_H
#define TESTS_GL_SUPPORT_H

#include <epoxy/gl.h>
#include <pbr/pbr.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#include <cmocka.h> /* needs those above */

#include "headless.h"

/* ---- The context ---- */

/* The kind under test: "3.3" and "compat" are made to be exactly OpenGL 3.3, "es3.0" exactly OpenGL ES 3.0. */
enum headless_kind context_kind(void);
bool context_is_es(void);
bool context_is_compat(void);
/* At least this desktop version, or this ES version; 0 = in no version of that API. */
bool context_has(int desktop, int es);
bool context_has_extension(const char *name);

/* Function lookup that knows only what the kind's version has (all of the driver's for "4.5" and "es3.2"). */
void *context_get_proc(void *user, const char *name);
/* Functions that were asked for and are not of the version, so far. */
size_t context_refused_count(void);

/* Runs the tests with the context current; 77 (skipped) with a reason where the machine has no such context. */
int run_gl_tests(const char *name, const struct CMUnitTest *tests, size_t count);
#define RUN_GL_TESTS(name, tests) run_gl_tests(name, tests, sizeof(tests) / sizeof((tests)[0]))
/* Each test gets a fresh host in *state; afterwards: no GL error, no error message of the driver, no leaked memory. */
#define GL_TEST(function) cmocka_unit_test_setup_teardown(function, host_setup, host_teardown)

/* Takes the context off this thread, and puts it back. */
void context_release(void);
void context_restore(void);
/* After an error that a test made on purpose. */
void context_forget_errors(void);

/* Fails if OpenGL has an error pending or the driver has reported one through KHR_debug. */
void expect_no_gl_error(const char *where);

/* ---- The host ---- */

struct memory {
    atomic_size_t blocks;         /* alive */
    atomic_size_t allocations;    /* ever */
    size_t fail_first, fail_last; /* allocations with these numbers (1 = first ever) fail; 0 = none */
};

struct host {
    struct memory memory;
    char log[512]; /* the last message */
    size_t errors; /* messages of level error */
    pbr_instance *instance;
    pbr_renderer *renderer;
    pbr_view *view;
};

int host_setup(void **state);
int host_teardown(void **state);
pbr_instance_desc host_instance_desc(struct host *host);
pbr_renderer_desc host_renderer_desc(void);
/* Replaces renderer and view. */
void host_use_renderer(struct host *host, const pbr_renderer_desc *desc);
void host_drop_renderer(struct host *host);
/* Another instance, for hosts have one thread: their points and hierarchies are to be gone. */
void host_use_threads(struct host *host, uint32_t count);
/* Smallest limit: every splat over it takes the quad path. */
void host_use_quads(struct host *host);

/* pbr_render, which must succeed and leave no GL error. */
pbr_stats render(struct host *host, const pbr_frame *frame, const pbr_item *items, size_t count);

/* One point with double coordinates exactly as given. */
pbr_points *one_point(struct host *host, const double position[3], float radius);
/* An item of one white unlit kind. */
pbr_item plain_item(const pbr_points *points, uint32_t splat);
/* An item of a hierarchy, with defaults. */
pbr_item lod_item(const pbr_lod *lod, uint32_t splat);

/* ---- Targets: rows from bottom to top, index y * width + x ---- */

struct target {
    GLuint framebuffer, colour, depth;
    GLenum colour_format, depth_format;
    int width, height, samples;
};

/* depth_format 0 = none; GL_DEPTH24_STENCIL8 brings a stencil buffer, cleared to 0. False, with nothing made, where the context
 * cannot draw to the formats. */
bool target_create(struct target *target, int width, int height, GLenum colour_format, GLenum depth_format, int samples);
void target_destroy(struct target *target);
void target_bind(const struct target *target);
/* A square of 8-bit colour and float depth, bound; closing destroys any target and leaves none bound. */
void target_open(struct target *target, int size);
void target_close(struct target *target);
/* Clears all of it, whatever is bound; needs write masks, scissor and discard at their defaults. */
void target_clear(const struct target *target, const float rgba[4], float depth);
/* Bytes as stored. Multisampled targets are resolved first. */
void target_read(const struct target *target, uint8_t (*rgba)[4]);
void target_read_float(const struct target *target, float (*rgba)[4]);
/* Window depth, through a shader: OpenGL ES cannot read it back. Not for multisampled targets. */
void target_read_depth(const struct target *target, float *depth);
/* Clears to 0, and depth to what is farthest by the frame's flags; renders and reads. */
pbr_stats draw_picture(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *items, size_t count,
                       uint8_t (*rgba)[4]);
/* How many of so many pixels have something in them. */
int covered_pixels(uint8_t (*rgba)[4], int count);
/* A PNG in the folder that PBR_TEST_OUT names, for looking; does nothing without it. */
void picture_save(const char *name, const uint8_t (*rgba)[4], int width, int height);

GLuint build_program(const char *vertex, const char *fragment); /* without their #version lines */
/* A quad over all of the viewport at this window depth, of one colour, with the host's current state. */
void draw_host_quad(float depth, const float rgba[4]);

/* ---- Matrices: double, column-major ---- */

void matrix_identity(double m[16]);
void matrix_scaling(double x, double y, double z, double m[16]);
void matrix_translation(double x, double y, double z, double m[16]);
void matrix_rotation(const double axis[3], double radians, double m[16]);
void matrix_perspective(double field_of_view, double aspect, double near, double far, double m[16]);
void matrix_frustum(double left, double right, double bottom, double top, double near, double far, double m[16]);
void matrix_ortho(double left, double right, double bottom, double top, double near, double far, double m[16]);
/* Clip depth -w..w to 0..w, or reversed to w..0 besides. */
void matrix_zero_to_one(double projection[16], bool reversed);
bool matrix_invert(const double m[16], double out[16]);
void matrix_apply(const double m[16], const double v[4], double out[4]);

/* ---- What the API's documentation says about one splat ---- */

struct placed {
    double x, y;   /* centre in the window, pixels */
    double depth;  /* window depth */
    double size;   /* diameter or side, pixels */
    bool is_drawn; /* the centre is between the near and far planes and before the eye */
};

/* Where the frame puts a point of this radius; model NULL = identity. */
struct placed place(const pbr_frame *frame, const pbr_item *item, const double *model, const double position[3], double radius);
/* Distance in pixels from a pixel's centre to the splat's edge: negative inside. */
double edge_distance(const struct placed *splat, uint32_t kind, int x, int y);

/* ---- Cameras of every kind ---- */

enum { CAMERAS = 13, PICTURE_WIDTH = 96, PICTURE_HEIGHT = 80 };

struct camera {
    const char *name;
    pbr_frame frame;
    double model[16]; /* object -> world */
};

/* For targets of PICTURE_WIDTH x PICTURE_HEIGHT. The first is a plain perspective from 1 to 100; the last has reversed depth. */
void make_cameras(struct camera cameras[CAMERAS]);
/* A frame that waits, with the origin ahead; turned so that no lattice of positions lies along the view, and by radians more. */
pbr_frame turned_frame(double radians, double distance, double near, double far, int size);
void frame_set_viewport(pbr_frame *frame, int x, int y, int width, int height);
/* The object-space point with these normalised device coordinates. */
void unproject(const struct camera *camera, const double ndc[3], double position[3]);
/* Radius that gives a splat there this diameter in pixels. */
double radius_for(const struct camera *camera, const double position[3], double size);
/* Somewhere in or up to half a picture beside the view, away from the near and far planes by more than rounding. */
void random_position(const struct camera *camera, uint64_t *seed, double position[3]);

/* ---- Random numbers that are the same everywhere ---- */

double random_between(uint64_t *state, double low, double high);
double random_log(uint64_t *state, double low, double high);

#endif
