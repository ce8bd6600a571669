/* How fast whole frames of libpbr's splats are, compared with plain GL_POINTS of the same data in the same process: one size for
 * all, the smallest shader, no lighting, no culling, points in the order of the file. Every frame is timed from its clear to the
 * end of glFinish. Each measured frame follows a baseline frame at once, and ratios are those of such pairs, so that a machine that
 * slows down slows both. The row "raw again" is the baseline against itself: what differs from 1 there is noise.
 *
 *     bench_splats [FILE | --shuffled] [--curve] [--radius PX] [--only TEXT] [--rounds N] [--gl VERSION] [--json]
 *
 * --radius scales all radii so that the mean on the screen is PX. --only leaves out the rows whose names do not hold TEXT.
 *
 * libpbr draws in an order of its own, along a space-filling curve. With --curve the plain points are put into that order too, so
 * that what is left is the cost of the frame itself. The row "raw in two passes" is then what blended kinds cannot pass:
 * two_passes.h.
 *
 * Speed is raw time / libpbr's time. The aims on the dragon: 0.9 for squares, 0.85 for circles; ellipses 0.6, culled 0.9; gaussian
 * 0.38, culled 0.55; ewa 0.27, culled 0.4; deferred and culled 0.45. SPDX-License-Identifier: MIT */
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "headless.h"
#include "raw_points.h"
#include "two_passes.h"

enum { WIDTH = 1280, HEIGHT = 720, SPHERE_POINTS = 2000000, FEWEST_ROUNDS = 9, MOST_ROUNDS = 999 };

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

struct variant {
    const char *name;
    bool is_raw, is_two_passes;
    uint32_t splat, blending, shading, flags;
    double ms[MOST_ROUNDS], raw_ms[MOST_ROUNDS], speed[MOST_ROUNDS];
};

static struct variant variants[] = {
    {.name = "raw again", .is_raw = true},
    {.name = "raw in two passes", .is_two_passes = true},
    {.name = "square, unlit", .splat = PBR_SPLAT_SQUARE, .shading = PBR_SHADE_NONE},
    {.name = "square, lit", .splat = PBR_SPLAT_SQUARE, .shading = PBR_SHADE_PHONG},
    {.name = "circle, unlit", .splat = PBR_SPLAT_CIRCLE, .shading = PBR_SHADE_NONE},
    {.name = "circle, lit", .splat = PBR_SPLAT_CIRCLE, .shading = PBR_SHADE_PHONG},
    {.name = "circle, lit, culled", .splat = PBR_SPLAT_CIRCLE, .shading = PBR_SHADE_PHONG, .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "ellipse, lit", .splat = PBR_SPLAT_ELLIPSE, .shading = PBR_SHADE_PHONG},
    {.name = "ellipse, lit, culled", .splat = PBR_SPLAT_ELLIPSE, .shading = PBR_SHADE_PHONG, .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "gaussian, lit", .splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_PHONG},
    {.name = "gaussian, lit, culled", .splat = PBR_SPLAT_GAUSSIAN, .shading = PBR_SHADE_PHONG, .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "gaussian, deferred, culled",
     .splat = PBR_SPLAT_GAUSSIAN,
     .shading = PBR_SHADE_DEFERRED,
     .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "ewa, lit", .splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_PHONG},
    {.name = "gaussian, field, culled",
     .splat = PBR_SPLAT_GAUSSIAN,
     .shading = PBR_SHADE_PHONG_FIELD,
     .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "ewa, lit, culled", .splat = PBR_SPLAT_EWA, .shading = PBR_SHADE_PHONG, .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "ewa-max, lit", .splat = PBR_SPLAT_EWA_MAX, .shading = PBR_SHADE_PHONG},
    {.name = "ewa-max, lit, culled", .splat = PBR_SPLAT_EWA_MAX, .shading = PBR_SHADE_PHONG, .flags = PBR_ITEM_CULL_BACK_FACES},
    {.name = "circle, filled", .splat = PBR_SPLAT_CIRCLE, .blending = PBR_BLEND_FILL},
    {.name = "ellipse, filled", .splat = PBR_SPLAT_ELLIPSE, .blending = PBR_BLEND_FILL},
};
enum { VARIANTS = sizeof variants / sizeof variants[0] };

struct bench {
    const char *file; /* NULL = the sphere */
    const char *only; /* NULL = all rows */
    bool as_json, is_es, shuffled, curve;
    uint32_t rounds;
    double radius; /* mean on the screen, pixels; 0 = as it is */
    double radius_scale;
    enum headless_kind context;
    pbr_instance *instance;
    pbr_points *points;
    pbr_points_info info;
    pbr_renderer *renderer;
    pbr_view *view;
    struct headless headless;
    struct raw_points raw;
    struct two_passes two;
    struct camera camera;
    double raw_size;
    GLuint framebuffer, renderbuffers[2];
};

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "bench_splats: %s (%s)\n", text, pbr_result_name(code));
}

/* Points evenly along a spiral on the unit sphere: neighbours in memory are neighbours on the screen, the order that plain points
 * are drawn fastest in. Shuffled, index i stands at place i * 1234567 modulo the count (they are coprime). */
static pbr_result create_sphere(pbr_instance *instance, bool shuffled, pbr_points **out) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    float(*positions)[3] = malloc(SPHERE_POINTS * sizeof *positions);
    uint8_t(*colours)[4] = malloc(SPHERE_POINTS * sizeof *colours);
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; positions && colours && i < SPHERE_POINTS; i++) {
        double place = (double)(shuffled ? i * 1234567 % SPHERE_POINTS : i), y = 1 - (2 * place + 1) / SPHERE_POINTS,
               r = sqrt(1 - y * y);
        double turn = place * 3.14159265358979323846 * (3 - sqrt(5)), p[3] = {r * cos(turn), y, r * sin(turn)};
        for (int k = 0; k < 3; k++) {
            positions[i][k] = (float)p[k];
            colours[i][k] = (uint8_t)(127.5 + 127.5 * p[k]);
        }
        colours[i][3] = 255;
    }
    desc.count = SPHERE_POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = desc.positions;
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 4};
    desc.radius = 0.0016f; /* the spacing sqrt(4 pi / 2e6) is 0.0025; its diagonal half 0.0018 */
    if (positions && colours) result = pbr_points_create(instance, &desc, out);
    free(positions);
    free(colours);
    return result;
}

/* ---- Along a Morton curve ---- */

struct place {
    uint64_t key;
    size_t point;
};

static int compare_places(const void *a, const void *b) {
    const struct place *x = a, *y = b;
    return (x->key > y->key) - (x->key < y->key);
}

/* The cell of a grid of 2^21 cubes along the longest side of the box, its coordinates' bits interleaved. */
static uint64_t curve_key(const double position[3], const pbr_points_info *info) {
    double extent = 0;
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) extent = fmax(extent, info->maximum[k] - info->minimum[k]);
    for (int k = 0; k < 3; k++) {
        const uint64_t cell = extent > 0 ? (uint64_t)((position[k] - info->minimum[k]) / extent * 2097151) : 0;
        for (int bit = 0; bit < 21; bit++) key |= (cell >> bit & 1) << (3 * bit + k);
    }
    return key;
}

/* The attributes of a point set, out and in again in another order. */
struct attributes {
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
};

static pbr_result copy_in_order(struct bench *bench, const struct place *places, struct attributes *from, struct attributes *to,
                                pbr_points **out) {
    const uint64_t count = bench->info.count;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = from->positions[0];
    copy.normals = bench->info.has_normals ? from->normals[0] : NULL;
    copy.colours = bench->info.has_colours ? from->colours[0] : NULL;
    copy.radii = bench->info.has_radii ? from->radii : NULL;
    pbr_result result = pbr_points_copy(bench->points, 0, count, &copy);
    if (result != PBR_OK) return result;
    for (uint64_t i = 0; i < count; i++) {
        const size_t p = places[i].point;
        memcpy(to->positions[i], from->positions[p], sizeof *to->positions);
        memcpy(to->normals[i], from->normals[p], sizeof *to->normals);
        memcpy(to->colours[i], from->colours[p], sizeof *to->colours);
        to->radii[i] = from->radii[p];
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = count;
    desc.positions = (pbr_attribute){to->positions, 0, PBR_FORMAT_FLOAT64, 3};
    if (copy.normals) desc.normals = (pbr_attribute){to->normals, 0, PBR_FORMAT_FLOAT32, 3};
    if (copy.colours) desc.colours = (pbr_attribute){to->colours, 0, PBR_FORMAT_UINT8, 4};
    if (copy.radii) desc.radii = (pbr_attribute){to->radii, 0, PBR_FORMAT_FLOAT32, 1};
    return pbr_points_create(bench->instance, &desc, out);
}

static void free_attributes(struct attributes *attributes) {
    free(attributes->positions);
    free(attributes->normals);
    free(attributes->radii);
    free(attributes->colours);
}

static bool allocate_attributes(struct attributes *attributes, uint64_t count) {
    attributes->positions = calloc(count + 1, sizeof *attributes->positions);
    attributes->normals = calloc(count + 1, sizeof *attributes->normals);
    attributes->radii = calloc(count + 1, sizeof *attributes->radii);
    attributes->colours = calloc(count + 1, sizeof *attributes->colours);
    return attributes->positions && attributes->normals && attributes->radii && attributes->colours;
}

static pbr_result sort_along_curve(struct bench *bench) {
    struct attributes from = {0}, to = {0};
    pbr_points *sorted = NULL;
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    struct place *places = calloc(bench->info.count + 1, sizeof *places);
    if (places && allocate_attributes(&from, bench->info.count) && allocate_attributes(&to, bench->info.count)) {
        pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
        copy.positions = from.positions[0];
        result = pbr_points_copy(bench->points, 0, bench->info.count, &copy);
        for (uint64_t i = 0; i < bench->info.count; i++) places[i] = (struct place){curve_key(from.positions[i], &bench->info), i};
        qsort(places, bench->info.count, sizeof *places, compare_places);
        if (result == PBR_OK) result = copy_in_order(bench, places, &from, &to, &sorted);
    }
    if (result == PBR_OK) {
        pbr_points_release(&bench->points);
        bench->points = sorted;
    }
    free_attributes(&from);
    free_attributes(&to);
    free(places);
    return result;
}

static bool create_framebuffer(struct bench *bench) {
    glGenFramebuffers(1, &bench->framebuffer);
    glGenRenderbuffers(2, bench->renderbuffers);
    glBindFramebuffer(GL_FRAMEBUFFER, bench->framebuffer);
    for (int i = 0; i < 2; i++) {
        glBindRenderbuffer(GL_RENDERBUFFER, bench->renderbuffers[i]);
        glRenderbufferStorage(GL_RENDERBUFFER, i ? GL_DEPTH_COMPONENT24 : GL_RGBA8, WIDTH, HEIGHT);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, i ? GL_DEPTH_ATTACHMENT : GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                                  bench->renderbuffers[i]);
    }
    glViewport(0, 0, WIDTH, HEIGHT);
    return glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static bool set_up(struct bench *bench) {
    const uint32_t size[2] = {WIDTH, HEIGHT};
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    desc.log = print_message;
    pbr_result result = pbr_instance_create(&desc, &bench->instance);
    if (result == PBR_OK && bench->file) result = pbr_read_points(bench->instance, bench->file, NULL, &bench->points);
    if (result == PBR_OK && !bench->file) result = create_sphere(bench->instance, bench->shuffled, &bench->points);
    bench->info = (pbr_points_info)PBR_POINTS_INFO_INIT;
    if (result == PBR_OK) result = pbr_points_get_info(bench->points, &bench->info);
    if (result == PBR_OK && bench->curve) result = sort_along_curve(bench);
    if (result != PBR_OK) return false;
    bench->camera = camera_look(camera_sphere(&bench->info, 1, false), 30, 20, 1, false, (double)bench->info.radius_maximum, size);
    const char *refusal = headless_create(&bench->headless, bench->context, false);
    if (refusal) fprintf(stderr, "bench_splats: %s\n", refusal);
    if (refusal || !create_framebuffer(bench) || !raw_points_create(&bench->raw, bench->points, bench->is_es)) return false;
    if (!bench->is_es && !two_passes_create(&bench->two, WIDTH, HEIGHT)) return false;
    glBindFramebuffer(GL_FRAMEBUFFER, bench->framebuffer);
    bench->radius_scale = 1;
    bench->raw_size = raw_points_mean_size(&bench->raw, &bench->camera, identity, 1);
    /* Not linear: plain points are no smaller than a pixel. */
    for (int i = 0; i < 20 && bench->radius > 0; i++) {
        bench->radius_scale *= 2 * bench->radius / bench->raw_size;
        bench->raw_size = raw_points_mean_size(&bench->raw, &bench->camera, identity, bench->radius_scale);
    }
    result = pbr_renderer_create(bench->instance, NULL, &bench->renderer);
    return result == PBR_OK && pbr_view_create(bench->renderer, NULL, &bench->view) == PBR_OK;
}

static void tear_down(struct bench *bench) {
    pbr_view_destroy(&bench->view);
    pbr_renderer_destroy(&bench->renderer);
    if (bench->headless.context) {
        raw_points_destroy(&bench->raw);
        if (!bench->is_es) two_passes_destroy(&bench->two);
        glDeleteFramebuffers(1, &bench->framebuffer);
        glDeleteRenderbuffers(2, bench->renderbuffers);
        headless_destroy(&bench->headless);
    }
    pbr_points_release(&bench->points);
    pbr_instance_destroy(&bench->instance);
}

static void begin_frame(void) {
    glDepthMask(GL_TRUE);
    glClearColor(0.1f, 0.1f, 0.12f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

/* Milliseconds of one frame; negative if libpbr failed. */
static double draw_variant(struct bench *bench, const struct variant *variant) {
    pbr_result result = PBR_OK;
    double start = seconds();
    begin_frame();
    if (variant->is_raw) {
        raw_points_draw(&bench->raw, &bench->camera, identity, bench->raw_size, bench->is_es);
    } else if (variant->is_two_passes) {
        two_passes_draw(&bench->two, &bench->raw, &bench->camera, identity, bench->raw_size, bench->framebuffer);
    } else {
        pbr_frame frame = PBR_FRAME_INIT;
        pbr_item item = PBR_ITEM_INIT;
        memcpy(frame.view, bench->camera.view, sizeof frame.view);
        memcpy(frame.projection, bench->camera.projection, sizeof frame.projection);
        item.points = bench->points;
        item.splat = variant->splat;
        item.blending = variant->blending;
        item.radius_scale = (float)bench->radius_scale;
        item.shading = variant->shading;
        item.flags = variant->flags;
        result = pbr_render(bench->view, &frame, &item, 1, NULL);
    }
    glFinish();
    return result == PBR_OK ? 1e3 * (seconds() - start) : -1;
}

static bool is_wanted(const struct bench *bench, int v) {
    return (!bench->only || strstr(variants[v].name, bench->only)) && !(variants[v].is_two_passes && bench->is_es);
}

/* Round -1 warms up: programs, uploads, caches. */
static bool measure(struct bench *bench) {
    const struct variant *raw = &variants[0];
    for (int round = -1; round < (int)bench->rounds; round++)
        for (int v = 0; v < VARIANTS; v++) {
            if (!is_wanted(bench, v)) continue;
            double raw_ms = draw_variant(bench, raw), ms = draw_variant(bench, &variants[v]);
            if (ms < 0) return false;
            if (round < 0) continue;
            variants[v].ms[round] = ms;
            variants[v].raw_ms[round] = raw_ms;
            variants[v].speed[round] = raw_ms / ms;
        }
    return glGetError() == GL_NO_ERROR;
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Element at a share of the sorted values: 0.5 the median, 0.25 and 0.75 the quartiles. */
static double quantile(const double *sorted, uint32_t count, double share) {
    return sorted[(uint32_t)(share * (count - 1) + 0.5)];
}

static void print_table(const struct bench *bench) {
    printf("%s, %s\n", (const char *)glGetString(GL_RENDERER), (const char *)glGetString(GL_VERSION));
    printf("%s: %llu points, %dx%d, mean splat %.2f px, %u rounds%s\n\n",
           bench->file       ? bench->file
           : bench->shuffled ? "shuffled sphere"
                             : "sphere",
           (unsigned long long)bench->info.count, WIDTH, HEIGHT, bench->raw_size, (unsigned)bench->rounds,
           bench->curve ? ", plain points in libpbr's order" : "");
    printf("%-24s %10s %10s %12s %8s   %s\n", "", "raw ms", "ms", "M points/s", "speed", "middle half");
    for (int v = 0; v < VARIANTS; v++) {
        const struct variant *variant = &variants[v];
        if (!is_wanted(bench, v)) continue;
        double ms = quantile(variant->ms, bench->rounds, 0.5);
        printf("%-24s %10.2f %10.2f %12.2f %8.3f   %.3f .. %.3f\n", variant->name, quantile(variant->raw_ms, bench->rounds, 0.5),
               ms, 1e-3 * (double)bench->info.count / ms, quantile(variant->speed, bench->rounds, 0.5),
               quantile(variant->speed, bench->rounds, 0.25), quantile(variant->speed, bench->rounds, 0.75));
    }
}

/* A driver's name, fit for a JSON string. */
static void print_plain(const char *text) {
    for (; text && *text; text++) putchar(*text == '"' || *text == '\\' || (unsigned char)*text < 0x20 ? ' ' : *text);
}

static void print_json(const struct bench *bench) {
    printf("{\n  \"gl_renderer\": \"");
    print_plain((const char *)glGetString(GL_RENDERER));
    printf("\",\n  \"points\": %llu,\n  \"width\": %d,\n  \"height\": %d,\n  \"mean_splat_px\": %.3f,\n  \"rounds\": %u,\n  "
           "\"variants\": [",
           (unsigned long long)bench->info.count, WIDTH, HEIGHT, bench->raw_size, (unsigned)bench->rounds);
    const char *comma = "";
    for (int v = 0; v < VARIANTS; v++) {
        const struct variant *variant = &variants[v];
        if (!is_wanted(bench, v)) continue;
        printf("%s\n    {\"name\": \"%s\", \"frame_ms\": %.4f, \"raw_frame_ms\": %.4f, \"speed_vs_raw\": %.4f, "
               "\"speed_low_quartile\": %.4f, "
               "\"speed_high_quartile\": %.4f}",
               comma, variant->name, quantile(variant->ms, bench->rounds, 0.5), quantile(variant->raw_ms, bench->rounds, 0.5),
               quantile(variant->speed, bench->rounds, 0.5), quantile(variant->speed, bench->rounds, 0.25),
               quantile(variant->speed, bench->rounds, 0.75));
        comma = ",";
    }
    printf("\n  ]\n}\n");
}

static bool parse_arguments(int argc, char **argv, struct bench *bench) {
    bench->rounds = 11;
    bench->context = HEADLESS_GL_45;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--json")) bench->as_json = true;
        else if (!strcmp(argv[i], "--shuffled")) bench->shuffled = true;
        else if (!strcmp(argv[i], "--curve")) bench->curve = true;
        else if (!strcmp(argv[i], "--rounds") && i + 1 < argc) bench->rounds = (uint32_t)strtoul(argv[++i], NULL, 10);
        else if (!strcmp(argv[i], "--radius") && i + 1 < argc) bench->radius = strtod(argv[++i], NULL);
        else if (!strcmp(argv[i], "--only") && i + 1 < argc) bench->only = argv[++i];
        else if (!strcmp(argv[i], "--gl") && i + 1 < argc && headless_kind_parse(argv[i + 1], &bench->context)) i++;
        else if (argv[i][0] != '-' && !bench->file) bench->file = argv[i];
        else return false;
    }
    bench->is_es = headless_kind_is_es(bench->context);
    return bench->radius >= 0 && bench->rounds >= FEWEST_ROUNDS && bench->rounds <= MOST_ROUNDS;
}

int main(int argc, char **argv) {
    static struct bench bench;
    if (!parse_arguments(argc, argv, &bench)) {
        fprintf(stderr,
                "usage: %s [FILE | --shuffled] [--curve] [--radius PX] [--only TEXT] [--rounds 9..999] "
                "[--gl 3.3|4.5|compat|es3.0|es3.2] [--json]\n",
                argv[0]);
        return 2;
    }
    bool done = set_up(&bench) && measure(&bench);
    for (int v = 0; done && v < VARIANTS; v++) {
        qsort(variants[v].ms, bench.rounds, sizeof(double), compare_doubles);
        qsort(variants[v].raw_ms, bench.rounds, sizeof(double), compare_doubles);
        qsort(variants[v].speed, bench.rounds, sizeof(double), compare_doubles);
    }
    if (!done) fprintf(stderr, "bench_splats: failed\n");
    else if (bench.as_json) print_json(&bench);
    else print_table(&bench);
    tear_down(&bench);
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
