/* What sequential point trees cost and gain, beside the same points without one: building, drawing, what the vertex stage drops,
 * and what pbr_render costs the CPU. Prints Markdown tables.
 *
 *     bench_trees [FILE | torus:N]... [--up y|z] [--splat KIND] [--size WxH] [--rounds N] [--frames N] [--leaf-points N]
 *                 [--only TABLE] [--json]
 *
 * Default: torus:200000. Each frame of a tree is timed next to one of its points, from the clear to the end of glFinish; ratios are
 * those of such pairs, medians of N rounds, so that a machine that slows down slows both. Views are around the bounding sphere as
 * pbr render --view 30,20,ZOOM: near 2, whole 1, far 0.3. TABLE is build, draw, drop, select (of blended kinds: entries tested
 * once, by a compute shader, against tested in every pass) or cpu. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <malloc.h>
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "camera.h"
#include "headless.h"
#include "json.h"
#include "kinds.h"
#include "median.h"
#include "surface.h"
#include "target.h"
#include "trees/gl_calls.h"
#include "trees/kept.h"

enum { THRESHOLDS = 4, PLACES = 3, MOST_MODELS = 16, MOST_ROUNDS = 999, BUILDS = 3 };

static const double thresholds[THRESHOLDS] = {0.5, 1, 2, 4};
static const struct place {
    const char *name;
    double zoom;
} places[PLACES] = {{"near", 2}, {"whole", 1}, {"far", 0.3}};
static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
static const float background[4] = {0.1f, 0.1f, 0.12f, 1};

/* Of the heap, as an allocator of libpbr's. */
struct meter {
    atomic_size_t now, most;
};

struct building {
    double ms[2]; /* on one thread, on all */
    uint64_t nodes, bytes;
    size_t heap; /* most beyond what was there before */
};

struct drawing {
    double points_ms, tree_ms; /* medians */
    double speed;              /* points' time / the tree's */
    double selecting;          /* the tree's time without compute shaders / with */
    struct kept kept;
};

/* A kind of frame whose cost to the CPU is measured. */
enum { CPU_EMPTY, CPU_POINTS, CPU_STILL, CPU_MOVING, CPU_FRAMES };
static const char *const cpu_names[CPU_FRAMES] = {"nothing", "points, moving", "tree, still", "tree, moving"};
struct cpu {
    double own_us, state_us, cut_us; /* medians */
    uint64_t calls, asking, working; /* of the last frame */
};

struct model {
    char name[64];
    pbr_points *points;
    pbr_points_info info;
    pbr_lod *tree;
    struct building building;
    struct drawing drawings[PLACES][THRESHOLDS];
    struct cpu cpu[CPU_FRAMES];
    uint32_t chunks;
};

struct bench {
    const char *inputs[MOST_MODELS], *only;
    uint32_t input_count, rounds, frames, leaf_points, splat, size[2];
    bool z_up, as_json;
    struct meter meter;
    pbr_instance *instance, *single; /* with all threads, with one */
    struct headless headless;
    struct target target;
    pbr_renderer *renderer, *counted, *asking; /* as it is; through gl_calls.h; without compute shaders */
    pbr_view *view, *counted_view, *asking_view;
    struct model models[MOST_MODELS];
};

/* ---- An allocator that knows how much it gave ---- */

static void *metered_allocate(void *user, size_t size, size_t alignment) {
    struct meter *meter = user;
    void *memory = NULL;
    if (posix_memalign(&memory, alignment < sizeof(void *) ? sizeof(void *) : alignment, size) != 0) return NULL;
    const size_t given = malloc_usable_size(memory), now = atomic_fetch_add(&meter->now, given) + given;
    size_t most = atomic_load(&meter->most);
    while (now > most && !atomic_compare_exchange_weak(&meter->most, &most, now)) {
    }
    return memory;
}

static void metered_release(void *user, void *memory) {
    struct meter *meter = user;
    atomic_fetch_sub(&meter->now, malloc_usable_size(memory));
    free(memory);
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "bench_trees: %s (%s)\n", text, pbr_result_name(code));
}

static bool create_instance(struct bench *bench, uint32_t thread_count, pbr_instance **out) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    desc.log = print_message;
    desc.allocate = metered_allocate;
    desc.release = metered_release;
    desc.memory_user = &bench->meter;
    desc.thread_count = thread_count;
    return pbr_instance_create(&desc, out) == PBR_OK;
}

/* ---- Models ---- */

static pbr_result create_torus(pbr_instance *instance, uint64_t count, pbr_points **out) {
    const struct surface torus = {.kind = SURFACE_TORUS};
    struct surface_point *points = malloc(count * sizeof *points);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    if (!points) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < count; i++) points[i] = surface_spread(&torus, i, count);
    desc.count = count;
    desc.positions = (pbr_attribute){points->position, sizeof *points, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){points->normal, sizeof *points, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){points->colour, sizeof *points, PBR_FORMAT_UINT8, 4};
    desc.radii = (pbr_attribute){&points->radius, sizeof *points, PBR_FORMAT_FLOAT32, 1};
    const pbr_result result = pbr_points_create(instance, &desc, out);
    free(points);
    return result;
}

/* A file's name without folder and ending. */
static void name_model(const char *input, struct model *model) {
    const char *slash = strrchr(input, '/');
    snprintf(model->name, sizeof model->name, "%s", slash ? slash + 1 : input);
    char *dot = strrchr(model->name, '.');
    if (dot && dot > model->name) *dot = 0;
}

static bool load(struct bench *bench, const char *input, struct model *model) {
    const uint64_t count = strncmp(input, "torus:", 6) ? 0 : strtoull(input + 6, NULL, 10);
    name_model(input, model);
    const pbr_result result = count > 0 ? create_torus(bench->instance, count, &model->points)
                                        : pbr_read_points(bench->instance, input, NULL, &model->points);
    model->info = (pbr_points_info)PBR_POINTS_INFO_INIT;
    return result == PBR_OK && pbr_points_get_info(model->points, &model->info) == PBR_OK && model->info.count > 0;
}

/* ---- Building ---- */

static bool build_once(pbr_instance *instance, uint32_t leaf_points, struct model *model, double *ms) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    desc.kind = PBR_LOD_SPT;
    desc.points = model->points;
    desc.leaf_points = leaf_points;
    const double start = gl_calls_seconds();
    const bool built = pbr_lod_create(instance, &desc, &model->tree) == PBR_OK;
    *ms = 1e3 * (gl_calls_seconds() - start);
    return built;
}

/* The last one built is what is drawn. */
static bool build(struct bench *bench, struct model *model) {
    pbr_instance *const instances[2] = {bench->single, bench->instance};
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    for (int i = 0; i < 2; i++) {
        double ms[BUILDS];
        for (int k = 0; k < BUILDS; k++) {
            pbr_lod_release(&model->tree);
            const size_t before = atomic_load(&bench->meter.now);
            atomic_store(&bench->meter.most, before);
            if (!build_once(instances[i], bench->leaf_points, model, &ms[k])) return false;
            model->building.heap = atomic_load(&bench->meter.most) - before;
        }
        model->building.ms[i] = median(ms, BUILDS);
    }
    if (pbr_lod_get_info(model->tree, &info) != PBR_OK) return false;
    model->building.bytes = info.data_bytes;
    const bool measured = pbr_lod_measure(model->tree, NULL, NULL, &statistics) == PBR_OK;
    model->building.nodes = statistics.nodes;
    return measured;
}

/* ---- Drawing ---- */

static const double *model_matrix(const struct bench *bench) {
    return bench->z_up ? camera_z_up : identity;
}

static struct camera look(const struct bench *bench, const struct model *model, double yaw, double zoom) {
    return camera_look(camera_sphere(&model->info, 1, bench->z_up), yaw, 20, zoom, false, (double)model->info.radius_maximum,
                       bench->size);
}

enum what { NOTHING, POINTS, TREE };

static bool render(const struct bench *bench, pbr_view *view, const struct model *model, const struct camera *camera,
                   enum what what, double threshold, pbr_stats *stats) {
    pbr_frame frame = PBR_FRAME_INIT;
    pbr_item item = PBR_ITEM_INIT;
    memcpy(frame.view, camera->view, sizeof frame.view);
    memcpy(frame.projection, camera->projection, sizeof frame.projection);
    for (int k = 0; k < 2; k++) frame.viewport[2 + k] = (int32_t)bench->size[k];
    frame.threshold = (float)threshold;
    frame.flags = PBR_FRAME_WAIT;
    item.id = what;
    if (what == POINTS) item.points = model->points;
    else item.lod = model->tree;
    item.transforms = model_matrix(bench);
    item.transform_count = 1;
    item.splat = bench->splat;
    *stats = (pbr_stats)PBR_STATS_INIT;
    return pbr_render(view, &frame, &item, what == NOTHING ? 0 : 1, stats) == PBR_OK;
}

/* Milliseconds from the clear to the end of the GPU's work; negative if libpbr failed. */
static double draw(const struct bench *bench, pbr_view *view, const struct model *model, const struct camera *camera,
                   enum what what, double threshold) {
    pbr_stats stats;
    const double start = gl_calls_seconds();
    target_clear(&bench->target, background);
    const bool drawn = render(bench, view, model, camera, what, threshold, &stats);
    glFinish();
    return drawn ? 1e3 * (gl_calls_seconds() - start) : -1;
}

/* Round -1 warms up: programs, uploads, caches. */
static bool time_drawing(const struct bench *bench, const struct model *model, const struct camera *camera, double threshold,
                         struct drawing *drawing) {
    double points_ms[MOST_ROUNDS], tree_ms[MOST_ROUNDS], speed[MOST_ROUNDS];
    for (int round = -1; round < (int)bench->rounds; round++) {
        const double points = draw(bench, bench->view, model, camera, POINTS, threshold);
        const double tree = draw(bench, bench->view, model, camera, TREE, threshold);
        if (points < 0 || tree < 0) return false;
        if (round < 0) continue;
        points_ms[round] = points;
        tree_ms[round] = tree;
        speed[round] = points / tree;
    }
    drawing->points_ms = median(points_ms, bench->rounds);
    drawing->tree_ms = median(tree_ms, bench->rounds);
    drawing->speed = median(speed, bench->rounds);
    return true;
}

/* Likewise. */
static bool time_selecting(const struct bench *bench, const struct model *model, const struct camera *camera, double threshold,
                           struct drawing *drawing) {
    double ratio[MOST_ROUNDS];
    for (int round = -1; round < (int)bench->rounds; round++) {
        const double asking = draw(bench, bench->asking_view, model, camera, TREE, threshold);
        const double selecting = draw(bench, bench->view, model, camera, TREE, threshold);
        if (asking < 0 || selecting < 0) return false;
        if (round >= 0) ratio[round] = asking / selecting;
    }
    drawing->selecting = median(ratio, bench->rounds);
    return true;
}

static bool is_wanted(const struct bench *bench, const char *table) {
    if (!strcmp(table, "select") && bench->splat < PBR_SPLAT_GAUSSIAN) return false; /* there is one pass */
    return !bench->only || !strcmp(bench->only, table);
}

static bool measure_views(const struct bench *bench, struct model *model) {
    for (int p = 0; p < PLACES; p++) {
        const struct camera camera = look(bench, model, 30, places[p].zoom);
        for (int t = 0; t < THRESHOLDS; t++) {
            struct drawing *drawing = &model->drawings[p][t];
            if (is_wanted(bench, "draw") && !time_drawing(bench, model, &camera, thresholds[t], drawing)) return false;
            if (is_wanted(bench, "select") && !time_selecting(bench, model, &camera, thresholds[t], drawing)) return false;
            if (is_wanted(bench, "drop") &&
                !kept_count(bench->instance, model->tree, &camera, model_matrix(bench), bench->size, thresholds[t], &drawing->kept))
                return false;
            if (drawing->kept.missed > 0) {
                fprintf(stderr, "bench_trees: %s: %" PRIu64 " entries are not handed over that would be drawn\n", model->name,
                        drawing->kept.missed);
                return false;
            }
        }
    }
    return true;
}

/* ---- The CPU's time ---- */

/* One frame, on an idle GPU; microseconds without what OpenGL took to answer, or negative. */
static double cpu_frame(const struct bench *bench, const struct model *model, int kind, uint32_t number, enum gl_passage passage,
                        pbr_stats *stats, struct gl_calls *calls) {
    const double yaw = kind == CPU_POINTS || kind == CPU_MOVING ? 30 + 0.25 * number : 30;
    const struct camera camera = look(bench, model, yaw, 1);
    const enum what what = kind == CPU_EMPTY ? NOTHING : kind == CPU_POINTS ? POINTS : TREE;
    target_clear(&bench->target, background);
    glFinish();
    gl_calls_begin(passage);
    const double start = gl_calls_seconds();
    const bool drawn = render(bench, bench->counted_view, model, &camera, what, 1, stats);
    const double seconds = gl_calls_seconds() - start;
    *calls = gl_calls_end();
    return drawn ? 1e6 * (seconds - calls->asking_seconds) : -1;
}

/* All that is drawn lies on the GPU before: the whole model is in view, and a frame is drawn in full first. */
static bool measure_cpu(const struct bench *bench, const struct model *model, int kind, struct cpu *cpu) {
    double *us = calloc(2 * (size_t)bench->frames, sizeof *us), *cut_us = calloc(bench->frames, sizeof *cut_us);
    pbr_stats stats;
    struct gl_calls calls;
    bool done = us && cut_us && cpu_frame(bench, model, kind, 0, GL_PASS_ALL, &stats, &calls) >= 0;
    for (int half = 0; half < 2; half++)
        for (uint32_t i = 0; done && i < bench->frames; i++) {
            double *value = &us[half * bench->frames + i];
            *value = cpu_frame(bench, model, kind, i, half ? GL_PASS_STATE : GL_PASS_ASKING, &stats, &calls);
            cut_us[i] = 1e6 * stats.cut_seconds;
            done = *value >= 0 && stats.upload_bytes == 0 && stats.programs_compiled == 0;
            if (!done) fprintf(stderr, "bench_trees: a frame of %s sent or compiled something\n", cpu_names[kind]);
        }
    if (done)
        *cpu = (struct cpu){median(us, bench->frames),
                            median(us + bench->frames, bench->frames),
                            median(cut_us, bench->frames),
                            calls.all,
                            calls.asking,
                            calls.working};
    free(us);
    free(cut_us);
    return done;
}

/* ---- All of it ---- */

static void *get_no_compute(void *user, const char *name) {
    return strcmp(name, "glDispatchCompute") ? headless_get_proc(user, name) : NULL;
}

static bool set_up(struct bench *bench) {
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT, asking = PBR_RENDERER_DESC_INIT;
    desc.get_proc_address = gl_calls_get_proc;
    asking.get_proc_address = get_no_compute;
    if (!create_instance(bench, 0, &bench->instance) || !create_instance(bench, 1, &bench->single)) return false;
    const char *refusal = headless_create(&bench->headless, HEADLESS_GL_45, false);
    if (!refusal) refusal = target_create(&bench->target, bench->size, 1, false, false);
    if (refusal) fprintf(stderr, "bench_trees: %s\n", refusal);
    return !refusal && pbr_renderer_create(bench->instance, NULL, &bench->renderer) == PBR_OK &&
           pbr_view_create(bench->renderer, NULL, &bench->view) == PBR_OK &&
           pbr_renderer_create(bench->instance, &desc, &bench->counted) == PBR_OK &&
           pbr_view_create(bench->counted, NULL, &bench->counted_view) == PBR_OK &&
           pbr_renderer_create(bench->instance, &asking, &bench->asking) == PBR_OK &&
           pbr_view_create(bench->asking, NULL, &bench->asking_view) == PBR_OK;
}

static void evict(struct bench *bench) {
    pbr_renderer *const renderers[3] = {bench->renderer, bench->counted, bench->asking};
    for (int i = 0; i < 3; i++) {
        pbr_renderer_evict(renderers[i], NULL);
        pbr_renderer_evict_lod(renderers[i], NULL);
    }
}

static void tear_down(struct bench *bench) {
    pbr_view_destroy(&bench->view);
    pbr_view_destroy(&bench->counted_view);
    pbr_view_destroy(&bench->asking_view);
    pbr_renderer_destroy(&bench->renderer);
    pbr_renderer_destroy(&bench->counted);
    pbr_renderer_destroy(&bench->asking);
    if (bench->headless.context) {
        target_destroy(&bench->target);
        headless_destroy(&bench->headless);
    }
    pbr_instance_destroy(&bench->single);
    pbr_instance_destroy(&bench->instance);
}

static bool measure(struct bench *bench, struct model *model, const char *input) {
    bool done = load(bench, input, model) && build(bench, model) && measure_views(bench, model);
    for (int kind = 0; done && is_wanted(bench, "cpu") && kind < CPU_FRAMES; kind++)
        done = measure_cpu(bench, model, kind, &model->cpu[kind]);
    if (!done) fprintf(stderr, "bench_trees: %s: failed\n", input);
    evict(bench);
    pbr_lod_release(&model->tree);
    pbr_points_release(&model->points);
    return done && glGetError() == GL_NO_ERROR;
}

/* ---- Tables ---- */

static double per_point(const struct model *model, double amount) {
    return amount / (double)model->info.count;
}

static void print_building(const struct bench *bench) {
    puts("\n| built | points | 1 thread | all threads | points/s | nodes a point | bytes a point | most heap, bytes a point |");
    puts("|---|---|---|---|---|---|---|---|");
    for (uint32_t m = 0; m < bench->input_count; m++) {
        const struct model *model = &bench->models[m];
        const struct building *building = &model->building;
        printf("| %s | %" PRIu64 " | %.1f ms | %.1f ms | %.2f M | %.2f | %.1f | %.1f |\n", model->name, model->info.count,
               building->ms[0], building->ms[1], 1e-3 * (double)model->info.count / building->ms[1],
               per_point(model, (double)building->nodes), per_point(model, (double)building->bytes),
               per_point(model, (double)building->heap));
    }
}

/* A line for each model and place, whose cells print_cell prints, one for each threshold from `first` on. -1: the points alone. */
static void print_views(const struct bench *bench, const char *title, int first,
                        void (*print_cell)(const struct model *model, int p, int t)) {
    printf("\n| %s |", title);
    for (int t = first; t < THRESHOLDS; t++) t < 0 ? printf(" points |") : printf(" %g px |", thresholds[t]);
    printf("\n|---|");
    for (int t = first; t < THRESHOLDS; t++) printf("---|");
    putchar('\n');
    for (uint32_t m = 0; m < bench->input_count; m++)
        for (int p = 0; p < PLACES; p++) {
            printf("| %s, %s |", bench->models[m].name, places[p].name);
            for (int t = first; t < THRESHOLDS; t++) print_cell(&bench->models[m], p, t);
            putchar('\n');
        }
}

static double millions_a_second(const struct model *model, double ms) {
    return 1e-3 * (double)model->info.count / ms;
}

static void print_speed(const struct model *model, int p, int t) {
    const struct drawing *drawing = &model->drawings[p][t < 0 ? 0 : t];
    const double ms = t < 0 ? drawing->points_ms : drawing->tree_ms;
    if (t >= 0) printf(" %.2f x:", drawing->speed);
    printf(" %.3g/s, %.3g M |", 1e3 / ms, millions_a_second(model, ms));
}

static void print_dropped(const struct model *model, int p, int t) {
    const struct kept *kept = &model->drawings[p][t].kept;
    printf(" %.3g %%, %.0f %%, %.1f %% |", 100 * per_point(model, (double)kept->handed),
           kept->handed ? 100 - 100 * (double)kept->kept / (double)kept->handed : 0,
           kept->kept ? 100 * (double)kept->twice / (double)kept->kept : 0);
}

static void print_selecting(const struct model *model, int p, int t) {
    printf(" %.2f x |", model->drawings[p][t].selecting);
}

static void print_cpu(const struct bench *bench) {
    puts("\n| a frame of | libpbr's own | and OpenGL's state | of it finding ranges | calls | that tell | that draw |");
    puts("|---|---|---|---|---|---|---|");
    for (uint32_t m = 0; m < bench->input_count; m++)
        for (int kind = 0; kind < CPU_FRAMES; kind++) {
            const struct cpu *cpu = &bench->models[m].cpu[kind];
            printf("| %s: %s | %.1f us | %.1f us | %.1f us | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " |\n", bench->models[m].name,
                   cpu_names[kind], cpu->own_us, cpu->state_us, cpu->cut_us, cpu->calls, cpu->asking, cpu->working);
        }
}

static void print_tables(const struct bench *bench) {
    printf("%s, %s; %" PRIu32 "x%" PRIu32 ", %s, medians of %" PRIu32 " rounds\n", (const char *)glGetString(GL_RENDERER),
           (const char *)glGetString(GL_VERSION), bench->size[0], bench->size[1], kind_name(splat_kinds, bench->splat),
           bench->rounds);
    if (is_wanted(bench, "build")) print_building(bench);
    if (is_wanted(bench, "draw")) {
        puts("\nFrames and millions of the model's points a second; of trees also how many times as fast as the points.");
        print_views(bench, "drawn", -1, print_speed);
    }
    if (is_wanted(bench, "drop")) {
        puts(
            "\nEntries handed to the vertex stage, of the points; what share of them it drops, by the test that it is held to; and "
            "what\nshare of the rest is drawn only since depths differ between nodes and their parents.");
        print_views(bench, "handed over, dropped, twice", 0, print_dropped);
    }
    if (is_wanted(bench, "select")) {
        puts("\nHow many times as fast a tree is drawn where its entries are tested once as where each pass tests them.");
        print_views(bench, "selected once", 0, print_selecting);
    }
    if (!is_wanted(bench, "cpu")) return;
    printf("\nThe CPU's time in pbr_render, the whole model at 1 px, medians of %" PRIu32 " frames. Own: calls of OpenGL return at "
           "once, or their time\ndoes not count where they tell something. State: all calls but those that draw, clear, compute or "
           "copy.\n",
           bench->frames);
    print_cpu(bench);
}

static void put_view(struct json *json, const struct model *model, int p, int t) {
    const struct drawing *drawing = &model->drawings[p][t];
    json_open_object(json, NULL);
    json_string(json, "view", places[p].name);
    json_number(json, "zoom", places[p].zoom);
    json_number(json, "threshold_px", thresholds[t]);
    json_number(json, "points_frame_ms", drawing->points_ms);
    json_number(json, "frame_ms", drawing->tree_ms);
    json_number(json, "speed_vs_points", drawing->speed);
    if (drawing->selecting > 0) json_number(json, "speed_selected_once", drawing->selecting);
    json_integer(json, "chunks", drawing->kept.chunks);
    json_integer(json, "handed", drawing->kept.handed);
    json_integer(json, "kept", drawing->kept.kept);
    json_integer(json, "twice", drawing->kept.twice);
    json_close_object(json);
}

static void put_cpu(struct json *json, const struct cpu *cpu, const char *name) {
    json_open_object(json, NULL);
    json_string(json, "frame", name);
    json_number(json, "own_us", cpu->own_us);
    json_number(json, "state_us", cpu->state_us);
    json_number(json, "cut_us", cpu->cut_us);
    json_integer(json, "gl_calls", cpu->calls);
    json_integer(json, "gl_asking_calls", cpu->asking);
    json_integer(json, "gl_working_calls", cpu->working);
    json_close_object(json);
}

static void put_model(struct json *json, const struct bench *bench, const struct model *model) {
    json_open_object(json, NULL);
    json_string(json, "name", model->name);
    json_integer(json, "points", model->info.count);
    json_integer(json, "nodes", model->building.nodes);
    json_integer(json, "bytes", model->building.bytes);
    json_integer(json, "build_heap_bytes", model->building.heap);
    json_number(json, "build_1_thread_ms", model->building.ms[0]);
    json_number(json, "build_ms", model->building.ms[1]);
    json_open_array(json, "views");
    for (int p = 0; p < PLACES; p++)
        for (int t = 0; t < THRESHOLDS; t++) put_view(json, model, p, t);
    json_close_array(json);
    json_open_array(json, "cpu");
    for (int kind = 0; is_wanted(bench, "cpu") && kind < CPU_FRAMES; kind++) put_cpu(json, &model->cpu[kind], cpu_names[kind]);
    json_close_array(json);
    json_close_object(json);
}

static void print_json(const struct bench *bench) {
    struct json json = {.file = stdout};
    json_open_object(&json, NULL);
    json_string(&json, "gl_renderer", (const char *)glGetString(GL_RENDERER));
    json_integer(&json, "width", bench->size[0]);
    json_integer(&json, "height", bench->size[1]);
    json_string(&json, "splat", kind_name(splat_kinds, bench->splat));
    json_integer(&json, "rounds", bench->rounds);
    json_open_array(&json, "models");
    for (uint32_t m = 0; m < bench->input_count; m++) put_model(&json, bench, &bench->models[m]);
    json_close_array(&json);
    json_close_object(&json);
}

static bool is_table(const char *text) {
    static const char *const tables[] = {"build", "draw", "drop", "select", "cpu"};
    for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++)
        if (!strcmp(text, tables[i])) return true;
    return false;
}

static bool parse_number(const char *text, uint32_t *value) {
    char *end;
    *value = (uint32_t)strtoul(text, &end, 10);
    return end != text && *end == 0 && *value > 0;
}

static bool parse(int argc, char **argv, struct bench *bench) {
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : "";
        if (!strcmp(argv[i], "--json")) bench->as_json = true;
        else if (!strcmp(argv[i], "--up") && (!strcmp(value, "y") || !strcmp(value, "z"))) bench->z_up = *argv[++i] == 'z';
        else if (!strcmp(argv[i], "--splat") && kind_parse(splat_kinds, value, &bench->splat)) i++;
        else if (!strcmp(argv[i], "--size") && sscanf(value, "%" SCNu32 "x%" SCNu32, &bench->size[0], &bench->size[1]) == 2) i++;
        else if (!strcmp(argv[i], "--rounds") && parse_number(value, &bench->rounds)) i++;
        else if (!strcmp(argv[i], "--frames") && parse_number(value, &bench->frames)) i++;
        else if (!strcmp(argv[i], "--leaf-points") && parse_number(value, &bench->leaf_points)) i++;
        else if (!strcmp(argv[i], "--only") && is_table(value)) bench->only = argv[++i];
        else if (argv[i][0] != '-' && bench->input_count < MOST_MODELS) bench->inputs[bench->input_count++] = argv[i];
        else return false;
    }
    if (bench->input_count == 0) bench->inputs[bench->input_count++] = "torus:200000";
    return bench->rounds <= MOST_ROUNDS && bench->frames <= 1000000 && bench->leaf_points <= 16 && bench->size[0] > 0 &&
           bench->size[1] > 0;
}

int main(int argc, char **argv) {
    static struct bench bench = {.rounds = 9, .frames = 200, .splat = PBR_SPLAT_ELLIPSE, .size = {1280, 720}};
    if (!parse(argc, argv, &bench)) {
        fprintf(stderr,
                "usage: %s [FILE | torus:N]... [--up y|z] [--splat" SPLAT_WORDS "] [--size WxH] [--rounds 1..999] [--frames N]\n"
                "       [--leaf-points 1..16] [--only build|draw|drop|select|cpu] [--json]\n",
                argv[0]);
        return 2;
    }
    bool done = set_up(&bench);
    for (uint32_t m = 0; done && m < bench.input_count; m++) done = measure(&bench, &bench.models[m], bench.inputs[m]);
    if (done && bench.as_json) print_json(&bench);
    else if (done) print_tables(&bench);
    tear_down(&bench);
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
