/* The header of a PLY file (Turk 1994), read as leniently as its data stays unambiguous: any line end, any blanks, comments
 * anywhere. SPDX-License-Identifier: MIT */
#include "ply_header.h"

#include <string.h>

#include "formats.h"
#include "number.h"

static const struct {
    const char *name;
    enum ply_type type;
} TYPES[] = {{"char", PLY_INT8},     {"int8", PLY_INT8},       {"uchar", PLY_UINT8},    {"uint8", PLY_UINT8},
             {"short", PLY_INT16},   {"int16", PLY_INT16},     {"ushort", PLY_UINT16},  {"uint16", PLY_UINT16},
             {"int", PLY_INT32},     {"int32", PLY_INT32},     {"uint", PLY_UINT32},    {"uint32", PLY_UINT32},
             {"float", PLY_FLOAT32}, {"float32", PLY_FLOAT32}, {"double", PLY_FLOAT64}, {"float64", PLY_FLOAT64}};

enum { MOST_WORDS = 5, MOST_ENTRIES = 1 << 30 };

struct line {
    struct ply_word words[MOST_WORDS];
    unsigned count; /* MOST_WORDS: that many or more */
    size_t begin;   /* in the file */
};

size_t ply_type_size(enum ply_type type) {
    static const unsigned char SIZES[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    return SIZES[type];
}

bool ply_word_is(struct ply_word word, const char *text) {
    return word.length == strlen(text) && memcmp(word.text, text, word.length) == 0;
}

bool ply_recognise(const struct reader *reader) {
    return reader->size >= 4 && memcmp(reader->data, "ply", 3) == 0 && is_space(reader->data[3]);
}

/* Splits the line at `*position` and moves past its end; false at the end of the file. A lone \r ends a line; in a file whose first
 * line ends so, a \n after it is data. */
static bool next_line(struct reader *reader, size_t *position, struct line *out) {
    const char *p = reader->data + *position, *end = reader->data + reader->size;
    *out = (struct line){.begin = *position};
    if (p == end) return false;
    while (p < end && *p != '\n' && *p != '\r') {
        if (is_space(*p)) {
            p++;
            continue;
        }
        const char *word = p;
        while (p < end && !is_space(*p)) p++;
        if (out->count < MOST_WORDS) out->words[out->count++] = (struct ply_word){word, (size_t)(p - word)};
    }
    if (p < end && *p++ == '\r' && reader->line_end == '\n' && p < end && *p == '\n') p++;
    *position = (size_t)(p - reader->data);
    return true;
}

static enum ply_type type_named(struct ply_word word) {
    for (size_t i = 0; i < sizeof TYPES / sizeof *TYPES; i++)
        if (ply_word_is(word, TYPES[i].name)) return TYPES[i].type;
    return PLY_NONE;
}

/* Makes room for one more entry. */
static pbr_result reserve(struct reader *reader, void **entries, uint32_t count, uint32_t *room, size_t size) {
    if (count < *room) return PBR_OK;
    if (*room >= MOST_ENTRIES) return PBR_ERROR_LIMIT;
    uint32_t wanted = *room ? *room * 2 : 16;
    void *grown = pbr_reallocate(reader->instance, *entries, *room, wanted, size);
    if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
    *entries = grown;
    *room = wanted;
    return PBR_OK;
}

static pbr_result read_format(struct reader *reader, const struct line *line, struct ply_header *out) {
    struct ply_word word = line->count > 1 ? line->words[1] : (struct ply_word){"", 0};
    out->encoding = ply_word_is(word, "ascii")                  ? PLY_ASCII
                    : ply_word_is(word, "binary_little_endian") ? PLY_LITTLE_ENDIAN
                    : ply_word_is(word, "binary_big_endian")    ? PLY_BIG_ENDIAN
                                                                : PLY_UNKNOWN;
    if (out->encoding == PLY_UNKNOWN)
        return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "unknown encoding '%s'",
                                 reader_excerpt(word.text, word.text + word.length).text);
    if (line->count < 3 || !ply_word_is(line->words[2], "1.0"))
        reader_warn(reader, 1, "the format's version is not 1.0; read as 1.0");
    return PBR_OK;
}

static pbr_result read_element(struct reader *reader, const struct line *line, struct ply_header *out) {
    struct ply_element element = {.first_property = out->property_count};
    if (line->count < 3) return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "an element needs a name and a count");
    element.name = line->words[1];
    const char *text = line->words[2].text, *end = text + line->words[2].length;
    if (number_parse_unsigned(text, end, &element.count) != end)
        return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "'%s' is not a count", reader_excerpt(text, end).text);
    void *entries = out->elements;
    pbr_result result = reserve(reader, &entries, out->element_count, &out->element_room, sizeof *out->elements);
    out->elements = entries;
    if (result == PBR_OK) out->elements[out->element_count++] = element;
    return result;
}

static pbr_result read_property(struct reader *reader, const struct line *line, struct ply_header *out) {
    if (out->element_count == 0) return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "a property before any element");
    bool list = line->count > 1 && ply_word_is(line->words[1], "list");
    unsigned needed = list ? 5 : 3;
    if (line->count < needed) return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "a property needs a type and a name");
    struct ply_property property = {.name = line->words[needed - 1], .type = type_named(line->words[needed - 2])};
    if (list) property.count_type = type_named(line->words[2]);
    for (unsigned i = list ? 2 : 1; i < needed - 1; i++)
        if (type_named(line->words[i]) == PLY_NONE)
            return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "unknown type '%s'",
                                     reader_excerpt(line->words[i].text, line->words[i].text + line->words[i].length).text);
    if (property.count_type >= PLY_FLOAT32)
        return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "the length of a list must be an integer");
    void *entries = out->properties;
    pbr_result result = reserve(reader, &entries, out->property_count, &out->property_room, sizeof *out->properties);
    out->properties = entries;
    if (result != PBR_OK) return result;
    out->properties[out->property_count++] = property;
    out->elements[out->element_count - 1].property_count++;
    return PBR_OK;
}

/* comment TextureFile NAME: the rest of the line, as names may hold blanks. */
static void read_comment(const struct reader *reader, const struct line *line, struct ply_header *out) {
    if (line->count < 3 || !ply_word_is(line->words[1], "TextureFile") || out->texture_count == PLY_MOST_TEXTURES) return;
    const char *begin = line->words[2].text, *end = begin, *file_end = reader->data + reader->size;
    while (end < file_end && *end != '\n' && *end != '\r') end++;
    while (is_space(end[-1])) end--;
    out->textures[out->texture_count++] = (struct ply_word){begin, (size_t)(end - begin)};
}

static pbr_result read_line(struct reader *reader, const struct line *line, struct ply_header *out) {
    struct ply_word keyword = line->words[0];
    if (line->count == 0 || ply_word_is(keyword, "obj_info")) return PBR_OK;
    if (ply_word_is(keyword, "comment")) {
        read_comment(reader, line, out);
        return PBR_OK;
    }
    if (ply_word_is(keyword, "format")) return read_format(reader, line, out);
    if (ply_word_is(keyword, "element")) return read_element(reader, line, out);
    if (ply_word_is(keyword, "property")) return read_property(reader, line, out);
    /* Before the first element no line can change how the data lies; after it one could. */
    if (out->element_count == 0) {
        reader_warn(reader, 1, "header line starting with '%s' ignored",
                    reader_excerpt(keyword.text, keyword.text + keyword.length).text);
        return PBR_OK;
    }
    return reader_error_line(reader, PBR_ERROR_FORMAT, line->begin, "unknown keyword '%s'",
                             reader_excerpt(keyword.text, keyword.text + keyword.length).text);
}

pbr_result ply_header_read(struct reader *reader, struct ply_header *out) {
    *out = (struct ply_header){0};
    const char *first = reader->data, *end = reader->data + reader->size;
    while (first < end && *first != '\n' && *first != '\r') first++;
    bool lone = first < end && *first == '\r' && !(first + 1 < end && first[1] == '\n');
    reader->line_end = lone ? '\r' : '\n';

    struct line line;
    size_t position = 0;
    next_line(reader, &position, &line); /* "ply" */
    for (;;) {
        if (!next_line(reader, &position, &line))
            return reader_error_line(reader, PBR_ERROR_FORMAT, reader->size, "the header has no end_header");
        if (line.count > 0 && ply_word_is(line.words[0], "end_header")) break;
        pbr_result result = read_line(reader, &line, out);
        if (result != PBR_OK) return result;
    }
    if (out->encoding == PLY_UNKNOWN) return reader_error_line(reader, PBR_ERROR_FORMAT, line.begin, "the header has no format");
    out->size = position;
    return PBR_OK;
}

void ply_header_free(pbr_instance *instance, struct ply_header *header) {
    pbr_free(instance, header->elements);
    pbr_free(instance, header->properties);
    *header = (struct ply_header){0};
}
