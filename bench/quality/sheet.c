/* Copying, differences and letters. SPDX-License-Identifier: MIT */
#include "sheet.h"

#include <math.h>
#include <stdio.h>

#include "srgb.h"

#ifdef QUALITY_HAS_FONT
#include "font.h"
#endif

bool sheet_create(struct session *session, uint32_t columns, uint32_t rows, const uint32_t cell[2], struct sheet *sheet) {
    const unsigned errors = atomic_load(&session->errors);
    *sheet = (struct sheet){PBR_IMAGE_INIT, {cell[0], cell[1]}};
    const pbr_result result = pbr_image_create(session->instance, columns * cell[0], rows * cell[1], 0, &sheet->image);
    if (!session_check(session, result, errors, "sheet")) return false;
    for (size_t i = 0; i < (size_t)sheet->image.width * sheet->image.height; i++) sheet->image.rgba[4 * i + 3] = 1;
    return true;
}

static float *pixel_of(const struct sheet *sheet, uint32_t column, uint32_t row, uint32_t x, uint32_t y) {
    return sheet->image.rgba + 4 * ((size_t)(row * sheet->cell[1] + y) * sheet->image.width + column * sheet->cell[0] + x);
}

#ifdef QUALITY_HAS_FONT
/* White on black in the cell's upper left corner. */
static void put_label(struct sheet *sheet, uint32_t column, uint32_t row, const char *label) {
    struct font font;
    const uint32_t limits[2] = {sheet->cell[0], sheet->cell[1]};
    int pen = 4;
    if (!font_create(&font, 8)) return;
    for (const char *c = label; *c; c++, pen += font.advance) {
        const struct font_glyph *glyph = font_glyph(&font, (unsigned char)*c);
        for (int y = 0; y < font.line; y++)
            for (int x = 0; x < font.advance; x++) {
                const int left = glyph->left + x - glyph->x, top = glyph->top + y - font.ascent - glyph->y;
                const bool is_inside = left >= glyph->left && left < glyph->right && top >= glyph->top && top < glyph->bottom;
                const float ink = is_inside ? (float)font.atlas[top * (int)font.side + left] / 255 : 0;
                if ((uint32_t)(pen + x) >= limits[0] || (uint32_t)y >= limits[1]) continue;
                float *pixel = pixel_of(sheet, column, row, (uint32_t)(pen + x), (uint32_t)y);
                for (int k = 0; k < 3; k++) pixel[k] = linear_from_srgb(ink);
            }
    }
    font_destroy(&font);
}
#else
static void put_label(struct sheet *sheet, uint32_t column, uint32_t row, const char *label) {
    (void)sheet, (void)column, (void)row, (void)label;
}
#endif

static const float *source_pixel(const pbr_image *picture, uint32_t x, uint32_t y) {
    return x < picture->width && y < picture->height ? picture->rgba + 4 * ((size_t)y * picture->width + x) : NULL;
}

void sheet_place(struct sheet *sheet, uint32_t column, uint32_t row, const char *label, const pbr_image *picture,
                 const uint32_t corner[2], uint32_t zoom) {
    for (uint32_t y = 0; y < sheet->cell[1]; y++)
        for (uint32_t x = 0; x < sheet->cell[0]; x++) {
            const float *from = source_pixel(picture, corner[0] + x / zoom, corner[1] + y / zoom);
            float *to = pixel_of(sheet, column, row, x, y);
            for (int k = 0; k < 3; k++) to[k] = from ? from[k] : 0;
            to[3] = 1;
        }
    put_label(sheet, column, row, label);
}

void sheet_place_difference(struct sheet *sheet, uint32_t column, uint32_t row, const char *label, const pbr_image *picture,
                            const pbr_image *truth, const uint32_t corner[2]) {
    const float magnified = 4;
    for (uint32_t y = 0; y < sheet->cell[1]; y++)
        for (uint32_t x = 0; x < sheet->cell[0]; x++) {
            const float *a = source_pixel(picture, corner[0] + x, corner[1] + y);
            const float *b = source_pixel(truth, corner[0] + x, corner[1] + y);
            float *to = pixel_of(sheet, column, row, x, y);
            for (int k = 0; a && b && k < 3; k++)
                to[k] = linear_from_srgb(fminf(magnified * fabsf(srgb_from_linear(a[k]) - srgb_from_linear(b[k])), 1));
            to[3] = 1;
        }
    put_label(sheet, column, row, label);
}

bool sheet_write(struct session *session, struct sheet *sheet, const char *folder, const char *name) {
    char path[1024];
    const unsigned errors = atomic_load(&session->errors);
    bool done = true;
    if (folder) {
        snprintf(path, sizeof path, "%s/%s", folder, name);
        done = session_check(session, pbr_image_write(session->instance, &sheet->image, path), errors, path);
    }
    pbr_image_destroy(session->instance, &sheet->image);
    return done;
}
