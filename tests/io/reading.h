/* What the tests of single formats share: files and bytes read, counted, cut and changed. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_IO_READING_H
#define PBR_TESTS_IO_READING_H

#include "support.h"

#include <pbr/io.h>
#include <unistd.h>

/* What a file must give; 0 and NULL where it gives nothing. */
struct expected {
    const char *path; /* in the test data */
    pbr_result result;
    uint32_t format;
    uint64_t vertices, faces, triangles; /* triangles 0: points */
    uint32_t warnings;
    bool normals, colours;
    uint32_t scalars;
    const char *error; /* part of the message */
};

enum { OUTCOME_MOST = 32 };

struct outcome {
    pbr_result result;
    pbr_file_content content; /* its points and mesh are released */
    pbr_points_info points;
    pbr_mesh_info mesh;
    bool is_mesh;
    /* Of the first points, or of those that a mesh gives. */
    double positions[3 * OUTCOME_MOST];
    float normals[3 * OUTCOME_MOST], scalars[PBR_MAX_SCALARS][OUTCOME_MOST];
    uint8_t colours[4 * OUTCOME_MOST];
    char names[PBR_MAX_SCALARS][64];
    char error[512];
    int warnings;
};

static inline void copy_outcome(const pbr_points *points, struct outcome *out) {
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    assert_int_equal(pbr_points_get_info(points, &out->points), PBR_OK);
    uint64_t count = out->points.count < OUTCOME_MOST ? out->points.count : OUTCOME_MOST;
    copy.positions = out->positions;
    copy.normals = out->points.has_normals ? out->normals : NULL;
    copy.colours = out->points.has_colours ? out->colours : NULL;
    assert_int_equal(pbr_points_copy(points, 0, count, &copy), PBR_OK);
    for (uint32_t i = 0; i < out->points.scalar_count; i++) {
        pbr_points_copy_desc scalar = PBR_POINTS_COPY_DESC_INIT;
        scalar.scalar = out->scalars[i];
        scalar.scalar_index = i;
        assert_int_equal(pbr_points_copy(points, 0, count, &scalar), PBR_OK);
        snprintf(out->names[i], sizeof out->names[i], "%s", pbr_points_scalar_name(points, i));
    }
}

/* Reads bytes, or a file where `data` is NULL. Whatever they hold: at most 16 times their size and 64 MiB of memory at once, one
 * logged error if and only if there is an error, and nothing left. */
static inline struct outcome read_it(const char *path, const void *data, size_t size, uint32_t flags) {
    struct host host;
    struct outcome out = {.content = PBR_FILE_CONTENT_INIT, .points = PBR_POINTS_INFO_INIT, .mesh = PBR_MESH_INFO_INIT};
    pbr_instance *instance = host_instance(&host);
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    desc.flags = flags;
    out.result = data ? pbr_read_memory(instance, path, data, size, &desc, &out.content)
                      : pbr_read_file(instance, path, &desc, &out.content);
    assert_true(atomic_load(&host.peak) <= 16 * size + ((size_t)64 << 20));
    assert_int_equal(atomic_load(&host.errors), out.result != PBR_OK);
    if (out.result != PBR_OK) {
        assert_null(out.content.points);
        assert_null(out.content.mesh);
        assert_memory_equal(host.error, path, strlen(path));
    }
    out.is_mesh = out.content.mesh != NULL;
    if (out.is_mesh) {
        pbr_points *points = NULL;
        assert_int_equal(pbr_mesh_get_info(out.content.mesh, &out.mesh), PBR_OK);
        assert_int_equal(pbr_mesh_to_points(out.content.mesh, NULL, &points), PBR_OK);
        copy_outcome(points, &out);
        pbr_points_release(&points);
    }
    if (out.content.points) copy_outcome(out.content.points, &out);
    pbr_points_release(&out.content.points);
    pbr_mesh_release(&out.content.mesh);
    memcpy(out.error, host.error, sizeof out.error);
    out.warnings = atomic_load(&host.warnings);
    host_finish(&host, instance);
    return out;
}

/* From a block of exactly that size, so that the address sanitizer sees a byte too far. */
static inline struct outcome read_bytes(const void *data, size_t size) {
    char *exact = malloc(size ? size : 1);
    assert_non_null(exact);
    memcpy(exact, data, size);
    struct outcome out = read_it("bytes", exact, size, PBR_READ_KEEP_RADII);
    free(exact);
    return out;
}

static inline struct outcome read_text(const char *text) {
    return read_bytes(text, strlen(text));
}

static inline bool has_data(void) {
    if (access(test_data(), R_OK) == 0) return true;
    print_message("skipped: no test data at %s (PBR_TEST_DATA)\n", test_data());
    return false;
}

/* A file of the test data; the caller frees it. */
static inline char *load(const char *name, size_t *size) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", test_data(), name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *size = (size_t)ftell(file);
    rewind(file);
    char *data = malloc(*size + 1);
    assert_non_null(data);
    assert_int_equal(fread(data, 1, *size, file), *size);
    fclose(file);
    return data;
}

static inline void check_outcome(const struct expected *file, const struct outcome *out) {
    if (out->result != file->result) fail_msg("%s: %s (%s)", file->path, pbr_result_name(out->result), out->error);
    if (out->content.vertex_count != file->vertices || out->content.face_count != file->faces ||
        out->content.warning_count != file->warnings || out->mesh.triangle_count != file->triangles ||
        out->content.format != file->format)
        fail_msg("%s: format %u, %llu vertices, %llu faces, %llu triangles, %u warnings", file->path, (unsigned)out->content.format,
                 (unsigned long long)out->content.vertex_count, (unsigned long long)out->content.face_count,
                 (unsigned long long)out->mesh.triangle_count, (unsigned)out->content.warning_count);
    if (file->error && !strstr(out->error, file->error)) fail_msg("%s: %s", file->path, out->error);
    if (out->result != PBR_OK) return;
    assert_int_equal(out->is_mesh, file->triangles > 0);
    int normals = out->is_mesh ? out->mesh.has_normals : out->points.has_normals;
    if (normals != file->normals || out->points.has_colours != file->colours || out->points.scalar_count != file->scalars)
        fail_msg("%s: normals %d, colours %d, %u scalars", file->path, normals, out->points.has_colours,
                 (unsigned)out->points.scalar_count);
    if (!out->is_mesh) assert_int_equal(out->points.count, file->vertices);
}

/* Mapped, and as a stream. */
static inline void check_files(const struct expected *files, size_t count) {
    for (size_t i = 0; i < count; i++)
        for (int stream = 0; stream < 2; stream++) {
            size_t size;
            char path[4096];
            free(load(files[i].path, &size));
            snprintf(path, sizeof path, "%s/%s", test_data(), files[i].path);
            struct outcome out = read_it(path, NULL, size, PBR_READ_KEEP_RADII | (stream ? PBR_READ_STREAM : 0));
            check_outcome(&files[i], &out);
        }
}

/* Every prefix of the bytes gives points, a mesh or an error; never more than the whole. */
static inline void check_every_cut(const char *data, size_t size) {
    struct outcome whole = read_bytes(data, size);
    assert_int_equal(whole.result, PBR_OK);
    for (size_t cut = 0; cut < size; cut++) {
        struct outcome out = read_bytes(data, cut);
        if (out.result != PBR_OK) {
            assert_true(out.result == PBR_ERROR_FORMAT || out.result == PBR_ERROR_UNSUPPORTED);
            continue;
        }
        assert_true(out.content.vertex_count <= whole.content.vertex_count);
        assert_true(out.content.face_count <= whole.content.face_count);
    }
}

/* Changed bytes, the same ones in every run. */
static inline void check_changes(const char *data, size_t size, uint64_t seed, int rounds) {
    char *copy = malloc(size);
    assert_non_null(copy);
    for (int round = 0; round < rounds; round++) {
        memcpy(copy, data, size);
        for (uint64_t changes = 1 + random_next(&seed) % 8; changes > 0; changes--) {
            size_t at = (size_t)(random_next(&seed) % size);
            uint64_t kind = random_next(&seed);
            copy[at] = kind % 3 == 0 ? (char)(kind >> 8) : kind % 3 == 1 ? (char)(copy[at] ^ 1 << (kind >> 8 & 7)) : (char)-1;
        }
        struct outcome out = read_bytes(copy, size);
        assert_true(out.result == PBR_OK || out.result == PBR_ERROR_FORMAT || out.result == PBR_ERROR_UNSUPPORTED ||
                    out.result == PBR_ERROR_LIMIT);
    }
    free(copy);
}

#endif
