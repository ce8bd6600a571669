/* How fast a file of a mesh, or of points, becomes the file of a QSplat tree: the rate that docs/benchmarks.md compares with the
 * original builder's, and its parts, each the least and the median of N rounds in one process.
 *
 *     bench_build FILE OUT.pbr [--threads N] [--rounds 1..999] [--json]
 *
 * SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "median.h"

enum { MOST_ROUNDS = 999 };

/* `TO_POINTS` is of meshes: their radii. */
enum part { READING, TO_POINTS, BUILDING, SAVING, WHOLE, PARTS };
static const char *const names[PARTS] = {"reading", "to_points", "building", "saving", "whole"};

struct arguments {
    const char *in, *out;
    uint32_t threads;
    size_t rounds;
    bool as_json;
};

static double times[PARTS][MOST_ROUNDS]; /* ms */

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e3 * (double)time.tv_sec + 1e-6 * (double)time.tv_nsec;
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user, (void)level;
    fprintf(stderr, "bench_build: %s (%s)\n", text, pbr_result_name(code));
}

static bool parse(int argc, char **argv, struct arguments *arguments) {
    int operands = 0;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--json")) arguments->as_json = true;
        else if (!strcmp(argv[i], "--rounds") && i + 1 < argc) arguments->rounds = strtoull(argv[++i], NULL, 10);
        else if (!strcmp(argv[i], "--threads") && i + 1 < argc) arguments->threads = (uint32_t)atoi(argv[++i]);
        else if (argv[i][0] != '-' && operands == 0 && ++operands) arguments->in = argv[i];
        else if (argv[i][0] != '-' && operands == 1 && ++operands) arguments->out = argv[i];
        else return false;
    }
    return operands == 2 && arguments->rounds >= 1 && arguments->rounds <= MOST_ROUNDS;
}

static bool do_round(pbr_instance *instance, const struct arguments *arguments, size_t round, uint64_t *points_count) {
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod *lod = NULL;
    double at[WHOLE + 1] = {now()};
    pbr_result result = pbr_read_file(instance, arguments->in, NULL, &content);
    at[TO_POINTS] = now();
    if (result == PBR_OK && content.mesh) result = pbr_mesh_to_points(content.mesh, NULL, &content.points);
    at[BUILDING] = now();
    desc.points = content.points;
    if (result == PBR_OK) result = pbr_lod_create(instance, &desc, &lod);
    at[SAVING] = now();
    if (result == PBR_OK) result = pbr_lod_save(lod, arguments->out, PBR_LOD_FILE_PBR, NULL, NULL);
    at[WHOLE] = now();
    for (int part = 0; part < WHOLE; part++) times[part][round] = at[part + 1] - at[part];
    times[WHOLE][round] = at[WHOLE] - at[READING];
    if (result == PBR_OK) result = pbr_lod_get_info(lod, &info);
    *points_count = info.point_count;
    pbr_lod_release(&lod);
    pbr_points_release(&content.points);
    pbr_mesh_release(&content.mesh);
    return result == PBR_OK;
}

static void report(const struct arguments *arguments, uint64_t points) {
    double least[PARTS], middle[PARTS];
    for (int part = 0; part < PARTS; part++) {
        middle[part] = median(times[part], arguments->rounds); /* which sorts them */
        least[part] = times[part][0];
    }
    const double rate = 1e3 * (double)points / least[WHOLE];
    if (arguments->as_json) {
        printf("{\"points\": %" PRIu64 ", \"points_per_s\": %.0f", points, rate);
        for (int part = 0; part < PARTS; part++)
            printf(", \"%s_least_ms\": %.3f, \"%s_median_ms\": %.3f", names[part], least[part], names[part], middle[part]);
        printf("}\n");
        return;
    }
    printf("%" PRIu64 " points, %zu rounds: %.2f M points/s\n\n| | least, ms | median |\n|---|---|---|\n", points,
           arguments->rounds, rate / 1e6);
    for (int part = 0; part < PARTS; part++) printf("| %s | %.1f | %.1f |\n", names[part], least[part], middle[part]);
}

int main(int argc, char **argv) {
    struct arguments arguments = {.rounds = 24};
    if (!parse(argc, argv, &arguments)) {
        fprintf(stderr, "usage: %s FILE OUT.pbr [--threads N] [--rounds 1..%d] [--json]\n", argv[0], MOST_ROUNDS);
        return 2;
    }
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    uint64_t points = 0;
    bool done = true;
    desc.log = print_message;
    desc.thread_count = arguments.threads;
    if (pbr_instance_create(&desc, &instance) != PBR_OK) return 1;
    for (size_t round = 0; round < arguments.rounds && done; round++) done = do_round(instance, &arguments, round, &points);
    if (done) report(&arguments, points);
    pbr_instance_destroy(&instance);
    return done ? 0 : 1;
}
