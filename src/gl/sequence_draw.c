/* Pages, their chunks, and what draws them. SPDX-License-Identifier: MIT */
#include "sequence_draw.h"

#include <math.h>
#include <string.h>

#include "uniforms.h"

pbr_result sequence_list(pbr_view *view, const struct placement *placement) {
    const struct sequence *sequence = placement->prepared->sequence;
    const uint64_t uploads = view->renderer->memory.uploaded;
    struct cut_view wanted;
    placement_view(placement, &view->renderer->gl, item_is_blended(&placement->prepared->item) ? PASS_ACCUMULATION : PASS_OPAQUE,
                   &wanted);
    if (view->listed == sequence && view->listed_uploads == uploads && memcmp(&view->listed_view, &wanted, sizeof wanted) == 0)
        return PBR_OK;
    view->list.count = 0;
    view->list.visited = view->list.culled = 0;
    view->listed = sequence;
    view->listed_uploads = uploads;
    memcpy(&view->listed_view, &wanted, sizeof wanted);
    const pbr_result result = spt_list(view->renderer->instance, sequence->spt, sequence->sizes, &wanted, &view->list);
    if (result != PBR_OK) view->listed = NULL;
    return result;
}

static pbr_result find_ranges(pbr_view *view, const struct placement *placement, enum pass pass, pbr_stats *stats) {
    const double start = renderer_seconds();
    pbr_result result = sequence_list(view, placement);
    stats->cut_seconds += renderer_seconds() - start;
    if (pass == PASS_ACCUMULATION || pass == PASS_SELECT) return result; /* the same again */
    stats->nodes_visited += view->list.visited;
    stats->splats_culled += view->list.culled;
    stats->threshold = fmaxf(stats->threshold, (float)placement->setup->threshold);
    return result;
}

bool sequence_can_be_selected(const pbr_renderer *renderer, const struct prepared_item *prepared) {
    return item_selects(prepared) && prepared->sequence->largest_page <= renderer->gl.most_storage_bytes;
}

/* Ranges of one page, from `first` on, at most so many. */
static size_t batch_length(const struct sequence *sequence, const struct draw_list *list, size_t first, size_t most) {
    const uint32_t page = sequence->places[list->ranges[first].chunk].page;
    size_t count = 1;
    while (count < most && first + count < list->count && sequence->places[list->ranges[first + count].chunk].page == page) count++;
    return count;
}

static uint32_t first_entry(const struct sequence *sequence, const struct draw_range *range) {
    return sequence->places[range->chunk].first + range->first;
}

/* Selects the entries of the view's draw list. */
static void select_entries(pbr_view *view, const struct placement *placement, const struct copies *copies) {
    const pbr_renderer *renderer = view->renderer;
    const struct gl *gl = &renderer->gl;
    const struct sequence *sequence = placement->prepared->sequence;
    const struct program *program = &renderer->programs.entries[renderer->selection.program];
    const struct draw_list *list = &view->list;
    uint32_t to = copies->first;
    uniforms_set_cut(gl, program, placement);
    for (size_t i = 0, count; i < list->count; i += count) {
        const struct page *page = &sequence->pages[sequence->places[list->ranges[i].chunk].page];
        GLuint ranges[PAGE_CHUNKS][4];
        count = batch_length(sequence, list, i, PAGE_CHUNKS);
        for (size_t k = 0; k < count; k++) {
            const struct draw_range *range = &list->ranges[i + k];
            const GLuint one[4] = {first_entry(sequence, range), range->count, to, copies->first_command + (GLuint)(i + k)};
            memcpy(ranges[k], one, sizeof one);
            to += range->count;
        }
        if (!page->drawable.splats) continue;
        uniforms_set_selection(gl, program, placement, sequence->spt, &list->ranges[i], count);
        selection_run(renderer, &page->drawable, ranges, count);
    }
}

/* Draws ranges of a page. */
static void draw_batch(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct page *page, bool quads,
                       const struct draw_range *ranges, size_t count) {
    const struct gl *gl = &renderer->gl;
    GLint firsts[PAGE_CHUNKS];
    GLsizei counts[PAGE_CHUNKS];
    for (size_t i = 0; i < count; i++) {
        firsts[i] = (GLint)first_entry(prepared->sequence, &ranges[i]);
        counts[i] = (GLsizei)ranges[i].count;
    }
    if (quads) {
        draw_bind_quads(renderer, prepared, &page->drawable, (uint32_t)firsts[0]);
        (*gl->DrawArraysInstanced)(GL_TRIANGLE_STRIP, 0, 4, counts[0]);
        return;
    }
    draw_bind_points(renderer, prepared, &page->drawable);
    if (count == 1) (*gl->DrawArrays)(GL_POINTS, firsts[0], counts[0]);
    else (*gl->MultiDrawArrays)(GL_POINTS, firsts, counts, (GLsizei)count);
}

/* Draws what was selected, to `first` on for the first of them, by pairs of commands from `command` on. */
static void draw_copies(const pbr_renderer *renderer, const struct prepared_item *prepared, bool quads, uint32_t first,
                        uint32_t command, size_t count) {
    const struct gl *gl = &renderer->gl;
    const struct drawable *copies = &renderer->selection.copies;
    const size_t at = (size_t)command * SELECT_PAIR_BYTES;
    if (quads) {
        draw_bind_quads(renderer, prepared, copies, first);
        (*gl->DrawArraysIndirect)(GL_TRIANGLE_STRIP, (const void *)(at + SELECT_PAIR_BYTES / 2));
        return;
    }
    (*gl->BindVertexArray)(copies->vertex_array);
    if (count == 1) (*gl->DrawArraysIndirect)(GL_POINTS, (const void *)at);
    else (*gl->MultiDrawArraysIndirect)(GL_POINTS, (const void *)at, (GLsizei)count, SELECT_PAIR_BYTES);
}

/* copies: where the list's entries were selected to, or NULL. */
static void draw_chunks(pbr_view *view, const struct placement *placement, enum pass pass, bool quads, const struct copies *copies,
                        pbr_stats *stats) {
    static const double nowhere[3] = {0, 0, 0};
    pbr_renderer *renderer = view->renderer;
    const struct gl *gl = &renderer->gl;
    const struct prepared_item *prepared = placement->prepared;
    const struct sequence *sequence = prepared->sequence;
    const struct draw_list *list = &view->list;
    struct program *program = &renderer->programs.entries[prepared->programs[pass][quads]];
    const bool fields = item_streams(prepared).fields;
    uint32_t first = copies ? copies->first : 0;
    bool is_used = false;
    for (size_t i = 0, count; i < list->count; i += count) {
        const struct draw_range *ranges = &list->ranges[i];
        const struct page *page = &sequence->pages[sequence->places[ranges->chunk].page];
        uint64_t splats = 0;
        count = batch_length(sequence, list, i, program->draws_many ? PAGE_CHUNKS : 1);
        for (size_t k = 0; k < count; k++) splats += ranges[k].count;
        const uint32_t from = first;
        first += (uint32_t)splats;
        if ((quads && !ranges->quads) || !page_is_there(page, fields)) continue;
        if (!is_used) {
            uniforms_use(renderer, program, placement);
            uniforms_set_origin(gl, program, placement, nowhere);
            if (copies) (*gl->Uniform2f)(program->cut, 0, -2); /* all */
            is_used = true;
        }
        uniforms_set_chunks(gl, program, placement, sequence->spt, ranges, count);
        if (copies) draw_copies(renderer, prepared, quads, from, copies->first_command + (uint32_t)i, count);
        else draw_batch(renderer, prepared, page, quads, ranges, count);
        draw_count(stats, pass, quads, splats);
    }
}

pbr_result sequence_draw(pbr_view *view, const struct placement *placement, enum pass pass, pbr_stats *stats) {
    const bool selects = sequence_can_be_selected(view->renderer, placement->prepared);
    struct copies places;
    const struct copies *copies = NULL;
    if (pass == PASS_SELECT && !selects) return PBR_OK;
    pbr_result result = find_ranges(view, placement, pass, stats);
    if (result != PBR_OK) return result;
    if (selects && selection_claim(&view->renderer->selection, &view->list, &places)) copies = &places;
    if (pass == PASS_SELECT) {
        if (copies) select_entries(view, placement, copies);
        return PBR_OK;
    }
    draw_chunks(view, placement, pass, false, copies, stats);
    if (pass_has(placement->prepared, pass, PRIMITIVE_QUADS)) draw_chunks(view, placement, pass, true, copies, stats);
    return PBR_OK;
}
