/* Colours of a PLY mesh from its textures. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PLY_PAINT_H
#define PBR_IO_PLY_PAINT_H

#include "arrays.h"
#include "ply_rows.h"

/* The polygons of a mesh, as they were read. */
struct ply_polygons {
    const struct ply_element *element; /* NULL: none */
    uint32_t index_property;
    size_t position; /* of the first row in the file */
    uint64_t rows;   /* whole ones */
    uint64_t vertex_count;
};

/* Makes the colours of vertices from the pictures that the header's comments name, by the polygons' texture coordinates or else the
 * vertices', if there are any. `faces` are the triangles of these polygons and no others. */
pbr_result ply_paint(struct reader *reader, const struct ply_header *header, const struct ply_polygons *polygons,
                     struct arrays *arrays, const struct ply_faces *faces);

#endif
