/* The codecs of pictures. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PICTURE_H
#define PBR_IO_PICTURE_H

#include <pbr/image.h>

#include "core/file.h"

bool png_recognise(const struct source *source);
pbr_result picture_read_png(pbr_instance *instance, const char *name, const struct source *source, pbr_image *image);
pbr_result picture_write_png(pbr_instance *instance, const char *name, const pbr_image *image, struct output *output);

bool exr_recognise(const struct source *source);
pbr_result picture_read_exr(pbr_instance *instance, const char *name, const struct source *source, pbr_image *image);
pbr_result picture_write_exr(pbr_instance *instance, const char *name, const pbr_image *image, struct output *output);

/* Whether a picture read from a file may be this large: sides up to PBR_MAX_IMAGE_SIZE and 4 GiB of pixels. Errors are logged. */
pbr_result picture_check_size(pbr_instance *instance, const char *name, uint64_t width, uint64_t height);

#endif
