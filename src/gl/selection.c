/* Room for selected entries, and selecting them. SPDX-License-Identifier: MIT */
#include "selection.h"

#include "renderer.h"

static uint64_t bytes_of(const struct selection *selection) {
    return (uint64_t)selection->capacity * sizeof(struct spt_entry) + (uint64_t)selection->command_capacity * SELECT_PAIR_BYTES;
}

void selection_free(pbr_renderer *renderer) {
    struct selection *selection = &renderer->selection;
    const struct gl *gl = renderer_gl(renderer);
    if (gl && selection->commands) {
        (*gl->DeleteVertexArrays)(1, &selection->copies.vertex_array);
        (*gl->DeleteBuffers)(1, &selection->copies.splats);
        (*gl->DeleteBuffers)(1, &selection->commands);
        renderer->memory.deletions++;
    }
    renderer->memory.bytes -= bytes_of(selection);
    *selection = (struct selection){.program = selection->program};
}

/* At least what is there. */
static uint32_t grown(uint64_t wanted, uint32_t there, uint64_t most) {
    if (wanted > most) wanted = most;
    return wanted > there ? (uint32_t)wanted : there;
}

/* Buffers of these sizes instead of those that are there. */
static pbr_result allocate(pbr_renderer *renderer, uint32_t entries, uint32_t ranges, GLenum *host_error) {
    struct selection *selection = &renderer->selection;
    const struct gl *gl = &renderer->gl;
    selection_free(renderer);
    (*gl->GenBuffers)(1, &selection->commands);
    (*gl->GenBuffers)(1, &selection->copies.splats);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, selection->commands);
    pbr_result result = renderer_allocate_buffer(renderer, (size_t)ranges * SELECT_PAIR_BYTES, NULL, GL_STREAM_COPY, host_error);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, selection->copies.splats);
    if (result == PBR_OK)
        result = renderer_allocate_buffer(renderer, entries * sizeof(struct spt_entry), NULL, GL_STREAM_COPY, host_error);
    if (result != PBR_OK) {
        selection_free(renderer);
        return result;
    }
    selection->copies.is_sequence = true;
    drawable_make_array(gl, &selection->copies);
    selection->capacity = entries;
    selection->command_capacity = ranges;
    renderer->memory.bytes += bytes_of(selection);
    return PBR_OK;
}

/* A view that comes nearer is to grow seldom, so more than is asked for where there is room. */
static void reserve(pbr_renderer *renderer, uint64_t entries, uint64_t ranges, GLenum *host_error) {
    struct selection *selection = &renderer->selection;
    const uint64_t most = renderer->gl.most_storage_bytes;
    for (int generous = 1; generous >= 0; generous--) {
        const struct selection wanted = {
            .capacity = grown(entries + generous * entries / 4, selection->capacity, most / sizeof(struct spt_entry)),
            .command_capacity = grown(ranges + generous * ranges / 4, selection->command_capacity, most / SELECT_PAIR_BYTES)};
        const uint64_t more = bytes_of(&wanted) - bytes_of(selection);
        if (more == 0) return; /* OpenGL has no larger ones */
        if (!renderer_has_room(renderer, more)) continue;
        if (allocate(renderer, wanted.capacity, wanted.command_capacity, host_error) != PBR_OK) selection->refused = true;
        return;
    }
}

void selection_prepare(pbr_renderer *renderer, uint64_t entries, uint64_t ranges, GLenum *host_error, uint32_t *programs_compiled) {
    struct selection *selection = &renderer->selection;
    if (entries == 0 || selection->refused) return;
    if (programs_need(renderer->instance, &renderer->gl, &renderer->programs, VARIANT_SELECT, &selection->program,
                      programs_compiled) != PBR_OK)
        selection->refused = true;
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
