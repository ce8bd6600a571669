/* Context, models and pictures. SPDX-License-Identifier: MIT */
#include "studio.h"

#include <pbr/io.h>
#include <pbr/support.h>
#include <string.h>

#include "input.h"

const struct method methods[METHODS] = {
    [METHOD_SQUARE] = {.name = "square", .splat = PBR_SPLAT_SQUARE},
    [METHOD_CIRCLE] = {.name = "circle", .splat = PBR_SPLAT_CIRCLE},
    [METHOD_ELLIPSE] = {.name = "ellipse", .splat = PBR_SPLAT_ELLIPSE},
    [METHOD_GAUSSIAN] = {.name = "gaussian", .splat = PBR_SPLAT_GAUSSIAN},
    [METHOD_EWA] = {.name = "ewa", .splat = PBR_SPLAT_EWA},
    [METHOD_EWA_MAX] = {.name = "ewa-max", .splat = PBR_SPLAT_EWA_MAX},
    [METHOD_CIRCLE_FILL] = {.name = "circle, filled", .splat = PBR_SPLAT_CIRCLE, .blending = PBR_BLEND_FILL},
    [METHOD_ELLIPSE_FILL] = {.name = "ellipse, filled", .splat = PBR_SPLAT_ELLIPSE, .blending = PBR_BLEND_FILL},
    [METHOD_GAUSSIAN_DEFERRED] = {.name = "gaussian, deferred", .splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_DEFERRED},
    [METHOD_EWA_DEFERRED] = {.name = "ewa, deferred", .splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_DEFERRED},
    [METHOD_GAUSSIAN_FIELD] = {.name = "gaussian, phong-field", .splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_PHONG_FIELD},
    [METHOD_EWA_FIELD] = {.name = "ewa, phong-field", .splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_PHONG_FIELD},
    [METHOD_EWA_HALF] = {.name = "ewa 0.5", .splat = PBR_SPLAT_EWA, .low_pass = 0.5f},
    [METHOD_EWA_THIRD] = {.name = "ewa 0.3", .splat = PBR_SPLAT_EWA, .low_pass = 0.3f},
    [METHOD_EWA_BOX] = {.name = "ewa 0.125", .splat = PBR_SPLAT_EWA, .low_pass = 0.125f},
};

/* ---- Models ---- */

static bool finish_model(struct studio *studio, struct model *model) {
    const unsigned errors = atomic_load(&studio->session.errors);
    pbr_result result = PBR_OK;
    model->info = (pbr_points_info)PBR_POINTS_INFO_INIT;
    if (!model->points) result = pbr_mesh_to_points(model->mesh, NULL, &model->points);
    if (result == PBR_OK) result = pbr_points_get_info(model->points, &model->info);
    if (result == PBR_OK) model->sphere = camera_sphere(&model->info, 1, false);
    return session_check(&studio->session, result, errors, model->name);
}

bool model_read(struct studio *studio, const char *name, const char *path, struct model *model) {
    struct input input;
    bool done = input_load(&studio->session, path, true, session_progress, &studio->session, &input);
    *model = (struct model){.name = name, .is_lit = true};
    if (done && !input.surface) {
        session_fail(&studio->session, "%s: has no triangles", path);
        done = false;
    }
    if (done) {
        model->mesh = pbr_mesh_retain(input.surface);
        model->points = pbr_points_retain(input.points);
        done = finish_model(studio, model);
    }
    input_release(&input);
    return done;
}

static pbr_attribute attribute(const void *data, uint32_t format, uint32_t components) {
    return (pbr_attribute){data, sizeof(struct surface_point), format, components};
}

/* Takes the arrays over. */
static bool create_model(struct studio *studio, struct surface_point *vertices, uint64_t vertex_count, uint32_t *indices,
                         uint64_t triangle_count, struct model *model) {
    pbr_instance *instance = studio->session.instance;
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    const unsigned errors = atomic_load(&studio->session.errors);
    desc.vertex_count = vertex_count;
    desc.positions = attribute(vertices->position, PBR_FORMAT_FLOAT32, 3);
    desc.normals = attribute(vertices->normal, PBR_FORMAT_FLOAT32, 3);
    desc.colours = attribute(vertices->colour, PBR_FORMAT_UINT8, 4);
    desc.indices = indices;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = triangle_count;
    const pbr_result result = pbr_mesh_create(instance, &desc, &model->mesh);
    pbr_free(instance, vertices);
    pbr_free(instance, indices);
    return session_check(&studio->session, result, errors, model->name) && finish_model(studio, model);
}

static bool allocate_arrays(struct studio *studio, uint64_t vertex_count, uint64_t triangle_count, struct surface_point **vertices,
                            uint32_t **indices) {
    pbr_instance *instance = studio->session.instance;
    *vertices = pbr_allocate(instance, vertex_count, sizeof **vertices);
    *indices = pbr_allocate(instance, triangle_count, 3 * sizeof **indices);
    if (*vertices && *indices) return true;
    pbr_free(instance, *vertices);
    pbr_free(instance, *indices);
    session_fail(&studio->session, "not enough memory");
    return false;
}

bool model_synthesise(struct studio *studio, enum surface_kind kind, uint64_t triangles, struct model *model) {
    const struct surface surface = {.kind = kind};
    struct surface_grid grid;
    struct surface_point *vertices;
    uint32_t *indices;
    *model = (struct model){.name = surface_names[kind], .is_lit = true};
    if (!grid_choose(kind, triangles, &grid)) {
        session_fail(&studio->session, "%s: no grid has so many triangles", model->name);
        return false;
    }
    const uint64_t vertex_count = grid_vertex_count(&grid);
    if (!allocate_arrays(studio, vertex_count, triangles, &vertices, &indices)) return false;
    for (uint64_t i = 0; i < vertex_count; i++) vertices[i] = grid_vertex(&grid, &surface, i);
    for (uint64_t i = 0; i < triangles; i++) grid_triangle(&grid, i, indices + 3 * i);
    return create_model(studio, vertices, vertex_count, indices, triangles, model);
}

/* Vertices on either side of the middle in a row of the floor, a quarter of a square apart. */
static uint32_t floor_reach(uint32_t row) {
    return (uint32_t)(0.66 * row) + 16;
}

static struct surface_point floor_vertex(uint32_t row, uint32_t column) {
    const struct surface surface = {.kind = SURFACE_CHECKERBOARD};
    const double squares = 8; /* of the surface, along each side */
    const double x = (column - (double)floor_reach(row) + 0.5) / 4, z = -(row + 0.5) / 4;
    struct surface_point point = surface_at(&surface, (x - squares * floor(x / squares)) / squares, fmod(-z, squares) / squares);
    point.position[0] = (float)x;
    point.position[2] = (float)z;
    return point;
}

/* Two triangles for each of the cells that begin in the row, which the next one reaches beyond. */
static uint32_t *floor_triangles(uint32_t row, uint32_t first, uint32_t *index) {
    const uint32_t columns = 2 * floor_reach(row), out = floor_reach(row + 1) - floor_reach(row);
    for (uint32_t column = 0; column + 1 < columns; column++) {
        const uint32_t at = first + column, beyond = first + columns + out + column;
        const uint32_t corners[6] = {at, at + 1, beyond + 1, at, beyond + 1, beyond};
        memcpy(index, corners, sizeof corners);
        index += 6;
    }
    return index;
}

bool model_make_floor(struct studio *studio, double length, struct model *model) {
    const uint32_t rows = (uint32_t)(4 * length);
    uint64_t vertex_count = 0, triangle_count = 0;
    struct surface_point *vertices;
    uint32_t *indices, first = 0;
    *model = (struct model){.name = "checkerboard"};
    for (uint32_t row = 0; row < rows; row++) {
        vertex_count += 2 * floor_reach(row);
        if (row + 1 < rows) triangle_count += 2 * (2 * floor_reach(row) - 1);
    }
    if (!allocate_arrays(studio, vertex_count, triangle_count, &vertices, &indices)) return false;
    uint32_t *index = indices;
    for (uint32_t row = 0; row < rows; row++) {
        for (uint32_t column = 0; column < 2 * floor_reach(row); column++) vertices[first + column] = floor_vertex(row, column);
        if (row + 1 < rows) index = floor_triangles(row, first, index);
        first += 2 * floor_reach(row);
    }
    return create_model(studio, vertices, vertex_count, indices, triangle_count, model);
}

void model_release(struct model *model) {
    pbr_points_release(&model->points);
    pbr_mesh_release(&model->mesh);
}

/* ---- Views ---- */

struct view view_around(const char *name, const struct model *model, double yaw, double pitch, double zoom,
                        const uint32_t size[2]) {
    const double margin = (double)model->info.radius_maximum;
    return (struct view){name, camera_look(model->sphere, yaw, pitch, zoom, false, margin, size), {size[0], size[1]}, {0, 0}};
}

struct view view_from(const char *name, const double eye[3], double yaw, double pitch, double field, double near, double far,
                      const uint32_t size[2]) {
    struct view view = {name, {.is_parallel = false}, {size[0], size[1]}, {0, 0}};
    /* The axes and the eye's place are those of a camera that looks at a sphere before it. */
    const double cosine = cos(camera_radians(pitch)), height = 1 / tan(camera_radians(field / 2));
    const double back[3] = {sin(camera_radians(yaw)) * cosine, sin(camera_radians(pitch)), cos(camera_radians(yaw)) * cosine};
    struct sphere sphere = {{0, 0, 0}, 1};
    for (int k = 0; k < 3; k++) sphere.centre[k] = eye[k] - back[k] / sin(camera_radians(25));
    view.camera = camera_look(sphere, yaw, pitch, 1, false, 0, size);
    view.camera.projection[0] = height * size[1] / size[0];
    view.camera.projection[5] = height;
    view.camera.projection[10] = -(far + near) / (far - near);
    view.camera.projection[14] = -2 * far * near / (far - near);
    view.camera.pixel_scale = size[1] * height / 2;
    return view;
}

/* ---- Pictures ---- */

static pbr_frame make_frame(const struct view *view) {
    pbr_frame frame = PBR_FRAME_INIT;
    memcpy(frame.view, view->camera.view, sizeof frame.view);
    memcpy(frame.projection, view->camera.projection, sizeof frame.projection);
    for (int k = 0; k < 2; k++) {
        frame.viewport[2 + k] = (int32_t)view->size[k];
        frame.jitter[k] = view->jitter[k];
    }
    return frame;
}

static pbr_item make_item(const struct model *model, const struct method *method) {
    pbr_item item = PBR_ITEM_INIT;
    item.points = model->points;
    item.splat = method->splat;
    item.blending = method->blending;
    item.shading = model->is_lit ? method->shading : PBR_SHADE_NONE;
    item.low_pass = method->low_pass;
    return item;
}

static bool make_target(struct studio *studio, const uint32_t size[2]) {
    if (studio->target.framebuffer && !memcmp(studio->target.size, size, sizeof studio->target.size)) return true;
    if (studio->target.framebuffer) target_destroy(&studio->target);
    const char *refusal = target_create(&studio->target, size, 1, true, false);
    if (refusal) session_fail(&studio->session, "%s", refusal);
    return !refusal;
}

bool studio_draw(struct studio *studio, const struct model *model, const struct method *method, const struct view *view,
                 pbr_image *image) {
    static const float nothing[4] = {0, 0, 0, 0};
    const unsigned errors = atomic_load(&studio->session.errors);
    const pbr_frame frame = make_frame(view);
    const pbr_item item = make_item(model, method);
    if (!make_target(studio, view->size)) return false;
    target_clear(&studio->target, nothing);
    pbr_result result = pbr_render(studio->view, &frame, &item, 1, NULL);
    if (result == PBR_OK) result = target_read(&studio->target, studio->session.instance, NULL, NULL, image);
    return session_check(&studio->session, result, errors, method->name);
}

bool studio_draw_reference(struct studio *studio, const struct model *model, const struct method *method, const struct view *view,
                           pbr_image *image) {
    const unsigned errors = atomic_load(&studio->session.errors);
    const pbr_frame frame = make_frame(view);
    const pbr_item item = make_item(model, method);
    const pbr_result result = pbr_reference_render(studio->session.instance, &frame, &item, 1, NULL, image);
    return session_check(&studio->session, result, errors, method->name);
}

bool studio_draw_truth(struct studio *studio, const struct model *model, const struct view *view, uint32_t samples,
                       uint32_t colour_source, pbr_image *image) {
    const unsigned errors = atomic_load(&studio->session.errors);
    const pbr_frame frame = make_frame(view);
    const pbr_mesh *mesh = model->mesh;
    pbr_item item = make_item(model, &methods[METHOD_CIRCLE]);
    item.colour_source = colour_source;
    if (colour_source == PBR_COLOUR_NORMAL) item.shading = PBR_SHADE_NONE;
    return session_check(&studio->session,
                         pbr_ground_truth(studio->session.instance, &frame, &item, &mesh, 1, samples, NULL, image), errors,
                         "ground truth");
}

bool studio_open(struct studio *studio) {
    if (!session_open(&studio->session)) return false;
    const char *refusal = headless_create(&studio->headless, HEADLESS_GL_45, false);
    if (refusal) session_fail(&studio->session, "%s", refusal);
    if (refusal) return false;
    const unsigned errors = atomic_load(&studio->session.errors);
    pbr_result result = pbr_renderer_create(studio->session.instance, NULL, &studio->renderer);
    if (result == PBR_OK) result = pbr_view_create(studio->renderer, NULL, &studio->view);
    return session_check(&studio->session, result, errors, "cannot draw");
}

void studio_close(struct studio *studio) {
    pbr_view_destroy(&studio->view);
    pbr_renderer_destroy(&studio->renderer);
    if (studio->target.framebuffer) target_destroy(&studio->target);
    if (studio->headless.context) headless_destroy(&studio->headless);
    session_close(&studio->session);
}
