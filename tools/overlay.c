/* Drawing into the window. SPDX-License-Identifier: MIT */
#include "overlay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gl_program.h"
#include "utf8.h"

/* One triangle over everything. The window's framebuffer is not sRGB: what the texture decodes is encoded again. */
static const char picture_vertex[] =
    "void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }\n";
static const char picture_fragment[] = "uniform sampler2D picture;\n"
                                       "out vec4 result;\n"
                                       "void main() {\n"
                                       "    vec3 c = texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb;\n"
                                       "    vec3 curve = 1.055 * pow(max(c, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;\n"
                                       "    result = vec4(mix(12.92 * c, curve, vec3(greaterThan(c, vec3(0.0031308)))), 1.0);\n"
                                       "}\n";

static const char quad_vertex[] = "layout(location = 0) in vec2 place;\n"
                                  "layout(location = 1) in vec2 texel;\n"
                                  "layout(location = 2) in vec4 colour;\n"
                                  "uniform vec2 size;\n"
                                  "out vec2 at;\n"
                                  "out vec4 tint;\n"
                                  "void main() {\n"
                                  "    gl_Position = vec4(2.0 * place.x / size.x - 1.0, 1.0 - 2.0 * place.y / size.y, 0.0, 1.0);\n"
                                  "    at = texel;\n"
                                  "    tint = colour;\n"
                                  "}\n";
static const char quad_fragment[] = "uniform sampler2D atlas;\n"
                                    "in vec2 at;\n"
                                    "in vec4 tint;\n"
                                    "out vec4 result;\n"
                                    "void main() { result = vec4(tint.rgb, tint.a * texture(atlas, at).r); }\n";

const char *overlay_create(struct overlay *overlay, bool is_es) {
    *overlay = (struct overlay){0};
    overlay->picture_program = gl_program(picture_vertex, picture_fragment, is_es);
    overlay->quad_program = gl_program(quad_vertex, quad_fragment, is_es);
    if (!overlay->picture_program || !overlay->quad_program) return "the driver refuses the window's shaders";
    overlay->size_location = glGetUniformLocation(overlay->quad_program, "size");
    glGenTextures(1, &overlay->atlas);
    glGenVertexArrays(2, overlay->vertex_arrays);
    glGenBuffers(1, &overlay->buffer);
    glBindVertexArray(overlay->vertex_arrays[1]);
    glBindBuffer(GL_ARRAY_BUFFER, overlay->buffer);
    const GLsizei stride = sizeof(struct overlay_vertex);
    glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, stride, (void *)offsetof(struct overlay_vertex, place));
    glVertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, stride, (void *)offsetof(struct overlay_vertex, texel));
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, stride, (void *)offsetof(struct overlay_vertex, colour));
    for (GLuint i = 0; i < 3; i++) glEnableVertexAttribArray(i);
    glBindVertexArray(0);
    return NULL;
}

void overlay_destroy(struct overlay *overlay) {
    glDeleteProgram(overlay->picture_program);
    glDeleteProgram(overlay->quad_program);
    glDeleteTextures(1, &overlay->atlas);
    glDeleteVertexArrays(2, overlay->vertex_arrays);
    glDeleteBuffers(1, &overlay->buffer);
    font_destroy(&overlay->font);
    free(overlay->vertices);
    *overlay = (struct overlay){0};
}

bool overlay_set_scale(struct overlay *overlay, float scale) {
    enum { ADVANCE = 8 }; /* logical pixels: letters of 13 */
    const int advance = (int)lroundf(fminf(fmaxf(ADVANCE * scale, 4), 64));
    if (overlay->font.atlas && overlay->font.advance == advance) return true;
    font_destroy(&overlay->font);
    if (!font_create(&overlay->font, advance)) return false;
    const GLsizei side = (GLsizei)overlay->font.side;
    glBindTexture(GL_TEXTURE_2D, overlay->atlas);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_R8, side, side, 0, GL_RED, GL_UNSIGNED_BYTE, overlay->font.atlas);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return true;
}

void overlay_begin(struct overlay *overlay, const uint32_t size[2]) {
    memcpy(overlay->size, size, sizeof overlay->size);
    overlay->count = 0;
}

/* Room for one quad more; where memory is short it is left out. */
static struct overlay_vertex *new_quad(struct overlay *overlay) {
    enum { CORNERS = 6 };
    if (overlay->count + CORNERS > overlay->capacity) {
        size_t capacity = overlay->capacity ? 2 * overlay->capacity : 1024 * CORNERS;
        struct overlay_vertex *vertices = realloc(overlay->vertices, capacity * sizeof *vertices);
        if (!vertices) return NULL;
        overlay->vertices = vertices;
        overlay->capacity = capacity;
    }
    overlay->count += CORNERS;
    return overlay->vertices + overlay->count - CORNERS;
}

/* Edges: left, top, right, bottom. */
static void add_quad(struct overlay *overlay, const int place[4], const float texel[4], overlay_colour colour) {
    static const int corners[6][2] = {{0, 1}, {2, 1}, {0, 3}, {0, 3}, {2, 1}, {2, 3}};
    struct overlay_vertex *quad = new_quad(overlay);
    for (int i = 0; quad && i < 6; i++) {
        const int x = corners[i][0], y = corners[i][1];
        quad[i] = (struct overlay_vertex){{(float)place[x], (float)place[y]}, {texel[x], texel[y]}, {0}};
        for (int k = 0; k < 4; k++) quad[i].colour[k] = (uint8_t)(colour >> (24 - 8 * k));
    }
}

void overlay_box(struct overlay *overlay, int x, int y, int width, int height, overlay_colour colour) {
    const float side = (float)overlay->font.side, full = (side - 0.5f) / side; /* the atlas' last row */
    add_quad(overlay, (int[4]){x, y, x + width, y + height}, (float[4]){0.5f / side, full, 0.5f / side, full}, colour);
}

void overlay_text(struct overlay *overlay, int x, int y, overlay_colour colour, const char *text) {
    const struct font *font = &overlay->font;
    const float side = (float)font->side;
    for (uint32_t character; (character = utf8_next(&text)); x += font->advance) {
        const struct font_glyph *g = font_glyph(font, character);
        const int left = x + g->x, top = y + font->ascent + g->y, width = g->right - g->left, height = g->bottom - g->top;
        if (width == 0) continue;
        add_quad(overlay, (int[4]){left, top, left + width, top + height},
                 (float[4]){(float)g->left / side, (float)g->top / side, (float)g->right / side, (float)g->bottom / side}, colour);
    }
}

void overlay_end(struct overlay *overlay, GLuint picture) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glViewport(0, 0, (GLsizei)overlay->size[0], (GLsizei)overlay->size[1]);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    if (epoxy_is_desktop_gl()) glDisable(GL_FRAMEBUFFER_SRGB);
    glActiveTexture(GL_TEXTURE0);
    glBindVertexArray(overlay->vertex_arrays[0]);
    glBindTexture(GL_TEXTURE_2D, picture);
    glUseProgram(overlay->picture_program);
    glDrawArrays(GL_TRIANGLES, 0, 3);

    glEnable(GL_BLEND);
    glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE);
    glBindTexture(GL_TEXTURE_2D, overlay->atlas);
    glUseProgram(overlay->quad_program);
    glBindVertexArray(overlay->vertex_arrays[1]);
    glUniform2f(overlay->size_location, (GLfloat)overlay->size[0], (GLfloat)overlay->size[1]);
    glBindBuffer(GL_ARRAY_BUFFER, overlay->buffer);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(overlay->count * sizeof *overlay->vertices), overlay->vertices, GL_STREAM_DRAW);
    glDrawArrays(GL_TRIANGLES, 0, (GLsizei)overlay->count);
    glDisable(GL_BLEND);
    glBindVertexArray(0);
}
