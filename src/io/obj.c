/* OBJ (Wavefront): vertices `v x y z [r g b]`, normals `vn`, texture coordinates `vt`, faces `f` whose corners are v, v/t, v//n or
 * v/t/n, in the material of the last `usemtl`, from a file `mtllib`. Indices count from 1, or back from the last vertex read. A
 * backslash joins a line to the next one.
 *
 * The file is read three times: what there is is counted, then vertices and normals are stored, then faces, which may refer to
 * vertices after them. Points and meshes have one normal a vertex: the mean of those that its corners name; and one colour: its
 * own, or where no vertex has one, the mean of the materials around it. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>

#include "arrays.h"
#include "formats.h"
#include "obj_materials.h"
#include "paint.h"
#include "ply_rows.h"
#include "text.h"

enum stage { STAGE_COUNT, STAGE_VERTICES, STAGE_FACES, STAGE_END };

struct job {
    struct reader *reader;
    const char *end; /* of what is read: less than the file when its last line is cut */
    enum stage stage;
    uint64_t vertices, normals; /* lines met in this stage */
    uint64_t textures;          /* likewise */
    uint64_t coloured, unknown; /* lines with colours; lines that are no statement */
    uint64_t libraries;         /* lines that name materials */
    struct arrays arrays;
    uint64_t normal_count, texture_count;
    double (*positions)[3];
    float (*normal_lines)[3], (*colour_lines)[3];
    double (*sums)[3];              /* of each vertex's corners' normals */
    uint64_t corners, bare_corners; /* with and without a normal that is there */
    pbr_attribute colour_table;
    struct materials materials;
    uint32_t paint; /* of the faces that come */
    float (*texture_lines)[2];
    struct patch *patches; /* of the triangles, if there are materials */
    struct ply_target target;
    struct ply_faces faces;
};

/* ---- statements ---- */

enum statement { VERTEX, NORMAL, TEXTURE, FACE, MATERIAL, LIBRARY, IGNORED, UNKNOWN };

static const struct {
    const char *word;
    enum statement statement;
} STATEMENTS[] = {{"v", VERTEX},           {"vn", NORMAL},         {"f", FACE},           {"vt", TEXTURE},
                  {"vp", IGNORED},         {"fo", FACE},           {"p", IGNORED},        {"l", IGNORED},
                  {"o", IGNORED},          {"g", IGNORED},         {"s", IGNORED},        {"mg", IGNORED},
                  {"usemtl", MATERIAL},    {"mtllib", LIBRARY},    {"usemap", IGNORED},   {"maplib", IGNORED},
                  {"lod", IGNORED},        {"bevel", IGNORED},     {"c_interp", IGNORED}, {"d_interp", IGNORED},
                  {"shadow_obj", IGNORED}, {"trace_obj", IGNORED}, {"cstype", IGNORED},   {"deg", IGNORED},
                  {"bmat", IGNORED},       {"step", IGNORED},      {"curv", IGNORED},     {"curv2", IGNORED},
                  {"surf", IGNORED},       {"parm", IGNORED},      {"trim", IGNORED},     {"hole", IGNORED},
                  {"scrv", IGNORED},       {"sp", IGNORED},        {"end", IGNORED},      {"con", IGNORED},
                  {"ctech", IGNORED},      {"stech", IGNORED},     {"call", IGNORED},     {"csh", IGNORED}};

/* The statement at `*p`, which is moved past its word. */
static enum statement take_statement(const char **p, const char *end) {
    const char *word = *p;
    while (*p < end && !is_space(**p) && **p != '\\') ++*p;
    size_t length = (size_t)(*p - word);
    for (size_t i = 0; i < sizeof STATEMENTS / sizeof *STATEMENTS; i++)
        if (length > 0 && STATEMENTS[i].word[0] == *word && strlen(STATEMENTS[i].word) == length &&
            memcmp(word, STATEMENTS[i].word, length) == 0)
            return STATEMENTS[i].statement;
    return UNKNOWN;
}

bool obj_recognise(const struct reader *reader) {
    if (reader->size == 0) return false;
    const char *p = reader->data + text_begin(reader), *end = reader->data + reader->size;
    char mark = text_line_end(reader);
    while (p < end) {
        p = text_skip_blanks(p, end);
        if (p < end && *p != '#') return take_statement(&p, end) != UNKNOWN;
        p = p < end ? memchr(p, mark, (size_t)(end - p)) : NULL;
        if (!p) return false;
    }
    return false;
}

/* ---- words ---- */

/* Past blanks, and line ends that a backslash takes away. */
static const char *skip_blanks(const struct job *job, const char *p, const char *end) {
    for (; p < end; p++) {
        if (is_space(*p)) continue;
        if (*p != '\\') break;
        const char *after = p + 1;
        while (after < end && *after == '\r' && job->reader->line_end != '\r') after++;
        if (after < end && *after != job->reader->line_end) break;
    }
    return p;
}

static const char *word_end(const char *p, const char *end) {
    while (p < end && !is_space(*p) && *p != '\\' && *p != '#') p++;
    return p;
}

/* The end of the statement at `p`: of its line, or of the last line that it goes on in. */
static const char *statement_end(const struct job *job, const char *p) {
    const char *from = p;
    for (;;) {
        const char *end = text_end_of_line(job->reader, from, job->end), *last = end;
        while (last > p && last[-1] == '\r') last--;
        if (end == job->end || last == p || last[-1] != '\\' || *p == '#') return end;
        from = end + 1;
    }
}

static size_t place(const struct job *job, const char *p) {
    return (size_t)(p - job->reader->data);
}

/* Reads the numbers of a statement. Returns how many, at most `most`, or -1 at what is no number, and then `*p` is there. */
static int read_numbers(const struct job *job, const char **p, const char *end, double *values, int most) {
    for (int count = 0;; count++) {
        *p = skip_blanks(job, *p, end);
        if (count == most || *p == end || **p == '#') return count;
        const char *after = number_parse(*p, end, &values[count]);
        if (!after || after != word_end(after, end)) return -1;
        *p = after;
    }
}

/* Reads an index at `*p`: 0 if there is none or it does not fit. */
static int64_t read_index(const char **p, const char *end) {
    const char *digits = *p + (*p < end && (**p == '-' || **p == '+'));
    uint64_t value;
    const char *after = number_parse_unsigned(digits, end, &value);
    if (!after) return 0;
    bool negative = **p == '-';
    *p = after;
    if (value > (uint64_t)INT64_MAX) return 0;
    return negative ? -(int64_t)value : (int64_t)value;
}

/* ---- vertices and normals ---- */

/* A row of three numbers at least. */
static pbr_result read_row(struct job *job, const char *p, const char *end, const char *what, double values[6], int *count) {
    const char *at = p;
    *count = read_numbers(job, &at, end, values, 6);
    if (*count < 0)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, at), "'%s' is not a number that fits here",
                                 reader_excerpt(at, word_end(at, end)).text);
    if (*count < 3) return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, p), "a %s of %d numbers", what, *count);
    return PBR_OK;
}

static pbr_result take_vertex(struct job *job, const char *p, const char *end) {
    double values[6];
    int count;
    uint64_t row = job->vertices++;
    if (job->stage == STAGE_FACES) return PBR_OK;
    pbr_result result = read_row(job, p, end, "vertex", values, &count);
    if (result != PBR_OK) return result;
    if (job->stage == STAGE_COUNT) job->coloured += count == 6;
    else memcpy(job->positions[row], values, sizeof *job->positions);
    for (int k = 0; k < 3 && job->colour_lines; k++) job->colour_lines[row][k] = count == 6 ? (float)values[3 + k] : NAN;
    return PBR_OK;
}

static pbr_result take_normal(struct job *job, const char *p, const char *end) {
    double values[6];
    int count;
    uint64_t row = job->normals++;
    if (job->stage == STAGE_FACES) return PBR_OK;
    pbr_result result = read_row(job, p, end, "normal", values, &count);
    for (int k = 0; k < 3 && job->normal_lines && result == PBR_OK; k++) job->normal_lines[row][k] = (float)values[k];
    return result;
}

/* ---- materials ---- */

/* Texture coordinates that cannot be read are none. */
static void take_texture(struct job *job, const char *p, const char *end) {
    double values[2] = {NAN, 0};
    uint64_t row = job->textures++;
    if (job->stage != STAGE_VERTICES || !job->texture_lines) return;
    int count = read_numbers(job, &p, end, values, 2);
    for (int k = 0; k < 2; k++) job->texture_lines[row][k] = count < 1 ? NAN : (float)values[k];
}

/* The name that a statement gives: the rest of its line, blanks in it included. */
static struct ply_word rest_of(const struct job *job, const char *p, const char *end) {
    p = skip_blanks(job, p, end);
    while (end > p && is_space(end[-1])) end--;
    return (struct ply_word){p, (size_t)(end - p)};
}

static pbr_result take_library(struct job *job, const char *p, const char *end) {
    job->libraries += job->stage == STAGE_COUNT;
    if (job->stage != STAGE_VERTICES || !job->patches) return PBR_OK;
    return materials_add_library(&job->materials, rest_of(job, p, end));
}

static void take_material(struct job *job, const char *p, const char *end) {
    if (job->stage == STAGE_FACES && job->patches) job->paint = materials_find(&job->materials, rest_of(job, p, end));
}

/* Of the triangle that came last, by the texture coordinates of its corners. */
static void set_patch(struct job *job, const int64_t textures[3]) {
    struct patch *patch = &job->patches[job->faces.count - 1];
    patch->paint = job->paint;
    for (int i = 0; i < 3; i++) {
        bool there = job->texture_lines && textures[i] >= 0 && (uint64_t)textures[i] < job->texture_count;
        for (int k = 0; k < 2; k++) patch->at[i][k] = there ? job->texture_lines[textures[i]][k] : NAN;
    }
}

/* ---- faces ---- */

/* An index from 1, or back from what was read so far, as one from 0. */
static int64_t resolve(int64_t index, uint64_t so_far) {
    if (index > 0) return index - 1;
    if (index == 0 || (uint64_t)-index > so_far) return PLY_NO_INDEX;
    return (int64_t)so_far + index;
}

static void add_normal(struct job *job, int64_t vertex, int64_t normal) {
    if (normal < 0 || (uint64_t)normal >= job->normal_count) {
        job->bare_corners++;
        return;
    }
    job->corners++;
    if (!job->sums || vertex < 0 || (uint64_t)vertex >= job->arrays.count) return;
    double n[3], length = 0;
    for (int k = 0; k < 3; k++) n[k] = job->normal_lines[normal][k];
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3 && length > 0 && isfinite(length); k++) job->sums[vertex][k] += n[k] / length;
}

enum { CORNER_VERTEX, CORNER_TEXTURE, CORNER_NORMAL, CORNER_PARTS };

/* Reads a corner at `*p`, with 0 for what it lacks. False, with `*p` unmoved, if it is none. */
static bool read_corner(const char **p, const char *end, int64_t corner[CORNER_PARTS]) {
    const char *at = *p;
    corner[CORNER_TEXTURE] = corner[CORNER_NORMAL] = 0;
    corner[CORNER_VERTEX] = read_index(&at, end);
    if (at == *p) return false;
    for (int part = CORNER_TEXTURE; part < CORNER_PARTS && at < end && *at == '/'; part++) {
        at++;
        corner[part] = read_index(&at, end);
    }
    if (at != word_end(at, end)) return false;
    *p = at;
    return true;
}

static pbr_result take_face(struct job *job, const char *p, const char *end) {
    int64_t corner[CORNER_PARTS], textures[3] = {0}; /* of the first corner, the last and this */
    if (job->stage == STAGE_VERTICES) return PBR_OK;
    struct ply_corners list = ply_corners_begin(&job->target, &job->faces);
    for (p = skip_blanks(job, p, end); p < end && *p != '#'; p = skip_blanks(job, p, end)) {
        if (!read_corner(&p, end, corner)) {
            ply_corners_cancel(&list);
            return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, p), "'%s' is not a corner of a face",
                                     reader_excerpt(p, word_end(p, end)).text);
        }
        int64_t vertex = resolve(corner[CORNER_VERTEX], job->vertices);
        size_t before = job->faces.count;
        textures[2] = resolve(corner[CORNER_TEXTURE], job->textures);
        if (list.count == 0) textures[0] = textures[2];
        /* What is counted need not be there yet. */
        ply_corner(&list, job->stage == STAGE_COUNT ? 0 : vertex);
        if (job->stage == STAGE_FACES) add_normal(job, vertex, resolve(corner[CORNER_NORMAL], job->normals));
        if (job->patches && job->faces.count > before) set_patch(job, textures);
        textures[1] = textures[2];
    }
    ply_corners_end(&list);
    return PBR_OK;
}

/* ---- the file, once ---- */

static pbr_result take_line(struct job *job, const char *p, const char *end) {
    if (p == end || *p == '#') return PBR_OK;
    switch (take_statement(&p, end)) {
    case VERTEX: return take_vertex(job, p, end);
    case NORMAL: return take_normal(job, p, end);
    case FACE: return take_face(job, p, end);
    case LIBRARY: return take_library(job, p, end);
    case TEXTURE: take_texture(job, p, end); return PBR_OK;
    case MATERIAL: take_material(job, p, end); return PBR_OK;
    case IGNORED: return PBR_OK;
    case UNKNOWN: job->unknown += job->stage == STAGE_COUNT; return PBR_OK;
    }
    return PBR_OK;
}

/* A last line without a line end may be cut: if a word is missing or unreadable there, it is left out. */
static bool is_cut(const struct job *job, const char *p, const char *end) {
    double values[3];
    int64_t corner[CORNER_PARTS];
    if (end < job->reader->data + job->reader->size) return false;
    switch (take_statement(&p, end)) {
    case VERTEX:
    case NORMAL: return read_numbers(job, &p, end, values, 3) < 3;
    case FACE:
        p = skip_blanks(job, p, end);
        while (p < end && read_corner(&p, end, corner)) p = skip_blanks(job, p, end);
        return p < end && *p != '#';
    default: return false;
    }
    return false;
}

static pbr_result walk(struct job *job, enum stage stage) {
    struct reader *reader = job->reader;
    const char *p = reader->data + text_begin(reader);
    size_t step = reader->size / 16 + 65536, told = 0;
    job->stage = stage;
    job->vertices = job->normals = job->textures = 0;
    while (p < job->end) {
        p = text_skip_blanks(p, text_end_of_line(reader, p, job->end));
        const char *end = statement_end(job, p);
        if (stage == STAGE_COUNT && is_cut(job, p, end)) {
            reader_warn(reader, 1, "the data ends within a line, which is left out");
            job->end = p;
            break;
        }
        pbr_result result = take_line(job, p, end);
        if (result != PBR_OK) return result;
        p = end < job->end ? end + 1 : end;
        size_t at = place(job, p);
        if (at - told < step) continue;
        told = at;
        result = reader_progress(reader, reader->size / STAGE_END * stage + at / STAGE_END);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* ---- what it makes ---- */

/* For colours from materials, where vertices have none and materials can be found. */
static pbr_result make_patches(struct job *job, uint64_t triangles) {
    pbr_attribute lines;
    if (job->coloured > 0 || job->libraries == 0 || triangles == 0 || !job->reader->path) return PBR_OK;
    job->patches = pbr_allocate(job->reader->instance, triangles, sizeof *job->patches);
    if (!job->patches) return PBR_ERROR_OUT_OF_MEMORY;
    if (job->textures == 0) return PBR_OK;
    job->texture_count = job->textures;
    pbr_result result = arrays_make(&job->arrays, job->textures, PBR_FORMAT_FLOAT32, 2, &lines);
    if (result == PBR_OK) job->texture_lines = (float(*)[2])(uintptr_t)lines.data;
    return result;
}

static pbr_result make_room(struct job *job) {
    struct arrays *arrays = &job->arrays;
    pbr_attribute normals, sums;
    size_t room = 0;
    uint64_t triangles = job->faces.count;
    if (job->vertices == 0)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, place(job, job->end), "the file has no vertices");
    if (job->vertices > PBR_MAX_POINTS)
        return pbr_log(job->reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu vertices, the limit is %llu",
                       job->reader->name, (unsigned long long)job->vertices, (unsigned long long)PBR_MAX_POINTS);
    arrays->count = job->target.vertex_count = job->vertices;
    job->normal_count = job->normals;
    job->faces = (struct ply_faces){0};
    pbr_result result = ply_faces_reserve(job->reader, &job->faces, &room, triangles);
    if (result == PBR_OK) result = arrays_make(arrays, arrays->count, PBR_FORMAT_FLOAT64, 3, &arrays->positions);
    if (result == PBR_OK && job->coloured > 0) {
        result = arrays_make(arrays, arrays->count, PBR_FORMAT_FLOAT32, 3, &job->colour_table);
        job->colour_lines = (float(*)[3])(uintptr_t)job->colour_table.data;
    }
    if (result == PBR_OK && job->normals > 0) {
        result = arrays_make(arrays, job->normals, PBR_FORMAT_FLOAT32, 3, &normals);
        if (result == PBR_OK) job->normal_lines = (float(*)[3])(uintptr_t)normals.data;
        if (result == PBR_OK && job->normals == arrays->count) arrays->normals = normals;
    }
    if (result == PBR_OK && job->normals > 0 && triangles > 0) {
        result = arrays_make(arrays, arrays->count, PBR_FORMAT_FLOAT64, 3, &sums);
        if (result == PBR_OK) job->sums = (double(*)[3])(uintptr_t)sums.data;
    }
    job->positions = (double(*)[3])(uintptr_t)arrays->positions.data;
    return result == PBR_OK ? make_patches(job, triangles) : result;
}

/* A mesh's normals are those that its corners name, if all do; points' are the lines `vn`, if there is one for each `v`. */
static void understand_normals(struct job *job) {
    if (job->faces.count == 0) {
        if (job->normal_count > 0 && !job->arrays.normals.data)
            reader_warn(job->reader, 1, "normals left out: %llu of them for %llu vertices", (unsigned long long)job->normal_count,
                        (unsigned long long)job->arrays.count);
        return;
    }
    job->arrays.normals = (pbr_attribute){0};
    if (job->corners > 0 && job->bare_corners > 0)
        reader_warn(job->reader, 1, "normals left out: %llu of %llu corners have none", (unsigned long long)job->bare_corners,
                    (unsigned long long)(job->bare_corners + job->corners));
    else if (job->corners > 0 && job->sums)
        job->arrays.normals = (pbr_attribute){.data = job->sums, .format = PBR_FORMAT_FLOAT64, .components = 3};
}

/* Vertices without a colour, where others have one, are white. */
static pbr_result understand_colours(struct job *job) {
    if (!job->colour_lines) return PBR_OK;
    struct triple_range range = arrays_triple(&job->colour_table, job->arrays.count);
    if (!(range.low >= 0 && range.high <= 65535)) {
        reader_warn(job->reader, 1, "colours left out that do not lie in 0..65535");
        return PBR_OK;
    }
    if (job->coloured < job->arrays.count)
        reader_warn(job->reader, 1, "%llu of %llu vertices have no colour: white",
                    (unsigned long long)(job->arrays.count - job->coloured), (unsigned long long)job->arrays.count);
    float white = range.high <= 1 ? 1 : range.high <= 255 ? 255 : 65535;
    for (uint64_t i = 0; i < job->arrays.count; i++)
        for (int k = 0; k < 3; k++)
            if (isnan(job->colour_lines[i][k])) job->colour_lines[i][k] = white;
    return arrays_colours(&job->arrays, &job->colour_table, range);
}

pbr_result obj_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    reader->line_end = text_line_end(reader);
    struct job job = {.reader = reader, .arrays = {.instance = reader->instance}, .paint = PAINT_NONE};
    job.end = reader->data + reader->size;
    job.materials.reader = reader;
    job.target = (struct ply_target){.shape = SHAPE_POLYGON, .vertex_count = PBR_MAX_POINTS};
    pbr_result result = walk(&job, STAGE_COUNT);
    if (result == PBR_OK) result = make_room(&job);
    if (result == PBR_OK) result = walk(&job, STAGE_VERTICES);
    if (result == PBR_OK) result = walk(&job, STAGE_FACES);
    if (result == PBR_OK) result = understand_colours(&job);
    if (result == PBR_OK && job.patches)
        result = paint_vertices(reader, &job.arrays, (const uint32_t(*)[3])job.faces.triangles, job.patches, job.faces.count,
                                job.materials.paints, job.materials.paint_count);
    if (result == PBR_OK) result = reader_progress(reader, reader->size);
    if (result != PBR_OK) goto cleanup;
    understand_normals(&job);
    ply_faces_warn(reader, &job.faces);
    if (job.unknown > 0)
        reader_warn(reader, job.unknown, "%llu lines ignored that are no OBJ statement", (unsigned long long)job.unknown);
    if (job.faces.count > 0) result = arrays_mesh(&job.arrays, job.faces.triangles, job.faces.count, desc, content);
    else result = arrays_points(&job.arrays, desc, content);
    if (result != PBR_OK) goto cleanup;
    content->format = PBR_FILE_OBJ;
    content->vertex_count = job.arrays.count;
    content->face_count = job.faces.faces;
    snprintf(content->encoding, sizeof content->encoding, "text");
cleanup:
    pbr_free(reader->instance, job.faces.triangles);
    pbr_free(reader->instance, job.patches);
    materials_free(&job.materials);
    arrays_free(&job.arrays);
    return result;
}
