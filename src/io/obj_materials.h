/* The materials of OBJ files. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_OBJ_MATERIALS_H
#define PBR_IO_OBJ_MATERIALS_H

#include "core/file.h"
#include "paint.h"

enum { MATERIALS_MOST_LIBRARIES = 16 };

struct material {
    struct ply_word name;
    uint32_t paint;
};

struct materials {
    struct reader *reader;
    struct source libraries[MATERIALS_MOST_LIBRARIES]; /* that the names lie in */
    uint32_t library_count;
    struct material *list;
    struct paint *paints; /* one for each picture, and for each material without */
    uint32_t count, paint_count, room;
};

/* Reads an MTL file that lies beside the mesh: newmtl, Kd, map_Kd. What cannot be understood is passed over. */
pbr_result materials_add_library(struct materials *materials, struct ply_word name);

/* The paint of a material, or PAINT_NONE. */
uint32_t materials_find(const struct materials *materials, struct ply_word name);

void materials_free(struct materials *materials);

#endif
