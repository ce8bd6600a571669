/* Drawing the splats of prepared items in one pass: cut, uniforms, draw calls. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_DRAW_H
#define PBR_GL_DRAW_H

#include "frame.h"
#include "item.h"
#include "placement.h"
#include "renderer.h"

/* Makes what drawing through quads needs. Leaves the vertex array binding changed. */
void draw_prepare(pbr_renderer *renderer);

/* Draws the view's first `count` items, those of the group that have the pass, to the bound framebuffer. PASS_SELECT draws nothing.
 */
pbr_result draw_items(pbr_view *view, const struct frame_setup *setup, size_t count, enum pass pass, uint32_t group,
                      pbr_stats *stats);

/* For points: binds the drawable's vertex array, with the streams that the item asks for. */
void draw_bind_points(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable);

/* For quads: the instances are records from `first` on, since there are no base instances before OpenGL 4.2. */
void draw_bind_quads(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable,
                     uint32_t first);

/* Counts a call. */
void draw_count(pbr_stats *stats, enum pass pass, bool quads, uint64_t splats);

#endif
