/* Files of QSplat version 11 (Rusinkiewicz), big-endian. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/file.h"
#include "qsplat.h"

enum { HEADER = 40, FRAGMENT = 20, COLOURS = 1, COMMENT = 2, VERSION = 11 };

bool qsplat_file_recognise(const uint8_t *data, uint64_t size) {
    return size >= 6 && memcmp(data, "QSplat", 6) == 0;
}

static float load_float(const uint8_t *p) {
    const uint32_t bits = load_big32(p);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static pbr_result wrong(pbr_instance *instance, const char *path, uint64_t at, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: byte %llu: %s", path, (unsigned long long)at, what);
}

static pbr_result parse_tree(pbr_instance *instance, const char *path, const uint8_t *p, uint64_t at, uint64_t length,
                             struct qsplat *tree) {
    if (length < HEADER) return wrong(instance, path, at + 8, "the tree is shorter than its header");
    const uint32_t leaves = load_big32(p + 12), options = load_big32(p + 16);
    tree->leaves = leaves;
    tree->root_children = load_big32(p + 36);
    tree->radius = tree->span = load_float(p + 32);
    tree->has_colours = (options & COLOURS) != 0;
    tree->nodes = p + HEADER;
    tree->size = length - HEADER;
    for (int k = 0; k < 3; k++) {
        tree->centre[k] = (double)load_float(p + 20 + 4 * k);
        if (!isfinite(tree->centre[k])) return wrong(instance, path, at + 20, "the centre is not finite");
    }
    if (options & ~(uint32_t)COLOURS) return wrong(instance, path, at + 16, "unknown options");
    if (!(tree->radius >= 0 && tree->radius <= FLT_MAX))
        return wrong(instance, path, at + 32, "the radius is negative or not finite");
    if (leaves > INT32_MAX) return wrong(instance, path, at + 12, "a negative number of points");
    if (tree->root_children > QSPLAT_CHILDREN || tree->root_children > leaves || (leaves > 0 && tree->root_children == 0))
        return wrong(instance, path, at + 36, "the root has an impossible number of children");
    return PBR_OK;
}

pbr_result qsplat_file_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct qsplat *tree) {
    for (uint64_t at = 0; at < size;) {
        const uint8_t *p = data + at;
        if (size - at < FRAGMENT) return wrong(instance, path, at, "the file ends within a fragment's header");
        if (memcmp(p, "QSplat", 6) != 0) return wrong(instance, path, at, "no fragment of QSplat begins here");
        const uint32_t length = load_big32(p + 8), options = load_big32(p + 16);
        if (length < FRAGMENT || length > INT32_MAX) return wrong(instance, path, at + 8, "an impossible length");
        if (length > size - at)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT,
                           "%s: byte %llu: the fragment has %u bytes, the file %llu more", path, (unsigned long long)at,
                           (unsigned)length, (unsigned long long)(size - at));
        if (options != COMMENT) {
            if (p[6] == '0' + VERSION / 10 && p[7] == '0' + VERSION % 10) return parse_tree(instance, path, p, at, length, tree);
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: QSplat version %c%c; only version 11 is supported",
                           path, p[6], p[7]);
        }
        at += length;
    }
    return wrong(instance, path, size, "the file has no tree");
}

/* ---- Writing ---- */

struct writer {
    pbr_instance *instance;
    const struct qsplat *tree;
    struct output output;
    struct qsplat_group *queue; /* groups in the order of the file, [first, first + count) of a ring */
    size_t first, count, capacity;
    uint64_t tail;   /* where the next group that is queued will lie */
    uint8_t *buffer; /* written from `at` on */
    size_t used;
    uint64_t at, left;
    bool damaged;
};

enum { BUFFER = 1 << 20 };

static pbr_result enqueue(struct writer *writer, const struct qsplat_group *group) {
    if (writer->count == writer->capacity) {
        const size_t capacity = writer->capacity ? 2 * writer->capacity : 1024;
        struct qsplat_group *grown = pbr_allocate(writer->instance, capacity, sizeof *grown);
        if (!grown) return PBR_ERROR_OUT_OF_MEMORY;
        for (size_t i = 0; i < writer->count; i++) grown[i] = writer->queue[(writer->first + i) & (writer->capacity - 1)];
        pbr_free(writer->instance, writer->queue);
        writer->queue = grown;
        writer->capacity = capacity;
        writer->first = 0;
    }
    writer->queue[(writer->first + writer->count++) & (writer->capacity - 1)] = *group;
    writer->tail += qsplat_group_size(writer->tree, group);
    return PBR_OK;
}

static void put(struct writer *writer, const void *data, size_t size) {
    if (writer->used + size > BUFFER) {
        output_write(&writer->output, writer->buffer, writer->used, writer->at);
        writer->at += writer->used;
        writer->used = 0;
    }
    memcpy(writer->buffer + writer->used, data, size);
    writer->used += size;
}

static void put_big(struct writer *writer, uint32_t v) {
    put(writer, (const uint8_t[4]){(uint8_t)(v >> 24), (uint8_t)(v >> 16), (uint8_t)(v >> 8), (uint8_t)v}, 4);
}

/* Records as they are, with a pointer to where the children's groups lie here. */
static pbr_result write_group(struct writer *writer, uint64_t *place) {
    const struct qsplat *tree = writer->tree;
    const struct qsplat_group group = writer->queue[writer->first];
    const uint32_t size = qsplat_node_size(tree);
    uint64_t next = 0;
    writer->first = (writer->first + 1) & (writer->capacity - 1);
    writer->count--;
    writer->damaged =
        !qsplat_group_is_inside(tree, &group) || group.count > writer->left || (group.inner && !qsplat_follow(tree, &group, &next));
    if (writer->damaged) return PBR_OK;
    writer->left -= group.count;
    if (group.inner) put_big(writer, (uint32_t)(writer->tail - *place));
    *place += qsplat_group_size(tree, &group);
    const uint8_t *p = tree->nodes + group.at + (group.inner ? 4 : 0);
    put(writer, p, (size_t)group.count * size);
    pbr_result result = PBR_OK;
    for (uint32_t i = 0; i < group.count && result == PBR_OK; i++) {
        const struct qsplat_node node = qsplat_read_node(p + (size_t)i * size, tree->has_colours);
        const struct qsplat_group below = {next, node.children, node.grandchildren};
        if (!node.children) continue;
        writer->damaged |= !group.inner;
        next += qsplat_group_size(tree, &below);
        result = enqueue(writer, &below);
    }
    return result;
}

static void write_header(struct writer *writer, uint64_t length) {
    const struct qsplat *tree = writer->tree;
    float place[4] = {(float)tree->centre[0], (float)tree->centre[1], (float)tree->centre[2], tree->radius};
    writer->used = 0;
    writer->at = 0;
    put(writer, "QSplat11", 8);
    put_big(writer, (uint32_t)length);
    put_big(writer, (uint32_t)tree->leaves);
    put_big(writer, tree->has_colours ? COLOURS : 0);
    for (int k = 0; k < 4; k++) {
        uint32_t bits;
        memcpy(&bits, &place[k], sizeof bits);
        put_big(writer, bits);
    }
    put_big(writer, tree->root_children);
    output_write(&writer->output, writer->buffer, writer->used, 0);
}

static pbr_result write_groups(struct writer *writer, const struct progress *progress, const char *path) {
    enum { REPORTS = 1 << 18 };
    const struct qsplat_group root = qsplat_root_group(writer->tree);
    uint64_t place = 0, groups = 0;
    writer->at = HEADER;
    pbr_result result = root.count > 0 ? enqueue(writer, &root) : PBR_OK;
    while (writer->count > 0 && result == PBR_OK) {
        result = write_group(writer, &place);
        if (result == PBR_OK && writer->damaged)
            result = pbr_log(writer->instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the hierarchy to be written is damaged", path);
        if (result == PBR_OK && writer->tail > INT32_MAX - HEADER - 4)
            result = pbr_log(writer->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT,
                             "%s: more than the 2 GiB that a file of QSplat holds; .pbr has no such limit", path);
        if (result == PBR_OK && ++groups % REPORTS == 0)
            result = progress_report(progress, "writing", (double)place / (double)writer->tree->size);
    }
    while (result == PBR_OK && place % 4 != 0) {
        put(writer, "", 1);
        place++;
    }
    if (result != PBR_OK) return result;
    output_write(&writer->output, writer->buffer, writer->used, writer->at);
    write_header(writer, HEADER + place);
    return progress_report(progress, "writing", 1);
}

pbr_result qsplat_file_write(pbr_instance *instance, const char *path, const struct qsplat *tree, const struct progress *progress) {
    struct writer writer = {.instance = instance, .tree = tree, .left = qsplat_most_nodes(tree)};
    pbr_result result = progress_report(progress, "writing", 0);
    for (int k = 0; k < 3 && result == PBR_OK; k++)
        if (!(fabs(tree->centre[k]) <= FLT_MAX))
            result =
                pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: the centre is beyond the floats of a file of QSplat", path);
    if (result == PBR_OK && tree->leaves > INT32_MAX)
        result = pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu points, a file of QSplat holds 2147483647", path,
                         (unsigned long long)tree->leaves);
    if (result == PBR_OK && !(writer.buffer = pbr_allocate(instance, BUFFER, 1))) result = PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = output_open(instance, path, &writer.output);
    if (result == PBR_OK) result = write_groups(&writer, progress, path);
    const pbr_result closed = output_close(&writer.output, result == PBR_OK);
    pbr_free(instance, writer.buffer);
    pbr_free(instance, writer.queue);
    return result == PBR_OK ? closed : result;
}
