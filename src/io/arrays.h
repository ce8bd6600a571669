/* The vertex arrays that a reader fills, and the points or mesh that they make. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_ARRAYS_H
#define PBR_IO_ARRAYS_H

#include "reader.h"

enum { ARRAYS_MOST_BLOCKS = PBR_MAX_SCALARS + 8 };

/* Absent attributes have no data. */
struct arrays {
    pbr_instance *instance;
    uint64_t count; /* vertices */
    pbr_attribute positions, normals, colours, radii;
    pbr_scalar scalars[PBR_MAX_SCALARS]; /* names live as long as the arrays */
    uint32_t scalar_count;
    void *blocks[ARRAYS_MOST_BLOCKS]; /* what the attributes point into */
    uint32_t block_count;
};

/* Allocates `rows` elements of `components` numbers, which live until arrays_free. */
pbr_result arrays_make(struct arrays *arrays, uint64_t rows, uint32_t format, uint32_t components, pbr_attribute *out);

/* The same as the next scalar. */
pbr_result arrays_make_scalar(struct arrays *arrays, uint64_t rows, uint32_t format, const char *name, pbr_attribute *out);

/* Another name for numbers that are there: `components` floats from column `first` of rows of `columns` floats. */
pbr_attribute arrays_columns(const pbr_attribute *rows, uint32_t first, uint32_t components);

/* What three columns of floats can mean. */
enum triple { TRIPLE_NUMBERS, TRIPLE_NORMALS, TRIPLE_COLOURS };
struct triple_range {
    float low, high; /* of the finite numbers; 0, 0 if there are none */
    enum triple kind;
};
/* Normals: all of length 1 to 1/50, zeros aside. Colours: no number is negative or past 65535. */
struct triple_range arrays_triple(const pbr_attribute *triple, uint64_t count);

/* Makes the colours from three columns of floats that lie in 0..1, 0..255 or 0..65535: what the largest of the file says. They are
 * display values: sRGB. NaN gives 0. */
pbr_result arrays_colours(struct arrays *arrays, const pbr_attribute *triple, struct triple_range range);

/* Makes the points, as `desc` says. */
pbr_result arrays_points(const struct arrays *arrays, const pbr_read_desc *desc, pbr_file_content *content);

/* Makes the mesh; every corner is a vertex that is there. Radii become the scalar "radius": a mesh has none. */
pbr_result arrays_mesh(struct arrays *arrays, uint32_t (*triangles)[3], size_t triangle_count, const pbr_read_desc *desc,
                       pbr_file_content *content);

void arrays_free(struct arrays *arrays);

#endif
