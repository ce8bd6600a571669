/* GPU copies of sequential point trees, chunk by chunk: sent once, when a chunk is first in view, and kept until the budget needs
 * the room. The renderer holds a reference on each tree until it is evicted. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_SEQUENCES_H
#define PBR_GL_SEQUENCES_H

#include "drawable.h"
#include "frame.h"
#include "lod/spt_cut.h"

struct sequence {
    pbr_lod *lod;            /* held */
    const struct spt *spt;   /* its */
    struct drawable *chunks; /* spt->chunk_count; splats 0: not on the GPU */
    struct spt_sizes *sizes; /* of those that were */
    uint64_t *last_frames;   /* serial number of the last frame that drew a chunk */
};

struct sequences {
    struct sequence **entries;
    size_t count, capacity;
};

/* The entry of a tree, made if there is none. */
pbr_result sequences_claim(pbr_renderer *renderer, const pbr_lod *lod, struct sequence **out);

/* What is in view, by the serial number of a frame: no room is made of what the current one draws. */
void sequences_mark(struct sequence *sequence, const struct draw_list *list, uint64_t frame);

/* Sends chunks that are marked for the current frame and not there, all where it waits, else as far as `*left` bytes go. `*missing`
 * counts those that are still not there. Leaves GL_ARRAY_BUFFER and the vertex array binding changed. */
enum { SEQUENCES_A_FRAME = 32 << 20 /* bytes */ };
pbr_result sequences_send(pbr_renderer *renderer, struct sequence *sequence, bool waits, uint64_t *left, size_t *missing,
                          GLenum *host_error);

/* Drops a tree's chunks, or all for NULL. */
void sequences_evict(pbr_renderer *renderer, const pbr_lod *lod);

/* Of the chunks that `frame` does not draw the one that was drawn longest ago; `*last_frame` is that. False: there is none. */
bool sequences_oldest(const pbr_renderer *renderer, uint64_t frame, size_t *sequence, uint32_t *chunk, uint64_t *last_frame);
void sequences_evict_at(pbr_renderer *renderer, size_t sequence, uint32_t chunk);

/* Names of GL objects held. */
uint64_t sequences_object_count(const struct sequences *sequences);

#endif
