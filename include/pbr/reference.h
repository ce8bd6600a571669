/* SPDX-License-Identifier: MIT */
/** @file reference.h
 * libpbr-io: pictures by which others are judged, made on the CPU in double precision, without OpenGL. #pbr_reference_render draws
 * splats by the definitions of docs/splats.md, pixel by pixel; #pbr_ground_truth draws the triangles that splats stand for.
 */
#ifndef PBR_REFERENCE_H
#define PBR_REFERENCE_H

#include <pbr/image.h>
#include <pbr/mesh.h>
#include <pbr/render.h>

PBR_BEGIN_DECLS

/** Samples of a pixel of #pbr_ground_truth, along each side, at most. */
#define PBR_MAX_SAMPLES 16

/** How to draw. The number of threads is the instance's. */
typedef struct pbr_reference_desc {
    size_t struct_size;
    uint32_t flags;           /**< Must be 0. */
    uint32_t reserved;        /**< Must be 0. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user;      /**< First argument of `progress`. */
} pbr_reference_desc;

#define PBR_REFERENCE_DESC_INIT PBR_SIZED(pbr_reference_desc)

/**
 * Draws what #pbr_render would draw into an empty target, over transparent black. The picture is the same with any number of threads.
 * @param instance    Lends memory and threads; the points may be another's.
 * @param frame       Its viewport has an area: the picture's size. The scissor box counts from the same origin as the viewport. Of target,
 *                    encoding, depth function, threshold and the flags against depth only validity is checked.
 * @param items       As #pbr_render takes them, but points alone; NULL with 0.
 * @param item_count  At most #PBR_MAX_ITEMS.
 * @param desc        NULL = defaults.
 * @param out         Must hold no pixels (#PBR_IMAGE_INIT); on error it holds none. Receives linear colour, alpha and depth. The caller
 *                    destroys it.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_LIMIT, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_reference_render(pbr_instance *instance, const pbr_frame *frame, const pbr_item *items, size_t item_count,
                                        const pbr_reference_desc *desc, pbr_image *out);

/**
 * Draws triangles instead of splats: the samples of a regular grid over each pixel see the nearest triangle, and are averaged. Both
 * sides are lit, sample by sample with the normal interpolated over the triangle, unless an item's shading is #PBR_SHADE_NONE.
 * Colours are interpolated in linear light. Alpha is the share of the samples that see a triangle; depth is the nearest sample's.
 * @param instance  Lends memory and threads; the meshes may be another's.
 * @param frame     As #pbr_reference_render takes it.
 * @param items     Transforms, shading, colour, material, flags and clip planes (by sample) are taken; what concerns splats is not.
 *                  A colour source of #PBR_COLOUR_SCALAR is not supported.
 * @param meshes    One for each item, whose `points` and `lod` are ignored. NULL with 0.
 * @param count     Of items and of meshes, at most #PBR_MAX_ITEMS.
 * @param samples   Along each side of a pixel, 1 to #PBR_MAX_SAMPLES.
 * @param desc      NULL = defaults.
 * @param out       As #pbr_reference_render gives it.
 * @return As #pbr_reference_render, and #PBR_ERROR_UNSUPPORTED. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_ground_truth(pbr_instance *instance, const pbr_frame *frame, const pbr_item *items,
                                    const pbr_mesh *const *meshes, size_t count, uint32_t samples, const pbr_reference_desc *desc,
                                    pbr_image *out);

PBR_END_DECLS
#endif
