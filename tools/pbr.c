/* pbr: libpbr on the command line. SPDX-License-Identifier: MIT */
#include <pbr/base.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"

static const struct command *const commands[] = {&info_command, &convert_command, &render_command,
                                                 &view_command, &compare_command, &synth_command};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static const char overview[] = "usage: pbr COMMAND ...\n"
                               "\n"
                               "  pbr info FILE... [--json]             what a file of points, a mesh or a hierarchy holds\n"
                               "  pbr convert IN OUT.pbr|OUT.qs|OUT.ply hierarchies of points, and back\n"
                               "  pbr render IN... -o OUT.png|OUT.exr   a picture of points, without a window\n"
                               "  pbr view IN...                        points in a window\n"
                               "  pbr compare A B [--json]              how far two pictures are apart\n"
                               "  pbr synth KIND N OUT.ply [--mesh]     a surface of exactly N points or triangles\n"
                               "  pbr COMMAND --help                    a command's options\n"
                               "  pbr --version\n"
                               "\n"
                               "Exit status: 0, 1 if something failed, 2 for a usage error. Messages go to stderr, one a line.\n";

static const struct command *find_command(const char *name) {
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (!strcmp(commands[i]->name, name)) return commands[i];
    return NULL;
}

static bool asks_for_help(int argc, char **argv) {
    for (int i = 0; i < argc && strcmp(argv[i], "--"); i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h")) return true;
    return false;
}

static int run(const struct command *command, int argc, char **argv) {
    struct session session;
    if (!session_open(&session)) return STATUS_FAILED;
    int status = command->run(&session, argc, argv);
    session_close(&session);
    return status;
}

/* A full disk shows when the output is flushed. */
static int finish_output(int status) {
    if (fflush(stdout) == 0 && !ferror(stdout)) return status;
    perror("pbr: standard output");
    return STATUS_FAILED;
}

int main(int argc, char **argv) {
    const char *name = argc > 1 ? argv[1] : "";
    const struct command *command = find_command(name);
    if (command && asks_for_help(argc - 2, argv + 2)) {
        fputs(command->usage, stdout);
    } else if (command) {
        return finish_output(run(command, argc - 2, argv + 2));
    } else if (!strcmp(name, "--help") || !strcmp(name, "-h") || !strcmp(name, "help")) {
        fputs(overview, stdout);
    } else if (!strcmp(name, "--version")) {
        uint32_t version = pbr_version();
        printf("pbr %u.%u.%u\n", version / 1000000, version / 1000 % 1000, version % 1000);
    } else {
        if (argc > 1) fprintf(stderr, "pbr: unknown command '%s' (see pbr --help)\n", name);
        else fputs(overview, stderr);
        return STATUS_USAGE;
    }
    return finish_output(STATUS_OK);
}
