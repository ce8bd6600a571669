/* Hierarchies whose file is damaged, whose memory runs out, whose work is cancelled. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include "cameras.h"
#include "lod/cut.h"

enum { HEADER = 40 };

static const struct kind small = {"a torus", TORUS, 300, 0}, uncoloured = {"a torus", TORUS, 300, NO_COLOURS},
                         single = {"1 point", SPHERE, 1, 0}, few = {"4 points", SPHERE, 4, 0};

/* An undamaged image to start from, and where the damaged ones go. */
struct bench {
    struct host host;
    pbr_instance *instance;
    struct folder folder;
    struct image image;
    struct qs_tree tree; /* of QSplat 11 */
    struct cut cut;      /* of one file after the other */
    long opened, refused;
};

static void start(struct bench *bench, const struct kind *kind, uint32_t file_format) {
    memset(bench, 0, sizeof *bench);
    bench->instance = host_start(&bench->host, 1);
    bench->folder = make_folder();
    struct surface surface = make_surface(kind);
    pbr_lod *lod = surface_lod(bench->instance, &surface);
    bench->image = save_image(lod, &bench->folder, file_format);
    if (file_format == PBR_LOD_FILE_QS) bench->tree = read_tree_of(kind->name, &bench->image);
    pbr_lod_release(&lod);
    free_surface(&surface);
}

static void stop(struct bench *bench) {
    cut_free(bench->instance, &bench->cut);
    free(bench->image.data);
    qs_free(&bench->tree);
    remove_folder(&bench->folder);
    host_stop(&bench->host, bench->instance);
}

/* All of a model of radius 1 about the origin. */
static struct cut_view plain_view(double threshold) {
    struct cut_view view = {.to_clip = {0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 1},
                            .size_per_radius = 100,
                            .size_minimum = 1,
                            .size_maximum = 1e18,
                            .point_limit = 64,
                            .viewport = {1000, 1000},
                            .eye = {0, 0, 1, 0},
                            .node_size_per_radius = 100,
                            .threshold = threshold};
    return view;
}

/* Paths that meet may be walked more than once, but not all of them: as many nodes as fit into the file, and what each of the
 * subtrees that threads work on may take and not need. */
static uint64_t most_nodes(size_t size) {
    enum { RECORD = 4, PARTS = 265 };
    return size / RECORD + PARTS * (size / RECORD / 256 + 4);
}

static void use_cut(struct bench *bench, const pbr_lod *lod, size_t size, double threshold) {
    struct cut *cut = &bench->cut;
    struct cut_view view = plain_view(threshold);
    assert_int_equal(lod_cut(lod, &view, NULL, NULL, cut), PBR_OK);
    if (cut->visited > most_nodes(size)) fail_msg("%llu nodes of %zu bytes", (unsigned long long)cut->visited, size);
    assert_true(cut->count <= cut->visited);
    struct splat *records = malloc((cut->count + 1) * sizeof *records);
    assert_non_null(records);
    cut_gather(bench->instance, cut, records);
    for (size_t i = 0; i < cut->count; i++) assert_true(records[i].radius >= 0); /* reads all of it */
    free(records);
}

/* Everything that can be asked of a hierarchy ends, within its file and its memory. */
static void use(struct bench *bench, pbr_lod *lod, size_t size) {
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_points *points = NULL;
    assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
    for (int k = 0; k < 3; k++) assert_true(isfinite(info.centre[k]));
    assert_true(isfinite(info.radius) && info.radius >= 0);
    use_cut(bench, lod, size, 0);
    use_cut(bench, lod, size, 4);
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
    assert_true(statistics.nodes <= most_nodes(size));
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &points), PBR_OK);
    pbr_points_release(&points);
    if ((bench->opened + bench->refused) % 16 != 0) return; /* writing takes long */
    const pbr_result saved = pbr_lod_save(lod, bench->folder.other, PBR_LOD_FILE_QS, NULL, NULL);
    assert_true(saved == PBR_OK || saved == PBR_ERROR_FORMAT);
    assert_int_equal(files_in(&bench->folder), saved == PBR_OK ? 2 : 1);
    unlink(bench->folder.other);
}

/* Opens the bytes as a file: an error of the format, explained in one line, or a hierarchy that can be used. */
static pbr_result try_bytes(struct bench *bench, const uint8_t *data, size_t size) {
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.flags = (bench->opened + bench->refused) % 8 ? PBR_LOD_OPEN_READ : 0;
    store_image(bench->folder.file, data, size);
    bench->host.messages = 0;
    const pbr_result result = pbr_lod_open(bench->instance, bench->folder.file, &desc, &lod);
    if (result == PBR_OK) {
        assert_int_equal(bench->host.messages, 0);
        use(bench, lod, size);
        bench->opened++;
    } else {
        assert_true(result == PBR_ERROR_FORMAT || result == PBR_ERROR_UNSUPPORTED); /* another version */
        assert_int_equal(bench->host.messages, 1);
        assert_int_equal(bench->host.level, PBR_LOG_ERROR);
        assert_int_equal(bench->host.code, result);
        assert_null(strchr(bench->host.text, '\n'));
        assert_null(lod);
        bench->refused++;
    }
    pbr_lod_release(&lod);
    return result;
}

static void put(uint8_t *data, size_t offset, int64_t value) {
    const uint32_t bits = (uint32_t)value;
    for (int i = 0; i < 4; i++) data[offset + (size_t)i] = (uint8_t)(bits >> (24 - 8 * i));
}

static uint8_t *copy_of(const struct image *image) {
    uint8_t *copy = malloc(image->size + 64);
    assert_non_null(copy);
    memcpy(copy, image->data, image->size);
    memset(copy + image->size, 0, 64);
    return copy;
}

/* ---- Files ---- */

static void a_file_that_ends_anywhere_is_refused(void **unused) {
    (void)unused;
    for (uint32_t form = PBR_LOD_FILE_PBR; form <= PBR_LOD_FILE_QS; form++) {
        struct bench bench;
        start(&bench, &small, form);
        for (size_t size = 0; size < bench.image.size; size += size < 200 ? 1 : 13)
            if (try_bytes(&bench, bench.image.data, size) == PBR_OK) fail_msg("form %u opens with its first %zu bytes", form, size);
        assert_int_equal(try_bytes(&bench, bench.image.data, bench.image.size), PBR_OK);
        stop(&bench);
    }
}

static void a_header_without_sense_is_refused(void **unused) {
    (void)unused;
    enum { LENGTH = 8, LEAVES = 12, OPTIONS = 16, CENTRE = 20, RADIUS = 32, CHILDREN = 36 };
    static const uint32_t nan_bits = 0x7fc00000, nan_negative = 0xffc00000, infinite = 0x7f800000, minus_one = 0xbf800000;
    struct bench bench;
    start(&bench, &small, PBR_LOD_FILE_QS);
    const int64_t size = (int64_t)bench.image.size;
    const struct {
        size_t offset;
        int64_t value;
    } wrong[] = {{0, 0},
                 {4, 0x20743131}, /* "QSpl t11" */
                 {LENGTH, 0},
                 {LENGTH, -1},
                 {LENGTH, INT32_MIN},
                 {LENGTH, 20},
                 {LENGTH, HEADER - 4},
                 {LENGTH, size + 4},
                 {LENGTH, INT32_MAX},
                 {LEAVES, -1},
                 {LEAVES, INT32_MIN},
                 {CENTRE, nan_bits},
                 {CENTRE + 4, infinite},
                 {CENTRE + 8, nan_negative},
                 {RADIUS, nan_bits},
                 {RADIUS, infinite},
                 {RADIUS, minus_one},
                 {CHILDREN, -1},
                 {CHILDREN, 5},
                 {CHILDREN, INT32_MAX},
                 {CHILDREN, INT32_MIN}};
    for (size_t i = 0; i < COUNT(wrong); i++) {
        uint8_t *copy = copy_of(&bench.image);
        put(copy, wrong[i].offset, wrong[i].value);
        if (try_bytes(&bench, copy, bench.image.size) == PBR_OK)
            fail_msg("a header with %lld at byte %zu opens", (long long)wrong[i].value, wrong[i].offset);
        free(copy);
    }
    stop(&bench);
}

/* Counts that the file cannot hold, other than by being refused, change nothing but themselves. */
static void any_header_does_no_harm(void **unused) {
    (void)unused;
    static const int64_t values[] = {0, 1, 2, 3, 4, 5, 255, 65536, INT32_MAX, INT32_MIN, -1, 0x00800000, 0x7f7fffff, 0x3f800000};
    const struct kind *const some[] = {&small, &uncoloured, &few, &single};
    for (size_t kind = 0; kind < COUNT(some); kind++) {
        struct bench bench;
        start(&bench, some[kind], PBR_LOD_FILE_QS);
        for (size_t offset = 8; offset < HEADER; offset += 4)
            for (size_t i = 0; i < COUNT(values); i++) {
                uint8_t *copy = copy_of(&bench.image);
                put(copy, offset, values[i]);
                try_bytes(&bench, copy, bench.image.size);
                free(copy);
            }
        stop(&bench);
    }
}

static void any_pointer_does_no_harm(void **unused) {
    (void)unused;
    const struct kind *const some[] = {&small, &uncoloured};
    for (size_t kind = 0; kind < COUNT(some); kind++) {
        struct bench bench;
        start(&bench, some[kind], PBR_LOD_FILE_QS);
        const int64_t size = (int64_t)bench.image.size;
        for (size_t i = 0; i < bench.tree.count; i++) {
            const struct qs_node *node = &bench.tree.nodes[i];
            const int64_t at = (int64_t)node->group;
            const int64_t values[] = {0,
                                      1,
                                      -1,
                                      4,
                                      -4,
                                      HEADER - at,
                                      -at,
                                      -at - 1,
                                      at - 44,
                                      size - at,
                                      size - at - 4,
                                      size - 1,
                                      INT32_MAX,
                                      INT32_MIN,
                                      -(at - HEADER) / 2};
            if (!node->has_pointer) continue;
            for (size_t k = i % 3; k < COUNT(values); k += i < 8 ? 1 : 3) {
                uint8_t *copy = copy_of(&bench.image);
                put(copy, node->group, values[k]);
                try_bytes(&bench, copy, bench.image.size);
                free(copy);
            }
        }
        assert_true(bench.opened + bench.refused > 100);
        stop(&bench);
    }
}

static void what_is_below_a_bad_pointer_is_left_out_and_counted(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &small, PBR_LOD_FILE_QS);
    size_t damaged = 0, below = 0;
    for (size_t i = 1; i < bench.tree.count && damaged == 0; i++)
        if (bench.tree.nodes[i].has_pointer) damaged = i;
    assert_true(damaged > 0);
    for (size_t i = 0; i < bench.tree.count; i++)
        for (size_t above = bench.tree.nodes[i].parent; above != 0; above = bench.tree.nodes[above].parent)
            if (above == damaged && bench.tree.nodes[i].children == 0 && bench.tree.nodes[i].parent != damaged) below++;
    uint8_t *copy = copy_of(&bench.image);
    put(copy, bench.tree.nodes[damaged].group, INT32_MAX);
    store_image(bench.folder.file, copy, bench.image.size);
    pbr_lod *lod = open_lod(bench.instance, bench.folder.file, 0);
    struct cut cut = {0};
    struct cut_view view = plain_view(0);
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    assert_int_equal(lod_cut(lod, &view, NULL, NULL, &cut), PBR_OK);
    assert_true(cut.damaged > 0);
    assert_true(cut.count >= bench.tree.leaves - below); /* a node may stand for what it has lost */
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
    assert_true(statistics.damaged > 0);
    assert_int_equal(pbr_lod_save(lod, bench.folder.other, PBR_LOD_FILE_QS, NULL, NULL), PBR_ERROR_FORMAT);
    cut_free(bench.instance, &cut);
    pbr_lod_release(&lod);
    free(copy);
    stop(&bench);
}

/* Groups that all point at the same next ones: four times as many paths with each level. */
static void paths_that_meet_are_not_all_walked(void **unused) {
    (void)unused;
    enum { LEVELS = 30, GROUP = 4 + 4 * 4, SIZE = HEADER + GROUP * (1 + 4 * LEVELS) + 4 * 4 * 4 };
    struct bench bench;
    start(&bench, &uncoloured, PBR_LOD_FILE_QS);
    for (int sphere = 0; sphere < 2; sphere++) {
        uint8_t *data = calloc(SIZE, 1);
        assert_non_null(data);
        memcpy(data, bench.image.data, HEADER);
        put(data, 8, SIZE);
        put(data, 12, sphere ? INT32_MAX : 1000);
        put(data, 36, 4);
        for (size_t group = 0; group < 1 + 4 * LEVELS; group++) {
            const size_t level = (group + 3) / 4, at = HEADER + group * GROUP, next = HEADER + (1 + 4 * level) * GROUP;
            const bool last = level == LEVELS; /* its children's are all leaves */
            put(data, at, (int64_t)(next - at));
            for (size_t i = 0; i < 4; i++) {
                /* Half the size, or all of it, which no threshold stops; four children with four each. */
                const uint32_t code = sphere ? QS_SPHERE_CODES - 1 : 5000;
                put(data, at + 4 + 4 * i, (int64_t)((code << 3 | (last ? 0 : 4) | 3) << 16));
            }
        }
        try_bytes(&bench, data, SIZE);
        free(data);
    }
    stop(&bench);
}

static void any_bytes_do_no_harm(void **unused) {
    (void)unused;
    enum { VARIANTS = 1000 };
    const struct {
        const struct kind *kind;
        uint32_t form;
    } some[] = {{&small, PBR_LOD_FILE_QS},
                {&uncoloured, PBR_LOD_FILE_QS},
                {&few, PBR_LOD_FILE_QS},
                {&small, PBR_LOD_FILE_PBR},
                {&few, PBR_LOD_FILE_PBR}};
    uint64_t state = 3;
    for (size_t i = 0; i < COUNT(some); i++) {
        struct bench bench;
        start(&bench, some[i].kind, some[i].form);
        for (int n = 0; n < VARIANTS; n++) {
            uint8_t *copy = copy_of(&bench.image);
            /* Half of them in the first bytes, where each counts. */
            const size_t within = n % 2 && bench.image.size > 256 ? 256 : bench.image.size, first = n % 4 < 2 ? 0 : HEADER;
            for (int flips = 1 + n % 3; flips > 0; flips--)
                copy[first + (size_t)(uniform(&state) * (double)(within - first))] ^= (uint8_t)(1 + 255 * uniform(&state));
            try_bytes(&bench, copy, bench.image.size);
            free(copy);
        }
        assert_true(bench.refused > 0 && (bench.opened > 0 || some[i].form == PBR_LOD_FILE_PBR));
        stop(&bench);
    }
}

static void what_is_no_hierarchy_is_refused(void **unused) {
    (void)unused;
    static const char *const texts[] = {"", "QSplat11", "ply\nformat ascii 1.0\nend_header\n"};
    struct bench bench;
    start(&bench, &small, PBR_LOD_FILE_QS);
    for (size_t i = 0; i < COUNT(texts); i++)
        assert_int_equal(try_bytes(&bench, (const uint8_t *)texts[i], strlen(texts[i])), PBR_ERROR_FORMAT);
    /* A comment alone. */
    assert_int_equal(try_bytes(&bench, (const uint8_t *)"QSplat11\0\0\0\x18\0\0\0\0\0\0\0\2hey", 24), PBR_ERROR_FORMAT);
    unlink(bench.folder.file);
    pbr_lod *lod = NULL;
    bench.host.messages = 0;
    assert_int_equal(pbr_lod_open(bench.instance, bench.folder.file, NULL, &lod), PBR_ERROR_IO);
    assert_int_equal(bench.host.messages, 1);
    assert_null(lod);
    stop(&bench);
}

/* ---- Memory ---- */

/* What a call that may run out of memory works on. */
struct memory_work {
    pbr_points *points;
    pbr_lod *lod;
    const char *path;
    uint32_t form;
    bool mapped;
};

static pbr_result create_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.points = work->points;
    const pbr_result result = pbr_lod_create(instance, &desc, &lod);
    assert_true((result == PBR_OK) == (lod != NULL));
    pbr_lod_release(&lod);
    return result;
}

static pbr_result open_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.flags = work->mapped ? 0 : PBR_LOD_OPEN_READ;
    const pbr_result result = pbr_lod_open(instance, work->path, &desc, &lod);
    assert_true((result == PBR_OK) == (lod != NULL));
    pbr_lod_release(&lod);
    return result;
}

static pbr_result cut_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    struct cut cut = {0};
    struct cut_view view = plain_view(0);
    const pbr_result result = lod_cut(work->lod, &view, NULL, NULL, &cut);
    cut_free(instance, &cut);
    return result;
}

static pbr_result measure_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    (void)instance;
    return pbr_lod_measure(work->lod, NULL, NULL, &statistics);
}

static pbr_result convert_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    pbr_points *points = NULL;
    (void)instance;
    const pbr_result result = pbr_lod_to_points(work->lod, NULL, NULL, &points);
    pbr_points_release(&points);
    return result;
}

static pbr_result save_it(pbr_instance *instance, void *user) {
    struct memory_work *work = user;
    (void)instance;
    unlink(work->path);
    const pbr_result result = pbr_lod_save(work->lod, work->path, work->form, NULL, NULL);
    assert_int_equal(access(work->path, F_OK), result == PBR_OK ? 0 : -1);
    return result;
}

static void memory_that_runs_out_leaves_nothing_behind(void **unused) {
    (void)unused;
    const struct kind *const some[] = {&small, &few, &(const struct kind){"a sphere", SPHERE, 5000, 0}};
    for (size_t i = 0; i < COUNT(some); i++)
        for (uint32_t threads = 1; threads <= 4; threads += 3) {
            struct host host;
            pbr_instance *instance = host_start(&host, threads);
            struct folder folder = make_folder();
            struct surface surface = make_surface(some[i]);
            struct memory_work work = {.path = folder.other, .points = surface_points(instance, &surface)};
            fail_every_allocation(&host, instance, create_it, &work);
            work.lod = surface_lod(instance, &surface);
            fail_every_allocation(&host, instance, cut_it, &work);
            fail_every_allocation(&host, instance, measure_it, &work);
            fail_every_allocation(&host, instance, convert_it, &work);
            for (work.form = PBR_LOD_FILE_PBR; work.form <= PBR_LOD_FILE_QS; work.form++) {
                fail_every_allocation(&host, instance, save_it, &work);
                work.mapped = !work.mapped;
                fail_every_allocation(&host, instance, open_it, &work);
            }
            pbr_lod_release(&work.lod);
            pbr_points_release(&work.points);
            free_surface(&surface);
            remove_folder(&folder);
            host_stop(&host, instance);
        }
}

/* A cut that failed for want of memory is whole the next time. */
static void a_cut_goes_on_after_memory_ran_out(void **unused) {
    (void)unused;
    static const struct kind kind = {"a sphere", SPHERE, 20000, 0};
    struct host host;
    pbr_instance *instance = host_start(&host, 4);
    struct surface surface = make_surface(&kind);
    pbr_lod *lod = surface_lod(instance, &surface);
    struct cut cut = {0};
    for (long n = 1; n < 20; n++) {
        struct cut_view view = plain_view(n % 2 ? 0 : 1);
        if (n % 5 == 0) cut_free(instance, &cut);
        atomic_store(&host.fail_at, n / 3);
        const pbr_result result = lod_cut(lod, &view, NULL, NULL, &cut);
        const bool failed = n / 3 > 0 && atomic_load(&host.fail_at) <= 0;
        atomic_store(&host.fail_at, 0);
        assert_int_equal(result, failed ? PBR_ERROR_OUT_OF_MEMORY : PBR_OK);
        view.threshold = 0;
        assert_int_equal(lod_cut(lod, &view, NULL, NULL, &cut), PBR_OK);
        assert_int_equal(cut.count, kind.count);
    }
    cut_free(instance, &cut);
    pbr_lod_release(&lod);
    free_surface(&surface);
    host_stop(&host, instance);
}

/* ---- Cancelling ---- */

struct calls {
    int left; /* until it is cancelled */
    int made;
    char stage[64];
    double fraction;
};

static int count_down(void *user, const char *stage, double fraction) {
    struct calls *calls = user;
    assert_true(fraction >= 0 && fraction <= 1);
    if (strncmp(stage, calls->stage, sizeof calls->stage - 1) == 0) assert_true(fraction >= calls->fraction);
    snprintf(calls->stage, sizeof calls->stage, "%s", stage);
    calls->fraction = fraction;
    calls->made++;
    return --calls->left != 0;
}

struct cancelled {
    struct host host;
    pbr_instance *instance;
    struct folder folder;
    pbr_points *points;
    pbr_lod *lod;
};

static pbr_result create_reporting(struct cancelled *c, struct calls *calls) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.points = c->points;
    desc.progress = count_down;
    desc.progress_user = calls;
    const pbr_result result = pbr_lod_create(c->instance, &desc, &lod);
    assert_true((result == PBR_OK) == (lod != NULL));
    pbr_lod_release(&lod);
    return result;
}

static pbr_result save_reporting(struct cancelled *c, struct calls *calls, uint32_t form) {
    static const char old[] = "what was there";
    store_image(c->folder.file, (const uint8_t *)old, sizeof old);
    const pbr_result result = pbr_lod_save(c->lod, c->folder.file, form, count_down, calls);
    assert_int_equal(files_in(&c->folder), 1);
    struct image image = load_image(c->folder.file);
    const bool same = image.size == sizeof old && memcmp(image.data, old, sizeof old) == 0;
    assert_int_equal(same, result != PBR_OK);
    free(image.data);
    return result;
}

static pbr_result save_qs_reporting(struct cancelled *c, struct calls *calls) {
    return save_reporting(c, calls, PBR_LOD_FILE_QS);
}

static pbr_result save_pbr_reporting(struct cancelled *c, struct calls *calls) {
    return save_reporting(c, calls, PBR_LOD_FILE_PBR);
}

static pbr_result measure_reporting(struct cancelled *c, struct calls *calls) {
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    return pbr_lod_measure(c->lod, count_down, calls, &statistics);
}

static pbr_result convert_reporting(struct cancelled *c, struct calls *calls) {
    pbr_points *points = NULL;
    const pbr_result result = pbr_lod_to_points(c->lod, count_down, calls, &points);
    assert_true((result == PBR_OK) == (points != NULL));
    pbr_points_release(&points);
    return result;
}

static void cancelled_work_leaves_nothing_behind(void **unused) {
    (void)unused;
    static const struct kind kind = {"a torus", TORUS, 40000, 0};
    pbr_result (*const works[])(struct cancelled *, struct calls *) = {create_reporting, save_qs_reporting, save_pbr_reporting,
                                                                       measure_reporting, convert_reporting};
    struct cancelled c = {.folder = make_folder()};
    c.instance = host_start(&c.host, 2);
    struct surface surface = make_surface(&kind);
    c.points = surface_points(c.instance, &surface);
    c.lod = surface_lod(c.instance, &surface);
    const long live = atomic_load(&c.host.live);
    for (size_t i = 0; i < COUNT(works); i++)
        for (int n = 1;; n++) {
            struct calls calls = {.left = n};
            const pbr_result result = works[i](&c, &calls);
            assert_int_equal(atomic_load(&c.host.live), live);
            if (result == PBR_OK) {
                assert_true(n > 1 && calls.made < n); /* it asked, how often depends on the threads, and heard no no */
                break;
            }
            assert_int_equal(result, PBR_ERROR_CANCELLED);
            assert_int_equal(calls.made, n); /* nor did it ask again */
            assert_true(n < 1000);           /* "a few dozen times per stage" */
        }
    pbr_lod_release(&c.lod);
    pbr_points_release(&c.points);
    free_surface(&surface);
    remove_folder(&c.folder);
    host_stop(&c.host, c.instance);
}

/* ---- Arguments ---- */

static void wrong_arguments_are_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &few, PBR_LOD_FILE_QS);
    struct surface surface = make_surface(&few);
    pbr_points *points = surface_points(bench.instance, &surface);
    pbr_lod *lod = NULL, *good = open_lod(bench.instance, bench.folder.file, 0);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod_open_desc open = PBR_LOD_OPEN_DESC_INIT;
    assert_int_equal(pbr_lod_create(bench.instance, &desc, &lod), PBR_ERROR_INVALID_ARGUMENT); /* no points */
    desc.points = points;
    desc.flags = PBR_LOD_NORMAL_FIELDS << 1;
    assert_int_equal(pbr_lod_create(bench.instance, &desc, &lod), PBR_ERROR_INVALID_ARGUMENT);
    desc.flags = 0;
    desc.kind = 99;
    assert_int_equal(pbr_lod_create(bench.instance, &desc, &lod), PBR_ERROR_INVALID_ARGUMENT);
    desc.kind = 0;
    assert_int_equal(pbr_lod_create(bench.instance, &desc, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_create(bench.instance, NULL, &lod), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_open(bench.instance, NULL, NULL, &lod), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_open(bench.instance, bench.folder.file, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    open.flags = 1u << 31;
    assert_int_equal(pbr_lod_open(bench.instance, bench.folder.file, &open, &lod), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_save(good, bench.folder.other, PBR_LOD_FILE_NONE, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_save(good, bench.folder.other, 99, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_save(good, NULL, PBR_LOD_FILE_QS, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_lod_save(good, "/nowhere/at/all", PBR_LOD_FILE_QS, NULL, NULL), PBR_ERROR_IO);
    assert_null(lod);
    pbr_lod *again = pbr_lod_retain(good);
    assert_ptr_equal(again, good);
    pbr_lod_release(&again);
    assert_null(again);
    pbr_lod_release(&again);
    pbr_lod_release(NULL);
    assert_null(pbr_lod_retain(NULL));
    assert_int_equal(pbr_instance_destroy(&bench.instance), PBR_ERROR_BUSY);
    pbr_lod_release(&good);
    pbr_points_release(&points);
    free_surface(&surface);
    stop(&bench);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_file_that_ends_anywhere_is_refused),
                                       cmocka_unit_test(a_header_without_sense_is_refused),
                                       cmocka_unit_test(any_header_does_no_harm),
                                       cmocka_unit_test(any_pointer_does_no_harm),
                                       cmocka_unit_test(what_is_below_a_bad_pointer_is_left_out_and_counted),
                                       cmocka_unit_test(paths_that_meet_are_not_all_walked),
                                       cmocka_unit_test(any_bytes_do_no_harm),
                                       cmocka_unit_test(what_is_no_hierarchy_is_refused),
                                       cmocka_unit_test(memory_that_runs_out_leaves_nothing_behind),
                                       cmocka_unit_test(a_cut_goes_on_after_memory_ran_out),
                                       cmocka_unit_test(cancelled_work_leaves_nothing_behind),
                                       cmocka_unit_test(wrong_arguments_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
