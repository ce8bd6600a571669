/* How good the pictures are: every kind of splat against its reference and against the triangles that splats stand for; aliasing;
 * holes. Prints Markdown; scripts/quality puts it into docs/quality.md, which defines the figures.
 *
 *     quality [--quick] [--data DIR] [--out DIR] [tables] [aliasing] [holes]
 *     quality --self-test
 *
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "parts.h"

static const struct part {
    const char *name, *title;
    bool (*run)(struct studio *studio, const struct plan *plan);
} parts[] = {{"tables", "Pictures", quality_tables}, {"aliasing", "Aliasing", quality_aliasing}, {"holes", "Holes", quality_holes}};
enum { PARTS = sizeof parts / sizeof parts[0] };

struct arguments {
    struct plan plan;
    bool is_self_test, wanted[PARTS];
};

static bool parse(int argc, char **argv, struct arguments *arguments) {
    bool any = false;
    for (int i = 1; i < argc; i++) {
        int p = 0;
        while (p < PARTS && strcmp(argv[i], parts[p].name)) p++;
        if (p < PARTS) any = arguments->wanted[p] = true;
        else if (!strcmp(argv[i], "--quick")) arguments->plan.is_quick = true;
        else if (!strcmp(argv[i], "--self-test")) arguments->is_self_test = true;
        else if (!strcmp(argv[i], "--data") && i + 1 < argc) arguments->plan.data = argv[++i];
        else if (!strcmp(argv[i], "--out") && i + 1 < argc) arguments->plan.output = argv[++i];
        else return false;
    }
    for (int p = 0; !any && p < PARTS; p++) arguments->wanted[p] = true;
    return true;
}

static bool run(struct studio *studio, const struct arguments *arguments) {
    if (arguments->is_self_test) return quality_self_test(studio);
    for (int p = 0; p < PARTS; p++) {
        if (!arguments->wanted[p]) continue;
        printf("## %s\n\n", parts[p].title);
        if (!parts[p].run(studio, &arguments->plan)) return false;
        session_progress_end(&studio->session);
    }
    return true;
}

int main(int argc, char **argv) {
    static struct studio studio;
    struct arguments arguments = {.plan = {.data = "../shared/data"}};
    if (!parse(argc, argv, &arguments)) {
        fprintf(stderr, "usage: %s [--quick | --self-test] [--data DIR] [--out DIR] [tables] [aliasing] [holes]\n", argv[0]);
        return STATUS_USAGE;
    }
    const bool done = studio_open(&studio) && run(&studio, &arguments);
    studio_close(&studio);
    return done && fflush(stdout) == 0 ? STATUS_OK : STATUS_FAILED;
}
