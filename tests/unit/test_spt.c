/* Sequential point trees: trees of whole clouds, what is drawn of them, and what codes stand for. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include <float.h>

#include "core/points.h"
#include "lod/spt_build.h"
#include "lod/spt_cut.h"

static const struct kind kinds[] = {
    {"1 point", SPHERE, 1, 0},
    {"2 points", SPHERE, 2, 0},
    {"3 points", SPHERE, 3, 0},
    {"17 points", SPHERE, 17, 0},
    {"1 point without radius", SPHERE, 1, ZERO_RADII},
    {"a sphere", SPHERE, 1000, 0},
    {"a plane", PLANE, 1000, 0},
    {"a torus", TORUS, 20000, 0},
    {"points in one place", COINCIDENT, 5000, 0},
    {"points in one place without radii", COINCIDENT, 300, ZERO_RADII},
    {"a line", LINE, 1000, 0},
    {"two far clusters", CLUSTERS, 3000, 0},
    {"a sphere without radii", SPHERE, 1000, ZERO_RADII},
    {"a sphere with one huge radius", SPHERE, 1000, ONE_HUGE},
    {"a sphere without normals", SPHERE, 1000, NO_NORMALS},
    {"a sphere with some normals", SPHERE, 1000, SOME_NORMALS},
    {"a sphere with any normals", SPHERE, 1000, RANDOM_NORMALS},
    {"a sphere without colours", SPHERE, 1000, NO_COLOURS},
    {"a survey", TORUS, 3000, SURVEY},
    {"a survey as small as a float's step", TORUS, 1000, SMALL_SURVEY},
    {"more than a chunk", SPHERE, SPT_CHUNK_LEAVES + 1, 0},
};

/* One chunk's tree and sequence. */
struct built {
    struct host *host;
    pbr_instance *instance;
    const struct kind *kind;
    uint32_t leaf_points;
    pbr_points *points;
    struct spt_builder builder;
    struct spt_tree tree;
    struct spt_chunk chunk;
    const struct spt_entry *entries;
    const struct spt_step *steps;
    uint32_t *order;    /* entry -> node */
    uint32_t *entry_of; /* node -> entry */
};

static void *take(size_t count, size_t size) {
    void *memory = calloc(count + 1, size);
    assert_non_null(memory);
    return memory;
}

static void make_sequence(struct built *b, size_t chunk) {
    assert_int_equal(spt_make_tree(&b->builder, chunk, &b->tree), PBR_OK);
    b->order = take(b->tree.count, sizeof *b->order);
    b->entry_of = take(b->tree.count, sizeof *b->entry_of);
    assert_int_equal(spt_sequence(b->instance, &b->tree, &b->chunk, &b->entries, &b->steps, b->order), PBR_OK);
    for (uint32_t i = 0; i < b->tree.count; i++) b->entry_of[b->order[i]] = i;
}

static void free_sequence(struct built *b) {
    pbr_free(b->instance, (void *)(uintptr_t)b->entries);
    pbr_free(b->instance, (void *)(uintptr_t)b->steps);
    free(b->order);
    free(b->entry_of);
}

/* Every chunk of every kind, with one and with several points in a cell. */
static void for_each_chunk(void (*check)(struct built *built)) {
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < 2 * COUNT(kinds); i++) {
        struct built b = {.host = &host, .instance = instance, .kind = &kinds[i / 2], .leaf_points = i % 2 ? 8 : 1};
        struct surface surface = make_surface(b.kind);
        b.points = surface_points(instance, &surface);
        b.builder = (struct spt_builder){.instance = instance, .points = b.points, .leaf_points = b.leaf_points};
        assert_int_equal(spt_builder_start(&b.builder), PBR_OK);
        for (size_t c = 0; c < b.builder.chunk_count; c++) {
            make_sequence(&b, c);
            check(&b);
            free_sequence(&b);
        }
        spt_tree_free(instance, &b.tree);
        spt_builder_end(&b.builder);
        pbr_points_release(&b.points);
        free_surface(&surface);
    }
    host_stop(&host, instance);
}

static bool is_leaf(const struct built *b, uint32_t node) {
    return b->tree.nodes[node].children == 0;
}

static const struct spt_entry *entry_at(const struct built *b, uint32_t node) {
    return &b->entries[b->entry_of[node]];
}

/* ---- Trees ---- */

static void check_shape(struct built *b) {
    const uint32_t count = b->tree.count;
    uint32_t *children = take(count, sizeof *children), leaves = 0;
    for (uint32_t i = 0; i + 1 < count; i++) {
        assert_true(b->tree.nodes[i].parent > i && b->tree.nodes[i].parent < count);
        children[b->tree.nodes[i].parent]++;
    }
    assert_true(b->tree.nodes[count - 1].parent == UINT32_MAX);
    for (uint32_t i = 0; i < count; i++) {
        assert_int_equal(children[i], b->tree.nodes[i].children);
        assert_true(children[i] != 1 && children[i] <= SPT_CHILDREN_MOST);
        leaves += children[i] == 0;
    }
    free(children);
    assert_int_equal(leaves, b->chunk.leaves);
    assert_int_equal(count, b->chunk.count);
    assert_true(leaves <= SPT_CHUNK_LEAVES);
    if (b->builder.chunk_count == 1) assert_int_equal(leaves, b->kind->count);
}

static void all_points_are_leaves_and_no_node_has_a_single_child(void **unused) {
    (void)unused;
    for_each_chunk(check_shape);
}

/* Radii were rounded up once more for each level. */
static void check_nested(struct built *b) {
    for (uint32_t i = 0; i + 1 < b->tree.count; i++) {
        const struct spt_node *node = &b->tree.nodes[i], *parent = &b->tree.nodes[node->parent];
        double d[3], along = 0;
        for (int k = 0; k < 3; k++) {
            d[k] = node->position[k] - parent->position[k];
            along += d[k] * (double)parent->normal[k];
        }
        for (int k = 0; k < 3; k++) d[k] -= along * (double)parent->normal[k];
        assert_true(length3(d) + (double)node->radius <= (double)parent->radius * (1 + 1e-6));
        assert_true(node->error <= parent->error);
        assert_true(is_leaf(b, i) ? node->error == 0 : (double)node->error <= 2 * (double)node->radius * (1 + 1e-6));
    }
}

static void discs_hold_their_childrens_and_errors_fall_towards_the_leaves(void **unused) {
    (void)unused;
    for_each_chunk(check_nested);
}

/* ---- Codes ---- */

/* What float products may be off. */
static const double FLOAT = 1e-6;

static void check_codes(struct built *b) {
    const struct spt_chunk *chunk = &b->chunk;
    double side = 0, largest = 0;
    for (uint32_t i = 0; i < b->tree.count; i++)
        for (int k = 0; k < 3; k++) side = fmax(side, b->tree.nodes[i].position[k] - chunk->origin[k]);
    for (uint32_t i = 0; i < b->tree.count; i++) largest = fmax(largest, (double)b->tree.nodes[i].radius);
    const double shift = side / 65535 / 2 * sqrt(3) * (1 + 0.01), radius_step = (largest + shift) / 65535;
    const double error_step = fmax((double)b->tree.nodes[b->tree.count - 1].error / 65534, (double)FLT_MIN);
    for (uint32_t i = 0; i < b->tree.count; i++) {
        const struct spt_node *node = &b->tree.nodes[i];
        const struct spt_entry *entry = entry_at(b, i);
        float p[3], normal[3];
        double moved[3];
        spt_decode_position(chunk, entry, p);
        for (int k = 0; k < 3; k++) moved[k] = chunk->origin[k] + (double)p[k] - node->position[k];
        assert_true(length3(moved) <= shift);
        const double radius = (double)spt_decode_radius(chunk, entry), least = (double)node->radius + length3(moved);
        if (node->radius > 0) assert_true(radius >= least && radius <= least + radius_step * (1 + 1e-3) + FLOAT * radius);
        else assert_int_equal(entry->radius, 0);
        const double error = (double)spt_decode_error(chunk, entry->error);
        assert_true(error >= (double)node->error);
        assert_true(error <= (double)node->error + error_step * (1 + 1e-3) + FLOAT * error);
        assert_int_equal(entry->error == 0, is_leaf(b, i));
        assert_true(entry->error < SPT_NO_PARENT);
        if (i + 1 == b->tree.count) assert_int_equal(entry->parent_error, SPT_NO_PARENT);
        else assert_int_equal(entry->parent_error, entry_at(b, node->parent)->error);
        splat_decode_normal(entry->normal, normal);
        for (int k = 0; k < 3; k++) assert_true(fabs((double)normal[k] - (double)node->normal[k]) < 1e-4);
    }
}

static void codes_are_as_exact_as_is_said(void **unused) {
    (void)unused;
    for_each_chunk(check_codes);
}

static void check_distances(struct built *b) {
    for (uint32_t i = 0; i + 1 < b->tree.count; i++) {
        const struct spt_entry *entry = entry_at(b, i), *parent = entry_at(b, b->tree.nodes[i].parent);
        float p[3], q[3];
        double d[3];
        spt_decode_position(&b->chunk, entry, p);
        spt_decode_position(&b->chunk, parent, q);
        for (int k = 0; k < 3; k++) d[k] = (double)p[k] - (double)q[k];
        const double decoded = (double)spt_decode_distance(&b->chunk, entry->distance), least = length3(d);
        assert_true(decoded >= least);
        /* A code and the room; the smallest code stands for 2^-15.9 of the largest distance. */
        assert_true(decoded <= fmax(least * (1 + 1.0 / 64) * exp2(1.0 / 16) * (1 + FLOAT),
                                    (double)b->chunk.largest_distance * exp2(-254.0 / 16) * (1 + FLOAT)));
    }
}

static void distances_to_parents_are_at_least_what_they_are(void **unused) {
    (void)unused;
    for_each_chunk(check_distances);
}

static void check_bounds(struct built *b) {
    const struct spt_chunk *chunk = &b->chunk;
    bool all = true;
    double least = 1;
    for (uint32_t i = 0; i < chunk->count; i++) {
        const double radius = (double)spt_decode_radius(chunk, &b->entries[i]);
        float p[3], normal[3];
        double d[3], dot = 0;
        spt_decode_position(chunk, &b->entries[i], p);
        splat_decode_normal(b->entries[i].normal, normal);
        all = all && (normal[0] != 0 || normal[1] != 0 || normal[2] != 0);
        for (int k = 0; k < 3; k++) {
            d[k] = (double)p[k] - (double)chunk->centre[k];
            assert_true((double)p[k] - radius >= (double)chunk->minimum[k] && (double)p[k] + radius <= (double)chunk->maximum[k]);
            dot += (double)normal[k] * (double)chunk->axis[k];
        }
        assert_true(length3(d) + radius <= (double)chunk->radius);
        least = fmin(least, dot);
    }
    if (!all) assert_true(chunk->cone == -1);
    else assert_true(least >= (double)chunk->cone - 1e-6);
    if (all && b->kind->shape == PLANE) assert_true((double)chunk->cone > 0.999);
}

static void bounds_hold_all_splats_and_normals(void **unused) {
    (void)unused;
    for_each_chunk(check_bounds);
}

static void check_order(struct built *b) {
    float distance = 0;
    for (uint32_t i = 1; i < b->chunk.count; i++) {
        const struct spt_entry *a = &b->entries[i - 1], *e = &b->entries[i];
        assert_true(a->parent_error >= e->parent_error);
        if (a->parent_error != e->parent_error) continue;
        assert_true(a->error >= e->error);
        if (a->error == e->error) assert_true(b->order[i - 1] < b->order[i]);
    }
    for (uint32_t i = b->chunk.count; i-- > 0;) {
        distance = fmaxf(distance, spt_decode_distance(&b->chunk, b->entries[i].distance));
        if (i % SPT_STEP == 0) assert_true(b->steps[i / SPT_STEP].distance == distance);
    }
}

static void entries_are_sorted_by_parents_errors(void **unused) {
    (void)unused;
    for_each_chunk(check_order);
}

/* ---- What is drawn ---- */

struct test { /* of an entry, as decoded */
    float e, E, D;
};

static struct test test_of(const struct built *b, const struct spt_entry *entry) {
    return (struct test){spt_decode_error(&b->chunk, entry->error), spt_decode_error(&b->chunk, entry->parent_error),
                         spt_decode_distance(&b->chunk, entry->distance)};
}

/* How often nodes from each leaf up to the root are drawn: fewest and most. Parents come last, so counts go down from the root. */
static void count_drawn(struct built *b, const bool *drawn, uint64_t *fewest, uint64_t *most) {
    uint64_t *above = take(b->tree.count, sizeof *above);
    *fewest = UINT64_MAX;
    *most = 0;
    for (uint32_t i = b->tree.count; i-- > 0;) {
        const uint32_t parent = b->tree.nodes[i].parent;
        above[i] = (parent == UINT32_MAX ? 0 : above[parent]) + drawn[i];
        if (!is_leaf(b, i)) continue;
        *fewest = above[i] < *fewest ? above[i] : *fewest;
        *most = above[i] > *most ? above[i] : *most;
    }
    free(above);
}

/* Scales at which the tree is cut somewhere: z = s e for some e. */
static double random_scale(const struct built *b, uint64_t *state, double z) {
    const struct spt_entry *entry = &b->entries[(size_t)(uniform(state) * b->chunk.count)];
    const double e = (double)spt_decode_error(&b->chunk, entry->error);
    return uniform(state) < 0.5 && e > 0 ? z / e : z / ((double)b->chunk.error_step * exp2(17 * uniform(state) - 0.5));
}

static void check_cuts(struct built *b) {
    uint64_t state = 9, fewest, most;
    bool *cut = take(b->tree.count, 1), *drawn = take(b->tree.count, 1);
    const int tries = b->tree.count > 100000 ? 5 : 50;
    for (int t = 0; t < tries; t++) {
        const float z = (float)(0.1 + 100 * uniform(&state)), s = (float)random_scale(b, &state, (double)z);
        for (uint32_t i = 0; i < b->tree.count; i++) {
            const struct test test = test_of(b, entry_at(b, i));
            cut[i] = spt_is_drawn(test.e, test.E, 0, s, z);
            drawn[i] = spt_is_drawn(test.e, test.E, test.D, s, z);
            assert_true(drawn[i] || !cut[i]);
        }
        count_drawn(b, cut, &fewest, &most);
        assert_int_equal(fewest, 1);
        assert_int_equal(most, 1);
    }
    free(cut);
    free(drawn);
}

static void at_one_depth_exactly_one_cut_is_drawn(void **unused) {
    (void)unused;
    for_each_chunk(check_cuts);
}

/* Depths as an eye somewhere sees them, also one within the model. */
static void check_overlap(struct built *b) {
    uint64_t state = 5, fewest, most;
    bool *drawn = take(b->tree.count, 1);
    const int tries = b->tree.count > 100000 ? 10 : 100;
    for (int t = 0; t < tries; t++) {
        double axis[3];
        random_direction(&state, axis);
        const double size = (double)b->chunk.radius, away = size * (t % 2 ? 4 * uniform(&state) : 1.2 * uniform(&state));
        const float s = (float)random_scale(b, &state, fmax(away, 1e-3 * size + 1e-6));
        for (uint32_t i = 0; i < b->tree.count; i++) {
            const struct test test = test_of(b, entry_at(b, i));
            float p[3], z = (float)away;
            spt_decode_position(&b->chunk, entry_at(b, i), p);
            for (int k = 0; k < 3; k++) z += (float)axis[k] * (p[k] - b->chunk.centre[k]);
            drawn[i] = spt_is_drawn(test.e, test.E, test.D, s, z);
        }
        count_drawn(b, drawn, &fewest, &most);
        if (fewest < 1) fail_msg("%s, %u points a leaf: try %d, scale %g", b->kind->name, b->leaf_points, t, (double)s);
    }
    free(drawn);
}

static void where_depths_differ_no_leaf_goes_without(void **unused) {
    (void)unused;
    for_each_chunk(check_overlap);
}

static void check_leaves(struct built *b) {
    uint32_t first, end, drawn = 0;
    spt_range(&b->chunk, b->steps, INFINITY, 1, 2, &first, &end);
    for (uint32_t i = 0; i < b->chunk.count; i++) {
        const struct test test = test_of(b, &b->entries[i]);
        const bool is = spt_is_drawn(test.e, test.E, test.D, INFINITY, 1.5f);
        assert_int_equal(is, is_leaf(b, b->order[i]));
        if (is) assert_true(i >= first && i < end);
        drawn += is;
    }
    assert_int_equal(drawn, b->chunk.leaves);
}

static void threshold_0_is_the_leaves(void **unused) {
    (void)unused;
    for_each_chunk(check_leaves);
}

/* Nothing before or behind is drawn at either end of the depths; between them a test that fails at both may hold, which the ends'
 * own tests tell: the left side is for the farthest, the right one for the nearest. */
static void check_ranges(struct built *b) {
    uint64_t state = 17;
    const int tries = b->tree.count > 100000 ? 20 : 300;
    uint64_t kept = 0, all = 0, heads = 0;
    struct spt_sizes sizes;
    spt_measure_sizes(&b->chunk, b->entries, &sizes);
    for (int t = 0; t < tries; t++) {
        const float near = (float)exp(20 * uniform(&state) - 10), far = near * (float)(1 + 3 * (t % 3) * uniform(&state));
        const float s = (float)random_scale(b, &state, (double)(t % 2 ? near : far));
        uint32_t first, end;
        if (t % 3 == 1) spt_range(&b->chunk, b->steps, (double)s, (double)near, (double)far, &first, &end);
        else spt_cut_range(&b->chunk, b->steps, &sizes, (double)s, (double)near, (double)far, &first, &end);
        assert_true(first <= end && end <= b->chunk.count);
        heads += end < b->chunk.count && end % SPT_STEP != 0;
        for (uint32_t i = 0; i < b->chunk.count; i++) {
            if (i >= first && i < end) continue;
            const struct test test = test_of(b, &b->entries[i]);
            const bool may =
                (test.e == 0 || s * test.e <= far) && near - (test.D > 0 ? SPT_DEPTH_ROOM * near : 0) < s * test.E + test.D;
            if (may) fail_msg("%s: entry %u of [%u, %u) is drawn", b->kind->name, i, first, end);
        }
        kept += end - first;
        all += b->chunk.count;
    }
    if (b->chunk.count > 2 * SPT_STEP && b->tree.count <= 100000) assert_true(heads > 0); /* some end within the first line */
    /* It does leave something out. */
    if (b->chunk.count > 20000 && b->kind->shape == TORUS) assert_true(kept < all * 9 / 10);
}

static void ranges_leave_out_nothing_that_is_drawn(void **unused) {
    (void)unused;
    for_each_chunk(check_ranges);
}

/* Entries that a step's bound just holds, seen from just where it ends: rounding must not part the two. */
static void check_edges(struct built *b) {
    for (uint32_t i = 0; i < b->chunk.count; i++) {
        const struct test test = test_of(b, &b->entries[i]);
        const struct spt_step *step = &b->steps[i / SPT_STEP];
        if (test.E >= SPT_ENDLESS || test.E != step->error || test.D != step->distance) continue;
        for (int t = -8; t <= 16; t++) {
            const float s = 1000.1f + (float)t;
            const float near = (float)(((double)s * (double)test.E + (double)test.D) * (1 + t * 0x1p-24));
            uint32_t first, end;
            spt_range(&b->chunk, b->steps, (double)s, (double)near, (double)near, &first, &end);
            if (spt_is_drawn(test.e, test.E, test.D, s, near)) assert_true(i >= first && i < end);
        }
    }
}

static void ranges_end_beyond_what_floats_may_be_off(void **unused) {
    (void)unused;
    for_each_chunk(check_edges);
}

/* Behind the eye all is out of depth, but its leaves are kept: their discs may reach before it. */
static void check_behind(struct built *b) {
    uint32_t first, end;
    spt_range(&b->chunk, b->steps, 100, -2, -1, &first, &end);
    for (uint32_t i = 0; i < b->chunk.count; i++) {
        const struct test test = test_of(b, &b->entries[i]);
        const bool drawn = spt_is_drawn(test.e, test.E, test.D, 100, -1.5f);
        assert_int_equal(drawn, is_leaf(b, b->order[i]));
        if (drawn) assert_true(i >= first && i < end);
    }
}

static void behind_the_eye_there_are_the_leaves(void **unused) {
    (void)unused;
    for_each_chunk(check_behind);
}

/* ---- All chunks ---- */

static pbr_points *points_of(pbr_instance *instance, const struct kind *kind) {
    struct surface surface = make_surface(kind);
    pbr_points *points = surface_points(instance, &surface);
    free_surface(&surface);
    return points;
}

static void one_thread_and_three_make_the_same(void **unused) {
    (void)unused;
    static const struct kind kind = {"several chunks", TORUS, 3 * SPT_CHUNK_LEAVES, 0};
    struct host hosts[2];
    pbr_instance *instances[2];
    struct spt spts[2];
    for (int i = 0; i < 2; i++) {
        instances[i] = host_start(&hosts[i], i ? 3 : 1);
        pbr_points *points = points_of(instances[i], &kind);
        assert_int_equal(spt_build(instances[i], points, 1, true, NULL, &spts[i]), PBR_OK);
        pbr_points_release(&points);
    }
    assert_int_equal(spts[0].leaves, kind.count);
    assert_true(spts[0].chunk_count >= 3 && spts[0].chunk_count == spts[1].chunk_count);
    for (uint32_t c = 0; c < spts[0].chunk_count; c++) {
        const struct spt_chunk *chunk = &spts[0].chunks[c];
        assert_memory_equal(chunk, &spts[1].chunks[c], sizeof *chunk);
        assert_memory_equal(spts[0].entries[c], spts[1].entries[c], chunk->count * sizeof(struct spt_entry));
        assert_memory_equal(spts[0].steps[c], spts[1].steps[c], spt_step_count(chunk) * sizeof(struct spt_step));
        assert_memory_equal(spts[0].fields[c], spts[1].fields[c], chunk->count * sizeof(struct normal_field));
    }
    for (int i = 0; i < 2; i++) {
        spt_free(instances[i], &spts[i]);
        host_stop(&hosts[i], instances[i]);
    }
}

/* Half of the light of white is 188 in sRGB, as the standard has it; the leaves keep their bytes. */
static void colours_are_averaged_in_linear_light(void **unused) {
    (void)unused;
    static const float positions[2][3] = {{0, 0, 0}, {1, 0, 0}};
    static const uint8_t colours[2][4] = {{255, 7, 0, 255}, {0, 7, 255, 255}};
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    struct spt spt;
    desc.count = 2;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 4};
    desc.radius = 1;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    assert_int_equal(spt_build(instance, points, 1, false, NULL, &spt), PBR_OK);
    assert_int_equal(spt.count, 3);
    assert_memory_equal(spt.entries[0][0].colour, ((const uint8_t[]){188, 7, 188}), 3); /* the root */
    assert_memory_equal(spt.entries[0][1].colour, colours[0], 3);
    assert_memory_equal(spt.entries[0][2].colour, colours[1], 3);
    spt_free(instance, &spt);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* One point so far away that all others are in one cell: they are divided by where they are all the same, so few nodes are as large
 * as the surface. */
static void points_in_one_cell_are_divided_by_place(void **unused) {
    (void)unused;
    static const struct kind kind = {"a sphere and a point", SPHERE, 5000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct surface surface = make_surface(&kind);
    surface.positions[77][0] = 1e8; /* 2^21 cells: 48 units each */
    pbr_points *points = surface_points(instance, &surface);
    struct spt_builder builder = {.instance = instance, .points = points, .leaf_points = 1};
    struct spt_tree tree = {0};
    assert_int_equal(spt_builder_start(&builder), PBR_OK);
    assert_int_equal(builder.chunk_count, 1);
    assert_int_equal(spt_make_tree(&builder, 0, &tree), PBR_OK);
    uint32_t large = 0;
    for (uint32_t i = 0; i < tree.count; i++) large += tree.nodes[i].radius > 0.25f;
    assert_true(large > 2 && large < 200);
    spt_tree_free(instance, &tree);
    spt_builder_end(&builder);
    pbr_points_release(&points);
    free_surface(&surface);
    host_stop(&host, instance);
}

/* Most points in a millionth of the box: cut until codes of positions are exact enough, or there are few. */
static void dense_parts_get_chunks_of_their_own(void **unused) {
    (void)unused;
    enum { POINTS = 60000, FEW = 8192 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = take(POINTS, sizeof *positions), *radii = take(POINTS, sizeof *radii);
    uint64_t state = 1;
    for (size_t i = 0; i < POINTS; i++) {
        const double size = i % 16 == 0 ? 1 : 1e-4;
        for (int k = 0; k < 2; k++) positions[i][k] = (float)(0.3 + size * uniform(&state));
        radii[i] = (float)(size / 200);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    struct spt spt;
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    assert_int_equal(spt_build(instance, points, 1, false, NULL, &spt), PBR_OK);
    uint64_t exact = 0;
    for (uint32_t c = 0; c < spt.chunk_count; c++) /* 32 half diagonals of a step. */
        if ((double)spt.chunks[c].position_step * 32 * sqrt(3) / 2 <= 1.001 * 1e-4 / 200) exact += spt.chunks[c].leaves;
    assert_int_equal(spt.leaves, POINTS);
    assert_true(exact > POINTS * 7 / 10);
    assert_true(spt.chunk_count < 100);
    spt_free(instance, &spt);
    pbr_points_release(&points);
    free(positions);
    free(radii);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_points_are_leaves_and_no_node_has_a_single_child),
        cmocka_unit_test(discs_hold_their_childrens_and_errors_fall_towards_the_leaves),
        cmocka_unit_test(codes_are_as_exact_as_is_said),
        cmocka_unit_test(distances_to_parents_are_at_least_what_they_are),
        cmocka_unit_test(bounds_hold_all_splats_and_normals),
        cmocka_unit_test(entries_are_sorted_by_parents_errors),
        cmocka_unit_test(at_one_depth_exactly_one_cut_is_drawn),
        cmocka_unit_test(where_depths_differ_no_leaf_goes_without),
        cmocka_unit_test(threshold_0_is_the_leaves),
        cmocka_unit_test(ranges_leave_out_nothing_that_is_drawn),
        cmocka_unit_test(ranges_end_beyond_what_floats_may_be_off),
        cmocka_unit_test(behind_the_eye_there_are_the_leaves),
        cmocka_unit_test(one_thread_and_three_make_the_same),
        cmocka_unit_test(colours_are_averaged_in_linear_light),
        cmocka_unit_test(points_in_one_cell_are_divided_by_place),
        cmocka_unit_test(dense_parts_get_chunks_of_their_own),
    };
    return cmocka_run_group_tests_name("spt", tests, NULL, NULL);
}
