/* Pictures without OpenGL: by the reference renderer, or of the meshes themselves. SPDX-License-Identifier: MIT */
#ifndef REFERENCE_H
#define REFERENCE_H

#include <pbr/reference.h>

#include "scene.h"

/* Draws a scene with a bar over `background` (sRGB with straight alpha), its splats or, with `samples` above 0, its inputs' meshes.
 * False with a message. `image` is to be destroyed either way. */
bool reference_draw(struct session *session, const struct scene *scene, const pbr_frame *frame, uint32_t samples,
                    const float background[4], pbr_image *image);

#endif
