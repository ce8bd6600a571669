/* Nodes of QSplat trees that are built, from the leaves up: spheres and cones tight around the leaves within runs, around the
 * children above; averages of normals and colours by area. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "qsplat_build.h"

static const float CONE_ROOM = 6e-4f; /* radians: the arc cosine of a dot product that is off by a few units in the last place */

static float distance(const float a[3], const float b[3]) {
    const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* A sphere around spheres: steps towards the farthest one, ever shorter (Badoiu & Clarkson 2003), from the middle. The radius is
 * rounded up. */
static struct qsplat_sphere enclose(const struct qsplat_sphere *spheres, uint32_t count) {
    enum { STEPS = 8 };
    struct qsplat_sphere out = {{0, 0, 0}, 0};
    for (int k = 0; k < 3; k++) {
        float low = INFINITY, high = -INFINITY;
        for (uint32_t i = 0; i < count; i++) {
            low = fminf(low, spheres[i].centre[k] - spheres[i].radius);
            high = fmaxf(high, spheres[i].centre[k] + spheres[i].radius);
        }
        out.centre[k] = (low + high) / 2;
    }
    float centre[3], step = 0.25f;
    memcpy(centre, out.centre, sizeof centre);
    out.radius = INFINITY;
    for (int s = 0;; s++, step *= 0.7f) {
        uint32_t farthest = 0;
        float reach = -1, apart = 0;
        for (uint32_t i = 0; i < count; i++) {
            const float d = distance(centre, spheres[i].centre);
            if (d + spheres[i].radius <= reach) continue;
            reach = d + spheres[i].radius, apart = d, farthest = i;
        }
        if (reach < out.radius) {
            memcpy(out.centre, centre, sizeof centre);
            out.radius = reach;
        }
        if (s == STEPS || !(apart > 0)) break;
        for (int k = 0; k < 3; k++) centre[k] += (spheres[farthest].centre[k] - centre[k]) * (step * reach / apart);
    }
    out.radius *= 1 + 4 * FLT_EPSILON;
    return out;
}

static void add_sums(struct sums *to, const struct sums *from) {
    for (int k = 0; k < 3; k++) {
        to->normal[k] += from->normal[k];
        to->colour[k] += from->colour[k];
    }
    to->weight += from->weight;
    to->reach = fmaxf(to->reach, from->reach);
    to->span = fmaxf(to->span, from->span);
}

static void finish_codes(const struct builder *builder, const struct sums *sums, struct node *node) {
    node->normal = qsplat_encode_normal(builder->codes, sums->normal);
    if (!builder->tree->has_colours) return;
    uint8_t srgb[3];
    for (int k = 0; k < 3; k++) srgb[k] = unorm8(srgb_from_linear(sums->colour[k] / sums->weight));
    node->colour = qsplat_encode_colour(srgb);
}

/* What a leaf brings to averages. */
static struct sums sums_of_leaf(const struct builder *builder, const struct leaf *leaf) {
    const float *normal = builder->codes->normals[leaf->normal];
    const float size = fminf(fmaxf(leaf->sphere.radius / builder->extent, 1e-9f), 1e3f), weight = size * size;
    const float centre[3] = {0, 0, 0};
    struct sums sums = {.weight = weight, .span = distance(centre, leaf->sphere.centre)};
    sums.reach = sums.span + leaf->sphere.radius;
    for (int k = 0; k < 3; k++) sums.normal[k] = weight * normal[k];
    sums.colour[0] = weight * builder->linear[0][leaf->colour >> 11];
    sums.colour[1] = weight * builder->linear[1][leaf->colour >> 5 & 63];
    sums.colour[2] = weight * builder->linear[0][leaf->colour & 31];
    return sums;
}

struct node *node_at(const struct builder *builder, const struct window *window, uint32_t level, uint64_t index) {
    return level < KEPT_LEVEL ? &window->levels[level][index - (window->first >> 2 * level)] : &builder->levels[level][index];
}

/* Tight around the leaves: a centre from the spheres below, and the least that holds all from there. */
static void measure_in_run(const struct builder *builder, const struct leaf *leaves, size_t count, struct node *node) {
    const float *axis = builder->codes->normals[node->normal], *centre = node->sphere.centre;
    float reach = 0, least = 1;
    for (size_t i = 0; i < count; i++) {
        const struct leaf *leaf = &leaves[i];
        const float *n = builder->codes->normals[leaf->normal];
        const float far = distance(centre, leaf->sphere.centre) + leaf->sphere.radius;
        const float dot = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2];
        reach = far > reach ? far : reach;
        least = dot < least ? dot : least;
        if (leaf->normal == QSPLAT_NO_NORMAL) least = -1;
    }
    node->sphere.radius = fminf(node->sphere.radius, reach * (1 + 4 * FLT_EPSILON));
    node->angle = node->normal == QSPLAT_NO_NORMAL ? 4 : acosf(least) + CONE_ROOM;
}

/* Of one level within a run: `below` holds the sums of the level below, if those are nodes, and gets this level's. */
static void make_run_level(struct builder *builder, const struct window *window, uint64_t first, size_t count, uint32_t level,
                           struct sums *below) {
    const size_t size = (size_t)1 << 2 * level, nodes = (count + size - 1) / size, children = (count + size / 4 - 1) / (size / 4);
    const struct leaf *leaves = window->leaves + (first - window->first);
    for (size_t i = 0; i < nodes; i++) {
        struct node *node = node_at(builder, window, level, (first >> 2 * level) + i);
        struct qsplat_sphere spheres[QSPLAT_CHILDREN];
        struct sums sums = {.weight = 0};
        uint32_t n = 0;
        for (size_t c = 4 * i; c < 4 * i + 4 && c < children; c++, n++) {
            spheres[n] =
                level == 1 ? leaves[c].sphere : node_at(builder, window, level - 1, (first >> 2 * (level - 1)) + c)->sphere;
            const struct sums part = level == 1 ? sums_of_leaf(builder, &leaves[c]) : below[c];
            add_sums(&sums, &part);
        }
        below[i] = sums;
        node->sphere = enclose(spheres, n);
        finish_codes(builder, &sums, node);
        measure_in_run(builder, leaves + i * size, count - i * size < size ? count - i * size : size, node);
    }
}

void make_run(struct builder *builder, const struct window *window, uint64_t run, struct sums *sums) {
    const uint64_t first = run * RUN;
    const size_t count = builder->count - first < RUN ? (size_t)(builder->count - first) : RUN;
    for (uint32_t level = 1; level <= RUN_LEVEL; level++) make_run_level(builder, window, first, count, level, sums);
    builder->sums[run] = sums[0];
}

static float angle_between(const float a[3], const float b[3]) {
    return acosf(fmaxf(fminf(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 1), -1));
}

static void make_upper_level(struct builder *builder, uint32_t level) {
    const uint64_t nodes = level_count(builder, level), children = level_count(builder, level - 1);
    for (uint64_t i = 0; i < nodes; i++) {
        struct node *node = &builder->levels[level][i];
        const struct node *below = &builder->levels[level - 1][4 * i];
        const uint32_t n = children - 4 * i < 4 ? (uint32_t)(children - 4 * i) : 4;
        struct qsplat_sphere spheres[QSPLAT_CHILDREN];
        struct sums sums = {.weight = 0};
        for (uint32_t c = 0; c < n; c++) {
            spheres[c] = below[c].sphere;
            add_sums(&sums, &builder->sums[4 * i + c]);
        }
        builder->sums[i] = sums;
        node->sphere = enclose(spheres, n);
        finish_codes(builder, &sums, node);
        for (uint32_t c = 0; c < n; c++) {
            const float apart = angle_between(builder->codes->normals[node->normal], builder->codes->normals[below[c].normal]);
            node->angle = fmaxf(node->angle, below[c].angle + apart + CONE_ROOM);
        }
        if (node->normal == QSPLAT_NO_NORMAL) node->angle = 4;
    }
}

struct qsplat_sphere make_upper_levels(struct builder *builder) {
    for (uint32_t level = RUN_LEVEL + 1; level <= builder->top; level++) make_upper_level(builder, level);
    builder->tree->span = builder->sums[0].span;
    return (struct qsplat_sphere){{0, 0, 0}, builder->sums[0].reach * NODE_ROOM};
}

pbr_result window_create(const struct builder *builder, uint64_t count, struct window *window) {
    *window = (struct window){.count = count, .leaves = pbr_allocate(builder->instance, (size_t)count, sizeof *window->leaves)};
    bool done = window->leaves != NULL;
    for (uint32_t level = 1; level < KEPT_LEVEL && done; level++) {
        const uint64_t nodes = (count + (UINT64_C(1) << 2 * level) - 1) >> 2 * level;
        window->levels[level] = pbr_allocate(builder->instance, (size_t)nodes, sizeof *window->levels[level]);
        done = window->levels[level] != NULL;
    }
    return done ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

void window_free(const struct builder *builder, struct window *window) {
    pbr_free(builder->instance, window->leaves);
    for (uint32_t level = 1; level < KEPT_LEVEL; level++) pbr_free(builder->instance, window->levels[level]);
}
