/* A plug-in's life with libpbr, many times: load the installed libraries, use them, unload them. After each cycle they are
 * unmapped, and no block, thread or file descriptor is left. The program is not linked to libpbr; the GL contexts are its own.
 *
 *     dlopen CYCLES FOLDER      FOLDER takes the pictures
 *
 * Memory is counted twice: what libpbr takes by the instance's hooks, of which nothing may be left after a cycle; and what anyone
 * takes by malloc (OpenEXR, the loader), which may not grow after a warm-up. Mesa keeps something of each shader that it compiles,
 * so the cycles that draw are held against as many in which libpbr stays loaded. Run it with
 * GLIBC_TUNABLES=glibc.malloc.tcache_count=0, or malloc counts the blocks that it keeps for the next caller as in use.
 * SPDX-License-Identifier: MIT */
#define _GNU_SOURCE /* dl_iterate_phdr, mallinfo2 */
#include <dirent.h>
#include <dlfcn.h>
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <link.h>
#include <malloc.h>
#include <pbr/image.h>
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <pbr/support.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    POINTS = 10000, /* enough that estimating radii takes several threads */
    THREADS = 4,
    WARM_UP = 20, /* cycles: the loader's and the C library's own first times */
    SIDE = 32
};

/* What is looked up: result, name, parameters. */
#define CORE_FUNCTIONS(F)                                                                                                          \
    F(pbr_result, pbr_instance_create, (const pbr_instance_desc *, pbr_instance **))                                               \
    F(pbr_result, pbr_instance_destroy, (pbr_instance **))                                                                         \
    F(pbr_result, pbr_parallel, (pbr_instance *, size_t, size_t, pbr_range_fn, void *))                                            \
    F(pbr_result, pbr_points_create, (pbr_instance *, const pbr_points_desc *, pbr_points **))                                     \
    F(pbr_result, pbr_points_get_info, (const pbr_points *, pbr_points_info *))                                                    \
    F(void, pbr_points_release, (pbr_points **))                                                                                   \
    F(pbr_result, pbr_renderer_create, (pbr_instance *, const pbr_renderer_desc *, pbr_renderer **))                               \
    F(pbr_result, pbr_renderer_destroy, (pbr_renderer **))                                                                         \
    F(pbr_result, pbr_view_create, (pbr_renderer *, const pbr_view_desc *, pbr_view **))                                           \
    F(void, pbr_view_destroy, (pbr_view **))                                                                                       \
    F(pbr_result, pbr_render, (pbr_view *, const pbr_frame *, const pbr_item *, size_t, pbr_stats *))
#define IO_FUNCTIONS(F)                                                                                                            \
    F(pbr_result, pbr_read_memory,                                                                                                 \
      (pbr_instance *, const char *, const void *, size_t, const pbr_read_desc *, pbr_file_content *))                             \
    F(pbr_result, pbr_image_create, (pbr_instance *, uint32_t, uint32_t, int, pbr_image *))                                        \
    F(void, pbr_image_destroy, (pbr_instance *, pbr_image *))                                                                      \
    F(pbr_result, pbr_image_write, (pbr_instance *, const pbr_image *, const char *))                                              \
    F(pbr_result, pbr_image_read, (pbr_instance *, const char *, pbr_image *))

struct api {
    void *core, *io;
    int stays; /* loaded, by someone else */
#define F(result, name, parameters) result(*name) parameters;
    CORE_FUNCTIONS(F)
    IO_FUNCTIONS(F)
#undef F
};

/* What was counted of the process. */
struct count {
    size_t blocks; /* of the instance's hooks, alive */
    size_t bytes;  /* of malloc, in use */
    int threads, files;
};

static atomic_size_t blocks, other_threads;

static void fail(int cycle, const char *what, const char *detail) {
    fprintf(stderr, "dlopen: cycle %d: %s%s%s\n", cycle, what, detail ? ": " : "", detail ? detail : "");
    exit(1);
}

/* ---- The host's callbacks ---- */

static void *take(void *user, size_t size, size_t alignment) {
    (void)user;
    (void)alignment; /* libpbr asks for no more than malloc gives */
    atomic_fetch_add(&blocks, 1);
    return malloc(size);
}

static void give_back(void *user, void *memory) {
    (void)user;
    atomic_fetch_sub(&blocks, 1);
    free(memory);
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    (void)level;
    fprintf(stderr, "dlopen: libpbr: %d: %s\n", (int)code, text);
}

static pbr_result note_thread(void *user, size_t begin, size_t end) {
    (void)user;
    (void)begin;
    (void)end;
    if (gettid() != getpid()) atomic_fetch_add(&other_threads, 1);
    usleep(100); /* time for the others to come */
    return PBR_OK;
}

/* ---- What is left in the process ---- */

static int is_libpbr(struct dl_phdr_info *info, size_t size, void *name) {
    (void)size;
    if (!strstr(info->dlpi_name, "/libpbr")) return 0;
    snprintf(name, 256, "%s", info->dlpi_name);
    return 1;
}

static int count_entries(const char *path) {
    DIR *folder = opendir(path);
    int count = 0;
    if (!folder) return -1;
    while (readdir(folder)) count++;
    closedir(folder);
    return count;
}

static struct count take_count(void) {
    struct mallinfo2 info = mallinfo2();
    return (struct count){.blocks = atomic_load(&blocks),
                          .bytes = info.uordblks + info.hblkhd,
                          .threads = count_entries("/proc/self/task"),
                          .files = count_entries("/proc/self/fd")};
}

/* A thread that was joined may still be listed for a moment; one that stays fails after two seconds. */
static struct count settled_count(int threads) {
    struct count now = take_count();
    for (int i = 0; i < 2000 && now.threads > threads; i++) {
        usleep(1000);
        now = take_count();
    }
    return now;
}

/* ---- The host's contexts: a new one for each cycle, since Mesa keeps what was compiled in one for as long as it lives ---- */

static int open_context(EGLDisplay display) {
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_DEPTH_SIZE, 24, EGL_NONE};
    const EGLint size[] = {EGL_WIDTH, SIDE, EGL_HEIGHT, SIDE, EGL_NONE};
    EGLConfig config = NULL;
    EGLint found = 0;
    if (!eglBindAPI(EGL_OPENGL_API) || !eglChooseConfig(display, wanted, &config, 1, &found) || !found) return 0;
    EGLSurface surface = eglCreatePbufferSurface(display, config, size);
    return eglMakeCurrent(display, surface, surface, eglCreateContext(display, config, EGL_NO_CONTEXT, NULL)) == EGL_TRUE;
}

static void close_context(EGLDisplay display) {
    EGLContext context = eglGetCurrentContext();
    EGLSurface surface = eglGetCurrentSurface(EGL_DRAW);
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display, context);
    eglDestroySurface(display, surface);
}

/* ---- One cycle ---- */

static void find(void *library, const char *name, void *out, size_t size) {
    void *symbol = dlsym(library, name);
    if (!symbol) fail(0, "no function", name);
    memcpy(out, &symbol, size);
}

static struct api load(void) {
    struct api api = {.core = dlopen("libpbr.so.0", RTLD_NOW | RTLD_LOCAL), .io = dlopen("libpbr-io.so.0", RTLD_NOW | RTLD_LOCAL)};
    if (!api.core || !api.io) fail(0, "cannot load", dlerror());
#define F(result, name, parameters) find(api.core, #name, &api.name, sizeof api.name);
    CORE_FUNCTIONS(F)
#undef F
#define F(result, name, parameters) find(api.io, #name, &api.name, sizeof api.name);
    IO_FUNCTIONS(F)
#undef F
    return api;
}

static void unload(int cycle, struct api *api) {
    char name[256] = "";
    if (dlclose(api->io) || dlclose(api->core)) fail(cycle, "dlclose", dlerror());
    if (!api->stays && dl_iterate_phdr(is_libpbr, name)) fail(cycle, "is still mapped", name);
}

/* A flat grid, whose radii are to be estimated. */
static pbr_points *make_points(int cycle, const struct api *api, pbr_instance *instance) {
    static float positions[POINTS][3];
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    pbr_points *points = NULL;
    for (int i = 0; i < POINTS; i++) {
        positions[i][0] = (float)(i % 200) / 100 - 1;
        positions[i][1] = (float)(i / 200) / 100 - 1;
    }
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    if (api->pbr_points_create(instance, &desc, &points) || api->pbr_points_get_info(points, &info) || !(info.radius_mean > 0))
        fail(cycle, "no points", NULL);
    return points;
}

static void read_and_write(int cycle, const struct api *api, pbr_instance *instance) {
    static const char ply[] = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
                              "end_header\n0 0 0\n3 4 0\n";
    static const char *const paths[] = {"dlopen.png", "dlopen.exr"};
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    if (api->pbr_read_memory(instance, "ply", ply, sizeof ply - 1, NULL, &content)) fail(cycle, "cannot read points", NULL);
    api->pbr_points_release(&content.points);
    for (int i = 0; i < 2; i++) {
        pbr_image image = PBR_IMAGE_INIT, again = PBR_IMAGE_INIT;
        if (api->pbr_image_create(instance, SIDE, SIDE, 1, &image)) fail(cycle, "no picture", NULL);
        for (int k = 0; k < 4 * SIDE * SIDE; k++) image.rgba[k] = 1;
        if (api->pbr_image_write(instance, &image, paths[i]) || api->pbr_image_read(instance, paths[i], &again))
            fail(cycle, "cannot write and read", paths[i]);
        if (again.width != SIDE || again.rgba[0] != 1) fail(cycle, "another picture", paths[i]);
        api->pbr_image_destroy(instance, &image);
        api->pbr_image_destroy(instance, &again);
    }
}

static void *find_gl(void *user, const char *name) {
    (void)user;
    return (void *)(uintptr_t)eglGetProcAddress(name);
}

/* Into the pbuffer that is bound; every second time by the host's own functions, else by libepoxy's. */
static void draw(int cycle, const struct api *api, pbr_instance *instance, const pbr_points *points) {
    pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    pbr_frame frame = PBR_FRAME_INIT;
    pbr_item item = PBR_ITEM_INIT;
    pbr_stats stats = PBR_STATS_INIT;
    if (cycle % 2) desc.get_proc_address = find_gl;
    for (int k = 0; k < 4; k++) frame.projection[5 * k] = k == 2 ? -1 : 1;
    item.points = points;
    if (api->pbr_renderer_create(instance, &desc, &renderer) || api->pbr_view_create(renderer, NULL, &view) ||
        api->pbr_render(view, &frame, &item, 1, &stats) || stats.splats_drawn != POINTS)
        fail(cycle, "cannot draw", NULL);
    api->pbr_view_destroy(&view);
    if (api->pbr_renderer_destroy(&renderer)) fail(cycle, "renderer", NULL);
}

static void run_cycle(int cycle, EGLDisplay display, int stays) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    if (display != EGL_NO_DISPLAY && !open_context(display)) fail(cycle, "no OpenGL context without a window", NULL);
    struct api api = load();
    api.stays = stays;
    desc.allocate = take;
    desc.release = give_back;
    desc.log = print_message;
    desc.thread_count = THREADS;
    if (api.pbr_instance_create(&desc, &instance)) fail(cycle, "no instance", NULL);
    pbr_points *points = make_points(cycle, &api, instance);
    if (api.pbr_parallel(instance, 4 * THREADS, 1, note_thread, NULL)) fail(cycle, "no loop", NULL);
    read_and_write(cycle, &api, instance);
    if (display != EGL_NO_DISPLAY) draw(cycle, &api, instance, points);
    api.pbr_points_release(&points);
    if (api.pbr_instance_destroy(&instance)) fail(cycle, "objects are left", NULL);
    unload(cycle, &api);
    if (display != EGL_NO_DISPLAY) close_context(display);
}

/* By how many bytes malloc's blocks in use have grown since the warm-up. */
static long run_cycles(const char *name, int cycles, EGLDisplay display, int stays) {
    struct count before = {0}, now = {0};
    for (int i = 1; i <= cycles; i++) {
        run_cycle(i, display, stays);
        if (i == WARM_UP) {
            usleep(20000); /* see settled_count */
            before = take_count();
        }
        now = i > WARM_UP ? settled_count(before.threads) : take_count();
        if (now.blocks != 0) fail(i, "blocks are left", name);
        if (i <= WARM_UP) continue;
        if (now.threads > before.threads) fail(i, "a thread is left", name);
        if (now.files > before.files) fail(i, "a file is left open", name);
    }
    long grown = (long)now.bytes - (long)before.bytes;
    printf("dlopen: %s: %d cycles; after the first %d malloc's bytes in use grew by %ld\n", name, cycles, WARM_UP, grown);
    return grown;
}

int main(int argc, char **argv) {
    int cycles = argc == 3 ? atoi(argv[1]) : 0;
    if (cycles <= 2 * WARM_UP || chdir(argv[2])) fail(0, "usage: dlopen CYCLES FOLDER", NULL);
    mallopt(M_ARENA_MAX, 1); /* one pool of malloc's, whichever thread asks */
    /* A leak in every cycle grows by 32 bytes each, malloc's smallest block with its header, or more. The bound is half of that. */
    const long most = 16L * (cycles - WARM_UP);
    if (run_cycles("without a context", cycles, EGL_NO_DISPLAY, 0) > most) fail(cycles, "memory grows", NULL);
    if (atomic_load(&other_threads) == 0) fail(cycles, "no second thread ever worked", NULL);
    EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (!eglInitialize(display, NULL, NULL)) fail(0, "no display without a window", NULL);
    struct api held = load();
    const long compiling = run_cycles("with a context, staying loaded", cycles, display, 1);
    unload(cycles, &held);
    if (run_cycles("with a context", cycles, display, 0) - compiling > most) fail(cycles, "memory grows with a context", NULL);
    eglTerminate(display);
    return 0;
}
