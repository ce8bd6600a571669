/* What the tests of QSplat hierarchies share: surfaces to build them from, files to read them back from, and nodes found by where
 * they are. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_UNIT_QS_TREES_H
#define PBR_TESTS_UNIT_QS_TREES_H

#include "support.h"

#include <dirent.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "qs_oracle.h"

#include "core/matrix.h"

/* ---- Surfaces ---- */

enum shape { SPHERE, PLANE, TORUS, COINCIDENT, LINE, CLUSTERS, ISLANDS };

enum {
    NO_NORMALS = 1,
    NO_COLOURS = 2,
    ZERO_RADII = 4,
    ONE_HUGE = 8,      /* one radius is far larger than all else */
    SURVEY = 16,       /* metres, far from zero */
    SOME_NORMALS = 32, /* every third is zero */
    SMALL_SURVEY = 64, /* as SURVEY, and no larger than a float's step there */
    RANDOM_NORMALS = 128,
    TWO_SIDES = 256 /* every normal is the same, or in a corner the opposite */
};

struct kind {
    const char *name;
    enum shape shape;
    size_t count;
    unsigned flags;
};

/* The input as it was given. */
struct surface {
    const struct kind *kind;
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
};

static inline void random_direction(uint64_t *state, double out[3]) {
    const double z = 2 * uniform(state) - 1, turn = 2 * acos(-1) * uniform(state), s = sqrt(1 - z * z);
    out[0] = s * cos(turn), out[1] = s * sin(turn), out[2] = z;
}

/* Of size about 1; the normal is unit. */
static inline void shape_point(const struct kind *kind, size_t i, uint64_t *state, double p[3], double n[3]) {
    const size_t side = (size_t)ceil(sqrt((double)kind->count));
    const double a = 2 * acos(-1) * uniform(state), b = 2 * acos(-1) * uniform(state);
    random_direction(state, n);
    memset(p, 0, 3 * sizeof *p);
    switch (kind->shape) {
    case SPHERE: memcpy(p, n, 3 * sizeof *p); break;
    case PLANE:
        p[0] = 2 * (double)(i % side) / (double)side - 1, p[1] = 2 * (double)(i / side) / (double)side - 1;
        n[0] = n[1] = 0, n[2] = 1;
        break;
    case TORUS:
        n[0] = cos(a) * cos(b), n[1] = sin(a) * cos(b), n[2] = sin(b);
        for (int k = 0; k < 3; k++) p[k] = 0.3 * n[k] + (k == 0 ? 0.7 * cos(a) : k == 1 ? 0.7 * sin(a) : 0);
        break;
    case COINCIDENT: p[0] = 0.3, p[1] = -0.2, p[2] = 0.1; break;
    case LINE: p[0] = p[1] = 2 * (double)i / (double)kind->count - 1; break;
    case CLUSTERS:
        for (int k = 0; k < 3; k++) p[k] = 1e-3 * uniform(state) + (i % 2 ? 1 : -1);
        break;
    case ISLANDS: /* 64, as far from one another as 800 times their size; their points cover them */
        for (int k = 0; k < 2; k++) p[k] = 100 * (double)(k ? i / 8 % 8 : i % 8) + uniform(state) / 8;
        n[0] = n[1] = 0, n[2] = 1;
        break;
    }
}

static inline struct surface make_surface(const struct kind *kind) {
    struct surface surface = {.kind = kind,
                              .positions = calloc(kind->count, sizeof *surface.positions),
                              .normals = calloc(kind->count, sizeof *surface.normals),
                              .radii = calloc(kind->count, sizeof *surface.radii),
                              .colours = calloc(kind->count, sizeof *surface.colours)};
    const double far_away[3] = {500000.25, 5400000.125, 300};
    const bool far = kind->flags & (SURVEY | SMALL_SURVEY);
    const double scale = kind->flags & SMALL_SURVEY ? 0.05 : far ? 50 : 1;
    uint64_t state = 77;
    assert_true(surface.positions && surface.normals && surface.radii && surface.colours);
    for (size_t i = 0; i < kind->count; i++) {
        double p[3], n[3];
        shape_point(kind, i, &state, p, n);
        if (kind->flags & RANDOM_NORMALS) random_direction(&state, n);
        if (kind->flags & TWO_SIDES) { /* a direction whose code's product with that of the opposite one is below -1, in floats */
            const double sign = i % 3 == 0 && p[0] < -0.6 && p[1] < -0.6 ? -1 : 1;
            n[0] = 0.773106 * sign, n[1] = -0.625336 * sign, n[2] = -0.106122 * sign;
        }
        const bool no_normal = kind->flags & SOME_NORMALS && i % 3 == 0;
        for (int k = 0; k < 3; k++) {
            surface.positions[i][k] = scale * p[k] + (far ? far_away[k] : 0);
            surface.normals[i][k] = no_normal ? 0 : (float)n[k];
        }
        /* Discs that overlap with their neighbours, of sizes up to twice the smallest. */
        const double radius = kind->flags & ZERO_RADII ? 0 : (1 + uniform(&state)) * scale / sqrt((double)kind->count);
        surface.radii[i] = (float)(kind->flags & ONE_HUGE && i == kind->count / 2 ? 1000 * scale : radius);
        for (int k = 0; k < 3; k++) surface.colours[i][k] = (uint8_t)(256 * uniform(&state));
        surface.colours[i][3] = 255;
    }
    return surface;
}

static inline void free_surface(struct surface *surface) {
    free(surface->positions);
    free(surface->normals);
    free(surface->radii);
    free(surface->colours);
}

static inline pbr_points *surface_points(pbr_instance *instance, const struct surface *surface) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points = NULL;
    desc.count = surface->kind->count;
    desc.positions = (pbr_attribute){.data = surface->positions, .format = PBR_FORMAT_FLOAT64, .components = 3};
    desc.radii = (pbr_attribute){.data = surface->radii, .format = PBR_FORMAT_FLOAT32, .components = 1};
    if (!(surface->kind->flags & NO_NORMALS))
        desc.normals = (pbr_attribute){.data = surface->normals, .format = PBR_FORMAT_FLOAT32, .components = 3};
    if (!(surface->kind->flags & NO_COLOURS))
        desc.colours = (pbr_attribute){.data = surface->colours, .format = PBR_FORMAT_UINT8, .components = 4};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

static inline pbr_lod *surface_lod(pbr_instance *instance, const struct surface *surface) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    pbr_points *points = surface_points(instance, surface);
    desc.points = points;
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
    pbr_points_release(&points);
    return lod;
}

/* ---- Files ---- */

struct folder {
    char path[64], file[96], other[96];
};

/* In memory where there is such a file system: thousands are written. */
static inline struct folder make_folder(void) {
    struct folder folder;
    snprintf(folder.path, sizeof folder.path, "%s/pbr-test-qsplat-XXXXXX", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    assert_non_null(mkdtemp(folder.path));
    snprintf(folder.file, sizeof folder.file, "%s/tree", folder.path);
    snprintf(folder.other, sizeof folder.other, "%s/other", folder.path);
    return folder;
}

static inline int files_in(const struct folder *folder) {
    DIR *dir = opendir(folder->path);
    int count = -2; /* . and .. */
    assert_non_null(dir);
    while (readdir(dir)) count++;
    closedir(dir);
    return count;
}

/* The folder holds the two files or nothing: no temporary name is left. */
static inline void remove_folder(const struct folder *folder) {
    unlink(folder->file);
    unlink(folder->other);
    assert_int_equal(rmdir(folder->path), 0);
}

struct image {
    uint8_t *data;
    size_t size;
};

static inline struct image load_image(const char *path) {
    struct image image = {0};
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    image.size = (size_t)info.st_size;
    image.data = malloc(image.size + 1);
    FILE *file = fopen(path, "rb");
    assert_true(image.data && file);
    assert_int_equal(fread(image.data, 1, image.size, file), image.size);
    fclose(file);
    return image;
}

static inline void store_image(const char *path, const uint8_t *data, size_t size) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

/* The image of the hierarchy's file in the folder, of the form PBR_LOD_FILE_... */
static inline struct image save_image(const pbr_lod *lod, const struct folder *folder, uint32_t file_format) {
    assert_int_equal(pbr_lod_save(lod, folder->file, file_format, NULL, NULL), PBR_OK);
    assert_int_equal(files_in(folder), 1);
    return load_image(folder->file);
}

static inline struct qs_tree read_tree_of(const char *name, const struct image *image) {
    struct qs_tree tree;
    const char *wrong = qs_read(image->data, image->size, &tree);
    if (wrong) fail_msg("%s: the file has %s", name, wrong);
    return tree;
}

static inline pbr_lod *open_lod(pbr_instance *instance, const char *path, uint32_t flags) {
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.flags = flags;
    assert_int_equal(pbr_lod_open(instance, path, &desc, &lod), PBR_OK);
    return lod;
}

/* A file of the test data; skips the test without. */
static inline void data_path(char out[4096], const char *name) {
    const char *data = getenv("PBR_TEST_DATA");
    snprintf(out, 4096, "%s/qs/%s", data ? data : "../shared/data", name);
    if (access(out, R_OK) == 0) return;
    print_message("skipped: no test data at %s (PBR_TEST_DATA)\n", out);
    skip();
}

/* ---- Nodes by where they are ---- */

struct place {
    uint64_t cell;
    size_t node;
};

struct finder {
    struct qs_tree tree; /* whose nodes are not its own */
    double cell;
    struct place *places; /* by cell, then by number */
};

static inline int compare_places(const void *a, const void *b) {
    const struct place *left = a, *right = b;
    if (left->cell != right->cell) return left->cell < right->cell ? -1 : 1;
    return (left->node > right->node) - (left->node < right->node);
}

static inline uint64_t cell_number(const int64_t index[3]) {
    uint64_t cell = 0;
    for (int k = 0; k < 3; k++) cell = cell << 21 | ((uint64_t)index[k] & 0x1fffff);
    return cell;
}

static inline void cell_index(const struct finder *finder, const double p[3], double move, int64_t out[3]) {
    for (int k = 0; k < 3; k++) out[k] = (int64_t)floor((p[k] - finder->tree.nodes[0].centre[k] + move) / finder->cell);
}

static inline struct finder make_finder(const struct qs_tree *tree) {
    const double radius = tree->nodes[0].radius;
    struct finder finder = {*tree, radius > 0 ? radius / 128 : 1, malloc(tree->count * sizeof *finder.places)};
    assert_non_null(finder.places);
    for (size_t i = 0; i < tree->count; i++) {
        int64_t index[3];
        cell_index(&finder, tree->nodes[i].centre, 0, index);
        finder.places[i] = (struct place){cell_number(index), i};
    }
    qsort(finder.places, tree->count, sizeof *finder.places, compare_places);
    return finder;
}

/* The first node in the cell that `accepts`, or the tree's count. */
static inline size_t find_in_cell(const struct finder *finder, uint64_t cell, bool (*accepts)(void *user, size_t node),
                                  void *user) {
    size_t low = 0, high = finder->tree.count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (finder->places[middle].cell < cell) low = middle + 1;
        else high = middle;
    }
    for (; low < finder->tree.count && finder->places[low].cell == cell; low++)
        if (accepts(user, finder->places[low].node)) return finder->places[low].node;
    return finder->tree.count;
}

/* The first node that `accepts`, of those whose centre is within `tolerance` of p and some others; or the tree's count. */
static inline size_t find_node(const struct finder *finder, const double p[3], double tolerance,
                               bool (*accepts)(void *user, size_t node), void *user) {
    int64_t low[3], high[3], at[3];
    size_t first = finder->tree.count;
    cell_index(finder, p, -tolerance, low);
    cell_index(finder, p, tolerance, high);
    for (at[0] = low[0]; at[0] <= high[0]; at[0]++)
        for (at[1] = low[1]; at[1] <= high[1]; at[1]++)
            for (at[2] = low[2]; at[2] <= high[2]; at[2]++) {
                const size_t found = find_in_cell(finder, cell_number(at), accepts, user);
                if (found < first) first = found;
            }
    return first;
}

static inline double distance3(const double a[3], const double b[3]) {
    const double difference[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return length3(difference);
}

/* Positions and radii come from sums and products of floats, a few a level. */
static inline double sphere_tolerance(const struct qs_tree *tree) {
    return 1e-5 * tree->nodes[0].radius;
}

#endif
