/* What blended splats cannot be cheaper than: the plain points of raw_points.h in the two passes, into the targets and with the
 * state that libpbr's gaussian splats need, a depth for each fragment among them, and without everything that makes splats of them.
 * OpenGL only: ES need not blend floats. SPDX-License-Identifier: MIT */
#ifndef TWO_PASSES_H
#define TWO_PASSES_H

#include "raw_points.h"

struct two_passes {
    GLuint programs[2], framebuffers[2], textures[3]; /* front, sums, depth */
};

static inline GLuint two_passes_texture(GLenum internal, GLenum format, GLenum type, int width, int height) {
    GLuint name = 0;
    glGenTextures(1, &name);
    glBindTexture(GL_TEXTURE_2D, name);
    glTexImage2D(GL_TEXTURE_2D, 0, (GLint)internal, width, height, 0, format, type, NULL);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    return name;
}

/* False if the driver refuses; destroy it in either case. Leaves framebuffer 0 bound. */
static inline bool two_passes_create(struct two_passes *two, int width, int height) {
    static const char vertex[] =
        "layout(location = 0) in vec3 position;\nlayout(location = 1) in vec4 colour;\nuniform mat4 matrix;\nuniform float size;\n"
        "flat out vec4 tint;\n"
        "void main() { gl_Position = matrix * vec4(position, 1.0); gl_PointSize = size; tint = colour; }\n";
    static const char *const fragments[2] = {
        "flat in vec4 tint;\nout uvec2 front;\nvoid main() { front = uvec2(floatBitsToUint(tint.x)); gl_FragDepth = "
        "gl_FragCoord.z; }\n",
        "flat in vec4 tint;\nout vec4 sum;\nvoid main() { sum = tint; gl_FragDepth = gl_FragCoord.z; }\n"};
    bool done = true;
    *two =
        (struct two_passes){.textures = {two_passes_texture(GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT, width, height),
                                         two_passes_texture(GL_RGBA32F, GL_RGBA, GL_FLOAT, width, height),
                                         two_passes_texture(GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT, width, height)}};
    glGenFramebuffers(2, two->framebuffers);
    for (int i = 0; i < 2; i++) {
        two->programs[i] = gl_program(vertex, fragments[i], false);
        glBindFramebuffer(GL_FRAMEBUFFER, two->framebuffers[i]);
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, two->textures[i], 0);
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, two->textures[2], 0);
        done = done && two->programs[i] && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    return done;
}

static inline void two_passes_destroy(struct two_passes *two) {
    for (int i = 0; i < 2; i++) glDeleteProgram(two->programs[i]);
    glDeleteFramebuffers(2, two->framebuffers);
    glDeleteTextures(3, two->textures);
    *two = (struct two_passes){0};
}

/* Leaves framebuffer `back` bound. */
static inline void two_passes_draw(const struct two_passes *two, const struct raw_points *raw, const struct camera *camera,
                                   const double model[16], double size, GLuint back) {
    static const GLuint nothing[4] = {0};
    static const GLfloat zero[4] = {0}, far = 1;
    for (int i = 0; i < 2; i++) {
        struct raw_points pass = *raw;
        pass.program = two->programs[i];
        pass.matrix_location = glGetUniformLocation(pass.program, "matrix");
        pass.size_location = glGetUniformLocation(pass.program, "size");
        glBindFramebuffer(GL_FRAMEBUFFER, two->framebuffers[i]);
        glDepthMask(i == 0);
        glDepthFunc(i == 0 ? GL_LESS : GL_LEQUAL);
        if (i == 0) {
            glClearBufferfv(GL_DEPTH, 0, &far);
            glClearBufferuiv(GL_COLOR, 0, nothing);
        } else {
            glClearBufferfv(GL_COLOR, 0, zero);
            glEnable(GL_BLEND);
            glBlendFunc(GL_ONE, GL_ONE);
        }
        raw_points_draw(&pass, camera, model, size, false);
    }
    glDisable(GL_BLEND);
    glDepthFunc(GL_LESS);
    glDepthMask(GL_TRUE);
    glBindFramebuffer(GL_FRAMEBUFFER, back);
}

#endif
