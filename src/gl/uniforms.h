/* The uniforms of programs: what shaders know of a frame, of an item under a transform, and of what is drawn of it.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_GL_UNIFORMS_H
#define PBR_GL_UNIFORMS_H

#include "placement.h"
#include "renderer.h"

/* The frame's lights and a material, for a program that lights. */
void uniforms_set_lights(const pbr_renderer *renderer, struct program *program, const struct frame_setup *setup,
                         const pbr_material *material);
void uniforms_set_eye(const struct gl *gl, const struct program *program, const struct frame_setup *setup);

/* Makes the program current and sets all but what depends on where records lie. */
void uniforms_use(pbr_renderer *renderer, struct program *program, const struct placement *placement);

/* The camera relative to where records lie: subtracted in double, so that the shaders' floats stay small. */
void uniforms_set_origin(const struct gl *gl, const struct program *program, const struct placement *placement,
                         const double origin[3]);

/* How large splats are: at most so many pixels in diameter. */
void uniforms_limit_radius(const struct gl *gl, const struct program *program, const struct placement *placement, double most);

/* Which entries are of the cut. */
void uniforms_set_cut(const struct gl *gl, const struct program *program, const struct placement *placement);

/* Of chunks of a sequential point tree, at most PAGE_CHUNKS, in the order in which a call draws them. */
void uniforms_set_chunks(const struct gl *gl, const struct program *program, const struct placement *placement,
                         const struct spt *spt, const struct draw_range *ranges, size_t count);

/* Likewise for the program that selects entries. */
void uniforms_set_selection(const struct gl *gl, const struct program *program, const struct placement *placement,
                            const struct spt *spt, const struct draw_range *ranges, size_t count);

#endif
