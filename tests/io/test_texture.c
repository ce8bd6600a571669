/* Colours of vertices from textures and materials: OBJ with MTL, PLY with pictures; and what of these files is not believed.
 * SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>
#include <pbr/image.h>
#include <sys/stat.h>
#ifdef PBR_HAS_JPEG
#include <jpeglib.h>
#endif

/* ---- a folder with a mesh and what it names ---- */

static char folder[64];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/pbr-test-texture-XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static const char *path_of(const char *name) {
    static char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static int remove_folder(void **state) {
    (void)state;
    static const char *const NAMES[] = {"mesh",      "a.mtl",    "t.png",    "u.png", "my texture.png",
                                        "sub/t.png", "link.png", "pipe.png", "t.jpg", "down"};
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES; i++) unlink(path_of(NAMES[i]));
    rmdir(path_of("sub"));
    return rmdir(folder);
}

static void write_bytes(const char *name, const void *data, size_t size) {
    FILE *file = fopen(path_of(name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static void write_text(const char *name, const char *text) {
    write_bytes(name, text, strlen(text));
}

/* A picture whose pixel at column x, row y from the top is colour(x, y): linear, not multiplied by alpha. */
static void write_picture(const char *name, uint32_t width, uint32_t height, void (*colour)(uint32_t x, uint32_t y, float out[4])) {
    struct host host;
    pbr_image image = PBR_IMAGE_INIT;
    pbr_instance *instance = host_instance(&host);
    assert_int_equal(pbr_image_create(instance, width, height, 0, &image), PBR_OK);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            float *to = image.rgba + 4 * ((size_t)y * width + x);
            colour(x, y, to);
            for (int k = 0; k < 3; k++) to[k] *= to[3];
        }
    assert_int_equal(pbr_image_write(instance, &image, path_of(name)), PBR_OK);
    pbr_image_destroy(instance, &image);
    host_finish(&host, instance);
}

static struct outcome read_mesh(const char *text) {
    write_text("mesh", text);
    struct outcome out = read_it(path_of("mesh"), NULL, strlen(text), PBR_READ_KEEP_RADII);
    if (out.result != PBR_OK) fail_msg("%s: %s", text, out.error);
    return out;
}

/* The code of a linear value: sRGB, IEC 61966-2-1. */
static double code_of(double linear) {
    return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055);
}

static void check_colour(const struct outcome *out, int vertex, double red, double green, double blue, double tolerance) {
    const double expected[] = {red, green, blue};
    assert_true(out->points.has_colours);
    for (int k = 0; k < 3; k++) {
        double off = out->colours[4 * vertex + k] - code_of(expected[k]);
        if (fabs(off) > tolerance) fail_msg("vertex %d, channel %d: %g off %g", vertex, k, off, code_of(expected[k]));
    }
}

static void set(float out[4], float red, float green, float blue, float alpha) {
    out[0] = red;
    out[1] = green;
    out[2] = blue;
    out[3] = alpha;
}

static void whole_grey(uint32_t x, uint32_t y, float out[4]) {
    (void)x, (void)y;
    set(out, 0.2f, 0.4f, 0.6f, 1);
}
static void white_at_right(uint32_t x, uint32_t y, float out[4]) {
    (void)y;
    set(out, x >= 128, x >= 128, x >= 128, 1);
}
static void red_over_green(uint32_t x, uint32_t y, float out[4]) {
    (void)x;
    set(out, y < 8, y >= 8, 0, 1);
}
static void chequered(uint32_t x, uint32_t y, float out[4]) {
    set(out, (x + y) & 1, (x + y) & 1, (x + y) & 1, 1);
}
static void half_transparent(uint32_t x, uint32_t y, float out[4]) {
    (void)y;
    set(out, x & 1, !(x & 1), 0, x & 1 ? 0 : 1);
}

#define SQUARE "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
#define WHOLE "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
#define FACE "usemtl m\nf 1/1 2/2 3/3 4/4\n"
#define MATERIAL "newmtl m\nmap_Kd t.png\n"

/* ---- means ---- */

/* Codes are rounded once when the picture is written and once when the vertices' are: 1 at most. */
static void one_colour_stays_itself(void **state) {
    (void)state;
    write_picture("t.png", 16, 16, whole_grey);
    write_text("a.mtl", "# all\nnewmtl other\nKd 1 0 0\n\nnewmtl m\nKd 0 0 0\nmap_Kd t.png\nillum 2\n");
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    assert_int_equal(out.content.warning_count, 0);
    for (int i = 0; i < 4; i++) check_colour(&out, i, 0.2f, 0.4f, 0.6f, 1);
}

/* The integral of hat function times picture over that of the hat function, with white where x > 1/2: at (0, 0) 1/2 in the triangle
 * below the diagonal, 1/8 in that above, equal in area; at (1, 0), which is in the one below alone, 7/8; the others by symmetry.
 * Samples are half a texel of 256 off the edge at most: 0.006 at the highest density of weight, 2 codes with rounding. */
static void means_are_those_of_the_hat_functions(void **state) {
    (void)state;
    write_picture("t.png", 256, 256, white_at_right);
    write_text("a.mtl", MATERIAL);
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    static const double EXPECTED[] = {5.0 / 16, 7.0 / 8, 11.0 / 16, 1.0 / 8};
    for (int i = 0; i < 4; i++) check_colour(&out, i, EXPECTED[i], EXPECTED[i], EXPECTED[i], 2);
}

/* A vertex of a white triangle and of a black one three times as large: 1/4. */
static void triangles_weigh_as_their_areas(void **state) {
    (void)state;
    write_text("a.mtl", "newmtl w\nKd 1 1 1\nnewmtl k\nKd 0 0 0\n");
    struct outcome out = read_mesh("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv -3 0 0\nusemtl w\nf 1 2 3\nusemtl k\nf 1 3 4\n");
    static const double EXPECTED[] = {0.25, 1, 0.25, 0};
    for (int i = 0; i < 4; i++) check_colour(&out, i, EXPECTED[i], EXPECTED[i], EXPECTED[i], 1);
}

/* Half of the light of white: code 188, not 128. */
static void means_are_taken_in_linear_light(void **state) {
    (void)state;
    write_picture("t.png", 128, 128, chequered);
    write_text("a.mtl", MATERIAL);
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    for (int i = 0; i < 4; i++) check_colour(&out, i, 0.5, 0.5, 0.5, 2); /* columns of samples shift against texels */
}

static void what_is_transparent_has_no_say(void **state) {
    (void)state;
    write_picture("t.png", 32, 32, half_transparent);
    write_text("a.mtl", MATERIAL);
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    for (int i = 0; i < 4; i++) check_colour(&out, i, 0, 1, 0, 1);
}

static void the_picture_stands_upright_and_repeats(void **state) {
    (void)state;
    static const char *const LOWER[] = {"vt 0 0\nvt 1 0\nvt 1 .5\nvt 0 .5\n", "vt 3 -2\nvt 4 -2\nvt 4 -1.5\nvt 3 -1.5 0\n",
                                        "vt 1 0\nvt 1 0\nvt 1 0\nvt 1 0\n"};
    static const char *const UPPER[] = {"vt 0 .5\nvt 1 .5\nvt 1 1\nvt 0 1\n", "vt -3 7.5\nvt -4 7.5\nvt -4 8\nvt -3 8\n",
                                        "vt 1 1\nvt 1 1\nvt 1 1\nvt 1 1\n"};
    write_picture("t.png", 16, 16, red_over_green);
    write_text("a.mtl", MATERIAL);
    char text[400];
    for (size_t i = 0; i < 3; i++) {
        snprintf(text, sizeof text, SQUARE "%s" FACE, LOWER[i]);
        struct outcome out = read_mesh(text);
        for (int k = 0; k < 4; k++) check_colour(&out, k, 0, 1, 0, 1);
    }
    for (size_t i = 0; i < 3; i++) {
        snprintf(text, sizeof text, SQUARE "%s" FACE, UPPER[i]);
        struct outcome out = read_mesh(text);
        for (int k = 0; k < 4; k++) check_colour(&out, k, 1, 0, 0, 1);
    }
}

/* The fan of a polygon that is left out leaves no patch behind; relative and negative indices name the same corners. */
static void corners_have_their_own_coordinates(void **state) {
    (void)state;
    write_picture("t.png", 16, 16, red_over_green);
    write_text("a.mtl", MATERIAL);
    struct outcome out = read_mesh(SQUARE "vt 0.5 0.1\nvt .5 .9\nusemtl m\nf 1/2 2/2 3/2 9/2\nf 1/1/ 2/1 3/-2\n"
                                          "v 5 0 0\nv 6 0 0\nv 6 1 0\nf -3/-1 -2/-1 -1/2\n");
    assert_int_equal(out.mesh.triangle_count, 2);
    for (int i = 0; i < 3; i++) check_colour(&out, i, 0, 1, 0, 1);
    for (int i = 3; i < 6; i++) check_colour(&out, i, 1, 0, 0, 1); /* vertex 4 is in no face: not among the points */
}

/* ---- which colours ---- */

static void colours_of_the_vertices_come_first(void **state) {
    (void)state;
    write_picture("t.png", 16, 16, red_over_green);
    write_text("a.mtl", MATERIAL);
    struct outcome out = read_mesh("mtllib a.mtl\nv 0 0 0 0 0 1\nv 1 0 0 0 0 1\nv 1 1 0 0 0 1\nv 0 1 0 0 0 1\n" WHOLE FACE);
    for (int i = 0; i < 4; i++) check_colour(&out, i, 0, 0, 1, 1);
}

static void without_its_texture_a_material_has_kd(void **state) {
    (void)state;
    write_text("a.mtl", "newmtl m\nmap_Kd gone.png\nKd 1 0 0.5\n");
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    assert_int_equal(out.content.warning_count, 1);
    for (int i = 0; i < 4; i++) check_colour(&out, i, 1, 0, pow((0.5 + 0.055) / 1.055, 2.4), 1); /* a display value */
}

static void names_may_have_options_blanks_and_folders(void **state) {
    (void)state;
    static const char *const LIBRARIES[] = {"newmtl m\nmap_Kd my texture.png\n",
                                            "newmtl m\r\n  map_Kd   my texture.png  \r\n",
                                            "newmtl m\nmap_Kd -s 1 1 1 -bm 0.5 -clamp on -imfchan m my texture.png\n",
                                            "newmtl m\nmap_Kd sub/t.png\n",
                                            "newmtl m\nmap_Kd sub\\t.png\n",
                                            "newmtl m\nmap_Kd ./sub//t.png\n"};
    mkdir(path_of("sub"), 0777);
    write_picture("sub/t.png", 4, 4, whole_grey);
    write_picture("my texture.png", 4, 4, whole_grey);
    for (size_t i = 0; i < sizeof LIBRARIES / sizeof *LIBRARIES; i++) {
        write_text("a.mtl", LIBRARIES[i]);
        struct outcome out = read_mesh(SQUARE WHOLE FACE);
        assert_int_equal(out.content.warning_count, 0);
        check_colour(&out, 0, 0.2f, 0.4f, 0.6f, 1);
    }
}

/* ---- PLY ---- */

#define PLY_HEAD(encoding) "ply\nformat " encoding " 1.0\ncomment TextureFile my texture.png\ncomment TextureFile u.png\n"
#define PLY_CORNERS "0 0 0\n1 0 0\n1 1 0\n5 0 0\n6 0 0\n6 1 0\n"

static void vertices_of_ply_may_have_coordinates(void **state) {
    (void)state;
    static const char *const NAMES[][2] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}};
    write_picture("my texture.png", 16, 16, red_over_green);
    for (size_t i = 0; i < 3; i++) {
        char text[700];
        snprintf(text, sizeof text,
                 PLY_HEAD("ascii") "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty float %s\n"
                                   "property float %s\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                   "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 .5\n0 1 0 0 .5\n4 0 1 2 3\n",
                 NAMES[i][0], NAMES[i][1]);
        struct outcome out = read_mesh(text);
        assert_int_equal(out.content.warning_count, 0);
        for (int k = 0; k < 4; k++) check_colour(&out, k, 0, 1, 0, 1);
    }
}

static void polygons_of_ply_may_have_coordinates(void **state) {
    (void)state;
    write_picture("my texture.png", 16, 16, red_over_green);
    write_picture("u.png", 16, 16, whole_grey);
    struct outcome out =
        read_mesh(PLY_HEAD("ascii") "element vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n"
                                    "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
                                    "property int texnumber\nend_header\n" PLY_CORNERS
                                    "3 0 1 2 6 0 .6 1 .6 1 .9 0\n4 0 1 2 9 8 0 0 0 0 0 0 0 0 0\n3 3 4 5 6 0 0 0 0 0 0 1\n");
    assert_int_equal(out.content.warning_count, 1); /* the face that refers to vertex 9 */
    for (int i = 0; i < 3; i++) check_colour(&out, i, 1, 0, 0, 1);
    for (int i = 3; i < 6; i++) check_colour(&out, i, 0.2f, 0.4f, 0.6f, 1);
}

/* Each byte is a number, so that both byte orders are written alike. */
static void binary_lists_are_found_too(void **state) {
    (void)state;
    static const char HEAD[] =
        PLY_HEAD("binary_big_endian") "element vertex 3\nproperty uchar x\nproperty uchar y\nproperty uchar z\nelement face 1\n"
                                      "property list uchar uchar texcoord\nproperty uchar flags\n"
                                      "property list uchar uchar vertex_indices\nend_header\n";
    static const unsigned char DATA[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 6, 0, 1, 0, 1, 0, 1, 9, 3, 0, 1, 2};
    char bytes[sizeof HEAD - 1 + sizeof DATA];
    memcpy(bytes, HEAD, sizeof HEAD - 1);
    memcpy(bytes + sizeof HEAD - 1, DATA, sizeof DATA);
    write_picture("my texture.png", 16, 16, red_over_green);
    write_bytes("mesh", bytes, sizeof bytes);
    struct outcome out = read_it(path_of("mesh"), NULL, sizeof bytes, PBR_READ_STREAM);
    assert_int_equal(out.result, PBR_OK);
    for (int i = 0; i < 3; i++) check_colour(&out, i, 1, 0, 0, 1); /* v = 1: the top */
}

static void ply_without_coordinates_has_no_colours(void **state) {
    (void)state;
    write_picture("my texture.png", 16, 16, red_over_green);
    struct outcome out =
        read_mesh(PLY_HEAD("ascii") "element vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                                    "property list uchar int vertex_indices\nend_header\n" PLY_CORNERS "3 0 1 2\n");
    assert_int_equal(out.content.warning_count, 1);
    assert_false(out.points.has_colours);
}

/* ---- what is not believed ---- */

static void files_outside_of_the_folder_are_not_read(void **state) {
    (void)state;
    char absolute[96], up[96];
    snprintf(absolute, sizeof absolute, "%s/t.png", folder);
    snprintf(up, sizeof up, "../%s/t.png", strrchr(folder, '/') + 1);
    const char *const NAMES[] = {up, "sub/../t.png", "..",         ".",         "sub",         "link.png", "down/t.png", "pipe.png",
                                 "", "gone.png",     "gone/t.png", "..\\t.png", "t.png/t.png", "/",        "sub/"};
    write_picture("t.png", 4, 4, whole_grey);
    mkdir(path_of("sub"), 0777);
    assert_int_equal(mkfifo(path_of("pipe.png"), 0666), 0);
    assert_int_equal(symlink("t.png", path_of("link.png")), 0);
    assert_int_equal(symlink("sub", path_of("down")), 0);
    for (size_t i = 0; i <= sizeof NAMES / sizeof *NAMES; i++) {
        char library[400];
        const char *name = i < sizeof NAMES / sizeof *NAMES ? NAMES[i] : absolute;
        snprintf(library, sizeof library, "newmtl m\nmap_Kd %s\n", name);
        write_text("a.mtl", library);
        struct outcome out = read_mesh(SQUARE WHOLE FACE);
        if (out.points.has_colours) fail_msg("'%s' was read", name);
        /* Without a name there is no texture, and nothing to warn of. */
        assert_int_equal(out.content.warning_count, *name ? 1 : 0);
        assert_int_equal(out.mesh.triangle_count, 2);
    }
    write_text("a.mtl", MATERIAL); /* the same picture by its plain name */
    assert_true(read_mesh(SQUARE WHOLE FACE).points.has_colours);
    struct outcome out = read_mesh("mtllib ../a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    assert_int_equal(out.content.warning_count, 1);
    assert_false(out.points.has_colours);
}

static void pictures_that_are_none_are_left_out(void **state) {
    (void)state;
    size_t size;
    write_picture("t.png", 16, 16, chequered);
    write_text("a.mtl", MATERIAL);
    FILE *file = fopen(path_of("t.png"), "rb");
    unsigned char png[4096];
    size = fread(png, 1, sizeof png, file);
    fclose(file);
    for (size_t cut = 0; cut + 16 < size; cut += 3) { /* the last 16 bytes are checksum and end */
        write_bytes("t.png", png, cut);
        struct outcome out = read_mesh(SQUARE WHOLE FACE);
        assert_false(out.points.has_colours);
        assert_int_equal(out.content.warning_count, 1);
    }
    /* 60,000 times 60,000 texels by the header, in as few bytes. */
    memcpy(png + 16, "\000\000\352\140\000\000\352\140", 8);
    write_bytes("t.png", png, size);
    assert_false(read_mesh(SQUARE WHOLE FACE).points.has_colours);
    write_text("t.png", "\377\330\377\340");
    assert_false(read_mesh(SQUARE WHOLE FACE).points.has_colours);
}

/* ---- JPEG ---- */

#ifdef PBR_HAS_JPEG
/* All of one colour, which the transform keeps to a code or two. */
static size_t make_jpeg(uint32_t width, uint32_t height, bool progressive, unsigned char *out, size_t room) {
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    unsigned char *data = NULL, row[3 * 64];
    unsigned long size = 0;
    JSAMPROW rows[1] = {row};
    for (size_t x = 0; x < 3 * (size_t)width; x++) row[x] = x % 3 == 0 ? 200 : x % 3 == 1 ? 100 : 50;
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &data, &size);
    jpeg.image_width = width;
    jpeg.image_height = height;
    jpeg.input_components = 3;
    jpeg.in_color_space = JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, 95, TRUE);
    if (progressive) jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    for (uint32_t y = 0; y < height; y++) jpeg_write_scanlines(&jpeg, rows, 1);
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    assert_true(size <= room);
    memcpy(out, data, size);
    free(data);
    return size;
}

static void jpeg_is_read_too(void **state) {
    (void)state;
    unsigned char bytes[4096];
    write_text("a.mtl", "newmtl m\nmap_Kd t.jpg\n");
    for (int progressive = 0; progressive < 2; progressive++) {
        size_t size = make_jpeg(21, 19, progressive, bytes, sizeof bytes);
        write_bytes("t.jpg", bytes, size);
        struct outcome out = read_mesh(SQUARE WHOLE FACE);
        assert_int_equal(out.content.warning_count, 0);
        static const int CODES[] = {200, 100, 50};
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 3; k++) assert_true(abs(out.colours[4 * i + k] - CODES[k]) <= 3);
    }
}

/* Any prefix and any change gives a mesh, with a warning where there are no colours. */
static void damaged_jpeg_gives_a_mesh(void **state) {
    (void)state;
    unsigned char bytes[4096], copy[4096];
    uint64_t seed = 9;
    write_text("a.mtl", "newmtl m\nmap_Kd t.jpg\n");
    for (int progressive = 0; progressive < 2; progressive++) {
        size_t size = make_jpeg(21, 19, progressive, bytes, sizeof bytes);
        for (size_t cut = 0; cut + 1 < size; cut += 1 + cut / 16) {
            write_bytes("t.jpg", bytes, cut);
            assert_int_equal(read_mesh(SQUARE WHOLE FACE).content.warning_count, 1);
        }
        for (int round = 0; round < 300; round++) {
            memcpy(copy, bytes, size);
            for (int change = 0; change < 3; change++)
                copy[3 + random_next(&seed) % (size - 3)] = (unsigned char)random_next(&seed);
            write_bytes("t.jpg", copy, size);
            struct outcome out = read_mesh(SQUARE WHOLE FACE);
            assert_true(out.points.has_colours || out.content.warning_count == 1);
        }
    }
}
#else
static void jpeg_is_left_out_with_a_warning(void **state) {
    (void)state;
    write_text("a.mtl", "newmtl m\nmap_Kd t.jpg\n");
    write_text("t.jpg", "\377\330\377\340");
    struct outcome out = read_mesh(SQUARE WHOLE FACE);
    assert_int_equal(out.content.warning_count, 1);
    assert_false(out.points.has_colours);
}
#endif

static void coordinates_may_be_anything(void **state) {
    (void)state;
    static const char *const LINES[] = {"vt nan 0\n",      "vt 0 inf\n",      "vt\n",         "vt x\n",
                                        "vt 1e30 -1e30\n", "vt 1e-30 1e38\n", "vt 1e300 0\n", ""};
    write_picture("t.png", 64, 64, chequered);
    write_text("a.mtl", MATERIAL);
    for (size_t i = 0; i < sizeof LINES / sizeof *LINES; i++) {
        char text[400];
        snprintf(text, sizeof text, SQUARE "%svt 1 0\nvt 1 1\n" FACE, LINES[i]); /* 4/4 names none */
        struct outcome out = read_mesh(text);
        assert_int_equal(out.mesh.triangle_count, 2);
    }
}

/* What is changed at random gives a mesh, with colours or without. */
static void broken_anywhere_they_give_a_mesh(void **state) {
    (void)state;
    static const char LIBRARY[] = "newmtl m\nKd 1 0 0\nmap_Kd -s 1 1 1 t.png\nnewmtl n\nKd .5 .5 .5\nnewmtl o\nmap_Kd u.png\n";
    static const char MESH[] = SQUARE WHOLE "usemtl m\nf 1/1 2/2 3/3\nusemtl n\nf 1 3 4\nusemtl o\nf 1/1 2/2 4/4\n";
    uint64_t seed = 5;
    write_picture("t.png", 16, 16, chequered);
    write_picture("u.png", 8, 8, half_transparent);
    for (int round = 0; round < 400; round++) {
        char library[sizeof LIBRARY - 1];
        memcpy(library, LIBRARY, sizeof library);
        for (int change = 0; change < 4; change++) library[random_next(&seed) % sizeof library] = (char)(random_next(&seed) >> 8);
        write_bytes("a.mtl", library, sizeof library - random_next(&seed) % 9);
        assert_int_equal(read_mesh(MESH).mesh.triangle_count, 3);
    }
}

/* The same of the mesh itself, which may then be none. */
static void broken_meshes_give_a_mesh_points_or_an_error(void **state) {
    (void)state;
    static const char *const MESHES[] = {
        SQUARE WHOLE "usemtl m\nf 1/1 2/2 3/3\nf -4/-4 -2/-2 -1/-1 1/1\n",
        PLY_HEAD("ascii") "element vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
                          "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
                          "property int texnumber\nend_header\n" PLY_CORNERS
                          "3 0 1 2 6 0 .6 1 .6 1 .9 0\n4 0 3 4 5 8 0 0 0 0 0 0 1 1 1\n",
        PLY_HEAD("binary_little_endian") "element face 1\nproperty list uchar uchar vertex_indices\n"
                                         "property list uchar char texcoord\nelement vertex 3\nproperty char x\n"
                                         "property char y\nproperty char z\nend_header\n"
                                         "\003\001\002\001\006\001\001\002\002\003\003XYZabcUVW",
        PLY_HEAD("ascii") "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n"
                          "property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                          "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 .5\n3 0 1 2\n"};
    uint64_t seed = 3;
    write_picture("t.png", 16, 16, chequered);
    write_picture("u.png", 8, 8, half_transparent);
    write_picture("my texture.png", 8, 8, whole_grey);
    write_text("a.mtl", MATERIAL);
    for (size_t i = 0; i < sizeof MESHES / sizeof *MESHES; i++) {
        size_t size = strlen(MESHES[i]);
        char copy[600];
        assert_true(size < sizeof copy);
        assert_true(read_mesh(MESHES[i]).is_mesh);
        for (int round = 0; round < 500; round++) {
            memcpy(copy, MESHES[i], size);
            for (uint64_t change = 1 + random_next(&seed) % 4; change > 0; change--) {
                uint64_t kind = random_next(&seed);
                char *at = copy + (kind >> 32) % size;
                *at = kind % 2 ? (char)(kind >> 8) : (char)(*at ^ 1 << (kind >> 8 & 7));
            }
            size_t end = round % 4 ? size : size - random_next(&seed) % size;
            write_bytes("mesh", copy, end);
            pbr_result result = read_it(path_of("mesh"), NULL, end, PBR_READ_KEEP_RADII).result;
            assert_true(result == PBR_OK || result == PBR_ERROR_FORMAT || result == PBR_ERROR_UNSUPPORTED ||
                        result == PBR_ERROR_LIMIT);
        }
    }
}

int main(void) {
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)
    const struct CMUnitTest tests[] = {
        IN_FOLDER(one_colour_stays_itself),
        IN_FOLDER(means_are_those_of_the_hat_functions),
        IN_FOLDER(triangles_weigh_as_their_areas),
        IN_FOLDER(means_are_taken_in_linear_light),
        IN_FOLDER(what_is_transparent_has_no_say),
        IN_FOLDER(the_picture_stands_upright_and_repeats),
        IN_FOLDER(corners_have_their_own_coordinates),
        IN_FOLDER(colours_of_the_vertices_come_first),
        IN_FOLDER(without_its_texture_a_material_has_kd),
        IN_FOLDER(names_may_have_options_blanks_and_folders),
        IN_FOLDER(vertices_of_ply_may_have_coordinates),
        IN_FOLDER(polygons_of_ply_may_have_coordinates),
        IN_FOLDER(binary_lists_are_found_too),
        IN_FOLDER(ply_without_coordinates_has_no_colours),
        IN_FOLDER(files_outside_of_the_folder_are_not_read),
        IN_FOLDER(pictures_that_are_none_are_left_out),
#ifdef PBR_HAS_JPEG
        IN_FOLDER(jpeg_is_read_too),
        IN_FOLDER(damaged_jpeg_gives_a_mesh),
#else
        IN_FOLDER(jpeg_is_left_out_with_a_warning),
#endif
        IN_FOLDER(coordinates_may_be_anything),
        IN_FOLDER(broken_anywhere_they_give_a_mesh),
        IN_FOLDER(broken_meshes_give_a_mesh_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
