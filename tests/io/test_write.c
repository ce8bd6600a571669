/* What is written reads back the same. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>
#include <sys/stat.h>

enum { MANY = 40000 }; /* more than are written at once */

struct folder {
    char path[64], file[96];
};

static struct folder make_folder(void) {
    struct folder folder = {.path = "/tmp/pbr-test-write-XXXXXX"};
    assert_non_null(mkdtemp(folder.path));
    snprintf(folder.file, sizeof folder.file, "%s/out.ply", folder.path);
    return folder;
}

/* The folder holds the file or nothing: no temporary name is left. */
static void remove_folder(const struct folder *folder) {
    unlink(folder->file);
    assert_int_equal(rmdir(folder->path), 0);
}

static pbr_points *make_points(pbr_instance *instance, size_t count, double scale, double shift, bool attributes) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    uint64_t seed = 11;
    double *positions = calloc(count + 1, 3 * sizeof *positions);
    float *numbers = calloc(count + 1, 5 * sizeof *numbers);
    uint8_t *colours = calloc(count + 1, 4);
    assert_true(positions && numbers && colours);
    for (size_t i = 0; i < 3 * count; i++)
        positions[i] = shift == 0 ? (double)(float)((double)random_next(&seed) * 0x1p-64 * scale)
                                  : (double)random_next(&seed) * 0x1p-64 * scale + shift;
    for (size_t i = 0; i < 5 * count; i++) numbers[i] = (float)((double)random_next(&seed) * 0x1p-63 - 1);
    for (size_t i = 0; i < 4 * count; i++) colours[i] = (uint8_t)random_next(&seed);
    for (size_t i = 0; i < count; i++) numbers[5 * i + 3] = 1e-9f + fabsf(numbers[5 * i + 3]) * 1e-9f;
    if (count > 0) numbers[4] = NAN;
    size_t row = 5 * sizeof *numbers;
    pbr_scalar scalars[] = {{"my value", {.data = numbers + 4, .stride = row, .format = PBR_FORMAT_FLOAT32, .components = 1}},
                            {"red", {.data = numbers + 3, .stride = row, .format = PBR_FORMAT_FLOAT32, .components = 1}},
                            {"", {.data = numbers + 2, .stride = row, .format = PBR_FORMAT_FLOAT32, .components = 1}}};
    desc.count = count;
    desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT64, .components = 3};
    if (attributes) {
        desc.normals = (pbr_attribute){.data = numbers, .stride = row, .format = PBR_FORMAT_FLOAT32, .components = 3};
        desc.colours = (pbr_attribute){.data = colours, .format = PBR_FORMAT_UINT8, .components = 4};
        desc.radii = (pbr_attribute){.data = numbers + 3, .stride = row, .format = PBR_FORMAT_FLOAT32, .components = 1};
        desc.scalars = scalars;
        desc.scalar_count = 3;
    }
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    free(positions);
    free(numbers);
    free(colours);
    return points;
}

struct copied {
    double *positions;
    float *normals, *radii, *scalars[3];
    uint8_t *colours;
};

static struct copied copy_points(const pbr_points *points, const pbr_points_info *info) {
    size_t n = (size_t)info->count + 1;
    struct copied out = {.positions = calloc(n, 3 * sizeof(double)),
                         .normals = calloc(n, 3 * sizeof(float)),
                         .radii = calloc(n, sizeof(float)),
                         .colours = calloc(n, 4)};
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = out.positions;
    if (info->has_normals) copy.normals = out.normals;
    if (info->has_radii) copy.radii = out.radii;
    if (info->has_colours) copy.colours = out.colours;
    assert_int_equal(pbr_points_copy(points, 0, info->count, &copy), PBR_OK);
    for (uint32_t s = 0; s < 3; s++) {
        pbr_points_copy_desc scalar = PBR_POINTS_COPY_DESC_INIT;
        out.scalars[s] = calloc(n, sizeof(float));
        scalar.scalar = out.scalars[s];
        scalar.scalar_index = s;
        if (s < info->scalar_count) assert_int_equal(pbr_points_copy(points, 0, info->count, &scalar), PBR_OK);
    }
    return out;
}

static void free_copied(struct copied *copied) {
    free(copied->positions);
    free(copied->normals);
    free(copied->radii);
    free(copied->colours);
    for (int s = 0; s < 3; s++) free(copied->scalars[s]);
}

/* Bit for bit, but for normals: those are kept in 2 x 16 bits, and what they decode to is encoded anew. */
static void check_same(const pbr_points *a, const pbr_points *b) {
    pbr_points_info left = PBR_POINTS_INFO_INIT, right = PBR_POINTS_INFO_INIT;
    assert_int_equal(pbr_points_get_info(a, &left), PBR_OK);
    assert_int_equal(pbr_points_get_info(b, &right), PBR_OK);
    assert_int_equal(left.count, right.count);
    assert_int_equal(left.has_normals, right.has_normals);
    assert_int_equal(left.has_colours, right.has_colours);
    assert_int_equal(left.has_radii, right.has_radii);
    assert_int_equal(left.scalar_count, right.scalar_count);
    struct copied x = copy_points(a, &left), y = copy_points(b, &right);
    size_t n = (size_t)left.count;
    assert_memory_equal(x.positions, y.positions, 3 * n * sizeof(double));
    assert_memory_equal(x.radii, y.radii, n * sizeof(float));
    assert_memory_equal(x.colours, y.colours, 4 * n);
    for (int s = 0; s < 3; s++) assert_memory_equal(x.scalars[s], y.scalars[s], n * sizeof(float));
    for (size_t i = 0; i < 3 * n; i++) assert_true(fabsf(x.normals[i] - y.normals[i]) < 1e-4f);
    free_copied(&x);
    free_copied(&y);
}

static pbr_points *read_points(pbr_instance *instance, const char *path) {
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    desc.flags = PBR_READ_KEEP_RADII;
    assert_int_equal(pbr_read_file(instance, path, &desc, &content), PBR_OK);
    assert_int_equal(content.warning_count, content.vertex_count == 0);
    assert_non_null(content.points);
    return content.points;
}

static bool file_has(const char *path, const char *text) {
    char start[1024] = "";
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    size_t got = fread(start, 1, sizeof start - 1, file);
    fclose(file);
    return memmem(start, got, text, strlen(text)) != NULL;
}

static void points_come_back_bit_for_bit(void **state) {
    (void)state;
    static const struct {
        size_t count;
        double scale, shift;
        bool attributes, wide;
    } CASES[] = {{0, 1, 0, false, false},       {1, 1, 0, true, false},        {MANY, 1, 0, false, false},
                 {MANY, 1e-30, 0, true, false}, {MANY, 1, 600000, true, true}, {MANY, 1e3, -5.4e6, false, true}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct host host;
        struct folder folder = make_folder();
        pbr_instance *instance = host_instance(&host);
        pbr_points *points = make_points(instance, CASES[i].count, CASES[i].scale, CASES[i].shift, CASES[i].attributes);
        assert_int_equal(pbr_write_file(instance, folder.file, points, NULL, NULL), PBR_OK);
        assert_int_equal(file_has(folder.file, "property double x"), CASES[i].wide);
        pbr_points *back = read_points(instance, folder.file);
        check_same(points, back);
        if (CASES[i].attributes) {
            assert_string_equal(pbr_points_scalar_name(back, 0), "my_value");
            assert_string_equal(pbr_points_scalar_name(back, 1), "scalar_red");
            assert_string_equal(pbr_points_scalar_name(back, 2), "scalar");
        }
        pbr_points_release(&back);
        pbr_points_release(&points);
        remove_folder(&folder);
        host_finish(&host, instance);
    }
}

/* A strip of triangles between two rows of vertices. */
static pbr_mesh *make_mesh(pbr_instance *instance, size_t count, bool attributes) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    double *positions = calloc(count, 3 * sizeof *positions);
    float *normals = calloc(count, 3 * sizeof *normals);
    uint16_t *colours = calloc(count, 3 * sizeof *colours);
    uint32_t(*indices)[3] = calloc(count, sizeof *indices);
    assert_true(positions && normals && colours && indices);
    for (size_t i = 0; i < count; i++) {
        positions[3 * i] = 1e6 + (double)(i / 2) * 0.1;
        positions[3 * i + 1] = (double)(i % 2);
        normals[3 * i + 2] = -1;
        colours[3 * i] = (uint16_t)(257 * (i % 256));
        for (uint32_t k = 0; k < 3 && i + 2 < count; k++) indices[i][k] = (uint32_t)i + k;
    }
    desc.vertex_count = count;
    desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT64, .components = 3};
    if (attributes) {
        desc.normals = (pbr_attribute){.data = normals, .format = PBR_FORMAT_FLOAT32, .components = 3};
        desc.colours = (pbr_attribute){.data = colours, .format = PBR_FORMAT_UINT16, .components = 3};
    }
    desc.indices = indices;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = count - 2;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    free(positions);
    free(normals);
    free(colours);
    free(indices);
    return mesh;
}

static void check_same_mesh(const pbr_mesh *a, const pbr_mesh *b, size_t count, bool colours) {
    struct {
        double positions[MANY][3];
        uint32_t triangles[MANY][3];
        uint8_t colours[MANY][4];
        float normals[MANY][3];
    } *copies = calloc(2, sizeof *copies);
    assert_non_null(copies);
    for (int i = 0; i < 2; i++) {
        pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
        copy.vertex_count = count;
        copy.triangle_count = count - 2;
        copy.positions = &copies[i].positions[0][0];
        copy.triangles = &copies[i].triangles[0][0];
        copy.normals = &copies[i].normals[0][0];
        if (colours) copy.colours = &copies[i].colours[0][0];
        assert_int_equal(pbr_mesh_copy(i ? b : a, &copy), PBR_OK);
    }
    assert_memory_equal(copies[0].positions, copies[1].positions, sizeof copies->positions);
    assert_memory_equal(copies[0].triangles, copies[1].triangles, sizeof copies->triangles);
    assert_memory_equal(copies[0].colours, copies[1].colours, sizeof copies->colours);
    for (size_t i = 0; i < count; i++) /* kept in 2 x 16 bits, encoded anew */
        for (int k = 0; k < 3; k++) assert_true(fabsf(copies[0].normals[i][k] - copies[1].normals[i][k]) < 1e-4f);
    assert_true(copies[0].positions[3][0] == 1e6 + 0.1 && copies[0].triangles[1][2] == 3);
    if (colours) assert_int_equal(copies[0].colours[5][0], 5);
    free(copies);
}

static void meshes_come_back_bit_for_bit(void **state) {
    (void)state;
    for (int attributes = 0; attributes < 2; attributes++) {
        struct host host;
        struct folder folder = make_folder();
        pbr_instance *instance = host_instance(&host);
        pbr_mesh *mesh = make_mesh(instance, MANY, attributes);
        pbr_mesh_info info = PBR_MESH_INFO_INIT;
        pbr_file_content content = PBR_FILE_CONTENT_INIT;
        assert_int_equal(pbr_write_file(instance, folder.file, NULL, mesh, NULL), PBR_OK);
        assert_int_equal(pbr_read_file(instance, folder.file, NULL, &content), PBR_OK);
        assert_int_equal(content.warning_count, 0);
        assert_int_equal(content.face_count, MANY - 2);
        assert_int_equal(pbr_mesh_get_info(content.mesh, &info), PBR_OK);
        assert_int_equal(info.has_normals, attributes);
        assert_int_equal(info.has_colours, attributes);
        check_same_mesh(mesh, content.mesh, MANY, attributes);
        pbr_mesh_release(&content.mesh);
        pbr_mesh_release(&mesh);
        remove_folder(&folder);
        host_finish(&host, instance);
    }
}

static void ranges_outside_a_mesh_are_refused(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_mesh *mesh = make_mesh(instance, 5, false);
    uint32_t triangles[2][3];
    double positions[1][3];
    pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
    copy.first_vertex = 4;
    copy.vertex_count = 1;
    copy.first_triangle = 1;
    copy.triangle_count = 2;
    copy.positions = &positions[0][0];
    copy.triangles = &triangles[0][0];
    assert_int_equal(pbr_mesh_copy(mesh, &copy), PBR_OK);
    assert_true(positions[0][0] == 1e6 + 0.2);
    assert_int_equal(triangles[1][0], 2);
    copy.triangle_count = 3;
    assert_int_equal(pbr_mesh_copy(mesh, &copy), PBR_ERROR_INVALID_ARGUMENT);
    copy.triangle_count = UINT64_MAX;
    assert_int_equal(pbr_mesh_copy(mesh, &copy), PBR_ERROR_INVALID_ARGUMENT);
    copy.triangle_count = 0;
    copy.vertex_count = 2;
    assert_int_equal(pbr_mesh_copy(mesh, &copy), PBR_ERROR_INVALID_ARGUMENT);
    uint8_t colours[4];
    copy.vertex_count = 1;
    copy.colours = colours;
    assert_int_equal(pbr_mesh_copy(mesh, &copy), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_mesh_copy(mesh, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_mesh_copy(NULL, &copy), PBR_ERROR_INVALID_ARGUMENT);
    pbr_mesh_release(&mesh);
    host_finish(&host, instance);
}

/* A file of the test data, as the reader makes it, written and read again. */
static void real_scans_come_back(void **state) {
    (void)state;
    if (!has_data()) skip();
    static const char *const NAMES[] = {"points/autzen_trim_7.las", "points/cgal_b9_training.ply", "points/pts/autzen.pts",
                                        "formats/ply/pond.0.ply"};
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES; i++) {
        struct host host;
        char path[4096];
        struct folder folder = make_folder();
        pbr_instance *instance = host_instance(&host);
        pbr_file_content content = PBR_FILE_CONTENT_INIT;
        snprintf(path, sizeof path, "%s/%s", test_data(), NAMES[i]);
        assert_int_equal(pbr_read_file(instance, path, NULL, &content), PBR_OK); /* with radii */
        assert_int_equal(pbr_write_file(instance, folder.file, content.points, NULL, NULL), PBR_OK);
        pbr_points *back = read_points(instance, folder.file);
        check_same(content.points, back);
        pbr_points_release(&back);
        pbr_points_release(&content.points);
        remove_folder(&folder);
        host_finish(&host, instance);
    }
}

static int stop_at_half(void *user, const char *stage, double fraction) {
    *(int *)user += 1;
    assert_string_equal(stage, "writing");
    return fraction < 0.4;
}

static void a_cancelled_write_leaves_the_old_file(void **state) {
    (void)state;
    struct host host;
    struct folder folder = make_folder();
    pbr_instance *instance = host_instance(&host);
    pbr_points *few = make_points(instance, 3, 1, 0, false), *many = make_points(instance, MANY, 1, 0, true);
    pbr_write_desc desc = PBR_WRITE_DESC_INIT;
    int calls = 0;
    assert_int_equal(pbr_write_file(instance, folder.file, few, NULL, NULL), PBR_OK);
    desc.progress = stop_at_half;
    desc.progress_user = &calls;
    assert_int_equal(pbr_write_file(instance, folder.file, many, NULL, &desc), PBR_ERROR_CANCELLED);
    assert_int_equal(calls, 2);
    pbr_points *back = read_points(instance, folder.file);
    check_same(few, back);
    pbr_points_release(&back);
    pbr_points_release(&few);
    pbr_points_release(&many);
    remove_folder(&folder);
    host_finish(&host, instance);
}

static void what_cannot_be_written_is_refused(void **state) {
    (void)state;
    struct host host;
    struct folder folder = make_folder();
    char other[128];
    pbr_instance *instance = host_instance(&host);
    pbr_points *points = make_points(instance, 3, 1, 0, false);
    pbr_mesh *mesh = make_mesh(instance, 5, false);
    pbr_write_desc desc = PBR_WRITE_DESC_INIT;
    assert_int_equal(pbr_write_file(instance, folder.file, NULL, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_write_file(instance, folder.file, points, mesh, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_write_file(instance, NULL, points, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_write_file(NULL, folder.file, points, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    desc.flags = 1;
    assert_int_equal(pbr_write_file(instance, folder.file, points, NULL, &desc), PBR_ERROR_INVALID_ARGUMENT);
    desc = (pbr_write_desc)PBR_WRITE_DESC_INIT;
    desc.struct_size--;
    assert_int_equal(pbr_write_file(instance, folder.file, points, NULL, &desc), PBR_ERROR_INVALID_ARGUMENT);
    snprintf(other, sizeof other, "%s/out.obj", folder.path);
    assert_int_equal(pbr_write_file(instance, other, points, NULL, NULL), PBR_ERROR_UNSUPPORTED);
    assert_non_null(strstr(host.error, "out.obj"));
    snprintf(other, sizeof other, "%s/absent/out.ply", folder.path);
    assert_int_equal(pbr_write_file(instance, other, points, NULL, NULL), PBR_ERROR_IO);
    snprintf(other, sizeof other, "%s/out.PLY", folder.path);
    assert_int_equal(pbr_write_file(instance, other, points, NULL, NULL), PBR_OK);
    unlink(other);
    pbr_mesh_release(&mesh);
    pbr_points_release(&points);
    remove_folder(&folder);
    host_finish(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_come_back_bit_for_bit),          cmocka_unit_test(meshes_come_back_bit_for_bit),
        cmocka_unit_test(ranges_outside_a_mesh_are_refused),     cmocka_unit_test(real_scans_come_back),
        cmocka_unit_test(a_cancelled_write_leaves_the_old_file), cmocka_unit_test(what_cannot_be_written_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
