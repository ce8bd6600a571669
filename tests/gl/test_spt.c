/* Sequential point trees on the GPU: the vertex stage draws the nodes that spt_is_drawn says, no matter how they are seen.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/matrix.h"
#include "gl/sequences.h"
#include "lod/lod.h"

enum { SIZE = 128, PIXELS = SIZE * SIZE, POINTS = 40000 };

typedef uint8_t picture[PIXELS][4];

/* A bumpy ball of overlapping discs, so that depths do not tie; some have no normal. */
static pbr_points *make_points(struct host *host, bool normals) {
    static float positions[POINTS][3], directions[POINTS][3], radii[POINTS];
    pbr_points *points = NULL;
    uint64_t seed = 5;
    for (int i = 0; i < POINTS; i++) {
        const double height = 1 - (2 * i + 1) / (double)POINTS, around = 2.39996322972865 * i, width = sqrt(1 - height * height);
        const double direction[3] = {width * cos(around), height, width * sin(around)};
        const double out = 1 + 0.05 * sin(9 * direction[0]) * sin(7 * direction[1]) + random_between(&seed, 0, 1e-3);
        for (int k = 0; k < 3; k++) {
            positions[i][k] = (float)(out * direction[k]);
            directions[i][k] = i % 97 == 0 ? 0 : (float)direction[k];
        }
        radii[i] = (float)random_between(&seed, 0.015, 0.025);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    if (normals) desc.normals = (pbr_attribute){directions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    return points;
}

static pbr_lod *make_tree_of(struct host *host, const pbr_points *points, uint32_t flags) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.kind = PBR_LOD_SPT;
    desc.flags = flags;
    desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &desc, &lod), PBR_OK);
    return lod;
}

static pbr_lod *make_tree(struct host *host, bool normals) {
    pbr_points *points = make_points(host, normals);
    pbr_lod *lod = make_tree_of(host, points, 0);
    pbr_points_release(&points);
    assert_true(lod->spt.chunk_count > 1);
    return lod;
}

static int count_different(picture a, picture b) {
    int count = 0;
    for (int i = 0; i < PIXELS; i++) {
        int most = 0;
        for (int k = 0; k < 4; k++) most = abs(a[i][k] - b[i][k]) > most ? abs(a[i][k] - b[i][k]) : most;
        count += most > 3; /* normals are coded once more on the way */
    }
    return count;
}

/* ---- The nodes that are to be drawn, as points ---- */

/* As draw.c scales depth and error, from the definitions: e pixels-per-unit / w against the threshold, in units of depth. */
static void scale_of(const pbr_frame *frame, const double to_eye[16], const double to_clip[16], double radius, float *per_w,
                     float *s) {
    const double *p = frame->projection;
    const double pixels = fmax(fabs(p[0]), fabs(p[5])) * SIZE / 2, stretch = matrix_largest_stretch(to_eye);
    const double slope = sqrt(to_clip[3] * to_clip[3] + to_clip[7] * to_clip[7] + to_clip[11] * to_clip[11]);
    *per_w = (float)(slope > 0 ? 1 / slope : radius * 0x1p24);
    *s = frame->threshold > 0 ? (float)(pixels * stretch * (double)*per_w / (double)frame->threshold) : INFINITY;
}

/* What spt_is_drawn keeps, all that is left out of a frame by ranges included. */
static pbr_points *select_nodes(struct host *host, const pbr_lod *lod, const pbr_frame *frame, const double model[16]) {
    const struct spt *spt = &lod->spt;
    double(*positions)[3] = calloc(spt->count, sizeof *positions);
    float(*normals)[3] = calloc(spt->count, sizeof *normals), *radii = calloc(spt->count, sizeof *radii);
    uint8_t(*colours)[3] = calloc(spt->count, sizeof *colours);
    double to_eye[16], to_clip[16], moved[16], view[16];
    float per_w, s;
    size_t count = 0;
    assert_true(positions && normals && radii && colours);
    matrix_identity(view);
    if (frame->view[15] != 0) memcpy(view, frame->view, sizeof view);
    matrix_multiply(view, model, moved);
    matrix_translate(moved, spt->centre, to_eye);
    matrix_multiply(frame->projection, to_eye, to_clip);
    scale_of(frame, to_eye, to_clip, spt->radius, &per_w, &s);
    for (uint32_t c = 0; c < spt->chunk_count; c++) {
        const struct spt_chunk *chunk = &spt->chunks[c];
        double m[16];
        matrix_translate(to_clip, chunk->origin, m);
        for (uint32_t i = 0; i < chunk->count; i++) {
            const struct spt_entry *entry = &spt->entries[c][i];
            float at[3], w = (float)m[15];
            spt_decode_position(chunk, entry, at);
            for (int k = 0; k < 3; k++) w += (float)m[4 * k + 3] * at[k];
            if (!spt_is_drawn(spt_decode_error(chunk, entry->error), spt_decode_error(chunk, entry->parent_error),
                              spt_decode_distance(chunk, entry->distance), s, w * per_w))
                continue;
            for (int k = 0; k < 3; k++) positions[count][k] = spt->centre[k] + chunk->origin[k] + (double)at[k];
            splat_decode_normal(entry->normal, normals[count]);
            memcpy(colours[count], entry->colour, 3);
            radii[count++] = spt_decode_radius(chunk, entry);
        }
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    assert_true(count > 0);
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    free(positions), free(normals), free(radii), free(colours);
    return points;
}

/* Nodes near the borders of the test may fall to either side: positions are rounded another way. Of such a node's size a cut has
 * thousands, so a few pixels in a thousand at most. */
enum { FEW = PIXELS / 200 };

static void expect_selection(struct host *host, const struct target *target, const pbr_lod *lod, pbr_item item,
                             const pbr_frame *frame, const double model[16], const char *what) {
    static picture wanted, got;
    pbr_points *points = select_nodes(host, lod, frame, model);
    pbr_item plain = item;
    plain.id = 2;
    plain.lod = NULL;
    plain.points = points;
    item.transforms = plain.transforms = model;
    item.transform_count = plain.transform_count = 1;
    const pbr_stats stats = draw_picture(host, target, frame, &item, 1, got);
    draw_picture(host, target, frame, &plain, 1, wanted);
    const int different = count_different(wanted, got);
    if (different > FEW) {
        picture_save("spt_wanted", (const uint8_t(*)[4])wanted, SIZE, SIZE);
        picture_save("spt_got", (const uint8_t(*)[4])got, SIZE, SIZE);
        fail_msg("%s, splat %u, threshold %g: %d pixels differ", what, (unsigned)item.splat, (double)frame->threshold, different);
    }
    assert_true(covered_pixels(wanted, PIXELS) > 500);
    assert_int_equal(stats.is_final, 1);
    pbr_renderer_evict(host->renderer, points);
    pbr_points_release(&points);
}

static pbr_frame make_frame(double distance) {
    return turned_frame(0, distance, 0.05, 60, SIZE);
}

static void the_vertex_stage_selects_what_the_reference_does(void **state) {
    struct host *host = *state;
    struct target target;
    static const float thresholds[] = {PBR_THRESHOLD_LEAVES, 0.5f, 1, 2, 4, 16};
    pbr_lod *lod = make_tree(host, true);
    double model[16];
    target_open(&target, SIZE);
    matrix_identity(model);
    for (size_t t = 0; t < sizeof thresholds / sizeof *thresholds; t++) {
        pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
        pbr_frame frame = make_frame(2.6);
        frame.threshold = thresholds[t];
        expect_selection(host, &target, lod, item, &frame, model, "whole");
        frame = make_frame(1.3);
        frame.threshold = thresholds[t];
        expect_selection(host, &target, lod, item, &frame, model, "near, cut by the border and the near plane");
        frame = make_frame(4);
        frame.threshold = thresholds[t];
        matrix_ortho(-1.4, 1.4, -1.4, 1.4, 0.5, 9, frame.projection);
        expect_selection(host, &target, lod, item, &frame, model, "orthographic");
        frame = make_frame(5);
        frame.threshold = thresholds[t];
        matrix_zero_to_one(frame.projection, true);
        frame.flags |= PBR_FRAME_REVERSED_Z | PBR_FRAME_CLIP_ZERO_TO_ONE;
        matrix_scaling(-2, 2, 2, model);
        model[12] = 0.5;
        expect_selection(host, &target, lod, item, &frame, model, "reversed, mirrored and scaled");
        frame = make_frame(4);
        frame.threshold = thresholds[t];
        matrix_scaling(1, 1.7, 0.5, model);
        item.radius_scale = 1.5f;
        item.size_minimum = 2;
        item.flags = PBR_ITEM_CULL_BACK_FACES;
        expect_selection(host, &target, lod, item, &frame, model, "stretched, enlarged, from one side");
        matrix_identity(model);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

static void all_kinds_draw_it(void **state) {
    struct host *host = *state;
    struct target target;
    double model[16];
    target_open(&target, SIZE);
    matrix_identity(model);
    for (int normals = 0; normals < 2; normals++) {
        pbr_lod *lod = make_tree(host, normals);
        pbr_frame frame = make_frame(2.2);
        frame.threshold = 3;
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
            pbr_item item = lod_item(lod, splat);
            expect_selection(host, &target, lod, item, &frame, model, "plain");
            item.shading = splat >= PBR_SPLAT_GAUSSIAN ? PBR_SHADE_DEFERRED : PBR_SHADE_NONE;
            item.blending = splat <= PBR_SPLAT_ELLIPSE ? PBR_BLEND_FILL : PBR_BLEND_KIND;
            expect_selection(host, &target, lod, item, &frame, model, "deferred or filled");
        }
        host_use_quads(host); /* all that is not tiny */
        expect_selection(host, &target, lod, lod_item(lod, PBR_SPLAT_SQUARE), &frame, model, "quads");
        expect_selection(host, &target, lod, lod_item(lod, PBR_SPLAT_EWA), &frame, model, "quads");
        pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
        static const double plane[4] = {1, 0.3, 0, 0.1};
        item.clip_planes = plane;
        item.clip_plane_count = 1;
        expect_selection(host, &target, lod, item, &frame, model, "clipped");
        pbr_lod_release(&lod);
    }
    target_close(&target);
}

/* It is sent once, then nothing is sent or allocated, whatever the view; less is handed to the GPU from afar. */
static void a_view_costs_a_search(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    pbr_lod *lod = make_tree(host, true);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(3);
    pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_int_equal(stats.upload_bytes, lod->spt.count * sizeof(struct spt_entry));
    assert_true(stats.gpu_memory_bytes >= stats.upload_bytes);
    assert_int_equal(stats.nodes_visited, lod->spt.chunk_count);
    assert_true(stats.threshold == 1);
    uint64_t last = UINT64_MAX;
    const size_t allocations = host->memory.allocations;
    for (int i = 0; i < 6; i++) {
        frame = make_frame(3 + 8 * i);
        frame.threshold = (float)(1 + i);
        stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        assert_int_equal(stats.upload_bytes, 0);
        assert_true(stats.splats_drawn > 0 && stats.splats_drawn <= last);
        last = stats.splats_drawn;
    }
    assert_true(last <= 4 * lod->spt.chunk_count); /* far less than a line of each table: roots, and a few below */
    assert_int_equal(host->memory.allocations, allocations);
    frame = make_frame(-3); /* behind the eye */
    stats = draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_int_equal(stats.splats_drawn, 0);
    assert_int_equal(stats.points, POINTS);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Two trees, and room for one: what is not drawn makes room, page by page. */
static void the_budget_is_kept(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted[2], got;
    pbr_lod *lods[2] = {make_tree(host, true), make_tree(host, false)};
    const uint64_t bytes = lods[0]->spt.count * sizeof(struct spt_entry);
    target_open(&target, SIZE);
    const pbr_frame frame = make_frame(3);
    for (int i = 0; i < 2; i++) {
        const pbr_item item = lod_item(lods[i], PBR_SPLAT_CIRCLE);
        draw_picture(host, &target, &frame, &item, 1, wanted[i]);
    }
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = bytes + bytes / 4;
    host_use_renderer(host, &desc);
    for (int i = 0; i < 6; i++) {
        const pbr_item item = lod_item(lods[i % 2], PBR_SPLAT_CIRCLE);
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_true(stats.gpu_memory_bytes <= desc.gpu_memory_budget);
        assert_memory_equal(wanted[i % 2], got, sizeof got);
    }
    pbr_stats stats = PBR_STATS_INIT;
    pbr_item items[2] = {lod_item(lods[0], PBR_SPLAT_CIRCLE), lod_item(lods[1], PBR_SPLAT_CIRCLE)};
    assert_int_equal(pbr_render(host->view, &frame, items, 2, &stats), PBR_ERROR_OUT_OF_GPU_MEMORY);
    items[1].flags = PBR_ITEM_HIDDEN;
    draw_picture(host, &target, &frame, items, 2, got);
    assert_memory_equal(wanted[0], got, sizeof got);
    pbr_renderer_evict_lod(host->renderer, lods[0]);
    pbr_renderer_evict_lod(host->renderer, lods[1]);
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    assert_int_equal(info.gpu_memory_bytes, 0);
    for (int i = 0; i < 2; i++) pbr_lod_release(&lods[i]);
    target_close(&target);
}

/* All sources of splats in one frame, a tree twice and many times, through points and through quads: the attributes of one do not
 * reach into another's draws. */
static void it_shares_a_frame_with_other_sources(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pictures[2];
    double models[5][16];
    pbr_points *points = make_points(host, true);
    pbr_lod *lod = make_tree(host, true), *cut = NULL;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &desc, &cut), PBR_OK);
    target_open(&target, SIZE);
    for (int i = 0; i < 5; i++) {
        matrix_scaling(0.5, 0.5, 0.5, models[i]);
        models[i][12] = 0.7 * (i % 3 - 1);
        models[i][13] = i < 3 ? 0.5 : -0.5;
    }
    pbr_item items[4] = {lod_item(lod, PBR_SPLAT_ELLIPSE), lod_item(NULL, PBR_SPLAT_ELLIPSE), lod_item(cut, PBR_SPLAT_ELLIPSE),
                         lod_item(lod, PBR_SPLAT_CIRCLE)};
    items[1].points = points;
    for (int i = 0; i < 4; i++) {
        items[i].id = (uint64_t)i;
        items[i].transforms = models[i];
        items[i].transform_count = i == 3 ? 2 : 1;
    }
    pbr_frame frame = make_frame(2.5);
    frame.threshold = 2;
    for (int quads = 0; quads < 2; quads++) {
        pbr_renderer_desc renderer = host_renderer_desc();
        if (quads) renderer.point_size_limit = 1;
        host_use_renderer(host, &renderer);
        const pbr_stats stats = draw_picture(host, &target, &frame, items, 4, pictures[quads]);
        assert_true(quads == (stats.splats_as_quads > stats.splats_drawn / 2));
        draw_picture(host, &target, &frame, items, 4, pictures[quads]);
    }
    assert_true(count_different(pictures[0], pictures[1]) <= FEW);
    pbr_points_release(&points);
    pbr_lod_release(&lod);
    pbr_lod_release(&cut);
    target_close(&target);
}

/* More than a frame sends: what is missing is said to be, and comes. */
static void a_large_tree_comes_over_some_frames(void **state) {
    enum { MANY = 1400000 };
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    float(*positions)[3] = malloc(MANY * sizeof *positions);
    pbr_points *points = NULL;
    pbr_lod *lod = NULL;
    uint64_t seed = 8;
    assert_non_null(positions);
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)random_between(&seed, -1, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = MANY;
    desc.positions = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    free(positions);
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    lod_desc.kind = PBR_LOD_SPT;
    lod_desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
    pbr_points_release(&points);
    const pbr_item item = lod_item(lod, PBR_SPLAT_SQUARE);
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(4);
    draw_picture(host, &target, &frame, &item, 1, wanted);
    pbr_renderer_evict_lod(host->renderer, lod);
    frame.flags = 0;
    uint64_t sent = 0;
    int frames = 0;
    for (bool is_final = false; !is_final; frames++) {
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
        const uint64_t most = SEQUENCES_A_FRAME + PAGE_BYTES;
        assert_true(stats.upload_bytes > 0 && stats.upload_bytes <= most);
        sent += stats.upload_bytes;
        is_final = stats.is_final;
        assert_int_equal(is_final, sent == lod->spt.count * sizeof(struct spt_entry));
    }
    assert_true(frames >= 2);
    assert_memory_equal(wanted, got, sizeof got);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* A budget that cannot be kept makes it coarser than a view begins; at rest, jitter or not, it gets fine again. */
static void it_is_steered_and_comes_to_rest(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    host_use_threads(host, 2);
    pbr_lod *lod = make_tree(host, true);
    const pbr_item item = lod_item(lod, PBR_SPLAT_CIRCLE);
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(2.5);
    draw_picture(host, &target, &frame, &item, 1, wanted);
    frame.flags = 0;
    frame.time_budget = 1e-6;
    float coarsest = 0;
    for (int i = 0; i < 60; i++) {
        frame.view[12] = 0.002 * i;
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
        coarsest = fmaxf(coarsest, stats.threshold);
    }
    assert_true(coarsest > 8);
    pbr_stats stats = PBR_STATS_INIT;
    for (int i = 0; i < 200 && !stats.is_final; i++) {
        frame = make_frame(2.5);
        frame.flags = 0;
        frame.time_budget = 1e-6;
        frame.jitter[0] = i % 2 ? 0.25 : -0.25;
        stats = draw_picture(host, &target, &frame, &item, 1, got);
    }
    assert_int_equal(stats.is_final, 1);
    frame.jitter[0] = 0;
    draw_picture(host, &target, &frame, &item, 1, got);
    assert_memory_equal(wanted, got, sizeof got);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Contexts that lack what makes it fast ---- */

enum lack { NOTHING, COMPUTE_SHADERS, DRAW_IDS, LARGE_STORAGE, DRAW_ID_COMPILER };

enum { SMALL_STORAGE = 1 << 20 /* bytes */ };

static const GLubyte *APIENTRY string_of_another(GLenum name, GLuint index) {
    const GLubyte *string = glGetStringi(name, index);
    return string && strcmp((const char *)string, "GL_ARB_shader_draw_parameters") == 0 ? (const GLubyte *)"another" : string;
}

static void APIENTRY limit_of_another(GLenum name, GLint64 *value) {
    glGetInteger64v(name, value);
    if (name == GL_MAX_SHADER_STORAGE_BLOCK_SIZE && *value > SMALL_STORAGE) *value = SMALL_STORAGE;
}

/* A driver that lists the extension and does not know it. */
static void APIENTRY compile_less(GLuint shader, GLsizei count, const GLchar *const *strings, const GLint *lengths) {
    const GLchar *pieces[64];
    assert_in_range(count, 1, 64);
    for (GLsizei i = 0; i < count; i++) pieces[i] = strstr(strings[i], "#define MULTI_DRAW\n") ? "this is no shader\n" : strings[i];
    glShaderSource(shader, count, pieces, lengths);
}

static void *lacking_get_proc(void *user, const char *name) {
    const enum lack lack = *(const enum lack *)user;
    const GLubyte *(APIENTRY *const get_string)(GLenum, GLuint) = string_of_another;
    void(APIENTRY *const get_limit)(GLenum, GLint64 *) = limit_of_another;
    void(APIENTRY *const compile)(GLuint, GLsizei, const GLchar *const *, const GLint *) = compile_less;
    void *address = context_get_proc(NULL, name);
    if (lack == COMPUTE_SHADERS && strcmp(name, "glDispatchCompute") == 0) address = NULL;
    if (lack == DRAW_IDS && strcmp(name, "glGetStringi") == 0) memcpy(&address, &get_string, sizeof address);
    if (lack == LARGE_STORAGE && strcmp(name, "glGetInteger64v") == 0) memcpy(&address, &get_limit, sizeof address);
    if (lack == DRAW_ID_COMPILER && strcmp(name, "glShaderSource") == 0) memcpy(&address, &compile, sizeof address);
    return address;
}

static void use_renderer_without(struct host *host, enum lack lack, uint64_t budget) {
    pbr_renderer_desc desc = host_renderer_desc();
    desc.get_proc_address = lacking_get_proc;
    desc.get_proc_address_user = &lack;
    desc.gpu_memory_budget = budget;
    host_use_renderer(host, &desc);
}

/* Of many chunks: kinds of both sorts, one of them under two transforms, in two groups of passes. */
static size_t make_crowd(const pbr_lod *lod, double models[2][16], pbr_item items[4]) {
    static const uint32_t splats[4] = {PBR_SPLAT_GAUSSIAN, PBR_SPLAT_EWA, PBR_SPLAT_SQUARE, PBR_SPLAT_ELLIPSE};
    static const double plane[4] = {1, 0.3, 0, 0.6};
    for (int i = 0; i < 2; i++) {
        matrix_scaling(0.7, 0.7, 0.7, models[i]);
        models[i][12] = i - 0.5;
    }
    for (int i = 0; i < 4; i++) {
        items[i] = lod_item(lod, splats[i]);
        items[i].id = (uint64_t)i;
        items[i].transforms = models[i % 2];
        items[i].transform_count = 1;
    }
    items[1].transforms = models[0];
    items[1].transform_count = 2;
    items[1].shading = PBR_SHADE_DEFERRED;
    items[1].clip_planes = plane;
    items[1].clip_plane_count = 1;
    items[2].blending = PBR_BLEND_FILL;
    return 4;
}

static uint64_t objects_on_gpu(const struct host *host) {
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    return info.gpu_object_count;
}

static uint64_t bytes_on_gpu(const struct host *host) {
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    return info.gpu_memory_bytes;
}

/* With a compute shader that selects, without, and with too little memory for what it selects: the same picture. */
static void what_is_selected_once_is_what_every_pass_would(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pictures[3];
    pbr_lod *lod = make_tree(host, true);
    double models[2][16];
    pbr_item items[4];
    const size_t count = make_crowd(lod, models, items);
    target_open(&target, SIZE);
    for (int near = 0; near < 2; near++) {
        pbr_frame frame = make_frame(near ? 1.1 : 2.5);
        uint64_t bytes[3] = {0}, selected = 0;
        frame.threshold = 2;
        for (int i = 0; i < 3; i++) {
            /* Some are quads. */
            use_renderer_without(host, i == 1 ? COMPUTE_SHADERS : NOTHING,
                                 i == 2 ? lod->spt.count * sizeof(struct spt_entry) + 1000 : 0);
            const pbr_stats stats = draw_picture(host, &target, &frame, items, count, pictures[i]);
            bytes[i] = bytes_on_gpu(host);
            selected = stats.splats_drawn * sizeof(struct spt_entry) / 2; /* of the other half there is one that is not */
            assert_true(stats.splats_as_quads > 0);
        }
        assert_memory_equal(pictures[1], pictures[2], sizeof pictures[0]);
        assert_true(bytes[2] < bytes[1] + 1000);
        if (context_has(43, 31)) assert_true(bytes[0] >= bytes[1] + selected);
        else assert_int_equal(bytes[0], bytes[1]);
        /* Compute shaders may compute depths otherwise. */
        assert_true(count_different(pictures[0], pictures[1]) <= FEW);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Room for copies is given up where something else needs it. */
static void copies_make_room(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    pbr_lod *lods[2] = {make_tree(host, true), make_tree(host, false)};
    const uint64_t bytes = lods[0]->spt.count * sizeof(struct spt_entry);
    const pbr_frame frame = make_frame(2.5);
    target_open(&target, SIZE);
    use_renderer_without(host, NOTHING, 2 * bytes + bytes / 8);
    const pbr_item first = lod_item(lods[0], PBR_SPLAT_GAUSSIAN);
    draw_picture(host, &target, &frame, &first, 1, pixels);
    pbr_item both[2] = {lod_item(lods[0], PBR_SPLAT_GAUSSIAN), lod_item(lods[1], PBR_SPLAT_CIRCLE)};
    both[1].id = 2;
    for (int i = 0; i < 2; i++) draw_picture(host, &target, &frame, both, 2, pixels);
    /* Two trees in turn, for which there is room: copies do not displace them. */
    const pbr_item second = lod_item(lods[1], PBR_SPLAT_GAUSSIAN);
    for (int i = 0; i < 6; i++) {
        const pbr_stats stats = draw_picture(host, &target, &frame, i % 2 ? &second : &first, 1, pixels);
        if (i >= 2) assert_int_equal(stats.upload_bytes, 0);
    }
    for (int i = 0; i < 2; i++) pbr_renderer_evict_lod(host->renderer, lods[i]);
    assert_true(bytes_on_gpu(host) < PIXELS * 64); /* they go with the last tree; what is blended in stays */
    for (int i = 0; i < 2; i++) pbr_lod_release(&lods[i]);
    target_close(&target);
}

/* ---- Trees of many pages ---- */

/* Discs evenly over a bumpy sphere. */
static pbr_lod *make_large_tree(struct host *host) {
    enum { MANY = 400000 };
    float(*positions)[3] = malloc(MANY * sizeof *positions), (*normals)[3] = malloc(MANY * sizeof *normals);
    float *radii = malloc(MANY * sizeof *radii);
    pbr_points *points = NULL;
    pbr_lod *lod = NULL;
    assert_true(positions && normals && radii);
    for (int i = 0; i < MANY; i++) {
        const double height = 1 - (2 * i + 1) / (double)MANY, around = 2.39996322972865 * i, width = sqrt(1 - height * height);
        const double direction[3] = {width * cos(around), height, width * sin(around)};
        const double out = 1 + 0.05 * sin(9 * direction[0]) * sin(7 * direction[1]);
        for (int k = 0; k < 3; k++) positions[i][k] = (float)(out * direction[k]), normals[i][k] = (float)direction[k];
        radii[i] = 0.006f;
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = MANY;
    desc.positions = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    free(positions), free(normals), free(radii);
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    lod_desc.kind = PBR_LOD_SPT;
    lod_desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
    pbr_points_release(&points);
    assert_true(lod->spt.chunk_count > 2 * PAGE_CHUNKS);
    return lod;
}

/* A call for each page where shaders can tell its draws apart, else for each chunk; copies of all lists, of some, of none; and a
 * driver that says more than it can: one picture. */
static void large_trees_look_alike_whatever_the_context_has(void **state) {
    static const enum lack lacks[] = {DRAW_IDS, NOTHING, COMPUTE_SHADERS, LARGE_STORAGE, DRAW_ID_COMPILER};
    static const uint32_t splats[] = {PBR_SPLAT_SQUARE, PBR_SPLAT_GAUSSIAN, PBR_SPLAT_EWA};
    static const double planes[5][4] = {{1, 0, 0, 0.9}, {0, 1, 0, 0.9}, {0, 0, 1, 0.9}, {-1, 0, 0, 0.9}, {0, -1, 0, 0.5}};
    enum { LACKS = sizeof lacks / sizeof *lacks };
    struct host *host = *state;
    struct target target;
    static picture wanted[3][2], got;
    const bool draws_many = !context_is_es() && context_has_extension("GL_ARB_shader_draw_parameters");
    pbr_lod *lod = make_large_tree(host);
    uint64_t bytes[DRAW_ID_COMPILER + 1] = {0};
    target_open(&target, SIZE);
    for (size_t l = 0; l < LACKS; l++) {
        if (lacks[l] == DRAW_ID_COMPILER && !draws_many) continue;
        use_renderer_without(host, lacks[l], 0);
        for (int s = 0; s < 3; s++)
            for (int near = 0; near < 2; near++) {
                pbr_item items[2] = {lod_item(lod, splats[s]), lod_item(lod, splats[s])};
                static const double moved[16] = {0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0.7, 0.7, 0.7, 1};
                pbr_frame frame = make_frame(near ? 1.6 : 8);
                frame.threshold = near ? 4 : 1;
                items[0].clip_planes = planes[0];
                items[0].clip_plane_count = 5;
                items[0].low_pass = 16; /* so that passes would need lists of their own */
                items[1].id = 2;
                items[1].transforms = moved;
                items[1].transform_count = 1;
                if (lacks[l] == DRAW_ID_COMPILER) {
                    assert_int_equal(pbr_prepare(host->view, &frame, items, 2, NULL), PBR_OK);
                    context_forget_errors(); /* what the compiler says */
                }
                const pbr_stats stats = draw_picture(host, &target, &frame, items, 2, got);
                if (l == 0) memcpy(wanted[s][near], got, sizeof got);
                const int different = count_different(wanted[s][near], got);
                if (different > FEW || (splats[s] == PBR_SPLAT_SQUARE && different > 0))
                    fail_msg("lack %d, splat %u, near %d: %d pixels differ", (int)lacks[l], (unsigned)splats[s], near, different);
                if (near) continue;
                /* No splat needs a quad, and all chunks are in view. */
                const bool per_page = draws_many && lacks[l] != DRAW_IDS && lacks[l] != DRAW_ID_COMPILER;
                const uint64_t chunks = lod->spt.chunk_count, passes = 2 * (splats[s] == PBR_SPLAT_SQUARE ? 1 : 2);
                if (!per_page) assert_int_equal(stats.draw_calls, chunks * passes);
                else assert_in_range(stats.draw_calls, passes * 2, passes * (chunks / 8));
            }
        bytes[lacks[l]] = bytes_on_gpu(host);
    }
    if (context_has(43, 31)) { /* copies of all, of some, of none */
        assert_true(bytes[NOTHING] > bytes[LARGE_STORAGE]);
        assert_true(bytes[LARGE_STORAGE] <= bytes[COMPUTE_SHADERS] + 2 * SMALL_STORAGE);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Normal fields ---- */

static const uint32_t blended[] = {PBR_SPLAT_GAUSSIAN, PBR_SPLAT_EWA, PBR_SPLAT_EWA_MAX};
enum { BLENDED = sizeof blended / sizeof *blended };

/* A smooth ball of radius 1, in a light that tells normals apart; every 97th point without a normal, if asked for. */
static pbr_points *make_ball(struct host *host, int count, bool gaps) {
    static float positions[POINTS][3], normals[POINTS][3], radii[POINTS];
    pbr_points *points = NULL;
    uint64_t seed = 3;
    for (int i = 0; i < count; i++) {
        const double height = 1 - (2 * i + 1) / (double)count, around = 2.39996322972865 * i, width = sqrt(1 - height * height);
        const double p[3] = {width * cos(around), height, width * sin(around)};
        for (int k = 0; k < 3; k++) {
            positions[i][k] = (float)p[k];
            normals[i][k] = gaps && i % 97 == 0 ? 0 : (float)p[k];
        }
        radii[i] = (float)(random_between(&seed, 1.2, 1.5) * sqrt(4 * 3.14159265358979 / count));
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = (uint64_t)count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    return points;
}

static const pbr_light slanted = {
    .struct_size = sizeof slanted, .kind = PBR_LIGHT_DIRECTIONAL, .vector = {0.4, 0.5, 1}, .colour = {1, 1, 1}};
static const pbr_material shiny = {0, 0.6f, 0.4f, 40};

static pbr_frame make_slanted_frame(double distance, float threshold) {
    pbr_frame frame = make_frame(distance);
    frame.lights = &slanted;
    frame.light_count = 1;
    frame.threshold = threshold;
    return frame;
}

static pbr_item shaded_item(const pbr_lod *lod, uint32_t splat, uint32_t shading) {
    pbr_item item = lod_item(lod, splat);
    item.shading = shading;
    item.material = shiny;
    item.colour_source = PBR_COLOUR_CONSTANT;
    for (int k = 0; k < 4; k++) item.colour[k] = 1;
    return item;
}

/* The points' own picture: positions are off by 2e-5, radii larger by as much, that is 0.001 pixels. */
static void its_leaves_have_the_fields_of_the_points(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    pbr_points *points = make_ball(host, 2000, true);
    pbr_lod *lod = make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS);
    target_open(&target, SIZE);
    for (int quads = 0; quads < 2; quads++) {
        if (quads) host_use_quads(host);
        for (int i = 0; i < BLENDED; i++) {
            const pbr_frame frame = make_slanted_frame(2.6, PBR_THRESHOLD_LEAVES);
            pbr_item item = shaded_item(lod, blended[i], PBR_SHADE_PHONG_FIELD), plain = item;
            plain.lod = NULL;
            plain.points = points;
            draw_picture(host, &target, &frame, &plain, 1, wanted);
            draw_picture(host, &target, &frame, &item, 1, got);
            assert_true(count_different(wanted, got) <= PIXELS / 1000); /* at the outline */
            item.shading = PBR_SHADE_DEFERRED;                          /* is another */
            draw_picture(host, &target, &frame, &item, 1, got);
            assert_true(count_different(wanted, got) >= PIXELS / 200);
        }
    }
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    target_close(&target);
}

static void without_fields_it_is_deferred(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pictures[4];
    pbr_points *points = make_ball(host, POINTS, true);
    pbr_lod *lods[2] = {make_tree_of(host, points, 0), make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS)};
    target_open(&target, SIZE);
    const pbr_frame frame = make_slanted_frame(2, 12);
    for (int i = 0; i < 4; i++) {
        const pbr_item item = shaded_item(lods[i / 2], PBR_SPLAT_GAUSSIAN, i % 2 ? PBR_SHADE_DEFERRED : PBR_SHADE_PHONG_FIELD);
        draw_picture(host, &target, &frame, &item, 1, pictures[i]);
    }
    assert_memory_equal(pictures[0], pictures[1], sizeof pictures[0]);
    assert_memory_equal(pictures[0], pictures[3], sizeof pictures[0]);
    assert_true(count_different(pictures[0], pictures[2]) > PIXELS / 20);
    for (int i = 0; i < 2; i++) pbr_lod_release(&lods[i]);
    pbr_points_release(&points);
    target_close(&target);
}

/* sRGB of the ball that a pixel shows, white in that light, by Phong 1975; -1 beside it and where it is seen from the side, since
 * discs reach beyond its outline. */
static double ball_at(const pbr_frame *frame, int i) {
    const double centre = frame->view[14], slope = 1 / frame->projection[5]; /* the view is a rotation before that */
    const double ray[3] = {slope * ((i % SIZE + 0.5) * 2 / SIZE - 1), slope * ((i / SIZE + 0.5) * 2 / SIZE - 1), -1};
    const double a = dot3(ray, ray), b = -ray[2] * centre, c = centre * centre - 1, inside = b * b - a * c;
    double n[3], to_eye[3], to_light[3];
    if (inside < 0) return -1;
    const double at = (-b - sqrt(inside)) / a;
    for (int k = 0; k < 3; k++) {
        n[k] = at * ray[k] - (k == 2 ? centre : 0);
        to_eye[k] = -ray[k] / sqrt(a);
        to_light[k] = slanted.vector[k] / length3(slanted.vector);
    }
    const double nl = dot3(n, to_light), nv = dot3(n, to_eye), rv = 2 * nl * nv - dot3(to_light, to_eye);
    if (nv < 0.35) return -1;
    const double light =
        nl > 0 ? (double)shiny.diffuse * nl + (double)shiny.specular * pow(fmax(rv, 0), (double)shiny.shininess) : 0;
    return 255 * (double)srgb_from_linear((float)fmin(light, 1));
}

static double ball_psnr(const pbr_frame *frame, picture got) {
    double sum = 0;
    int count = 0;
    for (int i = 0; i < PIXELS; i++) {
        const double wanted = ball_at(frame, i);
        if (wanted < 0) continue;
        sum += (got[i][1] - wanted) * (got[i][1] - wanted);
        count++;
    }
    assert_true(count > PIXELS / 5);
    return 10 * log10(255 * 255 * count / sum);
}

/* Normals of discs are off by r / R at their rim, fields by its square. */
static void coarse_nodes_are_shaded_as_the_surface(void **state) {
    struct host *host = *state;
    struct target target;
    static picture got;
    pbr_points *points = make_ball(host, POINTS, false);
    pbr_lod *lod = make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS);
    target_open(&target, SIZE);
    for (int i = 0; i < BLENDED; i++)
        for (int threshold = 2; threshold <= 8; threshold *= 2) {
            const pbr_frame frame = make_slanted_frame(2.6, (float)threshold);
            double quality[2];
            for (int fields = 0; fields < 2; fields++) {
                const pbr_item item = shaded_item(lod, blended[i], fields ? PBR_SHADE_PHONG_FIELD : PBR_SHADE_DEFERRED);
                draw_picture(host, &target, &frame, &item, 1, got);
                quality[fields] = ball_psnr(&frame, got);
            }
            if (quality[1] < quality[0] + threshold)
                fail_msg("splat %u, %d pixels: %.1f dB with fields, %.1f without", (unsigned)blended[i], threshold, quality[1],
                         quality[0]);
        }
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    target_close(&target);
}

/* Items with fields beside some that are selected, in one group and in others, whatever the context has. */
static void fields_go_past_selection(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pictures[3];
    pbr_points *points = make_ball(host, POINTS, true);
    pbr_lod *lod = make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS);
    double models[2][16];
    pbr_item items[6];
    const size_t count = make_crowd(lod, models, items);
    items[4] = shaded_item(lod, PBR_SPLAT_GAUSSIAN, PBR_SHADE_PHONG_FIELD);
    items[5] = items[0]; /* selected after what is not */
    items[4].transforms = models[0];
    items[5].transforms = models[1];
    items[4].transform_count = items[5].transform_count = 1;
    items[5].shading = PBR_SHADE_DEFERRED;
    items[5].material = shiny;
    target_open(&target, SIZE);
    for (int near = 0; near < 2; near++) {
        const pbr_frame frame = make_slanted_frame(near ? 1.1 : 2.5, 2);
        for (int i = 0; i < 3; i++) {
            use_renderer_without(host, (enum lack)i, 0);
            draw_picture(host, &target, &frame, items, count + 2, pictures[i]);
            assert_true(count_different(pictures[0], pictures[i]) <= FEW); /* compute shaders may compute depths otherwise */
        }
    }
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    target_close(&target);
}

/* They are sent when they are first asked for, to pages that are there and with those that are not, and go with them. */
static void fields_are_sent_when_they_are_asked_for(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    pbr_points *points = make_ball(host, POINTS, false);
    pbr_lod *lod = make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS);
    const pbr_item plain = shaded_item(lod, PBR_SPLAT_GAUSSIAN, PBR_SHADE_DEFERRED),
                   item = shaded_item(lod, PBR_SPLAT_GAUSSIAN, PBR_SHADE_PHONG_FIELD);
    const uint64_t entries = lod->spt.count * sizeof(struct spt_entry), fields = lod->spt.count * sizeof(struct normal_field);
    const pbr_frame frame = make_slanted_frame(2.6, 2);
    target_open(&target, SIZE);
    use_renderer_without(host, COMPUTE_SHADERS, 0); /* nothing else within the budget */
    assert_int_equal(draw_picture(host, &target, &frame, &plain, 1, pixels).upload_bytes, entries);
    const uint64_t targets = bytes_on_gpu(host) - entries;
    assert_int_equal(draw_picture(host, &target, &frame, &item, 1, pixels).upload_bytes, fields);
    assert_int_equal(bytes_on_gpu(host), targets + entries + fields);
    const uint64_t objects = objects_on_gpu(host);
    assert_int_equal(draw_picture(host, &target, &frame, &plain, 1, pixels).upload_bytes, 0);
    assert_int_equal(draw_picture(host, &target, &frame, &item, 1, pixels).upload_bytes, 0);
    pbr_renderer_evict_lod(host->renderer, lod);
    assert_int_equal(bytes_on_gpu(host), targets);
    assert_int_equal(objects - objects_on_gpu(host), 3 + 1); /* of a page, and what quads are drawn from */
    assert_int_equal(draw_picture(host, &target, &frame, &item, 1, pixels).upload_bytes, entries + fields);
    assert_int_equal(objects_on_gpu(host), objects);
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    target_close(&target);
}

static void the_budget_holds_fields(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted[2], got;
    pbr_points *points = make_ball(host, POINTS, true);
    pbr_lod *lods[2] = {make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS), make_tree_of(host, points, PBR_LOD_NORMAL_FIELDS)};
    const uint64_t entries = lods[0]->spt.count * sizeof(struct spt_entry),
                   fields = lods[0]->spt.count * sizeof(struct normal_field);
    const pbr_frame frame = make_slanted_frame(2.6, 2);
    const pbr_item plain = shaded_item(lods[1], PBR_SPLAT_GAUSSIAN, PBR_SHADE_DEFERRED),
                   item = shaded_item(lods[0], PBR_SPLAT_GAUSSIAN, PBR_SHADE_PHONG_FIELD);
    target_open(&target, SIZE);
    use_renderer_without(host, COMPUTE_SHADERS, 0);
    draw_picture(host, &target, &frame, &item, 1, wanted[0]);
    const uint64_t most = bytes_on_gpu(host) + 1000; /* targets, which are not of the budget, and one of both */
    draw_picture(host, &target, &frame, &plain, 1, wanted[1]);
    use_renderer_without(host, NOTHING, entries + fields + 1000);
    for (int i = 0; i < 4; i++) {
        const pbr_stats stats = draw_picture(host, &target, &frame, i % 2 ? &plain : &item, 1, got);
        assert_int_equal(stats.upload_bytes, i % 2 ? entries : entries + fields);
        assert_memory_equal(wanted[i % 2], got, sizeof got);
        assert_true(bytes_on_gpu(host) <= most);
    }
    /* Where there is no room for fields, what is there stays. */
    use_renderer_without(host, NOTHING, entries + fields / 2);
    pbr_item both = plain;
    both.lod = lods[0];
    draw_picture(host, &target, &frame, &both, 1, got);
    pbr_stats stats = PBR_STATS_INIT;
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, &stats), PBR_ERROR_OUT_OF_GPU_MEMORY);
    const pbr_stats after = draw_picture(host, &target, &frame, &both, 1, got);
    assert_int_equal(after.upload_bytes, 0);
    assert_memory_equal(wanted[1], got, sizeof got);
    for (int i = 0; i < 2; i++) pbr_lod_release(&lods[i]);
    pbr_points_release(&points);
    target_close(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(the_vertex_stage_selects_what_the_reference_does),
        GL_TEST(all_kinds_draw_it),
        GL_TEST(a_view_costs_a_search),
        GL_TEST(the_budget_is_kept),
        GL_TEST(it_shares_a_frame_with_other_sources),
        GL_TEST(a_large_tree_comes_over_some_frames),
        GL_TEST(it_is_steered_and_comes_to_rest),
        GL_TEST(what_is_selected_once_is_what_every_pass_would),
        GL_TEST(copies_make_room),
        GL_TEST(large_trees_look_alike_whatever_the_context_has),
        GL_TEST(its_leaves_have_the_fields_of_the_points),
        GL_TEST(without_fields_it_is_deferred),
        GL_TEST(coarse_nodes_are_shaded_as_the_surface),
        GL_TEST(fields_go_past_selection),
        GL_TEST(fields_are_sent_when_they_are_asked_for),
        GL_TEST(the_budget_holds_fields),
    };
    return RUN_GL_TESTS("spt", tests);
}
