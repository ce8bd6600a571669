/* POP hierarchies as the library's objects: made, stored, opened, damaged. SPDX-License-Identifier: MIT */
#include "qs_trees.h"

#include <float.h>

#include "cameras.h"
#include "lod/cut.h"
#include "lod/lod.h"
#include "lod/pop_cut.h"

/* ---- Meshes ---- */

enum {
    COLOURED = 1,
    AWAY = 2,   /* metres, far from zero */
    IN_ONE = 4, /* all vertices are in one place */
    STRAYS = 8  /* vertices that no triangle has: far off, and not finite */
};

/* A torus of radii 1 and 0.4: columns x rows cells of two triangles each; or one triangle. */
struct shape_of_mesh {
    uint32_t columns, rows;
    unsigned flags;
    double scale;
};

static const struct shape_of_mesh torus = {40, 30, COLOURED, 1}, bare = {13, 11, 0, 1}, survey = {20, 15, COLOURED | AWAY, 50},
                                  single = {0, 0, 0, 1}, clump = {20, 10, COLOURED | IN_ONE, 1}, strays = {8, 5, STRAYS, 1},
                                  huge = {12, 9, 0, 0.35e18}, tiny = {12, 9, COLOURED, 1e-25};
static const struct shape_of_mesh *const shapes[] = {&torus, &bare, &survey, &single, &clump, &strays, &huge, &tiny};

static uint32_t triangles_of(const struct shape_of_mesh *shape) {
    return shape->columns > 0 ? 2 * shape->columns * shape->rows : 1;
}

static uint32_t vertices_of(const struct shape_of_mesh *shape) {
    return (shape->columns > 0 ? shape->columns * shape->rows : 3) + (shape->flags & STRAYS ? 3 : 0);
}

static void place_vertices(const struct shape_of_mesh *shape, double (*positions)[3], uint8_t (*colours)[4]) {
    static const double origin[3] = {500000.25, 5400000.125, 300}, corners[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}};
    static const double far_off[3][3] = {{1e300, 0, 0}, {NAN, 0, 0}, {0, INFINITY, 0}};
    const uint32_t count = vertices_of(shape), grid = shape->columns * shape->rows;
    const double circle = 2 * acos(-1);
    for (uint32_t i = 0; i < count; i++) {
        const double a = circle * (double)(i % (shape->columns + 1)) / (shape->columns + 1.0);
        const double u = shape->columns ? circle * (double)(i % shape->columns) / shape->columns : 0;
        const double v = shape->columns ? circle * (double)(i / shape->columns) / shape->rows : 0;
        double p[3] = {(1 + 0.4 * cos(v)) * cos(u), 0.4 * sin(v), (1 + 0.4 * cos(v)) * sin(u)};
        if (shape->columns == 0) memcpy(p, corners[i], sizeof p);
        else if (i >= grid) memcpy(p, far_off[i - grid], sizeof p);
        else if (shape->flags & IN_ONE) p[0] = 0.3, p[1] = -0.2, p[2] = 0.1;
        for (int k = 0; k < 3; k++) {
            positions[i][k] = shape->scale * p[k] + (shape->flags & AWAY ? origin[k] : 0);
            colours[i][k] = (uint8_t)(127 + 100 * sin(a + k));
        }
        colours[i][3] = 255;
    }
}

static void join_vertices(const struct shape_of_mesh *shape, uint32_t (*triangles)[3]) {
    const uint32_t columns = shape->columns, rows = shape->rows;
    for (uint32_t k = 0; k < 3 && columns == 0; k++) triangles[0][k] = k;
    for (uint32_t i = 0; i < columns * rows; i++) {
        const uint32_t right = i / columns * columns + (i + 1) % columns, below = (i + columns) % (columns * rows);
        const uint32_t across = below / columns * columns + (below + 1) % columns;
        triangles[2 * i][0] = i, triangles[2 * i][1] = below, triangles[2 * i][2] = across;
        triangles[2 * i + 1][0] = i, triangles[2 * i + 1][1] = across, triangles[2 * i + 1][2] = right;
    }
}

static pbr_mesh *mesh_of(pbr_instance *instance, const struct shape_of_mesh *shape) {
    const uint32_t count = vertices_of(shape);
    double(*positions)[3] = malloc(count * sizeof *positions);
    uint8_t(*colours)[4] = malloc(count * sizeof *colours);
    uint32_t(*triangles)[3] = malloc(triangles_of(shape) * sizeof *triangles);
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    assert_true(positions && colours && triangles);
    place_vertices(shape, positions, colours);
    join_vertices(shape, triangles);
    desc.vertex_count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    if (shape->flags & COLOURED) desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 4};
    desc.indices = triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = triangles_of(shape);
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    free(positions);
    free(colours);
    free(triangles);
    return mesh;
}

static pbr_mesh *empty_mesh(pbr_instance *instance) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_mesh *mesh = NULL;
    assert_int_equal(pbr_mesh_create(instance, &desc, &mesh), PBR_OK);
    return mesh;
}

static pbr_lod *pop_lod(pbr_instance *instance, const pbr_mesh *mesh) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.kind = PBR_LOD_POP;
    desc.mesh = mesh;
    assert_int_equal(pbr_lod_create(instance, &desc, &lod), PBR_OK);
    return lod;
}

/* The mesh is released at once: the hierarchy needs it no longer. */
static pbr_lod *lod_of(pbr_instance *instance, const struct shape_of_mesh *shape) {
    pbr_mesh *mesh = mesh_of(instance, shape);
    pbr_lod *lod = pop_lod(instance, mesh);
    pbr_mesh_release(&mesh);
    return lod;
}

/* ---- Views ---- */

/* Towards the centre, `turn` radians around it, `distance` radii away; of a window of 800 x 600 pixels. */
static struct cut_view view_of(const pbr_lod *lod, double turn, double distance, double threshold, bool culls) {
    enum { WIDTH = 800, HEIGHT = 600 };
    const double radius = lod_radius(lod) > 0 ? lod_radius(lod) : 1, focal = 1.5, away = distance * radius;
    const double to_eye[16] = {cos(turn), 0, sin(turn), 0, 0, 1, 0, 0, -sin(turn), 0, cos(turn), 0, 0, 0, -away, 1};
    struct cut_view view = {.size_per_radius = focal * HEIGHT,
                            .node_size_per_radius = focal * HEIGHT,
                            .size_minimum = 1,
                            .size_maximum = 1e18,
                            .point_limit = 64,
                            .viewport = {WIDTH, HEIGHT},
                            .eye = {away * sin(turn), 0, away * cos(turn), 1},
                            .culls = culls,
                            .threshold = threshold};
    perspective(focal, (double)WIDTH / HEIGHT, 0.01 * radius, 10 * radius, view.projection);
    matrix_multiply(view.projection, to_eye, view.to_clip);
    memcpy(view.to_eye, to_eye, sizeof to_eye);
    return view;
}

struct drawn {
    struct cut cut;
    struct splat *records;
    uint32_t (*triangles)[3];
};

/* `drawn`: zero, or of the last view. */
static void draw(const pbr_lod *lod, const struct cut_view *view, struct drawn *drawn) {
    assert_int_equal(lod_cut(lod, view, NULL, NULL, &drawn->cut), PBR_OK);
    assert_true(drawn->cut.points_only <= drawn->cut.count);
    free(drawn->records);
    free(drawn->triangles);
    /* Of no more than is said: the address sanitizer would notice. */
    drawn->records = malloc((drawn->cut.count ? drawn->cut.count : 1) * sizeof *drawn->records);
    drawn->triangles = malloc((drawn->cut.triangle_count ? drawn->cut.triangle_count : 1) * sizeof *drawn->triangles);
    assert_true(drawn->records && drawn->triangles);
    lod_gather(lod, &drawn->cut, drawn->records, drawn->triangles);
}

static void drop(pbr_instance *instance, struct drawn *drawn) {
    cut_free(instance, &drawn->cut);
    free(drawn->records);
    free(drawn->triangles);
}

static void assert_same_drawn(const struct drawn *a, const struct drawn *b) {
    assert_int_equal(a->cut.count, b->cut.count);
    assert_int_equal(a->cut.points_only, b->cut.points_only);
    assert_int_equal(a->cut.triangle_count, b->cut.triangle_count);
    assert_int_equal(a->cut.visited, b->cut.visited);
    assert_int_equal(a->cut.culled, b->cut.culled);
    assert_true(a->cut.nearness == b->cut.nearness);
    if (a->cut.count > 0) assert_memory_equal(a->records, b->records, a->cut.count * sizeof *a->records);
    if (a->cut.triangle_count > 0) assert_memory_equal(a->triangles, b->triangles, a->cut.triangle_count * sizeof *a->triangles);
}

/* From far to within, by thresholds that draw triangles, points, and both. Returns how many cuts drew points and triangles. */
static int assert_same_cuts(pbr_instance *instance, const pbr_lod *a, const pbr_lod *b) {
    static const double distances[] = {20, 3, 1.2, 0.5}, thresholds[] = {0, 1, 12, 300};
    struct drawn first = {.records = NULL}, second = {.records = NULL};
    int mixed = 0;
    for (size_t d = 0; d < COUNT(distances); d++)
        for (size_t t = 0; t < COUNT(thresholds); t++) {
            const struct cut_view view = view_of(a, 0.7 * (double)(d + t), distances[d], thresholds[t], t % 2);
            draw(a, &view, &first);
            draw(b, &view, &second);
            assert_same_drawn(&first, &second);
            mixed += first.cut.count > 0 && first.cut.triangle_count > 0;
        }
    drop(instance, &first);
    drop(instance, &second);
    return mixed;
}

/* ---- Whole ---- */

static void assert_same(const pbr_lod *a, const pbr_lod *b) {
    const struct pop *p = &a->pop, *q = &b->pop;
    pbr_lod_statistics first = PBR_LOD_STATISTICS_INIT, second = PBR_LOD_STATISTICS_INIT;
    assert_memory_equal(&a->outline, &b->outline, sizeof a->outline);
    assert_memory_equal(&p->shape, &q->shape, sizeof p->shape);
    assert_int_equal(p->vertex_count, q->vertex_count);
    assert_true(p->position_step == q->position_step && p->radius_step == q->radius_step);
    if (p->shape.nodes > 0) {
        assert_memory_equal(p->nodes, q->nodes, p->shape.nodes * sizeof *p->nodes);
        assert_memory_equal(p->triangles, q->triangles, a->outline.triangles * sizeof *p->triangles);
        assert_memory_equal(p->vertices, q->vertices, p->vertex_count * sizeof *p->vertices);
    }
    assert_int_equal(pbr_lod_measure(a, NULL, NULL, &first), PBR_OK);
    assert_int_equal(pbr_lod_measure(b, NULL, NULL, &second), PBR_OK);
    assert_memory_equal(&first, &second, sizeof first);
}

static void assert_same_files(const struct folder *folder) {
    struct image first = load_image(folder->file), second = load_image(folder->other);
    assert_int_equal(first.size, second.size);
    assert_memory_equal(first.data, second.data, first.size);
    free(first.data);
    free(second.data);
}

static void give_back(pbr_instance *instance, const struct folder *folder, const pbr_lod *lod, bool mixes) {
    assert_int_equal(pbr_lod_save(lod, folder->file, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
    for (uint32_t flags = 0; flags <= PBR_LOD_OPEN_READ; flags++) {
        pbr_lod *opened = open_lod(instance, folder->file, flags);
        pbr_lod_info info = PBR_LOD_INFO_INIT;
        assert_same(lod, opened);
        assert_int_equal(assert_same_cuts(instance, lod, opened) > 0, mixes);
        assert_int_equal(pbr_lod_get_info(opened, &info), PBR_OK);
        assert_int_equal(info.kind, PBR_LOD_POP);
        assert_int_equal(info.file_format, PBR_LOD_FILE_PBR);
        assert_int_equal(info.is_mapped, !flags);
        assert_int_equal(pbr_lod_save(opened, folder->other, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
        assert_same_files(folder);
        pbr_lod_release(&opened);
    }
}

static void files_give_back_what_was_saved(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    for (size_t i = 0; i < COUNT(shapes); i++) {
        pbr_lod *lod = lod_of(instance, shapes[i]);
        give_back(instance, &folder, lod, shapes[i]->columns > 0 && !(shapes[i]->flags & IN_ONE));
        pbr_lod_release(&lod);
    }
    pbr_mesh *empty = empty_mesh(instance);
    pbr_lod *nothing = pop_lod(instance, empty);
    give_back(instance, &folder, nothing, false);
    pbr_lod_release(&nothing);
    pbr_mesh_release(&empty);
    assert_int_equal(host.messages, 0);
    remove_folder(&folder);
    host_stop(&host, instance);
}

static void it_is_described_and_counted(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(shapes); i++) {
        pbr_mesh *mesh = mesh_of(instance, shapes[i]);
        pbr_lod *lod = pop_lod(instance, mesh);
        pbr_lod_info info = PBR_LOD_INFO_INIT;
        pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
        const uint64_t triangles = triangles_of(shapes[i]);
        uint64_t parents = 0, children = 0, nodes = 0, cones = 0;
        assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
        assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
        assert_int_equal(info.point_count, triangles);
        assert_int_equal(info.triangle_count, triangles);
        assert_int_equal(info.vertex_count, vertices_of(shapes[i]));
        assert_int_equal(lod_triangle_count(lod), triangles);
        assert_int_equal(info.has_colours, (shapes[i]->flags & COLOURED) != 0);
        assert_true(info.radius >= info.bounding_radius);
        /* Of a triangle alone 0.56, of the torus 1.4. */
        if (!(shapes[i]->flags & IN_ONE))
            assert_true(info.bounding_radius > 0.5 * shapes[i]->scale && info.bounding_radius < 1.5 * shapes[i]->scale);
        assert_int_equal(statistics.leaves, triangles);
        for (size_t k = 0; k < 5; k++) parents += statistics.children[k], children += k * statistics.children[k];
        for (size_t k = 0; k < PBR_LOD_LEVELS; k++) nodes += statistics.level_nodes[k];
        for (size_t k = 0; k < 4; k++) cones += statistics.cones[k];
        assert_int_equal(nodes, statistics.nodes);
        assert_int_equal(cones, statistics.nodes);
        assert_int_equal(parents + triangles, statistics.nodes);
        assert_int_equal(children + 1, statistics.nodes);
        assert_int_equal(statistics.level_nodes[0], 1);
        assert_int_equal(statistics.level_nodes[statistics.levels], triangles);
        assert_int_equal(info.data_bytes, 12 * statistics.nodes + 12 * triangles + 24 * (uint64_t)vertices_of(shapes[i]));
        assert_true(info.memory_bytes >= info.data_bytes);
        pbr_lod_release(&lod);
        pbr_mesh_release(&mesh);
    }
    host_stop(&host, instance);
}

struct vertices {
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
};

static struct vertices make_vertices(size_t count) {
    struct vertices v = {malloc(count * sizeof *v.positions), malloc(count * sizeof *v.normals), malloc(count * sizeof *v.radii),
                         malloc(count * sizeof *v.colours)};
    assert_true(v.positions && v.normals && v.radii && v.colours);
    return v;
}

static void free_vertices(struct vertices *v) {
    free(v->positions);
    free(v->normals);
    free(v->radii);
    free(v->colours);
}

static void vertices_become_points(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (size_t i = 0; i < COUNT(shapes); i++) {
        const size_t count = vertices_of(shapes[i]), joined = count - (shapes[i]->flags & STRAYS ? 3 : 0);
        const bool coloured = shapes[i]->flags & COLOURED;
        pbr_mesh *mesh = mesh_of(instance, shapes[i]);
        pbr_lod *lod = pop_lod(instance, mesh);
        pbr_points *points = NULL;
        pbr_points_info info = PBR_POINTS_INFO_INIT;
        struct vertices given = make_vertices(count), got = make_vertices(count);
        pbr_mesh_copy_desc from_mesh = PBR_MESH_COPY_DESC_INIT;
        pbr_points_copy_desc from_points = PBR_POINTS_COPY_DESC_INIT;
        assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &points), PBR_OK);
        assert_int_equal(pbr_points_get_info(points, &info), PBR_OK);
        assert_int_equal(info.count, count);
        assert_int_equal(info.has_colours, coloured);
        assert_true(info.has_normals || shapes[i]->flags & IN_ONE);
        from_mesh.vertex_count = count;
        from_mesh.positions = *given.positions;
        from_mesh.normals = *given.normals;
        from_mesh.colours = coloured ? *given.colours : NULL;
        from_points.positions = *got.positions;
        from_points.normals = info.has_normals ? *got.normals : NULL;
        from_points.colours = coloured ? *got.colours : NULL;
        from_points.radii = got.radii;
        assert_int_equal(pbr_mesh_copy(mesh, &from_mesh), PBR_OK);
        assert_int_equal(pbr_points_copy(points, 0, count, &from_points), PBR_OK);
        for (size_t k = 0; k < joined; k++) {
            /* Two roundings of coordinates to floats, relative to different places; of codes of normals, 6.5e-5 each. */
            assert_true(distance3(given.positions[k], got.positions[k]) <= 1e-6 * shapes[i]->scale);
            if (coloured) assert_memory_equal(given.colours[k], got.colours[k], 4);
            for (int c = 0; c < 3 && info.has_normals; c++) assert_true(fabsf(given.normals[k][c] - got.normals[k][c]) < 2e-4f);
            /* A triangle's ball; of the coarsest mesh here 0.7. Steps are no smaller than 8e-25. */
            assert_true(got.radii[k] >= 0 && (double)got.radii[k] < 0.9 * shapes[i]->scale + 1e-23);
            assert_true(got.radii[k] > 0 || shapes[i]->flags & IN_ONE);
        }
        free_vertices(&given);
        free_vertices(&got);
        pbr_points_release(&points);
        pbr_lod_release(&lod);
        pbr_mesh_release(&mesh);
    }
    host_stop(&host, instance);
}

/* A cut that is kept from view to view is that of the file's hierarchy as it is of the one in memory. */
static void cuts_that_are_kept_are_the_same_from_a_file(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct folder folder = make_folder();
    pbr_lod *lod = lod_of(instance, &torus);
    struct drawn first = {.records = NULL}, second = {.records = NULL}, anew = {.records = NULL};
    assert_int_equal(pbr_lod_save(lod, folder.file, PBR_LOD_FILE_PBR, NULL, NULL), PBR_OK);
    pbr_lod *opened = open_lod(instance, folder.file, 0);
    uint64_t visited = 0, visited_anew = 0;
    for (int i = 0; i < 60; i++) {
        const struct cut_view view = view_of(lod, 0.0002 * i, 2.5 - 0.001 * i, 6, true);
        draw(lod, &view, &first);
        draw(opened, &view, &second);
        assert_same_drawn(&first, &second);
        visited += second.cut.visited;
        drop(instance, &anew);
        anew = (struct drawn){.records = NULL};
        draw(opened, &view, &anew);
        anew.cut.visited = second.cut.visited; /* of the root, and not */
        anew.cut.culled = second.cut.culled;
        assert_same_drawn(&second, &anew);
        visited_anew += anew.cut.front->visited;
    }
    assert_true(visited < visited_anew / 2);
    drop(instance, &first);
    drop(instance, &second);
    drop(instance, &anew);
    pbr_lod_release(&opened);
    pbr_lod_release(&lod);
    remove_folder(&folder);
    host_stop(&host, instance);
}

/* ---- Refused ---- */

static pbr_result no_points(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    (void)user, (void)first, (void)count, (void)batch;
    return PBR_ERROR_IO; /* is not asked */
}

static void assert_refused(struct host *host, pbr_result result, pbr_result wanted, const char *word) {
    assert_int_equal(result, wanted);
    assert_int_equal(host->messages, 1);
    assert_int_equal(host->code, wanted);
    if (!strstr(host->text, word) || strchr(host->text, '\n')) fail_msg("not about %s: %s", word, host->text);
    host->messages = 0;
}

static void what_it_cannot_do_is_refused_with_a_reason(void **unused) {
    (void)unused;
    struct host host, other_host;
    pbr_instance *instance = host_start(&host, 1), *other = host_start(&other_host, 1);
    struct folder folder = make_folder();
    pbr_mesh *mesh = mesh_of(instance, &torus), *others = mesh_of(other, &single);
    pbr_points *points = NULL;
    pbr_lod *lod = pop_lod(instance, mesh), *none = NULL;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod_build_desc build = PBR_LOD_BUILD_DESC_INIT;
    assert_int_equal(pbr_mesh_to_points(mesh, NULL, &points), PBR_OK);
    desc.kind = PBR_LOD_POP;
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "mesh is NULL");
    desc.points = points;
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "mesh is NULL");
    desc.mesh = mesh;
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "points is given");
    desc.points = NULL;
    desc.mesh = others;
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "another instance");
    /* A description from before there were meshes asks for none. */
    desc.mesh = mesh;
    desc.struct_size = offsetof(pbr_lod_desc, mesh);
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "mesh is NULL");
    desc.struct_size = sizeof desc;
    for (uint32_t kind = PBR_LOD_QSPLAT; kind <= PBR_LOD_SPT; kind++) {
        desc.kind = kind;
        assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "points is NULL");
        desc.points = points;
        assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "mesh is given");
        desc.points = NULL;
    }
    desc.kind = PBR_LOD_POP + 1;
    assert_refused(&host, pbr_lod_create(instance, &desc, &none), PBR_ERROR_INVALID_ARGUMENT, "kind");
    assert_null(none);
    assert_refused(&host, pbr_lod_save(lod, folder.file, PBR_LOD_FILE_QS, NULL, NULL), PBR_ERROR_INVALID_ARGUMENT, folder.file);
    build.kind = PBR_LOD_POP;
    build.source = no_points;
    build.point_count = 1;
    assert_refused(&host, pbr_lod_build_file(instance, &build, folder.file), PBR_ERROR_UNSUPPORTED, "in memory only");
    assert_int_equal(files_in(&folder), 0);
    assert_true(lod_can_be_cut(lod));
    pbr_lod_release(&lod);
    pbr_points_release(&points);
    pbr_mesh_release(&mesh);
    pbr_mesh_release(&others);
    remove_folder(&folder);
    host_stop(&host, instance);
    host_stop(&other_host, other);
}

static void meshes_past_what_floats_hold_are_refused(void **unused) {
    (void)unused;
    static const struct shape_of_mesh far = {12, 9, 0, 1e19};
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_mesh *mesh = mesh_of(instance, &far);
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.kind = PBR_LOD_POP;
    desc.mesh = mesh;
    assert_refused(&host, pbr_lod_create(instance, &desc, &lod), PBR_ERROR_LIMIT, "limit");
    assert_null(lod);
    pbr_mesh_release(&mesh);
    host_stop(&host, instance);
}

/* ---- Damage ---- */

/* All that can be asked of an opened hierarchy ends, within its bytes. */
static void use(pbr_instance *instance, const pbr_lod *lod) {
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_points *points = NULL;
    struct drawn drawn = {.records = NULL};
    assert_int_equal(pbr_lod_get_info(lod, &info), PBR_OK);
    assert_true(isfinite(info.radius) && isfinite(info.bounding_radius));
    assert_true(isfinite(info.centre[0]) && isfinite(info.centre[1]) && isfinite(info.centre[2]));
    assert_int_equal(pbr_lod_measure(lod, NULL, NULL, &statistics), PBR_OK);
    assert_true(isfinite(statistics.leaf_radius_mean));
    assert_int_equal(pbr_lod_to_points(lod, NULL, NULL, &points), PBR_OK);
    pbr_points_release(&points);
    /* From each to the next, and the last from the root again. */
    for (int i = 0; i < 6; i++) {
        const struct cut_view view = view_of(lod, 0.01 * i, 1.5 - 0.001 * i, i < 4 ? 3 : 0, i % 2);
        draw(lod, &view, &drawn);
        assert_true(drawn.cut.visited <= 2 * statistics.nodes); /* nodes, and those above that are looked at with them */
        assert_true(drawn.cut.triangle_count <= statistics.leaves && drawn.cut.count <= statistics.nodes);
        for (size_t k = 0; k < drawn.cut.count; k++) {
            const struct splat *s = &drawn.records[k];
            assert_true(isfinite(s->position[0]) && isfinite(s->position[1]) && isfinite(s->position[2]));
            assert_true(s->radius >= 0 && isfinite(s->radius));
        }
        for (size_t k = 0; k < drawn.cut.triangle_count; k++)
            for (int c = 0; c < 3; c++) assert_true(drawn.triangles[k][c] < lod->pop.vertex_count);
    }
    drop(instance, &drawn);
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
        use(instance, lod);
    } else {
        assert_true(result == PBR_ERROR_FORMAT || result == PBR_ERROR_UNSUPPORTED);
        assert_int_equal(host->messages, 1);
        assert_int_equal(host->code, result);
        assert_int_equal(strncmp(host->text, folder->file, strlen(folder->file)), 0);
        assert_null(strchr(host->text, '\n'));
        assert_null(lod);
    }
    pbr_lod_release(&lod);
    return result == PBR_OK;
}

/* Places in a file (docs/qsplat.md, docs/pop.md). */
enum { FILE_HEADER = 32, FIRST_SUM = FILE_HEADER + 24, SECTION = 4096, SECTION_HEADER = 72 };

static const uint64_t SUM_START = UINT64_C(0xcbf29ce484222325);

static uint64_t fnv(const uint8_t *p, size_t size, uint64_t sum) {
    for (size_t i = 0; i < size; i++) sum = (sum ^ p[i]) * UINT64_C(0x100000001b3);
    return sum;
}

static void mend_head(uint8_t *data) {
    const uint64_t head = fnv(data + FILE_HEADER, 40, fnv(data, 24, SUM_START));
    memcpy(data + 24, &head, 8);
}

/* Whoever means harm gets the sums right. */
static void mend(uint8_t *data) {
    const uint64_t first = fnv(data + SECTION, SECTION_HEADER, SUM_START);
    memcpy(data + FIRST_SUM, &first, 8);
    mend_head(data);
}

struct bench {
    struct host host;
    pbr_instance *instance;
    struct folder folder;
    struct image image;
    size_t nodes, triangles, vertices; /* where they begin */
};

static void start(struct bench *bench, const struct shape_of_mesh *shape) {
    bench->instance = host_start(&bench->host, 1);
    bench->folder = make_folder();
    pbr_lod *lod = lod_of(bench->instance, shape);
    bench->image = save_image(lod, &bench->folder, PBR_LOD_FILE_PBR);
    bench->nodes = SECTION + SECTION_HEADER;
    bench->triangles = bench->nodes + lod->pop.shape.nodes * sizeof(struct pop_node);
    bench->vertices = bench->triangles + 12 * (size_t)triangles_of(shape);
    assert_int_equal(bench->image.size, bench->vertices + sizeof(struct splat) * (size_t)vertices_of(shape));
    pbr_lod_release(&lod);
}

static void stop(struct bench *bench) {
    free(bench->image.data);
    remove_folder(&bench->folder);
    host_stop(&bench->host, bench->instance);
}

/* With `size` bytes of `value` at a place; the sums right. */
static bool opens_with(struct bench *bench, size_t at, const void *value, size_t size, uint32_t flags) {
    uint8_t before[16];
    assert_true(size <= sizeof before && at + size <= bench->image.size);
    memcpy(before, bench->image.data + at, size);
    memcpy(bench->image.data + at, value, size);
    mend(bench->image.data);
    const bool opens = try_bytes(&bench->host, bench->instance, &bench->folder, bench->image.data, bench->image.size, flags);
    memcpy(bench->image.data + at, before, size);
    mend(bench->image.data);
    return opens;
}

static void a_file_that_ends_anywhere_is_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &bare);
    const size_t edges[] = {SECTION, bench.nodes, bench.triangles, bench.vertices, bench.image.size};
    for (size_t i = 0; i < COUNT(edges); i++)
        for (size_t size = edges[i] - 80; size < edges[i] + 80 && size < bench.image.size; size++)
            if (try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, size, PBR_LOD_OPEN_READ))
                fail_msg("it opens with its first %zu bytes", size);
    for (size_t size = 0; size < bench.image.size; size += 97)
        assert_false(try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, size, PBR_LOD_OPEN_READ));
    assert_true(try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, bench.image.size, 0));
    stop(&bench);
}

/* The file is whole, but says of the section that it is shorter. */
static void a_section_that_ends_anywhere_is_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &bare);
    const size_t edges[] = {SECTION, bench.nodes, bench.triangles, bench.vertices, bench.image.size};
    for (size_t i = 0; i < COUNT(edges); i++)
        for (size_t end = edges[i] > SECTION ? edges[i] - 2 : SECTION; end < edges[i] + 2 && end < bench.image.size; end++) {
            struct image image = {malloc(bench.image.size), bench.image.size};
            const uint64_t size = end - SECTION, summed = size < SECTION_HEADER ? 0 : SECTION_HEADER;
            assert_non_null(image.data);
            memcpy(image.data, bench.image.data, image.size);
            memcpy(image.data + FILE_HEADER + 16, &size, 8);
            memcpy(image.data + FILE_HEADER + 32, &summed, 8);
            const uint64_t first = fnv(image.data + SECTION, summed, SUM_START);
            memcpy(image.data + FIRST_SUM, &first, 8);
            mend_head(image.data);
            if (try_bytes(&bench.host, bench.instance, &bench.folder, image.data, image.size, i % 2))
                fail_msg("it opens with a section of %zu bytes", (size_t)size);
            assert_non_null(strstr(bench.host.text, "POP hierarchy"));
            free(image.data);
        }
    stop(&bench);
}

static void a_section_that_is_not_aligned_is_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &bare);
    for (uint64_t off = 1; off < 4; off++) {
        const uint64_t place = SECTION + off, size = bench.image.size - SECTION, all = bench.image.size + off;
        uint8_t *copy = calloc(1, all);
        assert_non_null(copy);
        memcpy(copy, bench.image.data, SECTION);
        memcpy(copy + place, bench.image.data + SECTION, size);
        memcpy(copy + 16, &all, 8);
        memcpy(copy + FILE_HEADER + 8, &place, 8);
        mend_head(copy);
        for (uint32_t flags = 0; flags <= PBR_LOD_OPEN_READ; flags++) {
            assert_false(try_bytes(&bench.host, bench.instance, &bench.folder, copy, all, flags));
            assert_non_null(strstr(bench.host.text, "aligned"));
        }
        free(copy);
    }
    stop(&bench);
}

/* Each word of the section's header, with values that counts, steps and lengths must not have. */
static void any_word_is_refused_or_does_no_harm(void **unused) {
    (void)unused;
    static const uint32_t values[] = {0,          1,          2,          255,        0x7fffffff, 0x80000000,
                                      0xffffffff, 0x00000001, 0x7f800000, 0xff800000, 0x7fc00000, 0x7f7fffff,
                                      0x3f800000, 0xbf800000, 0x7fefffff, 0x7ff00000};
    static const struct shape_of_mesh *const some[] = {&torus, &single, &clump};
    for (size_t k = 0; k < COUNT(some); k++) {
        struct bench bench;
        int opened = 0, refused = 0;
        start(&bench, some[k]);
        for (size_t at = SECTION; at < SECTION + SECTION_HEADER; at += 4)
            for (size_t v = 0; v < COUNT(values); v++) {
                if (opens_with(&bench, at, &values[v], 4, v % 2)) opened++;
                else refused++;
            }
        assert_true(refused > 100 && opened > 50);
        stop(&bench);
    }
}

static void headers_that_lie_are_refused(void **unused) {
    (void)unused;
    static const uint64_t counts[] = {0x7fffffff,          0x80000000,          0xfffffffe,        0xffffffff, 0x100000000,
                                      UINT64_MAX / 24 + 1, UINT64_MAX / 12 + 1, UINT64_C(1) << 63, UINT64_MAX, UINT64_MAX - 4096};
    static const double lengths[] = {NAN, INFINITY, -INFINITY, -1, -1e-300, 1e300, DBL_MAX};
    static const float steps[] = {NAN, INFINITY, -INFINITY, -1, -1e-30f, 1e25f, FLT_MAX};
    static const uint32_t flags[] = {2, 3, 0x80000000, 0xffffffff};
    struct bench bench;
    start(&bench, &torus);
    for (size_t i = 0; i < COUNT(counts); i++)
        for (size_t at = 0; at <= 8; at += 8)
            if (opens_with(&bench, SECTION + at, &counts[i], 8, i % 2))
                fail_msg("it opens with %llu at %zu", (unsigned long long)counts[i], at);
    /* One more than there is, and vertices of no triangle but triangles of no vertex. */
    const uint64_t more[2] = {triangles_of(&torus) + 1, vertices_of(&torus) + 1}, none = 0;
    for (size_t k = 0; k < 2; k++) assert_false(opens_with(&bench, SECTION + 8 * k, &more[k], 8, 0));
    assert_false(opens_with(&bench, SECTION + 8, &none, 8, 0));
    for (size_t i = 0; i < COUNT(lengths); i++)
        for (size_t at = 32; at < SECTION_HEADER; at += 8)
            if ((at >= 56 || !isfinite(lengths[i])) && opens_with(&bench, SECTION + at, &lengths[i], 8, i % 2))
                fail_msg("it opens with %g at %zu", lengths[i], at);
    for (size_t i = 0; i < COUNT(steps); i++)
        for (size_t at = 20; at < 28; at += 4)
            if (opens_with(&bench, SECTION + at, &steps[i], 4, i % 2)) fail_msg("it opens with %g at %zu", (double)steps[i], at);
    for (size_t i = 0; i < COUNT(flags); i++)
        for (size_t at = 16; at <= 28; at += 12) {
            assert_false(opens_with(&bench, SECTION + at, &flags[i], 4, i % 2));
            assert_int_equal(bench.host.code, PBR_ERROR_UNSUPPORTED);
            assert_non_null(strstr(bench.host.text, "later version"));
        }
    stop(&bench);
}

static void corners_and_vertices_that_are_not_there_are_refused(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &bare);
    const uint32_t past = vertices_of(&bare), corners[] = {past, past + 1, 0x7fffffff, 0x80000000, 0xffffffff};
    const size_t last = bench.vertices - 4;
    for (size_t i = 0; i < COUNT(corners); i++)
        for (size_t at = bench.triangles; at <= last; at += at < bench.triangles + 24 || at == last ? 4 : last - at) {
            assert_false(opens_with(&bench, at, &corners[i], 4, i % 2));
            assert_non_null(strstr(bench.host.text, "vertex that is not there"));
        }
    const uint32_t good = past - 1;
    assert_true(opens_with(&bench, last, &good, 4, 0));
    static const float coordinates[] = {NAN, INFINITY, -INFINITY};
    const size_t places[] = {bench.vertices, bench.image.size - sizeof(struct splat)};
    for (size_t i = 0; i < COUNT(coordinates); i++)
        for (size_t p = 0; p < COUNT(places); p++)
            for (size_t k = 0; k < 4; k++) { /* the fourth: the radius */
                const size_t at = places[p] + (k < 3 ? 4 * k : offsetof(struct splat, radius));
                assert_false(opens_with(&bench, at, &coordinates[i], 4, i % 2));
                assert_non_null(strstr(bench.host.text, "not finite"));
            }
    const float below = -1, most = FLT_MAX;
    assert_false(opens_with(&bench, places[0] + offsetof(struct splat, radius), &below, 4, 0));
    assert_true(opens_with(&bench, places[0] + offsetof(struct splat, radius), &most, 4, 0));
    assert_true(opens_with(&bench, places[0], &most, 4, 0));
    stop(&bench);
}

static void any_nodes_do_no_harm(void **unused) {
    (void)unused;
    static const struct shape_of_mesh *const some[] = {&bare, &single, &clump};
    uint64_t state = 8;
    for (size_t s = 0; s < COUNT(some); s++) {
        struct bench bench;
        start(&bench, some[s]);
        for (int t = 0; t < 50; t++) {
            for (size_t i = bench.nodes; i < bench.triangles; i++)
                bench.image.data[i] = t == 0 ? 0xff : t == 1 ? 0x80 : t == 2 ? 0 : (uint8_t)(256 * uniform(&state));
            assert_true(try_bytes(&bench.host, bench.instance, &bench.folder, bench.image.data, bench.image.size, t % 2));
        }
        stop(&bench);
    }
}

/* Nothing but the bytes at hand is asked for, whatever the header says: a file of a few bytes that speaks of 2^31 triangles. */
static void no_memory_is_taken_for_what_a_file_says(void **unused) {
    (void)unused;
    struct bench bench;
    start(&bench, &single);
    const uint64_t counts[2] = {POP_TRIANGLES_MOST, PBR_MAX_POINTS};
    memcpy(bench.image.data + SECTION, counts, sizeof counts);
    mend(bench.image.data);
    store_image(bench.folder.file, bench.image.data, bench.image.size);
    pbr_lod *lod = NULL;
    assert_int_equal(pbr_lod_open(bench.instance, bench.folder.file, NULL, &lod), PBR_ERROR_FORMAT);
    assert_non_null(strstr(bench.host.text, "lacks nodes, triangles or vertices"));
    stop(&bench);
}

/* ---- Memory and cancelling ---- */

struct work {
    const pbr_mesh *mesh;
    struct folder folder;
};

static pbr_result make_save_open(pbr_instance *instance, void *user) {
    const struct work *work = user;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod *lod = NULL, *opened = NULL;
    pbr_points *points = NULL;
    struct cut cut = {0};
    desc.kind = PBR_LOD_POP;
    desc.mesh = work->mesh;
    pbr_result result = pbr_lod_create(instance, &desc, &lod);
    if (result == PBR_OK) result = pbr_lod_save(lod, work->folder.file, PBR_LOD_FILE_PBR, NULL, NULL);
    if (result == PBR_OK) result = pbr_lod_open(instance, work->folder.file, NULL, &opened);
    if (result == PBR_OK) result = pbr_lod_to_points(opened, NULL, NULL, &points);
    if (result == PBR_OK) {
        const struct cut_view view = view_of(opened, 0, 2, 0, false);
        result = lod_cut(opened, &view, NULL, NULL, &cut);
        assert_int_equal(cut.triangle_count, result == PBR_OK ? triangles_of(&torus) : 0);
    }
    cut_free(instance, &cut);
    pbr_points_release(&points);
    pbr_lod_release(&opened);
    pbr_lod_release(&lod);
    return result;
}

static void memory_that_runs_out_leaves_nothing_behind(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_mesh *mesh = mesh_of(instance, &torus);
    struct work work = {.mesh = mesh, .folder = make_folder()};
    fail_every_allocation(&host, instance, make_save_open, &work);
    pbr_mesh_release(&mesh);
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

/* Building, counting, saving, making points: 0 to 3. */
static pbr_result work_on(pbr_instance *instance, int what, const pbr_mesh *mesh, const pbr_lod *lod, const char *path, int *left) {
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    pbr_lod *made = NULL;
    pbr_points *points = NULL;
    pbr_result result;
    desc.kind = PBR_LOD_POP;
    desc.mesh = mesh;
    desc.progress = count_down;
    desc.progress_user = left;
    if (what == 0) result = pbr_lod_create(instance, &desc, &made);
    else if (what == 1) result = pbr_lod_measure(lod, count_down, left, &statistics);
    else if (what == 2) result = pbr_lod_save(lod, path, PBR_LOD_FILE_PBR, count_down, left);
    else result = pbr_lod_to_points(lod, count_down, left, &points);
    assert_int_equal(made != NULL, what == 0 && result == PBR_OK);
    assert_int_equal(points != NULL, what == 3 && result == PBR_OK);
    pbr_lod_release(&made);
    pbr_points_release(&points);
    return result;
}

static void cancelled_work_leaves_nothing_behind(void **unused) {
    (void)unused;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    struct folder folder = make_folder();
    pbr_mesh *mesh = mesh_of(instance, &torus);
    pbr_lod *lod = pop_lod(instance, mesh);
    const long live = atomic_load(&host.live);
    for (int what = 0; what < 4; what++) {
        int tries = 0;
        for (pbr_result result = PBR_ERROR_CANCELLED; result != PBR_OK; tries++) {
            int left = tries + 1;
            result = work_on(instance, what, mesh, lod, folder.file, &left);
            assert_true(result == PBR_OK || result == PBR_ERROR_CANCELLED);
            assert_int_equal(files_in(&folder), what == 2 && result == PBR_OK);
            assert_int_equal(atomic_load(&host.live), live);
            assert_true(tries < 100);
        }
        assert_true(tries > 1);
        unlink(folder.file);
    }
    pbr_lod_release(&lod);
    pbr_mesh_release(&mesh);
    remove_folder(&folder);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(files_give_back_what_was_saved),
        cmocka_unit_test(it_is_described_and_counted),
        cmocka_unit_test(vertices_become_points),
        cmocka_unit_test(cuts_that_are_kept_are_the_same_from_a_file),
        cmocka_unit_test(what_it_cannot_do_is_refused_with_a_reason),
        cmocka_unit_test(meshes_past_what_floats_hold_are_refused),
        cmocka_unit_test(a_file_that_ends_anywhere_is_refused),
        cmocka_unit_test(a_section_that_ends_anywhere_is_refused),
        cmocka_unit_test(a_section_that_is_not_aligned_is_refused),
        cmocka_unit_test(any_word_is_refused_or_does_no_harm),
        cmocka_unit_test(headers_that_lie_are_refused),
        cmocka_unit_test(corners_and_vertices_that_are_not_there_are_refused),
        cmocka_unit_test(any_nodes_do_no_harm),
        cmocka_unit_test(no_memory_is_taken_for_what_a_file_says),
        cmocka_unit_test(memory_that_runs_out_leaves_nothing_behind),
        cmocka_unit_test(cancelled_work_leaves_nothing_behind),
    };
    return cmocka_run_group_tests_name("pop_file", tests, NULL, NULL);
}
