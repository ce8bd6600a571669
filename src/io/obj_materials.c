/* The materials of OBJ files: MTL, a statement a line. SPDX-License-Identifier: MIT */
#include "obj_materials.h"

#include <string.h>

#include "beside.h"
#include "core/colour.h"
#include "text.h"

enum { MOST_MATERIALS = 1024, MOST_BYTES = 1 << 24 };

/* ---- the list ---- */

static bool same(struct ply_word a, struct ply_word b) {
    return a.length == b.length && memcmp(a.text, b.text, a.length) == 0;
}

uint32_t materials_find(const struct materials *materials, struct ply_word name) {
    for (uint32_t i = 0; i < materials->count; i++)
        if (same(materials->list[i].name, name)) return materials->list[i].paint;
    return PAINT_NONE;
}

static pbr_result make_room(struct materials *materials) {
    pbr_instance *instance = materials->reader->instance;
    if (materials->list) return PBR_OK;
    materials->list = pbr_allocate(instance, MOST_MATERIALS, sizeof *materials->list);
    materials->paints = pbr_allocate(instance, MOST_MATERIALS, sizeof *materials->paints);
    return materials->list && materials->paints ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

/* A picture is decoded once, however many materials share it. */
static void add_material(struct materials *materials, struct ply_word name, const struct paint *paint) {
    uint32_t i = 0;
    if (!name.text || materials->count == MOST_MATERIALS) return;
    while (i < materials->paint_count && !(paint->picture.length > 0 && same(materials->paints[i].picture, paint->picture))) i++;
    materials->list[materials->count++] = (struct material){name, i};
    if (i == materials->paint_count) materials->paints[materials->paint_count++] = *paint;
}

/* ---- statements ---- */

/* The rest of a line, without the blanks around it. */
static struct ply_word rest_of_line(const char *p, const char *end) {
    p = text_skip_blanks(p, end);
    while (end > p && is_space(end[-1])) end--;
    return (struct ply_word){p, (size_t)(end - p)};
}

static const char *word_end(const char *p, const char *end) {
    while (p < end && !is_space(*p)) p++;
    return p;
}

/* Options stand before a picture's name: a word with a minus, and words after it that are numbers, on or off, or a letter for a
 * channel. */
static struct ply_word picture_name(const char *p, const char *end) {
    bool option = false;
    for (;;) {
        p = text_skip_blanks(p, end);
        const char *after = word_end(p, end);
        struct ply_word word = {p, (size_t)(after - p)};
        double unused;
        bool begins = p < end && *p == '-';
        bool value = option && (number_parse(p, after, &unused) == after || ply_word_is(word, "on") || ply_word_is(word, "off") ||
                                (word.length == 1 && strchr("rgbmlz", *p)));
        if (p == end || (!begins && !value)) return rest_of_line(p, end);
        option = true;
        p = after;
    }
}

/* Kd holds display values, as the colours of vertices do. */
static void take_colour(const char *p, const char *end, struct paint *paint) {
    double values[3];
    if (text_numbers(&p, end, values, 3) != 3) return;
    for (int k = 0; k < 3; k++) {
        if (!(values[k] >= 0)) return;
        paint->colour[k] = linear_from_srgb(values[k] < 1 ? (float)values[k] : 1);
    }
    paint->has_colour = true;
}

static void read_library(struct materials *materials, const struct source *source) {
    struct reader text = {.data = (const char *)source->data, .size = source->size};
    struct ply_word name = {0};
    struct paint paint = {0};
    text.line_end = text_line_end(&text);
    const char *p = text.data + text_begin(&text), *end = text.data + text.size;
    while (p < end) {
        const char *line_end = text_end_of_line(&text, p, end);
        p = text_skip_blanks(p, line_end);
        const char *after = word_end(p, line_end);
        struct ply_word word = {p, (size_t)(after - p)};
        if (ply_word_is(word, "newmtl")) {
            add_material(materials, name, &paint);
            name = rest_of_line(after, line_end);
            paint = (struct paint){0};
        } else if (ply_word_is(word, "map_Kd")) {
            paint.picture = picture_name(after, line_end);
        } else if (ply_word_is(word, "Kd")) {
            take_colour(after, line_end, &paint);
        }
        p = line_end < end ? line_end + 1 : end;
    }
    add_material(materials, name, &paint);
}

pbr_result materials_add_library(struct materials *materials, struct ply_word name) {
    if (!materials->reader->path || materials->library_count == MATERIALS_MOST_LIBRARIES) return PBR_OK;
    struct source *source = &materials->libraries[materials->library_count];
    pbr_result result = make_room(materials);
    if (result == PBR_OK) result = beside_read(materials->reader, name.text, name.length, MOST_BYTES, source);
    if (result != PBR_OK || !source->data) return result;
    materials->library_count++;
    read_library(materials, source);
    return PBR_OK;
}

void materials_free(struct materials *materials) {
    for (uint32_t i = 0; i < materials->library_count; i++) source_close(&materials->libraries[i]);
    pbr_free(materials->reader->instance, materials->list);
    pbr_free(materials->reader->instance, materials->paints);
}
