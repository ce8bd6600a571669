/* What of a sequential point tree a view is handed, and what of that the vertex stage keeps: by the test that shaders are held to,
 * without OpenGL. SPDX-License-Identifier: MIT */
#ifndef KEPT_H
#define KEPT_H

#include <pbr/lod.h>
#include <stdbool.h>

#include "camera.h"

struct kept {
    uint32_t chunks; /* in view */
    uint64_t handed, kept;
    uint64_t
        twice; /* of those kept: only since depths may differ between a node and its parent; what they stand for is drawn, too */
    uint64_t missed; /* would be kept, but are not handed over: 0 */
};

/* `model`: object to world. False if memory is short. */
bool kept_count(pbr_instance *instance, const pbr_lod *tree, const struct camera *camera, const double model[16],
                const uint32_t size[2], double threshold, struct kept *out);

#endif
