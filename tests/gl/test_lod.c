/* Hierarchies on the screen: their leaves are drawn as the same points are, what does not change costs nothing, and what was made
 * is taken back. SPDX-License-Identifier: MIT */
#include "ball.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int count_objects(void) {
    int count = 0;
    for (GLuint i = 1; i < 400; i++)
        count += glIsBuffer(i) + glIsTexture(i) + glIsVertexArray(i) + glIsProgram(i) + glIsShader(i) + glIsFramebuffer(i) +
                 glIsRenderbuffer(i) + glIsSampler(i) + glIsQuery(i);
    return count;
}

static pbr_renderer_info info_of(const struct host *host) {
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    return info;
}

/* ---- The picture ---- */

/* Both draw the same records, but in another order, and relative to another origin. No depths tie, and no edge passes a pixel's
 * centre within rounding, so that opaque pictures are the same. Blended ones are sums in another order, of half floats where no
 * others can be blended: they agree to 60 dB, a quarter of a level of 255 on average. */
static void expect_same(const uint8_t (*a)[4], const uint8_t (*b)[4], bool blended, const char *what) {
    int different = 0;
    double squared = 0;
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < 4; k++) {
            const int difference = abs(a[i][k] - b[i][k]);
            different += difference > 0;
            squared += difference * difference;
        }
    if (blended ? squared <= 1e-6 * 255 * 255 * PIXELS * 4 : different == 0) return;
    picture_save("lod_wanted", a, SIZE, SIZE);
    picture_save("lod_wrong", b, SIZE, SIZE);
    fail_msg("%s: %d values differ", what, different);
}

struct kind {
    const char *name;
    uint32_t splat, blending, shading;
};
static const struct kind kinds[] = {{"circle", PBR_SPLAT_CIRCLE, PBR_BLEND_KIND, PBR_SHADE_PHONG},
                                    {"square", PBR_SPLAT_SQUARE, PBR_BLEND_KIND, PBR_SHADE_NONE},
                                    {"ellipse", PBR_SPLAT_ELLIPSE, PBR_BLEND_KIND, PBR_SHADE_PHONG},
                                    {"gaussian", PBR_SPLAT_GAUSSIAN, PBR_BLEND_KIND, PBR_SHADE_PHONG},
                                    {"ewa", PBR_SPLAT_EWA, PBR_BLEND_KIND, PBR_SHADE_DEFERRED},
                                    {"ewa-max", PBR_SPLAT_EWA_MAX, PBR_BLEND_KIND, PBR_SHADE_PHONG},
                                    {"filled circle", PBR_SPLAT_CIRCLE, PBR_BLEND_FILL, PBR_SHADE_PHONG},
                                    {"filled square", PBR_SPLAT_SQUARE, PBR_BLEND_FILL, PBR_SHADE_PHONG},
                                    {"filled ellipse", PBR_SPLAT_ELLIPSE, PBR_BLEND_FILL, PBR_SHADE_PHONG}};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static pbr_item item_of_kind(const pbr_lod *lod, const struct kind *kind) {
    pbr_item item = lod_item(lod, kind->splat);
    item.blending = kind->blending;
    item.shading = kind->shading;
    return item;
}

static bool is_blended(const pbr_item *item) {
    return item->splat >= PBR_SPLAT_GAUSSIAN || item->blending == PBR_BLEND_FILL;
}

/* The item's picture against that of its leaves as a point set. */
static void check_leaves(struct host *host, const struct target *target, const pbr_frame *frame, const pbr_item *item,
                         const pbr_points *leaves, const char *what) {
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    pbr_item plain = *item;
    plain.points = leaves;
    plain.lod = NULL;
    pbr_stats by_points = draw_picture(host, target, frame, &plain, 1, wanted);
    pbr_stats by_lod = draw_picture(host, target, frame, item, 1, got);
    assert_int_equal(by_lod.points, by_points.points);
    assert_int_equal(by_lod.is_final, 1);
    if (covered_pixels(wanted, PIXELS) < PIXELS / 20) fail_msg("%s: next to nothing is drawn", what);
    expect_same((const uint8_t(*)[4])wanted, (const uint8_t(*)[4])got, is_blended(item), what);
}

/* From outside; from within, where splats reach through the near plane and around the eye; a part of it; from very near, where many
 * are too near for points to blend them; and all of them as quads. */
static void leaves_draw_the_picture_of_the_points(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_points *leaves = NULL;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 1);
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
    for (int camera = 0; camera < 5; camera++) {
        pbr_frame frame = make_frame(camera);
        if (camera == 1) frame.view[14] = -0.8;
        if (camera == 2) {
            frame.flags = PBR_FRAME_SCISSOR;
            frame.scissor[0] = 20, frame.scissor[1] = 31, frame.scissor[2] = 50, frame.scissor[3] = 40;
            frame.viewport[0] = 3, frame.viewport[2] = SIZE - 7;
        }
        if (camera == 3) {
            matrix_perspective(1.8, 1, 0.05, 6, frame.projection);
            frame.view[14] = -1.35;
        }
        if (camera == 4) host_use_quads(host);
        for (int k = 0; k < KINDS; k++) {
            char what[64];
            pbr_item item = item_of_kind(lod, &kinds[k]);
            snprintf(what, sizeof what, "%s, camera %d", kinds[k].name, camera);
            check_leaves(host, &target, &frame, &item, leaves, what);
        }
    }
    pbr_points_release(&leaves);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Whatever else an item can ask for. */
static void items_of_hierarchies_take_what_items_of_points_take(void **state) {
    static const double plane[4] = {0.2, 1, 0.1, 0.3};
    static const char *const names[] = {"back faces",  "blended back faces", "normals",      "depth",
                                        "clip planes", "radius_scale",       "size_minimum", "a mirror that stretches"};
    struct host *host = *state;
    struct target target;
    pbr_points *leaves = NULL;
    double mirror[16];
    target_open(&target, SIZE);
    matrix_scaling(-1, 0.6, 1.3, mirror);
    pbr_lod *lod = lod_of(host, 2);
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
    for (int i = 0; i < 8; i++) {
        pbr_frame frame = make_frame(i);
        pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
        switch (i) {
        case 0: item.flags = PBR_ITEM_CULL_BACK_FACES; break;
        case 1: item.flags = PBR_ITEM_CULL_BACK_FACES, item.splat = PBR_SPLAT_GAUSSIAN; break;
        case 2: item.colour_source = PBR_COLOUR_NORMAL, item.shading = PBR_SHADE_NONE; break;
        case 3: item.colour_source = PBR_COLOUR_DEPTH, item.scalar_range[0] = 2, item.scalar_range[1] = 4; break;
        case 4: item.clip_planes = plane, item.clip_plane_count = 1; break;
        case 5: item.radius_scale = 0.7f, item.splat = PBR_SPLAT_ELLIPSE; break;
        case 6: item.size_minimum = 5, item.size_maximum = 9; break;
        default: item.transforms = mirror, item.transform_count = 1, item.splat = PBR_SPLAT_ELLIPSE; break;
        }
        check_leaves(host, &target, &frame, &item, leaves, names[i]);
    }
    pbr_points_release(&leaves);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Flattened, tiny, huge and far away, as points are. */
static void odd_transforms_draw_the_picture_of_the_points(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_points *leaves = NULL;
    double model[16], view[16];
    char what[64];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 23); /* a cloud in which no two circles have one depth */
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
    for (int i = 0; i < 5; i++) {
        const double scale = i == 1 ? 1e-12 : i == 2 ? 1e12 : 1;
        for (int k = 0; k < KINDS; k++) {
            pbr_frame frame = make_frame(1);
            pbr_item item = item_of_kind(lod, &kinds[k]);
            item.transforms = model;
            item.transform_count = 1;
            matrix_scaling(scale, scale, i == 3 ? 0 : scale, model);
            if (i == 0) { /* survey coordinates */
                matrix_translation(5e5, 5.4e6, 300, model);
                matrix_translation(-5e5, -5.4e6, -300 - 3.1, view);
                memcpy(frame.view, view, sizeof view);
            }
            if (scale != 1) { /* the camera goes along */
                matrix_scaling(1 / scale, 1 / scale, 1 / scale, view);
                for (int c = 0; c < 12; c++) frame.view[c] *= view[0];
            }
            if (i == 4) matrix_ortho(-1.2, 1.2, -1.2, 1.2, 0.5, 6, frame.projection);
            if (i == 3 && k >= 2) continue; /* discs in one plane tie everywhere */
            snprintf(what, sizeof what, "%s, case %d", kinds[k].name, i);
            check_leaves(host, &target, &frame, &item, leaves, what);
        }
    }
    pbr_points_release(&leaves);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Its range is found from the sphere around the hierarchy, so that no colour is at the map's end; the nearest are dark blue. */
static void depth_has_a_range_of_its_own(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    int first = 0;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 2);
    pbr_frame frame = make_frame(0);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    item.colour_source = PBR_COLOUR_DEPTH;
    item.shading = PBR_SHADE_NONE;
    draw_picture(host, &target, &frame, &item, 1, pixels);
    for (int i = 0; i < PIXELS; i++) first += pixels[i][3] > 0 && memcmp(pixels[i], pixels[PIXELS / 2 + SIZE / 2], 4) != 0;
    assert_true(first > PIXELS / 20); /* not all of one colour */
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Splats without normals face the eye, and those of a hierarchy of nothing are none. */
static void missing_normals_and_missing_points_are_drawn_as_such(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    float positions[POINTS][3];
    uint64_t seed = 3;
    target_open(&target, SIZE);
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)random_between(&seed, -1, 1);
    for (int count = 0; count <= POINTS; count += POINTS) {
        pbr_points *points = NULL, *leaves = NULL;
        pbr_lod *lod = NULL;
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
        desc.count = (uint64_t)count;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
        desc.radius = 0.05f;
        assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
        lod_desc.points = points;
        assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
        assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
        for (int k = 0; k < KINDS; k++) {
            pbr_frame frame = make_frame(k);
            pbr_item item = item_of_kind(lod, &kinds[k]);
            if (k % 2) item.colour_source = PBR_COLOUR_NORMAL;
            if (count) check_leaves(host, &target, &frame, &item, leaves, kinds[k].name);
            else draw_picture(host, &target, &frame, &item, 1, pixels);
            if (!count) assert_int_equal(covered_pixels(pixels, PIXELS), 0);
        }
        pbr_points_release(&points);
        pbr_points_release(&leaves);
        pbr_lod_release(&lod);
    }
    target_close(&target);
}

static void a_coarser_threshold_draws_fewer_splats(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4], again[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 3);
    pbr_frame frame = make_frame(0);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    const uint64_t leaves = draw_picture(host, &target, &frame, &item, 1, pixels).splats_drawn;
    assert_true(leaves > POINTS / 2 && leaves <= POINTS);
    frame.threshold = 12;
    const uint64_t nodes = draw_picture(host, &target, &frame, &item, 1, pixels).splats_drawn;
    assert_true(nodes < leaves);
    frame.threshold = 0;
    draw_picture(host, &target, &frame, &item, 1, pixels);
    frame.threshold = 1; /* the same, and known to be the same */
    assert_int_equal(draw_picture(host, &target, &frame, &item, 1, again).nodes_visited, 0);
    assert_memory_equal(pixels, again, sizeof pixels);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Of splats under a pixel most hold no pixel's centre. Where the picture cannot move from these, they are not drawn; nothing is
 * missing, and all of them are there as soon as it can. */
static void splats_between_the_pixels_are_not_drawn(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t still[PIXELS][4], shifted[PIXELS][4];
    host_use_threads(host, 2);
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 1);
    for (int k = 0; k < KINDS; k++) {
        pbr_frame frame = turned_frame(0.3 * k, 15, 0.5, 20, SIZE);
        frame.threshold = k % 2 ? PBR_THRESHOLD_LEAVES : 0.9f;
        const pbr_item item = item_of_kind(lod, &kinds[k]);
        const bool is_disc = item.splat == PBR_SPLAT_ELLIPSE || item.splat == PBR_SPLAT_GAUSSIAN;
        const bool knows = is_disc && item.blending != PBR_BLEND_FILL;
        const pbr_stats some = draw_picture(host, &target, &frame, &item, 1, still);
        frame.jitter[k % 2] = 1e-9; /* less than a float of the matrix shows */
        const pbr_stats all = draw_picture(host, &target, &frame, &item, 1, shifted);
        assert_int_equal(all.nodes_visited, 0);
        assert_true(covered_pixels(still, PIXELS) > PIXELS / 80);
        expect_same((const uint8_t(*)[4])shifted, (const uint8_t(*)[4])still, is_blended(&item), kinds[k].name);
        if (knows ? some.splats_drawn >= all.splats_drawn * 3 / 4 : some.splats_drawn != all.splats_drawn)
            fail_msg("%s: %llu of %llu splats are drawn", kinds[k].name, (unsigned long long)some.splats_drawn,
                     (unsigned long long)all.splats_drawn);
        /* The same cut from elsewhere, until there is another. */
        frame.jitter[k % 2] = 0;
        frame.flags = 0;
        frame.view[12] += 0.01;
        const pbr_stats moved = draw_picture(host, &target, &frame, &item, 1, shifted);
        assert_int_equal(moved.nodes_visited, 0);
        assert_int_equal(moved.splats_drawn, all.splats_drawn);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Each with a cut of its own; items without an id of their own, too. */
static void transforms_are_cut_one_by_one(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    double models[3][16];
    pbr_item items[3];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 4);
    pbr_frame frame = make_frame(0);
    for (int i = 0; i < 3; i++) {
        matrix_scaling(0.5, 0.5, 0.5, models[i]);
        models[i][12] = i - 1;
        models[i][13] = 0.4 * i;
        items[i] = lod_item(lod, PBR_SPLAT_CIRCLE);
        items[i].transforms = models[i];
        items[i].transform_count = 1;
    }
    for (int k = 0; k < KINDS; k++) {
        for (int i = 0; i < 3; i++) {
            items[i].splat = kinds[k].splat;
            items[i].blending = kinds[k].blending;
        }
        pbr_stats stats = draw_picture(host, &target, &frame, items, 3, wanted);
        assert_int_equal(stats.points, 3 * POINTS);
        pbr_item all = items[0];
        all.transforms = models[0];
        all.transform_count = 3;
        all.id = 7;
        draw_picture(host, &target, &frame, &all, 1, got);
        assert_memory_equal(wanted, got, sizeof wanted);
        assert_true(covered_pixels(got, PIXELS) > PIXELS / 20);
        stats = draw_picture(host, &target, &frame, items, 3, got);
        assert_int_equal(stats.nodes_visited, 0);
        assert_int_equal(stats.upload_bytes, 0);
        assert_memory_equal(wanted, got, sizeof wanted);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- What it costs ---- */

static void an_unchanged_view_costs_nothing(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 5);
    pbr_frame frame = make_frame(0);
    for (int k = 0; k < KINDS; k++) {
        pbr_item item = item_of_kind(lod, &kinds[k]);
        item.id = (uint64_t)k;
        pbr_stats first = draw_picture(host, &target, &frame, &item, 1, wanted);
        assert_true(first.nodes_visited > 0 && first.upload_bytes > 0);
        const size_t allocations = host->memory.allocations;
        const uint64_t objects = info_of(host).gpu_object_count;
        for (int i = 0; i < 3; i++) {
            pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
            assert_int_equal(stats.nodes_visited, 0);
            assert_int_equal(stats.upload_bytes, 0);
            assert_int_equal(stats.programs_compiled, 0);
            assert_int_equal(stats.splats_drawn, first.splats_drawn);
            assert_int_equal(stats.splats_culled, first.splats_culled);
            assert_memory_equal(wanted, got, sizeof wanted);
        }
        assert_int_equal(host->memory.allocations, allocations);
        assert_int_equal(info_of(host).gpu_object_count, objects);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Whatever it depends on. */
static void a_changed_view_is_cut_again(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    double model[16];
    target_open(&target, SIZE);
    matrix_translation(0.1, 0, 0, model);
    pbr_lod *lod = lod_of(host, 5);
    for (int i = 0; i < 9; i++) {
        pbr_frame frame = make_frame(0);
        pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
        draw_picture(host, &target, &frame, &item, 1, pixels);
        switch (i) {
        case 0: frame.view[12] = 0.1; break;
        case 1: frame.threshold = 3; break;
        case 2: frame.viewport[2] = SIZE - 1; break;
        case 3: frame.jitter[0] = 1.25; break; /* up to 1 is in every cut */
        case 4: item.transforms = model, item.transform_count = 1; break;
        case 5: item.radius_scale = 1.5f; break;
        case 6: item.size_minimum = 3; break;
        case 7: item.splat = PBR_SPLAT_ELLIPSE; break;
        default: item.flags = PBR_ITEM_CULL_BACK_FACES; break;
        }
        pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        if (stats.nodes_visited == 0 || stats.upload_bytes == 0) fail_msg("case %d is not noticed", i);
        draw_picture(host, &target, &frame, &item, 1, pixels);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

static void a_blended_item_is_cut_once_a_frame(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 5);
    pbr_frame frame = make_frame(0);
    pbr_item item = lod_item(lod, PBR_SPLAT_EWA);
    pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
    const uint64_t visited = stats.nodes_visited;
    assert_true(visited > 0);
    assert_true(stats.upload_bytes <= 24 * stats.points);
    frame = make_frame(1);
    stats = draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_true(stats.nodes_visited > 0 && stats.nodes_visited < 2 * visited);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A first time around, everything grows to its size; after that nothing is made, and the pictures are those of before. */
static void a_moving_camera_allocates_nothing_after_a_while(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t(*wanted)[PIXELS][4] = malloc(TURNS * sizeof *wanted), got[PIXELS][4];
    pbr_item items[3];
    target_open(&target, SIZE);
    assert_non_null(wanted);
    pbr_lod *lod = lod_of(host, 6);
    for (int i = 0; i < 3; i++) items[i] = item_of_kind(lod, &kinds[2 * i]);
    size_t allocations = 0;
    pbr_renderer_info before = PBR_RENDERER_INFO_INIT;
    for (int round = 0; round < 4; round++) {
        for (int turn = 0; turn < TURNS; turn++) {
            pbr_frame frame = make_frame(turn);
            frame.threshold = 2;
            pbr_stats stats = draw_picture(host, &target, &frame, items, 3, round ? got : wanted[turn]);
            assert_true(stats.nodes_visited > 0 && stats.upload_bytes > 0);
            if (round) assert_memory_equal(wanted[turn], got, sizeof got);
        }
        pbr_renderer_info info = info_of(host);
        if (round > 1) {
            assert_int_equal(host->memory.allocations, allocations);
            assert_int_equal(info.gpu_object_count, before.gpu_object_count);
            assert_int_equal(info.gpu_memory_bytes, before.gpu_memory_bytes);
        }
        allocations = host->memory.allocations;
        before = info;
    }
    free(wanted);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Frames that allocate no memory do not ask for errors, whether the camera moves or not. */
static void an_error_of_the_hosts_is_left(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 6);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    pbr_stats stats = PBR_STATS_INIT;
    for (int turn = 0; turn < 2 * TURNS; turn++) {
        pbr_frame frame = make_frame(turn);
        draw_picture(host, &target, &frame, &item, 1, pixels);
    }
    for (int turn = 0; turn < 6; turn++) {
        pbr_frame frame = make_frame(turn / 2);
        glEnable(GL_RGBA);
        assert_int_equal(pbr_render(host->view, &frame, &item, 1, &stats), PBR_OK);
        assert_int_equal(stats.host_gl_error, 0);
        assert_int_equal(glGetError(), GL_INVALID_ENUM);
        glFinish(); /* so that no buffer is busy */
    }
    context_forget_errors();
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A still view needs one buffer, a moving one at most three. */
static void the_ring_grows_as_the_camera_moves(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    uint64_t objects[6];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 6);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int i = 0; i < 6; i++) {
        pbr_frame frame = make_frame(i);
        draw_picture(host, &target, &frame, &item, 1, pixels);
        draw_picture(host, &target, &frame, &item, 1, pixels);
        objects[i] = info_of(host).gpu_object_count;
    }
    assert_int_equal(objects[1], objects[0] + 2); /* a buffer and its vertex array; a third one if the GPU were late */
    assert_int_equal(objects[5], objects[1]);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Drivers that will not ---- */

static GLenum APIENTRY never_done(GLsync sync, GLbitfield flags, GLuint64 timeout) {
    (void)sync, (void)flags;
    assert_int_equal(timeout, 0); /* nobody waits */
    return GL_TIMEOUT_EXPIRED;
}

static void *APIENTRY no_map(GLenum target, GLintptr offset, GLsizeiptr length, GLbitfield access) {
    (void)target, (void)offset, (void)length, (void)access;
    return NULL;
}

static GLboolean APIENTRY lost_map(GLenum target) {
    glUnmapBuffer(target);
    return GL_FALSE; /* "the data store contents have become corrupt" */
}

static GLsync APIENTRY no_fence(GLenum condition, GLbitfield flags) {
    (void)condition, (void)flags;
    return NULL;
}

enum obstacle { NEVER_DONE, NO_MAP, LOST_MAP, NO_FENCE, OBSTACLES };

static void *get_proc_past(void *user, const char *name) {
    void *replacement = NULL;
    GLenum(APIENTRY * wait)(GLsync, GLbitfield, GLuint64) = never_done;
    void *(APIENTRY * map)(GLenum, GLintptr, GLsizeiptr, GLbitfield) = no_map;
    GLboolean(APIENTRY * unmap)(GLenum) = lost_map;
    GLsync(APIENTRY * fence)(GLenum, GLbitfield) = no_fence;
    switch (*(const enum obstacle *)user) {
    case NEVER_DONE:
        if (!strcmp(name, "glClientWaitSync")) memcpy(&replacement, &wait, sizeof replacement);
        break;
    case NO_MAP:
        if (!strcmp(name, "glMapBufferRange")) memcpy(&replacement, &map, sizeof replacement);
        break;
    case LOST_MAP:
        if (!strcmp(name, "glUnmapBuffer")) memcpy(&replacement, &unmap, sizeof replacement);
        break;
    default:
        if (!strcmp(name, "glFenceSync")) memcpy(&replacement, &fence, sizeof replacement);
        break;
    }
    return replacement ? replacement : context_get_proc(NULL, name);
}

/* A GPU that is never done with a buffer, or no fences: new memory, which is counted. No maps: the records are sent. */
static void busy_buffers_and_failing_maps_change_no_picture(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t(*wanted)[PIXELS][4] = malloc(TURNS * sizeof *wanted), got[PIXELS][4];
    target_open(&target, SIZE);
    assert_non_null(wanted);
    pbr_lod *lod = lod_of(host, 7);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int turn = 0; turn < TURNS; turn++) {
        pbr_frame frame = make_frame(turn);
        draw_picture(host, &target, &frame, &item, 1, wanted[turn]);
    }
    for (enum obstacle obstacle = NEVER_DONE; obstacle < OBSTACLES; obstacle++) {
        pbr_renderer_desc desc = host_renderer_desc();
        desc.get_proc_address = get_proc_past;
        desc.get_proc_address_user = &obstacle;
        host_use_renderer(host, &desc);
        uint64_t orphaned = 0;
        for (int turn = 0; turn < TURNS; turn++) {
            pbr_frame frame = make_frame(turn);
            orphaned += draw_picture(host, &target, &frame, &item, 1, got).buffers_orphaned;
            assert_memory_equal(wanted[turn], got, sizeof got);
        }
        if (obstacle == NEVER_DONE || obstacle == NO_FENCE) assert_true(orphaned > TURNS / 2);
        else assert_true(orphaned <= TURNS);
    }
    free(wanted);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Lifetimes ---- */

static void hidden_items_keep_what_they_have(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 8);
    pbr_frame frame = make_frame(0);
    pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), lod_item(lod, PBR_SPLAT_CIRCLE)};
    items[1].id = 2;
    items[1].flags = PBR_ITEM_HIDDEN;
    pbr_stats stats = draw_picture(host, &target, &frame, items, 1, wanted);
    stats = draw_picture(host, &target, &frame, items, 2, got);
    assert_int_equal(stats.points, POINTS);
    assert_int_equal(stats.upload_bytes, 0);
    assert_memory_equal(wanted, got, sizeof wanted);
    const uint64_t objects = info_of(host).gpu_object_count;
    items[0].flags = PBR_ITEM_HIDDEN;
    for (int i = 0; i < 100; i++) {
        stats = render(host, &frame, items, 2);
        assert_int_equal(stats.points, 0);
        assert_int_equal(stats.splats_drawn, 0);
    }
    assert_int_equal(info_of(host).gpu_object_count, objects);
    items[0].flags = 0;
    stats = draw_picture(host, &target, &frame, items, 2, got);
    assert_int_equal(stats.nodes_visited + stats.upload_bytes, 0);
    assert_memory_equal(wanted, got, sizeof wanted);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* After some frames without it. What a host still draws stays, in whatever order it is given. */
static void a_removed_item_is_forgotten(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_item items[5];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 9), *other = lod_of(host, 10);
    pbr_frame frame = make_frame(0);
    for (int i = 0; i < 5; i++) {
        items[i] = lod_item(i == 2 ? other : lod, PBR_SPLAT_CIRCLE);
        items[i].id = (uint64_t)i;
    }
    draw_picture(host, &target, &frame, &items[2], 1, pixels);
    const pbr_renderer_info one = info_of(host);
    draw_picture(host, &target, &frame, items, 5, pixels);
    const pbr_renderer_info five = info_of(host);
    assert_true(five.gpu_object_count == one.gpu_object_count + 8 && five.gpu_memory_bytes > one.gpu_memory_bytes);
    for (int i = 0; i < 60; i++) { /* not yet; and turned around, they find their own */
        pbr_item turned[5] = {items[i % 5], items[(i + 4) % 5], items[(i + 2) % 5], items[(i + 1) % 5], items[(i + 3) % 5]};
        pbr_stats stats = render(host, &frame, turned, 5);
        assert_int_equal(stats.nodes_visited + stats.upload_bytes, 0);
    }
    const pbr_lod *name = other;
    size_t blocks = host->memory.blocks;
    pbr_lod_release(&other); /* the view's reference keeps it */
    assert_int_equal(host->memory.blocks, blocks);
    items[2].lod = name;
    assert_int_equal(render(host, &frame, &items[2], 1).upload_bytes, 0);
    for (int i = 0; i < 70; i++) render(host, &frame, &items[2], 1);
    assert_int_equal(info_of(host).gpu_object_count, one.gpu_object_count);
    assert_int_equal(info_of(host).gpu_memory_bytes, one.gpu_memory_bytes);
    blocks = host->memory.blocks;
    for (int i = 0; i < 70; i++) render(host, &frame, NULL, 0);
    assert_true(host->memory.blocks < blocks);
    assert_true(info_of(host).gpu_memory_bytes < one.gpu_memory_bytes);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void evicting_drops_cuts_and_references(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lods[2] = {lod_of(host, 11), lod_of(host, 12)};
    pbr_frame frame = make_frame(0);
    pbr_item items[2] = {lod_item(lods[0], PBR_SPLAT_CIRCLE), lod_item(lods[1], PBR_SPLAT_CIRCLE)};
    draw_picture(host, &target, &frame, items, 2, wanted);
    const pbr_renderer_info before = info_of(host);
    for (int way = 0; way < 3; way++) {
        if (way == 0) pbr_renderer_evict(host->renderer, NULL);
        if (way == 1) pbr_renderer_evict_lod(host->renderer, NULL);
        if (way == 2) pbr_renderer_evict_lod(host->renderer, lods[1]);
        assert_true(info_of(host).gpu_object_count <= before.gpu_object_count - (way == 2 ? 2 : 4));
        if (way < 2) assert_int_equal(info_of(host).gpu_memory_bytes, 0);
        pbr_stats stats = draw_picture(host, &target, &frame, items, 2, got);
        assert_true(stats.nodes_visited > 0 && stats.upload_bytes > 0);
        assert_memory_equal(wanted, got, sizeof wanted);
        assert_int_equal(info_of(host).gpu_object_count, before.gpu_object_count);
        assert_int_equal(info_of(host).gpu_memory_bytes, before.gpu_memory_bytes);
    }
    const pbr_lod *name = lods[1];
    pbr_lod_release(&lods[1]);
    const size_t blocks = host->memory.blocks;
    pbr_renderer_evict_lod(host->renderer, name);
    assert_true(host->memory.blocks + 1 < blocks); /* the hierarchy, too */
    pbr_renderer_evict_lod(NULL, name);
    pbr_lod_release(&lods[0]);
    target_close(&target);
}

static void a_view_takes_its_cuts_with_it(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_view *second = NULL;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 13);
    pbr_frame frame = make_frame(0), moved = make_frame(3);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    draw_picture(host, &target, &frame, &item, 1, pixels);
    const pbr_renderer_info one = info_of(host);
    assert_int_equal(pbr_view_create(host->renderer, NULL, &second), PBR_OK);
    assert_int_equal(pbr_render(second, &moved, &item, 1, NULL), PBR_OK);
    assert_int_equal(info_of(host).gpu_object_count, one.gpu_object_count + 2);
    assert_int_equal(draw_picture(host, &target, &frame, &item, 1, pixels).nodes_visited, 0); /* each remembers its own */
    pbr_view_destroy(&second);
    draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_int_equal(info_of(host).gpu_object_count, one.gpu_object_count);
    assert_int_equal(info_of(host).gpu_memory_bytes, one.gpu_memory_bytes);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void destroying_deletes_every_gl_object(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_renderer_desc desc = host_renderer_desc();
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 13);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    host_drop_renderer(host);
    const int objects = count_objects();
    const size_t blocks = host->memory.blocks;
    host_use_renderer(host, &desc);
    for (int turn = 0; turn < 5; turn++) {
        pbr_frame frame = make_frame(turn);
        draw_picture(host, &target, &frame, &item, 1, pixels);
    }
    assert_true(count_objects() > objects);
    host_drop_renderer(host);
    assert_int_equal(count_objects(), objects);
    assert_int_equal(host->memory.blocks, blocks);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* As after the loss of a context: there is none to call. */
static void an_abandoned_renderer_frees_its_cuts_without_a_context(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 14);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int turn = 0; turn < 5; turn++) {
        pbr_frame frame = make_frame(turn);
        draw_picture(host, &target, &frame, &item, 1, pixels);
    }
    context_release();
    pbr_renderer_abandon(host->renderer);
    pbr_renderer_evict_lod(host->renderer, lod);
    pbr_view_destroy(&host->view);
    assert_int_equal(pbr_renderer_destroy(&host->renderer), PBR_OK);
    context_restore();
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Limits ---- */

/* With room for one buffer the ring has one, and the picture is right; with less, nothing is drawn. */
static void a_budget_bounds_the_ring(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t(*wanted)[PIXELS][4] = malloc(TURNS * sizeof *wanted), got[PIXELS][4];
    uint64_t largest = 0;
    target_open(&target, SIZE);
    assert_non_null(wanted);
    pbr_lod *lod = lod_of(host, 15);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    for (int turn = 0; turn < TURNS; turn++) {
        pbr_frame frame = make_frame(turn);
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, wanted[turn]);
        largest = stats.upload_bytes > largest ? stats.upload_bytes : largest;
    }
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = largest;
    host_use_renderer(host, &desc);
    uint64_t objects = 0;
    for (int turn = 0; turn < TURNS; turn++) {
        pbr_frame frame = make_frame(turn);
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_true(stats.gpu_memory_bytes <= largest);
        assert_memory_equal(wanted[turn], got, sizeof got);
        if (turn == 4) objects = info_of(host).gpu_object_count;
    }
    assert_int_equal(info_of(host).gpu_object_count, objects);
    desc.gpu_memory_budget = 1000;
    host_use_renderer(host, &desc);
    pbr_frame frame = make_frame(0);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, NULL), PBR_ERROR_OUT_OF_GPU_MEMORY);
    target_read(&target, got);
    assert_int_equal(covered_pixels(got, PIXELS), 0);
    free(wanted);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Points and cuts make room for each other: what was drawn longest ago goes. */
static void the_budget_drops_cuts_and_points(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[2][PIXELS][4], got[PIXELS][4];
    pbr_points *points = NULL;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 16);
    assert_int_equal(make_points(host->instance, 17, &points), PBR_OK);
    pbr_frame frame = make_frame(0);
    pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), PBR_ITEM_INIT};
    items[1].points = points;
    for (int i = 0; i < 2; i++) draw_picture(host, &target, &frame, &items[i], 1, wanted[i]);
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = 24 * POINTS + 100; /* either */
    host_use_renderer(host, &desc);
    for (int i = 0; i < 6; i++) {
        const pbr_stats stats = draw_picture(host, &target, &frame, &items[i % 2], 1, got);
        assert_true(stats.upload_bytes > 0);
        assert_true(stats.gpu_memory_bytes <= desc.gpu_memory_budget);
        assert_int_equal(stats.nodes_visited > 0, i == 0 || i % 2 == 1); /* the cut itself is still known */
        assert_memory_equal(wanted[i % 2], got, sizeof got);
    }
    assert_int_equal(pbr_render(host->view, &frame, items, 2, NULL), PBR_ERROR_OUT_OF_GPU_MEMORY);
    pbr_points_release(&points);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void preparing_cuts_and_uploads(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t pixels[PIXELS][4];
    pbr_stats stats = PBR_STATS_INIT;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 18);
    pbr_frame frame = make_frame(0);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    assert_int_equal(pbr_prepare(host->view, &frame, &item, 1, &stats), PBR_OK);
    assert_true(stats.upload_bytes > 0);
    assert_int_equal(stats.splats_drawn, 0);
    target_read(&target, pixels);
    assert_int_equal(covered_pixels(pixels, PIXELS), 0);
    stats = draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_int_equal(stats.upload_bytes + stats.nodes_visited + stats.programs_compiled, 0);
    pbr_lod_release(&lod);
    target_close(&target);
}

static void wrong_items_are_refused(void **state) {
    static const float thresholds[] = {-2, -0.5f, NAN, INFINITY};
    struct host *host = *state;
    struct target target;
    pbr_points *points = NULL;
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 19);
    assert_int_equal(make_points(host->instance, 17, &points), PBR_OK);
    for (int i = 0; i < 7; i++) {
        pbr_frame frame = make_frame(0);
        pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), lod_item(lod, PBR_SPLAT_CIRCLE)};
        if (i == 0) items[1].points = points;
        else if (i == 1) items[1].lod = NULL;
        else if (i == 2) items[1].colour_source = PBR_COLOUR_SCALAR;
        else frame.threshold = thresholds[i - 3];
        const size_t errors = host->errors;
        assert_int_equal(pbr_render(host->view, &frame, items, 2, NULL), PBR_ERROR_INVALID_ARGUMENT);
        assert_int_equal(host->errors, errors + 1);
        assert_non_null(strstr(host->log, i < 3 ? "pbr_item 1" : "threshold"));
    }
    pbr_points_release(&points);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Memory ---- */

/* From building to the end, with a camera that moves; the first error, or PBR_OK. */
static pbr_result whole_life(struct host *host, const struct target *target) {
    pbr_instance *instance = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    pbr_lod *lod = NULL;
    double models[2][16];
    pbr_instance_desc instance_desc = host_instance_desc(host);
    pbr_renderer_desc renderer_desc = host_renderer_desc();
    target_bind(target);
    pbr_result result = pbr_instance_create(&instance_desc, &instance);
    if (!result) result = make_lod(instance, 20, &lod);
    if (!result) result = pbr_renderer_create(instance, &renderer_desc, &renderer);
    if (!result) result = pbr_view_create(renderer, NULL, &view);
    for (int i = 0; i < 2; i++) matrix_translation(i, 0, 0, models[i]);
    pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    item.transforms = models[0];
    item.transform_count = 2;
    for (int turn = 0; turn < 4 && !result; turn++) {
        pbr_frame frame = make_frame(turn);
        frame.threshold = turn < 2 ? 20 : PBR_THRESHOLD_LEAVES; /* more and more */
        result = pbr_render(view, &frame, &item, 1, NULL);
    }
    pbr_view_destroy(&view);
    assert_int_equal(pbr_renderer_destroy(&renderer), PBR_OK);
    pbr_lod_release(&lod);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    return result;
}

static void every_allocation_may_fail(void **state) {
    struct host *host = *state;
    struct target target;
    target_open(&target, SIZE);
    for (int only_one = 0; only_one < 2; only_one++) {
        assert_int_equal(whole_life(host, &target), PBR_OK);
        const int objects = count_objects();
        const size_t blocks = host->memory.blocks;
        for (size_t n = 1, failed = 1; failed; n++) {
            const size_t errors = host->errors;
            host->memory.fail_first = host->memory.allocations + n;
            host->memory.fail_last = only_one ? host->memory.fail_first : SIZE_MAX;
            pbr_result result = whole_life(host, &target);
            failed = host->memory.allocations >= host->memory.fail_first;
            host->memory.fail_first = 0;
            if (result != (failed ? PBR_ERROR_OUT_OF_MEMORY : PBR_OK))
                fail_msg("allocation %zu fails: %s", n, pbr_result_name(result));
            if (failed) assert_true(host->errors > errors);
            assert_int_equal(host->memory.blocks, blocks);
            assert_int_equal(count_objects(), objects);
            expect_no_gl_error("out of memory");
        }
    }
    target_close(&target);
}

static void a_failed_frame_can_be_drawn_again(void **state) {
    struct host *host = *state;
    struct target target;
    uint8_t wanted[PIXELS][4], got[PIXELS][4];
    target_open(&target, SIZE);
    pbr_lod *lod = lod_of(host, 21);
    pbr_frame frame = make_frame(0);
    pbr_item items[2] = {lod_item(lod, PBR_SPLAT_CIRCLE), lod_item(lod, PBR_SPLAT_CIRCLE)};
    items[1].splat = PBR_SPLAT_GAUSSIAN;
    draw_picture(host, &target, &frame, items, 2, wanted);
    int failures = 0;
    for (size_t n = 1; n < 100; n++) {
        pbr_renderer_evict(host->renderer, NULL);
        host->memory.fail_first = host->memory.allocations + n;
        host->memory.fail_last = SIZE_MAX;
        pbr_result result = pbr_render(host->view, &frame, items, 2, NULL);
        host->memory.fail_first = 0;
        if (result == PBR_OK) break;
        failures++;
        assert_int_equal(result, PBR_ERROR_OUT_OF_MEMORY);
        draw_picture(host, &target, &frame, items, 2, got);
        assert_memory_equal(wanted, got, sizeof wanted);
    }
    assert_true(failures > 2);
    pbr_lod_release(&lod);
    target_close(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(leaves_draw_the_picture_of_the_points),
        GL_TEST(items_of_hierarchies_take_what_items_of_points_take),
        GL_TEST(odd_transforms_draw_the_picture_of_the_points),
        GL_TEST(depth_has_a_range_of_its_own),
        GL_TEST(missing_normals_and_missing_points_are_drawn_as_such),
        GL_TEST(a_coarser_threshold_draws_fewer_splats),
        GL_TEST(splats_between_the_pixels_are_not_drawn),
        GL_TEST(transforms_are_cut_one_by_one),
        GL_TEST(an_unchanged_view_costs_nothing),
        GL_TEST(a_changed_view_is_cut_again),
        GL_TEST(a_blended_item_is_cut_once_a_frame),
        GL_TEST(a_moving_camera_allocates_nothing_after_a_while),
        GL_TEST(an_error_of_the_hosts_is_left),
        GL_TEST(the_ring_grows_as_the_camera_moves),
        GL_TEST(busy_buffers_and_failing_maps_change_no_picture),
        GL_TEST(hidden_items_keep_what_they_have),
        GL_TEST(a_removed_item_is_forgotten),
        GL_TEST(evicting_drops_cuts_and_references),
        GL_TEST(a_view_takes_its_cuts_with_it),
        GL_TEST(destroying_deletes_every_gl_object),
        GL_TEST(an_abandoned_renderer_frees_its_cuts_without_a_context),
        GL_TEST(a_budget_bounds_the_ring),
        GL_TEST(the_budget_drops_cuts_and_points),
        GL_TEST(preparing_cuts_and_uploads),
        GL_TEST(wrong_items_are_refused),
        GL_TEST(every_allocation_may_fail),
        GL_TEST(a_failed_frame_can_be_drawn_again),
    };
    return RUN_GL_TESTS("lod", tests);
}
