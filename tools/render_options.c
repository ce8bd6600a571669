/* Options of `pbr render`. SPDX-License-Identifier: MIT */
#include "render_options.h"

#include <ctype.h>
#include <pbr/reference.h>
#include <stdio.h>
#include <string.h>

#include "input.h"

const char render_usage[] =
    "usage: pbr render IN... -o OUT.png|OUT.exr [options]\n"
    "\n"
    "Draws points, a mesh's vertices as points, or hierarchies of either, without a window. PNG is 8-bit sRGB; OpenEXR is 32-bit "
    "linear with depth.\n"
    "\n"
    "  -o FILE               the picture. With --orbit, a %04d in the name writes every frame\n" SCENE_OPTIONS_USAGE
    "  --frames N            draw N frames after a first one that is timed apart; 1\n"
    "  --refine              do not wait for cuts of hierarchies: draw as a window would, before the frames until the picture is "
    "final\n"
    "  --orbit               turn by 360/N degrees a frame; the picture is the first, seen as --view says\n"
    "  --gl VERSION          3.3, 4.5, compat, es3.0 or es3.2; 4.5\n"
    "  --stats FILE          what the frames did and how long they took, as JSON\n"
    "  --reference           draw the splats by their definitions on the CPU, slowly, without OpenGL, to measure others by\n"
    "  --ground-truth N      draw the meshes' triangles instead, likewise, N x N samples a pixel, N from 1 to 16\n"
    "  --raw                 time the same data as plain GL_POINTS, too, in turn with the frames: raw_frame_ms, speed_vs_raw\n";

enum { OUTPUT = SCENE_OPTION_COUNT, FRAMES, REFINE, ORBIT, STATS, REFERENCE, GROUND_TRUTH, RAW };

static const struct option_rule rules[] = {SCENE_OPTION_RULES,
                                           [OUTPUT] = {"-o", true},
                                           [FRAMES] = {"--frames", true},
                                           [REFINE] = {"--refine", false},
                                           [ORBIT] = {"--orbit", false},
                                           [STATS] = {"--stats", true},
                                           [REFERENCE] = {"--reference", false},
                                           [GROUND_TRUTH] = {"--ground-truth", true},
                                           [RAW] = {"--raw", false},
                                           {NULL, false}};

/* One option's value; NULL if it was taken, else what it should have been. */
static const char *take_option(struct render_options *options, int option, const char *value) {
    switch (option) {
    case OUTPUT: options->output = value; return is_picture_name(value) ? NULL : "a name ending in .png or .exr";
    case FRAMES: return parse_count(value, 1, 1000000, &options->frames) ? NULL : "a number from 1 to 1000000";
    case REFINE: options->refine = true; return NULL;
    case ORBIT: options->orbit = true; return NULL;
    case STATS: options->stats = value; return NULL;
    case REFERENCE: options->reference = true; return NULL;
    case GROUND_TRUTH: return parse_count(value, 1, PBR_MAX_SAMPLES, &options->ground_truth) ? NULL : "a number from 1 to 16";
    case RAW: options->raw = true; return NULL;
    default: return "known";
    }
}

/* NULL, or which options contradict each other. */
static const char *contradiction(const struct render_options *options) {
    if (!options->reference && options->ground_truth == 0) return NULL;
    if (options->reference && options->ground_truth > 0) return "--reference and --ground-truth are two pictures";
    if (options->refine) return "--refine needs OpenGL, which --reference and --ground-truth do without";
    if (options->raw) return "--raw needs OpenGL, which --reference and --ground-truth do without";
    if (options->scene.samples > 1) return "--samples is OpenGL's; --ground-truth takes their number itself";
    return NULL;
}

int render_options_parse(struct session *session, int argc, char **argv, struct render_options *options) {
    struct option_scan scan = {.argc = argc, .argv = argv};
    int option;
    *options = (struct render_options){.scene = scene_options_default(HEADLESS_GL_45), .frames = 1};
    while ((option = scene_options_next(session, "render", &scan, rules, &options->scene)) != OPTION_END) {
        if (option == OPTION_BAD) return STATUS_USAGE;
        const char *expected = take_option(options, option, scan.value);
        if (expected) return session_bad_value(session, "render", rules[option].name, scan.value, expected);
    }
    if (!scene_options_check(session, "render", &options->scene)) return STATUS_USAGE;
    const char *error = contradiction(options);
    if (error) return session_usage(session, "render", error);
    if (!options->output && !options->stats) return session_usage(session, "render", "nothing to write: give -o or --stats");
    return STATUS_OK;
}

unsigned render_options_wanted(const struct render_options *options) {
    if (options->ground_truth > 0) return INPUT_SURFACE;
    return scene_options_wanted(&options->scene) | (options->reference || options->raw ? INPUT_LEAVES : 0);
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
