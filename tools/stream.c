/* Hierarchies of files that are larger than memory. SPDX-License-Identifier: MIT */
#include "stream.h"

#include <float.h>
#include <math.h>
#include <pbr/io.h>
#include <pbr/lod.h>
#include <pbr/support.h>
#include <string.h>

#include "input.h"

enum { BATCH = 1 << 16, GRID_MOST = 128 };

/* A stream at work. */
struct work {
    struct stream *stream;
    pbr_file_source *source;
    pbr_file_source_info info;
    double minimum[3], maximum[3]; /* once measured; both 0 before */
    double (*boxes)[2][3];         /* of each batch */
    double edge;                   /* of a cell */
    uint64_t grid;                 /* cells along a side */
    atomic_uchar *occupied;        /* cells */
    uint64_t first_batch;          /* of the piece that is read */
};

static pbr_result deliver(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    const struct work *work = user;
    const pbr_result result = pbr_file_source_read(work->source, first, count, batch);
    for (uint64_t i = 0; i < count && work->stream->radius > 0; i++) batch->radii[i] = (float)work->stream->radius;
    return result;
}

/* ---- One radius for all points, from how many there are on how large a surface ---- */

static uint64_t batch_count(const struct work *work) {
    return (work->info.point_count + BATCH - 1) / BATCH;
}

static bool is_usable(const double p[3]) {
    return fabs(p[0]) <= FLT_MAX && fabs(p[1]) <= FLT_MAX && fabs(p[2]) <= FLT_MAX;
}

static void measure_batch(struct work *work, uint64_t batch, double (*positions)[3], uint64_t count) {
    double(*box)[3] = work->boxes[batch];
    for (int k = 0; k < 3; k++) box[0][k] = INFINITY, box[1][k] = -INFINITY;
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 3 && is_usable(positions[i]); k++) {
            box[0][k] = fmin(box[0][k], positions[i][k]);
            box[1][k] = fmax(box[1][k], positions[i][k]);
        }
}

static void occupy_batch(struct work *work, double (*positions)[3], uint64_t count) {
    for (uint64_t i = 0; i < count; i++) {
        uint64_t cell = 0;
        if (!is_usable(positions[i])) continue;
        for (int k = 0; k < 3; k++) {
            const double at = fmin(floor((positions[i][k] - work->minimum[k]) / work->edge), (double)(work->grid - 1));
            cell = cell * work->grid + (uint64_t)fmax(at, 0);
        }
        atomic_store_explicit(&work->occupied[cell], 1, memory_order_relaxed);
    }
}

static pbr_result read_batches(void *user, size_t begin, size_t end) {
    struct work *work = user;
    double(*positions)[3] = pbr_allocate(work->stream->session->instance, BATCH, sizeof *positions);
    pbr_result result = positions ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = work->first_batch + begin; i < work->first_batch + end && result == PBR_OK; i++) {
        const uint64_t left = work->info.point_count - i * BATCH, count = left < BATCH ? left : BATCH;
        const pbr_lod_batch batch = {.struct_size = sizeof batch, .positions = positions[0]};
        result = pbr_file_source_read(work->source, i * BATCH, count, &batch);
        if (work->occupied) occupy_batch(work, positions, count);
        else measure_batch(work, i, positions, count);
    }
    pbr_free(work->stream->session->instance, positions);
    return result;
}

static pbr_result read_all(struct work *work, const char *stage) {
    enum { PIECE = 64 };
    struct session *session = work->stream->session;
    const uint64_t count = batch_count(work);
    pbr_result result = PBR_OK;
    for (work->first_batch = 0; work->first_batch < count && result == PBR_OK; work->first_batch += PIECE) {
        const uint64_t left = count - work->first_batch;
        session_progress(session, stage, (double)work->first_batch / (double)count);
        result = pbr_parallel(session->instance, left < PIECE ? left : PIECE, 1, read_batches, work);
    }
    return result;
}

static pbr_result measure(struct work *work) {
    pbr_instance *instance = work->stream->session->instance;
    work->boxes = pbr_allocate(instance, batch_count(work), sizeof *work->boxes);
    const pbr_result result = work->boxes ? read_all(work, "measuring") : PBR_ERROR_OUT_OF_MEMORY;
    for (int k = 0; k < 3; k++) work->minimum[k] = INFINITY, work->maximum[k] = -INFINITY;
    for (uint64_t i = 0; i < batch_count(work) && result == PBR_OK; i++)
        for (int k = 0; k < 3; k++) {
            work->minimum[k] = fmin(work->minimum[k], work->boxes[i][0][k]);
            work->maximum[k] = fmax(work->maximum[k], work->boxes[i][1][k]);
        }
    if (!(work->minimum[0] <= work->maximum[0])) memset(work->minimum, 0, sizeof work->minimum);
    if (!(work->minimum[0] <= work->maximum[0])) memset(work->maximum, 0, sizeof work->maximum);
    pbr_free(instance, work->boxes);
    work->boxes = NULL;
    return result;
}

/* The cells of a grid that hold points are about as many as the surface has squares of their side, or 1.5 times as many where it
 * lies askew. A point's share of that is the square of the spacing, and the spacing the radius, as where radii are estimated from
 * neighbours. Cells have 64 points in the mean, or more, if points lie as on a plane, so that few are missed. */
static pbr_result estimate_radius(struct work *work) {
    pbr_instance *instance = work->stream->session->instance;
    const double points = (double)work->info.point_count;
    double side = 0;
    uint64_t occupied = 0;
    pbr_result result = measure(work);
    for (int k = 0; k < 3; k++) side = fmax(side, work->maximum[k] - work->minimum[k]);
    if (result != PBR_OK || !(side > 0)) return result;
    work->grid = (uint64_t)fmin(fmax(sqrt(points / 64), 1), GRID_MOST);
    work->edge = side / (double)work->grid;
    const uint64_t cells = work->grid * work->grid * work->grid;
    work->occupied = pbr_allocate(instance, cells, sizeof *work->occupied);
    result = work->occupied ? read_all(work, "estimating radii") : PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < cells && result == PBR_OK; i++) occupied += atomic_load(&work->occupied[i]);
    pbr_free(instance, work->occupied);
    work->occupied = NULL;
    work->stream->radius = work->edge * sqrt((double)occupied / points);
    return result;
}

/* ---- Building ---- */

static pbr_result build(struct work *work) {
    const struct stream *stream = work->stream;
    pbr_lod_build_desc desc = PBR_LOD_BUILD_DESC_INIT;
    desc.flags = work->info.has_colours ? PBR_LOD_BUILD_COLOURS : 0;
    desc.point_count = work->info.point_count;
    desc.source = deliver;
    desc.source_user = work;
    memcpy(desc.minimum, work->minimum, sizeof desc.minimum);
    memcpy(desc.maximum, work->maximum, sizeof desc.maximum);
    desc.memory_bytes = (uint64_t)stream->memory << 20;
    desc.progress = session_progress;
    desc.progress_user = stream->session;
    return pbr_lod_build_file(stream->session->instance, &desc, stream->output);
}

/* Points that are not finite were left out. */
static pbr_result count_points(struct stream *stream) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod *lod = NULL;
    pbr_result result = pbr_lod_open(stream->session->instance, stream->output, NULL, &lod);
    if (result == PBR_OK) result = pbr_lod_get_info(lod, &info);
    pbr_lod_release(&lod);
    stream->points = info.point_count;
    return result;
}

static pbr_result open_source(struct work *work) {
    const struct stream *stream = work->stream;
    work->info = (pbr_file_source_info)PBR_FILE_SOURCE_INFO_INIT;
    pbr_result result =
        pbr_file_source_open(stream->session->instance, stream->input, session_progress, stream->session, &work->source);
    if (result == PBR_OK) result = pbr_file_source_get_info(work->source, &work->info);
    if (result != PBR_OK) return result;
    if (work->info.point_count == 0) {
        session_fail(stream->session, "%s: there are no points to build a hierarchy of", stream->input);
        return PBR_ERROR_UNSUPPORTED;
    }
    if (work->info.face_count > 0)
        session_warn(stream->session, "%s: faces are left out; without --memory they give normals and radii", stream->input);
    return PBR_OK;
}

bool stream_build(struct stream *stream) {
    struct session *session = stream->session;
    struct work work = {.stream = stream};
    const unsigned errors = atomic_load(&session->errors);
    const double start = session_seconds();
    const char *name = stream->input;
    if (input_is_hierarchy(stream->input)) {
        session_fail(session, "%s: is a hierarchy already; --memory is for building one", stream->input);
        return false;
    }
    pbr_result result = open_source(&work);
    if (result == PBR_OK && !work.info.has_radii && !(stream->radius > 0)) result = estimate_radius(&work);
    const double opened = session_seconds();
    if (result == PBR_OK) {
        name = stream->output;
        result = build(&work);
    }
    if (result == PBR_OK) result = count_points(stream);
    stream->load_ms = 1e3 * (opened - start);
    stream->build_ms = 1e3 * (session_seconds() - opened);
    pbr_file_source_close(&work.source);
    session_progress_end(session);
    return session_check(session, result, errors, name);
}
