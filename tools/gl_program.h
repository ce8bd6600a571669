/* Compiling the small programs of the command's own, for OpenGL 3.3 and OpenGL ES 3.0. SPDX-License-Identifier: MIT */
#ifndef GL_PROGRAM_H
#define GL_PROGRAM_H

#include <epoxy/gl.h>
#include <stdbool.h>

static inline GLuint gl_shader(GLenum stage, const char *text, bool is_es) {
    const char *parts[2] = {is_es ? "#version 300 es\nprecision highp float;\n" : "#version 330\n", text};
    GLuint shader = glCreateShader(stage);
    glShaderSource(shader, 2, parts, NULL);
    glCompileShader(shader);
    return shader;
}

/* 0 if the driver refuses it. The texts come without a version. */
static inline GLuint gl_program(const char *vertex_text, const char *fragment_text, bool is_es) {
    GLuint vertex = gl_shader(GL_VERTEX_SHADER, vertex_text, is_es);
    GLuint fragment = gl_shader(GL_FRAGMENT_SHADER, fragment_text, is_es);
    GLuint program = glCreateProgram();
    GLint linked = 0;
    glAttachShader(program, vertex);
    glAttachShader(program, fragment);
    glLinkProgram(program);
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked) return program;
    glDeleteProgram(program);
    return 0;
}

#endif
