/* docs/coordinates-and-colour.md in double. SPDX-License-Identifier: MIT */
#include "shade.h"

#include "core/colour_map.h"

/* ---- albedo ---- */

/* IEC 61966-2-1. */
static double linear(double srgb) {
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* A position of the map's, held within its ends; a range of no length is all at its start. */
static void look_up(const struct scene_item *item, double value, double out[3]) {
    const float *map = item->desc.colour_map ? item->desc.colour_map : &colour_map[0][0];
    const int last = (item->desc.colour_map ? (int)item->desc.colour_map_size : COLOUR_MAP_SIZE) - 1;
    const double length = item->range[1] - item->range[0];
    const double t = length != 0 ? fmin(fmax((value - item->range[0]) / length, 0), 1) * last : 0;
    const int cell = t < last ? (int)t : last - 1;
    for (int k = 0; k < 3; k++) {
        const double from = (double)map[3 * cell + k], to = (double)map[3 * cell + 3 + k];
        out[k] = from + (t - cell) * (to - from);
    }
}

void shade_albedo(const struct scene_item *item, const struct colouring *from, double out[3]) {
    const uint32_t source = item->desc.colour_source;
    if (source == PBR_COLOUR_NORMAL && vec_dot(from->normal, from->normal) > 0) {
        for (int k = 0; k < 3; k++) out[k] = linear((from->normal[k] + 1) / 2);
    } else if (source == PBR_COLOUR_DEPTH) {
        look_up(item, from->distance, out);
    } else if (source == PBR_COLOUR_SCALAR && !isnan(from->scalar)) {
        look_up(item, from->scalar, out);
    } else {
        const bool own = source == PBR_COLOUR_POINTS && from->colour;
        for (int k = 0; k < 3; k++) out[k] = own ? linear(from->colour[k] / 255.0) : (double)item->desc.colour[k];
    }
}

/* ---- ranges ---- */

/* Over the finite values. */
static pbr_result find_scalar_range(const struct scene *scene, struct scene_item *item) {
    enum { PIECE = 4096 };
    double low = INFINITY, high = -INFINITY;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    float *values = pbr_allocate(scene->instance, PIECE, sizeof *values);
    if (!values) return PBR_ERROR_OUT_OF_MEMORY;
    copy.scalar = values;
    copy.scalar_index = item->desc.scalar_index;
    pbr_result result = PBR_OK;
    for (uint64_t first = 0; result == PBR_OK && first < item->info.count; first += PIECE) {
        const uint64_t rest = item->info.count - first, count = rest < PIECE ? rest : PIECE;
        result = pbr_points_copy(item->desc.points, first, count, &copy);
        for (uint64_t i = 0; result == PBR_OK && i < count; i++) {
            if (!isfinite(values[i])) continue;
            low = fmin(low, (double)values[i]);
            high = fmax(high, (double)values[i]);
        }
    }
    pbr_free(scene->instance, values);
    item->range[0] = low <= high ? low : 0;
    item->range[1] = low <= high ? high : 0;
    return result;
}

/* Of the bounding spheres of all copies. */
static pbr_result find_distances(const struct scene *scene, struct scene_item *item, const double centre[3], double radius) {
    item->range[0] = INFINITY;
    item->range[1] = -INFINITY;
    for (uint32_t i = 0; i < item->desc.transform_count; i++) {
        struct placement placement;
        double seen[3];
        scene_place(scene, item, i, &placement);
        mat_point(placement.eye, centre, seen);
        const double distance = row_point(scene->lens.axis, seen), reach = placement.stretch * radius;
        item->range[0] = fmin(item->range[0], distance - reach);
        item->range[1] = fmax(item->range[1], distance + reach);
    }
    return PBR_OK;
}

static pbr_result find_depth_range(const struct scene *scene, struct scene_item *item) {
    if (!item->mesh) return find_distances(scene, item, item->info.centre, item->info.bounding_radius);
    pbr_mesh_info info = PBR_MESH_INFO_INIT;
    double centre[3], half[3];
    const pbr_result result = pbr_mesh_get_info(item->mesh, &info);
    for (int k = 0; k < 3; k++) {
        half[k] = (info.maximum[k] - info.minimum[k]) / 2;
        centre[k] = info.minimum[k] + half[k];
    }
    return result == PBR_OK ? find_distances(scene, item, centre, vec_length(half)) : result;
}

pbr_result shade_find_ranges(struct scene *scene) {
    pbr_result result = PBR_OK;
    for (size_t i = 0; result == PBR_OK && i < scene->item_count; i++) {
        struct scene_item *item = &scene->items[i];
        for (int k = 0; k < 2; k++) item->range[k] = (double)item->desc.scalar_range[k];
        if (item->range[0] != 0 || item->range[1] != 0) continue;
        if (item->desc.colour_source == PBR_COLOUR_SCALAR) result = find_scalar_range(scene, item);
        if (item->desc.colour_source == PBR_COLOUR_DEPTH) result = find_depth_range(scene, item);
    }
    return result;
}

/* ---- light ---- */

void shade_phong(const struct scene *scene, const pbr_material *material, const double albedo[3], const double point[3],
                 const double normal[3], double out[3]) {
    double to_eye[3], mirrored[3], n[3], lit[3], highlight[3] = {0, 0, 0};
    if (vec_dot(normal, normal) == 0) {
        memcpy(out, albedo, 3 * sizeof *out);
        return;
    }
    lens_to_eye(&scene->lens, point, to_eye);
    const double facing = vec_dot(normal, to_eye), side = facing < 0 ? -1 : 1;
    for (int k = 0; k < 3; k++) {
        n[k] = side * normal[k];
        mirrored[k] = 2 * facing * normal[k] - to_eye[k];
        lit[k] = (double)material->ambient * scene->ambient[k];
    }
    for (uint32_t i = 0; i < scene->light_count; i++) {
        const struct scene_light *light = &scene->lights[i];
        double l[3];
        for (int k = 0; k < 3; k++) l[k] = light->vector[k] - (light->is_point ? point[k] : 0);
        vec_normalise(l);
        const double diffuse = (double)material->diffuse * fmax(vec_dot(n, l), 0);
        const double specular = (double)material->specular * pow(fmax(vec_dot(mirrored, l), 0), (double)material->shininess);
        for (int k = 0; k < 3; k++) {
            lit[k] += diffuse * light->colour[k];
            highlight[k] += specular * light->colour[k];
        }
    }
    for (int k = 0; k < 3; k++) out[k] = albedo[k] * lit[k] + highlight[k];
}
