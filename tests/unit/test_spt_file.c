/* Sequential point trees as hierarchies: made, stored, opened, damaged. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include <float.h>

#include "lod/cut.h"
#include "lod/lod.h"

static const struct kind torus = {"a torus", TORUS, 3000, 0}, bare = {"a torus", TORUS, 700, NO_NORMALS | NO_COLOURS | ZERO_RADII},
                         survey = {"a survey", TORUS, 2000, SURVEY}, single = {"1 point", SPHERE, 1, 0},
                         small = {"a torus", TORUS, 700, NO_COLOURS}, clump = {"points in one place", COINCIDENT, 4000, 0},
                         large = {"several chunks", TORUS, 300000, 0};
static const struct kind *const kinds[] = {&torus, &bare, &survey, &single, &clump, &large};

static pbr_lod *spt_lod(pbr_instance *instance, const pbr_points *points, uint32_t flags) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.kind = PBR_LOD_SPT;
    desc.flags = flags;
    desc.points = points;
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
    return lod;
}

static pbr_points *points_of(pbr_instance *instance, const struct kind *kind) {
    struct surface surface = make_surface(kind);
    pbr_points *points = surface_points(instance, &surface);
    free_surface(&surface);
    return points;
}

static pbr_lod *lod_of(pbr_instance *instance, const struct kind *kind, uint32_t flags) {
    pbr_points *points = points_of(instance, kind);
    pbr_lod *lod = spt_lod(instance, points, flags);
    pbr_points_release(&points);
    return lod;
}

/* ---- Whole ---- */

static void assert_same(const pbr_lod *a, const pbr_lod *b) {
    assert_memory_equal(&a->outline, &b->outline, sizeof a->outline);
    assert_int_equal(a->spt.chunk_count, b->spt.chunk_count);
    assert_int_equal(a->spt.count, b->spt.count);
    assert_int_equal(a->spt.has_normals, b->spt.has_normals);
    assert_int_equal(!a->spt.fields, !b->spt.fields);
    for (uint32_t c = 0; c < a->spt.chunk_count; c++) {
        const struct spt_chunk *chunk = &a->spt.chunks[c];
        assert_memory_equal(chunk, &b->spt.chunks[c], sizeof *chunk);
        assert_memory_equal(a->spt.entries[c], b->spt.entries[c], chunk->count * sizeof(struct spt_entry));
        assert_memory_equal(a->spt.steps[c], b->spt.steps[c], spt_step_count(chunk) * sizeof(struct spt_step));
        if (a->spt.fields) assert_memory_equal(a->spt.fields[c], b->spt.fields[c], chunk->count * sizeof(struct normal_field));
    }
}

static void files_give_back_what_was_saved(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    for (size_t i = 0; i < 2 * COUNT(kinds); i++) {
        const struct kind *kind = kinds[i / 2];
        pbr_lod *lod = lod_of(instance, kind, i % 2 ? PBR_LOD_NORMAL_FIELDS : 0);
        assert_int_equal(pbr_lod_save(lod, folder.file, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
        for (uint32_t flags = 0; flags <= PBR_LOD_OPEN_READ; flags++) {
            pbr_lod *opened = open_lod(instance, folder.file, flags);
            pbr_lod_info info = PBR_LOD_INFO_INIT;
            assert_same(lod, opened);
            assert_int_equal(pbr_lod_get_info(opened, &info), PBR_OK);
            assert_int_equal(info.kind, PBR_LOD_SPT);
            assert_int_equal(info.file_format, PBR_LOD_FILE_PBR);
            assert_int_equal(info.is_mapped, !flags);
            assert_int_equal(info.has_normal_fields, i % 2 && !(kind->flags & NO_NORMALS));
            assert_int_equal(pbr_lod_save(opened, folder.other, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
            struct image first = load_image(folder.file), second = load_image(folder.other);
            assert_int_equal(first.size, second.size);
            assert_memory_equal(first.data, second.data, first.size);
            free(first.data);
            free(second.data);
            pbr_lod_release(&opened);
        }
        pbr_lod_release(&lod);
    }
    assert_int_equal(host.messages, 0);
    remove_folder(&folder);
    host_stop(&host, instance);
}

static void it_is_described_and_counted(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < 2 * COUNT(kinds); i++) {
        const struct kind *kind = kinds[i / 2];
        pbr_points *points = points_of(instance, kind);
        pbr_lod *lod = spt_lod(instance, points, i % 2 ? PBR_LOD_NORMAL_FIELDS : 0);
        pbr_lod_info info = PBR_LOD_INFO_INIT;
        pbr_points_info points_info = PBR_POINTS_INFO_INIT;
        pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
        assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
        assert_int_equal(pbr_points_get_info(points, &points_info), PBR_OK);
        assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
        const bool fields = i % 2 && !(kind->flags & NO_NORMALS);
        assert_int_equal(info.point_count, kind->count);
        assert_int_equal(info.has_colours, !(kind->flags & NO_COLOURS));
        assert_int_equal(info.has_normal_fields, fields);
        assert_true(info.radius >= info.bounding_radius);
        assert_true(fabs(info.bounding_radius - points_info.bounding_radius) <= 0.5 * points_info.bounding_radius + 1e-6);
        assert_int_equal(statistics.leaves, kind->count);
        assert_int_equal(statistics.nodes, lod->spt.count);
        assert_true(statistics.nodes < 2 * statistics.leaves);
        assert_true(info.data_bytes >= (fields ? 28 : 20) * statistics.nodes && info.memory_bytes >= info.data_bytes);
        const double mean = statistics.leaf_radius_mean, given = (double)points_info.radius_mean;
        /* Two roundings up: of a position, and of the radius, both 1.3e-5 of a chunk, which has sides of 2 at most. */
        assert_true(mean >= given * (1 - 1e-6) && mean <= given * (1 + 1e-6) + 1e-4 * info.radius);
        pbr_lod_release(&lod);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static int compare_doubles(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double *sorted_sums(const pbr_points *points, size_t count) {
    double(*positions)[3] = malloc(count * sizeof *positions), *sums = malloc(count * sizeof *sums);
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    assert_true(positions && sums);
    copy.positions = *positions;
    assert_int_equal(pbr_points_copy(points, 0, count, &copy), PBR_OK);
    for (size_t i = 0; i < count; i++) sums[i] = positions[i][0] + 2 * positions[i][1] - positions[i][2] / 3;
    qsort(sums, count, sizeof *sums, compare_doubles);
    free(positions);
    return sums;
}

/* Sums of coordinates that are off by little at each rank: the same points in another order. */
static void leaves_are_the_points(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        const size_t count = kinds[i]->count;
        pbr_points *points = points_of(instance, kinds[i]), *leaves = NULL;
        pbr_lod *lod = spt_lod(instance, points, 0);
        pbr_points_info info = PBR_POINTS_INFO_INIT;
        assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &leaves), PBR_OK);
        assert_int_equal(pbr_points_get_info(leaves, &info), PBR_OK);
        assert_int_equal(info.count, count);
        assert_int_equal(info.has_normals, !(kinds[i]->flags & NO_NORMALS));
        assert_int_equal(info.has_colours, !(kinds[i]->flags & NO_COLOURS));
        double *a = sorted_sums(points, count), *b = sorted_sums(leaves, count), step = 0;
        for (uint32_t c = 0; c < lod->spt.chunk_count; c++) step = fmax(step, (double)lod->spt.chunks[c].position_step);
        /* Half a step along each axis; and the point sets round to floats where that is less than 1/128 of a radius. */
        for (size_t k = 0; k < count; k++) assert_true(fabs(a[k] - b[k]) <= 4 * (step + (double)info.radius_maximum / 128));
        free(a);
        free(b);
        pbr_points_release(&leaves);
        pbr_lod_release(&lod);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static void nothing_and_huge_things_are_hierarchies_too(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    static const double scales[] = {0, 1, 1e-25, 1e17, 1e19};
    for (size_t i = 0; i < COUNT(scales); i++) {
        double positions[100][3];
        float radii[100];
        uint64_t state = 4;
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        pbr_lod_desc lod_desc = PBR_LOD_DESC_INIT;
        pbr_points *points = NULL, *leaves = NULL;
        pbr_lod *lod = NULL;
        for (size_t k = 0; k < 100; k++) {
            for (int c = 0; c < 3; c++) positions[k][c] = scales[i] * uniform(&state);
            radii[k] = (float)(scales[i] / 10);
        }
        desc.count = scales[i] > 0 ? 100 : 0;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
        desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
        assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
        lod_desc.kind = PBR_LOD_SPT;
        lod_desc.points = points;
        const pbr_result result = pbr_lod_create(instance, &lod_desc, &lod);
        assert_int_equal(result, scales[i] > 1e18 ? PBR_ERROR_LIMIT : PBR_OK);
        if (result == PBR_OK) {
            pbr_points_info info = PBR_POINTS_INFO_INIT;
            assert_int_equal(pbr_lod_save(lod, folder.file, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
            pbr_lod *opened = open_lod(instance, folder.file, 0);
            assert_same(lod, opened);
            assert_int_equal(pbr_lod_to_points(opened, NULL, NULL, &leaves), PBR_OK);
            assert_int_equal(pbr_points_get_info(leaves, &info), PBR_OK);
            assert_int_equal(info.count, desc.count);
            pbr_lod_release(&opened);
        }
        pbr_points_release(&leaves);
        pbr_lod_release(&lod);
        pbr_points_release(&points);
    }
    remove_folder(&folder);
    host_stop(&host, instance);
}

/* ---- Refused ---- */

static pbr_result no_points(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    (void)user, (void)first, (void)count, (void)batch;
    return PBR_ERROR_IO; /* is not asked */
}

static void what_it_cannot_do_is_refused_with_a_reason(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct folder folder = make_folder();
    pbr_points *points = points_of(instance, &torus);
    pbr_lod *lod = spt_lod(instance, points, 0), *none = NULL;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod_build_desc build = PBR_LOD_BUILD_DESC_INIT;
    struct cut_view view = {.threshold = 1};
    struct cut cut = {0};
    desc.kind = PBR_LOD_SPT;
    desc.points = points;
    desc.leaf_points = SPT_LEAF_POINTS_MOST + 1;
    assert_int_equal(pbr_lod_create(instance, &desc, &none), PBR_ERROR_LIMIT);
    desc.leaf_points = 0;
    desc.reserved = 1;
    assert_int_equal(pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT);
    desc.reserved = 0;
    desc.flags = PBR_LOD_NORMAL_FIELDS << 1;
    assert_int_equal(pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT);
    desc.kind = PBR_LOD_QSPLAT;
    desc.flags = PBR_LOD_NORMAL_FIELDS;
    assert_int_equal(pbr_lod_create(instance, &desc, &none), PBR_ERROR_UNSUPPORTED);
    assert_non_null(strstr(host.text, "normal fields"));
    host.messages = 0;
    assert_int_equal(pbr_lod_save(lod, folder.file, PBR_LOD_FILE_QS, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(host.messages, 1);
    assert_non_null(strstr(host.text, ".qs"));
    assert_int_equal(files_in(&folder), 0);
    build.kind = PBR_LOD_SPT;
    build.source = no_points;
    build.point_count = 1;
    assert_int_equal(pbr_lod_build_file(instance, &build, folder.file), PBR_ERROR_UNSUPPORTED);
    assert_int_equal(host.messages, 2);
    assert_int_equal(files_in(&folder), 0);
    assert_false(lod_can_be_cut(lod));
    assert_int_equal(lod_cut(lod, &view, NULL, NULL, &cut), PBR_ERROR_UNSUPPORTED);
    assert_int_equal(host.messages, 3);
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    remove_folder(&folder);
    host_stop(&host, instance);
}

static void more_points_in_a_leaf_make_fewer_nodes(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_points *points = points_of(instance, &torus);
    uint64_t before = UINT64_MAX;
    for (uint32_t n = 1; n <= SPT_LEAF_POINTS_MOST; n *= 4) {
        pbr_lod_desc desc = PBR_LOD_DESC_INIT;
        pbr_lod *lod = NULL;
        desc.kind = PBR_LOD_SPT;
        desc.points = points;
        desc.leaf_points = n;
        assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
        assert_true(lod->spt.count < before);
        assert_int_equal(lod->spt.leaves, torus.count);
        before = lod->spt.count;
        pbr_lod_release(&lod);
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* As it was before it had leaf_points. */
static void a_shorter_description_is_taken(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_points *points = points_of(instance, &single);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.struct_size = offsetof(pbr_lod_desc, leaf_points);
    desc.kind = PBR_LOD_SPT;
    desc.points = points;
    desc.leaf_points = desc.reserved = 99; /* is not read */
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
    pbr_lod_release(&lod);
    desc.struct_size--;
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_ERROR_INVALID_ARGUMENT);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* ---- Damage ---- */

/* Reads all fields: a sanitizer, or the end of the mapping, sees those that are not there. */
static void read_fields(const struct spt *spt) {
    unsigned sum = 0;
    for (uint32_t c = 0; spt->fields && c < spt->chunk_count; c++)
        for (uint32_t i = 0; i < spt->chunks[c].count; i++) {
            double a[2], b[2];
            normal_field_decode(&spt->fields[c][i], a, b);
            sum += isfinite(a[0] + a[1] + b[0] + b[1]);
        }
    assert_int_equal(sum, spt->fields ? spt->count : 0);
}

/* All that can be asked of an opened hierarchy ends, within its bytes. */
static void use(pbr_lod *lod) {
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_points *points = NULL;
    assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
    assert_true(isfinite(info.radius) && isfinite(info.centre[0] + info.centre[1] + info.centre[2]));
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
    const pbr_result result = pbr_lod_to_points(lod, NULL, NULL, &points);
    assert_true(result == PBR_OK);
    pbr_points_release(&points);
    read_fields(&lod->spt);
    for (uint32_t c = 0; c < lod->spt.chunk_count; c++)
        for (double s = 1e-6; s < 1e7; s *= 31) {
            uint32_t first, end;
            spt_range(&lod->spt.chunks[c], lod->spt.steps[c], s, 0.5, 20, &first, &end);
            assert_true(first <= end && end <= lod->spt.chunks[c].count);
        }
}

static bool try_bytes(struct host *host, pbr_instance *instance, const struct folder *folder, const uint8_t *data, size_t size,
                      uint32_t flags) {
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.flags = flags;
    store_image(folder->file, data, size);
    host->messages = 0;
    const pbr_result result = pbr_lod_open(instance, folder->file, &desc, &lod);
    if (result == PBR_OK) {
        use(lod);
    } else {
        assert_true(result == PBR_ERROR_FORMAT || result == PBR_ERROR_UNSUPPORTED);
        assert_int_equal(host->messages, 1);
        assert_int_equal(host->code, result);
        assert_null(lod);
    }
    pbr_lod_release(&lod);
    return result == PBR_OK;
}

/* Places in a file (docs/qsplat.md, docs/spt.md). */
enum { FILE_HEADER = 32, FIRST_SUM = FILE_HEADER + 24, SECTION = 4096, SECTION_HEADER = 64, CHUNK = 128 };

static uint64_t fnv(const uint8_t *p, size_t size, uint64_t sum) {
    for (size_t i = 0; i < size; i++) sum = (sum ^ p[i]) * UINT64_C(0x100000001b3);
    return sum;
}

static void mend_head(uint8_t *data) {
    const uint64_t head = fnv(data + FILE_HEADER, 40, fnv(data, 24, UINT64_C(0xcbf29ce484222325)));
    memcpy(data + 24, &head, 8);
}

/* Whoever means harm gets the sums right. */
static void mend(uint8_t *data) {
    const uint64_t first = fnv(data + SECTION, SECTION_HEADER, UINT64_C(0xcbf29ce484222325));
    memcpy(data + FIRST_SUM, &first, 8);
    mend_head(data);
}

struct bench {
    struct host host;
    pbr_instance *instance;
    struct folder folder;
    struct image image;
};

static void start(struct bench *bench, const struct kind *kind, uint32_t flags) {
    bench->instance = host_start(&bench->host, 1);
    bench->folder = make_folder();
    pbr_lod *lod = lod_of(bench->instance, kind, flags);
    bench->image = save_image(lod, &bench->folder, PBR_LOD_FILE_PBR);
    pbr_lod_release(&lod);
}

static void stop(struct bench *bench) {
    free(bench->image.data);
    remove_folder(&bench->folder);
    host_stop(&bench->host, bench->instance);
}

static void a_file_that_ends_anywhere_is_refused(void **unused) {
    (void)unused;
    for (uint32_t flags = 0; flags <= PBR_LOD_NORMAL_FIELDS; flags++) {
        struct bench bench;
        start(&bench, &torus, flags);
        for (size_t size = 0; size < bench.image.size; size += size < SECTION || size > SECTION + 300 ? 97 : 1)
            if (try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, size, PBR_LOD_OPEN_READ))
                fail_msg("it opens with its first %zu bytes", size);
        assert_true(try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, bench.image.size, 0));
        stop(&bench);
    }
}

/* Each word of the section's header, of the chunk and of the table, with values that counts, places and floats must not have. */
static void any_word_is_refused_or_does_no_harm(void **unused) {
    (void)unused;
    static const uint32_t values[] = {0,          1,          2,          255,        0x7fffffff, 0x80000000, 0xffffffff,
                                      0x7f800000, 0xff800000, 0x7fc00000, 0x7f7fffff, 0x3f800000, 0xbf800000, 0x00000001};
    const struct kind *const some[] = {&torus, &single, &clump, &torus};
    for (size_t k = 0; k < COUNT(some); k++) {
        struct bench bench;
        long opened = 0, refused = 0;
        start(&bench, some[k], k == 3 ? PBR_LOD_NORMAL_FIELDS : 0);
        for (size_t at = SECTION; at < SECTION + SECTION_HEADER + CHUNK + 48 && at + 4 <= bench.image.size; at += 4)
            for (size_t v = 0; v < COUNT(values); v++) {
                uint8_t before[4];
                memcpy(before, bench.image.data + at, 4);
                memcpy(bench.image.data + at, &values[v], 4);
                mend(bench.image.data);
                if (try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, bench.image.size, v % 2)) opened++;
                else refused++;
                memcpy(bench.image.data + at, before, 4);
            }
        assert_true(refused > 300 && opened > 50);
        stop(&bench);
    }
}

static void counts_and_places_that_lie_are_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &torus, 0);
    static const struct {
        size_t at;
        int size;
        uint64_t value;
    } lies[] = {{0, 8, 3001},
                {0, 8, UINT64_MAX},
                {8, 8, 1},
                {8, 8, UINT64_MAX},
                {16, 4, 0},
                {16, 4, 2},
                {16, 4, UINT32_MAX},
                {20, 4, 7},
                {20, 4, 8},
                {64 + 96, 8, 1},
                {64 + 96, 8, UINT64_MAX},
                {64 + 104, 4, 0},
                {64 + 104, 4, UINT32_MAX},
                {64 + 108, 4, 0},
                {64 + 108, 4, 2999},
                {64 + 116, 4, 1}};
    for (size_t i = 0; i < COUNT(lies); i++) {
        uint8_t *copy = malloc(bench.image.size);
        assert_non_null(copy);
        memcpy(copy, bench.image.data, bench.image.size);
        memcpy(copy + SECTION + lies[i].at, &lies[i].value, (size_t)lies[i].size);
        mend(copy);
        if (try_bytes(&bench.host, bench.instance, &bench.folder, copy, bench.image.size, 0))
            fail_msg("it opens with %llu at %zu", (unsigned long long)lies[i].value, lies[i].at);
        free(copy);
    }
    /* A section that ends before its entries do, at its header, its chunk, its table and its entries. */
    const size_t whole = bench.image.size - SECTION, ends[] = {0, 63, 64, 191, 192, 200, whole / 2, whole - 1};
    for (size_t i = 0; i < COUNT(ends); i++) {
        struct image image = {malloc(bench.image.size), bench.image.size};
        const uint64_t ends_at = ends[i];
        assert_non_null(image.data);
        memcpy(image.data, bench.image.data, image.size);
        memcpy(image.data + FILE_HEADER + 16, &ends_at, 8);
        if (ends_at < SECTION_HEADER) memset(image.data + FILE_HEADER + 32, 0, 8); /* sums up nothing */
        mend(image.data);
        if (ends_at < SECTION_HEADER) {
            const uint64_t nothing = UINT64_C(0xcbf29ce484222325);
            memcpy(image.data + FIRST_SUM, &nothing, 8);
            mend_head(image.data);
        }
        if (try_bytes(&bench.host, bench.instance, &bench.folder, image.data, image.size, 0))
            fail_msg("it opens with a section of %zu bytes", ends[i]);
        assert_non_null(strstr(bench.host.text, "sequential point tree"));
        free(image.data);
    }
    /* A section in a place that is not aligned. */
    const uint64_t place = SECTION + 2, size = bench.image.size - SECTION - 2;
    uint8_t *copy = calloc(1, bench.image.size);
    assert_non_null(copy);
    memcpy(copy, bench.image.data, SECTION);
    memcpy(copy + SECTION + 2, bench.image.data + SECTION, bench.image.size - SECTION - 2);
    memcpy(copy + FILE_HEADER + 8, &place, 8);
    memcpy(copy + FILE_HEADER + 16, &size, 8);
    mend_head(copy);
    assert_false(try_bytes(&bench.host, bench.instance, &bench.folder, copy, bench.image.size, 0));
    assert_non_null(strstr(bench.host.text, "aligned"));
    free(copy);
    stop(&bench);
}

static void any_entries_do_no_harm(void **unused) {
    (void)unused;
    struct bench bench;
    uint64_t state = 8, count;
    start(&bench, &single, PBR_LOD_NORMAL_FIELDS);
    memcpy(&count, bench.image.data + SECTION + 8, sizeof count);
    assert_int_equal(bench.image.size, SECTION + SECTION_HEADER + CHUNK + 12 + count * 28);
    stop(&bench);
    start(&bench, &small, PBR_LOD_NORMAL_FIELDS);
    memcpy(&count, bench.image.data + SECTION + 8, sizeof count);
    const size_t from = bench.image.size - (size_t)count * (sizeof(struct spt_entry) + sizeof(struct normal_field));
    for (int t = 0; t < 50; t++) {
        for (size_t i = from; i < bench.image.size; i++) bench.image.data[i] = t ? (uint8_t)(256 * uniform(&state)) : 0xff;
        assert_true(try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, bench.image.size, t % 2));
    }
    stop(&bench);
}

/* ---- Memory and cancelling ---- */

struct work {
    const pbr_points *points;
    struct folder folder;
    uint32_t flags;
};

static pbr_result make_save_open(pbr_instance *instance, void *user) {
    const struct work *work = user;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL, *opened = NULL;
    pbr_points *leaves = NULL;
    desc.kind = PBR_LOD_SPT;
    desc.flags = work->flags;
    desc.points = work->points;
    pbr_result result = pbr_lod_create(instance, &desc, &lod);
    if (result == PBR_OK) result = pbr_lod_save(lod, work->folder.file, PBR_LOD_FILE_PBR, NULL, NULL);
    if (result == PBR_OK) result = pbr_lod_open(instance, work->folder.file, NULL, &opened);
    if (result == PBR_OK) result = pbr_lod_to_points(opened, NULL, NULL, &leaves);
    pbr_points_release(&leaves);
    pbr_lod_release(&opened);
    pbr_lod_release(&lod);
    return result;
}

static void memory_that_runs_out_leaves_nothing_behind(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct work work = {.points = points_of(instance, &clump), .folder = make_folder()};
    for (; work.flags <= PBR_LOD_NORMAL_FIELDS; work.flags++) fail_every_allocation(&host, instance, make_save_open, &work);
    pbr_points_release((pbr_points **)(uintptr_t)&work.points);
    remove_folder(&work.folder);
    host_stop(&host, instance);
}

static int32_t count_down(void *user, const char *stage, double fraction) {
    int *left = user;
    assert_non_null(stage);
    assert_true(fraction >= 0 && fraction <= 1);
    assert_true(*left > 0); /* nor is it asked again */
    return --*left > 0;
}

static void cancelled_work_leaves_nothing_behind(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    pbr_points *points = points_of(instance, &torus);
    const long live = atomic_load(&host.live);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    desc.kind = PBR_LOD_SPT;
    desc.flags = PBR_LOD_NORMAL_FIELDS;
    desc.points = points;
    desc.progress = count_down;
    int tries = 0;
    for (pbr_result result = PBR_ERROR_CANCELLED; result != PBR_OK; tries++) {
        pbr_lod *lod = NULL;
        int left = tries + 1;
        desc.progress_user = &left;
        result = pbr_lod_create(instance, &desc, &lod);
        assert_true(result == PBR_OK || result == PBR_ERROR_CANCELLED);
        assert_int_equal(lod != NULL, result == PBR_OK);
        pbr_lod_release(&lod);
        assert_int_equal(atomic_load(&host.live), live);
        assert_true(tries < 100);
    }
    assert_true(tries > 3);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(files_give_back_what_was_saved),
        cmocka_unit_test(it_is_described_and_counted),
        cmocka_unit_test(leaves_are_the_points),
        cmocka_unit_test(nothing_and_huge_things_are_hierarchies_too),
        cmocka_unit_test(what_it_cannot_do_is_refused_with_a_reason),
        cmocka_unit_test(more_points_in_a_leaf_make_fewer_nodes),
        cmocka_unit_test(a_shorter_description_is_taken),
        cmocka_unit_test(a_file_that_ends_anywhere_is_refused),
        cmocka_unit_test(any_word_is_refused_or_does_no_harm),
        cmocka_unit_test(counts_and_places_that_lie_are_refused),
        cmocka_unit_test(any_entries_do_no_harm),
        cmocka_unit_test(memory_that_runs_out_leaves_nothing_behind),
        cmocka_unit_test(cancelled_work_leaves_nothing_behind),
    };
    return cmocka_run_group_tests_name("spt_file", tests, NULL, NULL);
}
