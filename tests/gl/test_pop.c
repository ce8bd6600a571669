/* Hierarchies over meshes on the GPU: triangles where points would be too large, and no seam between the two.
 * SPDX-License-Identifier: MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 128, PIXELS = SIZE * SIZE, RINGS = 60, SEGMENTS = 100 };

typedef uint8_t picture[PIXELS][4];

static const double PI = 3.14159265358979323846;

struct corners {
    float (*positions)[3];
    uint32_t (*triangles)[3];
    size_t vertex_count, triangle_count;
};

/* A sphere with a bump, closed; its poles are rings of small triangles and one vertex. */
static struct corners make_corners(double bump) {
    struct corners c = {.vertex_count = (size_t)(RINGS - 1) * SEGMENTS + 2, .triangle_count = (size_t)2 * (RINGS - 1) * SEGMENTS};
    c.positions = malloc(c.vertex_count * sizeof *c.positions);
    c.triangles = malloc(c.triangle_count * sizeof *c.triangles);
    assert_true(c.positions && c.triangles);
    for (size_t i = 0; i < c.vertex_count; i++) {
        const double tilt = i < 2 ? PI * (double)i : PI * (double)(1 + (i - 2) / SEGMENTS) / RINGS;
        const double turn = i < 2 ? 0 : 2 * PI * (double)((i - 2) % SEGMENTS) / SEGMENTS;
        const double out = 1 + bump * sin(5 * tilt) * cos(3 * turn);
        c.positions[i][0] = (float)(out * sin(tilt) * cos(turn));
        c.positions[i][1] = (float)(out * cos(tilt));
        c.positions[i][2] = (float)(out * sin(tilt) * sin(turn));
    }
    size_t n = 0;
    for (uint32_t ring = 0; ring < RINGS; ring++)
        for (uint32_t s = 0; s < SEGMENTS; s++) {
            const uint32_t next = (s + 1) % SEGMENTS, low = 2 + (ring - 1) * SEGMENTS, high = 2 + ring * SEGMENTS;
            const uint32_t quad[2][3] = {{ring > 0 ? low + s : 0, high + next, high + s}, {low + s, low + next, high + next}};
            if (ring < RINGS - 1) memcpy(c.triangles[n++], quad[0], sizeof quad[0]);
            const uint32_t last[3] = {low + s, low + next, 1};
            if (ring > 0) memcpy(c.triangles[n++], ring < RINGS - 1 ? quad[1] : last, sizeof last);
        }
    assert_int_equal(n, c.triangle_count);
    return c;
}

static void free_corners(struct corners *c) {
    free(c->positions);
    free(c->triangles);
}

/* Colours are the normals, so that a triangle's are not one. */
static pbr_mesh *make_mesh(struct host *host, const struct corners *c) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    float(*colours)[3] = malloc(c->vertex_count * sizeof *colours);
    assert_non_null(colours);
    for (size_t i = 0; i < c->vertex_count; i++)
        for (int k = 0; k < 3; k++) colours[i][k] = 0.5f + 0.4f * fminf(fmaxf(c->positions[i][k], -1), 1);
    desc.vertex_count = c->vertex_count;
    desc.positions = (pbr_attribute){c->positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = c->triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = c->triangle_count;
    assert_int_equal(pbr_mesh_create(host->instance, &desc, &mesh), PBR_OK);
    free(colours);
    return mesh;
}

static pbr_lod *make_lod(struct host *host, double bump) {
    struct corners corners = make_corners(bump);
    pbr_mesh *mesh = make_mesh(host, &corners);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.kind = PBR_LOD_POP;
    desc.mesh = mesh;
    assert_int_equal(pbr_lod_create(host->instance, &desc, &lod), PBR_OK);
    pbr_mesh_release(&mesh);
    free_corners(&corners);
    return lod;
}

static const uint64_t TRIANGLES = (uint64_t)2 * (RINGS - 1) * SEGMENTS;

static pbr_frame make_frame(double distance) {
    return turned_frame(0, distance, 0.05, 200, SIZE);
}

/* ---- Against triangles that the test draws itself ---- */

static void draw_triangles_by_hand(const struct corners *c, const pbr_frame *frame) {
    static const char vertex[] = "in vec3 position; uniform mat4 m; void main() { gl_Position = m * vec4(position, 1.0); }";
    static const char fragment[] = "out vec4 colour; void main() { colour = vec4(1.0); }";
    double all[16];
    float m[16];
    GLuint buffers[2], array, program = build_program(vertex, fragment);
    for (int column = 0; column < 4; column++)
        for (int r = 0; r < 4; r++) {
            all[4 * column + r] = 0;
            for (int k = 0; k < 4; k++) all[4 * column + r] += frame->projection[4 * k + r] * frame->view[4 * column + k];
        }
    for (int i = 0; i < 16; i++) m[i] = (float)all[i];
    glGenVertexArrays(1, &array);
    glBindVertexArray(array);
    glGenBuffers(2, buffers);
    glBindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(c->vertex_count * sizeof *c->positions), c->positions, GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(c->triangle_count * sizeof *c->triangles), c->triangles, GL_STATIC_DRAW);
    const GLuint at = (GLuint)glGetAttribLocation(program, "position");
    glVertexAttribPointer(at, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    glEnableVertexAttribArray(at);
    glUseProgram(program);
    glUniformMatrix4fv(glGetUniformLocation(program, "m"), 1, GL_FALSE, m);
    glViewport(0, 0, SIZE, SIZE);
    glEnable(GL_DEPTH_TEST);
    glDrawElements(GL_TRIANGLES, (GLsizei)(3 * c->triangle_count), GL_UNSIGNED_INT, NULL);
    glDisable(GL_DEPTH_TEST);
    glUseProgram(0);
    glBindVertexArray(0);
    glBindBuffer(GL_ARRAY_BUFFER, 0);
    glDeleteVertexArrays(1, &array);
    glDeleteBuffers(2, buffers);
    glDeleteProgram(program);
}

/* Vertices are relative to another origin: along edges rounding may decide. */
static void without_a_threshold_the_mesh_is_drawn(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels, wanted;
    static float depth[PIXELS], wanted_depth[PIXELS];
    static const double distances[] = {2.6, 1.3, 6};
    struct corners corners = make_corners(0.1);
    pbr_lod *lod = make_lod(host, 0.1);
    target_open(&target, SIZE);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++)
        for (size_t d = 0; d < sizeof distances / sizeof *distances; d++) {
            pbr_frame frame = make_frame(distances[d]);
            frame.threshold = PBR_THRESHOLD_LEAVES;
            const pbr_item item = lod_item(lod, splat);
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
            target_read_depth(&target, depth);
            target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
            draw_triangles_by_hand(&corners, &frame);
            target_read(&target, wanted);
            target_read_depth(&target, wanted_depth);
            int other = 0;
            for (int i = 0; i < PIXELS; i++) {
                other += (pixels[i][3] > 0) != (wanted[i][3] > 0);
                if (pixels[i][3] > 0 && wanted[i][3] > 0)
                    other += fabsf(depth[i] - wanted_depth[i]) > 1e-4f * (1 - wanted_depth[i]);
            }
            assert_true(other <= PIXELS / 1000);
            assert_int_equal(stats.splats_drawn, 0);
            if (d != 1) assert_int_equal(stats.triangles_drawn, TRIANGLES);
            else assert_in_range(stats.triangles_drawn, 1, TRIANGLES - 1); /* cut by the view */
        }
    pbr_lod_release(&lod);
    free_corners(&corners);
    target_close(&target);
}

/* ---- Points and triangles together ---- */

static double psnr(picture a, picture b) {
    double sum = 0;
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < 3; k++) sum += pow(a[i][k] - b[i][k], 2);
    return sum > 0 ? 10 * log10(255.0 * 255 * 3 * PIXELS / sum) : INFINITY;
}

/* A mixed picture differs from that of all triangles no more than one of points alone does: where the two meet is nothing that
 * neither has. And it covers what they cover: no cracks. */
static void no_seam_shows(void **state) {
    struct host *host = *state;
    struct target target;
    static picture triangles, mixed, points;
    pbr_lod *lod = make_lod(host, 0.1);
    target_open(&target, SIZE);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++)
        for (int way = 0; way < 3; way++) {
            pbr_item item = lod_item(lod, splat);
            if (way == 1) item.shading = splat >= PBR_SPLAT_GAUSSIAN ? PBR_SHADE_DEFERRED : PBR_SHADE_NONE;
            if (way == 2 && splat <= PBR_SPLAT_ELLIPSE) item.blending = PBR_BLEND_FILL;
            if (way == 2 && splat > PBR_SPLAT_ELLIPSE) break;
            pbr_frame frame = make_frame(2.4);
            frame.threshold = PBR_THRESHOLD_LEAVES;
            draw_picture(host, &target, &frame, &item, 1, triangles);
            frame.threshold = 6;
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, mixed);
            frame.threshold = 20;
            const pbr_stats coarse = draw_picture(host, &target, &frame, &item, 1, points);
            assert_true(stats.splats_drawn > TRIANGLES / 20 && stats.triangles_drawn > TRIANGLES / 20);
            assert_int_equal(coarse.triangles_drawn, 0);
            int cracks = 0;
            for (int i = 0; i < PIXELS; i++) cracks += triangles[i][3] > 0 && mixed[i][3] == 0;
            if (cracks > 0 || psnr(mixed, triangles) < psnr(points, triangles)) {
                picture_save("pop_triangles", (const uint8_t(*)[4])triangles, SIZE, SIZE);
                picture_save("pop_mixed", (const uint8_t(*)[4])mixed, SIZE, SIZE);
                picture_save("pop_points", (const uint8_t(*)[4])points, SIZE, SIZE);
                fail_msg("splat %u, way %d: %d cracks, PSNR %.1f, of points alone %.1f dB", (unsigned)splat, way, cracks,
                         psnr(mixed, triangles), psnr(points, triangles));
            }
        }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Red and blue say what is what. */
static void colours_tell_the_primitives(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    pbr_lod *lod = make_lod(host, 0);
    pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
    int red = 0, blue = 0;
    item.shading = PBR_SHADE_NONE;
    item.colour_source = PBR_COLOUR_PRIMITIVE;
    target_open(&target, SIZE);
    static const float thresholds[3] = {PBR_THRESHOLD_LEAVES, 6, 20};
    for (int t = 0; t < 3; t++) {
        pbr_frame frame = make_frame(2.4);
        frame.threshold = thresholds[t];
        draw_picture(host, &target, &frame, &item, 1, pixels);
        red = blue = 0;
        for (int i = 0; i < PIXELS; i++) {
            red += pixels[i][3] > 0 && pixels[i][0] > pixels[i][2];
            blue += pixels[i][3] > 0 && pixels[i][0] < pixels[i][2];
        }
        assert_true(red + blue > PIXELS / 3);
        assert_int_equal(red > 0, t > 0);
        assert_int_equal(blue > 0, t < 2);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Triangles are cut where the plane is, not left out whole as splats are. */
static void clip_planes_cut_triangles(void **state) {
    struct host *host = *state;
    struct target target;
    static picture whole, half;
    pbr_lod *lod = make_lod(host, 0);
    static const double plane[4] = {1, 0, 0, 0};
    target_open(&target, SIZE);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_GAUSSIAN; splat++) {
        pbr_item item = lod_item(lod, splat);
        pbr_frame frame = make_frame(3);
        matrix_translation(0, 0, -3, frame.view);
        frame.threshold = PBR_THRESHOLD_LEAVES;
        item.colour_source = PBR_COLOUR_NORMAL;
        draw_picture(host, &target, &frame, &item, 1, whole);
        item.clip_planes = plane;
        item.clip_plane_count = 1;
        draw_picture(host, &target, &frame, &item, 1, half);
        int other = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) { /* the plane is seen from its edge: a column */
                const bool wanted = whole[y * SIZE + x][3] > 0 && x >= SIZE / 2;
                other += (half[y * SIZE + x][3] > 0) != wanted;
            }
        assert_true(covered_pixels(half, PIXELS) > PIXELS / 10);
        assert_int_equal(other, 0);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Nothing is seen of the far side of a closed mesh: dropping it changes nothing, but at the rim. */
static void far_sides_can_be_dropped(void **state) {
    struct host *host = *state;
    struct target target;
    static picture all, culled;
    pbr_lod *lod = make_lod(host, 0.1);
    target_open(&target, SIZE);
    for (int t = 0; t < 2; t++) {
        pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
        pbr_frame frame = make_frame(2.4);
        frame.threshold = t ? 6 : PBR_THRESHOLD_LEAVES;
        const pbr_stats full = draw_picture(host, &target, &frame, &item, 1, all);
        item.flags = PBR_ITEM_CULL_BACK_FACES;
        const pbr_stats less = draw_picture(host, &target, &frame, &item, 1, culled);
        int other = 0;
        for (int i = 0; i < PIXELS; i++) other += memcmp(all[i], culled[i], 4) != 0;
        assert_true(other <= PIXELS / 200);
        assert_true(less.triangles_drawn + less.splats_drawn < (full.triangles_drawn + full.splats_drawn) * 2 / 3);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- From frame to frame ---- */

static void a_resting_view_costs_nothing(void **state) {
    struct host *host = *state;
    struct target target;
    static picture first, pixels;
    pbr_lod *lod = make_lod(host, 0.1);
    pbr_item item = lod_item(lod, PBR_SPLAT_GAUSSIAN);
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(2.4);
    frame.threshold = 6;
    pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, first);
    assert_true(stats.upload_bytes > 0 && stats.nodes_visited > 0);
    const size_t allocations = host->memory.allocations;
    for (int i = 0; i < 3; i++) {
        stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        assert_int_equal(stats.upload_bytes, 0);
        assert_int_equal(stats.nodes_visited, 0);
        assert_memory_equal(first, pixels, sizeof first);
    }
    /* A slow way: next to what the walk from the root looks at, little. */
    uint64_t visited = 0;
    for (int i = 1; i <= 10; i++) {
        frame = make_frame(2.4 + 1e-4 * i);
        frame.threshold = 6;
        stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        if (i > 2) visited += stats.nodes_visited;
    }
    assert_true(visited / 8 < TRIANGLES / 20);
    for (int i = 1; i <= 3; i++) draw_picture(host, &target, &frame, &item, 1, pixels);
    assert_true(host->memory.allocations - allocations < 16);
    pbr_lod_release(&lod);
    target_close(&target);
}

/* The thread that refines comes to what a frame that waits shows. */
static void refined_pictures_end_where_waiting_ones_are(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted, got;
    host_use_threads(host, 2);
    pbr_lod *lod = make_lod(host, 0.1);
    const pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
    target_open(&target, SIZE);
    for (int i = 0; i < 4; i++) {
        pbr_frame frame = make_frame(2 + 0.3 * i);
        frame.threshold = 6;
        draw_picture(host, &target, &frame, &item, 1, wanted);
        pbr_frame near = make_frame(1.2);
        draw_picture(host, &target, &near, &item, 1, got);
        frame.flags = 0;
        pbr_stats stats = PBR_STATS_INIT;
        for (int k = 0; k < 100000 && !stats.is_final; k++) stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_int_equal(stats.is_final, 1);
        assert_memory_equal(wanted, got, sizeof got);
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Vertices, all triangles, cuts: all count, go when they are evicted, and make room for one another. */
static void the_budget_is_kept(void **state) {
    struct host *host = *state;
    struct target target;
    static picture wanted[2], got;
    pbr_lod *lods[2] = {make_lod(host, 0.1), make_lod(host, 0)};
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(2.4);
    uint64_t most = 0;
    pbr_renderer_info info = PBR_RENDERER_INFO_INIT;
    for (int i = 0; i < 2; i++) {
        const pbr_item item = lod_item(lods[i], PBR_SPLAT_ELLIPSE);
        pbr_renderer_evict(host->renderer, NULL);
        for (int t = 0; t < 2; t++) {
            frame.threshold = t ? PBR_THRESHOLD_LEAVES : 6;
            draw_picture(host, &target, &frame, &item, 1, wanted[i]);
        }
        assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
        if (info.gpu_memory_bytes > most) most = info.gpu_memory_bytes;
    }
    pbr_renderer_desc desc = host_renderer_desc();
    desc.gpu_memory_budget = most + most / 8;
    host_use_renderer(host, &desc);
    for (int i = 0; i < 6; i++) {
        const pbr_item item = lod_item(lods[i % 2], PBR_SPLAT_ELLIPSE);
        for (int t = 0; t < 2; t++) {
            frame.threshold = t ? PBR_THRESHOLD_LEAVES : 6;
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
            assert_true(stats.gpu_memory_bytes <= desc.gpu_memory_budget);
        }
        assert_memory_equal(wanted[i % 2], got, sizeof got);
    }
    for (int i = 0; i < 2; i++) pbr_renderer_evict_lod(host->renderer, lods[i]);
    assert_int_equal(pbr_renderer_get_info(host->renderer, &info), PBR_OK);
    assert_int_equal(info.gpu_memory_bytes, 0);
    /* All triangles, and cuts of some, take turns where there is room for one. */
    pbr_lod_info lod_info = PBR_LOD_INFO_INIT;
    assert_int_equal(pbr_lod_get_info(lods[0], &lod_info), PBR_OK);
    desc.gpu_memory_budget = lod_info.vertex_count * 24 + lod_info.triangle_count * 12 * 11 / 10;
    host_use_renderer(host, &desc);
    for (int i = 0; i < 6; i++) {
        const pbr_item item = lod_item(lods[0], PBR_SPLAT_ELLIPSE);
        frame = make_frame(i % 2 ? 3 : 1.3);
        frame.threshold = PBR_THRESHOLD_LEAVES;
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, got);
        assert_int_equal(stats.triangles_drawn == lod_info.triangle_count, i % 2);
    }
    desc.gpu_memory_budget = 1000;
    host_use_renderer(host, &desc);
    const pbr_item item = lod_item(lods[0], PBR_SPLAT_ELLIPSE);
    assert_int_equal(pbr_render(host->view, &frame, &item, 1, NULL), PBR_ERROR_OUT_OF_GPU_MEMORY);
    for (int i = 0; i < 2; i++) pbr_lod_release(&lods[i]);
    target_close(&target);
}

/* What a point costs decides which nodes are points; the picture stays whole. */
static void points_that_cost_more_stand_for_more(void **state) {
    struct host *host = *state;
    struct target target;
    static picture triangles, pixels;
    static const float costs[] = {0, 1, 3, 50, 1e6f};
    pbr_lod *lod = make_lod(host, 0.1);
    pbr_item item = lod_item(lod, PBR_SPLAT_ELLIPSE);
    uint64_t last = UINT64_MAX;
    target_open(&target, SIZE);
    pbr_frame frame = make_frame(5);
    frame.threshold = PBR_THRESHOLD_LEAVES;
    draw_picture(host, &target, &frame, &item, 1, triangles);
    frame.threshold = 6;
    for (size_t i = 0; i < sizeof costs / sizeof *costs; i++) {
        item.point_cost = costs[i];
        const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
        assert_true(stats.splats_drawn <= last);
        if (costs[i] == 3) assert_true(stats.splats_drawn < last && stats.triangles_drawn > 0);
        last = stats.splats_drawn;
        for (int p = 0; p < PIXELS; p++) assert_true(triangles[p][3] == 0 || pixels[p][3] > 0);
        if (costs[i] <= 1) assert_int_equal(stats.triangles_drawn, 0);
    }
    assert_true(last <= 1); /* but for the root */
    pbr_lod_release(&lod);
    target_close(&target);
}

/* 1, or what leaves out some levels. */
static bool is_tried_cost(float cost) {
    int exponent = 0;
    return cost == 1 || (frexpf(cost, &exponent) == 0.5f && exponent % 2 == 0 && cost <= 131072);
}

static bool has_blue(picture pixels) {
    for (int i = 0; i < PIXELS; i++)
        if (pixels[i][2] > pixels[i][0]) return true;
    return false;
}

/* In frames each of which is in front of the one before it, in either sense of depth: with a cost of 1 all are splats, so the last
 * one's triangles show. Nothing else changes. */
static void a_point_cost_is_found_by_drawing(void **state) {
    struct host *host = *state;
    struct target target;
    static picture before, pixels;
    static float depth[PIXELS];
    static const uint32_t kinds[] = {PBR_SPLAT_CIRCLE, PBR_SPLAT_ELLIPSE, PBR_SPLAT_GAUSSIAN};
    host_use_threads(host, 2); /* else each frame waits */
    pbr_lod *lod = make_lod(host, 0.1);
    pbr_item item = lod_item(lod, 0);
    item.colour_source = PBR_COLOUR_PRIMITIVE;
    target_open(&target, SIZE);
    for (int reversed = 0; reversed < 2; reversed++)
        for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
            pbr_frame frame = make_frame(5);
            float cost = -1;
            GLint bound = 0;
            item.splat = kinds[i];
            frame.threshold = 6;
            if (reversed) {
                frame.flags |= PBR_FRAME_REVERSED_Z;
                for (int k = 0; k < 4; k++) frame.projection[4 * k + 2] *= -1;
                frame.depth_range[0] = 0.25f, frame.depth_range[1] = 0.75f;
            }
            assert_int_equal(draw_picture(host, &target, &frame, &item, 1, before).triangles_drawn, 0);
            assert_false(has_blue(before));
            target_clear(&target, (const float[4]){0, 0, 0, 0}, reversed ? 0 : 1);
            frame.time_budget = 1e-6; /* would make it coarser, were it asked */
            frame.flags &= ~(uint32_t)PBR_FRAME_WAIT;
            assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &item, &cost), PBR_OK);
            frame.time_budget = 0;
            frame.flags |= PBR_FRAME_WAIT;
            expect_no_gl_error("measuring");
            assert_true(is_tried_cost(cost));
            target_read(&target, pixels);
            assert_true(has_blue(pixels));
            target_read_depth(&target, depth);
            for (int p = 0; p < PIXELS; p++) {
                if (before[p][3] == 0) continue;
                assert_true(pixels[p][3] > 0);
                /* At least two costs are tried, so seven frames of forty are behind the last one. */
                if (reversed) assert_true(depth[p] >= 0.25f + 0.5f * 7 / 40 && depth[p] <= 0.75f);
                else assert_true(depth[p] >= 0 && depth[p] <= 33.0f / 40);
            }
            glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &bound);
            assert_int_equal(bound, target.framebuffer);
            draw_picture(host, &target, &frame, &item, 1, pixels);
            assert_memory_equal(before, pixels, sizeof before);
        }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Only what has one has a cost. */
static void a_point_cost_is_refused_where_there_is_none(void **state) {
    struct host *host = *state;
    struct target target;
    pbr_lod *lod = make_lod(host, 0.1);
    const pbr_frame frame = make_frame(5);
    pbr_item item = lod_item(lod, 0), wrong;
    pbr_points *points = NULL;
    pbr_lod *tree = NULL;
    float cost = -1;
    target_open(&target, SIZE);
    assert_int_equal(pbr_renderer_measure_point_cost(NULL, &frame, &item, &cost), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, NULL, &item, &cost), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, NULL, &cost), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &item, NULL), PBR_ERROR_INVALID_ARGUMENT);
    wrong = item, wrong.lod = NULL;
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &wrong, &cost), PBR_ERROR_INVALID_ARGUMENT);
    wrong = item, wrong.flags = PBR_ITEM_HIDDEN;
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &wrong, &cost), PBR_ERROR_INVALID_ARGUMENT);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &points), PBR_OK);
    desc.kind = PBR_LOD_QSPLAT;
    desc.points = points;
    assert_int_equal(pbr_lod_create(host->instance, &desc, &tree), PBR_OK);
    wrong = item, wrong.lod = tree;
    assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &wrong, &cost), PBR_ERROR_INVALID_ARGUMENT);
    pbr_lod_release(&tree);
    pbr_points_release(&points);
    wrong = item, wrong.struct_size = 8;
    assert_int_not_equal(pbr_renderer_measure_point_cost(host->renderer, &frame, &wrong, &cost), PBR_OK);
    static const float bad_ranges[][2] = {{-1, 1}, {0, 1.5f}, {0, NAN}},
                       ranges[][2] = {{0.01f, 1}, {1, 0.01f}, {0.03f, 1}, {0.5f, 0.5f}};
    for (int reversed = 0; reversed < 2; reversed++) {
        pbr_frame other = frame;
        if (reversed) other.flags |= PBR_FRAME_REVERSED_Z;
        for (size_t i = 0; i < sizeof bad_ranges / sizeof *bad_ranges; i++) {
            memcpy(other.depth_range, bad_ranges[i], sizeof other.depth_range);
            assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &other, &item, &cost), PBR_ERROR_INVALID_ARGUMENT);
        }
        assert_true(cost == -1);
        for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
            float found = -1;
            memcpy(other.depth_range, ranges[i], sizeof other.depth_range);
            assert_int_equal(pbr_renderer_measure_point_cost(host->renderer, &other, &item, &found), PBR_OK);
            assert_true(is_tried_cost(found));
        }
    }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* ---- Large triangles before others ---- */

/* Two walls, one behind the other: of one square, and of many small ones. Red before green. */
static pbr_lod *make_walls(struct host *host, double gap) {
    enum { SIDE = 60, CORNERS = (SIDE + 1) * (SIDE + 1), SQUARES = SIDE * SIDE };
    static float positions[4 + CORNERS][3], colours[4 + CORNERS][3], normals[4 + CORNERS][3];
    static uint32_t triangles[2 + 2 * SQUARES][3];
    static const uint32_t front[2][3] = {{0, 1, 2}, {2, 1, 3}};
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
    pbr_mesh *mesh = NULL;
    pbr_lod *lod = NULL;
    for (int i = 0; i < 4 + CORNERS; i++) {
        const int at = i - 4;
        positions[i][0] = i < 4 ? (float)(i % 2 * 2 - 1) : 2 * (float)(at % (SIDE + 1)) / SIDE - 1;
        positions[i][1] = i < 4 ? (float)(i / 2 * 2 - 1) : 2 * (float)(at / (SIDE + 1)) / SIDE - 1;
        positions[i][2] = i < 4 ? 0 : (float)-gap;
        colours[i][0] = i < 4 ? 1 : 0;
        colours[i][1] = i < 4 ? 0 : 1;
        normals[i][2] = 1;
    }
    memcpy(triangles, front, sizeof front);
    for (uint32_t i = 0; i < SQUARES; i++) {
        const uint32_t corner = 4 + i / SIDE * (SIDE + 1) + i % SIDE, above = corner + SIDE + 1;
        const uint32_t halves[2][3] = {{corner, corner + 1, above}, {corner + 1, above + 1, above}};
        memcpy(triangles[2 + 2 * i], halves, sizeof halves);
    }
    desc.vertex_count = 4 + CORNERS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = 2 + 2 * SQUARES;
    assert_int_equal(pbr_mesh_create(host->instance, &desc, &mesh), PBR_OK);
    lod_desc.kind = PBR_LOD_POP;
    lod_desc.mesh = mesh;
    assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
    pbr_mesh_release(&mesh);
    return lod;
}

/* Whatever is behind them, splats or triangles, and though their corners are far apart. */
static void large_triangles_hide_what_is_behind(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    pbr_lod *lod = make_walls(host, 0.3);
    target_open(&target, SIZE);
    for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++)
        for (int way = 0; way < 6; way++) {
            pbr_item item = lod_item(lod, splat);
            item.shading = way / 2 == 1 && splat >= PBR_SPLAT_GAUSSIAN ? PBR_SHADE_DEFERRED : PBR_SHADE_NONE;
            item.blending = way / 2 == 2 && splat <= PBR_SPLAT_ELLIPSE ? PBR_BLEND_FILL : PBR_BLEND_KIND;
            pbr_frame frame = make_frame(3);
            matrix_translation(0, 0, -3, frame.view);
            frame.threshold = way % 2 ? 6 : PBR_THRESHOLD_LEAVES;
            const pbr_stats stats = draw_picture(host, &target, &frame, &item, 1, pixels);
            if (way % 2) assert_true(stats.splats_drawn > 100);
            int red = 0, other = 0;
            for (int y = SIZE / 4; y < 3 * SIZE / 4; y++) /* within the front wall's outline */
                for (int x = SIZE / 4; x < 3 * SIZE / 4; x++) {
                    const uint8_t *p = pixels[y * SIZE + x];
                    red += p[0] > p[1] + 60; /* lit, with a highlight */
                    other += p[0] <= p[1] + 60;
                }
            if (other > 0 || red != SIZE * SIZE / 4)
                fail_msg("splat %u, way %d: %d red, %d others", (unsigned)splat, way, red, other);
        }
    pbr_lod_release(&lod);
    target_close(&target);
}

/* Each pixel looks up its own depth, and what is between two colours is their mean in linear light. */
static void colours_vary_over_triangles(void **state) {
    struct host *host = *state;
    struct target target;
    static picture pixels;
    static const float map[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static float floor_positions[4][3] = {{-50, -1, -1}, {50, -1, -1}, {-50, -1, -60}, {50, -1, -60}};
    static float ramp_positions[4][3] = {{-1, -1, 0}, {1, -1, 0}, {-1, 1, 0}, {1, 1, 0}};
    static float colours[4][3] = {{1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 1, 0}},
                 normals[4][3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    static const uint32_t triangles[2][3] = {{0, 1, 2}, {2, 1, 3}};
    target_open(&target, SIZE);
    for (int way = 0; way < 2; way++) {
        pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
        pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
        pbr_mesh *mesh = NULL;
        pbr_lod *lod = NULL;
        desc.vertex_count = 4;
        desc.positions = (pbr_attribute){way ? ramp_positions : floor_positions, 0, PBR_FORMAT_FLOAT32, 3};
        desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_FLOAT32, 3};
        desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
        desc.indices = triangles;
        desc.index_format = PBR_FORMAT_UINT32;
        desc.triangle_count = 2;
        assert_int_equal(pbr_mesh_create(host->instance, &desc, &mesh), PBR_OK);
        lod_desc.kind = PBR_LOD_POP;
        lod_desc.mesh = mesh;
        assert_int_equal(pbr_lod_create(host->instance, &lod_desc, &lod), PBR_OK);
        pbr_mesh_release(&mesh);
        for (uint32_t splat = PBR_SPLAT_SQUARE; splat <= PBR_SPLAT_GAUSSIAN; splat++) {
            pbr_item item = lod_item(lod, splat);
            pbr_frame frame = make_frame(3);
            matrix_translation(0, 0, way ? -3 : 0, frame.view);
            item.shading = PBR_SHADE_NONE;
            if (!way) {
                item.colour_source = PBR_COLOUR_DEPTH;
                item.colour_map = map[0];
                item.colour_map_size = 3;
                item.scalar_range[0] = 1;
                item.scalar_range[1] = 21;
            }
            draw_picture(host, &target, &frame, &item, 1, pixels);
            int green = 0;
            for (int i = 0; i < PIXELS; i++) green += pixels[i][3] > 0 && pixels[i][1] > 220;
            if (!way) assert_true(green > 100);
            const uint8_t *middle = pixels[SIZE / 2 * SIZE + SIZE / 2]; /* half of either, in sRGB */
            if (way) assert_true(abs(middle[0] - 188) <= 3 && abs(middle[1] - 188) <= 3);
        }
        pbr_lod_release(&lod);
    }
    target_close(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(without_a_threshold_the_mesh_is_drawn),
        GL_TEST(no_seam_shows),
        GL_TEST(colours_tell_the_primitives),
        GL_TEST(clip_planes_cut_triangles),
        GL_TEST(far_sides_can_be_dropped),
        GL_TEST(a_resting_view_costs_nothing),
        GL_TEST(refined_pictures_end_where_waiting_ones_are),
        GL_TEST(the_budget_is_kept),
        GL_TEST(points_that_cost_more_stand_for_more),
        GL_TEST(a_point_cost_is_found_by_drawing),
        GL_TEST(a_point_cost_is_refused_where_there_is_none),
        GL_TEST(large_triangles_hide_what_is_behind),
        GL_TEST(colours_vary_over_triangles),
    };
    return RUN_GL_TESTS("pop", tests);
}
