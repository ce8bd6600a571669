/* The entries of sequential point trees that a blended kind's passes draw, found once: a compute shader copies those that are of
 * the cut, in their order. Contexts without, and frames whose copies find no room, ask in every pass instead; the picture is the
 * same. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_SELECTION_H
#define PBR_GL_SELECTION_H

#include "drawable.h"
#include "lod/draw_list.h"

enum { SELECT_INVOCATIONS = 128 /* of a work group: what each OpenGL can */, SELECT_PAIR_BYTES = 32 };

/* Zero at the start. Buffers grow and are kept. */
struct selection {
    struct drawable copies;
    uint32_t capacity; /* entries */
    GLuint commands;   /* buffer: for each range a pair of struct DrawArraysIndirectCommand, as points and as quads */
    uint32_t command_capacity;
    uint32_t used, commands_used; /* by the current pass: all hand out the same places, since they draw the same lists */
    uint32_t program;             /* index */
    uint64_t most;                /* bytes of a buffer, where OpenGL refused more; 0: it has not */
    bool is_off;                  /* it refused the program */
};

/* Where the ranges of a list are copied to: one after the other, pair after pair. */
struct copies {
    uint32_t first, first_command;
};

/* Makes room for what a group of items selects, an upper bound of entries and of ranges, as far as the budget and OpenGL have it:
 * what does not fit is left to the passes, and so is all where OpenGL refuses the program. Leaves GL_ARRAY_BUFFER and the vertex
 * array binding changed. */
void selection_prepare(pbr_renderer *renderer, uint64_t entries, uint64_t ranges, GLenum *host_error, uint32_t *programs_compiled);

/* Starts a pass. */
void selection_rewind(struct selection *selection);

/* The next place for a list's entries, the same in each pass over the same lists. False: there is no room, and no pass has copies
 * of them. */
bool selection_claim(struct selection *selection, const struct draw_list *list, struct copies *out);

/* Bindings of shader storage buffers that it changes. */
enum { STORAGE_TREE, STORAGE_COPIES, STORAGE_COMMANDS, STORAGE_BINDINGS };

/* Copies are written between these. The first one makes the program current; the second one leaves the commands bound. */
void selection_begin(const pbr_renderer *renderer);
void selection_end(const pbr_renderer *renderer);

/* Selects from ranges of a page: first entry, how many, first copy, pair of commands. All other uniforms are set. */
void selection_run(const pbr_renderer *renderer, const struct drawable *page, GLuint ranges[][4], size_t count);

/* Gives the memory back; copies are made again where there is room, at no other cost. */
void selection_drop(pbr_renderer *renderer);
/* And forgets what OpenGL refused. */
void selection_free(pbr_renderer *renderer);

#endif
