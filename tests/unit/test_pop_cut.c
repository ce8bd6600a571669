/* Cuts of POP hierarchies: from the root against their definition, from the last cut against that from the root.
 * SPDX-License-Identifier: MIT */
#include "pop_meshes.h"

#include "cameras.h"
#include "core/points.h"
#include "lod/balance.h"
#include "lod/pop_cut.h"
#include "lod/qsplat.h"

/* The sanitizers look at memory, which is used alike in all views. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { VIEWS = 18, STEPS = 20, ORBIT = 60, CONES = 30 };
#else
enum { VIEWS = 60, STEPS = 160, ORBIT = 180, CONES = 300 };
#endif

/* Pixels; the last so that hierarchies of few triangles have inner nodes below it. */
static const double thresholds[] = {0, 0.5, 1, 3, 10, 60};

/* Decisions that a rounding error may turn: the library computes in float. */
static const double SIZE_TOLERANCE = 1e-4;
/* Of the cosine of a normal and a view: cuts leave room of 1e-4, and floats. */
static const double FACING_TOLERANCE = 1e-3;

struct scene {
    const char *name;
    struct host *host;
    pbr_instance *instance;
    struct pop pop;
};

static void for_each_mesh(void (*check)(struct scene *scene)) {
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(pop_mesh_kinds); i++) {
        struct scene scene = {.name = pop_mesh_kinds[i].name, .host = &host, .instance = instance};
        pbr_mesh *mesh = make_pop_mesh(instance, &pop_mesh_kinds[i]);
        assert_int_equal(pop_build(mesh, NULL, &scene.pop), PBR_OK);
        pbr_mesh_release(&mesh);
        check(&scene);
        pop_free(instance, &scene.pop);
    }
    host_stop(&host, instance);
}

/* ---- Views ---- */

/* What follows from the camera's place, which is `to_eye` of a hierarchy of radius 1. */
static void place(struct disc_camera *camera, const struct scene *scene, const double to_eye[16]) {
    const double s = scene->pop.radius > 0 ? 1 / scene->pop.radius : 1;
    const double scale[16] = {s, 0, 0, 0, 0, s, 0, 0, 0, 0, s, 0, 0, 0, 0, 1};
    double inverse[16];
    struct cut_view *cut = &camera->cut;
    matrix_multiply(to_eye, scale, camera->to_eye);
    memcpy(cut->to_eye, camera->to_eye, sizeof cut->to_eye);
    matrix_multiply(cut->projection, camera->to_eye, cut->to_clip);
    assert_true(matrix_inverse(camera->to_eye, inverse));
    const bool parallel = cut->projection[15] != 0;
    for (int k = 0; k < 4; k++) cut->eye[k] = inverse[parallel ? 8 + k : 12 + k];
    camera->stretch = matrix_largest_stretch(camera->to_eye);
    cut->reach_per_radius = camera->stretch * camera->radius_scale;
    cut->size_per_radius = 2 * camera->pixels_per_unit * cut->reach_per_radius;
    cut->node_size_per_radius = 2 * camera->pixels_per_unit * camera->stretch;
}

/* Within the model, before and behind it, cut by its near plane; of every projection. */
static struct disc_camera any_view(const struct scene *scene, int number) {
    struct disc_camera camera;
    double to_eye[16];
    random_camera(number, &camera);
    memcpy(to_eye, camera.to_eye, sizeof to_eye);
    place(&camera, scene, to_eye);
    camera.cut.discs = number % 2;
    if (!camera.cut.discs) camera.cut.spread = 0;
    camera.cut.culls = number / 6 % 3 != 2;
    camera.cut.threshold = thresholds[number / 3 % (int)COUNT(thresholds)];
    return camera;
}

/* ---- By the definition, in double ---- */

enum judgement { NO, MAYBE, YES };

static enum judgement by_margin(double value, double margin) {
    return value > margin ? YES : value < -margin ? NO : MAYBE;
}

static void ball_of(const struct pop *pop, uint32_t level, uint64_t index, double centre[3], double *radius) {
    const struct pop_ball ball = pop_decode_ball(pop, pop_node_at(pop, level, index));
    for (int k = 0; k < 3; k++) centre[k] = (double)ball.centre[k];
    *radius = (double)ball.radius;
}

static double w_of(const struct cut_view *view, const double p[3]) {
    return view->to_clip[3] * p[0] + view->to_clip[7] * p[1] + view->to_clip[11] * p[2] + view->to_clip[15];
}

static enum judgement is_small(const struct scene *scene, const struct cut_view *view, uint32_t level, uint64_t index) {
    double centre[3], radius;
    ball_of(&scene->pop, level, index, centre, &radius);
    const double w = w_of(view, centre), pixels = view->node_size_per_radius * radius, most = view->threshold * w;
    if (!(view->threshold > 0)) return NO;
    double error = 1e-6 * fabs(view->to_clip[15]); /* w is a sum that may cancel */
    for (int k = 0; k < 3; k++) error += 1e-6 * fabs(view->to_clip[4 * k + 3]) * scene->pop.radius;
    return by_margin(most - pixels, SIZE_TOLERANCE * fmax(pixels, fabs(most)) + view->threshold * error);
}

/* Whether a corner, or the middle, of a triangle below is in the view, and faces the eye there; for certain. */
static bool triangle_is_seen(const struct scene *scene, const struct cut_view *view, uint64_t t) {
    const struct pop *pop = &scene->pop;
    double corners[4][3] = {{0}}, normals[4][3] = {{0}};
    bool lacks_normal = false;
    for (int c = 0; c < 3; c++) {
        float n[3];
        pop_vertex(pop, pop->triangles[t][c], corners[c]);
        splat_decode_normal(pop->vertices[pop->triangles[t][c]].normal, n);
        lacks_normal |= n[0] == 0 && n[1] == 0 && n[2] == 0;
        for (int k = 0; k < 3; k++) {
            normals[c][k] = (double)n[k];
            corners[3][k] += corners[c][k] / 3;
            normals[3][k] += (double)n[k] / 3;
        }
    }
    for (int c = 0; c < 4; c++) {
        double clip[4], to_eye[3];
        transform(view->to_clip, corners[c], 1, clip);
        const double w = clip[3], z = view->zero_to_one ? 2 * clip[2] - w : clip[2];
        if (!(w > 0 && fabs(clip[0]) <= w && fabs(clip[1]) <= w && fabs(z) <= w)) continue;
        for (int k = 0; k < 3; k++) to_eye[k] = view->eye[k] - corners[c][k] * view->eye[3];
        if (!view->culls || lacks_normal || dot3(to_eye, normals[c]) > FACING_TOLERANCE * length3(to_eye)) return true;
    }
    return false;
}

/* Whether for certain nothing below the node can be seen: its ball is outside, or all in its cone face away from all of it. */
static bool must_be_culled(const struct scene *scene, const struct cut_view *view, uint32_t level, uint64_t index) {
    static const double sines[] = POP_CONE_SINES;
    const struct pop_node *node = pop_node_at(&scene->pop, level, index);
    double centre[3], radius, to_eye[3], axis[3];
    ball_of(&scene->pop, level, index, centre, &radius);
    for (int i = 0; i < 2 && !view->discs; i++) { /* left and right, bottom and top, with room for a splat, doubled */
        double normal[3];
        for (int side = -1; side <= 1; side += 2) {
            for (int k = 0; k < 3; k++) normal[k] = view->to_clip[4 * k + 3] + side * view->to_clip[4 * k + i];
            const double value = dot3(normal, centre) + view->to_clip[15] + side * view->to_clip[12 + i];
            const double room =
                2 * (view->size_minimum * fabs(w_of(view, centre)) + view->size_per_radius * radius) / view->viewport[i];
            if (value + 2 * length3(normal) * radius + room +
                    1e-3 * (length3(normal) * scene->pop.radius + fabs(view->to_clip[15])) <
                0)
                return true;
        }
    }
    if (!view->culls || pop_cone(node) == POP_NO_CONE) return false;
    int16_t code[2];
    float n[3];
    pop_decode_normal(node, code);
    splat_decode_normal(code, n);
    for (int k = 0; k < 3; k++) axis[k] = (double)n[k], to_eye[k] = view->eye[k] - centre[k] * view->eye[3];
    const double distance = length3(to_eye), reach = view->eye[3] != 0 ? radius * fabs(view->eye[3]) : 0;
    if (!(reach < 0.99 * distance)) return false;
    return acos(fmax(-1, dot3(to_eye, axis) / distance)) - asin(sines[pop_cone(node)]) - asin(reach / distance) > acos(0) + 2e-3;
}

/* ---- A cut as it is ---- */

struct drawn {
    struct splat *records;
    uint32_t (*triangles)[3];
};

static struct drawn gather(const struct pop *pop, const struct pop_cut *cut) {
    struct drawn drawn = {calloc(cut->counts[POP_POINT] + cut->counts[POP_QUAD] + 1, sizeof *drawn.records),
                          calloc(cut->counts[POP_TRIANGLE] + 1, sizeof *drawn.triangles)};
    assert_true(drawn.records && drawn.triangles);
    pop_cut_gather(pop, cut, drawn.records, drawn.triangles);
    assert_true(pop_cut_nearness(pop, cut) >= 0);
    return drawn;
}

static void free_drawn(struct drawn *drawn) {
    free(drawn->records);
    free(drawn->triangles);
}

static uint64_t leaf_after(const struct pop_shape *shape, uint32_t level, uint64_t index) {
    for (; level > 0; level--) {
        uint64_t first;
        index = first = index + 1;
        if (index == shape->levels[level].count) return shape->levels[0].count;
        pop_children(shape, level, index, &first);
        index = first - 1;
    }
    return index + 1;
}

static uint64_t first_leaf(const struct pop_shape *shape, uint32_t level, uint64_t index) {
    for (; level > 0; level--) pop_children(shape, level, index, &index);
    return index;
}

/* The nodes follow one another without gaps or overlaps, and none above them would stop a walk. */
static void check_definition(struct scene *scene, const struct disc_camera *camera, const struct pop_cut *cut) {
    const struct pop_shape *shape = &scene->pop.shape;
    const struct cut_view *view = &camera->cut;
    uint64_t leaf = 0, drawn = 0;
    for (size_t i = 0; i < cut->node_count; i++) {
        const struct pop_front_node *node = &cut->nodes[i];
        const uint64_t end = leaf_after(shape, node->level, node->index);
        const enum judgement small = is_small(scene, view, node->level, node->index);
        assert_int_equal(first_leaf(shape, node->level, node->index), leaf);
        drawn += node->fate != POP_CULLED;
        if (node->fate == POP_TRIANGLE && (node->level != 0 || small == YES)) fail_msg("%s: a triangle that is small", scene->name);
        if ((node->fate == POP_POINT || node->fate == POP_QUAD) && small == NO) fail_msg("%s: a point that is large", scene->name);
        if (node->fate != POP_CULLED && must_be_culled(scene, view, node->level, node->index))
            fail_msg("%s: what cannot be seen is drawn", scene->name);
        for (uint64_t t = leaf; t < end && node->fate == POP_CULLED; t++)
            if (triangle_is_seen(scene, view, t))
                fail_msg("%s: triangle %llu is seen and culled", scene->name, (unsigned long long)t);
        uint64_t above = node->index;
        for (uint32_t l = node->level; l + 1 < shape->level_count; l++) {
            above = pop_parent(shape, l, above);
            if (is_small(scene, view, l + 1, above) == YES || must_be_culled(scene, view, l + 1, above))
                fail_msg("%s: a node below one that stops", scene->name);
        }
        leaf = end;
    }
    assert_int_equal(leaf, shape->level_count > 0 ? shape->levels[0].count : 0);
    assert_int_equal(drawn, cut->counts[POP_POINT] + cut->counts[POP_QUAD] + cut->counts[POP_TRIANGLE]);
    assert_true(cut->visited >= cut->node_count && cut->visited <= shape->nodes);
}

/* Records are their nodes; a GL point can draw the first ones. */
static void check_records(struct scene *scene, const struct disc_camera *camera, const struct pop_cut *cut) {
    const struct pop *pop = &scene->pop;
    struct drawn drawn = gather(pop, cut);
    uint64_t next[POP_FATES] = {[POP_QUAD] = cut->counts[POP_POINT]};
    for (size_t i = 0; i < cut->node_count; i++) {
        const struct pop_front_node *front = &cut->nodes[i];
        const struct pop_node *node = pop_node_at(pop, front->level, front->index);
        if (front->fate == POP_CULLED) continue;
        if (front->fate == POP_TRIANGLE) {
            assert_memory_equal(drawn.triangles[next[POP_TRIANGLE]++], pop->triangles[front->index], sizeof *drawn.triangles);
            continue;
        }
        const struct splat *record = &drawn.records[next[front->fate]++];
        double centre[3], radius;
        uint8_t colour[4] = {255, 255, 255, 255};
        int16_t normal[2];
        ball_of(pop, front->level, front->index, centre, &radius);
        for (int k = 0; k < 3; k++) assert_true((double)record->position[k] == centre[k]);
        assert_true((double)record->radius == radius);
        if (pop->has_colours) qsplat_decode_colour(node->colour, colour);
        assert_memory_equal(record->colour, colour, 4);
        pop_decode_normal(node, normal);
        if (pop_cone(node) != POP_NO_CONE) assert_memory_equal(record->normal, normal, sizeof normal);
        if (front->fate != POP_POINT) continue;
        if (!camera->cut.discs) {
            assert_false(fate_of(&camera->cut, centre, radius).needs_quad);
            continue;
        }
        const struct clip_disc disc = random_disc(camera, centre, radius, false);
        if (disc_is_visible(&camera->cut, &disc)) assert_true(disc_fits_a_point(&camera->cut, &disc));
    }
    assert_int_equal(next[POP_POINT], cut->counts[POP_POINT]);
    assert_int_equal(next[POP_TRIANGLE], cut->counts[POP_TRIANGLE]);
    free_drawn(&drawn);
}

static uint64_t all_fates[POP_FATES];

static void check_walks(struct scene *scene) {
    struct pop_cut cut = {0};
    for (int v = 0; v < VIEWS; v++) {
        const struct disc_camera camera = any_view(scene, v);
        assert_int_equal(pop_cut_walk(scene->instance, &scene->pop, &camera.cut, NULL, &cut), PBR_OK);
        check_definition(scene, &camera, &cut);
        check_records(scene, &camera, &cut);
        for (int f = 0; f < POP_FATES; f++) all_fates[f] += cut.counts[f];
    }
    pop_cut_free(scene->instance, &cut);
}

static void walks_find_what_the_definition_says(void **unused) {
    (void)unused;
    memset(all_fates, 0, sizeof all_fates);
    for_each_mesh(check_walks);
    for (int f = 0; f < POP_FATES; f++) assert_true(all_fates[f] > 1000); /* or the test is of nothing */
}

/* ---- Facing ---- */

/* The largest and least n.v, over normals in a cone and points in a ball, are within the bounds, and these no further off than the
 * cone's and the ball's extremes, which need not be at once, and the room of 1e-4. */
static void facing_bounds_all_of_a_cone_seen_from_all_of_a_ball(void **unused) {
    (void)unused;
    for (int n = 0; n < CONES; n++) {
        double axis[3], across[3], largest = -INFINITY, least = INFINITY;
        random_unit(axis);
        const double half = n % 3 * 0.3, radius = n % 5 * 0.2, distance = radius + 0.01 + 2 * random_number();
        struct question q = {.corner = 1, .eye = {0, 0, 0, n % 7 ? 1 : 0}};
        const float a[3] = {(float)axis[0], (float)axis[1], (float)axis[2]}, centre[3] = {0.5f, -1, 2};
        random_unit(across);
        for (int k = 0; k < 3; k++) q.eye[k] = (float)(across[k] * distance) + centre[k] * q.eye[3];
        const struct facing f = question_facing(&q, a, (float)cos(half), (float)sin(half), centre, (float)radius);
        for (int s = 0; s < 20000; s++) {
            double p[3], m[3], side[3], along = 0, length;
            random_unit(p);
            random_unit(side);
            for (int k = 0; k < 3; k++) along += side[k] * axis[k];
            for (int k = 0; k < 3; k++) side[k] -= along * axis[k];
            if (!((length = length3(side)) > 1e-3)) continue;
            double dot = 0;
            for (int k = 0; k < 3; k++) {
                m[k] = cos(half) * axis[k] + sin(half) * side[k] / length;
                dot += m[k] * ((double)q.eye[k] - ((double)centre[k] + radius * p[k]) * (double)q.eye[3]);
            }
            largest = fmax(largest, dot);
            least = fmin(least, dot);
        }
        const double room = 1e-3 * (distance + 3);
        assert_true((double)f.most >= largest - 1e-6 && (double)f.most <= largest + room + 0.1 * (radius + distance * sin(half)));
        if (acos(dot3(axis, across)) + half < acos(-1)) assert_true((double)f.least <= least + 1e-6);
    }
}

/* ---- The front ---- */

static void check_same(struct scene *scene, const struct pop_cut *walked, const struct pop_cut *front, int step) {
    const char *name = scene->name;
    if (walked->node_count != front->node_count)
        fail_msg("%s, step %d: %zu nodes, not %zu", name, step, front->node_count, walked->node_count);
    for (size_t i = 0; i < front->node_count; i++) {
        const struct pop_front_node *a = &walked->nodes[i], *b = &front->nodes[i];
        if (a->index != b->index || a->level != b->level || a->fate != b->fate)
            fail_msg("%s, step %d: node %zu is %u, %u (%d), not %u, %u (%d)", name, step, i, b->level, b->index, b->fate, a->level,
                     a->index, a->fate);
    }
    assert_memory_equal(walked->counts, front->counts, sizeof walked->counts);
    struct drawn a = gather(&scene->pop, walked), b = gather(&scene->pop, front);
    assert_memory_equal(a.records, b.records, (walked->counts[POP_POINT] + walked->counts[POP_QUAD]) * sizeof *a.records);
    assert_memory_equal(a.triangles, b.triangles, walked->counts[POP_TRIANGLE] * sizeof *a.triangles);
    free_drawn(&a);
    free_drawn(&b);
}

static void turn(double m[16], double angle, int axis) {
    const double c = cos(angle), s = sin(angle);
    double r[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, out[16];
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    r[5 * a] = r[5 * b] = c, r[4 * a + b] = s, r[4 * b + a] = -s;
    matrix_multiply(m, r, out);
    memcpy(m, out, sizeof out);
}

/* One step of a path: the camera stands, moves a little, turns around itself or the model, comes nearer; now and then something
 * else changes; at times it jumps. */
static void take_step(int number, double to_eye[16], struct disc_camera *camera) {
    const double little = pow(10, -8 * random_number()); /* down to what rounding makes */
    struct cut_view *cut = &camera->cut;
    const int what = (int)(12 * random_number());
    double before[16], rotation[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    if (what < 4) turn(to_eye, little * (random_number() - 0.5), what % 3);
    else if (what < 7) to_eye[12 + what % 3] += little * (random_number() - 0.5);
    else if (what < 9) {
        turn(rotation, little * (random_number() - 0.5), what % 3);
        memcpy(before, to_eye, sizeof before);
        matrix_multiply(rotation, before, to_eye);
    } else if (what == 10) cut->threshold = fmax(cut->threshold, 0.1) * (1 + little * (random_number() - 0.5));
    else if (what == 11 && number % 3 == 0) random_view(to_eye);
    if (number % 23 == 22) cut->threshold = thresholds[number / 23 % (int)COUNT(thresholds)];
    if (number % 37 == 36) cut->culls = !cut->culls;
    if (number % 29 == 28) cut->guard = (struct cut_guard){.turn = 0.01, .move = 0.01, .eye = 0.01 * random_number()};
    if (number % 29 == 6) cut->guard = (struct cut_guard){.turn = 0};
    if (number % 41 == 40) cut->point_limit = cut->point_limit > 100 ? 20 : 255;
}

/* Of a camera that stands still, what else the cut depends on, and cameras would change along with all the rest. */
static void change_one_thing(int number, int path, struct disc_camera *camera, double eye[3]) {
    const double little = pow(10, -3 * random_number());
    struct cut_view *cut = &camera->cut;
    cut->culls = true;
    cut->guard = (struct cut_guard){.turn = 0};
    if (path % 2) eye[number % 3] += little * (random_number() - 0.5);
    else cut->guard.move = little;
}

static uint64_t walk_visits, front_visits;

static void check_paths(struct scene *scene) {
    for (int path = 0; path < 16; path++) {
        struct pop_cut walked = {0}, front = {0};
        struct disc_camera camera = any_view(scene, path);
        double to_eye[16], eye[3] = {0, 0, 0};
        if (path % 3 == 0) camera.cut.threshold = 1.5;
        random_view(to_eye);
        for (int step = 0; step < STEPS; step++) {
            if (path < 12) take_step(step, to_eye, &camera);
            else change_one_thing(step, path, &camera, eye);
            place(&camera, scene, to_eye);
            for (int k = 0; k < 3; k++) camera.cut.eye[k] += eye[k] * scene->pop.radius;
            assert_int_equal(pop_cut_walk(scene->instance, &scene->pop, &camera.cut, NULL, &walked), PBR_OK);
            assert_int_equal(pop_cut_update(scene->instance, &scene->pop, &camera.cut, NULL, &front), PBR_OK);
            check_same(scene, &walked, &front, step);
            assert_true(front.visited <= walked.visited);
            walk_visits += walked.visited;
            front_visits += front.visited;
        }
        pop_cut_free(scene->instance, &walked);
        pop_cut_free(scene->instance, &front);
    }
}

static void fronts_are_the_walks_cut_on_any_path_and_visit_no_more(void **unused) {
    (void)unused;
    walk_visits = front_visits = 0;
    for_each_mesh(check_paths);
    assert_true(2 * front_visits < walk_visits);
}

/* A torus of 30,000 triangles from outside, half a degree a frame: sums of visits over a quarter turn and jumps. */
static void slow_orbits_visit_little_and_jumps_no_more_than_walks(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a torus", TORUS, 30000, 0};
    const double degree = acos(-1) / 180;
    struct host host;
    struct scene scene = {.name = kind.name, .host = &host, .instance = host_start(&host, 2)};
    pbr_mesh *mesh = make_pop_mesh(scene.instance, &kind);
    assert_int_equal(pop_build(mesh, NULL, &scene.pop), PBR_OK);
    pbr_mesh_release(&mesh);
    for (int culls = 0; culls < 2; culls++) {
        struct pop_cut walked = {0}, front = {0};
        struct disc_camera camera = {.radius_scale = 1};
        struct cut_view *cut = &camera.cut;
        double to_eye[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1};
        uint64_t visits[2] = {0, 0};
        cut->viewport[0] = 1280, cut->viewport[1] = 720, cut->size_minimum = 1, cut->size_maximum = 1e18, cut->point_limit = 255;
        cut->threshold = 6, cut->culls = culls;
        perspective(2, 16.0 / 9, 0.1, 10, cut->projection);
        camera.pixels_per_unit = 720;
        for (int step = 0; step < ORBIT; step++) {
            turn(to_eye, step % 60 == 59 ? 2 : degree / 2, step % 60 == 59 ? 0 : 1);
            place(&camera, &scene, to_eye);
            assert_int_equal(pop_cut_walk(scene.instance, &scene.pop, cut, NULL, &walked), PBR_OK);
            assert_int_equal(pop_cut_update(scene.instance, &scene.pop, cut, NULL, &front), PBR_OK);
            check_same(&scene, &walked, &front, step);
            assert_true(front.visited <= walked.visited);
            if (step == 0 || step % 60 == 59) continue; /* jumps: all is looked at again */
            visits[0] += walked.visited;
            visits[1] += front.visited;
        }
        print_message("%s: %.1f %% of the walks' visits\n", culls ? "facing away culled" : "all drawn",
                      100.0 * (double)visits[1] / (double)visits[0]);
        assert_true(8 * visits[1] < visits[0]);
        /* The same view again is free, but for what rounding leaves in doubt. */
        assert_int_equal(pop_cut_update(scene.instance, &scene.pop, cut, NULL, &front), PBR_OK);
        assert_true(front.visited < walked.visited / 50);
        pop_cut_free(scene.instance, &walked);
        pop_cut_free(scene.instance, &front);
    }
    pop_free(scene.instance, &scene.pop);
    host_stop(&host, scene.instance);
}

/* ---- Costs of points ---- */

static struct disc_camera front_view(const struct scene *scene, double x) {
    struct disc_camera camera = {.radius_scale = 1, .pixels_per_unit = 720};
    const double to_eye[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, -3, 1};
    struct cut_view *cut = &camera.cut;
    cut->viewport[0] = cut->viewport[1] = 720, cut->size_minimum = 1, cut->size_maximum = 1e18, cut->point_limit = 255;
    cut->threshold = 1;
    perspective(2, 1, 0.1, 10, cut->projection);
    place(&camera, scene, to_eye);
    return camera;
}

/* A GPU on which splats and triangles take so long each, a frame so long at least; with errors of this part. */
struct gpu {
    const struct scene *scene;
    struct cut_view view;
    double splat, triangle, frame, noise;
    uint64_t state;
    int tries, fails_at;
};

static double seconds_of(const struct gpu *gpu, const struct balance_sample *sample) {
    return gpu->frame + gpu->splat * (double)sample->splats + gpu->triangle * (double)sample->triangles;
}

static pbr_result draw_at(void *user, float point_cost, struct balance_sample *out) {
    struct gpu *gpu = user;
    struct pop_cut cut = {0};
    if (++gpu->tries == gpu->fails_at) return PBR_ERROR_OUT_OF_GPU_MEMORY;
    gpu->view.point_cost = (double)point_cost;
    assert_int_equal(pop_cut_walk(gpu->scene->instance, &gpu->scene->pop, &gpu->view, NULL, &cut), PBR_OK);
    out->splats = cut.counts[POP_POINT] + cut.counts[POP_QUAD];
    out->triangles = cut.counts[POP_TRIANGLE];
    out->seconds = seconds_of(gpu, out) * (1 + gpu->noise * (2 * uniform(&gpu->state) - 1));
    pop_cut_free(gpu->scene->instance, &cut);
    return PBR_OK;
}

static struct balance_sample sample_at(struct gpu *gpu, float point_cost) {
    struct balance_sample sample = {0};
    assert_int_equal(draw_at(gpu, point_cost, &sample), PBR_OK);
    return sample;
}

/* Of all costs that there are, by steps of a fifth. */
enum { COSTS = 80 };

static void sample_all(struct gpu *gpu, struct balance_sample out[COSTS]) {
    double cost = 1;
    for (int i = 0; i < COSTS; i++, cost *= 1.2) out[i] = sample_at(gpu, (float)cost);
}

static double least_seconds(const struct gpu *gpu, const struct balance_sample samples[COSTS]) {
    double least = INFINITY;
    for (int i = 0; i < COSTS; i++) least = fmin(least, seconds_of(gpu, &samples[i]));
    return least;
}

/* What is found is within what the search ignores: 1/32 of the time, 1/4 where few splats are left out; with noise, within as much
 * more. Cheap splats are kept, dear ones left out. A cost that cannot be drawn is none, but for the first. */
static void the_cost_that_is_found_takes_least(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a torus", TORUS, 30000, 0};
    static const double sizes[] = {2, 6, 20, 60}, ratios[] = {0.1, 0.9, 1.1, 1.6, 3, 10, 40, 300, 1e5};
    struct host host;
    struct scene scene = {.name = kind.name, .host = &host, .instance = host_start(&host, 1)};
    pbr_mesh *mesh = make_pop_mesh(scene.instance, &kind);
    assert_int_equal(pop_build(mesh, NULL, &scene.pop), PBR_OK);
    pbr_mesh_release(&mesh);
    for (size_t s = 0; s < COUNT(sizes); s++) {
        struct gpu any = {.scene = &scene, .view = front_view(&scene, 0.1).cut};
        struct balance_sample samples[COSTS]; /* what is drawn does not depend on how long it takes */
        float last = 1;
        any.view.threshold = sizes[s];
        sample_all(&any, samples);
        for (size_t r = 0; r < COUNT(ratios); r++) {
            struct gpu gpu = {
                .scene = &scene, .view = front_view(&scene, 0.1).cut, .triangle = 1, .splat = ratios[r], .frame = 100};
            float cost = 0, noisy = 0;
            gpu.view.threshold = sizes[s];
            const double least = least_seconds(&gpu, samples);
            assert_int_equal(balance_find(draw_at, &gpu, &cost), PBR_OK);
            assert_true(gpu.tries > 0 && gpu.tries <= BALANCE_TRIES);
            const double found = sample_at(&gpu, cost).seconds;
            assert_true(found <= least * 5 / 4 * 32 / 31);
            if (ratios[r] <= 3) assert_true(found <= least * 1.1); /* few of them are at most 3/32 */
            if (ratios[r] < 1) assert_true(cost == 1);
            assert_true(cost >= last);
            last = cost;
            gpu.noise = 0.05;
            assert_int_equal(balance_find(draw_at, &gpu, &noisy), PBR_OK);
            gpu.noise = 0;
            assert_true(sample_at(&gpu, noisy).seconds <= least * 5 / 4 * 32 / 31 * 1.05 / 0.95);
        }
        assert_true(sample_at(&any, last).splats == 0); /* not at 100,000 triangles each */
    }
    for (int at = 1; at < 4; at++) {
        struct gpu gpu = {.scene = &scene, .view = front_view(&scene, 0).cut, .triangle = 1, .splat = 100, .fails_at = at};
        float cost = 7;
        gpu.view.threshold = 20;
        assert_int_equal(balance_find(draw_at, &gpu, &cost), at == 1 ? PBR_ERROR_OUT_OF_GPU_MEMORY : PBR_OK);
        assert_int_equal(gpu.tries, at);
        if (at == 1) assert_true(cost == 7);
        else if (at == 2) assert_true(cost == 1);
        else assert_true(cost <= 2);
    }
    pop_free(scene.instance, &scene.pop);
    host_stop(&host, scene.instance);
}

/* What was drawn once of a horse's gaussians, and times as chance may have them. */
struct table {
    const struct balance_sample *rows;
    int next;
    pbr_result last; /* after the rows */
    int count;
};

static pbr_result draw_row(void *user, float point_cost, struct balance_sample *out) {
    struct table *table = user;
    (void)point_cost;
    if (table->next == table->count) return table->last;
    *out = table->rows[table->next++];
    return PBR_OK;
}

static void chance_finds_no_larger_cost(void **unused) {
    (void)unused;
    static const struct balance_sample by_chance[] = {{25.3, 53873, 5552}, {25.2, 1418, 58007}, {20.5, 0, 61647}},
                                       far_better[] = {{80, 53873, 5552}, {40, 1418, 58007}, {20.5, 0, 61647}};
    const struct {
        struct table table;
        pbr_result result;
        float cost;
    } cases[] = {
        {{by_chance, 0, PBR_OK, 3}, PBR_OK, 2},
        {{far_better, 0, PBR_OK, 3}, PBR_OK, 8},
        {{far_better, 0, PBR_ERROR_OUT_OF_GPU_MEMORY, 2}, PBR_OK, 2},
        {{far_better, 0, PBR_ERROR_LIMIT, 1}, PBR_OK, 1},
        {{far_better, 0, PBR_ERROR_LIMIT, 0}, PBR_ERROR_LIMIT, 7},
        {{far_better, 0, PBR_ERROR_CONTEXT, 2}, PBR_ERROR_CONTEXT, 7}, /* is not a matter of size */
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        struct table table = cases[i].table;
        float cost = 7;
        assert_int_equal(balance_find(draw_row, &table, &cost), cases[i].result);
        assert_true(cost == cases[i].cost);
    }
}

/* ---- What goes wrong ---- */

static pbr_result cut_twice(pbr_instance *instance, void *user) {
    const struct scene *scene = user;
    struct pop_cut cut = {0};
    pbr_result result = PBR_OK;
    for (int i = 0; i < 3 && result == PBR_OK; i++) {
        const struct disc_camera camera = front_view(scene, 0.4 * i);
        result = pop_cut_update(instance, &scene->pop, &camera.cut, NULL, &cut);
        if (result != PBR_OK) assert_int_equal(cut.node_count, 0);
    }
    pop_cut_free(instance, &cut);
    return result;
}

static void failures_leave_an_empty_cut_that_can_be_made_again(void **unused) {
    (void)unused;
    static const struct pop_mesh_kind kind = {"a torus", TORUS, 5000, 0};
    struct host host;
    struct scene scene = {.name = kind.name, .host = &host, .instance = host_start(&host, 1)};
    pbr_mesh *mesh = make_pop_mesh(scene.instance, &kind);
    assert_int_equal(pop_build(mesh, NULL, &scene.pop), PBR_OK);
    pbr_mesh_release(&mesh);
    fail_every_allocation(&host, scene.instance, cut_twice, &scene);
    struct pop_cut cut = {0}, whole = {0};
    const atomic_bool cancel = true;
    const struct disc_camera first = front_view(&scene, 0), second = front_view(&scene, 0.5);
    assert_int_equal(pop_cut_walk(scene.instance, &scene.pop, &first.cut, &cancel, &cut), PBR_ERROR_CANCELLED);
    assert_int_equal(cut.node_count, 0);
    assert_int_equal(pop_cut_update(scene.instance, &scene.pop, &first.cut, NULL, &cut), PBR_OK);
    assert_int_equal(pop_cut_update(scene.instance, &scene.pop, &second.cut, &cancel, &cut), PBR_ERROR_CANCELLED);
    assert_int_equal(cut.node_count + cut.counts[POP_POINT] + cut.counts[POP_TRIANGLE], 0);
    assert_int_equal(pop_cut_update(scene.instance, &scene.pop, &second.cut, NULL, &cut), PBR_OK);
    assert_int_equal(pop_cut_walk(scene.instance, &scene.pop, &second.cut, NULL, &whole), PBR_OK);
    check_same(&scene, &whole, &cut, 0);
    pop_cut_free(scene.instance, &cut);
    pop_cut_free(scene.instance, &whole);
    pop_free(scene.instance, &scene.pop);
    host_stop(&host, scene.instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walks_find_what_the_definition_says),
        cmocka_unit_test(facing_bounds_all_of_a_cone_seen_from_all_of_a_ball),
        cmocka_unit_test(fronts_are_the_walks_cut_on_any_path_and_visit_no_more),
        cmocka_unit_test(slow_orbits_visit_little_and_jumps_no_more_than_walks),
        cmocka_unit_test(the_cost_that_is_found_takes_least),
        cmocka_unit_test(chance_finds_no_larger_cost),
        cmocka_unit_test(failures_leave_an_empty_cut_that_can_be_made_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
