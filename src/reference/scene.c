/* The contract of pbr_frame and pbr_item. SPDX-License-Identifier: MIT */
#include "scene.h"

#include "core/kernel.h"
#include "io/sized.h"

/* ---- checks ---- */

static pbr_result invalid(const struct scene *scene, const char *what) {
    return pbr_log(scene->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: %s", scene->caller, what);
}

static pbr_result above(const struct scene *scene, const char *what, uint64_t count, uint64_t most) {
    return pbr_log(scene->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu %s, the limit is %llu", scene->caller,
                   (unsigned long long)count, what, (unsigned long long)most);
}

static bool are_finite(const double *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}
static bool floats_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}
static bool are_zero(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (values[i] != 0) return false;
    return true;
}

/* But for rounding. */
static bool is_affine(const double m[16]) {
    const double tolerance = 1e-6;
    return are_finite(m, 16) && fabs(m[3]) <= tolerance && fabs(m[7]) <= tolerance && fabs(m[11]) <= tolerance &&
           fabs(m[15] - 1) <= tolerance;
}

/* ---- the frame ---- */

static const char *wrong_number(const pbr_frame *frame) {
    const uint32_t flags = PBR_FRAME_REVERSED_Z | PBR_FRAME_CLIP_ZERO_TO_ONE | PBR_FRAME_CLIP_UPPER_LEFT | PBR_FRAME_NO_DEPTH_TEST |
                           PBR_FRAME_NO_DEPTH_WRITE | PBR_FRAME_SCISSOR | PBR_FRAME_WAIT;
    const uint32_t never = 0x200, always = 0x207; /* of OpenGL's comparisons, which are numbered in a row */
    if (frame->flags & ~flags) return "frame: flags has an unknown bit";
    if (frame->target > PBR_TARGET_FRAMEBUFFER) return "frame: unknown target";
    if (frame->encoding > PBR_ENCODING_LINEAR) return "frame: unknown encoding";
    if (frame->depth_function != 0 && (frame->depth_function < never || frame->depth_function > always))
        return "frame: depth_function is none of OpenGL's";
    if (frame->viewport[2] <= 0 || frame->viewport[3] <= 0) return "frame: the viewport must have an area";
    if ((frame->flags & PBR_FRAME_SCISSOR) && (frame->scissor[2] < 0 || frame->scissor[3] < 0))
        return "frame: the scissor box has a negative size";
    if (!are_finite(frame->jitter, 2)) return "frame: jitter is not finite";
    if (!floats_are_finite(frame->depth_range, 2)) return "frame: depth_range is not finite";
    if (!floats_are_finite(frame->ambient, 3)) return "frame: ambient is not finite";
    if (!(frame->threshold >= 0 || frame->threshold == PBR_THRESHOLD_LEAVES) || !floats_are_finite(&frame->threshold, 1))
        return "frame: threshold is neither PBR_THRESHOLD_LEAVES nor a size in pixels";
    if (frame->light_count > 0 && !frame->lights) return "frame: lights is NULL, but light_count is not 0";
    return NULL;
}

static pbr_result take_matrices(struct scene *scene) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    bool is_given = false;
    for (int i = 0; i < 16; i++) is_given |= !(scene->frame.view[i] == 0);
    memcpy(scene->view, is_given ? scene->frame.view : identity, sizeof identity);
    if (!is_affine(scene->view)) return invalid(scene, "frame: view is not affine, or not finite");
    if (!are_finite(scene->frame.projection, 16) || !mat_is_invertible(scene->frame.projection))
        return invalid(scene, "frame: projection is not invertible, or not finite");
    lens_set_up(&scene->frame, &scene->lens);
    return PBR_OK;
}

static pbr_result take_light(struct scene *scene, const void *from, struct scene_light *light) {
    pbr_light desc = PBR_LIGHT_INIT;
    const pbr_result result = take_sized(scene->instance, "pbr_light", from, &desc, sizeof desc);
    if (result != PBR_OK) return result;
    if (desc.kind > PBR_LIGHT_POINT || desc.space > PBR_SPACE_WORLD) return invalid(scene, "light: unknown kind or space");
    if (!are_finite(desc.vector, 3) || !floats_are_finite(desc.colour, 3) || desc.reserved != 0)
        return invalid(scene, "light: a number is not finite, or reserved is not 0");
    light->is_point = desc.kind == PBR_LIGHT_POINT;
    for (int k = 0; k < 3; k++) {
        light->vector[k] = desc.vector[k];
        light->colour[k] = (double)desc.colour[k];
    }
    if (desc.space == PBR_SPACE_WORLD) {
        if (light->is_point) mat_point(scene->view, desc.vector, light->vector);
        else mat_direction(scene->view, desc.vector, light->vector);
    }
    if (!light->is_point && !vec_normalise(light->vector)) return invalid(scene, "light: the direction is 0");
    return PBR_OK;
}

static pbr_result take_lights(struct scene *scene) {
    const pbr_frame *frame = &scene->frame;
    if (frame->light_count > PBR_MAX_LIGHTS) return above(scene, "lights", frame->light_count, PBR_MAX_LIGHTS);
    const bool none = frame->light_count == 0;
    for (int k = 0; k < 3; k++) scene->ambient[k] = none && are_zero(frame->ambient, 3) ? 1 : (double)frame->ambient[k];
    if (none) {
        scene->lights[0] = (struct scene_light){.vector = {0, 0, 1}, .colour = {1, 1, 1}};
        scene->light_count = 1;
        return PBR_OK;
    }
    const size_t stride = frame->lights[0].struct_size;
    for (; scene->light_count < frame->light_count; scene->light_count++) {
        const char *light = (const char *)frame->lights + scene->light_count * stride;
        const pbr_result result = take_light(scene, light, &scene->lights[scene->light_count]);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* ---- items ---- */

static const char *wrong_splat(const pbr_item *item) {
    const float sizes[] = {item->radius_scale, item->size_minimum, item->size_maximum};
    if (item->splat > PBR_SPLAT_EWA_MAX) return "item: unknown splat";
    if (item->blending > PBR_BLEND_FILL) return "item: unknown blending";
    if (item->blending == PBR_BLEND_FILL && item->splat > PBR_SPLAT_ELLIPSE)
        return "item: circles, squares and ellipses are filled, but no blended kind";
    for (int i = 0; i < 3; i++)
        if (!(sizes[i] >= 0) || !isfinite(sizes[i])) return "item: radius_scale or a size is negative or not finite";
    if (!(item->low_pass >= 0 && (double)item->low_pass <= KERNEL_MOST_LOW_PASS)) return "item: low_pass is not 0 to 16";
    return NULL;
}

static const char *wrong_in_item(const pbr_item *item) {
    const float *material = &item->material.ambient;
    if (item->flags & ~(uint32_t)(PBR_ITEM_CULL_BACK_FACES | PBR_ITEM_HIDDEN)) return "item: flags has an unknown bit";
    if (item->shading > PBR_SHADE_PHONG_FIELD) return "item: unknown shading";
    if (item->colour_source == PBR_COLOUR_PRIMITIVE) return "item: PBR_COLOUR_PRIMITIVE tells nothing where all are alike";
    if (item->colour_source > PBR_COLOUR_PRIMITIVE) return "item: unknown colour_source";
    if (!(item->point_cost >= 0) || !isfinite(item->point_cost)) return "item: point_cost is negative or not finite";
    if (!floats_are_finite(item->colour, 4)) return "item: colour is not finite";
    if (!floats_are_finite(material, 4)) return "item: material is not finite";
    if (!floats_are_finite(item->scalar_range, 2)) return "item: scalar_range is not finite";
    if (item->colour_map ? item->colour_map_size < 2 || item->colour_map_size > 32 : item->colour_map_size != 0)
        return "item: a colour map has 2 to 32 entries";
    if (item->colour_map && !floats_are_finite(item->colour_map, (size_t)3 * item->colour_map_size))
        return "item: colour_map is not finite";
    if (!item->transforms != (item->transform_count == 0)) return "item: transforms and transform_count contradict each other";
    if (!item->clip_planes && item->clip_plane_count > 0) return "item: clip_planes is NULL, but clip_plane_count is not 0";
    return wrong_splat(item);
}

static pbr_result check_item(struct scene *scene, const pbr_item *item) {
    const char *wrong = wrong_in_item(item);
    if (wrong) return invalid(scene, wrong);
    if (item->transform_count > PBR_MAX_TRANSFORMS) return above(scene, "transforms", item->transform_count, PBR_MAX_TRANSFORMS);
    if (item->clip_plane_count > PBR_MAX_CLIP_PLANES)
        return above(scene, "clip planes", item->clip_plane_count, PBR_MAX_CLIP_PLANES);
    if (!are_finite(item->clip_planes, (size_t)4 * item->clip_plane_count))
        return invalid(scene, "item: a clip plane is not finite");
    for (uint32_t i = 0; i < item->transform_count; i++)
        if (!is_affine(item->transforms + (size_t)16 * i)) return invalid(scene, "item: a transform is not affine, or not finite");
    return PBR_OK;
}

static void fill_in_defaults(pbr_item *item) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    if (item->radius_scale == 0) item->radius_scale = 1;
    if (item->low_pass == 0) item->low_pass = (float)KERNEL_LOW_PASS;
    if (are_zero(item->colour, 4)) {
        for (int k = 0; k < 3; k++) item->colour[k] = 0.8f;
        item->colour[3] = 1;
    }
    if (are_zero(&item->material.ambient, 4)) item->material = (pbr_material){0.1f, 0.9f, 0.15f, 32};
    if (item->transform_count == 0) {
        item->transforms = identity;
        item->transform_count = 1;
    }
}

static pbr_result count_elements(struct scene *scene, struct scene_item *item, bool is_mesh) {
    uint64_t count = 0;
    if (is_mesh) {
        pbr_mesh_info info = PBR_MESH_INFO_INIT;
        if (!item->mesh) return invalid(scene, "a mesh is NULL");
        const pbr_result result = pbr_mesh_get_info(item->mesh, &info);
        if (result != PBR_OK) return result;
        count = info.triangle_count;
    } else {
        item->info = (pbr_points_info)PBR_POINTS_INFO_INIT;
        if (!item->desc.points || item->desc.lod)
            return invalid(scene, "item: points is NULL, or lod is not; pbr_lod_to_points gives a hierarchy's points");
        const pbr_result result = pbr_points_get_info(item->desc.points, &item->info);
        if (result != PBR_OK) return result;
        count = item->info.count;
        if (item->desc.colour_source == PBR_COLOUR_SCALAR && item->desc.scalar_index >= item->info.scalar_count)
            return invalid(scene, "item: the points have no scalar of that index");
    }
    item->first = scene->count;
    item->elements = item->desc.flags & PBR_ITEM_HIDDEN ? 0 : count;
    if (item->elements > (SIZE_MAX / 2 - scene->count) / item->desc.transform_count)
        return above(scene, "elements or more", scene->count, SIZE_MAX / 2);
    scene->count += item->elements * item->desc.transform_count;
    return PBR_OK;
}

static bool is_layered(const pbr_item *item) {
    return item->splat >= PBR_SPLAT_GAUSSIAN || item->blending == PBR_BLEND_FILL;
}

/* Of layered ones. All that are filled are so together. Splats shaded once each are blended together, whatever their colour; those
 * shaded once a pixel with their like. */
static bool share_a_layer(const pbr_item *a, const pbr_item *b) {
    const bool deferred = a->shading >= PBR_SHADE_DEFERRED;
    if (a->blending != b->blending) return false;
    if (a->blending == PBR_BLEND_FILL) return true;
    if (deferred != (b->shading >= PBR_SHADE_DEFERRED)) return false;
    const pbr_material *m = &a->material, *n = &b->material;
    return !deferred ||
           (m->ambient == n->ambient && m->diffuse == n->diffuse && m->specular == n->specular && m->shininess == n->shininess);
}

static void find_layer(struct scene *scene, size_t i) {
    struct scene_item *items = scene->items;
    if (!is_layered(&items[i].desc)) return;
    scene->is_filled |= items[i].desc.blending == PBR_BLEND_FILL;
    for (size_t earlier = 0; earlier < i; earlier++)
        if (items[earlier].layer > 0 && share_a_layer(&items[earlier].desc, &items[i].desc)) {
            items[i].layer = items[earlier].layer;
            return;
        }
    items[i].layer = ++scene->layer_count;
}

static pbr_result take_items(struct scene *scene, const pbr_item *items, const pbr_mesh *const *meshes, bool are_meshes) {
    const size_t stride = scene->item_count > 0 ? items[0].struct_size : 0;
    for (size_t i = 0; i < scene->item_count; i++) {
        struct scene_item *item = &scene->items[i];
        item->desc = (pbr_item)PBR_ITEM_INIT;
        pbr_result result =
            take_sized(scene->instance, "pbr_item", (const char *)items + i * stride, &item->desc, sizeof item->desc);
        if (result == PBR_OK) result = check_item(scene, &item->desc);
        if (result != PBR_OK) return result;
        if (are_meshes) item->mesh = meshes[i];
        fill_in_defaults(&item->desc);
        result = count_elements(scene, item, are_meshes);
        if (result != PBR_OK) return result;
        find_layer(scene, i);
    }
    return PBR_OK;
}

pbr_result scene_open(pbr_instance *instance, const char *caller, const pbr_frame *frame, const pbr_item *items,
                      const pbr_mesh *const *meshes, size_t count, const pbr_reference_desc *desc, struct scene *scene) {
    *scene = (struct scene){.instance = instance, .caller = caller, .item_count = count};
    if (!frame || (!items && count > 0)) return invalid(scene, "frame or items is NULL");
    pbr_result result = take_sized(instance, "pbr_frame", frame, &scene->frame, sizeof scene->frame);
    if (result == PBR_OK) result = take_sized(instance, "pbr_reference_desc", desc, &scene->desc, sizeof scene->desc);
    if (result != PBR_OK) return result;
    if (scene->desc.flags != 0 || scene->desc.reserved != 0) return invalid(scene, "flags or reserved is not 0");
    const char *wrong = wrong_number(&scene->frame);
    if (wrong) return invalid(scene, wrong);
    if (count > PBR_MAX_ITEMS) return above(scene, "items", count, PBR_MAX_ITEMS);
    result = take_matrices(scene);
    if (result == PBR_OK) result = take_lights(scene);
    if (result != PBR_OK) return result;
    scene->items = pbr_allocate(instance, count, sizeof *scene->items);
    if (!scene->items) return PBR_ERROR_OUT_OF_MEMORY;
    result = take_items(scene, items, meshes, meshes != NULL);
    if (result != PBR_OK) scene_close(scene);
    return result;
}

void scene_close(struct scene *scene) {
    pbr_free(scene->instance, scene->items);
    scene->items = NULL;
}

/* ---- elements ---- */

void scene_place(const struct scene *scene, const struct scene_item *item, uint64_t transform, struct placement *out) {
    double x[3], y[3], z[3], *m = out->eye;
    memcpy(out->world, item->desc.transforms + 16 * transform, sizeof out->world);
    mat_multiply(scene->view, out->world, m);
    out->stretch = mat_largest_stretch(m);
    /* The inverse transpose is the cofactors over the determinant, of which only the sign matters. */
    vec_cross(m + 4, m + 8, x);
    vec_cross(m + 8, m, y);
    vec_cross(m, m + 4, z);
    const double sign = vec_dot(m, x) < 0 ? -1 : 1;
    memset(out->normal, 0, sizeof out->normal);
    for (int r = 0; r < 3; r++) {
        out->normal[r] = sign * x[r];
        out->normal[4 + r] = sign * y[r];
        out->normal[8 + r] = sign * z[r];
    }
}

/* The item is the last that begins at or before the number: after it come only empty ones. */
void scene_walk(const struct scene *scene, uint64_t number, struct walk *walk) {
    size_t low = 0, high = scene->item_count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (scene->items[middle].first <= number) low = middle;
        else high = middle;
    }
    const struct scene_item *item = &scene->items[low];
    const uint64_t within = number - item->first, transform = within / item->elements;
    walk->index = within % item->elements;
    if (walk->item == item && walk->transform == transform) return;
    walk->item = item;
    walk->transform = transform;
    scene_place(scene, item, transform, &walk->placement);
}
