/* Pictures on meshes. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_TEXTURE_H
#define PBR_IO_TEXTURE_H

#include "reader.h"

struct texture {
    uint32_t width, height;
    unsigned char *texels; /* rows from the top; red, green, blue: sRGB, not times alpha; alpha */
    float linear[256];     /* of each code of sRGB */
};

enum { TEXTURE_REASON = 256 };

/* What all textures of a mesh may hold in all, and each of them. */
#define TEXTURE_MOST_TEXELS (UINT64_C(1) << 31)
#define TEXTURE_MOST_TEXELS_EACH (UINT64_C(1) << 26)

/* Reads a PNG or JPEG that the reader's file names, and takes its texels off `*texels_left`. What cannot be read is empty, after a
 * warning; an error is only PBR_ERROR_OUT_OF_MEMORY. */
pbr_result texture_read(struct reader *reader, const char *name, size_t length, uint64_t *texels_left, struct texture *out);
void texture_free(pbr_instance *instance, struct texture *texture);

#endif
