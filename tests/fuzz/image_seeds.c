/* Writes small pictures of every kind that pbr_image_read knows into FOLDER/png and FOLDER/exr: what the fuzzer starts from.
 * SPDX-License-Identifier: MIT */
#include <openexr.h>
#include <png.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 5, HEIGHT = 3 };

static void require(bool condition, const char *what) {
    if (condition) return;
    fprintf(stderr, "image_seeds: cannot write %s\n", what);
    exit(1);
}

static void write_png(const char *path, int type, int depth, int interlace) {
    unsigned char row[WIDTH * 8];
    png_color palette[2] = {{255, 0, 0}, {0, 0, 255}};
    png_byte opacity[2] = {128, 255};
    FILE *file = fopen(path, "wb");
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    require(file && info, path);
    if (setjmp(png_jmpbuf(png))) require(false, path);
    png_init_io(png, file);
    png_set_IHDR(png, info, WIDTH, HEIGHT, depth, type, interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (type == PNG_COLOR_TYPE_PALETTE) {
        png_set_PLTE(png, info, palette, 2);
        png_set_tRNS(png, info, opacity, 2, NULL);
    }
    if (interlace) png_set_gAMA(png, info, 0.5);
    else png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
    png_write_info(png, info);
    int passes = png_set_interlace_handling(png);
    for (int y = 0; y < passes * HEIGHT; y++) {
        for (size_t i = 0; i < sizeof row; i++) row[i] = type == PNG_COLOR_TYPE_PALETTE ? 0 : (unsigned char)(16 * y + (int)i);
        png_write_row(png, row);
    }
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    require(fclose(file) == 0, path);
}

static void write_pngs(const char *folder) {
    static const int KINDS[][2] = {{0, 1}, {0, 2}, {0, 4}, {0, 8}, {0, 16}, {2, 8}, {2, 16}, {3, 1},
                                   {3, 2}, {3, 4}, {3, 8}, {4, 8}, {4, 16}, {6, 8}, {6, 16}}; /* all that there are */
    char path[4096];
    for (size_t i = 0; i < sizeof KINDS / sizeof KINDS[0]; i++)
        for (int interlace = 0; interlace < 2; interlace++) {
            snprintf(path, sizeof path, "%s/png/%d_%d_%d.png", folder, KINDS[i][0], KINDS[i][1], interlace);
            write_png(path, KINDS[i][0], KINDS[i][1], interlace ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE);
        }
}

/* Encodes one line or tile of zeros and ones. */
static exr_result_t write_chunk(exr_context_t context, const exr_chunk_info_t *chunk, exr_encode_pipeline_t *pipeline, bool first) {
    float values[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++) values[i] = (float)(i % 3) * 0.5f;
    exr_result_t code =
        first ? exr_encoding_initialize(context, 0, chunk, pipeline) : exr_encoding_update(context, 0, chunk, pipeline);
    for (int c = 0; code == EXR_ERR_SUCCESS && c < pipeline->channel_count; c++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[c];
        bool whole = channel->data_type == EXR_PIXEL_UINT;
        channel->encode_from_ptr = (const uint8_t *)values;
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = whole ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
        channel->user_pixel_stride = sizeof(float);
        channel->user_line_stride = (int32_t)sizeof(float) * channel->width;
    }
    if (code == EXR_ERR_SUCCESS && first) code = exr_encoding_choose_default_routines(context, 0, pipeline);
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(context, 0, pipeline) : code;
}

static exr_result_t write_chunks(exr_context_t context, bool tiled) {
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    int32_t step_x = tiled ? 4 : WIDTH, step_y = 2;
    exr_result_t code = tiled ? EXR_ERR_SUCCESS : exr_get_scanlines_per_chunk(context, 0, &step_y);
    for (int y = 0; y < HEIGHT; y += step_y)
        for (int x = 0; x < WIDTH && code == EXR_ERR_SUCCESS; x += step_x) {
            exr_chunk_info_t chunk;
            code = tiled ? exr_write_tile_chunk_info(context, 0, x / step_x, y / step_y, 0, 0, &chunk)
                         : exr_write_scanline_chunk_info(context, 0, y, &chunk);
            if (code == EXR_ERR_SUCCESS) code = write_chunk(context, &chunk, &pipeline, x == 0 && y == 0);
        }
    exr_encoding_destroy(context, &pipeline);
    return code;
}

/* `channels`: one letter each, in the order of the alphabet. */
static void write_exr(const char *path, const char *channels, exr_pixel_type_t type, exr_compression_t compression, bool tiled) {
    exr_context_t context = NULL;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    int part = 0;
    exr_result_t code = exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code == EXR_ERR_SUCCESS) code = exr_add_part(context, NULL, tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS) code = exr_initialize_required_attr_simple(context, part, WIDTH, HEIGHT, compression);
    if (code == EXR_ERR_SUCCESS && tiled)
        code = exr_set_tile_descriptor(context, part, 4, 2, EXR_TILE_ONE_LEVEL, EXR_TILE_ROUND_DOWN);
    for (const char *c = channels; *c && code == EXR_ERR_SUCCESS; c++) {
        const char name[2] = {*c, 0};
        code = exr_add_channel(context, part, name, type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    if (code == EXR_ERR_SUCCESS) code = exr_write_header(context);
    if (code == EXR_ERR_SUCCESS) code = write_chunks(context, tiled);
    require(code == EXR_ERR_SUCCESS && exr_finish(&context) == EXR_ERR_SUCCESS, path);
}

static void write_exrs(const char *folder) {
    static const exr_compression_t CODECS[] = {EXR_COMPRESSION_NONE, EXR_COMPRESSION_RLE, EXR_COMPRESSION_ZIPS,
                                               EXR_COMPRESSION_ZIP,  EXR_COMPRESSION_PIZ, EXR_COMPRESSION_PXR24,
                                               EXR_COMPRESSION_B44};
    char path[4096];
    for (size_t i = 0; i < sizeof CODECS / sizeof CODECS[0]; i++) {
        snprintf(path, sizeof path, "%s/exr/colour_%d.exr", folder, (int)CODECS[i]);
        write_exr(path, "ABGRZ", i % 2 ? EXR_PIXEL_FLOAT : EXR_PIXEL_HALF, CODECS[i], false);
        snprintf(path, sizeof path, "%s/exr/tiles_%d.exr", folder, (int)CODECS[i]);
        write_exr(path, "AY", i % 2 ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT, CODECS[i], true);
    }
    snprintf(path, sizeof path, "%s/exr/integers.exr", folder);
    write_exr(path, "BGR", EXR_PIXEL_UINT, EXR_COMPRESSION_ZIP, false);
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: image_seeds FOLDER\n");
        return 2;
    }
    write_pngs(argv[1]);
    write_exrs(argv[1]);
    return 0;
}
