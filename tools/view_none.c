/* pbr view of a build without GLFW. SPDX-License-Identifier: MIT */
#include "commands.h"
#include "view_options.h"

static int run_view(struct session *session, int argc, char **argv) {
    struct view_options options;
    int status = view_options_parse(session, argc, argv, &options);
    return status == STATUS_OK ? session_fail(session, "view: this pbr was built without the viewer (which needs GLFW)") : status;
}

const struct command view_command = {"view", run_view, view_usage};
