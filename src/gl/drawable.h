/* A buffer of splat records as drawing sees it, wherever the records come from. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_DRAWABLE_H
#define PBR_GL_DRAWABLE_H

#include "context.h"

/* Vertex attribute locations, as in shaders/splat.glsl. */
enum {
    ATTRIBUTE_POSITION_RADIUS = 0,
    ATTRIBUTE_NORMAL = 1,
    ATTRIBUTE_COLOUR = 2,
    ATTRIBUTE_SCALAR = 3,
    ATTRIBUTE_FIELD = 4,
    ATTRIBUTE_ERRORS = 5
};

struct drawable {
    double origin[3];    /* of the records' positions, relative to the item's origin */
    GLuint splats;       /* buffer of struct splat, or */
    bool is_sequence;    /* of struct spt_entry */
    GLuint vertex_array; /* reads `splats`, one vertex a record */
    GLuint *scalars;     /* buffers of float, one for each scalar of the points; NULL, 0 = not uploaded */
    GLuint fields;       /* buffer of struct normal_field; 0 = not uploaded */
};

/* Makes the vertex array for the buffer bound to GL_ARRAY_BUFFER; it is left bound. */
void drawable_make_array(const struct gl *gl, struct drawable *drawable);

/* Points the attributes of the bound vertex array at record `first` of the drawable, whose buffer is bound to GL_ARRAY_BUFFER. */
void drawable_point_at(const struct gl *gl, const struct drawable *drawable, uint32_t first);

#endif
