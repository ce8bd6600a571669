/* QSplat trees and their files, against a reader of its own (qs_oracle.h). SPDX-License-Identifier: MIT */
#include "qs_trees.h"

/* Largest error of a normal's code, radians: of the corners of the cells at the middle of a face (codes_... below shows it). */
static const double NORMAL_ERROR = 0.0487;

static const struct kind kinds[] = {
    {"1 point", SPHERE, 1, 0},
    {"2 points", SPHERE, 2, 0},
    {"3 points", SPHERE, 3, 0},
    {"4 points", SPHERE, 4, 0},
    {"5 points", SPHERE, 5, 0},
    {"16 points", SPHERE, 16, 0},
    {"17 points", SPHERE, 17, 0},
    {"1 point without radius", SPHERE, 1, ZERO_RADII},
    {"2 points without radii", SPHERE, 2, ZERO_RADII},
    {"a sphere", SPHERE, 1000, 0},
    {"a plane", PLANE, 1000, 0},
    {"a plane of even size", PLANE, 4096, 0},
    {"a plate of two sides", PLANE, 70000, TWO_SIDES},
    {"a torus", TORUS, 1000, 0},
    {"points in one place", COINCIDENT, 300, 0},
    {"points in one place without radii", COINCIDENT, 300, ZERO_RADII},
    {"points in one place without radii and colours", COINCIDENT, 257, ZERO_RADII | NO_COLOURS},
    {"a line", LINE, 1000, 0},
    {"two far clusters", CLUSTERS, 1000, 0},
    {"two far clusters without radii", CLUSTERS, 1000, ZERO_RADII},
    {"a sphere without radii", SPHERE, 1000, ZERO_RADII},
    {"a sphere with one huge radius", SPHERE, 1000, ONE_HUGE},
    {"a sphere without normals", SPHERE, 1000, NO_NORMALS},
    {"a sphere with some normals", SPHERE, 1000, SOME_NORMALS},
    {"a sphere with any normals", SPHERE, 1000, RANDOM_NORMALS},
    {"a sphere without colours", SPHERE, 1000, NO_COLOURS},
    {"a sphere without normals and colours", SPHERE, 1000, NO_NORMALS | NO_COLOURS},
    {"a survey", TORUS, 1000, SURVEY},
    {"a survey as small as a float's step", TORUS, 1000, SMALL_SURVEY},
    {"a large sphere", SPHERE, 65537, 0},
    {"a large sphere without colours", SPHERE, 65537, NO_COLOURS},
    {"a large plane", PLANE, 65537, NO_COLOURS},
    {"a large torus", TORUS, 100000, 0},
    {"a large survey", TORUS, 65537, SURVEY},
    {"islands", ISLANDS, 10007, 0},
    {"large islands", ISLANDS, 70009, 0},
    {"islands without radii", ISLANDS, 10007, ZERO_RADII},
};

/* A hierarchy, and what was written of it as QSplat 11. */
struct built {
    pbr_instance *instance;
    struct host *host;
    struct folder folder;
    const struct kind *kind;
    struct surface surface;
    pbr_lod *lod;
    struct image image;
    struct qs_tree tree;
    double shift[3]; /* what the file's centre, which is of floats, is off */
};

static struct built build(struct host *host, pbr_instance *instance, const struct kind *kind) {
    struct built built = {.host = host, .instance = instance, .folder = make_folder(), .kind = kind, .surface = make_surface(kind)};
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    built.lod = surface_lod(instance, &built.surface);
    built.image = save_image(built.lod, &built.folder, PBR_LOD_FILE_QS);
    built.tree = read_tree_of(kind->name, &built.image);
    assert_int_equal(pbr_lod_get_info(built.lod, &info), PBR_OK);
    for (int k = 0; k < 3; k++) {
        built.shift[k] = built.tree.nodes[0].centre[k] - info.centre[k];
        if (fabs(built.shift[k]) > fabs(info.centre[k]) * 0x1.001p-24)
            fail_msg("%s: the root's centre is %g off", kind->name, built.shift[k]);
    }
    return built;
}

static void release(struct built *built) {
    pbr_lod_release(&built->lod);
    free_surface(&built->surface);
    free(built->image.data);
    qs_free(&built->tree);
    remove_folder(&built->folder);
}

static void for_each_kind(void (*check)(struct built *built)) {
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct built built = build(&host, instance, &kinds[i]);
        check(&built);
        release(&built);
    }
    assert_int_equal(host.messages, 0);
    host_stop(&host, instance);
}

/* ---- Codes ---- */

static void the_table_of_spheres_has_7621_codes(void **unused) {
    (void)unused;
    assert_true(qs_sphere_of(QS_SPHERE_CODES - 1).radius == 1); /* filling it counts */
    assert_true(qs_sphere_of(0).radius == 1.0 / 13);
    assert_true(qs_sphere_of(QS_SPHERE_CODES).radius == 0);
}

static double angle_between(const double a[3], const double b[3]) {
    double cross[3];
    cross3(a, b, cross);
    return atan2(length3(cross), dot3(a, b)); /* exact near 0, which acos is not */
}

static void codes_of_normals_are_off_by_0_0487_at_most_and_0_0152_on_average(void **unused) {
    (void)unused;
    enum { SAMPLES = 1000000 };
    uint64_t state = 5;
    double sum = 0, largest = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double normal[3], decoded[3];
        random_direction(&state, normal);
        qs_normal_of(qs_normal_code_of(normal), decoded);
        const double error = angle_between(normal, decoded);
        sum += error;
        largest = fmax(largest, error);
    }
    assert_true(largest <= NORMAL_ERROR);
    assert_true(sum / SAMPLES <= 0.0152);
}

/* ---- Points and leaves ---- */

/* What a point must find its own leaf by. */
struct sought {
    const struct qs_tree *tree;
    const bool *taken;
    double position[3], radius, tolerance;
    const float *normal;   /* NULL = any */
    const uint8_t *colour; /* NULL = any */
};

static bool is_that_leaf(void *user, size_t number) {
    const struct sought *sought = user;
    const struct qs_node *node = &sought->tree->nodes[number];
    if (node->children > 0 || sought->taken[number]) return false;
    if (distance3(node->centre, sought->position) > sought->tolerance) return false;
    if (fabs(node->radius - sought->radius) > sought->tolerance) return false;
    /* Points hold normals in 2 x 16 bits, 6.5e-5 off at most. */
    for (int k = 0; sought->normal && k < 3; k++)
        if (fabs((double)sought->normal[k] - node->normal[k]) > 1e-3) return false;
    return !sought->colour || memcmp(sought->colour, node->colour, 3) == 0;
}

struct copied {
    pbr_points_info info;
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
};

/* The leaves of a hierarchy, in its order. */
static struct copied copy_leaves(const pbr_lod *lod) {
    struct copied copied = {.info = PBR_POINTS_INFO_INIT};
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    pbr_points *points = NULL;
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &points), PBR_OK);
    assert_int_equal(pbr_points_get_info(points, &copied.info), PBR_OK);
    const size_t count = (size_t)copied.info.count;
    copied.positions = calloc(count, sizeof *copied.positions);
    copied.normals = calloc(count, sizeof *copied.normals);
    copied.radii = calloc(count, sizeof *copied.radii);
    copied.colours = calloc(count, sizeof *copied.colours);
    assert_true(copied.positions && copied.normals && copied.radii && copied.colours);
    copy.positions = *copied.positions;
    copy.normals = copied.info.has_normals ? *copied.normals : NULL;
    copy.colours = copied.info.has_colours ? *copied.colours : NULL;
    copy.radii = copied.radii;
    assert_int_equal(pbr_points_copy(points, 0, count, &copy), PBR_OK);
    pbr_points_release(&points);
    return copied;
}

static void free_copied(struct copied *copied) {
    free(copied->positions);
    free(copied->normals);
    free(copied->radii);
    free(copied->colours);
}

/* Every leaf is a point and every point a leaf. `shift` is added to the points. */
static void compare_leaves(const char *name, const pbr_lod *lod, const struct qs_tree *tree, const double shift[3], bool normals) {
    struct copied points = copy_leaves(lod);
    struct finder finder = make_finder(tree);
    bool *taken = calloc(tree->count, 1);
    assert_non_null(taken);
    assert_int_equal(points.info.count, tree->leaves);
    assert_int_equal(points.info.has_colours, tree->colours);
    if (normals) assert_true(points.info.has_normals);
    for (size_t i = 0; i < tree->leaves; i++) {
        struct sought sought = {.tree = tree, .taken = taken, .radius = (double)points.radii[i]};
        for (int k = 0; k < 3; k++) sought.position[k] = points.positions[i][k] + shift[k];
        sought.tolerance = sphere_tolerance(tree);
        sought.normal = normals ? points.normals[i] : NULL;
        sought.colour = tree->colours ? points.colours[i] : NULL;
        const size_t leaf = find_node(&finder, sought.position, sought.tolerance, is_that_leaf, &sought);
        if (leaf == tree->count)
            fail_msg("%s: no leaf is point %zu at %g %g %g, radius %g", name, i, sought.position[0], sought.position[1],
                     sought.position[2], sought.radius);
        taken[leaf] = true;
    }
    free(taken);
    free(finder.places);
    free_copied(&points);
}

static void compare_statistics(const char *name, const pbr_lod *lod, const struct qs_tree *tree) {
    pbr_lod_statistics got = PBR_LOD_STATISTICS_INIT, wanted = PBR_LOD_STATISTICS_INIT;
    uint64_t cones = 0;
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &got), PBR_OK);
    for (size_t i = 0; i < tree->count; i++) {
        const struct qs_node *node = &tree->nodes[i];
        wanted.level_nodes[node->level < PBR_LOD_LEVELS ? node->level : PBR_LOD_LEVELS - 1]++;
        if (node->children > 0) wanted.children[node->children]++;
        else wanted.leaf_radius_mean += node->radius / (double)tree->leaves;
        if (node->cone >= 0) wanted.cones[node->cone]++;
        wanted.overhang_largest = fmax(wanted.overhang_largest, node->overhang);
    }
    if (got.nodes != tree->count || got.leaves != tree->leaves || got.levels != tree->levels)
        fail_msg("%s: %llu nodes, %llu leaves, %llu levels; not %zu, %zu, %zu", name, (unsigned long long)got.nodes,
                 (unsigned long long)got.leaves, (unsigned long long)got.levels, tree->count, tree->leaves, tree->levels);
    assert_memory_equal(got.level_nodes, wanted.level_nodes, sizeof wanted.level_nodes);
    assert_memory_equal(got.children, wanted.children, sizeof wanted.children);
    for (int i = 0; i < 4; i++) {
        assert_in_range(got.cones[i], wanted.cones[i], wanted.cones[i] + 1); /* the root's is not in the file */
        cones += got.cones[i];
    }
    assert_in_range(cones, tree->count - 1, tree->count);
    assert_true(fabs(got.leaf_radius_mean - wanted.leaf_radius_mean) <= sphere_tolerance(tree));
    assert_true(fabs(got.overhang_largest - wanted.overhang_largest) <= 1e-3); /* of floats: small nodes far from the centre */
    assert_true(got.overhang_mean >= 0 && got.overhang_mean <= got.overhang_largest);
    assert_int_equal(got.damaged, 0);
}

/* ---- Files by the original program ---- */

static void compare_file(const char *file, uint32_t flags) {
    struct host host;
    char path[4096];
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    data_path(path, file);
    pbr_instance *instance = host_start(&host, 2);
    struct image image = load_image(path);
    struct qs_tree tree = read_tree_of(file, &image);
    pbr_lod *lod = open_lod(instance, path, flags);
    assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
    assert_int_equal(info.kind, PBR_LOD_QSPLAT);
    assert_int_equal(info.file_format, PBR_LOD_FILE_QS);
    assert_int_equal(info.point_count, tree.leaves);
    assert_int_equal(info.has_colours, tree.colours);
    assert_int_equal(info.is_mapped, !(flags & PBR_LOD_OPEN_READ));
    /* "A sphere around all splats": codes let children reach out of the root's. */
    assert_true(distance3(info.centre, tree.nodes[0].centre) <= sphere_tolerance(&tree));
    for (size_t i = 0; i < tree.count; i++)
        if (tree.nodes[i].children == 0)
            assert_true(distance3(tree.nodes[i].centre, info.centre) + tree.nodes[i].radius <=
                        info.radius + sphere_tolerance(&tree));
    compare_leaves(file, lod, &tree, (const double[3]){0, 0, 0}, true);
    compare_statistics(file, lod, &tree);
    pbr_lod_release(&lod);
    qs_free(&tree);
    free(image.data);
    assert_int_equal(host.messages, 0);
    host_stop(&host, instance);
}

static void the_originals_bunny_has_the_leaves_of_its_file(void **unused) {
    (void)unused;
    compare_file("bunny.qs", 0);
}

static void the_originals_coloured_bunny_has_the_leaves_of_its_file(void **unused) {
    (void)unused;
    compare_file("bunny_colour.qs", PBR_LOD_OPEN_READ);
}

static void the_originals_dragon_has_the_leaves_of_its_file(void **unused) {
    (void)unused;
    compare_file("dragon.qs", 0);
}

/* The original's trees go through a save unchanged, and its comments are no tree. */
static void the_originals_bunny_is_saved_as_it_was(void **unused) {
    (void)unused;
    static const uint8_t comment[] = "QSplat11\0\0\0\x18\0\0\0\0\0\0\0\2hey"; /* 24 bytes with the end */
    struct host host;
    char path[4096];
    data_path(path, "bunny_colour.qs");
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    struct image image = load_image(path), both = {malloc(image.size + 48), image.size + 48};
    assert_non_null(both.data);
    memcpy(both.data, comment, 24);
    memcpy(both.data + 24, image.data, image.size);
    memcpy(both.data + 24 + image.size, comment, 24);
    store_image(folder.other, both.data, both.size);
    pbr_lod *lod = open_lod(instance, folder.other, 0);
    assert_int_equal(pbr_lod_save(lod, folder.file, PBR_LOD_FILE_QS, NULL, NULL), PBR_OK);
    pbr_lod_release(&lod);
    struct image saved = load_image(folder.file);
    struct qs_tree before = read_tree_of("before", &both), after = read_tree_of("after", &saved);
    assert_int_equal(before.count, after.count);
    for (size_t i = 0; i < before.count; i++) {
        const struct qs_node *a = &before.nodes[i], *b = &after.nodes[i];
        assert_true(a->sphere_code == b->sphere_code && a->normal_code == b->normal_code && a->cone == b->cone);
        assert_true(a->children == b->children && a->first_child == b->first_child);
        assert_memory_equal(a->colour, b->colour, 3);
    }
    qs_free(&before);
    qs_free(&after);
    free(image.data);
    free(both.data);
    free(saved.data);
    remove_folder(&folder);
    host_stop(&host, instance);
}

/* ---- Trees that are built ---- */

/* The nodes that a point's leaf may be: those reached from the root through spheres that hold the point's own. */
struct candidates {
    size_t *leaves, count, capacity;
};

static bool holds(const struct built *built, const struct qs_node *node, const double position[3], double radius) {
    return distance3(node->centre, position) + radius <= node->radius * (1 + 1e-6) + sphere_tolerance(&built->tree);
}

static bool keeps_attributes(const struct built *built, const struct qs_node *node, size_t point) {
    double normal[3];
    for (int k = 0; k < 3; k++) normal[k] = (double)built->surface.normals[point][k];
    const bool has_normal = length3(normal) > 0 && !(built->kind->flags & NO_NORMALS);
    /* The points' own 6.5e-5 beside the code's error. */
    if (has_normal && angle_between(normal, node->normal) > NORMAL_ERROR + 1e-4) return false;
    for (int k = 0; k < 3 && !(built->kind->flags & NO_COLOURS); k++)
        if (abs(node->colour[k] - built->surface.colours[point][k]) > (k == 1 ? 4 : 8)) return false; /* a step of 6, 5 bits */
    return true;
}

static void descend(const struct built *built, size_t number, size_t point, const double position[3],
                    struct candidates *candidates) {
    const struct qs_node *node = &built->tree.nodes[number];
    if (!holds(built, node, position, (double)built->surface.radii[point])) return;
    for (int i = 0; i < node->children; i++) descend(built, node->first_child + (size_t)i, point, position, candidates);
    if (node->children > 0 || !keeps_attributes(built, node, point)) return;
    if (candidates->count == candidates->capacity) {
        candidates->capacity = 2 * candidates->capacity + 8;
        candidates->leaves = realloc(candidates->leaves, candidates->capacity * sizeof *candidates->leaves);
        assert_non_null(candidates->leaves);
    }
    candidates->leaves[candidates->count++] = number;
}

/* A matching of points and leaves along augmenting paths (Kuhn 1955). */
struct matching {
    struct candidates *candidates; /* of each point */
    size_t *owners;                /* of each node, 1 + a point; 0 = none */
    size_t *asked;                 /* of each node: for which point last, as owners */
};

static bool find_leaf(const struct matching *matching, size_t point, size_t round) {
    const struct candidates *own = &matching->candidates[point];
    for (size_t i = 0; i < own->count; i++)
        if (!matching->owners[own->leaves[i]]) {
            matching->owners[own->leaves[i]] = 1 + point;
            return true;
        }
    for (size_t i = 0; i < own->count; i++) {
        const size_t leaf = own->leaves[i];
        if (matching->asked[leaf] == round) continue;
        matching->asked[leaf] = round;
        if (!find_leaf(matching, matching->owners[leaf] - 1, round)) continue;
        matching->owners[leaf] = 1 + point;
        return true;
    }
    return false;
}

static void check_spheres(struct built *built) {
    enum { MATCHED = 1000 }; /* in larger trees a leaf for each point will do */
    const size_t count = built->kind->count;
    struct matching matching = {calloc(count, sizeof *matching.candidates), calloc(built->tree.count, sizeof(size_t)),
                                calloc(built->tree.count, sizeof(size_t))};
    assert_true(matching.candidates && matching.owners && matching.asked);
    assert_int_equal(built->tree.leaves, count);
    for (size_t i = 0; i < count; i++) {
        double position[3];
        for (int k = 0; k < 3; k++) position[k] = built->surface.positions[i][k] + built->shift[k];
        descend(built, 0, i, position, &matching.candidates[i]);
        if (matching.candidates[i].count == 0)
            fail_msg("%s: no leaf, or not each sphere above one, holds point %zu", built->kind->name, i);
        if (count <= MATCHED && !find_leaf(&matching, i, 1 + i))
            fail_msg("%s: the leaves that hold point %zu are other points'", built->kind->name, i);
    }
    for (size_t i = 0; i < count; i++) free(matching.candidates[i].leaves);
    free(matching.candidates);
    free(matching.owners);
    free(matching.asked);
}

static void every_point_lies_in_a_leaf_and_in_all_spheres_above_it(void **unused) {
    (void)unused;
    for_each_kind(check_spheres);
}

static void check_children(struct built *built) {
    size_t inner = 0;
    for (size_t i = 0; i < built->tree.count; i++) {
        const struct qs_node *node = &built->tree.nodes[i];
        for (int k = 0; k < 3; k++) assert_true(isfinite(node->centre[k]));
        assert_true(isfinite(node->radius) && node->radius >= 0);
        inner += node->children > 0;
        if (node->children == 1 && built->kind->count > 1) fail_msg("%s: a single child", built->kind->name);
    }
    const double average = (double)(built->tree.count - 1) / (double)inner;
    if (built->kind->count > 10000 && average <= 3.4) fail_msg("%s: %g children on average", built->kind->name, average);
    /* Any tree of 2 to 4 children over points that halve in space: far less than one level a point. */
    if (built->tree.levels > 64) fail_msg("%s: %zu levels", built->kind->name, built->tree.levels);
}

static void inner_nodes_have_two_to_four_children_and_nearly_four_on_average(void **unused) {
    (void)unused;
    for_each_kind(check_children);
}

/* Splats are drawn as large as the codes make them. Four neighbours of about their spacing in size have a parent some three times
 * theirs; a code's centre is off by sqrt(3) / 13 of its radius at most, by half of that on average, and twice where it is off the
 * disc's plane; and the parent has grown, too. Nor is any leaf far above that, not even where points are few beside others, or on
 * both sides of a gap: a group of siblings that a gap runs through has no code below a 26th of it, here 500 times what is asked
 * for. From islands' distance to their points' size it is a factor of 10,000, in six levels of codes that are in practice some five
 * times smaller than what is above them. */
static void check_growth(struct built *built) {
    double given = 0, coded = 0, largest_given = 0, largest = 0;
    for (size_t i = 0; i < built->kind->count; i++) {
        given += (double)built->surface.radii[i];
        largest_given = fmax(largest_given, (double)built->surface.radii[i]);
    }
    for (size_t i = 0; i < built->tree.count; i++)
        if (built->tree.nodes[i].children == 0) {
            coded += built->tree.nodes[i].radius;
            largest = fmax(largest, built->tree.nodes[i].radius);
        }
    if (built->kind->count <= 10000) return;
    if (built->kind->flags & ZERO_RADII)
        largest_given = 2 / sqrt((double)built->kind->count), given = largest_given * (double)built->kind->count;
    if (coded > 1.8 * given) fail_msg("%s: leaves are %g times as large as their points", built->kind->name, coded / given);
    if (largest > (built->kind->shape == ISLANDS ? 10 : 3) * largest_given)
        fail_msg("%s: a leaf is %g times as large as the largest point", built->kind->name, largest / largest_given);
}

static void leaves_are_hardly_larger_than_their_points(void **unused) {
    (void)unused;
    for_each_kind(check_growth);
}

/* Codes 0 to 2 are real cones; where normals are missing nothing is known of what the leaf's code says. */
static void check_cones(struct built *built) {
    if (built->kind->flags & (NO_NORMALS | SOME_NORMALS)) return;
    for (size_t i = 1; i < built->tree.count; i++) {
        const struct qs_node *leaf = &built->tree.nodes[i];
        if (leaf->children > 0) continue;
        for (size_t above = leaf->parent; above != 0; above = built->tree.nodes[above].parent) {
            const struct qs_node *node = &built->tree.nodes[above];
            const double angle = angle_between(leaf->normal, node->normal);
            if (angle > qs_cone_of(node->cone) + 1e-6) /* the library's floats */
                fail_msg("%s: a leaf's normal is %g beside a cone of code %d", built->kind->name, angle, node->cone);
        }
    }
}

static void every_normal_lies_in_all_cones_above_it(void **unused) {
    (void)unused;
    for_each_kind(check_cones);
}

static void check_size(struct built *built) {
    const double bytes = (double)built->image.size / (double)built->kind->count;
    if (built->kind->count > 10000 && bytes > (built->tree.colours ? 10 : 6.7))
        fail_msg("%s: %g bytes a point", built->kind->name, bytes);
    assert_int_equal(built->tree.colours, !(built->kind->flags & NO_COLOURS));
}

static void a_file_takes_6_7_bytes_a_point_and_10_with_colours(void **unused) {
    (void)unused;
    for_each_kind(check_size);
}

static void check_info(struct built *built) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    assert_int_equal(pbr_lod_get_info(built->lod, &info), PBR_OK);
    assert_int_equal(info.kind, PBR_LOD_QSPLAT);
    assert_int_equal(info.file_format, PBR_LOD_FILE_NONE);
    assert_int_equal(info.point_count, built->kind->count);
    assert_int_equal(info.has_colours, built->tree.colours);
    assert_int_equal(info.is_mapped, 0);
    for (size_t i = 0; i < built->kind->count; i++)
        if (distance3(built->surface.positions[i], info.centre) + (double)built->surface.radii[i] > info.radius * (1 + 1e-6))
            fail_msg("%s: point %zu is outside the sphere around all", built->kind->name, i);
    /* Not much more than that, else nothing is ever culled: quantised leaves may double the smallest sphere. */
    double farthest = 0;
    for (size_t i = 0; i < built->kind->count; i++)
        farthest = fmax(farthest, distance3(built->surface.positions[i], info.centre) + (double)built->surface.radii[i]);
    if (!(info.radius <= 2 * farthest + 0x1p-22 * length3(info.centre)))
        fail_msg("%s: radius %g around points within %g", built->kind->name, info.radius, farthest);
}

static void the_sphere_around_all_is_around_all(void **unused) {
    (void)unused;
    for_each_kind(check_info);
}

static bool has_normals(const struct kind *kind) {
    return !(kind->flags & (NO_NORMALS | SOME_NORMALS));
}

static void check_leaves(struct built *built) {
    compare_leaves(built->kind->name, built->lod, &built->tree, built->shift, has_normals(built->kind));
    compare_statistics(built->kind->name, built->lod, &built->tree);
}

static void leaves_in_memory_are_those_of_the_file(void **unused) {
    (void)unused;
    for_each_kind(check_leaves);
}

/* ---- Round trips ---- */

static void check_qs_round_trip(struct built *built) {
    pbr_lod *lod = open_lod(built->instance, built->folder.file, built->kind->count % 2 ? PBR_LOD_OPEN_READ : 0);
    compare_leaves(built->kind->name, lod, &built->tree, (const double[3]){0, 0, 0}, has_normals(built->kind));
    compare_statistics(built->kind->name, lod, &built->tree);
    /* Onto the file that it may be mapped from. */
    assert_int_equal(pbr_lod_save(lod, built->folder.file, PBR_LOD_FILE_QS, NULL, NULL), PBR_OK);
    pbr_lod_release(&lod);
    struct image again = load_image(built->folder.file);
    if (again.size != built->image.size || memcmp(again.data, built->image.data, again.size) != 0)
        fail_msg("%s: a QSplat file changes when it is opened and saved", built->kind->name);
    free(again.data);
}

static void a_qsplat_file_opened_and_saved_is_the_same(void **unused) {
    (void)unused;
    for_each_kind(check_qs_round_trip);
}

static void expect_same_leaves(const char *name, const pbr_lod *a, const pbr_lod *b) {
    struct copied left = copy_leaves(a), right = copy_leaves(b);
    const size_t count = (size_t)left.info.count;
    assert_int_equal(left.info.count, right.info.count);
    assert_int_equal(left.info.has_normals, right.info.has_normals);
    assert_int_equal(left.info.has_colours, right.info.has_colours);
    if (memcmp(left.positions, right.positions, count * sizeof *left.positions) != 0 ||
        memcmp(left.normals, right.normals, count * sizeof *left.normals) != 0 ||
        memcmp(left.radii, right.radii, count * sizeof *left.radii) != 0 ||
        memcmp(left.colours, right.colours, count * sizeof *left.colours) != 0)
        fail_msg("%s: other leaves", name);
    free_copied(&left);
    free_copied(&right);
}

static void check_container(struct built *built) {
    pbr_lod_info info = PBR_LOD_INFO_INIT, before = PBR_LOD_INFO_INIT;
    struct image container = save_image(built->lod, &built->folder, PBR_LOD_FILE_PBR);
    for (int mapped = 0; mapped < 2; mapped++) {
        pbr_lod *lod = open_lod(built->instance, built->folder.file, mapped ? 0 : PBR_LOD_OPEN_READ);
        assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
        assert_int_equal(pbr_lod_get_info(built->lod, &before), PBR_OK);
        assert_int_equal(info.file_format, PBR_LOD_FILE_PBR);
        assert_int_equal(info.is_mapped, mapped);
        assert_memory_equal(info.centre, before.centre, sizeof info.centre); /* doubles, so surveys keep theirs */
        assert_true(fabs(info.radius - before.radius) <= 0);
        expect_same_leaves(built->kind->name, built->lod, lod);
        compare_statistics(built->kind->name, lod, &built->tree);
        struct image qs = {0};
        assert_int_equal(pbr_lod_save(lod, built->folder.other, PBR_LOD_FILE_QS, NULL, NULL), PBR_OK);
        qs = load_image(built->folder.other);
        assert_int_equal(qs.size, built->image.size);
        assert_memory_equal(qs.data, built->image.data, qs.size);
        free(qs.data);
        pbr_lod_release(&lod);
        unlink(built->folder.other);
    }
    free(container.data);
}

static void a_container_holds_the_same_tree(void **unused) {
    (void)unused;
    for_each_kind(check_container);
}

static void a_tree_is_the_same_on_every_run_and_number_of_threads(void **unused) {
    (void)unused;
    static const uint32_t threads[] = {1, 1, 4, 3};
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct image first[2] = {{0}, {0}};
        for (size_t run = 0; run < COUNT(threads); run++) {
            struct host host;
            pbr_instance *instance = host_start(&host, threads[run]);
            struct folder folder = make_folder();
            struct surface surface = make_surface(&kinds[i]);
            pbr_lod *lod = surface_lod(instance, &surface);
            for (uint32_t form = 0; form < 2; form++) {
                struct image image = save_image(lod, &folder, form ? PBR_LOD_FILE_QS : PBR_LOD_FILE_PBR);
                if (run == 0) {
                    first[form] = image;
                    continue;
                }
                if (image.size != first[form].size || memcmp(image.data, first[form].data, image.size) != 0)
                    fail_msg("%s: other bytes with %u threads", kinds[i].name, threads[run]);
                free(image.data);
            }
            pbr_lod_release(&lod);
            free_surface(&surface);
            remove_folder(&folder);
            host_stop(&host, instance);
        }
        free(first[0].data);
        free(first[1].data);
    }
}

static void no_points_make_an_empty_hierarchy(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct folder folder = make_folder();
    pbr_points_desc empty = PBR_POINTS_DESC_INIT;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_points *points = NULL;
    pbr_lod *lod = NULL;
    assert_int_equal(pbr_points_create(instance, &empty, &points), PBR_OK);
    desc.points = points;
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
    pbr_points_release(&points);
    for (uint32_t form = PBR_LOD_FILE_NONE; form <= PBR_LOD_FILE_QS; form++) {
        pbr_lod_info info = PBR_LOD_INFO_INIT;
        pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
        pbr_lod *opened = NULL;
        if (form) assert_int_equal(pbr_lod_save(lod, folder.file, form, NULL, NULL), PBR_OK);
        opened = form ? open_lod(instance, folder.file, 0) : pbr_lod_retain(lod);
        assert_int_equal(pbr_lod_get_info(opened, &info), PBR_OK);
        assert_int_equal(info.point_count, 0);
        assert_true(fabs(info.radius) <= 0);
        assert_int_equal(pbr_lod_measure(opened, NULL, NULL, &statistics), PBR_OK);
        assert_int_equal(statistics.leaves, 0);
        struct copied leaves = copy_leaves(opened);
        assert_int_equal(leaves.info.count, 0);
        free_copied(&leaves);
        pbr_lod_release(&opened);
    }
    pbr_lod_release(&lod);
    remove_folder(&folder);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_table_of_spheres_has_7621_codes),
                                       cmocka_unit_test(codes_of_normals_are_off_by_0_0487_at_most_and_0_0152_on_average),
                                       cmocka_unit_test(the_originals_bunny_has_the_leaves_of_its_file),
                                       cmocka_unit_test(the_originals_coloured_bunny_has_the_leaves_of_its_file),
                                       cmocka_unit_test(the_originals_dragon_has_the_leaves_of_its_file),
                                       cmocka_unit_test(the_originals_bunny_is_saved_as_it_was),
                                       cmocka_unit_test(every_point_lies_in_a_leaf_and_in_all_spheres_above_it),
                                       cmocka_unit_test(inner_nodes_have_two_to_four_children_and_nearly_four_on_average),
                                       cmocka_unit_test(leaves_are_hardly_larger_than_their_points),
                                       cmocka_unit_test(every_normal_lies_in_all_cones_above_it),
                                       cmocka_unit_test(a_file_takes_6_7_bytes_a_point_and_10_with_colours),
                                       cmocka_unit_test(the_sphere_around_all_is_around_all),
                                       cmocka_unit_test(leaves_in_memory_are_those_of_the_file),
                                       cmocka_unit_test(a_qsplat_file_opened_and_saved_is_the_same),
                                       cmocka_unit_test(a_container_holds_the_same_tree),
                                       cmocka_unit_test(a_tree_is_the_same_on_every_run_and_number_of_threads),
                                       cmocka_unit_test(no_points_make_an_empty_hierarchy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
