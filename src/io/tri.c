/* TRI (University of West Bohemia): sections, each a heading, its number of rows and the rows. Vertices: x y z. Vertices' Normals:
 * x y z. Vertices' Colours (ours): r g b. Triangles: three indices. Sections come in any order, others are passed over. No grammar
 * of the format is public: docs/files.md says what is taken for granted, and why. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>

#include "arrays.h"
#include "formats.h"
#include "ply_rows.h"
#include "text.h"

enum kind { VERTICES, NORMALS, COLOURS, TRIANGLES, TABLES, OTHER = TABLES, UNKNOWN };

/* By their letters alone, small: "Vertices' Normals" is verticesnormals. */
static const struct {
    const char *letters;
    enum kind kind;
} NAMES[] = {{"vertices", VERTICES},        {"vertex", VERTICES},       {"verticesnormals", NORMALS}, {"vertexnormals", NORMALS},
             {"verticescolours", COLOURS},  {"vertexcolours", COLOURS}, {"verticescolors", COLOURS},  {"vertexcolors", COLOURS},
             {"trianglesnormals", OTHER},   {"trianglenormals", OTHER}, {"triangles", TRIANGLES},     {"tri", OTHER},
             {"trianglesneighbours", OTHER}};

enum { MOST_LETTERS = 20 }; /* of a name above, and one more */
#define NO_COUNT UINT64_MAX
#define NO_CORNER UINT32_MAX /* past PBR_MAX_POINTS */

struct heading {
    enum kind kind;
    uint64_t count; /* in the heading itself, or NO_COUNT */
};

struct job {
    struct reader *reader;
    const char *p, *end; /* what is left */
    size_t told;         /* progress */
    bool met[TABLES];
    bool passing;          /* the rows here belong to a section that is not read */
    uint64_t rows[TABLES]; /* whole ones that were read */
    uint64_t strays;       /* rows past their section's count */
    uint64_t unknown;      /* sections, or lines of text in them */
    struct excerpt first_unknown;
    struct arrays arrays;
    pbr_attribute tables[TRIANGLES]; /* rows of three */
    struct ply_faces faces;
    int base; /* of the indices: 0 or 1 */
};

/* ---- headings ---- */

static bool is_letter(char c) {
    return (c | 0x20) >= 'a' && (c | 0x20) <= 'z';
}

/* The letters of a line, small; the first MOST_LETTERS of them. */
static void take_letters(const char *p, const char *end, char out[MOST_LETTERS + 1]) {
    size_t count = 0;
    for (; p < end && count < MOST_LETTERS; p++) {
        if (is_letter(*p)) out[count++] = (char)(*p | 0x20);
    }
    out[count] = 0;
}

/* The whole number that ends a line, but for marks; or NO_COUNT. */
static uint64_t last_number(const char *p, const char *end) {
    uint64_t count;
    while (end > p && !is_digit(end[-1])) end--;
    const char *digits = end;
    while (digits > p && is_digit(digits[-1])) digits--;
    if (digits == end || (digits > p && (digits[-1] == '.' || digits[-1] == '-'))) return NO_COUNT;
    return number_parse_unsigned(digits, end, &count) == end ? count : NO_COUNT;
}

/* A heading is a line whose first letter or digit is a letter, and that does not begin with nan or inf. */
static bool is_heading(const char *p, const char *line_end, struct heading *out) {
    char letters[MOST_LETTERS + 1];
    double unused;
    const char *first = p;
    while (first < line_end && !is_digit(*first) && !is_letter(*first)) first++;
    if (first == line_end || is_digit(*first) || number_parse(p, line_end, &unused) == text_word_end(p, line_end)) return false;
    take_letters(first, line_end, letters);
    *out = (struct heading){UNKNOWN, last_number(first, line_end)};
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES; i++)
        if (strcmp(NAMES[i].letters, letters) == 0) out->kind = NAMES[i].kind;
    return true;
}

/* ---- lines ---- */

/* The next line that holds something, without moving past it. */
static bool find_line(struct job *job, const char **line_end) {
    while (job->p < job->end) {
        *line_end = text_end_of_line(job->reader, job->p, job->end);
        job->p = text_skip_blanks(job->p, *line_end);
        if (job->p < *line_end && !text_is_comment(job->p, *line_end)) return true;
        job->p = *line_end < job->end ? *line_end + 1 : job->end;
    }
    return false;
}

/* Lines of text, such as a title, may come before the first section's heading, numbers may not. */
bool tri_recognise(const struct reader *reader) {
    enum { MOST_LINES = 16 };
    struct reader copy = *reader;
    struct heading heading;
    const char *line_end;
    if (reader->size == 0) return false;
    copy.line_end = text_line_end(reader);
    struct job job = {.reader = &copy, .p = reader->data + text_begin(reader), .end = reader->data + reader->size};
    for (int i = 0; i < MOST_LINES && find_line(&job, &line_end) && is_heading(job.p, line_end, &heading); i++) {
        if (heading.kind != UNKNOWN) return true;
        job.p = line_end < job.end ? line_end + 1 : job.end;
    }
    return false;
}

static size_t place(const struct job *job, const char *p) {
    return (size_t)(p - job->reader->data);
}

static pbr_result pass_line(struct job *job, const char *line_end) {
    job->p = line_end < job->end ? line_end + 1 : job->end;
    if (place(job, job->p) - job->told < job->reader->size / 32 + 65536) return PBR_OK;
    return reader_progress(job->reader, job->told = place(job, job->p));
}

/* ---- rows ---- */

/* Makes room for no more rows than the bytes that are left can hold: a digit and a blank for each of three numbers. */
static pbr_result make_table(struct job *job, enum kind kind, uint64_t declared) {
    uint64_t most = (uint64_t)(job->end - job->p) / 6 + 1, rows = declared < most ? declared : most;
    size_t room = 0;
    if (kind == TRIANGLES) return ply_faces_reserve(job->reader, &job->faces, &room, rows);
    if (rows > PBR_MAX_POINTS && declared != NO_COUNT)
        return pbr_log(job->reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu vertices, the limit is %llu",
                       job->reader->name, (unsigned long long)rows, (unsigned long long)PBR_MAX_POINTS);
    return arrays_make(&job->arrays, rows, kind == VERTICES ? PBR_FORMAT_FLOAT64 : PBR_FORMAT_FLOAT32, 3, &job->tables[kind]);
}

/* An index as the file has it: `base` is known when all are there. */
static uint32_t corner(double index) {
    return index <= (double)PBR_MAX_POINTS ? (uint32_t)index : NO_CORNER;
}

static void store_row(struct job *job, enum kind kind, const double values[3]) {
    uint64_t row = job->rows[kind]++;
    double *numbers = kind == VERTICES ? (double *)(uintptr_t)job->tables[kind].data + 3 * row : NULL;
    float *floats = kind == NORMALS || kind == COLOURS ? (float *)(uintptr_t)job->tables[kind].data + 3 * row : NULL;
    for (int k = 0; k < 3; k++) {
        if (numbers) numbers[k] = values[k];
        else if (floats) floats[k] = (float)values[k];
        else job->faces.triangles[row][k] = corner(values[k]);
    }
}

static pbr_result not_fit(struct job *job, const char *p, const char *line_end) {
    return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, p), "'%s' is not a number that fits here",
                             reader_excerpt(p, text_word_end(p, line_end)).text);
}

static pbr_result check_row(struct job *job, enum kind kind, const char *at, const char *line_end, int columns,
                            const double values[3]) {
    if (columns < 0) return not_fit(job, at, line_end);
    if (columns != 3)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "a row of %d numbers, where 3 belong", columns);
    for (int k = 0; k < 3 && kind == TRIANGLES; k++)
        if (!(values[k] >= 0 && values[k] == floor(values[k])))
            return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "%g is not the index of a vertex",
                                     values[k]);
    return PBR_OK;
}

/* Reads rows up to the declared count, the next heading or the end of the data. A last line that the end may cut is left out. */
static pbr_result read_rows(struct job *job, enum kind kind, uint64_t declared) {
    const char *line_end;
    struct heading next;
    pbr_result result = PBR_OK;
    while (result == PBR_OK && job->rows[kind] < declared && find_line(job, &line_end) && !is_heading(job->p, line_end, &next)) {
        const char *at = job->p;
        double values[3];
        int columns = text_numbers(&at, line_end, values, 3);
        bool last = declared == NO_COUNT || job->rows[kind] + 1 == declared;
        if (line_end == job->end && (columns < 3 || !last)) {
            job->p = job->end;
            if (declared == NO_COUNT) reader_warn(job->reader, 1, "the data ends within a line, which is left out");
            break;
        }
        result = check_row(job, kind, at, line_end, columns, values);
        if (result != PBR_OK) break;
        store_row(job, kind, values);
        result = pass_line(job, line_end);
    }
    return result;
}

/* ---- sections ---- */

/* The count may stand in the heading, in a line of its own, or nowhere. */
static pbr_result take_count(struct job *job, uint64_t *count) {
    const char *line_end;
    double value;
    if (*count != NO_COUNT || !find_line(job, &line_end)) return PBR_OK;
    const char *at = job->p;
    if (text_numbers(&at, line_end, &value, 1) != 1) return PBR_OK;
    if (number_parse_unsigned(job->p, line_end, count) != text_word_end(job->p, line_end))
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "'%s' is not a count",
                                 reader_excerpt(job->p, text_word_end(job->p, line_end)).text);
    return pass_line(job, line_end);
}

static const char *kind_name(enum kind kind) {
    static const char *const KINDS[] = {"vertices", "normals", "colours", "triangles"};
    return KINDS[kind];
}

static pbr_result read_section(struct job *job, enum kind kind, uint64_t count) {
    pbr_result result = take_count(job, &count);
    if (result == PBR_OK) result = make_table(job, kind, count);
    if (result == PBR_OK) result = read_rows(job, kind, count);
    if (result != PBR_OK || count == NO_COUNT || job->rows[kind] == count) return result;
    if (job->p < job->end)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "the section ends after %llu of %llu %s",
                                 (unsigned long long)job->rows[kind], (unsigned long long)count, kind_name(kind));
    if (kind == VERTICES && job->rows[kind] == 0)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "the data ends before the first whole vertex");
    reader_warn(job->reader, 1, "the data ends after %llu of %llu %s", (unsigned long long)job->rows[kind],
                (unsigned long long)count, kind_name(kind));
    return PBR_OK;
}

static pbr_result read_heading(struct job *job, struct heading heading, const char *line_end) {
    const char *name = job->p;
    job->passing = heading.kind >= TABLES;
    if (heading.kind == UNKNOWN && job->unknown++ == 0) job->first_unknown = reader_excerpt(name, line_end);
    if (!job->passing && job->met[heading.kind])
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, name), "a second section of %s",
                                 kind_name(heading.kind));
    pbr_result result = pass_line(job, line_end);
    if (result != PBR_OK || job->passing) return result;
    job->met[heading.kind] = true;
    return read_section(job, heading.kind, heading.count);
}

static pbr_result read_sections(struct job *job) {
    const char *line_end;
    struct heading heading;
    pbr_result result = PBR_OK;
    while (result == PBR_OK && find_line(job, &line_end)) {
        if (is_heading(job->p, line_end, &heading)) {
            result = read_heading(job, heading, line_end);
        } else {
            job->strays += !job->passing;
            result = pass_line(job, line_end);
        }
    }
    if (result == PBR_OK && !job->met[VERTICES])
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->end), "the file has no section 'Vertices'");
    return result;
}

/* ---- what they mean ---- */

/* Indices count from 0 or from 1: whichever leaves out fewer corners, since a whole mesh uses its first and its last vertex. */
static void find_base(struct job *job) {
    uint64_t vertices = job->rows[VERTICES], firsts = 0, pasts = 0;
    for (uint64_t i = 0; i < job->rows[TRIANGLES]; i++)
        for (int k = 0; k < 3; k++) {
            firsts += job->faces.triangles[i][k] == 0;
            pasts += job->faces.triangles[i][k] == vertices;
        }
    job->base = pasts > firsts;
    if (firsts == 0 && pasts == 0 && job->rows[TRIANGLES] > 0)
        reader_warn(job->reader, 1, "no triangle has index 0 or %llu, so that indices may count from 0 or from 1; from 0 taken",
                    (unsigned long long)vertices);
}

static void resolve_triangles(struct job *job) {
    struct ply_target target = {.shape = SHAPE_POLYGON, .vertex_count = job->rows[VERTICES]};
    find_base(job);
    for (uint64_t i = 0; i < job->rows[TRIANGLES]; i++) {
        uint32_t corners[3]; /* written where they are read, or before */
        memcpy(corners, job->faces.triangles[i], sizeof corners);
        struct ply_corners list = ply_corners_begin(&target, &job->faces);
        for (int k = 0; k < 3; k++) ply_corner(&list, corners[k] == NO_CORNER ? PLY_NO_INDEX : (int64_t)corners[k] - job->base);
        ply_corners_end(&list);
    }
}

/* Normals and colours are there for every vertex, or left out. */
static bool fits(struct job *job, enum kind kind) {
    if (!job->met[kind] || job->rows[VERTICES] == 0) return false;
    if (job->rows[kind] == job->rows[VERTICES]) return true;
    reader_warn(job->reader, 1, "%s left out: %llu of them for %llu vertices", kind_name(kind), (unsigned long long)job->rows[kind],
                (unsigned long long)job->rows[VERTICES]);
    return false;
}

static pbr_result understand(struct job *job) {
    job->arrays.count = job->rows[VERTICES];
    job->arrays.positions = job->tables[VERTICES];
    if (job->strays)
        reader_warn(job->reader, job->strays, "%llu rows left out that are past their section's count",
                    (unsigned long long)job->strays);
    if (job->unknown)
        reader_warn(job->reader, job->unknown, "%llu headings or lines of text ignored, the first: '%s'",
                    (unsigned long long)job->unknown, job->first_unknown.text);
    if (job->arrays.count == 0) reader_warn(job->reader, 1, "the file has no vertices");
    resolve_triangles(job);
    if (fits(job, NORMALS)) job->arrays.normals = job->tables[NORMALS];
    if (!fits(job, COLOURS)) return PBR_OK;
    struct triple_range range = arrays_triple(&job->tables[COLOURS], job->arrays.count);
    if (range.low >= 0 && range.high <= 65535) return arrays_colours(&job->arrays, &job->tables[COLOURS], range);
    reader_warn(job->reader, 1, "colours left out that do not lie in 0..65535");
    return PBR_OK;
}

pbr_result tri_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    reader->line_end = text_line_end(reader);
    struct job job = {.reader = reader, .passing = true, .arrays = {.instance = reader->instance}};
    job.p = reader->data + text_begin(reader);
    job.end = reader->data + reader->size;
    pbr_result result = read_sections(&job);
    if (result == PBR_OK) result = understand(&job);
    if (result == PBR_OK) result = reader_progress(reader, reader->size);
    if (result != PBR_OK) goto cleanup;
    ply_faces_warn(reader, &job.faces);
    if (job.faces.count > 0) result = arrays_mesh(&job.arrays, job.faces.triangles, job.faces.count, desc, content);
    else result = arrays_points(&job.arrays, desc, content);
    if (result != PBR_OK) goto cleanup;
    content->format = PBR_FILE_TRI;
    content->vertex_count = job.arrays.count;
    content->face_count = job.faces.faces;
    if (job.faces.faces > 0) snprintf(content->encoding, sizeof content->encoding, "text, indices from %d", job.base);
    else snprintf(content->encoding, sizeof content->encoding, "text");
cleanup:
    pbr_free(reader->instance, job.faces.triangles);
    arrays_free(&job.arrays);
    return result;
}
