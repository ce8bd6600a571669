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

enum { BATCH = 1 << 16, GRAIN = 1 << 12 };

/* A triangle's unit normal, and the angles at its corners; none if it is degenerate. */
struct face {
    float normal[3], angles[3];
};

/* Some triangles, and what all threads find out about them. One puts it together, in their order, while the others look at the next
 * batch: so sums do not depend on the threads. */
struct batch {
    uint64_t first; /* triangle */
    size_t count;
    struct face *faces;             /* NULL: not looked for */
    double covering[BATCH / GRAIN]; /* sums of radii */
};

struct copying {
    pbr_mesh *mesh;
    const pbr_mesh_desc *desc;
    const pbr_attribute *indices;
    pbr_attribute positions;
    _Atomic uint8_t *referenced;        /* of each vertex */
    _Atomic uint64_t degenerate, wrong; /* wrong: the first triangle that uses vertices that there are not */
    struct batch copied, next;
    double (*normals)[3]; /* sums of faces', of each vertex; NULL: they are given */
    double covering;      /* sum of radii */
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

/* Of the next batch, LANES at most. Adds to *degenerate and *covering. False: one is wrong. */
static bool copy_few(struct copying *copying, size_t begin, size_t count, uint64_t *degenerate, double *covering) {
    struct batch *batch = &copying->next;
    const uint64_t first = batch->first + begin;
    struct triangles triangles;
    lanes radii, angles[3];
    for (size_t l = 0; l < count; l++)
        if (!copy_corners(copying, first + l)) return false;
    measure(copying->mesh, first, count, &triangles);
    triangles_covering_radius(&triangles, radii);
    if (batch->faces) triangles_angles(&triangles, angles);
    for (size_t l = 0; l < count; l++) {
        const uint32_t *corners = copying->mesh->triangles[first + l];
        const bool is_kept = is_finite(copying->mesh, &copying->positions, corners);
        const bool has_normal = is_kept && !triangles.is_degenerate[l];
        const double scale = has_normal ? 1 / triangles.length[l] : 0;
        for (int k = 0; k < 3 && batch->faces; k++) {
            batch->faces[begin + l].normal[k] = (float)(triangles.normal[k][l] * scale);
            batch->faces[begin + l].angles[k] = (float)angles[k][l];
        }
        if (!is_kept) continue;
        for (int k = 0; k < 3; k++) atomic_store_explicit(&copying->referenced[corners[k]], 1, memory_order_relaxed);
        *degenerate += triangles.is_degenerate[l];
        *covering += radii[l];
    }
    return true;
}

static void copy_some(struct copying *copying, size_t begin, size_t end) {
    uint64_t degenerate = 0;
    double covering = 0;
    for (size_t i = begin; i < end; i += LANES)
        if (!copy_few(copying, i, end - i < LANES ? end - i : LANES, &degenerate, &covering)) return;
    copying->next.covering[begin / GRAIN] = covering;
    atomic_fetch_add(&copying->degenerate, degenerate);
}

/* Corners' normals are weighted by the angles there: independent of how a flat region is cut into triangles (Thuermer and
 * Wuethrich 1998). */
static void add_faces(struct copying *copying) {
    const struct batch *batch = &copying->copied;
    for (size_t i = 0; i < batch->count && batch->faces; i++) {
        const struct face *face = &batch->faces[i];
        const uint32_t *corners = copying->mesh->triangles[batch->first + i];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) copying->normals[corners[c]][k] += (double)(face->normal[k] * face->angles[c]);
    }
    for (size_t i = 0; i * GRAIN < batch->count; i++) copying->covering += batch->covering[i];
}

/* Piece 0 puts the last batch together, the others look at the next one. */
static pbr_result copy_pieces(void *user, size_t begin, size_t end) {
    struct copying *copying = user;
    for (size_t piece = begin; piece < end; piece++) {
        const size_t count = copying->next.count, to = piece * GRAIN;
        if (piece == 0) add_faces(copying);
        else copy_some(copying, to - GRAIN, to < count ? to : count);
    }
    return PBR_OK;
}

static pbr_result refuse_triangle(const struct copying *copying, uint64_t triangle) {
    uint32_t corners[3];
    int corner = 0;
    read_corners(copying->indices, triangle, corners);
    while (corners[corner] < copying->desc->vertex_count) corner++;
    return pbr_log(copying->mesh->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                   "pbr_mesh_desc: triangle %llu uses vertex %u, but there are %llu", (unsigned long long)triangle,
                   (unsigned)corners[corner], (unsigned long long)copying->desc->vertex_count);
}

static pbr_result copy_batches(struct copying *copying, const struct progress *progress) {
    pbr_mesh *mesh = copying->mesh;
    const uint64_t count = copying->desc->triangle_count;
    uint64_t first = 0;
    do {
        const uint64_t left = count - first;
        copying->next.first = first;
        copying->next.count = left < BATCH ? (size_t)left : BATCH;
        const size_t pieces = 1 + (copying->next.count + GRAIN - 1) / GRAIN;
        pbr_result result = PBR_OK; /* at the end there is one batch to put together */
        if (left > 0) result = progress_report(progress, "copying triangles", (double)first / (double)count);
        if (result == PBR_OK) result = pbr_parallel(mesh->instance, pieces, 1, copy_pieces, copying);
        if (result != PBR_OK) return result;
        if (atomic_load(&copying->wrong) != UINT64_MAX) return refuse_triangle(copying, atomic_load(&copying->wrong));
        const struct batch copied = copying->next;
        copying->next = copying->copied;
        copying->copied = copied;
        first += copied.count;
    } while (copying->copied.count > 0);
    return PBR_OK;
}

static void measure_referenced(pbr_mesh *mesh, const _Atomic uint8_t *referenced) {
    const pbr_points *vertices = mesh->vertices;
    bool any = false;
    for (uint64_t v = 0; v < vertices->count; v++) {
        double p[3];
        if (!referenced[v]) {
            mesh->unreferenced++;
            continue;
        }
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

static bool allocate(struct copying *copying, struct face **faces) {
    pbr_mesh *mesh = copying->mesh;
    pbr_points *vertices = mesh->vertices;
    const size_t count = (size_t)vertices->count, triangles = (size_t)copying->desc->triangle_count;
    mesh->triangles = pbr_allocate(mesh->instance, triangles, sizeof *mesh->triangles);
    copying->referenced = pbr_allocate(mesh->instance, count, sizeof *copying->referenced);
    if (!mesh->triangles || !copying->referenced) return false;
    if (mesh->given_normals) return true;
    copying->normals = pbr_allocate(mesh->instance, count, sizeof *copying->normals);
    *faces = pbr_allocate(mesh->instance, 2 * (triangles < BATCH ? triangles : BATCH), sizeof **faces);
    if (!copying->normals || !*faces) return false;
    copying->copied.faces = *faces;
    copying->next.faces = *faces + (triangles < BATCH ? triangles : BATCH);
    vertices->normals = pbr_allocate(mesh->instance, count, sizeof *vertices->normals);
    if (vertices->normals) vertices->memory_bytes += count * sizeof *vertices->normals;
    return vertices->normals;
}

/* And vertices' normals, if they are not given. */
static pbr_result make_triangles(pbr_mesh *mesh, const pbr_mesh_desc *desc, const pbr_attribute *indices,
                                 const struct progress *progress) {
    struct copying copying = {.mesh = mesh, .desc = desc, .indices = indices, .positions = desc->positions};
    struct face *faces = NULL;
    pbr_result result = attribute_check(mesh->instance, "positions", &copying.positions, desc->vertex_count,
                                        1u << PBR_FORMAT_FLOAT32 | 1u << PBR_FORMAT_FLOAT64, 3, 3, false);
    if (result != PBR_OK) return result;
    atomic_init(&copying.degenerate, 0);
    atomic_init(&copying.wrong, UINT64_MAX);
    result = allocate(&copying, &faces) ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = copy_batches(&copying, progress);
    if (result != PBR_OK) goto cleanup;
    mesh->degenerate = atomic_load(&copying.degenerate);
    keep_triangles(mesh, &copying);
    if (mesh->triangle_count > 0) mesh->mean_covering = copying.covering / (double)mesh->triangle_count;
    measure_referenced(mesh, copying.referenced);
    if (copying.normals) result = pbr_parallel(mesh->instance, (size_t)mesh->vertices->count, GRAIN, encode_range, &copying);
cleanup:
    pbr_free(mesh->instance, copying.referenced);
    pbr_free(mesh->instance, copying.normals);
    pbr_free(mesh->instance, faces);
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
    float (*normals)[3];  /* of each vertex */
    _Atomic float *radii; /* of each vertex, -1 at first */
};

static pbr_result decode_range(void *user, size_t begin, size_t end) {
    const struct cover *cover = user;
    for (size_t v = begin; v < end; v++) splat_decode_normal(cover->mesh->vertices->normals[v], cover->normals[v]);
    return PBR_OK;
}

/* By any thread: the largest does not depend on the order. */
static void grow(_Atomic float *radius, float to) {
    float now = atomic_load_explicit(radius, memory_order_relaxed);
    while (to > now && !atomic_compare_exchange_weak_explicit(radius, &now, to, memory_order_relaxed, memory_order_relaxed)) {
    }
}

static pbr_result cover_range(void *user, size_t begin, size_t end) {
    const struct cover *cover = user;
    const pbr_mesh *mesh = cover->mesh;
    const double large = LARGE * mesh->mean_covering;
    for (size_t t = begin; t < end; t += LANES) {
        const size_t count = end - t < LANES ? end - t : LANES;
        struct triangles triangles;
        lanes normals[3][3], covering, hiding;
        measure(mesh, t, count, &triangles);
        for (size_t l = 0; l < LANES; l++)
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++) normals[i][k][l] = (double)cover->normals[corners_of(mesh, t, count, l)[i]][k];
        triangles_covering_radius(&triangles, covering);
        triangles_hiding_radius(&triangles, (const lanes(*)[3])normals, covering, hiding);
        for (size_t l = 0; l < count; l++) {
            const double radius = cover->scale * larger(covering[l], lesser(hiding[l], large));
            for (int i = 0; i < 3; i++) grow(&cover->radii[mesh->triangles[t + l][i]], float_above(lesser(radius, FLT_MAX)));
        }
    }
    return PBR_OK;
}

/* The referenced vertices in order, and their radii. */
static pbr_result choose_vertices(const pbr_mesh *mesh, double scale, const struct progress *progress, uint32_t *chosen,
                                  float *radii, uint64_t *count) {
    const size_t vertices = (size_t)mesh->vertices->count;
    struct cover cover = {.mesh = mesh, .scale = scale};
    cover.normals = pbr_allocate(mesh->instance, vertices, sizeof *cover.normals);
    cover.radii = pbr_allocate(mesh->instance, vertices, sizeof *cover.radii);
    pbr_result result = cover.normals && cover.radii ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (size_t v = 0; v < vertices && result == PBR_OK; v++) atomic_init(&cover.radii[v], -1);
    if (result == PBR_OK) result = pbr_parallel(mesh->instance, vertices, GRAIN, decode_range, &cover);
    if (result == PBR_OK)
        result = parallel_reporting(mesh->instance, (size_t)mesh->triangle_count, GRAIN, cover_range, &cover, progress,
                                    "covering triangles");
    *count = 0;
    for (size_t v = 0; v < vertices && result == PBR_OK; v++) {
        const float radius = atomic_load_explicit(&cover.radii[v], memory_order_relaxed);
        if (radius < 0) continue;
        chosen[*count] = (uint32_t)v;
        radii[(*count)++] = radius;
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
    uint32_t *chosen = pbr_allocate(instance, vertex_count, sizeof *chosen);
    float *radii = pbr_allocate(instance, vertex_count, sizeof *radii);
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
