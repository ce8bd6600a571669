/* Points as lines of numbers: .xyz, .asc, .txt, .csv, and the .pts of laser scanners, whose scans each begin with a line that
 * counts them.
 *
 * The first row says how many columns there are. Lines are counted in pieces of the file, which gives each piece its first row, and
 * the pieces are read in parallel; what the columns mean is decided when all are there. SPDX-License-Identifier: MIT */
#include <stdio.h>

#include "arrays.h"
#include "formats.h"
#include "text.h"

enum { PIECE_BYTES = 1 << 18, MOST_COLUMNS = 3 + PBR_MAX_SCALARS };

/* How the text begins. */
struct head {
    size_t first;        /* first line of the points, or of their count */
    int columns;         /* 0: this is no text of points */
    bool has_names;      /* a line of names was passed over */
    bool has_count;      /* a PTS file */
    bool has_two_counts; /* columns and rows of a PTX file */
};

struct piece {
    const char *begin, *end;
    uint64_t first_row, rows;
    uint64_t promised;   /* sum of the count lines */
    const char *bad;     /* what could not be read, or NULL: then `rows` are those before it */
    const char *bad_end; /* of its line */
    int bad_columns;     /* -1: `bad` is no number; else a row of so many */
};

struct job {
    struct reader *reader;
    struct head head;
    struct piece *pieces;
    size_t piece_count;
    uint64_t promised;
    struct arrays arrays;
    int extras; /* columns after x, y, z */
    double (*positions)[3];
    float *extra;        /* `extras` of them a row */
    pbr_attribute table; /* the same */
    char names[PBR_MAX_SCALARS][24];
};

/* ---- recognition ---- */

/* The next line that holds something: [*p, *end of line). False at the end of the text. */
static bool next_line(const char **p, const char **line_end, const char *end, char mark) {
    for (; *p < end; *p = *line_end + 1) {
        const char *found = memchr(*p, mark, (size_t)(end - *p));
        *line_end = found ? found : end;
        *p = text_skip_blanks(*p, *line_end);
        if (*p < *line_end && !text_is_comment(*p, *line_end)) return true;
        if (*line_end == end) break;
    }
    *p = end;
    return false;
}

static int count_numbers(const char *p, const char *end) {
    double value;
    return text_numbers(&p, end, &value, 1);
}

static bool is_count(const char *p, const char *end, uint64_t *out) {
    const char *after = number_parse_unsigned(p, end, out);
    return after && text_skip_blanks(after, end) == end;
}

/* Words of a line of column names; 0 if it cannot be one: names begin with a letter and hold printable characters. */
static int count_names(const char *p, const char *end) {
    int count = 0;
    while (p < end) {
        char first = (char)(*p | 0x20);
        if ((first < 'a' || first > 'z') && *p != '"') return 0;
        const char *after = text_word_end(p, end);
        for (; p < after; p++)
            if ((unsigned char)*p < ' ' || *p == 127) return 0;
        count++;
        p = text_skip_blanks(p, end);
        if (p < end && (*p == ',' || *p == ';')) p = text_skip_blanks(p + 1, end);
    }
    return count;
}

static struct head look(const struct reader *reader) {
    struct head head = {0};
    const char *end = reader->data + reader->size, *p = reader->data + text_begin(reader), *line_end = p;
    char mark = text_line_end(reader);
    uint64_t count;
    if (reader->size == 0 || !next_line(&p, &line_end, end, mark)) return head;
    head.first = (size_t)(p - reader->data);
    int columns = count_numbers(p, line_end), names = columns < 0 ? count_names(p, line_end) : 0;
    if (columns >= 3) head.columns = columns;
    if (columns >= 3 || (names < 3 && !is_count(p, line_end, &count))) return head;

    p = line_end < end ? line_end + 1 : end;
    if (!next_line(&p, &line_end, end, mark)) return head;
    columns = count_numbers(p, line_end);
    if (names == 0 && columns == 1) head.has_two_counts = is_count(p, line_end, &count);
    if (columns < 3 || (names > 0 && names != columns)) return head;
    head.columns = columns;
    head.has_names = names > 0;
    head.has_count = names == 0;
    if (head.has_names) head.first = (size_t)(p - reader->data);
    return head;
}

bool points_text_recognise(const struct reader *reader) {
    struct head head = look(reader);
    return head.columns > 0 || head.has_two_counts;
}

/* ---- lines in pieces ---- */

/* A count line breaks off the rows, unless the file ends in it: then it may be a row that is cut. */
static bool is_count_line(const struct job *job, const char *p, const char *end, uint64_t *count) {
    return is_count(p, end, count) && end < job->reader->data + job->reader->size;
}

/* A row takes a digit and a mark for each column: shorter lines are none, and ask for no room. Reading them finds that out. */
static bool may_be_row(const struct job *job, const char *p, const char *end) {
    return end - p >= 2 * (ptrdiff_t)job->head.columns - 1;
}

static void count_piece(const struct job *job, struct piece *piece) {
    for (const char *p = piece->begin; p < piece->end;) {
        const char *end = text_end_of_line(job->reader, p, piece->end), *text = text_skip_blanks(p, end);
        uint64_t count;
        if (text < end && !text_is_comment(text, end)) {
            if (!is_count_line(job, text, end, &count)) piece->rows += may_be_row(job, text, end);
            else if (__builtin_add_overflow(piece->promised, count, &piece->promised)) piece->promised = UINT64_MAX;
        }
        p = end < piece->end ? end + 1 : end;
    }
}

static pbr_result count_pieces(void *user, size_t begin, size_t end) {
    const struct job *job = user;
    for (size_t i = begin; i < end; i++) count_piece(job, &job->pieces[i]);
    return PBR_OK;
}

static void store_row(const struct job *job, uint64_t row, const double *values) {
    for (int k = 0; k < 3; k++) job->positions[row][k] = values[k];
    for (int k = 0; k < job->extras; k++) job->extra[row * (size_t)job->extras + (size_t)k] = (float)values[3 + k];
}

static void read_piece(const struct job *job, struct piece *piece) {
    uint64_t row = piece->first_row, count;
    for (const char *p = piece->begin; p < piece->end;) {
        const char *end = text_end_of_line(job->reader, p, piece->end), *text = text_skip_blanks(p, end);
        p = end < piece->end ? end + 1 : end;
        if (text == end || text_is_comment(text, end) || is_count_line(job, text, end, &count)) continue;
        double values[MOST_COLUMNS];
        const char *at = text;
        int columns = text_numbers(&at, end, values, MOST_COLUMNS);
        if (columns != job->head.columns) {
            piece->bad = columns < 0 ? at : text;
            piece->bad_end = end;
            piece->bad_columns = columns;
            piece->rows = row - piece->first_row;
            return;
        }
        store_row(job, row++, values);
    }
}

static pbr_result read_pieces(void *user, size_t begin, size_t end) {
    const struct job *job = user;
    for (size_t i = begin; i < end; i++) read_piece(job, &job->pieces[i]);
    return PBR_OK;
}

static pbr_result cut_pieces(struct job *job) {
    struct reader *reader = job->reader;
    const char *p = reader->data + job->head.first, *end = reader->data + reader->size;
    job->pieces = pbr_allocate(reader->instance, (size_t)(end - p) / PIECE_BYTES + 1, sizeof *job->pieces);
    if (!job->pieces) return PBR_ERROR_OUT_OF_MEMORY;
    while (p < end) {
        const char *to = end - p > PIECE_BYTES ? text_end_of_line(reader, p + PIECE_BYTES, end) : end;
        if (to < end) to++;
        job->pieces[job->piece_count++] = (struct piece){.begin = p, .end = to};
        p = to;
    }
    return PBR_OK;
}

/* ---- the rows ---- */

static pbr_result count_rows(struct job *job) {
    struct reader *reader = job->reader;
    pbr_result result = cut_pieces(job);
    if (result == PBR_OK) result = pbr_parallel(reader->instance, job->piece_count, 1, count_pieces, job);
    for (size_t i = 0; i < job->piece_count; i++) {
        job->pieces[i].first_row = job->arrays.count;
        job->arrays.count += job->pieces[i].rows;
        if (__builtin_add_overflow(job->promised, job->pieces[i].promised, &job->promised)) job->promised = UINT64_MAX;
    }
    if (result == PBR_OK && job->arrays.count > PBR_MAX_POINTS)
        return pbr_log(reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu points, the limit is %llu", reader->name,
                       (unsigned long long)job->arrays.count, (unsigned long long)PBR_MAX_POINTS);
    return result;
}

/* The first row that could not be read. The last one of a file that does not end its lines may be cut: it is left out. */
static pbr_result judge_bad_row(struct job *job) {
    struct reader *reader = job->reader;
    for (size_t i = 0; i < job->piece_count; i++) {
        const struct piece *piece = &job->pieces[i];
        if (!piece->bad) continue;
        size_t at = (size_t)(piece->bad - reader->data);
        bool last = piece->bad_end == reader->data + reader->size;
        uint64_t whole = piece->first_row + piece->rows;
        if (last && piece->bad_columns < job->head.columns && whole > 0) {
            job->arrays.count = whole;
            reader_warn(reader, 1, "the data ends within a row, which is left out");
            return PBR_OK;
        }
        if (piece->bad_columns < 0)
            return reader_error_line(reader, PBR_ERROR_FORMAT, at, "'%s' is not a number",
                                     reader_excerpt(piece->bad, text_word_end(piece->bad, piece->bad_end)).text);
        return reader_error_line(reader, PBR_ERROR_FORMAT, at, "%d columns, where the first row has %d", piece->bad_columns,
                                 job->head.columns);
    }
    return PBR_OK;
}

static pbr_result read_rows(struct job *job) {
    struct reader *reader = job->reader;
    job->extras = (job->head.columns < MOST_COLUMNS ? job->head.columns : MOST_COLUMNS) - 3;
    pbr_result result = arrays_make(&job->arrays, job->arrays.count, PBR_FORMAT_FLOAT64, 3, &job->arrays.positions);
    if (result == PBR_OK && job->extras > 0)
        result = arrays_make(&job->arrays, job->arrays.count, PBR_FORMAT_FLOAT32, (uint32_t)job->extras, &job->table);
    if (result != PBR_OK) return result;
    job->positions = (double(*)[3])(uintptr_t)job->arrays.positions.data;
    job->extra = (float *)(uintptr_t)job->table.data;
    result = reader_parallel(reader, job->piece_count, 1, job->head.first, reader->size, read_pieces, job);
    if (result == PBR_OK) result = judge_bad_row(job);
    if (result != PBR_OK) return result;
    if (job->head.has_names) reader_warn(reader, 1, "a line of column names skipped");
    if (job->head.has_count && job->promised != job->arrays.count)
        reader_warn(reader, 1, "%llu points announced, %llu there", (unsigned long long)job->promised,
                    (unsigned long long)job->arrays.count);
    if (job->head.columns > MOST_COLUMNS)
        reader_warn(reader, 1, "%d columns left out: a point has at most %d scalars", job->head.columns - MOST_COLUMNS,
                    PBR_MAX_SCALARS);
    return PBR_OK;
}

/* ---- what the columns mean ---- */

static void keep_scalars(struct job *job, int first, int count) {
    for (int i = first; i < first + count; i++) {
        uint32_t index = job->arrays.scalar_count++;
        char *name = job->names[index];
        if (job->head.columns == 4 || job->head.columns == 7)
            snprintf(name, sizeof job->names[index], "%s", job->head.has_count ? "intensity" : "scalar");
        else snprintf(name, sizeof job->names[index], "column_%d", i + 4);
        job->arrays.scalars[index] = (pbr_scalar){name, arrays_columns(&job->table, (uint32_t)i, 1)};
    }
}

/* Three columns from `first` on are normals or colours by their range, or, where that is taken, scalars. */
static pbr_result keep_triple(struct job *job, int first, struct triple_range range) {
    pbr_attribute triple = arrays_columns(&job->table, (uint32_t)first, 3);
    if (range.kind == TRIPLE_COLOURS && !job->arrays.colours.data) return arrays_colours(&job->arrays, &triple, range);
    if (range.kind == TRIPLE_NORMALS && !job->arrays.normals.data) job->arrays.normals = triple;
    else keep_scalars(job, first, 3);
    return PBR_OK;
}

static struct triple_range range_of(const struct job *job, int first) {
    pbr_attribute triple = arrays_columns(&job->table, (uint32_t)first, 3);
    return arrays_triple(&triple, job->arrays.count);
}

static pbr_result understand(struct job *job) {
    pbr_result result;
    switch (job->head.columns) {
    case 3: return PBR_OK;
    case 4: keep_scalars(job, 0, 1); return PBR_OK;
    case 6: return keep_triple(job, 0, range_of(job, 0));
    case 7: keep_scalars(job, 0, 1); return keep_triple(job, 1, range_of(job, 1));
    case 9: {
        struct triple_range a = range_of(job, 0), b = range_of(job, 3);
        /* Pure colours in 0..1 have length 1 too, but then nothing is negative. */
        if (a.kind == TRIPLE_NORMALS && b.kind == TRIPLE_NORMALS) {
            if (b.low >= 0) b.kind = TRIPLE_COLOURS;
            else if (a.low >= 0) a.kind = TRIPLE_COLOURS;
        }
        result = keep_triple(job, 0, a);
        return result == PBR_OK ? keep_triple(job, 3, b) : result;
    }
    default:
        keep_scalars(job, 0, job->extras);
        reader_warn(job->reader, 1, "%d columns: those after x, y and z are kept as scalars", job->head.columns);
        return PBR_OK;
    }
}

pbr_result points_text_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    reader->line_end = text_line_end(reader);
    struct job job = {.reader = reader, .head = look(reader), .arrays = {.instance = reader->instance}};
    if (job.head.has_two_counts)
        return reader_error_line(reader, PBR_ERROR_UNSUPPORTED, job.head.first,
                                 "PTX is not supported; convert it to PTS or PLY, for instance with CloudCompare");
    pbr_result result = count_rows(&job);
    if (result == PBR_OK) result = read_rows(&job);
    if (result == PBR_OK) result = understand(&job);
    if (result == PBR_OK) result = reader_progress(reader, reader->size);
    if (result == PBR_OK) result = arrays_points(&job.arrays, desc, content);
    if (result == PBR_OK) {
        content->format = job.head.has_count ? PBR_FILE_PTS : PBR_FILE_XYZ;
        content->vertex_count = job.arrays.count;
        snprintf(content->encoding, sizeof content->encoding, "text, %d columns", job.head.columns);
    }
    pbr_free(reader->instance, job.pieces);
    arrays_free(&job.arrays);
    return result;
}
