/* The viewer's window: GLFW, and what its events mean. SPDX-License-Identifier: MIT */
#ifndef VIEW_WINDOW_H
#define VIEW_WINDOW_H

#include "scene_options.h"
#include "view_state.h"

typedef struct GLFWwindow GLFWwindow;

enum view_gesture { VIEW_NO_GESTURE, VIEW_TURN, VIEW_MOVE, VIEW_LIGHT, VIEW_ZOOM };

/* Called while events are waited for. */
struct view_handler {
    void *user;
    /* By pixels of the framebuffer to the right and down; VIEW_ZOOM: by `down` steps nearer. */
    void (*gesture)(void *user, enum view_gesture gesture, double right, double down);
    void (*act)(void *user, enum view_action action, uint32_t number);
    void (*damage)(void *user); /* the content is lost, or of another size */
};

struct view_window {
    GLFWwindow *handle;
    struct view_handler handler;
    enum view_gesture gesture; /* of the drag that goes on */
    int button;                /* that drags */
    bool is_repeat;            /* the last key is held down */
    double pointer[2];         /* GLFW's units, window */
    bool is_inside;            /* `pointer` is known */
    int place[4];              /* x, y, width and height to come back to from the full screen */
};

/* Opens a window with a context, current on this thread. `window` stays where it is. NULL, or why not, valid until the next call.
 */
const char *view_window_open(struct view_window *window, const struct scene_options *options, const char *title,
                             struct view_handler handler);
void view_window_close(struct view_window *window);
/* Afterwards no window function may be called, view_window_wake neither. */
void view_window_end(void);

/* Waits for events, `seconds` at most (negative: as long as it takes), and handles them. */
void view_window_wait(struct view_window *window, double seconds);
/* Ends a wait. Any thread, while a window is open. */
void view_window_wake(void);

bool view_window_wants_close(const struct view_window *window);
void view_window_quit(struct view_window *window);
/* The framebuffer's, in pixels; 0 while minimised. */
void view_window_size(const struct view_window *window, uint32_t size[2]);
/* Pixels of the framebuffer to a logical pixel. */
float view_window_scale(const struct view_window *window);
void view_window_set_title(struct view_window *window, const char *title);
void view_window_toggle_full_screen(struct view_window *window);
void view_window_show(struct view_window *window);
/* For pbr_renderer_desc. */
void *view_window_get_proc(void *user, const char *name);

#endif
