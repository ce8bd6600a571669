/* The codes of QSplat's nodes: spheres, normals, colours. The tables follow the original's file format, version 11.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "core/four.h"
#include "core/minmax.h"
#include "qsplat.h"

static void make_spheres(struct qsplat_codes *codes) {
    const double grid = QSPLAT_GRID;
    uint16_t next = 0;
    for (int s = 0; s <= QSPLAT_GRID; s++)
        for (int i = 0; i < QSPLAT_GRID * QSPLAT_GRID * QSPLAT_GRID; i++) (&codes->indices[s][0][0][0])[i] = QSPLAT_SPHERES;
    for (int s = 1; s <= QSPLAT_GRID; s++)
        for (int x = 0; x <= QSPLAT_GRID - s; x++)
            for (int y = 0; y <= QSPLAT_GRID - s; y++)
                for (int z = 0; z <= QSPLAT_GRID - s; z++) {
                    const double X = (s + 2 * x) / grid - 1, Y = (s + 2 * y) / grid - 1, Z = (s + 2 * z) / grid - 1, R = s / grid;
                    const double most = 1 + sqrt(3) * R;
                    if (X * X + Y * Y + Z * Z > most * most) continue;
                    float *sphere = codes->spheres[next];
                    sphere[0] = (float)X, sphere[1] = (float)Y, sphere[2] = (float)Z, sphere[3] = (float)R;
                    codes->indices[s][x][y][z] = next++;
                }
    for (int i = next; i < 1 << QSPLAT_GRID; i++) codes->spheres[i][3] = (float)(1 / grid);
}

/* Cells of equal angle on the faces of a cube. */
static void make_normals(bool own, struct qsplat_codes *codes) {
    const double eighth = atan(1);
    double centres[QSPLAT_NORMAL_GRID];
    for (int i = 0; i <= QSPLAT_NORMAL_GRID; i++) codes->edges[i] = (float)tan((2.0 * i / QSPLAT_NORMAL_GRID - 1) * eighth);
    for (int i = 0; i < QSPLAT_NORMAL_GRID; i++) centres[i] = tan(((2.0 * i + 1) / QSPLAT_NORMAL_GRID - 1) * eighth);
    for (int code = 0; code < QSPLAT_NORMALS; code++) {
        const int face = code / (QSPLAT_NORMAL_GRID * QSPLAT_NORMAL_GRID), axis = face / 2;
        const double u = centres[code / QSPLAT_NORMAL_GRID % QSPLAT_NORMAL_GRID], v = centres[code % QSPLAT_NORMAL_GRID];
        /* Corner cells lie outside the sphere: on its rim then. */
        const double w = sqrt(fmax(1 - u * u - v * v, 0)), length = sqrt(u * u + v * v + w * w);
        float *n = codes->normals[code];
        n[axis] = (float)((face % 2 ? -w : w) / length);
        n[(axis + 1) % 3] = (float)(u / length);
        n[(axis + 2) % 3] = (float)(v / length);
    }
    for (int code = QSPLAT_NORMALS; code < QSPLAT_NORMAL_CODES; code++) codes->normals[code][2] = own ? 0 : 1;
    for (int code = 0; code < QSPLAT_NORMAL_CODES; code++) splat_encode_normal(codes->normals[code], codes->octahedral[code]);
}

void qsplat_codes_make(bool own, struct qsplat_codes *codes) {
    memset(codes, 0, sizeof *codes);
    make_spheres(codes);
    make_normals(own, codes);
}

/* ---- Encoding ---- */

static uint32_t find_cell(const struct qsplat_codes *codes, float c) {
    /* The cells' edges are tangents of even angles: a rational guess at the angle, put right by a cell at most. (Tried with all
     * floats from -1 to 1.) */
    const float guess = (c * (1.3476f - 0.3476f * fabsf(c)) + 1) * (QSPLAT_NORMAL_GRID / 2.0f);
    int i = guess > 0 ? (int)guess : 0;
    if (i >= QSPLAT_NORMAL_GRID) i = QSPLAT_NORMAL_GRID - 1;
    i -= (i > 0) & (c < codes->edges[i]);
    i += (i + 1 < QSPLAT_NORMAL_GRID) & (c >= codes->edges[i + 1]);
    return (uint32_t)i;
}

uint16_t qsplat_encode_normal(const struct qsplat_codes *codes, const float normal[3]) {
    const float squared = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
    if (!(squared > 0) || !isfinite(squared)) return QSPLAT_NO_NORMAL;
    const float scale = 1 / sqrtf(squared), cyclic[5] = {normal[0], normal[1], normal[2], normal[0], normal[1]};
    const float x = fabsf(normal[0]), y = fabsf(normal[1]), z = fabsf(normal[2]);
    const uint32_t is_z = z > largerf(x, y), axis = 2 * is_z | ((y > x) & !is_z); /* without a branch: it could not be foreseen */
    const uint32_t face = 2 * axis + (cyclic[axis] < 0);
    const uint32_t u = find_cell(codes, cyclic[axis + 1] * scale), v = find_cell(codes, cyclic[axis + 2] * scale);
    return (uint16_t)((face * QSPLAT_NORMAL_GRID + u) * QSPLAT_NORMAL_GRID + v);
}

uint16_t qsplat_encode_colour(const uint8_t srgb[3]) {
    const uint32_t r = (srgb[0] * 31u + 127) / 255, g = (srgb[1] * 63u + 127) / 255, b = (srgb[2] * 31u + 127) / 255;
    return (uint16_t)(r << 11 | g << 5 | b);
}

static bool holds(const struct qsplat_sphere *outer, const struct qsplat_sphere *inner) {
    double squared = 0;
    const double room = (double)outer->radius - (double)inner->radius;
    for (int k = 0; k < 3; k++) {
        const double d = (double)outer->centre[k] - (double)inner->centre[k];
        squared += d * d;
    }
    return room >= 0 && squared <= room * room;
}

/* A disc whose code lies off its plane is seen past, along the surface. One that is h off it, and s along it, hides what the disc
 * does from as far off the normal as an angle of tangent ASIDE, if its radius is larger by s + ASIDE h. (What other tangents give
 * and cost: docs/qsplat.md.) */
static const float ASIDE = 2;

enum { NONE = INT32_MAX };

/* What sorts codes by how far off the disc's plane they lie, for the four that number `first` and on: that distance as the bits of
 * a float, which are in order as integers are, the last three replaced by the code's number. NONE where a code does not hide the
 * disc. squared: from the code's centre to the disc's; high: off the disc's plane; room: how much larger the code's radius is. */
static four_ints rank(four squared, four high, float room, int32_t first) {
    const four height = four_magnitude(high), aside = room - ASIDE * height;
    const four_ints hides = (aside >= 0) & (squared - high * high <= aside * aside);
    const four_ints number = {first, first + 1, first + 2, first + 3};
    return (four_ints)four_choose(hides, (four)(((four_ints)height & ~7) | number), (four)((four_ints){0} + NONE));
}

static int32_t find_least(const four_ints ranks[2]) {
    const four_ints least = (four_ints)four_choose(ranks[0] < ranks[1], (four)ranks[0], (four)ranks[1]);
    const int32_t x = least[0] < least[1] ? least[0] : least[1], y = least[2] < least[3] ? least[2] : least[3];
    return x < y ? x : y;
}

static inline bool try_code(const struct qsplat_codes *codes, int size, four_ints cell, const struct qsplat_sphere *sphere,
                            const struct qsplat_sphere *parent, uint16_t *code, struct qsplat_sphere *decoded) {
    for (int k = 0; k < 3; k++)
        if (cell[k] < 0 || cell[k] > QSPLAT_GRID - size) return false;
    const uint16_t tried = codes->indices[size][cell[0]][cell[1]][cell[2]];
    if (tried == QSPLAT_SPHERES) return false;
    const struct qsplat_sphere to = qsplat_decode_sphere(codes, tried, parent);
    if (!holds(&to, sphere)) return false;
    *code = tried;
    *decoded = to;
    return true;
}

uint16_t qsplat_encode_sphere(const struct qsplat_codes *codes, const struct qsplat_sphere *sphere, const float normal[3],
                              const struct qsplat_sphere *parent, struct qsplat_sphere *decoded) {
    enum { LARGER = 2 /* sizes, at most, for the disc's sake; nor more than twice as large */ };
    const float grid = QSPLAT_GRID, scale = parent->radius > 0 ? grid / parent->radius : 0;
    const four at = (four_load3(sphere->centre) - four_load3(parent->centre)) * scale; /* in cells from the grid's middle */
    const four none = {0}, across = normal ? four_load3(normal) : none;
    const float cells = sphere->radius * scale;
    int size = cells < 1 ? 1 : cells < grid ? (int)cells + ((float)(int)cells < cells) : QSPLAT_GRID; /* that may hold it */
    int least = QSPLAT_GRID;                                                                          /* that holds it */
    uint16_t code = QSPLAT_SPHERES - 1;
    for (; size < QSPLAT_GRID && size <= least + (least < LARGER ? least : LARGER); size++) {
        const float room = (float)size - cells, last = grid - (float)size;
        const four place = four_larger((at + last) / 2, none), most = none + last;
        const four_ints cell = __builtin_convertvector(four_lesser(place, most) + 0.5f, four_ints);
        const four off = at - __builtin_convertvector(size + 2 * cell - QSPLAT_GRID, four); /* from the code's centre */
        const float squared = four_dot3(off, off);
        if (squared > room * room) continue;
        if (normal) {
            /* The cell, and those a step towards the disc along some axes: bit k of their number, along axis k. */
            const four farther = 4 - 4 * four_magnitude(off), lower = four_choose(off < 0, -2 * across, 2 * across);
            const four squareds = squared + (four){0, farther[0], farther[1], farther[0] + farther[1]};
            const four heights = four_dot3(off, across) - (four){0, lower[0], lower[1], lower[0] + lower[1]};
            four_ints ranks[2] = {rank(squareds, heights, room, 0), rank(squareds + farther[2], heights - lower[2], room, 4)};
            for (int32_t best; (best = find_least(ranks)) != NONE;) {
                const four_ints is_along = (best & (four_ints){1, 2, 4, 0}) != 0, way = (off < 0) | 1;
                if (try_code(codes, size, cell + (is_along & way), sphere, parent, &code, decoded)) return code;
                for (int z = 0; z < 2; z++) ranks[z] |= (ranks[z] == best) & NONE;
            }
        }
        if (least == QSPLAT_GRID && try_code(codes, size, cell, sphere, parent, &code, decoded)) {
            if (!normal) return code;
            least = size;
        }
    }
    if (code == QSPLAT_SPHERES - 1) *decoded = qsplat_decode_sphere(codes, code, parent);
    return code;
}
