/* A font of one width drawn into an atlas of glyphs: ASCII and the Latin letters of Europe. No OpenGL. SPDX-License-Identifier: MIT
 */
#ifndef FONT_H
#define FONT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FONT_FIRST = 0x20, FONT_GLYPHS = 0x180 - FONT_FIRST }; /* characters */

struct font_glyph {
    uint16_t left, top, right, bottom; /* in the atlas */
    int16_t x, y;                      /* of its upper left corner, from the pen's place on the base line; y counts down */
};

struct font {
    uint32_t side;       /* of the atlas, which is square */
    uint8_t *atlas;      /* coverage; the last row is full */
    int advance, ascent; /* pixels: from one character to the next; from a line's top to its base line */
    int line;            /* from one line's top to the next one's */
    struct font_glyph glyphs[FONT_GLYPHS];
};

/* `advance`: the width of a character in pixels, 1..200. False if memory is short. */
bool font_create(struct font *font, int advance);
void font_destroy(struct font *font);

/* That of '?' for a character that the font lacks. */
const struct font_glyph *font_glyph(const struct font *font, uint32_t character);

#endif
