/* k nearest neighbours by a balanced k-d tree (Friedman, Bentley, Finkel 1977).
 *
 * The tree has no pointers: the node at level l, place j covers a fixed range of the entries, halved down to leaves that all
 * lie at the same level. The entries are the positions themselves, moved into tree order, so that a leaf is a run of memory.
 * SPDX-License-Identifier: MIT */
#include "neighbours.h"

#include <string.h>

enum { LEAF_ENTRIES = 12, SERIAL_ENTRIES = 1 << 12, QUERY_GRAIN = 1 << 11 };

struct entry {
    double position[3];
    uint32_t point;
};

struct node {
    double split; /* entries of the left child are <= split on `axis`, those of the right child >= */
    uint32_t axis;
};

struct kd_tree {
    pbr_instance *instance;
    struct entry *entries;
    struct node *nodes; /* (1 << levels) - 1 inner nodes in heap order */
    size_t count;
    unsigned levels; /* of inner nodes */
};

static size_t middle(size_t begin, size_t end) {
    return begin + (end - begin) / 2;
}

/* ---- Building ---- */

static void swap_entries(struct entry *a, struct entry *b) {
    struct entry t = *a;
    *a = *b;
    *b = t;
}

static double median3(double a, double b, double c) {
    if (a > b) {
        double t = a;
        a = b;
        b = t;
    }
    return c < a ? a : c > b ? b : c;
}

/* Quickselect (Hoare 1961): afterwards entries before `k` are <= and those after it are >= entry k on the axis. Both scans stop at
 * values equal to the pivot, so equal values are halved as well; the pivots are drawn pseudo-randomly, so no order of the input
 * is bad by its nature. */
static void select_entry(struct entry *e, ptrdiff_t low, ptrdiff_t high, ptrdiff_t k, uint32_t axis) {
    uint64_t state = (uint64_t)(high - low);
    while (low < high) {
        uint64_t span = (uint64_t)(high - low) + 1;
        double drawn[3];
        for (int i = 0; i < 3; i++) {
            state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407); /* Knuth's MMIX generator */
            drawn[i] = e[low + (ptrdiff_t)((state >> 32) * span >> 32)].position[axis];
        }
        double pivot = median3(drawn[0], drawn[1], drawn[2]);
        ptrdiff_t i = low, j = high;
        do {
            while (e[i].position[axis] < pivot) i++;
            while (e[j].position[axis] > pivot) j--;
            if (i <= j) swap_entries(&e[i++], &e[j--]);
        } while (i <= j);
        if (k <= j) high = j;
        else if (k >= i) low = i;
        else return;
    }
}

static uint32_t widest_axis(const struct entry *e, size_t begin, size_t end) {
    double low[3], high[3];
    memcpy(low, e[begin].position, sizeof low);
    memcpy(high, low, sizeof high);
    for (size_t i = begin + 1; i < end; i++)
        for (int k = 0; k < 3; k++) {
            double v = e[i].position[k];
            if (v < low[k]) low[k] = v;
            if (v > high[k]) high[k] = v;
        }
    double x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
    return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

static void split_node(struct kd_tree *tree, size_t node, size_t begin, size_t end) {
    size_t mid = middle(begin, end);
    uint32_t axis = widest_axis(tree->entries, begin, end);
    select_entry(tree->entries, (ptrdiff_t)begin, (ptrdiff_t)end - 1, (ptrdiff_t)mid, axis);
    tree->nodes[node] = (struct node){tree->entries[mid].position[axis], axis};
}

static void build_subtree(struct kd_tree *tree, unsigned level, size_t node, size_t begin, size_t end) {
    if (level == tree->levels) return;
    split_node(tree, node, begin, end);
    build_subtree(tree, level + 1, 2 * node + 1, begin, middle(begin, end));
    build_subtree(tree, level + 1, 2 * node + 2, middle(begin, end), end);
}

struct build {
    struct kd_tree *tree;
    unsigned level;
    bool whole; /* build the subtrees, not only split the nodes of this level */
};

/* Works on the nodes [first, last) of a level: each owns a range of entries of its own. */
static pbr_result build_range(void *user, size_t first, size_t last) {
    const struct build *build = user;
    struct kd_tree *tree = build->tree;
    for (size_t place = first; place < last; place++) {
        size_t begin = 0, end = tree->count;
        for (unsigned bit = build->level; bit-- > 0;)
            if (place >> bit & 1) begin = middle(begin, end);
            else end = middle(begin, end);
        size_t node = ((size_t)1 << build->level) - 1 + place;
        if (build->whole) build_subtree(tree, build->level, node, begin, end);
        else split_node(tree, node, begin, end);
    }
    return PBR_OK;
}

/* The first levels have few nodes, which are split side by side; below, threads take whole subtrees. */
static pbr_result build_tree(struct kd_tree *tree, const struct progress *progress) {
    size_t enough = (size_t)8 * pbr_instance_threads(tree->instance);
    struct build build = {.tree = tree};
    pbr_result result = PBR_OK;
    for (; result == PBR_OK && build.level < tree->levels; build.level++) {
        size_t nodes = (size_t)1 << build.level;
        if (nodes >= enough || tree->count / nodes <= SERIAL_ENTRIES) break;
        result = progress_report(progress, "building the search tree", (double)build.level / tree->levels);
        if (result == PBR_OK) result = pbr_parallel(tree->instance, nodes, 1, build_range, &build);
    }
    build.whole = true;
    if (result == PBR_OK) result = pbr_parallel(tree->instance, (size_t)1 << build.level, 1, build_range, &build);
    return result == PBR_OK ? progress_report(progress, "building the search tree", 1) : result;
}

static pbr_result copy_entries(void *user, size_t begin, size_t end) {
    void *const *pair = user;
    const pbr_points *points = pair[0];
    struct kd_tree *tree = pair[1];
    for (size_t i = begin; i < end; i++) {
        points_position(points, i, tree->entries[i].position);
        tree->entries[i].point = (uint32_t)i;
    }
    return PBR_OK;
}

pbr_result kd_tree_create(const pbr_points *points, const struct progress *progress, struct kd_tree **out) {
    pbr_instance *instance = points->instance;
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    struct kd_tree *tree = *out = pbr_allocate(instance, 1, sizeof *tree);
    if (!tree) return result;
    tree->instance = instance;
    tree->count = (size_t)points->count;
    while ((tree->count >> tree->levels) >= LEAF_ENTRIES) tree->levels++;
    tree->entries = pbr_allocate(instance, tree->count, sizeof *tree->entries);
    tree->nodes = pbr_allocate(instance, ((size_t)1 << tree->levels) - 1, sizeof *tree->nodes);
    if (!tree->entries || !tree->nodes) goto cleanup;
    void *pair[2] = {(void *)(uintptr_t)points, tree};
    result = pbr_parallel(instance, tree->count, SERIAL_ENTRIES, copy_entries, pair);
    if (result == PBR_OK) result = build_tree(tree, progress);
cleanup:
    if (result != PBR_OK) {
        kd_tree_destroy(points, tree);
        *out = NULL;
    }
    return result;
}

void kd_tree_destroy(const pbr_points *points, struct kd_tree *tree) {
    if (!tree) return;
    pbr_free(points->instance, tree->entries);
    pbr_free(points->instance, tree->nodes);
    pbr_free(points->instance, tree);
}

/* ---- Searching ---- */

struct query {
    const struct kd_tree *tree;
    double position[3];
    uint64_t skip;
    uint32_t k, found;
    double *squared; /* ascending */
    uint64_t *indices;
};

/* Used for points and for cells: as rounding is monotone, a cell's distance then never exceeds that of a point in it. */
static double squared_length(const double v[3]) {
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

static void offer(struct query *query, double squared, uint64_t point) {
    uint32_t i = query->found < query->k ? query->found++ : query->k - 1;
    for (; i > 0 && query->squared[i - 1] > squared; i--) {
        query->squared[i] = query->squared[i - 1];
        query->indices[i] = query->indices[i - 1];
    }
    query->squared[i] = squared;
    query->indices[i] = point;
}

static void search_leaf(struct query *query, size_t begin, size_t end) {
    for (size_t i = begin; i < end; i++) {
        const struct entry *e = &query->tree->entries[i];
        double v[3] = {e->position[0] - query->position[0], e->position[1] - query->position[1],
                       e->position[2] - query->position[2]};
        double squared = squared_length(v);
        if (e->point == query->skip || (query->found == query->k && squared >= query->squared[query->k - 1])) continue;
        offer(query, squared, e->point);
    }
}

/* `offset`: from the query to the nearest point of the node's cell (Arya and Mount 1993). Depth is at most the tree's levels, 29.
 */
static void search(struct query *query, unsigned level, size_t node, size_t begin, size_t end, const double offset[3]) {
    const struct kd_tree *tree = query->tree;
    if (level == tree->levels) {
        search_leaf(query, begin, end);
        return;
    }
    uint32_t axis = tree->nodes[node].axis;
    double across = tree->nodes[node].split - query->position[axis], far_offset[3] = {offset[0], offset[1], offset[2]};
    size_t mid = middle(begin, end);
    far_offset[axis] = across;
    if (across >= 0) search(query, level + 1, 2 * node + 1, begin, mid, offset);
    else search(query, level + 1, 2 * node + 2, mid, end, offset);
    /* Not only where it is farther: among a million equal points, each would look at all the others. */
    if (query->found == query->k && squared_length(far_offset) >= query->squared[query->k - 1]) return;
    if (across >= 0) search(query, level + 1, 2 * node + 2, mid, end, far_offset);
    else search(query, level + 1, 2 * node + 1, begin, mid, far_offset);
}

uint32_t kd_tree_nearest(const struct kd_tree *tree, const double position[3], uint32_t k, uint64_t skip, double *squared_distances,
                         uint64_t *indices) {
    struct query query = {.tree = tree,
                          .position = {position[0], position[1], position[2]},
                          .skip = skip,
                          .k = k,
                          .squared = squared_distances,
                          .indices = indices};
    const double inside[3] = {0, 0, 0};
    if (k > 0) search(&query, 0, 0, 0, tree->count, inside);
    return query.found;
}

struct visits {
    const struct kd_tree *tree;
    uint32_t k;
    neighbours_fn visit;
    void *user;
};

static pbr_result visit_range(void *user, size_t begin, size_t end) {
    const struct visits *visits = user;
    double squared[NEIGHBOURS_MOST];
    uint64_t indices[NEIGHBOURS_MOST];
    for (size_t i = begin; i < end; i++) {
        const struct entry *e = &visits->tree->entries[i];
        uint32_t found = kd_tree_nearest(visits->tree, e->position, visits->k, e->point, squared, indices);
        visits->visit(visits->user, e->point, found, squared, indices);
    }
    return PBR_OK;
}

pbr_result kd_tree_for_each(const struct kd_tree *tree, uint32_t k, const struct progress *progress, neighbours_fn visit,
                            void *user) {
    struct visits visits = {.tree = tree, .k = k < NEIGHBOURS_MOST ? k : NEIGHBOURS_MOST, .visit = visit, .user = user};
    return parallel_reporting(tree->instance, tree->count, QUERY_GRAIN, visit_range, &visits, progress, "finding neighbours");
}
