/* A second reader of QSplat version 11, which the library's is held to: written from the format's description alone, recursive, in
 * double, and strict: what it accepts is a file that a writer may leave, every byte accounted for. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_UNIT_QS_ORACLE_H
#define PBR_TESTS_UNIT_QS_ORACLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { QS_SPHERE_CODES = 7621, QS_NORMAL_CELLS = 52, QS_NORMAL_CODES = 6 * QS_NORMAL_CELLS * QS_NORMAL_CELLS };

/* Relative to the parent's centre, in its radii. */
struct qs_sphere {
    double offset[3], radius;
};

struct qs_node {
    double centre[3], radius; /* object space */
    double normal[3];         /* unit; zero for the root, which has none */
    double overhang;          /* how far it reaches out of its parent's sphere, in that one's radii; 0 if it does not */
    uint8_t colour[3];
    int sphere_code, normal_code, cone; /* -1 for the root */
    int level;                          /* 0 for the root */
    int children;                       /* their count */
    size_t parent, first_child;         /* children follow each other; the root is 0, its own parent, and before all others */
    size_t group;                       /* byte offset in the image of the group of its children; 0 for a leaf */
    bool has_pointer;                   /* which then starts with the pointer to the next */
};

struct qs_tree {
    struct qs_node *nodes; /* parents before children */
    size_t count, leaves, levels;
    bool colours;
};

/* Entry `code` of the table of spheres; its radius is 0 past the end. */
struct qs_sphere qs_sphere_of(int code);

/* Unit. Any of the 2^14 codes. */
void qs_normal_of(int code, double out[3]);

/* The cell that holds a unit normal. */
int qs_normal_code_of(const double normal[3]);

/* Radians; pi for the cone of all directions. */
double qs_cone_of(int code);

/* NULL, or what is wrong. In any case qs_free releases the tree. */
const char *qs_read(const uint8_t *image, size_t size, struct qs_tree *tree);

void qs_free(struct qs_tree *tree);

#endif
