/* The budget of what is resident of a mapped file, against what the system says is. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/file.h"
#include "lod/cut.h"
#include "lod/residency.h"

enum { SIZE = 24 << 20, BUDGET = 4 << 20, READS = 60000, THREADS = 4 };

/* Bytes of the mapping at `data` that are in this process' memory. */
static size_t resident(const void *data) {
    char line[512], start[32];
    FILE *file = fopen("/proc/self/smaps", "r");
    size_t kilobytes = SIZE_MAX;
    bool found = false;
    assert_non_null(file);
    snprintf(start, sizeof start, "%lx-", (unsigned long)(uintptr_t)data);
    while (kilobytes == SIZE_MAX && fgets(line, sizeof line, file)) {
        if (!strncmp(line, start, strlen(start))) found = true;
        if (found && sscanf(line, "Rss: %zu", &kilobytes) != 1) kilobytes = SIZE_MAX;
    }
    fclose(file);
    assert_true(kilobytes != SIZE_MAX);
    return kilobytes << 10;
}

static unsigned char content(size_t i) {
    return (unsigned char)((i * 2654435761u) >> 13);
}

struct reading {
    struct residency *residency;
    const unsigned char *data;
    atomic_size_t wrong;
};

static pbr_result read_here_and_there(void *user, size_t begin, size_t end) {
    struct reading *reading = user;
    uint64_t state = begin;
    for (size_t i = begin; i < end; i++) {
        /* Some places again and again, others seldom. */
        const size_t place = (size_t)(uniform(&state) * uniform(&state) * (SIZE - 40));
        residency_touch(reading->residency, reading->data + place, 40);
        for (size_t k = 0; k < 40; k += 13)
            if (reading->data[place + k] != content(place + k)) atomic_fetch_add(&reading->wrong, 1);
    }
    return PBR_OK;
}

static void what_is_resident_stays_within_the_budget(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, THREADS);
    struct folder folder = make_folder();
    unsigned char *bytes = malloc(SIZE);
    assert_non_null(bytes);
    for (size_t i = 0; i < SIZE; i++) bytes[i] = content(i);
    FILE *file = fopen(folder.other, "wb");
    assert_true(file && fwrite(bytes, SIZE, 1, file) == 1 && fclose(file) == 0);
    free(bytes);
    struct source source;
    assert_int_equal(source_open(instance, folder.other, false, &source), PBR_OK);
    assert_true(source.mapped);
    struct reading reading = {.residency = residency_create(instance, source.data, source.size, BUDGET), .data = source.data};
    assert_non_null(reading.residency);
    assert_int_equal(residency_bytes(reading.residency), 0);
    for (int run = 0; run < 3; run++) {
        assert_int_equal(pbr_parallel(instance, READS, READS / 16, read_here_and_there, &reading), PBR_OK);
        assert_int_equal(atomic_load(&reading.wrong), 0);
        const size_t counted = residency_bytes(reading.residency), is = resident(source.data);
        assert_true(counted <= BUDGET + THREADS * RESIDENCY_CHUNK);
        /* The budget is used, and the count is right, but for chunks that were touched while they were given back. */
        assert_true(counted > BUDGET / 2);
        if (is > counted + BUDGET / 8) fail_msg("%zu bytes are resident, %zu are counted", is, counted);
    }
    residency_free(instance, reading.residency);
    source_close(&source);
    remove_folder(&folder);
    host_stop(&host, instance);
}

/* Of any size, from the first byte to the last. */
static void a_mapping_of_any_size_is_counted_whole(void **unused) {
    (void)unused;
    static const size_t sizes[] = {1, 4095, 4096, 65535, 65536, 65537, 1000000};
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    for (size_t i = 0; i < COUNT(sizes); i++) {
        unsigned char *data = mmap(NULL, sizes[i], PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        assert_true(data != MAP_FAILED);
        struct residency *residency = residency_create(instance, data, sizes[i], 0);
        assert_non_null(residency);
        for (size_t at = 0; at < sizes[i]; at += 1000) residency_touch(residency, data + at, 1);
        residency_touch(residency, data, sizes[i]);
        assert_in_range(residency_bytes(residency), sizes[i], sizes[i] + 2 * RESIDENCY_CHUNK);
        residency_free(instance, residency);
        munmap(data, sizes[i]);
    }
    host_stop(&host, instance);
}

/* A file that is larger than its budget is drawn as from memory. */
static void a_hierarchy_keeps_its_budget(void **unused) {
    (void)unused;
    static const struct kind kind = {"a sphere", SPHERE, 900000, NO_COLOURS};
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    struct surface surface = make_surface(&kind);
    pbr_lod *built = surface_lod(instance, &surface), *opened = NULL;
    assert_int_equal(pbr_lod_save(built, folder.other, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    desc.resident_bytes = 1; /* the least */
    assert_int_equal(pbr_lod_open(instance, folder.other, &desc, &opened), PBR_OK);
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    struct cut cuts[2] = {{0}, {0}};
    struct cut_view view;
    memset(&view, 0, sizeof view);
    for (int k = 0; k < 3; k++) view.to_clip[5 * k] = 0.5 / lod_radius(built);
    view.to_clip[15] = 1;
    view.viewport[0] = view.viewport[1] = 1000;
    view.point_limit = 64, view.size_maximum = 1e18;
    assert_int_equal(lod_cut(built, &view, NULL, NULL, &cuts[0]), PBR_OK);
    assert_int_equal(lod_cut(opened, &view, NULL, NULL, &cuts[1]), PBR_OK);
    assert_int_equal(cuts[0].count, kind.count);
    assert_int_equal(cuts[1].count, kind.count);
    assert_int_equal(pbr_lod_get_info(opened, &info), PBR_OK);
    assert_true(info.data_bytes > BUDGET + BUDGET / 8);
    assert_in_range(info.resident_bytes, BUDGET / 2, BUDGET + 2 * RESIDENCY_CHUNK);
    struct splat *records[2];
    for (int i = 0; i < 2; i++) {
        records[i] = malloc(kind.count * sizeof *records[i]);
        assert_non_null(records[i]);
        cut_gather(instance, &cuts[i], records[i]);
        cut_free(instance, &cuts[i]);
    }
    assert_memory_equal(records[0], records[1], kind.count * sizeof *records[0]);
    /* A walk over all, too. */
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    assert_int_equal(pbr_lod_measure(opened, NULL, NULL, &statistics), PBR_OK);
    assert_int_equal(statistics.leaves, kind.count);
    assert_int_equal(pbr_lod_get_info(opened, &info), PBR_OK);
    assert_in_range(info.resident_bytes, BUDGET / 2, BUDGET + 2 * RESIDENCY_CHUNK);
    for (int i = 0; i < 2; i++) free(records[i]);
    pbr_lod_release(&built);
    pbr_lod_release(&opened);
    free_surface(&surface);
    remove_folder(&folder);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_resident_stays_within_the_budget),
                                       cmocka_unit_test(a_mapping_of_any_size_is_counted_whole),
                                       cmocka_unit_test(a_hierarchy_keeps_its_budget)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
