/* Where QSplat trees that are built are split, and what becomes of the pieces. SPDX-License-Identifier: MIT */
#include "support.h"

#include <float.h>

#include "lod/qsplat_build.h"

/* Runs have an eighth of what was parted for them at least, and that was longer than a run. */
enum { LEAST_RUN = RUN / 8 };

static struct leaf *make_leaves(size_t count) {
    struct leaf *leaves = calloc(count, sizeof *leaves);
    assert_non_null(leaves);
    return leaves;
}

/* A square of `size` at x, as even as chance makes it. */
static void scatter(struct leaf *leaves, size_t count, double x, double size, float radius, uint64_t *state) {
    for (size_t i = 0; i < count; i++) {
        leaves[i].sphere.centre[0] = (float)(x + size * uniform(state));
        leaves[i].sphere.centre[1] = (float)(size * uniform(state));
        leaves[i].sphere.radius = radius;
    }
}

/* ---- Runs and branches ---- */

struct shape {
    struct host host;
    struct builder builder;
    place root;
};

static void free_shape(struct shape *shape) {
    pbr_instance *instance = shape->builder.instance;
    builder_end(&shape->builder);
    host_stop(&shape->host, instance);
}

/* All runs are below, in their order, each once; branches have two to four children, and come after these. Returns the levels. */
static int check_below(const struct builder *builder, place at, size_t *runs) {
    int most = 0;
    if (at & TIP) {
        assert_int_equal(at & ~TIP, *runs);
        (*runs)++;
        return 0;
    }
    assert_true(at < builder->branch_count);
    const struct node *node = &builder->branches[at].node;
    assert_true(node->child_count >= 2 && node->child_count <= QSPLAT_CHILDREN);
    for (uint32_t i = 0; i < node->child_count; i++) {
        assert_true(node->children[i] & TIP || node->children[i] < at);
        const int levels = check_below(builder, node->children[i], runs);
        most = levels > most ? levels : most;
    }
    return most + 1;
}

static void order(struct shape *shape, struct leaf *leaves, size_t count) {
    enum { FIRST = 1000 };
    uint64_t next = FIRST;
    size_t runs = 0;
    uint8_t *seen = calloc(count, 1);
    assert_non_null(seen);
    for (size_t i = 0; i < count; i++) leaves[i].normal = (uint16_t)(i >> 16), leaves[i].colour = (uint16_t)i;
    *shape = (struct shape){.builder = {.instance = NULL}};
    shape->builder.instance = host_start(&shape->host, 2);
    assert_int_equal(order_runs(&shape->builder, leaves, count, FIRST, NULL, &shape->root), PBR_OK);
    for (size_t i = 0; i < shape->builder.run_count; i++) {
        const struct run *run = &shape->builder.runs[i];
        assert_int_equal(run->first, next);
        assert_true(run->count <= RUN && run->count >= (count < LEAST_RUN ? count : LEAST_RUN));
        next += run->count;
    }
    assert_int_equal(next, FIRST + count);
    check_below(&shape->builder, shape->root, &runs);
    assert_int_equal(runs, shape->builder.run_count);
    for (size_t i = 0; i < count; i++) seen[(size_t)leaves[i].normal << 16 | leaves[i].colour]++;
    for (size_t i = 0; i < count; i++) assert_int_equal(seen[i], 1);
    free(seen);
}

static void whole_trees_are_made_of_whole_trees(void **unused) {
    (void)unused;
    static const struct {
        size_t runs, branches;
        int children; /* of the root; all else has four */
    } cases[] = {{1, 0, 0}, {2, 1, 2}, {4, 1, 4}, {8, 3, 2}, {12, 4, 3}, {16, 5, 4}, {48, 16, 3}};
    uint64_t state = 1;
    for (size_t i = 0; i < COUNT(cases); i++) {
        const size_t count = cases[i].runs * RUN;
        struct leaf *leaves = make_leaves(count);
        struct shape shape;
        scatter(leaves, count, 0, 1, 0.01f, &state);
        order(&shape, leaves, count);
        assert_int_equal(shape.builder.run_count, cases[i].runs);
        assert_int_equal(shape.builder.branch_count, cases[i].branches);
        for (size_t b = 0; b < cases[i].branches; b++)
            assert_int_equal(shape.builder.branches[b].node.child_count, b + 1 < cases[i].branches ? 4 : cases[i].children);
        free_shape(&shape);
        free(leaves);
    }
}

/* One more than fits: a leaf of its own would have a sphere as large as all of the tree above it. */
static void no_run_is_few(void **unused) {
    (void)unused;
    static const size_t counts[] = {1,           2,           5,           RUN - 1,      RUN + 1,      2 * RUN + 1,
                                    4 * RUN + 1, 5 * RUN + 7, 9 * RUN + 1, 16 * RUN + 1, 16 * RUN + 99};
    uint64_t state = 2;
    for (size_t i = 0; i < COUNT(counts); i++) {
        struct leaf *leaves = make_leaves(counts[i]);
        struct shape shape;
        scatter(leaves, counts[i], 0, 1, 0.01f, &state);
        order(&shape, leaves, counts[i]);
        /* Not many more than there have to be. */
        assert_true(shape.builder.run_count <= 2 * (counts[i] / RUN + 1));
        free_shape(&shape);
        free(leaves);
    }
}

/* The widest gap always has next to nothing on one side: points twice as far out as the one before, before a crowd. */
static void a_comet_is_not_taken_apart_point_by_point(void **unused) {
    (void)unused;
    enum { TAIL = 60, COUNT_ALL = TAIL + 2 * RUN };
    struct leaf *leaves = make_leaves(COUNT_ALL);
    struct shape shape;
    uint64_t state = 3;
    scatter(leaves, COUNT_ALL, 0, 1e-3, 1e-9f, &state);
    for (int i = 0; i < TAIL; i++) leaves[i].sphere.centre[0] = ldexpf(1, i / 2 - 8);
    order(&shape, leaves, COUNT_ALL);
    free_shape(&shape);
    free(leaves);
}

/* Of two things apart, however many points each has. */
static void no_run_lies_on_both_sides_of_a_gap(void **unused) {
    (void)unused;
    static const size_t counts[][2] = {{3 * RUN + 5, RUN + 3}, {2 * RUN - 1, 9 * RUN + 2}, {RUN / 2 + 1, RUN / 2 + 3}};
    uint64_t state = 4;
    for (size_t i = 0; i < COUNT(counts); i++) {
        const size_t left = counts[i][0], right = counts[i][1];
        struct leaf *leaves = make_leaves(left + right);
        struct shape shape;
        scatter(leaves, left, 0, 1, 0.01f, &state);
        scatter(leaves + left, right, 5, 1, 0.01f, &state);
        order(&shape, leaves, left + right);
        for (size_t r = 0; r < shape.builder.run_count; r++) {
            const struct run *run = &shape.builder.runs[r];
            const struct leaf *first = leaves + (run->first - shape.builder.runs[0].first);
            for (size_t k = 1; k < run->count; k++) assert_true((first[k].sphere.centre[0] < 2) == (first[0].sphere.centre[0] < 2));
        }
        free_shape(&shape);
        free(leaves);
    }
}

static void subtrees_are_joined_in_order_by_fours(void **unused) {
    (void)unused;
    static const struct {
        size_t count, branches;
        int levels;
    } cases[] = {{1, 0, 0}, {2, 1, 1}, {4, 1, 1}, {5, 2, 2}, {9, 3, 2}, {16, 5, 2}, {17, 6, 3}, {65, 22, 4}};
    for (size_t i = 0; i < COUNT(cases); i++) {
        struct shape shape = {.builder = {.instance = NULL}};
        place roots[65];
        size_t runs = 0;
        shape.builder.instance = host_start(&shape.host, 1);
        for (size_t r = 0; r < cases[i].count; r++) roots[r] = TIP | (place)r;
        assert_int_equal(join_roots(&shape.builder, roots, cases[i].count), PBR_OK);
        assert_int_equal(shape.builder.branch_count, cases[i].branches);
        assert_int_equal(check_below(&shape.builder, roots[0], &runs), cases[i].levels);
        assert_int_equal(runs, cases[i].count);
        free_shape(&shape);
    }
}

/* ---- Within runs ---- */

static void swap(struct leaf *a, struct leaf *b) {
    const struct leaf t = *a;
    *a = *b;
    *b = t;
}

/* Even, in clumps, in steps that make ties, or in places that double; with radii that are all the same, any, or none. */
static void make_any(struct leaf *leaves, size_t count, int number, uint64_t *state) {
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            const double u = uniform(state);
            const double c[] = {u, floor(5 * u) + 1e-4 * uniform(state), floor(6 * u), ldexp(1, (int)(30 * u))};
            leaves[i].sphere.centre[k] = k < 2 ? (float)c[number % 4] : 0;
        }
        leaves[i].sphere.radius = (float)(number / 4 % 3 == 0 ? 1e-5 : number / 4 % 3 == 1 ? pow(10, -6 * uniform(state)) : 0);
        leaves[i].normal = (uint16_t)i;
    }
}

static int compare_numbers(const void *a, const void *b) {
    return ((const struct leaf *)a)->normal - ((const struct leaf *)b)->normal;
}

/* What out-of-core trees rest on: leaves that stay below the same child, whatever their order, are split where they were. */
static void what_was_split_is_split_there_again(void **unused) {
    (void)unused;
    enum { TRIES = 3000, MOST = 300 };
    uint64_t state = 5;
    int at_gaps = 0;
    for (int number = 0; number < TRIES; number++) {
        struct leaf leaves[MOST] = {0};
        const size_t count = 2 + (size_t)(uniform(&state) * uniform(&state) * (MOST - 2));
        size_t starts[QSPLAT_CHILDREN + 1], again[QSPLAT_CHILDREN + 1];
        make_any(leaves, count, number, &state);
        const uint32_t children = split_leaves(leaves, count, false, starts);
        assert_true(children >= 2 && children <= QSPLAT_CHILDREN && starts[0] == 0 && starts[children] == count);
        for (uint32_t c = 0; c < children; c++) {
            assert_true(starts[c] < starts[c + 1]);
            for (size_t i = starts[c]; i < starts[c + 1]; i++) {
                const double room = (double)(starts[c + 1] - i);
                swap(&leaves[i], &leaves[i + (size_t)(uniform(&state) * room)]);
            }
        }
        at_gaps += starts[1] % QSPLAT_CHILDREN != 0 && count > QSPLAT_CHILDREN;
        assert_int_equal(split_leaves(leaves, count, true, again), children);
        assert_memory_equal(again, starts, (children + 1) * sizeof *starts);
        qsort(leaves, count, sizeof *leaves, compare_numbers);
        for (size_t i = 0; i < count; i++) assert_int_equal(leaves[i].normal, i);
    }
    assert_true(at_gaps > TRIES / 20);
}

/* With an eighth of the leaves or more on either side, whatever their radii, as long as these are small beside the gap. */
static void leaves_are_split_at_gaps(void **unused) {
    (void)unused;
    static const size_t counts[][2] = {{3, 4}, {5, 11}, {13, 90}, {100, 101}, {1000, 3001}, {5, 250}};
    static const float radii[] = {0, 1e-4f, 0.01f, 10};
    uint64_t state = 6;
    for (size_t i = 0; i < COUNT(counts); i++)
        for (size_t r = 0; r < COUNT(radii); r++) {
            const size_t left = counts[i][0], right = counts[i][1], all = left + right;
            const bool parts = radii[r] < 1 && left >= all / 8;
            struct leaf *leaves = make_leaves(all);
            size_t starts[QSPLAT_CHILDREN + 1];
            bool is_border = false;
            scatter(leaves, left, 0, 1, radii[r], &state);
            scatter(leaves + left, right, 100, 1, radii[r], &state);
            if (!(radii[r] < 1)) leaves[0].sphere.radius = 0; /* is less than a quarter of them */
            for (uint32_t c = split_leaves(leaves, all, false, starts); c > 0; c--) is_border |= starts[c] == left;
            assert_int_equal(is_border, parts);
            free(leaves);
        }
}

/* Of evenly scattered points whose radii are far too small for what they are apart nearly none are cut out of turn. */
static void chance_makes_no_gaps(void **unused) {
    (void)unused;
    enum { TRIES = 4000 };
    uint64_t state = 7;
    int cuts = 0;
    for (int number = 0; number < TRIES; number++) {
        static const size_t counts[] = {16, 64};
        struct leaf leaves[64] = {0};
        const size_t count = counts[number % 2];
        const size_t usual[] = {0, count / 4, count / 2, 3 * count / 4, count};
        size_t starts[QSPLAT_CHILDREN + 1];
        scatter(leaves, count, 0, 1, 1e-7f, &state);
        cuts += split_leaves(leaves, count, false, starts) != QSPLAT_CHILDREN || memcmp(starts, usual, sizeof usual) != 0;
    }
    /* Of 16 a gap of half their box: 13 (1/2)^14 = 0.1 %; of the 8 on either side one of 0.7 of it: 7 (0.3)^6 = 0.5 % each. */
    assert_true(cuts < TRIES / 100);
}

/* ---- Selection ---- */

/* Of places in many shapes of order: none that is chosen is beyond one that is not, and each leaf is still there once. */
static void check_selection(size_t count, size_t rank, int shape, int usual_looks, uint64_t *state) {
    struct leaf *leaves = make_leaves(count);
    uint8_t *seen = calloc(count, 1);
    assert_non_null(seen);
    float most = -FLT_MAX;
    for (size_t i = 0; i < count; i++) {
        const float at[] = {(float)uniform(state), (float)i, -(float)i,          (float)(i < count / 2 ? i : count - i),
                            (float)(i % 7),        0.25f,    (float)(i % 2 * i), (float)(int)(3 * uniform(state))};
        leaves[i].sphere.centre[1] = at[shape];
        leaves[i].normal = (uint16_t)i;
    }
    select_least(leaves, count, rank, 1, usual_looks);
    for (size_t i = 0; i < rank; i++) most = leaves[i].sphere.centre[1] > most ? leaves[i].sphere.centre[1] : most;
    for (size_t i = 0; i < count; i++) {
        assert_true(i < rank || leaves[i].sphere.centre[1] >= most);
        assert_true(!seen[leaves[i].normal]++);
    }
    free(seen);
    free(leaves);
}

static void the_least_come_first_in_every_order(void **state) {
    (void)state;
    static const size_t COUNTS[] = {1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 24, 25, 26, 131, 1023, 1024, 5000};
    uint64_t random = 7;
    for (size_t c = 0; c < sizeof COUNTS / sizeof *COUNTS; c++)
        for (int shape = 0; shape < 8; shape++)
            for (int sure = 0; sure < 2; sure++)
                for (size_t i = 0; i < 5; i++) {
                    const size_t n = COUNTS[c], ranks[] = {0, n - 1, n / 2, n / 8, (size_t)(uniform(&random) * (double)n)};
                    check_selection(n, ranks[i], shape, sure ? 0 : USUAL_LOOKS, &random);
                }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(whole_trees_are_made_of_whole_trees),
                                       cmocka_unit_test(no_run_is_few),
                                       cmocka_unit_test(a_comet_is_not_taken_apart_point_by_point),
                                       cmocka_unit_test(no_run_lies_on_both_sides_of_a_gap),
                                       cmocka_unit_test(subtrees_are_joined_in_order_by_fours),
                                       cmocka_unit_test(what_was_split_is_split_there_again),
                                       cmocka_unit_test(leaves_are_split_at_gaps),
                                       cmocka_unit_test(the_least_come_first_in_every_order),
                                       cmocka_unit_test(chance_makes_no_gaps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
