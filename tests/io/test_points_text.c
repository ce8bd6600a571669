/* Points as lines of numbers: what the columns mean, what is skipped, and what is refused. Counts of the files are those of their
 * lines. SPDX-License-Identifier: MIT */
#include "reading.h"

#include <math.h>

#define TEXT(path, format, count, warnings, normals, colours, scalars)                                                             \
    { path, PBR_OK, format, count, 0, 0, warnings, normals, colours, scalars, NULL }

static const struct expected FILES[] = {
    TEXT("points/cgal_kitten.xyz", PBR_FILE_XYZ, 5210, 0, true, false, 0),
    TEXT("points/cgal_sphere_20k_normal.xyz", PBR_FILE_XYZ, 21000, 0, true, false, 0),
    TEXT("points/pts/autzen.pts", PBR_FILE_PTS, 10, 0, false, true, 1),
    TEXT("points/pts/bunny_8.pts", PBR_FILE_PTS, 9, 1, false, false, 0), /* a row more than announced */
    TEXT("points/pts/site_56_8.pts", PBR_FILE_PTS, 8, 0, false, false, 1),
    TEXT("points/pts/test.pts", PBR_FILE_PTS, 19, 0, false, true, 1),
    TEXT("hostile/badheader.txt", PBR_FILE_XYZ, 8, 1, false, false, 0), /* its names are skipped, right or wrong */
    TEXT("hostile/crlf_test.txt", PBR_FILE_XYZ, 10, 1, false, false, 1),
    TEXT("hostile/missingheader.pcd", PBR_FILE_XYZ, 10, 0, false, false, 0), /* what is left of it are lines of numbers */
    {"hostile/box_UTF16BE.obj", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, false, false, 0, "UTF-16"},
    {"formats/pcd/octants.pcd", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, false, false, 0, "PCD is not supported; convert"},
    {"qs/bunny.qs", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, false, false, 0, "QSplat"},
    {"gaussians/test-splat.3-points-from-train.spz", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, false, false, 0, "gzip"},
};

static void every_file_gives_its_rows_or_its_error(void **state) {
    (void)state;
    if (!has_data()) skip();
    check_files(FILES, sizeof FILES / sizeof *FILES);
}

static void rows_may_be_written_in_many_ways(void **state) {
    (void)state;
    static const char *const TEXTS[] = {
        "1 2 3\n4 5 6\n",
        "1,2,3\n4,5,6",
        "1; 2; 3\r\n4;\t5;6\r\n",
        "1\t2\t3\r4\t5\t6\r",
        "# a comment\n\n// another\n 1 2 3 # and one\n  +4. 5e0 0.6e1,\n\n",
        "\357\273\2771 2 3\n4 5 6",
        "2\n1 2 3\n4 5 6\n",
        "1\n1 2 3\n1\n4 5 6\n",
        "x y z\n1 2 3\n4 5 6\n",
        "\"x\";\"y\", z m\n1 2 3 0\n4 5 6 0\n",
    };
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) {
        struct outcome out = read_text(TEXTS[i]);
        if (out.result != PBR_OK || out.points.count != 2) fail_msg("%s: %s", TEXTS[i], out.error);
        for (int k = 0; k < 6; k++) assert_true(out.positions[k] == k + 1);
        bool names = strstr(TEXTS[i], "y") != NULL, counts = TEXTS[i][1] == '\n';
        assert_int_equal(out.content.warning_count, names);
        assert_int_equal(out.content.format, counts ? PBR_FILE_PTS : PBR_FILE_XYZ);
    }
}

struct meaning {
    const char *text;
    bool normals, colours;
    uint32_t scalars;
    uint8_t colour[3]; /* of the first row */
    float normal[3], scalar;
};

static void columns_mean_what_their_number_and_range_say(void **state) {
    (void)state;
    static const struct meaning CASES[] = {
        {"0 0 0 -7.5\n", false, false, 1, {0}, {0}, -7.5f},
        {"0 0 0 0 0.6 -0.8\n1 1 1 1 0 0\n2 2 2 0 0 0\n", true, false, 0, {0}, {0, 0.6f, -0.8f}, 0},
        {"0 0 0 1 2 255\n", false, true, 0, {1, 2, 255}, {0}, 0},
        {"0 0 0 0.2 0.4 1\n1 1 1 0 0 0\n", false, true, 0, {51, 102, 255}, {0}, 0},
        {"0 0 0 257 514 65535\n", false, true, 0, {1, 2, 255}, {0}, 0},
        {"0 0 0 1 2 256\n1 1 1 -1 0 0\n", false, false, 3, {0}, {0}, 1},
        {"0 0 0 9 1 2 3\n1 1 1 9 255 0 0\n", false, true, 1, {1, 2, 3}, {0}, 9},
        {"0 0 0 9 0 -1 0\n", true, false, 1, {0}, {0, -1, 0}, 9},
        {"0 0 0 10 20 30 0 0 -1\n", true, true, 0, {10, 20, 30}, {0, 0, -1}, 0},
        {"0 0 0 0 0 -1 10 20 30\n", true, true, 0, {10, 20, 30}, {0, 0, -1}, 0},
        {"0 0 0 1 0 0 0 -1 0\n", true, true, 0, {255, 0, 0}, {0, -1, 0}, 0},
        {"0 0 0 0 -1 0 1 0 0\n", true, true, 0, {255, 0, 0}, {0, -1, 0}, 0},
        {"0 0 0 4 5\n", false, false, 2, {0}, {0}, 4},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        const struct meaning *c = &CASES[i];
        struct outcome out = read_text(c->text);
        if (out.result != PBR_OK || out.points.has_normals != c->normals || out.points.has_colours != c->colours ||
            out.points.scalar_count != c->scalars)
            fail_msg("%s: %s normals %d colours %d scalars %u", c->text, out.error, out.points.has_normals, out.points.has_colours,
                     (unsigned)out.points.scalar_count);
        if (c->colours) assert_memory_equal(out.colours, c->colour, 3);
        /* Normals are kept in 2 x 16 bits. */
        for (int k = 0; k < 3 && c->normals; k++) assert_true(fabsf(out.normals[k] - c->normal[k]) < 1e-4f);
        if (c->scalars) assert_true(out.scalars[0][0] == c->scalar);
    }
}

static void scans_follow_one_another(void **state) {
    (void)state;
    struct outcome out = read_text("2\n1 1 1 -5\n2 2 2 -6\n1\n3 3 3 -7\n");
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.points.count, 3);
    assert_int_equal(out.content.warning_count, 0);
    assert_string_equal(out.names[0], "intensity");
    assert_true(out.scalars[0][2] == -7);
    out = read_text("18446744073709551615\n1 1 1\n18446744073709551615\n2 2 2\n");
    assert_int_equal(out.points.count, 2);
    assert_int_equal(out.content.warning_count, 1);
}

static void faults_name_their_line(void **state) {
    (void)state;
    static const struct {
        const char *text;
        pbr_result result;
        const char *error;
    } CASES[] = {{"1 2 3\n4 5 x6\n7 8 9\n", PBR_ERROR_FORMAT, "bytes: line 2: 'x6' is not a number"},
                 {"#\n1 2 3\n4 5\n7 8 9\n", PBR_ERROR_FORMAT, "bytes: line 3: 2 columns, where the first row has 3"},
                 {"1 2 3\n4 5 6 7\n", PBR_ERROR_FORMAT, "bytes: line 2: 4 columns"},
                 {"1 2 3\n4,,6\n7 8 9\n", PBR_ERROR_FORMAT, "bytes: line 2: "},
                 {"4\n3\n0 0 0\n1 0 0\n", PBR_ERROR_UNSUPPORTED, "bytes: line 1: PTX"},
                 {"1 2\n3 4\n", PBR_ERROR_UNSUPPORTED, "bytes: byte 0: not a format that libpbr reads"},
                 {"a b\n1 2 3\n", PBR_ERROR_UNSUPPORTED, "not a format"},
                 {"hello\n", PBR_ERROR_UNSUPPORTED, "not a format"},
                 {"12\n", PBR_ERROR_UNSUPPORTED, "not a format"},
                 {"12\nC 0 0 0\n", PBR_ERROR_UNSUPPORTED, "not a format"},
                 {"", PBR_ERROR_UNSUPPORTED, "not a format"}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct outcome out = read_text(CASES[i].text);
        assert_int_equal(out.result, CASES[i].result);
        if (!strstr(out.error, CASES[i].error)) fail_msg("%s", out.error);
    }
}

static void a_row_that_the_end_cuts_is_left_out(void **state) {
    (void)state;
    static const char *const TEXTS[] = {"1 2 3\n4 5", "1 2 3\n4 5 -", "1 2 3\n4", "1 2 3\r4 5 6e+"};
    for (size_t i = 0; i < sizeof TEXTS / sizeof *TEXTS; i++) {
        struct outcome out = read_text(TEXTS[i]);
        assert_int_equal(out.result, PBR_OK);
        assert_int_equal(out.points.count, 1);
        assert_int_equal(out.content.warning_count, 1);
    }
}

/* More pieces than one, each with its comments and count lines: rows stay in order. */
static void large_files_keep_their_order(void **state) {
    (void)state;
    enum { ROWS = 60000 };
    size_t room = ROWS * 32, size = 0;
    char *text = malloc(room);
    assert_non_null(text);
    for (int i = 0; i < ROWS; i++) {
        if (i % 1000 == 0) size += (size_t)snprintf(text + size, room - size, "1000\n# scan\n");
        size += (size_t)snprintf(text + size, room - size, "%d %d.5 -%d\n", i, i, i);
    }
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    desc.flags = PBR_READ_KEEP_RADII;
    assert_int_equal(pbr_read_memory(instance, "text", text, size, &desc, &content), PBR_OK);
    assert_int_equal(content.vertex_count, ROWS);
    assert_int_equal(content.warning_count, 0);
    double *positions = malloc(ROWS * 3 * sizeof *positions);
    assert_non_null(positions);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = positions;
    assert_int_equal(pbr_points_copy(content.points, 0, ROWS, &copy), PBR_OK);
    for (int i = 0; i < ROWS; i++)
        assert_true(positions[3 * i] == i && positions[3 * i + 1] == i + 0.5 && positions[3 * i + 2] == -i);
    free(positions);
    free(text);
    pbr_points_release(&content.points);
    host_finish(&host, instance);
}

/* The first row promises 35 columns; each of the short lines after it may ask for no more room than its bytes justify. */
static void short_lines_do_not_make_large_arrays(void **state) {
    (void)state;
    size_t size = 16u << 20;
    char *text = malloc(size);
    assert_non_null(text);
    memset(text, '\n', size);
    for (size_t i = 0; i < 70; i++) text[i] = i % 2 ? ' ' : '1';
    for (size_t i = 72; i < size; i += 2) text[i] = 'a';
    struct outcome out = read_it("bytes", text, size, PBR_READ_KEEP_RADII);
    assert_int_equal(out.result, PBR_ERROR_FORMAT);
    free(text);
}

static void broken_anywhere_it_gives_points_or_an_error(void **state) {
    (void)state;
    static const char *const TEXTS[] = {
        "# scan\n3\n1.25 2 3 -17 10 20 30\n4 5 6 18 255 0 1e1 # end\n2\n7 8 9 nan 1 2 3\n",
        "x,y,z,nx,ny,nz,r,g,b\n1,2,3,0,0,1,10,20,30\n4,5,6,0,-1,0,255,0,7\n",
    };
    for (size_t i = 0; i < 2; i++) {
        check_every_cut(TEXTS[i], strlen(TEXTS[i]));
        check_changes(TEXTS[i], strlen(TEXTS[i]), 3 + i, 1000);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_gives_its_rows_or_its_error),
        cmocka_unit_test(rows_may_be_written_in_many_ways),
        cmocka_unit_test(columns_mean_what_their_number_and_range_say),
        cmocka_unit_test(scans_follow_one_another),
        cmocka_unit_test(faults_name_their_line),
        cmocka_unit_test(a_row_that_the_end_cuts_is_left_out),
        cmocka_unit_test(large_files_keep_their_order),
        cmocka_unit_test(short_lines_do_not_make_large_arrays),
        cmocka_unit_test(broken_anywhere_it_gives_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
