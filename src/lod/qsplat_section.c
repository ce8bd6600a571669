/* A QSplat tree in our own container: a header, the links to pages, and the groups of nodes as they are.
 * SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "container.h"
#include "qsplat.h"

/* Leaves, bytes of nodes, links: 64 bits each; centre, doubles; radius, float; the root's children, flags: 32 bits each; span,
 * float. */
enum { HEADER = QSPLAT_SECTION_HEADER, HAS_COLOURS = 1, OWN = 2 };

static pbr_result wrong(pbr_instance *instance, const char *path, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the QSplat section %s", path, what);
}

pbr_result qsplat_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct qsplat *tree) {
    if (size < HEADER) return wrong(instance, path, "is shorter than its header");
    const uint64_t flags = load_little(data + 56, 4), room = size - HEADER;
    tree->leaves = load_little(data, 8);
    tree->size = load_little(data + 8, 8);
    tree->link_count = load_little(data + 16, 8);
    for (int k = 0; k < 3; k++) {
        const uint64_t bits = load_little(data + 24 + 8 * k, 8);
        memcpy(&tree->centre[k], &bits, sizeof bits);
        if (!isfinite(tree->centre[k])) return wrong(instance, path, "has a centre that is not finite");
    }
    const uint32_t bits = (uint32_t)load_little(data + 48, 4), span = (uint32_t)load_little(data + 60, 4);
    memcpy(&tree->radius, &bits, sizeof bits);
    memcpy(&tree->span, &span, sizeof span);
    tree->root_children = (uint32_t)load_little(data + 52, 4);
    tree->has_colours = (flags & HAS_COLOURS) != 0;
    tree->own = (flags & OWN) != 0;
    if (flags & ~(uint64_t)(HAS_COLOURS | OWN))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: the QSplat section has flags of a later version", path);
    if (!(tree->radius >= 0 && tree->radius <= FLT_MAX && tree->span >= 0 && tree->span <= FLT_MAX))
        return wrong(instance, path, "has an impossible radius");
    if (tree->link_count > room / 8 || tree->size > room - 8 * tree->link_count) return wrong(instance, path, "lacks nodes");
    if (tree->root_children > QSPLAT_CHILDREN || tree->root_children > tree->leaves ||
        (tree->leaves > 0 && tree->root_children == 0))
        return wrong(instance, path, "has a root with an impossible number of children");
    tree->links = data + HEADER;
    tree->nodes = data + HEADER + 8 * tree->link_count;
    return PBR_OK;
}

void qsplat_section_header(const struct qsplat *tree, uint8_t header[QSPLAT_SECTION_HEADER]) {
    uint32_t radius;
    memset(header, 0, HEADER);
    store_little(tree->leaves, 8, header);
    store_little(tree->size, 8, header + 8);
    store_little(tree->link_count, 8, header + 16);
    for (int k = 0; k < 3; k++) {
        uint64_t bits;
        memcpy(&bits, &tree->centre[k], sizeof bits);
        store_little(bits, 8, header + 24 + 8 * k);
    }
    memcpy(&radius, &tree->radius, sizeof radius);
    store_little(radius, 4, header + 48);
    memcpy(&radius, &tree->span, sizeof radius);
    store_little(radius, 4, header + 60);
    store_little(tree->root_children, 4, header + 52);
    store_little((tree->has_colours ? HAS_COLOURS : 0) | (tree->own ? OWN : 0), 4, header + 56);
}

pbr_result qsplat_section_write(pbr_instance *instance, const char *path, const struct qsplat *tree,
                                const struct progress *progress) {
    uint8_t header[HEADER];
    qsplat_section_header(tree, header);
    const struct container_part parts[] = {{header, sizeof header}, {tree->links, 8 * tree->link_count}, {tree->nodes, tree->size}};
    return container_write(instance, path, QSPLAT_SECTION, parts, sizeof parts / sizeof *parts, progress);
}
