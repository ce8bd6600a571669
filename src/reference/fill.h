/* docs/splats.md: filling holes, over the whole picture. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_FILL_H
#define PBR_REFERENCE_FILL_H

#include "layers.h"

/* A pixel of the layer that is filled. */
struct fill_pixel {
    bool is_seen;
    double extent[2]; /* distances: of the front, and of the front moved back */
    double radius;    /* of the front's splat, pixels */
    double sum[3];    /* of the samples' colours */
    double samples;
};

struct fill {
    struct fill_pixel *pixels; /* in the order of the image's; NULL: no item is filled */
};

pbr_result fill_open(const struct scene *scene, struct fill *fill);
void fill_close(const struct scene *scene, struct fill *fill);

/* Takes what the resolved pixel (x, y), `at` in the image, has of the layer: its mark, and of the splats those that bring it their
 * colour, in their order. Any thread. */
void fill_add(struct fill *fill, size_t at, int32_t x, int32_t y, const struct pixel *pixel, const struct surfel *const *surfels,
              size_t count);

/* Once all is added: colours the pixels in which the layer is seen, but those that keep their splat's own. */
pbr_result fill_resolve(const struct scene *scene, const struct fill *fill, pbr_image *image);

#endif
