/* Uploading point sets and dropping them. SPDX-License-Identifier: MIT */
#include "resident.h"

#include <string.h>

#include "core/normal_field.h"
#include "renderer.h"

/* `count` if there is none. Starts where the last search ended: the next item is most often the same set or the next one. */
static size_t find_index(struct residents *residents, const pbr_points *points) {
    size_t i = residents->last_found;
    for (size_t tried = 0; tried < residents->count; tried++, i++) {
        if (i >= residents->count) i = 0;
        if (residents->entries[i]->points == points) return residents->last_found = i;
    }
    return residents->count;
}

static struct resident *find(struct residents *residents, const pbr_points *points) {
    const size_t i = find_index(residents, points);
    return i < residents->count ? residents->entries[i] : NULL;
}

void residents_touch(struct residents *residents, const pbr_points *points, uint64_t frame) {
    struct resident *resident = find(residents, points);
    if (resident) resident->last_frame = frame;
}

static void free_chunk(const struct gl *gl, const struct resident *resident, struct drawable *chunk) {
    if (gl) {
        (*gl->DeleteVertexArrays)(1, &chunk->vertex_array);
        (*gl->DeleteBuffers)(1, &chunk->splats);
        (*gl->DeleteBuffers)(1, &chunk->fields);
        if (chunk->scalars) (*gl->DeleteBuffers)((GLsizei)resident->points->scalar_count, chunk->scalars);
    }
    pbr_free(resident->points->instance, chunk->scalars);
}

static void free_resident(pbr_instance *instance, const struct gl *gl, struct resident *resident) {
    for (uint32_t i = 0; resident->chunks && i < resident->blocks.chunk_count; i++) free_chunk(gl, resident, &resident->chunks[i]);
    pbr_free(instance, resident->chunks);
    blocks_free(instance, &resident->blocks);
    pbr_points_release(&resident->points);
    pbr_free(instance, resident);
}

void residents_evict_at(pbr_renderer *renderer, size_t i) {
    struct residents *residents = &renderer->residents;
    struct resident *resident = residents->entries[i];
    residents->entries[i] = residents->entries[--residents->count];
    renderer->memory.bytes -= resident->bytes;
    renderer->memory.deletions++;
    free_resident(renderer->instance, renderer_gl(renderer), resident);
}

void residents_evict(pbr_renderer *renderer, const pbr_points *points) {
    struct residents *residents = &renderer->residents;
    if (points) {
        size_t i = find_index(residents, points);
        if (i < residents->count) residents_evict_at(renderer, i);
        return;
    }
    while (residents->count > 0) residents_evict_at(renderer, residents->count - 1);
    pbr_free(renderer->instance, residents->entries);
    residents->entries = NULL;
    residents->capacity = 0;
}

size_t residents_oldest(const struct residents *residents, uint64_t frame) {
    size_t oldest = residents->count;
    for (size_t i = 0; i < residents->count; i++) {
        const struct resident *resident = residents->entries[i];
        if (resident->last_frame == frame) continue;
        if (oldest == residents->count || resident->last_frame < residents->entries[oldest]->last_frame) oldest = i;
    }
    return oldest;
}

/* Fills a new buffer, left bound to GL_ARRAY_BUFFER. */
static pbr_result fill_buffer(pbr_renderer *renderer, const void *data, size_t bytes, GLuint *out, GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    (*gl->GenBuffers)(1, out);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, *out);
    pbr_result result = renderer_allocate_buffer(renderer, bytes, data, GL_STATIC_DRAW, host_error);
    if (result != PBR_OK) {
        (*gl->DeleteBuffers)(1, out);
        *out = 0;
        return result;
    }
    renderer->memory.uploaded += bytes;
    return PBR_OK;
}

static pbr_result upload_chunk(pbr_renderer *renderer, struct resident *resident, uint32_t i, struct splat *staging,
                               GLenum *host_error) {
    struct drawable *chunk = &resident->chunks[i];
    blocks_pack(resident->points, &resident->blocks, i, staging);
    pbr_result result =
        fill_buffer(renderer, staging, resident->blocks.chunks[i].count * sizeof *staging, &chunk->splats, host_error);
    if (result != PBR_OK) return result;
    memcpy(chunk->origin, resident->blocks.chunks[i].origin, sizeof chunk->origin);
    drawable_make_array(&renderer->gl, chunk);
    return PBR_OK;
}

static pbr_result upload_splats(pbr_renderer *renderer, struct resident *resident, GLenum *host_error) {
    const struct blocks *blocks = &resident->blocks;
    uint32_t largest = 0;
    for (uint32_t i = 0; i < blocks->chunk_count; i++)
        if (blocks->chunks[i].count > largest) largest = blocks->chunks[i].count;
    struct splat *staging = pbr_allocate(renderer->instance, largest, sizeof *staging);
    if (!staging) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = PBR_OK;
    for (uint32_t i = 0; i < blocks->chunk_count && result == PBR_OK; i++)
        result = upload_chunk(renderer, resident, i, staging, host_error);
    pbr_free(renderer->instance, staging);
    return result;
}

static pbr_result reserve_entry(pbr_instance *instance, struct residents *residents) {
    if (residents->count < residents->capacity) return PBR_OK;
    size_t capacity = residents->capacity ? 2 * residents->capacity : 16;
    struct resident **grown =
        pbr_reallocate(instance, residents->entries, residents->capacity, capacity, sizeof(struct resident *));
    if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
    residents->entries = grown;
    residents->capacity = capacity;
    return PBR_OK;
}

static pbr_result create_resident(pbr_renderer *renderer, const pbr_points *points, struct resident **out, GLenum *host_error) {
    pbr_instance *instance = renderer->instance;
    struct residents *residents = &renderer->residents;
    pbr_result result = reserve_entry(instance, residents);
    if (result != PBR_OK) return result;
    uint64_t bytes = points->count * sizeof(struct splat);
    result = renderer_make_room(renderer, bytes);
    if (result != PBR_OK) return result;
    struct resident *resident = pbr_allocate(instance, 1, sizeof *resident);
    if (!resident) return PBR_ERROR_OUT_OF_MEMORY;
    /* Reference counts change behind a const pointer; the points do not. */
    resident->points = pbr_points_retain((pbr_points *)(uintptr_t)points);
    result = blocks_build(points, &resident->blocks);
    if (result != PBR_OK) goto failed;
    resident->chunks = pbr_allocate(instance, resident->blocks.chunk_count, sizeof *resident->chunks);
    if (!resident->chunks) {
        result = PBR_ERROR_OUT_OF_MEMORY;
        goto failed;
    }
    if (points->count > 0) result = upload_splats(renderer, resident, host_error);
    if (result != PBR_OK) goto failed;
    resident->bytes = bytes;
    renderer->memory.bytes += bytes;
    residents->entries[residents->count++] = resident;
    *out = resident;
    return PBR_OK;
failed:
    free_resident(instance, &renderer->gl, resident);
    return result;
}

static pbr_result upload_scalar_chunk(pbr_renderer *renderer, struct resident *resident, uint32_t i, uint32_t scalar,
                                      GLenum *host_error) {
    pbr_instance *instance = renderer->instance;
    const struct chunk *source = &resident->blocks.chunks[i];
    struct drawable *chunk = &resident->chunks[i];
    if (!chunk->scalars) {
        chunk->scalars = pbr_allocate(instance, resident->points->scalar_count, sizeof *chunk->scalars);
        if (!chunk->scalars) return PBR_ERROR_OUT_OF_MEMORY;
    }
    if (chunk->scalars[scalar]) return PBR_OK;
    float *staging = pbr_allocate(instance, source->count, sizeof *staging);
    if (!staging) return PBR_ERROR_OUT_OF_MEMORY;
    const float *values = resident->points->scalars[scalar].values;
    for (uint32_t k = 0; k < source->count; k++) staging[k] = values[resident->blocks.order[source->first + k]];
    pbr_result result = fill_buffer(renderer, staging, source->count * sizeof *staging, &chunk->scalars[scalar], host_error);
    pbr_free(instance, staging);
    if (result != PBR_OK) return result;
    resident->bytes += source->count * sizeof *staging;
    renderer->memory.bytes += source->count * sizeof *staging;
    return PBR_OK;
}

static pbr_result upload_scalar(pbr_renderer *renderer, struct resident *resident, uint32_t scalar, GLenum *host_error) {
    const struct blocks *blocks = &resident->blocks;
    if (blocks->chunk_count == 0) return PBR_OK;
    uint64_t missing = 0;
    for (uint32_t i = 0; i < blocks->chunk_count; i++)
        if (!resident->chunks[i].scalars || !resident->chunks[i].scalars[scalar]) missing += blocks->chunks[i].count;
    if (missing == 0) return PBR_OK;
    resident->last_frame = renderer->frame; /* must not be evicted for its own sake */
    pbr_result result = renderer_make_room(renderer, missing * sizeof(float));
    for (uint32_t i = 0; i < blocks->chunk_count && result == PBR_OK; i++)
        result = upload_scalar_chunk(renderer, resident, i, scalar, host_error);
    return result;
}

/* Fits the set's fields and uploads those of all chunks, or none. */
static pbr_result upload_fields(pbr_renderer *renderer, struct resident *resident, GLenum *host_error) {
    pbr_instance *instance = renderer->instance;
    const struct blocks *blocks = &resident->blocks;
    const uint64_t count = resident->points->count, bytes = count * sizeof(struct normal_field);
    if (blocks->chunk_count == 0 || resident->chunks[0].fields) return PBR_OK;
    resident->last_frame = renderer->frame; /* must not be evicted for its own sake */
    pbr_result result = renderer_make_room(renderer, bytes);
    if (result != PBR_OK) return result;
    struct normal_field *fitted = pbr_allocate(instance, (size_t)count, sizeof *fitted);
    struct normal_field *staging = pbr_allocate(instance, (size_t)count, sizeof *staging);
    result = fitted && staging ? normal_field_fit(resident->points, 0, NULL, fitted) : PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < count && result == PBR_OK; i++) staging[i] = fitted[blocks->order[i]];
    for (uint32_t i = 0; i < blocks->chunk_count && result == PBR_OK; i++)
        result = fill_buffer(renderer, staging + blocks->chunks[i].first, blocks->chunks[i].count * sizeof *staging,
                             &resident->chunks[i].fields, host_error);
    pbr_free(instance, staging);
    pbr_free(instance, fitted);
    if (result == PBR_OK) {
        resident->bytes += bytes;
        renderer->memory.bytes += bytes;
        return PBR_OK;
    }
    for (uint32_t i = 0; i < blocks->chunk_count; i++) {
        (*renderer->gl.DeleteBuffers)(1, &resident->chunks[i].fields);
        resident->chunks[i].fields = 0;
    }
    return result;
}

pbr_result residents_acquire(pbr_renderer *renderer, const pbr_points *points, struct streams streams, struct resident **out,
                             GLenum *host_error) {
    struct resident *resident = find(&renderer->residents, points);
    pbr_result result = PBR_OK;
    if (!resident) result = create_resident(renderer, points, &resident, host_error);
    if (result == PBR_OK && streams.scalar >= 0) result = upload_scalar(renderer, resident, (uint32_t)streams.scalar, host_error);
    if (result == PBR_OK && streams.fields) result = upload_fields(renderer, resident, host_error);
    if (result != PBR_OK) return result;
    resident->last_frame = renderer->frame;
    *out = resident;
    return PBR_OK;
}

uint64_t residents_object_count(const struct residents *residents) {
    uint64_t count = 0;
    for (size_t i = 0; i < residents->count; i++) {
        const struct resident *resident = residents->entries[i];
        for (uint32_t c = 0; c < resident->blocks.chunk_count; c++) {
            count += 2 + (resident->chunks[c].fields != 0);
            for (uint32_t s = 0; resident->chunks[c].scalars && s < resident->points->scalar_count; s++)
                count += resident->chunks[c].scalars[s] != 0;
        }
    }
    return count;
}
