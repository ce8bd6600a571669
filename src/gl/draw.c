/* Cutting items and handing their splats to OpenGL. SPDX-License-Identifier: MIT */
#include "draw.h"

#include <math.h>
#include <string.h>

#include "core/colour_map.h"
#include "core/kernel.h"
#include "core/matrix.h"
#include "core/normal_field.h"
#include "lod/cloud.h"
#include "placement.h"

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

static void to_floats(const double m[16], GLfloat out[16]) {
    for (int i = 0; i < 16; i++) out[i] = (GLfloat)m[i];
}

void draw_set_lights(const pbr_renderer *renderer, struct program *program, const struct frame_setup *setup,
                     const pbr_material *material) {
    const struct gl *gl = &renderer->gl;
    const GLfloat coefficients[3] = {material->diffuse, material->specular, material->shininess};
    GLfloat ambient[3];
    for (int k = 0; k < 3; k++) ambient[k] = material->ambient * setup->ambient[k];
    (*gl->Uniform3fv)(program->material, 1, coefficients);
    (*gl->Uniform3fv)(program->ambient, 1, ambient);
    if (program->frame == renderer->frame) return; /* it has them already */
    program->frame = renderer->frame;
    (*gl->Uniform1i)(program->light_count, setup->light_count);
    (*gl->Uniform4fv)(program->light_vector, PBR_MAX_LIGHTS, setup->light_vectors[0]);
    (*gl->Uniform3fv)(program->light_colour, PBR_MAX_LIGHTS, setup->light_colours[0]);
}

void draw_set_eye(const struct gl *gl, const struct program *program, const struct frame_setup *setup) {
    const GLfloat eye[4] = {(GLfloat)setup->eye[0], (GLfloat)setup->eye[1], (GLfloat)setup->eye[2], (GLfloat)setup->eye[3]};
    (*gl->Uniform4fv)(program->eye, 1, eye);
}

static void set_normal_matrix(const struct gl *gl, const struct program *program, const struct placement *placement) {
    double cofactors[9], largest = 0;
    double sign = matrix_cofactors(placement->to_eye, cofactors) < 0 ? -1 : 1;
    for (int i = 0; i < 9; i++) largest = fmax(largest, fabs(cofactors[i]));
    GLfloat out[9];
    for (int i = 0; i < 9; i++) out[i] = (GLfloat)(largest > 0 ? sign * cofactors[i] / largest : 0);
    (*gl->UniformMatrix3fv)(program->normal_to_eye, 1, GL_FALSE, out);
}

static void set_map(const struct gl *gl, const struct program *program, const struct placement *placement) {
    const pbr_item *item = &placement->prepared->item;
    const uint32_t entries = item->colour_map ? item->colour_map_size : COLOUR_MAP_SIZE;
    const struct prepared_item *prepared = placement->prepared;
    double low = prepared->map_low, high = prepared->map_high;
    const bool depth = item->colour_source == PBR_COLOUR_DEPTH;
    if (depth && (low != 0 || high != 0)) {
        /* Given in world units; the shaders measure in eye space, and a view may scale. */
        const double *v = placement->setup->view;
        const double axis[3] = {v[2], v[6], v[10]};
        low *= length3(axis);
        high *= length3(axis);
    } else if (depth) {
        const double *m = placement->to_eye;
        double distance = -m[14], radius = prepared->radius * placement->stretch;
        for (int k = 0; k < 3; k++) distance -= m[4 * k + 2] * prepared->centre[k];
        low = fmax(distance - radius, 0);
        high = distance + radius;
    }
    const GLfloat last = (GLfloat)(entries - 1);
    const GLfloat range[4] = {(GLfloat)low, high > low ? (GLfloat)fmin(last / (high - low), 1e30) : 0, last, 0};
    (*gl->Uniform3fv)(program->map, (GLsizei)entries, item->colour_map ? item->colour_map : colour_map[0]);
    (*gl->Uniform4fv)(program->map_range, 1, range);
}

/* What disc.glsl asks, and whoever counts in pixels or computes depths. */
static void set_disc(const struct gl *gl, const struct program *program, const struct placement *placement) {
    const struct state_wanted *wanted = &placement->setup->wanted;
    const pbr_item *item = &placement->prepared->item;
    const double diameter = 2 * placement->setup->pixels_per_unit * placement->stretch; /* of unit radius */
    const GLfloat radius[4] = {item->radius_scale, diameter > 0 ? (GLfloat)(item->size_minimum / diameter) : 0,
                               diameter > 0 ? (GLfloat)fmin(item->size_maximum / diameter, 1e30) : 0, (GLfloat)placement->stretch};
    const GLint *v = wanted->viewport;
    const GLfloat half[2] = {(GLfloat)v[2] / 2, (GLfloat)v[3] / 2};
    const GLfloat window[4] = {half[0], half[1], (GLfloat)v[0] + half[0], (GLfloat)v[1] + half[1]};
    const double *range = wanted->depth_range;
    const double span = range[1] - range[0];
    const GLfloat depth[4] = {(GLfloat)(wanted->clip_zero_to_one ? span : span / 2),
                              (GLfloat)(wanted->clip_zero_to_one ? range[0] : (range[0] + range[1]) / 2),
                              wanted->clip_zero_to_one ? 0 : -1, 1};
    GLfloat projection[16];
    to_floats(placement->setup->projection, projection);
    (*gl->UniformMatrix4fv)(program->projection, 1, GL_FALSE, projection);
    (*gl->Uniform4fv)(program->radius, 1, radius);
    (*gl->Uniform4fv)(program->window, 1, window);
    (*gl->Uniform4fv)(program->depth, 1, depth);
}

/* What layers.glsl and the blended kinds ask besides. */
static void set_layers(const struct gl *gl, const struct program *program, const struct frame_setup *setup, const pbr_item *item) {
    const double *p = setup->projection, *e = setup->eye;
    const bool perspective = e[3] != 0;
    /* Clip z of the eye: how far depth x w changes when a point moves to the eye. Of a parallel projection, per unit along the
     * axis. */
    double change = p[2] * e[0] + p[6] * e[1] + p[10] * e[2] + p[14] * e[3];
    if (!perspective && e[2] != 0) change /= fabs(e[2]);
    const double w_per_unit = length3((const double[3]){p[3], p[7], p[11]});
    /* Pixels of two standard deviations of the low-pass. */
    const double reach = splat_is_blurred(item->splat) ? KERNEL_SIGMAS * sqrt((double)item->low_pass) : 0;
    const GLfloat filter[4] = {(GLfloat)w_per_unit, (GLfloat)(reach / setup->pixels_per_unit),
                               setup->wanted.clip_zero_to_one ? 0.5f : 0, setup->wanted.clip_zero_to_one ? 0.5f : 1};
    const GLfloat back[3] = {(GLfloat)-change, perspective, (GLfloat)(1 / setup->pixels_per_unit)};
    (*gl->Uniform3fv)(program->back, 1, back);
    (*gl->Uniform1f)(program->low_pass, (GLfloat)(reach * reach));
    (*gl->Uniform4fv)(program->filter, 1, filter);
}

/* Which entries are of the cut. */
static void set_cut(const struct gl *gl, const struct program *program, const struct placement *placement) {
    struct cut_view view;
    placement_view(placement, gl, PASS_OPAQUE, &view);
    const struct spt_scale scale = spt_scale_of(&view, placement->prepared->radius);
    (*gl->Uniform2f)(program->cut, (GLfloat)scale.depth_per_w, isinf(scale.s) ? -1 : (GLfloat)scale.s);
}

/* All uniforms but those of a drawable. */
static void use_program(pbr_renderer *renderer, struct program *program, const struct placement *placement) {
    const struct gl *gl = &renderer->gl;
    const struct prepared_item *prepared = placement->prepared;
    const pbr_item *item = &prepared->item;
    const struct frame_setup *setup = placement->setup;
    (*gl->UseProgram)(program->name);
    if (program->material >= 0) draw_set_lights(renderer, program, setup, &item->material);
    if (program->eye >= 0) draw_set_eye(gl, program, setup);
    if (program->normal_to_eye >= 0) set_normal_matrix(gl, program, placement);
    const GLfloat size[4] = {(GLfloat)placement_size_per_radius(placement), item->size_minimum, item->size_maximum,
                             gl->point_size_limit};
    (*gl->Uniform4fv)(program->size, 1, size);
    (*gl->Uniform2f)(program->pixel, 1.0f / (GLfloat)setup->wanted.viewport[2], 1.0f / (GLfloat)setup->wanted.viewport[3]);
    (*gl->Uniform4fv)(program->colour, 1, item->colour);
    if (program->window >= 0 || program->depth >= 0) set_disc(gl, program, placement);
    if (program->back >= 0 || program->filter >= 0 || program->low_pass >= 0) set_layers(gl, program, setup, item);
    if (program->map >= 0) set_map(gl, program, placement);
    if (program->cut >= 0) set_cut(gl, program, placement);
}

/* Planes a.p + d >= 0 of world space as planes of the drawable's space: row vector times matrix. */
static void set_clip_planes(const struct gl *gl, const struct program *program, const struct placement *placement,
                            const double origin[3]) {
    const pbr_item *item = &placement->prepared->item;
    double m[16];
    matrix_translate(placement->to_world, origin, m);
    GLfloat planes[PBR_MAX_CLIP_PLANES][4];
    for (uint32_t i = 0; i < item->clip_plane_count; i++)
        for (int c = 0; c < 4; c++) {
            const double *plane = item->clip_planes + 4 * i;
            planes[i][c] =
                (GLfloat)(plane[0] * m[4 * c] + plane[1] * m[4 * c + 1] + plane[2] * m[4 * c + 2] + plane[3] * m[4 * c + 3]);
        }
    (*gl->Uniform1i)(program->clip_plane_count, (GLint)item->clip_plane_count);
    (*gl->Uniform4fv)(program->clip_plane, (GLsizei)item->clip_plane_count, planes[0]);
}

/* The camera relative to the drawable's origin: subtracted in double, so that the shaders' floats stay small. */
static void set_origin(const struct gl *gl, const struct program *program, const struct placement *placement,
                       const double origin[3]) {
    double m[16];
    GLfloat floats[16];
    matrix_translate(placement->to_clip, origin, m);
    to_floats(m, floats);
    (*gl->UniformMatrix4fv)(program->to_clip, 1, GL_FALSE, floats);
    if (program->to_eye >= 0) {
        matrix_translate(placement->to_eye, origin, m);
        to_floats(m, floats);
        (*gl->UniformMatrix4fv)(program->to_eye, 1, GL_FALSE, floats);
    }
    if (program->clip_plane >= 0) set_clip_planes(gl, program, placement, origin);
}

/* How entries are decoded. */
static void set_sequence(const struct gl *gl, const struct program *program, const struct spt_chunk *chunk) {
    const GLfloat steps[4] = {chunk->position_step, chunk->radius_step, chunk->error_step, chunk->largest_distance};
    (*gl->Uniform4fv)(program->steps, 1, steps);
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

static void draw_points(const struct gl *gl, const struct prepared_item *prepared, const struct drawable *drawable,
                        const struct draw_range *range) {
    (*gl->BindVertexArray)(drawable->vertex_array);
    point_streams_at(gl, prepared, drawable, 0);
    (*gl->DrawArrays)(GL_POINTS, (GLint)range->first, (GLsizei)range->count);
}

/* Without base instances (OpenGL 4.2) the attributes are pointed at each range. */
static void draw_quads(const pbr_renderer *renderer, const struct prepared_item *prepared, const struct drawable *drawable,
                       const struct draw_range *range) {
    const struct gl *gl = &renderer->gl;
    (*gl->BindVertexArray)(renderer->quad_array);
    /* Their buffers may be of another, smaller item. */
    (*gl->DisableVertexAttribArray)(ATTRIBUTE_SCALAR);
    (*gl->DisableVertexAttribArray)(ATTRIBUTE_FIELD);
    if (drawable->sequence) (*gl->EnableVertexAttribArray)(ATTRIBUTE_ERRORS);
    else (*gl->DisableVertexAttribArray)(ATTRIBUTE_ERRORS);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, drawable->splats);
    drawable_point_at(gl, drawable, range->first);
    point_streams_at(gl, prepared, drawable, range->first);
    (*gl->DrawArraysInstanced)(GL_TRIANGLE_STRIP, 0, 4, (GLsizei)range->count);
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
        if (!last) use_program(renderer, program, placement);
        if (last != drawable) set_origin(&renderer->gl, program, placement, drawable->origin);
        if (last != drawable && drawable->sequence) set_sequence(&renderer->gl, program, drawable->sequence);
        last = drawable;
        if (quads) draw_quads(renderer, prepared, drawable, range);
        else draw_points(&renderer->gl, prepared, drawable, range);
        stats->draw_calls++;
        if (pass == PASS_ACCUMULATION) continue; /* the same splats again */
        if (quads) stats->splats_as_quads += range->count;
        else stats->splats_drawn += range->count;
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

pbr_result draw_list_sequence(pbr_view *view, const struct placement *placement, enum pass pass) {
    const struct sequence *sequence = placement->prepared->sequence;
    const uint64_t uploads = view->renderer->memory.uploaded;
    struct cut_view wanted;
    placement_view(placement, &view->renderer->gl, pass, &wanted);
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

static pbr_result list_sequence(pbr_view *view, const struct placement *placement, enum pass pass, pbr_stats *stats) {
    const double start = renderer_seconds();
    pbr_result result = draw_list_sequence(view, placement, pass);
    stats->cut_seconds += renderer_seconds() - start;
    if (pass == PASS_ACCUMULATION) return result; /* the same chunks again */
    stats->nodes_visited += view->list.visited;
    stats->splats_culled += view->list.culled;
    stats->threshold = fmaxf(stats->threshold, (float)placement->setup->threshold);
    return result;
}

static pbr_result list_cut(pbr_view *view, const struct placed_cut *entry, enum pass pass, pbr_stats *stats) {
    if (pass != PASS_ACCUMULATION && entry->is_valid) {
        stats->splats_culled += entry->culled;
        stats->nodes_hidden += entry->hidden;
        stats->nodes_damaged += entry->damaged;
        stats->threshold = fmaxf(stats->threshold, (float)entry->view.threshold);
    }
    return cuts_list(view->renderer->instance, entry, &view->list);
}

static pbr_result draw_placement(pbr_view *view, const struct placement *placement, uint32_t transform, enum pass pass,
                                 pbr_stats *stats) {
    const struct prepared_item *prepared = placement->prepared;
    const struct placed_cut *entry = prepared->has_cuts ? view->cuts.entries[prepared->first_cut + transform] : NULL;
    const struct sequence *sequence = prepared->sequence;
    const struct drawable *drawables = entry ? cuts_drawable(entry) : sequence ? sequence->chunks : prepared->resident->chunks;
    if (!sequence) {
        view->listed = NULL;
        view->list.count = 0;
        view->list.visited = view->list.culled = 0;
    }
    pbr_result result = entry      ? list_cut(view, entry, pass, stats)
                        : sequence ? list_sequence(view, placement, pass, stats)
                                   : list_blocks(view, placement, pass, stats);
    if (result != PBR_OK) return result;
    if (pass != PASS_ACCUMULATION) stats->points += prepared->point_count;
    draw_ranges(view, placement, drawables, pass, false, stats);
    if (pass_has_quads(prepared, pass)) draw_ranges(view, placement, drawables, pass, true, stats);
    return PBR_OK;
}

pbr_result draw_items(pbr_view *view, const struct frame_setup *setup, size_t count, enum pass pass, uint32_t group,
                      pbr_stats *stats) {
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
