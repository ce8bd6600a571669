/* SPDX-License-Identifier: MIT */
/** @file image.h
 * libpbr-io: pictures. PNG for people (8 or 16 bit, sRGB), OpenEXR for measuring (32-bit float, linear, with depth). The memory
 * is the instance's, but for what OpenEXR takes from malloc during a call.
 */
#ifndef PBR_IMAGE_H
#define PBR_IMAGE_H

#include <pbr/instance.h>

PBR_BEGIN_DECLS

/** Largest width or height of a picture. */
#define PBR_MAX_IMAGE_SIZE 65536

/** A picture: rows from top to bottom, no padding. Allocated with the instance's allocator by #pbr_image_create and the readers. */
typedef struct pbr_image {
    size_t struct_size;
    uint32_t width;  /**< Pixels. */
    uint32_t height; /**< Pixels. */
    float *rgba;  /**< width x height x 4: linear colour, premultiplied by alpha. */
    float *depth; /**< width x height, or NULL: distance along the view axis, infinity where nothing is. */
} pbr_image;

#define PBR_IMAGE_INIT PBR_SIZED(pbr_image)

/**
 * Allocates a picture of zeros (depth: infinity).
 * @param instance   Its allocator holds the pixels.
 * @param width      Pixels, 1 to #PBR_MAX_IMAGE_SIZE.
 * @param height     Likewise.
 * @param has_depth  Non-zero: with depth.
 * @param image      Must hold no pixels (#PBR_IMAGE_INIT); on error it holds none. The caller destroys it.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_LIMIT, #PBR_ERROR_OUT_OF_MEMORY. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_image_create(pbr_instance *instance, uint32_t width, uint32_t height, int has_depth, pbr_image *image);

/**
 * Frees the pixels and zeroes the structure (its `struct_size` stays).
 * @param instance  The one that the pixels were allocated with. NULL does nothing.
 * @param image     NULL and a picture without pixels are allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_image_destroy(pbr_instance *instance, pbr_image *image);

/**
 * Writes a picture, PNG or OpenEXR by the name's ending (.png, .exr). PNG: 8 bits a channel, sRGB, alpha unpremultiplied, the sRGB
 * chunk set. OpenEXR: channels R, G, B, A and, with depth, Z, all 32-bit float, ZIP compressed. The file appears under its name
 * only when it is complete; until then the old one stays.
 * @param instance  Receives messages, and lends memory during the call.
 * @param image     Is only read. Colours outside 0..1 are clamped in PNG, and kept in OpenEXR; PNG has no depth.
 * @param path      UTF-8.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_IO, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_UNSUPPORTED (another
 *         ending). Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_image_write(pbr_instance *instance, const pbr_image *image, const char *path);

/**
 * Reads a PNG (any type and depth; converted to linear by its sRGB, gAMA or no chunk as sRGB) or a single-part scan-line or
 * tiled OpenEXR file (channels R, G, B or Y, A, Z; half, float), by content.
 * @param instance  Its allocator holds the pixels.
 * @param path      UTF-8.
 * @param image     Must hold no pixels (#PBR_IMAGE_INIT); on error it holds none. The caller destroys it.
 * @return #PBR_OK, #PBR_ERROR_IO, #PBR_ERROR_FORMAT, #PBR_ERROR_UNSUPPORTED, #PBR_ERROR_LIMIT (a side above #PBR_MAX_IMAGE_SIZE,
 *         or pixels above 4 GiB), #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_INVALID_ARGUMENT.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_image_read(pbr_instance *instance, const char *path, pbr_image *image);

PBR_END_DECLS
#endif
