/* How the vertex stage finds the parts of a splat record. SPDX-License-Identifier: MIT */
#include "drawable.h"

#include "core/splat.h"
#include "lod/spt.h"

/* Codes as they are: shaders decode them. */
static void point_at_entries(const struct gl *gl, uint32_t first) {
    const size_t base = (size_t)first * sizeof(struct spt_entry);
    const GLsizei stride = sizeof(struct spt_entry);
    (*gl->VertexAttribPointer)(ATTRIBUTE_POSITION_RADIUS, 4, GL_UNSIGNED_SHORT, GL_FALSE, stride, (const void *)base);
    (*gl->VertexAttribPointer)(ATTRIBUTE_NORMAL, 2, GL_SHORT, GL_TRUE, stride,
                               (const void *)(base + offsetof(struct spt_entry, normal)));
    (*gl->VertexAttribPointer)(ATTRIBUTE_COLOUR, 4, GL_UNSIGNED_BYTE, GL_FALSE, stride,
                               (const void *)(base + offsetof(struct spt_entry, colour)));
    (*gl->VertexAttribPointer)(ATTRIBUTE_ERRORS, 2, GL_UNSIGNED_SHORT, GL_FALSE, stride,
                               (const void *)(base + offsetof(struct spt_entry, error)));
}

void drawable_point_at(const struct gl *gl, const struct drawable *drawable, uint32_t first) {
    if (drawable->is_sequence) {
        point_at_entries(gl, first);
        return;
    }
    const size_t base = (size_t)first * sizeof(struct splat);
    (*gl->VertexAttribPointer)(ATTRIBUTE_POSITION_RADIUS, 4, GL_FLOAT, GL_FALSE, sizeof(struct splat), (const void *)base);
    (*gl->VertexAttribPointer)(ATTRIBUTE_NORMAL, 2, GL_SHORT, GL_TRUE, sizeof(struct splat),
                               (const void *)(base + offsetof(struct splat, normal)));
    (*gl->VertexAttribPointer)(ATTRIBUTE_COLOUR, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(struct splat),
                               (const void *)(base + offsetof(struct splat, colour)));
}

void drawable_make_array(const struct gl *gl, struct drawable *drawable) {
    (*gl->GenVertexArrays)(1, &drawable->vertex_array);
    (*gl->BindVertexArray)(drawable->vertex_array);
    for (GLuint a = ATTRIBUTE_POSITION_RADIUS; a <= ATTRIBUTE_COLOUR; a++) (*gl->EnableVertexAttribArray)(a);
    if (drawable->is_sequence) (*gl->EnableVertexAttribArray)(ATTRIBUTE_ERRORS);
    drawable_point_at(gl, drawable, 0);
}
