/* Survey coordinates: millimetres at hundreds of kilometres from the origin draw as they do at the origin. SPDX-License-Identifier:
 * MIT */
#include "support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 96, PIXELS = SIZE * SIZE, POINTS = 400 };

static const double FAR_AWAY[3] = {637000, 851000, 412};

/* Millimetre detail within a metre. Multiples of 2^-12 m, so that adding FAR_AWAY to them in double is exact. */
static void make_cloud(double (*positions)[3], float (*colours)[3]) {
    uint64_t seed = 5;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) {
            positions[i][k] = round(random_between(&seed, -0.5, 0.5) * 4096) / 4096;
            colours[i][k] = (float)random_between(&seed, 0.1, 1);
        }
}

static pbr_points_desc cloud_desc(const float (*colours)[3]) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.02f;
    return desc;
}

/* The picture seen from 1.5 m away, with everything moved by `shift`. */
static void draw(struct host *host, const struct target *target, const pbr_points *points, const double shift[3],
                 const double *model, uint8_t (*pixels)[4]) {
    static const int32_t viewport[4] = {0, 0, SIZE, SIZE};
    double turn[16], back[16];
    pbr_frame frame = PBR_FRAME_INIT;
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    item.colour_source = PBR_COLOUR_POINTS;
    if (model) item.transforms = model, item.transform_count = 1;
    matrix_perspective(0.9, 1, 0.1, 100, frame.projection);
    memcpy(frame.viewport, viewport, sizeof(viewport));
    matrix_rotation((const double[3]){1, 2, 0.5}, 0.6, turn);
    turn[14] = -1.5;
    matrix_translation(-shift[0], -shift[1], -shift[2], back);
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) {
            frame.view[4 * c + r] = 0;
            for (int k = 0; k < 4; k++) frame.view[4 * c + r] += turn[4 * k + r] * back[4 * c + k];
        }
    target_clear(target, (const float[4]){0, 0, 0, 0}, 1);
    render(host, &frame, &item, 1);
    target_read(target, pixels);
}

struct pictures {
    struct target target;
    double positions[POINTS][3];
    float narrow[POINTS][3], colours[POINTS][3];
    uint8_t near[PIXELS][4], far[PIXELS][4];
};

/* A centimetre is two thirds of a pixel here, so what float rounds to at 851 km (up to 3 cm) would move splats by pixels. The view
 * matrix far away is itself rounded to 1e-10 m, which only a splat on the verge of a subpixel step can show: two pixels are allowed
 * to. */
static void expect_same_picture(struct pictures *pictures, const char *what) {
    int different = 0, drawn = 0;
    for (int i = 0; i < PIXELS; i++) {
        different += memcmp(pictures->near[i], pictures->far[i], 4) != 0;
        drawn += pictures->near[i][3] != 0;
    }
    assert_true(drawn > PIXELS / 5);
    picture_save(what, (const uint8_t(*)[4])pictures->far, SIZE, SIZE);
    if (different > 2) fail_msg("%s: %d of %d pixels differ", what, different, PIXELS);
}

static struct pictures *open_pictures(struct host *host) {
    struct pictures *pictures = calloc(1, sizeof(*pictures));
    pbr_points *points = NULL;
    assert_non_null(pictures);
    assert_true(target_create(&pictures->target, SIZE, SIZE, GL_RGBA8, GL_DEPTH_COMPONENT32F, 0));
    target_bind(&pictures->target);
    make_cloud(pictures->positions, pictures->colours);
    pbr_points_desc desc = cloud_desc((const float(*)[3])pictures->colours);
    desc.positions = (pbr_attribute){pictures->positions, 0, PBR_FORMAT_FLOAT64, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    draw(host, &pictures->target, points, (const double[3]){0, 0, 0}, NULL, pictures->near);
    pbr_points_release(&points);
    return pictures;
}

static void close_pictures(struct pictures *pictures) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&pictures->target);
    free(pictures);
}

static void double_positions_far_away_draw_the_same_picture(void **state) {
    struct host *host = *state;
    struct pictures *pictures = open_pictures(host);
    pbr_points *points = NULL;
    double(*moved)[3] = calloc(POINTS, sizeof(*moved));
    assert_non_null(moved);
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) moved[i][k] = pictures->positions[i][k] + FAR_AWAY[k];
    pbr_points_desc desc = cloud_desc((const float(*)[3])pictures->colours);
    desc.positions = (pbr_attribute){moved, 0, PBR_FORMAT_FLOAT64, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    draw(host, &pictures->target, points, FAR_AWAY, NULL, pictures->far);
    expect_same_picture(pictures, "precision_double");
    pbr_points_release(&points);
    close_pictures(pictures);
    free(moved);
}

static void float_positions_with_an_origin_draw_the_same_picture(void **state) {
    struct host *host = *state;
    struct pictures *pictures = open_pictures(host);
    pbr_points *points = NULL;
    for (int i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) pictures->narrow[i][k] = (float)pictures->positions[i][k];
    pbr_points_desc desc = cloud_desc((const float(*)[3])pictures->colours);
    desc.positions = (pbr_attribute){pictures->narrow, 0, PBR_FORMAT_FLOAT32, 3};
    memcpy(desc.origin, FAR_AWAY, sizeof(desc.origin));
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    draw(host, &pictures->target, points, FAR_AWAY, NULL, pictures->far);
    expect_same_picture(pictures, "precision_origin");
    pbr_points_release(&points);
    close_pictures(pictures);
}

static void a_transform_far_away_draws_the_same_picture(void **state) {
    struct host *host = *state;
    struct pictures *pictures = open_pictures(host);
    pbr_points *points = NULL;
    double model[16];
    pbr_points_desc desc = cloud_desc((const float(*)[3])pictures->colours);
    desc.positions = (pbr_attribute){pictures->positions, 0, PBR_FORMAT_FLOAT64, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    matrix_translation(FAR_AWAY[0], FAR_AWAY[1], FAR_AWAY[2], model);
    draw(host, &pictures->target, points, FAR_AWAY, model, pictures->far);
    expect_same_picture(pictures, "precision_transform");
    pbr_points_release(&points);
    close_pictures(pictures);
}

/* One set that spans 851 km: its near part keeps its millimetres beside its far part. */
static void a_cloud_at_both_ends_of_a_country_keeps_its_millimetres(void **state) {
    struct host *host = *state;
    struct pictures *pictures = open_pictures(host);
    pbr_points *points = NULL;
    double(*both)[3] = calloc(2 * POINTS, sizeof(*both));
    float(*colours)[3] = calloc(2 * POINTS, sizeof(*colours));
    assert_non_null(both);
    assert_non_null(colours);
    for (int i = 0; i < 2 * POINTS; i++)
        for (int k = 0; k < 3; k++) {
            both[i][k] = pictures->positions[i / 2][k] + (i % 2 ? FAR_AWAY[k] : 0);
            colours[i][k] = pictures->colours[i / 2][k];
        }
    pbr_points_desc desc = cloud_desc((const float(*)[3])colours);
    desc.count = 2 * POINTS;
    desc.positions = (pbr_attribute){both, 0, PBR_FORMAT_FLOAT64, 3};
    assert_int_equal(pbr_points_create(host->instance, &desc, &points), PBR_OK);
    draw(host, &pictures->target, points, FAR_AWAY, NULL, pictures->far);
    expect_same_picture(pictures, "precision_both_far");
    draw(host, &pictures->target, points, (const double[3]){0, 0, 0}, NULL, pictures->far);
    expect_same_picture(pictures, "precision_both_near");
    pbr_points_release(&points);
    close_pictures(pictures);
    free(both);
    free(colours);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(double_positions_far_away_draw_the_same_picture),
        GL_TEST(float_positions_with_an_origin_draw_the_same_picture),
        GL_TEST(a_transform_far_away_draws_the_same_picture),
        GL_TEST(a_cloud_at_both_ends_of_a_country_keeps_its_millimetres),
    };
    return RUN_GL_TESTS("precision", tests);
}
