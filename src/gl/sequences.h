/* GPU copies of sequential point trees, page by page: sent once, when one of its chunks is first in view, and kept until the budget
 * needs the room. The renderer holds a reference on each tree until it is evicted. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_SEQUENCES_H
#define PBR_GL_SEQUENCES_H

#include "drawable.h"
#include "frame.h"
#include "lod/spt_cut.h"

/* Some chunks that follow one another: one buffer, and one of fields once an item asks for those; sent and dropped as a whole. */
struct page {
    struct drawable drawable; /* splats 0: not on the GPU */
    uint32_t first, count;    /* chunks; at most PAGE_CHUNKS */
    uint32_t entries;
    uint64_t last_frame; /* serial number of the last frame that drew it */
};

/* As many as a call can draw: their uniforms are to fit, with all others, in the 1024 numbers that each OpenGL has room for. */
enum { PAGE_CHUNKS = 16, PAGE_BYTES = 4 << 20 /* of more than one chunk */ };

/* Whether it can be drawn. `fields`: with them. */
static inline bool page_is_there(const struct page *page, bool fields) {
    return page->drawable.splats && (!fields || page->drawable.fields);
}

struct sequence {
    pbr_lod *lod;          /* held */
    const struct spt *spt; /* its */
    struct page *pages;
    uint32_t page_count;
    uint64_t largest_page; /* bytes */
    struct place {
        uint32_t page, first; /* entry within the page */
    } * places;               /* of chunks */
    struct spt_sizes *sizes;  /* of those that have been on the GPU */
};

struct sequences {
    struct sequence **entries;
    size_t count, capacity;
};

/* The entry of a tree, made if there is none. */
pbr_result sequences_claim(pbr_renderer *renderer, const pbr_lod *lod, struct sequence **out);

/* What is in view, by the serial number of a frame: no room is made of what the current one draws. */
void sequences_mark(struct sequence *sequence, const struct draw_list *list, uint64_t frame);

/* Sends pages that are marked for the current frame and not there, with fields or without, all where it waits, else as far as
 * `*left` bytes go. `*missing`
 * counts those that are still not there. Leaves GL_ARRAY_BUFFER and the vertex array binding changed. */
enum { SEQUENCES_A_FRAME = 32 << 20 /* bytes */ };
pbr_result sequences_send(pbr_renderer *renderer, struct sequence *sequence, bool fields, bool waits, uint64_t *left,
                          size_t *missing, GLenum *host_error);

/* Drops a tree's pages, or all for NULL. */
void sequences_evict(pbr_renderer *renderer, const pbr_lod *lod);

/* Of the pages that `frame` does not draw the one that was drawn longest ago; NULL: there is none. */
struct page *sequences_oldest(const pbr_renderer *renderer, uint64_t frame);
void sequences_drop(pbr_renderer *renderer, struct page *page);

/* Names of GL objects held. */
uint64_t sequences_object_count(const struct sequences *sequences);

#endif
