/* Walks over all of a QSplat tree: its statistics, its leaves, its file of the original's kind. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "qsplat.h"

/* ---- Walking ---- */

struct step {
    struct qsplat_sphere parent;
    struct qsplat_group group;
    uint32_t level; /* of the group's nodes */
};

struct walk {
    pbr_instance *instance;
    const struct qsplat *tree;
    struct step *stack;
    size_t count, capacity;
    uint64_t left, damaged;
    qsplat_visit_fn visit;
    void *user;
};

static pbr_result push(struct walk *walk, const struct step *step) {
    if (walk->count == walk->capacity) {
        const size_t capacity = walk->capacity ? 2 * walk->capacity : 64;
        struct step *grown = pbr_reallocate(walk->instance, walk->stack, walk->capacity, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        walk->stack = grown;
        walk->capacity = capacity;
    }
    walk->stack[walk->count++] = *step;
    return PBR_OK;
}

static pbr_result visit_group(struct walk *walk, const struct step *step) {
    const struct qsplat *tree = walk->tree;
    const size_t first = walk->count, size = qsplat_node_size(tree);
    const uint8_t *p = tree->nodes + step->group.at + (step->group.inner ? 4 : 0);
    uint64_t next = 0;
    bool follows = step->group.inner && qsplat_follow(tree, &step->group, &next);
    pbr_result result = PBR_OK;
    for (uint32_t i = 0; i < step->group.count && result == PBR_OK; i++, p += size) {
        struct qsplat_visit visit = {.node = qsplat_read_node(p, tree->has_colours), .parent = &step->parent, .level = step->level};
        visit.sphere = qsplat_decode_sphere(tree->codes, visit.node.sphere, &step->parent);
        if (visit.node.children && !follows) {
            walk->damaged++;
            visit.node.children = 0;
        }
        walk->visit(walk->user, &visit);
        if (!visit.node.children) continue;
        const struct step below = {visit.sphere, {next, visit.node.children, visit.node.grandchildren}, step->level + 1};
        next += qsplat_group_size(tree, &below.group);
        result = push(walk, &below);
    }
    /* First children first. */
    for (size_t i = first, j = walk->count; j > i + 1; i++) {
        const struct step t = walk->stack[i];
        walk->stack[i] = walk->stack[--j];
        walk->stack[j] = t;
    }
    return result;
}

static pbr_result walk_on(struct walk *walk, const struct progress *progress, const char *stage) {
    enum { REPORTS = 1 << 20 };
    const uint64_t most = qsplat_most_nodes(walk->tree);
    pbr_result result = PBR_OK;
    uint64_t reported = most;
    while (walk->count > 0 && result == PBR_OK) {
        const struct step step = walk->stack[--walk->count];
        if (!qsplat_group_is_inside(walk->tree, &step.group) || step.group.count > walk->left) {
            walk->damaged++;
            continue;
        }
        walk->left -= step.group.count;
        qsplat_touch(walk->tree, &step.group);
        result = visit_group(walk, &step);
        if (result != PBR_OK || reported - walk->left < REPORTS) continue;
        reported = walk->left;
        result = progress_report(progress, stage, (double)(most - walk->left) / (double)most);
    }
    return result;
}

pbr_result qsplat_walk(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress, const char *stage,
                       qsplat_visit_fn visit, void *user, uint64_t *damaged) {
    struct walk walk = {.instance = instance, .tree = tree, .left = qsplat_most_nodes(tree), .visit = visit, .user = user};
    const struct step root = {{{0, 0, 0}, tree->radius}, qsplat_root_group(tree), 1};
    pbr_result result = progress_report(progress, stage, 0);
    if (result == PBR_OK && root.group.count > 0) result = push(&walk, &root);
    if (result == PBR_OK) result = walk_on(&walk, progress, stage);
    if (result == PBR_OK) result = progress_report(progress, stage, 1);
    pbr_free(instance, walk.stack);
    *damaged = walk.damaged;
    return result;
}

/* ---- Statistics ---- */

struct measuring {
    pbr_lod_statistics *statistics;
    double radii, overhangs;
};

static void count_level(pbr_lod_statistics *s, uint32_t level) {
    s->level_nodes[level < PBR_LOD_LEVELS ? level : PBR_LOD_LEVELS - 1]++;
    if (level > s->levels) s->levels = level;
}

static void measure_node(void *user, const struct qsplat_visit *visit) {
    struct measuring *measuring = user;
    pbr_lod_statistics *s = measuring->statistics;
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)visit->sphere.centre[k] - (double)visit->parent->centre[k];
        squared += d * d;
    }
    const double reach = sqrt(squared) + (double)visit->sphere.radius, parent = (double)visit->parent->radius;
    const double overhang = parent > 0 ? fmax(reach / parent - 1, 0) : 0;
    measuring->overhangs += overhang;
    if (overhang > s->overhang_largest) s->overhang_largest = overhang;
    s->nodes++;
    s->cones[visit->node.cone]++;
    count_level(s, visit->level);
    if (visit->node.children) {
        s->children[visit->node.children]++;
    } else {
        s->leaves++;
        measuring->radii += (double)visit->sphere.radius;
    }
}

pbr_result qsplat_measure(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress,
                          pbr_lod_statistics *statistics) {
    struct measuring measuring = {.statistics = statistics};
    pbr_result result = qsplat_walk(instance, tree, progress, "counting nodes", measure_node, &measuring, &statistics->damaged);
    if (statistics->nodes > 0) statistics->overhang_mean = measuring.overhangs / (double)statistics->nodes;
    if (statistics->leaves > 0) statistics->leaf_radius_mean = measuring.radii / (double)statistics->leaves;
    if (statistics->nodes == 0) return result;
    statistics->nodes++;
    statistics->children[tree->root_children < 4 ? tree->root_children : 4]++;
    count_level(statistics, 0);
    return result;
}

/* ---- Leaves ---- */

struct leaf_arrays {
    const struct qsplat *tree;
    float (*positions)[3], (*normals)[3], *radii;
    uint8_t (*colours)[4];
    size_t count, capacity;
};

static void copy_leaf(void *user, const struct qsplat_visit *visit) {
    struct leaf_arrays *leaves = user;
    if (visit->node.children || leaves->count == leaves->capacity) return;
    const size_t i = leaves->count++;
    memcpy(leaves->positions[i], visit->sphere.centre, sizeof *leaves->positions);
    memcpy(leaves->normals[i], leaves->tree->codes->normals[visit->node.normal], sizeof *leaves->normals);
    leaves->radii[i] = visit->sphere.radius;
    if (leaves->colours) qsplat_decode_colour(visit->node.colour, leaves->colours[i]);
}

static pbr_result make_points(pbr_instance *instance, const struct leaf_arrays *leaves, pbr_points **out) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = leaves->count;
    desc.positions = (pbr_attribute){leaves->positions, 0, PBR_FORMAT_FLOAT32, 3};
    memcpy(desc.origin, leaves->tree->centre, sizeof desc.origin);
    desc.normals = (pbr_attribute){leaves->normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){leaves->radii, 0, PBR_FORMAT_FLOAT32, 1};
    if (leaves->colours) desc.colours = (pbr_attribute){leaves->colours, 0, PBR_FORMAT_UINT8, 4};
    return pbr_points_create(instance, &desc, out);
}

pbr_result qsplat_to_points(pbr_instance *instance, const struct qsplat *tree, const struct progress *progress, pbr_points **out) {
    if (tree->leaves > PBR_MAX_POINTS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_lod_to_points: %llu leaves, the limit of a point set is %llu",
                       (unsigned long long)tree->leaves, (unsigned long long)PBR_MAX_POINTS);
    /* A damaged file may have any number. */
    const uint64_t most = qsplat_most_nodes(tree);
    struct leaf_arrays leaves = {.tree = tree, .capacity = (size_t)(tree->leaves < most ? tree->leaves : most)};
    uint64_t damaged = 0;
    leaves.positions = pbr_allocate(instance, leaves.capacity, sizeof *leaves.positions);
    leaves.normals = pbr_allocate(instance, leaves.capacity, sizeof *leaves.normals);
    leaves.radii = pbr_allocate(instance, leaves.capacity, sizeof *leaves.radii);
    leaves.colours = tree->has_colours ? pbr_allocate(instance, leaves.capacity, sizeof *leaves.colours) : NULL;
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    if (leaves.positions && leaves.normals && leaves.radii && (leaves.colours || !tree->has_colours))
        result = qsplat_walk(instance, tree, progress, "reading leaves", copy_leaf, &leaves, &damaged);
    if (result == PBR_OK && damaged > 0)
        pbr_log(instance, PBR_LOG_WARNING, PBR_OK, "the hierarchy is damaged in %llu places: what is below is missing",
                (unsigned long long)damaged);
    if (result == PBR_OK) result = make_points(instance, &leaves, out);
    pbr_free(instance, leaves.positions);
    pbr_free(instance, leaves.normals);
    pbr_free(instance, leaves.radii);
    pbr_free(instance, leaves.colours);
    return result;
}
