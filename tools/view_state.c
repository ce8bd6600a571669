/* Keys and actions of the viewer. SPDX-License-Identifier: MIT */
#include "view_state.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "orbit.h"

const struct view_key view_keys[] = {
    {"s", "next kind of splat", {{'s', VIEW_KEY_NONE, VIEW_NEXT_SPLAT}}, false},
    {"g", "fill gaps between circles, squares, ellipses", {{'g', VIEW_KEY_NONE, VIEW_FILL}}, false},
    {"l", "next lighting:" SHADING_WORDS, {{'l', VIEW_KEY_NONE, VIEW_NEXT_SHADING}}, false},
    {"c", "next colour:" COLOUR_WORDS ", scalars", {{'c', VIEW_KEY_NONE, VIEW_NEXT_COLOUR}}, false},
    {"[ ]", "smaller or larger radii", {{'[', VIEW_KEY_NONE, VIEW_SMALLER_RADII}, {']', VIEW_KEY_NONE, VIEW_LARGER_RADII}}, true},
    {", .",
     "smaller or larger least size on screen",
     {{',', VIEW_KEY_NONE, VIEW_SMALLER_LEAST}, {'.', VIEW_KEY_NONE, VIEW_LARGER_LEAST}},
     true},
    {"< >", "finer or coarser hierarchies", {{'<', VIEW_KEY_NONE, VIEW_FINER}, {'>', VIEW_KEY_NONE, VIEW_COARSER}}, true},
    {"m", "next of a mesh: points and triangles, all triangles, vertices", {{'m', VIEW_KEY_NONE, VIEW_NEXT_PRIMITIVES}}, false},
    {"b", "back faces", {{'b', VIEW_KEY_NONE, VIEW_CULL}}, false},
    {"o", "orthographic or perspective", {{'o', VIEW_KEY_NONE, VIEW_PARALLEL}}, false},
    {"+ -",
     "zoom",
     {{'+', VIEW_KEY_NONE, VIEW_ZOOM_IN}, {'=', VIEW_KEY_NONE, VIEW_ZOOM_IN}, {'-', VIEW_KEY_NONE, VIEW_ZOOM_OUT}},
     true},
    {"arrows",
     "turn by 5 degrees",
     {{0, VIEW_KEY_LEFT, VIEW_TURN_LEFT},
      {0, VIEW_KEY_RIGHT, VIEW_TURN_RIGHT},
      {0, VIEW_KEY_UP, VIEW_TURN_UP},
      {0, VIEW_KEY_DOWN, VIEW_TURN_DOWN}},
     true},
    {"f", "frame all, from the same side", {{'f', VIEW_KEY_NONE, VIEW_FRAME}}, false},
    {"r", "reset view and light", {{'r', VIEW_KEY_NONE, VIEW_RESET}}, false},
    {"space", "spin", {{' ', VIEW_KEY_NONE, VIEW_SPIN}}, false},
    {"i", "information", {{'i', VIEW_KEY_NONE, VIEW_INFO}}, false},
    {"h F1", "these keys", {{'h', VIEW_KEY_NONE, VIEW_HELP}, {0, VIEW_KEY_F1, VIEW_HELP}}, false},
    {"p F12", "screenshot", {{'p', VIEW_KEY_NONE, VIEW_SCREENSHOT}, {0, VIEW_KEY_F12, VIEW_SCREENSHOT}}, false},
    {"F11", "full screen", {{0, VIEW_KEY_F11, VIEW_FULL_SCREEN}}, false},
    {"q Esc", "quit", {{'q', VIEW_KEY_NONE, VIEW_QUIT}, {0, VIEW_KEY_ESCAPE, VIEW_LEAVE}}, false},
    {NULL, NULL, {{0, VIEW_KEY_NONE, VIEW_NO_ACTION}}, false}};

enum view_action view_find_action(uint32_t character, enum view_special key, bool is_repeat, uint32_t *number) {
    const size_t most = sizeof view_keys[0].bindings / sizeof view_keys[0].bindings[0];
    if (character >= 'A' && character <= 'Z') character += 'a' - 'A';
    *number = character - '1';
    if (character >= '1' && character <= '9') return !is_repeat && *number < kind_count(splat_kinds) ? VIEW_SPLAT : VIEW_NO_ACTION;
    for (const struct view_key *line = view_keys; line->name; line++)
        for (size_t i = 0; i < most && line->bindings[i].action; i++)
            if (line->bindings[i].character == character && line->bindings[i].key == key)
                return is_repeat && !line->repeats ? VIEW_NO_ACTION : line->bindings[i].action;
    return VIEW_NO_ACTION;
}

/* Points, normal, depth, then the scalars, and again. */
static void next_colour(struct view_state *state) {
    struct scene_options *options = &state->options;
    uint32_t next = 0;
    if (options->colour_source == PBR_COLOUR_SCALAR) {
        while (next < state->scalar_count && strcmp(state->scalars[next], options->scalar)) next++;
        next++;
    } else {
        options->colour_source = kind_after(colour_kinds, options->colour_source);
        if (options->colour_source != colour_kinds[0].value) return;
    }
    options->colour_source = next < state->scalar_count ? PBR_COLOUR_SCALAR : colour_kinds[0].value;
    if (options->colour_source == PBR_COLOUR_SCALAR) options->scalar = state->scalars[next];
}

/* 1, 1.19, 1.41, 1.68, 2. */
static void scale_radii(struct scene_options *options, int steps) {
    double scale = orbit_step(options->radius_scale > 0 ? options->radius_scale : 1, steps, 3);
    if (scale >= 1e-6 && scale <= 1e6) options->radius_scale = scale;
}

/* In half pixels, from the kind's own least size, 0, over 1.5 to where --max-size or 64 ends it. */
static void change_least_size(struct scene_options *options, int halves) {
    double size = (options->size_minimum > 0 ? options->size_minimum : 1) + 0.5 * halves;
    double most = options->size_maximum > 0 ? options->size_maximum : 64;
    if (size <= 1) options->size_minimum = 0;
    else if (size <= most) options->size_minimum = size;
}

/* By factors of sqrt 2 from the leaves, 0, over 1/4 pixel to 64. Of a scene that is to be drawn whole it is the leaves at first. */
static void change_threshold(struct scene_options *options, int steps) {
    const double least = 0.25, most = 64, before = scene_options_threshold(options);
    const double after = before > 0 ? orbit_step(before, 2 * steps, 3) : steps > 0 ? least : 0;
    if (options->lod == LOD_NONE) options->lod = LOD_AUTO;
    options->threshold = after < least ? 0 : fmin(after, fmax(most, before));
}

/* Of hierarchies over meshes: by the threshold, all triangles, all vertices as points. */
static void next_primitives(struct view_state *state) {
    struct scene_options *options = &state->options;
    if (options->vertices) {
        options->vertices = false;
        if (options->lod == LOD_NONE) options->lod = LOD_AUTO;
        if (!(options->threshold > 0)) options->threshold = state->kept_threshold > 0 ? state->kept_threshold : 1;
    } else if (scene_options_threshold(options) > 0) {
        state->kept_threshold = options->threshold;
        options->threshold = 0;
    } else {
        options->vertices = true;
    }
}

static void reset(struct view_state *state) {
    struct scene_options *options = &state->options;
    memcpy(options->view, state->start.view, sizeof options->view);
    memcpy(options->centre, state->start.centre, sizeof options->centre);
    memcpy(options->light, state->start.light, sizeof options->light);
    options->has_centre = state->start.has_centre;
    options->parallel = state->start.parallel;
    state->has_moved = state->spins = false;
}

static enum view_change turn(struct view_state *state, double right, double down) {
    orbit_turn(state->options.view, right, down);
    state->has_moved = true;
    return VIEW_SCENE_CHANGED;
}

static enum view_change zoom(struct view_state *state, double steps) {
    orbit_zoom(state->options.view, steps);
    state->has_moved = true;
    return VIEW_SCENE_CHANGED;
}

enum view_change view_act(struct view_state *state, enum view_action action, uint32_t number) {
    struct scene_options *options = &state->options;
    switch (action) {
    case VIEW_SPLAT: options->splat = splat_kinds[number].value; return VIEW_SCENE_CHANGED;
    case VIEW_NEXT_SPLAT: options->splat = kind_after(splat_kinds, options->splat); return VIEW_SCENE_CHANGED;
    case VIEW_FILL: /* kept, without effect, while the kind is one that is blended already */
        options->blending = options->blending == PBR_BLEND_FILL ? PBR_BLEND_KIND : PBR_BLEND_FILL;
        return VIEW_SCENE_CHANGED;
    case VIEW_NEXT_SHADING: options->shading = kind_after(shading_kinds, options->shading); return VIEW_SCENE_CHANGED;
    case VIEW_NEXT_COLOUR: next_colour(state); return VIEW_SCENE_CHANGED;
    case VIEW_SMALLER_RADII: scale_radii(options, -1); return VIEW_SCENE_CHANGED;
    case VIEW_LARGER_RADII: scale_radii(options, 1); return VIEW_SCENE_CHANGED;
    case VIEW_SMALLER_LEAST: change_least_size(options, -1); return VIEW_SCENE_CHANGED;
    case VIEW_LARGER_LEAST: change_least_size(options, 1); return VIEW_SCENE_CHANGED;
    case VIEW_FINER: change_threshold(options, -1); return VIEW_SCENE_CHANGED;
    case VIEW_COARSER: change_threshold(options, 1); return VIEW_SCENE_CHANGED;
    case VIEW_NEXT_PRIMITIVES: next_primitives(state); return VIEW_SCENE_CHANGED;
    case VIEW_CULL: options->cull = !options->cull; return VIEW_SCENE_CHANGED;
    case VIEW_PARALLEL: options->parallel = !options->parallel; return VIEW_SCENE_CHANGED;
    case VIEW_ZOOM_IN: return zoom(state, 1);
    case VIEW_ZOOM_OUT: return zoom(state, -1);
    case VIEW_TURN_LEFT: return turn(state, -5, 0);
    case VIEW_TURN_RIGHT: return turn(state, 5, 0);
    case VIEW_TURN_UP: return turn(state, 0, -5);
    case VIEW_TURN_DOWN: return turn(state, 0, 5);
    case VIEW_FRAME:
        options->has_centre = state->has_moved = false;
        options->view[2] = 1;
        return VIEW_SCENE_CHANGED;
    case VIEW_RESET: reset(state); return VIEW_SCENE_CHANGED;
    case VIEW_SPIN: state->spins = !state->spins; return VIEW_OVERLAY_CHANGED;
    case VIEW_INFO: state->shows_info = !state->shows_info; return VIEW_OVERLAY_CHANGED;
    case VIEW_HELP: state->shows_help = !state->shows_help; return VIEW_OVERLAY_CHANGED;
    default: return VIEW_SAME;
    }
}

void view_add_scalar(struct view_state *state, const char *name) {
    for (uint32_t i = 0; i < state->scalar_count; i++)
        if (!strcmp(state->scalars[i], name)) return;
    if (state->scalar_count < VIEW_MOST_SCALARS) state->scalars[state->scalar_count++] = name;
}

void view_colour_name(const struct scene_options *options, char *name, size_t capacity) {
    if (options->colour_source == PBR_COLOUR_SCALAR) snprintf(name, capacity, "scalar:%s", options->scalar);
    else snprintf(name, capacity, "%s", kind_name(colour_kinds, options->colour_source));
}
