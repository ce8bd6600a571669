/* Ellipses cover the pixels, and leave the depth, that docs/splats.md defines. SPDX-License-Identifier: MIT */
#include "surfels.h"

#include <stdlib.h>

/* ---- Pictures: sheets of many, to be read at once ---- */

enum { WIDTH = PICTURE_WIDTH, HEIGHT = PICTURE_HEIGHT, CELLS = 64 };

struct shot {
    const char *what;
    const struct camera *camera;
    pbr_frame frame; /* the camera's, moved to the cell */
    pbr_item item;
    struct surfel surfel;
    bool dropped; /* nothing is to be seen */
};

struct sheet {
    struct host *host;
    struct target target;
    uint8_t (*pixels)[4];
    float *depth; /* not of multisampled targets */
    int columns, cells, width, height;
    struct shot shots[CELLS];
    int count;
    long inside, outside, either; /* pixels judged so far */
};

static void sheet_open(struct sheet *sheet, struct host *host, int columns, int rows, int width, int height, int samples) {
    *sheet = (struct sheet){.host = host, .columns = columns, .cells = columns * rows, .width = width, .height = height};
    const size_t pixels = (size_t)(columns * width) * (size_t)(rows * height);
    const GLenum depth = samples ? GL_DEPTH_COMPONENT24 : GL_DEPTH_COMPONENT32F;
    sheet->pixels = malloc(pixels * sizeof(*sheet->pixels));
    sheet->depth = malloc(pixels * sizeof(*sheet->depth));
    assert_non_null(sheet->pixels);
    assert_non_null(sheet->depth);
    assert_true(sheet->cells <= CELLS);
    assert_true(target_create(&sheet->target, columns * width, rows * height, GL_RGBA8, depth, samples));
    target_bind(&sheet->target);
}

static void sheet_close(struct sheet *sheet) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&sheet->target);
    free(sheet->pixels);
    free(sheet->depth);
}

static bool is_in(const int32_t box[4], int x, int y) {
    return x >= box[0] && x < box[0] + box[2] && y >= box[1] && y < box[1] + box[3];
}

static void check_pixel(struct sheet *sheet, const struct shot *shot, const struct sight *sight, int x, int y) {
    const int i = y * sheet->target.width + x, alpha = sheet->pixels[i][3];
    const double px = x + 0.5, py = y + 0.5;
    enum verdict verdict = shot->dropped ? OUTSIDE : judge(sight, px, py);
    if (!is_in(shot->frame.viewport, x, y) || (shot->frame.flags & PBR_FRAME_SCISSOR && !is_in(shot->frame.scissor, x, y)))
        verdict = OUTSIDE;
    sheet->inside += verdict == INSIDE;
    sheet->outside += verdict == OUTSIDE;
    sheet->either += verdict == EITHER;
    /* At the border some of a pixel's samples may not be as its centre is: GL points, quads and clipping end between them. */
    const int some = sheet->target.samples ? 254 : 0;
    if (verdict == INSIDE ? alpha < 255 - some : verdict == OUTSIDE && alpha > some)
        fail_msg("%s, %s: pixel (%d, %d) of viewport %d %d %d %d has alpha %d: rho %.9g, window depth %.9g", shot->camera->name,
                 shot->what, x, y, shot->frame.viewport[0], shot->frame.viewport[1], shot->frame.viewport[2],
                 shot->frame.viewport[3], alpha, rho(sight, px, py), window_depth(sight, px, py));
    if (alpha == 0 || sheet->target.samples) return;
    const double depth = (double)sheet->depth[i], off = fabs(depth - window_depth(sight, px, py));
    if (!(off <= fabs(sight->scale) * sight->room + DEPTH_ERROR))
        fail_msg("%s, %s: pixel (%d, %d) has depth %.9g, not %.9g (rho %.9g)", shot->camera->name, shot->what, x, y, depth,
                 window_depth(sight, px, py), rho(sight, px, py));
}

static void check_cell(struct sheet *sheet, int cell) {
    const int left = cell % sheet->columns * sheet->width, bottom = cell / sheet->columns * sheet->height;
    const struct shot *shot = &sheet->shots[cell];
    const struct sight sight = see(&shot->frame, &shot->item, shot->camera->model, &shot->surfel);
    for (int y = bottom; y < bottom + sheet->height; y++)
        for (int x = left; x < left + sheet->width; x++) check_pixel(sheet, shot, &sight, x, y);
}

/* Reads and judges what was drawn since the last time. */
static void sheet_check(struct sheet *sheet) {
    if (sheet->count == 0) return;
    target_read(&sheet->target, sheet->pixels);
    picture_save("disc", (const uint8_t(*)[4])sheet->pixels, sheet->target.width, sheet->target.height);
    if (!sheet->target.samples) target_read_depth(&sheet->target, sheet->depth);
    for (int cell = 0; cell < sheet->count; cell++) check_cell(sheet, cell);
    sheet->count = 0;
}

/* A set of one point; `surfel` becomes what the set holds of it (normals are rounded to 16 bits). */
static pbr_points *one_surfel(struct host *host, struct surfel *surfel) {
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    float normal[3] = {0, 0, 0}, radius = 0;
    desc.count = 1;
    desc.positions = (pbr_attribute){surfel->position, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radius = (float)surfel->radius;
    if (length3(surfel->normal) > 0) {
        desc.normals = (pbr_attribute){surfel->normal, 0, PBR_FORMAT_FLOAT64, 3};
        copy.normals = normal;
    }
    if (pbr_points_create(host->instance, &desc, &points) != PBR_OK) fail_msg("no points: %s", host->log);
    copy.positions = surfel->position;
    copy.radii = &radius;
    assert_int_equal(pbr_points_copy(points, 0, 1, &copy), PBR_OK);
    for (int k = 0; k < 3; k++) surfel->normal[k] = (double)normal[k];
    surfel->radius = (double)radius;
    return points;
}

/* A place in the next cell for a disc that is then drawn with sheet_draw. */
static struct shot *sheet_next(struct sheet *sheet, const char *what, const struct camera *camera, const pbr_item *item,
                               const struct surfel *surfel) {
    const uint32_t reversed = camera->frame.flags & PBR_FRAME_REVERSED_Z;
    if (sheet->count == sheet->cells || (sheet->count > 0 && (sheet->shots[0].frame.flags & PBR_FRAME_REVERSED_Z) != reversed))
        sheet_check(sheet);
    if (sheet->count == 0) target_clear(&sheet->target, (const float[4]){0, 0, 0, 0}, reversed ? 0 : 1);
    struct shot *shot = &sheet->shots[sheet->count];
    *shot = (struct shot){what, camera, camera->frame, *item, *surfel, false};
    const int32_t corner[2] = {sheet->count % sheet->columns * sheet->width, sheet->count / sheet->columns * sheet->height};
    for (int k = 0; k < 2; k++) {
        shot->frame.viewport[k] += corner[k];
        shot->frame.scissor[k] += corner[k];
    }
    return shot;
}

static void sheet_draw(struct sheet *sheet, struct shot *shot) {
    pbr_points *points = one_surfel(sheet->host, &shot->surfel);
    shot->item.points = points;
    shot->item.transforms = shot->camera->model;
    shot->item.transform_count = 1;
    render(sheet->host, &shot->frame, &shot->item, 1);
    pbr_renderer_evict(sheet->host->renderer, points);
    pbr_points_release(&points);
    sheet->count++;
}

static void sheet_add(struct sheet *sheet, const char *what, const struct camera *camera, const pbr_item *item,
                      const struct surfel *surfel) {
    sheet_draw(sheet, sheet_next(sheet, what, camera, item, surfel));
}

/* ---- Every disc through every camera ---- */

static void check_family(struct sheet *sheet, const struct family *family, const struct camera *camera, const pbr_item *item,
                         uint64_t *seed, int count) {
    if (family->perspective && is_parallel(camera)) return;
    for (int n = 0; n < count; n++) {
        struct surfel surfel = family->make(camera, seed);
        sheet_add(sheet, family->name, camera, item, &surfel);
    }
}

/* Of the pixels by a rim few are too near to it to tell. */
static void expect_decided(const struct sheet *sheet, long inside) {
    assert_true(sheet->inside >= inside);
    assert_true(sheet->either < (sheet->inside + sheet->outside) / 500);
}

static void check_all(struct host *host, int each) {
    struct sheet sheet;
    struct camera views[VIEWS];
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 1;
    make_views(views);
    sheet_open(&sheet, host, 8, 8, WIDTH, HEIGHT, 0);
    for (int f = 0; f < FAMILIES; f++) {
        for (int v = 0; v < VIEWS; v++) check_family(&sheet, &families[f], &views[v], &item, &seed, each);
        sheet_check(&sheet);
    }
    expect_decided(&sheet, 100000);
    sheet_close(&sheet);
}

static void use_limit(struct host *host, float limit) {
    pbr_renderer_desc desc = host_renderer_desc();
    desc.point_size_limit = limit;
    host_use_renderer(host, &desc);
}

static void discs_cover_the_pixels_that_see_them(void **state) {
    check_all(*state, 3);
}

static void discs_as_quads_cover_the_same_pixels(void **state) {
    host_use_quads(*state);
    check_all(*state, 3);
}

static void a_mixture_of_points_and_quads_covers_the_same_pixels(void **state) {
    use_limit(*state, 24);
    check_all(*state, 3);
}

/* ---- What the item says ---- */

static void sizes_stay_between_minimum_and_maximum(void **state) {
    static const struct {
        float minimum, maximum, scale;
    } limits[] = {{9, 0, 0}, {0, 12, 0}, {7, 30, 1.7f}, {0, 0, 0.3f}, {0, 0.4f, 0}, {300, 0, 0}};
    enum { LIMITS = sizeof(limits) / sizeof(limits[0]) };
    static const int chosen[] = {0, 1, 6, 12, CAMERAS + 1, CAMERAS + 2};
    struct sheet sheet;
    struct camera views[VIEWS];
    pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 2;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int l = 0; l < LIMITS; l++)
            for (size_t c = 0; c < sizeof(chosen) / sizeof(chosen[0]); c++)
                for (int f = 0; f < FAMILIES; f++) {
                    item.size_minimum = limits[l].minimum;
                    item.size_maximum = limits[l].maximum;
                    item.radius_scale = limits[l].scale;
                    check_family(&sheet, &families[f], &views[chosen[c]], &item, &seed, 1);
                }
        sheet_check(&sheet);
    }
    expect_decided(&sheet, 100000);
    sheet_close(&sheet);
}

/* Towards the eye from a point of eye space; a parallel projection's eye is where window depth is nearest. */
static void direction_to_eye(const struct camera *camera, const double position[3], double out[3]) {
    const struct stand stand = stand_of(camera);
    const bool farther_ahead = camera->frame.depth_range[0] <= camera->frame.depth_range[1];
    const bool reversed = camera->frame.flags & PBR_FRAME_REVERSED_Z;
    const double sign = stand.eye[3] != 0 ? 1 : farther_ahead == reversed ? 1 : -1;
    for (int k = 0; k < 3; k++) out[k] = sign * (stand.eye[k] - stand.eye[3] * position[k]);
    unit(out);
}

/* Cosine between the normal, by the inverse transpose, and the direction to the eye. */
static double facing(const struct camera *camera, const struct surfel *surfel) {
    double eye[16], clip[16], inverse[16], position[3], normal[3], to[3];
    matrices_of(&camera->frame, camera->model, eye, clip);
    assert_true(matrix_invert(eye, inverse));
    to_eye(camera, surfel->position, position);
    direction_to_eye(camera, position, to);
    for (int k = 0; k < 3; k++) normal[k] = dot3(inverse + 4 * k, surfel->normal);
    return dot3(normal, to) / length3(normal);
}

static void back_faces_are_dropped_by_their_centres(void **state) {
    struct sheet sheet;
    struct camera views[VIEWS];
    pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 3;
    int dropped = 0, kept = 0;
    item.flags = PBR_ITEM_CULL_BACK_FACES;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int v = 0; v < VIEWS; v++)
            for (int n = 0; n < 12; n++) {
                struct surfel surfel = n % 6 == 0   ? without_a_normal(&views[v], &seed)
                                       : n % 6 == 1 ? sloping(&views[v], &seed, n < 6 ? 0.02 : -0.02)
                                       : n % 6 == 2 ? from_beside_the_view(&views[v], &seed)
                                                    : of_any_size(&views[v], &seed);
                struct shot *shot = sheet_next(&sheet, "back faces", &views[v], &item, &surfel);
                shot->dropped = length3(surfel.normal) > 0 && facing(&views[v], &surfel) < 0;
                dropped += shot->dropped;
                kept += !shot->dropped;
                sheet_draw(&sheet, shot);
            }
        sheet_check(&sheet);
    }
    assert_true(dropped > 100 && kept > 100);
    expect_decided(&sheet, 10000);
    sheet_close(&sheet);
}

static void clip_planes_keep_or_drop_whole_discs(void **state) {
    static const double planes[2][4] = {{1, 0.5, 0, -0.25}, {0, -2, 1, 9}}; /* world space */
    struct sheet sheet;
    struct camera views[VIEWS];
    pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 4;
    int dropped = 0;
    item.clip_planes = planes[0];
    item.clip_plane_count = 2;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int v = 0; v < VIEWS; v++)
            for (int n = 0; n < 6; n++) {
                const struct surfel surfel = of_any_size(&views[v], &seed);
                const double p[4] = {surfel.position[0], surfel.position[1], surfel.position[2], 1};
                double world[4];
                struct shot *shot = sheet_next(&sheet, "clip planes", &views[v], &item, &surfel);
                matrix_apply(views[v].model, p, world);
                for (int k = 0; k < 2; k++) shot->dropped |= dot3(planes[k], world) + planes[k][3] < 0;
                dropped += shot->dropped;
                sheet_draw(&sheet, shot);
            }
        sheet_check(&sheet);
    }
    assert_true(dropped > 50);
    expect_decided(&sheet, 2000);
    sheet_close(&sheet);
}

/* ---- What the frame says ---- */

static void the_scissor_box_of_the_frame_cuts(void **state) {
    static const int32_t box[4] = {20, 5, 30, 44};
    struct sheet sheet;
    struct camera views[VIEWS];
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 5;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int v = 0; v < CAMERAS; v += 4) {
            views[v].frame.flags |= PBR_FRAME_SCISSOR;
            memcpy(views[v].frame.scissor, box, sizeof(box));
            for (int f = 0; f < FAMILIES; f++) check_family(&sheet, &families[f], &views[v], &item, &seed, 1);
        }
        sheet_check(&sheet);
    }
    expect_decided(&sheet, 10000);
    sheet_close(&sheet);
}

/* A range without extent tells nothing about near and far. */
static void near_and_far_planes_cut_in_every_depth_range(void **state) {
    static const float ranges[][2] = {{0.5f, 0.5f}, {0.9f, 0.2f}, {0.3f, 0.300001f}, {0, 0.001f}};
    enum { RANGES = sizeof(ranges) / sizeof(ranges[0]) };
    struct sheet sheet;
    struct camera views[VIEWS];
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 6;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int r = 0; r < RANGES; r++)
            for (int v = 0; v < 12; v++) {
                struct camera camera = views[v];
                memcpy(camera.frame.depth_range, ranges[r], sizeof(camera.frame.depth_range));
                for (int n = 0; n < 2; n++) {
                    struct surfel near = through_the_near_plane(&camera, &seed), far = through_the_far_plane(&camera, &seed);
                    sheet_add(&sheet, "near, in a depth range", &camera, &item, &near);
                    sheet_add(&sheet, "far, in a depth range", &camera, &item, &far);
                }
                sheet_check(&sheet); /* the camera's address is this loop's */
            }
    }
    expect_decided(&sheet, 10000);
    sheet_close(&sheet);
}

/* Samples of a pixel see what its centre sees. */
static void a_multisampled_target_gets_pixels_by_their_centres(void **state) {
    struct sheet sheet;
    struct camera views[VIEWS];
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 7;
    make_views(views);
    sheet_open(&sheet, *state, 8, 8, WIDTH, HEIGHT, 4);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int v = 0; v < VIEWS; v += 3)
            for (int f = 0; f < FAMILIES; f++) check_family(&sheet, &families[f], &views[v], &item, &seed, 1);
        sheet_check(&sheet);
    }
    expect_decided(&sheet, 10000);
    sheet_close(&sheet);
}

static void check_viewport(struct host *host, int width, int height, int each) {
    struct sheet sheet;
    struct camera views[VIEWS];
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    uint64_t seed = 8;
    make_views(views);
    const int cells = width > WIDTH ? 1 : 8;
    sheet_open(&sheet, host, cells, cells, width, height, 0);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(host);
        for (int v = 0; v < 2; v++) {
            frame_set_viewport(&views[v].frame, 0, 0, width, height);
            if (width > WIDTH) views[v].frame.projection[0] *= (double)WIDTH / HEIGHT * height / width; /* square pixels */
            for (int f = 0; f < FAMILIES; f++) check_family(&sheet, &families[f], &views[v], &item, &seed, each);
            sheet_check(&sheet);
        }
    }
    assert_true(sheet.inside > 100 && sheet.outside > 100);
    sheet_close(&sheet);
}

static void a_viewport_of_one_pixel_is_seen_through(void **state) {
    check_viewport(*state, 1, 1, 40);
}

static void the_widest_viewport_is_exact(void **state) {
    GLint sides[3] = {0, 0, 0}, most[2] = {0, 0};
    glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &sides[0]);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &sides[1]);
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, most);
    sides[2] = most[0];
    for (int i = 0; i < 3; i++)
        if (sides[i] < 16384) {
            print_message("skipped: no targets of 16384 x 16 pixels\n");
            skip();
        }
    check_viewport(*state, 16384, 16, 1);
}

/* ---- What hides what ---- */

enum { CROWD = 280, COPIES = 2, SIGHTS = CROWD * COPIES };

/* Discs of all families in one set, drawn under two transforms; colours are all different. */
struct crowd {
    struct surfel surfels[CROWD];
    uint8_t colours[CROWD][4];
    double transforms[COPIES][16];
    pbr_points *points;
    struct sight sights[SIGHTS];
};

static struct crowd *make_crowd(struct host *host, const struct camera *camera, uint64_t seed) {
    static double positions[CROWD][3], normals[CROWD][3];
    static float radii[CROWD], held[CROWD][3];
    static const double axis[3] = {0.2, 1, 0.4};
    struct crowd *crowd = calloc(1, sizeof(*crowd));
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    assert_non_null(crowd);
    for (int i = 0; i < CROWD; i++) {
        const struct family *family = &families[i % 3 ? 0 : i / 3 % FAMILIES];
        struct surfel *surfel = &crowd->surfels[i];
        *surfel = (family->perspective && is_parallel(camera) ? of_any_size : family->make)(camera, &seed);
        memcpy(positions[i], surfel->position, sizeof(positions[i]));
        memcpy(normals[i], surfel->normal, sizeof(normals[i]));
        radii[i] = (float)surfel->radius;
        const uint8_t colour[4] = {(uint8_t)(i % 16 * 16), (uint8_t)(i / 16 * 14), 200, 255};
        memcpy(crowd->colours[i], colour, sizeof(colour));
    }
    desc.count = CROWD;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    desc.colours = (pbr_attribute){crowd->colours, 0, PBR_FORMAT_UINT8, 4};
    assert_int_equal(pbr_points_create(host->instance, &desc, &crowd->points), PBR_OK);
    copy.positions = positions[0];
    copy.normals = held[0];
    assert_int_equal(pbr_points_copy(crowd->points, 0, CROWD, &copy), PBR_OK);
    memcpy(crowd->transforms[0], camera->model, sizeof(crowd->transforms[0]));
    matrix_rotation(axis, 0.3, crowd->transforms[1]);
    crowd->transforms[1][13] = 0.4;
    const pbr_item item = plain_item(NULL, PBR_SPLAT_ELLIPSE);
    for (int i = 0; i < SIGHTS; i++) {
        struct surfel *surfel = &crowd->surfels[i % CROWD];
        memcpy(surfel->position, positions[i % CROWD], sizeof(surfel->position));
        for (int k = 0; k < 3; k++) surfel->normal[k] = (double)held[i % CROWD][k];
        surfel->radius = (double)radii[i % CROWD];
        crowd->sights[i] = see(&camera->frame, &item, crowd->transforms[i / CROWD], surfel);
    }
    return crowd;
}

/* Index of the nearest disc at a pixel's centre, -1 for none, -2 where rounding decides. Nearer is larger in sign x depth. */
static int nearest(const struct crowd *crowd, double sign, double x, double y) {
    double depths[SIGHTS], rooms[SIGHTS], best = INFINITY;
    int seen[SIGHTS], count = 0, winner = -1;
    for (int i = 0; i < SIGHTS; i++) {
        const struct sight *sight = &crowd->sights[i];
        const enum verdict verdict = judge(sight, x, y);
        if (verdict == OUTSIDE) continue;
        depths[count] = -sign * window_depth(sight, x, y);
        rooms[count] = fabs(sight->scale) * sight->room;
        if (verdict == INSIDE && depths[count] < best) {
            best = depths[count];
            winner = count;
        }
        seen[count++] = i;
    }
    for (int i = 0; i < count; i++)
        if (i != winner && (winner < 0 || depths[i] - best <= rooms[i] + rooms[winner])) return -2;
    return winner < 0 ? -1 : seen[winner];
}

/* Fails unless every pixel has the colour of the nearest disc. Returns how many discs are seen. */
static int check_crowd(const struct crowd *crowd, const struct camera *camera, const int nearest_of[WIDTH * HEIGHT],
                       const uint8_t (*pixels)[4]) {
    bool seen[SIGHTS] = {false};
    int count = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int n = nearest_of[i];
        static const uint8_t nothing[4] = {0, 0, 0, 0};
        if (n == -2 || !is_in(camera->frame.viewport, i % WIDTH, i / WIDTH)) continue;
        if (memcmp(pixels[i], n < 0 ? nothing : crowd->colours[n % CROWD], 4))
            fail_msg("%s: pixel (%d, %d) is not of disc %d of copy %d", camera->name, i % WIDTH, i / WIDTH, n % CROWD, n / CROWD);
        if (n >= 0 && !seen[n]) count++, seen[n] = true;
    }
    return count;
}

static void the_nearest_disc_is_seen_at_each_pixel(void **state) {
    static const int chosen[] = {0, 1, 7, 12, CAMERAS + 4};
    static const float limits[] = {0, 24, 0.5f};
    static int nearest_of[WIDTH * HEIGHT];
    static uint8_t pixels[WIDTH * HEIGHT][4];
    struct host *host = *state;
    struct camera views[VIEWS];
    struct target target;
    make_views(views);
    assert_true(target_create(&target, WIDTH, HEIGHT, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&target);
    for (size_t c = 0; c < sizeof(chosen) / sizeof(chosen[0]); c++) {
        const struct camera *camera = &views[chosen[c]];
        const bool reversed = camera->frame.flags & PBR_FRAME_REVERSED_Z;
        struct crowd *crowd = make_crowd(host, camera, 9 + c);
        pbr_item item = plain_item(crowd->points, PBR_SPLAT_ELLIPSE);
        int unsure = 0;
        item.colour_source = PBR_COLOUR_POINTS;
        item.transforms = crowd->transforms[0];
        item.transform_count = COPIES;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            nearest_of[i] = nearest(crowd, reversed ? 1 : -1, i % WIDTH + 0.5, i / WIDTH + 0.5);
            unsure += nearest_of[i] == -2;
        }
        assert_true(unsure < WIDTH * HEIGHT / 20);
        for (int path = 0; path < 3; path++) {
            use_limit(host, limits[path]);
            target_clear(&target, (const float[4]){0, 0, 0, 0}, reversed ? 0 : 1);
            render(host, &camera->frame, &item, 1);
            target_read(&target, pixels);
            picture_save("disc_crowd", (const uint8_t(*)[4])pixels, WIDTH, HEIGHT);
            assert_true(check_crowd(crowd, camera, nearest_of, (const uint8_t(*)[4])pixels) > 30);
        }
        pbr_points_release(&crowd->points);
        free(crowd);
    }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

/* The host's red quad lies at one window depth, the disc crosses it: red wins where the disc is farther. */
static void check_border(struct host *host, struct target *target, const struct camera *camera, bool host_first, uint64_t *seed,
                         int counts[2]) {
    static const float red[4] = {1, 0, 0, 1};
    static uint8_t pixels[WIDTH * HEIGHT][4];
    const bool reversed = camera->frame.flags & PBR_FRAME_REVERSED_Z;
    struct surfel surfel = anywhere(camera, seed, 60, 300);
    pbr_points *points = one_surfel(host, &surfel);
    pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
    item.transforms = camera->model;
    item.transform_count = 1;
    const struct sight sight = see(&camera->frame, &item, camera->model, &surfel);
    double eye[16], clip[16], out[4];
    const double p[4] = {surfel.position[0], surfel.position[1], surfel.position[2], 1};
    matrices_of(&camera->frame, camera->model, eye, clip);
    matrix_apply(clip, p, out);
    const bool zero_to_one = camera->frame.flags & PBR_FRAME_CLIP_ZERO_TO_ONE;
    const double unit_depth = zero_to_one ? out[2] / out[3] : (out[2] / out[3] + 1) / 2;
    const float border = (float)(sight.scale * unit_depth + sight.shift); /* through the disc's centre */
    target_clear(target, (const float[4]){0, 0, 0, 0}, reversed ? 0 : 1);
    for (int step = 0; step < 2; step++) {
        if ((step == 0) != host_first) {
            render(host, &camera->frame, &item, 1);
            continue;
        }
        glViewport(0, 0, WIDTH, HEIGHT);
        glEnable(GL_DEPTH_TEST);
        glDepthFunc(reversed ? GL_GREATER : GL_LESS);
        draw_host_quad(border, red);
        glDisable(GL_DEPTH_TEST);
    }
    target_read(target, pixels);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const double x = i % WIDTH + 0.5, y = i / WIDTH + 0.5, depth = window_depth(&sight, x, y);
        const enum verdict verdict = is_in(camera->frame.viewport, i % WIDTH, i / WIDTH) ? judge(&sight, x, y) : OUTSIDE;
        if (verdict == EITHER || fabs(depth - (double)border) <= fabs(sight.scale) * sight.room) continue;
        const bool seen = verdict == INSIDE && (depth < (double)border) != reversed;
        counts[seen] += verdict == INSIDE;
        if ((pixels[i][1] == 255) != seen || pixels[i][0] != 255)
            fail_msg("%s, host %s: pixel (%d, %d) shows the %s; the disc is at depth %.9g, the host's at %.9g", camera->name,
                     host_first ? "first" : "last", i % WIDTH, i / WIDTH, seen ? "host" : "disc", depth, (double)border);
    }
    pbr_renderer_evict(host->renderer, points);
    pbr_points_release(&points);
}

static void discs_and_the_hosts_quad_cut_each_other(void **state) {
    struct camera views[VIEWS];
    struct target target;
    uint64_t seed = 20;
    int counts[2] = {0, 0};
    make_views(views);
    assert_true(target_create(&target, WIDTH, HEIGHT, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&target);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        for (int v = 0; v < VIEWS; v++)
            for (int n = 0; n < 4; n++) check_border(*state, &target, &views[v], n % 2 == 0, &seed, counts);
    }
    assert_true(counts[0] > 10000 && counts[1] > 10000);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

/* ---- Extremes ---- */

struct extreme {
    const char *what;
    double position[3], spacing; /* of the points */
    double normal[3], radius, scale[3];
    float size_minimum, size_maximum, radius_scale;
    bool draws_nothing;
};

static const struct extreme extremes[] = {
    {"no radius", {0, 0, -5}, 0.1, {0, 0, 1}, 0, {1, 1, 1}, 0, 0, 0, true},
    {"a radius near 0", {0, 0, -5}, 0.1, {0, 0, 1}, 1e-30, {1, 1, 1}, 0, 0, 0, true},
    {"a radius near 0 without a normal", {0, 0, -5}, 0.1, {0, 0, 0}, 1e-42, {1, 1, 1}, 0, 0, 0, true},
    {"a huge radius", {0, 0, -5}, 0.1, {0.1, 0.2, 1}, 1e30, {1, 1, 1}, 0, 0, 0, false},
    {"the largest radius", {0, 1, -5}, 0.1, {0, 1, 0.1}, 3.4e38, {1, 1, 1}, 0, 0, 0, false},
    {"the largest radius behind the eye", {0, 1, 5}, 0.1, {0, 1, 0.1}, 3.4e38, {1, 1, 1}, 0, 0, 0, false},
    {"a huge radius without a normal", {0, 0, -5}, 0.1, {0, 0, 0}, 1e30, {1, 1, 1}, 0, 0, 0, false},
    {"coincident points", {0, 0, -5}, 0, {0, 0, 1}, 0.5, {1, 1, 1}, 0, 0, 0, false},
    {"behind all cameras", {0, 0, 60}, 0.1, {0, 1, 1}, 0.5, {1, 1, 1}, 0, 0, 0, true},
    {"beyond all cameras", {0, 0, -5e4}, 0.1, {0, 1, 1}, 0.5, {1, 1, 1}, 0, 0, 0, false},
    {"at the eye", {0, 0, 0}, 0, {0, 1, 1}, 0.5, {1, 1, 1}, 0, 0, 0, false},
    {"at the eye without a normal", {0, 0, 0}, 0, {0, 0, 0}, 5, {1, 1, 1}, 0, 0, 0, false},
    {"far away", {1e30, -1e30, -1e30}, 1e29, {0, 0, 1}, 1e30, {1, 1, 1}, 0, 0, 0, false},
    {"shrunk to a point", {0, 0, -5}, 0.1, {0, 0, 1}, 0.5, {0, 0, 0}, 0, 0, 0, false},
    {"flattened", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1, 1, 0}, 0, 0, 0, false},
    {"flattened to a line", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1, 0, 0}, 3, 9, 0, false},
    {"shrunk", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1e-30, 1e-30, 1e-30}, 2, 0, 0, false},
    {"enlarged", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1e30, 1e30, 1e30}, 0, 0, 0, false},
    {"a huge minimum", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1, 1, 1}, 3e38f, 0, 0, false},
    {"a maximum near 0", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1, 1, 1}, 0, 1e-30f, 0, true},
    {"a huge scale", {0, 0, -5}, 0.1, {0, 1, 1}, 0.5, {1, 1, 1}, 0, 0, 3e38f, false},
};
enum { EXTREMES = sizeof(extremes) / sizeof(extremes[0]) };

static pbr_points *extreme_points(struct host *host, const struct extreme *extreme) {
    enum { COUNT = 27 };
    double positions[COUNT][3], normals[COUNT][3];
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    for (int i = 0; i < COUNT; i++) {
        const int step[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        for (int k = 0; k < 3; k++) positions[i][k] = extreme->position[k] + extreme->spacing * step[k];
        memcpy(normals[i], extreme->normal, sizeof(normals[i]));
    }
    desc.count = COUNT;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radius = (float)extreme->radius;
    if (pbr_points_create(host->instance, &desc, &points) != PBR_OK) fail_msg("no points: %s", host->log);
    return points;
}

static void read_state(GLint state[16]) {
    static const GLenum names[] = {
        GL_CURRENT_PROGRAM, GL_VERTEX_ARRAY_BINDING, GL_ARRAY_BUFFER_BINDING, GL_DEPTH_FUNC, GL_DRAW_FRAMEBUFFER_BINDING,
        GL_DEPTH_WRITEMASK, GL_DEPTH_TEST,           GL_SCISSOR_TEST,         GL_BLEND};
    enum { NAMES = sizeof(names) / sizeof(names[0]) };
    memset(state, 0, 16 * sizeof(*state));
    for (int i = 0; i < NAMES; i++) glGetIntegerv(names[i], &state[i]);
    glGetIntegerv(GL_VIEWPORT, state + NAMES);
}

/* The picture has no NaN, no colour but the discs' and the background's, and no depth outside the range. */
static void check_sane(const struct target *target, const struct extreme *extreme, const char *camera) {
    static float rgba[WIDTH * HEIGHT][4], depth[WIDTH * HEIGHT];
    target_read_float(target, rgba);
    target_read_depth(target, depth);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        for (int k = 0; k < 4; k++)
            if (!(rgba[i][k] == 0 || rgba[i][k] == 1))
                fail_msg("%s, %s: pixel %d has the value %g", camera, extreme->what, i, (double)rgba[i][k]);
        if (!(depth[i] >= 0 && depth[i] <= 1))
            fail_msg("%s, %s: pixel %d has depth %g", camera, extreme->what, i, (double)depth[i]);
        if (extreme->draws_nothing && rgba[i][3] > 0) fail_msg("%s, %s: pixel %d is covered", camera, extreme->what, i);
    }
}

static void extremes_do_no_harm(void **state) {
    struct host *host = *state;
    struct camera views[VIEWS];
    struct target target;
    make_views(views);
    if (!target_create(&target, WIDTH, HEIGHT, GL_RGBA32F, GL_DEPTH_COMPONENT32F, 0))
        assert_true(target_create(&target, WIDTH, HEIGHT, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&target);
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(host);
        for (int e = 0; e < EXTREMES; e++) {
            const struct extreme *extreme = &extremes[e];
            pbr_points *points = extreme_points(host, extreme);
            pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
            double model[16];
            GLint before[16], after[16];
            matrix_scaling(extreme->scale[0], extreme->scale[1], extreme->scale[2], model);
            item.transforms = model;
            item.transform_count = 1;
            item.size_minimum = extreme->size_minimum;
            item.size_maximum = extreme->size_maximum;
            item.radius_scale = extreme->radius_scale;
            for (int v = 0; v < VIEWS; v += 4) {
                target_clear(&target, (const float[4]){0, 0, 0, 0}, views[v].frame.flags & PBR_FRAME_REVERSED_Z ? 0 : 1);
                read_state(before);
                render(host, &views[v].frame, &item, 1);
                read_state(after);
                assert_memory_equal(before, after, sizeof(before));
                check_sane(&target, extreme, views[v].name);
            }
            pbr_renderer_evict(host->renderer, points);
            pbr_points_release(&points);
        }
    }
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

static void an_empty_set_draws_nothing(void **state) {
    struct host *host = *state;
    struct camera views[VIEWS];
    struct target target;
    static uint8_t pixels[WIDTH * HEIGHT][4];
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    make_views(views);
    assert_true(target_create(&target, WIDTH, HEIGHT, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&target);
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    const pbr_item item = plain_item(points, PBR_SPLAT_ELLIPSE);
    target_clear(&target, (const float[4]){0, 0, 0, 0}, 1);
    pbr_stats stats = render(host, &views[0].frame, &item, 1);
    target_read(&target, pixels);
    for (int i = 0; i < WIDTH * HEIGHT; i++) assert_int_equal(pixels[i][3], 0);
    assert_int_equal(stats.draw_calls, 0);
    pbr_points_release(&points);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(discs_cover_the_pixels_that_see_them),
        GL_TEST(discs_as_quads_cover_the_same_pixels),
        GL_TEST(a_mixture_of_points_and_quads_covers_the_same_pixels),
        GL_TEST(sizes_stay_between_minimum_and_maximum),
        GL_TEST(back_faces_are_dropped_by_their_centres),
        GL_TEST(clip_planes_keep_or_drop_whole_discs),
        GL_TEST(the_scissor_box_of_the_frame_cuts),
        GL_TEST(near_and_far_planes_cut_in_every_depth_range),
        GL_TEST(a_multisampled_target_gets_pixels_by_their_centres),
        GL_TEST(a_viewport_of_one_pixel_is_seen_through),
        GL_TEST(the_widest_viewport_is_exact),
        GL_TEST(the_nearest_disc_is_seen_at_each_pixel),
        GL_TEST(discs_and_the_hosts_quad_cut_each_other),
        GL_TEST(extremes_do_no_harm),
        GL_TEST(an_empty_set_draws_nothing),
    };
    return RUN_GL_TESTS("disc", tests);
}
