/* pbr_render: items are checked and made resident, cut, and drawn. SPDX-License-Identifier: MIT */
#include <pbr/render.h>
#include <string.h>
#include <time.h>

#include "core/matrix.h"
#include "frame.h"
#include "lod/cloud.h"
#include "renderer.h"

/* An item of the current frame. */
struct prepared_item {
    pbr_item item; /* defaults filled in */
    struct resident *resident;
    uint32_t variant; /* without VARIANT_QUADS */
    int64_t scalar;   /* index, or -1 */
    float map_low, map_high;
};

static const float default_map[][3] = {
    /* Dark blue to yellow with rising luminance; linear RGB. */
    {0.012f, 0.006f, 0.080f}, {0.017f, 0.044f, 0.260f}, {0.012f, 0.150f, 0.330f}, {0.020f, 0.310f, 0.260f},
    {0.110f, 0.500f, 0.130f}, {0.420f, 0.670f, 0.060f}, {0.900f, 0.780f, 0.120f}, {1.000f, 0.900f, 0.420f}};

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static pbr_result invalid(pbr_instance *instance, size_t index, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_item %zu: %s", index, what);
}

/* ---- Checking items and filling in defaults ---- */

static bool floats_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

static const char *item_fault(const pbr_item *item) {
    const uint32_t known = PBR_ITEM_CULL_BACK_FACES | PBR_ITEM_HIDDEN;
    if (!item->points) return "points is NULL";
    if (!item->transforms != !item->transform_count) return "transforms and transform_count do not agree";
    if (item->splat > PBR_SPLAT_SQUARE || item->shading > PBR_SHADE_NONE || item->colour_source > PBR_COLOUR_DEPTH)
        return "splat, shading or colour_source is unknown";
    if (item->flags & ~known || item->reserved != 0) return "a flag is unknown, or reserved is not 0";
    if (!(item->radius_scale >= 0) || !(item->size_minimum >= 0) || !(item->size_maximum >= 0) || !isfinite(item->radius_scale) ||
        !isfinite(item->size_minimum))
        return "radius_scale, size_minimum or size_maximum is negative or not finite";
    if (item->size_maximum != 0 && item->size_maximum < item->size_minimum) return "size_maximum is below size_minimum";
    if (!floats_are_finite(item->colour, 4) || !floats_are_finite(&item->material.ambient, 4) ||
        !floats_are_finite(item->scalar_range, 2))
        return "colour, material or scalar_range is not finite";
    if (item->material.shininess < 0) return "material.shininess is negative";
    if (!item->clip_planes != !item->clip_plane_count) return "clip_planes and clip_plane_count do not agree";
    if (!item->colour_map != !item->colour_map_size) return "colour_map and colour_map_size do not agree";
    if (item->colour_map && (item->colour_map_size < 2 || item->colour_map_size > 32)) return "colour_map_size is not within 2..32";
    if (item->colour_map && !floats_are_finite(item->colour_map, 3 * (size_t)item->colour_map_size))
        return "colour_map is not finite";
    for (size_t i = 0; i < item->transform_count; i++) {
        double transform[16];
        memcpy(transform, item->transforms + 16 * i, sizeof transform);
        if (!matrix_is_finite(transform) || !matrix_make_affine(transform)) return "a transform is not a finite affine matrix";
    }
    for (size_t i = 0; i < 4 * (size_t)item->clip_plane_count; i++)
        if (!isfinite(item->clip_planes[i])) return "a clip plane is not finite";
    return NULL;
}

/* `least`: diameter of the smallest GL point. */
static void fill_in_defaults(pbr_item *item, float least) {
    if (!item->transforms) {
        item->transforms = identity;
        item->transform_count = 1;
    }
    if (item->radius_scale == 0) item->radius_scale = 1;
    /* The smallest shapes that always cover a pixel centre: the pixel's square, the disc around it. */
    if (item->size_minimum == 0) item->size_minimum = item->splat == PBR_SPLAT_SQUARE ? 1 : 1.41421356f;
    if (item->size_maximum == 0) item->size_maximum = 1e18f;
    item->size_maximum = fmaxf(item->size_maximum, least);
    item->size_minimum = fminf(fmaxf(item->size_minimum, least), item->size_maximum);
    if (item->colour[0] == 0 && item->colour[1] == 0 && item->colour[2] == 0 && item->colour[3] == 0)
        for (int k = 0; k < 4; k++) item->colour[k] = k == 3 ? 1 : 0.8f;
    pbr_material *m = &item->material;
    if (m->ambient == 0 && m->diffuse == 0 && m->specular == 0 && m->shininess == 0) *m = (pbr_material){0.1f, 0.9f, 0.15f, 32};
}

static uint32_t choose_variant(const pbr_item *item) {
    const pbr_points *points = item->points;
    uint32_t source = item->colour_source;
    if ((source == PBR_COLOUR_POINTS && !points->colours) || (source == PBR_COLOUR_NORMAL && !points->normals))
        source = PBR_COLOUR_CONSTANT;
    uint32_t variant = source << VARIANT_COLOUR_SHIFT;
    if (item->splat == PBR_SPLAT_CIRCLE) variant |= VARIANT_CIRCLE;
    if (points->normals && item->shading == PBR_SHADE_PHONG) variant |= VARIANT_LIT;
    if (points->normals && item->flags & PBR_ITEM_CULL_BACK_FACES) variant |= VARIANT_CULL;
    if (item->clip_plane_count > 0) variant |= VARIANT_CLIP_PLANES;
    return variant;
}

static pbr_result prepare_item(const pbr_renderer *renderer, const void *in, size_t index, struct prepared_item *out) {
    pbr_instance *instance = renderer->instance;
    *out = (struct prepared_item){.scalar = -1};
    pbr_item *item = &out->item;
    pbr_result result = read_desc(instance, "pbr_item", in, sizeof *item, item, sizeof *item);
    if (result != PBR_OK) return result;
    if (item->transform_count > PBR_MAX_TRANSFORMS || item->clip_plane_count > PBR_MAX_CLIP_PLANES)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT,
                       "pbr_item %zu: %u transforms or %u clip planes; the limits are %d and %d", index,
                       (unsigned)item->transform_count, (unsigned)item->clip_plane_count, PBR_MAX_TRANSFORMS, PBR_MAX_CLIP_PLANES);
    const char *fault = item_fault(item);
    if (fault) return invalid(instance, index, fault);
    if (item->points->instance != instance)
        return invalid(instance, index, "points were made from another instance than the renderer");
    fill_in_defaults(item, renderer->gl.point_size_least);
    out->variant = choose_variant(item);
    if (item->colour_source == PBR_COLOUR_SCALAR) {
        if (item->scalar_index >= item->points->scalar_count) return invalid(instance, index, "the points have no such scalar");
        out->scalar = item->scalar_index;
    }
    const bool given = item->scalar_range[0] != 0 || item->scalar_range[1] != 0;
    if (given || out->scalar < 0) {
        out->map_low = item->scalar_range[0];
        out->map_high = item->scalar_range[1];
    } else {
        out->map_low = item->points->scalars[out->scalar].minimum;
        out->map_high = item->points->scalars[out->scalar].maximum;
    }
    return PBR_OK;
}

static pbr_result prepare_items(pbr_view *view, const pbr_item *items, size_t count) {
    pbr_instance *instance = view->renderer->instance;
    if (count > PBR_MAX_ITEMS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_render: %zu items, the limit is %d", count, PBR_MAX_ITEMS);
    if (count > 0 && !items)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_render: items is NULL, item_count is %zu", count);
    if (count > view->item_capacity) {
        const size_t capacity = count > 2 * view->item_capacity ? count : 2 * view->item_capacity;
        struct prepared_item *grown = pbr_reallocate(instance, view->items, 0, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        view->items = grown;
        view->item_capacity = capacity;
    }
    const char *at = (const char *)items;
    for (size_t i = 0; i < count; i++, at += items->struct_size) {
        size_t size;
        memcpy(&size, at, sizeof size);
        if (size != items->struct_size) return invalid(instance, i, "struct_size differs from the first item's");
        pbr_result result = prepare_item(view->renderer, at, i, &view->items[i]);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

/* ---- Making items drawable ---- */

static pbr_result need_program(pbr_renderer *renderer, uint32_t variant, pbr_stats *stats) {
    struct program *program = &renderer->programs[variant];
    if (program->name) return PBR_OK;
    if (program->refused) return PBR_ERROR_GL; /* logged once; asking again would cost a compilation each frame */
    pbr_result result = program_create(renderer->instance, &renderer->gl, variant, program);
    stats->programs_compiled += result == PBR_OK;
    program->refused = result != PBR_OK;
    return result;
}

static void need_quad_array(pbr_renderer *renderer) {
    const struct gl *gl = &renderer->gl;
    if (renderer->quad_array && renderer->quad_array_evictions == renderer->residents.evictions) return;
    (*gl->DeleteVertexArrays)(1, &renderer->quad_array);
    renderer->quad_array_evictions = renderer->residents.evictions;
    (*gl->GenVertexArrays)(1, &renderer->quad_array);
    (*gl->BindVertexArray)(renderer->quad_array);
    for (GLuint a = ATTRIBUTE_POSITION_RADIUS; a <= ATTRIBUTE_COLOUR; a++) {
        (*gl->EnableVertexAttribArray)(a);
        (*gl->VertexAttribDivisor)(a, 1);
    }
    (*gl->VertexAttribDivisor)(ATTRIBUTE_SCALAR, 1);
}

static pbr_result make_drawable(pbr_view *view, size_t count, uint32_t frame_variant, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    pbr_result result = PBR_OK;
    /* What the frame draws must not make room for itself; what it hides goes last of the rest. */
    for (size_t i = 0; i < count; i++) {
        const bool hidden = view->items[i].item.flags & PBR_ITEM_HIDDEN;
        residents_touch(&renderer->residents, view->items[i].item.points, hidden ? renderer->frame - 1 : renderer->frame);
    }
    for (size_t i = 0; i < count && result == PBR_OK; i++) {
        struct prepared_item *prepared = &view->items[i];
        if (prepared->item.flags & PBR_ITEM_HIDDEN) continue;
        prepared->variant |= frame_variant;
        if (!(prepared->variant & VARIANT_LIT)) prepared->variant &= ~(uint32_t)VARIANT_ONE_LIGHT;
        result = residents_acquire(renderer->instance, &renderer->gl, &renderer->residents, prepared->item.points, prepared->scalar,
                                   renderer->frame, &prepared->resident, &stats->host_gl_error);
        if (result == PBR_OK) result = need_program(renderer, prepared->variant, stats);
        if (result == PBR_OK) result = need_program(renderer, prepared->variant | VARIANT_QUADS, stats);
    }
    if (result == PBR_OK) need_quad_array(renderer);
    return result;
}

/* ---- Drawing ---- */

/* One item under one of its transforms. */
struct placement {
    const struct prepared_item *prepared;
    const struct frame_setup *setup;
    double to_eye[16];  /* object space relative to the points' origin -> eye */
    double to_clip[16]; /* the same -> clip */
    double to_world[16];
    double stretch;
};

static void place(const struct prepared_item *prepared, const struct frame_setup *setup, const double transform[16],
                  struct placement *out) {
    double to_eye[16], affine[16];
    out->prepared = prepared;
    out->setup = setup;
    memcpy(affine, transform, sizeof affine);
    matrix_make_affine(affine);
    matrix_multiply(setup->view, affine, to_eye);
    matrix_translate(to_eye, prepared->item.points->origin, out->to_eye);
    matrix_translate(affine, prepared->item.points->origin, out->to_world);
    matrix_multiply(setup->projection, out->to_eye, out->to_clip);
    out->stretch = matrix_largest_stretch(to_eye);
}

static void to_floats(const double m[16], GLfloat out[16]) {
    for (int i = 0; i < 16; i++) out[i] = (GLfloat)m[i];
}

static double size_per_radius(const struct placement *placement) {
    return 2 * placement->setup->pixels_per_unit * placement->stretch * placement->prepared->item.radius_scale;
}

static void set_lights(const struct gl *gl, const struct program *program, const struct frame_setup *setup) {
    (*gl->Uniform1i)(program->light_count, setup->light_count);
    (*gl->Uniform4fv)(program->light_vector, PBR_MAX_LIGHTS, setup->light_vectors[0]);
    (*gl->Uniform3fv)(program->light_colour, PBR_MAX_LIGHTS, setup->light_colours[0]);
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
    const pbr_points *points = item->points;
    const uint32_t entries = item->colour_map ? item->colour_map_size : sizeof default_map / sizeof *default_map;
    double low = placement->prepared->map_low, high = placement->prepared->map_high;
    const bool depth = item->colour_source == PBR_COLOUR_DEPTH;
    if (depth && (low != 0 || high != 0)) {
        /* Given in world units; the shaders measure in eye space, and a view may scale. */
        const double *v = placement->setup->view;
        const double axis[3] = {v[2], v[6], v[10]};
        low *= length3(axis);
        high *= length3(axis);
    } else if (depth) {
        const double *m = placement->to_eye;
        double distance = -m[14], radius = points->bounding_radius * placement->stretch;
        for (int k = 0; k < 3; k++) distance -= m[4 * k + 2] * (points->minimum[k] + points->maximum[k]) / 2;
        low = fmax(distance - radius, 0);
        high = distance + radius;
    }
    const GLfloat last = (GLfloat)(entries - 1);
    const GLfloat range[4] = {(GLfloat)low, high > low ? (GLfloat)fmin(last / (high - low), 1e30) : 0, last, 0};
    (*gl->Uniform3fv)(program->map, (GLsizei)entries, item->colour_map ? item->colour_map : default_map[0]);
    (*gl->Uniform4fv)(program->map_range, 1, range);
}

/* All uniforms but those of a chunk. */
static void use_program(pbr_renderer *renderer, struct program *program, const struct placement *placement) {
    const struct gl *gl = &renderer->gl;
    const struct prepared_item *prepared = placement->prepared;
    const pbr_item *item = &prepared->item;
    const struct frame_setup *setup = placement->setup;
    (*gl->UseProgram)(program->name);
    if (prepared->variant & VARIANT_LIT && program->frame != renderer->frame) {
        set_lights(gl, program, setup);
        program->frame = renderer->frame;
    }
    if (prepared->variant & (VARIANT_LIT | VARIANT_CULL)) {
        const GLfloat eye[4] = {(GLfloat)setup->eye[0], (GLfloat)setup->eye[1], (GLfloat)setup->eye[2], (GLfloat)setup->eye[3]};
        (*gl->Uniform4fv)(program->eye, 1, eye);
        set_normal_matrix(gl, program, placement);
    }
    if (prepared->variant & VARIANT_LIT) {
        const pbr_material *m = &item->material;
        const GLfloat material[3] = {m->diffuse, m->specular, m->shininess};
        GLfloat ambient[3];
        for (int k = 0; k < 3; k++) ambient[k] = m->ambient * setup->ambient[k];
        (*gl->Uniform3fv)(program->material, 1, material);
        (*gl->Uniform3fv)(program->ambient, 1, ambient);
    }
    const GLfloat size[4] = {(GLfloat)size_per_radius(placement), item->size_minimum, item->size_maximum, gl->point_size_limit};
    (*gl->Uniform4fv)(program->size, 1, size);
    (*gl->Uniform2f)(program->pixel, 1.0f / (GLfloat)setup->wanted.viewport[2], 1.0f / (GLfloat)setup->wanted.viewport[3]);
    (*gl->Uniform4fv)(program->colour, 1, item->colour);
    if (program->map >= 0) set_map(gl, program, placement);
}

/* Planes a.p + d >= 0 of world space as planes of the chunk's space: row vector times matrix. */
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

/* The camera relative to the chunk's origin: subtracted in double, so that the shaders' floats stay small. */
static void set_chunk(const struct gl *gl, const struct program *program, const struct placement *placement,
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
    if (placement->prepared->variant & VARIANT_CLIP_PLANES) set_clip_planes(gl, program, placement, origin);
}

static void point_scalar_at(const struct gl *gl, const struct resident_chunk *chunk, int64_t scalar, uint32_t first) {
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, chunk->scalars[scalar]);
    (*gl->EnableVertexAttribArray)(ATTRIBUTE_SCALAR);
    (*gl->VertexAttribPointer)(ATTRIBUTE_SCALAR, 1, GL_FLOAT, GL_FALSE, sizeof(float),
                               (const void *)((size_t)first * sizeof(float)));
}

static void draw_points(const struct gl *gl, const struct prepared_item *prepared, const struct draw_range *range) {
    const struct resident_chunk *chunk = &prepared->resident->chunks[range->chunk];
    (*gl->BindVertexArray)(chunk->vertex_array);
    if (prepared->scalar >= 0) point_scalar_at(gl, chunk, prepared->scalar, 0);
    (*gl->DrawArrays)(GL_POINTS, (GLint)range->first, (GLsizei)range->count);
}

/* Without base instances (OpenGL 4.2) the attributes are pointed at each range. */
static void draw_quads(pbr_renderer *renderer, const struct prepared_item *prepared, const struct draw_range *range) {
    const struct gl *gl = &renderer->gl;
    const struct resident_chunk *chunk = &prepared->resident->chunks[range->chunk];
    (*gl->BindVertexArray)(renderer->quad_array);
    (*gl->BindBuffer)(GL_ARRAY_BUFFER, chunk->splats);
    resident_point_at(gl, range->first);
    if (prepared->scalar >= 0) point_scalar_at(gl, chunk, prepared->scalar, range->first);
    else (*gl->DisableVertexAttribArray)(ATTRIBUTE_SCALAR); /* its buffer may be of another, smaller item */
    (*gl->DrawArraysInstanced)(GL_TRIANGLE_STRIP, 0, 4, (GLsizei)range->count);
}

static void draw_ranges(pbr_view *view, const struct placement *placement, bool quads, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    const struct prepared_item *prepared = placement->prepared;
    struct program *program = &renderer->programs[prepared->variant | (quads ? VARIANT_QUADS : 0)];
    uint32_t chunk = UINT32_MAX;
    for (size_t i = 0; i < view->list.count; i++) {
        const struct draw_range *range = &view->list.ranges[i];
        if (quads && !range->quads) continue;
        if (chunk == UINT32_MAX) use_program(renderer, program, placement);
        if (chunk != range->chunk)
            set_chunk(&renderer->gl, program, placement, prepared->resident->blocks.chunks[range->chunk].origin);
        chunk = range->chunk;
        if (quads) draw_quads(renderer, prepared, range);
        else draw_points(&renderer->gl, prepared, range);
        stats->draw_calls++;
        if (quads) stats->splats_as_quads += range->count;
        else stats->splats_drawn += range->count;
    }
}

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static pbr_result draw_placement(pbr_view *view, const struct placement *placement, pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    const pbr_item *item = &placement->prepared->item;
    struct cut_view cut = {.size_per_radius = size_per_radius(placement),
                           .size_minimum = item->size_minimum,
                           .size_maximum = item->size_maximum,
                           .point_limit = renderer->gl.point_size_limit,
                           .viewport = {placement->setup->wanted.viewport[2], placement->setup->wanted.viewport[3]},
                           .zero_to_one = placement->setup->wanted.clip_zero_to_one};
    memcpy(cut.to_clip, placement->to_clip, sizeof cut.to_clip);
    const double start = seconds_now();
    view->list.count = 0;
    view->list.visited = view->list.culled = 0;
    pbr_result result = cloud_cut(renderer->instance, &placement->prepared->resident->blocks, &cut, &view->list);
    stats->cut_seconds += seconds_now() - start;
    stats->nodes_visited += view->list.visited;
    stats->splats_culled += view->list.culled;
    stats->points += item->points->count;
    if (result != PBR_OK) return result;
    draw_ranges(view, placement, false, stats);
    draw_ranges(view, placement, true, stats);
    return PBR_OK;
}

static pbr_result draw_items(pbr_view *view, const struct frame_setup *setup, size_t count, pbr_stats *stats) {
    for (size_t i = 0; i < count; i++) {
        const struct prepared_item *prepared = &view->items[i];
        if (prepared->item.flags & PBR_ITEM_HIDDEN) continue;
        for (uint32_t t = 0; t < prepared->item.transform_count; t++) {
            struct placement placement;
            place(prepared, setup, prepared->item.transforms + 16 * (size_t)t, &placement);
            pbr_result result = draw_placement(view, &placement, stats);
            if (result != PBR_OK) return result;
        }
    }
    return PBR_OK;
}

/* ---- The call ---- */

static bool transform_feedback_runs(const struct gl *gl) {
    GLboolean active = GL_FALSE, paused = GL_FALSE;
    if (!gl->has_transform_feedback_query) return false;
    (*gl->GetBooleanv)(GL_TRANSFORM_FEEDBACK_ACTIVE, &active);
    (*gl->GetBooleanv)(GL_TRANSFORM_FEEDBACK_PAUSED, &paused);
    return active && !paused;
}

static pbr_result render_frame(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t count, bool draw,
                               pbr_stats *stats) {
    pbr_renderer *renderer = view->renderer;
    pbr_instance *instance = renderer->instance;
    const struct gl *gl = &renderer->gl;
    if (renderer->abandoned) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT, "pbr_render: the renderer was abandoned");
    struct frame_setup setup;
    pbr_result result = frame_setup(instance, gl, frame, &setup);
    if (result == PBR_OK) result = prepare_items(view, items, count);
    if (result != PBR_OK) return result;
    if (setup.empty) return PBR_OK;
    if (setup.wanted.bind_framebuffer && setup.wanted.framebuffer && !(*gl->IsFramebuffer)(setup.wanted.framebuffer))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_frame: %u is not the name of a framebuffer",
                       (unsigned)setup.wanted.framebuffer);
    if (transform_feedback_runs(gl))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_render: transform feedback is active; end or pause it first");

    renderer->frame++;
    const uint64_t uploaded = renderer->residents.uploaded;
    struct state state;
    bool encode = false;
    state_save(gl, renderer->keep_state, &setup.wanted, &state);
    result = frame_target(instance, gl, &setup, (GLenum)state.draw_buffers[0], &encode, &setup.wanted.framebuffer_srgb);
    const uint32_t variant = (encode ? VARIANT_ENCODE_SRGB : 0u) | (setup.light_count == 1 ? VARIANT_ONE_LIGHT : 0u);
    if (result == PBR_OK) result = make_drawable(view, count, variant, stats);
    if (result == PBR_OK && draw) {
        state_set(gl, &setup.wanted, &state);
        result = draw_items(view, &setup, count, stats);
    }
    state_restore(gl, &state);
    stats->upload_bytes = renderer->residents.uploaded - uploaded;
    stats->gpu_memory_bytes = renderer->residents.bytes;
    stats->is_final = result == PBR_OK;
    return result;
}

static pbr_result run(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t count, bool draw, pbr_stats *stats) {
    if (!view) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = view->renderer->instance;
    if (!frame) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_render: frame is NULL");
    pbr_stats full = {.struct_size = sizeof full};
    if (stats && write_info(instance, "pbr_stats", &full, sizeof full, stats, sizeof full) != PBR_OK)
        return PBR_ERROR_INVALID_ARGUMENT;
    pbr_result result = render_frame(view, frame, items, count, draw, &full);
    if (stats) write_info(instance, "pbr_stats", &full, sizeof full, stats, sizeof full);
    return result;
}

pbr_result pbr_render(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats) {
    return run(view, frame, items, item_count, true, stats);
}

pbr_result pbr_prepare(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats) {
    return run(view, frame, items, item_count, false, stats);
}
