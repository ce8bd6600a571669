/* The vertex arrays that a reader fills, and the points or mesh that they make. SPDX-License-Identifier: MIT */
#include "arrays.h"

#include <math.h>
#include <string.h>

static size_t number_size(uint32_t format) {
    return format == PBR_FORMAT_FLOAT64 ? 8 : format == PBR_FORMAT_FLOAT32 ? 4 : format == PBR_FORMAT_UINT16 ? 2 : 1;
}

pbr_result arrays_make(struct arrays *arrays, uint64_t rows, uint32_t format, uint32_t components, pbr_attribute *out) {
    size_t size = number_size(format) * components;
    if (arrays->block_count == ARRAYS_MOST_BLOCKS) return PBR_ERROR_LIMIT;
    void *data = pbr_allocate(arrays->instance, rows, size);
    if (!data) return PBR_ERROR_OUT_OF_MEMORY;
    arrays->blocks[arrays->block_count++] = data;
    *out = (pbr_attribute){.data = data, .stride = size, .format = format, .components = components};
    return PBR_OK;
}

pbr_result arrays_make_scalar(struct arrays *arrays, uint64_t rows, uint32_t format, const char *name, pbr_attribute *out) {
    pbr_result result = arrays->scalar_count < PBR_MAX_SCALARS ? arrays_make(arrays, rows, format, 1, out) : PBR_ERROR_LIMIT;
    if (result == PBR_OK) arrays->scalars[arrays->scalar_count++] = (pbr_scalar){name, *out};
    return result;
}

pbr_attribute arrays_columns(const pbr_attribute *rows, uint32_t first, uint32_t components) {
    pbr_attribute out = *rows;
    out.data = (const float *)rows->data + first;
    out.components = components;
    return out;
}

static void read_triple(const pbr_attribute *triple, uint64_t i, float out[3]) {
    memcpy(out, (const char *)triple->data + (size_t)i * triple->stride, 3 * sizeof *out);
}

struct triple_range arrays_triple(const pbr_attribute *triple, uint64_t count) {
    struct triple_range range = {INFINITY, -INFINITY, TRIPLE_NUMBERS};
    bool unit = true, any = false;
    for (uint64_t i = 0; i < count; i++) {
        float v[3];
        read_triple(triple, i, v);
        for (int k = 0; k < 3; k++) {
            if (!isfinite(v[k])) continue;
            range.low = fminf(range.low, v[k]);
            range.high = fmaxf(range.high, v[k]);
        }
        float squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        if (!isfinite(squared) || squared == 0) continue; /* no direction */
        any = true;
        unit &= fabsf(squared - 1) < 0.04f;
    }
    if (!(range.low <= range.high)) range.low = range.high = 0;
    if (unit && any) range.kind = TRIPLE_NORMALS;
    else if (range.low >= 0 && range.high <= 65535) range.kind = TRIPLE_COLOURS;
    return range;
}

pbr_result arrays_colours(struct arrays *arrays, const pbr_attribute *triple, struct triple_range range) {
    float scale = range.high <= 1 ? 65535.0f : range.high <= 255 ? 257.0f : 1.0f;
    pbr_result result = arrays_make(arrays, arrays->count, PBR_FORMAT_UINT16, 3, &arrays->colours);
    if (result != PBR_OK) return result;
    uint16_t *to = arrays->blocks[arrays->block_count - 1];
    for (uint64_t i = 0; i < arrays->count; i++) {
        float v[3];
        read_triple(triple, i, v);
        for (int k = 0; k < 3; k++) {
            float c = v[k] * scale;
            *to++ = !(c > 0) ? 0 : c >= 65535 ? 65535 : (uint16_t)(c + 0.5f);
        }
    }
    return PBR_OK;
}

pbr_result arrays_points(const struct arrays *arrays, const pbr_read_desc *desc, pbr_file_content *content) {
    pbr_points_desc points = PBR_POINTS_DESC_INIT;
    points.count = arrays->count;
    if (arrays->count > 0) {
        points.positions = arrays->positions;
        points.normals = arrays->normals;
        points.colours = arrays->colours;
        points.radii = arrays->radii;
        points.scalars = arrays->scalar_count ? arrays->scalars : NULL;
        points.scalar_count = arrays->scalar_count;
    }
    content->radii_estimated = !points.radii.data && !(desc->flags & PBR_READ_KEEP_RADII);
    if (content->radii_estimated) points.flags = PBR_POINTS_ESTIMATE_RADII;
    points.radius_neighbours = desc->radius_neighbours;
    points.radius_scale = desc->radius_scale;
    points.progress = desc->progress;
    points.progress_user = desc->progress_user;
    return pbr_points_create(arrays->instance, &points, &content->points);
}

pbr_result arrays_mesh(struct arrays *arrays, uint32_t (*triangles)[3], size_t triangle_count, const pbr_read_desc *desc,
                       pbr_file_content *content) {
    pbr_mesh_desc mesh = PBR_MESH_DESC_INIT;
    if (arrays->radii.data && arrays->scalar_count < PBR_MAX_SCALARS)
        arrays->scalars[arrays->scalar_count++] = (pbr_scalar){"radius", arrays->radii};
    mesh.vertex_count = arrays->count;
    mesh.positions = arrays->positions;
    mesh.normals = arrays->normals;
    mesh.colours = arrays->colours;
    mesh.scalars = arrays->scalar_count ? arrays->scalars : NULL;
    mesh.scalar_count = arrays->scalar_count;
    mesh.indices = triangles;
    mesh.index_format = PBR_FORMAT_UINT32;
    mesh.triangle_count = triangle_count;
    mesh.progress = desc->progress;
    mesh.progress_user = desc->progress_user;
    return pbr_mesh_create(arrays->instance, &mesh, &content->mesh);
}

void arrays_free(struct arrays *arrays) {
    while (arrays->block_count > 0) pbr_free(arrays->instance, arrays->blocks[--arrays->block_count]);
}
