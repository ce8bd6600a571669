/* TRI: sections in any order and spelling, indices from 0 and from 1, and broken files. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>

#define SQUARE "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
#define UPWARDS "0 0 1\n0 0 1\n0 0 1\n0 0 1\n"
#define FROM_0 "0 1 2\n0 2 3\n"
#define FROM_1 "1 2 3\n1 3 4\n"

static void sections_may_be_written_in_many_ways(void **state) {
    (void)state;
    static const struct {
        const char *text;
        bool normals;
        uint32_t warnings;
    } CASES[] = {
        {"Vertices\n4\n" SQUARE "Vertices' Normals\n4\n" UPWARDS "Triangles\n2\n" FROM_0, true, 0},
        {"Vertices 4\n" SQUARE "Vertices' Normals 4\n" UPWARDS "Triangles 2\n" FROM_0, true, 0},
        {"[Vertices]\n4\n" SQUARE "[Vertices Normals]\n4\n" UPWARDS "[Triangles]\n2\n" FROM_0, true, 0},
        {"VERTICES: 4\n" SQUARE "VERTEX NORMALS: 4\n" UPWARDS "TRIANGLES: 2\n" FROM_0, true, 0},
        {"-- Vertices (4) --\n" SQUARE "-- Triangles (2) --\n" FROM_0, false, 0},
        {"Vertices\n" SQUARE "Triangles\n" FROM_0, false, 0},
        {"Triangles\n2\n" FROM_0 "Vertices' Normals\n4\n" UPWARDS "Vertices\n4\n" SQUARE, true, 0},
        {"\357\273\277# comment\n\nTRI 1.0\nVertices\n\n4 # four\n" SQUARE "// faces\nTriangles\n2\n" FROM_0, false, 0},
        {"TRI\nVertices\n4\n" SQUARE "Triangles\n2\n" FROM_0 "Triangles' Normals\n2\n0 0 1\n0 0 1\n", false, 0},
        {"A title\nVertices\n4\n" SQUARE "Materials\n1\nred 1 0 0\nTriangles\n2\n" FROM_0, false, 3},
        {"Vertices\r\n4\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\nTriangles\r\n2\r\n0 1 2\r\n0 2 3", false, 0},
        {"Vertices\r4\r0 0 0\r1 0 0\r1 1 0\r0 1 0\rTriangles\r2\r0 1 2\r0 2 3\r", false, 0},
        {"Vertices\n4\n0,0,0\n+1;0;0\n 1e0\t1 0\n-0 .1e1 0\nTriangles\n2\n" FROM_0, false, 0},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (out.result != PBR_OK || out.mesh.triangle_count != 2 || out.mesh.has_normals != CASES[i].normals ||
            out.content.warning_count != CASES[i].warnings)
            fail_msg("%s: %s, %d warnings", CASES[i].text, out.error, (int)out.content.warning_count);
        assert_int_equal(out.content.format, PBR_FILE_TRI);
        assert_int_equal(out.content.vertex_count, 4);
        assert_int_equal(out.content.face_count, 2);
        assert_string_equal(out.content.encoding, "text, indices from 0");
        static const double POSITIONS[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
        for (int k = 0; k < 12; k++) assert_true(out.positions[k] == POSITIONS[k]);
        for (int k = 0; k < 4; k++) assert_true(fabsf(out.normals[3 * k + 2] - 1) < 1e-4f); /* kept in 2 x 16 bits */
    }
}

static void indices_count_from_0_or_1_as_they_show(void **state) {
    (void)state;
    static const struct {
        const char *triangles, *encoding;
        uint64_t kept;
        uint32_t warnings;
    } CASES[] = {{"2\n" FROM_0, "text, indices from 0", 2, 0},
                 {"2\n" FROM_1, "text, indices from 1", 2, 0},
                 {"1\n2 3 4\n", "text, indices from 1", 1, 0},
                 {"1\n1 2 3\n", "text, indices from 0", 1, 1},                  /* nothing tells */
                 {"3\n" FROM_0 "0 1 4\n", "text, indices from 0", 2, 1},        /* one does not fit */
                 {"4\n" FROM_1 "0 4 1\n2 4 3\n", "text, indices from 1", 3, 1}, /* likewise */
                 {"3\n" FROM_0 "0 1 99999999999999\n", "text, indices from 0", 2, 1}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        char text[300];
        snprintf(text, sizeof text, "Vertices\n4\n" SQUARE "Triangles\n%s", CASES[i].triangles);
        struct outcome out = read_text(text);
        if (out.result != PBR_OK || strcmp(out.content.encoding, CASES[i].encoding) != 0 ||
            out.mesh.triangle_count != CASES[i].kept || out.content.warning_count != CASES[i].warnings)
            fail_msg("%s: %s, %s, %d warnings", text, out.error, out.content.encoding, (int)out.content.warning_count);
    }
    /* Which corners a triangle has, its points tell: the second vertex is in none. */
    struct outcome out = read_text("Vertices\n4\n7 7 7\n0 0 0\n1 0 0\n1 1 0\nTriangles\n1\n4 2 3\n");
    static const double POSITIONS[] = {0, 0, 0, 1, 0, 0, 1, 1, 0};
    assert_int_equal(out.points.count, 3);
    for (int k = 0; k < 9; k++) assert_true(out.positions[k] == POSITIONS[k]);
}

static void vertices_may_have_colours(void **state) {
    (void)state;
    static const uint8_t COLOURS[] = {51, 102, 255, 255, 0, 0, 0, 255};
    static const char *const TEXTS[] = {"Vertices\n2\n0 0 0\n1 1 1\nVertices' Colours\n2\n51 102 255\n0 0 0\n",
                                        "Vertices\n2\n0 0 0\n1 1 1\nvertex colors 2\n0.2 0.4 1\n0 0 0\n"};
    for (size_t i = 0; i < 2; i++) {
        struct outcome out = read_text(TEXTS[i]);
        assert_int_equal(out.content.warning_count, 0);
        assert_true(out.points.has_colours);
        assert_memory_equal(out.colours, COLOURS, sizeof COLOURS);
    }
    struct outcome out = read_text("Vertices\n1\n0 0 0\nVertices' Colours\n1\n0 -1 0\n");
    assert_int_equal(out.content.warning_count, 1);
    assert_false(out.points.has_colours);
}

static void what_not_every_vertex_has_is_left_out(void **state) {
    (void)state;
    struct outcome out =
        read_text("Vertices\n2\n0 0 0\n1 1 1\nVertices' Normals\n1\n0 0 1\nVertices' Colours\n3\n" FROM_0 "1 1 1\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.content.warning_count, 2);
    assert_false(out.points.has_normals);
    assert_false(out.points.has_colours);
    out = read_text("Vertices\n1\n0 0 0\n1 1 1\n2 2 2\n");
    assert_int_equal(out.points.count, 1);
    assert_int_equal(out.content.warning_count, 2);
}

static void faults_name_their_line(void **state) {
    (void)state;
    static const struct {
        const char *text;
        pbr_result result;
        const char *error;
    } CASES[] = {{"Triangles\n1\n0 1 2\n", PBR_ERROR_FORMAT, "bytes: line 4: the file has no section 'Vertices'"},
                 {"Vertices\n2\n1 2 3\n1 x 3\n", PBR_ERROR_FORMAT, "bytes: line 4: 'x' is not a number"},
                 {"Vertices\n2\n1 2\n1 2 3\n", PBR_ERROR_FORMAT, "bytes: line 3: a row of 2 numbers"},
                 {"Vertices\n1\n1 2 3 4\n", PBR_ERROR_FORMAT, "bytes: line 3: a row of 4 numbers"},
                 {"Vertices\n1.5\n1 2 3\n", PBR_ERROR_FORMAT, "bytes: line 2: '1.5' is not a count"},
                 {"Vertices\n-1\n1 2 3\n", PBR_ERROR_FORMAT, "bytes: line 2: '-1' is not a count"},
                 {"Vertices\n18446744073709551616\n1 2 3\n", PBR_ERROR_FORMAT, "line 2: '18446744073709551616' is not a count"},
                 {"Vertices\n3\n1 2 3\n1 2 3\nTriangles\n", PBR_ERROR_FORMAT, "line 5: the section ends after 2 of 3 vertices"},
                 {"Vertices\n1\n1 2 3\nVertices\n1\n", PBR_ERROR_FORMAT, "line 4: a second section of vertices"},
                 {"Vertices\n4\n" SQUARE "Triangles\n1\n0 -1 2\n\n", PBR_ERROR_FORMAT, "line 9: -1 is not the index"},
                 {"Vertices\n4\n" SQUARE "Triangles\n1\n0 1.5 2\n", PBR_ERROR_FORMAT, "line 9: 1.5 is not the index"},
                 {"Vertices\n4\n" SQUARE "Triangles\n1\n0 nan 2\n", PBR_ERROR_FORMAT, "is not the index"},
                 {"Vertices\n4\n", PBR_ERROR_FORMAT, "bytes: line 3: the data ends before the first whole vertex"},
                 {"Verticals\n4\n1 2 3\n", PBR_ERROR_UNSUPPORTED, "not a format that libpbr reads"},
                 {"x y z\n1 2 3\nVertices\n", PBR_OK, ""}}; /* columns with names: XYZ, if anything */
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        if (CASES[i].result == PBR_OK) assert_int_not_equal(out.content.format, PBR_FILE_TRI);
        else if (out.result != CASES[i].result || !strstr(out.error, CASES[i].error)) fail_msg("%s: %s", CASES[i].text, out.error);
    }
}

static void the_end_cuts_off_no_more_than_it_must(void **state) {
    (void)state;
    struct outcome out = read_text("Vertices\n4\n" SQUARE "Triangles\n2\n0 1 2\n0 3");
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("Vertices\n4\n" SQUARE "Triangles\n3\n0 1 2\n0 2 3"); /* 3 of 31, say */
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("Vertices\n4\n" SQUARE "Triangles\n0 1 2\n0 3");
    assert_int_equal(out.mesh.triangle_count, 1);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("Vertices\n4\n" SQUARE "Triangles\n2");
    assert_int_equal(out.points.count, 4);
    assert_int_equal(out.content.warning_count, 1);
    out = read_text("Vertices\n18446744073709551615\n0 0 0\n1 0 0\n");
    assert_int_equal(out.points.count, 2);
    out = read_text("Vertices\n4000000000\n0 0 0\n1 0 0\nTriangles\n4000000000\n");
    assert_int_equal(out.result, PBR_ERROR_FORMAT);
    out = read_text("Vertices\n0\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.points.count, 0);
    assert_int_equal(out.content.warning_count, 1);
}

static void broken_anywhere_it_gives_a_mesh_points_or_an_error(void **state) {
    (void)state;
    static const char TEXT[] = "# all\nTRI 1.0\nVertices 4\n0 0 0\n1 0 0\n1 1 .5e0\n0 1 0\nVertices' Normals\n4\n0 0 1\n0 1 0\n"
                               "1 0 0\n0 0 -1\nVertices' Colours\n4\n255 0 0\n0 255 0\n0 0 255\n9 9 9\nTriangles' Normals\n2\n"
                               "0 0 1\n0 0 1\nTriangles\n2\n1 2 3\n1 3 4\n";
    check_every_cut(TEXT, sizeof TEXT - 1);
    check_changes(TEXT, sizeof TEXT - 1, 11, 1500);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sections_may_be_written_in_many_ways),
        cmocka_unit_test(indices_count_from_0_or_1_as_they_show),
        cmocka_unit_test(vertices_may_have_colours),
        cmocka_unit_test(what_not_every_vertex_has_is_left_out),
        cmocka_unit_test(faults_name_their_line),
        cmocka_unit_test(the_end_cuts_off_no_more_than_it_must),
        cmocka_unit_test(broken_anywhere_it_gives_a_mesh_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
