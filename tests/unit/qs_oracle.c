/* See the header. SPDX-License-Identifier: MIT */
#include "qs_oracle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { HEADER = 40, GRID = 13, MOST_LEVELS = 4096 };

static const double PI = 3.14159265358979323846;

/* ---- Codes ---- */

static size_t fill_spheres(struct qs_sphere *out) {
    size_t count = 0;
    for (int s = 1; s <= GRID; s++)
        for (int x = 0; x <= GRID - s; x++)
            for (int y = 0; y <= GRID - s; y++)
                for (int z = 0; z <= GRID - s; z++) {
                    const double radius = (double)s / GRID, reach = 1 + sqrt(3) * radius;
                    const struct qs_sphere sphere = {
                        {(double)(s + 2 * x) / GRID - 1, (double)(s + 2 * y) / GRID - 1, (double)(s + 2 * z) / GRID - 1}, radius};
                    const double *p = sphere.offset;
                    if (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] > reach * reach) continue;
                    if (count < QS_SPHERE_CODES) out[count] = sphere;
                    count++;
                }
    return count;
}

struct qs_sphere qs_sphere_of(int code) {
    static struct qs_sphere table[QS_SPHERE_CODES];
    if (!(table[0].radius > 0) && fill_spheres(table) != QS_SPHERE_CODES) abort(); /* the description contradicts itself */
    return code >= 0 && code < QS_SPHERE_CODES ? table[code] : (struct qs_sphere){{0, 0, 0}, 0};
}

void qs_normal_of(int code, double out[3]) {
    out[0] = out[1] = 0;
    out[2] = 1;
    if (code >= QS_NORMAL_CODES) return;
    const int face = code / (QS_NORMAL_CELLS * QS_NORMAL_CELLS), axis = face / 2;
    const int cells[2] = {code / QS_NORMAL_CELLS % QS_NORMAL_CELLS, code % QS_NORMAL_CELLS};
    double sum = 0;
    for (int k = 0; k < 2; k++) {
        const double warped = (cells[k] + 0.5) * 2 / QS_NORMAL_CELLS - 1, c = tan(warped * PI / 4);
        out[(axis + 1 + k) % 3] = c;
        sum += c * c;
    }
    out[axis] = (face % 2 ? -1 : 1) * sqrt(fmax(1 - sum, 0));
    const double length = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
    for (int k = 0; k < 3; k++) out[k] /= length;
}

int qs_normal_code_of(const double normal[3]) {
    int axis = 0, cells[2];
    for (int k = 1; k < 3; k++)
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    for (int k = 0; k < 2; k++) {
        const double warped = atan(normal[(axis + 1 + k) % 3]) * 4 / PI;
        cells[k] = (int)floor((warped + 1) / 2 * QS_NORMAL_CELLS);
        if (cells[k] == QS_NORMAL_CELLS) cells[k]--;
    }
    return ((2 * axis + (normal[axis] < 0)) * QS_NORMAL_CELLS + cells[0]) * QS_NORMAL_CELLS + cells[1];
}

double qs_cone_of(int code) {
    static const double sines[] = {1.0 / 16, 4.0 / 16, 9.0 / 16};
    return code >= 0 && code < 3 ? asin(sines[code]) : PI;
}

/* ---- The tree ---- */

struct reading {
    const uint8_t *image; /* of the whole file */
    size_t end;           /* of the fragment */
    size_t record;        /* bytes */
    uint8_t *seen;        /* of each byte: belongs to what was read */
    struct qs_tree *tree;
    size_t capacity;
};

static uint32_t big_endian(const uint8_t *p, int bytes) {
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value = value << 8 | p[i];
    return value;
}

static int64_t integer(const uint8_t *p) {
    return (int32_t)big_endian(p, 4);
}

static double real(const uint8_t *p) {
    const uint32_t bits = big_endian(p, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

/* Whether the bytes lie in the fragment and belong to nothing else yet; then they do. */
static bool claim(struct reading *reading, size_t offset, size_t size) {
    if (offset > reading->end || size > reading->end - offset) return false;
    for (size_t i = 0; i < size; i++)
        if (reading->seen[offset + i]++) return false;
    return true;
}

/* Appends a zeroed node. */
static size_t add_node(struct reading *reading) {
    struct qs_tree *tree = reading->tree;
    if (tree->count == reading->capacity) {
        reading->capacity = 2 * reading->capacity + 64;
        tree->nodes = realloc(tree->nodes, reading->capacity * sizeof *tree->nodes);
        if (!tree->nodes) abort();
    }
    tree->nodes[tree->count] = (struct qs_node){0};
    return tree->count++;
}

/* The record of a child of `parent`. Sets whether the child's children have children. */
static const char *read_record(struct reading *reading, const uint8_t *p, size_t parent, bool *grandchildren) {
    const size_t number = add_node(reading);
    const struct qs_node *above = &reading->tree->nodes[parent];
    struct qs_node *node = &reading->tree->nodes[number];
    const uint32_t tree_bits = big_endian(p, 2), normal_bits = big_endian(p + 2, 2);
    node->sphere_code = (int)(tree_bits >> 3);
    node->normal_code = (int)(normal_bits >> 2);
    node->cone = (int)(normal_bits & 3);
    node->children = tree_bits & 3 ? (int)(tree_bits & 3) + 1 : 0;
    node->parent = parent;
    node->level = above->level + 1;
    *grandchildren = tree_bits >> 2 & 1;
    if (node->sphere_code >= QS_SPHERE_CODES) return "a sphere code past the table";
    if (node->children == 0 && *grandchildren) return "a leaf has grandchildren";
    const struct qs_sphere sphere = qs_sphere_of(node->sphere_code);
    double square = 0;
    for (int k = 0; k < 3; k++) {
        node->centre[k] = above->centre[k] + above->radius * sphere.offset[k];
        square += sphere.offset[k] * sphere.offset[k];
    }
    node->radius = above->radius * sphere.radius;
    node->overhang = fmax(sqrt(square) + sphere.radius - 1, 0);
    qs_normal_of(node->normal_code, node->normal);
    if (reading->tree->colours) {
        const uint32_t c = big_endian(p + 4, 2), red = c >> 11, green = c >> 5 & 63, blue = c & 31;
        node->colour[0] = (uint8_t)(red << 3 | red >> 2);
        node->colour[1] = (uint8_t)(green << 2 | green >> 4);
        node->colour[2] = (uint8_t)(blue << 3 | blue >> 2);
    }
    return NULL;
}

/* The children of `parent`, and all below. `has_pointer`: the group starts with one. */
static const char *read_group(struct reading *reading, size_t parent, size_t offset, bool has_pointer) {
    const int children = reading->tree->nodes[parent].children;
    const size_t first = reading->tree->count;
    bool grandchildren[4], any = false;
    size_t next = 0;
    reading->tree->nodes[parent].first_child = first;
    reading->tree->nodes[parent].group = offset;
    reading->tree->nodes[parent].has_pointer = has_pointer;
    if (!claim(reading, offset, (has_pointer ? 4 : 0) + (size_t)children * reading->record))
        return "a group outside the fragment, or over another";
    if (has_pointer) {
        const int64_t distance = integer(reading->image + offset);
        if (distance <= 0 || (uint64_t)distance > reading->end - offset) return "a pointer out of the fragment";
        next = offset + (size_t)distance;
        offset += 4;
    }
    for (int i = 0; i < children; i++) {
        const char *wrong = read_record(reading, reading->image + offset + (size_t)i * reading->record, parent, &grandchildren[i]);
        if (wrong) return wrong;
        any |= reading->tree->nodes[first + (size_t)i].children > 0;
    }
    if (any != has_pointer) return any ? "children without a pointer to them" : "a pointer to no children";
    for (int i = 0; i < children; i++) {
        const size_t child = first + (size_t)i, size = (size_t)reading->tree->nodes[child].children * reading->record;
        if (size == 0) continue;
        if (reading->tree->nodes[child].level >= MOST_LEVELS) return "too deep for this reader";
        const char *wrong = read_group(reading, child, next, grandchildren[i]);
        if (wrong) return wrong;
        next += size + (grandchildren[i] ? 4 : 0);
    }
    return NULL;
}

/* Breadth first: the groups, in the order of the nodes' levels and within one of the nodes, lie one behind the other. */
static bool is_breadth_first(const struct qs_tree *tree) {
    size_t *queue = malloc(tree->count * sizeof *queue), begin = 0, end = 0, last = 0;
    bool ordered = true;
    if (!queue) abort();
    for (queue[end++] = 0; begin < end; begin++) {
        const struct qs_node *node = &tree->nodes[queue[begin]];
        for (int i = 0; i < node->children; i++) queue[end++] = node->first_child + (size_t)i;
        if (node->children == 0) continue;
        ordered &= node->group > last;
        last = node->group;
    }
    free(queue);
    return ordered;
}

static const char *check_whole(const struct reading *reading, size_t begin, uint32_t leaves) {
    struct qs_tree *tree = reading->tree;
    for (size_t i = 0; i < tree->count; i++) {
        tree->leaves += tree->nodes[i].children == 0;
        if ((size_t)tree->nodes[i].level > tree->levels) tree->levels = (size_t)tree->nodes[i].level;
    }
    if (tree->leaves != leaves) return "another number of leaves than the header says";
    size_t end = reading->end;
    while (end > begin && !reading->seen[end - 1]) {
        if (reading->image[--end] != 0) return "padding that is not zero";
    }
    if (reading->end - end > 3) return "more padding than there is need for";
    for (size_t i = begin; i < end; i++)
        if (!reading->seen[i]) return "bytes that belong to no group";
    return is_breadth_first(tree) ? NULL : "groups that are not breadth first";
}

static const char *read_tree(struct reading *reading, size_t begin) {
    const uint8_t *header = reading->image + begin;
    const int64_t leaves = integer(header + 12), children = integer(header + 36);
    if (!claim(reading, begin, HEADER)) return "a header that is cut off";
    if (leaves < 1 || children < 1 || children > 4 || children > leaves) return "a root without sense";
    reading->tree->colours = integer(header + 16) & 1;
    reading->record = reading->tree->colours ? 6 : 4;
    add_node(reading);
    struct qs_node *root = reading->tree->nodes;
    root->sphere_code = root->normal_code = root->cone = -1;
    root->children = (int)children;
    for (int k = 0; k < 3; k++) root->centre[k] = real(header + 20 + 4 * k);
    root->radius = real(header + 32);
    if (!isfinite(root->centre[0] + root->centre[1] + root->centre[2]) || !isfinite(root->radius) || root->radius < 0)
        return "a root's sphere that is none";
    /* Inner nodes have two leaves and more, so the root's children are all leaves iff there are as many of them. */
    const char *wrong = read_group(reading, 0, begin + HEADER, children < leaves);
    return wrong ? wrong : check_whole(reading, begin, (uint32_t)leaves);
}

const char *qs_read(const uint8_t *image, size_t size, struct qs_tree *tree) {
    enum { COMMENT = 2, SMALLEST = 20 };
    const char *wrong = "no tree";
    *tree = (struct qs_tree){0};
    for (size_t begin = 0; begin < size;) {
        if (size - begin < SMALLEST || memcmp(image + begin, "QSplat11", 8) != 0) return "no fragment where one begins";
        const int64_t length = integer(image + begin + 8);
        if (length < SMALLEST || length % 4 != 0 || (uint64_t)length > size - begin) return "a fragment's length is wrong";
        if (integer(image + begin + 16) != COMMENT) {
            if (tree->count > 0) return "two trees";
            if (length < HEADER) return "a header that is cut off";
            struct reading reading = {.image = image, .end = begin + (size_t)length, .tree = tree, .seen = calloc(size, 1)};
            if (!reading.seen) abort();
            wrong = read_tree(&reading, begin);
            free(reading.seen);
            if (wrong) return wrong;
        }
        begin += (size_t)length;
    }
    return wrong;
}

void qs_free(struct qs_tree *tree) {
    free(tree->nodes);
    *tree = (struct qs_tree){0};
}
