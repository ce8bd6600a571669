/* The cut of a whole cloud, against a test of every splat. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "cameras.h"
#include "core/matrix.h"
#include "lod/cloud.h"

enum { POINTS = 160000, VIEWS = 60 };

static pbr_points *make_points(pbr_instance *instance) {
    float(*positions)[3] = malloc(POINTS * sizeof *positions);
    float *radii = malloc(POINTS * sizeof *radii);
    for (int i = 0; i < POINTS; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = (float)(2 * random_number() - 1);
        radii[i] = (float)(0.002 + (i % 20000 == 0 ? 0.2 : 0.01) * random_number());
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    pbr_points *points = NULL;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    free(positions);
    free(radii);
    return points;
}

/* Marks what the cut hands over: 1 = in a range, 3 = in a range that quads draw too. Returns the number of records. */
static uint64_t mark(const struct blocks *blocks, const struct draw_list *list, uint8_t *marks, size_t count) {
    uint64_t records = 0;
    memset(marks, 0, count);
    for (size_t i = 0; i < list->count; i++) {
        const struct draw_range *range = &list->ranges[i];
        records += range->count;
        for (uint32_t k = 0; k < range->count; k++) {
            uint32_t point = blocks->order[blocks->chunks[range->chunk].first + range->first + k];
            assert_int_equal(marks[point], 0); /* no record twice */
            marks[point] = range->quads ? 3 : 1;
        }
    }
    return records;
}

static void cut_keeps_every_visible_splat_and_quads_where_needed(void **unused) {
    (void)unused;
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    pbr_points *points = make_points(instance);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    uint8_t *marks = malloc(POINTS);
    struct draw_list list = {0};
    uint64_t culled = 0, points_only = 0;
    for (int v = 0; v < VIEWS; v++) {
        struct cut_view view = {
            .size_minimum = v % 3 ? 1 : 12, .size_maximum = v % 5 ? 1e18 : 30, .point_limit = 64, .viewport = {640, 360}};
        double eye[16], projection[16];
        random_view(eye);
        perspective(4, 640.0 / 360, 0.01 + random_number(), 2 + random_number(), projection);
        matrix_multiply(projection, eye, view.to_clip);
        view.size_per_radius = 2 * 360.0 / 2 * 4; /* a diameter: twice half the height times the focal length */
        list.count = 0;
        list.culled = 0;
        assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
        assert_int_equal(mark(&blocks, &list, marks, POINTS) + list.culled, POINTS);
        culled += list.culled;
        for (uint64_t i = 0; i < POINTS; i++) {
            double p[3];
            points_position(points, i, p);
            struct splat_fate fate = fate_of(&view, p, points->radii[i]);
            if (fate.visible) assert_true(marks[i] & 1);
            if (fate.needs_quad) assert_true(marks[i] & 2);
            points_only += marks[i] == 1;
        }
    }
    /* The cut is not merely conservative: it leaves out a good part, and keeps blocks within the view to GL points alone. */
    assert_true(culled > POINTS * VIEWS / 5);
    assert_true(points_only > 0);
    pbr_free(instance, list.ranges);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(marks);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

static void a_cloud_well_within_the_view_is_one_range_of_points(void **unused) {
    (void)unused;
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    pbr_points *points = make_points(instance);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    const double from_afar[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -40, 1};
    struct cut_view view = {
        .size_per_radius = 1440, .size_minimum = 1, .size_maximum = 1e18, .point_limit = 64, .viewport = {640, 360}};
    double projection[16];
    perspective(4, 640.0 / 360, 1, 100, projection);
    matrix_multiply(projection, from_afar, view.to_clip);
    struct draw_list list = {0};
    assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
    assert_int_equal(list.count, 1);
    assert_int_equal(list.ranges[0].count, POINTS);
    assert_false(list.ranges[0].quads);
    assert_int_equal(list.visited, blocks.block_count);
    pbr_free(instance, list.ranges);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* The vertex stage computes in float. Near the camera, in a cloud that reaches far, its x is off by more than any fixed margin: a
 * block at the view's edge must go to the quads too wherever that may put a centre outside. */
static void float_error_at_the_edge_never_loses_a_splat(void **unused) {
    (void)unused;
    enum { FRAMES = 400 };
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    int outside_in_float = 0;
    for (int i = 0; i < FRAMES; i++) {
        const float place[3] = {(float)(4e4 * random_number()), (float)(4e4 * random_number()), (float)(4e4 * random_number())};
        struct splat record = {.position = {place[0], place[1], place[2]}, .radius = 0.5f};
        struct block block = {.centre = {place[0], place[1], place[2]}, .largest_splat = 0.5f, .count = 1};
        struct chunk chunk = {.count = 1, .block_count = 1};
        struct blocks blocks = {.blocks = &block, .chunks = &chunk, .block_count = 1, .chunk_count = 1};
        struct cut_view view = {
            .size_per_radius = 720, .size_minimum = 1, .size_maximum = 1e18, .point_limit = 1024, .viewport = {640, 360}};
        /* The centre is between 2e-4 and 1e-2 of the view's half width inside its right edge, 1 before the eye. */
        const double half = 640.0 / 360 / 2, turn = 6.2831853 * random_number(), c = cos(turn), s = sin(turn);
        const double at[3] = {half * (1 - 2.1e-4 - 5e-3 * random_number()), 0, -1}; /* in eye space, which is turned about y */
        const double moved[3] = {at[0] - c * place[0] - s * place[2], at[1] - place[1], at[2] + s * place[0] - c * place[2]};
        const double matrix[16] = {c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, moved[0], moved[1], moved[2], 1};
        double projection[16];
        perspective(2, 640.0 / 360, 0.1, 1000, projection);
        matrix_multiply(projection, matrix, view.to_clip);
        struct draw_list list = {0};
        assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
        assert_int_equal(list.count, 1);
        float clip[4];
        for (int r = 0; r < 4; r++)
            clip[r] = (float)view.to_clip[r] * record.position[0] + (float)view.to_clip[4 + r] * record.position[1] +
                      (float)view.to_clip[8 + r] * record.position[2] + (float)view.to_clip[12 + r];
        outside_in_float += fabsf(clip[0]) > clip[3];
        if (fabsf(clip[0]) > clip[3]) assert_true(list.ranges[0].quads);
        pbr_free(instance, list.ranges);
    }
    assert_true(outside_in_float > 0); /* else this showed nothing */
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* ---- Discs in space ---- */

enum { BLOCK_DISCS = 4, DISC_BLOCKS = 800, DISCS = BLOCK_DISCS * DISC_BLOCKS, DISC_VIEWS = 48 };

/* Blocks of a few discs each, in spheres from none to a tenth of the cloud, and radii from none to half of it. */
struct disc_cloud {
    float positions[DISCS][3], radii[DISCS];
    struct block blocks[DISC_BLOCKS];
    uint32_t order[DISCS];
    struct chunk chunk;
};

static struct disc_cloud *make_disc_cloud(void) {
    struct disc_cloud *cloud = calloc(1, sizeof *cloud);
    cloud->chunk = (struct chunk){.count = DISCS, .block_count = DISC_BLOCKS};
    for (uint32_t b = 0; b < DISC_BLOCKS; b++) {
        struct block *block = &cloud->blocks[b];
        const double extent = b % 3 ? 0.2 * pow(0.001, random_number()) : 0, largest = 0.5 * pow(0.001, random_number());
        block->first = b * BLOCK_DISCS;
        block->count = BLOCK_DISCS;
        for (int k = 0; k < 3; k++) block->centre[k] = (float)(2 * random_number() - 1);
        for (uint32_t i = block->first; i < block->first + block->count; i++) {
            double away[3];
            random_unit(away);
            cloud->order[i] = i;
            cloud->radii[i] = b % 16 ? (float)(largest * (0.5 + random_number())) : 0;
            block->largest_splat = fmaxf(block->largest_splat, cloud->radii[i]);
            for (int k = 0; k < 3; k++) {
                cloud->positions[i][k] = (float)(block->centre[k] + extent * away[k]);
                away[k] = (double)cloud->positions[i][k] - block->centre[k];
            }
            block->radius = fmaxf(block->radius, float_above(length3(away)));
        }
    }
    return cloud;
}

/* Several directions of every disc that the cut leaves out or leaves to GL points. */
static void every_disc_in_the_view_is_drawn_by_what_can(void **unused) {
    (void)unused;
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    struct disc_cloud *cloud = make_disc_cloud();
    const struct blocks blocks = {cloud->order, cloud->blocks, &cloud->chunk, DISC_BLOCKS, 1};
    static uint8_t marks[DISCS];
    struct draw_list list = {0};
    long culled = 0, points_only = 0, quads_needed = 0;
    for (int v = 0; v < DISC_VIEWS; v++) {
        struct disc_camera camera;
        random_camera(v, &camera);
        list.count = 0;
        list.culled = 0;
        assert_int_equal(cloud_cut(instance, &blocks, &camera.cut, &list), PBR_OK);
        assert_int_equal(mark(&blocks, &list, marks, DISCS) + list.culled, DISCS);
        for (int i = 0; i < DISCS; i++) {
            culled += marks[i] == 0;
            points_only += marks[i] == 1;
            for (int direction = 0; direction < 2; direction++) {
                const double position[3] = {(double)cloud->positions[i][0], (double)cloud->positions[i][1],
                                            (double)cloud->positions[i][2]};
                const struct clip_disc disc = random_disc(&camera, position, (double)cloud->radii[i], direction == 0);
                const bool fits = disc_fits_a_point(&camera.cut, &disc);
                if ((marks[i] == 1 && fits) || marks[i] == 3 || !disc_is_visible(&camera.cut, &disc)) continue;
                fail_msg("view %d, block %d, disc %d of radius %g is %s", v, i / BLOCK_DISCS, i, (double)cloud->radii[i],
                         marks[i] ? "left to GL points" : "left out");
            }
            quads_needed += marks[i] == 3;
        }
    }
    assert_true(culled > (long)DISCS * DISC_VIEWS / 3);
    assert_true(points_only > (long)DISCS * DISC_VIEWS / 10);
    assert_true(quads_needed > 0);
    pbr_free(instance, list.ranges);
    free(cloud);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* A view's plane in eye space, value(p) = normal . p + offset >= 0 inside: the sides through the centres of the outermost pixels,
 * moved out by the spread. */
static double eye_plane(const struct cut_view *view, int i, double normal[3]) {
    const double *m = view->projection, sign = i % 2 ? -1 : 1;
    const double w = i >= 4 ? !(view->zero_to_one && i == 4) : 1 + (2 * view->spread - 1) / view->viewport[i / 2];
    for (int k = 0; k < 3; k++) normal[k] = sign * m[4 * k + i / 2] + w * m[4 * k + 3];
    return sign * m[12 + i / 2] + w * m[15];
}

/* Moves from `from` by the shortest way to the most violated plane. False if that does not lead into the view. */
static bool reach_into_view(const struct cut_view *view, const double from[3], double *way) {
    double worst = 0, normal[3], to[3] = {0, 0, 0}, clip[4];
    for (int i = 0; i < 6; i++) {
        const double value = eye_plane(view, i, normal) + dot3(normal, from), distance = -value / length3(normal);
        if (!(distance > worst)) continue;
        worst = distance;
        for (int k = 0; k < 3; k++) to[k] = from[k] + distance * (1 + 1e-9) * normal[k] / length3(normal);
    }
    if (!(worst > 0)) return false;
    for (int i = 0; i < 6; i++)
        if (eye_plane(view, i, normal) + dot3(normal, to) < 0) return false;
    transform(view->projection, to, 1, clip);
    *way = worst * (1 + 1e-9);
    return clip[3] > 0;
}

/* Splats whose radius, or smallest size, is just what it takes. */
static void a_disc_that_just_reaches_into_the_view_is_kept(void **unused) {
    (void)unused;
    enum { TRIES = 1500 };
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    long reached[3] = {0};
    for (int v = 0; v < DISC_VIEWS; v++) {
        struct disc_camera camera;
        random_camera(v, &camera);
        camera.cut.size_maximum = 1e18;
        for (int n = 0; n < TRIES; n++) {
            struct block block = {.count = 1};
            struct chunk chunk = {.count = 1, .block_count = 1};
            const struct blocks blocks = {.blocks = &block, .chunks = &chunk, .block_count = 1, .chunk_count = 1};
            struct draw_list list = {0};
            double eye[4], clip[4], way;
            for (int k = 0; k < 3; k++) block.centre[k] = (float)(6 * random_number() - 3);
            transform(camera.to_eye, block.centre, 1, eye);
            transform(camera.cut.projection, eye, 1, clip);
            if (!reach_into_view(&camera.cut, eye, &way)) continue;
            const bool by_size = n % 2 && clip[3] > 0;
            camera.cut.size_minimum = by_size ? way * 2 * camera.pixels_per_unit / clip[3] * (1 + 1e-9) : 0;
            block.largest_splat = by_size ? 0 : float_above(way / camera.cut.reach_per_radius);
            assert_int_equal(cloud_cut(instance, &blocks, &camera.cut, &list), PBR_OK);
            if (list.count == 0)
                fail_msg("view %d: a splat at %g %g %g, w %g, that reaches %g %s is left out", v, eye[0], eye[1], eye[2], clip[3],
                         way, by_size ? "by its smallest size" : "by its radius");
            reached[by_size ? 0 : clip[3] > 0 ? 1 : 2]++;
            pbr_free(instance, list.ranges);
        }
    }
    for (int i = 0; i < 3; i++) assert_true(reached[i] > 1000);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* How far a blurred splat reaches towards the view's middle, pixels: from the middle of its disc's outline by the root of the sum
 * of the squares of the spread and of the outline's half side. The disc lies along `change`, that of the window position per unit.
 */
static double inward_reach(const double change[3], const double w_row[3], double w, double radius, double spread, double side) {
    const double half = radius * length3(change), steep = radius / w * dot3(w_row, change) / length3(change);
    const double grow = 1 / (1 - steep * steep), middle = -grow * half * steep;
    return sqrt(grow * half * half + middle * middle + spread * spread) - side * middle;
}

static void a_blurred_splat_that_just_reaches_into_the_view_is_kept(void **unused) {
    (void)unused;
    enum { TRIES = 1500 };
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    long reached = 0;
    for (int v = 0; v < DISC_VIEWS; v++) {
        struct disc_camera camera;
        random_camera(v, &camera);
        const struct cut_view *view = &camera.cut;
        const double *m = view->projection, w_row[3] = {m[3], m[7], m[11]};
        camera.cut.size_minimum = 0, camera.cut.size_maximum = 1e18;
        for (int n = 0; n < TRIES && view->spread > 0; n++) {
            struct block block = {.count = 1};
            struct chunk chunk = {.count = 1, .block_count = 1};
            const struct blocks blocks = {.blocks = &block, .chunks = &chunk, .block_count = 1, .chunk_count = 1};
            struct draw_list list = {0};
            double clip[4], change[3];
            for (int k = 0; k < 3; k++) block.centre[k] = (float)(6 * random_number() - 3);
            transform(view->to_clip, block.centre, 1, clip);
            const double w = clip[3], z = view->zero_to_one ? 2 * clip[2] - w : clip[2];
            const int side = fabs(clip[1]) > fabs(clip[0]);
            if (!(w > 0) || fabs(z) > w || fabs(clip[!side]) > w) continue;
            const double half = view->viewport[side] / 2, beyond = fabs(clip[side] / w) * half - (half - 0.5);
            for (int k = 0; k < 3; k++) change[k] = (m[4 * k + side] - clip[side] / w * w_row[k]) * half / w;
            double radius = sqrt(view->largest_spread) * w / length3(w_row), step = radius;
            const double outward = clip[side] > 0 ? 1 : -1;
            if (beyond <= 0 || !(length3(w_row) > 0)) continue;
            if (inward_reach(change, w_row, w, radius, view->spread, outward) < beyond) continue;
            for (int i = 0; i < 60; i++) { /* down to the least that reaches */
                step /= 2;
                if (radius > step && inward_reach(change, w_row, w, radius - step, view->spread, outward) >= beyond) radius -= step;
            }
            block.largest_splat = float_above(radius * (1 + 1e-9) / view->reach_per_radius);
            assert_int_equal(cloud_cut(instance, &blocks, view, &list), PBR_OK);
            if (list.count == 0)
                fail_msg("view %d: a splat %g pixels beyond the outermost pixel, of radius %g at w %g, is left out", v, beyond,
                         radius, w);
            reached++;
            pbr_free(instance, list.ranges);
        }
    }
    assert_true(reached > 300);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* Somewhere in the view and near one of its sides; in eye space. */
static void by_a_side(const struct cut_view *view, double out[3]) {
    const double *m = view->projection, near_side = 1 - pow(1e-4, random_number()), other = 1.8 * random_number() - 0.9;
    const double x = random_number() < 0.5 ? -near_side : near_side;
    const bool upright = random_number() < 0.5;
    out[2] = m[11] != 0 ? -0.7 - random_number() : 0;
    const double w = m[11] * out[2] + m[15];
    out[0] = ((upright ? other : x) * w - m[8] * out[2] - m[12]) / m[0];
    out[1] = ((upright ? x : other) * w - m[9] * out[2] - m[13]) / m[5];
}

/* Discs around a point of eye space that are largest on the screen along an axis, or whose box is farthest off their centre. */
static struct clip_disc worst_disc(const struct cut_view *view, const double position[3], double radius, int axis, int way) {
    const double *m = view->projection;
    struct clip_disc disc;
    double a[3], b[3], change[3], w_row[3] = {m[3], m[7], m[11]};
    transform(m, position, 1, disc.centre);
    for (int k = 0; k < 3; k++) change[k] = m[4 * k + axis] - disc.centre[axis] / disc.centre[3] * w_row[k];
    const double w_length = length3(w_row) > 0 ? length3(w_row) : 1;
    for (int k = 0; k < 3; k++) a[k] = change[k] / length3(change) + way * w_row[k] / w_length;
    if (!(length3(a) > 0)) random_unit(a);
    if (way != 0 && length3(w_row) > 0) cross3(change, w_row, b);
    else {
        double any[3];
        random_unit(any);
        cross3(a, any, b);
    }
    const double a_length = length3(a), b_length = length3(b);
    for (int k = 0; k < 3; k++) a[k] *= radius / a_length, b[k] *= radius / b_length;
    transform(m, a, 0, disc.across[0]);
    transform(m, b, 0, disc.across[1]);
    return disc;
}

/* Blocks of one splat by the view's sides, of sizes around the limit of GL points. */
static void a_disc_left_to_gl_points_fits_one(void **unused) {
    (void)unused;
    enum { TRIES = 1500 };
    static const double limits[] = {8, 64, 1000};
    pbr_instance *instance = NULL;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    long points_only = 0, quads = 0;
    for (int v = 0; v < DISC_VIEWS; v++) {
        struct disc_camera camera;
        struct cut_view *view = &camera.cut;
        random_camera(v, &camera);
        if (v / 6 % 2) view->projection[0] *= 0.2, view->projection[5] *= 0.2, camera.pixels_per_unit *= 0.2; /* a wide angle */
        memcpy(view->to_clip, view->projection, sizeof view->to_clip);
        camera.stretch = camera.radius_scale = view->reach_per_radius = 1;
        view->size_per_radius = 2 * camera.pixels_per_unit;
        view->size_maximum = 1e18;
        view->point_limit = limits[v / 12 % 3];
        for (int n = 0; n < TRIES; n++) {
            struct block block = {.count = 1};
            struct chunk chunk = {.count = 1, .block_count = 1};
            const struct blocks blocks = {.blocks = &block, .chunks = &chunk, .block_count = 1, .chunk_count = 1};
            struct draw_list list = {0};
            const double size = view->point_limit * (n % 4 ? random_number() : 1 - 0.1 * pow(1e-3, random_number()));
            by_a_side(view, block.centre);
            const double w = view->projection[11] * block.centre[2] + view->projection[15];
            view->size_minimum = n % 2 ? size : 0;
            block.largest_splat = n % 2 ? 0 : (float)(size * w / (2 * camera.pixels_per_unit));
            const double radius = n % 2 ? size * w / (2 * camera.pixels_per_unit) : (double)block.largest_splat;
            assert_int_equal(cloud_cut(instance, &blocks, view, &list), PBR_OK);
            const bool left_to_points = list.count == 1 && !list.ranges[0].quads;
            points_only += left_to_points;
            quads += !left_to_points;
            for (int direction = 0; direction < 6 && left_to_points; direction++) {
                const struct clip_disc disc = worst_disc(view, block.centre, radius, direction % 2, direction / 2 - 1);
                if (!disc_fits_a_point(view, &disc))
                    fail_msg("view %d: a disc of %g pixels at %g %g %g does not fit into a GL point", v, size, block.centre[0],
                             block.centre[1], block.centre[2]);
            }
            pbr_free(instance, list.ranges);
        }
    }
    assert_true(points_only > 5000);
    assert_true(quads > 5000);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

/* ---- back faces ---- */

static pbr_points *make_sphere(pbr_instance *instance, bool with_a_gap) {
    float(*positions)[3] = malloc(POINTS * sizeof *positions), (*normals)[3] = malloc(POINTS * sizeof *normals);
    for (int i = 0; i < POINTS; i++) {
        double n[3];
        random_unit(n);
        for (int k = 0; k < 3; k++) positions[i][k] = (float)(n[k] + 0.01 * random_number()), normals[i][k] = (float)n[k];
        if (with_a_gap && i % 50 == 0) memset(normals[i], 0, sizeof normals[i]);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.01f;
    pbr_points *points = NULL;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    free(positions);
    free(normals);
    return points;
}

/* What faces the eye, a point or with w = 0 a direction, by the rule of pbr_item's flag. */
static bool faces(const struct splat *splat, const double origin[3], const double eye[4]) {
    float normal[3];
    double product = 0;
    splat_decode_normal(splat->normal, normal);
    for (int k = 0; k < 3; k++) product += (double)normal[k] * (eye[k] - eye[3] * (origin[k] + (double)splat->position[k]));
    return product >= 0;
}

/* All is in view, so what is left out is left out for facing away. */
static void no_splat_that_faces_the_eye_is_dropped_with_its_block(void **unused) {
    pbr_instance *instance = NULL;
    (void)unused;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    for (int gap = 0; gap < 2; gap++) {
        pbr_points *points = make_sphere(instance, gap);
        struct blocks blocks;
        struct draw_list list = {0};
        assert_int_equal(blocks_build(points, &blocks), PBR_OK);
        assert_int_equal(blocks.chunk_count, 1);
        struct splat *splats = malloc(POINTS * sizeof *splats);
        bool *kept = malloc(POINTS * sizeof *kept);
        blocks_pack(points, &blocks, 0, splats);
        for (int i = 0; i < VIEWS; i++) {
            struct cut_view view = {.size_per_radius = 100,
                                    .size_minimum = 1,
                                    .size_maximum = 1e9,
                                    .point_limit = 1e9,
                                    .viewport = {1000, 1000},
                                    .culls = true,
                                    .eye = {0, 0, 0, i % 2}};
            uint64_t faced = 0;
            random_unit(view.eye);
            for (int k = 0; k < 3; k++) view.eye[k] *= i % 2 ? 1.02 + i / 10.0 : 1;
            for (int k = 0; k < 4; k++) view.to_clip[5 * k] = k < 3 ? 0.1 : 1; /* parallel, much wider than the sphere */
            list.count = list.culled = 0;
            assert_int_equal(cloud_cut(instance, &blocks, &view, &list), PBR_OK);
            memset(kept, 0, POINTS * sizeof *kept);
            for (size_t r = 0; r < list.count; r++)
                for (uint32_t n = 0; n < list.ranges[r].count; n++) kept[list.ranges[r].first + n] = true;
            for (int n = 0; n < POINTS; n++) {
                faced += faces(&splats[n], blocks.chunks[0].origin, view.eye);
                if (faces(&splats[n], blocks.chunks[0].origin, view.eye)) assert_true(kept[n]);
            }
            if (gap) assert_int_equal(list.culled, 0); /* each block has splats that face everywhere */
            else assert_true(list.culled > (POINTS - faced) / 4);
        }
        free(splats);
        free(kept);
        pbr_free(instance, list.ranges);
        blocks_free(instance, &blocks);
        pbr_points_release(&points);
    }
    pbr_instance_destroy(&instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(cut_keeps_every_visible_splat_and_quads_where_needed),
                                       cmocka_unit_test(a_cloud_well_within_the_view_is_one_range_of_points),
                                       cmocka_unit_test(float_error_at_the_edge_never_loses_a_splat),
                                       cmocka_unit_test(every_disc_in_the_view_is_drawn_by_what_can),
                                       cmocka_unit_test(a_disc_left_to_gl_points_fits_one),
                                       cmocka_unit_test(a_disc_that_just_reaches_into_the_view_is_kept),
                                       cmocka_unit_test(a_blurred_splat_that_just_reaches_into_the_view_is_kept),
                                       cmocka_unit_test(no_splat_that_faces_the_eye_is_dropped_with_its_block)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
