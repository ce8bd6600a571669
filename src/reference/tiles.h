/* The picture in squares, each drawn with the elements that may touch it. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_TILES_H
#define PBR_REFERENCE_TILES_H

#include <pbr/support.h>

enum { TILE_SIDE = 32 };

/* Pixels: box[0] <= x < box[2], box[1] <= y < box[3]. Any thread calls, for several tiles or runs of elements at once. */
struct tiling {
    pbr_instance *instance;
    int32_t width, height;
    uint64_t count; /* elements, at most SIZE_MAX / 2 */
    pbr_progress_fn progress;
    void *progress_user;
    /* Writes boxes of the elements [first, first + count), empty ones for what touches nothing; all within the picture. */
    pbr_result (*find_boxes)(void *user, uint64_t first, size_t count, int32_t (*boxes)[4]);
    /* Draws a tile with its elements, in rising order. */
    pbr_result (*draw)(void *user, const int32_t box[4], const uint64_t *elements, size_t count);
    void *user;
};

pbr_result tiles_draw(const struct tiling *tiling);

#endif
