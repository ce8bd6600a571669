/* Saving, setting and restoring the host's GL state. SPDX-License-Identifier: MIT */
#include "state.h"

/* Switches that must have one value while libpbr draws, whatever the frame. */
static const struct toggle {
    GLenum name;
    short desktop, es; /* first version that has it; 0 = never */
    enum { ANY, COMPATIBILITY, DEPTH_CLAMP, DEPTH_BOUNDS, SRGB, SAVED_ONLY } when;
    bool wanted;
} toggles[STATE_TOGGLES] = {
    {GL_CULL_FACE, 10, 20, ANY, false},
    {GL_STENCIL_TEST, 10, 20, ANY, false},
    {GL_DITHER, 10, 20, ANY, false},
    {GL_POLYGON_OFFSET_FILL, 11, 20, ANY, false},
    {GL_POLYGON_OFFSET_LINE, 11, 0, ANY, false},
    {GL_POLYGON_OFFSET_POINT, 11, 0, ANY, false}, /* meant for polygons drawn as points, but some drivers move GL points too */
    {GL_SAMPLE_ALPHA_TO_COVERAGE, 13, 20, ANY, false},
    {GL_SAMPLE_COVERAGE, 13, 20, ANY, false},
    {GL_SAMPLE_ALPHA_TO_ONE, 13, 0, ANY, false},
    {GL_SAMPLE_MASK, 32, 31, ANY, false},
    {GL_SAMPLE_SHADING, 40, 32, ANY, false},
    {GL_MULTISAMPLE, 13, 0, ANY, true},
    {GL_COLOR_LOGIC_OP, 11, 0, ANY, false},
    {GL_POLYGON_SMOOTH, 10, 0, ANY, false},
    {GL_RASTERIZER_DISCARD, 30, 30, ANY, false},
    {GL_PRIMITIVE_RESTART, 31, 0, ANY, false},
    {GL_PRIMITIVE_RESTART_FIXED_INDEX, 43, 30, ANY, false},
    {GL_PROGRAM_POINT_SIZE, 32, 0, ANY, true},
    {GL_DEPTH_CLAMP, 32, 30, DEPTH_CLAMP, false},
    {GL_DEPTH_BOUNDS_TEST_EXT, 10, 0, DEPTH_BOUNDS, false},
    {GL_ALPHA_TEST, 10, 0, COMPATIBILITY, false},
    {GL_POINT_SMOOTH, 10, 0, COMPATIBILITY, false},
    {GL_POLYGON_STIPPLE, 10, 0, COMPATIBILITY, false},
    {GL_POINT_SPRITE, 20, 0, COMPATIBILITY, true},
    {GL_VERTEX_PROGRAM_TWO_SIDE, 20, 0, COMPATIBILITY, false},
    /* The frame decides about these; state_set follows up. */
    {GL_DEPTH_TEST, 10, 20, SAVED_ONLY, false},
    {GL_FRAMEBUFFER_SRGB, 30, 30, SRGB, false},
};

static bool applies(const struct gl *gl, const struct toggle *toggle) {
    int first = gl->es ? toggle->es : toggle->desktop;
    if (!first || gl->version < first) return false;
    switch (toggle->when) {
    case COMPATIBILITY: return gl->compatibility;
    case DEPTH_CLAMP: return gl->has_depth_clamp;
    case DEPTH_BOUNDS: return gl->has_depth_bounds;
    case SRGB: return gl->has_srgb_control;
    default: return true;
    }
}

static void switch_to(const struct gl *gl, GLenum name, bool on) {
    if (on) (*gl->Enable)(name);
    else (*gl->Disable)(name);
}

/* Of draw buffer 0 or viewport 0 alone where `indexed`; a global switch would reach the others too. */
static void switch_first(const struct gl *gl, bool indexed, GLenum name, bool on) {
    if (!indexed) switch_to(gl, name, on);
    else if (on) (*gl->Enablei)(name, 0);
    else (*gl->Disablei)(name, 0);
}

static bool has_viewport_array(const struct gl *gl) {
    return gl->ViewportIndexedf && gl->ScissorIndexed && gl->DepthRangeIndexed && gl->Enablei && gl->Disablei;
}

static bool has_indexed_buffers(const struct gl *gl) {
    return gl->Enablei && gl->Disablei && gl->IsEnabledi && gl->ColorMaski && gl->GetBooleani_v;
}

void state_window(const struct gl *gl, const GLfloat viewport[4], const GLint scissor[4], const GLdouble range[2]) {
    if (has_viewport_array(gl)) {
        (*gl->ViewportIndexedf)(0, viewport[0], viewport[1], viewport[2], viewport[3]);
        (*gl->ScissorIndexed)(0, scissor[0], scissor[1], scissor[2], scissor[3]);
        (*gl->DepthRangeIndexed)(0, range[0], range[1]);
        return;
    }
    (*gl->Viewport)((GLint)viewport[0], (GLint)viewport[1], (GLsizei)viewport[2], (GLsizei)viewport[3]);
    (*gl->Scissor)(scissor[0], scissor[1], scissor[2], scissor[3]);
    if (gl->es) (*gl->DepthRangef)((GLfloat)range[0], (GLfloat)range[1]);
    else (*gl->DepthRange)(range[0], range[1]);
}

static void set_colour_mask(const struct gl *gl, const GLboolean mask[4]) {
    if (has_indexed_buffers(gl)) (*gl->ColorMaski)(0, mask[0], mask[1], mask[2], mask[3]);
    else (*gl->ColorMask)(mask[0], mask[1], mask[2], mask[3]);
}

static void save_draw_buffers(const struct gl *gl, struct state *state) {
    bool several = false;
    for (int i = 0; i < gl->max_draw_buffers; i++) {
        (*gl->GetIntegerv)(GL_DRAW_BUFFER0 + (GLenum)i, &state->draw_buffers[i]);
        several |= i > 0 && state->draw_buffers[i] != GL_NONE;
    }
    state->draw_buffers_changed = several;
}

static void save_rest(const struct gl *gl, struct state *state) {
    (*gl->GetIntegerv)(GL_CURRENT_PROGRAM, &state->program);
    (*gl->GetIntegerv)(GL_VERTEX_ARRAY_BINDING, &state->vertex_array);
    (*gl->GetIntegerv)(GL_ARRAY_BUFFER_BINDING, &state->array_buffer);
    (*gl->GetFloatv)(GL_VIEWPORT, state->viewport);
    (*gl->GetIntegerv)(GL_SCISSOR_BOX, state->scissor);
    state->scissor_test = (*gl->IsEnabled)(GL_SCISSOR_TEST);
    if (gl->es) {
        GLfloat range[2] = {0, 1};
        (*gl->GetFloatv)(GL_DEPTH_RANGE, range);
        state->depth_range[0] = range[0];
        state->depth_range[1] = range[1];
    } else {
        (*gl->GetDoublev)(GL_DEPTH_RANGE, state->depth_range);
    }
    (*gl->GetIntegerv)(GL_DEPTH_FUNC, &state->depth_function);
    (*gl->GetBooleanv)(GL_DEPTH_WRITEMASK, &state->depth_mask);
    if (has_indexed_buffers(gl)) {
        (*gl->GetBooleani_v)(GL_COLOR_WRITEMASK, 0, state->colour_mask);
        state->blend = (*gl->IsEnabledi)(GL_BLEND, 0);
    } else {
        (*gl->GetBooleanv)(GL_COLOR_WRITEMASK, state->colour_mask);
        state->blend = (*gl->IsEnabled)(GL_BLEND);
    }
    for (int i = 0; i < STATE_TOGGLES; i++)
        if (applies(gl, &toggles[i])) state->toggles[i] = (*gl->IsEnabled)(toggles[i].name);
    for (int i = 0; i < gl->max_clip_distances; i++) state->clip_distances[i] = (*gl->IsEnabled)(GL_CLIP_DISTANCE0 + (GLenum)i);
    if (gl->PolygonMode) {
        (*gl->GetIntegerv)(GL_POLYGON_MODE, state->polygon_mode);
        if (!gl->compatibility) state->polygon_mode[1] = state->polygon_mode[0];
    }
    if (gl->ClipControl) {
        (*gl->GetIntegerv)(GL_CLIP_ORIGIN, &state->clip_origin);
        (*gl->GetIntegerv)(GL_CLIP_DEPTH_MODE, &state->clip_depth_mode);
    }
    if (gl->PointParameterf) (*gl->GetFloatv)(GL_POINT_FADE_THRESHOLD_SIZE, &state->fade_threshold);
    if (gl->compatibility) (*gl->GetIntegerv)(GL_CLAMP_FRAGMENT_COLOR, &state->fragment_clamp);
}

static bool has_indexed_functions(const struct gl *gl) {
    return gl->BlendFuncSeparatei && gl->BlendEquationSeparatei && gl->BlendEquationi && gl->GetIntegeri_v;
}

static void get_of_buffer(const struct gl *gl, GLuint buffer, GLenum name, GLint *out) {
    if (has_indexed_functions(gl)) (*gl->GetIntegeri_v)(name, buffer, out);
    else (*gl->GetIntegerv)(name, out);
}

static void save_blending(const struct gl *gl, struct state *state) {
    static const GLenum functions[4] = {GL_BLEND_SRC_RGB, GL_BLEND_DST_RGB, GL_BLEND_SRC_ALPHA, GL_BLEND_DST_ALPHA};
    static const GLenum equations[2] = {GL_BLEND_EQUATION_RGB, GL_BLEND_EQUATION_ALPHA};
    for (GLuint b = 0; b < STATE_SUMS; b++) {
        for (int i = 0; i < 4; i++) get_of_buffer(gl, b, functions[i], &state->blend_functions[b][i]);
        for (int i = 0; i < 2; i++) get_of_buffer(gl, b, equations[i], &state->blend_equations[b][i]);
    }
    if (has_indexed_buffers(gl)) {
        state->blend_second = (*gl->IsEnabledi)(GL_BLEND, 1);
        (*gl->GetBooleani_v)(GL_COLOR_WRITEMASK, 1, state->mask_second);
    }
    (*gl->GetIntegerv)(GL_ACTIVE_TEXTURE, &state->active_texture);
    for (int i = 0; i < STATE_TEXTURES; i++) {
        (*gl->ActiveTexture)(GL_TEXTURE0 + (GLenum)i);
        (*gl->GetIntegerv)(GL_TEXTURE_BINDING_2D, &state->textures[i]);
        (*gl->GetIntegerv)(GL_SAMPLER_BINDING, &state->samplers[i]);
    }
}

static const struct pack {
    GLenum name;
    GLint tight;
    bool desktop_only;
} packs[STATE_PACKS] = {{GL_PACK_ALIGNMENT, 4, false},
                        {GL_PACK_ROW_LENGTH, 0, false},
                        {GL_PACK_SKIP_ROWS, 0, false},
                        {GL_PACK_SKIP_PIXELS, 0, false},
                        {GL_PACK_SWAP_BYTES, GL_FALSE, true}};

static GLuint still_there(const struct gl *gl, GLint buffer) {
    return buffer && (*gl->IsBuffer)((GLuint)buffer) ? (GLuint)buffer : 0;
}

static void save_reading(const struct gl *gl, struct state *state) {
    (*gl->GetIntegerv)(GL_READ_FRAMEBUFFER_BINDING, &state->read_framebuffer);
    (*gl->GetIntegerv)(GL_PIXEL_PACK_BUFFER_BINDING, &state->pack_buffer);
    for (int i = 0; i < STATE_PACKS; i++)
        if (!gl->es || !packs[i].desktop_only) (*gl->GetIntegerv)(packs[i].name, &state->packs[i]);
}

void state_pack_tightly(const struct gl *gl) {
    for (int i = 0; i < STATE_PACKS; i++)
        if (!gl->es || !packs[i].desktop_only) (*gl->PixelStorei)(packs[i].name, packs[i].tight);
}

static void restore_reading(const struct gl *gl, const struct state *state) {
    const GLuint framebuffer = (GLuint)state->read_framebuffer;
    (*gl->BindFramebuffer)(GL_READ_FRAMEBUFFER, framebuffer && (*gl->IsFramebuffer)(framebuffer) ? framebuffer : 0);
    (*gl->BindBuffer)(GL_PIXEL_PACK_BUFFER, still_there(gl, state->pack_buffer));
    for (int i = 0; i < STATE_PACKS; i++)
        if (!gl->es || !packs[i].desktop_only) (*gl->PixelStorei)(packs[i].name, state->packs[i]);
}

static void save_selecting(const struct gl *gl, struct state *state) {
    (*gl->GetIntegerv)(GL_DRAW_INDIRECT_BUFFER_BINDING, &state->indirect_buffer);
    (*gl->GetIntegerv)(GL_SHADER_STORAGE_BUFFER_BINDING, &state->storage_buffer);
    for (GLuint i = 0; i < STATE_STORAGES; i++) {
        (*gl->GetIntegeri_v)(GL_SHADER_STORAGE_BUFFER_BINDING, i, &state->storages[i]);
        (*gl->GetInteger64i_v)(GL_SHADER_STORAGE_BUFFER_START, i, &state->storage_starts[i]);
        (*gl->GetInteger64i_v)(GL_SHADER_STORAGE_BUFFER_SIZE, i, &state->storage_sizes[i]);
    }
}

static void restore_selecting(const struct gl *gl, const struct state *state) {
    (*gl->BindBuffer)(GL_DRAW_INDIRECT_BUFFER, still_there(gl, state->indirect_buffer));
    for (GLuint i = 0; i < STATE_STORAGES; i++) {
        const GLuint buffer = still_there(gl, state->storages[i]);
        if (buffer && state->storage_sizes[i] > 0) /* 0: all of it, however long */
            (*gl->BindBufferRange)(GL_SHADER_STORAGE_BUFFER, i, buffer, (GLintptr)state->storage_starts[i],
                                   (GLsizeiptr)state->storage_sizes[i]);
        else (*gl->BindBufferBase)(GL_SHADER_STORAGE_BUFFER, i, buffer);
    }
    (*gl->BindBuffer)(GL_SHADER_STORAGE_BUFFER, still_there(gl, state->storage_buffer)); /* last: the others change it */
}

void state_save(const struct gl *gl, bool keep, const struct state_wanted *wanted, struct state *state) {
    state->kept = keep;
    state->framebuffer_changed = wanted->bind_framebuffer;
    state->blends = wanted->blends || wanted->reads;
    state->reads = wanted->reads;
    if (keep || state->blends) (*gl->GetIntegerv)(GL_DRAW_FRAMEBUFFER_BINDING, &state->framebuffer);
    if (keep) save_rest(gl, state);
    if (keep && state->blends) save_blending(gl, state);
    if (keep && state->reads) save_reading(gl, state);
    state->selects = wanted->selects;
    if (keep && state->selects) save_selecting(gl, state);
    if (wanted->bind_framebuffer) (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, wanted->framebuffer);
    save_draw_buffers(gl, state);
}

void state_set(const struct gl *gl, const struct state_wanted *wanted, struct state *state) {
    static const GLboolean all[4] = {GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE};
    /* Our fragment stage has one output; draw buffers past the first would receive undefined values. */
    if (state->draw_buffers_changed) {
        const GLenum first = (GLenum)state->draw_buffers[0];
        (*gl->DrawBuffers)(1, &first);
    }
    for (int i = 0; i < STATE_TOGGLES; i++)
        if (toggles[i].when != SAVED_ONLY && applies(gl, &toggles[i])) switch_to(gl, toggles[i].name, toggles[i].wanted);
    for (int i = 0; i < gl->max_clip_distances; i++) (*gl->Disable)(GL_CLIP_DISTANCE0 + (GLenum)i);
    switch_to(gl, GL_DEPTH_TEST, wanted->depth_test);
    (*gl->DepthFunc)(wanted->depth_function);
    (*gl->DepthMask)(wanted->depth_write ? GL_TRUE : GL_FALSE);
    if (gl->has_srgb_control && wanted->framebuffer_srgb) (*gl->Enable)(GL_FRAMEBUFFER_SRGB);
    switch_first(gl, has_indexed_buffers(gl), GL_BLEND, false);
    set_colour_mask(gl, all);
    const GLfloat viewport[4] = {(GLfloat)wanted->viewport[0], (GLfloat)wanted->viewport[1], (GLfloat)wanted->viewport[2],
                                 (GLfloat)wanted->viewport[3]};
    state_window(gl, viewport, wanted->scissor, wanted->depth_range);
    switch_first(gl, has_viewport_array(gl), GL_SCISSOR_TEST, true);
    if (gl->PolygonMode) (*gl->PolygonMode)(GL_FRONT_AND_BACK, GL_FILL);
    if (gl->ClipControl) (*gl->ClipControl)(GL_LOWER_LEFT, wanted->clip_zero_to_one ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE);
    if (gl->PointParameterf) (*gl->PointParameterf)(GL_POINT_FADE_THRESHOLD_SIZE, 0);
    if (gl->compatibility) (*gl->ClampColor)(GL_CLAMP_FRAGMENT_COLOR, GL_FALSE);
}

static void restore_polygon_mode(const struct gl *gl, const struct state *state) {
    if (state->polygon_mode[0] == state->polygon_mode[1]) {
        (*gl->PolygonMode)(GL_FRONT_AND_BACK, (GLenum)state->polygon_mode[0]);
        return;
    }
    (*gl->PolygonMode)(GL_FRONT, (GLenum)state->polygon_mode[0]);
    (*gl->PolygonMode)(GL_BACK, (GLenum)state->polygon_mode[1]);
}

/* Of one draw buffer where the version tells them apart. */
static void set_blend_functions(const struct gl *gl, GLuint buffer, const GLint functions[4], const GLint equations[2]) {
    const GLint *f = functions;
    const bool same = equations[0] == equations[1]; /* advanced equations cannot be set apart */
    if (has_indexed_functions(gl)) {
        (*gl->BlendFuncSeparatei)(buffer, (GLenum)f[0], (GLenum)f[1], (GLenum)f[2], (GLenum)f[3]);
        if (same) (*gl->BlendEquationi)(buffer, (GLenum)equations[0]);
        else (*gl->BlendEquationSeparatei)(buffer, (GLenum)equations[0], (GLenum)equations[1]);
    } else if (buffer == 0) {
        (*gl->BlendFuncSeparate)((GLenum)f[0], (GLenum)f[1], (GLenum)f[2], (GLenum)f[3]);
        if (same) (*gl->BlendEquation)((GLenum)equations[0]);
        else (*gl->BlendEquationSeparate)((GLenum)equations[0], (GLenum)equations[1]);
    }
}

static void set_second_buffer(const struct gl *gl, bool blend, const GLboolean mask[4]) {
    if (!has_indexed_buffers(gl)) return; /* one switch and one mask for all */
    if (blend) (*gl->Enablei)(GL_BLEND, 1);
    else (*gl->Disablei)(GL_BLEND, 1);
    (*gl->ColorMaski)(1, mask[0], mask[1], mask[2], mask[3]);
}

void state_add_up(const struct gl *gl, bool on) {
    static const GLint functions[4] = {GL_ONE, GL_ONE, GL_ONE, GL_ONE}, equations[2] = {GL_FUNC_ADD, GL_FUNC_ADD};
    static const GLboolean all[4] = {GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE};
    switch_first(gl, has_indexed_buffers(gl), GL_BLEND, on);
    set_second_buffer(gl, on, all);
    for (GLuint b = 0; b < STATE_SUMS && on; b++) set_blend_functions(gl, b, functions, equations);
}

static void restore_blending(const struct gl *gl, const struct state *state) {
    for (GLuint b = 0; b < STATE_SUMS; b++) set_blend_functions(gl, b, state->blend_functions[b], state->blend_equations[b]);
    set_second_buffer(gl, state->blend_second, state->mask_second);
    for (int i = 0; i < STATE_TEXTURES; i++) {
        const GLuint texture = (GLuint)state->textures[i], sampler = (GLuint)state->samplers[i];
        (*gl->ActiveTexture)(GL_TEXTURE0 + (GLenum)i);
        (*gl->BindTexture)(GL_TEXTURE_2D, texture && (*gl->IsTexture)(texture) ? texture : 0);
        (*gl->BindSampler)((GLuint)i, sampler && (*gl->IsSampler)(sampler) ? sampler : 0);
    }
    (*gl->ActiveTexture)((GLenum)state->active_texture);
}

void state_restore(const struct gl *gl, const struct state *state) {
    if (!state->kept) return;
    if (state->draw_buffers_changed) {
        GLenum buffers[STATE_DRAW_BUFFERS];
        for (int i = 0; i < gl->max_draw_buffers; i++) buffers[i] = (GLenum)state->draw_buffers[i];
        (*gl->DrawBuffers)(gl->max_draw_buffers, buffers);
    }
    if (state->framebuffer_changed) (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, (GLuint)state->framebuffer);
    /* A program or buffer that the host deleted while it was bound is gone once unbound; binding its name would be an error. */
    GLuint program = (GLuint)state->program;
    (*gl->UseProgram)(program && (*gl->IsProgram)(program) ? program : 0);
    (*gl->BindVertexArray)((GLuint)state->vertex_array);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, still_there(gl, state->array_buffer));

    for (int i = 0; i < STATE_TOGGLES; i++)
        if (applies(gl, &toggles[i])) switch_to(gl, toggles[i].name, state->toggles[i]);
    for (int i = 0; i < gl->max_clip_distances; i++) switch_to(gl, GL_CLIP_DISTANCE0 + (GLenum)i, state->clip_distances[i]);
    (*gl->DepthFunc)((GLenum)state->depth_function);
    (*gl->DepthMask)(state->depth_mask);
    switch_first(gl, has_indexed_buffers(gl), GL_BLEND, state->blend);
    set_colour_mask(gl, state->colour_mask);
    state_window(gl, state->viewport, state->scissor, state->depth_range);
    switch_first(gl, has_viewport_array(gl), GL_SCISSOR_TEST, state->scissor_test);
    if (gl->PolygonMode) restore_polygon_mode(gl, state);
    if (gl->ClipControl) (*gl->ClipControl)((GLenum)state->clip_origin, (GLenum)state->clip_depth_mode);
    if (gl->PointParameterf) (*gl->PointParameterf)(GL_POINT_FADE_THRESHOLD_SIZE, state->fade_threshold);
    if (gl->compatibility) (*gl->ClampColor)(GL_CLAMP_FRAGMENT_COLOR, (GLenum)state->fragment_clamp);
    if (state->blends) restore_blending(gl, state);
    if (state->reads) restore_reading(gl, state);
    if (state->selects) restore_selecting(gl, state);
}
