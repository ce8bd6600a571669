/* The subcommands. Each gets its arguments without the command's names and returns the exit status. SPDX-License-Identifier: MIT */
#ifndef COMMANDS_H
#define COMMANDS_H

#include "session.h"

struct command {
    const char *name;
    int (*run)(struct session *session, int argc, char **argv);
    const char *usage; /* the whole help text */
};

extern const struct command compare_command, convert_command, info_command, render_command, synth_command, view_command;

#endif
