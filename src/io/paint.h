/* Colours of vertices, averaged from what their triangles are painted with. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PAINT_H
#define PBR_IO_PAINT_H

#include "arrays.h"
#include "ply_rows.h"

/* What triangles are painted with: a picture, or where there is none, or it cannot be read, one colour. */
struct paint {
    struct ply_word picture; /* a file's name; empty: none */
    float colour[3];         /* linear */
    bool has_colour;
};

#define PAINT_NONE UINT32_MAX

/* A triangle's part of its picture: (0, 0) is the lower left corner, (1, 1) the upper right one, and it repeats. */
struct patch {
    float at[3][2];
    uint32_t paint; /* or PAINT_NONE */
};

/* Makes the colours of vertices, if any triangle has one: each vertex's is the mean, in linear light, of what its triangles are
 * painted with, weighted with their areas and with the function that is 1 at the vertex and falls to 0 at the opposite side. */
pbr_result paint_vertices(struct reader *reader, struct arrays *arrays, const uint32_t (*triangles)[3], const struct patch *patches,
                          size_t count, const struct paint *paints, uint32_t paint_count);

#endif
