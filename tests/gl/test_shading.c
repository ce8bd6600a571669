/* Colours on the screen are those of the formulas: Phong in linear light, colour sources, encodings. SPDX-License-Identifier: MIT
 */
#include "support.h"

#include "core/colour.h"
#include "core/matrix.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 8, PIXELS = SIZE * SIZE, MIDDLE = SIZE / 2 * SIZE + SIZE / 2 };

struct scene {
    struct host *host;
    struct target target;
    pbr_frame frame;
};

static void scene_open(struct scene *scene, struct host *host, GLenum format) {
    static const int32_t viewport[4] = {0, 0, SIZE, SIZE};
    scene->host = host;
    scene->frame = (pbr_frame)PBR_FRAME_INIT;
    matrix_perspective(1, 1, 0.5, 100, scene->frame.projection);
    memcpy(scene->frame.viewport, viewport, sizeof(viewport));
    assert_true(target_create(&scene->target, SIZE, SIZE, format, GL_DEPTH_COMPONENT24, 0));
    target_bind(&scene->target);
}

static void scene_close(struct scene *scene) {
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    target_destroy(&scene->target);
}

/* A point at `position` (object space) with what the descriptor holds besides, in single values. */
static pbr_points *make_point(struct scene *scene, const double position[3], const double *normal, const uint8_t *colour,
                              const pbr_scalar *scalar) {
    pbr_points *points = NULL;
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 1;
    desc.positions = (pbr_attribute){position, 0, PBR_FORMAT_FLOAT64, 3};
    if (normal) desc.normals = (pbr_attribute){normal, 0, PBR_FORMAT_FLOAT64, 3};
    if (colour) desc.colours = (pbr_attribute){colour, 0, PBR_FORMAT_UINT8, 3};
    if (scalar) desc.scalars = scalar, desc.scalar_count = 1;
    desc.radius = 1;
    assert_int_equal(pbr_points_create(scene->host->instance, &desc, &points), PBR_OK);
    return points;
}

/* A splat over all of the picture. */
static pbr_item big_item(const pbr_points *points) {
    pbr_item item = PBR_ITEM_INIT;
    item.points = points;
    item.splat = PBR_SPLAT_SQUARE;
    item.size_minimum = 100;
    return item;
}

static void draw(struct scene *scene, const pbr_item *item, uint8_t rgba[4]) {
    uint8_t pixels[PIXELS][4];
    target_clear(&scene->target, (const float[4]){0, 0, 0, 0}, 1);
    render(scene->host, &scene->frame, item, 1);
    target_read(&scene->target, pixels);
    for (int i = 0; i < PIXELS; i++) assert_memory_equal(pixels[i], pixels[MIDDLE], 4); /* one colour a splat */
    memcpy(rgba, pixels[MIDDLE], 4);
}

/* One step of 8 bits: the driver's powers and its rounding may fall on either side of a half. */
static void expect_linear(const uint8_t rgba[4], const double linear[3], const char *what) {
    for (int k = 0; k < 3; k++) {
        double wanted = 255 * (double)srgb_from_linear((float)fmin(fmax(linear[k], 0), 1));
        if (fabs(rgba[k] - wanted) > 1)
            fail_msg("%s: channel %d is %d, not %.2f (%d %d %d)", what, k, rgba[k], wanted, rgba[0], rgba[1], rgba[2]);
    }
    assert_int_equal(rgba[3], 255);
}

/* ---- Phong ---- */

static void normalise(double v[3]) {
    double length = length3(v);
    for (int k = 0; k < 3; k++) v[k] /= length;
}

/* Phong 1975, in eye space: ambient and diffuse light take the surface's colour, highlights the light's. The normal is turned to
 * the eye. */
static void phong(const double base[3], const double eye_point[3], const double eye_normal[3], const double to_eye[3],
                  const pbr_frame *frame, const double (*lights)[3], const pbr_material *material, double out[3]) {
    double n[3], v[3];
    memcpy(n, eye_normal, sizeof(n));
    memcpy(v, to_eye, sizeof(v));
    normalise(n), normalise(v);
    double turn = dot3(n, v) < 0 ? -1 : 1;
    for (int k = 0; k < 3; k++) n[k] *= turn, out[k] = base[k] * (double)material->ambient * (double)frame->ambient[k];
    for (uint32_t i = 0; i < frame->light_count; i++) {
        double l[3];
        for (int k = 0; k < 3; k++) l[k] = lights[i][k] - (frame->lights[i].kind == PBR_LIGHT_POINT ? eye_point[k] : 0);
        normalise(l);
        double nl = dot3(n, l), rv = 2 * nl * dot3(n, v) - dot3(l, v);
        if (nl <= 0) continue;
        double highlight = (double)material->specular * pow(fmax(rv, 0), (double)material->shininess);
        for (int k = 0; k < 3; k++)
            out[k] += (double)frame->lights[i].colour[k] * (base[k] * (double)material->diffuse * nl + highlight);
    }
}

static void random_direction(uint64_t *seed, double out[3]) {
    do
        for (int k = 0; k < 3; k++) out[k] = random_between(seed, -1, 1);
    while (length3(out) < 0.2 || length3(out) > 1);
    normalise(out);
}

/* Inverse transpose of the upper 3x3. */
static void turn_normal(const double m[16], const double n[3], double out[3]) {
    double inverse[16];
    assert_true(matrix_invert(m, inverse));
    for (int r = 0; r < 3; r++) out[r] = inverse[4 * r] * n[0] + inverse[4 * r + 1] * n[1] + inverse[4 * r + 2] * n[2];
}

struct lit {
    pbr_light lights[PBR_MAX_LIGHTS];
    double eye_lights[PBR_MAX_LIGHTS][3]; /* vectors in eye space */
    double model[16], position[3], normal[3], base[3];
    double eye_point[3], eye_normal[3], to_eye[3];
    pbr_material material;
};

static void random_lights(uint64_t *seed, struct scene *scene, struct lit *lit) {
    pbr_frame *frame = &scene->frame;
    frame->light_count = 1 + (uint32_t)random_between(seed, 0, PBR_MAX_LIGHTS);
    frame->lights = lit->lights;
    for (int k = 0; k < 3; k++) frame->ambient[k] = (float)random_between(seed, 0, 1);
    for (uint32_t i = 0; i < frame->light_count; i++) {
        pbr_light *light = &lit->lights[i];
        *light = (pbr_light)PBR_LIGHT_INIT;
        light->kind = random_between(seed, 0, 1) < 0.5 ? PBR_LIGHT_POINT : PBR_LIGHT_DIRECTIONAL;
        light->space = random_between(seed, 0, 1) < 0.5 ? PBR_SPACE_EYE : PBR_SPACE_WORLD;
        random_direction(seed, light->vector);
        for (int k = 0; k < 3; k++) light->vector[k] *= 7, light->colour[k] = (float)random_between(seed, 0, 0.5);
        double from[4] = {light->vector[0], light->vector[1], light->vector[2], light->kind == PBR_LIGHT_POINT}, to[4];
        memcpy(to, from, sizeof(to));
        if (light->space == PBR_SPACE_WORLD) matrix_apply(frame->view, from, to);
        memcpy(lit->eye_lights[i], to, sizeof(lit->eye_lights[i]));
    }
}

/* A point in view under a model matrix that turns, stretches and mirrors, and a view matrix that turns and scales. */
static void random_geometry(uint64_t *seed, struct scene *scene, struct lit *lit, bool orthographic) {
    double axis[3], turn[16], scale[16], model_view[16], inverse[16], eye[4] = {0, 0, 0, 1}, object[4];
    random_direction(seed, axis);
    matrix_rotation(axis, random_between(seed, 0, 6), turn);
    matrix_scaling(random_between(seed, 0, 1) < 0.5 ? -1 : 1, random_between(seed, 0.5, 2), random_between(seed, 0.5, 2), scale);
    matrix_multiply(turn, scale, lit->model);
    random_direction(seed, axis);
    matrix_rotation(axis, random_between(seed, 0, 6), turn);
    double size = random_between(seed, 0.5, 2);
    matrix_scaling(size, size, size, scale);
    matrix_multiply(scale, turn, scene->frame.view);
    scene->frame.view[14] = -3;
    matrix_multiply(scene->frame.view, lit->model, model_view);

    eye[0] = random_between(seed, -1, 1), eye[1] = random_between(seed, -1, 1), eye[2] = random_between(seed, -8, -4);
    memcpy(lit->eye_point, eye, sizeof(lit->eye_point));
    assert_true(matrix_invert(model_view, inverse));
    matrix_apply(inverse, eye, object);
    memcpy(lit->position, object, sizeof(lit->position));
    for (int k = 0; k < 3; k++) lit->to_eye[k] = orthographic ? k == 2 : -lit->eye_point[k];
    do {
        random_direction(seed, lit->normal);
        turn_normal(model_view, lit->normal, lit->eye_normal);
        normalise(lit->eye_normal);
    } while (fabs(dot3(lit->eye_normal, lit->to_eye)) < 0.05); /* which side faces the eye is beyond rounding */
}

static void check_lit(struct host *host, bool orthographic) {
    struct scene scene;
    struct lit lit;
    uint64_t seed = orthographic ? 21 : 20;
    scene_open(&scene, host, GL_RGBA8);
    if (orthographic) matrix_ortho(-2, 2, -2, 2, 0, 100, scene.frame.projection);
    for (int n = 0; n < 60; n++) {
        double wanted[3];
        uint8_t rgba[4];
        random_geometry(&seed, &scene, &lit, orthographic);
        random_lights(&seed, &scene, &lit);
        lit.material = (pbr_material){(float)random_between(&seed, 0.01, 0.5), (float)random_between(&seed, 0, 1),
                                      (float)random_between(&seed, 0, 1), (float)random_between(&seed, 1, 40)};
        pbr_points *points = make_point(&scene, lit.position, lit.normal, NULL, NULL);
        pbr_item item = big_item(points);
        item.material = lit.material;
        item.transforms = lit.model;
        item.transform_count = 1;
        item.colour_source = PBR_COLOUR_CONSTANT;
        for (int k = 0; k < 3; k++) {
            item.colour[k] = (float)random_between(&seed, 0.05, 1);
            lit.base[k] = (double)item.colour[k];
        }
        item.colour[3] = 1;
        phong(lit.base, lit.eye_point, lit.eye_normal, lit.to_eye, &scene.frame, (const double(*)[3])lit.eye_lights, &lit.material,
              wanted);
        draw(&scene, &item, rgba);
        expect_linear(rgba, wanted, "Phong");
        pbr_renderer_evict(host->renderer, points);
        pbr_points_release(&points);
    }
    scene_close(&scene);
}

static void lit_colours_are_phongs(void **state) {
    check_lit(*state, false);
}
static void orthographic_views_look_along_one_direction(void **state) {
    check_lit(*state, true);
}

static void lit_colours_of_quads_are_phongs(void **state) {
    host_use_quads(*state);
    check_lit(*state, false);
}

/* One white light from the eye, full ambient light, and the documented coefficients. */
static void without_lights_there_is_a_headlight(void **state) {
    struct scene scene;
    const double position[3] = {0.3, -0.2, -4}, normal[3] = {0.4, 0.1, 0.8}, forward[3] = {0, 0, 1}, base[3] = {0.5, 0.25, 0.125};
    const double to_eye[3] = {-0.3, 0.2, 4};
    const pbr_material material = {0.1f, 0.9f, 0.15f, 32};
    double wanted[3];
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    pbr_points *points = make_point(&scene, position, normal, NULL, NULL);
    pbr_item item = big_item(points);
    item.colour_source = PBR_COLOUR_CONSTANT;
    for (int k = 0; k < 3; k++) item.colour[k] = (float)base[k];
    draw(&scene, &item, rgba);
    pbr_light light = PBR_LIGHT_INIT;
    for (int k = 0; k < 3; k++) light.colour[k] = 1;
    pbr_frame explicit_frame = scene.frame;
    explicit_frame.lights = &light;
    explicit_frame.light_count = 1;
    for (int k = 0; k < 3; k++) explicit_frame.ambient[k] = 1;
    phong(base, position, normal, to_eye, &explicit_frame, (const double(*)[3])forward, &material, wanted);
    expect_linear(rgba, wanted, "headlight");
    pbr_points_release(&points);
    scene_close(&scene);
}

static void ambient_light_is_taken_as_it_is_where_lights_are_given(void **state) {
    struct scene scene;
    const double position[3] = {0, 0, -4}, normal[3] = {0, 0, 1};
    pbr_light light = PBR_LIGHT_INIT;
    uint8_t rgba[4];
    light.vector[2] = 1; /* colour 0 */
    scene_open(&scene, *state, GL_RGBA8);
    pbr_points *points = make_point(&scene, position, normal, NULL, NULL);
    pbr_item item = big_item(points);
    scene.frame.lights = &light;
    scene.frame.light_count = 1;
    draw(&scene, &item, rgba);
    expect_linear(rgba, (const double[3]){0, 0, 0}, "no light at all");
    pbr_points_release(&points);
    scene_close(&scene);
}

static void back_faces_are_culled_only_when_asked(void **state) {
    struct scene scene;
    struct lit lit;
    uint64_t seed = 23;
    int culled = 0;
    for (int path = 0; path < 2; path++) {
        if (path) host_use_quads(*state);
        scene_open(&scene, *state, GL_RGBA8);
        for (int n = 0; n < 30; n++) {
            uint8_t rgba[4];
            random_geometry(&seed, &scene, &lit, false);
            pbr_points *points = make_point(&scene, lit.position, lit.normal, NULL, NULL);
            pbr_item item = big_item(points);
            item.transforms = lit.model;
            item.transform_count = 1;
            draw(&scene, &item, rgba);
            assert_int_equal(rgba[3], 255);
            item.flags = PBR_ITEM_CULL_BACK_FACES;
            draw(&scene, &item, rgba);
            bool faces = dot3(lit.eye_normal, lit.to_eye) > 0;
            assert_int_equal(rgba[3], faces ? 255 : 0);
            culled += !faces;
            pbr_renderer_evict(scene.host->renderer, points);
            pbr_points_release(&points);
        }
        scene_close(&scene);
    }
    assert_true(culled > 5 && culled < 55);
}

/* No direction: a set without normals, or a point whose normal is zero. */
static void points_without_a_normal_are_unlit_and_never_culled(void **state) {
    struct scene scene;
    const double position[3] = {0.1, 0.2, -4}, zero[3] = {0, 0, 0};
    const uint8_t colour[3] = {200, 100, 50};
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    for (int i = 0; i < 2; i++) {
        pbr_points *points = make_point(&scene, position, i ? zero : NULL, colour, NULL);
        pbr_item item = big_item(points);
        item.flags = PBR_ITEM_CULL_BACK_FACES;
        draw(&scene, &item, rgba);
        for (int k = 0; k < 3; k++) assert_in_range(rgba[k], colour[k] - 1, colour[k] + 1);
        assert_int_equal(rgba[3], 255);
        pbr_points_release(&points);
    }
    scene_close(&scene);
}

/* ---- Colour sources ---- */

static void colours_of_points_come_back(void **state) {
    struct scene scene;
    const double position[3] = {0.1, 0.2, -4};
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    for (int level = 0; level < 256; level += 15) {
        const uint8_t colour[3] = {(uint8_t)level, (uint8_t)(255 - level), (uint8_t)(level / 2)};
        pbr_points *points = make_point(&scene, position, NULL, colour, NULL);
        pbr_item item = big_item(points);
        item.shading = PBR_SHADE_NONE;
        draw(&scene, &item, rgba);
        for (int k = 0; k < 3; k++) assert_in_range(rgba[k], colour[k] > 0 ? colour[k] - 1 : 0, colour[k] + 1);
        assert_int_equal(rgba[3], 255);
        pbr_points_release(&points);
    }
    scene_close(&scene);
}

static void points_without_colours_take_the_items(void **state) {
    struct scene scene;
    const double position[3] = {0.1, 0.2, -4};
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    pbr_points *points = make_point(&scene, position, NULL, NULL, NULL);
    pbr_item item = big_item(points);
    item.shading = PBR_SHADE_NONE;
    draw(&scene, &item, rgba);
    expect_linear(rgba, (const double[3]){0.8, 0.8, 0.8}, "the default grey");
    const float colour[4] = {0.1f, 0.5f, 0.9f, 0.3f}; /* opaque splats write alpha 1 whatever theirs */
    memcpy(item.colour, colour, sizeof(colour));
    draw(&scene, &item, rgba);
    expect_linear(rgba, (const double[3]){0.1, 0.5, 0.9}, "the item's colour");
    pbr_points_release(&points);
    scene_close(&scene);
}

static void scalars_go_through_the_colour_map(void **state) {
    static const float map[3][3] = {{0.1f, 0, 1}, {0.9f, 0.2f, 0}, {0, 0.7f, 0.3f}};
    struct scene scene;
    const double position[3] = {0.1, 0.2, -4};
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    for (int i = -2; i <= 14; i++) {
        double value = 5 + 0.25 * i, t = fmin(fmax((value - 5) / 3, 0), 1) * 2, wanted[3];
        int cell = t >= 1 ? 1 : 0;
        pbr_scalar scalar = {"value", {&value, 0, PBR_FORMAT_FLOAT64, 1}};
        pbr_points *points = make_point(&scene, position, NULL, NULL, &scalar);
        pbr_item item = big_item(points);
        item.shading = PBR_SHADE_NONE;
        item.colour_source = PBR_COLOUR_SCALAR;
        item.colour_map = map[0];
        item.colour_map_size = 3;
        item.scalar_range[0] = 5, item.scalar_range[1] = 8;
        draw(&scene, &item, rgba);
        for (int k = 0; k < 3; k++)
            wanted[k] = (double)map[cell][k] + (t - cell) * ((double)map[cell + 1][k] - (double)map[cell][k]);
        expect_linear(rgba, wanted, "a scalar");
        pbr_points_release(&points);
    }
    double nan = NAN;
    pbr_scalar scalar = {"value", {&nan, 0, PBR_FORMAT_FLOAT64, 1}};
    pbr_points *points = make_point(&scene, position, NULL, NULL, &scalar);
    pbr_item item = big_item(points);
    item.shading = PBR_SHADE_NONE;
    item.colour_source = PBR_COLOUR_SCALAR;
    item.scalar_range[0] = 5, item.scalar_range[1] = 8;
    item.colour[1] = item.colour[3] = 1;
    draw(&scene, &item, rgba);
    expect_linear(rgba, (const double[3]){0, 1, 0}, "no value");
    pbr_points_release(&points);
    scene_close(&scene);
}

/* Three points with values 2, 4 and 10 in a row: without a range the map spans 2..10. */
static void a_scalar_without_a_range_spans_its_own(void **state) {
    static const float positions[3][3] = {{-1, 0, -4}, {0, 0, -4}, {1, 0, -4}}, values[3] = {2, 4, 10};
    static const float map[2][3] = {{1, 0, 0}, {0, 0, 1}};
    struct scene scene;
    uint8_t pixels[PIXELS][4];
    pbr_points *points = NULL;
    scene_open(&scene, *state, GL_RGBA8);
    pbr_scalar scalar = {"value", {values, 0, PBR_FORMAT_FLOAT32, 1}};
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = 3;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radius = 0.4f;
    desc.scalars = &scalar;
    desc.scalar_count = 1;
    assert_int_equal(pbr_points_create(scene.host->instance, &desc, &points), PBR_OK);
    pbr_item item = plain_item(points, PBR_SPLAT_SQUARE);
    item.colour_source = PBR_COLOUR_SCALAR;
    item.colour_map = map[0];
    item.colour_map_size = 2;
    target_clear(&scene.target, (const float[4]){0, 0, 0, 0}, 1);
    render(scene.host, &scene.frame, &item, 1);
    target_read(&scene.target, pixels);
    for (int i = 0; i < 3; i++) {
        const double at[3] = {(double)positions[i][0], 0, -4}, t = ((double)values[i] - 2) / 8;
        struct placed splat = place(&scene.frame, &item, NULL, at, 0.4);
        expect_linear(pixels[(int)splat.y * SIZE + (int)splat.x], (const double[3]){1 - t, 0, t}, "own range");
    }
    pbr_points_release(&points);
    scene_close(&scene);
}

static void normals_are_colours_in_object_space(void **state) {
    struct scene scene;
    uint64_t seed = 29;
    double model[16];
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    matrix_rotation((const double[3]){0, 0, 1}, 2, model); /* must not matter */
    for (int n = 0; n < 20; n++) {
        const double position[3] = {0, 0, -4};
        double normal[3];
        random_direction(&seed, normal);
        pbr_points *points = make_point(&scene, position, normal, NULL, NULL);
        pbr_item item = big_item(points);
        item.shading = PBR_SHADE_NONE;
        item.colour_source = PBR_COLOUR_NORMAL;
        item.transforms = model;
        item.transform_count = 1;
        draw(&scene, &item, rgba);
        for (int k = 0; k < 3; k++) assert_true(fabs(rgba[k] - 255 * (normal[k] + 1) / 2) <= 1);
        pbr_points_release(&points);
    }
    scene_close(&scene);
}

/* Distances are in world units, so a view matrix that scales changes nothing. */
static void depth_goes_through_the_colour_map(void **state) {
    static const float map[2][3] = {{1, 0, 0}, {0, 1, 0}};
    struct scene scene;
    uint8_t rgba[4];
    scene_open(&scene, *state, GL_RGBA8);
    for (int scaled = 0; scaled < 2; scaled++) {
        double size = scaled ? 2.5 : 1;
        matrix_scaling(size, size, size, scene.frame.view);
        for (int i = 0; i <= 8; i++) {
            const double position[3] = {0.5, 0.4, -2 - 0.5 * i}, t = fmin(fmax((2 + 0.5 * i - 3) / 2, 0), 1);
            pbr_points *points = make_point(&scene, position, NULL, NULL, NULL);
            pbr_item item = big_item(points);
            item.shading = PBR_SHADE_NONE;
            item.colour_source = PBR_COLOUR_DEPTH;
            item.colour_map = map[0];
            item.colour_map_size = 2;
            item.scalar_range[0] = 3, item.scalar_range[1] = 5;
            draw(&scene, &item, rgba);
            expect_linear(rgba, (const double[3]){1 - t, t, 0}, scaled ? "depth, scaled view" : "depth");
            pbr_points_release(&points);
        }
    }
    scene_close(&scene);
}

/* ---- Encodings ---- */

static void every_target_holds_the_same_linear_colour(void **state) {
    static const GLenum formats[] = {GL_RGBA8, GL_SRGB8_ALPHA8, GL_RGBA16F};
    struct host *host = *state;
    bool has_switch = !context_is_es() || context_has_extension("GL_EXT_sRGB_write_control");
    const double position[3] = {0, 0, -4}, linear[3] = {0.02, 0.2, 0.7};
    for (int format = 0; format < 3; format++)
        for (uint32_t encoding = PBR_ENCODING_AUTO; encoding <= PBR_ENCODING_LINEAR; encoding++) {
            struct scene scene;
            struct target probe;
            float pixels[PIXELS][4];
            uint8_t bytes[PIXELS][4];
            bool is_float = formats[format] == GL_RGBA16F, is_srgb = formats[format] == GL_SRGB8_ALPHA8;
            if (!target_create(&probe, SIZE, SIZE, formats[format], 0, 0)) continue; /* ES 3.0 need not draw to float formats */
            target_destroy(&probe);
            scene_open(&scene, host, formats[format]);
            pbr_points *points = make_point(&scene, position, NULL, NULL, NULL);
            pbr_item item = big_item(points);
            item.shading = PBR_SHADE_NONE;
            for (int k = 0; k < 3; k++) item.colour[k] = (float)linear[k];
            scene.frame.encoding = encoding;
            target_clear(&scene.target, (const float[4]){0, 0, 0, 0}, 1);
            if (is_srgb && encoding == PBR_ENCODING_LINEAR && !has_switch) {
                assert_int_equal(pbr_render(host->view, &scene.frame, &item, 1, NULL), PBR_ERROR_UNSUPPORTED);
                pbr_points_release(&points);
                scene_close(&scene);
                continue;
            }
            render(host, &scene.frame, &item, 1);
            if (is_float) target_read_float(&scene.target, pixels);
            else target_read(&scene.target, bytes);
            bool linear_stored = encoding == PBR_ENCODING_LINEAR || (encoding == PBR_ENCODING_AUTO && is_float);
            for (int k = 0; k < 3; k++) {
                double stored = is_float ? (double)pixels[MIDDLE][k] : bytes[MIDDLE][k] / 255.0;
                double wanted = linear_stored ? linear[k] : (double)srgb_from_linear((float)linear[k]);
                /* One step of 8 bits, or of half floats below 1. */
                if (fabs(stored - wanted) > (is_float ? 1.0 / 1024 : 1.0 / 255))
                    fail_msg("format %d, encoding %u, channel %d: %f, not %f", format, encoding, k, stored, wanted);
            }
            assert_true(is_float ? pixels[MIDDLE][3] == 1 : bytes[MIDDLE][3] == 255);
            pbr_points_release(&points);
            scene_close(&scene);
        }
}

/* Also where a compatibility context is told to clamp what fragments write. */
static void float_targets_take_colours_over_one(void **state) {
    struct host *host = *state;
    struct scene scene;
    struct target probe;
    float pixels[PIXELS][4];
    if (!target_create(&probe, SIZE, SIZE, GL_RGBA16F, 0, 0)) {
        print_message("skipped: the context does not draw to float formats\n");
        skip();
    }
    target_destroy(&probe);
    scene_open(&scene, host, GL_RGBA16F);
    if (context_is_compat()) glClampColor(GL_CLAMP_FRAGMENT_COLOR, GL_TRUE);
    pbr_points *points = make_point(&scene, (const double[3]){0, 0, -4}, NULL, NULL, NULL);
    pbr_item item = big_item(points);
    item.shading = PBR_SHADE_NONE;
    item.colour[0] = 2.5f;
    target_clear(&scene.target, (const float[4]){0, 0, 0, 0}, 1);
    render(host, &scene.frame, &item, 1);
    if (context_is_compat()) glClampColor(GL_CLAMP_FRAGMENT_COLOR, GL_FIXED_ONLY);
    target_read_float(&scene.target, pixels);
    assert_true(pixels[MIDDLE][0] == 2.5f && pixels[MIDDLE][3] == 1);
    pbr_points_release(&points);
    scene_close(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(lit_colours_are_phongs),
        GL_TEST(orthographic_views_look_along_one_direction),
        GL_TEST(lit_colours_of_quads_are_phongs),
        GL_TEST(without_lights_there_is_a_headlight),
        GL_TEST(ambient_light_is_taken_as_it_is_where_lights_are_given),
        GL_TEST(back_faces_are_culled_only_when_asked),
        GL_TEST(points_without_a_normal_are_unlit_and_never_culled),
        GL_TEST(colours_of_points_come_back),
        GL_TEST(points_without_colours_take_the_items),
        GL_TEST(scalars_go_through_the_colour_map),
        GL_TEST(a_scalar_without_a_range_spans_its_own),
        GL_TEST(normals_are_colours_in_object_space),
        GL_TEST(depth_goes_through_the_colour_map),
        GL_TEST(every_target_holds_the_same_linear_colour),
        GL_TEST(float_targets_take_colours_over_one),
    };
    return RUN_GL_TESTS("shading", tests);
}
