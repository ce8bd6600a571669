/* Triangle meshes, and the points that cover them. SPDX-License-Identifier: MIT */
#include "mesh.h"

#include <float.h>
#include <string.h>

#include "attribute.h"
#include "minmax.h"
#include "splat.h"
#include "triangles.h"

/* Of a triangle that covers more than others of its mesh, discs that are grown to hide it would jut out at silhouettes: times the
 * mean covering radius, tried on the scans. */
static const double LARGE = 3;

/* Of `count` triangles from `first` on; the last one stands in for those that LANES lacks. */
static const uint32_t *corners_of(const pbr_mesh *mesh, uint64_t first, size_t count, size_t lane) {
    return mesh->triangles[first + (lane < count ? lane : count - 1)];
}

static void measure(const pbr_mesh *mesh, uint64_t first, size_t count, struct triangles *out) {
    lanes corners[3][3];
    for (size_t l = 0; l < LANES; l++) {
        for (int i = 0; i < 3; i++) {
            double p[3];
            points_position(mesh->vertices, corners_of(mesh, first, count, l)[i], p);
            for (int k = 0; k < 3; k++) corners[i][k][l] = p[k];
        }
    }
    triangles_measure((const lanes(*)[3])corners, out);
}

/* ---- Batches ---- */

enum { BATCH = 1 << 17, GRAIN = 1 << 12 };

/* What is done with triangles: all threads look at a batch, and one of them puts together what they found out about the last one,
 * in the triangles' order. So nothing is summed up in an order that depends on the threads, and what is put together needs no
 * atomics. */
struct batches {
    size_t size; /* of what is found out about a triangle */
    void (*look)(void *user, uint64_t first, size_t count, void *found);
    pbr_result (*put_together)(void *user, uint64_t first, size_t count, const void *found);
    void *user;
};

struct batch {
    uint64_t first; /* triangle */
    size_t count;
    unsigned char *found;
};

struct round {
    const struct batches *batches;
    struct batch next, last;
};

/* Piece 0 is to put the last batch together. */
static pbr_result do_pieces(void *user, size_t begin, size_t end) {
    const struct round *round = user;
    const struct batches *batches = round->batches;
    const struct batch *next = &round->next, *last = &round->last;
    pbr_result result = PBR_OK;
    for (size_t piece = begin; piece < end && result == PBR_OK; piece++) {
        if (piece == 0) {
            result = batches->put_together(batches->user, last->first, last->count, last->found);
        } else {
            const size_t at = (piece - 1) * GRAIN, left = next->count - at;
            batches->look(batches->user, next->first + at, left < GRAIN ? left : GRAIN, next->found + at * batches->size);
        }
    }
    return result;
}

/* Reports the stage but for its end, which is the caller's. */
static pbr_result look_at_triangles(const pbr_mesh *mesh, uint64_t count, const struct batches *batches,
                                    const struct progress *progress, const char *stage) {
    const size_t room = count < BATCH ? (size_t)count : BATCH;
    unsigned char *found = allocate_unset(mesh->instance, 2 * room, batches->size);
    if (!found) return PBR_ERROR_OUT_OF_MEMORY;
    struct round round = {batches, {.found = found}, {.found = found + room * batches->size}};
    pbr_result result = progress_report(progress, stage, 0);
    uint64_t first = 0;
    double told = 0;
    do {
        const uint64_t left = count - first;
        round.next.first = first;
        round.next.count = left < BATCH ? (size_t)left : BATCH;
        if (result == PBR_OK && left > 0) result = progress_report_some(progress, stage, (double)first / (double)count, &told);
        if (result == PBR_OK)
            result = pbr_parallel(mesh->instance, 1 + (round.next.count + GRAIN - 1) / GRAIN, 1, do_pieces, &round);
        const struct batch looked_at = round.next;
        round.next = round.last;
        round.last = looked_at;
        first += looked_at.count;
    } while (result == PBR_OK && round.last.count > 0);
    pbr_free(mesh->instance, found);
    return result;
}

/* ---- Creating ---- */

static pbr_result check_indices(pbr_instance *instance, const pbr_mesh_desc *desc, pbr_attribute *indices) {
    size_t corners;
    const char *wrong = NULL;
    if (desc->flags != 0) wrong = "flags is not 0";
    if (desc->reserved != 0) wrong = "reserved is not 0";
    if (wrong) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_mesh_desc: %s", wrong);
    *indices = (pbr_attribute){.data = desc->indices, .format = desc->index_format, .components = 3};
    if (__builtin_mul_overflow(desc->triangle_count, sizeof(uint32_t[3]), &corners))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_mesh_desc: %llu triangles exceed the address space",
                       (unsigned long long)desc->triangle_count);
    return attribute_check(instance, "indices", indices, desc->triangle_count, 1u << PBR_FORMAT_UINT16 | 1u << PBR_FORMAT_UINT32, 3,
                           3, desc->triangle_count > 0);
}

static pbr_result create_vertices(pbr_instance *instance, const pbr_mesh_desc *desc, pbr_points **out) {
    pbr_points_desc points = PBR_POINTS_DESC_INIT;
    points.count = desc->vertex_count;
    points.positions = desc->positions;
    memcpy(points.origin, desc->origin, sizeof points.origin);
    points.normals = desc->normals;
    points.colours = desc->colours;
    points.scalars = desc->scalars;
    points.scalar_count = desc->scalar_count;
    points.progress = desc->progress;
    points.progress_user = desc->progress_user;
    return points_create(instance, &points, true, out);
}

/* All corners have finite coordinates in the input. */
static bool is_finite(const pbr_mesh *mesh, const pbr_attribute *positions, const uint32_t corners[3]) {
    double p[3];
    if (mesh->vertices->dropped == 0) return true;
    for (int k = 0; k < 3; k++)
        if (!attribute_read_position(positions, corners[k], p)) return false;
    return true;
}

/* A triangle's unit normal and the angles at its corners, none if it is degenerate, and its covering radius. */
struct face {
    float normal[3], angles[3];
    double covering;
};

struct copying {
    pbr_mesh *mesh;
    const pbr_mesh_desc *desc;
    const pbr_attribute *indices;
    pbr_attribute positions;
    _Atomic uint8_t *referenced;        /* of each vertex */
    _Atomic uint64_t degenerate, wrong; /* wrong: the first triangle that uses vertices that there are not */
    double (*normals)[3];               /* sums of faces', of each vertex; NULL: they are given */
    double covering;                    /* sum of radii */
};

static void note_wrong(struct copying *copying, uint64_t triangle) {
    uint64_t first = atomic_load(&copying->wrong);
    while (triangle < first && !atomic_compare_exchange_weak(&copying->wrong, &first, triangle)) {
    }
}

static void read_corners(const pbr_attribute *indices, uint64_t triangle, uint32_t corners[3]) {
    const unsigned char *at = (const unsigned char *)indices->data + (size_t)triangle * indices->stride;
    uint16_t narrow[3];
    if (indices->format == PBR_FORMAT_UINT32) {
        memcpy(corners, at, sizeof(uint32_t[3]));
        return;
    }
    memcpy(narrow, at, sizeof narrow);
    for (int k = 0; k < 3; k++) corners[k] = narrow[k];
}

static bool copy_corners(struct copying *copying, uint64_t triangle) {
    uint32_t *corners = copying->mesh->triangles[triangle];
    bool is_wrong = false;
    read_corners(copying->indices, triangle, corners);
    for (int k = 0; k < 3; k++) is_wrong |= corners[k] >= copying->desc->vertex_count;
    if (is_wrong) note_wrong(copying, triangle);
    return !is_wrong;
}

/* LANES at most. Adds to *degenerate. False: one is wrong. */
static bool copy_few(struct copying *copying, uint64_t first, size_t count, struct face *faces, uint64_t *degenerate) {
    struct triangles triangles;
    lanes radii, angles[3];
    for (size_t l = 0; l < count; l++)
        if (!copy_corners(copying, first + l)) return false;
    measure(copying->mesh, first, count, &triangles);
    triangles_covering_radius(&triangles, radii);
    if (copying->normals) triangles_angles(&triangles, angles);
    for (size_t l = 0; l < count; l++) {
        const uint32_t *corners = copying->mesh->triangles[first + l];
        const bool is_kept = is_finite(copying->mesh, &copying->positions, corners);
        const bool has_normal = is_kept && !triangles.is_degenerate[l];
        const double scale = has_normal ? 1 / triangles.length[l] : 0;
        for (int k = 0; k < 3 && copying->normals; k++) {
            faces[l].normal[k] = (float)(triangles.normal[k][l] * scale);
            faces[l].angles[k] = (float)angles[k][l];
        }
        faces[l].covering = is_kept ? radii[l] : 0;
        if (!is_kept) continue;
        for (int k = 0; k < 3; k++) atomic_store_explicit(&copying->referenced[corners[k]], 1, memory_order_relaxed);
        *degenerate += triangles.is_degenerate[l];
    }
    return true;
}

static void copy_some(void *user, uint64_t first, size_t count, void *faces) {
    struct copying *copying = user;
    uint64_t degenerate = 0;
    for (size_t i = 0; i < count; i += LANES)
        if (!copy_few(copying, first + i, count - i < LANES ? count - i : LANES, (struct face *)faces + i, &degenerate)) return;
    atomic_fetch_add(&copying->degenerate, degenerate);
}

static pbr_result refuse_triangle(const struct copying *copying, uint64_t triangle) {
    const uint32_t *corners = copying->mesh->triangles[triangle]; /* as it was judged: the host's may be another by now */
    int corner = 0;
    while (corners[corner] < copying->desc->vertex_count) corner++;
    return pbr_log(copying->mesh->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                   "pbr_mesh_desc: triangle %llu uses vertex %u, but there are %llu", (unsigned long long)triangle,
                   (unsigned)corners[corner], (unsigned long long)copying->desc->vertex_count);
}

/* Corners' normals are weighted by the angles there: independent of how a flat region is cut into triangles (Thuermer and
 * Wuethrich 1998). */
static pbr_result add_faces(void *user, uint64_t first, size_t count, const void *faces) {
    struct copying *copying = user;
    const uint64_t wrong = atomic_load(&copying->wrong);
    if (wrong < first + count) return refuse_triangle(copying, wrong); /* one of the next batch may not be its first yet */
    for (size_t i = 0; i < count; i++) {
        const struct face *face = (const struct face *)faces + i;
        const uint32_t *corners = copying->mesh->triangles[first + i];
        for (int c = 0; c < 3 && copying->normals; c++)
            for (int k = 0; k < 3; k++) copying->normals[corners[c]][k] += (double)(face->normal[k] * face->angles[c]);
        copying->covering += face->covering;
    }
    return PBR_OK;
}

static void measure_referenced(pbr_mesh *mesh, const _Atomic uint8_t *referenced) {
    const pbr_points *vertices = mesh->vertices;
    bool any = false;
    for (uint64_t v = 0; v < vertices->count; v++) mesh->unreferenced += !referenced[v];
    if (mesh->unreferenced == 0 && vertices->count > 0) { /* all vertices' box is known */
        for (int k = 0; k < 3; k++) {
            mesh->minimum[k] = vertices->minimum[k] + vertices->origin[k];
            mesh->maximum[k] = vertices->maximum[k] + vertices->origin[k];
        }
        return;
    }
    for (uint64_t v = 0; v < vertices->count; v++) {
        double p[3];
        if (!referenced[v]) continue;
        points_position(vertices, v, p);
        for (int k = 0; k < 3; k++) {
            p[k] += vertices->origin[k];
            mesh->minimum[k] = any ? lesser(mesh->minimum[k], p[k]) : p[k];
            mesh->maximum[k] = any ? larger(mesh->maximum[k], p[k]) : p[k];
        }
        any = true;
    }
}

/* Without those whose corners are no places. */
static void keep_triangles(pbr_mesh *mesh, const struct copying *copying) {
    mesh->triangle_count = mesh->vertices->dropped == 0 ? copying->desc->triangle_count : 0;
    for (uint64_t t = mesh->triangle_count; t < copying->desc->triangle_count; t++) {
        if (is_finite(mesh, &copying->positions, mesh->triangles[t]))
            memmove(mesh->triangles[mesh->triangle_count++], mesh->triangles[t], sizeof *mesh->triangles);
        else mesh->dropped++;
    }
}

static pbr_result encode_range(void *user, size_t begin, size_t end) {
    const struct copying *copying = user;
    for (size_t v = begin; v < end; v++) {
        const double *sum = copying->normals[v];
        const float n[3] = {(float)sum[0], (float)sum[1], (float)sum[2]};
        splat_encode_normal(n, copying->mesh->vertices->normals[v]);
    }
    return PBR_OK;
}

static bool allocate(struct copying *copying) {
    pbr_mesh *mesh = copying->mesh;
    pbr_points *vertices = mesh->vertices;
    const size_t count = (size_t)vertices->count, triangles = (size_t)copying->desc->triangle_count;
    mesh->triangles = allocate_unset(mesh->instance, triangles, sizeof *mesh->triangles);
    copying->referenced = pbr_allocate(mesh->instance, count, sizeof *copying->referenced);
    if (!mesh->triangles || !copying->referenced) return false;
    if (mesh->given_normals) return true;
    copying->normals = pbr_allocate(mesh->instance, count, sizeof *copying->normals);
    vertices->normals = allocate_unset(mesh->instance, count, sizeof *vertices->normals);
    if (vertices->normals) vertices->memory_bytes += count * sizeof *vertices->normals;
    return copying->normals && vertices->normals;
}

/* And vertices' normals, if they are not given. */
static pbr_result make_triangles(pbr_mesh *mesh, const pbr_mesh_desc *desc, const pbr_attribute *indices,
                                 const struct progress *progress) {
    struct copying copying = {.mesh = mesh, .desc = desc, .indices = indices, .positions = desc->positions};
    const struct batches batches = {sizeof(struct face), copy_some, add_faces, &copying};
    pbr_result result = attribute_check(mesh->instance, "positions", &copying.positions, desc->vertex_count,
                                        1u << PBR_FORMAT_FLOAT32 | 1u << PBR_FORMAT_FLOAT64, 3, 3, false);
    if (result != PBR_OK) return result;
    atomic_init(&copying.degenerate, 0);
    atomic_init(&copying.wrong, UINT64_MAX);
    result = allocate(&copying) ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = look_at_triangles(mesh, desc->triangle_count, &batches, progress, "copying triangles");
    if (result != PBR_OK) goto cleanup;
    mesh->degenerate = atomic_load(&copying.degenerate);
    keep_triangles(mesh, &copying);
    if (mesh->triangle_count > 0) mesh->mean_covering = copying.covering / (double)mesh->triangle_count;
    measure_referenced(mesh, copying.referenced);
    if (copying.normals) result = pbr_parallel(mesh->instance, (size_t)mesh->vertices->count, GRAIN, encode_range, &copying);
cleanup:
    pbr_free(mesh->instance, copying.referenced);
    pbr_free(mesh->instance, copying.normals);
    return result;
}

pbr_result pbr_mesh_create(pbr_instance *instance, const pbr_mesh_desc *desc, pbr_mesh **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!desc || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_mesh_create: %s is NULL", desc ? "out" : "desc");
    pbr_mesh_desc d;
    pbr_attribute indices;
    pbr_mesh *mesh = NULL;
    pbr_result result = read_desc(instance, "pbr_mesh_desc", desc, sizeof d, &d, sizeof d);
    if (result == PBR_OK) result = check_indices(instance, &d, &indices);
    if (result != PBR_OK) return result;
    struct progress progress = {d.progress, d.progress_user};
    mesh = pbr_allocate(instance, 1, sizeof *mesh);
    if (!mesh) return PBR_ERROR_OUT_OF_MEMORY;
    mesh->instance = instance;
    atomic_init(&mesh->references, 1);
    mesh->given_normals = d.normals.data != NULL;
    result = create_vertices(instance, &d, &mesh->vertices);
    if (result == PBR_OK) result = make_triangles(mesh, &d, &indices, &progress);
    if (result == PBR_OK) result = progress_report(&progress, "copying triangles", 1);
    if (result == PBR_OK) *out = mesh;
    else pbr_mesh_release(&mesh);
    return result;
}

pbr_mesh *pbr_mesh_retain(pbr_mesh *mesh) {
    if (mesh) atomic_fetch_add(&mesh->references, 1);
    return mesh;
}

void pbr_mesh_release(pbr_mesh **mesh) {
    if (!mesh || !*mesh) return;
    pbr_mesh *m = *mesh;
    *mesh = NULL;
    if (atomic_fetch_sub(&m->references, 1) != 1) return;
    /* Its vertices are the child that keeps the instance: they go last. */
    pbr_points *vertices = m->vertices;
    pbr_instance *instance = m->instance;
    pbr_free(instance, m->triangles);
    pbr_free(instance, m);
    pbr_points_release(&vertices);
}

pbr_result pbr_mesh_get_info(const pbr_mesh *mesh, pbr_mesh_info *info) {
    if (!mesh || !info) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_mesh_info i = {.struct_size = sizeof i,
                       .vertex_count = mesh->vertices->count,
                       .triangle_count = mesh->triangle_count,
                       .dropped_triangle_count = mesh->dropped,
                       .unreferenced_count = mesh->unreferenced,
                       .degenerate_count = mesh->degenerate,
                       .has_normals = mesh->given_normals,
                       .has_colours = mesh->vertices->colours != NULL,
                       .memory_bytes = sizeof *mesh + mesh->vertices->memory_bytes +
                                       (mesh->triangle_count + mesh->dropped) * sizeof *mesh->triangles};
    memcpy(i.minimum, mesh->minimum, sizeof i.minimum);
    memcpy(i.maximum, mesh->maximum, sizeof i.maximum);
    return write_info(mesh->instance, "pbr_mesh_info", &i, sizeof i, info, sizeof i);
}

pbr_result pbr_mesh_copy(const pbr_mesh *mesh, const pbr_mesh_copy_desc *desc) {
    if (!mesh) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_mesh_copy_desc d;
    if (!desc) return pbr_log(mesh->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_mesh_copy: desc is NULL");
    pbr_result result = read_desc(mesh->instance, "pbr_mesh_copy_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (d.first_triangle > mesh->triangle_count || d.triangle_count > mesh->triangle_count - d.first_triangle)
        return pbr_log(mesh->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_mesh_copy: the triangles are outside the mesh");
    pbr_points_copy_desc vertices = PBR_POINTS_COPY_DESC_INIT;
    vertices.positions = d.positions;
    vertices.normals = d.normals;
    vertices.colours = d.colours;
    result = pbr_points_copy(mesh->vertices, d.first_vertex, d.vertex_count, &vertices);
    if (result == PBR_OK && d.triangles && d.triangle_count > 0)
        memcpy(d.triangles, mesh->triangles[d.first_triangle], (size_t)d.triangle_count * sizeof *mesh->triangles);
    return result;
}

/* ---- Points ---- */

struct cover {
    const pbr_mesh *mesh;
    double scale;
    float (*normals)[3]; /* of each vertex */
    float *radii;        /* of each vertex, -1 at first */
};

static pbr_result decode_range(void *user, size_t begin, size_t end) {
    const struct cover *cover = user;
    for (size_t v = begin; v < end; v++) splat_decode_normal(cover->mesh->vertices->normals[v], cover->normals[v]);
    return PBR_OK;
}

static void cover_some(void *user, uint64_t first, size_t count, void *found) {
    const struct cover *cover = user;
    const pbr_mesh *mesh = cover->mesh;
    const double large = LARGE * mesh->mean_covering;
    float *radii = found;
    for (size_t begin = 0; begin < count; begin += LANES) {
        const size_t few = count - begin < LANES ? count - begin : LANES;
        struct triangles triangles;
        lanes normals[3][3], covering, hiding;
        measure(mesh, first + begin, few, &triangles);
        for (size_t l = 0; l < LANES; l++)
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++)
                    normals[i][k][l] = (double)cover->normals[corners_of(mesh, first + begin, few, l)[i]][k];
        triangles_covering_radius(&triangles, covering);
        triangles_hiding_radius(&triangles, (const lanes(*)[3])normals, covering, hiding);
        for (size_t l = 0; l < few; l++) {
            const double radius = cover->scale * larger(covering[l], lesser(hiding[l], large));
            radii[begin + l] = float_above(lesser(radius, FLT_MAX));
        }
    }
}

static pbr_result grow_radii(void *user, uint64_t first, size_t count, const void *found) {
    const struct cover *cover = user;
    const float *radii = found;
    for (size_t i = 0; i < count; i++) {
        const uint32_t *corners = cover->mesh->triangles[first + i];
        for (int k = 0; k < 3; k++) cover->radii[corners[k]] = largerf(cover->radii[corners[k]], radii[i]);
    }
    return PBR_OK;
}

/* The referenced vertices in order, and their radii. */
static pbr_result choose_vertices(const pbr_mesh *mesh, double scale, const struct progress *progress, uint32_t *chosen,
                                  float *radii, uint64_t *count) {
    const size_t vertices = (size_t)mesh->vertices->count;
    struct cover cover = {.mesh = mesh, .scale = scale};
    const struct batches batches = {sizeof(float), cover_some, grow_radii, &cover};
    cover.normals = allocate_unset(mesh->instance, vertices, sizeof *cover.normals);
    cover.radii = allocate_unset(mesh->instance, vertices, sizeof *cover.radii);
    pbr_result result = cover.normals && cover.radii ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t v = 0; v < vertices && result == PBR_OK; v++) cover.radii[v] = -1;
    if (result == PBR_OK) result = pbr_parallel(mesh->instance, vertices, GRAIN, decode_range, &cover);
    if (result == PBR_OK) result = look_at_triangles(mesh, mesh->triangle_count, &batches, progress, "covering triangles");
    if (result == PBR_OK) result = progress_report(progress, "covering triangles", 1);
    *count = 0;
    for (size_t v = 0; v < vertices && result == PBR_OK; v++) {
        if (cover.radii[v] < 0) continue;
        chosen[*count] = (uint32_t)v;
        radii[(*count)++] = cover.radii[v];
    }
    pbr_free(mesh->instance, cover.normals);
    pbr_free(mesh->instance, cover.radii);
    return result;
}

pbr_result pbr_mesh_to_points(const pbr_mesh *mesh, const pbr_mesh_to_points_desc *desc, pbr_points **out) {
    if (out) *out = NULL;
    if (!mesh) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = mesh->instance;
    if (!out) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_mesh_to_points: out is NULL");
    pbr_mesh_to_points_desc d;
    pbr_result result = read_desc(instance, "pbr_mesh_to_points_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (!(d.radius_scale >= 0 && d.radius_scale <= FLT_MAX) || d.flags != 0)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_mesh_to_points_desc: %s",
                       d.flags != 0 ? "flags is not 0" : "radius_scale is negative or not finite");
    struct progress progress = {d.progress, d.progress_user};
    size_t vertex_count = (size_t)mesh->vertices->count;
    uint32_t *chosen = allocate_unset(instance, vertex_count, sizeof *chosen);
    float *radii = allocate_unset(instance, vertex_count, sizeof *radii);
    pbr_points *points = NULL;
    uint64_t count;
    result = PBR_ERROR_OUT_OF_MEMORY;
    if (chosen && radii) result = choose_vertices(mesh, d.radius_scale > 0 ? d.radius_scale : 1, &progress, chosen, radii, &count);
    if (result == PBR_OK) result = points_select(mesh->vertices, chosen, count, radii, &points);
    pbr_free(instance, chosen);
    pbr_free(instance, radii);
    if (result == PBR_OK) *out = points;
    else pbr_points_release(&points);
    return result;
}
