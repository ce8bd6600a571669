/* PNG by libpng. Its errors leave by longjmp, so everything a function must free or return lives in a structure outside of it.
 * SPDX-License-Identifier: MIT */
#include <png.h>
#include <setjmp.h>
#include <string.h>

#include "core/colour.h"
#include "picture.h"

struct codec {
    pbr_instance *instance;
    const char *name;
    pbr_result result; /* of the first error */
    const struct source *source;
    struct output *output;
    size_t position;
    png_structp png;
    png_infop info;
    png_bytep pixels;
    png_bytepp rows;
    float *table; /* linear value of each 8 or 16-bit code */
};

static void on_error(png_structp png, png_const_charp text) {
    struct codec *codec = png_get_error_ptr(png);
    if (codec->result == PBR_OK) codec->result = PBR_ERROR_FORMAT;
    if (codec->result != PBR_ERROR_IO) /* which output_close explains */
        pbr_log(codec->instance, PBR_LOG_ERROR, codec->result, "%s: byte %zu: %s", codec->name, codec->position, text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text) {
    struct codec *codec = png_get_error_ptr(png);
    pbr_log(codec->instance, PBR_LOG_WARNING, PBR_OK, "%s: %s", codec->name, text);
}

static png_voidp on_allocate(png_structp png, png_alloc_size_t size) {
    struct codec *codec = png_get_mem_ptr(png);
    void *memory = pbr_allocate(codec->instance, size, 1);
    if (!memory && codec->result == PBR_OK) codec->result = PBR_ERROR_OUT_OF_MEMORY;
    return memory;
}

static void on_free(png_structp png, png_voidp memory) {
    struct codec *codec = png_get_mem_ptr(png);
    pbr_free(codec->instance, memory);
}

static void on_read(png_structp png, png_bytep to, size_t size) {
    struct codec *codec = png_get_io_ptr(png);
    if (size > codec->source->size - codec->position) png_error(png, "the file ends too early");
    memcpy(to, codec->source->data + codec->position, size);
    codec->position += size;
}

static void on_write(png_structp png, png_bytep from, size_t size) {
    struct codec *codec = png_get_io_ptr(png);
    if (!output_write(codec->output, from, size, codec->position)) {
        codec->result = PBR_ERROR_IO;
        png_error(png, "cannot write");
    }
    codec->position += size;
}

static void on_flush(png_structp png) {
    (void)png;
}

static void free_codec(struct codec *codec) {
    pbr_free(codec->instance, codec->pixels);
    pbr_free(codec->instance, codec->rows);
    pbr_free(codec->instance, codec->table);
}

/* ---- reading ---- */

bool png_recognise(const struct source *source) {
    return source->size >= 8 && png_sig_cmp(source->data, 0, 8) == 0;
}

/* Deflate packs at most 1032 to 1: a file too small for its pixels is refused before they are allocated. */
static pbr_result check_size(struct codec *codec) {
    uint64_t width = png_get_image_width(codec->png, codec->info), height = png_get_image_height(codec->png, codec->info);
    pbr_result result = picture_check_size(codec->instance, codec->name, width, height);
    if (result != PBR_OK) return result;
    uint64_t bits = (uint64_t)png_get_bit_depth(codec->png, codec->info) * png_get_channels(codec->png, codec->info);
    if (width * height / 8 * bits <= (uint64_t)codec->source->size * 1032) return PBR_OK;
    return pbr_log(codec->instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: byte %zu: the file is too short for %llu x %llu pixels",
                   codec->name, codec->source->size, (unsigned long long)width, (unsigned long long)height);
}

/* Every kind of PNG becomes RGBA of 8 or 16 bits. */
static void set_transformations(struct codec *codec) {
    png_set_expand(codec->png);
    png_set_gray_to_rgb(codec->png);
    png_set_add_alpha(codec->png, 0xffff, PNG_FILLER_AFTER);
    png_set_interlace_handling(codec->png);
    png_read_update_info(codec->png, codec->info);
}

static pbr_result make_table(struct codec *codec, unsigned entries) {
    double gamma = 0;
    bool powers = !png_get_valid(codec->png, codec->info, PNG_INFO_sRGB) && png_get_gAMA(codec->png, codec->info, &gamma) &&
                  gamma > 0.01 && gamma < 100;
    codec->table = pbr_allocate(codec->instance, entries, sizeof *codec->table);
    if (!codec->table) return PBR_ERROR_OUT_OF_MEMORY;
    for (unsigned i = 0; i < entries; i++) {
        float code = (float)i / (float)(entries - 1);
        codec->table[i] = powers ? powf(code, (float)(1 / gamma)) : linear_from_srgb(code);
    }
    return PBR_OK;
}

static void premultiply(const struct codec *codec, bool wide, pbr_image *image) {
    size_t numbers = (size_t)image->width * image->height * 4;
    for (size_t i = 0; i < numbers; i += 4) {
        unsigned code[4];
        for (size_t k = 0; k < 4; k++)
            code[k] = wide ? (unsigned)codec->pixels[2 * (i + k)] << 8 | codec->pixels[2 * (i + k) + 1] : codec->pixels[i + k];
        float alpha = (float)code[3] / (wide ? 65535 : 255);
        for (size_t k = 0; k < 3; k++) image->rgba[i + k] = codec->table[code[k]] * alpha;
        image->rgba[i + 3] = alpha;
    }
}

/* Returns PBR_OK or an error that is logged, or leaves by longjmp with codec->result set. */
static pbr_result read_picture(struct codec *codec, pbr_image *image) {
    png_set_read_fn(codec->png, codec, on_read);
    png_set_user_limits(codec->png, PBR_MAX_IMAGE_SIZE, PBR_MAX_IMAGE_SIZE);
    png_read_info(codec->png, codec->info);
    pbr_result result = check_size(codec);
    if (result != PBR_OK) return result;
    set_transformations(codec);
    uint32_t width = png_get_image_width(codec->png, codec->info), height = png_get_image_height(codec->png, codec->info);
    bool wide = png_get_bit_depth(codec->png, codec->info) == 16;
    size_t row = png_get_rowbytes(codec->png, codec->info);
    codec->pixels = pbr_allocate(codec->instance, height, row);
    codec->rows = pbr_allocate(codec->instance, height, sizeof *codec->rows);
    if (!codec->pixels || !codec->rows) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint32_t y = 0; y < height; y++) codec->rows[y] = codec->pixels + y * row;
    png_read_image(codec->png, codec->rows);
    png_read_end(codec->png, NULL);
    result = make_table(codec, wide ? 65536 : 256);
    if (result == PBR_OK) result = pbr_image_create(codec->instance, width, height, 0, image);
    if (result == PBR_OK) premultiply(codec, wide, image);
    return result;
}

static void read_guarded(struct codec *codec, pbr_image *image) {
    if (setjmp(png_jmpbuf(codec->png)) == 0) codec->result = read_picture(codec, image);
}

pbr_result picture_read_png(pbr_instance *instance, const char *name, const struct source *source, pbr_image *image) {
    struct codec codec = {.instance = instance, .name = name, .source = source};
    codec.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &codec, on_error, on_warning, &codec, on_allocate, on_free);
    if (codec.png) codec.info = png_create_info_struct(codec.png);
    if (codec.info) read_guarded(&codec, image);
    else codec.result = PBR_ERROR_OUT_OF_MEMORY;
    png_destroy_read_struct(&codec.png, &codec.info, NULL);
    free_codec(&codec);
    return codec.result;
}

/* ---- writing ---- */

static void encode_row(const pbr_image *image, uint32_t y, png_bytep out) {
    const float *in = image->rgba + (size_t)y * image->width * 4;
    for (uint32_t x = 0; x < image->width; x++, in += 4, out += 4) {
        float alpha = in[3] > 0 ? fminf(in[3], 1) : 0; /* NaN: 0 */
        for (int k = 0; k < 3; k++) out[k] = alpha > 0 ? unorm8(srgb_from_linear(fmaxf(in[k] / alpha, 0))) : 0;
        out[3] = unorm8(alpha);
    }
}

static void write_picture(struct codec *codec, const pbr_image *image) {
    png_set_write_fn(codec->png, codec, on_write, on_flush);
    png_set_user_limits(codec->png, PBR_MAX_IMAGE_SIZE, PBR_MAX_IMAGE_SIZE);
    png_set_IHDR(codec->png, codec->info, image->width, image->height, 8, PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_BASE, PNG_FILTER_TYPE_BASE);
    png_set_sRGB(codec->png, codec->info, PNG_sRGB_INTENT_RELATIVE);
    png_write_info(codec->png, codec->info);
    for (uint32_t y = 0; y < image->height; y++) {
        encode_row(image, y, codec->pixels);
        png_write_row(codec->png, codec->pixels);
    }
    png_write_end(codec->png, codec->info);
}

static void write_guarded(struct codec *codec, const pbr_image *image) {
    if (setjmp(png_jmpbuf(codec->png)) == 0) write_picture(codec, image);
}

pbr_result picture_write_png(pbr_instance *instance, const char *name, const pbr_image *image, struct output *output) {
    struct codec codec = {.instance = instance, .name = name, .output = output};
    codec.pixels = pbr_allocate(instance, image->width, 4);
    if (!codec.pixels) return PBR_ERROR_OUT_OF_MEMORY;
    codec.png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, &codec, on_error, on_warning, &codec, on_allocate, on_free);
    if (codec.png) codec.info = png_create_info_struct(codec.png);
    if (codec.info) write_guarded(&codec, image);
    else codec.result = PBR_ERROR_OUT_OF_MEMORY;
    png_destroy_write_struct(&codec.png, &codec.info);
    free_codec(&codec);
    return codec.result;
}
