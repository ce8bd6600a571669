/* Copying, reducing and reading depth. SPDX-License-Identifier: MIT */
#include "depth.h"

#include <math.h>
#include <string.h>

#include "renderer.h"

/* ---- What can be copied ---- */

/* A depth format that is blitted into one of the same kind only. */
static const struct format {
    GLint depth_bits, stencil_bits;
    bool is_float;
    GLenum internal, format, type;
    uint32_t bytes;
} formats[] = {
    {16, 0, false, GL_DEPTH_COMPONENT16, GL_DEPTH_COMPONENT, GL_UNSIGNED_SHORT, 2},
    {24, 0, false, GL_DEPTH_COMPONENT24, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, 4},
    {24, 8, false, GL_DEPTH24_STENCIL8, GL_DEPTH_STENCIL, GL_UNSIGNED_INT_24_8, 4},
    {32, 0, true, GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT, 4},
    {32, 8, true, GL_DEPTH32F_STENCIL8, GL_DEPTH_STENCIL, GL_FLOAT_32_UNSIGNED_INT_24_8_REV, 8},
};

static GLint ask_attachment(const struct gl *gl, GLenum attachment, GLenum what) {
    GLint value = 0;
    (*gl->GetFramebufferAttachmentParameteriv)(GL_DRAW_FRAMEBUFFER, attachment, what, &value);
    return value;
}

/* Of the bound draw framebuffer, with one sample a pixel; NULL: none that can be copied. */
static const struct format *find_format(const struct gl *gl, GLuint target) {
    const GLenum depth = target ? GL_DEPTH_ATTACHMENT : GL_DEPTH;
    if (ask_attachment(gl, depth, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE) return NULL;
    const GLint depth_bits = ask_attachment(gl, depth, GL_FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE);
    const bool is_float = ask_attachment(gl, depth, GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE) == GL_FLOAT;
    GLint stencil_bits = 0;
    if (target) stencil_bits = ask_attachment(gl, depth, GL_FRAMEBUFFER_ATTACHMENT_STENCIL_SIZE);
    else if (ask_attachment(gl, GL_STENCIL, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) != GL_NONE)
        stencil_bits = ask_attachment(gl, GL_STENCIL, GL_FRAMEBUFFER_ATTACHMENT_STENCIL_SIZE);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (formats[i].depth_bits == depth_bits && formats[i].stencil_bits == stencil_bits && formats[i].is_float == is_float)
            return &formats[i];
    return NULL;
}

/* Nearer replaces farther, and stays. */
static bool is_usual(const struct state_wanted *wanted) {
    const bool less = wanted->depth_function == GL_LESS || wanted->depth_function == GL_LEQUAL;
    const bool greater = wanted->depth_function == GL_GREATER || wanted->depth_function == GL_GEQUAL;
    const bool fits =
        wanted->viewport[0] <= INT32_MAX - wanted->viewport[2] && wanted->viewport[1] <= INT32_MAX - wanted->viewport[3];
    return fits && wanted->depth_test && wanted->depth_write && (wanted->reversed ? greater : less) &&
           wanted->depth_range[0] != wanted->depth_range[1];
}

/* ---- Objects ---- */

static bool make_framebuffer(const struct gl *gl, GLenum attachment, GLuint texture, GLuint *name) {
    (*gl->GenFramebuffers)(1, name);
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, *name);
    (*gl->FramebufferTexture2D)(GL_DRAW_FRAMEBUFFER, attachment, GL_TEXTURE_2D, texture, 0);
    return attachment != GL_COLOR_ATTACHMENT0 || (*gl->CheckFramebufferStatus)(GL_DRAW_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static void free_copy(const struct gl *gl, struct depth_reader *reader) {
    if (gl) {
        (*gl->DeleteFramebuffers)(1, &reader->copy_framebuffer);
        (*gl->DeleteTextures)(1, &reader->copy);
    }
    reader->copy = reader->copy_framebuffer = 0;
    reader->width = reader->height = 0;
}

static void free_frame(const struct gl *gl, struct depth_frame *frame) {
    if (gl) {
        if (frame->fence) (*gl->DeleteSync)(frame->fence);
        (*gl->DeleteFramebuffers)(1, &frame->framebuffer);
        (*gl->DeleteTextures)(1, &frame->tiles);
        (*gl->DeleteBuffers)(1, &frame->buffer);
    }
    occluders_release(&frame->occluders);
    *frame = (struct depth_frame){0};
}

static size_t tile_bytes(const struct depth_frame *frame) {
    return (size_t)frame->width * (size_t)frame->height * 4 * sizeof(GLuint);
}

static void count_bytes(struct depth_reader *reader) {
    reader->bytes = 0;
    for (int i = 0; i < DEPTH_FRAMES; i++) reader->bytes += 2 * tile_bytes(&reader->frames[i]);
    for (size_t i = 0; i < sizeof formats / sizeof *formats && reader->copy; i++)
        if (formats[i].internal == reader->format)
            reader->bytes += (uint64_t)reader->width * (uint64_t)reader->height * formats[i].bytes;
}

static bool make_copy(const struct gl *gl, struct depth_reader *reader, const struct format *format, GLsizei width,
                      GLsizei height) {
    free_copy(gl, reader);
    reader->copy = gl_make_texture(gl, format->internal, format->format, format->type, width, height);
    make_framebuffer(gl, format->stencil_bits ? GL_DEPTH_STENCIL_ATTACHMENT : GL_DEPTH_ATTACHMENT, reader->copy,
                     &reader->copy_framebuffer);
    /* Before OpenGL 4.1 a framebuffer without colours is to say so. */
    static const GLenum none = GL_NONE;
    (*gl->BindFramebuffer)(GL_READ_FRAMEBUFFER, reader->copy_framebuffer);
    (*gl->DrawBuffers)(1, &none);
    (*gl->ReadBuffer)(GL_NONE);
    reader->format = format->internal;
    reader->width = width;
    reader->height = height;
    return (*gl->CheckFramebufferStatus)(GL_DRAW_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static bool make_frame(const struct gl *gl, struct depth_frame *frame, GLsizei width, GLsizei height) {
    free_frame(gl, frame);
    frame->tiles = gl_make_texture(gl, GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, width, height);
    const bool complete = make_framebuffer(gl, GL_COLOR_ATTACHMENT0, frame->tiles, &frame->framebuffer);
    frame->width = width;
    frame->height = height;
    (*gl->GenBuffers)(1, &frame->buffer);
    (*gl->BindBuffer)(GL_PIXEL_PACK_BUFFER, frame->buffer);
    (*gl->BufferData)(GL_PIXEL_PACK_BUFFER, (GLsizeiptr)tile_bytes(frame), NULL, GL_STREAM_READ);
    return complete;
}

static struct depth_frame *next_frame(struct depth_reader *reader) {
    return &reader->frames[(reader->first + reader->count) % DEPTH_FRAMES];
}

/* What the next frame is captured with. A failure is no reason not to draw: then nothing is known to be hidden. */
static bool make_objects(pbr_renderer *renderer, struct depth_reader *reader, const struct format *format,
                         const struct frame_setup *setup, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    const GLsizei width = setup->wanted.viewport[2], height = setup->wanted.viewport[3];
    const GLsizei columns = (width - 1) / (2 * OCCLUDERS_TILE) + 1, rows = (height - 1) / (2 * OCCLUDERS_TILE) + 1;
    struct depth_frame *frame = next_frame(reader);
    const bool has_copy = reader->copy && reader->format == format->internal && reader->width >= width && reader->height >= height;
    const bool has_frame = frame->tiles && frame->width == columns && frame->height == rows;
    if (has_copy && has_frame) return true;
    const GLenum pending = gl_drain_errors(gl);
    if (*host_error == GL_NO_ERROR) *host_error = pending;
    GLint unpack = 0; /* pixels would come from it */
    (*gl->GetIntegerv)(GL_PIXEL_UNPACK_BUFFER_BINDING, &unpack);
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, 0);
    (*gl->ActiveTexture)(GL_TEXTURE0);
    bool made = has_copy || make_copy(gl, reader, format, width, height);
    if (!has_frame) made = make_frame(gl, frame, columns, rows) && made;
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, unpack && (*gl->IsBuffer)((GLuint)unpack) ? (GLuint)unpack : 0);
    made = gl_drain_errors(gl) == GL_NO_ERROR && made;
    if (!made) {
        free_copy(gl, reader);
        free_frame(gl, frame);
    }
    count_bytes(reader);
    return made;
}

/* ---- Out ---- */

static void window(const struct gl *gl, GLsizei width, GLsizei height) {
    const GLfloat viewport[4] = {0, 0, (GLfloat)width, (GLfloat)height};
    const GLint scissor[4] = {0, 0, width, height};
    static const GLdouble range[2] = {0, 1};
    state_window(gl, viewport, scissor, range);
}

static void reduce(const pbr_renderer *renderer, const struct depth_reader *reader, const struct depth_frame *frame,
                   const struct frame_setup *setup, const struct program *program) {
    const struct gl *gl = &renderer->gl;
    const GLint *v = setup->wanted.viewport;
    const GLfloat box[3] = {(GLfloat)v[2], (GLfloat)v[3], setup->wanted.reversed ? -1.0f : 1.0f};
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, frame->framebuffer);
    window(gl, frame->width, frame->height);
    (*gl->Disable)(GL_DEPTH_TEST);
    (*gl->ActiveTexture)(GL_TEXTURE0);
    (*gl->BindTexture)(GL_TEXTURE_2D, reader->copy);
    (*gl->BindSampler)(0, 0);
    (*gl->UseProgram)(program->name);
    (*gl->Uniform1i)(program->front, 0);
    (*gl->Uniform3fv)(program->box, 1, box);
    (*gl->BindVertexArray)(renderer->empty_array);
    (*gl->DrawArrays)(GL_TRIANGLES, 0, 3);
}

/* One that nobody else holds. */
static struct occluders *take_from_pool(pbr_instance *instance, struct depth_reader *reader, const GLint viewport[4]) {
    for (int i = 0; i < DEPTH_POOL; i++) {
        struct occluders **o = &reader->pool[i];
        if (*o && atomic_load_explicit(&(*o)->references, memory_order_acquire) > 1) continue;
        if (*o && ((*o)->size[0] != viewport[2] || (*o)->size[1] != viewport[3])) occluders_release(o);
        if (!*o && occluders_create(instance, viewport[2], viewport[3], o) != PBR_OK) return NULL;
        return occluders_retain(*o);
    }
    struct occluders *out = NULL; /* many cuts hold many of them */
    return occluders_create(instance, viewport[2], viewport[3], &out) == PBR_OK ? out : NULL;
}

static void describe(struct depth_frame *frame, const struct frame_setup *setup, const struct format *format, uint64_t serial) {
    struct occluders *o = frame->occluders;
    const struct state_wanted *wanted = &setup->wanted;
    const int bits = format->depth_bits < 22 ? format->depth_bits : 22; /* floats come before integers */
    memcpy(frame->range, wanted->depth_range, sizeof frame->range);
    frame->zero_to_one = wanted->clip_zero_to_one;
    o->frame = serial;
    memcpy(o->view, setup->view, sizeof o->view);
    memcpy(o->projection, setup->still, sizeof o->projection);
    memcpy(o->jitter, setup->jitter, sizeof o->jitter);
    o->sign = wanted->reversed != (wanted->depth_range[0] > wanted->depth_range[1]) ? -1 : 1;
    o->error = 4.0 / ((double)(1 << bits) * fabs(wanted->depth_range[1] - wanted->depth_range[0]));
}

void depth_capture(pbr_view *view, const struct frame_setup *setup, GLuint target, const struct program *program,
                   GLenum *host_error) {
    pbr_renderer *renderer = view->renderer;
    const struct gl *gl = &renderer->gl;
    struct depth_reader *reader = &view->depth;
    const GLint *v = setup->wanted.viewport;
    const struct format *format = is_usual(&setup->wanted) && !setup->several_samples ? find_format(gl, target) : NULL;
    const bool has_room = reader->count < DEPTH_FRAMES;
    const bool can = format && (!has_room || make_objects(renderer, reader, format, setup, host_error));
    if (!can) depth_forget(reader); /* no later picture would confirm what it hides */
    if (can && has_room) {
        struct depth_frame *frame = next_frame(reader);
        frame->occluders = take_from_pool(renderer->instance, reader, v);
        if (frame->occluders) {
            describe(frame, setup, format, renderer->frame);
            (*gl->BindFramebuffer)(GL_READ_FRAMEBUFFER, target);
            (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, reader->copy_framebuffer);
            window(gl, v[2], v[3]); /* blits obey the scissor */
            (*gl->BlitFramebuffer)(v[0], v[1], v[0] + v[2], v[1] + v[3], 0, 0, v[2], v[3], GL_DEPTH_BUFFER_BIT, GL_NEAREST);
            reduce(renderer, reader, frame, setup, program);
            frame->fence = (*gl->FenceSync)(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
            frame->state = DEPTH_REDUCED;
            reader->count++;
        }
    }
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, target);
}

/* ---- Back ---- */

static bool is_signalled(const struct gl *gl, struct depth_frame *frame) {
    if (!frame->fence) return true; /* could not be made: then what comes next waits, once */
    const GLenum state = (*gl->ClientWaitSync)(frame->fence, GL_SYNC_FLUSH_COMMANDS_BIT, 0);
    if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED) return false;
    (*gl->DeleteSync)(frame->fence);
    frame->fence = NULL;
    return true;
}

static void read_tiles(const struct gl *gl, struct depth_frame *frame) {
    (*gl->BindFramebuffer)(GL_READ_FRAMEBUFFER, frame->framebuffer);
    (*gl->BindBuffer)(GL_PIXEL_PACK_BUFFER, frame->buffer);
    state_pack_tightly(gl);
    (*gl->ReadPixels)(0, 0, frame->width, frame->height, GL_RGBA_INTEGER, GL_UNSIGNED_INT, NULL);
    frame->fence = (*gl->FenceSync)(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    frame->state = DEPTH_READ;
}

/* Window depth to sign times z over w. */
static void fill(const struct depth_frame *frame, const GLuint *texels) {
    struct occluders *o = frame->occluders;
    const double *range = frame->range, span = (frame->zero_to_one ? 1 : 2) / (range[1] - range[0]);
    const double low = frame->zero_to_one ? 0 : -1;
    for (int32_t r = 0; r < o->rows[0]; r++)
        for (int32_t c = 0; c < o->columns[0]; c++) {
            float depth;
            memcpy(&depth, texels + 4 * ((size_t)(r / 2) * (size_t)frame->width + (size_t)(c / 2)) + 2 * (r % 2) + c % 2,
                   sizeof depth);
            const float farthest = (float)(o->sign * (low + ((double)depth - range[0]) * span));
            o->levels[0][r * o->columns[0] + c] = isfinite(farthest) ? farthest : INFINITY; /* beyond the target it is anything */
        }
    occluders_finish(o);
}

static void take(const struct gl *gl, struct depth_reader *reader, struct depth_frame *frame, GLenum *host_error) {
    (*gl->BindBuffer)(GL_PIXEL_PACK_BUFFER, frame->buffer);
    const GLuint *texels = (*gl->MapBufferRange)(GL_PIXEL_PACK_BUFFER, 0, (GLsizeiptr)tile_bytes(frame), GL_MAP_READ_BIT);
    if (texels && frame->occluders) fill(frame, texels);
    const bool intact = texels && (*gl->UnmapBuffer)(GL_PIXEL_PACK_BUFFER);
    if (intact && frame->occluders) {
        occluders_release(&reader->newest);
        reader->newest = occluders_retain(frame->occluders);
    } else if (!texels) {
        const GLenum error = gl_drain_errors(gl); /* of the mapping, that of memory; another is the host's */
        if (error != GL_OUT_OF_MEMORY && *host_error == GL_NO_ERROR) *host_error = error;
    }
    occluders_release(&frame->occluders);
    frame->state = DEPTH_FREE;
}

void depth_poll(pbr_view *view, GLenum *host_error) {
    const struct gl *gl = &view->renderer->gl;
    struct depth_reader *reader = &view->depth;
    for (int i = 0; i < reader->count; i++) {
        struct depth_frame *frame = &reader->frames[(reader->first + i) % DEPTH_FRAMES];
        if (frame->state == DEPTH_REDUCED && is_signalled(gl, frame)) read_tiles(gl, frame);
    }
    while (reader->count > 0) {
        struct depth_frame *frame = &reader->frames[reader->first];
        if (frame->state != DEPTH_READ || !is_signalled(gl, frame)) break;
        take(gl, reader, frame, host_error);
        reader->first = (reader->first + 1) % DEPTH_FRAMES;
        reader->count--;
    }
}

void depth_forget(struct depth_reader *reader) {
    occluders_release(&reader->newest);
    for (int i = 0; i < DEPTH_FRAMES; i++) occluders_release(&reader->frames[i].occluders);
}

uint64_t depth_object_count(const struct depth_reader *reader) {
    uint64_t count = reader->copy ? 2 : 0;
    for (int i = 0; i < DEPTH_FRAMES; i++) count += reader->frames[i].tiles ? 3 : 0;
    return count;
}

void depth_free(const struct gl *gl, struct depth_reader *reader) {
    free_copy(gl, reader);
    for (int i = 0; i < DEPTH_FRAMES; i++) free_frame(gl, &reader->frames[i]);
    for (int i = 0; i < DEPTH_POOL; i++) occluders_release(&reader->pool[i]);
    occluders_release(&reader->newest);
    *reader = (struct depth_reader){0};
}
