/* Hierarchies: making, opening, saving, describing. SPDX-License-Identifier: MIT */
#include "lod.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "container.h"
#include "core/points.h"
#include "cut.h"

static pbr_lod *lod_new(pbr_instance *instance, bool own) {
    pbr_lod *lod = pbr_allocate(instance, 1, sizeof *lod);
    if (!lod) return NULL;
    lod->tree.codes = pbr_allocate(instance, 1, sizeof *lod->tree.codes);
    if (!lod->tree.codes) {
        pbr_free(instance, lod);
        return NULL;
    }
    qsplat_codes_make(own, lod->tree.codes);
    lod->instance = instance;
    atomic_init(&lod->references, 1);
    instance_add_child(instance);
    return lod;
}

pbr_result pbr_lod_create(pbr_instance *instance, const pbr_lod_desc *desc, pbr_lod **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!desc || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_create: %s is NULL", desc ? "out" : "desc");
    pbr_lod_desc d;
    pbr_result result = read_desc(instance, "pbr_lod_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (!d.points || d.flags || d.kind > PBR_LOD_QSPLAT)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_desc: %s",
                       !d.points ? "points is NULL"
                       : d.flags ? "flags is not 0"
                                 : "unknown kind");
    const struct progress progress = {d.progress, d.progress_user};
    pbr_lod *lod = lod_new(instance, true);
    if (!lod) return PBR_ERROR_OUT_OF_MEMORY;
    result = qsplat_build(instance, d.points, &progress, &lod->tree, &lod->built);
    if (result == PBR_OK) *out = lod;
    else pbr_lod_release(&lod);
    return result;
}

static const char *build_fault(const pbr_lod_build_desc *d, const char *path) {
    if (!path) return "path is NULL";
    if (d->flags & ~(uint32_t)PBR_LOD_BUILD_COLOURS) return "unknown flags";
    if (d->kind > PBR_LOD_QSPLAT) return "unknown kind";
    if (!d->source) return "source is NULL";
    if (d->point_count == 0 || d->point_count > UINT64_C(1) << 44) return "point_count is 0 or past 2^44";
    for (int k = 0; k < 3; k++)
        if (!(d->minimum[k] <= d->maximum[k]) || !isfinite(d->maximum[k] - d->minimum[k]))
            return "the box is inside out or not finite";
    return NULL;
}

pbr_result pbr_lod_build_file(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path) {
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!desc) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_build_file: desc is NULL");
    pbr_lod_build_desc d;
    pbr_result result = read_desc(instance, "pbr_lod_build_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    const char *fault = build_fault(&d, path);
    if (fault) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_build_file: %s", fault);
    struct qsplat_codes *codes = pbr_allocate(instance, 1, sizeof *codes);
    if (!codes) return PBR_ERROR_OUT_OF_MEMORY;
    qsplat_codes_make(true, codes);
    result = qsplat_stream(instance, &d, path, codes);
    pbr_free(instance, codes);
    return result;
}

static pbr_result parse(pbr_lod *lod, const char *path, bool own) {
    const uint8_t *data = lod->file.data;
    if (!own) return qsplat_file_parse(lod->instance, path, data, lod->file.size, &lod->tree);
    struct container_section section;
    const pbr_result result = container_find(lod->instance, path, data, lod->file.size, QSPLAT_SECTION, &section);
    return result == PBR_OK ? qsplat_section_parse(lod->instance, path, section.data, section.size, &lod->tree) : result;
}

static const uint64_t RESIDENT_DEFAULT = UINT64_C(128) << 20;

pbr_result pbr_lod_open(pbr_instance *instance, const char *path, const pbr_lod_open_desc *desc, pbr_lod **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!path || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_open: %s is NULL", path ? "out" : "path");
    pbr_lod_open_desc d;
    pbr_result result = read_desc(instance, "pbr_lod_open_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    if (d.flags & ~(uint32_t)PBR_LOD_OPEN_READ || d.reserved)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_lod_open_desc: unknown flags, or reserved is not 0");
    struct source file;
    result = source_open(instance, path, (d.flags & PBR_LOD_OPEN_READ) != 0, &file);
    if (result != PBR_OK) return result;
    const bool own = container_recognise(file.data, file.size);
    if (!own && !qsplat_file_recognise(file.data, file.size)) {
        source_close(&file);
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: neither a .pbr file nor one of QSplat", path);
    }
    pbr_lod *lod = lod_new(instance, own);
    if (!lod) {
        source_close(&file);
        return PBR_ERROR_OUT_OF_MEMORY;
    }
    lod->file = file;
    source_read_at_random(&file);
    lod->file_format = own ? PBR_LOD_FILE_PBR : PBR_LOD_FILE_QS;
    result = parse(lod, path, own);
    if (own && result == PBR_OK && !lod->tree.own) qsplat_codes_make(false, lod->tree.codes);
    const uint64_t budget = d.resident_bytes > 0 ? d.resident_bytes : RESIDENT_DEFAULT;
    if (result == PBR_OK && file.mapped && file.size > budget) { /* else all of it may be there */
        lod->tree.residency = residency_create(instance, file.data, file.size, budget);
        if (!lod->tree.residency) result = PBR_ERROR_OUT_OF_MEMORY;
    }
    if (result == PBR_OK) *out = lod;
    else pbr_lod_release(&lod);
    return result;
}

pbr_result pbr_lod_save(const pbr_lod *lod, const char *path, uint32_t file_format, pbr_progress_fn progress, void *progress_user) {
    if (!lod) return PBR_ERROR_INVALID_ARGUMENT;
    const struct progress p = {progress, progress_user};
    if (!path) return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_save: path is NULL");
    if (file_format == PBR_LOD_FILE_QS) return qsplat_file_write(lod->instance, path, &lod->tree, &p);
    if (file_format == PBR_LOD_FILE_PBR) return qsplat_section_write(lod->instance, path, &lod->tree, &p);
    return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_save: unknown file_format %u",
                   (unsigned)file_format);
}

pbr_lod *pbr_lod_retain(pbr_lod *lod) {
    if (lod) atomic_fetch_add(&lod->references, 1);
    return lod;
}

void pbr_lod_release(pbr_lod **lod) {
    if (!lod || !*lod) return;
    pbr_lod *l = *lod;
    *lod = NULL;
    if (atomic_fetch_sub(&l->references, 1) != 1) return;
    pbr_instance *instance = l->instance;
    source_close(&l->file);
    residency_free(instance, l->tree.residency);
    pbr_free(instance, l->built.nodes);
    pbr_free(instance, l->built.links);
    pbr_free(instance, l->tree.codes);
    pbr_free(instance, l);
    instance_drop_child(instance);
}

pbr_result pbr_lod_get_info(const pbr_lod *lod, pbr_lod_info *info) {
    if (!lod || !info) return PBR_ERROR_INVALID_ARGUMENT;
    const struct qsplat *tree = &lod->tree;
    const uint64_t bytes = lod->file.data ? lod->file.size : tree->size + 8 * tree->link_count;
    pbr_lod_info i = {.struct_size = sizeof i,
                      .kind = PBR_LOD_QSPLAT,
                      .file_format = lod->file_format,
                      .point_count = tree->leaves,
                      .radius = lod_radius(lod),
                      .bounding_radius = (double)tree->span,
                      .has_colours = tree->has_colours,
                      .is_mapped = lod->file.mapped,
                      .data_bytes = bytes,
                      .memory_bytes = sizeof *lod + sizeof *tree->codes + (lod->file.mapped ? 0 : bytes)};
    if (tree->residency) {
        i.resident_bytes = residency_bytes(tree->residency);
        i.memory_bytes += sizeof *tree->residency + tree->residency->chunk_count;
    }
    memcpy(i.centre, tree->centre, sizeof i.centre);
    return write_info(lod->instance, "pbr_lod_info", &i, sizeof i, info, sizeof i);
}

pbr_result pbr_lod_measure(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user, pbr_lod_statistics *statistics) {
    if (!lod || !statistics) return PBR_ERROR_INVALID_ARGUMENT;
    const struct progress p = {progress, progress_user};
    pbr_lod_statistics s = {.struct_size = sizeof s};
    const pbr_result result = qsplat_measure(lod->instance, &lod->tree, &p, &s);
    return result == PBR_OK ? write_info(lod->instance, "pbr_lod_statistics", &s, sizeof s, statistics, sizeof s) : result;
}

pbr_result pbr_lod_to_points(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user, pbr_points **out) {
    if (out) *out = NULL;
    if (!lod) return PBR_ERROR_INVALID_ARGUMENT;
    if (!out) return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_to_points: out is NULL");
    const struct progress p = {progress, progress_user};
    return qsplat_to_points(lod->instance, &lod->tree, &p, out);
}

pbr_result lod_choose_centre(pbr_instance *instance, const double minimum[3], const double maximum[3], double centre[3],
                             double *extent) {
    *extent = 0;
    for (int k = 0; k < 3; k++) {
        const double side = maximum[k] - minimum[k], middle = minimum[k] + side / 2;
        if (!(side <= LOD_EXTENT_MOST))
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "the points extend over %g, the limit of a hierarchy is %g",
                           side, LOD_EXTENT_MOST);
        /* A float if that is near enough: then files of QSplat, which have only those, keep it. */
        const double rounded = fabs(middle) <= FLT_MAX ? (double)(float)middle : middle;
        centre[k] = fabs(rounded - middle) <= side ? rounded : middle;
        *extent = fmax(*extent, side);
    }
    return PBR_OK;
}

/* ---- For the GL side ---- */

const double *lod_origin(const pbr_lod *lod) {
    return lod->tree.centre;
}

uint64_t lod_point_count(const pbr_lod *lod) {
    return lod->tree.leaves;
}

double lod_radius(const pbr_lod *lod) {
    return (double)lod->tree.radius;
}

bool lod_has_colours(const pbr_lod *lod) {
    return lod->tree.has_colours;
}

pbr_result lod_cut(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                   struct cut *cut) {
    return qsplat_cut(lod->instance, &lod->tree, view, occlusion, cancel, cut);
}
