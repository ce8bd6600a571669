/* Encoding QSplat trees that are built, from the root down. SPDX-License-Identifier: MIT */
#include "container.h"
#include "qsplat_build.h"

/* ---- Sizes ---- */

/* Of the group of a node's children. */
static uint64_t group_size(const struct builder *builder, const struct node *parent) {
    return parent->child_count * (uint64_t)qsplat_node_size(builder->tree) + (parent->has_grandchildren ? 4 : 0);
}

uint64_t page_size(const struct builder *builder, const struct node *nodes, uint32_t count) {
    uint64_t size = 0;
    for (uint32_t i = 0; i + 1 < count; i++) size += group_size(builder, &nodes[i]);
    return size;
}

pbr_result plan_pages(struct builder *builder, place root) {
    struct qsplat *tree = builder->tree;
    struct node *top = upper_node(builder, root);
    if (top->child_count == 0) { /* A single leaf. The root has no record, and so may have one child. */
        builder->runs[0].children[0] = *top;
        top->children[0] = TIP;
        top->child_count = 1;
    }
    builder->upper_size = 0;
    for (size_t i = 0; i < builder->branch_count; i++) builder->upper_size += group_size(builder, &builder->branches[i].node);
    for (size_t i = 0; i < builder->run_count; i++) builder->upper_size += group_size(builder, &builder->runs[i].root);
    if (builder->upper_size >> 31) /* pointers' highest bit says that they are links */
        return pbr_log(builder->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "a QSplat tree of so many points cannot be addressed");
    tree->size = builder->upper_size;
    tree->leaves = 0;
    for (size_t i = 0; i < builder->run_count; i++) {
        builder->runs[i].page_at = tree->size;
        tree->size += builder->runs[i].page_size;
        tree->leaves += builder->runs[i].count;
    }
    tree->link_count = builder->run_count;
    tree->root_children = top->child_count;
    return PBR_OK;
}

void store_links(const struct builder *builder, uint8_t *links) {
    for (size_t i = 0; i < builder->run_count; i++) store_little(builder->runs[i].page_at, 8, links + 8 * i);
}

/* ---- Records ---- */

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
static struct qsplat_sphere write_node(const struct builder *builder, const struct node *node, const struct qsplat_sphere *parent,
                                       uint8_t *p) {
    const bool is_disc = node->child_count == 0 && node->sphere.radius > 0;
    struct qsplat_sphere decoded, wide = node->sphere;
    if (node->child_count > 0) wide.radius *= NODE_ROOM;
    uint32_t sphere =
        qsplat_encode_sphere(builder->codes, &wide, is_disc ? builder->codes->normals[node->normal] : NULL, parent, &decoded);
    if (node->child_count > 0 && sphere == QSPLAT_SPHERES - 1)
        sphere = qsplat_encode_sphere(builder->codes, &node->sphere, NULL, parent, &decoded);
    const uint32_t children = node->child_count > 0 ? node->child_count - 1u : 0, grand = node->has_grandchildren;
    const uint32_t cone = node->normal == QSPLAT_NO_NORMAL ? 3 : cone_code(node->angle);
    store_big(sphere << 19 | grand << 18 | children << 16 | (uint32_t)node->normal << 2 | cone, 4, p);
    if (builder->tree->has_colours) store_big(node->colour, 2, p + 4);
    return decoded;
}

/* The group of a node's children, `pointer` before it where they have children. */
static void write_group(const struct builder *builder, const struct node *parent, const struct node *const *children,
                        const struct qsplat_sphere *sphere, uint32_t pointer, uint8_t *p,
                        struct qsplat_sphere decoded[QSPLAT_CHILDREN]) {
    if (parent->has_grandchildren) {
        store_big(pointer, 4, p);
        p += 4;
    }
    for (uint32_t i = 0; i < parent->child_count; i++, p += qsplat_node_size(builder->tree))
        decoded[i] = write_node(builder, children[i], sphere, p);
}

/* Those of the children that have children themselves: their groups follow from *tail on. */
static void append(const struct builder *builder, const struct node *parent, const struct node *const *children,
                   const struct qsplat_sphere *decoded, struct pending *queue, size_t *queued, uint64_t *tail) {
    for (uint32_t i = 0; i < parent->child_count; i++) {
        if (children[i]->child_count == 0) continue;
        queue[(*queued)++] = (struct pending){decoded[i], parent->children[i], *tail};
        *tail += group_size(builder, children[i]);
    }
}

/* ---- Upper levels ---- */

static void point_at_children(const struct run *run, const struct node *children[QSPLAT_CHILDREN]) {
    for (uint32_t i = 0; i < run->root.child_count; i++) children[i] = &run->children[i];
}

static void write_run_top(struct builder *builder, const struct pending *top, uint8_t *nodes) {
    const place index = top->parent & ~TIP;
    struct run *run = &builder->runs[index];
    const struct node *children[QSPLAT_CHILDREN];
    point_at_children(run, children);
    write_group(builder, &run->root, children, &top->sphere, ~index, nodes + top->at, run->decoded);
}

static void write_branch(const struct builder *builder, const struct pending *top, uint8_t *nodes, struct pending *queue,
                         size_t *queued, uint64_t *tail) {
    const struct node *node = &builder->branches[top->parent].node, *children[QSPLAT_CHILDREN];
    struct qsplat_sphere decoded[QSPLAT_CHILDREN];
    for (uint32_t i = 0; i < node->child_count; i++) children[i] = upper_node(builder, node->children[i]);
    write_group(builder, node, children, &top->sphere, (uint32_t)(*tail - top->at), nodes + top->at, decoded);
    append(builder, node, children, decoded, queue, queued, tail);
}

pbr_result write_upper(struct builder *builder, place root, const struct qsplat_sphere *sphere, uint8_t *nodes) {
    struct pending *queue = pbr_allocate(builder->instance, builder->branch_count + builder->run_count, sizeof *queue);
    uint64_t tail = group_size(builder, upper_node(builder, root));
    size_t queued = 1;
    if (!queue) return PBR_ERROR_OUT_OF_MEMORY;
    queue[0] = (struct pending){*sphere, root, 0};
    for (size_t i = 0; i < queued; i++) {
        const struct pending top = queue[i];
        if (top.parent & TIP) write_run_top(builder, &top, nodes);
        else write_branch(builder, &top, nodes, queue, &queued, &tail);
    }
    pbr_free(builder->instance, queue);
    return PBR_OK;
}

/* ---- Pages ---- */

void write_page(const struct builder *builder, const struct run *run, const struct leaf *leaves, const struct node *nodes,
                struct pending *queue, uint8_t *out) {
    const struct node *children[QSPLAT_CHILDREN];
    size_t queued = 0;
    uint64_t tail = 0;
    point_at_children(run, children);
    append(builder, &run->root, children, run->decoded, queue, &queued, &tail);
    for (size_t k = 0; k < queued; k++) {
        const struct pending top = queue[k];
        const struct node *parent = &nodes[top.parent];
        struct node tips[QSPLAT_CHILDREN];
        struct qsplat_sphere decoded[QSPLAT_CHILDREN];
        for (uint32_t i = 0; i < parent->child_count; i++) {
            const place child = parent->children[i];
            if (child & TIP) tips[i] = node_of_leaf(&leaves[child & ~TIP]);
            children[i] = child & TIP ? &tips[i] : &nodes[child];
        }
        write_group(builder, parent, children, &top.sphere, (uint32_t)(tail - top.at), out + top.at, decoded);
        append(builder, parent, children, decoded, queue, &queued, &tail);
    }
}
