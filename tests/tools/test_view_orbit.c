/* A model follows the pointer that turns, moves and zooms it. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../../tools/orbit.h"

static const uint32_t size[2] = {640, 480};

static void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.17g is not within %g of %.17g", a, tolerance, b);
}

static struct camera look(const double view[3], const double centre[3], double radius, bool parallel) {
    struct sphere sphere = {{centre[0], centre[1], centre[2]}, radius};
    return camera_look(sphere, view[0], view[1], view[2], parallel, 0.01, size);
}

/* Pixels to the right and down from the upper left; and the distance along the view axis. */
static void project(const struct camera *camera, const double point[3], double pixel[3]) {
    double eye[4], clip[4];
    for (int r = 0; r < 4; r++) {
        eye[r] = camera->view[12 + r];
        for (int k = 0; k < 3; k++) eye[r] += camera->view[4 * k + r] * point[k];
    }
    for (int r = 0; r < 4; r++) {
        clip[r] = 0;
        for (int k = 0; k < 4; k++) clip[r] += camera->projection[4 * k + r] * eye[k];
    }
    pixel[0] = (clip[0] / clip[3] + 1) / 2 * size[0];
    pixel[1] = (1 - clip[1] / clip[3]) / 2 * size[1];
    pixel[2] = -eye[2];
}

/* The front of the model, the point nearest to the eye, goes where the pointer goes; so does what is at its top, as seen from the
 * front. */
static void turning_follows_the_pointer(void **state) {
    (void)state;
    const double origin[3] = {0, 0, 0};
    for (int parallel = 0; parallel < 2; parallel++)
        for (int axis = 0; axis < 2; axis++) {
            double view[3] = {30, 20, 1}, before[3], after[3], front[3];
            struct camera camera = look(view, origin, 1, parallel);
            for (int k = 0; k < 3; k++) front[k] = camera.view[4 * k + 2];
            project(&camera, front, before);
            orbit_turn(view, axis == 0 ? 10 : 0, axis == 1 ? 10 : 0);
            camera = look(view, origin, 1, parallel);
            project(&camera, front, after);
            assert_true(after[axis] > before[axis] + 20);
        }
}

static void turning_adds_angles_and_ends_at_the_poles(void **state) {
    (void)state;
    double view[3] = {30, 20, 1};
    orbit_turn(view, 20, 10);
    assert_near(view[0], 10, 0);
    assert_near(view[1], 30, 0);
    orbit_turn(view, -20, -10);
    assert_near(view[0], 30, 0);
    assert_near(view[1], 20, 0);
    orbit_turn(view, 170.26, 0);
    assert_near(view[0], -140.26, 0);
    orbit_turn(view, 100, 0);
    assert_near(view[0], 119.74, 0);
    orbit_turn(view, 0, 500);
    assert_near(view[1], 90, 0);
    orbit_turn(view, 0, 1);
    assert_near(view[1], 90, 0);
    orbit_turn(view, 0, -300);
    assert_near(view[1], -90, 0);
    /* From where only --view leads the way back is open, the way out is not. */
    double beyond[3] = {0, 120, 1};
    orbit_turn(beyond, 0, 5);
    assert_near(beyond[1], 120, 0);
    orbit_turn(beyond, 0, -5);
    assert_near(beyond[1], 115, 0);
}

static void zoom_is_bounded_and_comes_back(void **state) {
    (void)state;
    double view[3] = {0, 0, 1};
    for (int i = 0; i < 4; i++) orbit_zoom(view, 1);
    assert_near(view[2], 2, 0);
    for (int i = 0; i < 4; i++) orbit_zoom(view, -1);
    assert_near(view[2], 1, 0);
    for (int i = 0; i < 1000; i++) orbit_zoom(view, 1);
    assert_near(view[2], ORBIT_MOST_ZOOM, 0);
    for (int i = 0; i < 1000; i++) orbit_zoom(view, -1);
    assert_near(view[2], ORBIT_LEAST_ZOOM, 0);
    /* Tenths of a step, as touch pads give them, add up: each is 1.7 %, rounded to 0.05 % at most. */
    view[2] = 1;
    for (int i = 0; i < 40; i++) orbit_zoom(view, 0.1);
    assert_near(view[2], 2, 2 * 40 * 5e-4);
    /* A zoom that is out of bounds from the start leaves them no further. */
    view[2] = 1e6;
    orbit_zoom(view, 1);
    assert_near(view[2], 1e6, 0);
    orbit_zoom(view, -1);
    assert_near(view[2], 840900, 0);
}

static void steps_come_back_from_everywhere(void **state) {
    (void)state;
    for (int digits = 3; digits <= 4; digits++) {
        double value = 1;
        for (int i = 0; i < 40; i++) value = orbit_step(value, 1, digits);
        assert_near(value, 1024, digits == 3 ? 4 : 0);
        for (int i = 0; i < 80; i++) value = orbit_step(value, -1, digits);
        assert_near(value, 1 / 1024., 1e-6);
        for (int i = 0; i < 40; i++) value = orbit_step(value, 1, digits);
        assert_near(value, 1, 0);
    }
}

/* Between the near and the far plane lies the centre at any zoom, and all of the sphere that is before the eye. */
static void planes_hold_what_is_looked_at(void **state) {
    (void)state;
    const double centre[3] = {10, -20, 30};
    for (int parallel = 0; parallel < 2; parallel++)
        for (double zoom = ORBIT_LEAST_ZOOM; zoom <= ORBIT_MOST_ZOOM; zoom *= 1.1) {
            const double view[3] = {77, -33, zoom}, radius = 5;
            struct camera camera = look(view, centre, radius, parallel);
            double pixel[3];
            project(&camera, centre, pixel);
            assert_near(pixel[0], size[0] / 2., 1e-6);
            assert_near(pixel[1], size[1] / 2., 1e-6);
            double near = camera_distance(&camera, 0), far = camera_distance(&camera, 1 - 1e-9);
            assert_true(near < pixel[2] && far > pixel[2] + radius);
            if (parallel) assert_true(near <= pixel[2] - radius);
            else assert_true(near > 0 && near <= (1 + 1e-6) * fmax(pixel[2] - radius, pixel[2] / 1000));
        }
}

static void moving_keeps_the_point_under_the_pointer(void **state) {
    (void)state;
    for (int parallel = 0; parallel < 2; parallel++)
        for (int i = 0; i < 50; i++) {
            const double view[3] = {37. * i, -90 + 3.7 * i, 0.1 * (i + 1)};
            double centre[3] = {1000, -2000, 3000}, before[3], after[3];
            struct camera camera = look(view, centre, 7, parallel);
            const double pixel = orbit_pixel(&camera, centre);
            /* Somewhere in the plane through the centre, across the view axis. */
            double point[3];
            for (int k = 0; k < 3; k++) point[k] = centre[k] + pixel * (100 * camera.view[4 * k] - 70 * camera.view[4 * k + 1]);
            project(&camera, point, before);
            assert_near(before[0], size[0] / 2. + 100, 1e-6);
            assert_near(before[1], size[1] / 2. + 70, 1e-6);
            orbit_pan(&camera, 31, -17, centre);
            camera = look(view, centre, 7, parallel);
            project(&camera, point, after);
            assert_near(after[0], before[0] + 31, 1e-6);
            assert_near(after[1], before[1] - 17, 1e-6);
            assert_near(after[2], before[2], 1e-9 * before[2]);
        }
}

static void rounding_is_a_hundredth_of_a_pixel(void **state) {
    (void)state;
    for (double pixel = 1e-9; pixel < 1e9; pixel *= 3.3) {
        const double coordinate = 637123.456789 * pixel;
        assert_near(orbit_round(coordinate, pixel), coordinate, pixel / 200 * (1 + 1e-6));
    }
    assert_near(orbit_round(637123.456789, 0.5), 637123.457, 0);
    assert_near(orbit_round(637123.456789, 5000), 637120, 0);
    /* Pixels without a size, of a camera that sees nothing. */
    assert_near(orbit_round(3.25, 0), 3.25, 0);
    assert_near(orbit_round(3.25, INFINITY), 3.25, 0);
}

/* Zoom counts in radii: with the same centre the same point stays in the same place. */
static void rescaling_keeps_the_picture(void **state) {
    (void)state;
    const double centre[3] = {1, 2, 3}, point[3] = {1.5, 2.25, 2.5};
    double view[3] = {20, 10, 1.5}, before[3], after[3];
    struct camera camera = look(view, centre, 2, false);
    project(&camera, point, before);
    orbit_rescale(view, 2, 7);
    camera = look(view, centre, 7, false);
    project(&camera, point, after);
    for (int k = 0; k < 2; k++) assert_near(after[k], before[k], 1e-3);
    /* There is no other zoom for a model without a radius. */
    const double zoom = view[2];
    orbit_rescale(view, 0, 7);
    orbit_rescale(view, 7, 0);
    assert_near(view[2], zoom, 0);
}

static void the_light_goes_where_it_is_dragged(void **state) {
    (void)state;
    double light[2] = {0, 0};
    orbit_light(light, 25, 15);
    assert_near(light[0], 25, 0);
    assert_near(light[1], -15, 0);
    orbit_light(light, 350, -300);
    assert_near(light[0], 15, 0);
    assert_near(light[1], 90, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(turning_follows_the_pointer),        cmocka_unit_test(turning_adds_angles_and_ends_at_the_poles),
        cmocka_unit_test(zoom_is_bounded_and_comes_back),     cmocka_unit_test(steps_come_back_from_everywhere),
        cmocka_unit_test(planes_hold_what_is_looked_at),      cmocka_unit_test(moving_keeps_the_point_under_the_pointer),
        cmocka_unit_test(rounding_is_a_hundredth_of_a_pixel), cmocka_unit_test(rescaling_keeps_the_picture),
        cmocka_unit_test(the_light_goes_where_it_is_dragged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
