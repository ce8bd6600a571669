/* Filling buffers in turn. SPDX-License-Identifier: MIT */
#include "stream.h"

#include <string.h>

#include "renderer.h"

static void forget_fence(const struct gl *gl, struct stream *stream, int i) {
    if (gl && stream->fences[i]) (*gl->DeleteSync)(stream->fences[i]);
    stream->fences[i] = NULL;
    stream->busy[i] = false;
}

/* Whatever has been drawn from the buffer lies before the fence. */
static void leave(const struct gl *gl, struct stream *stream, int i) {
    forget_fence(gl, stream, i);
    stream->fences[i] = (*gl->FenceSync)(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    stream->busy[i] = true;
}

/* Asks, never waits. */
static bool is_idle(const struct gl *gl, struct stream *stream, int i) {
    if (!stream->busy[i]) return true;
    if (!stream->fences[i]) return false;
    const GLenum state = (*gl->ClientWaitSync)(stream->fences[i], 0, 0);
    if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED) return false;
    forget_fence(gl, stream, i);
    return true;
}

/* One that the GPU is done with, else one that was not used yet, else the one that has been busy longest. */
static int next_buffer(const struct gl *gl, struct stream *stream) {
    for (int unused = 0; unused < 2; unused++)
        for (int k = 1; k < STREAM_BUFFERS; k++) {
            const int i = (stream->current + k) % STREAM_BUFFERS;
            if ((stream->capacities[i] == 0) == (unused == 1) && is_idle(gl, stream, i)) return i;
        }
    return (stream->current + 1) % STREAM_BUFFERS;
}

static void bind_buffer(const struct gl *gl, struct drawable *buffer) {
    const bool is_new = !buffer->splats;
    if (is_new) (*gl->GenBuffers)(1, &buffer->splats);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, buffer->splats);
    if (is_new) drawable_make_array(gl, buffer);
}

/* Gives the bound buffer i other memory: what the GPU reads stays with the driver until it is done. */
static pbr_result allocate(pbr_renderer *renderer, struct stream *stream, int i, size_t bytes, GLenum *host_error) {
    pbr_result result = renderer_allocate_buffer(renderer, bytes, NULL, GL_STREAM_DRAW, host_error);
    if (result != PBR_OK) bytes = 0;
    renderer->memory.bytes = renderer->memory.bytes - stream->capacities[i] + bytes;
    stream->capacities[i] = bytes;
    forget_fence(&renderer->gl, stream, i);
    return result;
}

static void give_up_others(pbr_renderer *renderer, struct stream *stream, int i) {
    const struct gl *gl = &renderer->gl;
    for (int k = 0; k < STREAM_BUFFERS; k++) {
        if (k == i || stream->capacities[k] == 0) continue;
        (*gl->BindBuffer)(GL_ARRAY_BUFFER, stream->buffers[k].splats);
        (*gl->BufferData)(GL_ARRAY_BUFFER, 0, NULL, GL_STREAM_DRAW);
        renderer->memory.bytes -= stream->capacities[k];
        stream->capacities[k] = 0;
        forget_fence(gl, stream, k);
    }
}

/* More than asked for, so that a growing cut allocates seldom. */
static size_t generous(const struct stream *stream, int i, size_t bytes) {
    const size_t grown = stream->capacities[i] + stream->capacities[i] / 8, others = stream->capacities[stream->current];
    const size_t most = grown > others ? grown : others;
    return most > bytes ? most : bytes;
}

/* Binds a buffer of at least so many bytes: `*i`, or the current one again where the budget has no room for a ring. A ring does not
 * displace what others have drawn, as that costs more than new memory for one buffer. */
static pbr_result reserve(pbr_renderer *renderer, struct stream *stream, int *i, size_t bytes, GLenum *host_error) {
    const size_t *capacities = stream->capacities;
    size_t wanted = generous(stream, *i, bytes);
    if (capacities[*i] < bytes && *i != stream->current && !renderer_has_room(renderer, wanted - capacities[*i]))
        *i = stream->current;
    if (capacities[*i] < bytes && !renderer_has_room(renderer, bytes - capacities[*i])) give_up_others(renderer, stream, *i);
    bind_buffer(&renderer->gl, &stream->buffers[*i]);
    if (capacities[*i] >= bytes) return PBR_OK;
    wanted = generous(stream, *i, bytes);
    if (!renderer_has_room(renderer, wanted - capacities[*i])) wanted = bytes;
    pbr_result result = renderer_make_room(renderer, wanted - capacities[*i]);
    return result == PBR_OK ? allocate(renderer, stream, *i, wanted, host_error) : result;
}

static size_t cut_bytes(const struct cut *cut) {
    return cut->count * sizeof(struct splat) + cut->triangle_count * sizeof(uint32_t[3]);
}

static void gather(const pbr_lod *lod, const struct cut *cut, void *to) {
    struct splat *records = to;
    lod_gather(lod, cut, records, (uint32_t(*)[3])(void *)(records + cut->count));
}

/* Into the bound buffer, which nobody reads. */
static pbr_result write_cut(pbr_renderer *renderer, const pbr_lod *lod, const struct cut *cut, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    const GLbitfield access = GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_RANGE_BIT | GL_MAP_UNSYNCHRONIZED_BIT;
    const GLsizeiptr bytes = (GLsizeiptr)cut_bytes(cut);
    void *to = (*gl->MapBufferRange)(GL_ARRAY_BUFFER, 0, bytes, access);
    if (to) {
        gather(lod, cut, to);
        if ((*gl->UnmapBuffer)(GL_ARRAY_BUFFER)) return PBR_OK;
    } else { /* it left an error, that of memory; another is the host's */
        const GLenum error = gl_drain_errors(gl);
        if (error != GL_OUT_OF_MEMORY && *host_error == GL_NO_ERROR) *host_error = error;
    }
    to = pbr_allocate(renderer->instance, (size_t)bytes, 1);
    if (!to) return PBR_ERROR_OUT_OF_MEMORY;
    gather(lod, cut, to);
    (*gl->BufferSubData)(GL_ARRAY_BUFFER, 0, bytes, to);
    pbr_free(renderer->instance, to);
    return PBR_OK;
}

pbr_result stream_fill(pbr_renderer *renderer, struct stream *stream, const pbr_lod *lod, const struct cut *cut, GLenum *host_error,
                       uint32_t *orphaned) {
    const struct gl *gl = &renderer->gl;
    const size_t bytes = cut_bytes(cut);
    int i = stream->current;
    if (stream->filled) {
        leave(gl, stream, i);
        i = next_buffer(gl, stream);
    }
    pbr_result result = reserve(renderer, stream, &i, bytes, host_error);
    if (result == PBR_OK && !is_idle(gl, stream, i)) {
        ++*orphaned;
        result = allocate(renderer, stream, i, stream->capacities[i], host_error);
    }
    if (result == PBR_OK && i == stream->current) stream->filled = false; /* the last records are written over */
    if (result == PBR_OK) result = write_cut(renderer, lod, cut, host_error);
    stream->filled = stream->filled && stream->capacities[stream->current] > 0;
    if (result != PBR_OK) return result;
    renderer->memory.uploaded += bytes;
    stream->current = i;
    stream->filled = true;
    return PBR_OK;
}

uint64_t stream_bytes(const struct stream *stream) {
    uint64_t bytes = 0;
    for (int i = 0; i < STREAM_BUFFERS; i++) bytes += stream->capacities[i];
    return bytes;
}

uint64_t stream_object_count(const struct stream *stream) {
    uint64_t count = 0;
    for (int i = 0; i < STREAM_BUFFERS; i++) count += stream->buffers[i].splats ? 2 : 0;
    return count;
}

void stream_free(pbr_renderer *renderer, struct stream *stream) {
    const struct gl *gl = renderer_gl(renderer);
    for (int i = 0; i < STREAM_BUFFERS; i++) {
        forget_fence(gl, stream, i);
        if (!gl || !stream->buffers[i].splats) continue;
        renderer->memory.deletions++;
        (*gl->DeleteVertexArrays)(1, &stream->buffers[i].vertex_array);
        (*gl->DeleteBuffers)(1, &stream->buffers[i].splats);
    }
    renderer->memory.bytes -= stream_bytes(stream);
    *stream = (struct stream){0};
}
