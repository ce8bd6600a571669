/* PLY written in the test: what each rule of the reader gives, in every encoding, and whole or broken anywhere.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <pbr/io.h>
#include <pthread.h>
#include <time.h>

#define VERTEX "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
#define FACES(n) "element face " #n "\nproperty list uchar int vertex_indices\n"
#define ROWS "0 0 0\n1 0 0\n0 1 0\n"

struct outcome {
    pbr_result result;
    pbr_file_content content;
    pbr_points_info points;
    pbr_mesh_info mesh;
    double positions[64];
    uint8_t colours[64];
    float scalar[16], radii[16], normals[48];
    char error[512];
    int warnings;
};

/* Reads, and copies what the points of a small file hold. */
static struct outcome read_bytes(const void *data, size_t size) {
    struct host host;
    struct outcome out = {.content = PBR_FILE_CONTENT_INIT, .points = PBR_POINTS_INFO_INIT, .mesh = PBR_MESH_INFO_INIT};
    pbr_instance *instance = host_instance(&host);
    char *exact = malloc(size ? size : 1); /* so that a byte too far is seen by the address sanitizer */
    assert_non_null(exact);
    memcpy(exact, data, size);
    out.result = pbr_read_memory(instance, "text.ply", exact, size, NULL, &out.content);
    free(exact);
    if (out.content.points) {
        assert_int_equal(pbr_points_get_info(out.content.points, &out.points), PBR_OK);
        if (out.points.count > 0 && out.points.count <= 16) {
            pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
            copy.positions = out.positions;
            copy.colours = out.points.has_colours ? out.colours : NULL;
            copy.radii = out.points.has_radii ? out.radii : NULL;
            copy.normals = out.points.has_normals ? out.normals : NULL;
            copy.scalar = out.points.scalar_count ? out.scalar : NULL;
            assert_int_equal(pbr_points_copy(out.content.points, 0, out.points.count, &copy), PBR_OK);
        }
    }
    if (out.content.mesh) assert_int_equal(pbr_mesh_get_info(out.content.mesh, &out.mesh), PBR_OK);
    if (out.result != PBR_OK) {
        assert_null(out.content.points);
        assert_null(out.content.mesh);
    }
    pbr_points_release(&out.content.points);
    pbr_mesh_release(&out.content.mesh);
    memcpy(out.error, host.error, sizeof out.error);
    out.warnings = host.warnings;
    assert_true(host.errors == (out.result != PBR_OK));
    /* The reader's own arrays and what is made from them, each bounded by the bytes there are. */
    assert_true(host.peak <= 48 * size + ((size_t)64 << 20));
    host_finish(&host, instance);
    return out;
}

static struct outcome read_text(const char *text) {
    return read_bytes(text, strlen(text));
}

static void rows_need_not_be_lines(void **state) {
    (void)state;
    const char *texts[] = {
        "ply\nformat ascii 1.0\n" VERTEX FACES(2) "end_header\n" ROWS "3 0 1 2\n3 2 1 0\n",
        "ply\nformat ascii 1.0\n" VERTEX FACES(2) "end_header\n0 0\n0 1 0 0 0\n1 0 3 0 1 2 3 2\n1\n\n0",
        "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\nelement face "
        "2\r\n"
        "property list uchar int vertex_index\r\nend_header\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 2\r\n3 2 1 0\r\n",
        "ply\rformat ascii 1.0\relement vertex 3\rproperty float x\rproperty float y\rproperty float z\relement face 2\r"
        "property list uchar int vertex_index\rend_header\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r3 2 1 0\r",
        "ply\n  format   ascii 1.0 \nobj_info x\n\ncomment y\n" VERTEX FACES(2) "comment z\nend_header \n" ROWS
                                                                                "\n\n3.0 0 1e0 2.\n 3 2 1 0",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct outcome out = read_text(texts[i]);
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.content.vertex_count, 3);
        assert_int_equal(out.content.face_count, 2);
        assert_int_equal(out.mesh.triangle_count, 2);
        assert_int_equal(out.content.warning_count, 0);
    }
}

/* A polygon is fanned as it is read: the triangles before a corner that is not there are taken back, but they were written. */
static void polygons_with_a_bad_last_corner_leave_no_trace(void **state) {
    (void)state;
    static const unsigned char POLYGONS[] = {3, 0, 1, 2, 9, 0, 1, 2, 0, 1, 2, 0, 1, 99};
    char file[512];
    int at = snprintf(file, sizeof file,
                      "ply\nformat binary_little_endian 1.0\n" VERTEX "element face 2\nproperty list uchar uchar vertex_indices\n"
                      "end_header\n");
    memset(file + at, 0, 36);
    memcpy(file + at + 36, POLYGONS, sizeof POLYGONS);
    struct outcome binary = read_bytes(file, (size_t)at + 36 + sizeof POLYGONS);
    struct outcome text =
        read_text("ply\nformat ascii 1.0\n" VERTEX FACES(2) "end_header\n" ROWS "3 0 1\n2 9 0 1 2 0 1 2 0 1 99\n");
    for (int i = 0; i < 2; i++) {
        const struct outcome *out = i ? &text : &binary;
        assert_int_equal(out->result, PBR_OK);
        assert_int_equal(out->content.face_count, 2);
        assert_int_equal(out->mesh.triangle_count, 1);
        assert_int_equal(out->content.warning_count, 1);
    }
}

/* Writes one number in binary. */
static size_t put(unsigned char *to, size_t at, double value, const char *type, bool big) {
    unsigned char bytes[8];
    size_t size = 0;
    uint64_t bits = 0;
    float narrow = (float)value;
    if (strcmp(type, "double") == 0) {
        memcpy(&bits, &value, 8);
        size = 8;
    } else if (strcmp(type, "float") == 0) {
        uint32_t word;
        memcpy(&word, &narrow, 4);
        bits = word;
        size = 4;
    } else {
        bits = (uint64_t)(int64_t)value;
        size = strstr(type, "char") ? 1 : strstr(type, "short") ? 2 : 4;
    }
    for (size_t i = 0; i < size; i++) bytes[big ? size - 1 - i : i] = (unsigned char)(bits >> (8 * i));
    memcpy(to + at, bytes, size);
    return at + size;
}

/* Every type, in text and both byte orders, arrives as the same number: as coordinate, as scalar, beside lists that are skipped. */
static void every_type_and_encoding_reads_the_same(void **state) {
    (void)state;
    static const struct {
        const char *type;
        double values[3];
    } TYPES[] = {{"char", {-128, 0, 127}},
                 {"uchar", {0, 7, 255}},
                 {"short", {-32768, 1, 32767}},
                 {"ushort", {0, 2, 65535}},
                 {"int", {-2147483647, 3, 2147483647}},
                 {"uint", {0, 4, 4294967295.0}},
                 {"float", {-1.5, 0.25, 3e30}},
                 {"double", {-1.1, 596648.123456789, 1e-300}}};
    static const char *const ENCODINGS[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    for (size_t t = 0; t < 8; t++)
        for (int e = 0; e < 3; e++) {
            unsigned char file[2048];
            const char *type = TYPES[t].type;
            size_t at = (size_t)snprintf(
                (char *)file, sizeof file,
                "ply\nformat %s 1.0\nelement thing 1\nproperty list ushort %s l\nproperty double d\nelement vertex 1\n"
                "property %s z\nproperty list uchar double skipped\nproperty %s y\nproperty %s x\nproperty %s s\n"
                "end_header\n",
                ENCODINGS[e], type, type, type, type, type);
            const double *v = TYPES[t].values;
            if (e == 0) {
                at += (size_t)snprintf((char *)file + at, sizeof file - at, "2 1 2 9\n%.17g 1 5 %.17g %.17g %.17g\n", v[2], v[1],
                                       v[0], v[1]);
            } else {
                at = put(file, at, 2, "ushort", e == 2);
                for (int i = 0; i < 2; i++) at = put(file, at, 1, type, e == 2);
                at = put(file, at, 9, "double", e == 2);
                at = put(file, at, v[2], type, e == 2);
                at = put(file, at, 1, "uchar", e == 2);
                at = put(file, at, 5, "double", e == 2);
                for (int i = 0; i < 3; i++) at = put(file, at, i == 0 ? v[1] : i == 1 ? v[0] : v[1], type, e == 2);
            }
            struct outcome out = read_bytes(file, at);
            assert_int_equal(out.result, PBR_OK);
            assert_int_equal(out.content.warning_count, 0);
            assert_string_equal(out.content.encoding, ENCODINGS[e]);
            /* Points keep positions to 1/128 of a radius or to float; one point is its own origin or exact. */
            for (int k = 0; k < 3; k++) {
                double want = t == 6 ? (double)(float)v[k] : v[k];
                assert_true(fabs(out.positions[k] - want) <= fabs(want) * 1e-7);
            }
            assert_int_equal(out.points.scalar_count, 1);
            assert_true(out.scalar[0] == (float)v[1]);
        }
}

static void colours_of_every_kind_become_8_bit_srgb(void **state) {
    (void)state;
    /* Half of linear light is 188 in sRGB: 1.055 * 0.5^(1/2.4) - 0.055 = 0.7354, times 255. */
    static const struct {
        const char *properties, *row;
        uint8_t expected[4];
    } CASES[] = {
        {"property uchar red\nproperty uchar green\nproperty uchar blue\n", "1 2 255", {1, 2, 255, 255}},
        {"property uchar r\nproperty uchar g\nproperty uchar b\nproperty uchar a\n", "1 2 255 7", {1, 2, 255, 7}},
        {"property uchar diffuse_blue\nproperty uchar diffuse_green\nproperty uchar diffuse_red\n", "1 2 255", {255, 2, 1, 255}},
        {"property ushort red\nproperty ushort green\nproperty ushort blue\n", "257 514 65535", {1, 2, 255, 255}},
        {"property int red\nproperty char green\nproperty int blue\n", "1 200 300", {1, 200, 255, 255}},
        {"property uchar red\nproperty ushort green\nproperty uchar blue\n", "1 514 255", {1, 2, 255, 255}},
        {"property float red\nproperty float green\nproperty double blue\nproperty uchar alpha\n",
         "0 0.5 2 51",
         {0, 188, 255, 51}}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        char text[1024];
        snprintf(text, sizeof text,
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n%send_header\n0 0 "
                 "0 %s\n",
                 CASES[i].properties, CASES[i].row);
        struct outcome out = read_text(text);
        assert_int_equal(out.result, PBR_OK);
        assert_true(out.points.has_colours);
        assert_memory_equal(out.colours, CASES[i].expected, 4);
        assert_int_equal(out.points.scalar_count, 0);
    }
    struct outcome mixed =
        read_text("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float "
                  "red\nproperty uchar green\nproperty uchar blue\nend_header\n0 0 0 1 2 3\n");
    assert_int_equal(mixed.content.warning_count, 1);
    assert_false(mixed.points.has_colours);
    assert_int_equal(mixed.points.scalar_count, 3);
}

static void radius_normal_and_other_properties_find_their_places(void **state) {
    (void)state;
    struct outcome out =
        read_text("ply\nformat ascii 1.0\nelement vertex 2\nproperty float radius\nproperty float nz\nproperty float ny\nproperty "
                  "float nx\nproperty float x\nproperty float y\nproperty float z\nproperty float value\nend_header\n"
                  "0.5 1 0 0 1 2 3 9\n0.25 0 1 0 4 5 6 nan\n");
    assert_int_equal(out.result, PBR_OK);
    assert_true(out.points.has_radii && out.points.has_normals);
    assert_true(out.radii[0] == 0.5f && out.radii[1] == 0.25f);
    assert_true(out.scalar[0] == 9 && isnan(out.scalar[1]));
    assert_true(fabsf(out.normals[2] - 1) < 1e-3f && fabsf(out.normals[4] - 1) < 1e-3f); /* octahedral: 1.1e-4 rad */
}

static void strips_alternate_and_restart(void **state) {
    (void)state;
    const char *head =
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\n"
        "property list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
    static const struct {
        const char *strip;
        uint64_t triangles;
        uint32_t warnings;
    } CASES[] = {{"6 0 1 2 3 4 5", 4, 0}, {"8 0 1 2 -1 3 4 5 -1", 2, 0}, {"7 0 1 2 2 3 4 5", 4 - 1, 0}, {"6 0 1 2 77 3 4", 1, 1}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        char text[1024];
        snprintf(text, sizeof text, "%s%s\n", head, CASES[i].strip);
        struct outcome out = read_text(text);
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.mesh.triangle_count, CASES[i].triangles);
        assert_int_equal(out.content.face_count, CASES[i].triangles);
        assert_int_equal(out.content.warning_count, CASES[i].warnings);
    }
}

static void bad_faces_are_left_out_and_counted(void **state) {
    (void)state;
    struct outcome out = read_text("ply\nformat ascii 1.0\n" VERTEX FACES(6) "end_header\n" ROWS
                                                                             "3 0 1 2\n3 0 1 3\n2 0 1\n4 0 1 2 -1\n3 0 1 1.5\n0\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.content.face_count, 6);
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 5); /* three out of range, two too short */
    assert_int_equal(out.warnings, 2);
}

static void faces_may_come_before_their_vertices(void **state) {
    (void)state;
    struct outcome out = read_text("ply\nformat ascii 1.0\n" FACES(2) VERTEX "end_header\n3 0 1 2\n3 2 1 0\n" ROWS);
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.mesh.triangle_count, 2);
    out = read_text("ply\nformat ascii 1.0\n" FACES(2) VERTEX "end_header\n3 0 1 2\n3 1 1 0\n0 0 0\n1 0 0\n");
    assert_int_equal(out.content.vertex_count, 2);
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 2); /* the data ends; a face refers to what is missing */
}

static void each_fault_has_its_result_and_place(void **state) {
    (void)state;
    static const struct {
        const char *text;
        pbr_result result;
        const char *place;
    } CASES[] = {
        {"", PBR_ERROR_UNSUPPORTED, "byte 0"},
        {"ply", PBR_ERROR_UNSUPPORTED, "byte 0"},
        {"plyx\n", PBR_ERROR_UNSUPPORTED, "byte 0"},
        {"ply\n", PBR_ERROR_FORMAT, "line 2"},
        {"ply\nformat ascii 1.0\n", PBR_ERROR_FORMAT, "line 3"},
        {"ply\n" VERTEX "end_header\n" ROWS, PBR_ERROR_FORMAT, "line 6"},
        {"ply\nformat binary 1.0\nend_header\n", PBR_ERROR_FORMAT, "line 2"},
        {"ply\nformat\nend_header\n", PBR_ERROR_FORMAT, "line 2"},
        {"ply\nformat ascii 1.0\nproperty float x\nend_header\n", PBR_ERROR_FORMAT, "line 3"},
        {"ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", PBR_ERROR_FORMAT, "line 3"},
        {"ply\nformat ascii 1.0\nelement vertex 99999999999999999999\nend_header\n", PBR_ERROR_FORMAT, "line 3"},
        {"ply\nformat ascii 1.0\nelement vertex\nend_header\n", PBR_ERROR_FORMAT, "line 3"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty string x\nend_header\n", PBR_ERROR_FORMAT, "line 4"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\nend_header\n", PBR_ERROR_FORMAT, "line 4"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproprty float x\nend_header\n", PBR_ERROR_FORMAT, "line 4"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\nend_header\n1 "
         "1 1 1\n",
         PBR_ERROR_UNSUPPORTED, "line 7"},
        {"ply\nformat ascii 1.0\n" VERTEX "end_header\n0 0 0\n0 zero 0\n0 0 0\n", PBR_ERROR_FORMAT, "line 9"},
        {"ply\nformat ascii 1.0\n" VERTEX FACES(1) "end_header\n" ROWS "-3 0 1 2\n", PBR_ERROR_FORMAT, "line 13"},
        {"ply\nformat ascii 1.0\n" VERTEX FACES(1) "end_header\n" ROWS "2.5 0 1 2\n", PBR_ERROR_FORMAT, "line 13"},
        {"ply\nformat ascii 1.0\n" VERTEX "end_header\n", PBR_ERROR_FORMAT, "line 8"},
        {"ply\nformat ascii 1.0\n" VERTEX "end_header\n0 0", PBR_ERROR_FORMAT, "line 8"},
        {"ply\nformat ascii 1.0\nelement thing 5\nproperty float w\n" VERTEX "end_header\n1 2 ", PBR_ERROR_FORMAT, "line 10"},
        {"ply\nformat binary_big_endian 1.0\n" VERTEX "end_header\n0123456789", PBR_ERROR_FORMAT, "byte 112"},
        {"ply\nformat binary_little_endian 1.0\n" VERTEX "element face 1\nproperty list char int vertex_indices\nend_header\n"
         "012345678901012345678901012345678901\377",
         PBR_ERROR_FORMAT, "byte 204"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != CASES[i].result || !strstr(out.error, CASES[i].place) || strncmp(out.error, "text.ply: ", 10) != 0)
            fail_msg("case %zu: %s, '%s'", i, pbr_result_name(out.result), out.error);
    }
}

static void absurd_counts_allocate_nothing_that_is_not_there(void **state) {
    (void)state;
    /* read_bytes holds the bound on memory. */
    static const char *const TEXTS[] = {
        "ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty float "
        "z\nend_header\n0 0 0\n1 0 0\n",
        "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\nproperty char x\nproperty char y\nproperty "
        "char z\nend_header\n"
        "abcdef",
        "ply\nformat ascii 1.0\nelement none 18446744073709551615\nelement vertex 2\nproperty float x\nproperty float y\nproperty "
        "float z\n"
        "end_header\n0 0 0\n1 0 0\n",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nelement face "
        "4294967295\nproperty list uint "
        "int vertex_indices\nend_header\n0 0 0\n1 0 0\n4294967295 0 1 0",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty "
        "list uint int "
        "vertex_indices\nend_header\n0 0 0\n1 0 0\n9007199254740992 0 1 0 1 0 1 0 1 1 0 1 0 1 0 1\n",
        "ply\nformat ascii 1.0\nelement vertex 900\nproperty float x\nproperty float y\nproperty float "
        "z\nend_header\n0\n0\n0\n1\n0\n0\n",
    };
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) {
        struct outcome out = read_text(TEXTS[i]);
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.content.vertex_count, 2);
        assert_true(out.content.warning_count == (i == 2 ? 0 : 1));
    }
}

#define BIG_ENDIAN_STRIP                                                                                                           \
    "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty list uchar uchar l\nproperty float y\n"       \
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement tristrips 1\n"                       \
    "property list int int vertex_indices\nend_header\n"

static const char *const WHOLE[] = {
    "ply\nformat ascii 1.0\n" VERTEX FACES(2) "end_header\n0.5 0 0\n1.25 0 0\n0 1e1 0\n3 0 1 2\n4 2 1 0 1\n",
    "ply\nformat binary_little_endian 1.0\n" VERTEX FACES(1) "end_header\n",
    BIG_ENDIAN_STRIP,
};

/* File i of WHOLE with its binary data. */
static size_t whole_file(int i, unsigned char *file) {
    size_t at = strlen(WHOLE[i]);
    bool big = i == 2;
    memcpy(file, WHOLE[i], at);
    for (int v = 0; v < 3 && i > 0; v++) {
        at = put(file, at, v, "float", big);
        if (big) at = put(file, put(file, at, 1, "uchar", big), 9, "uchar", big);
        at = put(file, put(file, at, v * v, "float", big), 1, "float", big);
        for (int k = 0; k < 3 && big; k++) at = put(file, at, 100 + k, "uchar", big);
    }
    if (i > 0) at = put(file, at, 3, big ? "int" : "uchar", big);
    for (int k = 0; k < 3 && i > 0; k++) at = put(file, at, k, "int", big);
    return at;
}

static void a_file_cut_anywhere_gives_its_whole_vertices_or_an_error(void **state) {
    (void)state;
    for (int i = 0; i < 3; i++) {
        unsigned char file[1024];
        size_t size = whole_file(i, file), header = strlen(WHOLE[i]);
        if (i == 0) header = (size_t)(strstr(WHOLE[0], "end_header") - WHOLE[0]) + 11;
        struct outcome whole = read_bytes(file, size);
        assert_int_equal(whole.result, PBR_OK);
        assert_int_equal(whole.content.warning_count, 0);
        uint64_t last = 0;
        for (size_t cut = 0; cut < size; cut++) {
            struct outcome out = read_bytes(file, cut);
            if (cut < header - (i == 0)) assert_int_not_equal(out.result, PBR_OK);
            if (out.result != PBR_OK) continue;
            assert_true(out.content.vertex_count >= last && out.content.vertex_count <= 3);
            /* Only the last byte, a line end, may be missing unnoticed. */
            assert_int_equal(out.content.warning_count, i == 0 && cut == size - 1   ? 0
                                                        : out.content.warning_count ? out.content.warning_count
                                                                                    : 1);
            last = out.content.vertex_count;
        }
        assert_int_equal(last, 3);
    }
}

static void flipped_bytes_never_crash(void **state) {
    (void)state;
    uint64_t r = 2463534242u;
    for (int n = 0; n < 6000; n++) {
        unsigned char file[1024];
        size_t size = whole_file(n % 3, file);
        for (uint64_t k = random_next(&r) % 4 + 1; k > 0; k--) file[random_next(&r) % size] = (unsigned char)random_next(&r);
        struct outcome out = read_bytes(file, size); /* which checks memory, leaks and that an error is told once */
        assert_true(out.result == PBR_OK || out.result == PBR_ERROR_FORMAT || out.result == PBR_ERROR_UNSUPPORTED);
    }
}

/* Large enough for several pieces on several threads; one long row per file, at a random place, is split over two lines. */
static void pieces_and_tokens_read_the_same(void **state) {
    (void)state;
    enum { VERTICES = 60000, FACE_ROWS = 60000 };
    size_t room = 8u << 20, at = 0;
    char *text = malloc(room);
    assert_non_null(text);
    for (int split = 0; split < 2; split++) {
        at = (size_t)snprintf(
            text, room,
            "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n",
            VERTICES, FACE_ROWS);
        for (int i = 0; i < VERTICES; i++)
            at += (size_t)snprintf(text + at, room - at, "%d.5 %d%c%d\n", i, i % 100, split && i == 41234 ? '\n' : ' ', i % 7);
        for (int i = 0; i < FACE_ROWS; i++) {
            int a = i % (VERTICES - 3);
            /* Every hundredth refers to a vertex that is not there, every seventh is a quad. */
            if (i % 100 == 0) at += (size_t)snprintf(text + at, room - at, "3 %d %d %d\n", a, a + 1, VERTICES);
            else if (i % 7 == 0)
                at += (size_t)snprintf(text + at, room - at, "4 %d %d %d%c%d\n", a, a + 1, a + 2,
                                       split && i == 50001 - 50001 % 7 ? '\n' : ' ', a + 3);
            else at += (size_t)snprintf(text + at, room - at, "3 %d %d %d\n", a, a + 1, a + 2);
        }
        struct outcome out = read_bytes(text, at);
        uint64_t quads = 0;
        for (int i = 0; i < FACE_ROWS; i++) quads += i % 7 == 0 && i % 100 != 0;
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.content.vertex_count, VERTICES);
        assert_int_equal(out.content.face_count, FACE_ROWS);
        assert_int_equal(out.content.warning_count, FACE_ROWS / 100);
        assert_int_equal(out.mesh.triangle_count, FACE_ROWS - FACE_ROWS / 100 + quads);
    }
    free(text);
}

/* ---- polygons in binary ---- */

enum { POLYGON_VERTICES = 50, POLYGON_ROWS = 9000, POLYGON_MOST = 2 * POLYGON_ROWS };

static uint32_t get_index(const unsigned char *p, bool big) {
    uint32_t value = 0;
    for (int i = 0; i < 4; i++) value |= (uint32_t)p[i] << 8 * (big ? 3 - i : i);
    return value;
}

/* Fans the rows in [p, end), each `before` bytes, a list and `after` bytes, by the book. Returns the triangles' number. `faces`
 * counts a last list, too, that is whole in a row that is not. */
static size_t fan_rows(const unsigned char *p, const unsigned char *end, bool big, size_t before, size_t after, uint32_t (*out)[3],
                       uint64_t *faces) {
    size_t count = 0;
    for (*faces = 0; *faces < POLYGON_ROWS && (size_t)(end - p) > before;) {
        const unsigned char *list = p + before + 1;
        size_t corners = p[before], left = (size_t)(end - list);
        bool there = true;
        *faces += left >= 4 * corners;
        if (left < 4 * corners + after) break;
        for (size_t i = 0; i < corners; i++) there &= get_index(list + 4 * i, big) < POLYGON_VERTICES;
        for (size_t i = 2; i < corners && there; i++, count++) {
            assert_true(count < POLYGON_MOST);
            out[count][0] = get_index(list, big);
            for (size_t k = 1; k < 3; k++) out[count][k] = get_index(list + 4 * (i - 2 + k), big);
        }
        p = list + 4 * corners + after;
    }
    return count;
}

/* The rows that are no triangle come late, or all along (`mixed`). */
static size_t put_rows(unsigned char *file, size_t at, bool big, size_t before, size_t after, bool mixed, uint64_t *random) {
    for (int row = 0; row < POLYGON_ROWS; row++) {
        unsigned kind = mixed || row > 8500 ? (unsigned)(random_next(random) % 32) : 32, corners = 3;
        if (kind < 5) corners = kind == 3 ? 0 : 2 + kind; /* 2, 3, 4, 0, 6 */
        for (size_t i = 0; i < before; i++) file[at++] = 3;
        file[at++] = (unsigned char)corners;
        for (unsigned i = 0; i < corners; i++) {
            double index = kind == 8 ? 0 : (double)(random_next(random) % POLYGON_VERTICES); /* zeros: in range wherever read */
            if (kind >= 5 && kind < 8 && i == kind - 5)
                index = kind == 5 ? 4294967295.0 : kind == 6 ? 2147483648.0 : POLYGON_VERTICES;
            at = put(file, at, index, "uint", big);
        }
        for (size_t i = 0; i < after; i++) file[at++] = 3;
    }
    return at;
}

static void check_polygons(const unsigned char *file, size_t size, uint64_t faces, const uint32_t (*triangles)[3], size_t count) {
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_mesh_info info = PBR_MESH_INFO_INIT;
    pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
    unsigned char *exact = malloc(size);
    uint32_t *indices = malloc((count > 0 ? count : 1) * sizeof *triangles);
    assert_non_null(exact);
    assert_non_null(indices);
    memcpy(exact, file, size);
    assert_int_equal(pbr_read_memory(instance, NULL, exact, size, NULL, &content), PBR_OK);
    assert_int_equal(content.face_count, faces);
    assert_int_equal(pbr_mesh_get_info(content.mesh, &info), PBR_OK);
    assert_int_equal(info.triangle_count, count);
    copy.triangle_count = count;
    copy.triangles = indices;
    assert_int_equal(pbr_mesh_copy(content.mesh, &copy), PBR_OK);
    assert_memory_equal(indices, triangles, count * sizeof *triangles);
    pbr_mesh_release(&content.mesh);
    free(exact);
    free(indices);
    host_finish(&host, instance);
}

/* Triangles, other polygons, faulty ones, numbers beside them, a length that is wrong, and an end anywhere in the last rows. */
static void triangles_are_read_as_all_polygons_are(void **state) {
    (void)state;
    static const size_t ROOM = (size_t)POLYGON_ROWS * 32;
    unsigned char *file = malloc(ROOM);
    uint32_t(*triangles)[3] = malloc(POLYGON_MOST * sizeof *triangles);
    uint64_t random = 88172645463325252u;
    assert_non_null(file);
    assert_non_null(triangles);
    for (unsigned kind = 0; kind < 32; kind++) {
        const bool big = kind & 1, beside = kind & 2, mixed = kind & 8, wrong = kind & 16;
        const size_t before = beside ? 1 : 0, after = beside ? 2 : 0;
        size_t at = (size_t)snprintf((char *)file, ROOM,
                                     "ply\nformat binary_%s_endian 1.0\nelement vertex %d\nproperty uchar x\nproperty uchar y\n"
                                     "property uchar z\nelement face %d\n%sproperty list uchar %s vertex_indices\n%send_header\n",
                                     big ? "big" : "little", POLYGON_VERTICES, POLYGON_ROWS, beside ? "property uchar a\n" : "",
                                     kind & 4 ? "uint" : "int", beside ? "property short b\n" : "");
        for (int i = 0; i < 3 * POLYGON_VERTICES; i++) file[at++] = (unsigned char)random_next(&random);
        const size_t start = at, end = put_rows(file, at, big, before, after, mixed, &random);
        if (wrong) file[start + 4000 * (13 + before + after) + before] = 5; /* without the mixture: of row 4000 */
        for (size_t cut = 0; cut < (wrong ? 1 : 20); cut++) {
            uint64_t faces;
            size_t count = fan_rows(file + start, file + end - cut, big, before, after, triangles, &faces);
            assert_true(wrong || count > POLYGON_ROWS / 2);
            check_polygons(file, end - cut, faces, (const uint32_t(*)[3])triangles, count);
        }
    }
    free(file);
    free(triangles);
}

/* What one corner of a row may be instead, out of range; 0: none is. */
static const struct {
    const char *type;
    double index;
} faults[] = {{"int", 0},           {"uint", 0}, {"int", 0}, {"uint", 0}, {"int", POLYGON_VERTICES}, {"uint", 4294967295.0},
              {"int", 2147483648.0}};

/* Two elements of triangles alone, the first of which takes more than one step of those that are read in parallel: whole, and with
 * a single fault somewhere. Index 0 is none. */
static void triangles_alone_are_read_as_all_polygons_are(void **state) {
    (void)state;
    enum { FIRST = 140000, SECOND = 9000, ROWS_IN_ALL = FIRST + SECOND };
    static const size_t ROOM = (size_t)ROWS_IN_ALL * 20 + 4096;
    unsigned char *file = malloc(ROOM);
    uint32_t(*triangles)[3] = malloc(ROWS_IN_ALL * sizeof *triangles);
    uint64_t random = 7;
    assert_non_null(file);
    assert_non_null(triangles);
    for (unsigned kind = 0; kind < sizeof faults / sizeof *faults; kind++) {
        const bool big = kind & 2, beside = (kind & 1) == (kind & 2) / 2;
        const double fault = faults[kind].index;
        const char *type = faults[kind].type, *before = beside ? "property uchar a\n" : "";
        const int faulty = fault > 0 ? (int)(random_next(&random) % ROWS_IN_ALL) : -1;
        size_t count = 0, at;
        at = (size_t)snprintf((char *)file, ROOM,
                              "ply\nformat binary_%s_endian 1.0\nelement vertex %d\nproperty uchar x\nproperty uchar y\n"
                              "property uchar z\nelement face %d\n%sproperty list uchar %s vertex_indices\nelement face %d\n"
                              "%sproperty list uchar %s vertex_indices\nend_header\n",
                              big ? "big" : "little", POLYGON_VERTICES, FIRST, before, type, SECOND, before, type);
        for (int i = 0; i < 3 * POLYGON_VERTICES; i++) file[at++] = (unsigned char)random_next(&random);
        for (int row = 0; row < ROWS_IN_ALL; row++) {
            if (beside) file[at++] = 3;
            file[at++] = 3;
            for (int k = 0; k < 3; k++) {
                triangles[count][k] = (uint32_t)(random_next(&random) % POLYGON_VERTICES);
                at = put(file, at, row == faulty && k == row % 3 ? fault : triangles[count][k], "uint", big);
            }
            count += row != faulty;
        }
        check_polygons(file, at, ROWS_IN_ALL, (const uint32_t(*)[3])triangles, count);
    }
    free(file);
    free(triangles);
}

struct watcher {
    int calls, stop_at, reading;
    bool is_slow;
    pthread_t caller;
    double last;
    const char *stage;
};

static int watch(void *user, const char *stage, double fraction) {
    struct watcher *watcher = user;
    if (watcher->stage && strcmp(watcher->stage, stage) == 0) assert_true(fraction >= watcher->last);
    assert_true(fraction >= 0 && fraction <= 1);
    assert_true(pthread_equal(watcher->caller, pthread_self()));
    watcher->stage = stage;
    watcher->last = fraction;
    watcher->reading += strcmp(stage, "reading") == 0;
    if (watcher->is_slow) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL); /* in which other threads get ahead */
    return ++watcher->calls != watcher->stop_at;
}

static void progress_rises_and_cancel_leaves_nothing(void **state) {
    (void)state;
    const char *text = "ply\nformat ascii 1.0\n" VERTEX FACES(2) "end_header\n" ROWS "3 0 1 2\n3 2 1 0\n";
    int calls = 1;
    for (int stop = 0; stop <= calls; stop++) {
        struct host host;
        struct watcher watcher = {.stop_at = stop, .caller = pthread_self()};
        pbr_instance *instance = host_instance(&host);
        pbr_file_content content = PBR_FILE_CONTENT_INIT;
        pbr_read_desc desc = PBR_READ_DESC_INIT;
        desc.progress = watch;
        desc.progress_user = &watcher;
        pbr_result result = pbr_read_memory(instance, NULL, text, strlen(text), &desc, &content);
        assert_int_equal(result, stop == 0 ? PBR_OK : PBR_ERROR_CANCELLED);
        if (stop == 0) calls = watcher.calls;
        if (stop != 0) assert_null(content.mesh);
        pbr_mesh_release(&content.mesh);
        host_finish(&host, instance);
    }
    assert_true(calls >= 3);
}

/* However large a file is, and on the thread that reads it; and it can be cancelled on the way. */
static void progress_is_told_a_few_dozen_times(void **state) {
    (void)state;
    enum { ROWS_OF_LARGE = 500000, ROOM = 64 << 20 };
    static const char *const HEADS[] = {"", "format ascii 1.0", "format binary_little_endian 1.0"};
    char *file = malloc(ROOM);
    assert_non_null(file);
    for (size_t h = 0; h < sizeof HEADS / sizeof *HEADS; h++) {
        size_t size = 0;
        if (h > 0)
            size = (size_t)snprintf(
                file, ROOM, "ply\n%s\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
                HEADS[h], ROWS_OF_LARGE);
        for (int i = 0; i < ROWS_OF_LARGE; i++) {
            const float p[3] = {(float)i, (float)(i % 100) + 0.5f, 1};
            if (h == 2) memcpy(file + size, p, sizeof p), size += sizeof p;
            else size += (size_t)snprintf(file + size, ROOM - size, "%d %d.5 1\n", i, i % 100);
        }
        for (int i = 0; i < 4; i++) {
            const uint32_t threads = 1 + (uint32_t)i / 2;
            struct host host;
            struct watcher watcher = {.stop_at = i % 2 ? 3 : 0, .caller = pthread_self()};
            pbr_instance *instance = host_instance_of_threads(&host, threads);
            pbr_file_content content = PBR_FILE_CONTENT_INIT;
            pbr_read_desc desc = PBR_READ_DESC_INIT;
            desc.flags = PBR_READ_KEEP_RADII;
            desc.progress = watch;
            desc.progress_user = &watcher;
            const pbr_result result = pbr_read_memory(instance, NULL, file, size, &desc, &content);
            assert_int_equal(result, watcher.stop_at ? PBR_ERROR_CANCELLED : PBR_OK);
            if (result == PBR_OK) {
                assert_int_equal(content.vertex_count, ROWS_OF_LARGE);
                assert_true(watcher.reading <= 36);
                assert_true(watcher.reading >= 10 || threads > 1); /* another thread may be faster */
            }
            pbr_points_release(&content.points);
            host_finish(&host, instance);
        }
    }
    free(file);
}

/* Also while another thread finds out that faces are to be read in another way. */
static void a_cancel_is_never_lost(void **state) {
    (void)state;
    enum { VERTICES = 10, FACES = 200000, BAD = 10000, ROW = 13 };
    char *file = malloc(1000 + 3 * VERTICES + (size_t)FACES * ROW);
    assert_non_null(file);
    const size_t head =
        (size_t)sprintf(file,
                        "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty uchar x\nproperty uchar y\n"
                        "property uchar z\nelement face %d\nproperty list uchar uint vertex_indices\nend_header\n",
                        VERTICES, FACES);
    for (int i = 0; i < 3 * VERTICES; i++) file[head + (size_t)i] = (char)(i * i);
    for (int i = 0; i < FACES; i++) {
        const uint32_t corners[3] = {(uint32_t)i % VERTICES, (uint32_t)(i + 1) % VERTICES,
                                     i == BAD ? VERTICES : (uint32_t)(i + 2) % VERTICES};
        char *row = file + head + 3 * VERTICES + (size_t)i * ROW;
        row[0] = 3;
        memcpy(row + 1, corners, sizeof corners);
    }
    for (int stop = 1; stop <= 20; stop++) {
        struct host host;
        struct watcher watcher = {.stop_at = stop, .is_slow = true, .caller = pthread_self()};
        pbr_instance *instance = host_instance_of_threads(&host, 2);
        pbr_file_content content = PBR_FILE_CONTENT_INIT;
        pbr_read_desc desc = PBR_READ_DESC_INIT;
        desc.progress = watch;
        desc.progress_user = &watcher;
        const size_t size = head + 3 * VERTICES + (size_t)FACES * ROW;
        assert_int_equal(pbr_read_memory(instance, NULL, file, size, &desc, &content), PBR_ERROR_CANCELLED);
        assert_null(content.mesh);
        assert_int_equal(watcher.calls, stop);
        host_finish(&host, instance);
    }
    free(file);
}

static void descriptors_are_checked(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    for (int i = 0; i < 6; i++) {
        pbr_file_content content = PBR_FILE_CONTENT_INIT;
        pbr_read_desc desc = PBR_READ_DESC_INIT;
        if (i == 0) desc.flags = 1u << 31;
        if (i == 1) desc.reserved = 1;
        if (i == 2) desc.radius_scale = -1;
        if (i == 3) desc.struct_size = 3;
        if (i == 4) content.struct_size = 8;
        if (i == 5) desc.radius_neighbours = 33;
        assert_int_equal(pbr_read_memory(instance, NULL, "ply\n", 4, &desc, &content), PBR_ERROR_INVALID_ARGUMENT);
    }
    assert_int_equal(host.errors, 6);
    assert_int_equal(pbr_read_file(instance, NULL, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    host_finish(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_need_not_be_lines),
        cmocka_unit_test(polygons_with_a_bad_last_corner_leave_no_trace),
        cmocka_unit_test(every_type_and_encoding_reads_the_same),
        cmocka_unit_test(colours_of_every_kind_become_8_bit_srgb),
        cmocka_unit_test(radius_normal_and_other_properties_find_their_places),
        cmocka_unit_test(strips_alternate_and_restart),
        cmocka_unit_test(bad_faces_are_left_out_and_counted),
        cmocka_unit_test(faces_may_come_before_their_vertices),
        cmocka_unit_test(each_fault_has_its_result_and_place),
        cmocka_unit_test(absurd_counts_allocate_nothing_that_is_not_there),
        cmocka_unit_test(a_file_cut_anywhere_gives_its_whole_vertices_or_an_error),
        cmocka_unit_test(flipped_bytes_never_crash),
        cmocka_unit_test(pieces_and_tokens_read_the_same),
        cmocka_unit_test(triangles_are_read_as_all_polygons_are),
        cmocka_unit_test(triangles_alone_are_read_as_all_polygons_are),
        cmocka_unit_test(progress_rises_and_cancel_leaves_nothing),
        cmocka_unit_test(progress_is_told_a_few_dozen_times),
        cmocka_unit_test(a_cancel_is_never_lost),
        cmocka_unit_test(descriptors_are_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
