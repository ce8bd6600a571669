/* Nodes of QSplat trees that are built, from the leaves up: spheres and cones tight around the leaves within runs, around the
 * children above; averages of normals and colours by area. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/minmax.h"
#include "qsplat_build.h"

static const float CONE_ROOM = 6e-4f; /* radians: the arc cosine of a dot product that is off by a few units in the last place */

static float distance(const float a[3], const float b[3]) {
    const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

static void add_sums(struct sums *to, const struct sums *from) {
    for (int k = 0; k < 3; k++) {
        to->normal[k] += from->normal[k];
        to->colour[k] += from->colour[k];
    }
    to->weight += from->weight;
    to->reach = largerf(to->reach, from->reach);
    to->span = largerf(to->span, from->span);
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
    const float size = lesserf(largerf(leaf->sphere.radius / builder->extent, 1e-9f), 1e3f), weight = size * size;
    const float centre[3] = {0, 0, 0};
    struct sums sums = {.weight = weight, .span = distance(centre, leaf->sphere.centre)};
    sums.reach = sums.span + leaf->sphere.radius;
    for (int k = 0; k < 3; k++) sums.normal[k] = weight * normal[k];
    sums.colour[0] = weight * builder->linear[0][leaf->colour >> 11];
    sums.colour[1] = weight * builder->linear[1][leaf->colour >> 5 & 63];
    sums.colour[2] = weight * builder->linear[0][leaf->colour & 31];
    return sums;
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
    node->sphere.radius = lesserf(node->sphere.radius, reach * (1 + 4 * FLT_EPSILON));
    node->angle = node->normal == QSPLAT_NO_NORMAL ? 4 : acosf(largerf(least, -1)) + CONE_ROOM;
}

/* ---- Runs ---- */

struct making {
    const struct builder *builder;
    struct leaf *leaves;
    bool are_ordered;
    struct node *nodes;
    uint32_t count;
};

static struct qsplat_sphere sphere_at(const struct making *making, place at) {
    return at & TIP ? making->leaves[at & ~TIP].sphere : making->nodes[at].sphere;
}

/* Of the inner nodes among siblings, whose children have theirs. starts: of their leaves, among those of the parent. */
static void make_spheres(struct making *making, const place *places, uint32_t count, const size_t *starts, size_t first) {
    struct siblings siblings = {.count = 0};
    struct qsplat_sphere spheres[QSPLAT_CHILDREN];
    uint32_t inner[QSPLAT_CHILDREN];
    for (uint32_t i = 0; i < count; i++) {
        if (places[i] & TIP) continue;
        const struct node *node = &making->nodes[places[i]];
        for (uint32_t c = 0; c < node->child_count; c++)
            siblings.children[siblings.count][c] = sphere_at(making, node->children[c]);
        siblings.child_counts[siblings.count] = node->child_count;
        inner[siblings.count++] = i;
    }
    if (siblings.count == 0) return;
    enclose_siblings(&siblings, spheres);
    for (uint32_t k = 0; k < siblings.count; k++) {
        const uint32_t i = inner[k];
        struct node *node = &making->nodes[places[i]];
        node->sphere = spheres[k];
        measure_in_run(making->builder, making->leaves + first + starts[i], starts[i + 1] - starts[i], node);
    }
}

/* All but the subtree's own sphere, which is made beside those of its siblings. */
static place make_below(struct making *making, size_t first, size_t count, struct sums *sums) {
    const struct builder *builder = making->builder;
    size_t starts[QSPLAT_CHILDREN + 1];
    if (count == 1) {
        *sums = sums_of_leaf(builder, &making->leaves[first]);
        return TIP | (place)first;
    }
    struct node node = {.child_count = (uint8_t)split_leaves(making->leaves + first, count, making->are_ordered, starts)};
    *sums = (struct sums){.weight = 0};
    for (uint32_t i = 0; i < node.child_count; i++) {
        struct sums part;
        node.children[i] = make_below(making, first + starts[i], starts[i + 1] - starts[i], &part);
        node.has_grandchildren |= !(node.children[i] & TIP);
        add_sums(sums, &part);
    }
    if (node.has_grandchildren) make_spheres(making, node.children, node.child_count, starts, first);
    finish_codes(builder, sums, &node);
    making->nodes[making->count] = node;
    return making->count++;
}

uint32_t make_nodes(const struct builder *builder, struct leaf *leaves, size_t count, bool are_ordered, struct node *nodes,
                    struct sums *sums) {
    struct making making = {builder, leaves, are_ordered, nodes, 0};
    const place root = make_below(&making, 0, count, sums);
    const size_t starts[2] = {0, count};
    make_spheres(&making, &root, 1, starts, 0);
    return making.count;
}

uint32_t make_run(const struct builder *builder, struct leaf *leaves, struct node *nodes, struct run *run) {
    const uint32_t count = make_nodes(builder, leaves, run->count, false, nodes, &run->sums);
    run->root = count > 0 ? nodes[count - 1] : node_of_leaf(leaves);
    for (uint32_t i = 0; i < run->root.child_count; i++) {
        const place child = run->root.children[i];
        run->children[i] = child & TIP ? node_of_leaf(&leaves[child & ~TIP]) : nodes[child];
    }
    run->page_size = page_size(builder, nodes, count);
    return count;
}

/* ---- Branches ---- */

static const struct sums *sums_of(const struct builder *builder, place at) {
    return at & TIP ? &builder->runs[at & ~TIP].sums : &builder->branches[at].sums;
}

pbr_result join_roots(struct builder *builder, place *roots, size_t count) {
    const pbr_result result = builder_grow(builder, 0, count);
    while (result == PBR_OK && count > 1) {
        size_t joined = 0;
        for (size_t i = 0; i < count; joined++) {
            struct node node = {.child_count = 0};
            while (i < count && node.child_count < QSPLAT_CHILDREN) node.children[node.child_count++] = roots[i++];
            roots[joined] = node.children[0];
            if (node.child_count == 1) continue;
            roots[joined] = (place)builder->branch_count;
            builder->branches[builder->branch_count++] = (struct branch){.node = node};
        }
        count = joined;
    }
    return result;
}

static float angle_between(const float a[3], const float b[3]) {
    return acosf(largerf(lesserf(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 1), -1));
}

static void make_branch(const struct builder *builder, struct branch *branch) {
    struct node *node = &branch->node;
    struct siblings alone = {.count = 1, .child_counts = {node->child_count}};
    branch->sums = (struct sums){.weight = 0};
    for (uint32_t i = 0; i < node->child_count; i++) {
        const place at = node->children[i];
        const struct node *child = upper_node(builder, at);
        add_sums(&branch->sums, sums_of(builder, at));
        alone.children[0][i] = child->sphere;
        node->has_grandchildren |= child->child_count > 0;
    }
    enclose_siblings(&alone, &node->sphere);
    finish_codes(builder, &branch->sums, node);
    for (uint32_t i = 0; i < node->child_count; i++) {
        const struct node *child = upper_node(builder, node->children[i]);
        const float apart = angle_between(builder->codes->normals[node->normal], builder->codes->normals[child->normal]);
        node->angle = largerf(node->angle, child->angle + apart + CONE_ROOM);
    }
    if (node->normal == QSPLAT_NO_NORMAL) node->angle = 4;
}

struct qsplat_sphere make_branches(struct builder *builder, place root) {
    for (size_t i = 0; i < builder->branch_count; i++) make_branch(builder, &builder->branches[i]);
    const struct sums *sums = sums_of(builder, root);
    builder->tree->span = sums->span;
    return (struct qsplat_sphere){{0, 0, 0}, sums->reach * NODE_ROOM};
}
