/* Blended splats: visibility, accumulation, normalisation (docs/splats.md, "Layers"; Botsch & Kobbelt 2003) over targets of the
 * renderer's own. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_BLEND_H
#define PBR_GL_BLEND_H

#include <pbr/render.h>

#include "frame.h"
#include "renderer.h"

/* Sorts the blended ones of the view's first `count` items into groups, 1 and up, that are summed up together: those lit once a
 * splat, and those lit once a pixel that have the same material. Returns the number of groups. */
uint32_t blend_group(pbr_view *view, size_t count);

/* Compiles the resolve passes and makes targets that hold the frame's picture. Leaves draw framebuffer and texture bindings
 * changed. `frame_variant`: what the frame adds to programs. */
pbr_result blend_prepare(pbr_view *view, const struct frame_setup *setup, size_t count, uint32_t frame_variant, pbr_stats *stats);

/* Draws the groups into the framebuffer `target`, which is bound before and after. */
pbr_result blend_draw(pbr_view *view, const struct frame_setup *setup, GLuint target, size_t count, uint32_t groups,
                      pbr_stats *stats);

#endif
