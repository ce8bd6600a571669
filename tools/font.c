/* DejaVu Sans Mono, embedded at build time, rasterised by stb_truetype. SPDX-License-Identifier: MIT */
#include "font.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#include <stb_truetype.h>

extern const unsigned char font_file[];

/* One glyph after the other in rows from the top, a pixel of nothing between them. False if they do not fit above the last row. */
static bool pack(struct font *font, const stbtt_fontinfo *info, float scale) {
    int x = 1, y = 1, row = 0;
    const int side = (int)font->side;
    for (int i = 0; i < FONT_GLYPHS; i++) {
        struct font_glyph *glyph = &font->glyphs[i];
        int left, top, right, bottom;
        stbtt_GetCodepointBitmapBox(info, FONT_FIRST + i, scale, scale, &left, &top, &right, &bottom);
        const int width = right - left, height = bottom - top;
        if (x + width + 1 > side) {
            x = 1;
            y += row + 1;
            row = 0;
        }
        if (x + width + 1 > side || y + height + 2 > side) return false;
        stbtt_MakeCodepointBitmap(info, font->atlas + y * side + x, width, height, side, scale, scale, FONT_FIRST + i);
        *glyph = (struct font_glyph){(uint16_t)x,   (uint16_t)y, (uint16_t)(x + width), (uint16_t)(y + height),
                                     (int16_t)left, (int16_t)top};
        x += width + 1;
        row = height > row ? height : row;
    }
    memset(font->atlas + (side - 1) * side, 255, font->side);
    return true;
}

bool font_create(struct font *font, int advance) {
    enum { LEAST_SIDE = 128, MOST_SIDE = 16384 };
    stbtt_fontinfo info;
    int units, bearing, ascent, descent, gap;
    *font = (struct font){.advance = advance};
    if (!stbtt_InitFont(&info, font_file, stbtt_GetFontOffsetForIndex(font_file, 0))) return false;
    stbtt_GetCodepointHMetrics(&info, '0', &units, &bearing);
    stbtt_GetFontVMetrics(&info, &ascent, &descent, &gap);
    const float scale = (float)advance / (float)units;
    font->ascent = (int)lroundf((float)ascent * scale);
    font->line = (int)lroundf((float)(ascent - descent) * scale * 1.2f);
    for (font->side = LEAST_SIDE; font->side <= MOST_SIDE; font->side *= 2) {
        font->atlas = calloc(font->side, font->side);
        if (font->atlas && pack(font, &info, scale)) return true;
        font_destroy(font);
    }
    return false;
}

void font_destroy(struct font *font) {
    free(font->atlas);
    font->atlas = NULL;
}

const struct font_glyph *font_glyph(const struct font *font, uint32_t character) {
    const bool is_known = character >= FONT_FIRST && character < FONT_FIRST + FONT_GLYPHS && (character < 0x7f || character > 0x9f);
    return &font->glyphs[(is_known ? character : '?') - FONT_FIRST];
}
