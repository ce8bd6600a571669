/* Files of points that are read in pieces, against the same files read whole. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>

enum { ROWS = 1000 };

static void put(char *to, uint64_t value, size_t size, bool big_endian) {
    for (size_t i = 0; i < size; i++) to[big_endian ? size - 1 - i : i] = (char)(value >> (8 * i));
}

static void put_float(char *to, float value, bool big_endian) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(to, bits, 4, big_endian);
}

static void put_double(char *to, double value, bool big_endian) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(to, bits, 8, big_endian);
}

struct bytes {
    char *data;
    size_t size;
};

static char *add(struct bytes *bytes, size_t size) {
    bytes->data = realloc(bytes->data, bytes->size + size);
    assert_non_null(bytes->data);
    bytes->size += size;
    return bytes->data + bytes->size - size;
}

static void add_text(struct bytes *bytes, const char *text) {
    memcpy(add(bytes, strlen(text)), text, strlen(text));
}

/* Every kind of number and role; before the vertices an element without lists, after them faces. */
static struct bytes make_ply(bool big_endian, const char *colour_type) {
    struct bytes ply = {NULL, 0};
    char header[1024];
    snprintf(header, sizeof header,
             "ply\nformat binary_%s_endian 1.0\nelement camera 3\nproperty short a\nproperty double b\nelement vertex %d\n"
             "property float x\nproperty char unused\nproperty double y\nproperty int z\nproperty float nx\nproperty float ny\n"
             "property float nz\nproperty %s red\nproperty %s green\nproperty %s blue\nproperty float radius\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n",
             big_endian ? "big" : "little", ROWS, colour_type, colour_type, colour_type);
    add_text(&ply, header);
    memset(add(&ply, 30), 7, 30);
    for (int i = 0; i < ROWS; i++) {
        put_float(add(&ply, 4), (float)(i % 7) / 4, big_endian);
        put(add(&ply, 1), 9, 1, big_endian);
        put_double(add(&ply, 8), -(double)i / 8, big_endian);
        put(add(&ply, 4), (uint64_t)(int64_t)(i % 11 - 5), 4, big_endian);
        /* One normal is not finite, one has no direction, and one no length of 1. */
        const float normal[3] = {i == 3   ? NAN
                                 : i == 4 ? 0
                                          : cosf((float)i),
                                 i == 4 ? 0 : sinf((float)i) * (i == 5 ? 9.0f : 1.0f), 0};
        for (int k = 0; k < 3; k++) put_float(add(&ply, 4), normal[k], big_endian);
        for (int k = 0; k < 3; k++) {
            if (!strcmp(colour_type, "float")) put_float(add(&ply, 4), (float)(i * (k + 1)) / 1000 - 0.1f, big_endian);
            else if (!strcmp(colour_type, "ushort")) put(add(&ply, 2), (uint64_t)(i * 65 + k), 2, big_endian);
            else put(add(&ply, 1), (uint64_t)(i + 100 * k) & 255, 1, big_endian);
        }
        put_float(add(&ply, 4), i == 6 ? -1 : i == 7 ? INFINITY : i == 8 ? NAN : 0.5f + (float)i, big_endian);
    }
    put(add(&ply, 1), 3, 1, big_endian);
    for (uint64_t k = 0; k < 3; k++) put(add(&ply, 4), k, 4, big_endian);
    return ply;
}

/* LAS 1.2, point format 2. */
static struct bytes make_las(unsigned colour_factor) {
    struct bytes las = {NULL, 0};
    char *header = add(&las, 227);
    memset(header, 0, 227);
    memcpy(header, "LASF", 4);
    put(header + 24, 1, 1, false);
    put(header + 25, 2, 1, false);
    put(header + 94, 227, 2, false);
    put(header + 96, 227, 4, false);
    put(header + 104, 2, 1, false);
    put(header + 105, 29, 2, false); /* three bytes more than the format has */
    put(header + 107, ROWS, 4, false);
    for (int k = 0; k < 3; k++) {
        put_double(header + 131 + 8 * k, 0.01 * (k + 1), false);
        put_double(header + 155 + 8 * k, 1000.25 * (k + 1), false);
    }
    for (int i = 0; i < ROWS; i++) {
        char *record = add(&las, 29);
        memset(record, 0x55, 29);
        for (int k = 0; k < 3; k++) {
            put(record + 4 * k, (uint64_t)(int64_t)(i * (k + 1) - 500), 4, false);
            put(record + 20 + 2 * k, (uint64_t)((i + 80 * k) & 255) * colour_factor, 2, false);
        }
    }
    return las;
}

static void write_file(const char *path, const void *data, size_t size) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

struct opened {
    struct host host;
    pbr_instance *instance;
    pbr_file_source *source;
    pbr_file_source_info info;
};

static pbr_result open_source(struct opened *opened, const char *path) {
    *opened = (struct opened){.info = PBR_FILE_SOURCE_INFO_INIT};
    opened->instance = host_instance(&opened->host);
    const pbr_result result = pbr_file_source_open(opened->instance, path, NULL, NULL, &opened->source);
    assert_int_equal(opened->source != NULL, result == PBR_OK);
    assert_int_equal(atomic_load(&opened->host.errors), result != PBR_OK);
    if (result == PBR_OK) assert_int_equal(pbr_file_source_get_info(opened->source, &opened->info), PBR_OK);
    return result;
}

static void close_source(struct opened *opened) {
    pbr_file_source_close(&opened->source);
    assert_null(opened->source);
    pbr_file_source_close(&opened->source);
    host_finish(&opened->host, opened->instance);
}

struct arrays {
    double *positions;
    float *normals, *radii;
    uint8_t *colours;
};

static struct arrays make_arrays(size_t count) {
    struct arrays arrays = {calloc(count, 3 * sizeof(double)), calloc(count, 3 * sizeof(float)), calloc(count, sizeof(float)),
                            calloc(count, 4)};
    assert_true(arrays.positions && arrays.normals && arrays.radii && arrays.colours);
    return arrays;
}

static void free_arrays(struct arrays *arrays) {
    free(arrays->positions);
    free(arrays->normals);
    free(arrays->radii);
    free(arrays->colours);
}

static void assert_same_normal(const float got[3], const float wanted[3]) {
    const float length = sqrtf(got[0] * got[0] + got[1] * got[1] + got[2] * got[2]);
    /* Point sets store normals in 2 x 16 bits. */
    for (int k = 0; k < 3; k++) assert_true(fabsf((length > 0 ? got[k] / length : 0) - wanted[k]) < 1e-3f);
}

/* In ranges from the last to the first, since any order will do. */
static void read_ranges(pbr_file_source *source, uint64_t count, uint64_t range, const struct arrays *out) {
    for (uint64_t end = count; end > 0;) {
        const uint64_t first = (end - 1) / range * range;
        const pbr_lod_batch batch = {sizeof batch, out->positions + 3 * first, out->normals + 3 * first, out->colours + 4 * first,
                                     out->radii + first};
        assert_int_equal(pbr_file_source_read(source, first, end - first, &batch), PBR_OK);
        end = first;
    }
}

static void compare_with_whole(const char *path) {
    struct opened opened;
    assert_int_equal(open_source(&opened, path), PBR_OK);
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    desc.flags = PBR_READ_KEEP_RADII;
    assert_int_equal(pbr_read_file(opened.instance, path, &desc, &content), PBR_OK);
    assert_non_null(content.points);
    assert_int_equal(pbr_points_get_info(content.points, &info), PBR_OK);
    const uint64_t count = opened.info.point_count;
    assert_int_equal(count, content.vertex_count);
    assert_int_equal(count, info.count);
    assert_int_equal(opened.info.format, content.format);
    assert_true(opened.info.warning_count <= content.warning_count); /* which may tell of scalars that are left out */
    assert_string_equal(opened.info.encoding, content.encoding);
    assert_int_equal(opened.info.has_normals, info.has_normals);
    assert_int_equal(opened.info.has_colours, info.has_colours);
    assert_int_equal(opened.info.has_radii, info.has_radii);
    struct arrays got = make_arrays((size_t)count), wanted = make_arrays((size_t)count);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = wanted.positions;
    copy.normals = info.has_normals ? wanted.normals : NULL;
    copy.colours = info.has_colours ? wanted.colours : NULL;
    copy.radii = info.has_radii ? wanted.radii : NULL;
    assert_int_equal(pbr_points_copy(content.points, 0, count, &copy), PBR_OK);
    read_ranges(opened.source, count, 333, &got);
    for (uint64_t i = 0; i < count; i++) {
        /* Positions are doubles that no point set narrows, or such as floats hold. */
        for (uint64_t k = 0; k < 3; k++)
            if (got.positions[3 * i + k] != wanted.positions[3 * i + k])
                fail_msg("%s: point %llu: %.17g, not %.17g", path, (unsigned long long)i, got.positions[3 * i + k],
                         wanted.positions[3 * i + k]);
        assert_same_normal(got.normals + 3 * i, wanted.normals + 3 * i);
        for (uint64_t k = 0; k < 3; k++)
            assert_int_equal(got.colours[4 * i + k], info.has_colours ? wanted.colours[4 * i + k] : 255);
        assert_true(got.radii[i] == wanted.radii[i]);
    }
    free_arrays(&got);
    free_arrays(&wanted);
    pbr_points_release(&content.points);
    close_source(&opened);
}

/* A folder of the test's own. */
static char folder[64], path[128];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/pbr-source-XXXXXX");
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%s/file", folder);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    remove(path);
    return rmdir(folder);
}

static void ranges_are_what_the_whole_file_gives(void **state) {
    static const char *const colours[] = {"uchar", "ushort", "float"};
    (void)state;
    for (size_t i = 0; i < 2 * 3; i++) {
        struct bytes ply = make_ply(i % 2, colours[i / 2]);
        /* Without its face, so that both give points. */
        write_file(path, ply.data, ply.size - 13);
        struct opened opened;
        assert_int_equal(open_source(&opened, path), PBR_OK);
        assert_int_equal(opened.info.face_count, 1);
        close_source(&opened);
        char *faces = strstr(ply.data, "element face 1");
        faces[13] = '0';
        write_file(path, ply.data, ply.size - 13);
        compare_with_whole(path);
        free(ply.data);
    }
    for (unsigned factor = 0; factor < 3; factor++) { /* no colours; 8 bits; 16 bits */
        struct bytes las = make_las(factor == 2 ? 256 : factor);
        write_file(path, las.data, las.size);
        compare_with_whole(path);
        free(las.data);
    }
}

static void scans_are_what_whole_files_give(void **state) {
    static const char *const files[] = {
        "formats/las/1.2-with-color.las",     "formats/las/pdrf10-1.5.las",  "points/autzen_trim.las",   "points/autzen_trim_7.las",
        "formats/ply/pdal_simple_binary.ply", "points/cgal_b9_training.ply", "gaussians/train-1000.ply", "formats/ply/pond.0.ply"};
    (void)state;
    if (!has_data()) skip();
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char file[4096];
        snprintf(file, sizeof file, "%s/%s", test_data(), files[i]);
        compare_with_whole(file);
    }
}

static void check_refusal(const void *data, size_t size, pbr_result wanted, const char *error) {
    struct opened opened;
    write_file(path, data, size);
    const pbr_result result = open_source(&opened, path);
    if (result != wanted || !strstr(opened.host.error, error))
        fail_msg("%s, and not with '%s': %s", pbr_result_name(result), error, opened.host.error);
    close_source(&opened);
}

static void what_cannot_be_read_in_pieces_says_why(void **state) {
    static const struct {
        const char *text, *error;
        pbr_result result;
    } files[] = {
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n",
         "it is text", PBR_ERROR_UNSUPPORTED},
        {"1 2 3\n4 5 6\n", "only LAS and binary PLY can", PBR_ERROR_UNSUPPORTED},
        {"", "only LAS and binary PLY can", PBR_ERROR_UNSUPPORTED},
        {"v 1 2 3\n", "only LAS and binary PLY can", PBR_ERROR_UNSUPPORTED},
        {"ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 1\n"
         "property int x\nproperty int y\nproperty int z\nend_header\n",
         "lists before its vertices", PBR_ERROR_UNSUPPORTED},
        {"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\n"
         "property list uchar int n\nend_header\n",
         "its vertices have lists", PBR_ERROR_UNSUPPORTED},
        {"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty int x\nproperty int y\nend_header\n",
         "no numbers x, y and z", PBR_ERROR_UNSUPPORTED},
        {"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty int x\nproperty int y\nproperty int z\nend_header\n0123",
         "before the first whole vertex", PBR_ERROR_FORMAT},
        {"ply\nformat binary_little_endian 1.0\nelement other 18446744073709551615\nproperty int a\nelement vertex 1\n"
         "property int x\nproperty int y\nproperty int z\nend_header\n012301230123",
         "before the first whole vertex", PBR_ERROR_FORMAT},
        {"LASF", "header ends early", PBR_ERROR_FORMAT},
    };
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof *files; i++)
        check_refusal(files[i].text, strlen(files[i].text), files[i].result, files[i].error);
    struct opened opened;
    assert_int_equal(open_source(&opened, folder), PBR_ERROR_IO);
    close_source(&opened);
    assert_int_equal(open_source(&opened, "/nowhere/at/all"), PBR_ERROR_IO);
    close_source(&opened);
}

/* Cut anywhere, a file gives the points that are wholly there, or an error. */
static void what_is_cut_off_gives_what_is_there(void **state) {
    (void)state;
    for (int format = 0; format < 2; format++) {
        struct bytes file = format ? make_las(1) : make_ply(false, "uchar");
        const size_t row = format ? 29 : 36;
        size_t begin = 227;
        if (!format) begin = (size_t)(strstr(file.data, "end_header\n") - file.data) + 11 + 30;
        const struct arrays out = make_arrays(ROWS);
        for (size_t size = 0; size < begin + 5 * row; size++) {
            struct opened opened;
            write_file(path, file.data, size);
            const pbr_result result = open_source(&opened, path);
            assert_int_equal(result == PBR_OK, size >= begin + row);
            if (result == PBR_OK) {
                assert_int_equal(opened.info.point_count, (size - begin) / row);
                assert_int_equal(opened.info.warning_count, 1);
                read_ranges(opened.source, opened.info.point_count, 2, &out);
            }
            close_source(&opened);
        }
        struct arrays all = out;
        free_arrays(&all);
        free(file.data);
    }
}

static void ranges_past_the_end_are_refused(void **state) {
    struct bytes las = make_las(1);
    struct opened opened;
    struct arrays out = make_arrays(2);
    const pbr_lod_batch batch = {.struct_size = sizeof batch, .positions = out.positions}; /* the rest is not wanted */
    const pbr_lod_batch none = {.struct_size = sizeof none}, small = {.struct_size = 8, .positions = out.positions};
    (void)state;
    write_file(path, las.data, las.size);
    assert_int_equal(open_source(&opened, path), PBR_OK);
    assert_int_equal(pbr_file_source_read(opened.source, ROWS - 2, 2, &batch), PBR_OK);
    assert_true(out.positions[3] == (ROWS - 501) * 0.01 + 1000.25);
    assert_int_equal(pbr_file_source_read(opened.source, ROWS, 0, &batch), PBR_OK);
    assert_int_equal(pbr_file_source_read(opened.source, ROWS - 1, 2, &batch), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(opened.source, ROWS + 1, 0, &batch), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(opened.source, 1, UINT64_MAX, &batch), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(opened.source, 0, 1, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(opened.source, 0, 1, &none), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(opened.source, 0, 1, &small), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_read(NULL, 0, 1, &batch), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_get_info(NULL, &opened.info), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_file_source_get_info(opened.source, NULL), PBR_ERROR_INVALID_ARGUMENT);
    free_arrays(&out);
    free(las.data);
    close_source(&opened);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_are_what_the_whole_file_gives),   cmocka_unit_test(scans_are_what_whole_files_give),
        cmocka_unit_test(what_cannot_be_read_in_pieces_says_why), cmocka_unit_test(what_is_cut_off_gives_what_is_there),
        cmocka_unit_test(ranges_past_the_end_are_refused),
    };
    return cmocka_run_group_tests_name("file_source", tests, make_folder, remove_folder);
}
