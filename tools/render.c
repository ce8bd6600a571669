/* pbr render: pictures of points without a window. SPDX-License-Identifier: MIT */
#include <errno.h>
#include <pbr/image.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "json.h"
#include "median.h"
#include "raw_points.h"
#include "reference.h"
#include "render_options.h"
#include "scene.h"
#include "target.h"

/* What one run holds. Zero where it is not there yet. */
struct render {
    struct session *session;
    struct render_options options;
    bool is_es;
    struct scene scene;
    struct raw_points raw[MOST_INPUTS]; /* with --raw, one of each per input */
    double raw_sizes[MOST_INPUTS];
    struct headless headless;
    struct target target;
    pbr_renderer *renderer;
    pbr_view *view;
    bool without_gl;   /* --reference or --ground-truth: */
    pbr_image picture; /* the last frame */
};

/* What --stats tells. Times in milliseconds. */
struct record {
    uint64_t points, triangles; /* of all copies */
    pbr_stats last;
    uint64_t nodes_visited; /* the most of a frame: a hierarchy is not looked at again while the view stays */
    uint64_t nodes_in_all;  /* of the frames after the first one */
    double load_ms, build_ms, first_frame_ms;
    uint64_t refining_frames;                          /* with --refine: until the picture is final, */
    double first_picture_ms, final_picture_ms;         /* and from the start until something is drawn, until it is final */
    double *frame_ms, *cut_ms, *upload_bytes, *raw_ms; /* one per frame */
    uint64_t allocations;
};

static bool load_inputs(struct render *render, struct record *record) {
    const struct scene_options *options = &render->options.scene;
    const unsigned wanted = render_options_wanted(&render->options);
    for (uint32_t i = 0; i < options->input_count; i++) {
        struct input input;
        bool loaded = input_load(render->session, options->inputs[i], wanted, session_progress, render->session, &input);
        if (render->options.reference) pbr_lod_release(&input.lod); /* its leaves are drawn */
        if (loaded) scene_add(&render->scene, &input);
        input_release(&input);
        if (!loaded) return false;
        record->load_ms += input.load_ms;
        record->build_ms += input.build_ms;
    }
    for (uint32_t i = 0; i < options->input_count; i++)
        if (!scene_check_scalar(options, render->session, &render->scene.inputs[i])) return false;
    if (!scene_arrange(&render->scene, render->session) || !scene_find_vertices(&render->scene, render->session)) return false;
    scene_style(&render->scene);
    record->points = scene_point_count(&render->scene);
    record->triangles = scene_triangle_count(&render->scene);
    return true;
}

static struct camera frame_camera(const struct render *render, uint32_t frame) {
    const struct render_options *options = &render->options;
    return scene_camera(&render->scene, options->orbit ? 360.0 * frame / options->frames : 0, options->scene.size);
}

static bool set_up_raw(struct render *render) {
    const struct scene *scene = &render->scene;
    struct camera camera = frame_camera(render, 0);
    double scale = scene->options->radius_scale > 0 ? scene->options->radius_scale : 1;
    for (uint32_t i = 0; i < scene->input_count; i++) {
        if (!raw_points_create(&render->raw[i], scene->inputs[i].points, render->is_es)) {
            session_fail(render->session, "%s: cannot be drawn as plain GL_POINTS", scene->inputs[i].path);
            return false;
        }
        for (uint32_t t = 0; t < scene->transform_count; t++)
            render->raw_sizes[i] +=
                raw_points_mean_size(&render->raw[i], &camera, scene->transforms[t], scale) / scene->transform_count;
    }
    return true;
}

static bool measure_point_cost(struct render *render) {
    const struct camera camera = frame_camera(render, 0);
    pbr_light light;
    const pbr_frame frame = scene_frame(&render->options.scene, &camera, &light);
    target_clear(&render->target, render->options.scene.background);
    const pbr_item *item = scene_mesh_item(&render->scene);
    const bool done = scene_measure_point_cost(&render->scene, render->session, render->renderer, &frame);
    if (item) pbr_renderer_evict_lod(render->renderer, item->lod); /* so that the first frame is one */
    return done;
}

static bool set_up_gl(struct render *render) {
    struct session *session = render->session;
    const struct render_options *options = &render->options;
    const enum headless_kind context = options->scene.context;
    render->is_es = headless_kind_is_es(context);
    const char *refusal = headless_create(&render->headless, context, false);
    if (refusal) {
        session_fail(session, "OpenGL %s: %s", headless_kind_name(context), refusal);
        return false;
    }
    const char *ending = options->output ? strrchr(options->output, '.') : NULL;
    bool is_float = ending && !strcmp(ending, ".exr");
    refusal = target_create(&render->target, options->scene.size, options->scene.samples, is_float, render->is_es);
    if (refusal) {
        session_fail(session, "%s", refusal);
        return false;
    }
    if (is_float && render->is_es)
        session_warn(session, "%s: OpenGL ES cannot read depth back: the picture has none", options->output);
    unsigned errors = atomic_load(&session->errors);
    if (!session_check(session, pbr_renderer_create(session->instance, NULL, &render->renderer), errors, "renderer")) return false;
    if (!session_check(session, pbr_view_create(render->renderer, NULL, &render->view), errors, "view")) return false;
    if (options->scene.point_cost == POINT_COST_AUTO && !measure_point_cost(render)) return false;
    scene_style(&render->scene);
    return !options->raw || set_up_raw(render);
}

/* The same picture without OpenGL. */
static double draw_reference_frame(struct render *render, uint32_t frame_number, pbr_stats *stats) {
    struct camera camera = frame_camera(render, frame_number);
    const uint32_t samples = render->options.ground_truth;
    pbr_light light;
    pbr_frame frame = scene_frame(&render->options.scene, &camera, &light);
    double start = session_seconds();
    pbr_image_destroy(render->session->instance, &render->picture);
    if (!reference_draw(render->session, &render->scene, &frame, samples, render->options.scene.background, &render->picture))
        return -1;
    *stats = (pbr_stats)PBR_STATS_INIT;
    stats->splats_drawn = samples > 0 ? 0 : scene_point_count(&render->scene);
    stats->is_final = 1;
    return 1e3 * (session_seconds() - start);
}

/* One frame as a host would draw it, from the clear to the end of the GPU's work. Returns milliseconds, negative on error. */
static double draw_frame(struct render *render, uint32_t frame_number, pbr_stats *stats) {
    if (render->without_gl) return draw_reference_frame(render, frame_number, stats);
    struct camera camera = frame_camera(render, frame_number);
    pbr_light light;
    pbr_frame frame = scene_frame(&render->options.scene, &camera, &light);
    if (!render->options.refine) frame.flags |= PBR_FRAME_WAIT;
    unsigned errors = atomic_load(&render->session->errors);
    double start = session_seconds();
    target_clear(&render->target, render->options.scene.background);
    *stats = (pbr_stats)PBR_STATS_INIT;
    pbr_result result = pbr_render(render->view, &frame, render->scene.items, render->scene.input_count, stats);
    glFinish();
    return session_check(render->session, result, errors, "render") ? 1e3 * (session_seconds() - start) : -1;
}

static double draw_raw_frame(struct render *render, uint32_t frame_number) {
    const struct scene *scene = &render->scene;
    struct camera camera = frame_camera(render, frame_number);
    double start = session_seconds();
    target_clear(&render->target, render->options.scene.background);
    for (uint32_t i = 0; i < scene->input_count; i++)
        for (uint32_t t = 0; t < scene->transform_count; t++)
            raw_points_draw(&render->raw[i], &camera, scene->transforms[t], render->raw_sizes[i], render->is_es);
    glFinish();
    return 1e3 * (session_seconds() - start);
}

static double window_to_distance(const void *camera, double depth) {
    return camera_distance(camera, depth);
}

static bool write_picture(struct render *render, uint32_t frame, const char *path) {
    struct session *session = render->session;
    struct camera camera = frame_camera(render, frame);
    pbr_image image = PBR_IMAGE_INIT;
    unsigned errors = atomic_load(&session->errors);
    if (render->without_gl) return session_check(session, pbr_image_write(session->instance, &render->picture, path), errors, path);
    bool with_depth = render->target.is_float;
    pbr_result result = target_read(&render->target, session->instance, with_depth ? window_to_distance : NULL, &camera, &image);
    if (result == PBR_OK) result = pbr_image_write(session->instance, &image, path);
    pbr_image_destroy(session->instance, &image);
    return session_check(session, result, errors, path);
}

/* Writes the frame that is in the target now, if the output shows it: every one of an orbit into numbered files, the first of an
 * orbit into one file, else the last. */
static bool keep_frame(struct render *render, uint32_t frame) {
    const struct render_options *options = &render->options;
    char name[4096];
    if (!options->output) return true;
    bool numbered = options->orbit && render_frame_name(options->output, frame, name, sizeof name);
    if (!numbered && frame != (options->orbit ? 0 : options->frames - 1)) return true;
    return write_picture(render, frame, numbered ? name : options->output);
}

/* As a window would draw it: one frame after the other, of what is there. */
static bool draw_until_final(struct render *render, struct record *record) {
    const double start = session_seconds();
    do {
        const double ms = draw_frame(render, 0, &record->last);
        if (ms < 0) return false;
        if (record->refining_frames++ == 0) record->first_frame_ms = ms;
        if (record->last.nodes_visited > record->nodes_visited) record->nodes_visited = record->last.nodes_visited;
        record->final_picture_ms = 1e3 * (session_seconds() - start);
        if (record->first_picture_ms == 0 && record->last.splats_drawn > 0) record->first_picture_ms = record->final_picture_ms;
    } while (!record->last.is_final);
    return true;
}

static bool draw_frames(struct render *render, struct record *record) {
    const uint32_t frames = render->options.frames;
    /* The first frame of OpenGL's is timed apart, and drawn again. */
    if (render->options.refine) {
        if (!draw_until_final(render, record)) return false;
    } else if (!render->without_gl) {
        record->first_frame_ms = draw_frame(render, 0, &record->last);
        if (record->first_frame_ms < 0) return false;
        record->nodes_visited = record->last.nodes_visited;
    }
    if (render->options.raw) draw_raw_frame(render, 0);
    for (uint32_t i = 0; i < frames; i++) {
        if (render->options.raw) record->raw_ms[i] = draw_raw_frame(render, i);
        uint64_t before = atomic_load(&render->session->allocations);
        record->frame_ms[i] = draw_frame(render, i, &record->last);
        record->allocations += atomic_load(&render->session->allocations) - before;
        if (record->last.nodes_visited > record->nodes_visited) record->nodes_visited = record->last.nodes_visited;
        record->nodes_in_all += record->last.nodes_visited;
        record->cut_ms[i] = 1e3 * record->last.cut_seconds;
        record->upload_bytes[i] = (double)record->last.upload_bytes;
        if (record->frame_ms[i] < 0 || !keep_frame(render, i)) return false;
        if (render->without_gl && i == 0) record->first_frame_ms = record->frame_ms[0];
        if (frames > 1) session_progress(render->session, "drawing", (double)(i + 1) / frames);
    }
    session_progress_end(render->session);
    GLenum error = render->without_gl ? GL_NO_ERROR : glGetError();
    if (error) session_fail(render->session, "OpenGL error 0x%04x", (unsigned)error);
    return error == GL_NO_ERROR;
}

static void put_stats(const struct render *render, struct record *record, struct json *json) {
    const uint32_t frames = render->options.frames;
    double frame_ms = median(record->frame_ms, frames);
    json_open_object(json, NULL);
    json_integer(json, "points", record->points);
    json_integer(json, "nodes", 0); /* unknown: counting them would read all of a file */
    json_integer(json, "triangles", record->triangles);
    json_integer(json, "splats_drawn", record->last.splats_drawn);
    json_integer(json, "triangles_drawn", render->options.ground_truth > 0 ? record->triangles : record->last.triangles_drawn);
    json_integer(json, "nodes_visited", record->nodes_visited);
    json_number(json, "nodes_visited_per_frame", (double)record->nodes_in_all / frames);
    json_integer(json, "nodes_hidden", record->last.nodes_hidden);
    json_integer(json, "frames", frames);
    json_number(json, "frame_ms", frame_ms);
    json_number(json, "cut_ms", median(record->cut_ms, frames));
    json_number(json, "first_frame_ms", record->first_frame_ms);
    if (render->options.refine) {
        json_number(json, "first_picture_ms", record->first_picture_ms);
        json_number(json, "final_picture_ms", record->final_picture_ms);
        json_integer(json, "refining_frames", record->refining_frames);
    }
    json_number(json, "load_ms", record->load_ms);
    json_number(json, "build_ms", record->build_ms);
    json_number(json, "upload_bytes", median(record->upload_bytes, frames));
    json_number(json, "heap_allocations_per_frame", (double)record->allocations / frames);
    json_integer(json, "peak_rss_bytes", session_peak_memory());
    json_string(json, "gl_renderer", render->without_gl ? "none" : (const char *)glGetString(GL_RENDERER));
    json_string(json, "gl_version", render->without_gl ? "none" : (const char *)glGetString(GL_VERSION));
    const struct scene_options *scene = &render->options.scene;
    const bool has_splats = render->options.ground_truth == 0;
    json_string(json, "splat", has_splats ? kind_name(splat_kinds, scene->splat) : "none");
    json_string(json, "blend", has_splats ? kind_name(blending_kinds, scene_options_blending(scene)) : "none");
    const uint32_t lod = scene_hierarchy(&render->scene);
    const bool has_hierarchy = lod != LOD_NONE;
    json_string(json, "lod", kind_name(lod_kinds, lod));
    json_number(json, "point_cost", scene_point_cost(&render->scene));
    json_number(json, "threshold_px", has_hierarchy ? scene_options_threshold(scene) : 0);
    json_number(json, "drawn_threshold_px", (double)record->last.threshold);
    json_truth(json, "final", record->last.is_final == 1);
    if (render->options.raw) {
        double raw_ms = median(record->raw_ms, frames);
        json_number(json, "raw_frame_ms", raw_ms);
        json_number(json, "speed_vs_raw", raw_ms / frame_ms);
    }
    json_close_object(json);
}

static bool write_stats(struct render *render, struct record *record) {
    const char *path = render->options.stats;
    struct json json = {.file = fopen(path, "w")};
    if (json.file) put_stats(render, record, &json);
    bool written = json.file && !ferror(json.file);
    if (json.file && fclose(json.file) != 0) written = false;
    if (!written) session_fail(render->session, "%s: %s", path, strerror(errno));
    return written;
}

static void tear_down(struct render *render) {
    pbr_view_destroy(&render->view);
    pbr_renderer_destroy(&render->renderer);
    if (render->headless.context) {
        for (uint32_t i = 0; render->options.raw && i < render->scene.input_count; i++) raw_points_destroy(&render->raw[i]);
        target_destroy(&render->target);
        headless_destroy(&render->headless);
    }
    pbr_image_destroy(render->session->instance, &render->picture);
    scene_release(&render->scene);
}

static bool record_open(struct session *session, struct record *record, uint32_t frames) {
    record->frame_ms = calloc(4 * (size_t)frames, sizeof(double));
    if (!record->frame_ms) session_fail(session, "no memory for the times of %u frames", (unsigned)frames);
    record->cut_ms = record->frame_ms + frames;
    record->upload_bytes = record->cut_ms + frames;
    record->raw_ms = record->upload_bytes + frames;
    return record->frame_ms;
}

static int run_render(struct session *session, int argc, char **argv) {
    struct record record = {0};
    struct render *render = calloc(1, sizeof *render);
    if (!render) return session_fail(session, "no memory");
    render->session = session;
    render->scene.options = &render->options.scene;
    render->picture = (pbr_image)PBR_IMAGE_INIT;
    int status = render_options_parse(session, argc, argv, &render->options);
    if (status == STATUS_OK) {
        render->without_gl = render->options.reference || render->options.ground_truth > 0;
        bool done = record_open(session, &record, render->options.frames) && load_inputs(render, &record) &&
                    (render->without_gl || set_up_gl(render)) && draw_frames(render, &record) &&
                    (!render->options.stats || write_stats(render, &record));
        if (!done) status = STATUS_FAILED;
        tear_down(render);
    }
    free(record.frame_ms);
    free(render);
    return status;
}

const struct command render_command = {"render", run_render, render_usage};
