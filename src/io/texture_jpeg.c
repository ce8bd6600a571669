/* JPEG textures by libjpeg, where libpbr-io is built with it. Its errors leave by longjmp, so all that a function must free or
 * return lies in a structure outside of it. SPDX-License-Identifier: MIT */
#include "texture_jpeg.h"

#include <stdio.h>
#include <string.h>

bool jpeg_recognise(const struct source *source) {
    return source->size >= 3 && memcmp(source->data, "\377\330\377", 3) == 0;
}

#ifdef PBR_HAS_JPEG
#include <jpeglib.h>
#include <setjmp.h>

/* Of a progressive picture. Each costs time for all texels, however few bytes it has; encoders write some ten. */
enum { MOST_SCANS = 64 };

struct codec {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf back;
    pbr_instance *instance;
    const struct source *source;
    uint64_t most_texels;
    struct texture *out;
    char *reason;
    pbr_result result;
};

static void note(j_common_ptr jpeg) {
    struct codec *codec = jpeg->client_data;
    char text[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, text);
    snprintf(codec->reason, TEXTURE_REASON, "%.*s", TEXTURE_REASON - 1, text);
}

static void on_error(j_common_ptr jpeg) {
    struct codec *codec = jpeg->client_data;
    note(jpeg);
    longjmp(codec->back, 1);
}

/* Warnings are of level -1; the first one is told. */
static void on_message(j_common_ptr jpeg, int level) {
    if (level < 0 && jpeg->err->num_warnings++ == 0) note(jpeg);
}

static void give_up(struct codec *codec, const char *why) {
    snprintf(codec->reason, TEXTURE_REASON, "%s", why);
    longjmp(codec->back, 1);
}

static void on_progress(j_common_ptr jpeg) {
    struct codec *codec = jpeg->client_data;
    if (codec->jpeg.input_scan_number > MOST_SCANS) give_up(codec, "it has too many scans");
}

/* Red, green, blue to four bytes each, from the row's end on, so that nothing is overwritten that is still to be read. */
static void widen_row(unsigned char *row, size_t width) {
    for (size_t x = width; x-- > 0;) {
        row[4 * x + 3] = 255;
        row[4 * x + 2] = row[3 * x + 2];
        row[4 * x + 1] = row[3 * x + 1];
        row[4 * x] = row[3 * x];
    }
}

static void read_rows(struct codec *codec) {
    struct jpeg_decompress_struct *jpeg = &codec->jpeg;
    struct texture *out = codec->out;
    jpeg_create_decompress(jpeg);
    jpeg_mem_src(jpeg, codec->source->data, codec->source->size);
    jpeg_read_header(jpeg, TRUE);
    codec->progress.progress_monitor = on_progress;
    jpeg->progress = &codec->progress;
    size_t texels = (size_t)jpeg->image_width * jpeg->image_height;
    if (texels > codec->most_texels) give_up(codec, "it has too many texels, or too few bytes for them");
    jpeg->out_color_space = JCS_RGB;
    jpeg_start_decompress(jpeg);
    out->width = jpeg->output_width;
    out->height = jpeg->output_height;
    out->texels = pbr_allocate(codec->instance, texels, 4);
    if (!out->texels) codec->result = PBR_ERROR_OUT_OF_MEMORY;
    while (out->texels && jpeg->output_scanline < jpeg->output_height) {
        JSAMPROW row = out->texels + 4 * (size_t)jpeg->output_scanline * out->width;
        jpeg_read_scanlines(jpeg, &row, 1);
        widen_row(row, out->width);
    }
}

static void read_guarded(struct codec *codec) {
    if (setjmp(codec->back) == 0) read_rows(codec);
    else texture_free(codec->instance, codec->out);
}

pbr_result jpeg_read(struct reader *reader, const struct source *source, uint64_t most_texels, struct texture *out,
                     char reason[TEXTURE_REASON]) {
    struct codec codec = {.instance = reader->instance, .source = source, .most_texels = most_texels, .out = out, .reason = reason};
    codec.jpeg.err = jpeg_std_error(&codec.errors);
    codec.errors.error_exit = on_error;
    codec.errors.emit_message = on_message;
    codec.jpeg.client_data = &codec;
    read_guarded(&codec);
    jpeg_destroy_decompress(&codec.jpeg);
    return codec.result;
}
#else
pbr_result jpeg_read(struct reader *reader, const struct source *source, uint64_t most_texels, struct texture *out,
                     char reason[TEXTURE_REASON]) {
    (void)reader, (void)source, (void)most_texels, (void)out;
    snprintf(reason, TEXTURE_REASON, "this build reads no JPEG");
    return PBR_OK;
}
#endif
