/* pbr_ground_truth: many samples a pixel, each of the nearest triangle. SPDX-License-Identifier: MIT */
#include "facet.h"
#include "shade.h"
#include "tiles.h"

struct drawing {
    struct scene scene;
    struct model *models; /* one an item */
    int32_t samples;      /* along a pixel's side */
    pbr_image *image;
};

/* ---- meshes ---- */

static void release_models(struct drawing *drawing) {
    pbr_instance *instance = drawing->scene.instance;
    for (size_t i = 0; drawing->models && i < drawing->scene.item_count; i++) {
        pbr_free(instance, drawing->models[i].positions);
        pbr_free(instance, drawing->models[i].normals);
        pbr_free(instance, drawing->models[i].colours);
        pbr_free(instance, drawing->models[i].triangles);
    }
    pbr_free(instance, drawing->models);
}

static pbr_result copy_model(pbr_instance *instance, const pbr_mesh *mesh, struct model *model) {
    pbr_mesh_info info = PBR_MESH_INFO_INIT;
    pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
    const pbr_result result = pbr_mesh_get_info(mesh, &info);
    if (result != PBR_OK) return result;
    const size_t vertices = (size_t)info.vertex_count, triangles = (size_t)info.triangle_count;
    model->positions = pbr_allocate(instance, vertices, sizeof *model->positions);
    model->normals = pbr_allocate(instance, vertices, sizeof *model->normals);
    model->colours = info.has_colours ? pbr_allocate(instance, vertices, sizeof *model->colours) : NULL;
    model->triangles = pbr_allocate(instance, triangles, sizeof *model->triangles);
    if (!model->positions || !model->normals || !model->triangles || (info.has_colours && !model->colours))
        return PBR_ERROR_OUT_OF_MEMORY;
    copy.vertex_count = info.vertex_count;
    copy.triangle_count = info.triangle_count;
    copy.positions = &model->positions[0][0];
    copy.normals = &model->normals[0][0];
    copy.colours = model->colours ? &model->colours[0][0] : NULL;
    copy.triangles = &model->triangles[0][0];
    return pbr_mesh_copy(mesh, &copy);
}

static pbr_result take_models(struct drawing *drawing) {
    const struct scene *scene = &drawing->scene;
    pbr_result result = PBR_OK;
    drawing->models = pbr_allocate(scene->instance, scene->item_count, sizeof *drawing->models);
    if (!drawing->models) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = 0; result == PBR_OK && i < scene->item_count; i++) {
        if (scene->items[i].desc.colour_source == PBR_COLOUR_SCALAR)
            return pbr_log(scene->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: meshes are not coloured by scalars",
                           scene->caller);
        if (scene->items[i].elements > 0) result = copy_model(scene->instance, scene->items[i].mesh, &drawing->models[i]);
    }
    return result;
}

static const struct model *model_of(const struct drawing *drawing, const struct scene_item *item) {
    return &drawing->models[item - drawing->scene.items];
}

/* ---- triangles ---- */

static bool place_next(const struct drawing *drawing, struct walk *walk, uint64_t number, struct facet *out) {
    scene_walk(&drawing->scene, number, walk);
    return facet_place(&drawing->scene, walk, model_of(drawing, walk->item), out);
}

static pbr_result find_boxes(void *user, uint64_t first, size_t count, int32_t (*boxes)[4]) {
    const struct drawing *drawing = user;
    struct walk walk = {.item = NULL};
    for (size_t i = 0; i < count; i++) {
        struct facet facet;
        memset(boxes[i], 0, sizeof boxes[i]);
        if (place_next(drawing, &walk, first + i, &facet)) memcpy(boxes[i], facet.box, sizeof boxes[i]);
    }
    return PBR_OK;
}

/* ---- samples ---- */

/* What a sample sees. */
struct seen {
    double distance; /* infinite: nothing */
    uint64_t number; /* of the triangle */
};

/* One tile at work. */
struct patch {
    const int32_t *box;
    int32_t columns, rows; /* of samples */
    struct seen *seen;
};

static void interpolate_normal(const struct drawing *drawing, const struct facet *facet, const struct meeting *meeting,
                               double out[3]) {
    const struct model *model = model_of(drawing, facet->item);
    for (int k = 0; k < 3; k++) {
        out[k] = 0;
        for (int i = 0; i < 3; i++) out[k] += meeting->coordinates[i] * (double)model->normals[facet->corners[i]][k];
    }
    vec_normalise(out);
}

static void find_point(const struct facet *facet, const struct meeting *meeting, double out[3]) {
    for (int k = 0; k < 3; k++) {
        out[k] = 0;
        for (int i = 0; i < 3; i++) out[k] += meeting->coordinates[i] * facet->points[i][k];
    }
}

static bool is_culled(const struct drawing *drawing, const struct placement *placement, const struct facet *facet,
                      const struct meeting *meeting) {
    double object[3], normal[3], point[3], to_eye[3];
    if (!(facet->item->desc.flags & PBR_ITEM_CULL_BACK_FACES)) return false;
    interpolate_normal(drawing, facet, meeting, object);
    mat_direction(placement->normal, object, normal);
    find_point(facet, meeting, point);
    lens_to_eye(&drawing->scene.lens, point, to_eye);
    return vec_dot(normal, to_eye) < 0;
}

/* The samples, along side k, that may lie between the triangle's bounds. */
static void sample_range(const struct drawing *drawing, const struct patch *patch, const struct facet *facet, int k, int32_t *first,
                         int32_t *end) {
    const int32_t n = drawing->samples, count = k == 0 ? patch->columns : patch->rows;
    const double low = floor((facet->low[k] - patch->box[k]) * n - 1), high = ceil((facet->high[k] - patch->box[k]) * n + 1);
    *first = low > 0 ? (int32_t)fmin(low, count) : 0;
    *end = high < count ? (int32_t)fmax(high, 0) : count;
}

/* A sample's place in the window. */
static double sample_at(const struct drawing *drawing, int32_t first_pixel, int32_t sample) {
    return first_pixel + (sample + 0.5) / drawing->samples;
}

static void draw_facet(const struct drawing *drawing, const struct placement *placement, const struct facet *facet, uint64_t number,
                       struct patch *patch) {
    int32_t left, right, bottom, top;
    sample_range(drawing, patch, facet, 0, &left, &right);
    sample_range(drawing, patch, facet, 1, &bottom, &top);
    for (int32_t row = bottom; row < top; row++)
        for (int32_t column = left; column < right; column++) {
            struct seen *seen = &patch->seen[(size_t)row * (size_t)patch->columns + (size_t)column];
            const double x = sample_at(drawing, patch->box[0], column), y = sample_at(drawing, patch->box[1], row);
            struct meeting meeting;
            if (!facet_meet(facet, x, y, &meeting) || !(meeting.distance < seen->distance)) continue;
            if (is_culled(drawing, placement, facet, &meeting)) continue;
            *seen = (struct seen){meeting.distance, number};
        }
}

/* ---- colour ---- */

static void find_albedo(const struct drawing *drawing, const struct facet *facet, const struct meeting *meeting,
                        const double normal[3], double out[3]) {
    const struct model *model = model_of(drawing, facet->item);
    for (int k = 0; k < 3; k++) out[k] = 0;
    for (int i = 0; i < 3; i++) {
        const struct colouring from = {model->colours ? model->colours[facet->corners[i]] : NULL, normal, NAN, meeting->distance};
        double albedo[3];
        shade_albedo(facet->item, &from, albedo);
        for (int k = 0; k < 3; k++) out[k] += meeting->coordinates[i] * albedo[k];
    }
}

static void shade_sample(const struct drawing *drawing, const struct placement *placement, const struct facet *facet, double x,
                         double y, double out[3]) {
    struct meeting meeting;
    double object[3], normal[3], point[3], albedo[3];
    facet_meet(facet, x, y, &meeting);
    interpolate_normal(drawing, facet, &meeting, object);
    find_albedo(drawing, facet, &meeting, object, albedo);
    if (facet->item->desc.shading == PBR_SHADE_NONE) {
        memcpy(out, albedo, sizeof albedo);
        return;
    }
    mat_direction(placement->normal, object, normal);
    vec_normalise(normal);
    find_point(facet, &meeting, point);
    shade_phong(&drawing->scene, &facet->item->desc.material, albedo, point, normal, out);
}

/* Averages the samples of the pixel, which is (x, y) of the tile. The triangle of the last sample is kept, since the next one's is
 * likely to be the same. */
static void draw_pixel(const struct drawing *drawing, const struct patch *patch, int32_t x, int32_t y, struct walk *walk) {
    const int32_t n = drawing->samples;
    double rgba[4] = {0, 0, 0, 0}, nearest = INFINITY;
    struct facet facet;
    uint64_t kept = UINT64_MAX;
    for (int32_t i = 0; i < n * n; i++) {
        const int32_t row = y * n + i / n, column = x * n + i % n;
        const struct seen *seen = &patch->seen[(size_t)row * (size_t)patch->columns + (size_t)column];
        double colour[3];
        if (isinf(seen->distance)) continue;
        if (seen->number != kept) place_next(drawing, walk, kept = seen->number, &facet);
        shade_sample(drawing, &walk->placement, &facet, sample_at(drawing, patch->box[0], column),
                     sample_at(drawing, patch->box[1], row), colour);
        for (int k = 0; k < 3; k++) rgba[k] += colour[k];
        rgba[3]++;
        nearest = fmin(nearest, seen->distance);
    }
    pbr_image *image = drawing->image;
    const size_t at = (size_t)(image->height - 1 - (uint32_t)(patch->box[1] + y)) * image->width + (uint32_t)(patch->box[0] + x);
    for (size_t k = 0; k < 4; k++) image->rgba[4 * at + k] = (float)(rgba[k] / (n * n));
    image->depth[at] = (float)nearest;
}

/* Within the scissor box. */
static void draw_pixels(const struct drawing *drawing, const struct patch *patch) {
    const int32_t *scissor = drawing->scene.lens.box, *box = patch->box;
    struct walk walk = {.item = NULL};
    for (int32_t y = box[1]; y < box[3]; y++)
        for (int32_t x = box[0]; x < box[2]; x++)
            if (x >= scissor[0] && x < scissor[2] && y >= scissor[1] && y < scissor[3])
                draw_pixel(drawing, patch, x - box[0], y - box[1], &walk);
}

static pbr_result draw_tile(void *user, const int32_t box[4], const uint64_t *elements, size_t count) {
    struct drawing *drawing = user;
    pbr_instance *instance = drawing->scene.instance;
    struct patch patch = {box, (box[2] - box[0]) * drawing->samples, (box[3] - box[1]) * drawing->samples, NULL};
    const size_t samples = (size_t)patch.columns * (size_t)patch.rows;
    struct walk walk = {.item = NULL};
    patch.seen = pbr_allocate(instance, samples, sizeof *patch.seen);
    if (!patch.seen) return PBR_ERROR_OUT_OF_MEMORY;
    for (size_t i = 0; i < samples; i++) patch.seen[i].distance = INFINITY;
    for (size_t i = 0; i < count; i++) {
        struct facet facet;
        if (place_next(drawing, &walk, elements[i], &facet)) draw_facet(drawing, &walk.placement, &facet, elements[i], &patch);
    }
    draw_pixels(drawing, &patch);
    pbr_free(instance, patch.seen);
    return PBR_OK;
}

/* ---- the whole ---- */

static pbr_result draw(struct drawing *drawing) {
    const struct scene *scene = &drawing->scene;
    const struct tiling tiling = {
        scene->instance,           scene->lens.width, scene->lens.height, scene->count, scene->desc.progress,
        scene->desc.progress_user, find_boxes,        draw_tile,          drawing};
    pbr_result result =
        pbr_image_create(scene->instance, (uint32_t)scene->lens.width, (uint32_t)scene->lens.height, 1, drawing->image);
    if (result != PBR_OK) return result;
    result = take_models(drawing);
    if (result == PBR_OK) result = shade_find_ranges(&drawing->scene);
    if (result == PBR_OK) result = tiles_draw(&tiling);
    if (result != PBR_OK) pbr_image_destroy(scene->instance, drawing->image);
    return result;
}

pbr_result pbr_ground_truth(pbr_instance *instance, const pbr_frame *frame, const pbr_item *items, const pbr_mesh *const *meshes,
                            size_t count, uint32_t samples, const pbr_reference_desc *desc, pbr_image *out) {
    static const char name[] = "pbr_ground_truth";
    static const pbr_mesh *const none = NULL;
    struct drawing drawing = {.samples = (int32_t)samples, .image = out};
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if ((!meshes && count > 0) || samples < 1 || samples > PBR_MAX_SAMPLES)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: meshes is NULL, or samples are not 1 to %d", name,
                       PBR_MAX_SAMPLES);
    pbr_result result = scene_open(instance, name, frame, items, meshes ? meshes : &none, count, desc, &drawing.scene);
    if (result != PBR_OK) return result;
    result = draw(&drawing);
    release_models(&drawing);
    scene_close(&drawing.scene);
    return result;
}
