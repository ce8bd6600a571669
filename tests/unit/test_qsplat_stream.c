/* Hierarchies that are built out of core. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

/* Leaves that fit into the least memory. */
enum { LEAST_BUCKET = (32 << 20) / 4 * 3 / 20 };

/* The sanitizers are slow: there what is a few more is less than a bucket's. The thread sanitizer finds the same races in one. */
#if defined(__SANITIZE_THREAD__)
enum { MANY = 150000, A_FEW_MORE = 20000 };
#elif defined(__SANITIZE_ADDRESS__)
enum { MANY = 2 * LEAST_BUCKET + 50000, A_FEW_MORE = 20000 };
#else
enum { MANY = 2 * LEAST_BUCKET + 50000, A_FEW_MORE = LEAST_BUCKET + 5 };
#endif

struct source {
    const struct surface *surface;
    atomic_long calls, fail_at; /* counts calls; the one of this number fails, 0 = none */
    bool changes;               /* gives fewer points the second time */
    uint64_t spoilt;            /* the first so many points are not finite */
    bool far;                   /* the first point is as far away as floats go */
};

static pbr_result deliver(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    struct source *source = user;
    const struct surface *surface = source->surface;
    const long call = atomic_fetch_add(&source->calls, 1) + 1;
    if (call == atomic_load(&source->fail_at)) return PBR_ERROR_IO;
    assert_true(count > 0 && count <= 65536 && first + count <= surface->kind->count);
    assert_true((batch->colours != NULL) == !(surface->kind->flags & NO_COLOURS));
    const uint64_t spoilt = source->changes && call > 1 ? 10 : source->spoilt;
    for (uint64_t i = 0; i < count; i++) {
        const uint64_t from = first + i;
        for (int k = 0; k < 3; k++) {
            batch->positions[3 * i + (uint64_t)k] = from < spoilt ? (k == 1 ? INFINITY : 0) : surface->positions[from][k];
            if (source->far && from == 0) batch->positions[3 * i + (uint64_t)k] = 3e38;
            assert_true(batch->normals[3 * i + (uint64_t)k] == 0);
            if (!(surface->kind->flags & NO_NORMALS)) batch->normals[3 * i + (uint64_t)k] = surface->normals[from][k];
        }
        assert_true(batch->radii[i] == 0);
        batch->radii[i] = surface->radii[from];
        if (batch->colours) memcpy(batch->colours + 4 * i, surface->colours[from], 4);
    }
    return PBR_OK;
}

static pbr_lod_build_desc describe(struct source *source) {
    pbr_lod_build_desc desc = PBR_LOD_BUILD_DESC_INIT;
    desc.point_count = source->surface->kind->count;
    desc.source = deliver;
    desc.source_user = source;
    desc.memory_bytes = 1;
    if (!(source->surface->kind->flags & NO_COLOURS)) desc.flags = PBR_LOD_BUILD_COLOURS;
    return desc;
}

/* Positions of few bits, so that point sets keep them as they are, wherever they put their origin. */
static struct surface make_exact_surface(const struct kind *kind) {
    struct surface surface = make_surface(kind);
    for (size_t i = 0; i < kind->count; i++)
        for (int k = 0; k < 3; k++) surface.positions[i][k] = round(65536 * surface.positions[i][k]) / 65536;
    return surface;
}

static struct image build_image(const struct folder *folder, const struct surface *surface, uint32_t threads) {
    struct host host;
    pbr_instance *instance = host_start(&host, threads);
    struct source source = {.surface = surface};
    const pbr_lod_build_desc desc = describe(&source);
    assert_int_equal(pbr_lod_build_file(instance, &desc, folder->file), PBR_OK);
    assert_int_equal(files_in(folder), 1);
    assert_int_equal(host.messages, 0);
    host_stop(&host, instance);
    return load_image(folder->file);
}

/* Normals go through other codes on their way into point sets, so there are none here. A few more than a bucket should have are no
 * bucket of their own, in which they would have a sphere as large as the tree's. */
static void what_fits_gives_the_same_file_as_memory(void **state) {
    (void)state;
    static const struct kind kinds[] = {{"1 point", SPHERE, 1, NO_NORMALS},
                                        {"2 points", SPHERE, 2, NO_NORMALS},
                                        {"4 points", SPHERE, 4, NO_NORMALS},
                                        {"5 points", SPHERE, 5, NO_NORMALS | NO_COLOURS},
                                        {"17 points", TORUS, 17, NO_NORMALS},
                                        {"a torus", TORUS, 70001, NO_NORMALS},
                                        {"a torus in grey", TORUS, 300000, NO_NORMALS | NO_COLOURS},
                                        {"a few more than a bucket's", TORUS, A_FEW_MORE, NO_NORMALS | NO_COLOURS},
                                        {"one place", COINCIDENT, 20000, NO_NORMALS},
                                        {"a line", LINE, 20000, NO_NORMALS},
                                        {"clusters", CLUSTERS, 20000, NO_NORMALS},
                                        {"no radii", SPHERE, 3000, NO_NORMALS | ZERO_RADII},
                                        {"one huge radius", SPHERE, 3000, NO_NORMALS | ONE_HUGE}};
    const struct folder folder = make_folder();
    for (size_t i = 0; i < COUNT(kinds); i++) {
        struct host host;
        pbr_instance *instance = host_start(&host, 2);
        struct surface surface = make_exact_surface(&kinds[i]);
        pbr_lod *lod = surface_lod(instance, &surface);
        struct image in_memory = save_image(lod, &folder, PBR_LOD_FILE_PBR), streamed = build_image(&folder, &surface, 1);
        if (in_memory.size != streamed.size || memcmp(in_memory.data, streamed.data, streamed.size) != 0)
            fail_msg("%s: another file than from memory", kinds[i].name);
        free(in_memory.data);
        free(streamed.data);
        pbr_lod_release(&lod);
        free_surface(&surface);
        host_stop(&host, instance);
    }
    remove_folder(&folder);
}

static int compare_doubles(const void *a, const void *b) {
    const double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

/* Points that each move by less than `most` keep their sorted coordinates to within that. */
static void assert_same_coordinates(const double (*a)[3], const double (*b)[3], size_t count, double most) {
    double *left = malloc(count * sizeof *left), *right = malloc(count * sizeof *right);
    assert_true(left && right);
    for (int k = 0; k < 3; k++) {
        for (size_t i = 0; i < count; i++) left[i] = a[i][k], right[i] = b[i][k];
        qsort(left, count, sizeof *left, compare_doubles);
        qsort(right, count, sizeof *right, compare_doubles);
        for (size_t i = 0; i < count; i++) assert_true(fabs(left[i] - right[i]) <= most);
    }
    free(left);
    free(right);
}

/* The leaves of the file stand for the surface's points; the tree is no worse than one that is built in memory. */
static void check_large(const struct folder *folder, const struct surface *surface) {
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_lod *lod = open_lod(instance, folder->file, 0), *in_memory = surface_lod(instance, surface);
    pbr_lod_statistics got = PBR_LOD_STATISTICS_INIT, wanted = PBR_LOD_STATISTICS_INIT;
    pbr_points *leaves = NULL;
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    const size_t count = surface->kind->count;
    double(*positions)[3] = malloc(count * sizeof *positions);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &got), PBR_OK);
    assert_int_equal(pbr_lod_measure(in_memory, NULL, NULL, &wanted), PBR_OK);
    assert_int_equal(got.damaged, 0);
    assert_int_equal(got.leaves, count);
    /* Each bucket is a tree of its own, and not whole. */
    assert_true(got.nodes <= wanted.nodes + wanted.nodes / 1000);
    assert_true(got.levels <= wanted.levels + 2);
    /* Buckets are cut along the curve, so clusters are a little worse than halves of all. */
    assert_true(got.leaf_radius_mean <= 1.05 * wanted.leaf_radius_mean);
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
    assert_int_equal(pbr_points_get_info(leaves, &info), PBR_OK);
    /* Of 2 / sqrt(count) at most. Where two buckets meet, leaves of both in one group would be 33 times as large. */
    assert_true((double)info.radius_maximum <= 6 * 2 / sqrt((double)count));
    assert_non_null(positions);
    copy.positions = positions[0];
    assert_int_equal(pbr_points_copy(leaves, 0, count, &copy), PBR_OK);
    assert_same_coordinates((const double(*)[3])surface->positions, (const double(*)[3])positions, count,
                            (double)info.radius_maximum);
    free(positions);
    pbr_points_release(&leaves);
    pbr_lod_release(&in_memory);
    pbr_lod_release(&lod);
    host_stop(&host, instance);
}

static void several_buckets_make_one_tree_for_any_number_of_threads(void **state) {
    (void)state;
    const struct kind kind = {"a torus", TORUS, MANY, 0};
    const struct folder folder = make_folder();
    struct surface surface = make_surface(&kind);
    struct image one = build_image(&folder, &surface, 1), three = build_image(&folder, &surface, 3);
    assert_int_equal(one.size, three.size);
    assert_memory_equal(one.data, three.data, one.size);
    free(one.data);
    free(three.data);
    check_large(&folder, &surface);
    free_surface(&surface);
    remove_folder(&folder);
}

static void points_that_are_not_finite_are_left_out(void **state) {
    (void)state;
    const struct kind kind = {"a torus", TORUS, 100000, 0};
    const struct folder folder = make_folder();
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct surface surface = make_surface(&kind);
    struct source source = {.surface = &surface, .spoilt = 70000};
    pbr_lod_build_desc desc = describe(&source);
    assert_int_equal(pbr_lod_build_file(instance, &desc, folder.file), PBR_OK);
    assert_int_equal(host.messages, 1);
    assert_int_equal(host.level, PBR_LOG_WARNING);
    pbr_lod *lod = open_lod(instance, folder.file, 0);
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
    assert_int_equal(info.point_count, 30000);
    pbr_lod_release(&lod);
    source.spoilt = kind.count;
    assert_int_equal(unlink(folder.file), 0);
    assert_int_equal(pbr_lod_build_file(instance, &desc, folder.file), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(files_in(&folder), 0);
    free_surface(&surface);
    host_stop(&host, instance);
    remove_folder(&folder);
}

/* A file of that name, which failures are to leave as it is. */
static void expect_failure(pbr_instance *instance, const struct folder *folder, const pbr_lod_build_desc *desc, pbr_result wanted) {
    store_image(folder->file, (const uint8_t *)"old", 3);
    assert_int_equal(pbr_lod_build_file(instance, desc, folder->file), wanted);
    assert_int_equal(files_in(folder), 1);
    struct image image = load_image(folder->file);
    assert_int_equal(image.size, 3);
    free(image.data);
}

static int cancel(void *user, const char *stage, double fraction) {
    (void)stage, (void)fraction;
    return --*(int *)user > 0;
}

static void failures_leave_nothing_behind(void **state) {
    (void)state;
    const struct kind kind = {"a torus", TORUS, 150000, 0};
    const struct folder folder = make_folder();
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct surface surface = make_surface(&kind);
    /* 3 batches, read three times: to measure, to count, to distribute. */
    for (long call = 1; call <= 9; call++) {
        struct source source = {.surface = &surface, .fail_at = call};
        const pbr_lod_build_desc desc = describe(&source);
        expect_failure(instance, &folder, &desc, PBR_ERROR_IO);
    }
    struct source changing = {.surface = &surface, .changes = true};
    pbr_lod_build_desc desc = describe(&changing);
    for (int k = 0; k < 3; k++) desc.minimum[k] = -2, desc.maximum[k] = 2;
    desc.point_count = 60000; /* one batch, so that the first call is the whole first reading */
    expect_failure(instance, &folder, &desc, PBR_ERROR_INVALID_ARGUMENT);
    struct source far = {.surface = &surface, .far = true};
    desc = describe(&far);
    for (int k = 0; k < 3; k++) desc.minimum[k] = -2, desc.maximum[k] = 2;
    expect_failure(instance, &folder, &desc, PBR_ERROR_INVALID_ARGUMENT);
    struct source source = {.surface = &surface};
    desc = describe(&source);
    pbr_result result = PBR_ERROR_CANCELLED;
    int steps = 0;
    while (result != PBR_OK) {
        int left = ++steps;
        desc.progress = cancel;
        desc.progress_user = &left;
        store_image(folder.file, (const uint8_t *)"old", 3);
        result = pbr_lod_build_file(instance, &desc, folder.file);
        if (result != PBR_OK) assert_int_equal(result, PBR_ERROR_CANCELLED);
        assert_int_equal(files_in(&folder), 1);
    }
    assert_true(steps > 6);
    free_surface(&surface);
    host_stop(&host, instance);
    remove_folder(&folder);
}

static void without_memory_nothing_is_lost(void **state) {
    (void)state;
#if defined(__SANITIZE_THREAD__)
    print_message("skipped: there is one thread, and nothing for the thread sanitizer to find\n");
    skip();
#endif
    const struct kind kind = {"a torus", TORUS, 20000, 0};
    const struct folder folder = make_folder();
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct surface surface = make_surface(&kind);
    struct source source = {.surface = &surface};
    pbr_lod_build_desc desc = describe(&source);
    const long live = atomic_load(&host.live);
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    long at = 0;
    while (result != PBR_OK) {
        atomic_store(&host.fail_at, ++at);
        result = pbr_lod_build_file(instance, &desc, folder.file);
        if (result != PBR_OK) assert_int_equal(result, PBR_ERROR_OUT_OF_MEMORY);
        assert_int_equal(atomic_load(&host.live), live);
        assert_int_equal(files_in(&folder), result == PBR_OK);
    }
    assert_true(at > 20);
    atomic_store(&host.fail_at, 0);
    free_surface(&surface);
    host_stop(&host, instance);
    remove_folder(&folder);
}

static void wrong_arguments_are_refused(void **state) {
    (void)state;
    const struct kind kind = {"a torus", TORUS, 100, 0};
    const struct folder folder = make_folder();
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct surface surface = make_surface(&kind);
    struct source source = {.surface = &surface};
    const pbr_lod_build_desc good = describe(&source);
    pbr_lod_build_desc wrong[6];
    for (size_t i = 0; i < COUNT(wrong); i++) wrong[i] = good;
    wrong[0].source = NULL;
    wrong[1].point_count = 0;
    wrong[2].flags = 2;
    wrong[3].kind = 99;
    wrong[4].minimum[1] = 1;
    wrong[5].maximum[2] = INFINITY;
    for (size_t i = 0; i < COUNT(wrong); i++) {
        host.messages = 0;
        assert_int_equal(pbr_lod_build_file(instance, &wrong[i], folder.file), PBR_ERROR_INVALID_ARGUMENT);
        assert_int_equal(host.messages, 1);
    }
    assert_int_equal(pbr_lod_build_file(instance, &good, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_build_file(instance, NULL, folder.file), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_build_file(NULL, &good, folder.file), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_build_file(instance, &good, "/nowhere/at/all.pbr"), PBR_ERROR_IO);
    assert_int_equal(files_in(&folder), 0);
    free_surface(&surface);
    host_stop(&host, instance);
    remove_folder(&folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_fits_gives_the_same_file_as_memory),
        cmocka_unit_test(several_buckets_make_one_tree_for_any_number_of_threads),
        cmocka_unit_test(points_that_are_not_finite_are_left_out),
        cmocka_unit_test(failures_leave_nothing_behind),
        cmocka_unit_test(without_memory_nothing_is_lost),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
