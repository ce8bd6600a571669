/* What a viewer shows and what its keys do to it. Pure: no window, no OpenGL. SPDX-License-Identifier: MIT */
#ifndef VIEW_STATE_H
#define VIEW_STATE_H

#include "scene_options.h"

enum { VIEW_MOST_SCALARS = 256 };

struct view_state {
    struct scene_options options;           /* what is drawn: the command line's, as keys and pointer have changed them */
    struct scene_options start;             /* the command line's */
    const char *scalars[VIEW_MOST_SCALARS]; /* names of the inputs' scalar attributes, which are colours to choose from */
    uint32_t scalar_count;
    bool spins, shows_info, shows_help;
    double kept_threshold; /* what options.threshold was before all triangles were to be drawn */
    bool has_moved;    /* the camera is not where the command line put it */
};

enum view_action {
    VIEW_NO_ACTION,
    VIEW_SPLAT, /* with the number of a line of splat_kinds */
    VIEW_NEXT_SPLAT,
    VIEW_FILL,
    VIEW_NEXT_SHADING,
    VIEW_NEXT_COLOUR,
    VIEW_SMALLER_RADII,
    VIEW_LARGER_RADII,
    VIEW_SMALLER_LEAST,
    VIEW_LARGER_LEAST,
    VIEW_FINER,
    VIEW_COARSER,
    VIEW_NEXT_PRIMITIVES,
    VIEW_CULL,
    VIEW_PARALLEL,
    VIEW_ZOOM_IN,
    VIEW_ZOOM_OUT,
    VIEW_TURN_LEFT,
    VIEW_TURN_RIGHT,
    VIEW_TURN_UP,
    VIEW_TURN_DOWN,
    VIEW_FRAME,
    VIEW_RESET,
    VIEW_SPIN,
    VIEW_INFO,
    VIEW_HELP,
    VIEW_SCREENSHOT, /* this and the following are the window's business */
    VIEW_FULL_SCREEN,
    VIEW_LEAVE, /* the keys' help; where it is not shown, quit */
    VIEW_QUIT
};

/* Keys without a character. */
enum view_special {
    VIEW_KEY_NONE,
    VIEW_KEY_ESCAPE,
    VIEW_KEY_LEFT,
    VIEW_KEY_RIGHT,
    VIEW_KEY_UP,
    VIEW_KEY_DOWN,
    VIEW_KEY_F1,
    VIEW_KEY_F11,
    VIEW_KEY_F12
};

/* One line of the help. */
struct view_key {
    const char *name, *what;
    struct {
        uint32_t character; /* typed, whatever the keyboard's layout; 0 = `key` */
        enum view_special key;
        enum view_action action;
    } bindings[4];
    bool repeats; /* while it is held down */
};

/* Ended by a NULL name. The splats' numbers are not in it. */
extern const struct view_key view_keys[];

/* What a typed character or a key without one (the other is 0) does. */
enum view_action view_find_action(uint32_t character, enum view_special key, bool is_repeat, uint32_t *number);

enum view_change { VIEW_SAME, VIEW_OVERLAY_CHANGED, VIEW_SCENE_CHANGED };

enum view_change view_act(struct view_state *state, enum view_action action, uint32_t number);

/* Adds a colour to choose; a name that is there already, and one too many, is left out. The name is kept by reference. */
void view_add_scalar(struct view_state *state, const char *name);
/* "points", "scalar:intensity"; as --colour takes it. Cut where it does not fit. */
void view_colour_name(const struct scene_options *options, char *name, size_t capacity);

#endif
