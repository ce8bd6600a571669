/* Putting shaders together, compiling and linking them. SPDX-License-Identifier: MIT */
#include "program.h"

#include <stdio.h>
#include <string.h>

#include "shaders.h"

enum { PIECES_MOST = 8, DEFINES_SIZE = 512 };

static const char *shader_text(const char *name) {
    for (size_t i = 0; i < shader_file_count; i++)
        if (strcmp(shader_files[i].name, name) == 0) return shader_files[i].text;
    return "";
}

static void write_defines(uint32_t variant, char out[DEFINES_SIZE]) {
    static const char *const colours[8] = {"POINTS", "CONSTANT", "SCALAR", "NORMAL", "DEPTH", "", "", ""};
    static const char *const bits[VARIANT_COLOUR_SHIFT] = {"CIRCLE",      "QUADS",       "LIT",      "CULL",
                                                           "CLIP_PLANES", "ENCODE_SRGB", "ONE_LIGHT"};
    int used = snprintf(out, DEFINES_SIZE, "#define COLOUR_%s\n", colours[variant >> VARIANT_COLOUR_SHIFT & 7]);
    for (int i = 0; i < VARIANT_COLOUR_SHIFT; i++)
        if (variant >> i & 1) used += snprintf(out + used, (size_t)(DEFINES_SIZE - used), "#define %s\n", bits[i]);
}

static pbr_result log_failure(pbr_instance *instance, const char *what, const char *detail) {
    char line[400];
    size_t n = 0;
    /* The log takes one line. */
    for (; detail[n] && n < sizeof line - 1; n++) line[n] = detail[n] == '\n' || detail[n] == '\r' ? ' ' : detail[n];
    line[n] = '\0';
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_GL, "the driver refuses %s: %s", what, line);
}

/* files: NULL-terminated names; the #line directives number them in this order, so that a driver's message can be traced. */
static pbr_result compile(pbr_instance *instance, const struct gl *gl, GLenum stage, const char *defines, const char *const *files,
                          GLuint *out) {
    static const char es_header[] = "#version 300 es\nprecision highp float;\nprecision highp int;\n";
    static const char *const lines[] = {"#line 1 0\n", "#line 1 1\n", "#line 1 2\n"};
    const char *pieces[PIECES_MOST];
    GLsizei count = 0;
    pieces[count++] = gl->es ? es_header : "#version 330\n";
    pieces[count++] = defines;
    for (int i = 0; files[i]; i++) {
        pieces[count++] = lines[i];
        pieces[count++] = shader_text(files[i]);
    }
    GLuint shader = (*gl->CreateShader)(stage);
    if (!shader) return log_failure(instance, "a shader object", "glCreateShader returned 0");
    (*gl->ShaderSource)(shader, count, pieces, NULL);
    (*gl->CompileShader)(shader);
    GLint ok = 0;
    (*gl->GetShaderiv)(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char detail[400] = "";
        (*gl->GetShaderInfoLog)(shader, sizeof detail, NULL, detail);
        (*gl->DeleteShader)(shader);
        return log_failure(instance, files[0], detail);
    }
    *out = shader;
    return PBR_OK;
}

static pbr_result link_program(pbr_instance *instance, const struct gl *gl, GLuint vertex, GLuint fragment, GLuint *out) {
    GLuint name = (*gl->CreateProgram)();
    if (!name) return log_failure(instance, "a program object", "glCreateProgram returned 0");
    (*gl->AttachShader)(name, vertex);
    (*gl->AttachShader)(name, fragment);
    (*gl->LinkProgram)(name);
    GLint ok = 0;
    (*gl->GetProgramiv)(name, GL_LINK_STATUS, &ok);
    if (!ok) {
        char detail[400] = "";
        (*gl->GetProgramInfoLog)(name, sizeof detail, NULL, detail);
        (*gl->DeleteProgram)(name);
        return log_failure(instance, "to link a program", detail);
    }
    *out = name;
    return PBR_OK;
}

pbr_result program_create(pbr_instance *instance, const struct gl *gl, uint32_t variant, struct program *program) {
    static const char *const vertex_files[] = {"splat.glsl", "colour.glsl", "opaque.vert", NULL};
    static const char *const fragment_files[] = {"opaque.frag", NULL};
    char defines[DEFINES_SIZE];
    write_defines(variant, defines);
    GLuint vertex = 0, fragment = 0, name = 0;
    pbr_result result = compile(instance, gl, GL_VERTEX_SHADER, defines, vertex_files, &vertex);
    if (result == PBR_OK) result = compile(instance, gl, GL_FRAGMENT_SHADER, defines, fragment_files, &fragment);
    if (result == PBR_OK) result = link_program(instance, gl, vertex, fragment, &name);
    /* The program keeps what it linked; glDeleteShader ignores 0. */
    (*gl->DeleteShader)(vertex);
    (*gl->DeleteShader)(fragment);
    if (result != PBR_OK) return result;
    *program = (struct program){.name = name};
#define U(uniform) program->uniform = (*gl->GetUniformLocation)(name, "u_" #uniform);
    PROGRAM_UNIFORMS(U)
#undef U
    return PBR_OK;
}
