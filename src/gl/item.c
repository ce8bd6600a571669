/* Checking items and filling in what they leave to libpbr. SPDX-License-Identifier: MIT */
#include "item.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "core/matrix.h"
#include "lod/cut.h"
#include "lod/lod.h"

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static pbr_result invalid(pbr_instance *instance, size_t index, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_item %zu: %s", index, what);
}

static bool floats_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

static const char *item_fault(const pbr_item *item) {
    const uint32_t known = PBR_ITEM_CULL_BACK_FACES | PBR_ITEM_HIDDEN;
    if (!item->points == !item->lod) return item->lod ? "points and lod are both given" : "points and lod are NULL";
    if (item->lod && item->colour_source == PBR_COLOUR_SCALAR) return "hierarchies have no scalars";
    if (!item->transforms != !item->transform_count) return "transforms and transform_count do not agree";
    if (item->splat > PBR_SPLAT_EWA_MAX || item->shading > PBR_SHADE_PHONG_FIELD || item->colour_source > PBR_COLOUR_PRIMITIVE)
        return "splat, shading or colour_source is unknown";
    if (item->blending > PBR_BLEND_FILL) return "blending is unknown";
    if (item_is_filled(item) && item->splat >= PBR_SPLAT_GAUSSIAN)
        return "PBR_BLEND_FILL is of circle, square and ellipse; the other kinds are blended already";
    if (!(item->low_pass >= 0) || !(item->low_pass <= (float)KERNEL_MOST_LOW_PASS)) return "low_pass is not within 0..16";
    if (item->flags & ~known) return "a flag is unknown";
    if (!(item->point_cost >= 0) || !isfinite(item->point_cost)) return "point_cost is negative or not finite";
    if (!(item->radius_scale >= 0) || !(item->size_minimum >= 0) || !(item->size_maximum >= 0) || !isfinite(item->radius_scale) ||
        !isfinite(item->size_minimum))
        return "radius_scale, size_minimum or size_maximum is negative or not finite";
    if (item->size_maximum != 0 && item->size_maximum < item->size_minimum) return "size_maximum is below size_minimum";
    if (!floats_are_finite(item->colour, 4) || !floats_are_finite(&item->material.ambient, 4) ||
        !floats_are_finite(item->scalar_range, 2))
        return "colour, material or scalar_range is not finite";
    if (item->material.shininess < 0) return "material.shininess is negative";
    if (!item->clip_planes != !item->clip_plane_count) return "clip_planes and clip_plane_count do not agree";
    if (!item->colour_map != !item->colour_map_size) return "colour_map and colour_map_size do not agree";
    if (item->colour_map && (item->colour_map_size < 2 || item->colour_map_size > 32)) return "colour_map_size is not within 2..32";
    if (item->colour_map && !floats_are_finite(item->colour_map, 3 * (size_t)item->colour_map_size))
        return "colour_map is not finite";
    for (size_t i = 0; i < item->transform_count; i++) {
        double transform[16];
        memcpy(transform, item->transforms + 16 * i, sizeof transform);
        if (!matrix_is_finite(transform) || !matrix_make_affine(transform)) return "a transform is not a finite affine matrix";
    }
    for (size_t i = 0; i < 4 * (size_t)item->clip_plane_count; i++)
        if (!isfinite(item->clip_planes[i])) return "a clip plane is not finite";
    return NULL;
}

/* `least`: diameter of the smallest GL point. */
static void fill_in_defaults(pbr_item *item, float least) {
    if (!item->transforms) {
        item->transforms = identity;
        item->transform_count = 1;
    }
    if (item->radius_scale == 0) item->radius_scale = 1;
    if (item->size_maximum == 0) item->size_maximum = 1e18f;
    item->low_pass = item->low_pass == 0 ? (float)KERNEL_LOW_PASS : fmaxf(item->low_pass, 1e-6f); /* it is divided by */
    if (!splat_is_disc(item->splat)) {
        if (item->size_minimum == 0) item->size_minimum = 1; /* the least that always covers a pixel's centre */
        item->size_maximum = fmaxf(item->size_maximum, least);
        item->size_minimum = fmaxf(item->size_minimum, least);
    }
    item->size_minimum = fminf(item->size_minimum, item->size_maximum);
    if (item->colour[0] == 0 && item->colour[1] == 0 && item->colour[2] == 0 && item->colour[3] == 0)
        for (int k = 0; k < 4; k++) item->colour[k] = k == 3 ? 1 : 0.8f;
    pbr_material *m = &item->material;
    if (m->ambient == 0 && m->diffuse == 0 && m->specular == 0 && m->shininess == 0) *m = (pbr_material){0.1f, 0.9f, 0.15f, 32};
}

/* Points have neighbours that normal fields are fitted to, of hierarchies some were built with fields. */
static bool has_fields(const pbr_item *item) {
    return item->shading == PBR_SHADE_PHONG_FIELD && (item->points || lod_has_fields(item->lod));
}

/* The programs of cuts do not cull: the cut has, and a node's normal does not speak for all that is below it. */
static uint32_t choose_variant(const pbr_item *item, bool has_normals, bool has_colours) {
    uint32_t source = item->colour_source;
    if ((source == PBR_COLOUR_POINTS && !has_colours) || (source == PBR_COLOUR_NORMAL && !has_normals))
        source = PBR_COLOUR_CONSTANT;
    uint32_t variant = source << VARIANT_COLOUR_SHIFT;
    variant |= item->splat << VARIANT_KIND_SHIFT;
    variant |= item_is_blended(item) ? PASS_ACCUMULATION << VARIANT_PASS_SHIFT : 0u;
    variant |= item_is_filled(item) ? VARIANT_FILL : 0u;
    if (has_normals && item_is_deferred(item)) variant |= VARIANT_DEFERRED | (has_fields(item) ? VARIANT_FIELD : 0u);
    else if (has_normals && item->shading != PBR_SHADE_NONE) variant |= VARIANT_LIT;
    const bool has_cuts = item->lod && lod_can_be_cut(item->lod);
    if (has_normals && !has_cuts && item->flags & PBR_ITEM_CULL_BACK_FACES) variant |= VARIANT_CULL;
    if (item->lod && !has_cuts) variant |= VARIANT_SEQUENCE;
    if (item->clip_plane_count > 0) variant |= VARIANT_CLIP_PLANES;
    return variant;
}

static void describe(struct prepared_item *out) {
    const pbr_item *item = &out->item;
    const pbr_points *points = item->points;
    const bool has_normals = item->lod || points->normals;
    out->variant = choose_variant(item, has_normals, item->lod ? lod_has_colours(item->lod) : points->colours != NULL);
    out->has_cuts = item->lod && lod_can_be_cut(item->lod);
    out->has_triangles = item->lod && lod_triangle_count(item->lod) > 0;
    out->culls = has_normals && item->flags & PBR_ITEM_CULL_BACK_FACES;
    out->origin = item->lod ? lod_origin(item->lod) : points->origin;
    out->radius = item->lod ? lod_radius(item->lod) : points->bounding_radius;
    out->point_count = item->lod ? lod_point_count(item->lod) : points->count;
    for (int k = 0; k < 3 && points; k++) out->centre[k] = (points->minimum[k] + points->maximum[k]) / 2;
}

pbr_result item_prepare(pbr_instance *instance, const void *in, size_t index, float least, struct prepared_item *out) {
    *out = (struct prepared_item){.scalar = -1};
    pbr_item *item = &out->item;
    pbr_result result = read_desc(instance, "pbr_item", in, sizeof *item, item, sizeof *item);
    if (result != PBR_OK) return result;
    if (item->transform_count > PBR_MAX_TRANSFORMS || item->clip_plane_count > PBR_MAX_CLIP_PLANES)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT,
                       "pbr_item %zu: %u transforms or %u clip planes; the limits are %d and %d", index,
                       (unsigned)item->transform_count, (unsigned)item->clip_plane_count, PBR_MAX_TRANSFORMS, PBR_MAX_CLIP_PLANES);
    const char *fault = item_fault(item);
    if (fault) return invalid(instance, index, fault);
    if ((item->points ? item->points->instance : item->lod->instance) != instance)
        return invalid(instance, index, "points or lod were made from another instance than the renderer");
    fill_in_defaults(item, least);
    describe(out);
    if (item->colour_source == PBR_COLOUR_SCALAR) {
        if (item->scalar_index >= item->points->scalar_count) return invalid(instance, index, "the points have no such scalar");
        out->scalar = item->scalar_index;
    }
    const bool given = item->scalar_range[0] != 0 || item->scalar_range[1] != 0;
    if (given || out->scalar < 0) {
        out->map_low = item->scalar_range[0];
        out->map_high = item->scalar_range[1];
    } else {
        out->map_low = item->points->scalars[out->scalar].minimum;
        out->map_high = item->points->scalars[out->scalar].maximum;
    }
    return PBR_OK;
}
