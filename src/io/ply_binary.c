/* Rows of binary PLY elements. SPDX-License-Identifier: MIT */
#include <string.h>

#include "number_binary.h"
#include "ply_rows.h"

enum { GRAIN = 8192 /* rows */ };

/* ---- rows of one size: in parallel ---- */

struct fixed_rows {
    const struct ply_target *target;
    const char *data; /* row 0 */
    size_t row_size;
    bool big_endian;
};

static pbr_result read_fixed(void *user, size_t begin, size_t end) {
    const struct fixed_rows *rows = user;
    const char *p = rows->data;
    for (uint32_t i = 0; i < rows->target->property_count; i++) {
        const struct ply_column *column = &rows->target->columns[i];
        enum ply_type type = rows->target->properties[i].type;
        for (size_t row = begin; column->store != STORE_NOTHING && row < end; row++)
            ply_store(column, row, binary_number(p + row * rows->row_size, type, rows->big_endian));
        p += ply_type_size(type);
    }
    return PBR_OK;
}

static pbr_result fixed_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                             size_t *position, uint64_t *rows) {
    size_t size = ply_smallest_row(target, false);
    if (size == 0) { /* no properties: no data */
        *rows = count;
        return PBR_OK;
    }
    size_t whole = (reader->size - *position) / size;
    if (whole > count) whole = (size_t)count;
    struct fixed_rows work = {target, reader->data + *position, size, big_endian};
    const size_t begin = *position;
    *position += whole * size;
    *rows = whole;
    return target->columns ? reader_parallel(reader, whole, GRAIN, begin, *position, read_fixed, &work) : PBR_OK;
}

/* ---- rows that are triangles: nearly all, in nearly all files ---- */

/* Where the corners are if the element's only list is that of the indices, its length one byte, an index four. */
struct triangle_rows {
    size_t size, list; /* bytes of a row, 0 for other elements; of them before the list */
    uint32_t limit;    /* indices at or past it, read without their sign, are out of range */
    bool big_endian;
};

static struct triangle_rows find_triangles(const struct ply_target *target, bool big_endian) {
    static const struct triangle_rows NONE = {0};
    struct triangle_rows rows = {.limit = (uint32_t)target->vertex_count, .big_endian = big_endian};
    if (target->shape != SHAPE_POLYGON || target->columns) return NONE;
    for (uint32_t i = 0; i < target->property_count; i++) {
        const struct ply_property *property = &target->properties[i];
        size_t size = ply_type_size(property->type);
        if (i != target->index_property) {
            if (property->count_type != PLY_NONE) return NONE;
            rows.size += size;
        } else {
            if (property->count_type != PLY_UINT8 || size != 4 || property->type == PLY_FLOAT32) return NONE;
            if (property->type == PLY_INT32 && rows.limit > (uint32_t)INT32_MAX + 1) rows.limit = (uint32_t)INT32_MAX + 1;
            rows.list = rows.size;
            rows.size += 1 + 3 * size;
        }
    }
    return rows;
}

/* Reads `count` rows at p, before the first that is no triangle or out of range: returns how many. `to` may be NULL. */
static size_t read_triangles(const struct triangle_rows *rows, const char *p, size_t count, uint32_t (*to)[3]) {
    for (size_t row = 0; row < count; row++) {
        const char *list = p + row * rows->size + rows->list;
        uint32_t corner[3];
        for (int k = 0; k < 3; k++) corner[k] = (uint32_t)binary_bits(list + 1 + 4 * k, 4, rows->big_endian);
        if (*list != 3 || corner[0] >= rows->limit || corner[1] >= rows->limit || corner[2] >= rows->limit) return row;
        if (to) memcpy(to[row], corner, sizeof corner);
    }
    return count;
}

struct all_triangles {
    const struct triangle_rows *rows;
    const char *data; /* row 0 */
    uint32_t (*triangles)[3];
};

/* PBR_ERROR_FORMAT, which nothing else here returns: not all are. */
static pbr_result read_some(void *user, size_t begin, size_t end) {
    const struct all_triangles *all = user;
    const size_t count = end - begin;
    return read_triangles(all->rows, all->data + begin * all->rows->size, count, all->triangles + begin) == count
               ? PBR_OK
               : PBR_ERROR_FORMAT;
}

/* In parallel, if all rows are triangles; if not, *done is false, and nothing was read. */
static pbr_result read_all(struct reader *reader, const struct triangle_rows *rows, uint64_t count, size_t *position,
                           struct ply_faces *faces, size_t *room, bool *done) {
    const char *data = reader->data + *position;
    *done = false;
    if (rows->size == 0 || count == 0 || (reader->size - *position) / rows->size < count) return PBR_OK;
    /* Room for triangles is taken before they are read: of other faces as a rule not. */
    if (read_triangles(rows, data, 1, NULL) == 0 || read_triangles(rows, data + (count - 1) * rows->size, 1, NULL) == 0)
        return PBR_OK;
    pbr_result result = ply_faces_reserve(reader, faces, room, count);
    if (result != PBR_OK) return result;
    struct all_triangles all = {.rows = rows, .data = data, .triangles = faces->triangles + faces->count};
    result = reader_parallel(reader, (size_t)count, GRAIN, *position, *position + count * rows->size, read_some, &all);
    if (result != PBR_OK) return result == PBR_ERROR_FORMAT ? PBR_OK : result;
    *done = true;
    faces->count += count;
    faces->faces += count;
    *position += count * rows->size;
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

static pbr_result read_rows(struct reader *reader, const struct ply_target *target, const struct triangle_rows *triangles,
                            uint64_t count, bool big_endian, size_t *position, uint64_t *rows, struct ply_faces *faces) {
    enum { AT_ONCE = 8192 /* triangles: progress is to be told */ };
    const char *p = reader->data + *position, *end = reader->data + reader->size;
    size_t step = reader->size / 32 + 65536, told = *position;
    for (*rows = 0; *rows < count;) {
        size_t at = (size_t)(p - reader->data);
        if (at - told >= step) {
            pbr_result result = reader_progress(reader, at);
            if (result != PBR_OK) return result;
            told = at;
        }
        if (triangles->size > 0) {
            uint64_t most = (size_t)(end - p) / triangles->size;
            if (most > count - *rows) most = count - *rows;
            if (most > AT_ONCE) most = AT_ONCE;
            const size_t done =
                read_triangles(triangles, p, (size_t)most, faces->triangles ? faces->triangles + faces->count : NULL);
            faces->count += done;
            faces->faces += done;
            if (faces->count > faces->most) faces->most = faces->count;
            p += done * triangles->size;
            *rows += done;
            if (done > 0) continue;
        }
        enum row_state state = read_row(target, *rows, big_endian, &p, end, faces);
        if (state == ROW_NEGATIVE) return reader_error_byte(reader, PBR_ERROR_FORMAT, at, "a list of negative length");
        if (state == ROW_CUT) {
            p = reader->data + at;
            break;
        }
        ++*rows;
    }
    *position = (size_t)(p - reader->data);
    return PBR_OK;
}

pbr_result ply_binary_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                           size_t *position, uint64_t *rows, struct ply_faces *faces, size_t *room) {
    bool lists = false, done;
    for (uint32_t i = 0; i < target->property_count; i++) lists |= target->properties[i].count_type != PLY_NONE;
    if (!lists) return fixed_rows(reader, target, count, big_endian, position, rows);
    const struct triangle_rows triangles = find_triangles(target, big_endian);
    *rows = count;
    pbr_result result = read_all(reader, &triangles, count, position, faces, room, &done);
    if (result != PBR_OK || done) return result;

    /* Twice: the triangles are counted before they are allocated. */
    size_t start = *position;
    struct ply_faces part = {0};
    if (target->shape != SHAPE_NONE) {
        result = read_rows(reader, target, &triangles, count, big_endian, position, rows, &part);
        if (result == PBR_OK) result = ply_faces_reserve(reader, faces, room, part.most);
        if (result != PBR_OK) return result;
        part = (struct ply_faces){.triangles = part.most ? faces->triangles + faces->count : NULL};
        *position = start;
    }
    result = read_rows(reader, target, &triangles, count, big_endian, position, rows, &part);
    ply_faces_add(faces, &part);
    return result;
}
