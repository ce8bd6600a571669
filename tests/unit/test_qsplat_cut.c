/* The cut of a QSplat tree, against a walk over all nodes of its file. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include "../turned.h"
#include "cameras.h"
#include "lod/cut.h"

/* The sanitizers look at memory and threads, which are used alike in all views. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { VIEWS = 18 };
#else
enum { VIEWS = 48 };
#endif

/* Pixels; the last so that trees of few points have inner nodes below it. */
static const double thresholds[] = {0, 0.5, 1, 2, 8, 50};

/* Decisions that a rounding error may turn: the library computes with floats. */
static const double SIZE_TOLERANCE = 1e-4;
/* Of the cosine of normal and view: 6.5e-5 of the record's normal, and floats. */
static const double FACING_TOLERANCE = 1e-3;

/* A hierarchy, and its nodes relative to its origin, as records are. */
struct scene {
    const char *name;
    struct host *host;
    pbr_instance *instance;
    struct folder folder; /* of its file */
    pbr_lod *lod;
    struct qs_tree tree;
    struct finder finder;
    enum { NONE, SOME, ALL } normals; /* which nodes have one */
    long emitted, inner, culled;      /* over all cuts */
    long between, outside_pixels;     /* of those: said to lie between the pixels' centres, and do so */
};

/* What a cut did with each node. */
struct fates {
    bool *emitted, *below; /* itself, one above */
};

static void finish_scene(struct scene *scene, const struct image *image) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    double root[3];
    scene->tree = read_tree_of(scene->name, image);
    memcpy(root, scene->tree.nodes[0].centre, sizeof root);
    assert_int_equal(pbr_lod_get_info(scene->lod, &info), PBR_OK);
    /* A built tree has a double centre, its file the float beside. */
    if (info.file_format == PBR_LOD_FILE_QS) memcpy(root, lod_origin(scene->lod), sizeof root);
    for (size_t i = 0; i < scene->tree.count; i++)
        for (int k = 0; k < 3; k++) {
            scene->tree.nodes[i].centre[k] -= root[k];
            if (scene->normals == NONE) scene->tree.nodes[i].normal[k] = 0; /* the file has some */
        }
    scene->finder = make_finder(&scene->tree);
}

static struct scene build_scene(struct host *host, pbr_instance *instance, const struct kind *kind) {
    struct scene scene = {.name = kind->name, .host = host, .instance = instance, .folder = make_folder()};
    struct surface surface = make_surface(kind);
    scene.lod = surface_lod(instance, &surface);
    scene.normals = kind->flags & NO_NORMALS ? NONE : kind->flags & SOME_NORMALS ? SOME : ALL;
    struct image image = save_image(scene.lod, &scene.folder, PBR_LOD_FILE_QS);
    finish_scene(&scene, &image);
    free(image.data);
    free_surface(&surface);
    return scene;
}

static struct scene open_scene(struct host *host, pbr_instance *instance, const char *path) {
    struct scene scene = {.name = path, .host = host, .instance = instance, .folder = make_folder(), .normals = ALL};
    struct image image = load_image(path);
    scene.lod = open_lod(instance, path, 0);
    finish_scene(&scene, &image);
    free(image.data);
    return scene;
}

static void close_scene(struct scene *scene) {
    pbr_lod_release(&scene->lod);
    free(scene->finder.places);
    qs_free(&scene->tree);
    remove_folder(&scene->folder);
}

/* ---- Views ---- */

/* What follows from the camera's place. */
static void place(struct disc_camera *camera) {
    struct cut_view *cut = &camera->cut;
    double inverse[16];
    memcpy(cut->to_eye, camera->to_eye, sizeof cut->to_eye);
    matrix_multiply(cut->projection, camera->to_eye, cut->to_clip);
    assert_true(matrix_inverse(camera->to_eye, inverse));
    const bool parallel = cut->projection[15] != 0;
    for (int k = 0; k < 4; k++) cut->eye[k] = inverse[parallel ? 8 + k : 12 + k];
}

static void finish(struct disc_camera *camera) {
    struct cut_view *cut = &camera->cut;
    place(camera);
    camera->stretch = matrix_largest_stretch(camera->to_eye);
    cut->reach_per_radius = camera->stretch * camera->radius_scale;
    cut->size_per_radius = 2 * camera->pixels_per_unit * cut->reach_per_radius;
    cut->node_size_per_radius = 2 * camera->pixels_per_unit * camera->stretch;
}

/* Whatever the size of the hierarchy: seen as one of radius 1. */
static void fit(struct disc_camera *camera, const struct scene *scene) {
    const double radius = scene->tree.nodes[0].radius, s = radius > 0 ? 1 / radius : 1;
    const double scale[16] = {s, 0, 0, 0, 0, s, 0, 0, 0, 0, s, 0, 0, 0, 0, 1};
    double eye[16];
    memcpy(eye, camera->to_eye, sizeof eye);
    matrix_multiply(eye, scale, camera->to_eye);
    finish(camera);
}

/* Within the model, before and behind it, cut by its near plane; of every projection. */
static struct disc_camera view_of(const struct scene *scene, int number, double threshold) {
    struct disc_camera camera;
    random_camera(number, &camera);
    fit(&camera, scene);
    camera.cut.discs = number % 2 && scene->normals != SOME;
    if (!camera.cut.discs) camera.cut.spread = 0;
    camera.cut.culls = number / 6 % 3 == 1;
    camera.cut.threshold = threshold;
    camera.cut.edge = 7;
    return camera;
}

/* All of it, some 400 pixels large. */
static struct disc_camera view_of_all(const struct scene *scene, bool parallel, double threshold) {
    struct disc_camera camera = {.radius_scale = 1, .to_eye = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -5, 1}};
    struct cut_view *cut = &camera.cut;
    cut->viewport[0] = cut->viewport[1] = 1000;
    cut->size_minimum = 1, cut->size_maximum = 1e18, cut->point_limit = 64;
    perspective(2, 1, 1, 10, cut->projection);
    if (parallel)
        memcpy(cut->projection, (double[16]){0.4, 0, 0, 0, 0, 0.4, 0, 0, 0, 0, -0.2, 0, 0, 0, -1, 1}, sizeof cut->projection);
    camera.pixels_per_unit = 500 * cut->projection[0];
    fit(&camera, scene);
    cut->threshold = threshold;
    cut->edge = 7;
    return camera;
}

/* ---- What must be ---- */

static double w_of(const struct cut_view *view, const double p[3]) {
    return view->to_clip[3] * p[0] + view->to_clip[7] * p[1] + view->to_clip[11] * p[2] + view->to_clip[15];
}

/* Pixels; infinite behind the eye, where it must be looked into. */
static double size_of(const struct cut_view *view, const struct qs_node *node) {
    const double w = w_of(view, node->centre);
    return w > 0 ? view->node_size_per_radius * node->radius / w : INFINITY;
}

/* Whether normals in the cone, wherever in the node's cube, are across the direction to the eye, or off it by less than 0.15;
 * there are none without a normal.
 * For certain, or maybe: the library may widen cones by the errors of both ends' codes, 0.0487 each, and a guard's eye moves. */
static bool is_seen_from_edge(const struct cut_view *view, const struct qs_node *node, bool maybe) {
    double to_eye[3];
    if (length3(node->normal) < 0.5) return false;
    if (node->cone == 3) return true;
    for (int k = 0; k < 3; k++) to_eye[k] = view->eye[3] != 0 ? view->eye[k] / view->eye[3] - node->centre[k] : view->eye[k];
    const double distance = length3(to_eye), corner = view->eye[3] != 0 ? sqrt(3) * node->radius / distance : 0;
    const double reach = corner + (maybe ? FACING_TOLERANCE + view->guard.eye / distance : -FACING_TOLERANCE);
    const double off = acos(fmax(-1, fmin(1, dot3(to_eye, node->normal) / distance))) - acos(0);
    return reach >= 1 || fabs(off) <= qs_cone_of(node->cone) + 0.15 + (maybe ? 2 * 0.0487 : 0) + asin(reach);
}

/* The root has no record in the file to be drawn by: a cut starts with its children. Discs may have to be
 * smaller where they may nearly be seen from the edge. The tolerance is of sizes, positive for what may be fine, negative for what
 * is. */
static bool is_fine(const struct cut_view *view, const struct qs_node *node, double tolerance) {
    if (node->level == 0) return false;
    if (node->children == 0) return true;
    if (!(view->threshold > 0 && size_of(view, node) <= view->threshold * (1 + tolerance))) return false;
    if (!view->discs || size_of(view, node) <= view->edge * (1 + tolerance)) return true;
    return !is_seen_from_edge(view, node, tolerance < 0);
}

/* 1: faces the eye for certain, -1: away. The file does not tell which of some have normals. */
static int facing(const struct scene *scene, const struct cut_view *view, const struct qs_node *node) {
    double to_eye[3];
    if (!view->culls || scene->normals == NONE) return 1;
    if (scene->normals == SOME) return 0;
    for (int k = 0; k < 3; k++) to_eye[k] = view->eye[3] != 0 ? view->eye[k] / view->eye[3] - node->centre[k] : view->eye[k];
    const double along = dot3(to_eye, node->normal), margin = FACING_TOLERANCE * length3(to_eye);
    return along > margin ? 1 : along < -margin ? -1 : 0;
}

/* Whether it and all below, wherever in its sphere, face away: of an inner node that may hold a leaf that faces the eye not even
 * the mean normal decides. The library may widen cones by the errors of both ends' codes, 0.0487 each. */
static bool faces_away_with_all(const struct scene *scene, const struct cut_view *view, const struct qs_node *node) {
    const double widened = qs_cone_of(node->cone) + 2 * 0.0487 + FACING_TOLERANCE;
    double to_eye[3];
    if (scene->normals != ALL || !view->culls) return false;
    for (int k = 0; k < 3; k++) to_eye[k] = view->eye[3] != 0 ? view->eye[k] / view->eye[3] - node->centre[k] : view->eye[k];
    /* Leaves' centres are in the sphere; the original's reach out of it by no more than that again. */
    const double distance = length3(to_eye), reach = view->eye[3] != 0 ? 2 * node->radius : 0;
    if (!(reach < distance) || node->cone == 3) return false;
    return acos(dot3(to_eye, node->normal) / distance) - widened - asin(reach / distance) > acos(0);
}

/* Two unit vectors across a normal and each other. */
static void make_axes(const double normal[3], double axes[2][3]) {
    const double any[3] = {fabs(normal[0]) < 0.6, fabs(normal[0]) >= 0.6, 0};
    cross3(normal, any, axes[0]);
    cross3(normal, axes[0], axes[1]);
    for (int i = 0; i < 2; i++) {
        const double length = length3(axes[i]);
        for (int k = 0; k < 3; k++) axes[i][k] /= length;
    }
}

static struct clip_disc disc_of(const struct scene *scene, const struct disc_camera *camera, const struct qs_node *node) {
    double axes[2][3];
    if (scene->normals == NONE || length3(node->normal) < 0.5) return random_disc(camera, node->centre, node->radius, true);
    make_axes(node->normal, axes);
    return disc_along(camera, node->centre, node->radius, false, axes);
}

/* Whether its splat, were it drawn, would be seen for certain; and whether a GL point could draw it. */
static struct splat_fate splat_of(const struct scene *scene, const struct disc_camera *camera, const struct qs_node *node) {
    if (!camera->cut.discs) return fate_of(&camera->cut, node->centre, node->radius);
    struct splat_fate fate = {0, 0};
    const struct clip_disc disc = disc_of(scene, camera, node);
    fate.visible = disc_is_visible(&camera->cut, &disc);
    fate.needs_quad = fate.visible && !disc_fits_a_point(&camera->cut, &disc);
    return fate;
}

/* The disc that a record with a normal is drawn as. */
static struct clip_disc disc_of_record(const struct disc_camera *camera, const struct splat *record) {
    const struct cut_view *view = &camera->cut;
    float normal[3];
    double n[3], position[3], to_eye[3], axes[2][3];
    splat_decode_normal(record->normal, normal);
    for (int k = 0; k < 3; k++) n[k] = (double)normal[k], position[k] = (double)record->position[k];
    for (int k = 0; k < 3; k++) to_eye[k] = view->eye[k] - view->eye[3] * position[k];
    turn_from_edge(to_eye, view->size_per_radius * (double)record->radius / w_of(view, position), n);
    make_axes(n, axes);
    return disc_along(camera, position, (double)record->radius, false, axes);
}

/* Whether a pixel's centre near its own is in the disc: of the rays of the pixels around, where x = at[0] w and y = at[1] w. */
static bool disc_holds_a_pixel(const struct cut_view *view, const struct clip_disc *disc) {
    const double *c = disc->centre, *u = disc->across[0], *v = disc->across[1];
    for (int n = 0; n < 25; n++) {
        double at[2], m[2][3];
        for (int i = 0; i < 2; i++) {
            const double half = view->viewport[i] / 2;
            at[i] = (floor((c[i] / c[3] + 1) * half) + (i ? n / 5 : n % 5) - 2 + 0.5) / half - 1;
            m[i][0] = u[i] - at[i] * u[3], m[i][1] = v[i] - at[i] * v[3], m[i][2] = at[i] * c[3] - c[i];
        }
        const double determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        const double a = (m[0][2] * m[1][1] - m[0][1] * m[1][2]) / determinant;
        const double b = (m[0][0] * m[1][2] - m[0][2] * m[1][0]) / determinant;
        if (a * a + b * b <= 1) return true;
    }
    return false;
}

/* Whether there is none in the rectangle around the disc. */
static bool box_holds_no_pixel(const struct cut_view *view, const struct clip_disc *disc) {
    for (int i = 0; i < 2; i++) {
        double extent[2];
        disc_extent(disc, i, extent);
        for (int k = 0; k < 2; k++) extent[k] = (extent[k] + 1) * view->viewport[i] / 2 - 0.5;
        if (ceil(extent[0]) > floor(extent[1])) return true;
    }
    return false;
}

/* ---- What is ---- */

struct sought {
    const struct scene *scene;
    const struct cut_view *view;
    const struct splat *record;
    const bool *emitted;
};

/* A node whose cone is not known is not drawn from its edge: its normal is no farther than `most` from the line to the eye, in the
 * plane of both. */
static void drawn_normal(const struct cut_view *view, const struct qs_node *node, double most, double out[3]) {
    const double pi = acos(-1);
    double to_eye[3], axis[3], side[3];
    memcpy(out, node->normal, 3 * sizeof *out);
    for (int k = 0; k < 3; k++) to_eye[k] = view->eye[3] != 0 ? view->eye[k] / view->eye[3] - node->centre[k] : view->eye[k];
    const double distance = length3(to_eye);
    if (node->cone != 3 || node->children == 0 || !(distance > 0)) return;
    for (int k = 0; k < 3; k++) to_eye[k] /= distance;
    const double angle = acos(fmax(-1, fmin(1, dot3(to_eye, node->normal))));
    if (angle <= most || angle >= pi - most) return;
    cross3(to_eye, node->normal, axis);
    cross3(axis, to_eye, side); /* from the line to the eye towards the normal */
    const double length = length3(side), turned = angle < pi / 2 ? most : pi - most;
    for (int k = 0; k < 3; k++) out[k] = cos(turned) * to_eye[k] + sin(turned) * side[k] / length;
}

/* That is 60 degrees, but 45 over 12 pixels; a guard's nearest distance is not asked here. */
static bool has_drawn_normal(const struct cut_view *view, const struct qs_node *node, const float normal[3]) {
    const double pi = acos(-1), size = size_of(view, node);
    const bool guarded = view->guard.turn != 0 || view->guard.move != 0 || view->guard.eye != 0;
    for (int large = 0; large < 2; large++) {
        double wanted[3], off = 0;
        if (!guarded && (large ? size < 12 * (1 - SIZE_TOLERANCE) : size > 12 * (1 + SIZE_TOLERANCE))) continue;
        drawn_normal(view, node, large ? pi / 4 : pi / 3, wanted);
        for (int k = 0; k < 3; k++) off = fmax(off, fabs((double)normal[k] - wanted[k]));
        if (off <= 1e-3) return true; /* as in pbr_points */
    }
    return false;
}

static bool is_that_node(void *user, size_t number) {
    const struct sought *sought = user;
    const struct qs_tree *tree = &sought->scene->tree;
    const struct qs_node *node = &tree->nodes[number];
    const double position[3] = {(double)sought->record->position[0], (double)sought->record->position[1],
                                (double)sought->record->position[2]};
    float normal[3];
    if (sought->emitted[number] || distance3(position, node->centre) > sphere_tolerance(tree)) return false;
    if (fabs((double)sought->record->radius - node->radius) > sphere_tolerance(tree)) return false;
    if (!is_fine(sought->view, node, SIZE_TOLERANCE)) return false;
    if (is_fine(sought->view, &tree->nodes[node->parent], -SIZE_TOLERANCE)) return false;
    splat_decode_normal(sought->record->normal, normal);
    if (sought->scene->normals == ALL && !has_drawn_normal(sought->view, node, normal)) return false;
    return !tree->colours || (memcmp(sought->record->colour, node->colour, 3) == 0 && sought->record->colour[3] == 255);
}

static struct splat *gather(pbr_instance *instance, const struct cut *cut) {
    struct splat *records = malloc((cut->count + 1) * sizeof *records);
    assert_non_null(records);
    cut_gather(instance, cut, records);
    return records;
}

/* Of those that points draw, the last ones hold no pixel's centre, and most that do not are among them. */
static void check_pixels(struct scene *scene, const struct disc_camera *camera, int number, const struct cut *cut,
                         const struct splat *records) {
    const struct cut_guard *guard = &camera->cut.guard;
    const bool may_know = camera->cut.discs && camera->cut.spread == 0 && guard->turn == 0 && guard->move == 0 && guard->eye == 0;
    assert_true(cut->between <= (may_know ? cut->points_only : 0));
    scene->between += (long)cut->between;
    for (size_t i = 0; i < cut->points_only && may_know && scene->normals == ALL; i++) {
        const struct clip_disc disc = disc_of_record(camera, &records[i]);
        scene->outside_pixels += box_holds_no_pixel(&camera->cut, &disc);
        if (i >= cut->points_only - cut->between && disc_holds_a_pixel(&camera->cut, &disc))
            fail_msg("%s, view %d, %g pixels: record %zu is said to lie between pixels, and holds one's centre", scene->name,
                     number, camera->cut.threshold, i);
    }
}

/* Each record is a node, no larger than the threshold or a leaf, below one that is larger; none is above another. Those that points
 * draw, they can also as `seen` sees them. */
static struct fates find_records(struct scene *scene, const struct disc_camera *camera, const struct disc_camera *seen, int number,
                                 const struct cut *cut) {
    const size_t count = scene->tree.count;
    struct fates fates = {calloc(count, 1), calloc(count, 1)};
    struct splat *records = gather(scene->instance, cut);
    assert_true(fates.emitted && fates.below);
    assert_true(cut->points_only <= cut->count);
    for (size_t i = 0; i < cut->count; i++) {
        struct sought sought = {scene, &camera->cut, &records[i], fates.emitted};
        const double position[3] = {(double)records[i].position[0], (double)records[i].position[1], (double)records[i].position[2]};
        const size_t node = find_node(&scene->finder, position, sphere_tolerance(&scene->tree), is_that_node, &sought);
        if (node == count)
            fail_msg("%s, view %d, %g pixels: record %zu at %g %g %g, radius %g, w %g, is no node that may be drawn", scene->name,
                     number, camera->cut.threshold, i, position[0], position[1], position[2], (double)records[i].radius,
                     w_of(&camera->cut, position));
        fates.emitted[node] = true;
        scene->inner += scene->tree.nodes[node].children > 0;
        if (i < cut->points_only && splat_of(scene, seen, &scene->tree.nodes[node]).needs_quad)
            fail_msg("%s, view %d, %g pixels: record %zu is left to GL points, which cannot draw it", scene->name, number,
                     camera->cut.threshold, i);
    }
    check_pixels(scene, camera, number, cut, records);
    free(records);
    for (size_t i = 1; i < count; i++) {
        const size_t parent = scene->tree.nodes[i].parent;
        fates.below[i] = fates.below[parent] || fates.emitted[parent];
        if (fates.below[i] && fates.emitted[i])
            fail_msg("%s, view %d, %g pixels: a node is drawn above another", scene->name, number, camera->cut.threshold);
    }
    scene->emitted += (long)cut->count;
    return fates;
}

/* The walk that knows nothing of culling comes to each node that is neither below a fine one nor near to the decision. */
static void check_walk(struct scene *scene, const struct disc_camera *camera, int number, const struct fates *fates) {
    const struct cut_view *view = &camera->cut;
    const size_t count = scene->tree.count;
    bool *reached = calloc(count, 1);
    assert_non_null(reached);
    for (size_t i = 0; i < count; i++) {
        const struct qs_node *node = &scene->tree.nodes[i];
        const bool above = i > 0 && !(reached[node->parent] && !is_fine(view, &scene->tree.nodes[node->parent], SIZE_TOLERANCE));
        reached[i] = !above;
        if (above || i == 0 || !is_fine(view, node, -SIZE_TOLERANCE)) continue;
        const int faces = facing(scene, view, node);
        if (fates->emitted[i] && (node->children == 0 ? faces < 0 : faces_away_with_all(scene, view, node)))
            fail_msg("%s, view %d, %g pixels: a node that faces away is drawn", scene->name, number, view->threshold);
        if (faces > 0 && !fates->emitted[i] && splat_of(scene, camera, node).visible)
            fail_msg("%s, view %d, %g pixels: a node at %g %g %g, radius %g, level %d, %d children, is seen and left out",
                     scene->name, number, view->threshold, node->centre[0], node->centre[1], node->centre[2], node->radius,
                     node->level, node->children);
    }
    free(reached);
}

/* A leaf that would be seen stands in for itself, or one above it does. */
static void check_leaves(struct scene *scene, const struct disc_camera *camera, int number, const struct fates *fates) {
    for (size_t i = 1; i < scene->tree.count; i++) {
        const struct qs_node *node = &scene->tree.nodes[i];
        if (node->children > 0 || fates->emitted[i] || fates->below[i]) continue;
        scene->culled++;
        if (facing(scene, &camera->cut, node) > 0 && splat_of(scene, camera, node).visible)
            fail_msg("%s, view %d, %g pixels: a leaf at %g %g %g, radius %g, is seen, and nothing stands for it", scene->name,
                     number, camera->cut.threshold, node->centre[0], node->centre[1], node->centre[2], node->radius);
    }
}

static void check_cut(struct scene *scene, const struct disc_camera *camera, int number, const struct cut *cut) {
    struct fates fates = find_records(scene, camera, camera, number, cut);
    check_walk(scene, camera, number, &fates);
    check_leaves(scene, camera, number, &fates);
    assert_true(cut->visited >= cut->count);
    assert_true(cut->visited <= scene->tree.count);
    assert_int_equal(cut->damaged, 0);
    free(fates.emitted);
    free(fates.below);
}

static void check_views(struct scene *scene, int views) {
    struct cut cut = {0};
    for (int v = 0; v < views; v++)
        for (size_t t = 0; t < COUNT(thresholds); t++) {
            const struct disc_camera camera = view_of(scene, v, thresholds[t]);
            assert_int_equal(lod_cut(scene->lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
            check_cut(scene, &camera, v, &cut);
        }
    cut_free(scene->instance, &cut);
}

/* ---- Promises ---- */

static const struct kind kinds[] = {
    {"1 point", SPHERE, 1, 0},
    {"2 points", SPHERE, 2, 0},
    {"5 points", SPHERE, 5, 0},
    {"17 points without radii", SPHERE, 17, ZERO_RADII},
    {"a torus", TORUS, 4000, 0},
    {"a sphere", SPHERE, 2000, NO_COLOURS},
    {"a sphere with any normals", SPHERE, 2000, RANDOM_NORMALS},
    {"a sphere without normals", SPHERE, 1000, NO_NORMALS},
    {"a sphere with some normals", SPHERE, 1000, SOME_NORMALS},
    {"a sphere with one huge radius", SPHERE, 1000, ONE_HUGE},
    {"a plane", PLANE, 1024, 0},
    {"two far clusters", CLUSTERS, 1000, 0},
    {"points in one place", COINCIDENT, 100, 0},
    {"points in one place without radii", COINCIDENT, 100, ZERO_RADII},
    {"a survey", TORUS, 2000, SURVEY},
};

static void every_cut_of_a_built_tree_shows_all_that_is_seen(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    long inner = 0, culled = 0;
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct scene scene = build_scene(&host, instance, &kinds[i]);
        check_views(&scene, VIEWS);
        inner += scene.inner, culled += scene.culled;
        close_scene(&scene);
    }
    if (inner < 200 * VIEWS || culled < 2000 * VIEWS)
        fail_msg("%ld inner, %ld culled", inner, culled); /* else this showed nothing */
    assert_int_equal(host.messages, 0);
    host_stop(&host, instance);
}

/* The original's spheres do not hold all that is below them, nor its cones. */
static void every_cut_of_the_originals_bunny_shows_all_that_is_seen(void **unused) {
    (void)unused;
    char path[4096];
    struct host host;
    data_path(path, "bunny_colour.qs");
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = open_scene(&host, instance, path);
    check_views(&scene, VIEWS / 4);
    if (scene.inner < 5000 || scene.culled < 50000) fail_msg("%ld inner, %ld culled", scene.inner, scene.culled);
    close_scene(&scene);
    host_stop(&host, instance);
}

/* Each leaf has one record at or above it; at threshold 0 the leaves have. */
static void a_view_of_all_covers_each_leaf_once(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct scene scene = build_scene(&host, instance, &kinds[i]);
        struct cut cut = {0};
        for (int v = 0; v < 2 * (int)COUNT(thresholds); v++) {
            const struct disc_camera camera = view_of_all(&scene, v % 2, thresholds[v / 2]);
            assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
            struct fates fates = find_records(&scene, &camera, &camera, v, &cut);
            for (size_t n = 0; n < scene.tree.count; n++)
                if (scene.tree.nodes[n].children == 0 && !fates.emitted[n] && !fates.below[n])
                    fail_msg("%s, view %d: a leaf is left out", scene.name, v);
            assert_int_equal(cut.culled, 0);
            if (v / 2 == 0) assert_int_equal(cut.count, scene.tree.leaves);
            free(fates.emitted);
            free(fates.below);
        }
        cut_free(instance, &cut);
        close_scene(&scene);
    }
    host_stop(&host, instance);
}

/* What lies between the pixels' centres: most of it, where splats are that small. */
static void most_splats_that_hold_no_pixel_are_told(void **unused) {
    (void)unused;
    char path[4096];
    struct host host;
    data_path(path, "bunny_colour.qs");
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = open_scene(&host, instance, path);
    struct cut cut = {0};
    for (int v = 0; v < 24; v++) {
        struct disc_camera camera = view_of_all(&scene, v % 2, thresholds[v % 3]);
        double before[16], model[16] = {0};
        for (int k = 0; k < 9; k++) model[4 * (k / 3) + k % 3] = (k % 4 == 0) + 0.8 * random_number() - 0.4;
        model[15] = 1;
        memcpy(before, camera.to_eye, sizeof before);
        matrix_multiply(before, model, camera.to_eye);
        camera.to_eye[12] = random_number() - 0.5, camera.to_eye[13] = random_number() - 0.5;
        camera.radius_scale = 0.5 + random_number();
        camera.cut.size_minimum = v % 4 == 0 ? 0.3 : 0;
        camera.cut.viewport[0] = 700 + 10 * v;
        camera.cut.discs = true, camera.cut.largest_spread = 0.8;
        finish(&camera);
        assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
        struct fates fates = find_records(&scene, &camera, &camera, v, &cut);
        free(fates.emitted);
        free(fates.below);
        camera.cut.guard.move = 1e-9; /* where the view may move, nothing is said */
        assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
        assert_int_equal(cut.between, 0);
    }
    if (scene.between < 20000 || 4 * scene.between < 3 * scene.outside_pixels)
        fail_msg("%ld of %ld are known to lie between the pixels' centres", scene.between, scene.outside_pixels);
    cut_free(instance, &cut);
    close_scene(&scene);
    host_stop(&host, instance);
}

/* ---- Guards ---- */

/* With what lies between members: views are compared as bytes. */
static void copy_camera(struct disc_camera *to, const struct disc_camera *from) {
    memcpy(to, from, sizeof *to);
}

static void copy_view(struct cut_view *to, const struct cut_view *from) {
    memcpy(to, from, sizeof *to);
}

/* A rigid motion of eye space: a turn around a point, and a step. */
static void move_eye(struct disc_camera *camera, double angle, const double pivot[3], double step) {
    double axis[3], any[3], rows[3][3], motion[16] = {0}, before[16], way[3];
    random_unit(axis);
    random_unit(any);
    random_unit(way);
    cross3(axis, any, rows[0]);
    const double length = length3(rows[0]);
    for (int k = 0; k < 3; k++) rows[0][k] /= length;
    cross3(axis, rows[0], rows[1]);
    /* Rotation by Rodrigues' formula, column by column. */
    for (int c = 0; c < 3; c++) {
        double e[3] = {c == 0, c == 1, c == 2}, across[3];
        cross3(axis, e, across);
        for (int k = 0; k < 3; k++)
            motion[4 * c + k] = e[k] * cos(angle) + across[k] * sin(angle) + axis[k] * axis[c] * (1 - cos(angle));
    }
    motion[15] = 1;
    for (int k = 0; k < 3; k++) {
        double turned = 0;
        for (int c = 0; c < 3; c++) turned += motion[4 * c + k] * pivot[c];
        motion[12 + k] = pivot[k] - turned + step * way[k];
    }
    memcpy(before, camera->to_eye, sizeof before);
    matrix_multiply(motion, before, camera->to_eye);
    place(camera);
}

/* The picture is shifted by up to a pixel. */
static void jitter(struct disc_camera *camera) {
    for (int axis = 0; axis < 2; axis++) {
        const double shift = (2 * random_number() - 1) * 2 / camera->cut.viewport[axis];
        for (int c = 0; c < 4; c++) camera->cut.projection[4 * c + axis] += shift * camera->cut.projection[4 * c + 3];
    }
    place(camera);
}

/* Guards as wide as they are needed, not wider: what the moved camera sees, a cut for the first one holds. */
static void check_guard(struct scene *scene, int number, double threshold, struct cut *cut) {
    static const double amounts[] = {0.0005, 0.01, 0.06};
    static const double origin[3] = {0, 0, 0};
    struct disc_camera made = view_of(scene, number, threshold), seen;
    copy_camera(&seen, &made);
    const double amount = amounts[number / 4 % 3] * random_number(), radius = scene->tree.nodes[0].radius;
    struct cut_guard *guard = &made.cut.guard;
    switch (number % 4) {
    case 0: move_eye(&seen, amount, origin, 0); break;                  /* looks around */
    case 1: move_eye(&seen, 0, origin, amount); break;                  /* flies */
    case 2: move_eye(&seen, amount, made.to_eye + 12, 0); break;        /* around the hierarchy */
    default: move_eye(&seen, amount, origin, amount * random_number()); /* anyhow */
    }
    double squared = 0;
    for (int k = 0; k < 3; k++) squared += pow(seen.cut.eye[k] - made.cut.eye[k], 2);
    guard->eye = sqrt(squared) * (1 + 1e-9) + 1e-9;
    if (number % 4 == 2) {
        guard->move = amount * sqrt(3) * radius * matrix_largest_stretch(made.to_eye) + 1e-9;
    } else {
        double back[16] = {0}, motion[16];
        assert_true(matrix_inverse(made.to_eye, back));
        matrix_multiply(seen.to_eye, back, motion);
        guard->turn = amount * (1 + 1e-9) + 1e-9;
        guard->move = length3(motion + 12) * (1 + 1e-9) + 1e-9;
    }
    if (!cut_view_covers(&made.cut, &seen.cut, radius)) fail_msg("%s, view %d: its own guard is not enough", scene->name, number);
    if (number % 3 == 0) { /* only now: a cut is asked for the still picture */
        guard->jitter[0] = guard->jitter[1] = 1;
        jitter(&seen);
    }
    assert_int_equal(lod_cut(scene->lod, &made.cut, NULL, NULL, cut), PBR_OK);
    struct fates fates = find_records(scene, &made, &seen, number, cut);
    check_leaves(scene, &seen, number, &fates);
    free(fates.emitted);
    free(fates.below);
}

static void a_guarded_cut_shows_all_that_is_seen_from_nearby(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct scene scene = build_scene(&host, instance, &kinds[i]);
        struct cut cut = {0};
        for (int v = 0; v < 2 * VIEWS; v++) check_guard(&scene, v, thresholds[v % COUNT(thresholds)], &cut);
        cut_free(instance, &cut);
        close_scene(&scene);
    }
    host_stop(&host, instance);
}

/* Anything else than a motion that is within the guard needs a cut of its own. */
static void a_guard_covers_what_is_near_and_nothing_else(void **unused) {
    (void)unused;
    static const double origin[3] = {0, 0, 0};
    static const struct kind kind = {"a torus", TORUS, 1000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = build_scene(&host, instance, &kind);
    const double radius = scene.tree.nodes[0].radius;
    for (int v = 0; v < VIEWS; v++) {
        struct disc_camera made = view_of(&scene, v, 2), other;
        copy_camera(&other, &made);
        assert_true(cut_view_covers(&made.cut, &made.cut, radius)); /* without a guard, too */
        made.cut.guard = (struct cut_guard){0.01, 0.01, 0.05, {0, 0}};
        assert_true(cut_view_covers(&made.cut, &other.cut, radius));
        move_eye(&other, 0.02, origin, 0);
        assert_false(cut_view_covers(&made.cut, &other.cut, radius));
        copy_camera(&other, &made), other.cut.guard = (struct cut_guard){0}, other.to_eye[12] += 0.02, place(&other);
        assert_false(cut_view_covers(&made.cut, &other.cut, radius));
        double *const others[] = {&other.cut.viewport[0], &other.cut.size_per_radius, &other.cut.projection[0], &other.cut.spread,
                                  &other.cut.node_size_per_radius};
        for (size_t k = 0; k < COUNT(others); k++) {
            copy_view(&other.cut, &made.cut), other.cut.guard = (struct cut_guard){0};
            assert_true(cut_view_covers(&made.cut, &other.cut, radius));
            *others[k] = 1.3 * *others[k] + 1;
            assert_false(cut_view_covers(&made.cut, &other.cut, radius));
        }
        copy_view(&other.cut, &made.cut), other.cut.guard = (struct cut_guard){0};
        other.cut.threshold *= 2, other.cut.edge *= 2; /* a steered one: how fine a cut is, is not what it covers */
        assert_true(cut_view_covers(&made.cut, &other.cut, radius));
        copy_view(&other.cut, &made.cut), other.cut.guard = (struct cut_guard){0}, other.cut.guard.jitter[1] = 1;
        assert_false(cut_view_covers(&made.cut, &other.cut, radius));
        copy_camera(&other, &made), other.cut.guard = (struct cut_guard){0}; /* grows: no motion */
        for (int k = 0; k < 12; k++) other.to_eye[k] *= 1.001;
        place(&other);
        assert_false(cut_view_covers(&made.cut, &other.cut, radius));
    }
    close_scene(&scene);
    host_stop(&host, instance);
}

/* Of a steady motion a cut holds for as many more frames as are asked for; of a leap, or of rest, for no other. */
static void a_steady_motion_is_foreseen(void **unused) {
    (void)unused;
    static const double origin[3] = {0, 0, 0};
    static const struct cut_guard none;
    static const struct kind kind = {"a torus", TORUS, 1000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = build_scene(&host, instance, &kind);
    const double radius = scene.tree.nodes[0].radius;
    for (int orbits = 0; orbits < 2; orbits++) {
        enum { FRAMES = 16 };
        struct disc_camera frames[FRAMES] = {view_of_all(&scene, false, 2)};
        for (int i = 1; i < FRAMES; i++) {
            const double angle = 0.004 * i,
                         rotation[16] = {cos(angle), 0, -sin(angle), 0, 0, 1, 0, 0, sin(angle), 0, cos(angle), 0, 0, 0, 0, 1};
            double base[16];
            copy_camera(&frames[i], &frames[0]);
            memcpy(base, frames[0].to_eye, sizeof base);
            if (orbits) matrix_multiply(frames[0].to_eye, rotation, frames[i].to_eye);
            else matrix_multiply(rotation, base, frames[i].to_eye);
            place(&frames[i]);
        }
        struct cut_view asked;
        for (int count = 3; count <= 12; count *= 2) {
            copy_view(&asked, &frames[1].cut);
            assert_true(cut_view_foresee(&frames[0].cut, radius, 0.2, count, &asked) == count);
            for (int i = 1; i <= count; i++) assert_true(cut_view_covers(&asked, &frames[i].cut, radius));
            assert_false(cut_view_covers(&asked, &frames[count + 3].cut, radius));
        }
        struct disc_camera far;
        copy_camera(&far, &frames[0]);
        move_eye(&far, 0.8, origin, 0);
        copy_view(&asked, &far.cut);
        assert_true(cut_view_foresee(&frames[0].cut, radius, 0.2, 6, &asked) == 0);
        assert_memory_equal(&asked.guard, &none, sizeof none);
    }
    close_scene(&scene);
    host_stop(&host, instance);
}

/* What is seen ahead of costs some nodes, not a multiple of the picture: of parallel views, near to a surface and within it, too.
 */
static void a_foreseen_cut_is_not_much_larger(void **unused) {
    (void)unused;
    static const double amounts[] = {0.001, 0.01, 0.1, 1}, origin[3] = {0, 0, 0};
    static const struct kind kind = {"a torus", TORUS, 20000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = build_scene(&host, instance, &kind);
    const double radius = scene.tree.nodes[0].radius;
    struct cut cut = {0};
    size_t guarded = 0, plain_splats = 0, splats = 0;
    for (int v = 0; v < 4 * VIEWS; v++) {
        const struct disc_camera last = view_of(&scene, v, 4);
        struct disc_camera now;
        copy_camera(&now, &last);
        move_eye(&now, v % 2 ? amounts[v % 4] : 0, origin, v % 3 ? amounts[v % 4] : 0);
        assert_int_equal(lod_cut(scene.lod, &now.cut, NULL, NULL, &cut), PBR_OK);
        const size_t plain = cut.count;
        struct cut_view asked;
        copy_view(&asked, &now.cut);
        cut_view_foresee(&last.cut, radius, cut.nearness, 6, &asked);
        if (asked.guard.turn == 0 && asked.guard.move == 0) continue;
        assert_true(cut_view_covers(&asked, &now.cut, radius));
        assert_int_equal(lod_cut(scene.lod, &asked, NULL, NULL, &cut), PBR_OK);
        guarded++, plain_splats += plain, splats += cut.count;
    }
    assert_true(guarded > VIEWS);
    assert_true(splats < 2 * plain_splats);
    cut_free(instance, &cut);
    close_scene(&scene);
    host_stop(&host, instance);
}

/* ---- Facing ---- */

/* Seen along -z, at threshold 0: how many of the surface's splats are drawn, at least and at most. */
static void expect_facing(const struct scene *scene, const pbr_lod *lod, const struct surface *surface, uint32_t form) {
    const double sure = 0.06; /* the cosine's error by the normal's code, of 0.0487 and more */
    size_t least = 0, most = 0;
    struct cut cut = {0};
    struct disc_camera camera = view_of_all(scene, true, 0);
    camera.cut.culls = true;
    assert_int_equal(lod_cut(lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
    for (size_t i = 0; i < surface->kind->count; i++) {
        const float *n = surface->normals[i];
        const bool any = surface->kind->flags & NO_NORMALS || !(fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]) > 0);
        least += any || (double)n[2] > sure;
        most += any || (double)n[2] > -sure;
    }
    if (cut.count < least || cut.count > most)
        fail_msg("%s, form %u: %zu splats, not %zu to %zu", scene->name, form, cut.count, least, most);
    cut_free(scene->instance, &cut);
}

static void without_normals_nothing_faces_away(void **unused) {
    (void)unused;
    static const struct kind some[] = {{"a sphere without normals", SPHERE, 3000, NO_NORMALS},
                                       {"a sphere with some normals", SPHERE, 3000, SOME_NORMALS},
                                       {"a sphere with some of any normals", SPHERE, 3000, SOME_NORMALS | RANDOM_NORMALS},
                                       {"a sphere with any normals", SPHERE, 3000, RANDOM_NORMALS},
                                       {"1 point without normal", SPHERE, 1, NO_NORMALS}};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(some); i++) {
        struct scene scene = build_scene(&host, instance, &some[i]);
        struct surface surface = make_surface(&some[i]);
        for (uint32_t form = PBR_LOD_FILE_NONE; form <= PBR_LOD_FILE_QS; form++) {
            if (form) assert_int_equal(pbr_lod_save(scene.lod, scene.folder.other, form, NULL, NULL), PBR_OK);
            pbr_lod *lod = form ? open_lod(instance, scene.folder.other, 0) : pbr_lod_retain(scene.lod);
            expect_facing(&scene, lod, &surface, form);
            pbr_lod_release(&lod);
        }
        free_surface(&surface);
        close_scene(&scene);
    }
    host_stop(&host, instance);
}

/* Half of a sphere faces the eye; a tree that only drops single leaves looks at all of it. */
static void what_faces_away_is_culled_with_all_below(void **unused) {
    (void)unused;
    static const struct kind kind = {"a sphere", SPHERE, 50000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct scene scene = build_scene(&host, instance, &kind);
    struct cut cut = {0};
    struct disc_camera camera = view_of_all(&scene, true, 0);
    camera.cut.culls = true;
    assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
    assert_in_range(cut.count, kind.count * 45 / 100, kind.count * 55 / 100);
    assert_true(cut.visited < scene.tree.count * 3 / 4);
    cut_free(instance, &cut);
    close_scene(&scene);
    host_stop(&host, instance);
}

static void a_view_of_nothing_has_no_records(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct scene scene = build_scene(&host, instance, &kinds[i]);
        struct cut cut = {0};
        struct disc_camera camera = view_of_all(&scene, i % 2, 1);
        camera.to_eye[12] = 1e3; /* far beside the view */
        matrix_multiply(camera.cut.projection, camera.to_eye, camera.cut.to_clip);
        assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
        assert_int_equal(cut.count, 0);
        assert_int_equal(cut.points_only, 0);
        assert_true(cut.culled > 0);
        cut_free(instance, &cut);
        close_scene(&scene);
    }
    host_stop(&host, instance);
}

static void expect_same_cut(pbr_instance *instance, const struct cut *a, const struct cut *b) {
    struct splat *records[2] = {gather(instance, a), gather(instance, b)};
    assert_int_equal(a->count, b->count);
    assert_int_equal(a->points_only, b->points_only);
    assert_int_equal(a->visited, b->visited);
    assert_int_equal(a->culled, b->culled);
    if (a->count > 0) assert_memory_equal(records[0], records[1], a->count * sizeof *records[0]);
    free(records[0]), free(records[1]);
}

static void a_cut_is_the_same_on_every_run_form_and_number_of_threads(void **unused) {
    (void)unused;
    static const struct kind kind = {"a torus", TORUS, 50000, 0};
    struct host hosts[2];
    pbr_instance *instances[2] = {host_start(&hosts[0], 1), host_start(&hosts[1], 4)};
    struct scene scene = build_scene(&hosts[0], instances[0], &kind);
    assert_int_equal(pbr_lod_save(scene.lod, scene.folder.other, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
    pbr_lod *lods[4] = {scene.lod, open_lod(instances[1], scene.folder.other, 0),
                        open_lod(instances[1], scene.folder.other, PBR_LOD_OPEN_READ),
                        open_lod(instances[0], scene.folder.other, 0)};
    struct cut cuts[4] = {{0}, {0}, {0}, {0}};
    for (int v = 0; v < VIEWS; v++) {
        const struct disc_camera camera = view_of(&scene, v, thresholds[v % COUNT(thresholds)]);
        for (int i = 0; i < 4; i++) {
            assert_int_equal(lod_cut(lods[i], &camera.cut, NULL, NULL, &cuts[i]), PBR_OK);
            if (i > 0) expect_same_cut(instances[1], &cuts[0], &cuts[i]);
        }
    }
    for (int i = 0; i < 4; i++) cut_free(instances[i == 1 || i == 2], &cuts[i]);
    for (int i = 1; i < 4; i++) pbr_lod_release(&lods[i]);
    close_scene(&scene);
    for (int i = 0; i < 2; i++) host_stop(&hosts[i], instances[i]);
}

static void the_same_view_again_allocates_nothing(void **unused) {
    (void)unused;
    static const struct kind kind = {"a torus", TORUS, 50000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 4);
    struct scene scene = build_scene(&host, instance, &kind);
    struct cut cut = {0};
    for (int v = 0; v < 8; v++) {
        const struct disc_camera camera = view_of(&scene, v, 1);
        assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
        atomic_store(&host.fail_at, 1);
        assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
        assert_int_equal(atomic_exchange(&host.fail_at, 0), 1); /* nobody asked */
    }
    cut_free(instance, &cut);
    close_scene(&scene);
    host_stop(&host, instance);
}

/* Matrices of a host gone wrong: nothing is promised of the cut, but that there is one. */
static void views_without_sense_do_no_harm(void **unused) {
    (void)unused;
    static const double odd[] = {0, NAN, INFINITY, -INFINITY, 1e300, -1e-300};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct scene scene = build_scene(&host, instance, &kinds[i]);
        struct cut cut = {0};
        for (size_t n = 0; n < COUNT(odd) * 40; n++) {
            struct disc_camera camera = view_of(&scene, (int)n, thresholds[n % COUNT(thresholds)]);
            double *const places[] = {
                &camera.cut.to_clip[n / COUNT(odd) % 16],   &camera.cut.eye[n % 4],      &camera.cut.threshold,
                &camera.cut.node_size_per_radius,           &camera.cut.size_per_radius, &camera.cut.viewport[0],
                &camera.cut.projection[n / COUNT(odd) % 16]};
            *places[n % COUNT(places)] = odd[n % COUNT(odd)];
            assert_int_equal(lod_cut(scene.lod, &camera.cut, NULL, NULL, &cut), PBR_OK);
            assert_true(cut.count <= scene.tree.leaves);
            assert_true(cut.visited <= scene.tree.count);
        }
        cut_free(instance, &cut);
        close_scene(&scene);
    }
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_cut_of_a_built_tree_shows_all_that_is_seen),
                                       cmocka_unit_test(every_cut_of_the_originals_bunny_shows_all_that_is_seen),
                                       cmocka_unit_test(a_view_of_all_covers_each_leaf_once),
                                       cmocka_unit_test(most_splats_that_hold_no_pixel_are_told),
                                       cmocka_unit_test(a_guarded_cut_shows_all_that_is_seen_from_nearby),
                                       cmocka_unit_test(a_guard_covers_what_is_near_and_nothing_else),
                                       cmocka_unit_test(a_steady_motion_is_foreseen),
                                       cmocka_unit_test(a_foreseen_cut_is_not_much_larger),
                                       cmocka_unit_test(a_view_of_nothing_has_no_records),
                                       cmocka_unit_test(without_normals_nothing_faces_away),
                                       cmocka_unit_test(what_faces_away_is_culled_with_all_below),
                                       cmocka_unit_test(a_cut_is_the_same_on_every_run_form_and_number_of_threads),
                                       cmocka_unit_test(the_same_view_again_allocates_nothing),
                                       cmocka_unit_test(views_without_sense_do_no_harm)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
