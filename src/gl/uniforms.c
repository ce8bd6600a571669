/* From placements to the uniforms of programs. SPDX-License-Identifier: MIT */
#include "uniforms.h"

#include <math.h>
#include <string.h>

#include "core/colour_map.h"
#include "core/kernel.h"
#include "core/matrix.h"
#include "core/normal_field.h"
#include "lod/spt_cut.h"

static double dot4(const double a[4], const double b[4]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

static void to_floats(const double m[16], GLfloat out[16]) {
    for (int i = 0; i < 16; i++) out[i] = (GLfloat)m[i];
}

void uniforms_set_lights(const pbr_renderer *renderer, struct program *program, const struct frame_setup *setup,
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

void uniforms_set_eye(const struct gl *gl, const struct program *program, const struct frame_setup *setup) {
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

void uniforms_limit_radius(const struct gl *gl, const struct program *program, const struct placement *placement, double most) {
    const pbr_item *item = &placement->prepared->item;
    const double diameter = 2 * placement->setup->pixels_per_unit * placement->stretch; /* of unit radius */
    const GLfloat radius[4] = {item->radius_scale, diameter > 0 ? (GLfloat)(item->size_minimum / diameter) : 0,
                               diameter > 0 ? (GLfloat)fmin(most / diameter, 1e30) : 0, (GLfloat)placement->stretch};
    (*gl->Uniform4fv)(program->radius, 1, radius);
}

/* What disc.glsl asks, and whoever counts in pixels or computes depths. */
static void set_disc(const struct gl *gl, const struct program *program, const struct placement *placement) {
    const struct state_wanted *wanted = &placement->setup->wanted;
    const pbr_item *item = &placement->prepared->item;
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
    uniforms_limit_radius(gl, program, placement, (double)item->size_maximum);
    (*gl->Uniform4fv)(program->window, 1, window);
    (*gl->Uniform4fv)(program->depth, 1, depth);
}

/* Clip x, y, w of a place to the direction of its ray: what of the rows of the matrix to clip coordinates takes there is their
 * inverse, up to a factor; of a parallel projection, which has none, the adjugate. */
static void set_ray(const struct gl *gl, const struct program *program, const struct placement *placement) {
    const double *m = placement->to_clip;
    const double x[3] = {m[0], m[4], m[8]}, y[3] = {m[1], m[5], m[9]}, w[3] = {m[3], m[7], m[11]};
    double columns[9], largest = 0;
    cross3(y, w, columns);
    cross3(w, x, columns + 3);
    cross3(x, y, columns + 6);
    for (int i = 0; i < 9; i++) largest = fmax(largest, fabs(columns[i]));
    GLfloat out[9];
    for (int i = 0; i < 9; i++) out[i] = (GLfloat)(largest > 0 ? columns[i] / largest : 0);
    (*gl->UniformMatrix3fv)(program->ray, 1, GL_FALSE, out);
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
void uniforms_set_cut(const struct gl *gl, const struct program *program, const struct placement *placement) {
    struct cut_view view;
    placement_view(placement, gl, PASS_OPAQUE, &view);
    const struct spt_scale scale = spt_scale_of(&view, placement->prepared->radius);
    (*gl->Uniform2f)(program->cut, (GLfloat)scale.depth_per_w, isinf(scale.s) ? -1 : (GLfloat)scale.s);
}

/* Software drivers take a slower path for the thousands of vertices around each one that is clipped. So points that are not drawn
 * go to the view's lower left corner, which is not outside: one pixel in size, such a point has the next pixel's centre on its rim,
 * left of the view, and those drivers drop it as a whole. (At the right its rim has the view's last pixel.) Of several samples a
 * pixel some are in the view, and would all be shaded one after the other. Then back faces, which are many, are rather clipped; and
 * circles, of which none lie between the pixels. */
static void set_rejected(const struct gl *gl, const struct program *program, const struct placement *placement) {
    static const GLfloat corner[4] = {-1, -1, 0.5f, 1}, outside[4] = {2, 0, 0, 1};
    const struct prepared_item *prepared = placement->prepared;
    const bool clips = placement->setup->several_samples && (prepared->culls || !splat_is_disc(prepared->item.splat));
    (*gl->Uniform4fv)(program->rejected, 1, clips ? outside : corner);
}

/* All uniforms but those of a drawable. */
void uniforms_use(pbr_renderer *renderer, struct program *program, const struct placement *placement) {
    const struct gl *gl = &renderer->gl;
    const struct prepared_item *prepared = placement->prepared;
    const pbr_item *item = &prepared->item;
    const struct frame_setup *setup = placement->setup;
    (*gl->UseProgram)(program->name);
    if (program->material >= 0) uniforms_set_lights(renderer, program, setup, &item->material);
    if (program->eye >= 0) uniforms_set_eye(gl, program, setup);
    if (program->normal_to_eye >= 0) set_normal_matrix(gl, program, placement);
    const GLfloat size[4] = {(GLfloat)placement_size_per_radius(placement), item->size_minimum, item->size_maximum,
                             gl->point_size_limit};
    (*gl->Uniform4fv)(program->size, 1, size);
    (*gl->Uniform2f)(program->pixel, 1.0f / (GLfloat)setup->wanted.viewport[2], 1.0f / (GLfloat)setup->wanted.viewport[3]);
    (*gl->Uniform4fv)(program->colour, 1, item->colour);
    if (program->window >= 0 || program->depth >= 0) set_disc(gl, program, placement);
    if (program->ray >= 0) set_ray(gl, program, placement);
    if (program->back >= 0 || program->filter >= 0 || program->low_pass >= 0) set_layers(gl, program, setup, item);
    if (program->map >= 0) set_map(gl, program, placement);
    if (program->rejected >= 0) set_rejected(gl, program, placement);
    if (program->cut >= 0) uniforms_set_cut(gl, program, placement);
}

/* Planes a.p + d >= 0 of world space as planes of the drawable's space: row vector times matrix. */
static void set_clip_planes(const struct gl *gl, const struct program *program, const struct placement *placement,
                            const double origin[3]) {
    const pbr_item *item = &placement->prepared->item;
    double m[16];
    matrix_translate(placement->to_world, origin, m);
    GLfloat planes[PBR_MAX_CLIP_PLANES][4];
    for (uint32_t i = 0; i < item->clip_plane_count; i++)
        for (int c = 0; c < 4; c++) planes[i][c] = (GLfloat)dot4(item->clip_planes + 4 * i, m + 4 * c);
    (*gl->Uniform1i)(program->clip_plane_count, (GLint)item->clip_plane_count);
    (*gl->Uniform4fv)(program->clip_plane, (GLsizei)item->clip_plane_count, planes[0]);
}

/* The camera relative to the drawable's origin: subtracted in double, so that the shaders' floats stay small. */
void uniforms_set_origin(const struct gl *gl, const struct program *program, const struct placement *placement,
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

static double row_dot(const double m[16], int row, const double v[4]) {
    return m[row] * v[0] + m[4 + row] * v[1] + m[8 + row] * v[2] + m[12 + row] * v[3];
}

/* How entries are decoded. */
static void to_steps(const struct spt_chunk *chunk, GLfloat out[4]) {
    const GLfloat steps[4] = {chunk->position_step, chunk->radius_step, chunk->error_step, chunk->largest_distance};
    memcpy(out, steps, sizeof steps);
}

void uniforms_set_chunks(const struct gl *gl, const struct program *program, const struct placement *placement,
                         const struct spt *spt, const struct draw_range *ranges, size_t count) {
    const pbr_item *item = &placement->prepared->item;
    GLfloat clip[PAGE_CHUNKS][4], eye[PAGE_CHUNKS][4], steps[PAGE_CHUNKS][4], planes[PAGE_CHUNKS][PBR_MAX_CLIP_PLANES] = {{0}};
    for (size_t i = 0; i < count; i++) {
        const struct spt_chunk *chunk = &spt->chunks[ranges[i].chunk];
        const double at[4] = {chunk->origin[0], chunk->origin[1], chunk->origin[2], 1};
        double world[4];
        for (int r = 0; r < 4; r++) {
            clip[i][r] = (GLfloat)row_dot(placement->to_clip, r, at);
            eye[i][r] = (GLfloat)row_dot(placement->to_eye, r, at);
            world[r] = row_dot(placement->to_world, r, at);
        }
        for (uint32_t p = 0; p < item->clip_plane_count; p++) planes[i][p] = (GLfloat)dot4(item->clip_planes + 4 * p, world);
        to_steps(chunk, steps[i]);
    }
    (*gl->Uniform4fv)(program->clip_origins, (GLsizei)count, clip[0]);
    (*gl->Uniform4fv)(program->steps, (GLsizei)count, steps[0]);
    if (program->eye_origins >= 0) (*gl->Uniform4fv)(program->eye_origins, (GLsizei)count, eye[0]);
    if (program->plane_offsets >= 0) (*gl->Uniform4fv)(program->plane_offsets, 2 * (GLsizei)count, planes[0]);
}

void uniforms_set_selection(const struct gl *gl, const struct program *program, const struct placement *placement,
                            const struct spt *spt, const struct draw_range *ranges, size_t count) {
    GLfloat rows[PAGE_CHUNKS][4], steps[PAGE_CHUNKS][4];
    for (size_t i = 0; i < count; i++) {
        const struct spt_chunk *chunk = &spt->chunks[ranges[i].chunk];
        double m[16];
        matrix_translate(placement->to_clip, chunk->origin, m);
        for (int k = 0; k < 4; k++) rows[i][k] = (GLfloat)m[4 * k + 3];
        to_steps(chunk, steps[i]);
    }
    (*gl->Uniform4fv)(program->rows, (GLsizei)count, rows[0]);
    (*gl->Uniform4fv)(program->steps, (GLsizei)count, steps[0]);
}
