/* Sphere, torus, plane, checkerboard and terrain. SPDX-License-Identifier: MIT */
#include "surface.h"

#include <math.h>
#include <stddef.h>

const char *const surface_names[] = {[SURFACE_SPHERE] = "sphere",   [SURFACE_TORUS] = "torus",
                                     [SURFACE_PLANE] = "plane",     [SURFACE_CHECKERBOARD] = "checkerboard",
                                     [SURFACE_TERRAIN] = "terrain", NULL};

static const double pi = 3.14159265358979323846;
static const double tube = 0.4; /* the torus's smaller radius; the larger is 1 */

/* The output function of SplitMix64 (Steele, Lea & Flood 2014): every bit of the result depends on every bit of `z`. */
static uint64_t mix(uint64_t z) {
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

/* A height of -1..1 for each point of the integer lattice of each octave. */
static double lattice_height(uint64_t key, int64_t x, int64_t z) {
    uint64_t bits = mix(mix(key + (uint64_t)x) + (uint64_t)z);
    return (double)(bits >> 11) / (double)(UINT64_C(1) << 52) - 1;
}

/* Adds a height that is smooth between the lattice's (value noise) to out[0], and its slopes along x and z to out[1], out[2]. */
static void add_noise(uint64_t key, double x, double z, double height, double frequency, double out[3]) {
    double x0 = floor(x), z0 = floor(z), corners[4];
    double u = x - x0, w = z - z0;
    for (int i = 0; i < 4; i++) corners[i] = lattice_height(key, (int64_t)x0 + i % 2, (int64_t)z0 + i / 2);
    /* Weights with zero first and second derivatives at both ends, so that normals have no creases. */
    double fu = u * u * u * (6 * u * u - 15 * u + 10), du = 30 * u * u * (u - 1) * (u - 1);
    double fw = w * w * w * (6 * w * w - 15 * w + 10), dw = 30 * w * w * (w - 1) * (w - 1);
    double along_x = corners[1] - corners[0], along_z = corners[2] - corners[0];
    double twist = corners[0] - corners[1] - corners[2] + corners[3];
    out[0] += height * (corners[0] + along_x * fu + along_z * fw + twist * fu * fw);
    out[1] += height * frequency * du * (along_x + twist * fw);
    out[2] += height * frequency * dw * (along_z + twist * fu);
}

/* Height and slopes over (x, z): octaves of half the width and 0.4 of the height each. */
static void terrain_height(uint32_t seed, double x, double z, double out[3]) {
    double height = 0.3, frequency = 1.5;
    out[0] = out[1] = out[2] = 0;
    for (uint64_t octave = 0; octave < 6; octave++) {
        add_noise(mix((uint64_t)seed << 8 | octave), frequency * x, frequency * z, height, frequency, out);
        height *= 0.4;
        frequency *= 2;
    }
}

static void set_colour(struct surface_point *point, double red, double green, double blue) {
    const double colour[3] = {red, green, blue};
    for (int i = 0; i < 3; i++) point->colour[i] = (uint8_t)(255 * fmin(fmax(colour[i], 0), 1) + 0.5);
    point->colour[3] = 255;
}

static void set_vectors(struct surface_point *point, const double position[3], const double normal[3]) {
    for (int i = 0; i < 3; i++) {
        point->position[i] = (float)position[i];
        point->normal[i] = (float)normal[i];
    }
}

static struct surface_point sphere_at(double s, double t) {
    struct surface_point point = {.radius = 0};
    double around = 2 * pi * s, width = sin(pi * t);
    const double n[3] = {width * sin(around), -cos(pi * t), width * cos(around)};
    set_vectors(&point, n, n);
    set_colour(&point, (n[0] + 1) / 2, (n[1] + 1) / 2, (n[2] + 1) / 2);
    return point;
}

static struct surface_point torus_at(double s, double t) {
    struct surface_point point = {.radius = 0};
    double around = 2 * pi * s, across = 2 * pi * t, distance = 1 + tube * cos(across);
    const double position[3] = {distance * sin(around), tube * sin(across), distance * cos(around)};
    const double normal[3] = {cos(across) * sin(around), sin(across), cos(across) * cos(around)};
    set_vectors(&point, position, normal);
    set_colour(&point, 0.6 + 0.35 * cos(around), 0.6 + 0.35 * cos(around - 2 * pi / 3), 0.6 + 0.35 * cos(around + 2 * pi / 3));
    return point;
}

static struct surface_point plane_at(double s, double t, bool is_checkered) {
    struct surface_point point = {.radius = 0};
    set_vectors(&point, (double[3]){2 * s - 1, 0, 1 - 2 * t}, (double[3]){0, 1, 0});
    if (!is_checkered) set_colour(&point, 0.2 + 0.7 * s, 0.2 + 0.7 * t, 0.5);
    else if (((int)floor(8 * s) + (int)floor(8 * t)) % 2) set_colour(&point, 0.15, 0.3, 0.5);
    else set_colour(&point, 0.9, 0.9, 0.85);
    return point;
}

/* Grass, rock where it is steep, snow where it is high. */
static struct surface_point terrain_at(uint32_t seed, double s, double t) {
    struct surface_point point = {.radius = 0};
    double x = 2 * s - 1, z = 1 - 2 * t, height[3];
    terrain_height(seed, x, z, height);
    double up = 1 / sqrt(1 + height[1] * height[1] + height[2] * height[2]);
    set_vectors(&point, (double[3]){x, height[0], z}, (double[3]){-height[1] * up, up, -height[2] * up});
    double rock = fmin(fmax((0.9 - up) / 0.15, 0), 1), snow = fmin(fmax((height[0] - 0.12) / 0.1, 0), 1) * (1 - rock);
    double bare = (1 - rock) * (1 - snow);
    set_colour(&point, 0.33 * bare + 0.45 * rock + 0.95 * snow, 0.50 * bare + 0.40 * rock + 0.95 * snow,
               0.22 * bare + 0.35 * rock + 0.97 * snow);
    return point;
}

struct surface_point surface_at(const struct surface *surface, double s, double t) {
    switch (surface->kind) {
    case SURFACE_SPHERE: return sphere_at(s, t);
    case SURFACE_TORUS: return torus_at(s, t);
    case SURFACE_TERRAIN: return terrain_at(surface->seed, s, t);
    default: return plane_at(s, t, surface->kind == SURFACE_CHECKERBOARD);
    }
}

/* The t below which lies this fraction of the area. */
static double area_inverse(enum surface_kind kind, double fraction) {
    if (kind == SURFACE_SPHERE) return acos(1 - 2 * fraction) / pi;
    if (kind != SURFACE_TORUS) return fraction;
    /* a + tube sin a = 2 pi fraction; from its right side Newton's method is within 1e-15 in six steps. */
    double a = 2 * pi * fraction;
    for (int i = 0; i < 8; i++) a -= (a + tube * sin(a) - 2 * pi * fraction) / (1 + tube * cos(a));
    return a / (2 * pi);
}

static double surface_area(enum surface_kind kind) {
    return kind == SURFACE_SPHERE ? 4 * pi : kind == SURFACE_TORUS ? 4 * pi * pi * tube : 4;
}

/* A lattice of the golden ratio: it stays evenly spread however the surface stretches the square along s or t. With area a for
 * each point, none of the surface is farther than sqrt(a / 2) from a point; 0.77 sqrt(a) at the sphere's poles, and 0.87 sqrt(a)
 * where the torus's first and last points meet (both measured). */
struct surface_point surface_spread(const struct surface *surface, uint64_t i, uint64_t count) {
    const double golden = 0.61803398874989484820, reach = 0.9;
    double s = fmod((double)i * golden, 1), t = area_inverse(surface->kind, ((double)i + 0.5) / (double)count);
    struct surface_point point = surface_at(surface, s, t);
    double stretch = surface->kind == SURFACE_TERRAIN ? 1 / (double)point.normal[1] : 1; /* down the slope */
    point.radius = (float)(reach * stretch * sqrt(surface_area(surface->kind) / (double)count));
    return point;
}

bool grid_is_possible(const struct surface_grid *grid) {
    uint32_t columns = 1, rows = 1;
    if (grid->kind == SURFACE_SPHERE || grid->kind == SURFACE_TORUS) columns = 3;
    if (grid->kind == SURFACE_TORUS) rows = 3;
    return grid->columns >= columns && grid->rows >= rows && grid_vertex_count(grid) < UINT32_MAX;
}

uint64_t grid_triangle_count(const struct surface_grid *grid) {
    return 2 * (uint64_t)grid->columns * grid->rows;
}

uint64_t grid_vertex_count(const struct surface_grid *grid) {
    const uint64_t columns = grid->columns, rows = grid->rows;
    return grid->kind == SURFACE_SPHERE  ? columns * rows + 2
           : grid->kind == SURFACE_TORUS ? columns * rows
                                         : (columns + 1) * (rows + 1);
}

bool grid_choose(enum surface_kind kind, uint64_t triangle_count, struct surface_grid *grid) {
    const double square = kind == SURFACE_SPHERE ? 2 : kind == SURFACE_TORUS ? 1 / tube : 1; /* columns to rows */
    const uint64_t cells = triangle_count / 2;
    double best = log(8);
    bool found = false;
    if (triangle_count % 2) return false;
    for (uint64_t a = 1; a * a <= cells; a++) {
        if (cells % a || cells / a > UINT32_MAX) continue;
        for (int turn = 0; turn < 2; turn++) {
            struct surface_grid tried = {kind, (uint32_t)(turn ? a : cells / a), (uint32_t)(turn ? cells / a : a)};
            double badness = fabs(log((double)tried.columns / tried.rows / square));
            if (badness >= best || !grid_is_possible(&tried)) continue;
            best = badness;
            *grid = tried;
            found = true;
        }
    }
    return found;
}

struct surface_point grid_vertex(const struct surface_grid *grid, const struct surface *surface, uint64_t i) {
    const uint64_t columns = grid->columns, rows = grid->rows;
    const uint64_t across = grid->kind == SURFACE_SPHERE || grid->kind == SURFACE_TORUS ? columns : columns + 1;
    double s = (double)(i % across) / (double)columns, row = (double)(i / across);
    if (grid->kind != SURFACE_SPHERE) return surface_at(surface, s, row / (double)rows);
    if (i >= columns * rows) return surface_at(surface, 0, (double)(i - columns * rows)); /* poles */
    return surface_at(surface, s, (row + 1) / (double)(rows + 1));
}

/* The cell's corners at its lower and its upper row, split along the diagonal. */
static void cell_triangle(uint64_t lower, uint64_t upper, uint64_t column, uint64_t next, bool is_second, uint32_t corners[3]) {
    corners[0] = (uint32_t)(lower + column);
    corners[1] = (uint32_t)(is_second ? upper + next : lower + next);
    corners[2] = (uint32_t)(is_second ? upper + column : upper + next);
}

void grid_triangle(const struct surface_grid *grid, uint64_t i, uint32_t corners[3]) {
    const uint64_t columns = grid->columns, rows = grid->rows, column = i / 2 % columns, row = i / 2 / columns;
    const uint64_t next = (column + 1) % columns;
    const bool is_second = i % 2;
    switch (grid->kind) {
    case SURFACE_TORUS: cell_triangle(row * columns, (row + 1) % rows * columns, column, next, is_second, corners); break;
    case SURFACE_SPHERE:
        if (row + 1 < rows) {
            cell_triangle(row * columns, (row + 1) * columns, column, next, is_second, corners);
        } else { /* the last "row" is that of the two poles */
            uint64_t ring = is_second ? (rows - 1) * columns : 0;
            corners[0] = (uint32_t)(ring + (is_second ? column : next));
            corners[1] = (uint32_t)(ring + (is_second ? next : column));
            corners[2] = (uint32_t)(columns * rows + is_second);
        }
        break;
    default: cell_triangle(row * (columns + 1), (row + 1) * (columns + 1), column, column + 1, is_second, corners); break;
    }
}
