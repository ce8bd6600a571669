/* Builds a hierarchy of any number of points that are made as they are read: a bumpy ball, evenly covered. bench/billion goes on
 * from there.
 *
 *     bench_billion N OUT.pbr [--memory MB] [--threads N] [--json]
 *
 * SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>
#include <pbr/pbr.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

static const double PI = 3.14159265358979323846;

struct arguments {
    double count;
    const char *out;
    uint64_t memory_mb;
    uint32_t threads;
    bool as_json;
};

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user, (void)level;
    fprintf(stderr, "bench_billion: %s (%s)\n", text, pbr_result_name(code));
}

/* The surface at a direction: its distance from the centre, and its normal, which is the gradient of |p| - h(p / |p|). */
static double bumps(const double d[3], float normal[3]) {
    static const struct {
        double height, k[3];
    } waves[] = {{0.05, {9, 7, 5}}, {0.02, {-23, 17, 11}}, {0.004, {71, -59, 83}}, {0.0005, {310, 270, -290}}};
    double h = 1, slope[3] = {0, 0, 0}, along = 0, n[3], length = 0;
    for (size_t i = 0; i < sizeof waves / sizeof *waves; i++) {
        const double *k = waves[i].k, phase = k[0] * d[0] + k[1] * d[1] + k[2] * d[2];
        h += waves[i].height * sin(phase);
        for (int c = 0; c < 3; c++) slope[c] += waves[i].height * cos(phase) * k[c];
    }
    for (int c = 0; c < 3; c++) along += slope[c] * d[c];
    for (int c = 0; c < 3; c++) {
        n[c] = d[c] - (slope[c] - along * d[c]) / h;
        length += n[c] * n[c];
    }
    for (int c = 0; c < 3; c++) normal[c] = (float)(n[c] / sqrt(length));
    return h;
}

/* Evenly along a spiral. Discs of 3 N^-1/2 close the unit sphere; slopes draw the spiral out by 1 / (normal . d). */
static pbr_result make_points(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    const struct arguments *arguments = user;
    const double golden = PI * (3 - sqrt(5)), radius = 3 / sqrt(arguments->count);
    for (uint64_t i = 0; i < count; i++) {
        const double place = (double)(first + i) + 0.5, z = 1 - 2 * place / arguments->count, side = sqrt(1 - z * z);
        const double turn = fmod(golden * place, 2 * PI), d[3] = {side * cos(turn), z, side * sin(turn)};
        float *normal = batch->normals + 3 * i;
        const double h = bumps(d, normal);
        batch->radii[i] = (float)(radius * h / ((double)normal[0] * d[0] + (double)normal[1] * d[1] + (double)normal[2] * d[2]));
        for (int c = 0; c < 3; c++) {
            batch->positions[3 * i + (uint64_t)c] = h * d[c];
            batch->colours[4 * i + (uint64_t)c] = (uint8_t)(150 + 60 * d[c] + 600 * (h - 1));
        }
    }
    return PBR_OK;
}

static bool parse(int argc, char **argv, struct arguments *arguments) {
    int operands = 0;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--json")) arguments->as_json = true;
        else if (!strcmp(argv[i], "--memory") && i + 1 < argc) arguments->memory_mb = strtoull(argv[++i], NULL, 10);
        else if (!strcmp(argv[i], "--threads") && i + 1 < argc) arguments->threads = (uint32_t)atoi(argv[++i]);
        else if (argv[i][0] != '-' && operands == 0 && ++operands) arguments->count = floor(atof(argv[i]));
        else if (argv[i][0] != '-' && operands == 1 && ++operands) arguments->out = argv[i];
        else return false;
    }
    return operands == 2 && arguments->count >= 1 && arguments->count <= 1e12;
}

static bool report(pbr_instance *instance, const struct arguments *arguments, double time) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod *lod = NULL;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    const double start = seconds();
    if (pbr_lod_open(instance, arguments->out, NULL, &lod) != PBR_OK) return false;
    const double open_ms = 1e3 * (seconds() - start);
    pbr_lod_get_info(lod, &info);
    pbr_lod_release(&lod);
    const double points = (double)info.point_count;
    printf(arguments->as_json ? "{\"points\": %" PRIu64 ", \"build_s\": %.2f, \"points_per_s\": %.0f, \"bytes_per_point\": %.3f, "
                                "\"peak_rss_mb\": %.0f, \"open_ms\": %.3f}\n"
                              : "%" PRIu64
                                " points in %.2f s, %.0f a second; %.3f bytes a point; at most %.0f MB in memory; opened in "
                                "%.3f ms\n",
           info.point_count, time, points / time, (double)info.data_bytes / points, (double)usage.ru_maxrss / 1024, open_ms);
    return info.point_count == (uint64_t)arguments->count;
}

int main(int argc, char **argv) {
    struct arguments arguments = {.memory_mb = 1024};
    if (!parse(argc, argv, &arguments)) {
        fprintf(stderr, "usage: %s N OUT.pbr [--memory MB] [--threads N] [--json]\n", argv[0]);
        return 2;
    }
    pbr_instance_desc instance_desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    pbr_lod_build_desc desc = PBR_LOD_BUILD_DESC_INIT;
    instance_desc.log = print_message;
    instance_desc.thread_count = arguments.threads;
    if (pbr_instance_create(&instance_desc, &instance) != PBR_OK) return 1;
    desc.point_count = (uint64_t)arguments.count;
    desc.source = make_points;
    desc.source_user = &arguments;
    desc.flags = PBR_LOD_BUILD_COLOURS;
    desc.memory_bytes = arguments.memory_mb << 20;
    for (int k = 0; k < 3; k++) desc.minimum[k] = -1.1, desc.maximum[k] = 1.1;
    const double start = seconds();
    const bool done =
        pbr_lod_build_file(instance, &desc, arguments.out) == PBR_OK && report(instance, &arguments, seconds() - start);
    pbr_instance_destroy(&instance);
    return done ? 0 : 1;
}
