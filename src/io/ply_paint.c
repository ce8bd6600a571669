/* Colours of a PLY mesh from its textures: `comment TextureFile NAME`, and of each vertex s and t (or u and v, texture_u and
 * texture_v), or of each polygon a list `texcoord` of two numbers a corner, and `texnumber`, which of several pictures.
 *
 * Lists are read here once more, one row after the other: few files have them, and the readers of rows stay as they are.
 * SPDX-License-Identifier: MIT */
#include "ply_paint.h"

#include <math.h>
#include <string.h>

#include "number.h"
#include "number_binary.h"
#include "paint.h"

enum { MOST_CORNERS = 64 }; /* of a polygon with texture coordinates */
#define NO_PROPERTY UINT32_MAX

struct walk {
    enum ply_encoding encoding;
    const char *p, *end;
    const struct ply_property *properties;
    uint32_t property_count;
    uint32_t coordinates, number; /* properties */
    uint32_t pictures;
    struct ply_target target;
    struct ply_faces counted;
    /* Of the row: */
    double list[2 * MOST_CORNERS];
    uint64_t list_length;
    double picture;
};

/* The next number; NaN for a word that is none. False at the end. */
static bool next_number(struct walk *walk, enum ply_type type, double *out) {
    size_t size = ply_type_size(type);
    if (walk->encoding != PLY_ASCII) {
        if ((size_t)(walk->end - walk->p) < size) return false;
        *out = binary_number(walk->p, type, walk->encoding == PLY_BIG_ENDIAN);
        walk->p += size;
        return true;
    }
    while (walk->p < walk->end && is_space(*walk->p)) walk->p++;
    const char *word = walk->p;
    while (walk->p < walk->end && !is_space(*walk->p)) walk->p++;
    if (number_parse(word, walk->p, out) != walk->p) *out = NAN;
    return walk->p > word;
}

static bool read_list(struct walk *walk, uint32_t property) {
    double length, value;
    struct ply_corners list = ply_corners_begin(&walk->target, &walk->counted);
    if (!next_number(walk, walk->properties[property].count_type, &length) || !(length >= 0)) return false;
    if (property == walk->coordinates) walk->list_length = length <= 2 * MOST_CORNERS ? (uint64_t)length : 0;
    for (uint64_t i = 0; (double)i < length; i++) {
        if (!next_number(walk, walk->properties[property].type, &value)) return false;
        if (property == walk->target.index_property) ply_corner(&list, ply_index(value));
        else if (property == walk->coordinates && i < walk->list_length) walk->list[i] = value;
    }
    if (property == walk->target.index_property) ply_corners_end(&list);
    return true;
}

static bool read_row(struct walk *walk) {
    double value;
    walk->list_length = 0;
    walk->picture = 0;
    for (uint32_t i = 0; i < walk->property_count; i++) {
        if (walk->properties[i].count_type != PLY_NONE) {
            if (!read_list(walk, i)) return false;
        } else {
            if (!next_number(walk, walk->properties[i].type, &value)) return false;
            if (i == walk->number) walk->picture = value;
        }
    }
    return true;
}

/* Polygons are fanned around their first corner. */
static void set_patches(const struct walk *walk, struct patch *patches, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const size_t corners[3] = {0, i + 1, i + 2};
        for (int k = 0; k < 3; k++)
            for (size_t axis = 0; axis < 2; axis++) {
                size_t at = 2 * corners[k] + axis;
                patches[i].at[k][axis] = at < walk->list_length ? (float)walk->list[at] : NAN;
            }
        bool there = walk->picture >= 0 && walk->picture < walk->pictures;
        patches[i].paint = there ? (uint32_t)walk->picture : PAINT_NONE;
    }
}

/* False if the rows do not give the triangles that are there. */
static bool take_lists(struct walk *walk, uint64_t rows, struct patch *patches, size_t count) {
    for (uint64_t i = 0; i < rows; i++) {
        size_t before = walk->counted.count;
        if (!read_row(walk) || walk->counted.count > count) return false;
        set_patches(walk, patches + before, walk->counted.count - before);
    }
    return walk->counted.count == count;
}

/* ---- coordinates of vertices ---- */

static const float *scalar_named(const struct arrays *arrays, const char *name) {
    for (uint32_t i = 0; i < arrays->scalar_count; i++)
        if (strcmp(arrays->scalars[i].name, name) == 0) return arrays->scalars[i].values.data;
    return NULL;
}

static bool take_vertices(const struct arrays *arrays, const struct ply_faces *faces, struct patch *patches) {
    static const char *const NAMES[][2] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
    const float *axes[2] = {NULL, NULL};
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES && !(axes[0] && axes[1]); i++)
        for (int axis = 0; axis < 2; axis++) axes[axis] = scalar_named(arrays, NAMES[i][axis]);
    if (!axes[0] || !axes[1]) return false;
    for (size_t i = 0; i < faces->count; i++) {
        patches[i].paint = 0;
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 2; axis++) patches[i].at[k][axis] = axes[axis][faces->triangles[i][k]];
    }
    return true;
}

/* ---- both ---- */

static struct walk begin_walk(const struct reader *reader, const struct ply_header *header, const struct ply_polygons *polygons) {
    struct walk walk = {.encoding = header->encoding,
                        .p = reader->data + polygons->position,
                        .end = reader->data + reader->size,
                        .properties = header->properties + polygons->element->first_property,
                        .property_count = polygons->element->property_count,
                        .coordinates = NO_PROPERTY,
                        .number = NO_PROPERTY,
                        .pictures = header->texture_count};
    walk.target = (struct ply_target){
        .shape = SHAPE_POLYGON, .index_property = polygons->index_property, .vertex_count = polygons->vertex_count};
    for (uint32_t i = 0; i < walk.property_count; i++) {
        bool is_list = walk.properties[i].count_type != PLY_NONE;
        if (is_list && ply_word_is(walk.properties[i].name, "texcoord")) walk.coordinates = i;
        if (!is_list && ply_word_is(walk.properties[i].name, "texnumber")) walk.number = i;
    }
    return walk;
}

pbr_result ply_paint(struct reader *reader, const struct ply_header *header, const struct ply_polygons *polygons,
                     struct arrays *arrays, const struct ply_faces *faces) {
    struct paint paints[PLY_MOST_TEXTURES] = {0};
    if (!reader->path || header->texture_count == 0 || !polygons->element || faces->count == 0 || arrays->colours.data)
        return PBR_OK;
    struct patch *patches = pbr_allocate(reader->instance, faces->count, sizeof *patches);
    if (!patches) return PBR_ERROR_OUT_OF_MEMORY;
    struct walk walk = begin_walk(reader, header, polygons);
    pbr_result result = PBR_OK;
    bool there = walk.coordinates != NO_PROPERTY ? take_lists(&walk, polygons->rows, patches, faces->count)
                                                 : take_vertices(arrays, faces, patches);
    for (uint32_t i = 0; i < header->texture_count; i++) paints[i].picture = header->textures[i];
    if (there)
        result = paint_vertices(reader, arrays, (const uint32_t(*)[3])faces->triangles, patches, faces->count, paints,
                                header->texture_count);
    else reader_warn(reader, 1, "textures left out: no texture coordinates that can be read");
    pbr_free(reader->instance, patches);
    return result;
}
