/* What is drawn into the window: a picture, and text and boxes over it. Places and sizes are in the framebuffer's pixels from the
 * upper left; layout goes by the font's character and line, which follow the screen's scale. SPDX-License-Identifier: MIT */
#ifndef OVERLAY_H
#define OVERLAY_H

#include <epoxy/gl.h>

#include "font.h"

/* sRGB and opacity, 0xRRGGBBAA. */
typedef uint32_t overlay_colour;

struct overlay_vertex {
    float place[2], texel[2]; /* pixels; atlas, 0..1 */
    uint8_t colour[4];
};

struct overlay {
    struct font font;
    GLuint picture_program, quad_program, buffer, atlas;
    GLuint vertex_arrays[2]; /* without attributes, for the picture; of quads */
    GLint size_location;
    uint32_t size[2]; /* of the framebuffer */
    struct overlay_vertex *vertices;
    size_t count, capacity;
};

/* NULL, or why not, in static storage; to be destroyed either way. */
const char *overlay_create(struct overlay *overlay, bool is_es);
void overlay_destroy(struct overlay *overlay);

/* `scale`: pixels to a logical pixel. False if memory is short. */
bool overlay_set_scale(struct overlay *overlay, float scale);

/* Starts a frame with nothing on it. */
void overlay_begin(struct overlay *overlay, const uint32_t size[2]);
void overlay_box(struct overlay *overlay, int x, int y, int width, int height, overlay_colour colour);
/* One line of UTF-8; (x, y) is its upper left. */
void overlay_text(struct overlay *overlay, int x, int y, overlay_colour colour, const char *text);
/* Draws into the window: first `picture`, an sRGB texture of the framebuffer's size with its first row at the bottom. */
void overlay_end(struct overlay *overlay, GLuint picture);

#endif
