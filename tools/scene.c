/* Items, transforms and camera of a scene. SPDX-License-Identifier: MIT */
#include "scene.h"

#include <stdlib.h>
#include <string.h>

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

void scene_add(struct scene *scene, struct input *input) {
    const uint32_t i = scene->input_count++;
    scene->inputs[i] = input_move(input);
    scene->infos[i] = input->info;
    scene->items[i] = (pbr_item)PBR_ITEM_INIT;
    scene->items[i].id = i;
    scene->items[i].lod = scene->inputs[i].lod;
    scene->items[i].points = scene->inputs[i].lod ? NULL : scene->inputs[i].points;
}

void scene_drop(struct scene *scene) {
    input_release(&scene->inputs[--scene->input_count]);
}

int scene_find_scalar(const struct input *input, const char *name) {
    for (uint32_t s = 0; s < input->info.scalar_count; s++)
        if (!strcmp(pbr_points_scalar_name(input->points, s), name)) return (int)s;
    return -1;
}

bool scene_check_scalar(const struct scene_options *options, struct session *session, const struct input *input) {
    if (options->colour_source != PBR_COLOUR_SCALAR || scene_find_scalar(input, options->scalar) >= 0) return true;
    session_fail(session, "%s: no scalar attribute is named '%s' (see pbr info)", input->path, options->scalar);
    return false;
}

/* Copies in rows from top to bottom and columns from left to right, seen along -z, a tenth of their box apart, with the middle of
 * all where the model's is. The sphere is widened to hold them. */
bool scene_arrange(struct scene *scene, struct session *session) {
    const struct scene_options *options = scene->options;
    const uint32_t rows = options->grid[0], columns = options->grid[1];
    double low[3] = {0}, high[3] = {0};
    scene->transform_count = rows * columns;
    if (!scene->transforms) scene->transforms = calloc(scene->transform_count, sizeof *scene->transforms);
    if (!scene->transforms) {
        session_fail(session, "no memory for %u copies", (unsigned)scene->transform_count);
        return false;
    }
    scene->sphere = camera_sphere(scene->infos, scene->input_count, options->z_up);
    const double fallback = scene->sphere.radius > 0 ? scene->sphere.radius : 1; /* for what has no width or height */
    camera_box(scene->infos, scene->input_count, low, high);
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
    scene->largest_radius = 0;
    for (uint32_t i = 0; i < scene->input_count; i++) {
        scene->items[i].transforms = scene->transforms[0];
        scene->items[i].transform_count = scene->transform_count;
        scene->largest_radius = fmax(scene->largest_radius, (double)scene->infos[i].radius_maximum);
    }
    return true;
}

static bool draws_vertices(const struct scene *scene, const struct input *input) {
    return scene->options->vertices && input->lod_kind == PBR_LOD_POP;
}

bool scene_find_vertices(struct scene *scene, struct session *session) {
    const unsigned errors = atomic_load(&session->errors);
    for (uint32_t i = 0; i < scene->input_count; i++) {
        struct input *input = &scene->inputs[i];
        if (!draws_vertices(scene, input) || input->points) continue;
        if (!session_check(session, pbr_lod_to_points(input->lod, NULL, NULL, &input->points), errors, input->path)) return false;
    }
    return true;
}

void scene_style(struct scene *scene) {
    const struct scene_options *options = scene->options;
    for (uint32_t i = 0; i < scene->input_count; i++) {
        pbr_item *item = &scene->items[i];
        const struct input *input = &scene->inputs[i];
        item->lod = draws_vertices(scene, input) ? NULL : input->lod;
        item->points = item->lod ? NULL : input->points;
        const bool scalar = options->colour_source == PBR_COLOUR_SCALAR;
        const int index = scalar ? scene_find_scalar(input, options->scalar) : 0;
        item->splat = options->splat;
        item->shading = options->shading;
        item->blending = scene_options_blending(options);
        item->low_pass = (float)options->low_pass;
        item->point_cost = (float)scene_point_cost(scene);
        item->colour_source = index < 0 ? PBR_COLOUR_POINTS : options->colour_source;
        item->scalar_index = index < 0 ? 0 : (uint32_t)index;
        item->flags = options->cull ? PBR_ITEM_CULL_BACK_FACES : 0;
        item->radius_scale = (float)options->radius_scale;
        item->size_minimum = (float)options->size_minimum;
        item->size_maximum = (float)options->size_maximum;
    }
}

const pbr_item *scene_mesh_item(const struct scene *scene) {
    for (uint32_t i = 0; i < scene->input_count; i++)
        if (scene->inputs[i].lod_kind == PBR_LOD_POP && !draws_vertices(scene, &scene->inputs[i])) return &scene->items[i];
    return NULL;
}

bool scene_measure_point_cost(struct scene *scene, struct session *session, pbr_renderer *renderer, const pbr_frame *frame) {
    const unsigned errors = atomic_load(&session->errors);
    const pbr_item *item = scene_mesh_item(scene);
    float cost = 1;
    scene_style(scene);
    const pbr_result result = item ? pbr_renderer_measure_point_cost(renderer, frame, item, &cost) : PBR_OK;
    scene->measured_cost = (double)cost;
    return session_check(session, result, errors, "--point-cost auto");
}

double scene_point_cost(const struct scene *scene) {
    const double asked = scene->options->point_cost;
    const double cost = asked == POINT_COST_AUTO ? scene->measured_cost : asked;
    return cost > 0 ? cost : 1;
}

void scene_to_world(const struct scene_options *options, const double point[3], double world[3]) {
    const double x = point[0], y = point[1], z = point[2];
    world[0] = x;
    world[1] = options->z_up ? z : y;
    world[2] = options->z_up ? -y : z;
}

void scene_from_world(const struct scene_options *options, const double world[3], double point[3]) {
    const double x = world[0], y = world[1], z = world[2];
    point[0] = x;
    point[1] = options->z_up ? -z : y;
    point[2] = options->z_up ? y : z;
}

void scene_centre(const struct scene *scene, double centre[3]) {
    if (scene->options->has_centre) scene_to_world(scene->options, scene->options->centre, centre);
    else memcpy(centre, scene->sphere.centre, sizeof scene->sphere.centre);
}

struct camera scene_camera(const struct scene *scene, double turn, const uint32_t size[2]) {
    const struct scene_options *options = scene->options;
    double centre[3], margin = scene->largest_radius * (options->radius_scale > 0 ? options->radius_scale : 1);
    struct sphere sphere = scene->sphere;
    scene_centre(scene, centre);
    if (!(sphere.radius > 0)) sphere.radius = margin > 0 ? margin : 1;
    /* Around another centre the same sphere reaches out of itself by what the centres are apart. */
    for (int k = 0; k < 3; k++) sphere.centre[k] -= centre[k];
    margin += hypot(hypot(sphere.centre[0], sphere.centre[1]), sphere.centre[2]);
    memcpy(sphere.centre, centre, sizeof centre);
    return camera_look(sphere, options->view[0] + turn, options->view[1], options->view[2], options->parallel, margin, size);
}

pbr_frame scene_frame(const struct scene_options *options, const struct camera *camera, pbr_light *light) {
    pbr_frame frame = PBR_FRAME_INIT;
    const float threshold = (float)scene_options_threshold(options);
    const double yaw = camera_radians(options->light[0]), pitch = camera_radians(options->light[1]);
    memcpy(frame.view, camera->view, sizeof frame.view);
    memcpy(frame.projection, camera->projection, sizeof frame.projection);
    frame.threshold = threshold > 0 ? threshold : PBR_THRESHOLD_LEAVES;
    if (options->occlusion) frame.flags |= PBR_FRAME_OCCLUSION;
    frame.time_budget = 1e-3 * options->time_budget;
    if (options->light[0] == 0 && options->light[1] == 0) return frame;
    *light = (pbr_light)PBR_LIGHT_INIT;
    light->kind = PBR_LIGHT_DIRECTIONAL;
    light->space = PBR_SPACE_EYE;
    light->vector[0] = sin(yaw) * cos(pitch);
    light->vector[1] = sin(pitch);
    light->vector[2] = cos(yaw) * cos(pitch);
    for (int k = 0; k < 3; k++) light->colour[k] = frame.ambient[k] = 1; /* as libpbr's own */
    frame.lights = light;
    frame.light_count = 1;
    return frame;
}

uint32_t scene_hierarchy(const struct scene *scene) {
    for (uint32_t i = 0; i < scene->input_count; i++)
        if (scene->items[i].lod) return scene->inputs[i].lod_kind;
    return LOD_NONE;
}

uint64_t scene_point_count(const struct scene *scene) {
    uint64_t count = 0;
    for (uint32_t i = 0; i < scene->input_count; i++) count += scene->infos[i].count * scene->transform_count;
    return count;
}

uint64_t scene_triangle_count(const struct scene *scene) {
    uint64_t count = 0;
    for (uint32_t i = 0; i < scene->input_count; i++) count += scene->inputs[i].mesh.triangle_count * scene->transform_count;
    return count;
}

void scene_release(struct scene *scene) {
    for (uint32_t i = 0; i < scene->input_count; i++) input_release(&scene->inputs[i]);
    free(scene->transforms);
    scene->transforms = NULL;
    scene->input_count = 0;
}
