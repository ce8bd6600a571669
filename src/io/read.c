/* Reading files by content. SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/io.h>
#include <string.h>

#include "core/file.h"
#include "formats.h"
#include "sized.h"

static pbr_result invalid(pbr_instance *instance, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s", what);
}

static pbr_result take_desc(pbr_instance *instance, const pbr_read_desc *in, pbr_read_desc *out) {
    *out = (pbr_read_desc)PBR_READ_DESC_INIT;
    pbr_result result = take_sized(instance, "pbr_read_desc", in, out, sizeof *out);
    if (result != PBR_OK) return result;
    if (out->flags & ~(uint32_t)(PBR_READ_STREAM | PBR_READ_KEEP_RADII)) return invalid(instance, "pbr_read_desc: unknown flags");
    if (out->reserved != 0) return invalid(instance, "pbr_read_desc: reserved must be 0");
    if (!(out->radius_scale >= 0 && isfinite(out->radius_scale)))
        return invalid(instance, "pbr_read_desc: radius_scale must be finite and not negative");
    if (out->radius_neighbours > 32) return invalid(instance, "pbr_read_desc: radius_neighbours is at most 32");
    return PBR_OK;
}

/* In the order in which they are asked: text without any mark of its own comes last. */
static const struct {
    bool (*recognise)(const struct reader *reader);
    pbr_result (*read)(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);
} FORMATS[] = {{ply_recognise, ply_read},
               {las_recognise, las_read},
               {off_recognise, off_read},
               {foreign_recognise, foreign_read},
               {obj_recognise, obj_read},
               {tri_recognise, tri_read},
               {points_text_recognise, points_text_read}};

static pbr_result read_content(pbr_instance *instance, const char *name, const char *path, const void *data, size_t size,
                               const pbr_read_desc *desc, pbr_file_content *content) {
    struct reader reader = {.instance = instance,
                            .name = name,
                            .path = path,
                            .data = data,
                            .size = size,
                            .line_end = '\n',
                            .progress = desc->progress,
                            .progress_user = desc->progress_user};
    size_t i = 0, count = sizeof FORMATS / sizeof *FORMATS;
    while (i < count && !FORMATS[i].recognise(&reader)) i++;
    if (i == count) return reader_error_byte(&reader, PBR_ERROR_UNSUPPORTED, 0, "not a format that libpbr reads");
    pbr_result result = FORMATS[i].read(&reader, desc, content);
    content->warning_count = reader.warnings > UINT32_MAX ? UINT32_MAX : (uint32_t)reader.warnings;
    return result;
}

static pbr_result read_path(pbr_instance *instance, const char *path, const pbr_read_desc *desc, pbr_file_content *content) {
    struct source source;
    pbr_result result = source_open(instance, path, desc->flags & PBR_READ_STREAM, &source);
    if (result == PBR_OK) result = read_content(instance, path, path, source.data, source.size, desc, content);
    source_close(&source);
    return result;
}

/* A caller's content structure: of this version's size or longer. */
static pbr_result check_content(pbr_instance *instance, pbr_file_content *content) {
    if (content->struct_size < sizeof *content || content->struct_size > 65536)
        return invalid(instance, "pbr_file_content: wrong struct_size");
    memset((char *)content + sizeof content->struct_size, 0, content->struct_size - sizeof content->struct_size);
    return PBR_OK;
}

pbr_result pbr_read_file(pbr_instance *instance, const char *path, const pbr_read_desc *desc, pbr_file_content *content) {
    pbr_read_desc given;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!path || !content) return invalid(instance, "pbr_read_file: path and content are required");
    pbr_result result = check_content(instance, content);
    if (result == PBR_OK) result = take_desc(instance, desc, &given);
    return result == PBR_OK ? read_path(instance, path, &given, content) : result;
}

pbr_result pbr_read_memory(pbr_instance *instance, const char *name, const void *data, size_t size, const pbr_read_desc *desc,
                           pbr_file_content *content) {
    pbr_read_desc given;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!content || (!data && size > 0)) return invalid(instance, "pbr_read_memory: data and content are required");
    pbr_result result = check_content(instance, content);
    if (result == PBR_OK) result = take_desc(instance, desc, &given);
    return result == PBR_OK ? read_content(instance, name ? name : "memory", NULL, data, size, &given, content) : result;
}

pbr_result pbr_read_points(pbr_instance *instance, const char *path, const pbr_read_desc *desc, pbr_points **out) {
    pbr_read_desc given;
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!path || !out) return invalid(instance, "pbr_read_points: path and out are required");
    pbr_result result = take_desc(instance, desc, &given);
    if (result == PBR_OK) result = read_path(instance, path, &given, &content);
    if (result == PBR_OK && content.mesh) {
        pbr_mesh_to_points_desc convert = PBR_MESH_TO_POINTS_DESC_INIT;
        convert.radius_scale = given.radius_scale;
        convert.progress = given.progress;
        convert.progress_user = given.progress_user;
        result = pbr_mesh_to_points(content.mesh, &convert, out);
        pbr_mesh_release(&content.mesh);
    } else if (result == PBR_OK) {
        *out = content.points;
    }
    return result;
}
