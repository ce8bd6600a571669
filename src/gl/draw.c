/* Cutting items and handing their splats to OpenGL. SPDX-License-Identifier: MIT */
#include "draw.h"

#include <math.h>

#include "core/normal_field.h"
#include "lod/cloud.h"
#include "sequence_draw.h"
#include "uniforms.h"

void draw_prepare(pbr_renderer *renderer) {
    const struct gl *gl = &renderer->gl;
    if (renderer->quad_array && renderer->quad_array_deletions == renderer->memory.deletions) return;
    (*gl->DeleteVertexArrays)(1, &renderer->quad_array);
    renderer->quad_array_deletions = renderer->memory.deletions;
    (*gl->GenVertexArrays)(1, &renderer->quad_array);
    (*gl->BindVertexArray)(renderer->quad_array);
    for (GLuint a = ATTRIBUTE_POSITION_RADIUS; a <= ATTRIBUTE_COLOUR; a++) {
        (*gl->EnableVertexAttribArray)(a);
        (*gl->VertexAttribDivisor)(a, 1);
    }
    (*gl->VertexAttribDivisor)(ATTRIBUTE_SCALAR, 1);
    (*gl->VertexAttribDivisor)(ATTRIBUTE_FIELD, 1);
    (*gl->VertexAttribDivisor)(ATTRIBUTE_ERRORS, 1);
}

/* Points the attributes of the bound vertex array beyond the record at its streams, from record `first` on. */
static void point_streams_at(const struct gl *gl, const struct prepared_item *prepared, const struct drawable *drawable,
                             uint32_t first) {
    const struct streams streams = item_streams(prepared);
    if (streams.scalar >= 0) {
        (*gl->BindBuffer)(GL_ARRAY_BUFFER, drawable->scalars[streams.scalar]);
        (*gl->EnableVertexAttribArray)(ATTRIBUTE_SCALAR);
        (*gl->VertexAttribPointer)(ATTRIBUTE_SCALAR, 1, GL_FLOAT, GL_FALSE, sizeof(float),
                                   (const void *)((size_t)first * sizeof(float)));
    }
    if (streams.fields) {
        (*gl->BindBuffer)(GL_ARRAY_BUFFER, drawable->fields);
        (*gl->EnableVertexAttribArray)(ATTRIBUTE_FIELD);
        (*gl->VertexAttribPointer)(ATTRIBUTE_FIELD, 4, GL_SHORT, GL_FALSE, sizeof(struct normal_field),
                                   (const void *)((size_t)first * sizeof(struct normal_field)));
    }
}

void draw_bind_points(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable) {
    (*renderer->gl.BindVertexArray)(drawable->vertex_array);
    point_streams_at(&renderer->gl, prepared, drawable, 0);
}

static void draw_points(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable,
                        const struct draw_range *range) {
    draw_bind_points(renderer, prepared, drawable);
    (*renderer->gl.DrawArrays)(GL_POINTS, (GLint)range->first, (GLsizei)range->count);
}

void draw_bind_quads(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable,
                     uint32_t first) {
    const struct gl *gl = &renderer->gl;
    (*gl->BindVertexArray)(renderer->quad_array);
    /* Their buffers may be of another, smaller item. */
    (*gl->DisableVertexAttribArray)(ATTRIBUTE_SCALAR);
    (*gl->DisableVertexAttribArray)(ATTRIBUTE_FIELD);
    if (drawable->is_sequence) (*gl->EnableVertexAttribArray)(ATTRIBUTE_ERRORS);
    else (*gl->DisableVertexAttribArray)(ATTRIBUTE_ERRORS);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, drawable->splats);
    drawable_point_at(gl, drawable, first);
    point_streams_at(gl, prepared, drawable, first);
}

static void draw_quads(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable,
                       const struct draw_range *range) {
    draw_bind_quads(renderer, prepared, drawable, range->first);
    (*renderer->gl.DrawArraysInstanced)(GL_TRIANGLE_STRIP, 0, 4, (GLsizei)range->count);
}

/* Triangles of a cut: of the stream behind the records, or all of the mesh. */
static void draw_triangles(pbr_view *view, const struct placement *placement, const struct placed_cut *entry, enum pass pass,
                           pbr_stats *stats) {
    static const double nowhere[3] = {0, 0, 0};
    pbr_renderer *renderer = view->renderer;
    const struct gl *gl = &renderer->gl;
    const struct prepared_item *prepared = placement->prepared;
    struct program *program = &renderer->programs.entries[prepared->programs[pass][PRIMITIVE_TRIANGLES]];
    const GLuint buffer = entry->all_triangles ? prepared->mesh->triangles : cuts_drawable(entry)->splats;
    const size_t first = entry->all_triangles ? 0 : entry->count * sizeof(struct splat);
    uniforms_use(renderer, program, placement);
    uniforms_set_origin(gl, program, placement, nowhere);
    if (program->radius >= 0) uniforms_limit_radius(gl, program, placement, fmax((double)entry->view.threshold, 1));
    (*gl->BindVertexArray)(prepared->mesh->vertices.vertex_array);
    (*gl->BindBuffer)(GL_ELEMENT_ARRAY_BUFFER, buffer);
    (*gl->DrawElements)(GL_TRIANGLES, (GLsizei)(3 * entry->triangles), GL_UNSIGNED_INT, (const void *)first);
    (*gl->BindBuffer)(GL_ELEMENT_ARRAY_BUFFER, 0); /* or it would outlive its deletion */
    stats->draw_calls++;
    if (pass != PASS_ACCUMULATION) stats->triangles_drawn += entry->triangles;
}

void draw_count(pbr_stats *stats, enum pass pass, bool quads, uint64_t splats) {
    stats->draw_calls++;
    if (pass == PASS_ACCUMULATION) return; /* the same splats again */
    if (quads) stats->splats_as_quads += splats;
    else stats->splats_drawn += splats;
}

/* The view's draw list: ranges of these drawables. */
static void draw_ranges(pbr_view *view, const struct placement *placement, const struct drawable *drawables, enum pass pass,
                        bool quads, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    const struct prepared_item *prepared = placement->prepared;
    struct program *program = &renderer->programs.entries[prepared->programs[pass][quads]];
    const struct drawable *last = NULL;
    for (size_t i = 0; i < view->list.count; i++) {
        const struct draw_range *range = &view->list.ranges[i];
        const struct drawable *drawable = &drawables[range->chunk];
        if ((quads && !range->quads) || !drawable->splats) continue;
        if (!last) uniforms_use(renderer, program, placement);
        if (last != drawable) uniforms_set_origin(&renderer->gl, program, placement, drawable->origin);
        last = drawable;
        if (quads) draw_quads(renderer, prepared, drawable, range);
        else draw_points(renderer, prepared, drawable, range);
        draw_count(stats, pass, quads, range->count);
    }
}

/* The ranges of a set's blocks that the pass needs. */
static pbr_result list_blocks(pbr_view *view, const struct placement *placement, enum pass pass, pbr_stats *stats) {
    struct cut_view wanted;
    placement_view(placement, &view->renderer->gl, pass, &wanted);
    const double start = renderer_seconds();
    pbr_result result = cloud_cut(view->renderer->instance, &placement->prepared->resident->blocks, &wanted, &view->list);
    stats->cut_seconds += renderer_seconds() - start;
    if (pass == PASS_ACCUMULATION) return result; /* the same blocks again */
    stats->nodes_visited += view->list.visited;
    stats->splats_culled += view->list.culled;
    return result;
}

static pbr_result list_cut(pbr_view *view, const struct placement *placement, const struct placed_cut *entry, enum pass pass,
                           pbr_stats *stats) {
    if (pass != PASS_ACCUMULATION && entry->is_valid) {
        stats->splats_culled += entry->culled;
        stats->nodes_hidden += entry->hidden;
        stats->nodes_damaged += entry->damaged;
        stats->threshold = fmaxf(stats->threshold, (float)entry->view.threshold);
    }
    return cuts_list(view->renderer->instance, placement, entry, &view->list);
}

static pbr_result draw_placement(pbr_view *view, const struct placement *placement, uint32_t transform, enum pass pass,
                                 pbr_stats *stats) {
    const struct prepared_item *prepared = placement->prepared;
    if (pass != PASS_ACCUMULATION && pass != PASS_SELECT) stats->points += prepared->point_count;
    if (prepared->sequence) return sequence_draw(view, placement, pass, stats);
    if (pass == PASS_SELECT) return PBR_OK;
    const struct placed_cut *entry = prepared->has_cuts ? view->cuts.entries[prepared->first_cut + transform] : NULL;
    const struct drawable *drawables = entry ? cuts_drawable(entry) : prepared->resident->chunks;
    view->listed = NULL;
    view->list.count = 0;
    view->list.visited = view->list.culled = 0;
    pbr_result result = entry ? list_cut(view, placement, entry, pass, stats) : list_blocks(view, placement, pass, stats);
    if (result != PBR_OK) return result;
    draw_ranges(view, placement, drawables, pass, false, stats);
    if (pass_has(prepared, pass, PRIMITIVE_QUADS)) draw_ranges(view, placement, drawables, pass, true, stats);
    if (entry && entry->is_valid && entry->triangles > 0 && pass_has(prepared, pass, PRIMITIVE_TRIANGLES))
        draw_triangles(view, placement, entry, pass, stats);
    return PBR_OK;
}

pbr_result draw_items(pbr_view *view, const struct frame_setup *setup, size_t count, enum pass pass, uint32_t group,
                      pbr_stats *stats) {
    selection_rewind(&view->renderer->selection);
    for (size_t i = 0; i < count; i++) {
        const struct prepared_item *prepared = &view->items[i];
        if (prepared->item.flags & PBR_ITEM_HIDDEN || prepared->group != group) continue;
        if (item_is_blended(&prepared->item) != (pass != PASS_OPAQUE)) continue;
        for (uint32_t t = 0; t < prepared->item.transform_count; t++) {
            struct placement placement;
            placement_make(prepared, setup, t, &placement);
            pbr_result result = draw_placement(view, &placement, t, pass, stats);
            if (result != PBR_OK) return result;
        }
    }
    return PBR_OK;
}
