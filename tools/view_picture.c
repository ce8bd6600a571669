/* Drawing, timing and writing the viewer's picture. SPDX-License-Identifier: MIT */
#include "view_picture.h"

#include <string.h>

#include "median.h"

typedef pbr_result draw_fn(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t count, pbr_stats *stats);

bool picture_create(struct picture *picture, struct session *session, const struct scene_options *options,
                    void *(*get_proc)(void *user, const char *name)) {
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    unsigned errors = atomic_load(&session->errors);
    *picture = (struct picture){.session = session, .samples = options->samples, .is_es = headless_kind_is_es(options->context)};
    desc.get_proc_address = get_proc;
    return session_check(session, pbr_renderer_create(session->instance, &desc, &picture->renderer), errors, "renderer") &&
           session_check(session, pbr_view_create(picture->renderer, NULL, &picture->view), errors, "view");
}

void picture_destroy(struct picture *picture) {
    pbr_view_destroy(&picture->view);
    pbr_renderer_destroy(&picture->renderer);
    target_destroy(&picture->target);
}

bool picture_resize(struct picture *picture, const uint32_t size[2]) {
    target_destroy(&picture->target);
    const char *refusal = target_create(&picture->target, size, picture->samples, false, picture->is_es);
    if (refusal) session_fail(picture->session, "%s", refusal);
    return !refusal;
}

/* Where it is asked for, and splats are of another kind than when it was measured. Fails as drawing does. */
static bool measure_point_cost(struct picture *picture, struct scene *scene) {
    const struct scene_options *options = scene->options;
    const struct picture_kind now = {true, options->splat, options->blending, options->shading};
    const struct picture_kind *last = &picture->measured;
    const bool is_known =
        last->is_known && now.splat == last->splat && now.blending == last->blending && now.shading == last->shading;
    if (options->point_cost != POINT_COST_AUTO || is_known || !scene_mesh_item(scene)) return true;
    pbr_light light;
    const struct camera camera = scene_camera(scene, 0, picture->target.size);
    const pbr_frame frame = scene_frame(options, &camera, &light);
    picture->measured = now;
    target_clear(&picture->target, options->background);
    return scene_measure_point_cost(scene, picture->session, picture->renderer, &frame);
}

static bool call(struct picture *picture, draw_fn *draw, struct scene *scene, bool waits) {
    pbr_light light;
    unsigned errors = atomic_load(&picture->session->errors);
    struct camera camera = scene_camera(scene, 0, picture->target.size);
    pbr_frame frame = scene_frame(scene->options, &camera, &light);
    if (waits) frame.flags |= PBR_FRAME_WAIT;
    if (waits) frame.time_budget = 0;
    scene_style(scene);
    target_clear(&picture->target, scene->options->background);
    picture->stats = (pbr_stats)PBR_STATS_INIT;
    pbr_result result = draw(picture->view, &frame, scene->items, scene->input_count, &picture->stats);
    return session_check(picture->session, result, errors, "view");
}

bool picture_prepare(struct picture *picture, struct scene *scene) {
    return call(picture, pbr_prepare, scene, false);
}

void picture_forget(struct picture *picture, const pbr_item *item) {
    if (item->lod) pbr_renderer_evict_lod(picture->renderer, item->lod);
    else pbr_renderer_evict(picture->renderer, item->points);
}

bool picture_draw(struct picture *picture, struct scene *scene, bool waits) {
    picture->is_final = true; /* what fails is not tried again by itself */
    if (!measure_point_cost(picture, scene)) return false;
    const double start = session_seconds();
    if (!call(picture, pbr_render, scene, waits)) return false;
    picture->is_final = picture->stats.is_final == 1;
    if (scene->input_count > 0) {
        glFinish();
        picture->times[picture->frame_count++ % PICTURE_TIMES] = 1e3 * (session_seconds() - start);
    }
    target_resolve(&picture->target);
    return true;
}

bool picture_write(struct picture *picture, const char *name) {
    pbr_image image = PBR_IMAGE_INIT;
    unsigned errors = atomic_load(&picture->session->errors);
    pbr_instance *instance = picture->session->instance;
    pbr_result result = target_read(&picture->target, instance, NULL, NULL, &image);
    if (result == PBR_OK) result = pbr_image_write(instance, &image, name);
    pbr_image_destroy(instance, &image);
    return session_check(picture->session, result, errors, name);
}

double picture_milliseconds(const struct picture *picture) {
    double times[PICTURE_TIMES];
    const size_t count = picture->frame_count < PICTURE_TIMES ? (size_t)picture->frame_count : PICTURE_TIMES;
    memcpy(times, picture->times, sizeof times);
    return count ? median(times, count) : 0;
}
