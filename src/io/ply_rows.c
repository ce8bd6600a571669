/* Where the rows of a PLY element go: columns and triangles. SPDX-License-Identifier: MIT */
#include "ply_rows.h"

#include <string.h>

/* Colours: 0..full, rounded; NaN gives 0. */
static unsigned unorm(double value, unsigned full) {
    return !(value > 0) ? 0 : value >= full ? full : (unsigned)(value + 0.5);
}

void ply_store(const struct ply_column *column, uint64_t row, double value) {
    if (column->store == STORE_NOTHING) return; /* has no place */
    unsigned char *to = column->base + row * column->stride;
    value *= column->scale;
    switch (column->store) {
    case STORE_NOTHING: break;
    case STORE_FLOAT: {
        float number = (float)value;
        memcpy(to, &number, sizeof number);
        break;
    }
    case STORE_DOUBLE: memcpy(to, &value, sizeof value); break;
    case STORE_UNORM8: *to = (unsigned char)unorm(value, 255); break;
    case STORE_UNORM16: {
        uint16_t number = (uint16_t)unorm(value, 65535);
        memcpy(to, &number, sizeof number);
        break;
    }
    }
}

pbr_result ply_faces_reserve(struct reader *reader, struct ply_faces *faces, size_t *room, uint64_t more) {
    if (more > SIZE_MAX - faces->count) return PBR_ERROR_OUT_OF_MEMORY;
    size_t wanted = faces->count + (size_t)more;
    if (wanted <= *room) return PBR_OK;
    void *grown = pbr_reallocate(reader->instance, faces->triangles, faces->count, wanted, sizeof *faces->triangles);
    if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
    faces->triangles = grown;
    *room = wanted;
    return PBR_OK;
}

void ply_faces_add(struct ply_faces *sum, const struct ply_faces *part) {
    sum->count += part->count;
    sum->faces += part->faces;
    sum->out_of_range += part->out_of_range;
    sum->too_short += part->too_short;
}

void ply_faces_warn(struct reader *reader, const struct ply_faces *faces) {
    if (faces->out_of_range)
        reader_warn(reader, faces->out_of_range, "%llu faces left out that refer to vertices that are not there",
                    (unsigned long long)faces->out_of_range);
    if (faces->too_short)
        reader_warn(reader, faces->too_short, "%llu faces left out that have fewer than 3 corners",
                    (unsigned long long)faces->too_short);
}

size_t ply_smallest_row(const struct ply_target *target, bool ascii) {
    size_t size = 0;
    for (uint32_t i = 0; i < target->property_count; i++) {
        const struct ply_property *property = &target->properties[i];
        /* Text: a digit and a blank. A list: its length. */
        size += ascii ? 2 : ply_type_size(property->count_type != PLY_NONE ? property->count_type : property->type);
    }
    return size;
}
