/* Any bytes as a file of points or a mesh, and what was read as points. With FUZZ_FORMAT=ply, say, only what is recognised as PLY
 * is looked at, so that the fuzzer stays there. SPDX-License-Identifier: MIT */
#include "fuzz.h"

#include <math.h>
#include <pbr/io.h>

#include "io/formats.h"

/* What points.h says of every point. */
static void check_copies(const pbr_points_info *info, const pbr_points_copy_desc *copy) {
    for (uint64_t i = 0; i < info->count; i++) {
        for (int k = 0; k < 3; k++) {
            double x = copy->positions[3 * i + (uint64_t)k];
            expect(isfinite(x), "positions are finite");
            expect(x >= info->minimum[k] && x <= info->maximum[k], "positions are inside the box");
        }
        expect(copy->radii[i] >= 0 && isfinite(copy->radii[i]), "radii are finite and not negative");
        if (!copy->normals) continue;
        const float *n = copy->normals + 3 * i;
        double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]);
        /* Stored in 2 x 16 bits: see docs/internals.md. */
        expect(length == 0 || fabs(length - 1) < 1e-3, "normals are unit or zero");
    }
}

static void check_points(const pbr_points *points) {
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    expect(pbr_points_get_info(points, &info) == PBR_OK, "points describe themselves");
    size_t count = (size_t)info.count;
    /* Exactly as large as promised: the sanitizer sees a byte more. */
    copy.positions = malloc(count * 3 * sizeof *copy.positions);
    copy.radii = malloc(count * sizeof *copy.radii);
    copy.normals = info.has_normals ? malloc(count * 3 * sizeof *copy.normals) : NULL;
    copy.colours = info.has_colours ? malloc(count * 4) : NULL;
    copy.scalar = info.scalar_count ? malloc(count * sizeof *copy.scalar) : NULL;
    expect(pbr_points_copy(points, 0, count, &copy) == PBR_OK, "points can be copied");
    check_copies(&info, &copy);
    for (copy.scalar_index = 1; copy.scalar_index < info.scalar_count; copy.scalar_index++)
        expect(pbr_points_copy(points, 0, count, &copy) == PBR_OK, "every scalar can be copied");
    for (uint32_t i = 0; i < info.scalar_count; i++)
        expect(strlen(pbr_points_scalar_name(points, i)) < 64, "scalars have names of at most 63 bytes");
    expect(!pbr_points_scalar_name(points, info.scalar_count), "no name past the last scalar");
    free(copy.positions);
    free(copy.radii);
    free(copy.normals);
    free(copy.colours);
    free(copy.scalar);
}

static void check_corners(const pbr_mesh *mesh, const pbr_mesh_info *info) {
    pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
    copy.vertex_count = info->vertex_count;
    copy.triangle_count = info->triangle_count;
    copy.positions = malloc((size_t)info->vertex_count * 3 * sizeof *copy.positions);
    copy.normals = malloc((size_t)info->vertex_count * 3 * sizeof *copy.normals);
    copy.colours = info->has_colours ? malloc((size_t)info->vertex_count * 4) : NULL;
    copy.triangles = malloc((size_t)info->triangle_count * 3 * sizeof *copy.triangles);
    expect(pbr_mesh_copy(mesh, &copy) == PBR_OK, "a mesh can be copied");
    for (uint64_t i = 0; i < 3 * info->triangle_count; i++)
        expect(copy.triangles[i] < info->vertex_count, "triangles have corners that exist");
    free(copy.positions);
    free(copy.normals);
    free(copy.colours);
    free(copy.triangles);
}

static void check_mesh(const pbr_mesh *mesh) {
    pbr_mesh_info info = PBR_MESH_INFO_INIT;
    pbr_points_info made = PBR_POINTS_INFO_INIT;
    pbr_points *points = NULL;
    expect(pbr_mesh_get_info(mesh, &info) == PBR_OK, "a mesh describes itself");
    check_corners(mesh, &info);
    expect(pbr_mesh_to_points(mesh, NULL, &points) == PBR_OK, "a mesh becomes points");
    expect(pbr_points_get_info(points, &made) == PBR_OK, "points describe themselves");
    expect(made.count == info.vertex_count - info.unreferenced_count, "one point for each referenced vertex");
    check_points(points);
    pbr_points_release(&points);
}

#ifdef FUZZ_FORMAT
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
static bool is_wanted(const uint8_t *data, size_t size) {
    return JOIN(FUZZ_FORMAT, _recognise)(&(struct reader){.data = (const char *)data, .size = size, .line_end = '\n'});
}
#else
static bool is_wanted(const uint8_t *data, size_t size) {
    (void)data, (void)size;
    return true;
}
#endif

/* The same bytes as a source that is read in pieces, but for opening the file. */
static void check_records(pbr_instance *instance, const uint8_t *data, size_t size) {
    struct reader reader = {.instance = instance, .name = "input", .data = (const char *)data, .size = size, .line_end = '\n'};
    struct records records = {.data = NULL};
    pbr_result result = PBR_ERROR_UNSUPPORTED;
    if (ply_recognise(&reader)) result = ply_records(&reader, &records);
    else if (las_recognise(&reader)) result = las_records(&reader, &records);
    if (result != PBR_OK) return;
    expect(records.count <= size, "a record takes a byte");
    for (uint64_t i = 0; i < records.count; i++) {
        double *position = malloc(3 * sizeof *position);
        float *normal = malloc(3 * sizeof *normal), *radius = calloc(1, sizeof *radius);
        uint8_t *colour = malloc(4);
        records_decode(&records, i, 1, position, normal, colour, radius);
        expect(*radius >= 0 && isfinite(*radius), "radii are finite and not negative");
        free(position);
        free(normal);
        free(radius);
        free(colour);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct host host;
    if (!is_wanted(data, size)) return 0;
    /* What reading may take: docs/hardening.md. */
    pbr_instance *instance = host_start(&host, 16 * size + ((size_t)64 << 20));
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_result result = pbr_read_memory(instance, "input", data, size, NULL, &content);
    expect(!host.refused, "reading takes at most 16 times the file and 64 MiB");
    expect(result == PBR_OK ? host.errors == 0 : host.errors == 1, "an error is explained once, a success never");
    if (result == PBR_OK) expect(!content.points != !content.mesh, "a file holds points or a mesh");
    else expect(!content.points && !content.mesh, "an error leaves nothing");
    host.limit = SIZE_MAX / 2; /* what follows is the caller's wish, not the file's */
    if (content.points) check_points(content.points);
    if (content.mesh) check_mesh(content.mesh);
    pbr_points_release(&content.points);
    pbr_mesh_release(&content.mesh);
    check_records(instance, data, size);
    host_stop(&host, instance);
    return 0;
}
