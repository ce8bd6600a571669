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

/* ---- rows with lists that are triangles: nearly all, in nearly all files ---- */

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

/* Reads rows from `*p` on, before the first that is no triangle, cut or out of range. Not too many: progress is to be told. */
static uint64_t read_triangles(const struct triangle_rows *rows, uint64_t most, const char **p, const char *end,
                               struct ply_faces *faces) {
    enum { AT_ONCE = 8192 };
    uint64_t whole = (size_t)(end - *p) / rows->size, done = 0;
    if (most > whole) most = whole;
    if (most > AT_ONCE) most = AT_ONCE;
    for (; done < most; done++) {
        const char *list = *p + done * rows->size + rows->list;
        uint32_t corner[3];
        if (*list != 3) break;
        for (int k = 0; k < 3; k++) corner[k] = (uint32_t)binary_bits(list + 1 + 4 * k, 4, rows->big_endian);
        if (corner[0] >= rows->limit || corner[1] >= rows->limit || corner[2] >= rows->limit) break;
        ply_emit(faces, corner[0], corner[1], corner[2]);
    }
    *p += done * rows->size;
    faces->faces += done;
    return done;
}

static pbr_result read_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                            size_t *position, uint64_t *rows, struct ply_faces *faces) {
    const char *p = reader->data + *position, *end = reader->data + reader->size;
    const struct triangle_rows triangles = find_triangles(target, big_endian);
    size_t step = reader->size / 32 + 65536, told = *position;
    for (*rows = 0; *rows < count;) {
        size_t at = (size_t)(p - reader->data);
        if (at - told >= step) {
            pbr_result result = reader_progress(reader, at);
            if (result != PBR_OK) return result;
            told = at;
        }
        uint64_t read = triangles.size ? read_triangles(&triangles, count - *rows, &p, end, faces) : 0;
        if (read == 0) {
            enum row_state state = read_row(target, *rows, big_endian, &p, end, faces);
            if (state == ROW_NEGATIVE) return reader_error_byte(reader, PBR_ERROR_FORMAT, at, "a list of negative length");
            if (state == ROW_CUT) {
                p = reader->data + at;
                break;
            }
            read = 1;
        }
        *rows += read;
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
