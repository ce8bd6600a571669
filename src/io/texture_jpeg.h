/* JPEG textures. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_TEXTURE_JPEG_H
#define PBR_IO_TEXTURE_JPEG_H

#include "core/file.h"
#include "texture.h"

bool jpeg_recognise(const struct source *source);

/* Decodes a JPEG of at most `most_texels`. The texels are none of it, and `reason` says why, if it cannot be read; if it is
 * damaged, `reason` says how. An error is only PBR_ERROR_OUT_OF_MEMORY. */
pbr_result jpeg_read(struct reader *reader, const struct source *source, uint64_t most_texels, struct texture *out,
                     char reason[TEXTURE_REASON]);

#endif
