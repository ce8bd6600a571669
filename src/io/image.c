/* Pictures in memory, and their files by kind. SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/image.h>
#include <string.h>

#include "picture.h"

static pbr_result invalid(pbr_instance *instance, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s", what);
}

/* This version's structure, or a longer one that adds only zeros. */
static bool known_size(const pbr_image *image) {
    if (image->struct_size < sizeof *image || image->struct_size > 65536) return false;
    for (size_t i = sizeof *image; i < image->struct_size; i++)
        if (((const unsigned char *)image)[i] != 0) return false;
    return true;
}

pbr_result pbr_image_create(pbr_instance *instance, uint32_t width, uint32_t height, int has_depth, pbr_image *image) {
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!image || !known_size(image) || image->rgba || image->depth)
        return invalid(instance, "pbr_image_create: image must be set up by PBR_IMAGE_INIT and hold no pixels");
    if (width == 0 || height == 0) return invalid(instance, "pbr_image_create: width and height must be at least 1");
    if (width > PBR_MAX_IMAGE_SIZE || height > PBR_MAX_IMAGE_SIZE)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_image_create: %u x %u pixels, the limit is %d",
                       (unsigned)width, (unsigned)height, PBR_MAX_IMAGE_SIZE);
    size_t pixels = (size_t)width * height;
    float *rgba = pbr_allocate(instance, pixels, 4 * sizeof *rgba), *depth = NULL;
    if (!rgba) return PBR_ERROR_OUT_OF_MEMORY;
    if (has_depth) {
        depth = pbr_allocate(instance, pixels, sizeof *depth);
        if (!depth) {
            pbr_free(instance, rgba);
            return PBR_ERROR_OUT_OF_MEMORY;
        }
        for (size_t i = 0; i < pixels; i++) depth[i] = HUGE_VALF;
    }
    image->width = width;
    image->height = height;
    image->rgba = rgba;
    image->depth = depth;
    return PBR_OK;
}

void pbr_image_destroy(pbr_instance *instance, pbr_image *image) {
    if (!instance || !image) return;
    pbr_free(instance, image->rgba);
    pbr_free(instance, image->depth);
    image->rgba = image->depth = NULL;
    image->width = image->height = 0;
}

pbr_result picture_check_size(pbr_instance *instance, const char *name, uint64_t width, uint64_t height) {
    const uint64_t most_pixels = (UINT64_C(4) << 30) / (4 * sizeof(float));
    if (width == 0 || height == 0) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the picture has no pixels", name);
    if (width <= PBR_MAX_IMAGE_SIZE && height <= PBR_MAX_IMAGE_SIZE && width * height <= most_pixels) return PBR_OK;
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu x %llu pixels; the limits are %d a side and %llu in all",
                   name, (unsigned long long)width, (unsigned long long)height, PBR_MAX_IMAGE_SIZE,
                   (unsigned long long)most_pixels);
}

static bool ends_with(const char *path, const char *ending) {
    size_t length = strlen(path), tail = strlen(ending);
    if (length < tail) return false;
    for (const char *p = path + length - tail; *p; p++, ending++)
        if (*p != *ending && !(*p >= 'A' && *p <= 'Z' && *p - 'A' + 'a' == *ending)) return false;
    return true;
}

pbr_result pbr_image_write(pbr_instance *instance, const pbr_image *image, const char *path) {
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!image || !path || !known_size(image)) return invalid(instance, "pbr_image_write: image and path are required");
    if (!image->rgba || image->width == 0 || image->height == 0 || image->width > PBR_MAX_IMAGE_SIZE ||
        image->height > PBR_MAX_IMAGE_SIZE)
        return invalid(instance, "pbr_image_write: the image holds no pixels, or too many");
    bool png = ends_with(path, ".png");
    if (!png && !ends_with(path, ".exr"))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: the name must end in .png or .exr", path);
    struct output output;
    pbr_result result = output_open(instance, path, &output);
    if (result != PBR_OK) return result;
    result = png ? picture_write_png(instance, path, image, &output) : picture_write_exr(instance, path, image, &output);
    bool failed_to_write = output.error != 0;
    pbr_result closed = output_close(&output, result == PBR_OK);
    return failed_to_write || result == PBR_OK ? closed : result;
}

pbr_result pbr_image_read(pbr_instance *instance, const char *path, pbr_image *image) {
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!path || !image || !known_size(image) || image->rgba || image->depth)
        return invalid(instance, "pbr_image_read: a path, and an image set up by PBR_IMAGE_INIT without pixels, are required");
    struct source source;
    pbr_result result = source_open(instance, path, true, &source);
    if (result != PBR_OK) return result;
    if (png_recognise(&source)) result = picture_read_png(instance, path, &source, image);
    else if (exr_recognise(&source)) result = picture_read_exr(instance, path, &source, image);
    else result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: byte 0: neither a PNG nor an OpenEXR picture", path);
    source_close(&source);
    if (result != PBR_OK) pbr_image_destroy(instance, image);
    return result;
}
