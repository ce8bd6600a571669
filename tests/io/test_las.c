/* LAS files of many writers, and broken ones, against what their bytes say: counts from the headers and the files' sizes, values
 * from the records, worked out by hand. SPDX-License-Identifier: MIT */
#include "reading.h"

#define LAS(path, count, warnings, colours, scalars)                                                                               \
    { path, PBR_OK, PBR_FILE_LAS, count, 0, 0, warnings, false, colours, scalars, NULL }
#define LAS_ERROR(path, result, error)                                                                                             \
    { path, result, 0, 0, 0, 0, 0, false, false, 0, error }

/* Colours that are all 0 are left out with a warning; a header that promises points where the file ends is an error. */
static const struct expected FILES[] = {
    LAS("formats/las/1.0_0.las", 1, 0, false, 4),
    LAS("formats/las/1.0_1.las", 1, 0, false, 5),
    LAS("formats/las/1.1_0.las", 1, 0, false, 4),
    LAS("formats/las/1.1_1.las", 1, 0, false, 5),
    LAS_ERROR("formats/las/1.2-no-points.las", PBR_ERROR_FORMAT, "byte 229: the data ends before the first whole point"),
    LAS("formats/las/1.2-with-color.las", 1065, 0, true, 5),
    LAS("formats/las/1.2_0.las", 1, 0, false, 4),
    LAS("formats/las/1.2_1.las", 1, 0, false, 5),
    LAS("formats/las/1.2_2.las", 1, 0, true, 4),
    LAS("formats/las/1.2_3.las", 1, 0, true, 5),
    LAS("formats/las/100-points.las", 100, 0, true, 5),
    LAS("formats/las/no-points.las", 0, 1, false, 0),
    LAS("formats/las/pdrf10-1.4.las", 1024, 0, true, 5),
    LAS("formats/las/pdrf10-1.5.las", 1024, 0, true, 5),
    LAS("formats/las/pdrf4-1.3.las", 1024, 0, false, 5),
    LAS("formats/las/pdrf5-1.3.las", 1024, 0, true, 5),
    LAS("formats/las/pdrf6-1.4.las", 1024, 0, false, 5),
    LAS("formats/las/pdrf7-v4-1.4.las", 1024, 0, true, 5),
    LAS("formats/las/pdrf8-1.4.las", 1024, 0, true, 5),
    LAS("formats/las/pdrf9-1.4.las", 1024, 0, false, 5),
    LAS("formats/las/points-1.4.las", 3, 0, true, 5),
    LAS("formats/las/prec3.las", 110, 0, true, 5),
    LAS("formats/las/test1_4.las", 1000, 0, false, 5),
    LAS("formats/las/utm15.las", 1, 0, true, 5),
    LAS("formats/las/utm17.las", 10, 1, false, 5),
    LAS("points/autzen_5m.las", 5000000, 0, true, 4),
    LAS("points/autzen_trim.las", 110000, 0, true, 5),
    LAS("points/autzen_trim_7.las", 110000, 0, true, 5),
    LAS_ERROR("points/autzen_trim.laz", PBR_ERROR_UNSUPPORTED, "compressed LAS is not supported; decompress with"),
    LAS("hostile/bad-geotiff-keys.las", 10, 0, false, 5),
    LAS("hostile/bad_vlr_count.las", 10, 1, false, 5),
    LAS("hostile/spec_3.las", 10, 1, false, 5),
    LAS("hostile/spurious.las", 1065, 0, true, 5),
};

static void every_file_gives_its_points_or_its_error(void **state) {
    (void)state;
    if (!has_data()) skip();
    check_files(FILES, sizeof FILES / sizeof *FILES);
}

static void put(char *to, uint64_t value, size_t size) {
    for (size_t i = 0; i < size; i++) to[i] = (char)(value >> (8 * i));
}

static void put_double(char *to, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(to, bits, 8);
}

enum { COUNT = 5, MOST_BYTES = 2048, LARGE_HEADER = 375, EXTRA = 3 };

static const unsigned SIZES[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
static const unsigned TIMES[] = {0, 20, 0, 20, 20, 20, 22, 22, 22, 22, 22};
static const unsigned COLOURS[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

/* A file of COUNT points with EXTRA bytes in each record. Returns its size. */
static size_t write_las(char *file, unsigned minor, unsigned format, unsigned colour_factor) {
    size_t header = minor >= 4 ? LARGE_HEADER : minor == 3 ? 235 : 227, record = SIZES[format] + EXTRA;
    memset(file, 0, MOST_BYTES);
    memcpy(file, "LASF", 4);
    put(file + 24, 1, 1);
    put(file + 25, minor, 1);
    put(file + 94, header, 2);
    put(file + 96, header + 2, 4); /* as in 1.0, where two bytes may stand between */
    put(file + 104, format, 1);
    put(file + 105, record, 2);
    put(file + 107, minor >= 4 ? 0 : COUNT, 4);
    if (minor >= 4) put(file + 247, COUNT, 8);
    for (int k = 0; k < 3; k++) {
        put_double(file + 131 + 8 * k, 0.01 * (k + 1));
        put_double(file + 155 + 8 * k, 600000.5 + k);
    }
    for (int i = 0; i < COUNT; i++) {
        char *p = file + header + 2 + (size_t)i * record;
        for (int k = 0; k < 3; k++) put(p + 4 * k, (uint64_t)(int64_t)(1000 * i - 2147480000 * (k == 2)), 4);
        put(p + 12, 65535 - (unsigned)i, 2);
        put(p + 14, format >= 6 ? 0xe9 : 0xf5, 1); /* extended: return 9 of 14; else return 5 of 6, and flags above */
        put(p + 15, 0xe2, 1);                      /* class 2 with flags above */
        if (format >= 6) put(p + 16, 200, 1);
        if (TIMES[format]) put_double(p + TIMES[format], 3e8 + 0.25 * i);
        for (unsigned k = 0; k < 3 && COLOURS[format]; k++)
            put(p + COLOURS[format] + 2 * k, (10 * (unsigned)i + k) * colour_factor, 2);
    }
    return header + 2 + COUNT * record;
}

static void every_version_and_point_format_reads_alike(void **state) {
    (void)state;
    for (unsigned minor = 0; minor <= 5; minor++)
        for (unsigned format = 0; format <= 10; format++)
            for (unsigned factor = 1; factor <= 257; factor += 256) {
                char file[MOST_BYTES];
                struct outcome out = read_bytes(file, write_las(file, minor, format, factor));
                assert_int_equal(out.result, PBR_OK);
                assert_int_equal(out.points.count, COUNT);
                assert_int_equal(out.content.warning_count, 0);
                assert_int_equal(out.points.scalar_count, TIMES[format] ? 5 : 4);
                assert_int_equal(out.points.has_colours, COLOURS[format] != 0);
                assert_string_equal(out.names[0], "intensity");
                for (int i = 0; i < COUNT; i++) {
                    for (int k = 0; k < 3; k++)
                        assert_true(out.positions[3 * i + k] ==
                                    (1000 * i - 2147480000 * (k == 2)) * (0.01 * (k + 1)) + (600000.5 + k));
                    assert_true(out.scalars[0][i] == (float)(65535 - i));
                    assert_true(out.scalars[1][i] == (format >= 6 ? 200 : 2));
                    assert_true(out.scalars[2][i] == (format >= 6 ? 9 : 5));
                    assert_true(out.scalars[3][i] == (format >= 6 ? 14 : 6));
                    if (TIMES[format]) assert_true(out.scalars[4][i] == 0.25f * (float)i);
                    /* 8 bits in the low half, or filling 16: the same colours. */
                    for (int k = 0; k < 3 && COLOURS[format]; k++) assert_int_equal(out.colours[4 * i + k], 10 * i + k);
                }
            }
}

static void positions_are_the_records_numbers_exactly(void **state) {
    (void)state;
    if (!has_data()) skip();
    size_t size;
    char *data = load("points/autzen_trim_7.las", &size);
    struct outcome out = read_bytes(data, size);
    static const double FIRST[] = {637177.98, 849393.9500000001, 411.19, 637177.3, 849396.9500000001, 411.25};
    for (int i = 0; i < 6; i++) assert_true(out.positions[i] == FIRST[i]);
    static const uint8_t COLOUR[] = {84, 102, 93, 255, 82, 98, 90, 255};
    assert_memory_equal(out.colours, COLOUR, sizeof COLOUR);
    free(data);
}

static void broken_headers_say_where_and_why(void **state) {
    (void)state;
    static const struct {
        size_t at, size;
        uint64_t value;
        pbr_result result;
        const char *error;
    } CASES[] = {{24, 1, 2, PBR_ERROR_UNSUPPORTED, "byte 24: LAS version 2.2"},
                 {25, 1, 6, PBR_ERROR_UNSUPPORTED, "byte 24: LAS version 1.6"},
                 {94, 2, 226, PBR_ERROR_FORMAT, "byte 94: a LAS header of 226 bytes"},
                 {96, 4, 226, PBR_ERROR_FORMAT, "byte 96: the points begin inside the header"},
                 {96, 4, 0xffffffff, PBR_ERROR_FORMAT, "the data ends before the points"},
                 {104, 1, 11, PBR_ERROR_UNSUPPORTED, "byte 104: LAS point format 11"},
                 {104, 1, 0x83, PBR_ERROR_UNSUPPORTED, "byte 104: compressed LAS"},
                 {104, 1, 0x43, PBR_ERROR_UNSUPPORTED, "byte 104: compressed LAS"},
                 {105, 2, 33, PBR_ERROR_FORMAT, "byte 105: point records of 33 bytes"},
                 {105, 2, 0, PBR_ERROR_FORMAT, "byte 105: point records of 0 bytes"},
                 {139, 8, 0, PBR_ERROR_FORMAT, "byte 139: a scale"},
                 {147, 8, UINT64_C(0x7ff0000000000000), PBR_ERROR_FORMAT, "byte 147: a scale"},
                 {155, 8, UINT64_C(0x7ff8000000000000), PBR_ERROR_FORMAT, "byte 155: an offset"}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        char file[MOST_BYTES];
        size_t size = write_las(file, 2, 3, 1);
        put(file + CASES[i].at, CASES[i].value, CASES[i].size);
        struct outcome out = read_bytes(file, size);
        assert_int_equal(out.result, CASES[i].result);
        if (!strstr(out.error, CASES[i].error)) fail_msg("%s", out.error);
    }
}

static void compressed_files_are_known_by_their_records_too(void **state) {
    (void)state;
    static const char *const USERS[] = {"laszip encoded", "copc"};
    for (int i = 0; i < 2; i++) {
        char file[MOST_BYTES] = {0}, whole[MOST_BYTES];
        size_t size = write_las(file, 2, 3, 1), vlr = 54 + 7;
        memcpy(whole, file, 227);
        memset(whole + 227, 0, 2 * vlr);
        memcpy(whole + 227 + 2, "other", 6);
        put(whole + 227 + 20, 7, 2);
        memcpy(whole + 227 + vlr + 2, USERS[i], strlen(USERS[i]) + 1);
        memcpy(whole + 227 + 2 * vlr, file + 227, size - 227);
        put(whole + 96, 227 + 2 * vlr, 4);
        put(whole + 100, 2, 4);
        struct outcome out = read_bytes(whole, size + 2 * vlr);
        assert_int_equal(out.result, PBR_ERROR_UNSUPPORTED);
        assert_non_null(strstr(out.error, "decompress"));
        put(whole + 100, 1, 4); /* as many records as are counted */
        assert_int_equal(read_bytes(whole, size + 2 * vlr).result, PBR_OK);
    }
}

static void counts_past_the_end_give_what_is_there(void **state) {
    (void)state;
    char file[MOST_BYTES];
    size_t size = write_las(file, 4, 7, 1);
    put(file + 247, UINT64_MAX, 8);
    struct outcome out = read_bytes(file, size);
    assert_int_equal(out.result, PBR_OK);
    assert_int_equal(out.points.count, COUNT);
    assert_int_equal(out.content.warning_count, 1);
    put(file + 247, 3, 8);
    assert_int_equal(read_bytes(file, size).points.count, 3);
    put(file + 107, 2, 4); /* the old count beside it, another number */
    out = read_bytes(file, size);
    assert_int_equal(out.points.count, 3);
    assert_int_equal(out.content.warning_count, 1);
    put(file + 247, 0, 8);
    assert_int_equal(read_bytes(file, size).points.count, 2);
}

static void broken_anywhere_it_gives_points_or_an_error(void **state) {
    (void)state;
    char file[MOST_BYTES];
    size_t size = write_las(file, 2, 3, 1);
    check_every_cut(file, size);
    check_changes(file, size, 1, 500);
    size = write_las(file, 4, 10, 257);
    check_every_cut(file, size);
    check_changes(file, size, 2, 500);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_gives_its_points_or_its_error),
        cmocka_unit_test(every_version_and_point_format_reads_alike),
        cmocka_unit_test(positions_are_the_records_numbers_exactly),
        cmocka_unit_test(broken_headers_say_where_and_why),
        cmocka_unit_test(compressed_files_are_known_by_their_records_too),
        cmocka_unit_test(counts_past_the_end_give_what_is_there),
        cmocka_unit_test(broken_anywhere_it_gives_points_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
