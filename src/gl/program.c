/* Putting shaders together, compiling and linking them. SPDX-License-Identifier: MIT */
#include "program.h"

#include <pbr/render.h>
#include <stdio.h>
#include <string.h>

#include "selection.h"
#include "sequences.h"
#include "shaders.h"

enum { FILES_MOST = 12, PIECES_MOST = 4 + 2 * FILES_MOST, DEFINES_SIZE = 512 };

static const char *shader_text(const char *name) {
    for (size_t i = 0; i < shader_file_count; i++)
        if (strcmp(shader_files[i].name, name) == 0) return shader_files[i].text;
    return "";
}

static void write_defines(uint32_t variant, char out[DEFINES_SIZE]) {
    static const char *const colours[8] = {"POINTS", "CONSTANT", "SCALAR", "NORMAL", "DEPTH", "PRIMITIVE", "", ""};
    static const char *const kinds[8] = {"CIRCLE", "SQUARE", "ELLIPSE", "GAUSSIAN", "EWA", "EWA_MAX", "SELECT", "TILES"};
    static const char *const passes[4] = {"OPAQUE", "VISIBILITY", "ACCUMULATION", "RESOLVE"};
    static const char *const bits[] = {"QUADS",     "LIT",      "CULL",  "CLIP_PLANES", "ENCODE_SRGB",
                                       "ONE_LIGHT", "DEFERRED", "FIELD", "FILL"};
    int used = snprintf(out, DEFINES_SIZE, "#define COLOUR_%s\n#define %s\n#define PASS_%s\n",
                        colours[variant >> VARIANT_COLOUR_SHIFT & 7], kinds[variant >> VARIANT_KIND_SHIFT & 7],
                        passes[variant >> VARIANT_PASS_SHIFT & 3]);
    used += snprintf(out + used, (size_t)(DEFINES_SIZE - used), "#define PAGE_CHUNKS %d\n", PAGE_CHUNKS);
    if (variant == VARIANT_SELECT)
        used += snprintf(out + used, (size_t)(DEFINES_SIZE - used),
                         "#define SELECT_INVOCATIONS %d\n#define STORAGE_TREE %d\n#define STORAGE_COPIES %d\n"
                         "#define STORAGE_COMMANDS %d\n",
                         SELECT_INVOCATIONS, STORAGE_TREE, STORAGE_COPIES, STORAGE_COMMANDS);
    if (variant & VARIANT_SEQUENCE) used += snprintf(out + used, (size_t)(DEFINES_SIZE - used), "#define SEQUENCE\n");
    if (variant & VARIANT_TRIANGLES) used += snprintf(out + used, (size_t)(DEFINES_SIZE - used), "#define TRIANGLES\n");
    for (size_t i = 0; i < sizeof bits / sizeof *bits; i++)
        if (variant & (uint32_t)VARIANT_QUADS << i)
            used += snprintf(out + used, (size_t)(DEFINES_SIZE - used), "#define %s\n", bits[i]);
}

/* A program in the making. */
struct build {
    pbr_instance *instance;
    const struct gl *gl;
    int32_t level; /* of what is said if the driver refuses it: PBR_LOG_... */
    const char *extension, *defines;
};

static pbr_result log_failure(const struct build *build, const char *what, const char *detail) {
    char line[400];
    size_t n = 0;
    /* The log takes one line. */
    for (; detail[n] && n < sizeof line - 1; n++) line[n] = detail[n] == '\n' || detail[n] == '\r' ? ' ' : detail[n];
    line[n] = '\0';
    return pbr_log(build->instance, build->level, PBR_ERROR_GL, "the driver refuses %s: %s", what, line);
}

static const char *version_line(const struct gl *gl, GLenum stage) {
    if (stage == GL_COMPUTE_SHADER)
        return gl->es ? "#version 310 es\nprecision highp float;\nprecision highp int;\n" : "#version 430\n";
    return gl->es ? "#version 300 es\nprecision highp float;\nprecision highp int;\n" : "#version 330\n";
}

/* files: NULL-terminated names; the #line directives number them in this order, so that a driver's message can be traced. */
static pbr_result compile(const struct build *build, GLenum stage, const char *const *files, GLuint *out) {
    static const char *const lines[FILES_MOST - 1] = {"#line 1 0\n", "#line 1 1\n", "#line 1 2\n", "#line 1 3\n",
                                                      "#line 1 4\n", "#line 1 5\n", "#line 1 6\n", "#line 1 7\n",
                                                      "#line 1 8\n", "#line 1 9\n", "#line 1 10\n"};
    const struct gl *gl = build->gl;
    const char *pieces[PIECES_MOST];
    GLsizei count = 0;
    pieces[count++] = version_line(gl, stage);
    pieces[count++] = stage == GL_VERTEX_SHADER ? build->extension : "";
    pieces[count++] = stage == GL_VERTEX_SHADER ? "#define VERTEX_STAGE\n" : "";
    pieces[count++] = build->defines;
    for (int i = 0; files[i]; i++) {
        pieces[count++] = lines[i];
        pieces[count++] = shader_text(files[i]);
    }
    GLuint shader = (*gl->CreateShader)(stage);
    if (!shader) return log_failure(build, "a shader object", "glCreateShader returned 0");
    (*gl->ShaderSource)(shader, count, pieces, NULL);
    (*gl->CompileShader)(shader);
    GLint ok = 0;
    (*gl->GetShaderiv)(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char detail[400] = "";
        (*gl->GetShaderInfoLog)(shader, sizeof detail, NULL, detail);
        (*gl->DeleteShader)(shader);
        return log_failure(build, files[0], detail);
    }
    *out = shader;
    return PBR_OK;
}

/* second: 0 of a compute program. */
static pbr_result link_program(const struct build *build, GLuint first, GLuint second, GLuint *out) {
    const struct gl *gl = build->gl;
    GLuint name = (*gl->CreateProgram)();
    if (!name) return log_failure(build, "a program object", "glCreateProgram returned 0");
    (*gl->AttachShader)(name, first);
    if (second) (*gl->AttachShader)(name, second);
    (*gl->LinkProgram)(name);
    GLint ok = 0;
    (*gl->GetProgramiv)(name, GL_LINK_STATUS, &ok);
    if (!ok) {
        char detail[400] = "";
        (*gl->GetProgramInfoLog)(name, sizeof detail, NULL, detail);
        (*gl->DeleteProgram)(name);
        return log_failure(build, "to link a program", detail);
    }
    *out = name;
    return PBR_OK;
}

typedef const char *const files_of_stages[FILES_MOST];

/* files: of the vertex and the fragment stage, or of the compute stage. */
static pbr_result build_program(const struct build *build, bool computes, files_of_stages *files, GLuint *out) {
    GLuint shaders[2] = {0, 0};
    pbr_result result = compile(build, computes ? GL_COMPUTE_SHADER : GL_VERTEX_SHADER, files[0], &shaders[0]);
    if (result == PBR_OK && !computes) result = compile(build, GL_FRAGMENT_SHADER, files[1], &shaders[1]);
    if (result == PBR_OK) result = link_program(build, shaders[0], shaders[1], out);
    /* The program keeps what it linked; glDeleteShader ignores 0. */
    for (int i = 0; i < 2; i++) (*build->gl->DeleteShader)(shaders[i]);
    return result;
}

static pbr_result program_create(pbr_instance *instance, const struct gl *gl, uint32_t variant, struct program *program) {
    static const char *const opaque[][FILES_MOST] = {
        {"cut.glsl", "splat.glsl", "encode.glsl", "light.glsl", "colour.glsl", "clip.glsl", "vertex.glsl", "billboard.vert"},
        {"billboard.frag"}};
    static const char *const ellipse[][FILES_MOST] = {{"kernel.h", "cut.glsl", "splat.glsl", "encode.glsl", "light.glsl",
                                                       "colour.glsl", "clip.glsl", "vertex.glsl", "disc.glsl", "ellipse.vert"},
                                                      {"ellipse.frag"}};
    static const char *const mark[][FILES_MOST] = {{"kernel.h", "cut.glsl", "splat.glsl", "encode.glsl", "light.glsl",
                                                    "colour.glsl", "clip.glsl", "vertex.glsl", "layers.glsl", "billboard.vert"},
                                                   {"clear.glsl", "billboard.frag"}};
    static const char *const blended[][FILES_MOST] = {{"kernel.h", "cut.glsl", "splat.glsl", "encode.glsl", "light.glsl",
                                                       "colour.glsl", "clip.glsl", "vertex.glsl", "disc.glsl", "layers.glsl",
                                                       "blended.vert"},
                                                      {"kernel.h", "clear.glsl", "blended.frag"}};
    static const char *const centre[][FILES_MOST] = {
        {"cut.glsl", "splat.glsl", "encode.glsl", "light.glsl", "colour.glsl", "clip.glsl", "vertex.glsl", "centre.vert"},
        {"clear.glsl", "centre.frag"}};
    static const char *const triangles[][FILES_MOST] = {
        {"kernel.h", "cut.glsl", "splat.glsl", "encode.glsl", "light.glsl", "colour.glsl", "clip.glsl", "vertex.glsl", "disc.glsl",
         "layers.glsl", "triangle.vert"},
        {"encode.glsl", "light.glsl", "colour.glsl", "clip.glsl", "clear.glsl", "triangle.frag"}};
    static const char *const resolve[][FILES_MOST] = {{"resolve.vert"}, {"encode.glsl", "light.glsl", "resolve.frag"}};
    static const char *const tiles[][FILES_MOST] = {{"resolve.vert"}, {"tiles.frag"}};
    static const char *const select[][FILES_MOST] = {{"cut.glsl", "select.comp"}};
    static const char *const fill[][FILES_MOST] = {{"resolve.vert"}, {"kernel.h", "encode.glsl", "fill.frag"}};
    static files_of_stages *const passes[PASS_COUNT][2] = {/* screen-parallel kinds, those in space */
                                                           {opaque, ellipse},
                                                           {mark, blended},
                                                           {centre, blended},
                                                           {resolve, resolve}};
    const enum pass pass = variant >> VARIANT_PASS_SHIFT & 3;
    files_of_stages *files = passes[pass][(variant >> VARIANT_KIND_SHIFT & 7) >= PBR_SPLAT_ELLIPSE];
    if (variant & VARIANT_FILL && pass == PASS_ACCUMULATION) files = centre;
    if (variant & VARIANT_FILL && pass == PASS_RESOLVE) files = fill;
    if (variant & VARIANT_TRIANGLES) files = triangles;
    if (variant == VARIANT_TILES) files = tiles;
    char defines[DEFINES_SIZE];
    write_defines(variant, defines);
    const bool computes = variant == VARIANT_SELECT;
    if (computes) files = select;
    /* One call draws the chunks of a page where shaders can tell them apart; where a driver says so and cannot, each takes its own.
     */
    const bool draws_many = gl->has_draw_ids && variant & VARIANT_SEQUENCE && !(variant & VARIANT_QUADS);
    struct build build = {instance, gl, computes || draws_many ? PBR_LOG_WARNING : PBR_LOG_ERROR, "", defines};
    if (draws_many) build.extension = "#extension GL_ARB_shader_draw_parameters : require\n#define MULTI_DRAW\n";
    *program = (struct program){.variant = variant, .draws_many = draws_many};
    pbr_result result = build_program(&build, computes, files, &program->name);
    if (result != PBR_OK && draws_many) {
        build.level = PBR_LOG_ERROR;
        build.extension = "";
        program->draws_many = false;
        result = build_program(&build, computes, files, &program->name);
    }
    if (result != PBR_OK) return result;
    const GLuint name = program->name;
#define U(uniform) program->uniform = (*gl->GetUniformLocation)(name, "u_" #uniform);
    PROGRAM_UNIFORMS(U)
#undef U
    return PBR_OK;
}

pbr_result programs_need(pbr_instance *instance, const struct gl *gl, struct programs *programs, uint32_t variant, uint32_t *index,
                         uint32_t *compiled) {
    /* A frame's items ask for the same few. One that was refused stays in the list: asking again would cost a compilation a frame.
     */
    for (*index = 0; *index < programs->count; ++*index)
        if (programs->entries[*index].variant == variant) return programs->entries[*index].name ? PBR_OK : PBR_ERROR_GL;
    if (programs->count == programs->capacity) {
        const uint32_t capacity = programs->capacity ? 2 * programs->capacity : 16;
        struct program *grown = pbr_reallocate(instance, programs->entries, programs->capacity, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        programs->entries = grown;
        programs->capacity = capacity;
    }
    pbr_result result = program_create(instance, gl, variant, &programs->entries[programs->count++]);
    *compiled += result == PBR_OK;
    return result;
}

void programs_free(pbr_instance *instance, const struct gl *gl, struct programs *programs) {
    for (uint32_t i = 0; gl && i < programs->count; i++)
        if (programs->entries[i].name) (*gl->DeleteProgram)(programs->entries[i].name);
    pbr_free(instance, programs->entries);
    *programs = (struct programs){0};
}
