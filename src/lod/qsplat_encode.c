/* Encoding QSplat trees that are built, from the root down. Sizes, and so all places in the file, follow from the shape.
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "qsplat_build.h"

/* ---- Shape ---- */

uint64_t level_count(const struct builder *builder, uint32_t level) {
    const uint64_t leaves = UINT64_C(1) << 2 * level;
    return (builder->count + leaves - 1) / leaves;
}

uint64_t leaves_below(const struct builder *builder, struct place place) {
    const uint64_t first = place.index << 2 * place.level, most = UINT64_C(1) << 2 * place.level;
    return builder->count - first < most ? builder->count - first : most;
}

/* The children of a node that has more than one leaf. */
uint32_t children_of(const struct builder *builder, struct place parent, struct place out[QSPLAT_CHILDREN]) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < QSPLAT_CHILDREN; i++) {
        struct place child = {4 * parent.index + i, parent.level - 1};
        if (child.index << 2 * child.level >= builder->count) break;
        while (child.level > 0 && leaves_below(builder, child) <= UINT64_C(1) << 2 * (child.level - 1)) {
            child.index *= 4;
            child.level--;
        }
        out[count++] = child;
    }
    return count;
}

/* ---- Sizes and records ---- */

/* Of the group of a node's children. */
static uint64_t group_size(const struct builder *builder, const struct place *children, uint32_t count) {
    bool inner = false;
    for (uint32_t i = 0; i < count; i++) inner |= children[i].level > 0;
    return count * (uint64_t)qsplat_node_size(builder->tree) + (inner ? 4 : 0);
}

static uint64_t size_of_children(const struct builder *builder, struct place parent) {
    struct place children[QSPLAT_CHILDREN];
    return group_size(builder, children, children_of(builder, parent, children));
}

/* Of all groups below. */
static uint64_t size_below(const struct builder *builder, struct place parent) {
    struct place children[QSPLAT_CHILDREN];
    if (parent.level == 0) return 0;
    const uint32_t count = children_of(builder, parent, children);
    uint64_t size = group_size(builder, children, count), whole = 0;
    for (uint32_t i = 0; i < count; i++) {
        /* The first ones are alike. */
        const bool as_before = i > 0 && leaves_below(builder, children[i]) == leaves_below(builder, children[0]);
        if (!as_before || i == 0) whole = size_below(builder, children[i]);
        size += whole;
    }
    return size;
}

static uint32_t cone_code(float angle) {
    static const float angles[3] = {0.06254076f, 0.25268026f, 0.59741f}; /* of sines 1/16, 4/16, 9/16; rounded down */
    uint32_t code = 0;
    while (code < 3 && !(angle <= angles[code])) code++;
    return code;
}

static void store_big(uint32_t v, int bytes, uint8_t *p) {
    for (int i = 0; i < bytes; i++) p[i] = (uint8_t)(v >> 8 * (bytes - 1 - i));
}

/* A node's record at p, and what its sphere decodes to. */
static struct qsplat_sphere write_node(const struct builder *builder, const struct window *window, struct place place,
                                       const struct qsplat_sphere *parent, uint8_t *p) {
    const struct leaf *leaf = place.level == 0 ? &window->leaves[place.index - window->first] : NULL;
    const struct node *node = leaf ? NULL : node_at(builder, window, place.level, place.index);
    struct place children[QSPLAT_CHILDREN];
    struct qsplat_sphere decoded;
    uint32_t count = 0, grand = 0;
    if (node) {
        count = children_of(builder, place, children);
        for (uint32_t i = 0; i < count; i++) grand |= children[i].level > 0;
    }
    const struct qsplat_sphere *exact = leaf ? &leaf->sphere : &node->sphere;
    struct qsplat_sphere wide = *exact;
    if (node) wide.radius *= NODE_ROOM;
    uint32_t sphere = qsplat_encode_sphere(builder->codes, &wide, parent, &decoded);
    if (node && sphere == QSPLAT_SPHERES - 1) sphere = qsplat_encode_sphere(builder->codes, exact, parent, &decoded);
    const uint32_t normal = leaf ? leaf->normal : node->normal;
    const uint32_t cone = normal == QSPLAT_NO_NORMAL ? 3 : leaf ? 0 : cone_code(node->angle);
    store_big(sphere << 19 | grand << 18 | (count ? count - 1 : 0) << 16 | normal << 2 | cone, 4, p);
    if (builder->tree->has_colours) store_big(leaf ? leaf->colour : node->colour, 2, p + 4);
    return decoded;
}

/* Writes the group of a node's children, `link` before them or, for 0, how far it is to *tail; and appends those that have children
 * themselves to `next`, their groups from *tail on. */
static void write_group(const struct builder *builder, const struct window *window, const struct pending *parent, uint8_t *base,
                        uint32_t link, uint64_t *tail, struct pending *next, uint64_t *next_count) {
    struct place children[QSPLAT_CHILDREN];
    const uint32_t count = children_of(builder, parent->place, children), size = qsplat_node_size(builder->tree);
    uint8_t *p = base + parent->at;
    if (group_size(builder, children, count) > (uint64_t)count * size) {
        store_big(link ? link : (uint32_t)(*tail - parent->at), 4, p);
        p += 4;
    }
    for (uint32_t i = 0; i < count; i++) {
        const struct qsplat_sphere decoded = write_node(builder, window, children[i], &parent->sphere, p + (size_t)i * size);
        if (children[i].level == 0) continue;
        next[(*next_count)++] = (struct pending){decoded, children[i], *tail};
        *tail += size_of_children(builder, children[i]);
    }
}

/* Whether what is below the node's children lies in a page. */
static bool ends_upper(const struct builder *builder, struct place parent) {
    struct place children[QSPLAT_CHILDREN];
    const uint32_t count = children_of(builder, parent, children);
    uint64_t most = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t leaves = leaves_below(builder, children[i]);
        most = leaves > most ? leaves : most;
    }
    return most > 1 && most <= QSPLAT_PAGE_LEAVES;
}

/* How many groups of the upper levels, of how many bytes, and pages, are below. */
static void count_upper(struct builder *builder, struct place parent) {
    struct place children[QSPLAT_CHILDREN];
    const uint32_t count = children_of(builder, parent, children);
    builder->upper_groups++;
    builder->upper_size += group_size(builder, children, count);
    if (ends_upper(builder, parent)) {
        builder->tree->link_count++;
        return;
    }
    for (uint32_t i = 0; i < count; i++)
        if (children[i].level > 0) count_upper(builder, children[i]);
}

pbr_result plan_pages(struct builder *builder) {
    struct qsplat *tree = builder->tree;
    const struct place top = {0, builder->top};
    struct place children[QSPLAT_CHILDREN];
    tree->own = true;
    tree->leaves = builder->count;
    tree->root_children = children_of(builder, top, children);
    tree->size = size_below(builder, top);
    tree->link_count = 0;
    builder->upper_groups = builder->upper_size = 0;
    count_upper(builder, top);
    builder->pages = pbr_allocate(builder->instance, (size_t)tree->link_count, sizeof *builder->pages);
    return builder->pages ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

static void walk_upper(struct builder *builder, const struct window *end, struct pending *queue, uint8_t *nodes) {
    uint64_t tail = size_of_children(builder, queue[0].place), written = 1, pages = 0;
    for (uint64_t i = 0; i < written; i++) {
        const struct pending parent = queue[i];
        if (!ends_upper(builder, parent.place)) {
            write_group(builder, end, &parent, nodes, 0, &tail, queue, &written);
            continue;
        }
        struct page *page = &builder->pages[pages];
        uint64_t within = 0;
        write_group(builder, end, &parent, nodes, ~(uint32_t)pages, &within, page->parents, &page->count);
        for (uint64_t k = 0; k < page->count; k++) page->size += size_below(builder, page->parents[k].place);
        pages++;
    }
}

pbr_result write_upper(struct builder *builder, const struct window *end, const struct qsplat_sphere *root, uint8_t *nodes) {
    struct pending *queue = pbr_allocate(builder->instance, (size_t)builder->upper_groups, sizeof *queue);
    if (!queue) return PBR_ERROR_OUT_OF_MEMORY;
    queue[0] = (struct pending){*root, {0, builder->top}, 0};
    walk_upper(builder, end, queue, nodes);
    uint64_t tail = builder->upper_size;
    for (uint64_t i = 0; i < builder->tree->link_count; i++) {
        builder->pages[i].at = tail;
        tail += builder->pages[i].size;
    }
    pbr_free(builder->instance, queue);
    return PBR_OK;
}

void write_page(const struct builder *builder, const struct window *window, const struct page *page, struct pending *queue,
                uint8_t *out) {
    uint64_t count = page->count, tail = 0;
    memcpy(queue, page->parents, sizeof page->parents);
    for (uint64_t k = 0; k < count; k++) tail += size_of_children(builder, queue[k].place);
    for (uint64_t k = 0; k < count; k++) {
        const struct pending parent = queue[k];
        write_group(builder, window, &parent, out, 0, &tail, queue, &count);
    }
}

void store_links(const struct builder *builder, uint8_t *links) {
    for (uint64_t i = 0; i < builder->tree->link_count; i++)
        for (int k = 0; k < 8; k++) links[8 * i + (uint64_t)k] = (uint8_t)(builder->pages[i].at >> 8 * k);
}
