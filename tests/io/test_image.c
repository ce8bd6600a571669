/* Pictures: what is written is read back, and broken files are refused. SPDX-License-Identifier: MIT */
#include "support.h"

#include <dirent.h>
#include <math.h>
#include <openexr.h>
#include <pbr/image.h>
#include <png.h>
#include <unistd.h>

#include "core/colour.h"

static char folder[] = "/tmp/pbr-test-image-XXXXXX";

static int make_folder(void **state) {
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int files_in_folder(void) {
    DIR *dir = opendir(folder);
    int count = 0;
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir));) count += entry->d_name[0] != '.';
    closedir(dir);
    return count;
}

static int remove_folder(void **state) {
    (void)state;
    return rmdir(folder); /* fails if a test or the library left a file */
}

static const char *in_folder(const char *name) {
    static char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_file(const char *path, const void *data, size_t size) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static size_t read_whole(const char *path, unsigned char *to, size_t room) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    size_t size = fread(to, 1, room, file);
    fclose(file);
    assert_true(size < room);
    return size;
}

static pbr_image random_picture(pbr_instance *instance, uint32_t width, uint32_t height, uint64_t seed) {
    pbr_image image = PBR_IMAGE_INIT;
    assert_int_equal(pbr_image_create(instance, width, height, 1, &image), PBR_OK);
    for (size_t i = 0; i < (size_t)width * height * 4; i++) {
        uint32_t bits = (uint32_t)random_next(&seed);
        memcpy(&image.rgba[i], &bits, sizeof bits); /* NaN, infinities, denormals, anything */
    }
    for (size_t i = 0; i < (size_t)width * height; i += 2) image.depth[i] = i % 4 ? 1e-42f : (float)i / 3;
    return image;
}

static void exr_keeps_every_bit_of_colour_and_depth(void **state) {
    (void)state;
    static const uint32_t SIZES[][2] = {{1, 1}, {37, 53}, {200, 16}, {3, 17}};
    for (size_t s = 0; s < 4; s++)
        for (int depth = 0; depth < 2; depth++) {
            struct host host;
            pbr_instance *instance = host_instance(&host);
            pbr_image image = random_picture(instance, SIZES[s][0], SIZES[s][1], 7 + s), back = PBR_IMAGE_INIT;
            size_t pixels = (size_t)image.width * image.height;
            if (!depth) {
                pbr_free(instance, image.depth);
                image.depth = NULL;
            }
            const char *path = in_folder("a.exr");
            assert_int_equal(pbr_image_write(instance, &image, path), PBR_OK);
            assert_int_equal(files_in_folder(), 1);
            assert_int_equal(pbr_image_read(instance, path, &back), PBR_OK);
            assert_true(back.width == image.width && back.height == image.height);
            assert_memory_equal(back.rgba, image.rgba, pixels * 16);
            assert_int_equal(back.depth != NULL, depth);
            if (depth) assert_memory_equal(back.depth, image.depth, pixels * 4);
            pbr_image_destroy(instance, &image);
            pbr_image_destroy(instance, &back);
            host_finish(&host, instance);
            unlink(path);
        }
}

/* Among pictures of 192 bytes, about half of them random, some compress to exactly their own size. */
static void exr_keeps_pictures_that_do_not_shrink(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    const char *path = in_folder("a.exr");
    uint64_t r = 12345;
    for (int n = 0; n < 600; n++) {
        pbr_image image = PBR_IMAGE_INIT, back = PBR_IMAGE_INIT;
        assert_int_equal(pbr_image_create(instance, 12, 1, 0, &image), PBR_OK);
        unsigned char *bytes = (unsigned char *)image.rgba;
        for (int i = 0; i < 100 + n % 60; i++) bytes[random_next(&r) % 192] = (unsigned char)random_next(&r);
        assert_int_equal(pbr_image_write(instance, &image, path), PBR_OK);
        assert_int_equal(pbr_image_read(instance, path, &back), PBR_OK);
        assert_memory_equal(back.rgba, image.rgba, 192);
        pbr_image_destroy(instance, &image);
        pbr_image_destroy(instance, &back);
    }
    host_finish(&host, instance);
    unlink(path);
}

static void png_keeps_every_8_bit_code(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = PBR_IMAGE_INIT, back = PBR_IMAGE_INIT, again = PBR_IMAGE_INIT;
    assert_int_equal(pbr_image_create(instance, 256, 3, 0, &image), PBR_OK);
    for (int i = 0; i < 256 * 3; i++) {
        float alpha = i < 512 ? 1 : (float)(i % 256) / 255; /* two rows opaque, one of every alpha */
        for (int k = 0; k < 3; k++) image.rgba[4 * i + k] = linear_from_srgb((float)((i + 85 * k) % 256) / 255) * alpha;
        image.rgba[4 * i + 3] = alpha;
    }
    const char *path = in_folder("a.png");
    assert_int_equal(pbr_image_write(instance, &image, path), PBR_OK);
    assert_int_equal(pbr_image_read(instance, path, &back), PBR_OK);
    assert_null(back.depth);
    /* The same 8-bit code gives the same float. */
    assert_memory_equal(back.rgba, image.rgba, 512 * 16);
    for (int i = 512; i < 768; i++) assert_true(back.rgba[4 * i + 3] == image.rgba[4 * i + 3]);
    /* What was read is a fixed point, transparent pixels included. */
    assert_int_equal(pbr_image_write(instance, &back, path), PBR_OK);
    assert_int_equal(pbr_image_read(instance, path, &again), PBR_OK);
    assert_memory_equal(again.rgba, back.rgba, 768 * 16);
    pbr_image_destroy(instance, &image);
    pbr_image_destroy(instance, &back);
    pbr_image_destroy(instance, &again);
    host_finish(&host, instance);
    unlink(path);
}

static void png_takes_any_float(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = random_picture(instance, 31, 7, 99), back = PBR_IMAGE_INIT;
    const char *path = in_folder("a.png");
    assert_int_equal(pbr_image_write(instance, &image, path), PBR_OK);
    assert_int_equal(pbr_image_read(instance, path, &back), PBR_OK);
    for (int i = 0; i < 31 * 7 * 4; i++) assert_true(back.rgba[i] >= 0 && back.rgba[i] <= 1);
    pbr_image_destroy(instance, &image);
    pbr_image_destroy(instance, &back);
    host_finish(&host, instance);
    unlink(path);
}

/* Writes a PNG of one row by libpng itself. */
static void write_png(const char *path, uint32_t width, int type, int depth, int interlace, double gamma,
                      const unsigned char *row) {
    FILE *file = fopen(path, "wb");
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    png_color palette[2] = {{10, 20, 30}, {200, 100, 50}};
    png_byte alpha[2] = {255, 51};
    assert_true(file && png && info);
    if (setjmp(png_jmpbuf(png)) != 0) fail();
    png_init_io(png, file);
    png_set_IHDR(png, info, width, 1, depth, type, interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (gamma > 0) png_set_gAMA(png, info, gamma);
    if (type == PNG_COLOR_TYPE_PALETTE) {
        png_set_PLTE(png, info, palette, 2);
        png_set_tRNS(png, info, alpha, 2, NULL);
    }
    png_write_info(png, info);
    png_bytep rows[1] = {(png_bytep)(uintptr_t)row};
    png_write_image(png, rows);
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    fclose(file);
}

static void check_png(int type, int depth, int interlace, double gamma, const unsigned char *row, uint32_t width,
                      const float *expected) {
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = PBR_IMAGE_INIT;
    const char *path = in_folder("kind.png");
    write_png(path, width, type, depth, interlace, gamma, row);
    assert_int_equal(pbr_image_read(instance, path, &image), PBR_OK);
    assert_true(image.width == width && image.height == 1);
    /* A few roundings of float. */
    for (uint32_t i = 0; i < 4 * width; i++) assert_true(fabsf(image.rgba[i] - expected[i]) <= 1e-6f);
    pbr_image_destroy(instance, &image);
    host_finish(&host, instance);
    unlink(path);
}

static void every_kind_of_png_is_read(void **state) {
    (void)state;
    float grey = linear_from_srgb(128 / 255.0f), a = 51 / 255.0f;
    const float greys[] = {0, 0, 0, 1, grey, grey, grey, 1}, bits[] = {1, 1, 1, 1, 0, 0, 0, 1};
    check_png(PNG_COLOR_TYPE_GRAY, 8, 0, 0, (const unsigned char[]){0, 128}, 2, greys);
    check_png(PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_ADAM7, 0, (const unsigned char[]){0, 128}, 2, greys);
    check_png(PNG_COLOR_TYPE_GRAY, 1, 0, 0, (const unsigned char[]){0x80}, 2, bits);
    const float indexed[] = {
        linear_from_srgb(200 / 255.0f) * a, linear_from_srgb(100 / 255.0f) * a, linear_from_srgb(50 / 255.0f) * a, a,
        linear_from_srgb(10 / 255.0f),      linear_from_srgb(20 / 255.0f),      linear_from_srgb(30 / 255.0f),     1};
    check_png(PNG_COLOR_TYPE_PALETTE, 1, 0, 0, (const unsigned char[]){0x80}, 2, indexed);
    float wide = linear_from_srgb(0x1234 / 65535.0f);
    const float wides[] = {wide, 0, 1, 1};
    check_png(PNG_COLOR_TYPE_RGB, 16, 0, 0, (const unsigned char[]){0x12, 0x34, 0, 0, 255, 255}, 1, wides);
    const float linear[] = {128 / 255.0f * a, a, 0, a};
    check_png(PNG_COLOR_TYPE_RGB_ALPHA, 8, 0, 1.0, (const unsigned char[]){128, 255, 0, 51}, 1, linear);
    const float greyed[] = {grey * a, grey * a, grey * a, a};
    check_png(PNG_COLOR_TYPE_GRAY_ALPHA, 8, 0, 0, (const unsigned char[]){128, 51}, 1, greyed);
}

/* Writes by the library itself a picture of 5 x 3 whose channel c holds 10 y + x + 100 c, with its origin at (-2, 7). */
static void write_exr(const char *path, bool tiled, exr_pixel_type_t type, const char *const *names, int channels,
                      exr_compression_t compression) {
    exr_context_t context;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_attr_box2i_t window;
    exr_attr_v2f_t centre;
    int part;
    memset(&centre, 0, sizeof centre);
    window.min.x = -2;
    window.min.y = 7;
    window.max.x = 2;
    window.max.y = 9;
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    assert_int_equal(exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &init), 0);
    assert_int_equal(exr_add_part(context, NULL, tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part), 0);
    assert_int_equal(
        exr_initialize_required_attr(context, 0, &window, &window, 1, &centre, 1, EXR_LINEORDER_INCREASING_Y, compression), 0);
    if (tiled) assert_int_equal(exr_set_tile_descriptor(context, 0, 4, 2, EXR_TILE_ONE_LEVEL, EXR_TILE_ROUND_DOWN), 0);
    for (int c = 0; c < channels; c++)
        assert_int_equal(exr_add_channel(context, 0, names[c], type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1), 0);
    assert_int_equal(exr_write_header(context), 0);
    int32_t step_x = tiled ? 4 : 5, step_y = tiled ? 2 : 1;
    if (!tiled) assert_int_equal(exr_get_scanlines_per_chunk(context, 0, &step_y), 0);
    bool first = true;
    for (int y = 0; y < 3; y += step_y)
        for (int x = 0; x < 5; x += step_x, first = false) {
            exr_chunk_info_t chunk;
            float values[5][16];
            uint32_t integers[5][16];
            assert_int_equal(tiled ? exr_write_tile_chunk_info(context, 0, x / 4, y / 2, 0, 0, &chunk)
                                   : exr_write_scanline_chunk_info(context, 0, y + 7, &chunk),
                             0);
            assert_int_equal(first ? exr_encoding_initialize(context, 0, &chunk, &pipeline)
                                   : exr_encoding_update(context, 0, &chunk, &pipeline),
                             0);
            for (int c = 0; c < channels; c++) {
                exr_coding_channel_info_t *channel = &pipeline.channels[c];
                for (int j = 0; j < channel->height; j++)
                    for (int i = 0; i < channel->width; i++) {
                        values[c][j * channel->width + i] = (float)(10 * (y + j) + x + i + 100 * c);
                        integers[c][j * channel->width + i] = (uint32_t)(10 * (y + j) + x + i + 100 * c);
                    }
                channel->encode_from_ptr = type == EXR_PIXEL_UINT ? (uint8_t *)integers[c] : (uint8_t *)values[c];
                channel->user_bytes_per_element = 4;
                channel->user_data_type = type == EXR_PIXEL_UINT ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
                channel->user_pixel_stride = 4;
                channel->user_line_stride = 4 * channel->width;
            }
            if (first) assert_int_equal(exr_encoding_choose_default_routines(context, 0, &pipeline), 0);
            assert_int_equal(exr_encoding_run(context, 0, &pipeline), 0);
        }
    exr_encoding_destroy(context, &pipeline);
    assert_int_equal(exr_finish(&context), 0);
}

static void scan_lines_tiles_and_all_number_types_are_read(void **state) {
    (void)state;
    static const char *const COLOUR[] = {"A", "B", "G", "R", "Z"}, *const GREY[] = {"Y"};
    static const exr_pixel_type_t TYPES[] = {EXR_PIXEL_FLOAT, EXR_PIXEL_HALF, EXR_PIXEL_UINT};
    static const exr_compression_t CODECS[] = {EXR_COMPRESSION_NONE, EXR_COMPRESSION_RLE, EXR_COMPRESSION_PXR24,
                                               EXR_COMPRESSION_ZIP, EXR_COMPRESSION_PIZ};
    for (int n = 0; n < 2 * 3 * 5 * 2; n++) {
        bool tiled = n & 1, grey = n & 2;
        exr_pixel_type_t type = TYPES[n / 4 % 3];
        struct host host;
        pbr_instance *instance = host_instance(&host);
        pbr_image image = PBR_IMAGE_INIT;
        const char *path = in_folder("kind.exr");
        write_exr(path, tiled, type, grey ? GREY : COLOUR, grey ? 1 : 5, CODECS[n / 12]);
        assert_int_equal(pbr_image_read(instance, path, &image), PBR_OK);
        assert_true(image.width == 5 && image.height == 3 && (image.depth != NULL) == !grey);
        for (int i = 0; i < 15; i++) {
            float base = (float)(10 * (i / 5) + i % 5); /* whole numbers below 2048 are exact in half */
            const float *p = image.rgba + 4 * i;
            if (grey) assert_true(p[0] == base && p[1] == base && p[2] == base && p[3] == 1);
            else
                assert_true(p[3] == base && p[2] == base + 100 && p[1] == base + 200 && p[0] == base + 300 &&
                            image.depth[i] == base + 400);
        }
        pbr_image_destroy(instance, &image);
        host_finish(&host, instance);
        unlink(path);
    }
}

/* Reads bytes as a picture. An error leaves no pixels, and is told. */
static pbr_result read_bytes(const unsigned char *data, size_t size) {
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = PBR_IMAGE_INIT;
    const char *path = in_folder("bytes");
    write_file(path, data, size);
    pbr_result result = pbr_image_read(instance, path, &image);
    if (result != PBR_OK) assert_true(!image.rgba && !image.depth && host.errors >= 1);
    pbr_image_destroy(instance, &image);
    /* Of a file of some hundred bytes nothing large is made: the reader's bound for OpenEXR is 64 MiB + 65536 times the file. */
    assert_true(host.peak <= ((size_t)80 << 20) + 65536 * size);
    host_finish(&host, instance);
    unlink(path);
    return result;
}

static size_t small_file(const char *name, unsigned char *to, size_t room) {
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = random_picture(instance, 5, 4, 3);
    const char *path = in_folder(name);
    assert_int_equal(pbr_image_write(instance, &image, path), PBR_OK);
    size_t size = read_whole(path, to, room);
    unlink(path);
    pbr_image_destroy(instance, &image);
    host_finish(&host, instance);
    return size;
}

static void a_picture_cut_anywhere_is_an_error(void **state) {
    (void)state;
    static const char *const NAMES[] = {"a.png", "a.exr"};
    for (int n = 0; n < 2; n++) {
        unsigned char file[4096];
        size_t size = small_file(NAMES[n], file, sizeof file);
        assert_int_equal(read_bytes(file, size), PBR_OK);
        for (size_t cut = 0; cut < size; cut++) assert_int_not_equal(read_bytes(file, cut), PBR_OK);
    }
}

static void flipped_bytes_never_crash(void **state) {
    (void)state;
    static const char *const NAMES[] = {"a.png", "a.exr"};
    uint64_t r = 88172645463325252u;
    for (int n = 0; n < 2; n++) {
        unsigned char file[4096], broken[4096];
        size_t size = small_file(NAMES[n], file, sizeof file);
        for (int i = 0; i < 1500; i++) {
            memcpy(broken, file, size);
            for (uint64_t k = random_next(&r) % 3 + 1; k > 0; k--) broken[random_next(&r) % size] = (unsigned char)random_next(&r);
            read_bytes(broken, size);
        }
    }
}

static void what_cannot_be_written_leaves_no_file(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_image image = random_picture(instance, 4, 4, 5), empty = PBR_IMAGE_INIT;
    assert_int_equal(pbr_image_write(instance, &image, in_folder("a.bmp")), PBR_ERROR_UNSUPPORTED);
    assert_int_equal(pbr_image_write(instance, &image, in_folder("no such folder/a.png")), PBR_ERROR_IO);
    assert_int_equal(pbr_image_write(instance, &image, in_folder("no such folder/a.exr")), PBR_ERROR_IO);
    assert_int_equal(pbr_image_write(instance, &empty, in_folder("a.png")), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_image_read(instance, in_folder("a.png"), &empty), PBR_ERROR_IO);
    assert_int_equal(pbr_image_create(instance, PBR_MAX_IMAGE_SIZE + 1, 1, 0, &empty), PBR_ERROR_LIMIT);
    assert_int_equal(pbr_image_create(instance, 0, 1, 0, &empty), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(files_in_folder(), 0);
    pbr_image_destroy(instance, &image);
    pbr_image_destroy(instance, NULL);
    host_finish(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exr_keeps_every_bit_of_colour_and_depth),
        cmocka_unit_test(exr_keeps_pictures_that_do_not_shrink),
        cmocka_unit_test(png_keeps_every_8_bit_code),
        cmocka_unit_test(png_takes_any_float),
        cmocka_unit_test(every_kind_of_png_is_read),
        cmocka_unit_test(scan_lines_tiles_and_all_number_types_are_read),
        cmocka_unit_test(a_picture_cut_anywhere_is_an_error),
        cmocka_unit_test(flipped_bytes_never_crash),
        cmocka_unit_test(what_cannot_be_written_leaves_no_file),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
