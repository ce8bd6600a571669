/* Keys of the viewer. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../tools/view_state.h"

static struct view_state make_state(void) {
    struct view_state state = {.options = scene_options_default(HEADLESS_GL_33)};
    state.start = state.options;
    return state;
}

/* Types a character, once or held down. */
static enum view_change type(struct view_state *state, char character, bool is_repeat) {
    uint32_t number;
    enum view_action action = view_find_action((uint32_t)character, VIEW_KEY_NONE, is_repeat, &number);
    return view_act(state, action, number);
}

static void press(struct view_state *state, const char *characters) {
    for (; *characters; characters++) type(state, *characters, false);
}

static void every_splat_has_a_number(void **state) {
    (void)state;
    struct view_state s = make_state();
    for (uint32_t i = 0; i < kind_count(splat_kinds); i++) {
        assert_int_equal(type(&s, (char)('1' + i), false), VIEW_SCENE_CHANGED);
        assert_int_equal(s.options.splat, splat_kinds[i].value);
    }
    const uint32_t last = s.options.splat;
    assert_true(kind_count(splat_kinds) < 9);
    assert_int_equal(type(&s, '9', false), VIEW_SAME);
    assert_int_equal(type(&s, '0', false), VIEW_SAME);
    assert_int_equal(s.options.splat, last);
}

static void kinds_go_round(void **state) {
    (void)state;
    struct view_state s = make_state();
    for (uint32_t i = 0; i < kind_count(splat_kinds); i++) {
        assert_int_equal(s.options.splat, splat_kinds[i].value);
        press(&s, "s");
    }
    assert_int_equal(s.options.splat, splat_kinds[0].value);
    for (uint32_t i = 0; i < kind_count(shading_kinds); i++) {
        assert_int_equal(s.options.shading, shading_kinds[i].value);
        press(&s, "l");
    }
    assert_int_equal(s.options.shading, shading_kinds[0].value);
}

/* Nothing that the keys can do is a scene that libpbr refuses. */
static void fill_is_of_the_kinds_that_can_be_filled(void **state) {
    (void)state;
    struct view_state s = make_state();
    assert_int_equal(scene_options_blending(&s.options), PBR_BLEND_KIND);
    assert_int_equal(type(&s, 'g', false), VIEW_SCENE_CHANGED);
    for (uint32_t i = 0; i < kind_count(splat_kinds); i++) {
        const bool can = s.options.splat <= PBR_SPLAT_ELLIPSE;
        assert_int_equal(scene_options_blending(&s.options), can ? PBR_BLEND_FILL : PBR_BLEND_KIND);
        press(&s, "s");
    }
    press(&s, "g");
    assert_int_equal(scene_options_blending(&s.options), PBR_BLEND_KIND);
}

static void colours_go_round_over_the_scalars(void **state) {
    (void)state;
    struct view_state s = make_state();
    char name[32];
    view_add_scalar(&s, "heat");
    view_add_scalar(&s, "time");
    view_add_scalar(&s, "heat");
    assert_int_equal(s.scalar_count, 2);
    for (uint32_t i = 0; i < kind_count(colour_kinds); i++) {
        view_colour_name(&s.options, name, sizeof name);
        assert_string_equal(name, colour_kinds[i].name);
        press(&s, "c");
    }
    view_colour_name(&s.options, name, sizeof name);
    assert_string_equal(name, "scalar:heat");
    press(&s, "c");
    view_colour_name(&s.options, name, sizeof name);
    assert_string_equal(name, "scalar:time");
    press(&s, "c");
    assert_int_equal(s.options.colour_source, colour_kinds[0].value);
    /* From a name of the command line's, which need not be the same string; without scalars the kinds alone go round. */
    char text[] = "heat";
    s.options.colour_source = PBR_COLOUR_SCALAR;
    s.options.scalar = text;
    press(&s, "c");
    assert_string_equal(s.options.scalar, "time");
    s = make_state();
    for (uint32_t i = 0; i < kind_count(colour_kinds); i++) press(&s, "c");
    assert_int_equal(s.options.colour_source, colour_kinds[0].value);
    /* No more names than there is room for. */
    static char names[VIEW_MOST_SCALARS + 1][16];
    for (int i = 0; i <= VIEW_MOST_SCALARS; i++) {
        snprintf(names[i], sizeof names[i], "s%d", i);
        view_add_scalar(&s, names[i]);
    }
    assert_int_equal(s.scalar_count, VIEW_MOST_SCALARS);
}

static void sizes_grow_and_shrink_within_what_options_take(void **state) {
    (void)state;
    struct view_state s = make_state();
    press(&s, "]]]]");
    assert_true(s.options.radius_scale == 2);
    press(&s, "[[[[[[[[");
    assert_true(s.options.radius_scale == 0.5);
    for (int i = 0; i < 200; i++) press(&s, "[");
    assert_true(s.options.radius_scale >= 1e-6);
    for (int i = 0; i < 400; i++) press(&s, "]");
    assert_true(s.options.radius_scale <= 1e6 && s.options.radius_scale > 8e5);
    press(&s, "..");
    assert_true(s.options.size_minimum == 2);
    press(&s, ",,,");
    assert_true(s.options.size_minimum == 0); /* the kind's own */
    for (int i = 0; i < 200; i++) press(&s, ".");
    assert_true(s.options.size_minimum == 64);
    s.options.size_maximum = 3.2;
    s.options.size_minimum = 0;
    for (int i = 0; i < 200; i++) press(&s, ".");
    assert_true(s.options.size_minimum == 3);
}

static void the_threshold_goes_between_the_leaves_and_64_pixels(void **state) {
    (void)state;
    struct view_state s = make_state();
    press(&s, ">>");
    assert_true(s.options.threshold == 2);
    press(&s, "<<<<");
    assert_true(s.options.threshold == 0.5);
    press(&s, "<<");
    assert_true(s.options.threshold == 0.25);
    for (int i = 0; i < 3; i++) {
        press(&s, "<");
        assert_true(s.options.threshold == 0);
    }
    for (int i = 0; i < 50; i++) press(&s, ">");
    assert_true(s.options.threshold == 64);
    /* What the command line says beyond stays, until it is left. */
    s.options.threshold = 100;
    press(&s, ">");
    assert_true(s.options.threshold == 100);
    press(&s, "<");
    assert_true(s.options.threshold < 100 && s.options.threshold > 64);
    /* From where everything is drawn whole, as if by the leaves. */
    s.options.threshold = 3;
    s.options.lod = LOD_NONE;
    assert_true(scene_options_threshold(&s.options) == 0);
    press(&s, ">");
    assert_true(s.options.threshold == 0.25 && scene_options_threshold(&s.options) == 0.25);
}

static void meshes_are_drawn_by_the_threshold_as_triangles_and_as_vertices(void **state) {
    (void)state;
    struct view_state s = make_state();
    s.options.lod = PBR_LOD_POP;
    s.options.threshold = 3;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(type(&s, 'm', false), VIEW_SCENE_CHANGED);
        assert_true(scene_options_threshold(&s.options) == 0 && !s.options.vertices);
        press(&s, "m");
        assert_true(s.options.vertices);
        press(&s, "m");
        assert_true(scene_options_threshold(&s.options) == 3 && !s.options.vertices);
        assert_int_equal(s.options.lod, PBR_LOD_POP);
    }
    /* From where all is drawn whole, as from all triangles. */
    s = make_state();
    s.options.lod = LOD_NONE;
    press(&s, "m");
    assert_true(s.options.vertices);
    press(&s, "m");
    assert_true(scene_options_threshold(&s.options) > 0 && !s.options.vertices);
}

static void reset_brings_back_the_view_and_the_light_only(void **state) {
    (void)state;
    struct view_state s = make_state();
    s.start.view[0] = s.options.view[0] = 77;
    s.start.has_centre = s.options.has_centre = true;
    s.start.centre[1] = s.options.centre[1] = 5;
    s.options.light[0] = 10;
    s.options.centre[1] = 6;
    press(&s, "+o2 ");
    uint32_t number;
    view_act(&s, view_find_action(0, VIEW_KEY_LEFT, false, &number), 0);
    assert_true(s.options.view[0] == 82 && s.options.view[2] > 1 && s.has_moved && s.spins);
    press(&s, "r");
    assert_memory_equal(s.options.view, s.start.view, sizeof s.options.view);
    assert_true(s.options.light[0] == 0 && s.options.has_centre && s.options.centre[1] == 5);
    assert_false(s.options.parallel || s.has_moved || s.spins);
    assert_int_equal(s.options.splat, splat_kinds[1].value);
    /* Frame all keeps the side, and lets the centre be the model's again. */
    press(&s, "-f");
    assert_true(s.options.view[0] == 77 && s.options.view[2] == 1 && !s.options.has_centre && !s.has_moved);
}

static void switches_are_switched_and_keys_held_down_do_not_flicker(void **state) {
    (void)state;
    struct view_state s = make_state();
    press(&s, "boih");
    assert_true(s.options.cull && s.options.parallel && s.shows_info && s.shows_help);
    for (const char *key = "boihslcgpq 1"; *key; key++) assert_int_equal(type(&s, *key, true), VIEW_SAME);
    assert_true(s.options.cull && s.options.parallel && s.shows_info && s.shows_help);
    assert_int_equal(type(&s, ']', true), VIEW_SCENE_CHANGED);
    /* With the shift lock, too. */
    press(&s, "BOIH");
    assert_false(s.options.cull || s.options.parallel || s.shows_info || s.shows_help);
    assert_int_equal(type(&s, 'x', false), VIEW_SAME);
}

static void keys_without_a_character_are_found(void **state) {
    (void)state;
    uint32_t number;
    assert_int_equal(view_find_action(0, VIEW_KEY_F1, false, &number), VIEW_HELP);
    assert_int_equal(view_find_action(0, VIEW_KEY_F11, false, &number), VIEW_FULL_SCREEN);
    assert_int_equal(view_find_action(0, VIEW_KEY_F12, false, &number), VIEW_SCREENSHOT);
    assert_int_equal(view_find_action('p', VIEW_KEY_NONE, false, &number), VIEW_SCREENSHOT);
    assert_int_equal(view_find_action(0, VIEW_KEY_ESCAPE, false, &number), VIEW_LEAVE);
    assert_int_equal(view_find_action('q', VIEW_KEY_NONE, false, &number), VIEW_QUIT);
    assert_int_equal(view_find_action(0, VIEW_KEY_UP, true, &number), VIEW_TURN_UP);
}

static void no_key_means_two_things(void **state) {
    (void)state;
    for (const struct view_key *a = view_keys; a->name; a++)
        for (const struct view_key *b = a; b->name; b++)
            for (int i = 0; i < 4 && a->bindings[i].action; i++)
                for (int j = a == b ? i + 1 : 0; j < 4 && b->bindings[j].action; j++) {
                    bool same = a->bindings[i].character == b->bindings[j].character && a->bindings[i].key == b->bindings[j].key;
                    if (same) fail_msg("'%s' and '%s'", a->name, b->name);
                }
}

/* Its lines of keys, as .TP and the keys in bold. */
static void manual_lists_every_key(void **state) {
    (void)state;
    static char manual[200000];
    FILE *file = fopen("docs/pbr.1", "r"); /* tests run in the project's folder */
    assert_non_null(file);
    manual[fread(manual, 1, sizeof manual - 1, file)] = '\0';
    fclose(file);
    for (const struct view_key *key = view_keys; key->name; key++) {
        char line[64] = "\n.TP\n.B ";
        size_t length = strlen(line);
        for (const char *c = key->name; *c && length + 2 < sizeof line; c++) {
            if (*c == '-') line[length++] = '\\';
            line[length++] = *c;
        }
        line[length++] = '\n';
        line[length] = '\0';
        if (!strstr(manual, line)) fail_msg("the manual lacks the keys '%s'", key->name);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_splat_has_a_number),
        cmocka_unit_test(kinds_go_round),
        cmocka_unit_test(fill_is_of_the_kinds_that_can_be_filled),
        cmocka_unit_test(colours_go_round_over_the_scalars),
        cmocka_unit_test(sizes_grow_and_shrink_within_what_options_take),
        cmocka_unit_test(the_threshold_goes_between_the_leaves_and_64_pixels),
        cmocka_unit_test(meshes_are_drawn_by_the_threshold_as_triangles_and_as_vertices),
        cmocka_unit_test(reset_brings_back_the_view_and_the_light_only),
        cmocka_unit_test(switches_are_switched_and_keys_held_down_do_not_flicker),
        cmocka_unit_test(keys_without_a_character_are_found),
        cmocka_unit_test(no_key_means_two_things),
        cmocka_unit_test(manual_lists_every_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
