/* Runs the fragments of one document, in order, in a context without a window. A message of libpbr's, an OpenGL error or an object
 * left behind fails. SPDX-License-Identifier: MIT */
#include "host.h"

pbr_instance *instance;
pbr_points *points;
pbr_renderer *renderer;
pbr_view *view;
double world_to_eye[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1};
int width = 64, height = 48;
GLuint framebuffer;

static int messages;

static void fail(const char *place, const char *what) {
    fprintf(stderr, "%s: %s\n", place, what);
    exit(1);
}

static void count_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)level;
    fprintf(stderr, "%s: %s: %s\n", (const char *)user, pbr_result_name(code), text);
    messages++;
}

static int open_context(void) {
    EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, NULL, NULL) || !eglBindAPI(EGL_OPENGL_API)) return 0;
    EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, NULL);
    return context && eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
}

static int open_framebuffer(void) {
    const GLenum formats[2] = {GL_RGBA8, GL_DEPTH_COMPONENT32F}, places[2] = {GL_COLOR_ATTACHMENT0, GL_DEPTH_ATTACHMENT};
    GLuint buffers[2];
    glGenRenderbuffers(2, buffers);
    glGenFramebuffers(1, &framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    for (int i = 0; i < 2; i++) {
        glBindRenderbuffer(GL_RENDERBUFFER, buffers[i]);
        glRenderbufferStorage(GL_RENDERBUFFER, formats[i], width, height);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, places[i], GL_RENDERBUFFER, buffers[i]);
    }
    glViewport(0, 0, width, height);
    return glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static int make_handles(void) {
    const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_instance_desc own = PBR_INSTANCE_DESC_INIT;
    own.log = count_message;
    own.log_user = "libpbr";
    desc.count = 3;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.1f;
    return !pbr_instance_create(&own, &instance) && !pbr_points_create(instance, &desc, &points) &&
           !pbr_renderer_create(instance, NULL, &renderer) && !pbr_view_create(renderer, NULL, &view);
}

int main(void) {
    if (!open_context() || !open_framebuffer()) fail("host", "no OpenGL context without a window");
    if (!snippets_make_instance && !make_handles()) fail("host", "cannot make the objects");
    for (const struct snippet *s = snippets; s->place; s++) {
        s->run();
        if (messages) fail(s->place, "libpbr complains");
        if (glGetError() != GL_NO_ERROR) fail(s->place, "an OpenGL error is left");
        printf("%s: ran\n", s->place);
    }
    pbr_view_destroy(&view);
    if (pbr_renderer_destroy(&renderer)) fail("host", "views are left");
    pbr_points_release(&points);
    if (pbr_instance_destroy(&instance)) fail("host", "objects are left");
    return 0;
}
