/* Pictures on meshes, by libpng's simple interface. Its own linear form takes sRGB for a power of 2.2, which is far off where it is
 * dark: so its sRGB form and a table. SPDX-License-Identifier: MIT */
#include "texture.h"

#include <png.h>
#include <stdio.h>

#include "beside.h"
#include "core/colour.h"
#include "texture_jpeg.h"

enum { MOST_BYTES = 1 << 29 };

/* The compression packs so much to 1 at most, and a texel takes a bit at least: a file too short for its texels is refused before
 * they are allocated. Deflate: 1032. JPEG of one code for each block of 64: less. */
static uint64_t most_texels(const struct source *source, uint64_t texels_left) {
    uint64_t most = (uint64_t)source->size * 1032 * 8;
    if (most > TEXTURE_MOST_TEXELS_EACH) most = TEXTURE_MOST_TEXELS_EACH;
    return most < texels_left ? most : texels_left;
}

/* Fills `why` if it cannot be read. */
static pbr_result read_png(struct reader *reader, const struct source *source, uint64_t most, struct texture *out,
                           char why[TEXTURE_REASON]) {
    png_image image = {.version = PNG_IMAGE_VERSION, .format = PNG_FORMAT_RGBA};
    pbr_result result = PBR_OK;
    if (!png_image_begin_read_from_memory(&image, source->data, source->size)) goto cleanup;
    if ((uint64_t)image.width * image.height > most) {
        snprintf(why, TEXTURE_REASON, "it has too many texels, or too few bytes for them");
        goto cleanup;
    }
    image.format = PNG_FORMAT_RGBA;
    out->width = image.width;
    out->height = image.height;
    out->texels = pbr_allocate(reader->instance, (size_t)image.width * image.height, 4);
    if (!out->texels) result = PBR_ERROR_OUT_OF_MEMORY;
    else if (!png_image_finish_read(&image, NULL, out->texels, 0, NULL)) texture_free(reader->instance, out);
cleanup:
    if (!out->texels && !why[0]) snprintf(why, TEXTURE_REASON, "%s", image.message);
    png_image_free(&image);
    return result;
}

pbr_result texture_read(struct reader *reader, const char *name, size_t length, uint64_t *texels_left, struct texture *out) {
    struct source source;
    char why[TEXTURE_REASON] = "";
    *out = (struct texture){0};
    pbr_result result = beside_read(reader, name, length, MOST_BYTES, &source);
    if (result != PBR_OK || !source.data) return result;
    uint64_t most = most_texels(&source, *texels_left);
    if (source.size >= 8 && png_sig_cmp(source.data, 0, 8) == 0) result = read_png(reader, &source, most, out, why);
    else if (jpeg_recognise(&source)) result = jpeg_read(reader, &source, most, out, why);
    else snprintf(why, sizeof why, "neither PNG nor JPEG");
    if (result == PBR_OK && why[0])
        reader_warn(reader, 1, "texture '%s' %s: %s", reader_excerpt(name, name + length).text,
                    out->texels ? "damaged" : "left out", why);
    *texels_left -= (uint64_t)out->width * out->height;
    for (int i = 0; i < 256; i++) out->linear[i] = linear_from_srgb((float)i / 255);
    source_close(&source);
    return result;
}

void texture_free(pbr_instance *instance, struct texture *texture) {
    pbr_free(instance, texture->texels);
    *texture = (struct texture){0};
}
