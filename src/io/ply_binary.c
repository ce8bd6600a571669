/* Rows of binary PLY elements. SPDX-License-Identifier: MIT */
#include "number_binary.h"
#include "ply_rows.h"

/* ---- rows of one size: in parallel ---- */

struct fixed_rows {
    const struct ply_target *target;
    const char *data; /* row 0 */
    size_t row_size;
    size_t first; /* row that the current step begins with */
    bool big_endian;
};

static pbr_result read_fixed(void *user, size_t begin, size_t end) {
    const struct fixed_rows *rows = user;
    const char *p = rows->data;
    for (uint32_t i = 0; i < rows->target->property_count; i++) {
        const struct ply_column *column = &rows->target->columns[i];
        enum ply_type type = rows->target->properties[i].type;
        for (size_t row = rows->first + begin; column->store != STORE_NOTHING && row < rows->first + end; row++)
            ply_store(column, row, binary_number(p + row * rows->row_size, type, rows->big_endian));
        p += ply_type_size(type);
    }
    return PBR_OK;
}

static pbr_result fixed_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                             size_t *position, uint64_t *rows) {
    enum { STEPS = 32, GRAIN = 8192 };
    size_t size = ply_smallest_row(target, false);
    if (size == 0) { /* no properties: no data */
        *rows = count;
        return PBR_OK;
    }
    size_t whole = (reader->size - *position) / size;
    if (whole > count) whole = (size_t)count;
    struct fixed_rows work = {target, reader->data + *position, size, 0, big_endian};
    size_t step = whole / STEPS < GRAIN ? GRAIN : whole / STEPS + 1;
    for (; target->columns && work.first < whole; work.first += step) {
        pbr_result result = reader_progress(reader, *position + work.first * size);
        size_t now = whole - work.first < step ? whole - work.first : step;
        if (result == PBR_OK) result = pbr_parallel(reader->instance, now, GRAIN, read_fixed, &work);
        if (result != PBR_OK) return result;
    }
    *position += whole * size;
    *rows = whole;
    return PBR_OK;
}

/* ---- rows with lists: one after the other ---- */

enum row_state { ROW_WHOLE, ROW_CUT, ROW_NEGATIVE };

/* Reads a list at `*p`. ROW_CUT: the data ends first. */
static enum row_state read_list(const struct ply_target *target, uint32_t property, bool big_endian, const char **p,
                                const char *end, struct ply_faces *faces) {
    enum ply_type type = target->properties[property].type, count_type = target->properties[property].count_type;
    size_t size = ply_type_size(type), head = ply_type_size(count_type);
    if ((size_t)(end - *p) < head) return ROW_CUT;
    double length = binary_number(*p, count_type, big_endian);
    if (length < 0) return ROW_NEGATIVE;
    size_t count = (size_t)length, there = ((size_t)(end - *p) - head) / size;
    bool whole = count <= there;
    *p += head;
    if (target->shape != SHAPE_NONE && property == target->index_property && (whole || target->shape == SHAPE_STRIP)) {
        struct ply_corners list = ply_corners_begin(target, faces);
        for (size_t i = 0; i < (whole ? count : there); i++)
            ply_corner(&list, ply_index(binary_number(*p + i * size, type, big_endian)));
        if (whole) ply_corners_end(&list);
    }
    if (whole) *p += count * size;
    return whole ? ROW_WHOLE : ROW_CUT;
}

static enum row_state read_row(const struct ply_target *target, uint64_t row, bool big_endian, const char **p, const char *end,
                               struct ply_faces *faces) {
    size_t before = faces->count;
    enum row_state state = ROW_WHOLE;
    for (uint32_t i = 0; i < target->property_count && state == ROW_WHOLE; i++) {
        const struct ply_property *property = &target->properties[i];
        size_t size = ply_type_size(property->type);
        if (property->count_type != PLY_NONE) {
            state = read_list(target, i, big_endian, p, end, faces);
        } else if ((size_t)(end - *p) < size) {
            state = ROW_CUT;
        } else {
            if (target->columns) ply_store(&target->columns[i], row, binary_number(*p, property->type, big_endian));
            *p += size;
        }
    }
    if (state != ROW_WHOLE && target->shape == SHAPE_POLYGON) faces->count = before;
    return state;
}

static pbr_result read_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                            size_t *position, uint64_t *rows, struct ply_faces *faces) {
    const char *p = reader->data + *position, *end = reader->data + reader->size;
    size_t step = reader->size / 32 + 65536, told = *position;
    for (*rows = 0; *rows < count; ++*rows) {
        const char *begin = p;
        enum row_state state = read_row(target, *rows, big_endian, &p, end, faces);
        size_t at = (size_t)(begin - reader->data);
        if (state == ROW_NEGATIVE) return reader_error_byte(reader, PBR_ERROR_FORMAT, at, "a list of negative length");
        if (state == ROW_CUT) {
            p = begin;
            break;
        }
        if (at - told >= step) {
            pbr_result result = reader_progress(reader, at);
            if (result != PBR_OK) return result;
            told = at;
        }
    }
    *position = (size_t)(p - reader->data);
    return PBR_OK;
}

pbr_result ply_binary_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                           size_t *position, uint64_t *rows, struct ply_faces *faces, size_t *room) {
    bool lists = false;
    for (uint32_t i = 0; i < target->property_count; i++) lists |= target->properties[i].count_type != PLY_NONE;
    if (!lists) return fixed_rows(reader, target, count, big_endian, position, rows);

    /* Twice: the triangles are counted before they are allocated. */
    size_t start = *position;
    struct ply_faces part = {0};
    if (target->shape != SHAPE_NONE) {
        pbr_result result = read_rows(reader, target, count, big_endian, position, rows, &part);
        if (result == PBR_OK) result = ply_faces_reserve(reader, faces, room, part.most);
        if (result != PBR_OK) return result;
        part = (struct ply_faces){.triangles = part.most ? faces->triangles + faces->count : NULL};
        *position = start;
    }
    pbr_result result = read_rows(reader, target, count, big_endian, position, rows, &part);
    ply_faces_add(faces, &part);
    return result;
}
