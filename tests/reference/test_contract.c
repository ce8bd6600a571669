/* What the reference renderer refuses, how it fails, and that threads change nothing. SPDX-License-Identifier: MIT */
#include "../struct_sizes.h"
#include "support.h"

#include <stdio.h>

enum { SURFELS = 5000 };

static pbr_points *make_cloud(pbr_instance *instance) {
    static struct surfel_data surfels[SURFELS];
    uint64_t random = 12;
    for (int i = 0; i < SURFELS; i++) {
        struct surfel_data *s = &surfels[i];
        for (int k = 0; k < 3; k++) {
            s->position[k] = 2 * uniform(&random) - 1 + (k == 2 ? -3 : 0);
            s->normal[k] = i % 10 ? uniform(&random) - 0.5 : 0;
            s->colour[k] = (float)uniform(&random);
        }
        s->radius = (float)(0.1 * uniform(&random));
    }
    return make_points(instance, surfels, SURFELS);
}

/* A floor of two triangles. */
static pbr_mesh *make_floor(pbr_instance *instance) {
    static const float corners[4][3] = {{-3, -1, 1}, {3, -1, 1}, {3, -1, -9}, {-3, -1, -9}};
    static const uint16_t halves[2][3] = {{0, 1, 2}, {0, 2, 3}};
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    desc.vertex_count = 4;
    desc.positions = (pbr_attribute){corners, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = halves;
    desc.index_format = PBR_FORMAT_UINT16;
    desc.triangle_count = 2;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    return mesh;
}

static const double places[2][16] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.3, 0, 0, 1},
                                     {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.3, 0, -1, 1}};

static void any_number_of_threads_draws_the_same_bits(void **state) {
    float *kept = NULL;
    (void)state;
    for (uint32_t threads = 1; threads <= 16; threads *= 4) {
        struct stage stage;
        stage_open(&stage, threads);
        stage.frame.viewport[2] = 200, stage.frame.viewport[3] = 150; /* of 35 tiles */
        look(&stage, 75);
        pbr_points *points = make_cloud(stage.instance);
        pbr_item items[9];
        for (uint32_t i = 0; i < 9; i++) { /* all kinds, then those that can be filled */
            items[i] = plain_item(points, i % 6);
            items[i].blending = i < 6 ? PBR_BLEND_KIND : PBR_BLEND_FILL;
            items[i].shading = i % 2 ? PBR_SHADE_PHONG : PBR_SHADE_DEFERRED;
            if (i >= 6) continue; /* not where the others are, which would hide them */
            items[i].transforms = places[0];
            items[i].transform_count = 2;
        }
        draw(&stage, items, 9);
        const size_t bytes = (size_t)200 * 150 * 4 * sizeof *kept;
        if (!kept) {
            kept = malloc(bytes);
            memcpy(kept, stage.image.rgba, bytes);
        }
        assert_memory_equal(kept, stage.image.rgba, bytes);
        pbr_points_release(&points);
        stage_close(&stage);
    }
    free(kept);
}

static void nothing_to_draw_is_transparent_black_at_infinity(void **state) {
    static const struct surfel_data nowhere;
    struct stage stage;
    (void)state;
    stage_open(&stage, 2);
    pbr_points *none = make_points(stage.instance, &nowhere, 0), *cloud = make_cloud(stage.instance);
    pbr_item items[] = {plain_item(none, PBR_SPLAT_EWA), plain_item(cloud, PBR_SPLAT_EWA)};
    items[1].flags = PBR_ITEM_HIDDEN;
    for (size_t count = 0; count <= 2; count++) {
        draw(&stage, count ? items : NULL, count);
        for (size_t i = 0; i < SIZE * SIZE; i++)
            assert_true(stage.image.rgba[4 * i] == 0 && stage.image.rgba[4 * i + 3] == 0 && isinf(stage.image.depth[i]));
    }
    pbr_points_release(&none);
    pbr_points_release(&cloud);
    stage_close(&stage);
}

/* ---- refusals ---- */

static void expect_refused(struct stage *stage, const pbr_frame *frame, const pbr_item *items, size_t count, pbr_result wanted,
                           const char *what) {
    pbr_image image = PBR_IMAGE_INIT;
    stage->host.messages = 0;
    const pbr_result result = pbr_reference_render(stage->instance, frame, items, count, NULL, &image);
    if (result != wanted) fail_msg("%s: %s", what, pbr_result_name(result));
    assert_int_equal(stage->host.messages, 1);
    assert_int_equal(stage->host.code, wanted);
    assert_null(image.rgba);
    assert_null(image.depth);
}

static const double broken[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.1, 0, 0, 0, 1};
static const double nan_plane[4] = {0, NAN, 0, 0};
static const float small_map[6];

/* Makes one thing wrong; false after the last. */
static bool spoil(int i, pbr_frame *frame, pbr_item *item, pbr_light *light) {
    light->vector[0] = 1;
    switch (i) {
    case 0: frame->projection[5] = NAN; break;
    case 1: frame->view[12] = INFINITY; break;
    case 2: memset(frame->projection, 0, sizeof frame->projection); break;
    case 3: frame->projection[5] = 0; break;
    case 4: frame->view[3] = 1; break;
    case 5: frame->target = 7; break;
    case 6: frame->encoding = 7; break;
    case 7: frame->flags = 1u << 20; break;
    case 8: frame->depth_function = 17; break;
    case 9: frame->jitter[0] = NAN; break;
    case 10: frame->light_count = 1; break;
    case 11: frame->lights = light, frame->light_count = 1, light->vector[0] = 0; break;
    case 12: frame->lights = light, frame->light_count = 1, light->kind = 2; break;
    case 13: frame->lights = light, frame->light_count = 1, light->colour[1] = NAN; break;
    case 14: frame->viewport[2] = 0; break;
    case 15: frame->viewport[3] = -5; break;
    case 16: frame->flags = PBR_FRAME_SCISSOR, frame->scissor[2] = -1; break;
    case 17: frame->threshold = -2; break;
    case 18: item->points = NULL; break;
    case 19: item->transforms = broken, item->transform_count = 1; break;
    case 20: item->transform_count = 1; break;
    case 21: item->splat = 6; break;
    case 22: item->shading = 4; break;
    case 23: item->colour_source = 5; break;
    case 24: item->flags = 1u << 20; break;
    case 25: item->radius_scale = NAN; break;
    case 26: item->size_minimum = -1; break;
    case 27: item->colour_source = PBR_COLOUR_SCALAR; break;
    case 28: item->clip_planes = nan_plane, item->clip_plane_count = 1; break;
    case 29: item->clip_plane_count = 1; break;
    case 30: item->colour_map = small_map, item->colour_map_size = 1; break;
    case 31: item->colour_map_size = 4; break;
    case 32: item->point_cost = -1; break;
    case 33: item->struct_size = 8; break;
    case 34: frame->struct_size = 8; break;
    case 35: item->material.shininess = INFINITY; break;
    case 36: item->low_pass = -0.5f; break;
    case 37: item->low_pass = NAN; break;
    case 38: item->low_pass = INFINITY; break;
    case 39: item->low_pass = 16.01f; break;
    case 40: item->splat = PBR_SPLAT_SQUARE, item->blending = 2; break;
    case 41: item->splat = PBR_SPLAT_GAUSSIAN, item->blending = PBR_BLEND_FILL; break;
    case 42: item->splat = PBR_SPLAT_EWA, item->blending = PBR_BLEND_FILL; break;
    case 43: item->splat = PBR_SPLAT_EWA_MAX, item->blending = PBR_BLEND_FILL; break;
    default: return false;
    }
    return true;
}

static void arguments_outside_their_contract_are_refused(void **state) {
    struct stage stage;
    pbr_light light = PBR_LIGHT_INIT;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_cloud(stage.instance);
    const pbr_item good = plain_item(points, PBR_SPLAT_EWA);
    for (int i = 0;; i++) {
        pbr_frame frame = stage.frame;
        pbr_item item = good;
        char what[16];
        light = (pbr_light)PBR_LIGHT_INIT;
        snprintf(what, sizeof what, "case %d", i);
        if (!spoil(i, &frame, &item, &light)) break;
        expect_refused(&stage, &frame, &item, 1, PBR_ERROR_INVALID_ARGUMENT, what);
        item.flags |= PBR_ITEM_HIDDEN; /* what is hidden is checked, too */
        expect_refused(&stage, &frame, &item, 1, PBR_ERROR_INVALID_ARGUMENT, what);
    }
    expect_refused(&stage, NULL, &good, 1, PBR_ERROR_INVALID_ARGUMENT, "no frame");
    expect_refused(&stage, &stage.frame, NULL, 1, PBR_ERROR_INVALID_ARGUMENT, "no items");
    pbr_image image = PBR_IMAGE_INIT;
    assert_int_equal(pbr_reference_render(NULL, &stage.frame, &good, 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_reference_render(stage.instance, &stage.frame, &good, 1, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    draw(&stage, &good, 1);
    assert_int_equal(pbr_reference_render(stage.instance, &stage.frame, &good, 1, NULL, &stage.image), PBR_ERROR_INVALID_ARGUMENT);
    assert_non_null(stage.image.rgba); /* a picture in the way stays */
    pbr_points_release(&points);
    stage_close(&stage);
}

static void limits_are_named(void **state) {
    static const double planes[4 * (PBR_MAX_CLIP_PLANES + 1)];
    pbr_light lights[PBR_MAX_LIGHTS + 1];
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_cloud(stage.instance);
    pbr_item item = plain_item(points, PBR_SPLAT_EWA);
    expect_refused(&stage, &stage.frame, &item, PBR_MAX_ITEMS + 1, PBR_ERROR_LIMIT, "items");
    assert_non_null(strstr(stage.host.text, "65536"));
    item.transforms = places[0];
    item.transform_count = PBR_MAX_TRANSFORMS + 1;
    expect_refused(&stage, &stage.frame, &item, 1, PBR_ERROR_LIMIT, "transforms");
    item = plain_item(points, PBR_SPLAT_EWA);
    item.clip_planes = planes;
    item.clip_plane_count = PBR_MAX_CLIP_PLANES + 1;
    expect_refused(&stage, &stage.frame, &item, 1, PBR_ERROR_LIMIT, "clip planes");
    item.clip_plane_count = 0;
    for (int i = 0; i <= PBR_MAX_LIGHTS; i++) lights[i] = (pbr_light)PBR_LIGHT_INIT;
    stage.frame.lights = lights;
    stage.frame.light_count = PBR_MAX_LIGHTS + 1;
    expect_refused(&stage, &stage.frame, &item, 1, PBR_ERROR_LIMIT, "lights");
    stage.frame.light_count = 0;
    stage.frame.viewport[2] = PBR_MAX_IMAGE_SIZE + 1;
    expect_refused(&stage, &stage.frame, &item, 1, PBR_ERROR_LIMIT, "width");
    pbr_points_release(&points);
    stage_close(&stage);
}

static void the_ground_truth_refuses_what_it_cannot_draw(void **state) {
    struct stage stage;
    pbr_image image = PBR_IMAGE_INIT;
    pbr_item item = plain_item(NULL, 0);
    const pbr_mesh *none = NULL;
    (void)state;
    stage_open(&stage, 1);
    pbr_mesh *mesh = make_floor(stage.instance);
    const pbr_mesh *meshes = mesh;
    pbr_instance *in = stage.instance;
    const pbr_frame *frame = &stage.frame;
    assert_int_equal(pbr_ground_truth(in, frame, &item, NULL, 1, 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_ground_truth(in, frame, &item, &none, 1, 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_ground_truth(in, frame, &item, &meshes, 1, 0, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_ground_truth(in, frame, &item, &meshes, 1, PBR_MAX_SAMPLES + 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_ground_truth(in, NULL, &item, &meshes, 1, 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_ground_truth(NULL, frame, &item, &meshes, 1, 1, NULL, &image), PBR_ERROR_INVALID_ARGUMENT);
    item.colour_source = PBR_COLOUR_SCALAR;
    assert_int_equal(pbr_ground_truth(in, frame, &item, &meshes, 1, 1, NULL, &image), PBR_ERROR_UNSUPPORTED);
    assert_null(image.rgba);
    assert_int_equal(pbr_ground_truth(in, frame, NULL, NULL, 0, 1, NULL, &image), PBR_OK);
    pbr_image_destroy(in, &image);
    pbr_mesh_release(&mesh);
    stage_close(&stage);
}

/* ---- failures ---- */

struct work {
    struct stage *stage;
    pbr_item item;
    const pbr_mesh *mesh;
    int cancel_after; /* reports; negative: never */
    int reports;
    double fraction;
    const char *stage_name;
};

static int count_reports(void *user, const char *stage, double fraction) {
    struct work *work = user;
    if (!work->stage_name || strcmp(stage, work->stage_name) != 0) work->fraction = 0;
    assert_true(fraction >= work->fraction && fraction <= 1);
    work->stage_name = stage;
    work->fraction = fraction;
    return work->reports++ != work->cancel_after;
}

static pbr_result draw_work(pbr_instance *instance, void *user) {
    struct work *work = user;
    pbr_image image = PBR_IMAGE_INIT;
    pbr_reference_desc desc = PBR_REFERENCE_DESC_INIT;
    desc.progress = count_reports;
    desc.progress_user = work;
    work->stage_name = NULL;
    work->reports = 0;
    const pbr_result result = work->mesh
                                  ? pbr_ground_truth(instance, &work->stage->frame, &work->item, &work->mesh, 1, 2, &desc, &image)
                                  : pbr_reference_render(instance, &work->stage->frame, &work->item, 1, &desc, &image);
    assert_int_equal(image.rgba != NULL, result == PBR_OK);
    pbr_image_destroy(instance, &image);
    return result;
}

static void failed_allocations_and_cancelling_leave_nothing(void **state) {
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_cloud(stage.instance);
    pbr_mesh *mesh = make_floor(stage.instance);
    for (int i = 0; i < 3; i++) {
        struct work work = {
            .stage = &stage, .item = plain_item(points, PBR_SPLAT_EWA), .mesh = i == 1 ? mesh : NULL, .cancel_after = -1};
        if (i == 2) {
            work.item.splat = PBR_SPLAT_ELLIPSE;
            work.item.blending = PBR_BLEND_FILL;
        }
        fail_every_allocation(&stage.host, stage.instance, draw_work, &work);
        assert_int_equal(draw_work(stage.instance, &work), PBR_OK);
        const int reports = work.reports;
        assert_in_range(reports, 3, 200);
        assert_true(work.fraction == 1);
        for (work.cancel_after = 0; work.cancel_after < reports; work.cancel_after++) {
            const long live = atomic_load(&stage.host.live);
            assert_int_equal(draw_work(stage.instance, &work), PBR_ERROR_CANCELLED);
            assert_int_equal(work.reports, work.cancel_after + 1);
            assert_int_equal(atomic_load(&stage.host.live), live);
        }
    }
    pbr_mesh_release(&mesh);
    pbr_points_release(&points);
    stage_close(&stage);
}

/* ---- structures ---- */

static pbr_result use_desc(void *user, void *desc) {
    struct stage *stage = user;
    pbr_image image = PBR_IMAGE_INIT;
    const pbr_result result = pbr_reference_render(stage->instance, &stage->frame, NULL, 0, desc, &image);
    pbr_image_destroy(stage->instance, &image);
    return result;
}

static void descriptions_of_every_promised_size_are_taken_and_no_other(void **state) {
    static const struct sized sized = SIZED(pbr_reference_desc, progress_user, NULL, use_desc);
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    check_input_sizes(&sized, &stage);
    stage_close(&stage);
}

/* Hosts built with later headers: items and lights lie farther apart. */
static void longer_structures_are_walked_by_their_size(void **state) {
    struct {
        pbr_item item;
        uint64_t later;
    } items[2];
    const struct surfel_data discs[] = {{{-0.5, 0, -2}, {0, 0, 1}, 0.2f, {1, 0, 0}}, {{0.5, 0, -2}, {0, 0, 1}, 0.2f, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points[2];
    memset(items, 0, sizeof items);
    for (int i = 0; i < 2; i++) {
        points[i] = make_points(stage.instance, &discs[i], 1);
        items[i].item = plain_item(points[i], PBR_SPLAT_ELLIPSE);
        items[i].item.struct_size = sizeof items[0];
    }
    draw(&stage, &items[0].item, 2);
    assert_true(colour_at(&stage, 24, 32)[0] == 1 && colour_at(&stage, 39, 32)[1] == 1);
    items[1].later = 1;
    expect_refused(&stage, &stage.frame, &items[0].item, 2, PBR_ERROR_INVALID_ARGUMENT, "an unknown member");
    for (int i = 0; i < 2; i++) pbr_points_release(&points[i]);
    stage_close(&stage);
}

/* ---- hostile numbers ---- */

/* Mostly ordinary, sometimes absurd. */
static double odd_number(uint64_t *random) {
    static const double odd[] = {0, 1, -1, 1e-300, 1e300, -1e300, 1e150, 1e-150, 1e30, -1e30, 1e-30, 2.5e38, 1e10, -1e-10};
    const double u = uniform(random);
    return u < 0.4 ? 4 * uniform(random) - 2 : odd[(size_t)(uniform(random) * COUNT(odd))];
}

static void fill_odd(double *values, size_t count, bool affine, uint64_t *random) {
    for (size_t i = 0; i < count; i++) values[i] = affine && i % 4 == 3 ? i == 15 : odd_number(random);
}

static void expect_picture(pbr_instance *instance, pbr_result result, pbr_image *image) {
    if (result != PBR_OK) {
        assert_int_equal(result, PBR_ERROR_INVALID_ARGUMENT); /* a projection that is not invertible */
        return;
    }
    for (size_t i = 0; i < SIZE * SIZE; i++) {
        assert_false(isnan(image->depth[i]));
        for (size_t k = 4 * i; k < 4 * i + 4; k++) assert_false(isnan(image->rgba[k]));
    }
    pbr_image_destroy(instance, image);
}

/* Of transforms, cameras and sizes that overflow, underflow and collapse. */
static void absurd_numbers_give_a_picture_without_nan(void **state) {
    static const uint16_t triangles[4][3] = {{0, 1, 2}, {2, 3, 4}, {1, 1, 5}, {0, 4, 5}};
    struct stage stage;
    uint64_t random = 99;
    (void)state;
    stage_open(&stage, 2);
    for (int i = 0; i < 1500; i++) {
        struct surfel_data surfels[6] = {{{0}, {0}, 0, {0}}};
        double transform[16];
        for (int s = 0; s < 6; s++) {
            fill_odd(surfels[s].position, 6, false, &random); /* and the normal */
            for (int k = 0; k < 3; k++) surfels[s].position[k] = fmin(fmax(surfels[s].position[k], -3e38), 3e38);
            surfels[s].radius = (float)fmin(fabs(odd_number(&random)), 3e38);
            surfels[s].colour[0] = 0.5f;
        }
        fill_odd(transform, 16, true, &random);
        pbr_frame frame = stage.frame;
        if (uniform(&random) < 0.5) fill_odd(frame.projection, 16, false, &random);
        if (uniform(&random) < 0.5) fill_odd(frame.view, 16, true, &random);
        frame.flags = (uint32_t)(uniform(&random) * 8);
        pbr_points *points = make_points(stage.instance, surfels, 6);
        pbr_item item = plain_item(points, (uint32_t)(uniform(&random) * 6));
        if (item.splat <= PBR_SPLAT_ELLIPSE && uniform(&random) < 0.5) item.blending = PBR_BLEND_FILL;
        item.low_pass = (float)fmin(fabs(odd_number(&random)), 16);
        item.shading = (uint32_t)(uniform(&random) * 4);
        item.colour_source = uniform(&random) < 0.5 ? PBR_COLOUR_DEPTH : PBR_COLOUR_NORMAL;
        item.size_maximum = uniform(&random) < 0.3 ? (float)fmin(fabs(odd_number(&random)), 3e38) : 0;
        item.transforms = transform;
        item.transform_count = 1;
        pbr_image image = PBR_IMAGE_INIT;
        expect_picture(stage.instance, pbr_reference_render(stage.instance, &frame, &item, 1, NULL, &image), &image);

        pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
        pbr_mesh *mesh = NULL;
        desc.vertex_count = 6;
        desc.positions = (pbr_attribute){surfels->position, sizeof *surfels, PBR_FORMAT_FLOAT64, 3};
        desc.indices = triangles;
        desc.index_format = PBR_FORMAT_UINT16;
        desc.triangle_count = 4;
        assert_int_equal(pbr_mesh_create(stage.instance, &desc, &mesh), PBR_OK);
        const pbr_mesh *meshes = mesh;
        expect_picture(stage.instance, pbr_ground_truth(stage.instance, &frame, &item, &meshes, 1, 2, NULL, &image), &image);
        pbr_mesh_release(&mesh);
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* ---- colours ---- */

static void expect_colour(struct stage *stage, const pbr_item *item, const double wanted[3]) {
    draw(stage, item, 1);
    for (int k = 0; k < 3; k++) assert_true(fabs((double)colour_at(stage, 32, 32)[k] - wanted[k]) < 1e-5);
}

/* A map of red, green and blue from 10 to 20; its end is blue. */
static void colours_come_from_their_source(void **state) {
    static const float map[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const float values[2] = {12.5f, NAN};
    const double positions[2][3] = {{0, 0, -2}, {0, 0, 5}};
    const float normals[2][3] = {{0, 0, 1}, {0, 0, 1}};
    const uint8_t colours[2][3] = {{188, 0, 255}, {0, 0, 0}};
    const pbr_scalar scalar = {"value", {values, 0, PBR_FORMAT_FLOAT32, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = 2;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    desc.radius = 1;
    assert_int_equal(pbr_points_create(stage.instance, &desc, &points), PBR_OK);
    pbr_item item = plain_item(points, PBR_SPLAT_CIRCLE);
    expect_colour(&stage, &item, (const double[]){pow((188 / 255.0 + 0.055) / 1.055, 2.4), 0, 1});
    item.colour_source = PBR_COLOUR_CONSTANT;
    expect_colour(&stage, &item, (const double[]){0.8, 0.8, 0.8});
    item.colour[2] = 0.5f;
    expect_colour(&stage, &item, (const double[]){0, 0, 0.5});
    item.colour_source = PBR_COLOUR_NORMAL;
    const double half = pow((0.5 + 0.055) / 1.055, 2.4);
    expect_colour(&stage, &item, (const double[]){half, half, 1});
    item.colour_source = PBR_COLOUR_SCALAR;
    item.colour_map = map[0];
    item.colour_map_size = 3;
    item.scalar_range[0] = 10, item.scalar_range[1] = 20;
    expect_colour(&stage, &item, (const double[]){0.5, 0.5, 0});
    item.scalar_range[0] = -10, item.scalar_range[1] = 0;
    expect_colour(&stage, &item, (const double[]){0, 0, 1});
    item.scalar_range[0] = item.scalar_range[1] = 0; /* the attribute's own: one value */
    expect_colour(&stage, &item, (const double[]){1, 0, 0});
    item.colour_source = PBR_COLOUR_DEPTH;
    expect_colour(&stage, &item, (const double[]){0, 0, 1}); /* from -5 to 2: both points' sphere */
    item.scalar_range[0] = 1, item.scalar_range[1] = 5;
    expect_colour(&stage, &item, (const double[]){0.5, 0.5, 0});
    pbr_points_release(&points);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_number_of_threads_draws_the_same_bits),
        cmocka_unit_test(nothing_to_draw_is_transparent_black_at_infinity),
        cmocka_unit_test(arguments_outside_their_contract_are_refused),
        cmocka_unit_test(limits_are_named),
        cmocka_unit_test(the_ground_truth_refuses_what_it_cannot_draw),
        cmocka_unit_test(failed_allocations_and_cancelling_leave_nothing),
        cmocka_unit_test(descriptions_of_every_promised_size_are_taken_and_no_other),
        cmocka_unit_test(longer_structures_are_walked_by_their_size),
        cmocka_unit_test(absurd_numbers_give_a_picture_without_nan),
        cmocka_unit_test(colours_come_from_their_source),
    };
    return cmocka_run_group_tests_name("contract", tests, NULL, NULL);
}
