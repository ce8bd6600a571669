/* The passes of blended splats, and the targets between them. SPDX-License-Identifier: MIT */
#include "blend.h"

#include <string.h>

#include "core/matrix.h"
#include "draw.h"
#include "uniforms.h"

/* Sums of many small weights stall in half floats, of each channel at another size, so they are taken only where nothing else can
 * be blended. */
static uint32_t sum_bytes(const struct gl *gl) {
    return gl->has_float_blend ? 16 : 8;
}

void targets_free(const struct gl *gl, struct targets *targets) {
    if (gl) {
        (*gl->DeleteFramebuffers)(1, &targets->visibility);
        (*gl->DeleteFramebuffers)(1, &targets->accumulation);
        (*gl->DeleteFramebuffers)(1, &targets->deferred);
        (*gl->DeleteFramebuffers)(1, &targets->marks);
        (*gl->DeleteTextures)(1, &targets->depth);
        (*gl->DeleteTextures)(1, &targets->front);
        (*gl->DeleteTextures)(1, &targets->colours);
        (*gl->DeleteTextures)(1, &targets->second);
    }
    *targets = (struct targets){0};
}

static GLuint make_sums(const struct gl *gl, GLsizei width, GLsizei height) {
    return gl_make_texture(gl, gl->has_float_blend ? GL_RGBA32F : GL_RGBA16F, GL_RGBA,
                           gl->has_float_blend ? GL_FLOAT : GL_HALF_FLOAT, width, height);
}

static GLuint make_framebuffer(const struct gl *gl, GLuint depth, GLuint colour, GLuint second) {
    static const GLenum both[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    GLuint name = 0;
    (*gl->GenFramebuffers)(1, &name);
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, name);
    (*gl->FramebufferTexture2D)(GL_DRAW_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0);
    (*gl->FramebufferTexture2D)(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour, 0);
    if (!second) return name;
    (*gl->FramebufferTexture2D)(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, second, 0);
    (*gl->DrawBuffers)(2, both);
    return name;
}

static bool is_complete(const struct gl *gl, GLuint framebuffer) {
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, framebuffer);
    return (*gl->CheckFramebufferStatus)(GL_DRAW_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static pbr_result make_targets(pbr_renderer *renderer, GLsizei width, GLsizei height, bool second, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    struct targets *targets = &renderer->targets;
    targets_free(gl, targets);
    const GLenum pending = gl_drain_errors(gl);
    if (*host_error == GL_NO_ERROR) *host_error = pending;
    /* A buffer that the host unpacks pixels from would be read instead of none. */
    GLint unpack = 0;
    (*gl->GetIntegerv)(GL_PIXEL_UNPACK_BUFFER_BINDING, &unpack);
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, 0);
    (*gl->ActiveTexture)(GL_TEXTURE0);
    targets->depth = gl_make_texture(gl, GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT, width, height);
    targets->front = gl_make_texture(gl, GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT, width, height);
    targets->colours = make_sums(gl, width, height);
    if (second) targets->second = make_sums(gl, width, height);
    targets->visibility = make_framebuffer(gl, targets->depth, targets->front, 0);
    targets->accumulation = make_framebuffer(gl, targets->depth, targets->colours, 0);
    if (second) {
        targets->deferred = make_framebuffer(gl, targets->depth, targets->colours, targets->second);
        targets->marks = make_framebuffer(gl, targets->depth, targets->front, targets->second);
    }
    const bool complete = is_complete(gl, targets->visibility) && is_complete(gl, targets->accumulation) &&
                          (!second || (is_complete(gl, targets->deferred) && is_complete(gl, targets->marks)));
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, unpack && (*gl->IsBuffer)((GLuint)unpack) ? (GLuint)unpack : 0);
    const GLenum error = gl_drain_errors(gl);
    if (error != GL_NO_ERROR || !complete) {
        targets_free(gl, targets);
        return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_GPU_MEMORY,
                       "OpenGL refuses targets of %d x %d pixels for blended splats (error 0x%04x)", (int)width, (int)height,
                       (unsigned)error);
    }
    targets->width = width;
    targets->height = height;
    targets->bytes = (uint64_t)width * (uint64_t)height * (4 + 8 + (second ? 2 : 1) * sum_bytes(gl));
    return PBR_OK;
}

static GLsizei larger(GLsizei a, GLsizei b) {
    return a > b ? a : b;
}

static bool same_material(const pbr_material *a, const pbr_material *b) {
    return a->ambient == b->ambient && a->diffuse == b->diffuse && a->specular == b->specular && a->shininess == b->shininess;
}

uint32_t blend_group(pbr_view *view, size_t count) {
    uint32_t groups = 0;
    for (size_t i = 0; i < count; i++) {
        struct prepared_item *prepared = &view->items[i];
        if (!item_is_blended(&prepared->item) || prepared->item.flags & PBR_ITEM_HIDDEN) continue;
        const uint32_t how = prepared->variant & (VARIANT_DEFERRED | VARIANT_FILL);
        for (size_t k = i; k-- > 0 && !prepared->group;) {
            const struct prepared_item *other = &view->items[k];
            if (!other->group || how != (other->variant & (VARIANT_DEFERRED | VARIANT_FILL))) continue;
            if (!(how & VARIANT_DEFERRED) || same_material(&other->item.material, &prepared->item.material))
                prepared->group = other->group;
        }
        if (!prepared->group) prepared->group = ++groups;
    }
    return groups;
}

pbr_result blend_prepare(pbr_view *view, const struct frame_setup *setup, size_t count, uint32_t frame_variant, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    const struct targets *targets = &renderer->targets;
    const GLint *box = setup->wanted.scissor;
    bool second = targets->second != 0; /* once there, kept */
    pbr_result result = PBR_OK;
    for (size_t i = 0; i < count && result == PBR_OK; i++) {
        struct prepared_item *prepared = &view->items[i];
        if (!prepared->group) continue;
        uint32_t variant = (uint32_t)PASS_RESOLVE << VARIANT_PASS_SHIFT | (frame_variant & VARIANT_ENCODE_SRGB) |
                           (prepared->variant & VARIANT_FILL);
        if (prepared->variant & VARIANT_DEFERRED) variant |= VARIANT_DEFERRED | VARIANT_LIT | (frame_variant & VARIANT_ONE_LIGHT);
        second |= (prepared->variant & (VARIANT_DEFERRED | VARIANT_FILL)) != 0;
        result = programs_need(renderer->instance, &renderer->gl, &renderer->programs, variant,
                               &prepared->programs[PASS_RESOLVE][0], &stats->programs_compiled);
    }
    /* Grown, never shrunk: views of several sizes would take turns. An empty box needs none. */
    if (result == PBR_OK && box[2] > 0 && box[3] > 0 &&
        (box[2] > targets->width || box[3] > targets->height || (second && !targets->second)))
        result =
            make_targets(renderer, larger(box[2], targets->width), larger(box[3], targets->height), second, &stats->host_gl_error);
    if (result == PBR_OK && !renderer->empty_array) (*renderer->gl.GenVertexArrays)(1, &renderer->empty_array);
    return result;
}

static void set_window(const struct gl *gl, const struct state_wanted *wanted) {
    const GLint *v = wanted->viewport;
    const GLfloat viewport[4] = {(GLfloat)v[0], (GLfloat)v[1], (GLfloat)v[2], (GLfloat)v[3]};
    state_window(gl, viewport, wanted->scissor, wanted->depth_range);
}

/* Window coordinates and depth to eye space. */
static void set_to_eye(const struct gl *gl, const struct program *program, const struct frame_setup *setup) {
    const struct state_wanted *wanted = &setup->wanted;
    double inverse[16], window_to_clip[16] = {0}, all[16];
    const double *range = wanted->depth_range, span = range[1] - range[0];
    for (int k = 0; k < 2; k++) {
        window_to_clip[5 * k] = 2.0 / wanted->viewport[k + 2];
        window_to_clip[12 + k] = -1 - 2.0 * wanted->viewport[k] / wanted->viewport[k + 2];
    }
    /* An empty range has lost the depth: the near plane's then. */
    window_to_clip[10] = span != 0 ? (wanted->clip_zero_to_one ? 1 : 2) / span : 0;
    window_to_clip[14] = -range[0] * window_to_clip[10] - (wanted->clip_zero_to_one ? 0 : 1);
    window_to_clip[15] = 1;
    if (!matrix_inverse(setup->projection, inverse)) { /* depth is constant, and positions unknown */
        memset(inverse, 0, sizeof inverse);
        inverse[15] = 1;
    }
    matrix_multiply(inverse, window_to_clip, all);
    GLfloat floats[16];
    for (int i = 0; i < 16; i++) floats[i] = (GLfloat)all[i];
    (*gl->UniformMatrix4fv)(program->to_eye, 1, GL_FALSE, floats);
}

static void bind_textures(const struct gl *gl, const struct targets *targets) {
    const GLuint textures[STATE_TEXTURES] = {[UNIT_COLOURS] = targets->colours, targets->front, targets->second};
    for (GLuint i = 0; i < STATE_TEXTURES; i++) {
        (*gl->ActiveTexture)(GL_TEXTURE0 + i);
        (*gl->BindTexture)(GL_TEXTURE_2D, textures[i]);
        (*gl->BindSampler)(i, 0);
    }
}

static void resolve(const pbr_renderer *renderer, const struct frame_setup *setup, const struct prepared_item *one_of_group) {
    const struct gl *gl = &renderer->gl;
    struct program *program = &renderer->programs.entries[one_of_group->programs[PASS_RESOLVE][0]];
    bind_textures(gl, &renderer->targets);
    (*gl->UseProgram)(program->name);
    (*gl->Uniform1i)(program->colours, UNIT_COLOURS);
    (*gl->Uniform1i)(program->front, UNIT_FRONT);
    (*gl->Uniform2f)(program->corner, (GLfloat)setup->wanted.scissor[0], (GLfloat)setup->wanted.scissor[1]);
    if (program->second >= 0) (*gl->Uniform1i)(program->second, UNIT_SECOND);
    if (program->box >= 0) {
        const GLint *box = setup->wanted.scissor;
        const GLfloat size[3] = {(GLfloat)box[2], (GLfloat)box[3], setup->wanted.reversed ? -1.0f : 1.0f};
        (*gl->Uniform3fv)(program->box, 1, size);
    }
    if (program->material >= 0) {
        uniforms_set_lights(renderer, program, setup, &one_of_group->item.material);
        uniforms_set_eye(gl, program, setup);
        set_to_eye(gl, program, setup);
    }
    (*gl->BindVertexArray)(renderer->empty_array);
    (*gl->DepthFunc)(setup->wanted.depth_function);
    (*gl->DepthMask)(setup->wanted.depth_write ? GL_TRUE : GL_FALSE);
    if (setup->wanted.depth_test) (*gl->Enable)(GL_DEPTH_TEST);
    else (*gl->Disable)(GL_DEPTH_TEST);
    (*gl->DrawArrays)(GL_TRIANGLES, 0, 3);
}

/* Once for both passes that draw them. */
static pbr_result draw_selection(pbr_view *view, const struct frame_setup *own, size_t count, uint32_t group, pbr_stats *stats) {
    const pbr_renderer *renderer = view->renderer;
    if (!own->wanted.selects || renderer->selection.capacity == 0) return PBR_OK;
    selection_begin(renderer);
    pbr_result result = draw_items(view, own, count, PASS_SELECT, group, stats);
    selection_end(renderer);
    return result;
}

/* How far the front layer reaches. `own`: the frame as our targets see it. */
static pbr_result draw_visibility(pbr_view *view, const struct frame_setup *own, size_t count, uint32_t group, bool marks,
                                  pbr_stats *stats) {
    static const GLuint nothing[4] = {UINT32_MAX, UINT32_MAX, 0, 0};
    const struct gl *gl = &view->renderer->gl;
    const GLfloat farthest = own->wanted.reversed ? 0 : 1;
    const struct targets *targets = &view->renderer->targets;
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, marks ? targets->marks : targets->visibility);
    if (marks) state_add_up(gl, false); /* colour mask of buffer 1 */
    (*gl->DepthMask)(GL_TRUE);
    (*gl->DepthFunc)(own->wanted.reversed ? GL_GREATER : GL_LESS);
    (*gl->ClearBufferfv)(GL_DEPTH, 0, &farthest);
    (*gl->ClearBufferuiv)(GL_COLOR, 0, nothing);
    return draw_items(view, own, count, PASS_VISIBILITY, group, stats);
}

static pbr_result draw_sums(pbr_view *view, const struct frame_setup *own, size_t count, uint32_t group, bool deferred,
                            pbr_stats *stats) {
    static const GLfloat zero[4] = {0, 0, 0, 0};
    const struct gl *gl = &view->renderer->gl;
    const struct targets *targets = &view->renderer->targets;
    const int buffers = deferred ? 2 : 1;
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, deferred ? targets->deferred : targets->accumulation);
    (*gl->DepthMask)(GL_FALSE);
    (*gl->DepthFunc)(own->wanted.reversed ? GL_GEQUAL : GL_LEQUAL);
    state_add_up(gl, true); /* before the clears: they obey the colour mask of buffer 1 */
    for (int i = 0; i < buffers; i++) (*gl->ClearBufferfv)(GL_COLOR, i, zero);
    pbr_result result = draw_items(view, own, count, PASS_ACCUMULATION, group, stats);
    state_add_up(gl, false);
    return result;
}

pbr_result blend_draw(pbr_view *view, const struct frame_setup *setup, GLuint target, size_t count, uint32_t groups,
                      pbr_stats *stats) {
    const pbr_renderer *renderer = view->renderer;
    const struct gl *gl = &renderer->gl;
    pbr_result result = PBR_OK;
    if (setup->wanted.scissor[2] == 0 || setup->wanted.scissor[3] == 0) return PBR_OK;
    struct frame_setup own = *setup;
    own.several_samples = false;
    for (int i = 0; i < 2; i++) { /* our targets begin at the scissor's corner */
        own.wanted.viewport[i] -= setup->wanted.scissor[i];
        own.wanted.scissor[i] = 0;
    }
    for (uint32_t group = 1; group <= groups && result == PBR_OK; group++) {
        size_t first = 0;
        while (view->items[first].group != group) first++;
        set_window(gl, &own.wanted);
        (*gl->Enable)(GL_DEPTH_TEST);
        const uint32_t variant = view->items[first].variant;
        result = draw_selection(view, &own, count, group, stats);
        if (result == PBR_OK) result = draw_visibility(view, &own, count, group, (variant & VARIANT_FILL) != 0, stats);
        if (result == PBR_OK) result = draw_sums(view, &own, count, group, (variant & VARIANT_DEFERRED) != 0, stats);
        (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, target);
        set_window(gl, &setup->wanted);
        if (result == PBR_OK) resolve(renderer, setup, &view->items[first]);
    }
    return result;
}
