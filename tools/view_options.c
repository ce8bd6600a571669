/* Options of `pbr view`. SPDX-License-Identifier: MIT */
#include "view_options.h"

const char view_usage[] =
    "usage: pbr view IN... [options]\n"
    "\n"
    "Shows points, a mesh's vertices as points, or hierarchies, in a window; each file as soon as it is read. Drag with\n"
    "the left button to turn, with the right one (or the middle one, or shift and the left one) to move, with ctrl and the left "
    "one to turn the light; the\n"
    "wheel zooms; h shows the keys.\n"
    "\n" SCENE_OPTIONS_USAGE "  --gl VERSION          3.3, 4.5, compat, es3.0 or es3.2; 3.3\n"
    "  --screenshots FOLDER  where screenshots go, as pbr-0001.png and so on; the current folder\n"
    "  --json                print at the end what was shown, and how, as JSON\n";

enum { MOST_PIXELS = 16384 }; /* a side; X servers end clients that ask for more than they have */

enum { SCREENSHOTS = SCENE_OPTION_COUNT, JSON };

static const struct option_rule rules[] = {
    SCENE_OPTION_RULES, [SCREENSHOTS] = {"--screenshots", true}, [JSON] = {"--json", false}, {NULL, false}};

int view_options_parse(struct session *session, int argc, char **argv, struct view_options *options) {
    struct option_scan scan = {.argc = argc, .argv = argv};
    int option;
    *options = (struct view_options){.scene = scene_options_default(HEADLESS_GL_33), .screenshots = "."};
    options->scene.time_budget = 33;
    while ((option = scene_options_next(session, "view", &scan, rules, &options->scene)) != OPTION_END) {
        if (option == OPTION_BAD) return STATUS_USAGE;
        if (option == SCREENSHOTS) options->screenshots = scan.value;
        if (option == JSON) options->json = true;
    }
    const uint32_t *size = options->scene.size;
    if (size[0] > MOST_PIXELS || size[1] > MOST_PIXELS)
        return session_usage(session, "view", "--size: more than 16384 pixels a side");
    return scene_options_check(session, "view", &options->scene) ? STATUS_OK : STATUS_USAGE;
}
