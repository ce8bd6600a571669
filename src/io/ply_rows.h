/* Where the rows of a PLY element go: vertex properties into columns, index lists into triangles. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PLY_ROWS_H
#define PBR_IO_PLY_ROWS_H

#include "ply_header.h"

enum ply_store { STORE_NOTHING, STORE_FLOAT, STORE_DOUBLE, STORE_UNORM8, STORE_UNORM16 };

/* The array that a property's numbers go to. */
struct ply_column {
    enum ply_store store;
    double scale; /* applied to every number: 1, or what makes a colour's full value that of the array */
    unsigned char *base;
    size_t stride;
};

enum ply_shape { SHAPE_NONE, SHAPE_POLYGON, SHAPE_STRIP };

/* How the rows of one element are read. */
struct ply_target {
    const struct ply_property *properties;
    uint32_t property_count;
    const struct ply_column *columns; /* one a property, or NULL: numbers are not kept */
    enum ply_shape shape;             /* of the index list */
    uint32_t index_property;          /* with a shape */
    uint64_t vertex_count;            /* indices at or past it are out of range */
};

/* Triangles made of index lists. With `triangles` NULL they are only counted. */
struct ply_faces {
    uint32_t (*triangles)[3];
    size_t count;
    size_t most;    /* that `count` ever was: triangles of a polygon are taken back when it turns out to be faulty */
    uint64_t faces; /* polygons, or triangles of strips, left out ones included */
    uint64_t out_of_range, too_short;
};

/* An index that no vertex has. */
#define PLY_NO_INDEX INT64_MIN

/* One index list on its way to triangles. */
struct ply_corners {
    struct ply_faces *faces;
    const struct ply_target *target;
    size_t begin;          /* triangles before this list */
    int64_t first, second; /* polygon: first and last corner; strip: the last two */
    uint64_t count;
    bool bad;
};

static inline struct ply_corners ply_corners_begin(const struct ply_target *target, struct ply_faces *faces) {
    return (struct ply_corners){.faces = faces, .target = target, .begin = faces->count};
}

static inline void ply_emit(struct ply_faces *faces, int64_t a, int64_t b, int64_t c) {
    if (faces->triangles) {
        faces->triangles[faces->count][0] = (uint32_t)a;
        faces->triangles[faces->count][1] = (uint32_t)b;
        faces->triangles[faces->count][2] = (uint32_t)c;
    }
    if (++faces->count > faces->most) faces->most = faces->count;
}

/* Strips wind alternately; -1 starts anew; a corner given twice in a row only turns the strip. */
static inline void ply_strip_corner(struct ply_corners *list, int64_t index, bool in_range) {
    if (!in_range) {
        list->faces->out_of_range += index != -1;
        list->count = 0;
        return;
    }
    if (list->count >= 2 && list->first != list->second && list->second != index && index != list->first) {
        bool flip = list->count & 1;
        ply_emit(list->faces, flip ? list->second : list->first, flip ? list->first : list->second, index);
        list->faces->faces++;
    }
    list->first = list->second;
    list->second = index;
    list->count++;
}

static inline void ply_corner(struct ply_corners *list, int64_t index) {
    bool in_range = index >= 0 && (uint64_t)index < list->target->vertex_count;
    if (list->target->shape == SHAPE_STRIP) {
        ply_strip_corner(list, index, in_range);
        return;
    }
    list->bad |= !in_range;
    if (list->count == 0) list->first = index;
    else if (list->count >= 2 && !list->bad) ply_emit(list->faces, list->first, list->second, index);
    list->second = index;
    list->count++;
}

/* The list is whole. */
static inline void ply_corners_end(struct ply_corners *list) {
    struct ply_faces *faces = list->faces;
    if (list->target->shape == SHAPE_STRIP) return;
    faces->faces++;
    if (list->bad) faces->count = list->begin;
    if (list->bad) faces->out_of_range++;
    else if (list->count < 3) faces->too_short++;
}

/* The list broke off: of a polygon nothing stays, of a strip what there was. */
static inline void ply_corners_cancel(struct ply_corners *list) {
    if (list->target->shape == SHAPE_POLYGON) list->faces->count = list->begin;
}

static inline int64_t ply_index(double value) {
    return value >= -1 && value <= 9007199254740992.0 && value == (double)(int64_t)value ? (int64_t)value : PLY_NO_INDEX;
}

/* Most triangles that a list of `count` indices can give. */
static inline uint64_t ply_most_triangles(uint64_t count) {
    return count < 3 ? 0 : count - 2;
}

void ply_store(const struct ply_column *column, uint64_t row, double value);

/* The rows of an element, read: `rows` is how many were whole, at most `element->count`; `*position` moves past them. Less than all
 * means that the data ends. Adds to `*faces`, whose triangles grow as needed (`*room` of them), if the target has a shape. */
pbr_result ply_ascii_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool last, size_t *position,
                          uint64_t *rows, struct ply_faces *faces, size_t *room);
pbr_result ply_binary_rows(struct reader *reader, const struct ply_target *target, uint64_t count, bool big_endian,
                           size_t *position, uint64_t *rows, struct ply_faces *faces, size_t *room);

/* Makes room for `more` triangles after those that `faces` holds. */
pbr_result ply_faces_reserve(struct reader *reader, struct ply_faces *faces, size_t *room, uint64_t more);

/* Adds counts, not triangles. */
void ply_faces_add(struct ply_faces *sum, const struct ply_faces *part);

/* Warns of the faces that were left out. */
void ply_faces_warn(struct reader *reader, const struct ply_faces *faces);

/* Bytes that a row takes at least; 0 for an element without properties. */
size_t ply_smallest_row(const struct ply_target *target, bool ascii);

#endif
