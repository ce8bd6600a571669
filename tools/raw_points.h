/* The baseline that libpbr's frames are measured against: the same points as plain GL_POINTS, in the order of the file, all of one
 * size, with the smallest shader that does it. One draw call, nothing culled, nothing lit. SPDX-License-Identifier: MIT */
#ifndef RAW_POINTS_H
#define RAW_POINTS_H

#include <epoxy/gl.h>
#include <pbr/points.h>
#include <stdlib.h>
#include <string.h>

#include "camera.h"
#include "gl_program.h"

struct raw_points {
    GLuint program, vertex_array, buffers[2]; /* float3 positions relative to `origin`, RGBA8 colours */
    GLint matrix_location, size_location;
    double origin[3]; /* object space */
    uint64_t count;
    double *positions; /* count x 3, object space */
    float *radii;      /* count */
};

static inline bool raw_program(struct raw_points *raw, bool is_es) {
    raw->program = gl_program("layout(location = 0) in vec3 position;\n"
                              "layout(location = 1) in vec4 colour;\n"
                              "uniform mat4 matrix;\n"
                              "uniform float size;\n"
                              "out vec4 tint;\n"
                              "void main() { gl_Position = matrix * vec4(position, 1.0); gl_PointSize = size; tint = colour; }\n",
                              "in vec4 tint;\nout vec4 result;\nvoid main() { result = tint; }\n", is_es);
    if (!raw->program) return false;
    raw->matrix_location = glGetUniformLocation(raw->program, "matrix");
    raw->size_location = glGetUniformLocation(raw->program, "size");
    return true;
}

/* Copies the points' attributes out; the caller frees positions, radii and the two results in any case. */
static inline bool raw_copy(struct raw_points *raw, const pbr_points *points, const pbr_points_info *info, float **offsets,
                            uint8_t (**colours)[4]) {
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    const size_t count = info->count;
    raw->positions = malloc((count + 1) * 3 * sizeof(double));
    raw->radii = calloc(count + 1, sizeof(float));
    *offsets = malloc((count + 1) * 3 * sizeof(float));
    *colours = malloc((count + 1) * 4);
    if (!raw->positions || !raw->radii || !*offsets || !*colours) return false;
    memset(*colours, 231, (count + 1) * 4); /* libpbr's 0.8 grey in sRGB */
    copy.positions = raw->positions;
    copy.radii = info->has_radii ? raw->radii : NULL;
    copy.colours = info->has_colours ? **colours : NULL;
    if (pbr_points_copy(points, 0, count, &copy) != PBR_OK) return false;
    for (size_t i = 0; i < 3 * count; i++) (*offsets)[i] = (float)(raw->positions[i] - raw->origin[i % 3]);
    return true;
}

static inline void raw_points_destroy(struct raw_points *raw) {
    glDeleteProgram(raw->program);
    glDeleteVertexArrays(1, &raw->vertex_array);
    glDeleteBuffers(2, raw->buffers);
    free(raw->positions);
    free(raw->radii);
    *raw = (struct raw_points){0};
}

/* False if memory is short or the shader fails; destroy it in either case. */
static inline bool raw_points_create(struct raw_points *raw, const pbr_points *points, bool is_es) {
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    float *offsets = NULL;
    uint8_t(*colours)[4] = NULL;
    *raw = (struct raw_points){0};
    bool done = pbr_points_get_info(points, &info) == PBR_OK && raw_program(raw, is_es);
    memcpy(raw->origin, info.centre, sizeof raw->origin);
    raw->count = info.count;
    done = done && raw_copy(raw, points, &info, &offsets, &colours);
    if (done) {
        const void *data[2] = {offsets, colours};
        const GLsizeiptr sizes[2] = {(GLsizeiptr)(info.count * 3 * sizeof(float)), (GLsizeiptr)(info.count * 4)};
        glGenVertexArrays(1, &raw->vertex_array);
        glGenBuffers(2, raw->buffers);
        glBindVertexArray(raw->vertex_array);
        for (GLuint i = 0; i < 2; i++) {
            glBindBuffer(GL_ARRAY_BUFFER, raw->buffers[i]);
            glBufferData(GL_ARRAY_BUFFER, sizes[i], data[i], GL_STATIC_DRAW);
            glVertexAttribPointer(i, i == 0 ? 3 : 4, i == 0 ? GL_FLOAT : GL_UNSIGNED_BYTE, i == 1, 0, NULL);
            glEnableVertexAttribArray(i);
        }
        glBindVertexArray(0);
    }
    free(offsets);
    free(colours);
    return done;
}

/* out = a b, column-major. */
static inline void raw_multiply(const double a[16], const double b[16], double out[16]) {
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++) {
            out[4 * c + r] = 0;
            for (int k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
        }
}

/* Mean diameter in pixels, each at least 1, of the points before the camera. `model` is a rotation and translation. */
static inline double raw_points_mean_size(const struct raw_points *raw, const struct camera *camera, const double model[16],
                                          double radius_scale) {
    double to_eye[16], sum = 0;
    uint64_t seen = 0;
    raw_multiply(camera->view, model, to_eye);
    for (uint64_t i = 0; i < raw->count; i++) {
        const double *p = raw->positions + 3 * i;
        double distance = camera->is_parallel ? 1 : -(to_eye[2] * p[0] + to_eye[6] * p[1] + to_eye[10] * p[2] + to_eye[14]);
        if (distance <= 0) continue;
        sum += fmax(1, 2 * radius_scale * raw->radii[i] * camera->pixel_scale / distance);
        seen++;
    }
    return seen ? sum / (double)seen : 1;
}

/* Into the framebuffer that is bound; sets what it needs and leaves it set. Bytes go to the target as they are. */
static inline void raw_points_draw(const struct raw_points *raw, const struct camera *camera, const double model[16], double size,
                                   bool is_es) {
    double to_eye[16], moved[16], to_clip[16];
    float matrix[16];
    raw_multiply(camera->view, model, to_eye);
    memcpy(moved, to_eye, sizeof moved);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) moved[12 + r] += to_eye[4 * c + r] * raw->origin[c];
    raw_multiply(camera->projection, moved, to_clip);
    for (int i = 0; i < 16; i++) matrix[i] = (float)to_clip[i];
    if (!is_es) {
        glDisable(GL_FRAMEBUFFER_SRGB);
        glEnable(GL_PROGRAM_POINT_SIZE);
    }
    glEnable(GL_DEPTH_TEST);
    glUseProgram(raw->program);
    glUniformMatrix4fv(raw->matrix_location, 1, GL_FALSE, matrix);
    glUniform1f(raw->size_location, (float)size);
    glBindVertexArray(raw->vertex_array);
    glDrawArrays(GL_POINTS, 0, (GLsizei)raw->count);
}

#endif
