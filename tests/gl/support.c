/* The GL tests' context, host and targets. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"
#include "gl_names.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- The context ---- */

static struct headless headless;
static atomic_size_t refused;
static unsigned driver_errors;
static char driver_message[512];

enum headless_kind context_kind(void) {
    return headless.kind;
}
bool context_is_es(void) {
    return headless_kind_is_es(headless.kind);
}
bool context_is_compat(void) {
    return headless.kind == HEADLESS_GL_COMPAT;
}

/* Drivers give the newest context that is compatible with what was asked for. These make it the baseline: what later versions
 * brought and drivers also offer to older ones as an extension is switched off, as far as Mesa can; the function lookup hides the
 * rest. */
static const char no_desktop_extensions[] =
    "-GL_ARB_ES2_compatibility -GL_ARB_ES3_compatibility -GL_ARB_ES3_1_compatibility -GL_ARB_ES3_2_compatibility "
    "-GL_ARB_base_instance -GL_ARB_buffer_storage -GL_ARB_clear_texture -GL_ARB_clip_control -GL_ARB_compute_shader "
    "-GL_ARB_copy_image -GL_ARB_cull_distance -GL_ARB_draw_buffers_blend -GL_AMD_draw_buffers_blend -GL_ARB_draw_indirect "
    "-GL_ARB_enhanced_layouts -GL_ARB_explicit_uniform_location -GL_ARB_framebuffer_no_attachments -GL_ARB_gpu_shader5 "
    "-GL_ARB_gpu_shader_fp64 -GL_ARB_indirect_parameters -GL_ARB_internalformat_query -GL_ARB_internalformat_query2 "
    "-GL_ARB_multi_draw_indirect -GL_ARB_polygon_offset_clamp -GL_EXT_polygon_offset_clamp -GL_ARB_query_buffer_object "
    "-GL_ARB_sample_shading -GL_ARB_shader_atomic_counters -GL_ARB_shader_draw_parameters -GL_ARB_shader_image_load_store "
    "-GL_ARB_shader_storage_buffer_object -GL_ARB_shading_language_420pack -GL_ARB_stencil_texturing "
    "-GL_ARB_tessellation_shader -GL_ARB_texture_barrier -GL_ARB_texture_buffer_range "
    "-GL_ARB_texture_view -GL_ARB_transform_feedback2 -GL_ARB_transform_feedback3 "
    "-GL_ARB_transform_feedback_instanced -GL_ARB_vertex_attrib_64bit -GL_ARB_viewport_array -GL_KHR_robustness";
static const char no_es_extensions[] =
    "-GL_EXT_base_instance -GL_EXT_clip_control -GL_EXT_clip_cull_distance -GL_EXT_color_buffer_half_float "
    "-GL_EXT_copy_image -GL_EXT_depth_clamp -GL_EXT_disjoint_timer_query -GL_EXT_draw_buffers_indexed "
    "-GL_OES_draw_buffers_indexed -GL_EXT_draw_elements_base_vertex -GL_OES_draw_elements_base_vertex -GL_EXT_float_blend "
    "-GL_EXT_polygon_offset_clamp -GL_EXT_sRGB_write_control -GL_OES_sample_shading -GL_OES_sample_variables "
    "-GL_OES_shader_multisample_interpolation -GL_KHR_robustness -GL_EXT_robustness";

static bool is_baseline(enum headless_kind kind) {
    return kind != HEADLESS_GL_45 && kind != HEADLESS_ES_32;
}

bool context_has(int desktop, int es) {
    int wanted = context_is_es() ? es : desktop, newest = is_baseline(headless.kind) ? (context_is_es() ? 30 : 33) : 99;
    return wanted && wanted <= newest && epoxy_gl_version() >= wanted;
}

/* Whole names only: some begin like others. */
static bool is_hidden(const char *extension) {
    const char *hidden = context_is_es() ? no_es_extensions : no_desktop_extensions;
    const size_t length = strlen(extension);
    if (!is_baseline(headless.kind) || length == 0) return false;
    for (const char *at = hidden; (at = strstr(at, extension)); at += length)
        if (at[-1] == '-' && (at[length] == ' ' || at[length] == '\0')) return true;
    return false;
}

bool context_has_extension(const char *name) {
    return !is_hidden(name) && epoxy_has_gl_extension(name);
}

/* What a driver that cannot be told says of itself, as the baseline would: its own functions, and these around two of them. */
union get_string {
    const GLubyte *(GLAPIENTRY *function)(GLenum);
    void *pointer;
};
union get_string_at {
    const GLubyte *(GLAPIENTRY *function)(GLenum, GLuint);
    void *pointer;
};
static union get_string get_string;
static union get_string_at get_string_at;

static const GLubyte *GLAPIENTRY baseline_string(GLenum name) {
    const GLubyte *string = get_string.function(name);
    return string && name == GL_VERSION ? (const GLubyte *)(context_is_es() ? "OpenGL ES 3.0" : "3.3") : string;
}

static const GLubyte *GLAPIENTRY baseline_string_at(GLenum name, GLuint index) {
    const GLubyte *string = get_string_at.function(name, index);
    return string && name == GL_EXTENSIONS && is_hidden((const char *)string) ? (const GLubyte *)"" : string;
}

static void *baseline_function(const char *name) {
    if (!strcmp(name, "glGetString") && (get_string.pointer = headless_get_proc(NULL, name)))
        return (union get_string){baseline_string}.pointer;
    if (!strcmp(name, "glGetStringi") && (get_string_at.pointer = headless_get_proc(NULL, name)))
        return (union get_string_at){baseline_string_at}.pointer;
    return headless_get_proc(NULL, name);
}

static const char *open_context(void) {
    const char *text = getenv("PBR_TEST_GL");
    enum headless_kind kind;
    if (!headless_kind_parse(text && *text ? text : "4.5", &kind)) return "PBR_TEST_GL is none of 3.3, 4.5, compat, es3.0, es3.2";
    if (is_baseline(kind)) {
        setenv("MESA_GL_VERSION_OVERRIDE", "3.3", 1);
        setenv("MESA_GLES_VERSION_OVERRIDE", "3.0", 1);
        setenv("MESA_EXTENSION_OVERRIDE", headless_kind_is_es(kind) ? no_es_extensions : no_desktop_extensions, 1);
    }
    return headless_create(&headless, kind, !is_baseline(kind));
}

static int compare_names(const void *key, const void *element) {
    return strcmp(key, *(const char *const *)element);
}

#define HAS(names, name) bsearch(name, names, sizeof(names) / sizeof(names[0]), sizeof(names[0]), compare_names)

void *context_get_proc(void *user, const char *name) {
    bool allowed = !is_baseline(headless.kind) || (context_is_es()       ? HAS(es_30_names, name)
                                                   : context_is_compat() ? HAS(compatibility_33_names, name)
                                                                         : HAS(core_33_names, name));
    if (allowed) return is_baseline(headless.kind) ? baseline_function(name) : headless_get_proc(user, name);
    refused++;
    return NULL;
}

size_t context_refused_count(void) {
    return refused;
}

static void APIENTRY on_driver_message(GLenum source, GLenum type, GLuint id, GLenum severity, GLsizei length, const GLchar *text,
                                       const void *user) {
    (void)source, (void)id, (void)length, (void)user;
    if (type != GL_DEBUG_TYPE_ERROR && severity != GL_DEBUG_SEVERITY_HIGH) return;
    driver_errors++;
    snprintf(driver_message, sizeof(driver_message), "%s", text);
}

void context_release(void) {
    headless_release_current(&headless);
}
void context_restore(void) {
    assert_true(headless_make_current(&headless));
}

void context_forget_errors(void) {
    while (glGetError()) continue;
    driver_errors = 0;
}

void expect_no_gl_error(const char *where) {
    GLenum error = glGetError();
    if (error) fail_msg("%s: OpenGL error 0x%04x (%s)", where, error, driver_message);
    if (driver_errors) fail_msg("%s: the driver reports: %s", where, driver_message);
}

int run_gl_tests(const char *name, const struct CMUnitTest *tests, size_t count) {
    const char *error = open_context();
    if (error) {
        printf("skipped: %s\n", error);
        return 77;
    }
    if (context_has(43, 32)) {
        glEnable(GL_DEBUG_OUTPUT);
        glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
        glDebugMessageCallback(on_driver_message, NULL);
    }
    printf("%s on %s\n", headless_kind_name(headless.kind), (const char *)glGetString(GL_VERSION));
    int failed = _cmocka_run_group_tests(name, tests, count, NULL, NULL);
    headless_destroy(&headless);
    return failed;
}

/* ---- The host ---- */

static void *allocate(void *user, size_t size, size_t alignment) {
    struct memory *memory = user;
    void *block = NULL;
    size_t number = ++memory->allocations;
    if (memory->fail_first && number >= memory->fail_first && number <= memory->fail_last) return NULL;
    if (posix_memalign(&block, alignment < sizeof(void *) ? sizeof(void *) : alignment, size)) return NULL;
    memory->blocks++;
    return block;
}

static void release(void *user, void *block) {
    struct memory *memory = user;
    memory->blocks--;
    free(block);
}

static void on_log(void *user, int32_t level, pbr_result code, const char *text) {
    struct host *host = user;
    (void)code;
    if (level == PBR_LOG_ERROR) host->errors++;
    snprintf(host->log, sizeof(host->log), "%s", text);
}

pbr_instance_desc host_instance_desc(struct host *host) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    desc.allocate = allocate;
    desc.release = release;
    desc.memory_user = &host->memory;
    desc.log = on_log;
    desc.log_user = host;
    desc.thread_count = 1;
    return desc;
}

pbr_renderer_desc host_renderer_desc(void) {
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    desc.get_proc_address = context_get_proc;
    return desc;
}

void host_drop_renderer(struct host *host) {
    pbr_view_destroy(&host->view);
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_OK);
}

void host_use_renderer(struct host *host, const pbr_renderer_desc *desc) {
    host_drop_renderer(host);
    if (pbr_renderer_create(host->instance, desc, &host->renderer) != PBR_OK) fail_msg("no renderer: %s", host->log);
    assert_int_equal(pbr_view_create(host->renderer, NULL, &host->view), PBR_OK);
}

void host_use_quads(struct host *host) {
    pbr_renderer_desc desc = host_renderer_desc();
    desc.point_size_limit = 0.5f;
    host_use_renderer(host, &desc);
}

void host_use_threads(struct host *host, uint32_t count) {
    pbr_instance_desc instance_desc = host_instance_desc(host);
    const pbr_renderer_desc renderer_desc = host_renderer_desc();
    instance_desc.thread_count = count;
    host_drop_renderer(host);
    assert_int_equal(pbr_instance_destroy(&host->instance), PBR_OK);
    assert_int_equal(pbr_instance_create(&instance_desc, &host->instance), PBR_OK);
    host_use_renderer(host, &renderer_desc);
}

int host_setup(void **state) {
    struct host *host = calloc(1, sizeof(*host));
    if (!host) return -1;
    *state = host;
    driver_errors = 0;
    driver_message[0] = '\0';
    pbr_instance_desc instance_desc = host_instance_desc(host);
    pbr_renderer_desc renderer_desc = host_renderer_desc();
    assert_int_equal(pbr_instance_create(&instance_desc, &host->instance), PBR_OK);
    host_use_renderer(host, &renderer_desc);
    return 0;
}

int host_teardown(void **state) {
    struct host *host = *state;
    host_drop_renderer(host);
    assert_int_equal(pbr_instance_destroy(&host->instance), PBR_OK);
    assert_int_equal(host->memory.blocks, 0);
    expect_no_gl_error("after the test");
    free(host);
    return 0;
}

pbr_stats render(struct host *host, const pbr_frame *frame, const pbr_item *items, size_t count) {
    pbr_stats stats = PBR_STATS_INIT;
    pbr_result result = pbr_render(host->view, frame, items, count, &stats);
    if (result != PBR_OK) fail_msg("pbr_render: %s: %s", pbr_result_name(result), host->log);
    expect_no_gl_error("pbr_render");
    return stats;
}

pbr_points *one_point(struct host *host, const double position[3], float radius) {
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 1;
    desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radius = radius;
    if (pbr_points_create(host->instance, &desc, &points) != PBR_OK) fail_msg("no points: %s", host->log);
    return points;
}

pbr_item plain_item(const pbr_points *points, uint32_t splat) {
    pbr_item item = PBR_ITEM_INIT;
    item.id = 1;
    item.points = points;
    item.splat = splat;
    item.shading = PBR_SHADE_NONE;
    item.colour_source = PBR_COLOUR_CONSTANT;
    for (int k = 0; k < 4; k++) item.colour[k] = 1;
    return item;
}

pbr_item lod_item(const pbr_lod *lod, uint32_t splat) {
    pbr_item item = PBR_ITEM_INIT;
    item.id = 1;
    item.lod = lod;
    item.splat = splat;
    return item;
}

/* ---- Targets ---- */

bool target_create(struct target *target, int width, int height, GLenum colour_format, GLenum depth_format, int samples) {
    GLint framebuffer = 0;
    *target = (struct target){0, 0, 0, colour_format, depth_format, width, height, samples};
    glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &framebuffer);
    glGenFramebuffers(1, &target->framebuffer);
    glGenRenderbuffers(1, &target->colour);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    glBindRenderbuffer(GL_RENDERBUFFER, target->colour);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, colour_format, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target->colour);
    GLenum attachment = depth_format == GL_DEPTH24_STENCIL8 ? GL_DEPTH_STENCIL_ATTACHMENT : GL_DEPTH_ATTACHMENT;
    if (depth_format && samples) {
        glGenRenderbuffers(1, &target->depth);
        glBindRenderbuffer(GL_RENDERBUFFER, target->depth);
        glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, depth_format, width, height);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, target->depth);
    } else if (depth_format) {
        bool has_stencil = depth_format == GL_DEPTH24_STENCIL8;
        GLenum layout = has_stencil ? GL_DEPTH_STENCIL : GL_DEPTH_COMPONENT;
        GLenum type = depth_format == GL_DEPTH_COMPONENT32F ? GL_FLOAT : has_stencil ? GL_UNSIGNED_INT_24_8 : GL_UNSIGNED_INT;
        glGenTextures(1, &target->depth);
        glBindTexture(GL_TEXTURE_2D, target->depth);
        glTexImage2D(GL_TEXTURE_2D, 0, (GLint)depth_format, width, height, 0, layout, type, NULL);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
        glFramebufferTexture2D(GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, target->depth, 0);
        glBindTexture(GL_TEXTURE_2D, 0);
    }
    glBindRenderbuffer(GL_RENDERBUFFER, 0);
    bool complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    if (!complete) {
        context_forget_errors(); /* formats that the context does not know */
        target_destroy(target);
        glBindFramebuffer(GL_FRAMEBUFFER, (GLuint)framebuffer);
    }
    return complete;
}

void target_destroy(struct target *target) {
    glDeleteFramebuffers(1, &target->framebuffer);
    glDeleteRenderbuffers(1, &target->colour);
    if (target->depth && target->samples) glDeleteRenderbuffers(1, &target->depth);
    else if (target->depth) glDeleteTextures(1, &target->depth);
    memset(target, 0, sizeof(*target));
}

void target_bind(const struct target *target) {
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
}

void target_open(struct target *target, int size) {
    assert_true(target_create(target, size, size, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(target);
}

void target_close(struct target *target) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(target);
}

/* Draw and read framebuffers are put back: the host under test may have bound others. */
static void save_framebuffers(GLint saved[2]) {
    glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &saved[0]);
    glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &saved[1]);
}

static void restore_framebuffers(const GLint saved[2]) {
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, (GLuint)saved[0]);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, (GLuint)saved[1]);
}

void target_clear(const struct target *target, const float rgba[4], float depth) {
    GLint saved[2];
    save_framebuffers(saved);
    target_bind(target);
    glClearBufferfv(GL_COLOR, 0, rgba);
    if (target->depth_format == GL_DEPTH24_STENCIL8) glClearBufferfi(GL_DEPTH_STENCIL, 0, depth, 0);
    else if (target->depth_format) glClearBufferfv(GL_DEPTH, 0, &depth);
    restore_framebuffers(saved);
}

static void read_pixels(const struct target *target, GLenum type, void *out) {
    GLint saved[2];
    struct target single = {0};
    save_framebuffers(saved);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->framebuffer);
    if (target->samples) {
        assert_true(target_create(&single, target->width, target->height, target->colour_format, 0, 0));
        glBindFramebuffer(GL_READ_FRAMEBUFFER, target->framebuffer);
        glBlitFramebuffer(0, 0, target->width, target->height, 0, 0, target->width, target->height, GL_COLOR_BUFFER_BIT,
                          GL_NEAREST);
        glBindFramebuffer(GL_READ_FRAMEBUFFER, single.framebuffer);
    }
    glReadPixels(0, 0, target->width, target->height, GL_RGBA, type, out);
    if (target->samples) target_destroy(&single);
    restore_framebuffers(saved);
}

void target_read(const struct target *target, uint8_t (*rgba)[4]) {
    read_pixels(target, GL_UNSIGNED_BYTE, rgba);
}
void target_read_float(const struct target *target, float (*rgba)[4]) {
    read_pixels(target, GL_FLOAT, rgba);
}

pbr_stats draw_picture(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *items, size_t count,
                       uint8_t (*rgba)[4]) {
    target_clear(target, (const float[4]){0, 0, 0, 0}, frame->flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
    const pbr_stats stats = render(host, frame, items, count);
    target_read(target, rgba);
    return stats;
}

int covered_pixels(uint8_t (*rgba)[4], int count) {
    int covered = 0;
    for (int i = 0; i < count; i++) covered += rgba[i][3] > 0;
    return covered;
}

static GLuint compile(GLenum stage, const char *text) {
    GLint ok = 0;
    char log[512] = "";
    const char *parts[] = {
        context_is_es() ? "#version 300 es\nprecision highp float; precision highp sampler2D;\n" : "#version 330\n", text};
    GLuint shader = glCreateShader(stage);
    glShaderSource(shader, 2, parts, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    glGetShaderInfoLog(shader, sizeof(log), NULL, log);
    if (!ok) fail_msg("the test's own shader: %s", log);
    return shader;
}

GLuint build_program(const char *vertex, const char *fragment) {
    GLuint program = glCreateProgram(), stages[2] = {compile(GL_VERTEX_SHADER, vertex), compile(GL_FRAGMENT_SHADER, fragment)};
    for (int i = 0; i < 2; i++) {
        glAttachShader(program, stages[i]);
        glDeleteShader(stages[i]);
    }
    glLinkProgram(program);
    return program;
}

static const char quad_vertex[] =
    "uniform float depth; void main() { gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0,"
    " depth * 2.0 - 1.0, 1.0); }";

/* One triangle over the whole viewport with a program's uniforms set; program and vertex array are put back. */
static void draw_everywhere(GLuint program) {
    GLint saved_array = 0;
    GLuint array = 0;
    glGetIntegerv(GL_VERTEX_ARRAY_BINDING, &saved_array);
    glGenVertexArrays(1, &array);
    glBindVertexArray(array);
    glUseProgram(program);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray((GLuint)saved_array);
    glDeleteVertexArrays(1, &array);
}

void target_read_depth(const struct target *target, float *depth) {
    GLint saved[2], saved_program = 0, viewport[4];
    struct target bits;
    size_t pixels = (size_t)target->width * (size_t)target->height;
    uint32_t(*rgba)[4] = malloc(pixels * sizeof(*rgba));
    assert_non_null(rgba);
    save_framebuffers(saved);
    glGetIntegerv(GL_CURRENT_PROGRAM, &saved_program);
    glGetIntegerv(GL_VIEWPORT, viewport);
    assert_true(target_create(&bits, target->width, target->height, GL_RGBA32UI, 0, 0));
    GLuint program = build_program(quad_vertex, "uniform sampler2D map; out highp uvec4 bits; void main() {"
                                                " bits = uvec4(floatBitsToUint(texelFetch(map, ivec2(gl_FragCoord.xy), 0).r)); }");
    glUseProgram(program);
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D, target->depth);
    glViewport(0, 0, target->width, target->height);
    GLboolean tested = glIsEnabled(GL_DEPTH_TEST);
    glDisable(GL_DEPTH_TEST);
    draw_everywhere(program);
    if (tested) glEnable(GL_DEPTH_TEST);
    glReadPixels(0, 0, target->width, target->height, GL_RGBA_INTEGER, GL_UNSIGNED_INT, rgba);
    for (size_t i = 0; i < pixels; i++) memcpy(&depth[i], &rgba[i][0], sizeof(float));
    glBindTexture(GL_TEXTURE_2D, 0);
    glUseProgram((GLuint)saved_program);
    glDeleteProgram(program);
    glViewport(viewport[0], viewport[1], viewport[2], viewport[3]);
    target_destroy(&bits);
    restore_framebuffers(saved);
    free(rgba);
}

void draw_host_quad(float depth, const float rgba[4]) {
    GLint saved_program = 0;
    GLuint program = build_program(quad_vertex, "uniform vec4 colour; out vec4 result; void main() { result = colour; }");
    glGetIntegerv(GL_CURRENT_PROGRAM, &saved_program);
    glUseProgram(program);
    glUniform1f(glGetUniformLocation(program, "depth"), depth);
    glUniform4fv(glGetUniformLocation(program, "colour"), 1, rgba);
    draw_everywhere(program);
    glUseProgram((GLuint)saved_program);
    glDeleteProgram(program);
}

void picture_save(const char *name, const uint8_t (*rgba)[4], int width, int height) {
    const char *folder = getenv("PBR_TEST_OUT");
    char path[512];
    png_image image = {
        .version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height, .format = PNG_FORMAT_RGBA};
    if (!folder || !*folder) return;
    snprintf(path, sizeof(path), "%s/%s-%s.png", folder, name, headless_kind_name(headless.kind));
    png_image_write_to_file(&image, path, 0, rgba, -4 * width, NULL); /* bottom row first */
}

/* ---- Matrices ---- */

void matrix_scaling(double x, double y, double z, double m[16]) {
    memset(m, 0, 16 * sizeof(double));
    m[0] = x, m[5] = y, m[10] = z, m[15] = 1;
}

void matrix_identity(double m[16]) {
    matrix_scaling(1, 1, 1, m);
}

void matrix_translation(double x, double y, double z, double m[16]) {
    matrix_identity(m);
    m[12] = x, m[13] = y, m[14] = z;
}

/* Rodrigues' formula. */
void matrix_rotation(const double axis[3], double radians, double m[16]) {
    double length = length3(axis), a[3] = {axis[0] / length, axis[1] / length, axis[2] / length};
    double c = cos(radians), s = sin(radians);
    matrix_identity(m);
    for (int column = 0; column < 3; column++)
        for (int row = 0; row < 3; row++) m[4 * column + row] = (1 - c) * a[row] * a[column] + (row == column ? c : 0);
    m[1] += s * a[2], m[2] -= s * a[1], m[4] -= s * a[2], m[6] += s * a[0], m[8] += s * a[1], m[9] -= s * a[0];
}

void matrix_frustum(double left, double right, double bottom, double top, double near, double far, double m[16]) {
    memset(m, 0, 16 * sizeof(double));
    m[0] = 2 * near / (right - left);
    m[5] = 2 * near / (top - bottom);
    m[8] = (right + left) / (right - left);
    m[9] = (top + bottom) / (top - bottom);
    m[10] = -(far + near) / (far - near);
    m[11] = -1;
    m[14] = -2 * far * near / (far - near);
}

void matrix_perspective(double field_of_view, double aspect, double near, double far, double m[16]) {
    double top = near * tan(field_of_view / 2);
    matrix_frustum(-top * aspect, top * aspect, -top, top, near, far, m);
}

void matrix_ortho(double left, double right, double bottom, double top, double near, double far, double m[16]) {
    matrix_scaling(2 / (right - left), 2 / (top - bottom), -2 / (far - near), m);
    m[12] = -(right + left) / (right - left);
    m[13] = -(top + bottom) / (top - bottom);
    m[14] = -(far + near) / (far - near);
}

void matrix_zero_to_one(double projection[16], bool reversed) {
    for (int c = 0; c < 4; c++) {
        double z = projection[4 * c + 2], w = projection[4 * c + 3];
        projection[4 * c + 2] = reversed ? (w - z) / 2 : (w + z) / 2;
    }
}

/* Gauss-Jordan with pivoting by rows. */
bool matrix_invert(const double m[16], double out[16]) {
    double a[4][8];
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 8; c++) a[r][c] = c < 4 ? m[4 * c + r] : (c - 4 == r ? 1 : 0);
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int r = k + 1; r < 4; r++)
            if (fabs(a[r][k]) > fabs(a[pivot][k])) pivot = r;
        if (a[pivot][k] == 0) return false;
        for (int c = 0; c < 8; c++) {
            double swap = a[k][c];
            a[k][c] = a[pivot][c];
            a[pivot][c] = swap;
        }
        double scale = 1 / a[k][k];
        for (int c = 0; c < 8; c++) a[k][c] *= scale;
        for (int r = 0; r < 4; r++) {
            double factor = a[r][k];
            for (int c = 0; c < 8 && r != k; c++) a[r][c] -= factor * a[k][c];
        }
    }
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) out[4 * c + r] = a[r][4 + c];
    return true;
}

void matrix_apply(const double m[16], const double v[4], double out[4]) {
    for (int r = 0; r < 4; r++) out[r] = m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r] * v[3];
}

/* ---- Placing ---- */

static bool all_zero(const double *v, int count) {
    for (int i = 0; i < count; i++)
        if (v[i] != 0) return false;
    return true;
}

struct placed place(const pbr_frame *frame, const pbr_item *item, const double *model, const double position[3], double radius) {
    double view[16], world_to_eye[16], eye[4], clip[4], ndc[3];
    matrix_identity(view);
    if (!all_zero(frame->view, 16)) memcpy(view, frame->view, sizeof(view));
    memcpy(world_to_eye, view, sizeof(view));
    if (model) matrix_multiply(view, model, world_to_eye);
    const double p[4] = {position[0], position[1], position[2], 1};
    matrix_apply(world_to_eye, p, eye);
    matrix_apply(frame->projection, eye, clip);
    for (int k = 0; k < 3; k++) ndc[k] = clip[k] / clip[3];

    bool zero_to_one = frame->flags & PBR_FRAME_CLIP_ZERO_TO_ONE;
    double up = frame->flags & PBR_FRAME_CLIP_UPPER_LEFT ? -1 : 1, depth = zero_to_one ? ndc[2] : (ndc[2] + 1) / 2;
    double near = frame->depth_range[0], far = frame->depth_range[1];
    if (near == 0 && far == 0) far = 1;
    double scale = item->radius_scale != 0 ? (double)item->radius_scale : 1;
    struct placed out = {
        .x = frame->viewport[0] + (ndc[0] + 1) / 2 * frame->viewport[2] + frame->jitter[0],
        .y = frame->viewport[1] + (up * ndc[1] + 1) / 2 * frame->viewport[3] + frame->jitter[1],
        .depth = near + depth * (far - near),
        .size = 2 * radius * scale * matrix_largest_stretch(world_to_eye) * fabs(frame->projection[5]) * frame->viewport[3] / 2 /
                clip[3],
        .is_drawn = clip[3] > 0 && depth >= 0 && depth <= 1,
    };
    const double least = 1; /* always covers a pixel centre */
    out.size = fmax(out.size, item->size_minimum > 0 ? (double)item->size_minimum : least);
    if (item->size_maximum > 0) out.size = fmin(out.size, (double)item->size_maximum);
    return out;
}

double edge_distance(const struct placed *splat, uint32_t kind, int x, int y) {
    double dx = x + 0.5 - splat->x, dy = y + 0.5 - splat->y;
    const double square = fmax(fabs(dx), fabs(dy)) - splat->size / 2, disc = hypot(dx, dy) - fmax(splat->size / 2, sqrt(0.5));
    return kind == PBR_SPLAT_SQUARE ? square : fmax(square, disc);
}

/* ---- Cameras ---- */

pbr_frame turned_frame(double radians, double distance, double near, double far, int size) {
    static const double axis[3] = {0.3, 1, 0.2};
    pbr_frame frame = PBR_FRAME_INIT;
    frame.flags = PBR_FRAME_WAIT;
    matrix_perspective(0.9, 1, near, far, frame.projection);
    matrix_rotation(axis, 0.7 + radians, frame.view);
    frame.view[14] = -distance;
    frame_set_viewport(&frame, 0, 0, size, size);
    return frame;
}

void frame_set_viewport(pbr_frame *frame, int x, int y, int width, int height) {
    const int32_t viewport[4] = {x, y, width, height};
    memcpy(frame->viewport, viewport, sizeof(viewport));
}

void make_cameras(struct camera cameras[CAMERAS]) {
    static const char *const names[CAMERAS] = {"perspective",       "orthographic", "off-centre",      "flipped y",
                                               "upper-left clip",   "scaled view",  "stretched model", "mirrored model",
                                               "viewport offset",   "jitter",       "infinite far",    "clip 0..1",
                                               "reversed clip 1..0"};
    static const double axis[3] = {1, 2, 3};
    double a[16], b[16], c[16];
    for (int i = 0; i < CAMERAS; i++) {
        cameras[i].name = names[i];
        cameras[i].frame = (pbr_frame)PBR_FRAME_INIT;
        frame_set_viewport(&cameras[i].frame, 0, 0, PICTURE_WIDTH, PICTURE_HEIGHT);
        matrix_perspective(0.9, (double)PICTURE_WIDTH / PICTURE_HEIGHT, 1, 100, cameras[i].frame.projection);
        matrix_identity(cameras[i].model);
    }
    matrix_ortho(-6, 6, -5, 5, -10, 50, cameras[1].frame.projection);
    matrix_frustum(-0.1 * PICTURE_WIDTH / PICTURE_HEIGHT, 0.8 * PICTURE_WIDTH / PICTURE_HEIGHT, -0.7, 0.2, 1, 100,
                   cameras[2].frame.projection);
    cameras[3].frame.projection[5] *= -1;
    cameras[4].frame.flags = PBR_FRAME_CLIP_UPPER_LEFT;

    matrix_rotation(axis, 0.7, a);
    matrix_scaling(3, 3, 3, b);
    matrix_multiply(b, a, cameras[5].frame.view);
    cameras[5].frame.view[12] = 4, cameras[5].frame.view[14] = -2;

    matrix_scaling(2, 0.5, 1.3, b);
    matrix_rotation(axis, -1.1, c);
    matrix_multiply(b, c, cameras[6].model); /* shears in the model's own axes */
    matrix_multiply(a, cameras[6].model, b);
    memcpy(cameras[6].model, b, sizeof(b));
    matrix_scaling(-1, 1, 2, cameras[7].model);
    cameras[7].model[13] = 0.5;

    frame_set_viewport(&cameras[8].frame, 13, 9, 60, 50);
    cameras[9].frame.jitter[0] = 0.31, cameras[9].frame.jitter[1] = -0.47;
    cameras[10].frame.projection[10] = -1, cameras[10].frame.projection[14] = -2;
    matrix_zero_to_one(cameras[11].frame.projection, false);
    cameras[11].frame.flags = PBR_FRAME_CLIP_ZERO_TO_ONE;
    matrix_zero_to_one(cameras[12].frame.projection, true);
    cameras[12].frame.flags = PBR_FRAME_CLIP_ZERO_TO_ONE | PBR_FRAME_REVERSED_Z;
}

void unproject(const struct camera *camera, const double ndc[3], double position[3]) {
    double view[16], model_view[16], all[16], inverse[16], at[4];
    const double corner[4] = {ndc[0], ndc[1], ndc[2], 1};
    matrix_identity(view);
    if (camera->frame.view[15] != 0) memcpy(view, camera->frame.view, sizeof(view));
    matrix_multiply(view, camera->model, model_view);
    matrix_multiply(camera->frame.projection, model_view, all);
    assert_true(matrix_invert(all, inverse));
    matrix_apply(inverse, corner, at);
    for (int k = 0; k < 3; k++) position[k] = at[k] / at[3];
}

double radius_for(const struct camera *camera, const double position[3], double size) {
    pbr_item item = PBR_ITEM_INIT;
    return size / (place(&camera->frame, &item, camera->model, position, 1e9).size / 1e9);
}

void random_position(const struct camera *camera, uint64_t *seed, double position[3]) {
    double depth = random_between(seed, 0.02, 0.98);
    const double ndc[3] = {random_between(seed, -1.5, 1.5), random_between(seed, -1.5, 1.5),
                           camera->frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE ? depth : 2 * depth - 1};
    unproject(camera, ndc, position);
}

/* ---- Random numbers (Steele, Lea, Flood 2014: SplitMix) ---- */

double random_between(uint64_t *state, double low, double high) {
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    z ^= z >> 31;
    return low + (high - low) * ((double)(z >> 11) * 0x1p-53);
}

double random_log(uint64_t *state, double low, double high) {
    return exp(random_between(state, log(low), log(high)));
}
