/* Room for selected entries, and selecting them. SPDX-License-Identifier: MIT */
#include "selection.h"

#include "renderer.h"

_Static_assert((int)STORAGE_BINDINGS == (int)STATE_STORAGES, "each binding is given back");

static uint64_t bytes_of(const struct selection *selection) {
    return (uint64_t)selection->capacity * sizeof(struct spt_entry) + (uint64_t)selection->command_capacity * SELECT_PAIR_BYTES;
}

void selection_drop(pbr_renderer *renderer) {
    struct selection *selection = &renderer->selection;
    const struct gl *gl = renderer_gl(renderer);
    if (gl && selection->commands) {
        (*gl->DeleteVertexArrays)(1, &selection->copies.vertex_array);
        (*gl->DeleteBuffers)(1, &selection->copies.splats);
        (*gl->DeleteBuffers)(1, &selection->commands);
        renderer->memory.deletions++;
    }
    renderer->memory.bytes -= bytes_of(selection);
    *selection = (struct selection){.program = selection->program, .most = selection->most, .is_off = selection->is_off};
}

void selection_free(pbr_renderer *renderer) {
    selection_drop(renderer);
    renderer->selection.most = 0;
    renderer->selection.is_off = false;
}

/* Buffers of these sizes instead of those that are there. They are written and read by the GPU alone, and are to lie in its memory:
 * some drivers keep what is said to be streamed in the host's. */
static bool allocate(pbr_renderer *renderer, uint32_t entries, uint32_t ranges, GLenum *host_error) {
    struct selection *selection = &renderer->selection;
    const struct gl *gl = &renderer->gl;
    selection_drop(renderer);
    (*gl->GenBuffers)(1, &selection->commands);
    (*gl->GenBuffers)(1, &selection->copies.splats);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, selection->commands);
    GLenum error = renderer_try_buffer(renderer, (size_t)ranges * SELECT_PAIR_BYTES, NULL, GL_STATIC_COPY, host_error);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, selection->copies.splats);
    if (error == GL_NO_ERROR)
        error = renderer_try_buffer(renderer, entries * sizeof(struct spt_entry), NULL, GL_STATIC_COPY, host_error);
    if (error != GL_NO_ERROR) {
        selection_drop(renderer);
        return false;
    }
    selection->copies.is_sequence = true;
    drawable_make_array(gl, &selection->copies);
    selection->capacity = entries;
    selection->command_capacity = ranges;
    renderer->memory.bytes += bytes_of(selection);
    return true;
}

static uint64_t least(uint64_t a, uint64_t b) {
    return a < b ? a : b;
}

/* A quarter more than is wanted, so that a view that comes nearer grows seldom; or what the budget and OpenGL have. */
static void reserve(pbr_renderer *renderer, uint64_t entries, uint64_t ranges, GLenum *host_error) {
    const struct memory *memory = &renderer->memory;
    const struct selection old = renderer->selection;
    const uint64_t most = old.most ? old.most : renderer->gl.most_storage_bytes;
    const uint64_t room = memory->budget - memory->bytes + bytes_of(&old);
    ranges = least(ranges + ranges / 4, least(most, room) / SELECT_PAIR_BYTES);
    if (ranges < old.command_capacity) ranges = old.command_capacity; /* so that it settles */
    entries = least(entries + entries / 4, least(most, room - ranges * SELECT_PAIR_BYTES) / sizeof(struct spt_entry));
    if ((entries <= old.capacity && ranges <= old.command_capacity) || entries == 0) return;
    if (allocate(renderer, (uint32_t)entries, (uint32_t)ranges, host_error)) return;
    renderer->selection.most = entries * sizeof(struct spt_entry) / 2;
    pbr_log(renderer->instance, PBR_LOG_WARNING, PBR_OK,
            "OpenGL has no memory for %llu selected entries of sequential point trees; fewer are, which is slower",
            (unsigned long long)entries);
    if (old.capacity > 0) allocate(renderer, old.capacity, old.command_capacity, host_error);
}

void selection_prepare(pbr_renderer *renderer, uint64_t entries, uint64_t ranges, GLenum *host_error, uint32_t *programs_compiled) {
    struct selection *selection = &renderer->selection;
    if (entries == 0 || selection->is_off) return;
    const pbr_result result = programs_need(renderer->instance, &renderer->gl, &renderer->programs, VARIANT_SELECT,
                                            &selection->program, programs_compiled);
    selection->is_off = result != PBR_OK;
    if (result != PBR_OK) selection_drop(renderer);
    else if (entries > selection->capacity || ranges > selection->command_capacity) reserve(renderer, entries, ranges, host_error);
}

void selection_rewind(struct selection *selection) {
    selection->used = selection->commands_used = 0;
}

bool selection_claim(struct selection *selection, const struct draw_list *list, struct copies *out) {
    uint64_t entries = 0;
    for (size_t i = 0; i < list->count; i++) entries += list->ranges[i].count;
    if (entries > selection->capacity - selection->used || list->count > selection->command_capacity - selection->commands_used)
        return false;
    *out = (struct copies){selection->used, selection->commands_used};
    selection->used += (uint32_t)entries;
    selection->commands_used += (uint32_t)list->count;
    return true;
}

void selection_begin(const pbr_renderer *renderer) {
    const struct gl *gl = &renderer->gl;
    (*gl->UseProgram)(renderer->programs.entries[renderer->selection.program].name);
    (*gl->BindBufferBase)(GL_SHADER_STORAGE_BUFFER, STORAGE_COPIES, renderer->selection.copies.splats);
    (*gl->BindBufferBase)(GL_SHADER_STORAGE_BUFFER, STORAGE_COMMANDS, renderer->selection.commands);
    (*gl->MemoryBarrier)(GL_SHADER_STORAGE_BARRIER_BIT); /* draws before may still read */
}

void selection_run(const pbr_renderer *renderer, const struct drawable *page, GLuint ranges[][4], size_t count) {
    const struct gl *gl = &renderer->gl;
    const struct program *program = &renderer->programs.entries[renderer->selection.program];
    (*gl->BindBufferBase)(GL_SHADER_STORAGE_BUFFER, STORAGE_TREE, page->splats);
    (*gl->Uniform4uiv)(program->ranges, (GLsizei)count, ranges[0]);
    (*gl->DispatchCompute)((GLuint)count, 1, 1);
}

void selection_end(const pbr_renderer *renderer) {
    const struct gl *gl = &renderer->gl;
    (*gl->MemoryBarrier)(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_COMMAND_BARRIER_BIT);
    (*gl->BindBuffer)(GL_DRAW_INDIRECT_BUFFER, renderer->selection.commands);
}
