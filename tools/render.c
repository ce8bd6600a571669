/* pbr render: pictures of points without a window. SPDX-License-Identifier: MIT */
#include <errno.h>
#include <pbr/image.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "camera.h"
#include "commands.h"
#include "input.h"
#include "json.h"
#include "raw_points.h"
#include "render_options.h"
#include "target.h"

/* What one run holds. Zero where it is not there yet. */
struct scene {
    struct session *session;
    struct render_options options;
    bool is_es;
    /* One of each per input: */
    struct input inputs[MOST_INPUTS];
    pbr_points_info infos[MOST_INPUTS];
    pbr_item items[MOST_INPUTS];
    struct raw_points raw[MOST_INPUTS]; /* with --raw */
    double raw_sizes[MOST_INPUTS];
    double (*transforms)[16]; /* of every item: one, identity or z up; with --grid one a copy */
    uint32_t transform_count;
    struct sphere sphere;
    double margin; /* the largest splat's radius, world */
    struct headless headless;
    struct target target;
    pbr_renderer *renderer;
    pbr_view *view;
};

/* What --stats tells. Times in milliseconds. */
struct record {
    uint64_t points, triangles; /* of all copies */
    pbr_stats last;
    double load_ms, first_frame_ms;
    double *frame_ms, *cut_ms, *upload_bytes, *raw_ms; /* one per frame */
    uint64_t allocations;
};

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static bool load_inputs(struct scene *scene, struct record *record) {
    for (uint32_t i = 0; i < scene->options.input_count; i++) {
        struct input *input = &scene->inputs[i];
        if (!input_load(scene->session, scene->options.inputs[i], input)) return false;
        scene->infos[i] = input->info;
        record->load_ms += input->load_ms;
        record->points += input->info.count * scene->options.grid[0] * scene->options.grid[1];
        record->triangles += input->mesh.triangle_count * scene->options.grid[0] * scene->options.grid[1];
    }
    return true;
}

static bool find_scalar(struct scene *scene, uint32_t i, uint32_t *index) {
    for (uint32_t s = 0; s < scene->infos[i].scalar_count; s++) {
        if (strcmp(pbr_points_scalar_name(scene->inputs[i].points, s), scene->options.scalar)) continue;
        *index = s;
        return true;
    }
    session_fail(scene->session, "%s: no scalar attribute is named '%s' (see pbr info)", scene->options.inputs[i],
                 scene->options.scalar);
    return false;
}

/* Copies in rows from top to bottom and columns from left to right, seen along -z, a tenth of their box apart, with the middle of
 * all where the model's is. The sphere is widened to hold them. */
static bool set_up_transforms(struct scene *scene) {
    const struct render_options *options = &scene->options;
    const uint32_t rows = options->grid[0], columns = options->grid[1];
    double low[3] = {0}, high[3] = {0};
    scene->transform_count = rows * columns;
    scene->transforms = calloc(scene->transform_count, sizeof *scene->transforms);
    if (!scene->transforms) {
        session_fail(scene->session, "no memory for %u copies", (unsigned)scene->transform_count);
        return false;
    }
    scene->sphere = camera_sphere(scene->infos, options->input_count, options->z_up);
    const double fallback = scene->sphere.radius > 0 ? scene->sphere.radius : 1; /* for what has no width or height */
    camera_box(scene->infos, options->input_count, low, high);
    const int up = options->z_up ? 2 : 1;
    const double across = 1.1 * (high[0] > low[0] ? high[0] - low[0] : fallback);
    const double down = 1.1 * (high[up] > low[up] ? high[up] - low[up] : fallback);
    for (uint32_t i = 0; i < scene->transform_count; i++) {
        double *transform = scene->transforms[i];
        memcpy(transform, options->z_up ? camera_z_up : identity, sizeof identity);
        transform[12] = across * (i % columns - (columns - 1) / 2.0);
        transform[13] = down * ((rows - 1) / 2.0 - i / columns);
    }
    scene->sphere.radius += hypot(across * (columns - 1) / 2, down * (rows - 1) / 2);
    return true;
}

static bool set_up_items(struct scene *scene) {
    const struct render_options *options = &scene->options;
    if (!set_up_transforms(scene)) return false;
    for (uint32_t i = 0; i < options->input_count; i++) {
        pbr_item *item = &scene->items[i];
        *item = (pbr_item)PBR_ITEM_INIT;
        item->id = i;
        item->points = scene->inputs[i].points;
        item->transforms = scene->transforms[0];
        item->transform_count = scene->transform_count;
        item->splat = options->splat;
        item->shading = options->shading;
        item->colour_source = options->colour_source;
        item->flags = options->cull ? PBR_ITEM_CULL_BACK_FACES : 0;
        item->radius_scale = (float)options->radius_scale;
        item->size_minimum = (float)options->size_minimum;
        item->size_maximum = (float)options->size_maximum;
        if (options->colour_source == PBR_COLOUR_SCALAR && !find_scalar(scene, i, &item->scalar_index)) return false;
        double scale = options->radius_scale > 0 ? options->radius_scale : 1;
        scene->margin = fmax(scene->margin, scale * (double)scene->infos[i].radius_maximum);
    }
    return true;
}

static struct camera scene_camera(const struct scene *scene, uint32_t frame) {
    const struct render_options *options = &scene->options;
    double turn = options->orbit ? 360.0 * frame / options->frames : 0;
    return camera_look(scene->sphere, options->view[0] + turn, options->view[1], options->view[2], options->parallel, scene->margin,
                       options->size);
}

static bool set_up_raw(struct scene *scene) {
    struct camera camera = scene_camera(scene, 0);
    double scale = scene->options.radius_scale > 0 ? scene->options.radius_scale : 1;
    for (uint32_t i = 0; i < scene->options.input_count; i++) {
        if (!raw_points_create(&scene->raw[i], scene->inputs[i].points, scene->is_es)) {
            session_fail(scene->session, "%s: cannot be drawn as plain GL_POINTS", scene->options.inputs[i]);
            return false;
        }
        for (uint32_t t = 0; t < scene->transform_count; t++)
            scene->raw_sizes[i] +=
                raw_points_mean_size(&scene->raw[i], &camera, scene->transforms[t], scale) / scene->transform_count;
    }
    return true;
}

static bool set_up_gl(struct scene *scene) {
    struct session *session = scene->session;
    const struct render_options *options = &scene->options;
    scene->is_es = headless_kind_is_es(options->context);
    const char *refusal = headless_create(&scene->headless, options->context, false);
    if (refusal) {
        session_fail(session, "OpenGL %s: %s", headless_kind_name(options->context), refusal);
        return false;
    }
    const char *ending = options->output ? strrchr(options->output, '.') : NULL;
    bool is_float = ending && !strcmp(ending, ".exr");
    refusal = target_create(&scene->target, options->size, options->samples, is_float, scene->is_es);
    if (refusal) {
        session_fail(session, "%s", refusal);
        return false;
    }
    if (is_float && scene->is_es)
        session_warn(session, "%s: OpenGL ES cannot read depth back: the picture has none", options->output);
    unsigned errors = atomic_load(&session->errors);
    if (!session_check(session, pbr_renderer_create(session->instance, NULL, &scene->renderer), errors, "renderer")) return false;
    if (!session_check(session, pbr_view_create(scene->renderer, NULL, &scene->view), errors, "view")) return false;
    return !options->raw || set_up_raw(scene);
}

/* One frame as a host would draw it, from the clear to the end of the GPU's work. Returns milliseconds, negative on error. */
static double draw_frame(struct scene *scene, uint32_t frame_number, pbr_stats *stats) {
    struct camera camera = scene_camera(scene, frame_number);
    pbr_frame frame = PBR_FRAME_INIT;
    unsigned errors = atomic_load(&scene->session->errors);
    double start = session_seconds();
    target_clear(&scene->target, scene->options.background);
    memcpy(frame.view, camera.view, sizeof frame.view);
    memcpy(frame.projection, camera.projection, sizeof frame.projection);
    *stats = (pbr_stats)PBR_STATS_INIT;
    pbr_result result = pbr_render(scene->view, &frame, scene->items, scene->options.input_count, stats);
    glFinish();
    return session_check(scene->session, result, errors, "render") ? 1e3 * (session_seconds() - start) : -1;
}

static double draw_raw_frame(struct scene *scene, uint32_t frame_number) {
    struct camera camera = scene_camera(scene, frame_number);
    double start = session_seconds();
    target_clear(&scene->target, scene->options.background);
    for (uint32_t i = 0; i < scene->options.input_count; i++)
        for (uint32_t t = 0; t < scene->transform_count; t++)
            raw_points_draw(&scene->raw[i], &camera, scene->transforms[t], scene->raw_sizes[i], scene->is_es);
    glFinish();
    return 1e3 * (session_seconds() - start);
}

static double window_to_distance(const void *camera, double depth) {
    return camera_distance(camera, depth);
}

static bool write_picture(struct scene *scene, uint32_t frame, const char *path) {
    struct session *session = scene->session;
    struct camera camera = scene_camera(scene, frame);
    pbr_image image = PBR_IMAGE_INIT;
    unsigned errors = atomic_load(&session->errors);
    bool with_depth = scene->target.is_float;
    pbr_result result = target_read(&scene->target, session->instance, with_depth ? window_to_distance : NULL, &camera, &image);
    if (result == PBR_OK) result = pbr_image_write(session->instance, &image, path);
    pbr_image_destroy(session->instance, &image);
    return session_check(session, result, errors, path);
}

/* Writes the frame that is in the target now, if the output shows it: every one of an orbit into numbered files, the first of an
 * orbit into one file, else the last. */
static bool keep_frame(struct scene *scene, uint32_t frame) {
    const struct render_options *options = &scene->options;
    char name[4096];
    if (!options->output) return true;
    bool numbered = options->orbit && render_frame_name(options->output, frame, name, sizeof name);
    if (!numbered && frame != (options->orbit ? 0 : options->frames - 1)) return true;
    return write_picture(scene, frame, numbered ? name : options->output);
}

static bool draw_frames(struct scene *scene, struct record *record) {
    const uint32_t frames = scene->options.frames;
    record->first_frame_ms = draw_frame(scene, 0, &record->last);
    if (record->first_frame_ms < 0) return false;
    if (scene->options.raw) draw_raw_frame(scene, 0);
    for (uint32_t i = 0; i < frames; i++) {
        if (scene->options.raw) record->raw_ms[i] = draw_raw_frame(scene, i);
        uint64_t before = atomic_load(&scene->session->allocations);
        record->frame_ms[i] = draw_frame(scene, i, &record->last);
        record->allocations += atomic_load(&scene->session->allocations) - before;
        record->cut_ms[i] = 1e3 * record->last.cut_seconds;
        record->upload_bytes[i] = (double)record->last.upload_bytes;
        if (record->frame_ms[i] < 0 || !keep_frame(scene, i)) return false;
        if (frames > 1) session_progress(scene->session, "drawing", (double)(i + 1) / frames);
    }
    session_progress_end(scene->session);
    GLenum error = glGetError();
    if (error) session_fail(scene->session, "OpenGL error 0x%04x", (unsigned)error);
    return error == GL_NO_ERROR;
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts them. */
static double median(double *values, size_t count) {
    qsort(values, count, sizeof values[0], compare_doubles);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}

static uint64_t peak_memory(void) {
    struct rusage usage;
    return getrusage(RUSAGE_SELF, &usage) == 0 ? (uint64_t)usage.ru_maxrss * 1024 : 0;
}

static void put_stats(const struct scene *scene, struct record *record, struct json *json) {
    const uint32_t frames = scene->options.frames;
    double frame_ms = median(record->frame_ms, frames);
    json_open_object(json, NULL);
    json_integer(json, "points", record->points);
    json_integer(json, "nodes", 0); /* of hierarchies: none here */
    json_integer(json, "triangles", record->triangles);
    json_integer(json, "splats_drawn", record->last.splats_drawn);
    json_integer(json, "triangles_drawn", 0);
    json_integer(json, "nodes_visited", record->last.nodes_visited);
    json_integer(json, "frames", frames);
    json_number(json, "frame_ms", frame_ms);
    json_number(json, "cut_ms", median(record->cut_ms, frames));
    json_number(json, "first_frame_ms", record->first_frame_ms);
    json_number(json, "load_ms", record->load_ms);
    json_number(json, "build_ms", 0);
    json_number(json, "upload_bytes", median(record->upload_bytes, frames));
    json_number(json, "heap_allocations_per_frame", (double)record->allocations / frames);
    json_integer(json, "peak_rss_bytes", peak_memory());
    json_string(json, "gl_renderer", (const char *)glGetString(GL_RENDERER));
    json_string(json, "gl_version", (const char *)glGetString(GL_VERSION));
    json_string(json, "splat", render_splat_name(scene->options.splat));
    json_string(json, "blend", "opaque");
    json_string(json, "lod", "none");
    json_number(json, "threshold_px", 0);
    json_truth(json, "final", record->last.is_final == 1);
    if (scene->options.raw) {
        double raw_ms = median(record->raw_ms, frames);
        json_number(json, "raw_frame_ms", raw_ms);
        json_number(json, "speed_vs_raw", raw_ms / frame_ms);
    }
    json_close_object(json);
}

static bool write_stats(struct scene *scene, struct record *record) {
    const char *path = scene->options.stats;
    struct json json = {.file = fopen(path, "w")};
    if (json.file) put_stats(scene, record, &json);
    bool written = json.file && !ferror(json.file);
    if (json.file && fclose(json.file) != 0) written = false;
    if (!written) session_fail(scene->session, "%s: %s", path, strerror(errno));
    return written;
}

static void tear_down(struct scene *scene) {
    pbr_view_destroy(&scene->view);
    pbr_renderer_destroy(&scene->renderer);
    if (scene->headless.context) {
        for (uint32_t i = 0; scene->options.raw && i < scene->options.input_count; i++) raw_points_destroy(&scene->raw[i]);
        target_destroy(&scene->target);
        headless_destroy(&scene->headless);
    }
    for (uint32_t i = 0; i < scene->options.input_count; i++) input_release(&scene->inputs[i]);
    free(scene->transforms);
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
    struct scene *scene = calloc(1, sizeof *scene);
    if (!scene) return session_fail(session, "no memory");
    scene->session = session;
    int status = render_options_parse(session, argc, argv, &scene->options);
    if (status == STATUS_OK) {
        bool done = record_open(session, &record, scene->options.frames) && load_inputs(scene, &record) && set_up_items(scene) &&
                    set_up_gl(scene) && draw_frames(scene, &record) && (!scene->options.stats || write_stats(scene, &record));
        if (!done) status = STATUS_FAILED;
        tear_down(scene);
    }
    free(record.frame_ms);
    free(scene);
    return status;
}

const struct command render_command = {"render", run_render, render_usage};
