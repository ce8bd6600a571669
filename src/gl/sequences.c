/* Sending pages, and dropping them. SPDX-License-Identifier: MIT */
#include "sequences.h"

#include "lod/lod.h"
#include "renderer.h"

static size_t entry_bytes(const struct page *page) {
    return page->entries * sizeof(struct spt_entry);
}

static size_t field_bytes(const struct page *page) {
    return page->entries * sizeof(struct normal_field);
}

/* ---- Dropping ---- */

void sequences_drop(pbr_renderer *renderer, struct page *page) {
    const struct gl *gl = renderer_gl(renderer);
    if (!page->drawable.splats) return;
    renderer->memory.bytes -= entry_bytes(page) + (page->drawable.fields ? field_bytes(page) : 0);
    renderer->memory.deletions++;
    if (gl) {
        (*gl->DeleteVertexArrays)(1, &page->drawable.vertex_array);
        (*gl->DeleteBuffers)(1, &page->drawable.splats);
        (*gl->DeleteBuffers)(1, &page->drawable.fields);
    }
    page->drawable.splats = page->drawable.fields = page->drawable.vertex_array = 0;
}

static void free_sequence(pbr_instance *instance, struct sequence *sequence) {
    pbr_free(instance, sequence->pages);
    pbr_free(instance, sequence->places);
    pbr_free(instance, sequence->sizes);
    pbr_lod_release(&sequence->lod);
    pbr_free(instance, sequence);
}

void sequences_evict(pbr_renderer *renderer, const pbr_lod *lod) {
    for (pbr_view *view = renderer->views; view; view = view->next) view->listed = NULL;
    struct sequences *sequences = &renderer->sequences;
    for (size_t s = sequences->count; s-- > 0;) {
        struct sequence *sequence = sequences->entries[s];
        if (lod && sequence->lod != lod) continue;
        for (uint32_t i = 0; i < sequence->page_count; i++) sequences_drop(renderer, &sequence->pages[i]);
        sequences->entries[s] = sequences->entries[--sequences->count];
        free_sequence(renderer->instance, sequence);
    }
    if (lod) return;
    pbr_free(renderer->instance, sequences->entries);
    *sequences = (struct sequences){0};
}

struct page *sequences_oldest(const pbr_renderer *renderer, uint64_t frame) {
    const struct sequences *sequences = &renderer->sequences;
    struct page *oldest = NULL;
    for (size_t s = 0; s < sequences->count; s++)
        for (uint32_t i = 0; i < sequences->entries[s]->page_count; i++) {
            struct page *page = &sequences->entries[s]->pages[i];
            if (!page->drawable.splats || page->last_frame == frame) continue;
            if (!oldest || page->last_frame < oldest->last_frame) oldest = page;
        }
    return oldest;
}

/* ---- Sending ---- */

static bool fits(const struct page *page, const struct spt_chunk *chunk) {
    if (page->count == 0) return true;
    return page->count < PAGE_CHUNKS && entry_bytes(page) + chunk->count * sizeof(struct spt_entry) <= PAGE_BYTES;
}

static void lay_out(struct sequence *sequence) {
    const struct spt *spt = sequence->spt;
    struct page *page = sequence->pages;
    for (uint32_t i = 0; i < spt->chunk_count; i++) {
        if (!fits(page, &spt->chunks[i])) page++;
        if (page->count == 0) page->first = i;
        sequence->places[i] = (struct place){(uint32_t)(page - sequence->pages), page->entries};
        page->drawable.is_sequence = true;
        page->entries += spt->chunks[i].count;
        page->count++;
        if (entry_bytes(page) > sequence->largest_page) sequence->largest_page = entry_bytes(page);
    }
    sequence->page_count = spt->chunk_count > 0 ? (uint32_t)(page - sequence->pages) + 1 : 0;
}

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
    sequence->pages = pbr_allocate(instance, chunks, sizeof *sequence->pages);
    sequence->places = pbr_allocate(instance, chunks, sizeof *sequence->places);
    sequence->sizes = pbr_allocate(instance, chunks, sizeof *sequence->sizes);
    if (!sequence->pages || !sequence->places || !sequence->sizes) {
        free_sequence(instance, sequence);
        return PBR_ERROR_OUT_OF_MEMORY;
    }
    lay_out(sequence);
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

/* The bound buffer, with entries or fields. A driver may find out only now that it has no memory. */
static pbr_result fill(pbr_renderer *renderer, struct sequence *sequence, const struct page *page, bool fields) {
    const struct gl *gl = &renderer->gl;
    const struct spt *spt = sequence->spt;
    const size_t size = fields ? sizeof(struct normal_field) : sizeof(struct spt_entry);
    for (uint32_t i = page->first; i < page->first + page->count; i++) {
        const void *from = fields ? (const void *)spt->fields[i] : (const void *)spt->entries[i];
        (*gl->BufferSubData)(GL_ARRAY_BUFFER, (GLintptr)(sequence->places[i].first * size),
                             (GLsizeiptr)(spt->chunks[i].count * size), from);
        if (sequence->sizes[i].reach == 0) spt_measure_sizes(&spt->chunks[i], spt->entries[i], &sequence->sizes[i]);
    }
    const GLenum error = gl_drain_errors(gl);
    if (error == GL_NO_ERROR) return PBR_OK;
    return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_GPU_MEMORY,
                   "OpenGL refuses the nodes of a sequential point tree (error 0x%04x)", (unsigned)error);
}

/* The page's entries or its fields, as a buffer that is left bound. */
static pbr_result send_buffer(pbr_renderer *renderer, struct sequence *sequence, struct page *page, bool fields,
                              GLenum *host_error) {
    const struct gl *gl = &renderer->gl;
    const size_t bytes = fields ? field_bytes(page) : entry_bytes(page);
    GLuint *buffer = fields ? &page->drawable.fields : &page->drawable.splats;
    pbr_result result = renderer_make_room(renderer, bytes);
    if (result != PBR_OK) return result;
    (*gl->GenBuffers)(1, buffer);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, *buffer);
    result = renderer_allocate_buffer(renderer, bytes, NULL, GL_STATIC_DRAW, host_error);
    if (result == PBR_OK) result = fill(renderer, sequence, page, fields);
    if (result != PBR_OK) {
        (*gl->DeleteBuffers)(1, buffer);
        *buffer = 0;
        return result;
    }
    renderer->memory.bytes += bytes;
    renderer->memory.uploaded += bytes;
    return PBR_OK;
}

/* What the page lacks. */
static pbr_result send(pbr_renderer *renderer, struct sequence *sequence, struct page *page, bool fields, GLenum *host_error) {
    pbr_result result = PBR_OK;
    if (!page->drawable.splats) {
        result = send_buffer(renderer, sequence, page, false, host_error);
        if (result == PBR_OK) drawable_make_array(&renderer->gl, &page->drawable);
    }
    if (result == PBR_OK && fields && !page->drawable.fields) result = send_buffer(renderer, sequence, page, true, host_error);
    return result;
}

void sequences_mark(struct sequence *sequence, const struct draw_list *list, uint64_t frame) {
    for (size_t r = 0; r < list->count; r++) {
        uint64_t *last = &sequence->pages[sequence->places[list->ranges[r].chunk].page].last_frame;
        if (*last < frame) *last = frame;
    }
}

pbr_result sequences_send(pbr_renderer *renderer, struct sequence *sequence, bool fields, bool waits, uint64_t *left,
                          size_t *missing, GLenum *host_error) {
    pbr_result result = PBR_OK;
    for (uint32_t i = 0; i < sequence->page_count && result == PBR_OK; i++) {
        struct page *page = &sequence->pages[i];
        if (page_is_there(page, fields) || page->last_frame != renderer->frame) continue;
        if (!waits && *left == 0) {
            ++*missing;
            continue;
        }
        const uint64_t before = renderer->memory.uploaded;
        result = send(renderer, sequence, page, fields, host_error);
        const uint64_t sent = renderer->memory.uploaded - before;
        *left = sent < *left ? *left - sent : 0;
    }
    return result;
}

uint64_t sequences_object_count(const struct sequences *sequences) {
    uint64_t count = 0;
    for (size_t s = 0; s < sequences->count; s++)
        for (uint32_t i = 0; i < sequences->entries[s]->page_count; i++) {
            const struct drawable *drawable = &sequences->entries[s]->pages[i].drawable;
            count += (drawable->splats ? 2 : 0) + (drawable->fields != 0);
        }
    return count;
}
