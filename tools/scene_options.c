/* Options of a scene. SPDX-License-Identifier: MIT */
#include "scene_options.h"

#include <pbr/image.h>
#include <string.h>

#include "input.h"

static const char *const axes[] = {"y", "z", NULL};

static bool parse_view(const char *text, double view[3]) {
    double values[3];
    if (parse_list(text, values, 3) != 3 || !(values[2] > 0)) return false;
    memcpy(view, values, sizeof values);
    return true;
}

static bool parse_copies(const char *text, uint32_t grid[2]) {
    uint32_t values[2];
    if (!parse_size(text, PBR_MAX_TRANSFORMS, values) || (uint64_t)values[0] * values[1] > PBR_MAX_TRANSFORMS) return false;
    memcpy(grid, values, sizeof values);
    return true;
}

static bool parse_colour(const char *text, struct scene_options *options) {
    if (kind_parse(colour_kinds, text, &options->colour_source)) return true;
    if (strncmp(text, "scalar:", 7) || !text[7]) return false;
    options->colour_source = PBR_COLOUR_SCALAR;
    options->scalar = text + 7;
    return true;
}

static bool parse_point_cost(const char *text, double *cost) {
    if (strcmp(text, "auto") != 0) return parse_number_within(text, 0, 1e6, cost);
    *cost = POINT_COST_AUTO;
    return true;
}

/* One option's value; NULL if it was taken, else what it should have been. */
static const char *take_option(struct scene_options *options, int option, const char *value) {
    int axis;
    switch (option) {
    case SCENE_SIZE: return parse_size(value, PBR_MAX_IMAGE_SIZE, options->size) ? NULL : "WIDTHxHEIGHT, each 1 to 65536";
    case SCENE_VIEW: return parse_view(value, options->view) ? NULL : "YAW,PITCH,ZOOM with a zoom above 0";
    case SCENE_CENTRE:
        options->has_centre = parse_list(value, options->centre, 3) == 3;
        return options->has_centre ? NULL : "X,Y,Z";
    case SCENE_LIGHT: return parse_list(value, options->light, 2) == 2 ? NULL : "YAW,PITCH";
    case SCENE_ORTHO: options->parallel = true; return NULL;
    case SCENE_UP:
        axis = parse_word(value, axes);
        options->z_up = axis == 1;
        return axis >= 0 ? NULL : "y or z";
    case SCENE_GRID: return parse_copies(value, options->grid) ? NULL : "ROWSxCOLUMNS, at most 1048576 copies";
    case SCENE_SPLAT: return kind_parse(splat_kinds, value, &options->splat) ? NULL : "one of" SPLAT_WORDS;
    case SCENE_BLEND: return kind_parse(blending_kinds, value, &options->blending) ? NULL : "one of" BLENDING_WORDS;
    case SCENE_SHADE: return kind_parse(shading_kinds, value, &options->shading) ? NULL : "one of" SHADING_WORDS;
    case SCENE_COLOUR: return parse_colour(value, options) ? NULL : "one of" COLOUR_WORDS ", or scalar:NAME";
    case SCENE_CULL: options->cull = true; return NULL;
    case SCENE_OCCLUSION: options->occlusion = true; return NULL;
    case SCENE_LOD: return kind_parse(lod_kinds, value, &options->lod) ? NULL : "one of" LOD_WORDS;
    case SCENE_VERTICES: options->vertices = true; return NULL;
    case SCENE_THRESHOLD: return parse_number_within(value, 0, 1e6, &options->threshold) ? NULL : "pixels from 0 to 1e6";
    case SCENE_POINT_COST: return parse_point_cost(value, &options->point_cost) ? NULL : "auto or a number from 0 to 1e6";
    case SCENE_TIME_BUDGET: return parse_number_within(value, 0, 1e6, &options->time_budget) ? NULL : "milliseconds from 0 to 1e6";
    case SCENE_RADIUS_SCALE:
        return parse_number_within(value, 1e-6, 1e6, &options->radius_scale) ? NULL : "a number from 1e-6 to 1e6";
    case SCENE_MIN_SIZE: return parse_number_within(value, 1e-6, 1e6, &options->size_minimum) ? NULL : "pixels from 1e-6 to 1e6";
    case SCENE_MAX_SIZE: return parse_number_within(value, 1e-6, 1e6, &options->size_maximum) ? NULL : "pixels from 1e-6 to 1e6";
    case SCENE_LOW_PASS: return parse_number_within(value, 1e-6, 16, &options->low_pass) ? NULL : "square pixels from 1e-6 to 16";
    case SCENE_BACKGROUND: return parse_rgb(value, 4, options->background) ? NULL : "R,G,B or R,G,B,A, each 0 to 1";
    case SCENE_SAMPLES: return parse_count(value, 1, 64, &options->samples) ? NULL : "a number from 1 to 64";
    case SCENE_GL: return headless_kind_parse(value, &options->context) ? NULL : "3.3, 4.5, compat, es3.0 or es3.2";
    default: return "known";
    }
}

struct scene_options scene_options_default(enum headless_kind context) {
    return (struct scene_options){.size = {1280, 720},
                                  .samples = 1,
                                  .grid = {1, 1},
                                  .splat = PBR_SPLAT_CIRCLE,
                                  .shading = PBR_SHADE_PHONG,
                                  .colour_source = PBR_COLOUR_POINTS,
                                  .view = {30, 20, 1},
                                  .lod = LOD_AUTO,
                                  .threshold = 1,
                                  .context = context,
                                  .background = {0.1f, 0.1f, 0.12f, 1}};
}

int scene_options_next(struct session *session, const char *command, struct option_scan *scan, const struct option_rule *rules,
                       struct scene_options *options) {
    for (;;) {
        int option = option_next(scan, rules);
        const char *expected = NULL, *error = NULL;
        if (option == OPTION_BAD) error = scan->error;
        else if (option == OPTION_OPERAND && options->input_count == MOST_INPUTS) error = "too many files";
        else if (option == OPTION_OPERAND) options->inputs[options->input_count++] = scan->value;
        else if (option == OPTION_END || option >= SCENE_OPTION_COUNT) return option;
        else expected = take_option(options, option, scan->value);
        if (expected) session_bad_value(session, command, rules[option].name, scan->value, expected);
        if (error) session_usage(session, command, error);
        if (expected || error) return OPTION_BAD;
    }
}

bool scene_options_check(struct session *session, const char *command, const struct scene_options *options) {
    const char *error = NULL;
    if (options->input_count == 0) error = "no file given";
    else if (options->blending != scene_options_blending(options))
        error = "--blend fill is of circle, square and ellipse; the other kinds are blended already";
    else if (options->size_maximum > 0 && options->size_maximum < options->size_minimum) error = "--max-size is below --min-size";
    if (error) session_usage(session, command, error);
    return !error;
}

unsigned scene_options_wanted(const struct scene_options *options) {
    if (options->lod == LOD_NONE || options->lod == LOD_AUTO) return 0;
    const unsigned fields = options->shading == PBR_SHADE_PHONG_FIELD ? INPUT_FIELDS : 0;
    return INPUT_BUILD | fields | options->lod << INPUT_KIND_SHIFT;
}

double scene_options_threshold(const struct scene_options *options) {
    return options->lod == LOD_NONE ? 0 : options->threshold;
}

uint32_t scene_options_blending(const struct scene_options *options) {
    return options->splat < PBR_SPLAT_GAUSSIAN ? options->blending : PBR_BLEND_KIND;
}
