/* Writing PLY: binary, little-endian, a vertex element of floats (and of doubles where floats would move a position), colours as
 * bytes, faces as lists of three. SPDX-License-Identifier: MIT */
#include <pbr/io.h>
#include <stdio.h>
#include <string.h>

#include "core/file.h"
#include "ply.h"
#include "sized.h"

enum { CHUNK = 16384, HEADER_BYTES = 8192, FACE_BYTES = 1 + 3 * 4 };

struct job {
    pbr_instance *instance;
    const pbr_points *points; /* one of the two */
    const pbr_mesh *mesh;
    pbr_write_desc desc;
    uint64_t count, triangle_count;
    uint32_t scalar_count;
    bool has_normals, has_colours, has_radii;
    bool wide; /* positions are doubles */
    struct output output;
    uint64_t offset; /* in the file */
    uint64_t done;   /* vertices and triangles written */
    size_t row_size;
    /* Of one chunk. */
    double (*positions)[3];
    float (*normals)[3], *numbers;
    uint8_t (*colours)[4];
    uint32_t (*triangles)[3];
    unsigned char *rows;
};

/* ---- what there is ---- */

static pbr_result describe(struct job *job) {
    pbr_points_info points = PBR_POINTS_INFO_INIT;
    pbr_mesh_info mesh = PBR_MESH_INFO_INIT;
    pbr_result result = job->points ? pbr_points_get_info(job->points, &points) : pbr_mesh_get_info(job->mesh, &mesh);
    job->count = job->points ? points.count : mesh.vertex_count;
    job->triangle_count = mesh.triangle_count;
    job->scalar_count = points.scalar_count;
    job->has_normals = job->points ? points.has_normals : mesh.has_normals;
    job->has_colours = job->points ? points.has_colours : mesh.has_colours;
    job->has_radii = job->points && points.has_radii;
    return result;
}

static size_t chunk_size(uint64_t first, uint64_t count) {
    return count - first < CHUNK ? (size_t)(count - first) : CHUNK;
}

static pbr_result copy_vertices(const struct job *job, uint64_t first, size_t count, bool attributes) {
    if (job->mesh) {
        pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
        copy.first_vertex = first;
        copy.vertex_count = count;
        copy.positions = &job->positions[0][0];
        if (attributes && job->has_normals) copy.normals = &job->normals[0][0];
        if (attributes && job->has_colours) copy.colours = &job->colours[0][0];
        return pbr_mesh_copy(job->mesh, &copy);
    }
    pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
    copy.positions = &job->positions[0][0];
    if (attributes && job->has_normals) copy.normals = &job->normals[0][0];
    if (attributes && job->has_colours) copy.colours = &job->colours[0][0];
    return pbr_points_copy(job->points, first, count, &copy);
}

/* Whether float would change any position. */
static pbr_result find_wide(struct job *job) {
    for (uint64_t first = 0; first < job->count && !job->wide; first += CHUNK) {
        size_t now = chunk_size(first, job->count);
        pbr_result result = copy_vertices(job, first, now, false);
        if (result != PBR_OK) return result;
        for (size_t i = 0; i < now; i++)
            for (int k = 0; k < 3; k++) job->wide |= (double)(float)job->positions[i][k] != job->positions[i][k];
    }
    return PBR_OK;
}

/* ---- bytes ---- */

static pbr_result put_bytes(struct job *job, const void *data, size_t size) {
    if (!output_write(&job->output, data, size, job->offset)) return PBR_ERROR_IO; /* which output_close explains */
    job->offset += size;
    return PBR_OK;
}

static void put_integer(unsigned char *to, uint64_t value, size_t size) {
    for (size_t i = 0; i < size; i++) to[i] = (unsigned char)(value >> (8 * i));
}

static void put_float(unsigned char *to, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_integer(to, bits, 4);
}

static void put_double(unsigned char *to, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_integer(to, bits, 8);
}

/* ---- the header ---- */

/* A scalar's name as one word, and none that means something else. */
static void put_scalar_name(char *header, size_t *at, const char *name) {
    char word[64] = "scalar";
    if (*name) snprintf(word, sizeof word, "%s", name);
    for (char *p = word; *p; p++)
        if ((unsigned char)*p <= ' ' || *p == 127) *p = '_';
    *at += (size_t)snprintf(header + *at, HEADER_BYTES - *at, "property float %s%s\n", ply_is_role(word) ? "scalar_" : "", word);
}

static pbr_result write_header(struct job *job) {
    char header[HEADER_BYTES];
    const char *real = job->wide ? "double" : "float";
    size_t at = (size_t)snprintf(
        header, sizeof header,
        "ply\nformat binary_little_endian 1.0\nelement vertex %llu\nproperty %s x\nproperty %s y\n"
        "property %s z\n%s%s%s",
        (unsigned long long)job->count, real, real, real,
        job->has_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
        job->has_colours ? "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n" : "",
        job->has_radii ? "property float radius\n" : "");
    for (uint32_t i = 0; i < job->scalar_count; i++) put_scalar_name(header, &at, pbr_points_scalar_name(job->points, i));
    if (job->mesh)
        at += (size_t)snprintf(header + at, sizeof header - at, "element face %llu\nproperty list uchar uint vertex_indices\n",
                               (unsigned long long)job->triangle_count);
    at += (size_t)snprintf(header + at, sizeof header - at, "end_header\n");
    return put_bytes(job, header, at);
}

/* ---- rows ---- */

static pbr_result tell(const struct job *job) {
    if (!job->desc.progress) return PBR_OK;
    uint64_t all = job->count + job->triangle_count;
    double fraction = all ? (double)job->done / (double)all : 1;
    return job->desc.progress(job->desc.progress_user, "writing", fraction) ? PBR_OK : PBR_ERROR_CANCELLED;
}

static void put_attributes(struct job *job, size_t count) {
    size_t real = job->wide ? 8 : 4;
    for (size_t i = 0; i < count; i++) {
        unsigned char *to = job->rows + i * job->row_size;
        for (int k = 0; k < 3; k++, to += real)
            if (job->wide) put_double(to, job->positions[i][k]);
            else put_float(to, (float)job->positions[i][k]);
        for (int k = 0; k < 3 && job->has_normals; k++, to += 4) put_float(to, job->normals[i][k]);
        if (job->has_colours) memcpy(to, job->colours[i], 4);
    }
}

/* One number of each point, at `at` in its row. */
static pbr_result put_numbers(struct job *job, uint64_t first, size_t count, const pbr_points_copy_desc *copy, size_t at) {
    pbr_result result = pbr_points_copy(job->points, first, count, copy);
    for (size_t i = 0; i < count && result == PBR_OK; i++) put_float(job->rows + i * job->row_size + at, job->numbers[i]);
    return result;
}

static pbr_result write_vertices(struct job *job) {
    size_t numbers = job->has_radii + (size_t)job->scalar_count;
    for (uint64_t first = 0; first < job->count; first += CHUNK) {
        size_t now = chunk_size(first, job->count), at = job->row_size - 4 * numbers;
        pbr_result result = tell(job);
        if (result == PBR_OK) result = copy_vertices(job, first, now, true);
        if (result == PBR_OK) put_attributes(job, now);
        for (size_t i = 0; i < numbers && result == PBR_OK; i++, at += 4) {
            pbr_points_copy_desc copy = PBR_POINTS_COPY_DESC_INIT;
            if (i == 0 && job->has_radii) copy.radii = job->numbers;
            else copy.scalar = job->numbers;
            copy.scalar_index = (uint32_t)(i - job->has_radii) * (copy.scalar != NULL);
            result = put_numbers(job, first, now, &copy, at);
        }
        if (result == PBR_OK) result = put_bytes(job, job->rows, now * job->row_size);
        if (result != PBR_OK) return result;
        job->done += now;
    }
    return PBR_OK;
}

static pbr_result write_faces(struct job *job) {
    for (uint64_t first = 0; first < job->triangle_count; first += CHUNK) {
        pbr_mesh_copy_desc copy = PBR_MESH_COPY_DESC_INIT;
        size_t now = chunk_size(first, job->triangle_count);
        copy.first_triangle = first;
        copy.triangle_count = now;
        copy.triangles = &job->triangles[0][0];
        pbr_result result = tell(job);
        if (result == PBR_OK) result = pbr_mesh_copy(job->mesh, &copy);
        for (size_t i = 0; i < now && result == PBR_OK; i++) {
            unsigned char *to = job->rows + i * FACE_BYTES;
            *to++ = 3;
            for (int k = 0; k < 3; k++, to += 4) put_integer(to, job->triangles[i][k], 4);
        }
        if (result == PBR_OK) result = put_bytes(job, job->rows, now * FACE_BYTES);
        if (result != PBR_OK) return result;
        job->done += now;
    }
    return PBR_OK;
}

/* ---- the whole ---- */

static pbr_result make_chunk(struct job *job) {
    job->row_size =
        3 * 8 + (job->has_normals ? 12 : 0) + (job->has_colours ? 4 : 0) + 4 * (job->has_radii + (size_t)job->scalar_count);
    size_t row = job->row_size > FACE_BYTES ? job->row_size : FACE_BYTES;
    job->positions = pbr_allocate(job->instance, CHUNK, sizeof *job->positions);
    job->normals = pbr_allocate(job->instance, CHUNK, sizeof *job->normals);
    job->colours = pbr_allocate(job->instance, CHUNK, sizeof *job->colours);
    job->numbers = pbr_allocate(job->instance, CHUNK, sizeof *job->numbers);
    job->triangles = pbr_allocate(job->instance, CHUNK, sizeof *job->triangles);
    job->rows = pbr_allocate(job->instance, CHUNK, row);
    bool all = job->positions && job->normals && job->colours && job->numbers && job->triangles && job->rows;
    return all ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

static void free_chunk(struct job *job) {
    void *const blocks[] = {job->positions, job->normals, job->colours, job->numbers, job->triangles, job->rows};
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) pbr_free(job->instance, blocks[i]);
}

static pbr_result write_ply(struct job *job, const char *path) {
    pbr_result result = describe(job);
    if (result == PBR_OK) result = make_chunk(job);
    if (result == PBR_OK) result = find_wide(job);
    if (result == PBR_OK) result = output_open(job->instance, path, &job->output);
    if (result != PBR_OK) goto cleanup;
    if (!job->wide) job->row_size -= 3 * 4;
    result = write_header(job);
    if (result == PBR_OK) result = write_vertices(job);
    if (result == PBR_OK) result = write_faces(job);
    if (result == PBR_OK) result = tell(job);
    pbr_result closed = output_close(&job->output, result == PBR_OK);
    if (result == PBR_OK) result = closed;
cleanup:
    free_chunk(job);
    return result;
}

static pbr_result invalid(pbr_instance *instance, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_write_file: %s", what);
}

static bool ends_in_ply(const char *path) {
    static const char ENDING[] = ".ply";
    size_t length = strlen(path);
    if (length < sizeof ENDING - 1) return false;
    for (size_t i = 0; i < sizeof ENDING - 1; i++) {
        char c = path[length - (sizeof ENDING - 1) + i];
        if (c != ENDING[i] && (c < 'A' || c > 'Z' || c + 32 != ENDING[i])) return false;
    }
    return true;
}

pbr_result pbr_write_file(pbr_instance *instance, const char *path, const pbr_points *points, const pbr_mesh *mesh,
                          const pbr_write_desc *desc) {
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    struct job job = {.instance = instance, .points = points, .mesh = mesh, .desc = PBR_WRITE_DESC_INIT};
    if (!path) return invalid(instance, "path is required");
    if ((points != NULL) == (mesh != NULL)) return invalid(instance, "either points or a mesh is required");
    pbr_result result = take_sized(instance, "pbr_write_desc", desc, &job.desc, sizeof job.desc);
    if (result != PBR_OK) return result;
    if (job.desc.flags != 0 || job.desc.reserved != 0) return invalid(instance, "flags and reserved must be 0");
    if (!ends_in_ply(path))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "%s: not a name that ends in .ply: no other format is written", path);
    return write_ply(&job, path);
}
