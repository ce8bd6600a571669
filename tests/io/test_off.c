/* OFF: every keyword, and broken files. Counts of the files are those of their second lines. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>

#define OFF_ERROR(path, result, error)                                                                                             \
    { path, result, 0, 0, 0, 0, 0, false, false, 0, error }

static const struct expected FILES[] = {
    {"meshes/bunny00.off", PBR_OK, PBR_FILE_OFF, 37706, 75408, 75408, 0, false, false, 0, NULL},
    {"hostile/comments.off", PBR_OK, PBR_FILE_OFF, 8, 6, 12, 0, false, false, 0, NULL},
    {"hostile/whitespace.off", PBR_OK, PBR_FILE_OFF, 8, 6, 12, 0, false, false, 0, NULL},
    /* More vertices than numbers: the faces are no vertices. */
    OFF_ERROR("hostile/OutOfMemory.off", PBR_ERROR_FORMAT, "line 11: a vertex of 5 numbers, where the first one has 3"),
    OFF_ERROR("hostile/empty.off", PBR_ERROR_UNSUPPORTED, "not a format that libpbr reads"),
    OFF_ERROR("hostile/invalid.off", PBR_ERROR_FORMAT, "line 7: a face that has fewer corners than it says"),
};

static void every_file_gives_its_counts_or_its_error(void **state) {
    (void)state;
    if (!has_data()) skip();
    check_files(FILES, sizeof FILES / sizeof *FILES);
}

#define TRIANGLE "3 0 1 2\n"

static void headers_may_be_written_in_many_ways(void **state) {
    (void)state;
    static const char *const TEXTS[] = {
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n" TRIANGLE,
        "OFF 3 1 3\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5 0.5 1",
        "\357\273\277OFF3 1\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 2\r\n",
        "OFF\r3 1\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r",
        "\n  OFF # mesh\n\n# counts\n3 1 0\n# vertices\n0 0 0 # first\n\n1 0 0\n0 1 0\n# faces\n3 0 1 2 # last\n\n",
        "STOFF\n3 1 0\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n" TRIANGLE,
    };
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) {
        struct outcome out = read_text(TEXTS[i]);
        if (out.result != PBR_OK) fail_msg("%s: %s", TEXTS[i], out.error);
        assert_int_equal(out.content.format, PBR_FILE_OFF);
        assert_int_equal(out.content.face_count, 1);
        assert_int_equal(out.mesh.triangle_count, 1);
        assert_int_equal(out.content.warning_count, 0);
        static const double POSITIONS[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
        for (int k = 0; k < 9; k++) assert_true(out.positions[k] == POSITIONS[k]);
    }
}

static void keywords_say_what_vertices_carry(void **state) {
    (void)state;
    static const struct {
        const char *text;
        bool normals, colours;
        uint32_t warnings;
    } CASES[] = {{"NOFF\n2 0 0\n1 2 3 0 0 1\n4 5 6 0 1 0\n", true, false, 0},
                 {"COFF\n2 0 0\n1 2 3 10 20 30 255\n4 5 6 255 0 0 255\n", false, true, 0},
                 {"COFF\n2 0 0\n1 2 3 10 20 30\n4 5 6 255 0 0\n", false, true, 0},
                 {"OFF\n2 0 0\n1 2 3 10 20 30\n4 5 6 255 0 0\n", false, true, 0},
                 {"CNOFF\n2 0 0\n1 2 3 0 0 1 10 20 30 255\n4 5 6 0 1 0 255 0 0 255\n", true, true, 0},
                 {"NCOFF\n2 0 0\n1 2 3 0 0 1 10 20 30\n4 5 6 0 1 0 255 0 0\n", true, true, 0},
                 {"STCNOFF\n2 0 0\n1 2 3 0 0 1 10 20 30 255 0 0\n4 5 6 0 1 0 255 0 0 255 0 0\n", true, true, 0},
                 {"COFF\n2 0 0\n1 2 3\n4 5 6\n", false, false, 1},
                 {"COFF\n2 0 0\n1 2 3 -1 2 2 1\n4 5 6 1 1 1 1\n", false, false, 1},
                 {"OFF\n2 0 0\n1 2 3 4\n4 5 6 7\n", false, false, 1}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != PBR_OK || out.points.has_normals != CASES[i].normals || out.points.has_colours != CASES[i].colours ||
            out.content.warning_count != CASES[i].warnings)
            fail_msg("%s: %s normals %d colours %d", CASES[i].text, out.error, out.points.has_normals, out.points.has_colours);
        for (int k = 0; k < 6; k++) assert_true(out.positions[k] == k + 1);
        static const uint8_t COLOURS[] = {10, 20, 30, 255, 255, 0, 0, 255};
        if (CASES[i].colours) assert_memory_equal(out.colours, COLOURS, 8);
        if (CASES[i].normals) assert_true(fabsf(out.normals[2] - 1) < 1e-4f && fabsf(out.normals[4] - 1) < 1e-4f);
    }
}

static void pure_colours_are_no_normals(void **state) {
    (void)state;
    struct outcome out = read_text("COFF\n2 0 0\n1 2 3 1 0 0 1\n4 5 6 0 0 1 1\n");
    static const uint8_t COLOURS[] = {255, 0, 0, 255, 0, 0, 255, 255};
    assert_true(out.points.has_colours);
    assert_memory_equal(out.colours, COLOURS, 8);
}

#define SQUARE "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

static void faulty_faces_are_left_out_and_others_fanned(void **state) {
    (void)state;
    struct outcome out = read_text("OFF\n4 5 0\n" SQUARE "4 0 1 2 3\n3 0 1 4\n2 0 1\n1 0\n3 2 1 0 255 0 0\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.content.face_count, 5);
    assert_int_equal(out.mesh.triangle_count, 3);
    assert_int_equal(out.content.warning_count, 3);
}

static void faults_name_their_line(void **state) {
    (void)state;
    static const struct {
        const char *text;
        pbr_result result;
        const char *error;
    } CASES[] = {{"OFF\n", PBR_ERROR_FORMAT, "bytes: line 2: the counts of vertices and faces are missing"},
                 {"OFF\n4\n", PBR_ERROR_FORMAT, "bytes: line 2: the counts"},
                 {"OFF\n4 -1 0\n", PBR_ERROR_FORMAT, "bytes: line 2: the counts"},
                 {"OFF\n1.5 1 0\n", PBR_ERROR_FORMAT, "bytes: line 2: the counts"},
                 {"OFF BINARY\n", PBR_ERROR_UNSUPPORTED, "bytes: line 1: binary OFF"},
                 {"4OFF\n1 0 0\n", PBR_ERROR_UNSUPPORTED, "bytes: line 1: 4OFF"},
                 {"OFF\n2 0 0\n1 2 3\n1 x 3\n", PBR_ERROR_FORMAT, "bytes: line 4: 'x' is not a number"},
                 {"OFF\n2 0 0\n1 2\n1 2 3\n", PBR_ERROR_FORMAT, "bytes: line 3: a vertex of 2 numbers"},
                 {"NOFF\n2 0 0\n1 2 3\n1 2 3\n", PBR_ERROR_FORMAT, "bytes: line 3: a vertex of 3 numbers"},
                 {"OFF\n2 0 0\n1 2 3\n1 2 3 4\n", PBR_ERROR_FORMAT, "bytes: line 4: a vertex of 4 numbers"},
                 {"OFF\n4 2 0\n" SQUARE "3 0 -1 2\n" TRIANGLE, PBR_ERROR_FORMAT, "bytes: line 7: '-1' is not a number"},
                 {"OFF\n4 2 0\n" SQUARE "3 0 1\n" TRIANGLE, PBR_ERROR_FORMAT, "bytes: line 7: a face that has fewer corners"},
                 {"OFF\n4 1 0\n", PBR_ERROR_FORMAT, "the data ends before the first whole vertex"}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != CASES[i].result || !strstr(out.error, CASES[i].error)) fail_msg("%s: %s", CASES[i].text, out.error);
    }
}

static void the_end_cuts_off_no_more_than_it_must(void **state) {
    (void)state;
    struct outcome out = read_text("OFF\n4 2 0\n" SQUARE "3 0 1 2\n3 0 1");
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("OFF\n4 2 0\n" SQUARE);
    assert_int_equal(out.points.count, 4);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 2");
    assert_int_equal(out.points.count, 2);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("OFF\n4 1 0\n" SQUARE TRIANGLE TRIANGLE);
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("OFF\n9007199254740992 9007199254740992 0\n0 0 0\n1 0 0\n");
    assert_int_equal(out.points.count, 2);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("OFF\n0 0 0\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.points.count, 0);
    assert_int_equal(out.content.warning_count, 1);
}

static void broken_anywhere_it_gives_a_mesh_points_or_an_error(void **state) {
    (void)state;
    static const char TEXT[] = "CNOFF # all\n4 3 0\n0 0 0 0 0 1 1 2 3 255\n1 0 0 0 0 1 4 5 6 255\n1 1 .5e0 0 0 1 7 8 9 255\n"
                               "0 1 0 0 0 -1 0 0 0 255\n4 0 1 2 3 1 0 0\n3 0 1 2\n3 3 2 1\n";
    check_every_cut(TEXT, sizeof TEXT - 1);
    check_changes(TEXT, sizeof TEXT - 1, 5, 1500);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_gives_its_counts_or_its_error),
        cmocka_unit_test(headers_may_be_written_in_many_ways),
        cmocka_unit_test(keywords_say_what_vertices_carry),
        cmocka_unit_test(pure_colours_are_no_normals),
        cmocka_unit_test(faulty_faces_are_left_out_and_others_fanned),
        cmocka_unit_test(faults_name_their_line),
        cmocka_unit_test(the_end_cuts_off_no_more_than_it_must),
        cmocka_unit_test(broken_anywhere_it_gives_a_mesh_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
