/* Drawing the splats of prepared items in one pass: cut, uniforms, draw calls. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_DRAW_H
#define PBR_GL_DRAW_H

#include "frame.h"
#include "item.h"
#include "placement.h"
#include "renderer.h"

/* Makes what drawing through quads needs. Leaves the vertex array binding changed. */
void draw_prepare(pbr_renderer *renderer);

/* The view's draw list: chunks of a sequential point tree that the pass needs, whether they are there or not. */
pbr_result draw_list_sequence(pbr_view *view, const struct placement *placement, enum pass pass);

/* Draws the view's first `count` items, those of the group that have the pass, to the bound framebuffer. */
pbr_result draw_items(pbr_view *view, const struct frame_setup *setup, size_t count, enum pass pass, uint32_t group,
                      pbr_stats *stats);

#endif
