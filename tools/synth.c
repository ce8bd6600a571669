/* pbr synth: files of exactly so many points or triangles on known surfaces. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <pbr/io.h>
#include <pbr/lod.h>
#include <pbr/support.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "options.h"
#include "surface.h"

static const uint64_t HIERARCHY_MOST = UINT64_C(1) << 44; /* points: what pbr_lod_build_file takes */

struct synth {
    struct session *session;
    struct surface surface;
    const char *output;
    bool is_mesh, has_grid, is_hierarchy;
    uint64_t count;  /* points, or triangles */
    uint32_t memory; /* megabytes, of a hierarchy; 0 = the library's default */
    struct surface_grid grid;
    uint64_t vertex_count;
    struct surface_point *vertices;
    uint32_t *indices; /* 3 a triangle */
    uint64_t first;    /* of the piece that is being made */
};

static pbr_result make_vertices(void *user, size_t begin, size_t end) {
    const struct synth *synth = user;
    for (uint64_t i = synth->first + begin; i < synth->first + end; i++)
        synth->vertices[i] =
            synth->is_mesh ? grid_vertex(&synth->grid, &synth->surface, i) : surface_spread(&synth->surface, i, synth->count);
    return PBR_OK;
}

static pbr_result make_triangles(void *user, size_t begin, size_t end) {
    const struct synth *synth = user;
    for (uint64_t i = synth->first + begin; i < synth->first + end; i++) grid_triangle(&synth->grid, i, synth->indices + 3 * i);
    return PBR_OK;
}

/* In pieces, with progress between them. */
static pbr_result make_all(struct synth *synth, uint64_t count, pbr_range_fn work, const char *stage) {
    const uint64_t piece = 1 << 20;
    for (synth->first = 0; synth->first < count; synth->first += piece) {
        uint64_t left = count - synth->first;
        session_progress(synth->session, stage, (double)synth->first / (double)count);
        pbr_result result = pbr_parallel(synth->session->instance, left < piece ? left : piece, 1 << 14, work, synth);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

static pbr_attribute attribute(const void *data, uint32_t format, uint32_t components) {
    return (pbr_attribute){data, sizeof(struct surface_point), format, components};
}

static pbr_result create_points(const struct synth *synth, pbr_points **out) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = synth->vertex_count;
    desc.positions = attribute(synth->vertices->position, PBR_FORMAT_FLOAT32, 3);
    desc.normals = attribute(synth->vertices->normal, PBR_FORMAT_FLOAT32, 3);
    desc.colours = attribute(synth->vertices->colour, PBR_FORMAT_UINT8, 4);
    desc.radii = attribute(&synth->vertices->radius, PBR_FORMAT_FLOAT32, 1);
    desc.progress = session_progress;
    desc.progress_user = synth->session;
    return pbr_points_create(synth->session->instance, &desc, out);
}

static pbr_result create_mesh(const struct synth *synth, pbr_mesh **out) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    desc.vertex_count = synth->vertex_count;
    desc.positions = attribute(synth->vertices->position, PBR_FORMAT_FLOAT32, 3);
    desc.normals = attribute(synth->vertices->normal, PBR_FORMAT_FLOAT32, 3);
    desc.colours = attribute(synth->vertices->colour, PBR_FORMAT_UINT8, 4);
    desc.indices = synth->indices;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = synth->count;
    desc.progress = session_progress;
    desc.progress_user = synth->session;
    return pbr_mesh_create(synth->session->instance, &desc, out);
}

static int synthesize(struct synth *synth) {
    pbr_instance *instance = synth->session->instance;
    pbr_points *points = NULL;
    pbr_mesh *mesh = NULL;
    pbr_write_desc desc = PBR_WRITE_DESC_INIT;
    unsigned errors = atomic_load(&synth->session->errors);
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    desc.progress = session_progress;
    desc.progress_user = synth->session;
    synth->vertex_count = synth->is_mesh ? grid_vertex_count(&synth->grid) : synth->count;
    synth->vertices = pbr_allocate(instance, synth->vertex_count, sizeof *synth->vertices);
    if (!synth->vertices) goto cleanup;
    if (synth->is_mesh && !(synth->indices = pbr_allocate(instance, synth->count, 3 * sizeof *synth->indices))) goto cleanup;
    result = make_all(synth, synth->vertex_count, make_vertices, "making points");
    if (result == PBR_OK && synth->is_mesh) result = make_all(synth, synth->count, make_triangles, "making triangles");
    if (result == PBR_OK) result = synth->is_mesh ? create_mesh(synth, &mesh) : create_points(synth, &points);
    if (result == PBR_OK) result = pbr_write_file(instance, synth->output, points, mesh, &desc);
cleanup:
    pbr_points_release(&points);
    pbr_mesh_release(&mesh);
    pbr_free(instance, synth->vertices);
    pbr_free(instance, synth->indices);
    session_progress_end(synth->session);
    return session_check(synth->session, result, errors, synth->output) ? STATUS_OK : STATUS_FAILED;
}

/* A pbr_lod_source_fn: every kind is known point by point, so none need to be kept. */
static pbr_result deliver(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    const struct synth *synth = user;
    for (uint64_t i = 0; i < count; i++) {
        const struct surface_point point = surface_spread(&synth->surface, first + i, synth->count);
        for (uint64_t k = 0; k < 3; k++) batch->positions[3 * i + k] = (double)point.position[k];
        memcpy(batch->normals + 3 * i, point.normal, sizeof point.normal);
        memcpy(batch->colours + 4 * i, point.colour, sizeof point.colour);
        batch->radii[i] = point.radius;
    }
    return PBR_OK;
}

static int build(struct synth *synth) {
    const unsigned errors = atomic_load(&synth->session->errors);
    pbr_lod_build_desc desc = PBR_LOD_BUILD_DESC_INIT;
    desc.flags = PBR_LOD_BUILD_COLOURS;
    desc.point_count = synth->count;
    desc.source = deliver;
    desc.source_user = synth;
    desc.memory_bytes = (uint64_t)synth->memory << 20;
    desc.progress = session_progress;
    desc.progress_user = synth->session;
    const pbr_result result = pbr_lod_build_file(synth->session->instance, &desc, synth->output);
    session_progress_end(synth->session);
    return session_check(synth->session, result, errors, synth->output) ? STATUS_OK : STATUS_FAILED;
}

static int usage_error(struct synth *synth, const char *what, const char *argument) {
    session_fail(synth->session, "synth: %s%s%s%s (see pbr synth --help)", what, argument ? " '" : "", argument ? argument : "",
                 argument ? "'" : "");
    return STATUS_USAGE;
}

/* The nearest count below (step -1) or above (step 1) that a grid gives; a few steps away, except where there is none. */
static bool find_grid(const struct synth *synth, int step, struct surface_grid *grid) {
    uint64_t count = synth->count;
    for (int tries = 0; tries < 1000 && count > 0 && count <= PBR_MAX_POINTS; tries++) {
        if (grid_choose(synth->surface.kind, count, grid)) return true;
        count = step < 0 ? count - 1 : count + 1;
    }
    return false;
}

static int choose_grid(struct synth *synth) {
    const char *name = surface_names[synth->surface.kind];
    struct surface_grid low, high;
    if (synth->has_grid) {
        synth->grid.kind = synth->surface.kind;
        if (!grid_is_possible(&synth->grid)) return usage_error(synth, "--grid: too small or too large for a", name);
        if (grid_triangle_count(&synth->grid) == synth->count) return STATUS_OK;
        session_fail(synth->session, "synth: a grid of %ux%u has %" PRIu64 " triangles, not %" PRIu64,
                     (unsigned)synth->grid.columns, (unsigned)synth->grid.rows, grid_triangle_count(&synth->grid), synth->count);
        return STATUS_USAGE;
    }
    if (grid_choose(synth->surface.kind, synth->count, &synth->grid)) return STATUS_OK;
    bool has_low = find_grid(synth, -1, &low), has_high = find_grid(synth, 1, &high);
    char nearest[160] = "";
    if (has_low)
        snprintf(nearest, sizeof nearest, "%" PRIu64 " (%ux%u)", grid_triangle_count(&low), (unsigned)low.columns,
                 (unsigned)low.rows);
    if (has_high) {
        size_t used = strlen(nearest);
        snprintf(nearest + used, sizeof nearest - used, "%s%" PRIu64 " (%ux%u)", has_low ? " or " : "", grid_triangle_count(&high),
                 (unsigned)high.columns, (unsigned)high.rows);
    }
    session_fail(synth->session, "synth: no grid makes a %s of exactly %" PRIu64 " triangles; the nearest: %s", name, synth->count,
                 nearest);
    return STATUS_USAGE;
}

/* KIND, N, OUT. */
static int take_operand(struct synth *synth, int index, const char *value) {
    switch (index) {
    case 0: {
        int kind = parse_word(value, surface_names);
        if (kind < 0) return usage_error(synth, "neither sphere, torus, plane, checkerboard nor terrain:", value);
        synth->surface.kind = (enum surface_kind)kind;
        return STATUS_OK;
    }
    case 1:
        if (!parse_large_count(value, 1, HIERARCHY_MOST, &synth->count))
            return usage_error(synth, "not a number from 1 to 17592186044416:", value);
        return STATUS_OK;
    case 2:
        synth->output = value;
        synth->is_hierarchy = has_ending(value, ".pbr");
        if (synth->is_hierarchy || has_ending(value, ".ply")) return STATUS_OK;
        return usage_error(synth, "not a name ending in .ply or .pbr:", value);
    default: return usage_error(synth, "one argument too many:", value);
    }
}

/* What does not go together. */
static int check(struct synth *synth) {
    if (synth->has_grid && !synth->is_mesh) return usage_error(synth, "--grid needs --mesh", NULL);
    if (synth->is_mesh && synth->is_hierarchy) return usage_error(synth, "--mesh writes .ply, not", synth->output);
    if (synth->memory && !synth->is_hierarchy) return usage_error(synth, "--memory writes .pbr, not", synth->output);
    if (!synth->is_hierarchy && synth->count > PBR_MAX_POINTS)
        return usage_error(synth, "more than 4294967294 points or triangles go into .pbr only, not into", synth->output);
    return synth->is_mesh ? choose_grid(synth) : STATUS_OK;
}

static int run_synth(struct session *session, int argc, char **argv) {
    enum { MESH, GRID, SEED, MEMORY };
    static const struct option_rule rules[] = {[MESH] = {"--mesh", false},
                                               [GRID] = {"--grid", true},
                                               [SEED] = {"--seed", true},
                                               [MEMORY] = {"--memory", true},
                                               {NULL, false}};
    struct option_scan scan = {.argc = argc, .argv = argv};
    struct synth synth = {.session = session};
    uint32_t size[2];
    int operand_count = 0, status = STATUS_OK, option;

    while ((option = option_next(&scan, rules)) != OPTION_END) {
        switch (option) {
        case MESH: synth.is_mesh = true; break;
        case GRID:
            if (!parse_size(scan.value, UINT32_MAX - 1, size)) return usage_error(&synth, "--grid: not COLUMNSxROWS:", scan.value);
            synth.has_grid = true;
            synth.grid.columns = size[0];
            synth.grid.rows = size[1];
            break;
        case SEED:
            if (!parse_count(scan.value, 0, UINT32_MAX, &synth.surface.seed))
                return usage_error(&synth, "--seed: not a number from 0 to 4294967295:", scan.value);
            break;
        case MEMORY: {
            const char *expected = parse_memory(scan.value, &synth.memory);
            if (expected) return session_bad_value(session, "synth", "--memory", scan.value, expected);
            break;
        }
        case OPTION_OPERAND: status = take_operand(&synth, operand_count++, scan.value); break;
        default: return usage_error(&synth, scan.error, NULL);
        }
        if (status != STATUS_OK) return status;
    }
    if (operand_count < 3) return usage_error(&synth, "KIND, N and OUT are needed", NULL);
    status = check(&synth);
    if (status != STATUS_OK) return status;
    return synth.is_hierarchy ? build(&synth) : synthesize(&synth);
}

const struct command synth_command = {
    "synth", run_synth,
    "usage: pbr synth KIND N OUT.ply|OUT.pbr [options]\n"
    "\n"
    "Writes a surface of exactly N points, evenly spread, with normals, colours, and radii that close it; or of exactly N "
    "triangles.\n"
    "Into .pbr goes a hierarchy of the points, which are made as it is built, in bounded memory: N may be thousands of millions.\n"
    "KIND is sphere (radius 1), torus (radii 1 and 0.4), plane, checkerboard or terrain (each over -1..1 in x and z, y up).\n"
    "\n"
    "  --mesh                N triangles: a grid of COLUMNS x ROWS cells, two triangles each, as nearly square as N allows.\n"
    "                        An N that no such grid has is an error that names the nearest that have one\n"
    "  --grid COLUMNSxROWS   with --mesh: this grid; 2 x COLUMNS x ROWS must be N. On the sphere ROWS counts the rings of\n"
    "                        vertices between the poles\n"
    "  --seed N              of the terrain; 0\n"
    "  --memory MB           for building a .pbr, 32 at least; 1024\n"};
