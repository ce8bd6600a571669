/* pbr view: points in a window. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "commands.h"
#include "json.h"
#include "orbit.h"
#include "view_options.h"
#include "view_panels.h"
#include "view_picture.h"
#include "view_window.h"

/* Zero where it is not there yet. */
struct viewer {
    struct session *session;
    int status;
    struct view_options options;
    struct view_state state;
    struct view_facts facts;
    struct scene scene;        /* with state.options */
    struct scene_options good; /* what the last frame was drawn with */
    struct loader *loader;
    struct view_window window;
    struct picture picture;
    struct overlay overlay;
    enum view_change change;                /* what is to be drawn again */
    double shown_at, spun_at, notice_until; /* session_seconds */
    char notice[SESSION_LINE];
    char **screenshots; /* names of those written */
    uint32_t screenshot_count, screenshot_number;
};

static void change(struct viewer *viewer, enum view_change what) {
    if (what > viewer->change) viewer->change = what;
}

static void set_notice(struct viewer *viewer, const char *text) {
    snprintf(viewer->notice, sizeof viewer->notice, "%s", text);
    viewer->notice_until = session_seconds() + 5;
    change(viewer, VIEW_OVERLAY_CHANGED);
}

/* What failed stands on stderr already; it stays on the screen, too, the newest errors at least, and shows in the exit status. */
static void keep_error(struct viewer *viewer, const char *text) {
    struct view_facts *facts = &viewer->facts;
    if (facts->error_count == VIEW_MOST_ERRORS) memmove(facts->errors[0], facts->errors[1], sizeof facts->errors - SESSION_LINE);
    else facts->error_count++;
    snprintf(facts->errors[facts->error_count - 1], SESSION_LINE, "%s", text);
    viewer->status = STATUS_FAILED;
    change(viewer, VIEW_OVERLAY_CHANGED);
}

static void keep_last_error(struct viewer *viewer) {
    char text[SESSION_LINE];
    session_last_error(viewer->session, text, sizeof text);
    keep_error(viewer, text);
}

/* A kind that the context cannot draw is given up for the one before. */
static bool draw(struct viewer *viewer, bool waits) {
    struct scene_options *options = &viewer->state.options;
    if (!scene_find_vertices(&viewer->scene, viewer->session) || !picture_draw(&viewer->picture, &viewer->scene, waits)) {
        keep_last_error(viewer);
        options->vertices = viewer->good.vertices;
        options->splat = viewer->good.splat;
        options->blending = viewer->good.blending;
        options->shading = viewer->good.shading;
        options->colour_source = viewer->good.colour_source;
        options->scalar = viewer->good.scalar;
        if (viewer->picture.frame_count == 0 || !picture_draw(&viewer->picture, &viewer->scene, waits)) return false;
    }
    viewer->good = *options;
    return true;
}

/* Draws the picture in the window's size if that is not how it is. True if there is one then; while the window is minimised there
 * is none. What cannot be drawn at all closes the window. `waits`: as picture_draw. */
static bool update_picture(struct viewer *viewer, bool waits) {
    struct picture *picture = &viewer->picture;
    uint32_t size[2];
    view_window_size(&viewer->window, size);
    if (size[0] == 0) return false;
    if (memcmp(size, picture->target.size, sizeof size) != 0) {
        if (!picture_resize(picture, size)) goto fail;
        viewer->change = VIEW_SCENE_CHANGED;
    }
    if (viewer->change == VIEW_SCENE_CHANGED || (waits && !picture->is_final)) {
        if (!draw(viewer, waits)) goto fail;
        viewer->change = VIEW_OVERLAY_CHANGED;
    }
    return true;
fail:
    viewer->status = STATUS_FAILED;
    view_window_quit(&viewer->window);
    return false;
}

static void show(struct viewer *viewer) {
    struct view_facts *facts = &viewer->facts;
    if (viewer->change == VIEW_SAME || !update_picture(viewer, false)) return;
    facts->seconds = viewer->shown_at = session_seconds();
    facts->notice = viewer->shown_at < viewer->notice_until ? viewer->notice : NULL;
    facts->stats = viewer->picture.stats;
    facts->frame_ms = picture_milliseconds(&viewer->picture);
    overlay_begin(&viewer->overlay, viewer->picture.target.size);
    if (overlay_set_scale(&viewer->overlay, view_window_scale(&viewer->window))) view_panels_draw(&viewer->overlay, facts);
    overlay_end(&viewer->overlay, viewer->picture.target.texture);
    view_window_show(&viewer->window);
    viewer->change = VIEW_SAME;
}

/* The next name in the folder that is free; NULL if there is no memory. */
static char *screenshot_name(struct viewer *viewer) {
    const char *folder = strcmp(viewer->options.screenshots, ".") ? viewer->options.screenshots : "";
    char *name = NULL;
    do {
        free(name);
        if (asprintf(&name, "%s%spbr-%04u.png", folder, folder[0] ? "/" : "", (unsigned)++viewer->screenshot_number) < 0)
            return NULL;
    } while (access(name, F_OK) == 0);
    return name;
}

static void take_screenshot(struct viewer *viewer) {
    char text[SESSION_LINE];
    if (viewer->scene.input_count == 0) set_notice(viewer, "nothing is there to write yet");
    if (viewer->scene.input_count == 0 || !update_picture(viewer, true)) return;
    char *name = screenshot_name(viewer);
    char **names = realloc(viewer->screenshots, (viewer->screenshot_count + 1) * sizeof *names);
    if (names) viewer->screenshots = names;
    if (!name || !names) session_fail(viewer->session, "no memory for a screenshot");
    if (!name || !names || !picture_write(&viewer->picture, name)) {
        keep_last_error(viewer);
        free(name);
        return;
    }
    names[viewer->screenshot_count++] = name;
    snprintf(text, sizeof text, "wrote %s", name);
    set_notice(viewer, text);
}

static void pan(struct viewer *viewer, double right, double down) {
    struct scene_options *options = &viewer->state.options;
    double centre[3];
    if (viewer->picture.target.size[1] == 0) return;
    struct camera camera = scene_camera(&viewer->scene, 0, viewer->picture.target.size);
    scene_centre(&viewer->scene, centre);
    const double pixel = orbit_pixel(&camera, centre);
    orbit_pan(&camera, right, down, centre);
    scene_from_world(options, centre, options->centre);
    for (int k = 0; k < 3; k++) options->centre[k] = orbit_round(options->centre[k], pixel);
    options->has_centre = true;
}

static void on_gesture(void *user, enum view_gesture gesture, double right, double down) {
    struct viewer *viewer = user;
    struct scene_options *options = &viewer->state.options;
    const double degrees = ORBIT_DEGREES_PER_PIXEL / (double)view_window_scale(&viewer->window);
    switch (gesture) {
    case VIEW_TURN: orbit_turn(options->view, degrees * right, degrees * down); break;
    case VIEW_MOVE: pan(viewer, right, down); break;
    case VIEW_LIGHT: orbit_light(options->light, degrees * right, degrees * down); break;
    case VIEW_ZOOM: orbit_zoom(options->view, down); break;
    default: return;
    }
    if (gesture != VIEW_LIGHT) viewer->state.has_moved = true;
    change(viewer, VIEW_SCENE_CHANGED);
}

static void on_action(void *user, enum view_action action, uint32_t number) {
    struct viewer *viewer = user;
    if (action == VIEW_LEAVE) action = viewer->state.shows_help ? VIEW_HELP : VIEW_QUIT;
    if (action == VIEW_QUIT) view_window_quit(&viewer->window);
    else if (action == VIEW_FULL_SCREEN) view_window_toggle_full_screen(&viewer->window);
    else if (action == VIEW_SCREENSHOT) take_screenshot(viewer);
    else change(viewer, view_act(&viewer->state, action, number));
    if (action == VIEW_SPIN) viewer->spun_at = session_seconds();
}

static void on_damage(void *user) {
    change(user, VIEW_OVERLAY_CHANGED);
}

/* A camera that the user has moved stays where it is although the sphere that --view goes by has changed. */
static void keep_camera(struct viewer *viewer, struct sphere before) {
    struct scene_options *options = &viewer->state.options;
    if (!viewer->state.has_moved) return;
    if (!options->has_centre) scene_from_world(options, before.centre, options->centre);
    options->has_centre = true;
    orbit_rescale(options->view, before.radius, viewer->scene.sphere.radius);
}

/* False with a message, if it cannot be shown. */
static bool add_input(struct viewer *viewer, struct input *input) {
    struct scene *scene = &viewer->scene;
    const struct sphere before = scene->sphere;
    if (!scene_check_scalar(&viewer->options.scene, viewer->session, input)) return false;
    scene_add(scene, input);
    const bool has_picture = viewer->picture.target.size[0] > 0; /* not before it was shown once, if it opens minimised */
    if (!scene_arrange(scene, viewer->session) || !scene_find_vertices(scene, viewer->session) ||
        (has_picture && !picture_prepare(&viewer->picture, scene))) {
        picture_forget(&viewer->picture, &scene->items[scene->input_count - 1]);
        scene_drop(scene);
        scene_arrange(scene, viewer->session);
        return false;
    }
    const struct input *added = &scene->inputs[scene->input_count - 1];
    for (uint32_t s = 0; s < added->info.scalar_count; s++)
        view_add_scalar(&viewer->state, pbr_points_scalar_name(added->points, s));
    if (scene->input_count > 1) keep_camera(viewer, before);
    return true;
}

static void set_title(struct viewer *viewer) {
    char title[256];
    const struct loader_progress *loading = &viewer->facts.loading;
    if (loading->is_running) snprintf(title, sizeof title, "Reading %s - pbr", view_file_name(loading->path));
    else if (viewer->scene.input_count == 1)
        snprintf(title, sizeof title, "%s - pbr", view_file_name(viewer->scene.inputs[0].path));
    else snprintf(title, sizeof title, "%u files - pbr", (unsigned)viewer->scene.input_count);
    view_window_set_title(&viewer->window, title);
}

/* Shows what has been read since. All read and nothing to show closes the window. */
static void take_news(struct viewer *viewer) {
    char message[SESSION_LINE];
    struct input input;
    struct loader_progress *loading = &viewer->facts.loading;
    const struct loader_progress before = *loading;
    *loading = loader_progress(viewer->loader);
    bool is_new = before.is_running != loading->is_running || before.index != loading->index;
    for (enum loader_news news; (news = loader_take(viewer->loader, &input, message, sizeof message)) != LOADER_NOTHING;) {
        if (news == LOADER_FAILURE) keep_error(viewer, message);
        else if (!add_input(viewer, &input)) keep_last_error(viewer);
        input_release(&input);
        change(viewer, VIEW_SCENE_CHANGED);
        is_new = true;
    }
    if (is_new) set_title(viewer);
    if (!loading->is_running && viewer->scene.input_count == 0) view_window_quit(&viewer->window);
}

/* Hierarchies get finer. */
static bool is_refining(const struct viewer *viewer) {
    return viewer->picture.frame_count > 0 && !viewer->picture.is_final;
}

static void animate(struct viewer *viewer) {
    const double now = session_seconds();
    if (viewer->state.spins) {
        orbit_turn(viewer->state.options.view, -30 * fmin(now - viewer->spun_at, 0.1), 0); /* degrees a second; no leaps */
        viewer->spun_at = now;
        change(viewer, VIEW_SCENE_CHANGED);
    }
    if (is_refining(viewer)) change(viewer, VIEW_SCENE_CHANGED);
    if (viewer->facts.loading.is_running && now - viewer->shown_at >= 0.05) change(viewer, VIEW_OVERLAY_CHANGED);
    if (viewer->facts.notice && now >= viewer->notice_until) {
        viewer->facts.notice = NULL;
        change(viewer, VIEW_OVERLAY_CHANGED);
    }
}

/* How long nothing changes by itself: seconds, negative for ever. */
static double patience(const struct viewer *viewer) {
    const double now = session_seconds();
    if (viewer->state.spins) return fmax(viewer->spun_at + 1 / 60.0 - now, 0);
    if (is_refining(viewer)) return fmax(viewer->shown_at + 1 / 60.0 - now, 0);
    if (viewer->facts.loading.is_running) return 0.05;
    return viewer->facts.notice ? fmax(viewer->notice_until - now, 0) : -1;
}

static void run_events(struct viewer *viewer) {
    viewer->facts.loading = loader_progress(viewer->loader);
    set_title(viewer);
    show(viewer);
    while (!view_window_wants_close(&viewer->window)) {
        take_news(viewer);
        animate(viewer);
        show(viewer);
        if (!view_window_wants_close(&viewer->window)) view_window_wait(&viewer->window, patience(viewer));
    }
}

static void put_json(struct viewer *viewer) {
    const struct scene_options *options = &viewer->state.options;
    struct json json = {.file = stdout};
    char colour[SESSION_LINE];
    view_colour_name(options, colour, sizeof colour);
    json_open_object(&json, NULL);
    json_integer(&json, "points", scene_point_count(&viewer->scene));
    json_integer(&json, "frames", viewer->picture.frame_count);
    json_number(&json, "frame_ms", picture_milliseconds(&viewer->picture));
    json_numbers(&json, "size", (double[2]){viewer->picture.target.size[0], viewer->picture.target.size[1]}, 2);
    json_numbers(&json, "view", options->view, 3);
    if (options->has_centre) json_numbers(&json, "centre", options->centre, 3);
    else json_string(&json, "centre", NULL);
    json_numbers(&json, "light", options->light, 2);
    json_truth(&json, "ortho", options->parallel);
    json_string(&json, "splat", kind_name(splat_kinds, options->splat));
    json_string(&json, "blend", kind_name(blending_kinds, scene_options_blending(options)));
    json_string(&json, "shade", kind_name(shading_kinds, options->shading));
    json_string(&json, "colour", colour);
    json_truth(&json, "cull", options->cull);
    json_string(&json, "lod", kind_name(lod_kinds, options->lod));
    json_truth(&json, "vertices", options->vertices);
    json_number(&json, "point_cost", scene_point_cost(&viewer->scene));
    json_number(&json, "threshold", scene_options_threshold(options));
    json_number(&json, "radius_scale", options->radius_scale > 0 ? options->radius_scale : 1);
    json_number(&json, "min_size", options->size_minimum);
    json_number(&json, "low_pass", options->low_pass > 0 ? options->low_pass : 1);
    json_open_array(&json, "screenshots");
    for (uint32_t i = 0; i < viewer->screenshot_count; i++) json_string(&json, NULL, viewer->screenshots[i]);
    json_close_array(&json);
    json_close_object(&json);
}

/* False with a message. */
static bool open_window(struct viewer *viewer) {
    const struct scene_options *options = &viewer->options.scene;
    struct view_handler handler = {viewer, on_gesture, on_action, on_damage};
    const char *refusal = view_window_open(&viewer->window, options, "pbr", handler);
    if (refusal) {
        session_fail(viewer->session, "no window: %s", refusal);
        return false;
    }
    if (!picture_create(&viewer->picture, viewer->session, options, view_window_get_proc)) return false;
    refusal = overlay_create(&viewer->overlay, viewer->picture.is_es);
    if (refusal) session_fail(viewer->session, "%s", refusal);
    return !refusal;
}

/* The window goes at once, even if reading does not. */
static void close_window(struct viewer *viewer) {
    if (viewer->window.handle) {
        overlay_destroy(&viewer->overlay);
        picture_destroy(&viewer->picture);
    }
    view_window_close(&viewer->window);
    if (!loader_stop(&viewer->loader)) _exit(fflush(stdout) == 0 ? viewer->status : STATUS_FAILED);
    view_window_end();
}

static void view(struct viewer *viewer) {
    const struct scene_options *options = &viewer->options.scene;
    viewer->state.options = viewer->state.start = viewer->good = *options;
    viewer->state.shows_info = true;
    viewer->scene.options = &viewer->state.options;
    viewer->facts.state = &viewer->state;
    viewer->facts.scene = &viewer->scene;
    viewer->change = VIEW_SCENE_CHANGED;
    viewer->status = STATUS_FAILED;
    if (open_window(viewer)) {
        viewer->loader =
            loader_start(viewer->session, options->inputs, options->input_count, scene_options_wanted(options), view_window_wake);
        if (viewer->loader) {
            viewer->status = STATUS_OK;
            run_events(viewer);
            if (viewer->options.json) put_json(viewer);
        }
    }
    close_window(viewer);
}

static int run_view(struct session *session, int argc, char **argv) {
    struct viewer *viewer = calloc(1, sizeof *viewer);
    if (!viewer) return session_fail(session, "no memory");
    viewer->session = session;
    int status = view_options_parse(session, argc, argv, &viewer->options);
    if (status == STATUS_OK) {
        view(viewer);
        status = viewer->status;
    }
    scene_release(&viewer->scene);
    for (uint32_t i = 0; i < viewer->screenshot_count; i++) free(viewer->screenshots[i]);
    free(viewer->screenshots);
    free(viewer);
    return status;
}

const struct command view_command = {"view", run_view, view_usage};
