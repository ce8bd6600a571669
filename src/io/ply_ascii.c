/* Rows of PLY elements in text.
 *
 * The format is a stream of tokens, but every writer puts one row on a line. So lines are counted in pieces of the file, which
 * gives each piece its first row, and the pieces are read in parallel. If any line turns out not to be exactly one row, the element
 * is read again token by token, which also finds what to say about a fault. SPDX-License-Identifier: MIT */
#include "ply_rows.h"

#include <string.h>

#include "number.h"

enum { PIECE_BYTES = 1 << 18, MOST_PIECES_AT_ONCE = 64 };

enum row_state { ROW_WHOLE, ROW_CUT, ROW_BAD };

/* Where rows end: at the end of the data, or, line by line, at one character of those that is_space() knows. */
struct bounds {
    const char *end;
    int line_end; /* NO_LINES: no character is it */
};

enum { NO_LINES = 256 };

static inline bool is_end(const char *p, struct bounds bounds) {
    return p == bounds.end || *p == bounds.line_end;
}

static inline const char *skip_space(const char *p, struct bounds bounds) {
    while (!is_end(p, bounds) && is_space(*p)) p++;
    return p;
}

static inline const char *skip_token(const char *p, const char *end) {
    while (p < end && !is_space(*p)) p++;
    return p;
}

/* Reads a whole number of up to seven digits, as indices mostly are; false, and `*p` stays, where there is none. */
static inline bool next_small(const char **p, const char *end, uint32_t *out) {
    const int digits = number_digits(*p, end, out);
    const char *after = *p + digits;
    if (digits == 0 || digits == 8 || (after != end && !is_space(*after))) return false;
    *p = after;
    return true;
}

/* Reads the number at `*p` after blanks; on failure `*p` is at the token, or at the row's end. */
static inline enum row_state next_number(const char **p, struct bounds bounds, double *out) {
    *p = skip_space(*p, bounds);
    if (is_end(*p, bounds)) return ROW_CUT;
    const char *after = number_parse(*p, bounds.end, out);
    if (!after || (after < bounds.end && !is_space(*after))) return ROW_BAD;
    *p = after;
    return ROW_WHOLE;
}

/* Likewise an index; PLY_NO_INDEX for numbers that are none. */
static inline enum row_state next_index(const char **p, struct bounds bounds, int64_t *out) {
    *p = skip_space(*p, bounds);
    uint32_t small;
    if (next_small(p, bounds.end, &small)) {
        *out = small;
        return ROW_WHOLE;
    }
    double value = -2;
    const enum row_state state = next_number(p, bounds, &value);
    *out = ply_index(value);
    return state;
}

static enum row_state read_list(const struct ply_target *target, uint32_t property, const char **p, struct bounds bounds,
                                struct ply_faces *faces) {
    const char *start = skip_space(*p, bounds);
    int64_t count;
    enum row_state state = next_index(p, bounds, &count); /* a whole number, too */
    if (state != ROW_WHOLE) return state;
    if (count < 0) {
        *p = start; /* what the message shows */
        return ROW_BAD;
    }
    if (target->shape == SHAPE_NONE || property != target->index_property) {
        for (int64_t i = 0; i < count; i++) {
            *p = skip_space(*p, bounds);
            if (is_end(*p, bounds)) return ROW_CUT;
            *p = skip_token(*p, bounds.end);
        }
        return ROW_WHOLE;
    }
    struct ply_corners list = ply_corners_begin(target, faces);
    for (int64_t i = 0; i < count && state == ROW_WHOLE; i++) {
        int64_t index;
        state = next_index(p, bounds, &index);
        if (state == ROW_WHOLE) ply_corner(&list, index);
    }
    if (state == ROW_WHOLE) ply_corners_end(&list);
    else ply_corners_cancel(&list);
    return state;
}

/* Reads one row from `*p` on. */
static enum row_state read_row(const struct ply_target *target, uint64_t row, const char **p, struct bounds bounds,
                               struct ply_faces *faces) {
    size_t before = faces->count;
    enum row_state state = ROW_WHOLE;
    for (uint32_t i = 0; i < target->property_count && state == ROW_WHOLE; i++) {
        if (target->properties[i].count_type != PLY_NONE) {
            state = read_list(target, i, p, bounds, faces);
        } else if (target->columns && target->columns[i].store != STORE_NOTHING) {
            double value;
            state = next_number(p, bounds, &value);
            if (state == ROW_WHOLE) ply_store(&target->columns[i], row, value);
        } else {
            *p = skip_space(*p, bounds);
            if (is_end(*p, bounds)) state = ROW_CUT;
            *p = skip_token(*p, bounds.end);
        }
    }
    if (state != ROW_WHOLE && target->shape == SHAPE_POLYGON) faces->count = before;
    return state;
}

/* ---- line by line ---- */

struct piece {
    const char *begin, *end;
    uint64_t first_row, rows;
    uint64_t most_triangles;
    struct ply_faces faces; /* `triangles` is the piece's own part of the array */
    bool irregular;
};

struct lines {
    const struct ply_target *target;
    struct piece *pieces;
    size_t first;         /* piece that is counted first */
    uint64_t rows_wanted; /* of any piece at most */
    char line_end;
};

static inline const char *line_end(const struct lines *lines, const char *p, const char *end) {
    const char *found = memchr(p, lines->line_end, (size_t)(end - p));
    return found ? found : end;
}

/* Most triangles of the row that begins at `p`: from the length of its index list. */
static uint64_t row_triangles(const struct ply_target *target, const char *p, const char *end) {
    const struct bounds line = {end, NO_LINES};
    int64_t length = 0;
    for (uint32_t i = 0; i <= target->index_property; i++) {
        if (target->properties[i].count_type == PLY_NONE) {
            p = skip_token(skip_space(p, line), end);
            continue;
        }
        if (next_index(&p, line, &length) != ROW_WHOLE || length < 0) return 0;
        for (int64_t k = 0; i < target->index_property && k < length && p < end; k++) p = skip_token(skip_space(p, line), end);
    }
    /* An index takes a digit and a blank: a line that promises more than fits holds at most what fits. */
    uint64_t fits = (uint64_t)(end - p) / 2 + 1;
    return ply_most_triangles((uint64_t)length < fits ? (uint64_t)length : fits);
}

/* Counts a piece's rows, and ends it after the last one wanted. */
static void count_piece(const struct lines *lines, struct piece *piece, uint64_t wanted) {
    const char *p = piece->begin, *const piece_end = piece->end;
    uint64_t rows = 0, most_triangles = 0;
    while (p < piece_end && rows < wanted) {
        const char *end = line_end(lines, p, piece_end), *text = skip_space(p, (struct bounds){end, NO_LINES});
        if (text < end) {
            rows++;
            if (lines->target->shape != SHAPE_NONE) most_triangles += row_triangles(lines->target, text, end);
        }
        p = end < piece_end ? end + 1 : end;
    }
    piece->end = p;
    piece->rows = rows;
    piece->most_triangles = most_triangles;
}

static pbr_result count_pieces(void *user, size_t begin, size_t end) {
    const struct lines *lines = user;
    for (size_t i = begin; i < end; i++) count_piece(lines, &lines->pieces[lines->first + i], lines->rows_wanted);
    return PBR_OK;
}

/* The piece's neighbours in memory are other threads': it is written once. */
static void read_piece(const struct lines *lines, struct piece *piece) {
    const struct bounds bounds = {piece->end, lines->line_end};
    struct ply_faces faces = piece->faces;
    uint64_t row = piece->first_row;
    bool irregular = false;
    for (const char *p = piece->begin; p < bounds.end && !irregular; p += p < bounds.end) {
        p = skip_space(p, bounds);
        if (is_end(p, bounds)) continue;
        irregular = read_row(lines->target, row++, &p, bounds, &faces) != ROW_WHOLE;
        p = skip_space(p, bounds);
        irregular |= !is_end(p, bounds);
    }
    piece->faces = faces;
    piece->irregular = irregular;
}

static pbr_result read_pieces(void *user, size_t begin, size_t end) {
    const struct lines *lines = user;
    for (size_t i = begin; i < end; i++) read_piece(lines, &lines->pieces[i]);
    return PBR_OK;
}

/* Cuts [*p, end) at line ends into at most `most` pieces from pieces[count] on; returns how many. */
static size_t cut_pieces(struct lines *lines, size_t count, size_t most, const char **p, const char *end) {
    size_t made = 0;
    for (; made < most && *p < end; made++) {
        const char *to = end - *p > PIECE_BYTES ? line_end(lines, *p + PIECE_BYTES, end) : end;
        if (to < end) to++;
        lines->pieces[count + made] = (struct piece){.begin = *p, .end = to};
        *p = to;
    }
    return made;
}

/* Finds the pieces that hold the element's rows. Returns the rows found. */
static pbr_result find_pieces(struct reader *reader, struct lines *lines, uint64_t wanted, size_t position, size_t *count,
                              uint64_t *rows) {
    const char *p = reader->data + position, *end = reader->data + reader->size;
    *count = 0;
    *rows = 0;
    while (*rows < wanted && p < end) {
        /* As many as the rows will take if they are as long as those so far: what is beyond them is looked at in vain. */
        const double each = *rows > 0 ? (double)*rows / (double)*count : 0, left = (double)(wanted - *rows);
        const size_t most = *count == 0 ? 1 : left < each * MOST_PIECES_AT_ONCE ? (size_t)(left / each) + 1 : MOST_PIECES_AT_ONCE;
        lines->first = *count;
        lines->rows_wanted = wanted - *rows;
        size_t made = cut_pieces(lines, *count, most, &p, end);
        pbr_result result = pbr_parallel(reader->instance, made, 1, count_pieces, lines);
        if (result != PBR_OK) return result;
        for (size_t i = 0; i < made && *rows < wanted; i++) {
            struct piece *piece = &lines->pieces[(*count)++];
            if (piece->rows > wanted - *rows) count_piece(lines, piece, wanted - *rows);
            piece->first_row = *rows;
            *rows += piece->rows;
        }
    }
    return PBR_OK;
}

/* Reads pieces in parallel, and closes the gaps that left out triangles leave. */
static pbr_result read_found(struct reader *reader, struct lines *lines, size_t count, struct ply_faces *faces, size_t *room,
                             bool *regular) {
    uint64_t most = 0;
    for (size_t i = 0; i < count; i++) most += lines->pieces[i].most_triangles;
    pbr_result result = ply_faces_reserve(reader, faces, room, most);
    if (result != PBR_OK) return result;
    uint32_t(*triangles)[3] = faces->triangles ? faces->triangles + faces->count : NULL, (*to)[3] = triangles;
    for (size_t i = 0; i < count && to; i++) {
        lines->pieces[i].faces.triangles = to;
        to += lines->pieces[i].most_triangles;
    }
    result = reader_parallel(reader, count, 1, (size_t)(lines->pieces->begin - reader->data),
                             (size_t)(lines->pieces[count - 1].end - reader->data), read_pieces, lines);
    if (result != PBR_OK) return result;
    for (size_t i = 0; i < count; i++) *regular &= !lines->pieces[i].irregular;
    for (size_t i = 0; i < count && *regular; i++) {
        const struct ply_faces *part = &lines->pieces[i].faces;
        if (part->count) memmove(faces->triangles + faces->count, part->triangles, part->count * sizeof *part->triangles);
        ply_faces_add(faces, part);
    }
    return PBR_OK;
}

/* ---- token by token ---- */

/* Reads rows until the data ends. A last token that touches the end of the file may be cut, unless nothing is missing after it. */
static pbr_result read_tokens(struct reader *reader, const struct ply_target *target, uint64_t count, bool last, size_t *position,
                              uint64_t *rows, struct ply_faces *faces) {
    const char *p = reader->data + *position, *end = reader->data + reader->size;
    size_t step = reader->size / 32 + 65536, told = *position;
    for (*rows = 0; *rows < count; ++*rows) {
        const char *begin = p;
        struct ply_faces before = *faces;
        enum row_state state = read_row(target, *rows, &p, (struct bounds){end, NO_LINES}, faces);
        if (state == ROW_BAD && skip_token(p, end) == end) state = ROW_CUT;
        if (state == ROW_BAD)
            return reader_error_line(reader, PBR_ERROR_FORMAT, (size_t)(p - reader->data), "'%s' is not a number that fits here",
                                     reader_excerpt(p, skip_token(p, end)).text);
        if (state == ROW_WHOLE && p == end && target->property_count > 0 && !is_space(end[-1]) && !(last && *rows + 1 == count)) {
            state = ROW_CUT;
            before.most = faces->most;
            if (target->shape == SHAPE_POLYGON) *faces = before;
        }
        if (state == ROW_CUT) {
            p = begin;
            break;
        }
        size_t at = (size_t)(p - reader->data);
        if (at - told >= step) {
            pbr_result result = reader_progress(reader, at);
            if (result != PBR_OK) return result;
            told = at;
        }
    }
    *position = (size_t)(p - reader->data);
    return PBR_OK;
}

static pbr_result read_token_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool last,
                                  size_t *position, uint64_t *rows, struct ply_faces *faces, size_t *room) {
    /* Twice for faces: the triangles are counted before they are allocated. */
    size_t start = *position;
    struct ply_faces part = {0};
    if (target->shape != SHAPE_NONE) {
        pbr_result result = read_tokens(reader, target, count, last, position, rows, &part);
        if (result == PBR_OK) result = ply_faces_reserve(reader, faces, room, part.most);
        if (result != PBR_OK) return result;
        part = (struct ply_faces){.triangles = part.most ? faces->triangles + faces->count : NULL};
        *position = start;
    }
    pbr_result result = read_tokens(reader, target, count, last, position, rows, &part);
    ply_faces_add(faces, &part);
    return result;
}

pbr_result ply_ascii_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool last, size_t *position,
                          uint64_t *rows, struct ply_faces *faces, size_t *room) {
    *rows = count;
    if (target->property_count == 0 || count == 0) return PBR_OK;
    struct lines lines = {.target = target, .line_end = reader->line_end};
    size_t pieces = (reader->size - *position) / PIECE_BYTES + 2, found = 0;
    uint64_t there = 0;
    bool regular = true;
    lines.pieces = pbr_allocate(reader->instance, pieces, sizeof *lines.pieces);
    if (!lines.pieces) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = find_pieces(reader, &lines, count, *position, &found, &there);
    if (result != PBR_OK) goto cleanup;
    /* The last line of a file that ends too early may be cut too: the slow way knows. */
    regular = there == count &&
              (last || lines.pieces[found - 1].end < reader->data + reader->size || is_space(reader->data[reader->size - 1]));
    if (regular) result = read_found(reader, &lines, found, faces, room, &regular);
    if (result == PBR_OK && regular) *position = (size_t)(lines.pieces[found - 1].end - reader->data);
cleanup:
    pbr_free(reader->instance, lines.pieces);
    if (result == PBR_OK && !regular) result = read_token_rows(reader, target, count, last, position, rows, faces, room);
    return result;
}
