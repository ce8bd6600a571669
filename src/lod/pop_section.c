/* A POP hierarchy in our own container: a header, the nodes, the triangles, the vertices, as they are in memory.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "container.h"
#include "lod.h"
#include "pop.h"

/* Triangles, vertices: 64 bits each; flags: 32 bits; steps: floats; 32 bits that are 0; centre, radius, span: doubles. */
enum { HEADER = 72, HAS_COLOURS = 1 };

/* The rounded centre is no farther from the box's middle than the box is long: so corners are within 1.5 sqrt(3) of that. What
 * nodes decode to has squares that are floats, but for the largest radii, which are no ball's. */
#define SPAN_MOST (3 * LOD_EXTENT_MOST)
#define COORDINATE_MOST (2 * LOD_EXTENT_MOST)
#define RADIUS_MOST (8 * POP_LEVELS * LOD_EXTENT_MOST)

static pbr_result wrong(pbr_instance *instance, const char *path, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the section of the POP hierarchy %s", path, what);
}

static pbr_result foreign(pbr_instance *instance, const char *path) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: files of POP hierarchies are for little-endian machines",
                   path);
}

/* ---- Reading ---- */

static bool is_within(double v, double most) {
    return v >= 0 && v <= most;
}

static const char *header_fault(const struct pop *pop, uint64_t triangles) {
    const double largest_code = pop_decode_size((1u << POP_RADIUS_BITS) - 1);
    if (triangles > POP_TRIANGLES_MOST || pop->vertex_count > PBR_MAX_POINTS)
        return "has an impossible number of triangles or vertices";
    for (int k = 0; k < 3; k++)
        if (!isfinite(pop->centre[k])) return "has a centre that is not finite";
    if (!is_within(pop->radius, RADIUS_MOST) || !is_within(pop->span, SPAN_MOST) ||
        !is_within((double)pop->position_step * POP_POSITION_CODES, COORDINATE_MOST) ||
        !is_within((double)pop->radius_step * largest_code, RADIUS_MOST))
        return "has an impossible radius or step";
    return NULL;
}

static pbr_result parse_header(pbr_instance *instance, const char *path, const uint8_t *data, struct pop *pop,
                               uint64_t *triangles) {
    const uint64_t flags = load_little(data + 16, 4);
    *triangles = load_little(data, 8);
    pop->vertex_count = load_little(data + 8, 8);
    pop->has_colours = (flags & HAS_COLOURS) != 0;
    memcpy(&pop->position_step, data + 20, sizeof pop->position_step);
    memcpy(&pop->radius_step, data + 24, sizeof pop->radius_step);
    memcpy(pop->centre, data + 32, sizeof pop->centre);
    memcpy(&pop->radius, data + 56, sizeof pop->radius);
    memcpy(&pop->span, data + 64, sizeof pop->span);
    if (flags & ~(uint64_t)HAS_COLOURS || load_little(data + 28, 4) != 0)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "%s: the section of the POP hierarchy has flags of a later version", path);
    const char *fault = header_fault(pop, *triangles);
    return fault ? wrong(instance, path, fault) : PBR_OK;
}

/* Nodes may be any bits; what the GPU is to follow, or to draw, may not. */
static const char *mesh_fault(const struct pop *pop, uint64_t triangles) {
    for (uint64_t i = 0; i < triangles; i++)
        for (int k = 0; k < 3; k++)
            if (pop->triangles[i][k] >= pop->vertex_count) return "has a triangle with a vertex that is not there";
    for (uint64_t i = 0; i < pop->vertex_count; i++) {
        const struct splat *v = &pop->vertices[i];
        if (!isfinite(v->position[0]) || !isfinite(v->position[1]) || !isfinite(v->position[2]) || !(v->radius >= 0) ||
            !isfinite(v->radius))
            return "has a vertex that is not finite";
    }
    return NULL;
}

pbr_result pop_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct pop *pop) {
    uint64_t triangles;
    *pop = (struct pop){.owns = false};
    if (!is_little_endian()) return foreign(instance, path);
    if (size < HEADER) return wrong(instance, path, "is shorter than its header");
    if ((uintptr_t)data % sizeof(float) != 0) return wrong(instance, path, "is not aligned to 4 bytes");
    pbr_result result = parse_header(instance, path, data, pop, &triangles);
    if (result != PBR_OK) return result;
    pop_shape_of(triangles, &pop->shape);
    /* None of these is more than 2^36. */
    const uint64_t nodes = pop->shape.nodes * sizeof *pop->nodes, corners = triangles * sizeof *pop->triangles;
    if (nodes + corners + pop->vertex_count * sizeof *pop->vertices > size - HEADER)
        return wrong(instance, path, "lacks nodes, triangles or vertices");
    pop->nodes = (const struct pop_node *)(const void *)(data + HEADER);
    pop->triangles = (const uint32_t(*)[3])(const void *)(data + HEADER + nodes);
    pop->vertices = (const struct splat *)(const void *)(data + HEADER + nodes + corners);
    const char *fault = mesh_fault(pop, triangles);
    return fault ? wrong(instance, path, fault) : PBR_OK;
}

/* ---- Writing ---- */

pbr_result pop_section_write(pbr_instance *instance, const char *path, const struct pop *pop, const struct progress *progress) {
    uint8_t header[HEADER] = {0};
    const uint64_t triangles = pop->shape.level_count > 0 ? pop->shape.levels[0].count : 0;
    if (!is_little_endian()) return foreign(instance, path);
    store_little(triangles, 8, header);
    store_little(pop->vertex_count, 8, header + 8);
    store_little(pop->has_colours ? HAS_COLOURS : 0, 4, header + 16);
    memcpy(header + 20, &pop->position_step, sizeof pop->position_step);
    memcpy(header + 24, &pop->radius_step, sizeof pop->radius_step);
    memcpy(header + 32, pop->centre, sizeof pop->centre);
    memcpy(header + 56, &pop->radius, sizeof pop->radius);
    memcpy(header + 64, &pop->span, sizeof pop->span);
    const struct container_part parts[] = {{header, sizeof header},
                                           {pop->nodes, pop->shape.nodes * sizeof *pop->nodes},
                                           {pop->triangles, triangles * sizeof *pop->triangles},
                                           {pop->vertices, pop->vertex_count * sizeof *pop->vertices}};
    return container_write(instance, path, POP_SECTION, parts, sizeof parts / sizeof *parts, progress);
}
