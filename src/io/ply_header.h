/* The header of a PLY file: which elements with which properties its data holds. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PLY_HEADER_H
#define PBR_IO_PLY_HEADER_H

#include "reader.h"

enum ply_type { PLY_NONE, PLY_INT8, PLY_UINT8, PLY_INT16, PLY_UINT16, PLY_INT32, PLY_UINT32, PLY_FLOAT32, PLY_FLOAT64 };
enum ply_encoding { PLY_UNKNOWN, PLY_ASCII, PLY_LITTLE_ENDIAN, PLY_BIG_ENDIAN };

/* A word of the header, in the file's own bytes. */
struct ply_word {
    const char *text;
    size_t length;
};

struct ply_property {
    struct ply_word name;
    enum ply_type type;       /* of the number, or of a list's numbers */
    enum ply_type count_type; /* PLY_NONE: not a list */
};

struct ply_element {
    struct ply_word name;
    uint64_t count;                          /* as declared: not to be trusted */
    uint32_t first_property, property_count; /* in ply_header.properties */
};

enum { PLY_MOST_TEXTURES = 64 };

struct ply_header {
    enum ply_encoding encoding;
    struct ply_element *elements;
    struct ply_property *properties;
    uint32_t element_count, property_count, element_room, property_room;
    struct ply_word textures[PLY_MOST_TEXTURES]; /* files of pictures, by comments */
    uint32_t texture_count;
    size_t size; /* bytes up to the data */
};

size_t ply_type_size(enum ply_type type);
bool ply_word_is(struct ply_word word, const char *text);

/* Reads the header and sets the reader's line end. The result, whole or not, is freed by ply_header_free. */
pbr_result ply_header_read(struct reader *reader, struct ply_header *out);
void ply_header_free(pbr_instance *instance, struct ply_header *header);

#endif
