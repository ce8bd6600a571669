/* Finding a context's functions, version and limits. SPDX-License-Identifier: MIT */
#include "context.h"

#include <dlfcn.h>
#include <string.h>

/* libepoxy aborts the process when a function is called without a context, so ask the window-system libraries that the host has
 * loaded already whether there is one; nothing is loaded for this. */
static bool any_context_is_current(void) {
    static const char *const where[][2] = {
        {"libEGL.so.1", "eglGetCurrentContext"}, {"libGLX.so.0", "glXGetCurrentContext"}, {"libGL.so.1", "glXGetCurrentContext"}};
    bool current = false;
    for (size_t i = 0; i < sizeof where / sizeof *where && !current; i++) {
        void *library = dlopen(where[i][0], RTLD_LAZY | RTLD_NOLOAD);
        if (!library) continue;
        void *symbol = dlsym(library, where[i][1]);
        void *(*get_current)(void);
        memcpy(&get_current, &symbol, sizeof get_current);
        current = symbol && get_current() != NULL;
        dlclose(library);
    }
    return current;
}

static bool parse_version(const char *text, struct gl *gl) {
    static const char es_prefix[] = "OpenGL ES ";
    gl->es = strncmp(text, es_prefix, sizeof es_prefix - 1) == 0;
    if (gl->es) text += sizeof es_prefix - 1;
    if (text[0] < '0' || text[0] > '9' || text[1] != '.' || text[2] < '0' || text[2] > '9') return false;
    gl->version = 10 * (text[0] - '0') + (text[2] - '0');
    return true;
}

static bool has_extension(const struct gl *gl, const char *name) {
    GLint count = 0;
    (*gl->GetIntegerv)(GL_NUM_EXTENSIONS, &count);
    for (GLint i = 0; i < count; i++) {
        const char *extension = (const char *)(*gl->GetStringi)(GL_EXTENSIONS, (GLuint)i);
        if (extension && strcmp(extension, name) == 0) return true;
    }
    return false;
}

/* The entry for one function, or NULL if the host has no such function. */
static const void *find(const pbr_renderer_desc *desc, const char *name, void *own, size_t size, const void *epoxy) {
    if (!desc->get_proc_address) return epoxy;
    void *address = desc->get_proc_address(desc->get_proc_address_user, name);
    memcpy(own, &address, size);
    return address ? own : NULL;
}

static pbr_result missing(pbr_instance *instance, const char *name) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "the OpenGL context has no function gl%s, which libpbr needs",
                   name);
}

/* In OpenGL ES these functions have names of their own, also where the version has some of them: only together do they know of
 * timestamps. */
static void find_es_queries(const pbr_renderer_desc *desc, struct gl *gl) {
    if (!has_extension(gl, "GL_EXT_disjoint_timer_query")) return;
#define F(name) gl->name = find(desc, "gl" #name "EXT", &gl->own.name, sizeof gl->own.name, &epoxy_gl##name##EXT)
    F(DeleteQueries);
    F(GenQueries);
    F(GetQueryObjectui64v);
    F(GetQueryObjectuiv);
    F(GetQueryiv);
    F(QueryCounter);
#undef F
}

static int count_timestamp_bits(const struct gl *gl) {
    GLint bits = 0;
    if (!gl->DeleteQueries || !gl->GenQueries || !gl->GetQueryObjectui64v || !gl->GetQueryObjectuiv || !gl->GetQueryiv ||
        !gl->QueryCounter)
        return 0;
    (*gl->GetQueryiv)(GL_TIMESTAMP, GL_QUERY_COUNTER_BITS, &bits);
    return bits;
}

static pbr_result read_limits(pbr_instance *instance, const pbr_renderer_desc *desc, struct gl *gl) {
    GLint mask = 0;
    if (!gl->es && gl->version >= 32) (*gl->GetIntegerv)(GL_CONTEXT_PROFILE_MASK, &mask);
    /* Contexts made the old way may have a mask of 0 and be compatible all the same. */
    gl->compatibility = !gl->es && (mask & GL_CONTEXT_COMPATIBILITY_PROFILE_BIT ||
                                    (!(mask & GL_CONTEXT_CORE_PROFILE_BIT) && has_extension(gl, "GL_ARB_compatibility")));
    gl->has_srgb_control = !gl->es || has_extension(gl, "GL_EXT_sRGB_write_control");
    gl->has_clip_distances =
        !gl->es || has_extension(gl, "GL_EXT_clip_cull_distance") || has_extension(gl, "GL_APPLE_clip_distance");
    gl->has_depth_clamp = !gl->es || has_extension(gl, "GL_EXT_depth_clamp");
    gl->has_depth_bounds = !gl->es && has_extension(gl, "GL_EXT_depth_bounds_test");
    gl->has_transform_feedback_query = gl->es || gl->version >= 40 || has_extension(gl, "GL_ARB_transform_feedback2");

    gl->has_query_buffer = !gl->es && (gl->version >= 44 || has_extension(gl, "GL_ARB_query_buffer_object") ||
                                       has_extension(gl, "GL_AMD_query_buffer_object"));
    gl->timestamp_bits = count_timestamp_bits(gl);
    gl->has_draw_ids = !gl->es && gl->MultiDrawArrays && has_extension(gl, "GL_ARB_shader_draw_parameters");
    gl->has_selection =
        gl->DispatchCompute && gl->DrawArraysIndirect && gl->MemoryBarrier && (gl->MultiDrawArraysIndirect || !gl->has_draw_ids);
    GLint64 storage = 0; /* as a GLint it may be negative */
    if (gl->has_selection) (*gl->GetInteger64v)(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &storage);
    gl->most_storage_bytes = storage < INT32_MAX ? (uint64_t)(storage > 0 ? storage : 0) : INT32_MAX;
    gl->has_selection = gl->most_storage_bytes > 0;
    GLint64 largest = 0;
    gl->largest_index = UINT32_MAX; /* older versions do not tell */
    if (gl->version >= (gl->es ? 30 : 43)) (*gl->GetInteger64v)(GL_MAX_ELEMENT_INDEX, &largest);
    if (largest > 0 && largest < UINT32_MAX) gl->largest_index = (uint32_t)largest;
    gl->has_multiview = has_extension(gl, "GL_OVR_multiview");
    gl->has_float_targets = !gl->es || gl->version >= 32 || has_extension(gl, "GL_EXT_color_buffer_float") ||
                            has_extension(gl, "GL_EXT_color_buffer_half_float");
    gl->has_float_blend = !gl->es || (has_extension(gl, "GL_EXT_float_blend") &&
                                      (gl->version >= 32 || has_extension(gl, "GL_EXT_color_buffer_float")));

    GLfloat range[2] = {1, 1};
    (*gl->GetFloatv)(gl->es ? GL_ALIASED_POINT_SIZE_RANGE : GL_POINT_SIZE_RANGE, range);
    gl->point_size_least = range[0];
    gl->point_size_limit = range[1];
    if (desc->point_size_limit > 0 && desc->point_size_limit < gl->point_size_limit) gl->point_size_limit = desc->point_size_limit;
    (*gl->GetIntegerv)(GL_MAX_VIEWPORT_DIMS, gl->max_viewport);
    (*gl->GetIntegerv)(GL_MAX_DRAW_BUFFERS, &gl->max_draw_buffers);
    if (gl->has_clip_distances) (*gl->GetIntegerv)(GL_MAX_CLIP_DISTANCES, &gl->max_clip_distances);
    if (gl->max_clip_distances > 32) gl->max_clip_distances = 32;
    if (gl->max_draw_buffers > 32) gl->max_draw_buffers = 32;
    if (gl->max_draw_buffers < 1)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "the OpenGL context reports no draw buffers");
    return PBR_OK;
}

pbr_result gl_load(pbr_instance *instance, const pbr_renderer_desc *desc, struct gl *gl) {
    if (!desc->get_proc_address && !any_context_is_current())
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT,
                       "pbr_renderer_create: no OpenGL context is current on this thread");

    gl->GetString = find(desc, "glGetString", &gl->own.GetString, sizeof gl->own.GetString, &epoxy_glGetString);
    if (!gl->GetString) return missing(instance, "GetString");
    const char *version = (const char *)(*gl->GetString)(GL_VERSION);
    if (!version)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT,
                       "pbr_renderer_create: glGetString(GL_VERSION) is NULL; no context is current");
    if (!parse_version(version, gl) || gl->version < (gl->es ? 30 : 33))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "libpbr needs OpenGL 3.3 or OpenGL ES 3.0; the context is \"%.80s\"", version);

        /* First all that the version promises, then what extensions add, which can be asked for only with the former. */
#define F(name, type, desktop, es_version, extension)                                                                              \
    if (gl->es ? es_version && gl->version >= es_version : desktop && gl->version >= desktop) {                                    \
        gl->name = find(desc, "gl" #name, &gl->own.name, sizeof gl->own.name, &epoxy_gl##name);                                    \
        if (!gl->name && (gl->es ? es_version <= 30 : desktop <= 33)) return missing(instance, #name);                             \
    }
    GL_FUNCTIONS(F)
#undef F
#define F(name, type, desktop, es_version, extension)                                                                              \
    {                                                                                                                              \
        const char *brought_by = extension;                                                                                        \
        if (!gl->name && !gl->es && brought_by && has_extension(gl, brought_by))                                                   \
            gl->name = find(desc, "gl" #name, &gl->own.name, sizeof gl->own.name, &epoxy_gl##name);                                \
    }
    GL_FUNCTIONS(F)
#undef F
    if (gl->es && has_extension(gl, "GL_EXT_clip_control"))
        gl->ClipControl = find(desc, "glClipControlEXT", &gl->own.ClipControl, sizeof gl->own.ClipControl, &epoxy_glClipControlEXT);
    if (gl->es) find_es_queries(desc, gl);
    return read_limits(instance, desc, gl);
}

GLenum gl_drain_errors(const struct gl *gl) {
    GLenum first = GL_NO_ERROR;
    /* A lost context may report errors without end. */
    for (int i = 0; i < 64; i++) {
        GLenum error = (*gl->GetError)();
        if (error == GL_NO_ERROR) break;
        if (first == GL_NO_ERROR) first = error;
    }
    return first;
}

GLuint gl_make_texture(const struct gl *gl, GLenum internal, GLenum format, GLenum type, GLsizei width, GLsizei height) {
    GLuint name = 0;
    (*gl->GenTextures)(1, &name);
    (*gl->BindTexture)(GL_TEXTURE_2D, name);
    (*gl->TexImage2D)(GL_TEXTURE_2D, 0, (GLint)internal, width, height, 0, format, type, NULL);
    (*gl->TexParameteri)(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    (*gl->TexParameteri)(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    (*gl->TexParameteri)(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    return name;
}
