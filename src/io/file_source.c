/* Files of points that are read where they lie. SPDX-License-Identifier: MIT */
#include <pbr/io.h>
#include <string.h>

#include "core/file.h"
#include "formats.h"
#include "sized.h"

struct pbr_file_source {
    pbr_instance *instance;
    struct source file;
    struct records records;
    pbr_file_source_info info;
};

static pbr_result find_points(struct reader *reader, uint32_t *format, struct records *records) {
    const bool is_ply = ply_recognise(reader);
    *format = is_ply ? PBR_FILE_PLY : PBR_FILE_LAS;
    if (is_ply) return ply_records(reader, records);
    if (las_recognise(reader)) return las_records(reader, records);
    return pbr_log(reader->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                   "%s: cannot be read in pieces: only LAS and binary PLY can", reader->name);
}

static void describe(pbr_file_source *source, uint32_t format, uint64_t warnings) {
    const struct records *records = &source->records;
    source->info = (pbr_file_source_info){.struct_size = sizeof source->info,
                                          .format = format,
                                          .warning_count = warnings > UINT32_MAX ? UINT32_MAX : (uint32_t)warnings,
                                          .point_count = records->count,
                                          .face_count = records->face_count,
                                          .has_normals = records->normal[0].type != PLY_NONE,
                                          .has_colours = records->colour[0].type != PLY_NONE,
                                          .has_radii = records->radius.type != PLY_NONE};
    memcpy(source->info.encoding, records->encoding, sizeof source->info.encoding);
}

pbr_result pbr_file_source_open(pbr_instance *instance, const char *path, pbr_progress_fn progress, void *progress_user,
                                pbr_file_source **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!path || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_file_source_open: %s is NULL",
                       path ? "out" : "path");
    pbr_file_source *source = pbr_allocate(instance, 1, sizeof *source);
    if (!source) return PBR_ERROR_OUT_OF_MEMORY;
    source->instance = instance;
    uint32_t format = PBR_FILE_UNKNOWN;
    pbr_result result = source_open(instance, path, false, &source->file);
    struct reader reader = {.instance = instance,
                            .file = &source->file,
                            .name = path,
                            .data = (const char *)source->file.data,
                            .size = source->file.size,
                            .line_end = '\n',
                            .progress = progress,
                            .progress_user = progress_user};
    if (result == PBR_OK) result = find_points(&reader, &format, &source->records);
    describe(source, format, reader.warnings);
    if (result == PBR_OK) *out = source;
    else pbr_file_source_close(&source);
    return result;
}

pbr_result pbr_file_source_get_info(const pbr_file_source *source, pbr_file_source_info *info) {
    if (!source || !info) return PBR_ERROR_INVALID_ARGUMENT;
    return give_sized(source->instance, "pbr_file_source_info", &source->info, sizeof source->info, info);
}

pbr_result pbr_file_source_read(void *source, uint64_t first, uint64_t count, const pbr_lod_batch *batch) {
    const pbr_file_source *s = source;
    if (!s) return PBR_ERROR_INVALID_ARGUMENT;
    const struct records *records = &s->records;
    if (!batch || batch->struct_size < sizeof *batch || !batch->positions)
        return pbr_log(s->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_file_source_read: there is no batch");
    if (first > records->count || count > records->count - first)
        return pbr_log(s->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_file_source_read: past the last point");
    if (count == 0) return PBR_OK;
    records_decode(records, first, count, batch->positions, batch->normals, batch->colours, batch->radii);
    const size_t begin = (size_t)(records->data - (const char *)s->file.data) + (size_t)first * records->size;
    source_done_with(&s->file, begin, (size_t)count * records->size);
    return PBR_OK;
}

void pbr_file_source_close(pbr_file_source **source) {
    if (!source || !*source) return;
    source_close(&(*source)->file);
    pbr_free((*source)->instance, *source);
    *source = NULL;
}
