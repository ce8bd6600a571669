/* Uploading meshes and dropping them. SPDX-License-Identifier: MIT */
#include "meshes.h"

#include "lod/lod.h"
#include "renderer.h"

static size_t find(const struct meshes *meshes, const pbr_lod *lod) {
    size_t i = 0;
    while (i < meshes->count && meshes->entries[i]->lod != lod) i++;
    return i;
}

static void mark(uint64_t *last, uint64_t frame) {
    if (*last < frame) *last = frame;
}

void meshes_touch(struct meshes *meshes, const pbr_lod *lod, bool with_triangles, uint64_t frame) {
    const size_t i = find(meshes, lod);
    if (i == meshes->count) return;
    mark(&meshes->entries[i]->last_frame, frame);
    if (with_triangles) mark(&meshes->entries[i]->triangles_frame, frame);
}

static void free_copy(pbr_renderer *renderer, struct mesh_copy *copy) {
    const struct gl *gl = renderer_gl(renderer);
    if (gl) {
        (*gl->DeleteVertexArrays)(1, &copy->vertices.vertex_array);
        (*gl->DeleteBuffers)(1, &copy->vertices.splats);
        (*gl->DeleteBuffers)(1, &copy->triangles);
    }
    renderer->memory.bytes -= copy->bytes;
    pbr_lod_release(&copy->lod);
    pbr_free(renderer->instance, copy);
}

void meshes_evict(pbr_renderer *renderer, const pbr_lod *lod) {
    struct meshes *meshes = &renderer->meshes;
    for (size_t i = meshes->count; i-- > 0;) {
        struct mesh_copy *copy = meshes->entries[i];
        if (lod && copy->lod != lod) continue;
        meshes->entries[i] = meshes->entries[--meshes->count];
        renderer->memory.deletions++;
        free_copy(renderer, copy);
    }
    if (lod) return;
    pbr_free(renderer->instance, meshes->entries);
    *meshes = (struct meshes){0};
}

struct mesh_copy *meshes_oldest(const struct meshes *meshes, uint64_t frame) {
    struct mesh_copy *oldest = NULL;
    for (size_t i = 0; i < meshes->count; i++) {
        struct mesh_copy *copy = meshes->entries[i];
        if (copy->last_frame == frame) continue;
        if (!oldest || copy->last_frame < oldest->last_frame) oldest = copy;
    }
    return oldest;
}

struct mesh_copy *meshes_oldest_triangles(const struct meshes *meshes, uint64_t frame) {
    struct mesh_copy *oldest = NULL;
    for (size_t i = 0; i < meshes->count; i++) {
        struct mesh_copy *copy = meshes->entries[i];
        if (!copy->triangles || copy->triangles_frame == frame) continue;
        if (!oldest || copy->triangles_frame < oldest->triangles_frame) oldest = copy;
    }
    return oldest;
}

static size_t triangle_bytes(const struct mesh_copy *copy) {
    return (size_t)copy->pop->shape.levels[0].count * sizeof *copy->pop->triangles;
}

void meshes_drop_triangles(pbr_renderer *renderer, struct mesh_copy *copy) {
    const struct gl *gl = renderer_gl(renderer);
    if (gl) (*gl->DeleteBuffers)(1, &copy->triangles);
    copy->triangles = 0;
    copy->bytes -= triangle_bytes(copy);
    renderer->memory.bytes -= triangle_bytes(copy);
    renderer->memory.deletions++;
}

uint64_t meshes_object_count(const struct meshes *meshes) {
    uint64_t count = 0;
    for (size_t i = 0; i < meshes->count; i++) count += 2 + (meshes->entries[i]->triangles != 0);
    return count;
}

/* ---- Uploading ---- */

/* A buffer of so many bytes for the copy, bound to GL_ARRAY_BUFFER. */
static pbr_result fill_buffer(pbr_renderer *renderer, struct mesh_copy *copy, const void *data, size_t bytes, GLuint *buffer,
                              GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    pbr_result result = renderer_make_room(renderer, bytes);
    if (result != PBR_OK) return result;
    (*gl->GenBuffers)(1, buffer);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, *buffer);
    result = renderer_allocate_buffer(renderer, bytes, data, GL_STATIC_DRAW, host_error);
    if (result != PBR_OK) {
        (*gl->DeleteBuffers)(1, buffer);
        *buffer = 0;
        return result;
    }
    copy->bytes += bytes;
    renderer->memory.bytes += bytes;
    renderer->memory.uploaded += bytes;
    return PBR_OK;
}

static pbr_result upload_vertices(pbr_renderer *renderer, struct mesh_copy *copy, GLenum *host_error) {
    const struct pop *pop = copy->pop;
    pbr_result result = fill_buffer(renderer, copy, pop->vertices, (size_t)pop->vertex_count * sizeof *pop->vertices,
                                    &copy->vertices.splats, host_error);
    if (result == PBR_OK) drawable_make_array(&renderer->gl, &copy->vertices);
    return result;
}

static pbr_result add(pbr_renderer *renderer, const pbr_lod *lod, struct mesh_copy **out, GLenum *host_error) {
    pbr_instance *instance = renderer->instance;
    struct meshes *meshes = &renderer->meshes;
    if (meshes->count == meshes->capacity) {
        const size_t capacity = meshes->capacity ? 2 * meshes->capacity : 8;
        struct mesh_copy **grown =
            pbr_reallocate(instance, meshes->entries, meshes->capacity, capacity, sizeof(struct mesh_copy *));
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        meshes->entries = grown;
        meshes->capacity = capacity;
    }
    struct mesh_copy *copy = pbr_allocate(instance, 1, sizeof *copy);
    if (!copy) return PBR_ERROR_OUT_OF_MEMORY;
    /* Reference counts change behind a const pointer; the hierarchy does not. */
    copy->lod = pbr_lod_retain((pbr_lod *)(uintptr_t)lod);
    copy->pop = &lod->pop;
    copy->last_frame = renderer->frame;
    pbr_result result = upload_vertices(renderer, copy, host_error);
    if (result != PBR_OK) {
        free_copy(renderer, copy);
        return result;
    }
    *out = meshes->entries[meshes->count++] = copy;
    return PBR_OK;
}

pbr_result meshes_acquire(pbr_renderer *renderer, const pbr_lod *lod, bool with_triangles, struct mesh_copy **out,
                          GLenum *host_error) {
    const size_t i = find(&renderer->meshes, lod);
    struct mesh_copy *copy = i < renderer->meshes.count ? renderer->meshes.entries[i] : NULL;
    pbr_result result = PBR_OK;
    if (!copy && lod->pop.vertex_count > (uint64_t)renderer->gl.largest_index + 1)
        return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "a mesh of %llu vertices, OpenGL's limit is %llu here",
                       (unsigned long long)lod->pop.vertex_count, (unsigned long long)renderer->gl.largest_index + 1);
    if (!copy) result = add(renderer, lod, &copy, host_error);
    if (result != PBR_OK) return result;
    mark(&copy->last_frame, renderer->frame);
    if (with_triangles) mark(&copy->triangles_frame, renderer->frame);
    if (with_triangles && !copy->triangles)
        result = fill_buffer(renderer, copy, copy->pop->triangles, triangle_bytes(copy), &copy->triangles, host_error);
    *out = copy;
    return result;
}

uint64_t meshes_missing(const pbr_renderer *renderer, const pbr_lod *lod, bool with_triangles) {
    const size_t i = find(&renderer->meshes, lod);
    const struct mesh_copy *copy = i < renderer->meshes.count ? renderer->meshes.entries[i] : NULL;
    const struct pop *pop = &lod->pop;
    const uint64_t vertices = copy ? 0 : pop->vertex_count * sizeof *pop->vertices;
    return vertices + (!with_triangles || (copy && copy->triangles) ? 0 : pop->shape.levels[0].count * sizeof *pop->triangles);
}

void meshes_release_triangles(pbr_renderer *renderer, const pbr_lod *lod) {
    const size_t i = find(&renderer->meshes, lod);
    if (i < renderer->meshes.count) renderer->meshes.entries[i]->triangles_frame = renderer->frame - 1;
}
