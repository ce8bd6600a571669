/* OFF: [ST][C][N]OFF, the counts of vertices, faces and (not used) edges, then a vertex a line, x y z, normal, colour, texture, and
 * a face a line, its number of corners, their indices, and a colour (not used). SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>

#include "arrays.h"
#include "formats.h"
#include "ply_rows.h"
#include "text.h"

enum { MOST_EXTRAS = 16 };

struct keyword {
    const char *end; /* NULL: there is none */
    bool texture, colours, normals, homogeneous;
};

struct job {
    struct reader *reader;
    struct keyword keyword;
    const char *p, *end;      /* what is left */
    uint64_t vertices, faces; /* declared */
    struct arrays arrays;
    int columns;         /* of each vertex */
    pbr_attribute table; /* those after x, y, z */
    struct ply_faces made;
    bool cut;
};

static bool take(const char **p, const char *end, const char *word) {
    size_t length = strlen(word);
    if ((size_t)(end - *p) < length || memcmp(*p, word, length) != 0) return false;
    *p += length;
    return true;
}

/* The keyword at the file's first word. A number may touch it. */
static struct keyword find_keyword(const struct reader *reader) {
    struct keyword keyword = {0};
    const char *end = reader->data + reader->size, *p = text_skip_blanks(reader->data + text_begin(reader), end);
    keyword.texture = take(&p, end, "ST");
    keyword.colours = take(&p, end, "C");
    keyword.normals = take(&p, end, "N");
    keyword.colours |= take(&p, end, "C");
    keyword.homogeneous = take(&p, end, "4");
    keyword.homogeneous |= take(&p, end, "n");
    if (take(&p, end, "OFF") && (p == end || is_space(*p) || is_digit(*p) || *p == '#')) keyword.end = p;
    return keyword;
}

bool off_recognise(const struct reader *reader) {
    return reader->size > 0 && find_keyword(reader).end != NULL;
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

static size_t place(const struct job *job, const char *p) {
    return (size_t)(p - job->reader->data);
}

static pbr_result not_a_number(struct job *job, const char *p, const char *line_end) {
    return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, p), "'%s' is not a number that fits here",
                             reader_excerpt(p, text_word_end(p, line_end)).text);
}

static bool is_whole_number(double value) {
    return value >= 0 && value <= 9007199254740992.0 && value == floor(value);
}

static pbr_result read_counts(struct job *job) {
    static const char REASON[] = "the counts of vertices and faces are missing";
    const char *line_end, *at;
    double counts[3];
    if (job->keyword.homogeneous)
        return reader_error_line(job->reader, PBR_ERROR_UNSUPPORTED, place(job, job->p), "4OFF and nOFF are not supported");
    if (!find_line(job, &line_end)) return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "%s", REASON);
    at = job->p;
    if (take(&at, line_end, "BINARY"))
        return reader_error_line(job->reader, PBR_ERROR_UNSUPPORTED, place(job, job->p),
                                 "binary OFF is not supported; convert it to text, for instance with MeshLab");
    int count = text_numbers(&at, line_end, counts, 3);
    if (count < 2 || !is_whole_number(counts[0]) || !is_whole_number(counts[1]))
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "%s", REASON);
    job->vertices = (uint64_t)counts[0];
    job->faces = (uint64_t)counts[1];
    job->p = line_end < job->end ? line_end + 1 : job->end;
    return PBR_OK;
}

/* ---- vertices ---- */

/* Makes room for no more vertices than the bytes that are left can hold: a digit and a blank for each column. */
static pbr_result make_vertices(struct job *job, const char *line_end, uint64_t *rows) {
    const char *at = job->p;
    double unused;
    job->columns = text_numbers(&at, line_end, &unused, 1);
    if (job->columns < 0) return not_a_number(job, at, line_end);
    if (job->columns < (job->keyword.normals ? 6 : 3))
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "a vertex of %d numbers", job->columns);
    uint64_t most = (uint64_t)(job->end - job->p) / (2 * (uint64_t)job->columns) + 1;
    *rows = job->vertices < most ? job->vertices : most;
    if (*rows > PBR_MAX_POINTS)
        return pbr_log(job->reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu vertices, the limit is %llu",
                       job->reader->name, (unsigned long long)*rows, (unsigned long long)PBR_MAX_POINTS);
    int extras = job->columns - 3 < MOST_EXTRAS ? job->columns - 3 : MOST_EXTRAS;
    pbr_result result = arrays_make(&job->arrays, *rows, PBR_FORMAT_FLOAT64, 3, &job->arrays.positions);
    if (result == PBR_OK && extras > 0)
        result = arrays_make(&job->arrays, *rows, PBR_FORMAT_FLOAT32, (uint32_t)extras, &job->table);
    return result;
}

static void store_vertex(struct job *job, uint64_t row, const double *values) {
    double *position = (double *)(uintptr_t)job->arrays.positions.data + 3 * row;
    float *extra = (float *)(uintptr_t)job->table.data;
    for (int k = 0; k < 3; k++) position[k] = values[k];
    for (uint32_t k = 0; k < job->table.components; k++) extra[job->table.components * row + k] = (float)values[3 + k];
}

static pbr_result read_vertices(struct job *job) {
    uint64_t rows = 0;
    const char *line_end;
    size_t step = job->reader->size / 32 + 65536, told = 0;
    if (job->vertices == 0) return PBR_OK;
    bool any = find_line(job, &line_end);
    pbr_result result = any ? make_vertices(job, line_end, &rows) : PBR_OK;
    while (result == PBR_OK && job->arrays.count < rows && find_line(job, &line_end)) {
        double values[3 + MOST_EXTRAS];
        const char *at = job->p;
        int columns = text_numbers(&at, line_end, values, 3 + MOST_EXTRAS);
        if (line_end == job->end && (job->arrays.count + 1 < job->vertices || job->faces > 0)) break; /* may be cut */
        if (columns < 0) return not_a_number(job, at, line_end);
        if (columns != job->columns)
            return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p),
                                     "a vertex of %d numbers, where the first one has %d", columns, job->columns);
        store_vertex(job, job->arrays.count++, values);
        job->p = line_end < job->end ? line_end + 1 : job->end;
        if (place(job, job->p) - told >= step) result = reader_progress(job->reader, told = place(job, job->p));
    }
    if (result != PBR_OK || job->arrays.count == job->vertices) return result;
    job->cut = true;
    if (job->arrays.count == 0)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p), "the data ends before the first whole vertex");
    reader_warn(job->reader, 1, "the data ends after %llu of %llu vertices", (unsigned long long)job->arrays.count,
                (unsigned long long)job->vertices);
    return PBR_OK;
}

/* What follows x, y, z: a normal if the keyword says so, then a colour of 3 or 4 numbers, whether it says so or not. */
static pbr_result understand(struct job *job) {
    int used = 3 + (job->keyword.normals ? 3 : 0), left = job->columns - used - (job->keyword.texture ? 2 : 0);
    if (job->arrays.count == 0) return PBR_OK;
    if (job->keyword.normals) job->arrays.normals = arrays_columns(&job->table, 0, 3);
    if (left != 3 && left != 4) {
        if (left != 0 || job->keyword.colours)
            reader_warn(job->reader, 1, "%d numbers of each vertex left out", job->columns - used);
        return PBR_OK;
    }
    pbr_attribute triple = arrays_columns(&job->table, (uint32_t)used - 3, 3);
    struct triple_range range = arrays_triple(&triple, job->arrays.count);
    if (range.low >= 0 && range.high <= 65535) return arrays_colours(&job->arrays, &triple, range);
    reader_warn(job->reader, 1, "colours left out that do not lie in 0..65535");
    return PBR_OK;
}

/* ---- faces ---- */

/* Reads the face at job->p; `*p` is moved to what was not understood. */
static bool read_face(const struct ply_target *target, const char **p, const char *line_end, struct ply_faces *faces) {
    uint64_t count, index;
    const char *after = number_parse_unsigned(*p, line_end, &count);
    if (!after || after != text_word_end(after, line_end)) return false;
    *p = after;
    struct ply_corners list = ply_corners_begin(target, faces);
    for (uint64_t i = 0; i < count; i++) {
        *p = text_skip_blanks(*p, line_end);
        after = number_parse_unsigned(*p, line_end, &index);
        if (!after || after != text_word_end(after, line_end)) {
            ply_corners_cancel(&list);
            return false;
        }
        ply_corner(&list, index <= INT64_MAX ? (int64_t)index : PLY_NO_INDEX);
        *p = after;
    }
    ply_corners_end(&list);
    return true;
}

/* Reads the faces, or counts their triangles. A line that is cut by the end of the file is left out. */
static pbr_result read_faces(struct job *job, const struct ply_target *target, struct ply_faces *faces) {
    const char *line_end;
    size_t step = job->reader->size / 32 + 65536, told = place(job, job->p);
    while (faces->faces < job->faces && find_line(job, &line_end)) {
        const char *at = job->p;
        bool last = faces->faces + 1 == job->faces;
        struct ply_faces before = *faces;
        bool whole = read_face(target, &at, line_end, faces);
        if (line_end == job->end && (!whole || !last)) {
            before.most = faces->most;
            *faces = before;
            break;
        }
        if (!whole && at == line_end)
            return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->p),
                                     "a face that has fewer corners than it says");
        if (!whole) return not_a_number(job, at, line_end);
        job->p = line_end < job->end ? line_end + 1 : job->end;
        if (place(job, job->p) - told >= step) {
            pbr_result result = reader_progress(job->reader, told = place(job, job->p));
            if (result != PBR_OK) return result;
        }
    }
    return PBR_OK;
}

/* Twice: the triangles are counted before they are allocated. */
static pbr_result make_faces(struct job *job) {
    struct ply_target target = {.shape = SHAPE_POLYGON, .vertex_count = job->arrays.count};
    struct ply_faces counted = {0};
    const char *begin = job->p, *line_end;
    size_t room = 0;
    if (job->cut) return PBR_OK;
    pbr_result result = read_faces(job, &target, &counted);
    if (result == PBR_OK) result = ply_faces_reserve(job->reader, &job->made, &room, counted.most);
    job->p = begin;
    if (result == PBR_OK) result = read_faces(job, &target, &job->made);
    if (result != PBR_OK) return result;
    if (job->made.faces < job->faces)
        reader_warn(job->reader, 1, "the data ends after %llu of %llu faces", (unsigned long long)job->made.faces,
                    (unsigned long long)job->faces);
    else if (find_line(job, &line_end))
        reader_warn(job->reader, 1, "%zu bytes after the last face ignored", (size_t)(job->end - job->p));
    return PBR_OK;
}

pbr_result off_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    reader->line_end = text_line_end(reader);
    struct job job = {.reader = reader, .keyword = find_keyword(reader), .arrays = {.instance = reader->instance}};
    job.p = job.keyword.end;
    job.end = reader->data + reader->size;
    pbr_result result = read_counts(&job);
    if (result == PBR_OK) result = read_vertices(&job);
    if (result == PBR_OK) result = understand(&job);
    if (result == PBR_OK) result = make_faces(&job);
    if (result == PBR_OK) result = reader_progress(reader, reader->size);
    if (result != PBR_OK) goto cleanup;
    ply_faces_warn(reader, &job.made);
    if (job.vertices == 0) reader_warn(reader, 1, "the file has no vertices");
    if (job.made.count > 0) result = arrays_mesh(&job.arrays, job.made.triangles, job.made.count, desc, content);
    else result = arrays_points(&job.arrays, desc, content);
    if (result != PBR_OK) goto cleanup;
    content->format = PBR_FILE_OFF;
    content->vertex_count = job.arrays.count;
    content->face_count = job.made.faces;
    snprintf(content->encoding, sizeof content->encoding, "text");
cleanup:
    pbr_free(reader->instance, job.made.triangles);
    arrays_free(&job.arrays);
    return result;
}
