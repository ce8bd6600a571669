/* Triangle meshes, and the points that cover them. SPDX-License-Identifier: MIT */
#include "mesh.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "attribute.h"
#include "matrix.h"
#include "splat.h"

/* ---- One triangle ---- */

/* Growth of radii for tilted discs. Discs that are grown where they jut out are seen at silhouettes, so it stops at sharp edges and
 * at triangles that are large for their mesh. The numbers are a trade, tried on the scans. */
static const double SEEN_FROM = 3.7320508075688773; /* tan 75 degrees: from how far off the face normal */
static const double MOST_BENT = 0.6427876096865394; /* cos 50 degrees: between vertex and face normal */
static const double MOST_GROWTH = 1.3;
static const double LARGE = 3; /* times the mean covering radius */

/* Corners relative to one another: edges[i] leads from corner i to the next one. */
static void triangle_edges(const pbr_points *vertices, const uint32_t corners[3], double edges[3][3]) {
    double p[3][3];
    for (int i = 0; i < 3; i++) points_position(vertices, corners[i], p[i]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) edges[i][k] = p[(i + 1) % 3][k] - p[i][k];
}

/* Twice the area is no more than what rounding makes of a straight line. */
static bool is_degenerate(const double edges[3][3]) {
    double normal[3];
    cross3(edges[0], edges[1], normal);
    double longest = fmax(dot3(edges[0], edges[0]), fmax(dot3(edges[1], edges[1]), dot3(edges[2], edges[2])));
    return !(length3(normal) > 8 * DBL_EPSILON * longest);
}

/* The smallest radius at which three equal discs around the corners cover the triangle. Squared sides a, b and c, the longest; in
 * an obtuse triangle the last point covered lies on the longest side, b / (2 cos A) from A or a / (2 cos B) from B, here by the law
 * of cosines. On a line that is half the longer gap. */
double triangle_covering_radius(const double edges[3][3]) {
    double side[3] = {dot3(edges[0], edges[0]), dot3(edges[1], edges[1]), dot3(edges[2], edges[2])};
    int longest = side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
    double a = side[(longest + 1) % 3], b = side[(longest + 2) % 3], c = side[longest];
    if (a + b <= c) {
        double from_a = b > 0 ? b * sqrt(c) / (b + c - a) : 0, from_b = a > 0 ? a * sqrt(c) / (a + c - b) : 0;
        return fmax(from_a, from_b);
    }
    double normal[3];
    cross3(edges[0], edges[1], normal);
    return sqrt(a) * sqrt(b) * sqrt(c) / (2 * length3(normal));
}

/* The smallest circle around the corners: the barycentric weights of its centre, and where that is relative to each corner. */
static void enclosing_centre(const double edges[3][3], double weights[3], double to_centre[3][3]) {
    double side[3] = {dot3(edges[0], edges[0]), dot3(edges[1], edges[1]), dot3(edges[2], edges[2])}, sum = 0;
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
        for (int k = 0; k < 3; k++) to_centre[i][k] = weights[next] * edges[i][k] - weights[last] * edges[last][k];
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
double triangle_hiding_radius(const double edges[3][3], const double normals[3][3]) {
    const double covering = triangle_covering_radius(edges);
    double face[3], weights[3], to_centre[3][3], shift[3] = {0, 0, 0}, second = 0, radius = 0;
    if (is_degenerate(edges)) return covering;
    cross3(edges[0], edges[1], face);
    enclosing_centre(edges, weights, to_centre);
    for (int i = 0; i < 3; i++) {
        const double along = dot3(normals[i], face) / length3(face), length = length3(to_centre[i]);
        if (!(fabs(along) > MOST_BENT * length3(normals[i]))) return covering;
        const double bend = -dot3(normals[i], to_centre[i]) / (along * length);
        for (int k = 0; k < 3; k++) shift[k] += weights[i] * bend * to_centre[i][k] / length;
        second += weights[i] * bend * bend / 2;
        if (weights[i] > 0) radius = fmax(radius, length);
    }
    return radius * fmin(1 + SEEN_FROM * length3(shift) + second, MOST_GROWTH);
}

/* ---- All triangles ---- */

enum { BATCH = 1 << 16, GRAIN = 1 << 12 };

/* What all threads find out about the triangles of a batch, and one puts together, in their order: so the result does not depend on
 * the threads. */
struct batch {
    const pbr_mesh *mesh;
    uint64_t first;     /* triangle */
    struct face *faces; /* of each; or */
    double *radii;
    double scale, large; /* of radii: a factor, and what none grows beyond */
};

static pbr_result for_batches(struct batch *batch, pbr_range_fn find,
                              void (*gather)(const struct batch *batch, size_t count, void *to), void *to) {
    pbr_result result = PBR_OK;
    for (batch->first = 0; batch->first < batch->mesh->triangle_count && result == PBR_OK; batch->first += BATCH) {
        const uint64_t left = batch->mesh->triangle_count - batch->first;
        const size_t count = left < BATCH ? (size_t)left : BATCH;
        result = pbr_parallel(batch->mesh->instance, count, GRAIN, find, batch);
        if (result == PBR_OK) gather(batch, count, to);
    }
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

struct copying {
    pbr_mesh *mesh;
    const pbr_mesh_desc *desc;
    const pbr_attribute *indices;
    pbr_attribute positions;
    _Atomic uint64_t degenerate, wrong; /* wrong: the first triangle that uses vertices that there are not */
};

static void note_wrong(struct copying *copying, uint64_t triangle) {
    uint64_t first = atomic_load(&copying->wrong);
    while (triangle < first && !atomic_compare_exchange_weak(&copying->wrong, &first, triangle)) {
    }
}

static pbr_result copy_range(void *user, size_t begin, size_t end) {
    struct copying *copying = user;
    const pbr_mesh *mesh = copying->mesh;
    uint64_t degenerate = 0;
    for (size_t t = begin; t < end; t++) {
        double read[3], edges[3][3];
        uint32_t *corners = mesh->triangles[t];
        bool is_wrong = false;
        attribute_read(copying->indices, t, read);
        for (int k = 0; k < 3; k++) {
            corners[k] = (uint32_t)read[k];
            is_wrong |= corners[k] >= copying->desc->vertex_count;
        }
        if (is_wrong) {
            note_wrong(copying, t);
            return PBR_OK;
        }
        if (!is_finite(mesh, &copying->positions, corners)) continue;
        triangle_edges(mesh->vertices, corners, edges);
        degenerate += is_degenerate((const double(*)[3])edges);
    }
    atomic_fetch_add(&copying->degenerate, degenerate);
    return PBR_OK;
}

static pbr_result refuse_triangle(const struct copying *copying, uint64_t triangle) {
    double read[3];
    int corner = 0;
    attribute_read(copying->indices, triangle, read);
    while ((uint32_t)read[corner] < copying->desc->vertex_count) corner++;
    return pbr_log(copying->mesh->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                   "pbr_mesh_desc: triangle %llu uses vertex %u, but there are %llu", (unsigned long long)triangle,
                   (unsigned)read[corner], (unsigned long long)copying->desc->vertex_count);
}

static pbr_result copy_triangles(pbr_mesh *mesh, const pbr_mesh_desc *desc, const pbr_attribute *indices) {
    struct copying copying = {.mesh = mesh, .desc = desc, .indices = indices, .positions = desc->positions};
    pbr_result result = attribute_check(mesh->instance, "positions", &copying.positions, desc->vertex_count,
                                        1u << PBR_FORMAT_FLOAT32 | 1u << PBR_FORMAT_FLOAT64, 3, 3, false);
    if (result != PBR_OK) return result;
    mesh->triangles = pbr_allocate(mesh->instance, (size_t)desc->triangle_count, sizeof *mesh->triangles);
    if (!mesh->triangles) return PBR_ERROR_OUT_OF_MEMORY;
    atomic_init(&copying.degenerate, 0);
    atomic_init(&copying.wrong, UINT64_MAX);
    result = pbr_parallel(mesh->instance, (size_t)desc->triangle_count, GRAIN, copy_range, &copying);
    if (result != PBR_OK) return result;
    if (atomic_load(&copying.wrong) != UINT64_MAX) return refuse_triangle(&copying, atomic_load(&copying.wrong));
    mesh->degenerate = atomic_load(&copying.degenerate);
    for (uint64_t t = 0; t < desc->triangle_count; t++) {
        if (!is_finite(mesh, &copying.positions, mesh->triangles[t])) mesh->dropped++;
        else if (mesh->dropped > 0) memcpy(mesh->triangles[mesh->triangle_count++], mesh->triangles[t], sizeof *mesh->triangles);
        else mesh->triangle_count++;
    }
    return PBR_OK;
}

static pbr_result measure_referenced(pbr_mesh *mesh) {
    const pbr_points *vertices = mesh->vertices;
    uint8_t *referenced = pbr_allocate(mesh->instance, (size_t)vertices->count, 1);
    if (!referenced) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) referenced[mesh->triangles[t][k]] = 1;
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
            mesh->minimum[k] = any ? fmin(mesh->minimum[k], p[k]) : p[k];
            mesh->maximum[k] = any ? fmax(mesh->maximum[k], p[k]) : p[k];
        }
        any = true;
    }
    pbr_free(mesh->instance, referenced);
    return PBR_OK;
}

/* A triangle's unit normal, and the angles at its corners; none if it is degenerate. */
struct face {
    double normal[3], angles[3];
};

static pbr_result find_faces(void *user, size_t begin, size_t end) {
    const struct batch *batch = user;
    for (size_t i = begin; i < end; i++) {
        struct face *face = &batch->faces[i];
        double edges[3][3];
        triangle_edges(batch->mesh->vertices, batch->mesh->triangles[batch->first + i], edges);
        *face = (struct face){.normal = {0}};
        cross3(edges[0], edges[1], face->normal);
        const double length = length3(face->normal);
        if (is_degenerate((const double(*)[3])edges) || !(length > 0)) continue;
        for (int k = 0; k < 3; k++) {
            face->angles[k] = atan2(length, -dot3(edges[k], edges[(k + 2) % 3]));
            face->normal[k] /= length;
        }
    }
    return PBR_OK;
}

/* Corners' normals are weighted by the angles there: independent of how a flat region is cut into triangles (Thuermer and
 * Wuethrich 1998). */
static void add_faces(const struct batch *batch, size_t count, void *to) {
    double(*sums)[3] = to;
    for (size_t i = 0; i < count; i++) {
        const struct face *face = &batch->faces[i];
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        for (int c = 0; c < 3 && face->angles[c] > 0; c++)
            for (int k = 0; k < 3; k++) sums[corners[c]][k] += face->normal[k] * face->angles[c];
    }
}

static pbr_result average_normals(pbr_mesh *mesh) {
    pbr_points *vertices = mesh->vertices;
    size_t count = (size_t)vertices->count;
    double(*sums)[3] = pbr_allocate(mesh->instance, count, sizeof *sums);
    struct batch batch = {.mesh = mesh, .faces = pbr_allocate(mesh->instance, BATCH, sizeof *batch.faces)};
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    if (!sums || !batch.faces) goto cleanup;
    vertices->normals = pbr_allocate(mesh->instance, count, sizeof *vertices->normals);
    if (!vertices->normals) goto cleanup;
    vertices->memory_bytes += count * sizeof *vertices->normals;
    result = for_batches(&batch, find_faces, add_faces, sums);
    for (size_t v = 0; v < count && result == PBR_OK; v++) {
        float n[3] = {(float)sums[v][0], (float)sums[v][1], (float)sums[v][2]};
        splat_encode_normal(n, vertices->normals[v]);
    }
cleanup:
    pbr_free(mesh->instance, sums);
    pbr_free(mesh->instance, batch.faces);
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
    if (result == PBR_OK) result = measure_referenced(mesh);
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
        double edges[3][3];
        triangle_edges(batch->mesh->vertices, batch->mesh->triangles[batch->first + i], edges);
        batch->radii[i] = triangle_covering_radius((const double(*)[3])edges);
    }
    return PBR_OK;
}

static void sum_radii(const struct batch *batch, size_t count, void *to) {
    double *sum = to;
    for (size_t i = 0; i < count; i++) *sum += batch->radii[i];
}

static pbr_result find_hiding_radii(void *user, size_t begin, size_t end) {
    const struct batch *batch = user;
    const pbr_points *vertices = batch->mesh->vertices;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        double edges[3][3], normals[3][3];
        triangle_edges(vertices, corners, edges);
        for (int c = 0; c < 3; c++) {
            float n[3];
            splat_decode_normal(vertices->normals[corners[c]], n);
            for (int k = 0; k < 3; k++) normals[c][k] = (double)n[k];
        }
        const double covering = triangle_covering_radius((const double(*)[3])edges);
        const double hiding = triangle_hiding_radius((const double(*)[3])edges, (const double(*)[3])normals);
        batch->radii[i] = batch->scale * fmax(covering, fmin(hiding, batch->large));
    }
    return PBR_OK;
}

static void grow_corners(const struct batch *batch, size_t count, void *to) {
    float *radii = to;
    for (size_t i = 0; i < count; i++) {
        const float radius = float_above(fmin(batch->radii[i], FLT_MAX));
        const uint32_t *corners = batch->mesh->triangles[batch->first + i];
        for (int k = 0; k < 3; k++) radii[corners[k]] = fmaxf(radii[corners[k]], radius);
    }
}

/* The referenced vertices in order, and their radii. `radii` has one per vertex and is compacted in place. */
static pbr_result choose_vertices(const pbr_mesh *mesh, double scale, uint32_t *chosen, float *radii, uint64_t *count) {
    struct batch batch = {.mesh = mesh, .radii = pbr_allocate(mesh->instance, BATCH, sizeof *batch.radii), .scale = scale};
    double sum = 0;
    *count = 0;
    if (!batch.radii) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t v = 0; v < mesh->vertices->count; v++) radii[v] = -1;
    pbr_result result = for_batches(&batch, find_covering_radii, sum_radii, &sum);
    batch.large = mesh->triangle_count > 0 ? LARGE * (sum / (double)mesh->triangle_count) : 0;
    if (result == PBR_OK) result = for_batches(&batch, find_hiding_radii, grow_corners, radii);
    for (uint64_t v = 0; v < mesh->vertices->count && result == PBR_OK; v++) {
        if (radii[v] < 0) continue;
        chosen[*count] = (uint32_t)v;
        radii[(*count)++] = radii[v];
    }
    pbr_free(mesh->instance, batch.radii);
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
