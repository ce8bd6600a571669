/* Spheres around spheres, for the nodes of a QSplat tree that is built. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>

#include "core/four.h"
#include "qsplat_build.h"

/* A number of each sibling: all are looked for at once. A step waits for a square root and a division, and so do those of the
 * siblings, side by side. */
typedef four lanes;

struct spheres {
    lanes centre[3], radius;
};

/* Of each sibling's children. Those that it lacks are its first one again, which changes nothing. */
static void gather(const struct siblings *siblings, struct spheres children[QSPLAT_CHILDREN]) {
    for (uint32_t l = 0; l < QSPLAT_CHILDREN; l++) {
        const uint32_t sibling = l < siblings->count ? l : 0, count = siblings->child_counts[sibling];
        for (uint32_t i = 0; i < QSPLAT_CHILDREN; i++) {
            const struct qsplat_sphere *sphere = &siblings->children[sibling][i < count ? i : 0];
            for (int k = 0; k < 3; k++) children[i].centre[k][l] = sphere->centre[k];
            children[i].radius[l] = sphere->radius;
        }
    }
}

/* The middle of the spheres' box. */
static void find_middle(const struct spheres children[QSPLAT_CHILDREN], lanes middle[3]) {
    for (int k = 0; k < 3; k++) {
        lanes low = children[0].centre[k] - children[0].radius, high = children[0].centre[k] + children[0].radius;
        for (int i = 1; i < QSPLAT_CHILDREN; i++) {
            low = four_lesser(low, children[i].centre[k] - children[i].radius);
            high = four_larger(high, children[i].centre[k] + children[i].radius);
        }
        middle[k] = (low + high) / 2;
    }
}

/* How far the spheres reach from a place; `way` leads from there towards the farthest one, by `step` of that. */
static lanes look(const struct spheres children[QSPLAT_CHILDREN], const lanes from[3], float step, lanes way[3]) {
    lanes most = {0}, apart = {0}, to[3];
    for (int k = 0; k < 3; k++) to[k] = from[k];
    for (int i = 0; i < QSPLAT_CHILDREN; i++) {
        const struct spheres *child = &children[i];
        const lanes x = from[0] - child->centre[0], y = from[1] - child->centre[1], z = from[2] - child->centre[2];
        const lanes squared = x * x + y * y + z * z;
        lanes length;
        for (int l = 0; l < QSPLAT_CHILDREN; l++) length[l] = sqrtf(squared[l]);
        const lanes reach = length + child->radius;
        const four_ints is_farther = ~(reach <= most); /* nor is a place that is no number ever near */
        most = four_choose(is_farther, reach, most);
        apart = four_choose(is_farther, length, apart);
        for (int k = 0; k < 3; k++) to[k] = four_choose(is_farther, child->centre[k], to[k]);
    }
    /* None where the farthest one lies around the place. */
    const four_ints is_away = apart > 0;
    const lanes one = {1, 1, 1, 1}, share = (lanes)((four_ints)(step * most / four_choose(is_away, apart, one)) & is_away);
    for (int k = 0; k < 3; k++) way[k] = (to[k] - from[k]) * share;
    return most;
}

void enclose_siblings(const struct siblings *siblings, struct qsplat_sphere *out) {
    enum { STEPS = 8 };
    struct spheres children[QSPLAT_CHILDREN], best;
    lanes centre[3], way[3];
    float step = 0.25f;
    gather(siblings, children);
    find_middle(children, centre);
    best.radius = look(children, centre, step, way);
    for (int k = 0; k < 3; k++) best.centre[k] = centre[k];
    for (int s = 0; s < STEPS; s++) {
        for (int k = 0; k < 3; k++) centre[k] += way[k];
        step *= 0.7f;
        const lanes reach = look(children, centre, step, way);
        const four_ints is_better = reach < best.radius;
        best.radius = four_choose(is_better, reach, best.radius);
        for (int k = 0; k < 3; k++) best.centre[k] = four_choose(is_better, centre[k], best.centre[k]);
    }
    for (uint32_t l = 0; l < siblings->count; l++)
        out[l] = (struct qsplat_sphere){{best.centre[0][l], best.centre[1][l], best.centre[2][l]},
                                        best.radius[l] * (1 + 4 * FLT_EPSILON)};
}
