/* Window, context and events of the viewer. SPDX-License-Identifier: MIT */
#include "view_window.h"

#include <string.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

static struct view_window *window_of(GLFWwindow *handle) {
    return glfwGetWindowUserPointer(handle);
}

/* Pixels of the framebuffer to one of GLFW's units. */
static double unit_of(const struct view_window *window) {
    int units, pixels, height;
    glfwGetWindowSize(window->handle, &units, &height);
    glfwGetFramebufferSize(window->handle, &pixels, &height);
    return units > 0 && pixels > 0 ? (double)pixels / units : 1;
}

/* Places come with the events: where the pointer is now may be ahead of them. */
static void on_pointer(GLFWwindow *handle, double x, double y) {
    struct view_window *window = window_of(handle);
    const double unit = unit_of(window), right = unit * (x - window->pointer[0]), down = unit * (y - window->pointer[1]);
    const bool moves = window->is_inside && window->gesture != VIEW_NO_GESTURE;
    window->pointer[0] = x;
    window->pointer[1] = y;
    window->is_inside = true;
    if (moves) window->handler.gesture(window->handler.user, window->gesture, right, down);
}

static enum view_gesture gesture_of(int button, int modifiers) {
    if (button == GLFW_MOUSE_BUTTON_RIGHT || button == GLFW_MOUSE_BUTTON_MIDDLE) return VIEW_MOVE;
    if (button != GLFW_MOUSE_BUTTON_LEFT) return VIEW_NO_GESTURE;
    return modifiers & GLFW_MOD_CONTROL ? VIEW_LIGHT : modifiers & GLFW_MOD_SHIFT ? VIEW_MOVE : VIEW_TURN;
}

/* The first button that is pressed decides until it is released. */
static void on_button(GLFWwindow *handle, int button, int action, int modifiers) {
    struct view_window *window = window_of(handle);
    if (action == GLFW_PRESS && window->gesture == VIEW_NO_GESTURE) {
        window->gesture = gesture_of(button, modifiers);
        window->button = button;
    } else if (action == GLFW_RELEASE && button == window->button) {
        window->gesture = VIEW_NO_GESTURE;
    }
}

static void on_wheel(GLFWwindow *handle, double right, double up) {
    struct view_window *window = window_of(handle);
    (void)right;
    window->handler.gesture(window->handler.user, VIEW_ZOOM, 0, up);
}

static void act(struct view_window *window, uint32_t character, enum view_special key) {
    uint32_t number;
    enum view_action action = view_find_action(character, key, window->is_repeat, &number);
    if (action != VIEW_NO_ACTION) window->handler.act(window->handler.user, action, number);
}

static enum view_special special_of(int key) {
    switch (key) {
    case GLFW_KEY_ESCAPE: return VIEW_KEY_ESCAPE;
    case GLFW_KEY_LEFT: return VIEW_KEY_LEFT;
    case GLFW_KEY_RIGHT: return VIEW_KEY_RIGHT;
    case GLFW_KEY_UP: return VIEW_KEY_UP;
    case GLFW_KEY_DOWN: return VIEW_KEY_DOWN;
    case GLFW_KEY_F1: return VIEW_KEY_F1;
    case GLFW_KEY_F11: return VIEW_KEY_F11;
    case GLFW_KEY_F12: return VIEW_KEY_F12;
    default: return VIEW_KEY_NONE;
    }
}

/* Keys that have no character. The others come as characters, after this, so that they are where the keyboard's layout has them. */
static void on_key(GLFWwindow *handle, int key, int code, int action, int modifiers) {
    struct view_window *window = window_of(handle);
    (void)code, (void)modifiers;
    if (action == GLFW_RELEASE) return;
    window->is_repeat = action == GLFW_REPEAT;
    if (special_of(key) != VIEW_KEY_NONE) act(window, 0, special_of(key));
}

static void on_character(GLFWwindow *handle, unsigned character) {
    act(window_of(handle), character, VIEW_KEY_NONE);
}

static void on_damage(GLFWwindow *handle) {
    struct view_window *window = window_of(handle);
    window->handler.damage(window->handler.user);
}

static void on_size(GLFWwindow *handle, int width, int height) {
    (void)width, (void)height;
    on_damage(handle);
}

static void on_scale(GLFWwindow *handle, float x, float y) {
    (void)x, (void)y;
    on_damage(handle);
}

static const char *last_error(void) {
    const char *text = NULL;
    glfwGetError(&text);
    return text ? text : "GLFW tells no reason";
}

static void set_hints(const struct scene_options *options) {
    int version[2];
    const bool is_es = headless_kind_is_es(options->context), is_compatible = options->context == HEADLESS_GL_COMPAT;
    headless_kind_version(options->context, version);
    glfwWindowHint(GLFW_CLIENT_API, is_es ? GLFW_OPENGL_ES_API : GLFW_OPENGL_API);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, version[0]);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, version[1]);
    if (!is_es) glfwWindowHint(GLFW_OPENGL_PROFILE, is_compatible ? GLFW_OPENGL_COMPAT_PROFILE : GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_DEPTH_BITS, 0); /* points are drawn in a framebuffer object */
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
    glfwWindowHintString(GLFW_X11_CLASS_NAME, "pbr");
    glfwWindowHintString(GLFW_X11_INSTANCE_NAME, "pbr");
}

const char *view_window_open(struct view_window *window, const struct scene_options *options, const char *title,
                             struct view_handler handler) {
    *window = (struct view_window){.handler = handler};
    if (!glfwInit()) return last_error();
    set_hints(options);
    window->handle = glfwCreateWindow((int)options->size[0], (int)options->size[1], title, NULL, NULL);
    if (!window->handle) return last_error();
    glfwMakeContextCurrent(window->handle);
    glfwSwapInterval(1);
    glfwSetWindowUserPointer(window->handle, window);
    glfwSetCursorPosCallback(window->handle, on_pointer);
    glfwSetMouseButtonCallback(window->handle, on_button);
    glfwSetScrollCallback(window->handle, on_wheel);
    glfwSetKeyCallback(window->handle, on_key);
    glfwSetCharCallback(window->handle, on_character);
    glfwSetWindowRefreshCallback(window->handle, on_damage);
    glfwSetFramebufferSizeCallback(window->handle, on_size);
    glfwSetWindowContentScaleCallback(window->handle, on_scale);
    return NULL;
}

void view_window_close(struct view_window *window) {
    if (window->handle) glfwDestroyWindow(window->handle);
    window->handle = NULL;
}

void view_window_end(void) {
    glfwTerminate();
}

void view_window_wait(struct view_window *window, double seconds) {
    (void)window;
    if (seconds < 0) glfwWaitEvents();
    else if (seconds > 0) glfwWaitEventsTimeout(seconds);
    else glfwPollEvents();
}

void view_window_wake(void) {
    glfwPostEmptyEvent();
}

bool view_window_wants_close(const struct view_window *window) {
    return glfwWindowShouldClose(window->handle);
}

void view_window_quit(struct view_window *window) {
    glfwSetWindowShouldClose(window->handle, GLFW_TRUE);
}

void view_window_size(const struct view_window *window, uint32_t size[2]) {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window->handle, &width, &height);
    const bool is_visible = width > 0 && height > 0 && !glfwGetWindowAttrib(window->handle, GLFW_ICONIFIED);
    size[0] = is_visible ? (uint32_t)width : 0;
    size[1] = is_visible ? (uint32_t)height : 0;
}

float view_window_scale(const struct view_window *window) {
    float x = 1, y = 1;
    glfwGetWindowContentScale(window->handle, &x, &y);
    return y > 0 ? y : 1;
}

void view_window_set_title(struct view_window *window, const char *title) {
    glfwSetWindowTitle(window->handle, title);
}

/* The screen that holds the window's middle; the first if none does. */
static GLFWmonitor *screen_of(const struct view_window *window) {
    int count = 0, x, y, width, height;
    GLFWmonitor **screens = glfwGetMonitors(&count);
    glfwGetWindowPos(window->handle, &x, &y);
    glfwGetWindowSize(window->handle, &width, &height);
    for (int i = 0; i < count; i++) {
        int left, top;
        const GLFWvidmode *mode = glfwGetVideoMode(screens[i]);
        glfwGetMonitorPos(screens[i], &left, &top);
        const int dx = x + width / 2 - left, dy = y + height / 2 - top;
        if (mode && dx >= 0 && dx < mode->width && dy >= 0 && dy < mode->height) return screens[i];
    }
    return count > 0 ? screens[0] : NULL;
}

void view_window_toggle_full_screen(struct view_window *window) {
    int *place = window->place;
    if (glfwGetWindowMonitor(window->handle)) {
        glfwSetWindowMonitor(window->handle, NULL, place[0], place[1], place[2], place[3], GLFW_DONT_CARE);
        return;
    }
    GLFWmonitor *screen = screen_of(window);
    const GLFWvidmode *mode = screen ? glfwGetVideoMode(screen) : NULL;
    if (!mode) return;
    glfwGetWindowPos(window->handle, &place[0], &place[1]);
    glfwGetWindowSize(window->handle, &place[2], &place[3]);
    glfwSetWindowMonitor(window->handle, screen, 0, 0, mode->width, mode->height, mode->refreshRate);
}

void view_window_show(struct view_window *window) {
    glfwSwapBuffers(window->handle);
}

void *view_window_get_proc(void *user, const char *name) {
    (void)user;
    union {
        GLFWglproc function;
        void *pointer;
    } address = {glfwGetProcAddress(name)};
    return address.pointer;
}
