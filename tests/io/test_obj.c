/* OBJ: vertices, normals, colours and all forms of faces, and broken files. Counts of the files are those of their lines `v` and
 * `f`. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>

#define OBJ(path, vertices, faces, triangles, warnings, normals, colours)                                                          \
    { path, PBR_OK, PBR_FILE_OBJ, vertices, faces, triangles, warnings, normals, colours, 0, NULL }
#define OBJ_ERROR(path, result, error)                                                                                             \
    { path, result, 0, 0, 0, 0, 0, false, false, 0, error }

static const struct expected FILES[] = {
    OBJ("meshes/bunny_normals.obj", 35947, 69451, 69451, 0, true, false),
    OBJ("hostile/box_longline.obj", 8, 6, 944, 0, false, false),
    OBJ("hostile/box_without_lineending.obj", 8, 6, 12, 0, false, false),
    OBJ("hostile/malformed.obj", 8, 6, 8, 2, false, false), /* two faces refer to vertices 0 and 12 */
    OBJ("hostile/negative_indices.obj", 8, 6, 12, 0, true, false),
    OBJ("hostile/notenoughindices.obj", 3, 2, 1, 2, false, false),           /* a face of two corners; its MTL is not there */
    OBJ("hostile/only_a_part_of_vertexcolors.obj", 5, 3, 3, 1, false, true), /* the others are white */
    OBJ("hostile/point_cloud.obj", 3, 0, 0, 0, true, false),
    OBJ("hostile/testmixed.obj", 8, 6, 12, 0, false, false),
    OBJ_ERROR("hostile/number_formats.obj", PBR_ERROR_FORMAT, "line 11: '3.1+e2' is not a number"),
    OBJ_ERROR("hostile/no_vertex.obj", PBR_ERROR_UNSUPPORTED, "not a format that libpbr reads"),
    OBJ_ERROR("hostile/empty.obj", PBR_ERROR_UNSUPPORTED, "not a format that libpbr reads"),
};

static void every_file_gives_its_counts_or_its_error(void **state) {
    (void)state;
    if (!has_data()) skip();
    check_files(FILES, sizeof FILES / sizeof *FILES);
}

#define CORNERS "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
#define OTHERS "vt 0 0\nvn 0 0 1\nvn 0 0 2\n"

static void all_forms_of_faces_make_the_same_mesh(void **state) {
    (void)state;
    static const struct {
        const char *text;
        bool normals;
    } CASES[] = {{CORNERS "f 1 2 3 4\n", false},
                 {"f 1 2 3 4\n" CORNERS, false},
                 {CORNERS "f -4 -3 -2 -1\nv 9 9 9\n", false},
                 {CORNERS OTHERS "f 1/1 2/1 3/1 4/1\n", false},
                 {CORNERS OTHERS "f 1//1 2//2 3//1 4//2\n", true},
                 {CORNERS OTHERS "f 1/1/1 2/1/1 3/1/1 4/1/1\n", true},
                 {CORNERS OTHERS "f -4/-1/-1 -3/-1/-2 -2/-1/-1 -1/-1/-1\n", true},
                 {CORNERS "f 1// 2// 3/ 4//\n", false},
                 {CORNERS OTHERS "f 1/7/1 2//1 +3//+1 4//1 # comment\n", true},
                 {"# comment \\\nmtllib a.mtl\no a\ng b\nusemtl c\ns off\n" CORNERS "f 1 2 \\\n 3 \\\r\n4\nl 1 2\np 1\n", false},
                 {"v 0 \\\n0 0\r\nv 1 0 0 1\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3 4", false},
                 {"v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 \\\r3 4\r", false}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != PBR_OK || out.mesh.triangle_count != 2 || out.content.face_count != 1 ||
            out.mesh.has_normals != CASES[i].normals || out.content.warning_count != 0)
            fail_msg("%s: %s", CASES[i].text, out.error);
        static const double POSITIONS[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
        for (int k = 0; k < 12; k++) assert_true(out.positions[k] == POSITIONS[k]);
        for (int k = 0; k < 4; k++) assert_true(fabsf(out.normals[3 * k + 2] - 1) < 1e-4f);
    }
}

static void a_vertex_has_the_mean_of_its_corners_normals(void **state) {
    (void)state;
    struct outcome out = read_text(CORNERS "vn 1 0 0\nvn 0 7 0\nf 1//1 2//1 3//1\nf 1//2 3//1 4//2\n");
    assert_true(out.mesh.has_normals);
    const float half = (float)sqrt(0.5); /* normals are kept in 2 x 16 bits */
    const float expected[] = {half, half, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0};
    for (int k = 0; k < 12; k++) assert_true(fabsf(out.normals[k] - expected[k]) < 1e-4f);
}

static void normals_that_only_some_corners_have_are_left_out(void **state) {
    (void)state;
    static const char *const TEXTS[] = {CORNERS OTHERS "f 1//1 2 3//1\n", CORNERS OTHERS "f 1//1 2//3 3//1\n",
                                        CORNERS OTHERS "f 1//1 2//-3 3//1\n", CORNERS "vn 0 0 1\nv 5 5 5\n"};
    for (size_t i = 0; i < 4; i++) {
        struct outcome out = read_text(TEXTS[i]);
        assert_int_equal(out.result, PBR_OK);
        assert_false(out.is_mesh ? out.mesh.has_normals : out.points.has_normals);
        assert_int_equal(out.content.warning_count, 1);
    }
}

static void colours_are_read_and_white_where_absent(void **state) {
    (void)state;
    static const struct {
        const char *text;
        uint8_t colours[8];
        uint32_t warnings;
    } CASES[] = {{"v 0 0 0 0.2 0.4 1\nv 1 1 1 0 0 0\n", {51, 102, 255, 255, 0, 0, 0, 255}, 0},
                 {"v 0 0 0 51 102 255\nv 1 1 1 0 0 0 9\n", {51, 102, 255, 255, 0, 0, 0, 255}, 0},
                 {"v 0 0 0 0.2 0.4 1\nv 1 1 1\n", {51, 102, 255, 255, 255, 255, 255, 255}, 1},
                 {"v 0 0 0 51 102 255\nv 1 1 1 1\n", {51, 102, 255, 255, 255, 255, 255, 255}, 1},
                 {"v 0 0 0 1 0 0\nv 1 1 1 0 1 0\n", {255, 0, 0, 255, 0, 255, 0, 255}, 0}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        assert_int_equal(out.result, PBR_OK);
        assert_true(out.points.has_colours);
        assert_memory_equal(out.colours, CASES[i].colours, 8);
        assert_int_equal(out.content.warning_count, CASES[i].warnings);
    }
    struct outcome out = read_text("v 0 0 0 -1 0 0\n");
    assert_false(out.points.has_colours);
    assert_int_equal(out.content.warning_count, 1);
}

static void faults_name_their_line(void **state) {
    (void)state;
    static const struct {
        const char *text, *error;
    } CASES[] = {{"v 0 0 0\nv 1 x 0\n", "bytes: line 2: 'x' is not a number"},
                 {"v 0 0 0\nv 1 2\n", "bytes: line 2: a vertex of 2 numbers"},
                 {"v 0 0 0\n\nvn 1\nv 0 0 0\n", "bytes: line 3: a normal of 1 numbers"},
                 {CORNERS "f 1 2 a\nf 1 2 3\n", "bytes: line 5: 'a' is not a corner"},
                 {CORNERS "f 1 2 3/x\nf 1 2 3\n", "bytes: line 5: '3/x' is not a corner"},
                 {CORNERS "f 1 2 3/1/1/1\nf 1 2 3\n", "bytes: line 5: '3/1/1/1' is not a corner"},
                 {CORNERS "f 1 \\\n2 \\\n?\nf 1 2 3\n", "bytes: line 7: '?' is not a corner"},
                 {CORNERS "f 1 2 99999999999999999999\nf 1 2 3\n", "bytes: line 5: '99999999999999999999' is not a corner"},
                 {"g nothing\n", "the file has no vertices"}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != PBR_ERROR_FORMAT || !strstr(out.error, CASES[i].error)) fail_msg("%s: %s", CASES[i].text, out.error);
    }
}

static void faulty_faces_and_foreign_lines_are_left_out(void **state) {
    (void)state;
    struct outcome out =
        read_text(CORNERS "f 1 2 5\nf 0 1 2\nf 1 2 -5\nf 1 2\nf 1 2 9999999999999999999\nnonsense 1\nf 1 2 3 # ok\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.content.face_count, 6);
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 6);
}

static void a_line_that_the_end_cuts_is_left_out(void **state) {
    (void)state;
    static const char *const TEXTS[] = {CORNERS "f 1 2 3\nf 1 2 3/x", CORNERS "f 1 2 3\nv 1 2", CORNERS "f 1 2 3\nvn 0 0 -"};
    for (size_t i = 0; i < 3; i++) {
        struct outcome out = read_text(TEXTS[i]);
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.content.vertex_count, 4);
        assert_int_equal(out.mesh.triangle_count, 1);
        assert_int_equal(out.content.warning_count, 1);
    }
}

static void broken_anywhere_it_gives_a_mesh_points_or_an_error(void **state) {
    (void)state;
    static const char TEXT[] = "# all\no thing\nv 0 0 0 1 .5 0\nv 1 0 0\nv 1 1 .5e0 0 0 1\nv 0 1 0\nvt 0 0\nvn 0 0 1\nvn 0 1 0\n"
                               "usemtl x\nf 1/1/1 2/1/1 3/1/2 \\\n4/1/1\nf -1//-1 -2//-1 -3//1\nl 1 2\nf 3//1 2//1 1//2\n";
    check_every_cut(TEXT, sizeof TEXT - 1);
    check_changes(TEXT, sizeof TEXT - 1, 7, 1500);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_gives_its_counts_or_its_error),
        cmocka_unit_test(all_forms_of_faces_make_the_same_mesh),
        cmocka_unit_test(a_vertex_has_the_mean_of_its_corners_normals),
        cmocka_unit_test(normals_that_only_some_corners_have_are_left_out),
        cmocka_unit_test(colours_are_read_and_white_where_absent),
        cmocka_unit_test(faults_name_their_line),
        cmocka_unit_test(faulty_faces_and_foreign_lines_are_left_out),
        cmocka_unit_test(a_line_that_the_end_cuts_is_left_out),
        cmocka_unit_test(broken_anywhere_it_gives_a_mesh_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
