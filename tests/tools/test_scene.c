/* The camera, the light and the items of a scene are what its options say. SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../tools/scene.h"

static const uint32_t size[2] = {640, 480};

static void assert_near(double value, double wanted, double tolerance) {
    if (!(fabs(value - wanted) <= tolerance)) fail_msg("%.12g is not %.12g", value, wanted);
}

/* Points at the corners of a box from -1 to 1 in x, -2 to 2 in y and -3 to 3 in z, about a survey's origin. */
static const double origin[3] = {637000, 851000, 400};
static const double radius = 3.7416573867739413; /* sqrt 14 */

static struct input make_input(struct session *session, const char *scalar_name) {
    float positions[8][3], values[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)((i >> k & 1) ? k + 1 : -k - 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_scalar scalar = {scalar_name, {values, 0, PBR_FORMAT_FLOAT32, 1}};
    struct input input = {.path = "box", .info = PBR_POINTS_INFO_INIT};
    desc.count = 8;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.25f;
    memcpy(desc.origin, origin, sizeof origin);
    desc.scalars = scalar_name ? &scalar : NULL;
    desc.scalar_count = scalar_name != NULL;
    assert_int_equal(pbr_points_create(session->instance, &desc, &input.points), PBR_OK);
    assert_int_equal(pbr_points_get_info(input.points, &input.info), PBR_OK);
    return input;
}

struct box {
    struct session session;
    struct scene_options options;
    struct scene scene;
};

static struct box *make_box(bool z_up) {
    struct box *box = calloc(1, sizeof *box);
    assert_non_null(box);
    assert_true(session_open(&box->session));
    box->options = scene_options_default(HEADLESS_GL_45);
    box->options.z_up = z_up;
    box->scene.options = &box->options;
    struct input input = make_input(&box->session, NULL);
    scene_add(&box->scene, &input);
    assert_null(input.points);
    assert_true(scene_arrange(&box->scene, &box->session));
    return box;
}

static void end_box(struct box *box) {
    scene_release(&box->scene);
    session_close(&box->session);
    assert_null(box->session.instance);
    free(box);
}

/* Where a point of the files' is in eye space. */
static void to_eye(const struct box *box, const struct camera *camera, const double point[3], double eye[3]) {
    double world[3];
    scene_to_world(&box->options, point, world);
    for (int r = 0; r < 3; r++) {
        eye[r] = camera->view[12 + r];
        for (int k = 0; k < 3; k++) eye[r] += camera->view[4 * k + r] * world[k];
    }
}

static void points_in_the_world_are_where_items_put_them(void **state) {
    (void)state;
    for (int z_up = 0; z_up < 2; z_up++) {
        struct box *box = make_box(z_up);
        const double point[3] = {3, 5, 7}, *m = box->scene.items[0].transforms;
        double world[3], back[3];
        scene_to_world(&box->options, point, world);
        for (int r = 0; r < 3; r++) assert_near(world[r], m[r] * 3 + m[4 + r] * 5 + m[8 + r] * 7 + m[12 + r], 0);
        scene_from_world(&box->options, world, back);
        assert_memory_equal(back, point, sizeof point);
        assert_near(world[1], z_up ? 7 : 5, 0);
        end_box(box);
    }
}

static void the_camera_looks_at_the_centre(void **state) {
    (void)state;
    for (int z_up = 0; z_up < 2; z_up++) {
        struct box *box = make_box(z_up);
        const double distance = radius / sin(camera_radians(25)) / 2, corner[3] = {origin[0] + 1, origin[1] + 2, origin[2] + 3};
        double eye[3];
        box->options.view[2] = 2;
        struct camera camera = scene_camera(&box->scene, 0, size);
        to_eye(box, &camera, origin, eye);
        for (int k = 0; k < 3; k++) assert_near(eye[k], k == 2 ? -distance : 0, 1e-6);
        memcpy(box->options.centre, corner, sizeof corner);
        box->options.has_centre = true;
        camera = scene_camera(&box->scene, 0, size);
        to_eye(box, &camera, corner, eye);
        for (int k = 0; k < 3; k++) assert_near(eye[k], k == 2 ? -distance : 0, 1e-6);
        end_box(box);
    }
}

/* Of the whole sphere what is before the eye, and as near as a thousandth of the distance, wherever the centre is. */
static void planes_hold_the_sphere_around_any_centre(void **state) {
    (void)state;
    struct box *box = make_box(false);
    box->options.has_centre = true;
    for (int parallel = 0; parallel < 2; parallel++)
        for (int i = 0; i < 40; i++) {
            double eye[3];
            box->options.parallel = parallel;
            box->options.view[2] = exp2(i % 7 - 3);
            for (int k = 0; k < 3; k++) box->options.centre[k] = origin[k] + 2 * (i % (3 + k)) * (k == 1 ? -1 : 1);
            struct camera camera = scene_camera(&box->scene, 9 * i, size);
            to_eye(box, &camera, origin, eye);
            double near = camera_distance(&camera, 0), far = camera_distance(&camera, 1 - 1e-9);
            double distance = radius / sin(camera_radians(25)) / box->options.view[2];
            assert_true(far > -eye[2] + radius);
            if (parallel) assert_true(near < -eye[2] - radius);
            else assert_true(near > 0 && near < fmax(-eye[2] - radius, distance / 999));
        }
    end_box(box);
}

/* The sphere's own centre, given, changes no bit. */
static void the_centre_that_is_there_anyway_is_the_default(void **state) {
    (void)state;
    struct box *box = make_box(true);
    struct camera before = scene_camera(&box->scene, 0, size);
    double centre[3];
    scene_centre(&box->scene, centre);
    scene_from_world(&box->options, centre, box->options.centre);
    for (int k = 0; k < 3; k++) assert_near(box->options.centre[k], origin[k], 1e-6);
    box->options.has_centre = true;
    struct camera after = scene_camera(&box->scene, 0, size);
    assert_memory_equal(before.view, after.view, sizeof before.view);
    assert_memory_equal(before.projection, after.projection, sizeof before.projection);
    end_box(box);
}

static void the_light_is_right_of_and_above_the_eye(void **state) {
    (void)state;
    struct box *box = make_box(false);
    struct camera camera = scene_camera(&box->scene, 0, size);
    pbr_light light;
    pbr_frame frame = scene_frame(&box->options, &camera, &light);
    assert_int_equal(frame.light_count, 0); /* libpbr's own, which is from the eye */
    const struct {
        double angles[2], vector[3];
    } lights[] = {{{90, 0}, {1, 0, 0}}, {{0, 90}, {0, 1, 0}}, {{-90, 0}, {-1, 0, 0}}, {{45, 30}, {0.61237, 0.5, 0.61237}}};
    for (size_t i = 0; i < sizeof lights / sizeof lights[0]; i++) {
        memcpy(box->options.light, lights[i].angles, sizeof box->options.light);
        frame = scene_frame(&box->options, &camera, &light);
        assert_int_equal(frame.light_count, 1);
        assert_ptr_equal(frame.lights, &light);
        assert_int_equal(light.space, PBR_SPACE_EYE);
        for (int k = 0; k < 3; k++) assert_near(light.vector[k], lights[i].vector[k], 1e-5);
    }
    end_box(box);
}

/* Zero, and what is zero in single precision, is the leaves, not the default. */
static void the_frame_has_the_threshold(void **state) {
    (void)state;
    struct box *box = make_box(false);
    const struct {
        uint32_t lod;
        double threshold;
        float wanted;
    } cases[] = {{LOD_AUTO, 1, 1},
                 {LOD_AUTO, 2.5, 2.5f},
                 {LOD_AUTO, 0, PBR_THRESHOLD_LEAVES},
                 {LOD_AUTO, 1e-60, PBR_THRESHOLD_LEAVES},
                 {PBR_LOD_QSPLAT, 2.5, 2.5f},
                 {LOD_NONE, 2.5, PBR_THRESHOLD_LEAVES}};
    struct camera camera = scene_camera(&box->scene, 0, size);
    pbr_light light;
    assert_int_equal(box->options.lod, LOD_AUTO);
    assert_true(box->options.threshold == 1);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        box->options.lod = cases[i].lod;
        box->options.threshold = cases[i].threshold;
        assert_true(scene_frame(&box->options, &camera, &light).threshold == cases[i].wanted);
    }
    assert_int_equal(scene_hierarchy(&box->scene), LOD_NONE);
    end_box(box);
}

static void what_lacks_the_scalar_keeps_its_colours(void **state) {
    (void)state;
    struct box *box = make_box(false);
    struct input input = make_input(&box->session, "heat");
    assert_int_equal(scene_find_scalar(&input, "heat"), 0);
    assert_int_equal(scene_find_scalar(&input, "cold"), -1);
    scene_add(&box->scene, &input);
    assert_true(scene_arrange(&box->scene, &box->session));
    box->options.colour_source = PBR_COLOUR_SCALAR;
    box->options.scalar = "heat";
    scene_style(&box->scene);
    assert_int_equal(box->scene.items[0].colour_source, PBR_COLOUR_POINTS);
    assert_int_equal(box->scene.items[1].colour_source, PBR_COLOUR_SCALAR);
    assert_true(scene_check_scalar(&box->options, &box->session, &box->scene.inputs[1]));
    assert_int_equal(scene_point_count(&box->scene), 16);
    scene_drop(&box->scene);
    assert_int_equal(scene_point_count(&box->scene), 8);
    end_box(box);
}

static void items_are_filled_where_their_kind_can_be(void **state) {
    (void)state;
    struct box *box = make_box(false);
    box->options.blending = PBR_BLEND_FILL;
    box->options.low_pass = 0.5;
    for (box->options.splat = PBR_SPLAT_CIRCLE; box->options.splat <= PBR_SPLAT_EWA_MAX; box->options.splat++) {
        scene_style(&box->scene);
        const pbr_item *item = &box->scene.items[0];
        assert_int_equal(item->blending, box->options.splat <= PBR_SPLAT_ELLIPSE ? PBR_BLEND_FILL : PBR_BLEND_KIND);
        assert_near((double)item->low_pass, 0.5, 0);
    }
    end_box(box);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_in_the_world_are_where_items_put_them),
        cmocka_unit_test(the_camera_looks_at_the_centre),
        cmocka_unit_test(planes_hold_the_sphere_around_any_centre),
        cmocka_unit_test(the_centre_that_is_there_anyway_is_the_default),
        cmocka_unit_test(the_light_is_right_of_and_above_the_eye),
        cmocka_unit_test(the_frame_has_the_threshold),
        cmocka_unit_test(what_lacks_the_scalar_keeps_its_colours),
        cmocka_unit_test(items_are_filled_where_their_kind_can_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
