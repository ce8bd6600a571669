/* Reading one element of the host's attribute arrays. The arrays may be unaligned, hence memcpy. SPDX-License-Identifier: MIT */
#include "attribute.h"

#include <float.h>
#include <math.h>
#include <string.h>

size_t format_size(uint32_t format) {
    switch (format) {
    case PBR_FORMAT_INT8:
    case PBR_FORMAT_UINT8: return 1;
    case PBR_FORMAT_INT16:
    case PBR_FORMAT_UINT16: return 2;
    case PBR_FORMAT_FLOAT32:
    case PBR_FORMAT_INT32:
    case PBR_FORMAT_UINT32: return 4;
    case PBR_FORMAT_FLOAT64: return 8;
    default: return 0;
    }
}

pbr_result attribute_check(pbr_instance *instance, const char *name, pbr_attribute *attribute, uint64_t count, uint32_t formats,
                           uint32_t fewest, uint32_t most, bool required) {
    if (!attribute->data) {
        if (!required) return PBR_OK;
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: required, but the data pointer is NULL", name);
    }
    size_t size = format_size(attribute->format);
    if (size == 0 || !(formats >> attribute->format & 1))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: format %u is not allowed", name,
                       (unsigned)attribute->format);
    if (attribute->components < fewest || attribute->components > most)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: %u components, expected %u to %u", name,
                       (unsigned)attribute->components, (unsigned)fewest, (unsigned)most);
    size_t element = size * attribute->components, last, end;
    if (attribute->stride == 0) attribute->stride = element;
    if (attribute->stride < element)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: stride is %zu, but an element has %zu bytes", name,
                       attribute->stride, element);
    if (count > 0 && (__builtin_mul_overflow(count - 1, attribute->stride, &last) || __builtin_add_overflow(last, element, &end) ||
                      end > PTRDIFF_MAX))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "%s: %llu elements with a stride of %zu exceed the address space", name, (unsigned long long)count,
                       attribute->stride);
    return PBR_OK;
}

static double read_number(const unsigned char *at, uint32_t format) {
    union {
        float f32;
        double f64;
        int8_t i8;
        uint8_t u8;
        int16_t i16;
        uint16_t u16;
        int32_t i32;
        uint32_t u32;
    } value;
    switch (format) {
    case PBR_FORMAT_FLOAT32: memcpy(&value.f32, at, sizeof value.f32); return value.f32;
    case PBR_FORMAT_FLOAT64: memcpy(&value.f64, at, sizeof value.f64); return value.f64;
    case PBR_FORMAT_INT8: memcpy(&value.i8, at, sizeof value.i8); return value.i8;
    case PBR_FORMAT_UINT8: memcpy(&value.u8, at, sizeof value.u8); return value.u8;
    case PBR_FORMAT_INT16: memcpy(&value.i16, at, sizeof value.i16); return value.i16;
    case PBR_FORMAT_UINT16: memcpy(&value.u16, at, sizeof value.u16); return value.u16;
    case PBR_FORMAT_INT32: memcpy(&value.i32, at, sizeof value.i32); return value.i32;
    default: memcpy(&value.u32, at, sizeof value.u32); return value.u32;
    }
}

void attribute_read(const pbr_attribute *attribute, uint64_t i, double *out) {
    const unsigned char *at = (const unsigned char *)attribute->data + (size_t)i * attribute->stride;
    size_t size = format_size(attribute->format);
    for (uint32_t c = 0; c < attribute->components; c++) out[c] = read_number(at + c * size, attribute->format);
}
