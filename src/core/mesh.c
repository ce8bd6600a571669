/* Triangle meshes, and the points that cover them. SPDX-License-Identifier: MIT */
#include "mesh.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "attribute.h"
#include "matrix.h"
#include "minmax.h"
#include "splat.h"

/* ---- One triangle ---- */

/* Growth of radii for tilted discs. Discs that are grown where they jut out are seen at silhouettes, so it stops at sharp edges and
 * at triangles that are large for their mesh. The numbers are a trade, tried on the scans. */
static const double SEEN_FROM = 3.7320508075688773; /* tan 75 degrees: from how far off the face normal */
static const double MOST_BENT = 0.6427876096865394; /* cos 50 degrees: between vertex and face normal */
static const double MOST_GROWTH = 1.3;
static const double LARGE = 3; /* times the mean covering radius */

static const double PI = 3.14159265358979323846;

void triangle_measure(const double corners[3][3], struct triangle *out) {
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) out->edges[i][k] = corners[(i + 1) % 3][k] - corners[i][k];
        out->sides[i] = dot3(out->edges[i], out->edges[i]);
    }
    cross3(out->edges[0], out->edges[1], out->normal);
    out->length = length3(out->normal);
    out->is_degenerate = !(out->length > 8 * DBL_EPSILON * larger(out->sides[0], larger(out->sides[1], out->sides[2])));
}

static void measure(const pbr_points *vertices, const uint32_t corners[3], struct triangle *out) {
    double p[3][3];
    for (int i = 0; i < 3; i++) points_position(vertices, corners[i], p[i]);
    triangle_measure((const double(*)[3])p, out);
}

/* The smallest radius at which three equal discs around the corners cover the triangle. Squared sides a, b and c, the longest; in
 * an obtuse triangle the last point covered lies on the longest side, b / (2 cos A) from A or a / (2 cos B) from B, here by the law
 * of cosines. On a line that is half the longer gap. */
double triangle_covering_radius(const struct triangle *triangle) {
    const double *side = triangle->sides;
    int longest = side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
    double a = side[(longest + 1) % 3], b = side[(longest + 2) % 3], c = side[longest];
    if (a + b <= c) {
        double from_a = b > 0 ? b * sqrt(c) / (b + c - a) : 0, from_b = a > 0 ? a * sqrt(c) / (a + c - b) : 0;
        return lesser(larger(from_a, from_b), sqrt(c) / 2); /* of needles rounding may leave neither */
    }
    return sqrt(a) * sqrt(b) * sqrt(c) / (2 * triangle->length);
}

/* The smallest circle around the corners: the barycentric weights of its centre, and where that is relative to each corner. */
static void enclosing_centre(const struct triangle *triangle, double weights[3], double to_centre[3][3]) {
    const double *side = triangle->sides;
    double sum = 0;
    int obtuse = -1;
    for (int i = 0; i < 3; i++) { /* the circumcentre's weights; the side opposite to corner i is the next edge */
        const double opposite = side[(i + 1) % 3], adjacent = side[i] + side[(i + 2) % 3];
        weights[i] = opposite * (adjacent - opposite);
        if (!(weights[i] > 0)) obtuse = i;
    }
    for (int i = 0; i < 3 && obtuse >= 0; i++) weights[i] = i != obtuse;
    for (int i = 0; i < 3; i++) sum += weights[i];
    for (int i = 0; i < 3; i++) weights[i] /= sum;
    for (int i = 0; i < 3; i++) {
        const int next = (i + 1) % 3, last = (i + 2) % 3;
        for (int k = 0; k < 3; k++)
            to_centre[i][k] = weights[next] * triangle->edges[i][k] - weights[last] * triangle->edges[last][k];
    }
}

/* Discs across vertex normals do not lie in the triangle's plane. Let the normal n at the corner p be along m + t, m the face
 * normal and t in the plane; seen along a direction at an angle to m of tangent T, coming from the side of the unit vector w of the
 * plane, a disc of radius r hides x of the triangle iff |P(x - p)| <= r, with P the projection along that direction onto the disc's
 * plane:
 *
 *     |P(x - p)| = |x - p| (1 - T (t.v) (v.w) + O(t^2)), v the unit vector from p to x.
 *
 * Take for x the centre of the smallest circle around the corners, R its radius, l_i its barycentric coordinates: the l_i v_i sum
 * up to 0. Near it, x + e is missed by all discs only if v_i.e > r - |P_i(x - p_i)| for all i. The mean by l_i of the left sides is
 * 0, so r need only be the mean of the right sides' ratios, and for the worst w that is
 *
 *     r / R = 1 + T |sum l_i (t_i.v_i) v_i| + O(t^2).
 *
 * Normals that bend alike, as on a sphere, cancel out: what turns one disc away from the eye turns another towards it. There the
 * discs have a point in common at the mean of 1 / cos of the bends, taken to second order, and no direction sees between them. */
double triangle_hiding_radius(const struct triangle *triangle, const double normals[3][3], double covering) {
    double weights[3], to_centre[3][3], shift[3] = {0, 0, 0}, second = 0, radius = 0;
    if (triangle->is_degenerate) return covering;
    enclosing_centre(triangle, weights, to_centre);
    for (int i = 0; i < 3; i++) {
        const double along = dot3(normals[i], triangle->normal) / triangle->length, length = length3(to_centre[i]);
        if (!(fabs(along) > MOST_BENT * length3(normals[i]))) return covering;
        const double bend = -dot3(normals[i], to_centre[i]) / (along * length);
        for (int k = 0; k < 3; k++) shift[k] += weights[i] * bend * to_centre[i][k] / length;
        second += weights[i] * bend * bend / 2;
        if (weights[i] > 0) radius = larger(length, radius);
    }
    return radius * lesser(1 + SEEN_FROM * length3(shift) + second, MOST_GROWTH);
}

/* ---- All triangles ---- */

enum { BATCH = 1 << 15, GRAIN = 1 << 12 };

/* What all threads find out about the triangles of a batch, and one puts together, in their order: so the result does not depend on
 * the threads. */
struct batch {
    const pbr_mesh *mesh;
    uint64_t first; /* triangle */
    size_t count;
    struct face *faces; /* of each; or */
    double *radii;
    double scale, large; /* of radii: a factor, and what none grows beyond */
};

/* One batch is put together while the next one is made. */
struct sweep {
    struct batch made, next;
    pbr_range_fn find; /* of `next` */
    void (*gather)(const struct batch *batch, void *to);
    void *to;
};

static pbr_result sweep_pieces(void *user, size_t begin, size_t end) {
    struct sweep *sweep = user;
    pbr_result result = PBR_OK;
    for (size_t piece = begin; piece < end && result == PBR_OK; piece++) {
        const size_t from = piece == 0 ? 0 : (piece - 1) * GRAIN, left = sweep->next.count - from;
        if (piece == 0) sweep->gather(&sweep->made, sweep->to);
        else result = sweep->find(&sweep->next, from, from + (left < GRAIN ? left : GRAIN));
    }
    return result;
}

/* The batches have space for BATCH triangles each. */
static pbr_result sweep_triangles(struct sweep *sweep) {
    const pbr_mesh *mesh = sweep->next.mesh;
    uint64_t first = 0;
    sweep->made.count = 0;
    do {
        const uint64_t left = mesh->triangle_count - first;
        sweep->next.first = first;
        sweep->next.count = left < BATCH ? (size_t)left : BATCH;
        const size_t pieces = 1 + (sweep->next.count + GRAIN - 1) / GRAIN;
        const pbr_result result = pbr_parallel(mesh->instance, pieces, 1, sweep_pieces, sweep);
        if (result != PBR_OK) return result;
        const struct batch made = sweep->next;
        sweep->next = sweep->made;
        sweep->made = made;
        first += made.count;
    } while (sweep->made.count > 0);
    return PBR_OK;
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

struct copying {
    pbr_mesh *mesh;
    const pbr_mesh_desc *desc;
    const pbr_attribute *indices;
    pbr_attribute positions;
    _Atomic uint8_t *referenced;        /* of each vertex */
    _Atomic uint64_t degenerate, wrong; /* wrong: the first triangle that uses vertices that there are not */
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

static pbr_result copy_range(void *user, size_t begin, size_t end) {
    struct copying *copying = user;
    const pbr_mesh *mesh = copying->mesh;
    uint64_t degenerate = 0;
    for (size_t t = begin; t < end; t++) {
        struct triangle triangle;
        uint32_t *corners = mesh->triangles[t];
        bool is_wrong = false;
        read_corners(copying->indices, t, corners);
        for (int k = 0; k < 3; k++) is_wrong |= corners[k] >= copying->desc->vertex_count;
        if (is_wrong) {
            note_wrong(copying, t);
            return PBR_OK;
        }
        if (!is_finite(mesh, &copying->positions, corners)) continue;
        for (int k = 0; k < 3; k++) atomic_store_explicit(&copying->referenced[corners[k]], 1, memory_order_relaxed);
        measure(mesh->vertices, corners, &triangle);
        degenerate += triangle.is_degenerate;
    }
    atomic_fetch_add(&copying->degenerate, degenerate);
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

static pbr_result copy_triangles(pbr_mesh *mesh, const pbr_mesh_desc *desc, const pbr_attribute *indices) {
    struct copying copying = {.mesh = mesh, .desc = desc, .indices = indices, .positions = desc->positions};
    pbr_result result = attribute_check(mesh->instance, "positions", &copying.positions, desc->vertex_count,
                                        1u << PBR_FORMAT_FLOAT32 | 1u << PBR_FORMAT_FLOAT64, 3, 3, false);
    if (result != PBR_OK) return result;
    mesh->triangles = pbr_allocate(mesh->instance, (size_t)desc->triangle_count, sizeof *mesh->triangles);
    copying.referenced = pbr_allocate(mesh->instance, (size_t)mesh->vertices->count, sizeof *copying.referenced);
    atomic_init(&copying.degenerate, 0);
    atomic_init(&copying.wrong, UINT64_MAX);
    result = PBR_ERROR_OUT_OF_MEMORY;
    if (!mesh->triangles || !copying.referenced) goto cleanup;
    result = pbr_parallel(mesh->instance, (size_t)desc->triangle_count, GRAIN, copy_range, &copying);
    if (result != PBR_OK) goto cleanup;
    if (atomic_load(&copying.wrong) != UINT64_MAX) {
        result = refuse_triangle(&copying, atomic_load(&copying.wrong));
        goto cleanup;
    }
    mesh->degenerate = atomic_load(&copying.degenerate);
    keep_triangles(mesh, &copying);
    measure_referenced(mesh, copying.referenced);
cleanup:
    pbr_free(mesh->instance, copying.referenced);
    return result;
}

/* A triangle's unit normal, and the angles at its corners; none if it is degenerate. */
struct face {
    double normal[3], angles[3];
};

static pbr_result find_faces(void *user, size_t begin, size_t end) {
    const struct batch *batch = user;
    for (size_t i = begin; i < end; i++) {
        struct face *face = &batch->faces[i];
        struct triangle triangle;
        measure(batch->mesh->vertices, batch->mesh->triangles[batch->first + i], &triangle);
        *face = (struct face){.normal = {0}};
        if (triangle.is_degenerate || !(triangle.length > 0)) continue;
        for (int k = 0; k < 2; k++) face->angles[k] = atan2(triangle.length, -dot3(triangle.edges[k], triangle.edges[(k + 2) % 3]));
        face->angles[2] = larger(PI - face->angles[0] - face->angles[1], 0);
        for (int k = 0; k < 3; k++) face->normal[k] = triangle.normal[k] / triangle.length;
    }
    return PBR_OK;
}

/* Corners' normals are weighted by the angles there: independent of how a flat region is cut into triangles (Thuermer and
 * Wuethrich 1998). */
static void add_faces(const struct batch *batch, void *to) {
    double(*sums)[3] = to;
    for (size_t i = 0; i < batch->count; i++) {
        const struct face *face = &batch->faces[i];
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) sums[corners[c]][k] += face->normal[k] * face->angles[c];
    }
}

struct averages {
    const double (*sums)[3];
    int16_t (*normals)[2];
};

static pbr_result encode_range(void *user, size_t begin, size_t end) {
    const struct averages *averages = user;
    for (size_t v = begin; v < end; v++) {
        const double *sum = averages->sums[v];
        const float n[3] = {(float)sum[0], (float)sum[1], (float)sum[2]};
        splat_encode_normal(n, averages->normals[v]);
    }
    return PBR_OK;
}

static pbr_result average_normals(pbr_mesh *mesh) {
    pbr_points *vertices = mesh->vertices;
    size_t count = (size_t)vertices->count;
    double(*sums)[3] = pbr_allocate(mesh->instance, count, sizeof *sums);
    struct face *faces = pbr_allocate(mesh->instance, 2 * BATCH, sizeof *faces);
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    if (!sums || !faces) goto cleanup;
    vertices->normals = pbr_allocate(mesh->instance, count, sizeof *vertices->normals);
    if (!vertices->normals) goto cleanup;
    vertices->memory_bytes += count * sizeof *vertices->normals;
    struct sweep sweep = {.made = {.mesh = mesh, .faces = faces},
                          .next = {.mesh = mesh, .faces = faces + BATCH},
                          .find = find_faces,
                          .gather = add_faces,
                          .to = sums};
    result = sweep_triangles(&sweep);
    struct averages averages = {(const double(*)[3])sums, vertices->normals};
    if (result == PBR_OK) result = pbr_parallel(mesh->instance, count, GRAIN, encode_range, &averages);
cleanup:
    pbr_free(mesh->instance, sums);
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
    if (result == PBR_OK) result = progress_report(&progress, "copying triangles", 0);
    if (result == PBR_OK) result = copy_triangles(mesh, &d, &indices);
    if (result == PBR_OK) result = progress_report(&progress, "copying triangles", 1);
    if (result == PBR_OK && !mesh->given_normals) result = average_normals(mesh);
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

static pbr_result find_covering_radii(void *user, size_t begin, size_t end) {
    const struct batch *batch = user;
    for (size_t i = begin; i < end; i++) {
        struct triangle triangle;
        measure(batch->mesh->vertices, batch->mesh->triangles[batch->first + i], &triangle);
        batch->radii[i] = triangle_covering_radius(&triangle);
    }
    return PBR_OK;
}

static void sum_radii(const struct batch *batch, void *to) {
    double *sum = to;
    for (size_t i = 0; i < batch->count; i++) *sum += batch->radii[i];
}

static pbr_result find_hiding_radii(void *user, size_t begin, size_t end) {
    const struct batch *batch = user;
    const pbr_points *vertices = batch->mesh->vertices;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        struct triangle triangle;
        double normals[3][3];
        measure(vertices, corners, &triangle);
        for (int c = 0; c < 3; c++) {
            float n[3];
            splat_decode_normal(vertices->normals[corners[c]], n);
            for (int k = 0; k < 3; k++) normals[c][k] = (double)n[k];
        }
        const double covering = triangle_covering_radius(&triangle);
        const double hiding = triangle_hiding_radius(&triangle, (const double(*)[3])normals, covering);
        batch->radii[i] = (double)float_above(lesser(batch->scale * larger(covering, lesser(hiding, batch->large)), FLT_MAX));
    }
    return PBR_OK;
}

static void grow_corners(const struct batch *batch, void *to) {
    float *radii = to;
    for (size_t i = 0; i < batch->count; i++) {
        const float radius = (float)batch->radii[i];
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        for (int k = 0; k < 3; k++)
            if (radius > radii[corners[k]]) radii[corners[k]] = radius;
    }
}

/* The referenced vertices in order, and their radii. `radii` has one per vertex and is compacted in place. */
static pbr_result choose_vertices(const pbr_mesh *mesh, double scale, uint32_t *chosen, float *radii, uint64_t *count) {
    double *found = pbr_allocate(mesh->instance, 2 * BATCH, sizeof *found), sum = 0;
    struct sweep sweep = {.made = {.mesh = mesh, .radii = found, .scale = scale},
                          .next = {.mesh = mesh, .radii = found + BATCH, .scale = scale},
                          .find = find_covering_radii,
                          .gather = sum_radii,
                          .to = &sum};
    *count = 0;
    if (!found) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t v = 0; v < mesh->vertices->count; v++) radii[v] = -1;
    pbr_result result = sweep_triangles(&sweep);
    sweep.made.large = sweep.next.large = mesh->triangle_count > 0 ? LARGE * (sum / (double)mesh->triangle_count) : 0;
    sweep.find = find_hiding_radii, sweep.gather = grow_corners, sweep.to = radii;
    if (result == PBR_OK) result = sweep_triangles(&sweep);
    for (uint64_t v = 0; v < mesh->vertices->count && result == PBR_OK; v++) {
        if (radii[v] < 0) continue;
        chosen[*count] = (uint32_t)v;
        radii[(*count)++] = radii[v];
    }
    pbr_free(mesh->instance, found);
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
    result = chosen && radii ? progress_report(&progress, "covering triangles", 0) : PBR_ERROR_OUT_OF_MEMORY;
    if (result != PBR_OK) goto cleanup;
    uint64_t count;
    result = choose_vertices(mesh, d.radius_scale > 0 ? d.radius_scale : 1, chosen, radii, &count);
    if (result == PBR_OK) result = points_select(mesh->vertices, chosen, count, radii, &points);
    if (result == PBR_OK) result = progress_report(&progress, "covering triangles", 1);
cleanup:
    pbr_free(instance, chosen);
    pbr_free(instance, radii);
    if (result == PBR_OK) *out = points;
    else pbr_points_release(&points);
    return result;
}
