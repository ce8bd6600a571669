/* Numbers of binary files. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_NUMBER_BINARY_H
#define PBR_IO_NUMBER_BINARY_H

#include "ply_header.h"

#include <string.h>

static inline uint64_t binary_bits(const char *p, size_t size, bool big_endian) {
    const unsigned char *bytes = (const unsigned char *)p;
    uint64_t little = 0, big = 0; /* both: a load and a swap to a compiler that knows the size */
    for (size_t i = 0; i < size; i++) {
        little |= (uint64_t)bytes[i] << (8 * i);
        big = big << 8 | bytes[i];
    }
    return big_endian ? big : little;
}

static inline double binary_number(const char *p, enum ply_type type, bool big_endian) {
    switch (type) {
    case PLY_NONE: return 0;
    case PLY_INT8: return (int8_t)binary_bits(p, 1, big_endian);
    case PLY_UINT8: return (double)binary_bits(p, 1, big_endian);
    case PLY_INT16: return (int16_t)binary_bits(p, 2, big_endian);
    case PLY_UINT16: return (double)binary_bits(p, 2, big_endian);
    case PLY_INT32: return (int32_t)binary_bits(p, 4, big_endian);
    case PLY_UINT32: return (double)binary_bits(p, 4, big_endian);
    case PLY_FLOAT32: {
        uint32_t bits = (uint32_t)binary_bits(p, 4, big_endian);
        float value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    case PLY_FLOAT64: {
        uint64_t bits = binary_bits(p, 8, big_endian);
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    }
    return 0;
}

#endif
