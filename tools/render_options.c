/* Options of `pbr render`. SPDX-License-Identifier: MIT */
#include "render_options.h"

#include <ctype.h>
#include <pbr/image.h>
#include <stdio.h>
#include <string.h>

#include "options.h"

const char render_usage[] =
    "usage: pbr render IN... -o OUT.png|OUT.exr [options]\n"
    "\n"
    "Draws points, or a mesh's vertices as points, without a window. PNG is 8-bit sRGB; OpenEXR is 32-bit linear with depth.\n"
    "\n"
    "  -o FILE               the picture. With --orbit, a %04d in the name writes every frame\n"
    "  --size WxH            pixels; 1280x720\n"
    "  --view YAW,PITCH,ZOOM degrees around the bounding sphere, and zoom 1 = it just fits; 30,20,1. Vertical field of view 50 "
    "degrees\n"
    "  --ortho               parallel projection of the same height at the sphere's centre\n"
    "  --up y|z              which axis of the files points up; y\n"
    "  --grid RxC            R rows and C columns of copies, side by side as seen by --view 0,0; 1x1. The view is around all of "
    "them\n"
    "  --splat circle|square shape on the screen; circle\n"
    "  --shade phong|none    lighting; phong, where there are normals\n"
    "  --colour SOURCE       points, normal, depth, or scalar:NAME through a colour map; points\n"
    "  --cull                drop splats that face away\n"
    "  --radius-scale F      factor on every radius\n"
    "  --min-size PX         smallest diameter on screen; 1\n"
    "  --max-size PX         largest diameter on screen; no limit\n"
    "  --background R,G,B[,A] sRGB, 0..1; 0.1,0.1,0.12\n"
    "  --samples N           multisampling; 1\n"
    "  --frames N            draw N frames after a first one that is timed apart; 1\n"
    "  --orbit               turn by 360/N degrees a frame; the picture is the first, seen as --view says\n"
    "  --gl VERSION          3.3, 4.5, compat, es3.0 or es3.2; 4.5\n"
    "  --stats FILE          what the frames did and how long they took, as JSON\n"
    "  --raw                 time the same data as plain GL_POINTS, too, in turn with the frames: raw_frame_ms, speed_vs_raw\n";

enum {
    OUTPUT,
    SIZE,
    VIEW,
    ORTHO,
    UP,
    GRID,
    SPLAT,
    SHADE,
    COLOUR,
    CULL,
    RADIUS_SCALE,
    MIN_SIZE,
    MAX_SIZE,
    BACKGROUND,
    SAMPLES,
    FRAMES,
    ORBIT,
    GL,
    STATS,
    RAW
};

static const struct option_rule rules[] = {[OUTPUT] = {"-o", true},
                                           [SIZE] = {"--size", true},
                                           [VIEW] = {"--view", true},
                                           [ORTHO] = {"--ortho", false},
                                           [UP] = {"--up", true},
                                           [GRID] = {"--grid", true},
                                           [SPLAT] = {"--splat", true},
                                           [SHADE] = {"--shade", true},
                                           [COLOUR] = {"--colour", true},
                                           [CULL] = {"--cull", false},
                                           [RADIUS_SCALE] = {"--radius-scale", true},
                                           [MIN_SIZE] = {"--min-size", true},
                                           [MAX_SIZE] = {"--max-size", true},
                                           [BACKGROUND] = {"--background", true},
                                           [SAMPLES] = {"--samples", true},
                                           [FRAMES] = {"--frames", true},
                                           [ORBIT] = {"--orbit", false},
                                           [GL] = {"--gl", true},
                                           [STATS] = {"--stats", true},
                                           [RAW] = {"--raw", false},
                                           {NULL, false}};

/* Words in the order of PBR_SPLAT_, PBR_SHADE_. */
static const char *const splats[] = {[PBR_SPLAT_CIRCLE] = "circle", [PBR_SPLAT_SQUARE] = "square", NULL};
static const char *const shadings[] = {[PBR_SHADE_PHONG] = "phong", [PBR_SHADE_NONE] = "none", NULL};
static const char *const axes[] = {"y", "z", NULL};

const char *render_splat_name(uint32_t splat) {
    return splats[splat];
}

static bool parse_choice(const char *text, const char *const *words, uint32_t *out) {
    int index = parse_word(text, words);
    if (index < 0) return false;
    *out = (uint32_t)index;
    return true;
}

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

static bool parse_colour(const char *text, struct render_options *options) {
    if (!strcmp(text, "points")) options->colour_source = PBR_COLOUR_POINTS;
    else if (!strcmp(text, "normal")) options->colour_source = PBR_COLOUR_NORMAL;
    else if (!strcmp(text, "depth")) options->colour_source = PBR_COLOUR_DEPTH;
    else if (!strncmp(text, "scalar:", 7) && text[7]) options->colour_source = PBR_COLOUR_SCALAR, options->scalar = text + 7;
    else return false;
    return true;
}

/* One option's value; NULL if it was taken, else what it should have been. */
static const char *take_option(struct render_options *options, int option, const char *value) {
    uint32_t axis = 0;
    switch (option) {
    case OUTPUT: options->output = value; return is_picture_name(value) ? NULL : "a name ending in .png or .exr";
    case SIZE: return parse_size(value, PBR_MAX_IMAGE_SIZE, options->size) ? NULL : "WIDTHxHEIGHT, each 1 to 65536";
    case VIEW: return parse_view(value, options->view) ? NULL : "YAW,PITCH,ZOOM with a zoom above 0";
    case ORTHO: options->parallel = true; return NULL;
    case UP:
        if (!parse_choice(value, axes, &axis)) return "y or z";
        options->z_up = axis == 1;
        return NULL;
    case GRID: return parse_copies(value, options->grid) ? NULL : "ROWSxCOLUMNS, at most 1048576 copies";
    case SPLAT: return parse_choice(value, splats, &options->splat) ? NULL : "circle or square";
    case SHADE: return parse_choice(value, shadings, &options->shading) ? NULL : "phong or none";
    case COLOUR: return parse_colour(value, options) ? NULL : "points, normal, depth or scalar:NAME";
    case CULL: options->cull = true; return NULL;
    case RADIUS_SCALE: return parse_number_within(value, 1e-6, 1e6, &options->radius_scale) ? NULL : "a number from 1e-6 to 1e6";
    case MIN_SIZE: return parse_number_within(value, 1e-6, 1e6, &options->size_minimum) ? NULL : "pixels from 1e-6 to 1e6";
    case MAX_SIZE: return parse_number_within(value, 1e-6, 1e6, &options->size_maximum) ? NULL : "pixels from 1e-6 to 1e6";
    case BACKGROUND: return parse_rgb(value, 4, options->background) ? NULL : "R,G,B or R,G,B,A, each 0 to 1";
    case SAMPLES: return parse_count(value, 1, 64, &options->samples) ? NULL : "a number from 1 to 64";
    case FRAMES: return parse_count(value, 1, 1000000, &options->frames) ? NULL : "a number from 1 to 1000000";
    case ORBIT: options->orbit = true; return NULL;
    case GL: return headless_kind_parse(value, &options->context) ? NULL : "3.3, 4.5, compat, es3.0 or es3.2";
    case STATS: options->stats = value; return NULL;
    case RAW: options->raw = true; return NULL;
    default: return "known";
    }
}

static int usage_error(struct session *session, const char *what) {
    session_fail(session, "render: %s (see pbr render --help)", what);
    return STATUS_USAGE;
}

int render_options_parse(struct session *session, int argc, char **argv, struct render_options *options) {
    struct option_scan scan = {.argc = argc, .argv = argv};
    int option;
    *options = (struct render_options){.size = {1280, 720},
                                       .grid = {1, 1},
                                       .frames = 1,
                                       .samples = 1,
                                       .view = {30, 20, 1},
                                       .context = HEADLESS_GL_45,
                                       .background = {0.1f, 0.1f, 0.12f, 1}};
    while ((option = option_next(&scan, rules)) != OPTION_END) {
        if (option == OPTION_BAD) return usage_error(session, scan.error);
        if (option == OPTION_OPERAND) {
            if (options->input_count == MOST_INPUTS) return usage_error(session, "too many files");
            options->inputs[options->input_count++] = scan.value;
            continue;
        }
        const char *expected = take_option(options, option, scan.value);
        if (expected) {
            session_fail(session, "render: %s: '%s' is not %s", rules[option].name, scan.value, expected);
            return STATUS_USAGE;
        }
    }
    if (options->input_count == 0) return usage_error(session, "no file given");
    if (!options->output && !options->stats) return usage_error(session, "nothing to write: give -o or --stats");
    if (options->size_maximum > 0 && options->size_maximum < options->size_minimum)
        return usage_error(session, "--max-size is below --min-size");
    return STATUS_OK;
}

bool render_frame_name(const char *output, uint32_t frame, char *name, size_t capacity) {
    const char *percent = strchr(output, '%'), *end = percent ? percent + 1 : NULL;
    int digits = 0;
    snprintf(name, capacity, "%s", output);
    if (!percent) return false;
    if (end[0] == '0' && isdigit((unsigned char)end[1]) && end[1] != '0') {
        digits = end[1] - '0';
        end += 2;
    }
    if (*end != 'd') return false;
    int length = snprintf(name, capacity, "%.*s%0*u%s", (int)(percent - output), output, digits, (unsigned)frame, end + 1);
    return length > 0 && (size_t)length < capacity;
}
