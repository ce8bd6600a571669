/* Nodes of sequential point trees from their children: averages, a disc around the children's, and how far it is from them.
 * Dachsbacher, Vogelgsang, Stamminger 2003, section 4. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "core/matrix.h"
#include "core/points.h"
#include "spt_build.h"

/* Normals whose mean is shorter point into no common direction. */
static const double LEAST_MEAN = 1e-3;

static const double ROUNDING = 1e-9; /* relative, and more than what double does here */

static bool has_normal(const struct spt_node *node) {
    return node->normal[0] != 0 || node->normal[1] != 0 || node->normal[2] != 0;
}

/* Cosine and sine of the angle between two discs; those without a normal face wherever is worst. The sine is not made of the
 * cosine, which would be off by 5e-4 where they are parallel. */
static double cosine_between(const struct spt_node *a, const struct spt_node *b) {
    double dot = 0;
    for (int k = 0; k < 3; k++) dot += (double)a->normal[k] * (double)b->normal[k];
    return fmin(fabs(dot), 1);
}
static double sine_between(const struct spt_node *a, const struct spt_node *b) {
    const double m[3] = {(double)a->normal[0], (double)a->normal[1], (double)a->normal[2]};
    const double n[3] = {(double)b->normal[0], (double)b->normal[1], (double)b->normal[2]};
    double cross[3];
    cross3(m, n, cross);
    return fmin(length3(cross), 1);
}

/* ---- Averages ---- */

static void average_normal(const struct spt_node *const *children, uint32_t count, double weight, struct spt_node *node) {
    double sum[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) sum[k] += (double)children[i]->weight * (double)children[i]->normal[k];
    const double length = length3(sum);
    for (int k = 0; k < 3; k++) node->normal[k] = length > LEAST_MEAN * weight ? (float)(sum[k] / length) : 0;
}

/* How far a child's disc reaches from the node's position: in the node's plane, or in space. */
static double reach_of(const struct spt_node *node, const struct spt_node *child) {
    double d[3], along = 0, squared = 0;
    for (int k = 0; k < 3; k++) {
        d[k] = child->position[k] - node->position[k];
        along += d[k] * (double)node->normal[k];
    }
    for (int k = 0; k < 3; k++) {
        d[k] -= along * (double)node->normal[k];
        squared += d[k] * d[k];
    }
    return sqrt(squared) + (double)child->radius;
}

void spt_average(const struct spt_node *const *children, uint32_t count, struct spt_node *node) {
    double weight = 0, offset[3] = {0, 0, 0}, colour[3] = {0, 0, 0}, reach = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct spt_node *child = children[i];
        weight += (double)child->weight;
        for (int k = 0; k < 3; k++) {
            offset[k] += (double)child->weight * (child->position[k] - children[0]->position[k]);
            colour[k] += (double)child->weight * (double)child->colour[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        node->position[k] = children[0]->position[k] + offset[k] / weight;
        node->colour[k] = (float)(colour[k] / weight);
    }
    node->weight = (float)weight;
    average_normal(children, count, weight, node);
    for (uint32_t i = 0; i < count; i++) reach = fmax(reach, reach_of(node, children[i]));
    node->radius = reach > 0 ? float_above(reach * (1 + ROUNDING)) : 0;
}

/* ---- Errors ---- */

/* The thickness of the children's discs along the normal. */
double spt_perpendicular_error(const struct spt_node *node, const struct spt_node *const *children, uint32_t count) {
    double high = -INFINITY, low = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        const struct spt_node *child = children[i];
        const double reach = (double)child->radius * (has_normal(child) ? sine_between(child, node) : 1);
        double along = 0;
        for (int k = 0; k < 3; k++) along += (child->position[k] - node->position[k]) * (double)node->normal[k];
        high = fmax(high, along + reach);
        low = fmin(low, along - reach);
    }
    return high - low;
}

struct circle {
    double x, y, radius;
};

/* Circles in the node's plane that lie within the shadows of the children's discs, which are ellipses of half axes r and r cos. A
 * disc without a normal faces the eye, so its shadow is a circle. */
static void shadows(const struct spt_node *node, const struct spt_node *const *children, uint32_t count, struct circle *out) {
    const double n[3] = {(double)node->normal[0], (double)node->normal[1], (double)node->normal[2]};
    int least = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(n[k]) < fabs(n[least])) least = k;
    double u[3] = {0, 0, 0}, v[3];
    for (int k = 0; k < 3; k++) u[k] = (k == least) - n[least] * n[k];
    const double length = length3(u);
    for (int k = 0; k < 3; k++) u[k] /= length;
    cross3(n, u, v);
    for (uint32_t i = 0; i < count; i++) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = children[i]->position[k] - node->position[k];
        const double cosine = has_normal(children[i]) ? cosine_between(children[i], node) : 1;
        out[i] = (struct circle){dot3(d, u), dot3(d, v), (double)children[i]->radius * cosine};
    }
}

/* Of the slab across the direction (x, y), unit. */
static double width_across(const struct circle *circles, uint32_t count, double x, double y) {
    double high = -INFINITY, low = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        const double along = x * circles[i].x + y * circles[i].y;
        high = fmax(high, along + circles[i].radius);
        low = fmin(low, along - circles[i].radius);
    }
    return high - low;
}

/* The narrowest slab that holds the circles. Which two circles it touches changes with its direction; between two changes its width
 * is the constant radii and the cosine of an angle within a right one, which is concave. So it is least at a change, where a side
 * touches two circles at once: of each pair, the two common tangents with both on one side. */
static double smallest_width(const struct circle *circles, uint32_t count) {
    double least = width_across(circles, count, 1, 0); /* of circles within one, it is the same all around */
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < i; k++) {
            const double x = circles[i].x - circles[k].x, y = circles[i].y - circles[k].y, distance = hypot(x, y);
            const double along = (circles[k].radius - circles[i].radius) / distance, across = sqrt(1 - along * along);
            if (!(along * along <= 1)) continue; /* one is within the other */
            const double c = x / distance, s = y / distance;
            least = fmin(least, width_across(circles, count, along * c - across * s, along * s + across * c));
            least = fmin(least, width_across(circles, count, along * c + across * s, along * s - across * c));
        }
    return least;
}

/* How much wider the node's disc is than the children's together, where those are narrowest. The circles stand for the shadows:
 * their slab is narrower by 2 max r (1 - cos) at most, so the error is not below the exact one and above it by no more. */
double spt_tangential_error(const struct spt_node *node, const struct spt_node *const *children, uint32_t count) {
    struct circle circles[SPT_CHILDREN_MOST] = {{0, 0, 0}};
    shadows(node, children, count, circles);
    return fmax(0, 2 * (double)node->radius - smallest_width(circles, count));
}

void spt_combine(const struct spt_node *const *children, uint32_t count, struct spt_node *node) {
    memset(node, 0, sizeof *node);
    spt_average(children, count, node);
    const double whole = 2 * (double)node->radius;
    double error = whole;
    if (has_normal(node))
        error = fmin(error, hypot(spt_perpendicular_error(node, children, count), spt_tangential_error(node, children, count)));
    node->error = error > 0 ? float_above(error * (1 + ROUNDING)) : 0;
    for (uint32_t i = 0; i < count; i++) {
        node->error = fmaxf(node->error, children[i]->error);
        if (children[i]->height >= node->height) node->height = (uint16_t)(children[i]->height + 1);
    }
    node->children = (uint16_t)count;
}
