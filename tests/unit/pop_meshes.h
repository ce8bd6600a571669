/* Meshes for the tests of POP hierarchies, hostile ones among them. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_UNIT_POP_MESHES_H
#define PBR_TESTS_UNIT_POP_MESHES_H

#include "support.h"

#include "core/matrix.h"
#include "lod/pop.h"

enum pop_mesh_shape { GRID, TORUS, SOUP, COINCIDENT, LINE, TWO_PARTS };

enum {
    WITH_COLOURS = 1,
    SURVEY = 2,   /* far from zero */
    HUGE_ONE = 4, /* the first triangle is 1000 times as large as all else */
    HUGE = 8,     /* near to the largest that a hierarchy can be */
    TINY = 16,    /* at the other end of floats */
    NO_NORMALS = 32,
    NAN_VERTICES = 64, /* triangles with them are the mesh's to drop */
    SLIVERS = 128,
    ROUGH = 256 /* normals differ from corner to corner, most by little */
};

struct pop_mesh_kind {
    const char *name;
    enum pop_mesh_shape shape;
    uint32_t count; /* triangles */
    unsigned flags;
};

static const struct pop_mesh_kind pop_mesh_kinds[] = {
    {"no triangle", SOUP, 0, 0},
    {"1 triangle", SOUP, 1, 0},
    {"2 triangles", SOUP, 2, WITH_COLOURS},
    {"5 triangles", SOUP, 5, 0},
    {"a grid", GRID, 2000, WITH_COLOURS},
    {"a torus", TORUS, 5003, WITH_COLOURS},
    {"a torus of slivers", TORUS, 4000, SLIVERS},
    {"triangles anywhere", SOUP, 3001, WITH_COLOURS},
    {"one triangle is huge", TORUS, 3000, HUGE_ONE},
    {"all in one place", COINCIDENT, 777, WITH_COLOURS},
    {"all on a line", LINE, 1234, 0},
    {"two far parts", TWO_PARTS, 2500, 0},
    {"a survey", TORUS, 2600, SURVEY | WITH_COLOURS},
    {"huge coordinates", SOUP, 900, HUGE},
    {"tiny coordinates", SOUP, 900, TINY},
    {"no normals", TORUS, 1100, NO_NORMALS},
    {"rough normals", GRID, 3000, ROUGH},
    {"vertices that are no numbers", TORUS, 1900, NAN_VERTICES},
};

/* Corners are not shared: neighbours have vertices of their own in one place. */
static inline void pop_mesh_place(const struct pop_mesh_kind *kind, double u, double v, double out[3]) {
    const double pi = acos(-1);
    if (kind->shape == GRID) {
        out[0] = 2 * u - 1, out[1] = 0.1 * sin(9 * u) * cos(7 * v), out[2] = 2 * v - 1;
        return;
    }
    const double a = 2 * pi * u, b = 2 * pi * v;
    out[0] = (1 + 0.4 * cos(b)) * cos(a), out[1] = 0.4 * sin(b), out[2] = (1 + 0.4 * cos(b)) * sin(a);
}

static inline void pop_mesh_triangle(const struct pop_mesh_kind *kind, uint32_t i, uint64_t *state, double corners[3][3]) {
    const uint32_t rows = kind->flags & SLIVERS ? 4 : (uint32_t)ceil(sqrt(kind->count / 2.0));
    const uint32_t columns = (kind->count / 2 + rows) / rows, cell = i / 2;
    double centre[3];
    for (int k = 0; k < 3; k++) centre[k] = 2 * uniform(state) - 1;
    for (int c = 0; c < 3; c++) {
        const uint32_t right = i % 2 ? c != 0 : c == 1, up = i % 2 ? c != 2 : c == 2;
        switch (kind->shape) {
        case GRID:
        case TORUS:
            pop_mesh_place(kind, (double)(cell % columns + right) / columns, (double)(cell / columns + up) / rows, corners[c]);
            break;
        case SOUP:
        case TWO_PARTS: /* of sizes that differ by some thousands */
            for (int k = 0; k < 3; k++) {
                corners[c][k] = centre[k] + exp(-8 * uniform(state)) * (uniform(state) - 0.5);
                if (kind->shape == TWO_PARTS) corners[c][k] = 1e-3 * corners[c][k] + (i % 3 ? 1 : -1);
            }
            break;
        case COINCIDENT: corners[c][0] = 0.25, corners[c][1] = -3, corners[c][2] = 7; break;
        case LINE: corners[c][0] = corners[c][1] = corners[c][2] = uniform(state); break;
        }
    }
    const double size = kind->flags & HUGE ? 2e17 : kind->flags & TINY ? 1e-30 : kind->flags & HUGE_ONE && i == 0 ? 1000 : 1;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++) corners[c][k] = corners[c][k] * size + (kind->flags & SURVEY ? 1e6 * (k + 1) : 0);
}

static inline pbr_mesh *make_pop_mesh(pbr_instance *instance, const struct pop_mesh_kind *kind) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    const size_t count = kind->count, vertices = 3 * count;
    double(*positions)[3] = calloc(vertices + 1, sizeof *positions);
    float(*normals)[3] = calloc(vertices + 1, sizeof *normals);
    uint8_t(*colours)[4] = calloc(vertices + 1, sizeof *colours);
    uint32_t *indices = calloc(vertices + 1, sizeof *indices);
    uint64_t state = 5;
    pbr_mesh *mesh = NULL;
    assert_true(positions && normals && colours && indices);
    for (uint32_t i = 0; i < kind->count; i++) {
        pop_mesh_triangle(kind, i, &state, positions + 3 * i);
        if (kind->flags & NAN_VERTICES && i % 7 == 0) positions[3 * i + i % 3][1] = NAN;
    }
    for (size_t v = 0; v < vertices; v++) {
        indices[v] = (uint32_t)v;
        for (int k = 0; k < 4; k++) colours[v][k] = (uint8_t)(256 * uniform(&state));
        if (!(kind->flags & ROUGH)) continue;
        const double turn = 6.3 * uniform(&state), off = 0.6 * pow(uniform(&state), 12);
        normals[v][0] = (float)(sin(off) * cos(turn)), normals[v][1] = (float)cos(off),
        normals[v][2] = (float)(sin(off) * sin(turn));
    }
    desc.vertex_count = vertices;
    desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT64, .components = 3};
    if (kind->flags & (NO_NORMALS | ROUGH))
        desc.normals = (pbr_attribute){.data = normals, .format = PBR_FORMAT_FLOAT32, .components = 3};
    if (kind->flags & WITH_COLOURS) desc.colours = (pbr_attribute){.data = colours, .format = PBR_FORMAT_UINT8, .components = 4};
    desc.indices = indices;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = count;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    free(positions);
    free(normals);
    free(colours);
    free(indices);
    return mesh;
}

static inline void pop_vertex(const struct pop *pop, uint32_t vertex, double out[3]) {
    for (int k = 0; k < 3; k++) out[k] = (double)pop->vertices[vertex].position[k];
}

#endif
