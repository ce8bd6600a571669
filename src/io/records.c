/* Points that lie in a file as records of one size. SPDX-License-Identifier: MIT */
#include "records.h"

#include <float.h>
#include <math.h>

#include "core/colour.h"
#include "number_binary.h"

static inline double field_value(const struct records *records, const struct record_field *field, const char *record) {
    return field->scale * binary_number(record + field->at, field->type, records->big_endian) + field->offset;
}

/* As point sets take over colours of these formats. */
static uint8_t colour_value(enum record_colours kind, double value) {
    const double full = kind == RECORD_UNORM8 ? 255 : 65535;
    if (kind == RECORD_LINEAR) return unorm8(srgb_from_linear((float)value));
    const uint32_t whole = !(value > 0) ? 0 : value >= full ? (uint32_t)full : (uint32_t)(value + 0.5);
    return (uint8_t)(kind == RECORD_UNORM8 ? whole : (whole + 128) / 257);
}

/* Zeros for one that has no direction. */
static void decode_normal(const struct records *records, const char *record, float out[3]) {
    for (int k = 0; k < 3; k++) out[k] = (float)field_value(records, &records->normal[k], record);
    if (!isfinite(out[0]) || !isfinite(out[1]) || !isfinite(out[2])) out[0] = out[1] = out[2] = 0;
}

void records_decode(const struct records *records, uint64_t first, uint64_t count, double *positions, float *normals,
                    uint8_t *colours, float *radii) {
    const char *record = records->data + (size_t)first * records->size;
    for (uint64_t i = 0; i < count; i++, record += records->size) {
        for (uint64_t k = 0; k < 3; k++) positions[3 * i + k] = field_value(records, &records->position[k], record);
        if (normals && records->normal[0].type != PLY_NONE) decode_normal(records, record, normals + 3 * i);
        for (uint64_t k = 0; colours && k < 3; k++)
            colours[4 * i + k] = records->colour[k].type == PLY_NONE
                                     ? 255
                                     : colour_value(records->colours, field_value(records, &records->colour[k], record));
        if (colours) colours[4 * i + 3] = 255;
        if (radii && records->radius.type != PLY_NONE) {
            const double radius = field_value(records, &records->radius, record);
            radii[i] = radius > 0 && radius <= FLT_MAX ? (float)radius : 0;
        }
    }
}
