/* Surfaces of known shape for `pbr synth`: evenly spread points on them, and grids of triangles over them.
 *
 * A surface is a map of the unit square (s, t), with ds x dt along its normal. Sphere (radius 1) and torus (radii 1 and 0.4, around
 * the y axis) have s once around the axis; the others lie over -1..1 in x and z, with y up. SPDX-License-Identifier: MIT */
#ifndef SURFACE_H
#define SURFACE_H

#include <stdbool.h>
#include <stdint.h>

enum surface_kind { SURFACE_SPHERE, SURFACE_TORUS, SURFACE_PLANE, SURFACE_CHECKERBOARD, SURFACE_TERRAIN };

/* In the order of surface_kind, ended by NULL. */
extern const char *const surface_names[];

struct surface {
    enum surface_kind kind;
    uint32_t seed; /* of the terrain */
};

struct surface_point {
    float position[3], normal[3];
    float radius;      /* 0 unless it is one of many that close the surface */
    uint8_t colour[4]; /* sRGB, alpha 255 */
};

struct surface_point surface_at(const struct surface *surface, double s, double t);

/* Point `i` of `count` that are spread so that each has the same area around it (of the terrain: of its plan). Discs of their radii
 * leave no hole, except beyond the outermost points of a surface with a border. */
struct surface_point surface_spread(const struct surface *surface, uint64_t i, uint64_t count);

/* 2 x columns x rows triangles. On the sphere rows are rings of vertices between the poles, so that no triangle has an edge of
 * length 0. */
struct surface_grid {
    enum surface_kind kind;
    uint32_t columns, rows; /* along s, along t */
};

/* Columns and rows enough to make the surface, and vertices few enough for 32-bit indices? */
bool grid_is_possible(const struct surface_grid *grid);
uint64_t grid_triangle_count(const struct surface_grid *grid);
uint64_t grid_vertex_count(const struct surface_grid *grid);

/* The grid of exactly so many triangles whose cells are nearest to squares. False if there is none, or none with cells less than 8
 * times as long as wide. */
bool grid_choose(enum surface_kind kind, uint64_t triangle_count, struct surface_grid *grid);

struct surface_point grid_vertex(const struct surface_grid *grid, const struct surface *surface, uint64_t i);
/* Counterclockwise seen from the side that the normals point to. */
void grid_triangle(const struct surface_grid *grid, uint64_t i, uint32_t corners[3]);

#endif
