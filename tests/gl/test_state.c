/* What pbr_render and pbr_prepare leave of the host's OpenGL state, and that the picture does not depend on it.
 *
 * Every piece of state is one function that sets it to an unusual value or back to the default; the whole of it is read before and
 * after each call, and must be the same. SPDX-License-Identifier: MIT */
#include "support.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 48, UNITS = 8, MOST_ENTRIES = 4096 };

/* ---- Objects of the host's that state refers to ---- */

struct objects {
    GLuint program, pipeline, array, buffers[16], samplers[UNITS], textures_2d[UNITS], texture_cube, texture_3d, texture_array,
        buffer_texture;
    GLuint renderbuffer, feedback;
    struct target target, other;
    GLuint second_colour; /* of target */
};

static struct objects things;

static const char simple_vertex[] = "in vec4 position; void main() { gl_Position = position; }";
static const char simple_fragment[] = "out vec4 colour; void main() { colour = vec4(0.25); }";

static void create_textures(void) {
    glGenTextures(UNITS, things.textures_2d);
    glGenSamplers(UNITS, things.samplers);
    for (int i = 0; i < UNITS; i++) {
        glBindTexture(GL_TEXTURE_2D, things.textures_2d[i]);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, 4, 4, 0, GL_RGBA, GL_UNSIGNED_BYTE, NULL);
        glSamplerParameteri(things.samplers[i], GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    }
    glBindTexture(GL_TEXTURE_2D, 0);
    glGenTextures(1, &things.texture_cube);
    glGenTextures(1, &things.texture_3d);
    glGenTextures(1, &things.texture_array);
    glGenTextures(1, &things.buffer_texture);
}

static void create_buffers(void) {
    static const char zeros[4096];
    glGenBuffers(16, things.buffers);
    for (int i = 0; i < 16; i++) {
        glBindBuffer(GL_COPY_WRITE_BUFFER, things.buffers[i]);
        glBufferData(GL_COPY_WRITE_BUFFER, sizeof(zeros), zeros, GL_STATIC_DRAW);
    }
    glBindBuffer(GL_COPY_WRITE_BUFFER, 0);
}

static void create_array(void) {
    glGenVertexArrays(1, &things.array);
    glBindVertexArray(things.array);
    for (GLuint i = 0; i < 4; i++) {
        glBindBuffer(GL_ARRAY_BUFFER, things.buffers[i]);
        glVertexAttribPointer(i, (GLint)i + 1, GL_UNSIGNED_SHORT, GL_TRUE, 40, (const void *)(uintptr_t)(8 * i));
        glVertexAttribDivisor(i, i);
        if (i != 1) glEnableVertexAttribArray(i);
    }
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, things.buffers[4]);
    glBindVertexArray(0);
    glBindBuffer(GL_ARRAY_BUFFER, 0);
}

static void create_objects(int samples) {
    things.program = build_program(simple_vertex, simple_fragment);
    create_textures();
    create_buffers();
    create_array();
    if (context_has(41, 31)) glGenProgramPipelines(1, &things.pipeline);
    if (context_has(40, 30)) glGenTransformFeedbacks(1, &things.feedback);
    glGenRenderbuffers(1, &things.renderbuffer);
    glBindRenderbuffer(GL_RENDERBUFFER, things.renderbuffer);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, 4, 4);
    assert_true(target_create(&things.target, SIZE, SIZE, GL_RGBA8, GL_DEPTH24_STENCIL8, samples));
    assert_true(target_create(&things.other, 16, 16, GL_RGBA8, GL_DEPTH_COMPONENT24, 0));
    glGenRenderbuffers(1, &things.second_colour);
    glBindRenderbuffer(GL_RENDERBUFFER, things.second_colour);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_RGBA8, SIZE, SIZE);
    glBindRenderbuffer(GL_RENDERBUFFER, 0);
    target_bind(&things.target);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_RENDERBUFFER, things.second_colour);
}

static void delete_objects(void) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glDeleteProgram(things.program);
    glDeleteTextures(UNITS, things.textures_2d);
    glDeleteSamplers(UNITS, things.samplers);
    glDeleteTextures(1, &things.texture_cube);
    glDeleteTextures(1, &things.texture_3d);
    glDeleteTextures(1, &things.texture_array);
    glDeleteTextures(1, &things.buffer_texture);
    glDeleteVertexArrays(1, &things.array);
    glDeleteBuffers(16, things.buffers);
    if (things.pipeline) glDeleteProgramPipelines(1, &things.pipeline);
    if (things.feedback) glDeleteTransformFeedbacks(1, &things.feedback);
    glDeleteRenderbuffers(1, &things.renderbuffer);
    glDeleteRenderbuffers(1, &things.second_colour);
    target_destroy(&things.target);
    target_destroy(&things.other);
    memset(&things, 0, sizeof(things));
}

/* ---- Reading all state ---- */

struct entry {
    char name[48];
    bool is_listed; /* among what PBR_RENDERER_KEEP_NO_STATE may leave changed */
    double values[4];
};

struct snapshot {
    size_t count;
    bool is_listed; /* of the entries being added */
    struct entry *entries;
};

static void add(struct snapshot *snapshot, const char *name, int index, const double values[4]) {
    assert_true(snapshot->count < MOST_ENTRIES);
    struct entry *entry = &snapshot->entries[snapshot->count++];
    memset(entry, 0, sizeof(*entry));
    if (index < 0) snprintf(entry->name, sizeof(entry->name), "%s", name);
    else snprintf(entry->name, sizeof(entry->name), "%s[%d]", name, index);
    entry->is_listed = snapshot->is_listed;
    memcpy(entry->values, values, sizeof(entry->values));
}

static void add_integers(struct snapshot *snapshot, const char *name, int index, GLenum pname) {
    GLint v[16] = {0};
    glGetIntegerv(pname, v);
    add(snapshot, name, index, (const double[4]){v[0], v[1], v[2], v[3]});
}

static void add_floats(struct snapshot *snapshot, const char *name, GLenum pname) {
    GLfloat v[16] = {0};
    glGetFloatv(pname, v);
    add(snapshot, name, -1, (const double[4]){(double)v[0], (double)v[1], (double)v[2], (double)v[3]});
}

static void add_enable(struct snapshot *snapshot, const char *name, GLenum capability) {
    add(snapshot, name, -1, (const double[4]){glIsEnabled(capability)});
}

static void add_indexed(struct snapshot *snapshot, const char *name, GLenum pname, int index) {
    GLint v[4] = {0};
    glGetIntegeri_v(pname, (GLuint)index, v);
    add(snapshot, name, index, (const double[4]){v[0], v[1], v[2], v[3]});
}

static void add_indexed_offset(struct snapshot *snapshot, const char *name, GLenum pname, int index) {
    GLint64 v = 0;
    glGetInteger64i_v(pname, (GLuint)index, &v);
    add(snapshot, name, index, (const double[4]){(double)v});
}

#define INTEGERS(pname) add_integers(snapshot, #pname, -1, pname)
#define FLOATS(pname) add_floats(snapshot, #pname, pname)
#define ENABLE(pname) add_enable(snapshot, #pname, pname)
#define INDEXED(pname, i) add_indexed(snapshot, #pname, pname, i)
#define OFFSET(pname, i) add_indexed_offset(snapshot, #pname, pname, i)

static bool has_indexed_blend(void) {
    return context_has(40, 32) || context_has_extension("GL_OES_draw_buffers_indexed");
}
static bool has_indexed_mask(void) {
    return !context_is_es() || has_indexed_blend();
}
static bool has_viewports(void) {
    return context_has(41, 0);
}
static bool has_clip_control(void) {
    return context_has(45, 0) || context_has_extension("GL_EXT_clip_control");
}
static bool has_clip_distances(void) {
    return !context_is_es() || context_has_extension("GL_EXT_clip_cull_distance");
}
static bool has_depth_clamp(void) {
    return !context_is_es() || context_has_extension("GL_EXT_depth_clamp");
}
static bool has_srgb_switch(void) {
    return !context_is_es() || context_has_extension("GL_EXT_sRGB_write_control");
}
static bool has_sample_mask(void) {
    return context_has(32, 31);
}
static bool has_sample_shading(void) {
    return context_has(40, 32);
}

enum { OWN_UNITS = 3, OWN_BUFFERS = 2, OWN_STORAGES = 3 };

static void read_draw_buffer(struct snapshot *snapshot, int i) {
    if (has_indexed_blend()) {
        INDEXED(GL_BLEND_SRC_RGB, i), INDEXED(GL_BLEND_SRC_ALPHA, i), INDEXED(GL_BLEND_DST_RGB, i), INDEXED(GL_BLEND_DST_ALPHA, i);
        INDEXED(GL_BLEND_EQUATION_RGB, i), INDEXED(GL_BLEND_EQUATION_ALPHA, i);
    }
    if (!has_indexed_mask()) return;
    INDEXED(GL_COLOR_WRITEMASK, i);
    add(snapshot, "GL_BLEND", i, (const double[4]){glIsEnabledi(GL_BLEND, (GLuint)i)});
}

/* Of the units that libpbr uses. */
static void read_own_textures(struct snapshot *snapshot) {
    GLint active = 0;
    INTEGERS(GL_ACTIVE_TEXTURE);
    glGetIntegerv(GL_ACTIVE_TEXTURE, &active);
    for (int i = 0; i < OWN_UNITS; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        add_integers(snapshot, "GL_TEXTURE_BINDING_2D", i, GL_TEXTURE_BINDING_2D);
        add_integers(snapshot, "GL_SAMPLER_BINDING", i, GL_SAMPLER_BINDING);
    }
    glActiveTexture((GLenum)active);
}

static void read_storage_buffers(struct snapshot *snapshot, int first, int end) {
    for (int i = first; i < end && context_has(43, 31); i++)
        INDEXED(GL_SHADER_STORAGE_BUFFER_BINDING, i), OFFSET(GL_SHADER_STORAGE_BUFFER_START, i),
            OFFSET(GL_SHADER_STORAGE_BUFFER_SIZE, i);
}

/* What the documentation of PBR_RENDERER_KEEP_NO_STATE lists. */
static void read_listed(struct snapshot *snapshot) {
    INTEGERS(GL_CURRENT_PROGRAM), INTEGERS(GL_VERTEX_ARRAY_BINDING), INTEGERS(GL_ARRAY_BUFFER_BINDING);
    INTEGERS(GL_DRAW_FRAMEBUFFER_BINDING);
    for (int i = 0; i < 4; i++) add_integers(snapshot, "GL_DRAW_BUFFER", i, GL_DRAW_BUFFER0 + (GLenum)i);
    FLOATS(GL_VIEWPORT), INTEGERS(GL_SCISSOR_BOX), ENABLE(GL_SCISSOR_TEST), FLOATS(GL_DEPTH_RANGE);
    ENABLE(GL_DEPTH_TEST), INTEGERS(GL_DEPTH_FUNC), INTEGERS(GL_DEPTH_WRITEMASK), ENABLE(GL_BLEND), INTEGERS(GL_COLOR_WRITEMASK);
    ENABLE(GL_STENCIL_TEST), ENABLE(GL_CULL_FACE), ENABLE(GL_POLYGON_OFFSET_FILL), ENABLE(GL_DITHER), ENABLE(GL_RASTERIZER_DISCARD);
    ENABLE(GL_SAMPLE_ALPHA_TO_COVERAGE), ENABLE(GL_SAMPLE_COVERAGE);
    if (has_depth_clamp()) ENABLE(GL_DEPTH_CLAMP);
    if (has_sample_mask()) ENABLE(GL_SAMPLE_MASK);
    if (has_sample_shading()) ENABLE(GL_SAMPLE_SHADING);
    if (context_has(43, 30)) ENABLE(GL_PRIMITIVE_RESTART_FIXED_INDEX);
    if (has_srgb_switch()) ENABLE(GL_FRAMEBUFFER_SRGB);
    for (GLenum i = 0; i < 8 && has_clip_distances(); i++) add_enable(snapshot, "GL_CLIP_DISTANCE", GL_CLIP_DISTANCE0 + i);
    if (has_clip_control()) INTEGERS(GL_CLIP_ORIGIN), INTEGERS(GL_CLIP_DEPTH_MODE);
    INTEGERS(GL_BLEND_SRC_RGB), INTEGERS(GL_BLEND_SRC_ALPHA), INTEGERS(GL_BLEND_DST_RGB), INTEGERS(GL_BLEND_DST_ALPHA);
    INTEGERS(GL_BLEND_EQUATION_RGB), INTEGERS(GL_BLEND_EQUATION_ALPHA);
    for (int i = 1; i < OWN_BUFFERS; i++) read_draw_buffer(snapshot, i);
    read_own_textures(snapshot);
    INTEGERS(GL_READ_FRAMEBUFFER_BINDING), INTEGERS(GL_READ_BUFFER), INTEGERS(GL_PIXEL_PACK_BUFFER_BINDING);
    INTEGERS(GL_PACK_ALIGNMENT), INTEGERS(GL_PACK_ROW_LENGTH), INTEGERS(GL_PACK_SKIP_ROWS), INTEGERS(GL_PACK_SKIP_PIXELS);
    if (context_has(40, 31)) INTEGERS(GL_DRAW_INDIRECT_BUFFER_BINDING);
    if (context_has(43, 31)) INTEGERS(GL_SHADER_STORAGE_BUFFER_BINDING);
    read_storage_buffers(snapshot, 0, OWN_STORAGES);
    if (context_is_es()) return;
    INTEGERS(GL_PACK_SWAP_BYTES);
    INTEGERS(GL_POLYGON_MODE), ENABLE(GL_POLYGON_OFFSET_LINE), ENABLE(GL_POLYGON_OFFSET_POINT), ENABLE(GL_POLYGON_SMOOTH);
    ENABLE(GL_COLOR_LOGIC_OP), ENABLE(GL_MULTISAMPLE), ENABLE(GL_SAMPLE_ALPHA_TO_ONE);
    ENABLE(GL_PRIMITIVE_RESTART), ENABLE(GL_PROGRAM_POINT_SIZE), FLOATS(GL_POINT_FADE_THRESHOLD_SIZE);
    if (!context_is_compat()) return;
    ENABLE(GL_ALPHA_TEST), ENABLE(GL_POINT_SPRITE), ENABLE(GL_POINT_SMOOTH), ENABLE(GL_POLYGON_STIPPLE),
        ENABLE(GL_VERTEX_PROGRAM_TWO_SIDE);
    INTEGERS(GL_CLAMP_FRAGMENT_COLOR);
}

/* Viewports past the first, and draw buffers past those that libpbr uses. */
static void read_indexed(struct snapshot *snapshot) {
    for (int i = 1; i < 8 && has_viewports(); i++) {
        GLfloat rectangle[4] = {0};
        GLdouble range[2] = {0};
        glGetFloati_v(GL_VIEWPORT, (GLuint)i, rectangle);
        add(snapshot, "GL_VIEWPORT", i,
            (const double[4]){(double)rectangle[0], (double)rectangle[1], (double)rectangle[2], (double)rectangle[3]});
        glGetDoublei_v(GL_DEPTH_RANGE, (GLuint)i, range);
        add(snapshot, "GL_DEPTH_RANGE", i, (const double[4]){range[0], range[1]});
        INDEXED(GL_SCISSOR_BOX, i);
        add(snapshot, "GL_SCISSOR_TEST", i, (const double[4]){glIsEnabledi(GL_SCISSOR_TEST, (GLuint)i)});
    }
    for (int i = OWN_BUFFERS; i < 4; i++) read_draw_buffer(snapshot, i);
}

/* The values of fixed-function state whose switch is listed. */
static void read_values(struct snapshot *snapshot) {
    FLOATS(GL_BLEND_COLOR), INTEGERS(GL_CULL_FACE_MODE), INTEGERS(GL_FRONT_FACE);
    FLOATS(GL_POLYGON_OFFSET_FACTOR), FLOATS(GL_POLYGON_OFFSET_UNITS), FLOATS(GL_SAMPLE_COVERAGE_VALUE),
        INTEGERS(GL_SAMPLE_COVERAGE_INVERT);
    if (context_has(46, 0)) FLOATS(GL_POLYGON_OFFSET_CLAMP);
    if (has_sample_mask()) INDEXED(GL_SAMPLE_MASK_VALUE, 0);
    if (has_sample_shading()) FLOATS(GL_MIN_SAMPLE_SHADING_VALUE);
    if (context_is_es()) return;
    INTEGERS(GL_LOGIC_OP_MODE), INTEGERS(GL_PRIMITIVE_RESTART_INDEX);
    INTEGERS(GL_POINT_SPRITE_COORD_ORIGIN);
    if (context_is_compat()) INTEGERS(GL_ALPHA_TEST_FUNC), FLOATS(GL_ALPHA_TEST_REF);
}

static void read_textures(struct snapshot *snapshot) {
    GLint active = 0;
    glGetIntegerv(GL_ACTIVE_TEXTURE, &active);
    for (int i = 0; i < UNITS; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        if (i >= OWN_UNITS) add_integers(snapshot, "GL_TEXTURE_BINDING_2D", i, GL_TEXTURE_BINDING_2D);
        add_integers(snapshot, "GL_TEXTURE_BINDING_3D", i, GL_TEXTURE_BINDING_3D);
        add_integers(snapshot, "GL_TEXTURE_BINDING_CUBE_MAP", i, GL_TEXTURE_BINDING_CUBE_MAP);
        add_integers(snapshot, "GL_TEXTURE_BINDING_2D_ARRAY", i, GL_TEXTURE_BINDING_2D_ARRAY);
        if (i >= OWN_UNITS) add_integers(snapshot, "GL_SAMPLER_BINDING", i, GL_SAMPLER_BINDING);
        if (context_has(31, 32)) add_integers(snapshot, "GL_TEXTURE_BINDING_BUFFER", i, GL_TEXTURE_BINDING_BUFFER);
        if (!context_is_compat()) continue;
        add(snapshot, "GL_TEXTURE_2D", i, (const double[4]){glIsEnabled(GL_TEXTURE_2D)});
        GLint replace = 0;
        glGetTexEnviv(GL_POINT_SPRITE, GL_COORD_REPLACE, &replace);
        add(snapshot, "GL_COORD_REPLACE", i, (const double[4]){replace});
    }
    glActiveTexture((GLenum)active);
}

static void read_buffers(struct snapshot *snapshot) {
    INTEGERS(GL_PIXEL_UNPACK_BUFFER_BINDING), INTEGERS(GL_UNIFORM_BUFFER_BINDING);
    INTEGERS(GL_COPY_READ_BUFFER_BINDING), INTEGERS(GL_COPY_WRITE_BUFFER_BINDING), INTEGERS(GL_TRANSFORM_FEEDBACK_BUFFER_BINDING);
    if (context_has(43, 31)) INTEGERS(GL_DISPATCH_INDIRECT_BUFFER_BINDING);
    if (context_has(42, 31)) INTEGERS(GL_ATOMIC_COUNTER_BUFFER_BINDING);
    if (context_has(44, 0)) INTEGERS(GL_QUERY_BUFFER_BINDING);
    if (context_has(31, 32)) INTEGERS(GL_TEXTURE_BUFFER_BINDING);
    for (int i = 0; i < 4; i++) {
        INDEXED(GL_UNIFORM_BUFFER_BINDING, i), OFFSET(GL_UNIFORM_BUFFER_START, i), OFFSET(GL_UNIFORM_BUFFER_SIZE, i);
        INDEXED(GL_TRANSFORM_FEEDBACK_BUFFER_BINDING, i), OFFSET(GL_TRANSFORM_FEEDBACK_BUFFER_START, i);
    }
    read_storage_buffers(snapshot, OWN_STORAGES, 4);
    if (context_has(40, 30)) INTEGERS(GL_TRANSFORM_FEEDBACK_BINDING);
}

/* Of the vertex array of the host's, by binding it. */
static void read_array(struct snapshot *snapshot, GLuint array) {
    static const struct {
        const char *name;
        GLenum pname;
    } attributes[] = {{"enabled", GL_VERTEX_ATTRIB_ARRAY_ENABLED},       {"size", GL_VERTEX_ATTRIB_ARRAY_SIZE},
                      {"stride", GL_VERTEX_ATTRIB_ARRAY_STRIDE},         {"type", GL_VERTEX_ATTRIB_ARRAY_TYPE},
                      {"normalised", GL_VERTEX_ATTRIB_ARRAY_NORMALIZED}, {"integer", GL_VERTEX_ATTRIB_ARRAY_INTEGER},
                      {"divisor", GL_VERTEX_ATTRIB_ARRAY_DIVISOR},       {"buffer", GL_VERTEX_ATTRIB_ARRAY_BUFFER_BINDING}};
    GLint bound = 0;
    glGetIntegerv(GL_VERTEX_ARRAY_BINDING, &bound);
    glBindVertexArray(array);
    INTEGERS(GL_ELEMENT_ARRAY_BUFFER_BINDING);
    for (GLuint i = 0; i < 16; i++) {
        void *pointer = NULL;
        for (size_t k = 0; k < sizeof(attributes) / sizeof(attributes[0]); k++) {
            GLint v = 0;
            glGetVertexAttribiv(i, attributes[k].pname, &v);
            add(snapshot, attributes[k].name, (int)i, (const double[4]){v, array});
        }
        glGetVertexAttribPointerv(i, GL_VERTEX_ATTRIB_ARRAY_POINTER, &pointer);
        add(snapshot, "pointer", (int)i, (const double[4]){(double)(uintptr_t)pointer, array});
    }
    glBindVertexArray((GLuint)bound);
}

/* The generic attributes' values: a vertex shader of the host's without an array reads them. */
static void read_current_attributes(struct snapshot *snapshot) {
    for (GLuint i = context_is_compat() ? 1 : 0; i < 16; i++) {
        GLfloat v[4] = {0};
        glGetVertexAttribfv(i, GL_CURRENT_VERTEX_ATTRIB, v);
        add(snapshot, "GL_CURRENT_VERTEX_ATTRIB", (int)i,
            (const double[4]){(double)v[0], (double)v[1], (double)v[2], (double)v[3]});
    }
}

static void read_pixel_store(struct snapshot *snapshot) {
    INTEGERS(GL_UNPACK_ALIGNMENT), INTEGERS(GL_UNPACK_ROW_LENGTH), INTEGERS(GL_UNPACK_SKIP_ROWS), INTEGERS(GL_UNPACK_SKIP_PIXELS);
    INTEGERS(GL_UNPACK_IMAGE_HEIGHT), INTEGERS(GL_UNPACK_SKIP_IMAGES);
    if (context_is_es()) return;
    INTEGERS(GL_UNPACK_SWAP_BYTES), INTEGERS(GL_UNPACK_LSB_FIRST), INTEGERS(GL_PACK_LSB_FIRST);
    INTEGERS(GL_PACK_IMAGE_HEIGHT), INTEGERS(GL_PACK_SKIP_IMAGES);
}

static void read_stencil(struct snapshot *snapshot) {
    INTEGERS(GL_STENCIL_FUNC), INTEGERS(GL_STENCIL_REF), INTEGERS(GL_STENCIL_VALUE_MASK), INTEGERS(GL_STENCIL_WRITEMASK);
    INTEGERS(GL_STENCIL_FAIL), INTEGERS(GL_STENCIL_PASS_DEPTH_FAIL), INTEGERS(GL_STENCIL_PASS_DEPTH_PASS);
    INTEGERS(GL_STENCIL_BACK_FUNC), INTEGERS(GL_STENCIL_BACK_REF), INTEGERS(GL_STENCIL_BACK_VALUE_MASK),
        INTEGERS(GL_STENCIL_BACK_WRITEMASK);
    INTEGERS(GL_STENCIL_BACK_FAIL), INTEGERS(GL_STENCIL_BACK_PASS_DEPTH_FAIL), INTEGERS(GL_STENCIL_BACK_PASS_DEPTH_PASS);
}

static void read_rest(struct snapshot *snapshot) {
    INTEGERS(GL_RENDERBUFFER_BINDING);
    FLOATS(GL_COLOR_CLEAR_VALUE), FLOATS(GL_DEPTH_CLEAR_VALUE), INTEGERS(GL_STENCIL_CLEAR_VALUE), FLOATS(GL_LINE_WIDTH);
    INTEGERS(GL_FRAGMENT_SHADER_DERIVATIVE_HINT);
    if (context_has(41, 31)) INTEGERS(GL_PROGRAM_PIPELINE_BINDING);
    if (context_has(40, 32)) INTEGERS(GL_PATCH_VERTICES);
    if (context_has(43, 32)) ENABLE(GL_DEBUG_OUTPUT), ENABLE(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    if (context_is_es()) return;
    FLOATS(GL_POINT_SIZE), INTEGERS(GL_PROVOKING_VERTEX), ENABLE(GL_LINE_SMOOTH), INTEGERS(GL_CLAMP_READ_COLOR);
    ENABLE(GL_TEXTURE_CUBE_MAP_SEAMLESS);
    if (!context_is_compat()) return;
    ENABLE(GL_LIGHTING), ENABLE(GL_FOG), INTEGERS(GL_SHADE_MODEL);
    INTEGERS(GL_CLAMP_VERTEX_COLOR), INTEGERS(GL_MATRIX_MODE), FLOATS(GL_POINT_DISTANCE_ATTENUATION), FLOATS(GL_POINT_SIZE_MIN);
    FLOATS(GL_POINT_SIZE_MAX), FLOATS(GL_CURRENT_COLOR), INTEGERS(GL_CLIENT_ACTIVE_TEXTURE), INTEGERS(GL_ATTRIB_STACK_DEPTH);
}

static void take_snapshot(struct snapshot *snapshot) {
    if (!snapshot->entries) snapshot->entries = calloc(MOST_ENTRIES, sizeof(*snapshot->entries));
    assert_non_null(snapshot->entries);
    snapshot->count = 0;
    snapshot->is_listed = true;
    read_listed(snapshot);
    snapshot->is_listed = false;
    read_indexed(snapshot);
    read_values(snapshot);
    read_textures(snapshot);
    read_buffers(snapshot);
    read_array(snapshot, things.array);
    if (context_is_es() || context_is_compat()) read_array(snapshot, 0); /* core profiles have no default vertex array */
    read_current_attributes(snapshot);
    read_pixel_store(snapshot);
    read_stencil(snapshot);
    read_rest(snapshot);
    expect_no_gl_error("reading the state");
}

static void expect_same(const struct snapshot *before, const struct snapshot *after, bool listed_too, const char *what) {
    assert_int_equal(before->count, after->count);
    for (size_t i = 0; i < before->count; i++) {
        const struct entry *a = &before->entries[i], *b = &after->entries[i];
        if (a->is_listed && !listed_too) continue;
        for (int k = 0; k < 4; k++)
            if (a->values[k] != b->values[k])
                fail_msg("%s: %s was %g %g %g %g and is %g %g %g %g", what, a->name, a->values[0], a->values[1], a->values[2],
                         a->values[3], b->values[0], b->values[1], b->values[2], b->values[3]);
    }
}

/* ---- Setting state: on = unusual, off = the default ---- */

static void enable(GLenum capability, bool on) {
    if (on) glEnable(capability);
    else glDisable(capability);
}

static bool always(void) {
    return true;
}
static bool on_desktop(void) {
    return !context_is_es();
}
static bool on_compat(void) {
    return context_is_compat();
}
static bool has_43_or_es_30(void) {
    return context_has(43, 30);
}
static bool has_43_or_es_31(void) {
    return context_has(43, 31);
}
static bool has_41_or_es_31(void) {
    return context_has(41, 31);
}

static void set_program(bool on) {
    glUseProgram(on ? things.program : 0);
}
static void set_pipeline(bool on) {
    glBindProgramPipeline(on ? things.pipeline : 0);
}
static void set_array(bool on) {
    glBindVertexArray(on ? things.array : 0);
}

static void set_depth(bool on) {
    enable(GL_DEPTH_TEST, on);
    glDepthFunc(on ? GL_NEVER : GL_LESS);
    glDepthMask(!on);
    if (context_is_es()) glClearDepthf(on ? 0.25f : 1);
    else glClearDepth(on ? 0.25 : 1);
}

static void set_depth_range(bool on) {
    if (context_is_es()) glDepthRangef(on ? 0.75f : 0, on ? 0.5f : 1);
    else glDepthRange(on ? 0.75 : 0, on ? 0.5 : 1);
}

static void set_depth_clamp(bool on) {
    enable(GL_DEPTH_CLAMP, on);
}

static void set_blend(bool on) {
    enable(GL_BLEND, on);
    glBlendFuncSeparate(on ? GL_ZERO : GL_ONE, on ? GL_DST_COLOR : GL_ZERO, on ? GL_CONSTANT_ALPHA : GL_ONE, on ? GL_ONE : GL_ZERO);
    glBlendEquationSeparate(on ? GL_FUNC_REVERSE_SUBTRACT : GL_FUNC_ADD, on ? GL_MIN : GL_FUNC_ADD);
    glBlendColor(on ? 0.1f : 0, on ? 0.2f : 0, 0, 0);
}

static void set_indexed_blend(bool on) {
    for (GLuint i = 0; i < 4; i++) {
        if (on && i % 2 == 0) glEnablei(GL_BLEND, i);
        else glDisablei(GL_BLEND, i);
        glBlendFunci(i, on ? GL_DST_ALPHA : GL_ONE, on ? GL_ONE_MINUS_DST_ALPHA : GL_ZERO);
        glBlendEquationi(i, on ? (i ? GL_MAX : GL_FUNC_SUBTRACT) : GL_FUNC_ADD);
    }
}

static void set_colour_mask(bool on) {
    glColorMask(!on, on ? GL_FALSE : GL_TRUE, GL_TRUE, !on);
}

static void set_indexed_colour_masks(bool on) {
    for (GLuint i = 0; i < 4; i++) glColorMaski(i, !on, !on || i == 1, !on || i == 2, !on);
}

static void set_cull(bool on) {
    enable(GL_CULL_FACE, on);
    glCullFace(on ? GL_FRONT_AND_BACK : GL_BACK);
    glFrontFace(on ? GL_CW : GL_CCW);
}

static void set_polygon_offset(bool on) {
    enable(GL_POLYGON_OFFSET_FILL, on);
    glPolygonOffset(on ? 3 : 0, on ? 100000 : 0);
    if (context_is_es()) return;
    enable(GL_POLYGON_OFFSET_LINE, on);
    enable(GL_POLYGON_OFFSET_POINT, on);
}

static void set_polygon_mode(bool on) {
    glPolygonMode(GL_FRONT_AND_BACK, on ? GL_POINT : GL_FILL);
    if (on && context_is_compat()) glPolygonMode(GL_BACK, GL_LINE); /* elsewhere the two are one */
}

static void set_stencil(bool on) {
    enable(GL_STENCIL_TEST, on);
    glStencilFuncSeparate(GL_FRONT, on ? GL_NEVER : GL_ALWAYS, on ? 3 : 0, on ? 0x1f : 0xff);
    glStencilFuncSeparate(GL_BACK, on ? GL_NEVER : GL_ALWAYS, on ? 5 : 0, on ? 0x2f : 0xff);
    glStencilOpSeparate(GL_FRONT, on ? GL_ZERO : GL_KEEP, on ? GL_REPLACE : GL_KEEP, on ? GL_INCR : GL_KEEP);
    glStencilOpSeparate(GL_BACK, on ? GL_INVERT : GL_KEEP, on ? GL_DECR_WRAP : GL_KEEP, on ? GL_INCR_WRAP : GL_KEEP);
    glStencilMaskSeparate(GL_FRONT, on ? 0x11 : 0xff);
    glStencilMaskSeparate(GL_BACK, on ? 0x22 : 0xff);
    glClearStencil(on ? 7 : 0);
}

static void set_logic_op(bool on) {
    enable(GL_COLOR_LOGIC_OP, on);
    glLogicOp(on ? GL_CLEAR : GL_COPY);
}

static void set_dither(bool on) {
    enable(GL_DITHER, !on);
}

static void set_multisampling(bool on) {
    enable(GL_SAMPLE_ALPHA_TO_COVERAGE, on);
    enable(GL_SAMPLE_COVERAGE, on);
    glSampleCoverage(on ? 0 : 1, GL_FALSE);
    if (context_is_es()) return;
    enable(GL_MULTISAMPLE, !on);
    enable(GL_SAMPLE_ALPHA_TO_ONE, on);
}

static void set_sample_mask(bool on) {
    enable(GL_SAMPLE_MASK, on);
    glSampleMaski(0, on ? 0 : 0xffffffffu);
}

static void set_sample_shading(bool on) {
    enable(GL_SAMPLE_SHADING, on);
    glMinSampleShading(on ? 0.5f : 0);
}

static void set_primitive_restart(bool on) {
    enable(GL_PRIMITIVE_RESTART, on);
    glPrimitiveRestartIndex(on ? 1 : 0);
}

static void set_fixed_restart(bool on) {
    enable(GL_PRIMITIVE_RESTART_FIXED_INDEX, on);
}
static void set_discard(bool on) {
    enable(GL_RASTERIZER_DISCARD, on);
}

static void set_points(bool on) {
    enable(GL_PROGRAM_POINT_SIZE, on);
    glPointSize(on ? 7 : 1);
    glPointParameteri(GL_POINT_SPRITE_COORD_ORIGIN, on ? GL_LOWER_LEFT : GL_UPPER_LEFT);
    glPointParameterf(GL_POINT_FADE_THRESHOLD_SIZE, on ? 30 : 1);
}

static void set_srgb(bool on) {
    enable(GL_FRAMEBUFFER_SRGB, on != context_is_es());
}

static void set_clip_distances(bool on) {
    for (GLenum i = 0; i < 8; i++) enable(GL_CLIP_DISTANCE0 + i, on && i != 3);
}

static void set_clip_control(bool on) {
    if (context_is_es()) glClipControlEXT(on ? GL_UPPER_LEFT : GL_LOWER_LEFT, on ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE);
    else glClipControl(on ? GL_UPPER_LEFT : GL_LOWER_LEFT, on ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE);
}

static void set_viewport(bool on) {
    glViewport(on ? 3 : 0, on ? 5 : 0, on ? 7 : SIZE, on ? 9 : SIZE);
}

static void set_scissor(bool on) {
    enable(GL_SCISSOR_TEST, on);
    glScissor(on ? 1 : 0, on ? 2 : 0, on ? 3 : SIZE, on ? 4 : SIZE);
}

static void set_viewports(bool on) {
    for (GLuint i = 0; i < 8; i++) {
        float x = on ? (float)i : 0;
        glViewportIndexedf(i, x + (on ? 0.5f : 0), 0, SIZE - x, SIZE);
        glScissorIndexed(i, on ? (GLint)i + 1 : 0, 0, SIZE, SIZE);
        glDepthRangeIndexed(i, on ? 0.1 * i : 0, on ? 0.9 : 1);
        if (on && i % 2) glEnablei(GL_SCISSOR_TEST, i);
        else glDisablei(GL_SCISSOR_TEST, i);
    }
}

static void set_textures(bool on) {
    for (int i = 0; i < UNITS; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        glBindTexture(GL_TEXTURE_2D, on ? things.textures_2d[i] : 0);
        glBindTexture(GL_TEXTURE_CUBE_MAP, on ? things.texture_cube : 0);
        glBindTexture(GL_TEXTURE_3D, on ? things.texture_3d : 0);
        glBindTexture(GL_TEXTURE_2D_ARRAY, on ? things.texture_array : 0);
        if (context_has(31, 32)) glBindTexture(GL_TEXTURE_BUFFER, on ? things.buffer_texture : 0);
        glBindSampler((GLuint)i, on ? things.samplers[i] : 0);
    }
    glActiveTexture(on ? GL_TEXTURE5 : GL_TEXTURE0);
}

static void set_buffers(bool on) {
    glBindBuffer(GL_ARRAY_BUFFER, on ? things.buffers[5] : 0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, on ? things.buffers[6] : 0);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, on ? things.buffers[7] : 0);
    for (GLuint i = 0; i < 4; i++) {
        if (on) glBindBufferRange(GL_UNIFORM_BUFFER, i, things.buffers[i], 1024, 256);
        else glBindBufferBase(GL_UNIFORM_BUFFER, i, 0);
    }
    glBindBuffer(GL_UNIFORM_BUFFER, on ? things.buffers[8] : 0);
    glBindBuffer(GL_COPY_READ_BUFFER, on ? things.buffers[9] : 0);
    glBindBuffer(GL_COPY_WRITE_BUFFER, on ? things.buffers[10] : 0);
    if (context_has(40, 31)) glBindBuffer(GL_DRAW_INDIRECT_BUFFER, on ? things.buffers[11] : 0);
    if (context_has(31, 32)) glBindBuffer(GL_TEXTURE_BUFFER, on ? things.buffers[12] : 0);
    if (context_has(44, 0)) glBindBuffer(GL_QUERY_BUFFER, on ? things.buffers[13] : 0);
    if (context_has(42, 31)) glBindBuffer(GL_ATOMIC_COUNTER_BUFFER, on ? things.buffers[14] : 0);
}

static void set_storage_buffers(bool on) {
    for (GLuint i = 0; i < 4; i++) {
        if (on) glBindBufferRange(GL_SHADER_STORAGE_BUFFER, i, things.buffers[i], 512, 128);
        else glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, 0);
    }
    glBindBuffer(GL_SHADER_STORAGE_BUFFER, on ? things.buffers[15] : 0);
    glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, on ? things.buffers[11] : 0);
}

static void set_feedback(bool on) {
    if (context_has(40, 30)) glBindTransformFeedback(GL_TRANSFORM_FEEDBACK, on ? things.feedback : 0);
    if (on) glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, things.buffers[2]);
    else glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, 0);
    glBindBuffer(GL_TRANSFORM_FEEDBACK_BUFFER, on ? things.buffers[3] : 0);
}

static void set_pixel_store(bool on) {
    glPixelStorei(GL_UNPACK_ALIGNMENT, on ? 8 : 4);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, on ? 37 : 0);
    glPixelStorei(GL_UNPACK_SKIP_ROWS, on ? 2 : 0);
    glPixelStorei(GL_UNPACK_SKIP_PIXELS, on ? 3 : 0);
    glPixelStorei(GL_UNPACK_IMAGE_HEIGHT, on ? 41 : 0);
    glPixelStorei(GL_UNPACK_SKIP_IMAGES, on ? 1 : 0);
    glPixelStorei(GL_PACK_ALIGNMENT, on ? 1 : 4);
    glPixelStorei(GL_PACK_ROW_LENGTH, on ? 77 : 0);
    glPixelStorei(GL_PACK_SKIP_ROWS, on ? 2 : 0);
    glPixelStorei(GL_PACK_SKIP_PIXELS, on ? 3 : 0);
    if (context_is_es()) return;
    glPixelStorei(GL_UNPACK_SWAP_BYTES, on);
    glPixelStorei(GL_PACK_SWAP_BYTES, on);
}

static void set_current_attributes(bool on) {
    for (GLuint i = 0; i < 16; i++) glVertexAttrib4f(i, on ? 0.25f * (float)i : 0, on ? 3 : 0, 0, on ? 0.5f : 1);
}

static void set_renderbuffer(bool on) {
    glBindRenderbuffer(GL_RENDERBUFFER, on ? things.renderbuffer : 0);
}
static void set_read_framebuffer(bool on) {
    glBindFramebuffer(GL_READ_FRAMEBUFFER, on ? things.other.framebuffer : things.target.framebuffer);
}

static void set_draw_buffers(bool on) {
    const GLenum both[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glDrawBuffers(on ? 2 : 1, both);
}

static void set_compat(bool on) {
    enable(GL_ALPHA_TEST, on);
    glAlphaFunc(on ? GL_NEVER : GL_ALWAYS, on ? 0.5f : 0);
    enable(GL_POINT_SPRITE, false);
    enable(GL_POINT_SMOOTH, on);
    glClampColor(GL_CLAMP_VERTEX_COLOR, on ? GL_FALSE : GL_TRUE);
    glClampColor(GL_CLAMP_FRAGMENT_COLOR, on ? GL_TRUE : GL_FIXED_ONLY);
    enable(GL_LIGHTING, on);
    enable(GL_FOG, on);
    enable(GL_TEXTURE_2D, on);
    enable(GL_VERTEX_PROGRAM_TWO_SIDE, on);
    enable(GL_POLYGON_STIPPLE, on);
    enable(GL_LINE_SMOOTH, on);
    glShadeModel(on ? GL_FLAT : GL_SMOOTH);
    glMatrixMode(on ? GL_TEXTURE : GL_MODELVIEW);
    glPointParameterf(GL_POINT_SIZE_MAX, on ? 2 : 255);
}

static void set_polygon_smooth(bool on) {
    enable(GL_POLYGON_SMOOTH, on);
    enable(GL_LINE_SMOOTH, on);
    glProvokingVertex(on ? GL_FIRST_VERTEX_CONVENTION : GL_LAST_VERTEX_CONVENTION);
}

static const struct disturbance {
    const char *name;
    bool (*is_available)(void);
    void (*set)(bool on);
} disturbances[] = {
    {"program", always, set_program},
    {"program pipeline", has_41_or_es_31, set_pipeline},
    {"vertex array", always, set_array},
    {"depth", always, set_depth},
    {"depth range", always, set_depth_range},
    {"depth clamp", has_depth_clamp, set_depth_clamp},
    {"blend", always, set_blend},
    {"blend per buffer", has_indexed_blend, set_indexed_blend},
    {"colour mask", always, set_colour_mask},
    {"colour mask per buffer", has_indexed_mask, set_indexed_colour_masks},
    {"cull", always, set_cull},
    {"polygon offset", always, set_polygon_offset},
    {"polygon mode", on_desktop, set_polygon_mode},
    {"polygon smooth", on_desktop, set_polygon_smooth},
    {"stencil", always, set_stencil},
    {"logic op", on_desktop, set_logic_op},
    {"dither", always, set_dither},
    {"multisampling", always, set_multisampling},
    {"sample mask", has_sample_mask, set_sample_mask},
    {"sample shading", has_sample_shading, set_sample_shading},
    {"primitive restart", on_desktop, set_primitive_restart},
    {"fixed primitive restart", has_43_or_es_30, set_fixed_restart},
    {"rasterizer discard", always, set_discard},
    {"points", on_desktop, set_points},
    {"sRGB", has_srgb_switch, set_srgb},
    {"clip distances", has_clip_distances, set_clip_distances},
    {"clip control", has_clip_control, set_clip_control},
    {"viewport", always, set_viewport},
    {"scissor", always, set_scissor},
    {"viewports", has_viewports, set_viewports},
    {"textures and samplers", always, set_textures},
    {"buffers", always, set_buffers},
    {"storage buffers", has_43_or_es_31, set_storage_buffers},
    {"transform feedback", always, set_feedback},
    {"pixel store", always, set_pixel_store},
    {"current attributes", always, set_current_attributes},
    {"renderbuffer", always, set_renderbuffer},
    {"read framebuffer", always, set_read_framebuffer},
    {"draw buffers", always, set_draw_buffers},
    {"compatibility", on_compat, set_compat},
};
enum { DISTURBANCES = sizeof(disturbances) / sizeof(disturbances[0]) };

static void set_all(bool on) {
    for (int i = 0; i < DISTURBANCES; i++)
        if (disturbances[i].is_available()) disturbances[i].set(on);
}

/* ---- Drawing under it ---- */

enum { ITEMS = 15 };

struct scene {
    pbr_points *points;
    pbr_lod *lod, *tree, *mesh;
    pbr_frame frame;
    /* Lit circles, squares through a colour map with clip planes, ellipses, and blended splats of both kinds: both sizes of splats,
     * all inputs of the shaders, all passes; then two that are cuts of a hierarchy, and two of a sequential
     * point tree, and three over a mesh. */
    pbr_item items[ITEMS];
    uint8_t normal[SIZE * SIZE][4], pixels[SIZE * SIZE][4];
    struct snapshot before, after;
};

enum { POINTS = 300 };

/* Of triangles of all sizes between these points, and a hierarchy over it. */
static pbr_lod *create_mesh(struct host *host, float (*positions)[3]) {
    static uint32_t triangles[POINTS][3];
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    pbr_mesh *mesh = NULL;
    pbr_lod *lod = NULL;
    for (uint32_t i = 0; i < POINTS; i++)
        for (uint32_t k = 0; k < 3; k++) triangles[i][k] = (i + k * (1 + i % 5)) % POINTS;
    desc.vertex_count = desc.triangle_count = POINTS;
    desc.positions = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    assert_int_equal(pbr_mesh_create(host->instance, &desc, &mesh), PBR_OK);
    lod_desc.kind = PBR_LOD_POP;
    lod_desc.mesh = mesh;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
    pbr_mesh_release(&mesh);
    return lod;
}

static void create_points(struct host *host, struct scene *scene) {
    float(*positions)[3] = malloc(POINTS * sizeof(*positions)), *radii = malloc(POINTS * sizeof(*radii));
    uint64_t seed = 11;
    assert_non_null(positions);
    assert_non_null(radii);
    for (int i = 0; i < POINTS; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = (float)random_between(&seed, -1, 1);
        radii[i] = (float)random_log(&seed, 0.02, 0.3);
    }
    pbr_scalar scalar = {"height", {positions, sizeof(*positions), PBR_FORMAT_FLOAT32, 1}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = desc.normals = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    assert_int_equal(pbr_points_create(host->instance, &desc, &scene->points), PBR_OK);
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    lod_desc.points = scene->points;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &scene->lod), PBR_OK);
    lod_desc.kind = PBR_LOD_SPT;
    lod_desc.flags = PBR_LOD_NORMAL_FIELDS;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &scene->tree), PBR_OK);
    scene->mesh = create_mesh(host, positions);
    free(positions);
    free(radii);
}

static void draw(struct host *host, struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, things.target.framebuffer);
    render(host, &scene->frame, scene->items, ITEMS);
}

static void clear(void) {
    target_clear(&things.target, (const float[4]){0.2f, 0.1f, 0.3f, 0.5f}, 1);
}

static struct scene *scene_open_with(struct host *host, int samples) {
    static const double planes[4] = {0, 1, 0, 0.4};
    /* Side by side, partly within one another. */
    static const double placements[ITEMS][16] = {
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.4, 0.4, 0, 1},    {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1, 0.1, 0, 1},
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.6, 0.5, 0, 1},     {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.5, -0.6, 0, 1},
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, -0.6, 0, 1},    {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.9, 0, 1},
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.9, 0, 0, 1},      {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.9, -0.1, 0, 1},
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.3, 0.9, 0, 1},    {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.3, -0.3, 0, 1},
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.8, 0.9, 0, 1},     {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.8, -0.9, 0, 1},
        {0.3, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 1},   {0.3, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 0.3, 0, 0.5, 0, 0, 1},
        {0.3, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 0.3, 0, -0.5, 0, 0, 1}};
    static const GLubyte nothing_of_a_polygon[128];
    static const int32_t viewport[4] = {0, 0, SIZE, SIZE};
    pbr_renderer_desc desc = host_renderer_desc();
    struct scene *scene = calloc(1, sizeof(*scene));
    assert_non_null(scene);
    create_objects(samples);
    create_points(host, scene);
    set_all(false);
    if (context_is_compat()) glPolygonStipple(nothing_of_a_polygon);
    desc.point_size_limit = 6; /* some splats are points, some quads */
    host_use_renderer(host, &desc);
    scene->frame = (pbr_frame)PBR_FRAME_INIT;
    matrix_perspective(0.8, 1, 3.4, 4.6,
                       scene->frame.projection); /* some points lie before the near plane, some behind the far one */
    matrix_translation(0, 0, -4, scene->frame.view);
    memcpy(scene->frame.viewport, viewport, sizeof(viewport));
    for (int i = 0; i < ITEMS; i++) {
        scene->items[i] = (pbr_item)PBR_ITEM_INIT;
        scene->items[i].id = (uint64_t)i;
        if (i < ITEMS - 7) scene->items[i].points = scene->points;
        else scene->items[i].lod = i < ITEMS - 5 ? scene->lod : i < ITEMS - 3 ? scene->tree : scene->mesh;
        scene->items[i].transforms = placements[i];
        scene->items[i].transform_count = 1;
    }
    scene->items[2].splat = PBR_SPLAT_ELLIPSE;
    scene->items[3].splat = PBR_SPLAT_GAUSSIAN;
    scene->items[4].splat = PBR_SPLAT_EWA;
    scene->items[4].flags = PBR_ITEM_CULL_BACK_FACES;
    scene->items[5].splat = PBR_SPLAT_EWA;
    scene->items[5].shading = PBR_SHADE_DEFERRED;
    scene->items[6].splat = PBR_SPLAT_ELLIPSE;
    scene->items[6].blending = PBR_BLEND_FILL;
    scene->items[7].splat = PBR_SPLAT_SQUARE;
    scene->items[7].blending = PBR_BLEND_FILL;
    scene->items[9].splat = PBR_SPLAT_GAUSSIAN;
    scene->items[9].flags = PBR_ITEM_CULL_BACK_FACES;
    scene->items[10].splat = PBR_SPLAT_EWA;
    scene->items[10].shading = PBR_SHADE_PHONG_FIELD;
    scene->items[11].splat = PBR_SPLAT_EWA;
    scene->items[13].splat = PBR_SPLAT_GAUSSIAN;
    scene->items[13].shading = PBR_SHADE_DEFERRED;
    scene->items[14].splat = PBR_SPLAT_CIRCLE;
    scene->items[14].blending = PBR_BLEND_FILL;
    scene->items[1].splat = PBR_SPLAT_SQUARE;
    scene->items[1].colour_source = PBR_COLOUR_SCALAR;
    scene->items[1].clip_planes = planes;
    scene->items[1].clip_plane_count = 1;
    scene->items[1].size_minimum = 2;
    clear();
    draw(host, scene);
    target_read(&things.target, scene->normal);
    picture_save("state", (const uint8_t(*)[4])scene->normal, SIZE, SIZE);
    scene->frame.flags |= PBR_FRAME_OCCLUSION; /* saves most, and changes nothing that is seen */
    return scene;
}

static struct scene *scene_open(struct host *host) {
    return scene_open_with(host, 0);
}

static void scene_close(struct scene *scene) {
    set_all(false);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    pbr_points_release(&scene->points);
    pbr_lod_release(&scene->lod);
    pbr_lod_release(&scene->tree);
    pbr_lod_release(&scene->mesh);
    delete_objects();
    free(scene->before.entries);
    free(scene->after.entries);
    free(scene);
}

static void expect_normal_picture(struct scene *scene, const char *what) {
    target_read(&things.target, scene->pixels);
    if (!memcmp(scene->normal, scene->pixels, sizeof(scene->normal))) return;
    picture_save("state_wrong", (const uint8_t(*)[4])scene->pixels, SIZE, SIZE);
    fail_msg("%s: the picture is another", what);
}

static void the_picture_is_not_empty(void **state) {
    struct scene *scene = scene_open(*state);
    int drawn = 0;
    for (int i = 0; i < SIZE * SIZE; i++) drawn += scene->normal[i][3] == 255;
    assert_true(drawn > SIZE * SIZE / 4);
    pbr_stats stats = render(*state, &scene->frame, scene->items, ITEMS);
    assert_true(stats.splats_as_quads > 0); /* both primitives are at work */
    scene_close(scene);
}

/* Evicted first, so that each call uploads too; host buffer bindings must not get in its way. */
static void check_each_state(struct host *host, int samples) {
    struct scene *scene = scene_open_with(host, samples);
    for (int i = 0; i < DISTURBANCES; i++) {
        if (!disturbances[i].is_available()) continue;
        clear();
        pbr_renderer_evict(host->renderer, NULL);
        disturbances[i].set(true);
        take_snapshot(&scene->before);
        render(host, &scene->frame, scene->items, ITEMS);
        render(host, &scene->frame, scene->items, ITEMS); /* reads what the first one left */
        take_snapshot(&scene->after);
        disturbances[i].set(false);
        expect_same(&scene->before, &scene->after, true, disturbances[i].name);
        expect_normal_picture(scene, disturbances[i].name);
    }
    scene_close(scene);
}

static void each_state_is_kept_and_does_not_matter(void **state) {
    check_each_state(*state, 0);
}
static void each_state_is_kept_on_a_multisampled_target(void **state) {
    check_each_state(*state, 4);
}

static void set_up_afresh(struct host *host) {
    pbr_renderer_desc desc = host_renderer_desc();
    desc.point_size_limit = 6;
    host_use_renderer(host, &desc);
}

/* Renderer and view are made, programs compiled and points uploaded under the strange state. */
static void all_states_at_once_are_kept_by_every_call(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    clear();
    set_all(true);
    take_snapshot(&scene->before);
    set_up_afresh(host);
    take_snapshot(&scene->after);
    expect_same(&scene->before, &scene->after, true, "pbr_renderer_create");
    assert_int_equal(pbr_prepare(host->view, &scene->frame, scene->items, ITEMS, NULL), PBR_OK);
    take_snapshot(&scene->after);
    expect_same(&scene->before, &scene->after, true, "pbr_prepare");
    for (int i = 0; i < 2; i++) {
        render(host, &scene->frame, scene->items, ITEMS);
        take_snapshot(&scene->after);
        expect_same(&scene->before, &scene->after, true, "pbr_render");
    }
    pbr_renderer_evict(host->renderer, NULL);
    take_snapshot(&scene->after);
    expect_same(&scene->before, &scene->after, true, "pbr_renderer_evict");
    host_drop_renderer(host);
    take_snapshot(&scene->after);
    expect_same(&scene->before, &scene->after, true, "pbr_renderer_destroy");
    set_all(false);
    expect_normal_picture(scene, "all at once");
    scene_close(scene);
}

static void prepare_draws_nothing(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    uint8_t cleared[4];
    set_up_afresh(host);
    clear();
    pbr_stats stats = PBR_STATS_INIT;
    assert_int_equal(pbr_prepare(host->view, &scene->frame, scene->items, ITEMS, &stats), PBR_OK);
    assert_true(stats.upload_bytes > 0 && stats.programs_compiled > 0);
    target_read(&things.target, scene->pixels);
    memcpy(cleared, scene->pixels[0], 4);
    for (int i = 0; i < SIZE * SIZE; i++) assert_memory_equal(scene->pixels[i], cleared, 4);
    stats = render(host, &scene->frame, scene->items, ITEMS);
    assert_int_equal(stats.upload_bytes, 0);
    assert_int_equal(stats.programs_compiled, 0);
    expect_normal_picture(scene, "after pbr_prepare");
    scene_close(scene);
}

static void errors_keep_all_state_and_draw_nothing(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    static const double singular[16];
    pbr_item good = scene->items[1];
    clear();
    target_read(&things.target, scene->normal);
    for (int i = 0; i < 6; i++) {
        pbr_frame frame = scene->frame;
        scene->items[1] = good;
        if (i == 0) scene->items[1].points = NULL;
        if (i == 1) scene->items[1].splat = 99;
        if (i == 2) scene->items[1].scalar_index = 7;
        if (i == 3) scene->items[1].clip_plane_count = PBR_MAX_CLIP_PLANES + 1;
        if (i == 4) scene->items[1].transforms = singular, scene->items[1].transform_count = 1; /* not affine */
        if (i == 5) frame.viewport[2] = -1;
        set_all(true);
        take_snapshot(&scene->before);
        pbr_result result = pbr_render(host->view, &frame, scene->items, ITEMS, NULL);
        take_snapshot(&scene->after);
        set_all(false);
        assert_true(result == PBR_ERROR_INVALID_ARGUMENT || result == PBR_ERROR_LIMIT);
        expect_same(&scene->before, &scene->after, true, "after an error");
        expect_normal_picture(scene, "after an error");
    }
    scene_close(scene);
}

/* The bound framebuffer is one without attachments, as the window's is here; the target is given by name. */
static void a_framebuffer_given_by_name_is_drawn_to(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    clear();
    scene->frame.target = PBR_TARGET_FRAMEBUFFER;
    scene->frame.framebuffer = things.target.framebuffer;
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, things.other.framebuffer);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
    target_clear(&things.other, (const float[4]){1, 0, 0, 1}, 1);
    take_snapshot(&scene->before);
    render(host, &scene->frame, scene->items, ITEMS);
    take_snapshot(&scene->after);
    expect_same(&scene->before, &scene->after, true, "a framebuffer by name");
    expect_normal_picture(scene, "a framebuffer by name");
    target_read(&things.other, scene->pixels);
    for (int i = 0; i < 16 * 16; i++) assert_memory_equal(scene->pixels[i], ((const uint8_t[4]){255, 0, 0, 255}), 4);
    scene_close(scene);
}

static void a_second_attachment_is_left_alone(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    static const float blue[4] = {0, 0, 1, 0.4f};
    clear();
    set_draw_buffers(true);
    glClearBufferfv(GL_COLOR, 1, blue);
    render(host, &scene->frame, scene->items, ITEMS);
    glReadBuffer(GL_COLOR_ATTACHMENT1);
    target_read(&things.target, scene->pixels);
    glReadBuffer(GL_COLOR_ATTACHMENT0);
    for (int i = 0; i < SIZE * SIZE; i++) assert_memory_equal(scene->pixels[i], ((const uint8_t[4]){0, 0, 255, 102}), 4);
    set_draw_buffers(false);
    expect_normal_picture(scene, "two attachments");
    scene_close(scene);
}

/* A program that the host deleted while it was in use lives as long as it is. */
static void a_deleted_program_stays_in_use(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    GLint current = 0;
    GLuint program = build_program(simple_vertex, simple_fragment);
    glUseProgram(program);
    glDeleteProgram(program);
    clear();
    pbr_result result = pbr_render(host->view, &scene->frame, scene->items, ITEMS, NULL);
    assert_int_equal(result, PBR_OK);
    glGetIntegerv(GL_CURRENT_PROGRAM, &current);
    assert_true(current == 0 || current == (GLint)program);
    glUseProgram(0);
    expect_normal_picture(scene, "a deleted program");
    scene_close(scene);
}

/* Its capture cannot be paused and resumed behind the host's back on every version, so it is refused where it can be seen. */
static void running_transform_feedback_is_refused(void **state) {
    static const char *const captured[] = {"gl_Position"};
    struct host *host = *state;
    if (!context_has(40, 30)) {
        print_message("skipped: OpenGL 3.3 does not tell\n");
        skip();
    }
    struct scene *scene = scene_open(host);
    GLuint program = build_program(simple_vertex, simple_fragment);
    glTransformFeedbackVaryings(program, 1, captured, GL_INTERLEAVED_ATTRIBS);
    glLinkProgram(program);
    clear();
    target_read(&things.target, scene->normal);
    set_feedback(true);
    glUseProgram(program);
    glBeginTransformFeedback(GL_POINTS);
    assert_int_equal(pbr_render(host->view, &scene->frame, scene->items, ITEMS, NULL), PBR_ERROR_INVALID_ARGUMENT);
    expect_no_gl_error("under transform feedback");
    glEndTransformFeedback();
    glUseProgram(0);
    set_feedback(false);
    expect_normal_picture(scene, "under transform feedback");
    glDeleteProgram(program);
    scene_close(scene);
}

static void without_keeping_state_only_what_is_listed_changes(void **state) {
    struct host *host = *state;
    struct scene *scene = scene_open(host);
    pbr_renderer_desc desc = host_renderer_desc();
    desc.point_size_limit = 6;
    desc.flags = PBR_RENDERER_KEEP_NO_STATE;
    for (int i = 0; i < 2; i++) { /* from the default state, and from the strange one */
        host_use_renderer(host, &desc);
        clear();
        set_all(i);
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, things.target.framebuffer);
        for (int frame = 0; frame < 2; frame++) {
            take_snapshot(&scene->before);
            render(host, &scene->frame, scene->items, ITEMS);
            take_snapshot(&scene->after);
            expect_same(&scene->before, &scene->after, false, "keeping no state");
        }
        set_all(false);
        target_bind(&things.target);
        expect_normal_picture(scene, "keeping no state");
    }
    scene_close(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(the_picture_is_not_empty),
        GL_TEST(each_state_is_kept_and_does_not_matter),
        GL_TEST(each_state_is_kept_on_a_multisampled_target),
        GL_TEST(all_states_at_once_are_kept_by_every_call),
        GL_TEST(prepare_draws_nothing),
        GL_TEST(errors_keep_all_state_and_draw_nothing),
        GL_TEST(a_framebuffer_given_by_name_is_drawn_to),
        GL_TEST(a_second_attachment_is_left_alone),
        GL_TEST(a_deleted_program_stays_in_use),
        GL_TEST(running_transform_feedback_is_refused),
        GL_TEST(without_keeping_state_only_what_is_listed_changes),
    };
    return RUN_GL_TESTS("state", tests);
}
