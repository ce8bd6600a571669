/* libpbr in one page: a torus of points, drawn into a framebuffer object of a context without a window, written as a picture.
 * The libpbr part is draw_torus(); the rest is what every OpenGL program has already.
 *
 *     minimal_egl torus.ppm
 *
 * SPDX-License-Identifier: MIT */
#include <epoxy/gl.h> /* before EGL's headers, which define the same basic types */

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <math.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 640, HEIGHT = 480, AROUND = 600, ACROSS = 240, POINTS = AROUND * ACROSS };

struct surfel {
    float position[3], normal[3], radius;
    uint8_t colour[4]; /* sRGB */
};

/* Any layout of yours will do: libpbr is told pointers, strides and formats, and copies. */
static void compute_torus(struct surfel *surfels) {
    for (int i = 0; i < POINTS; i++) {
        float u = 6.2831853f * (float)(i / ACROSS) / AROUND, v = 6.2831853f * (float)(i % ACROSS) / ACROSS;
        float normal[3] = {cosf(u) * cosf(v), sinf(u) * cosf(v), sinf(v)};
        float position[3] = {cosf(u) + 0.4f * normal[0], sinf(u) + 0.4f * normal[1], 0.4f * normal[2]};
        for (int k = 0; k < 3; k++) {
            surfels[i].position[k] = position[k];
            surfels[i].normal[k] = normal[k];
            surfels[i].colour[k] = (uint8_t)(127.5f + 127.5f * sinf(3 * u + 2 * (float)k));
        }
        surfels[i].colour[3] = 255;
        surfels[i].radius = 0.011f; /* a little over half the largest gap between neighbours: no holes */
    }
}

/* Where libpbr explains what went wrong. It prints nothing itself. */
static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "libpbr: %s (%s)\n", text, pbr_result_name(code));
}

static pbr_result draw_torus(const struct surfel *surfels) {
    pbr_instance_desc instance_desc = PBR_INSTANCE_DESC_INIT; /* memory, messages, threads: zero means default */
    pbr_points_desc points_desc = PBR_POINTS_DESC_INIT;       /* what the points are: arrays, read during the call */
    pbr_frame frame = PBR_FRAME_INIT;                         /* the camera; by default into what is bound */
    pbr_item item = PBR_ITEM_INIT;                            /* what to draw and how: round, lit, in the points' colours */
    pbr_instance *instance = NULL;
    pbr_points *points = NULL;
    pbr_renderer *renderer = NULL; /* one for each OpenGL context */
    pbr_view *view = NULL;         /* one for each camera */

    instance_desc.log = print_message;
    points_desc.count = POINTS;
    points_desc.positions = (pbr_attribute){surfels->position, sizeof *surfels, PBR_FORMAT_FLOAT32, 3};
    points_desc.normals = (pbr_attribute){surfels->normal, sizeof *surfels, PBR_FORMAT_FLOAT32, 3};
    points_desc.radii = (pbr_attribute){&surfels->radius, sizeof *surfels, PBR_FORMAT_FLOAT32, 1};
    points_desc.colours = (pbr_attribute){surfels->colour, sizeof *surfels, PBR_FORMAT_UINT8, 4};

    const double near = 1, far = 10, scale = 2; /* scale: 1 / tan(half the vertical field of view) */
    const double tilt = 0.9, distance = 4;      /* the world leans back by `tilt`, `distance` before the eye */
    double world_to_eye[16] = {1, 0, 0, 0, 0, cos(tilt), -sin(tilt), 0, 0, sin(tilt), cos(tilt), 0, 0, 0, -distance, 1};
    double eye_to_clip[16] = {[0] = scale * HEIGHT / WIDTH,
                              [5] = scale,
                              [10] = (far + near) / (near - far),
                              [11] = -1,
                              [14] = 2 * far * near / (near - far)};
    for (int i = 0; i < 16; i++) {
        frame.view[i] = world_to_eye[i];
        frame.projection[i] = eye_to_clip[i];
    }

    pbr_result result = pbr_instance_create(&instance_desc, &instance);
    if (result == PBR_OK) result = pbr_points_create(instance, &points_desc, &points);
    if (result == PBR_OK) result = pbr_renderer_create(instance, NULL, &renderer);
    if (result == PBR_OK) result = pbr_view_create(renderer, NULL, &view);
    item.points = points;
    if (result == PBR_OK) result = pbr_render(view, &frame, &item, 1, NULL);

    pbr_view_destroy(&view);
    pbr_renderer_destroy(&renderer);
    pbr_points_release(&points);
    pbr_instance_destroy(&instance);
    return result;
}

static EGLContext open_context(EGLDisplay *display) {
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
    *display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (*display == EGL_NO_DISPLAY || !eglInitialize(*display, NULL, NULL) || !eglBindAPI(EGL_OPENGL_API)) return EGL_NO_CONTEXT;
    EGLContext context = eglCreateContext(*display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, version);
    return context && eglMakeCurrent(*display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) ? context : EGL_NO_CONTEXT;
}

/* A framebuffer object with colour and depth, bound and cleared. Deleted with the context. */
static int open_framebuffer(void) {
    GLuint framebuffer, buffers[2];
    glGenFramebuffers(1, &framebuffer);
    glGenRenderbuffers(2, buffers);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    for (int i = 0; i < 2; i++) {
        glBindRenderbuffer(GL_RENDERBUFFER, buffers[i]);
        glRenderbufferStorage(GL_RENDERBUFFER, i ? GL_DEPTH_COMPONENT24 : GL_RGBA8, WIDTH, HEIGHT);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, i ? GL_DEPTH_ATTACHMENT : GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, buffers[i]);
    }
    glViewport(0, 0, WIDTH, HEIGHT);
    glClearColor(0.1f, 0.1f, 0.12f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    return glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static int write_picture(const char *path) {
    static uint8_t pixels[HEIGHT][WIDTH][3];
    FILE *file = fopen(path, "wb");
    if (!file) return 0;
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, WIDTH, HEIGHT, GL_RGB, GL_UNSIGNED_BYTE, pixels);
    fprintf(file, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
    for (int y = HEIGHT - 1; y >= 0; y--) fwrite(pixels[y], 1, sizeof pixels[y], file);
    int failed = ferror(file);
    return fclose(file) == 0 && !failed;
}

int main(int argc, char **argv) {
    static struct surfel surfels[POINTS];
    EGLDisplay display;
    const char *failure = NULL;
    if (argc != 2) {
        fprintf(stderr, "usage: %s PICTURE.ppm\n", argv[0]);
        return 2;
    }
    compute_torus(surfels);
    EGLContext context = open_context(&display);
    if (!context) failure = "no OpenGL 3.3 context without a window";
    else if (!open_framebuffer()) failure = "the framebuffer is incomplete";
    else if (draw_torus(surfels) != PBR_OK) failure = "libpbr could not draw";
    else if (!write_picture(argv[1])) failure = "cannot write the picture";
    if (failure) fprintf(stderr, "%s: %s\n", argv[0], failure);
    if (display != EGL_NO_DISPLAY) eglTerminate(display);
    return failure ? EXIT_FAILURE : EXIT_SUCCESS;
}
