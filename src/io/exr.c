/* OpenEXR by its C library. The library takes no allocator with a user pointer, so its own buffers come from malloc; the pixels are
 * the instance's. SPDX-License-Identifier: MIT */
#include <math.h>
#include <openexr.h>
#include <string.h>

#include "picture.h"

struct stream {
    pbr_instance *instance;
    const char *name;
    const struct source *source;
    struct output *output;
    bool logged; /* one message an operation: the library reports an error on several levels */
};

static void on_error(exr_const_context_t context, exr_result_t code, const char *text) {
    struct stream *stream = NULL;
    (void)code;
    if (!context || exr_get_user_data(context, (void **)&stream) != EXR_ERR_SUCCESS || !stream || stream->logged) return;
    stream->logged = true;
    pbr_log(stream->instance, PBR_LOG_ERROR, stream->output ? PBR_ERROR_IO : PBR_ERROR_FORMAT, "%s: %s", stream->name, text);
}

/* What the library's result means here; logs it if the library has not. */
static pbr_result explain(struct stream *stream, exr_result_t code) {
    pbr_result result = code == EXR_ERR_SUCCESS                   ? PBR_OK
                        : code == EXR_ERR_OUT_OF_MEMORY           ? PBR_ERROR_OUT_OF_MEMORY
                        : code == EXR_ERR_FEATURE_NOT_IMPLEMENTED ? PBR_ERROR_UNSUPPORTED
                        : stream->output                          ? PBR_ERROR_IO
                                                                  : PBR_ERROR_FORMAT;
    if (result != PBR_OK && !stream->logged)
        pbr_log(stream->instance, PBR_LOG_ERROR, result, "%s: %s", stream->name, exr_get_default_error_message(code));
    return result;
}

static int64_t on_read(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t error) {
    const struct stream *stream = user;
    (void)context;
    (void)error;
    if (offset >= stream->source->size) return 0;
    uint64_t there = stream->source->size - offset;
    if (size > there) size = there;
    memcpy(buffer, stream->source->data + offset, size);
    return (int64_t)size;
}

static int64_t on_size(exr_const_context_t context, void *user) {
    const struct stream *stream = user;
    (void)context;
    return (int64_t)stream->source->size;
}

static int64_t on_write(exr_const_context_t context, void *user, const void *buffer, uint64_t size, uint64_t offset,
                        exr_stream_error_func_ptr_t error) {
    struct stream *stream = user;
    (void)context;
    (void)error;
    return output_write(stream->output, buffer, size, offset) ? (int64_t)size : -1;
}

static exr_context_initializer_t initializer(struct stream *stream) {
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = on_error;
    init.user_data = stream;
    init.read_fn = stream->source ? on_read : NULL;
    init.size_fn = stream->source ? on_size : NULL;
    init.write_fn = stream->output ? on_write : NULL;
    init.max_image_width = init.max_image_height = PBR_MAX_IMAGE_SIZE;
    init.max_tile_width = init.max_tile_height = PBR_MAX_IMAGE_SIZE;
    return init;
}

/* ---- reading ---- */

bool exr_recognise(const struct source *source) {
    return source->size >= 4 && memcmp(source->data, "\x76\x2f\x31\x01", 4) == 0;
}

struct reading {
    struct stream *stream;
    exr_context_t context;
    pbr_image *image;
    exr_attr_box2i_t window;
    bool grey; /* Y stands for R, G and B */
};

/* The floats that a channel goes to; NULL if it is not one of ours. */
static float *channel_target(const struct reading *reading, const char *name, int *stride) {
    static const char NAMES[] = "RGBA";
    *stride = 4;
    if (strcmp(name, "Z") == 0) {
        *stride = 1;
        return reading->image->depth;
    }
    if (reading->grey && strcmp(name, "Y") == 0) return reading->image->rgba;
    const char *found = name[0] && !name[1] ? strchr(NAMES, name[0]) : NULL;
    if (!found || (reading->grey && *found != 'A')) return NULL;
    return reading->image->rgba + (found - NAMES);
}

/* Checks the channels, and makes the picture. */
static pbr_result make_picture(struct reading *reading) {
    struct stream *stream = reading->stream;
    const exr_attr_chlist_t *list = NULL;
    exr_result_t code = exr_get_channels(reading->context, 0, &list);
    if (code == EXR_ERR_SUCCESS) code = exr_get_data_window(reading->context, 0, &reading->window);
    if (code != EXR_ERR_SUCCESS) return explain(stream, code);
    bool colour = false, alpha = false, depth = false, luminance = false;
    for (int i = 0; i < list->num_channels; i++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[i];
        const char *name = entry->name.str;
        bool ours = strlen(name) == 1 && strchr("RGBAYZ", name[0]);
        if (ours && (entry->x_sampling != 1 || entry->y_sampling != 1))
            return pbr_log(stream->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: channel %s is subsampled", stream->name,
                           name);
        colour |= ours && strchr("RGB", name[0]);
        alpha |= strcmp(name, "A") == 0;
        depth |= strcmp(name, "Z") == 0;
        luminance |= strcmp(name, "Y") == 0;
    }
    if (!colour && !alpha && !depth && !luminance)
        return pbr_log(stream->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: no channel R, G, B, Y, A or Z", stream->name);
    reading->grey = luminance && !colour;
    int64_t width = (int64_t)reading->window.max.x - reading->window.min.x + 1,
            height = (int64_t)reading->window.max.y - reading->window.min.y + 1;
    pbr_result result =
        picture_check_size(stream->instance, stream->name, width > 0 ? (uint64_t)width : 0, height > 0 ? (uint64_t)height : 0);
    if (result != PBR_OK) return result;
    /* The densest codec (DWA: 64 samples to one, then deflate) packs below 65536 to 1; small pictures are always fine. */
    if ((uint64_t)width * (uint64_t)height * 16 > (UINT64_C(64) << 20) + (uint64_t)stream->source->size * 65536)
        return pbr_log(stream->instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT,
                       "%s: byte %zu: the file is too short for %lld x %lld pixels", stream->name, stream->source->size,
                       (long long)width, (long long)height);
    result = pbr_image_create(stream->instance, (uint32_t)width, (uint32_t)height, depth, reading->image);
    for (size_t i = 0; result == PBR_OK && !alpha && i < (size_t)width * (size_t)height; i++) reading->image->rgba[4 * i + 3] = 1;
    return result;
}

/* Values of unsigned integer channels arrive as they are, in the floats' place. */
static void convert_integers(float *to, int stride, int32_t width, int32_t height, size_t line) {
    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width; x++) {
            uint32_t value;
            float *place = to + (size_t)y * line + (size_t)x * (size_t)stride;
            memcpy(&value, place, sizeof value);
            *place = (float)value;
        }
}

/* Decodes one chunk whose first pixel is (x, y) of the picture. */
static exr_result_t read_chunk(struct reading *reading, const exr_chunk_info_t *chunk, exr_decode_pipeline_t *pipeline, bool first,
                               size_t x, size_t y) {
    exr_result_t code = first ? exr_decoding_initialize(reading->context, 0, chunk, pipeline)
                              : exr_decoding_update(reading->context, 0, chunk, pipeline);
    if (code != EXR_ERR_SUCCESS) return code;
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        int stride;
        float *to = channel_target(reading, channel->channel_name, &stride);
        channel->decode_to_ptr = NULL;
        if (!to) continue;
        if ((size_t)channel->width > reading->image->width - x || (size_t)channel->height > reading->image->height - y)
            return EXR_ERR_CORRUPT_CHUNK;
        size_t line = (size_t)reading->image->width * (size_t)stride;
        channel->decode_to_ptr = (uint8_t *)(to + y * line + x * (size_t)stride);
        channel->user_pixel_stride = stride * (int)sizeof(float);
        channel->user_line_stride = (int32_t)(line * sizeof(float));
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = channel->data_type == EXR_PIXEL_UINT ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
    }
    if (first) code = exr_decoding_choose_default_routines(reading->context, 0, pipeline);
    if (code == EXR_ERR_SUCCESS) code = exr_decoding_run(reading->context, 0, pipeline);
    for (int i = 0; i < pipeline->channel_count && code == EXR_ERR_SUCCESS; i++) {
        const exr_coding_channel_info_t *channel = &pipeline->channels[i];
        int stride;
        float *to = channel_target(reading, channel->channel_name, &stride);
        size_t line = (size_t)reading->image->width * (size_t)stride;
        if (to && channel->data_type == EXR_PIXEL_UINT)
            convert_integers(to + y * line + x * (size_t)stride, stride, channel->width, channel->height, line);
    }
    return code;
}

static exr_result_t read_scanlines(struct reading *reading) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t lines = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(reading->context, 0, &lines);
    if (code == EXR_ERR_SUCCESS && lines < 1) code = EXR_ERR_CORRUPT_CHUNK;
    for (uint32_t y = 0; y < reading->image->height && code == EXR_ERR_SUCCESS; y += (uint32_t)lines) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(reading->context, 0, (int)y + reading->window.min.y, &chunk);
        if (code == EXR_ERR_SUCCESS) code = read_chunk(reading, &chunk, &pipeline, y == 0, 0, y);
    }
    exr_decoding_destroy(reading->context, &pipeline);
    return code;
}

static exr_result_t read_tiles(struct reading *reading) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t tile_width = 0, tile_height = 0;
    bool first = true;
    exr_result_t code = exr_get_tile_sizes(reading->context, 0, 0, 0, &tile_width, &tile_height);
    if (code == EXR_ERR_SUCCESS && (tile_width < 1 || tile_height < 1)) code = EXR_ERR_CORRUPT_CHUNK;
    for (size_t y = 0; y < reading->image->height && code == EXR_ERR_SUCCESS; y += (size_t)tile_height)
        for (size_t x = 0; x < reading->image->width && code == EXR_ERR_SUCCESS; x += (size_t)tile_width, first = false) {
            exr_chunk_info_t chunk;
            code = exr_read_tile_chunk_info(reading->context, 0, (int)(x / (size_t)tile_width), (int)(y / (size_t)tile_height), 0,
                                            0, &chunk);
            if (code == EXR_ERR_SUCCESS) code = read_chunk(reading, &chunk, &pipeline, first, x, y);
        }
    exr_decoding_destroy(reading->context, &pipeline);
    return code;
}

static void spread_grey(pbr_image *image) {
    for (size_t i = 0; i < (size_t)image->width * image->height; i++)
        image->rgba[4 * i + 1] = image->rgba[4 * i + 2] = image->rgba[4 * i];
}

pbr_result picture_read_exr(pbr_instance *instance, const char *name, const struct source *source, pbr_image *image) {
    struct stream stream = {.instance = instance, .name = name, .source = source};
    struct reading reading = {.stream = &stream, .image = image};
    exr_context_initializer_t init = initializer(&stream);
    exr_storage_t storage = EXR_STORAGE_DEEP_SCANLINE;
    int parts = 0;
    pbr_result result = explain(&stream, exr_start_read(&reading.context, name, &init));
    if (result == PBR_OK) result = explain(&stream, exr_get_count(reading.context, &parts));
    if (result == PBR_OK) result = explain(&stream, exr_get_storage(reading.context, 0, &storage));
    if (result == PBR_OK && (parts != 1 || (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)))
        result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: only single-part flat pictures are read", name);
    if (result == PBR_OK) result = make_picture(&reading);
    if (result == PBR_OK) result = explain(&stream, storage == EXR_STORAGE_TILED ? read_tiles(&reading) : read_scanlines(&reading));
    if (result == PBR_OK && reading.grey) spread_grey(image);
    if (reading.context) exr_finish(&reading.context);
    return result;
}

/* ---- writing ---- */

struct compression {
    exr_result_t (*compress)(struct _exr_encode_pipeline *pipeline); /* the library's */
};

static exr_result_t write_header(exr_context_t context, const pbr_image *image) {
    static const char *const NAMES[] = {"A", "B", "G", "R", "Z"}; /* sorted: the file's order */
    int part = 0, channels = image->depth ? 5 : 4;
    exr_result_t code = exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS)
        code =
            exr_initialize_required_attr_simple(context, part, (int32_t)image->width, (int32_t)image->height, EXR_COMPRESSION_ZIP);
    for (int i = 0; i < channels && code == EXR_ERR_SUCCESS; i++)
        code = exr_add_channel(context, part, NAMES[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    return code == EXR_ERR_SUCCESS ? exr_write_header(context) : code;
}

/* The library's compression. Readers take a chunk that is no smaller than its pixels for one stored as it is, but OpenEXRCore 3.1
 * writes the compressed bytes if they are exactly as many: then the pixels are stored instead. */
static exr_result_t compress_or_store(struct _exr_encode_pipeline *pipeline) {
    const struct compression *compression = pipeline->encoding_user_data;
    exr_result_t code = compression->compress(pipeline);
    if (code == EXR_ERR_SUCCESS && pipeline->compressed_buffer != pipeline->packed_buffer &&
        pipeline->compressed_bytes == pipeline->packed_bytes)
        memcpy(pipeline->compressed_buffer, pipeline->packed_buffer, pipeline->packed_bytes);
    return code;
}

static exr_result_t choose_routines(exr_context_t context, exr_encode_pipeline_t *pipeline, struct compression *compression) {
    exr_result_t code = exr_encoding_choose_default_routines(context, 0, pipeline);
    if (code != EXR_ERR_SUCCESS || !pipeline->compress_fn) return code;
    compression->compress = pipeline->compress_fn;
    pipeline->encoding_user_data = compression;
    pipeline->compress_fn = compress_or_store;
    return code;
}

static exr_result_t write_chunk(exr_context_t context, const pbr_image *image, const exr_chunk_info_t *chunk,
                                exr_encode_pipeline_t *pipeline, struct compression *compression, uint32_t y) {
    exr_result_t code =
        y == 0 ? exr_encoding_initialize(context, 0, chunk, pipeline) : exr_encoding_update(context, 0, chunk, pipeline);
    if (code != EXR_ERR_SUCCESS) return code;
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        bool depth = channel->channel_name[0] == 'Z';
        size_t stride = depth ? 1 : 4, component = depth ? 0 : strcspn("RGBA", channel->channel_name);
        const float *from = (depth ? image->depth : image->rgba) + (size_t)y * image->width * stride + component;
        channel->encode_from_ptr = (const uint8_t *)from;
        channel->user_pixel_stride = (int32_t)(stride * sizeof(float));
        channel->user_line_stride = (int32_t)(stride * sizeof(float) * image->width);
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
    }
    if (y == 0) code = choose_routines(context, pipeline, compression);
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(context, 0, pipeline) : code;
}

static exr_result_t write_chunks(exr_context_t context, const pbr_image *image) {
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    struct compression compression = {0};
    int32_t lines = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(context, 0, &lines);
    for (uint32_t y = 0; y < image->height && code == EXR_ERR_SUCCESS; y += (uint32_t)lines) {
        exr_chunk_info_t chunk;
        code = exr_write_scanline_chunk_info(context, 0, (int)y, &chunk);
        if (code == EXR_ERR_SUCCESS) code = write_chunk(context, image, &chunk, &pipeline, &compression, y);
    }
    exr_encoding_destroy(context, &pipeline);
    return code;
}

pbr_result picture_write_exr(pbr_instance *instance, const char *name, const pbr_image *image, struct output *output) {
    struct stream stream = {.instance = instance, .name = name, .output = output};
    exr_context_t context = NULL;
    exr_context_initializer_t init = initializer(&stream);
    exr_result_t code = exr_start_write(&context, name, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code == EXR_ERR_SUCCESS) code = write_header(context, image);
    if (code == EXR_ERR_SUCCESS) code = write_chunks(context, image);
    pbr_result result = explain(&stream, code);
    if (context) {
        exr_result_t finished = exr_finish(&context); /* writes the table of chunks */
        if (result == PBR_OK) result = explain(&stream, finished);
    }
    return result;
}
