/* pbr_reference_render: every pixel gathers the splats that cover its centre. SPDX-License-Identifier: MIT */
#include "fill.h"
#include "shade.h"
#include "tiles.h"

/* Splats that a thread holds ready: 150 MB. */
enum { MOST_AT_ONCE = 1 << 18 };

struct drawing {
    struct scene scene;
    struct fill fill;
    pbr_image *image;
};

/* ---- splats ---- */

/* `colours`: with all that colour depends on. */
static pbr_result read_sample(const struct walk *at, bool colours, struct sample *out) {
    const struct scene_item *item = at->item;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    *out = (struct sample){.radius = 0};
    copy.positions = out->position;
    if (item->info.has_normals) copy.normals = out->normal;
    if (item->info.has_radii) copy.radii = &out->radius;
    if (colours && item->info.has_colours) copy.colours = out->colour;
    if (colours && item->desc.colour_source == PBR_COLOUR_SCALAR) copy.scalar = &out->scalar;
    copy.scalar_index = item->desc.scalar_index;
    if (item->fields) out->field = &item->fields[at->index];
    return pbr_points_copy(item->desc.points, at->index, 1, &copy);
}

/* Of the items whose normals vary over each splat. */
static pbr_result fit_fields(struct scene *scene) {
    for (size_t i = 0; i < scene->item_count; i++) {
        struct scene_item *item = &scene->items[i];
        if (item->elements == 0 || item->desc.shading != PBR_SHADE_PHONG_FIELD) continue;
        if (item->desc.splat < PBR_SPLAT_GAUSSIAN) continue;
        item->fields = pbr_allocate(scene->instance, (size_t)item->info.count, sizeof *item->fields);
        if (!item->fields) return PBR_ERROR_OUT_OF_MEMORY;
        const pbr_result result =
            pbr_points_fit_fields(item->desc.points, scene->desc.progress, scene->desc.progress_user, item->fields->a);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

static pbr_result find_boxes(void *user, uint64_t first, size_t count, int32_t (*boxes)[4]) {
    const struct drawing *drawing = user;
    struct walk walk = {.item = NULL};
    for (size_t i = 0; i < count; i++) {
        struct sample sample;
        struct surfel surfel = {.number = first + i};
        scene_walk(&drawing->scene, first + i, &walk);
        const pbr_result result = read_sample(&walk, false, &sample);
        if (result != PBR_OK) return result;
        memset(boxes[i], 0, sizeof boxes[i]);
        if (surfel_place(&drawing->scene, &walk, &sample, &surfel)) memcpy(boxes[i], surfel.box, sizeof boxes[i]);
    }
    return PBR_OK;
}

static pbr_result make_surfels(const struct scene *scene, const uint64_t *elements, size_t count, struct surfel *surfels) {
    struct walk walk = {.item = NULL};
    for (size_t i = 0; i < count; i++) {
        struct sample sample;
        scene_walk(scene, elements[i], &walk);
        const pbr_result result = read_sample(&walk, true, &sample);
        if (result != PBR_OK) return result;
        surfels[i].number = elements[i];
        surfel_place(scene, &walk, &sample, &surfels[i]);
        surfel_shade(scene, &sample, &surfels[i]);
    }
    return PBR_OK;
}

/* ---- pixels ---- */

/* One tile's memory, each of the same number of elements. */
struct bench {
    struct surfel *surfels;
    const struct surfel **in_row;
    struct fragment *fragments;
};

static size_t image_index(const pbr_image *image, int32_t x, int32_t y) {
    return (size_t)(image->height - 1 - (uint32_t)y) * image->width + (uint32_t)x;
}

static void write_pixel(pbr_image *image, size_t at, const struct pixel *pixel) {
    for (int k = 0; k < 4; k++) image->rgba[4 * at + (size_t)k] = (float)pixel->rgba[k];
    image->depth[at] = (float)pixel->distance;
}

static void draw_row(struct drawing *drawing, const int32_t box[4], int32_t y, size_t count, const struct bench *bench) {
    size_t in_row = 0;
    for (size_t i = 0; i < count; i++)
        if (bench->surfels[i].box[1] <= y && y < bench->surfels[i].box[3]) bench->in_row[in_row++] = &bench->surfels[i];
    for (int32_t x = box[0]; x < box[2]; x++) {
        size_t found = 0;
        for (size_t i = 0; i < in_row; i++) {
            const struct surfel *surfel = bench->in_row[i];
            if (x < surfel->box[0] || x >= surfel->box[2]) continue;
            found += surfel_fragment(&drawing->scene.lens, surfel, x + 0.5, y + 0.5, &bench->fragments[found]);
        }
        struct pixel pixel;
        layers_resolve(&drawing->scene, x + 0.5, y + 0.5, bench->fragments, found, &pixel);
        if (found == 0) continue;
        const size_t at = image_index(drawing->image, x, y);
        write_pixel(drawing->image, at, &pixel);
        fill_add(&drawing->fill, at, x, y, &pixel, bench->in_row, in_row);
    }
}

/* Draws a part of a tile with all elements that may touch it. */
static pbr_result draw_at_once(struct drawing *drawing, const int32_t box[4], const uint64_t *elements, size_t count) {
    pbr_instance *instance = drawing->scene.instance;
    struct bench bench = {pbr_allocate(instance, count, sizeof *bench.surfels), pbr_allocate(instance, count, sizeof *bench.in_row),
                          pbr_allocate(instance, count, sizeof *bench.fragments)};
    pbr_result result = bench.surfels && bench.in_row && bench.fragments ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = make_surfels(&drawing->scene, elements, count, bench.surfels);
    for (int32_t y = box[1]; result == PBR_OK && y < box[3]; y++) draw_row(drawing, box, y, count, &bench);
    pbr_free(instance, bench.surfels);
    pbr_free(instance, (void *)bench.in_row);
    pbr_free(instance, bench.fragments);
    return result;
}

/* Lists those of the elements that may touch the box. */
static pbr_result choose(const struct scene *scene, const int32_t box[4], const uint64_t *elements, size_t count, uint64_t *chosen,
                         size_t *chosen_count) {
    struct walk walk = {.item = NULL};
    *chosen_count = 0;
    for (size_t i = 0; i < count; i++) {
        struct sample sample;
        struct surfel surfel;
        scene_walk(scene, elements[i], &walk);
        const pbr_result result = read_sample(&walk, false, &sample);
        if (result != PBR_OK) return result;
        if (!surfel_place(scene, &walk, &sample, &surfel)) continue;
        const int32_t *own = surfel.box;
        if (own[0] < box[2] && own[2] > box[0] && own[1] < box[3] && own[3] > box[1]) chosen[(*chosen_count)++] = elements[i];
    }
    return PBR_OK;
}

/* Too many elements for the memory that a thread may take are drawn half by half of the tile. */
static pbr_result draw_tile(void *user, const int32_t box[4], const uint64_t *elements, size_t count) {
    struct drawing *drawing = user;
    const int32_t width = box[2] - box[0], height = box[3] - box[1];
    if (count <= MOST_AT_ONCE || width * height == 1) return draw_at_once(drawing, box, elements, count);
    uint64_t *chosen = pbr_allocate(drawing->scene.instance, count, sizeof *chosen);
    pbr_result result = chosen ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (int half = 0; half < 2 && result == PBR_OK; half++) {
        int32_t part[4] = {box[0], box[1], box[2], box[3]};
        const int side = width >= height ? 0 : 1;
        size_t chosen_count = 0;
        part[half ? side : side + 2] = box[side] + (box[side + 2] - box[side]) / 2;
        result = choose(&drawing->scene, part, elements, count, chosen, &chosen_count);
        if (result == PBR_OK) result = draw_tile(user, part, chosen, chosen_count);
    }
    pbr_free(drawing->scene.instance, chosen);
    return result;
}

pbr_result pbr_reference_render(pbr_instance *instance, const pbr_frame *frame, const pbr_item *items, size_t item_count,
                                const pbr_reference_desc *desc, pbr_image *out) {
    struct drawing drawing = {.image = out};
    struct scene *scene = &drawing.scene;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_result result = scene_open(instance, "pbr_reference_render", frame, items, NULL, item_count, desc, scene);
    if (result != PBR_OK) return result;
    const struct tiling tiling = {
        instance,  scene->lens.width, scene->lens.height, scene->count, scene->desc.progress, scene->desc.progress_user, find_boxes,
        draw_tile, &drawing};
    result = pbr_image_create(instance, (uint32_t)scene->lens.width, (uint32_t)scene->lens.height, 1, out);
    if (result == PBR_OK) {
        result = shade_find_ranges(scene);
        if (result == PBR_OK) result = fit_fields(scene);
        if (result == PBR_OK) result = fill_open(scene, &drawing.fill);
        if (result == PBR_OK) result = tiles_draw(&tiling);
        if (result == PBR_OK) result = fill_resolve(scene, &drawing.fill, out);
        fill_close(scene, &drawing.fill);
        if (result != PBR_OK) pbr_image_destroy(instance, out);
    }
    for (size_t i = 0; i < scene->item_count; i++) pbr_free(instance, scene->items[i].fields);
    scene_close(scene);
    return result;
}
