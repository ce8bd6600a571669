/* Offscreen OpenGL contexts through EGL: Mesa's surfaceless platform, a device (NVIDIA), or the default display.
 * SPDX-License-Identifier: MIT */
#include "headless.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <string.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

static const struct {
    const char *name;
    bool es;
    EGLint major, minor, profile; /* EGL_CONTEXT_OPENGL_..._PROFILE_BIT; 0 for ES */
} kinds[] = {
    [HEADLESS_GL_33] = {"3.3", false, 3, 3, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT},
    [HEADLESS_GL_45] = {"4.5", false, 4, 5, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT},
    [HEADLESS_GL_COMPAT] = {"compat", false, 3, 3, EGL_CONTEXT_OPENGL_COMPATIBILITY_PROFILE_BIT},
    [HEADLESS_ES_30] = {"es3.0", true, 3, 0, 0},
    [HEADLESS_ES_32] = {"es3.2", true, 3, 2, 0},
};

bool headless_kind_parse(const char *text, enum headless_kind *kind) {
    for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++) {
        if (strcmp(text, kinds[i].name)) continue;
        *kind = (enum headless_kind)i;
        return true;
    }
    return false;
}

const char *headless_kind_name(enum headless_kind kind) {
    return kinds[kind].name;
}

bool headless_kind_is_es(enum headless_kind kind) {
    return kinds[kind].es;
}

void headless_kind_version(enum headless_kind kind, int version[2]) {
    version[0] = kinds[kind].major;
    version[1] = kinds[kind].minor;
}

/* Whole words only: extension names are prefixes of each other. */
static bool lists(const char *extensions, const char *name) {
    size_t length = strlen(name);
    for (const char *at = extensions; at && (at = strstr(at, name)); at += length)
        if ((at == extensions || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0')) return true;
    return false;
}

static EGLDisplay initialised(EGLDisplay display) {
    return display != EGL_NO_DISPLAY && eglInitialize(display, NULL, NULL) ? display : EGL_NO_DISPLAY;
}

/* The first device with a working display. */
static EGLDisplay open_device(PFNEGLGETPLATFORMDISPLAYEXTPROC get_display) {
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLDeviceEXT devices[16];
    EGLint count = 0;
    PFNEGLQUERYDEVICESEXTPROC query = (PFNEGLQUERYDEVICESEXTPROC)eglGetProcAddress("eglQueryDevicesEXT");
    if (!query || !query(16, devices, &count)) return EGL_NO_DISPLAY;
    for (EGLint i = 0; i < count && display == EGL_NO_DISPLAY; i++)
        display = initialised(get_display(EGL_PLATFORM_DEVICE_EXT, devices[i], NULL));
    return display;
}

static EGLDisplay open_display(void) {
    EGLDisplay display = EGL_NO_DISPLAY;
    const char *extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
        lists(extensions, "EGL_EXT_platform_base") ? (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT")
                                                   : NULL;
    if (get_display && lists(extensions, "EGL_MESA_platform_surfaceless"))
        display = initialised(get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL));
    if (display == EGL_NO_DISPLAY && get_display && lists(extensions, "EGL_EXT_platform_device"))
        display = open_device(get_display);
    if (display == EGL_NO_DISPLAY) display = initialised(eglGetDisplay(EGL_DEFAULT_DISPLAY));
    return display;
}

static EGLContext open_context(EGLDisplay display, EGLConfig config, enum headless_kind kind, bool debug) {
    EGLint attributes[9] = {EGL_CONTEXT_MAJOR_VERSION, kinds[kind].major, EGL_CONTEXT_MINOR_VERSION, kinds[kind].minor}, count = 4;
    if (kinds[kind].profile) {
        attributes[count++] = EGL_CONTEXT_OPENGL_PROFILE_MASK;
        attributes[count++] = kinds[kind].profile;
    }
    if (debug) {
        attributes[count++] = EGL_CONTEXT_OPENGL_DEBUG;
        attributes[count++] = EGL_TRUE;
    }
    attributes[count] = EGL_NONE;
    return eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
}

/* Software drivers allocate what they queue, and free it after each frame. glibc gives that back to the system and takes it again,
 * page by page: up to half of a frame, or nothing, as other memory happens to lie. */
static void keep_freed_memory(void) {
#ifdef __GLIBC__
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
}

const char *headless_create(struct headless *headless, enum headless_kind kind, bool debug) {
    const char *error = NULL;
    EGLConfig config = NULL;
    EGLint config_count = 0;
    memset(headless, 0, sizeof(*headless));
    headless->kind = kind;
    keep_freed_memory();
    headless->display = open_display();
    if (headless->display == EGL_NO_DISPLAY) return "EGL has no display that works without a window system";
    if (!eglBindAPI(kinds[kind].es ? EGL_OPENGL_ES_API : EGL_OPENGL_API)) return "EGL does not offer this OpenGL API";

    EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, kinds[kind].es ? EGL_OPENGL_ES3_BIT : EGL_OPENGL_BIT,
                       EGL_NONE};
    if (!eglChooseConfig(headless->display, wanted, &config, 1, &config_count) || config_count == 0) {
        wanted[1] = 0; /* no surface: a surfaceless platform need not offer pbuffers */
        if (!eglChooseConfig(headless->display, wanted, &config, 1, &config_count) || config_count == 0)
            return "EGL has no configuration for this OpenGL API";
    }
    headless->context = open_context(headless->display, config, kind, debug);
    if (headless->context == EGL_NO_CONTEXT) {
        error = "the driver offers no OpenGL context of this version and profile";
        goto cleanup;
    }
    if (!lists(eglQueryString(headless->display, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context")) {
        const EGLint size[] = {EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
        headless->surface = eglCreatePbufferSurface(headless->display, config, size);
        if (headless->surface == EGL_NO_SURFACE) {
            error = "EGL offers neither contexts without a surface nor pbuffers";
            goto cleanup;
        }
    }
    if (!headless_make_current(headless)) error = "EGL cannot make the OpenGL context current";

cleanup:
    if (error) headless_destroy(headless);
    return error;
}

bool headless_make_current(const struct headless *headless) {
    return eglBindAPI(kinds[headless->kind].es ? EGL_OPENGL_ES_API : EGL_OPENGL_API) &&
           eglMakeCurrent(headless->display, headless->surface, headless->surface, headless->context);
}

void headless_release_current(const struct headless *headless) {
    if (headless->display != EGL_NO_DISPLAY) eglMakeCurrent(headless->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

void headless_destroy(struct headless *headless) {
    if (headless->context != EGL_NO_CONTEXT) {
        eglBindAPI(kinds[headless->kind].es ? EGL_OPENGL_ES_API : EGL_OPENGL_API);
        if (eglGetCurrentContext() == headless->context) headless_release_current(headless);
        eglDestroyContext(headless->display, headless->context);
    }
    if (headless->surface != EGL_NO_SURFACE) eglDestroySurface(headless->display, headless->surface);
    memset(headless, 0, sizeof(*headless));
}

void *headless_get_proc(void *user, const char *name) {
    (void)user;
    union {
        void (*function)(void);
        void *pointer;
    } address = {eglGetProcAddress(name)};
    return address.pointer;
}
