/* Reading one element of the host's attribute arrays, whatever its format, stride and alignment. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_ATTRIBUTE_H
#define PBR_CORE_ATTRIBUTE_H

#include <float.h>
#include <math.h>
#include <string.h>

#include "instance.h"

/* Bytes of one number; 0 for an unknown format. */
size_t format_size(uint32_t format);

/* Checks an attribute against its contract and fills in its stride: a bit (1 << PBR_FORMAT_...) per allowed format, and a range of
 * component counts. `name` is for the log. An absent attribute is fine unless `required`. */
pbr_result attribute_check(pbr_instance *instance, const char *name, pbr_attribute *attribute, uint64_t count, uint32_t formats,
                           uint32_t fewest, uint32_t most, bool required);

/* Element i as numbers: integers by their value, without normalisation. */
void attribute_read(const pbr_attribute *attribute, uint64_t i, double *out);

/* Element i, of three floats or doubles, as a position; false if it is none: a coordinate that is not finite, or past the range of
 * float, in which splats are drawn. */
static inline bool attribute_read_position(const pbr_attribute *attribute, uint64_t i, double out[3]) {
    const unsigned char *at = (const unsigned char *)attribute->data + (size_t)i * attribute->stride;
    if (attribute->format == PBR_FORMAT_FLOAT32) {
        float narrow[3];
        memcpy(narrow, at, sizeof narrow);
        for (int k = 0; k < 3; k++) out[k] = (double)narrow[k];
    } else {
        memcpy(out, at, sizeof(double[3]));
    }
    return fabs(out[0]) <= FLT_MAX && fabs(out[1]) <= FLT_MAX && fabs(out[2]) <= FLT_MAX;
}

#endif
