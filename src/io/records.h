/* Points that lie in a file as records of one size, where they are. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_RECORDS_H
#define PBR_IO_RECORDS_H

#include "ply_header.h"

/* A number of each record. Type PLY_NONE: there is none. */
struct record_field {
    size_t at; /* in the record */
    enum ply_type type;
    double scale, offset; /* value = scale * number + offset */
};

/* What the fields of colours hold. */
enum record_colours {
    RECORD_UNORM8,  /* 0..255 after scaling, sRGB */
    RECORD_UNORM16, /* 0..65535 after scaling, sRGB */
    RECORD_LINEAR   /* 0..1, linear */
};

struct records {
    const char *data; /* the first record's, in the reader's bytes */
    size_t size;      /* of a record; 0 only where there is none */
    uint64_t count;   /* whole ones that are there */
    bool big_endian;
    struct record_field position[3], normal[3], colour[3], radius;
    enum record_colours colours;
    uint64_t face_count; /* as declared: faces beside the points */
    char encoding[32];
};

/* Fills what was asked for into `count` elements of the arrays, which may be NULL but for the positions. Numbers are as the
 * formats' whole readers give them. Any thread. */
void records_decode(const struct records *records, uint64_t first, uint64_t count, double *positions, float *normals,
                    uint8_t *colours, float *radii);

#endif
