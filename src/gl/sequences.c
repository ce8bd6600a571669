/* Sending chunks, and dropping them. SPDX-License-Identifier: MIT */
#include "sequences.h"

#include <string.h>

#include "lod/lod.h"
#include "renderer.h"

static uint64_t chunk_bytes(const struct sequence *sequence, uint32_t i) {
    return sequence->chunks[i].splats ? sequence->spt->chunks[i].count * sizeof(struct spt_entry) : 0;
}

/* ---- Dropping ---- */

void sequences_evict_at(pbr_renderer *renderer, size_t s, uint32_t i) {
    struct sequence *sequence = renderer->sequences.entries[s];
    const struct gl *gl = renderer_gl(renderer);
    struct drawable *chunk = &sequence->chunks[i];
    if (!chunk->splats) return;
    renderer->memory.bytes -= chunk_bytes(sequence, i);
    renderer->memory.deletions++;
    if (gl) {
        (*gl->DeleteVertexArrays)(1, &chunk->vertex_array);
        (*gl->DeleteBuffers)(1, &chunk->splats);
    }
    chunk->splats = chunk->vertex_array = 0;
}

static void free_sequence(pbr_instance *instance, struct sequence *sequence) {
    pbr_free(instance, sequence->chunks);
    pbr_free(instance, sequence->sizes);
    pbr_free(instance, sequence->last_frames);
    pbr_lod_release(&sequence->lod);
    pbr_free(instance, sequence);
}

void sequences_evict(pbr_renderer *renderer, const pbr_lod *lod) {
    for (pbr_view *view = renderer->views; view; view = view->next) view->listed = NULL;
    struct sequences *sequences = &renderer->sequences;
    for (size_t s = sequences->count; s-- > 0;) {
        struct sequence *sequence = sequences->entries[s];
        if (lod && sequence->lod != lod) continue;
        for (uint32_t i = 0; i < sequence->spt->chunk_count; i++) sequences_evict_at(renderer, s, i);
        sequences->entries[s] = sequences->entries[--sequences->count];
        free_sequence(renderer->instance, sequence);
    }
    if (lod) return;
    pbr_free(renderer->instance, sequences->entries);
    *sequences = (struct sequences){0};
}

bool sequences_oldest(const pbr_renderer *renderer, uint64_t frame, size_t *sequence, uint32_t *chunk, uint64_t *last_frame) {
    const struct sequences *sequences = &renderer->sequences;
    bool found = false;
    for (size_t s = 0; s < sequences->count; s++)
        for (uint32_t i = 0; i < sequences->entries[s]->spt->chunk_count; i++) {
            const uint64_t last = sequences->entries[s]->last_frames[i];
            if (!sequences->entries[s]->chunks[i].splats || last == frame || (found && last >= *last_frame)) continue;
            found = true;
            *sequence = s;
            *chunk = i;
            *last_frame = last;
        }
    return found;
}

/* ---- Sending ---- */

static pbr_result add(pbr_renderer *renderer, const pbr_lod *lod, struct sequence **out) {
    pbr_instance *instance = renderer->instance;
    struct sequences *sequences = &renderer->sequences;
    if (sequences->count == sequences->capacity) {
        const size_t capacity = sequences->capacity ? 2 * sequences->capacity : 8;
        struct sequence **grown =
            pbr_reallocate(instance, sequences->entries, sequences->capacity, capacity, sizeof(struct sequence *));
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        sequences->entries = grown;
        sequences->capacity = capacity;
    }
    struct sequence *sequence = pbr_allocate(instance, 1, sizeof *sequence);
    if (!sequence) return PBR_ERROR_OUT_OF_MEMORY;
    const size_t chunks = lod->spt.chunk_count > 0 ? lod->spt.chunk_count : 1;
    /* Reference counts change behind a const pointer; the tree does not. */
    sequence->lod = pbr_lod_retain((pbr_lod *)(uintptr_t)lod);
    sequence->spt = &lod->spt;
    sequence->chunks = pbr_allocate(instance, chunks, sizeof *sequence->chunks);
    sequence->sizes = pbr_allocate(instance, chunks, sizeof *sequence->sizes);
    sequence->last_frames = pbr_allocate(instance, chunks, sizeof *sequence->last_frames);
    if (!sequence->chunks || !sequence->sizes || !sequence->last_frames) {
        free_sequence(instance, sequence);
        return PBR_ERROR_OUT_OF_MEMORY;
    }
    for (uint32_t i = 0; i < sequence->spt->chunk_count; i++) {
        sequence->chunks[i].sequence = &sequence->spt->chunks[i];
        memcpy(sequence->chunks[i].origin, sequence->spt->chunks[i].origin, sizeof sequence->chunks[i].origin);
    }
    *out = sequences->entries[sequences->count++] = sequence;
    return PBR_OK;
}

pbr_result sequences_claim(pbr_renderer *renderer, const pbr_lod *lod, struct sequence **out) {
    const struct sequences *sequences = &renderer->sequences;
    for (size_t s = 0; s < sequences->count; s++)
        if (sequences->entries[s]->lod == lod) {
            *out = sequences->entries[s];
            return PBR_OK;
        }
    return add(renderer, lod, out);
}

static pbr_result send(pbr_renderer *renderer, struct sequence *sequence, uint32_t i, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    const struct spt_chunk *chunk = &sequence->spt->chunks[i];
    struct drawable *drawable = &sequence->chunks[i];
    const size_t bytes = chunk->count * sizeof(struct spt_entry);
    pbr_result result = renderer_make_room(renderer, bytes);
    if (result != PBR_OK) return result;
    (*gl->GenBuffers)(1, &drawable->splats);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, drawable->splats);
    result = renderer_allocate_buffer(renderer, bytes, sequence->spt->entries[i], GL_STATIC_DRAW, host_error);
    if (result != PBR_OK) {
        (*gl->DeleteBuffers)(1, &drawable->splats);
        drawable->splats = 0;
        return result;
    }
    renderer->memory.bytes += bytes;
    renderer->memory.uploaded += bytes;
    if (sequence->sizes[i].reach == 0) spt_measure_sizes(chunk, sequence->spt->entries[i], &sequence->sizes[i]);
    drawable_make_array(gl, drawable);
    return PBR_OK;
}

void sequences_mark(struct sequence *sequence, const struct draw_list *list, uint64_t frame) {
    for (size_t r = 0; r < list->count; r++) {
        uint64_t *last = &sequence->last_frames[list->ranges[r].chunk];
        if (*last < frame) *last = frame;
    }
}

pbr_result sequences_send(pbr_renderer *renderer, struct sequence *sequence, bool waits, uint64_t *left, size_t *missing,
                          GLenum *host_error) {
    pbr_result result = PBR_OK;
    for (uint32_t i = 0; i < sequence->spt->chunk_count && result == PBR_OK; i++) {
        if (sequence->chunks[i].splats || sequence->last_frames[i] != renderer->frame) continue;
        if (!waits && *left == 0) {
            ++*missing;
            continue;
        }
        result = send(renderer, sequence, i, host_error);
        const uint64_t bytes = chunk_bytes(sequence, i);
        *left = bytes < *left ? *left - bytes : 0;
    }
    return result;
}

uint64_t sequences_object_count(const struct sequences *sequences) {
    uint64_t count = 0;
    for (size_t s = 0; s < sequences->count; s++)
        for (uint32_t i = 0; i < sequences->entries[s]->spt->chunk_count; i++)
            count += sequences->entries[s]->chunks[i].splats ? 2 : 0;
    return count;
}
