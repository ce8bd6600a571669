/* Hierarchies: making, opening, saving, describing. SPDX-License-Identifier: MIT */
#include "lod.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "container.h"
#include "core/points.h"
#include "cut.h"

static const struct lod_kind *const kinds[] = {&lod_kind_qsplat, &lod_kind_spt, &lod_kind_pop};
enum { KINDS = sizeof kinds / sizeof *kinds };

/* 0: the default. NULL: unknown. */
static const struct lod_kind *find_kind(uint32_t kind) {
    for (size_t i = 0; i < KINDS; i++)
        if (kinds[i]->kind == (kind ? kind : PBR_LOD_QSPLAT)) return kinds[i];
    return NULL;
}

static pbr_lod *lod_new(pbr_instance *instance, const struct lod_kind *kind) {
    pbr_lod *lod = pbr_allocate(instance, 1, sizeof *lod);
    if (!lod) return NULL;
    lod->instance = instance;
    lod->kind = kind;
    atomic_init(&lod->references, 1);
    instance_add_child(instance);
    return lod;
}

/* The last step of making one: it goes to `out` if all went well. */
static pbr_result finish(pbr_lod *lod, pbr_result result, pbr_lod **out) {
    if (result == PBR_OK) {
        lod->kind->outline(lod, &lod->outline);
        *out = lod;
    } else {
        pbr_lod_release(&lod);
    }
    return result;
}

static const char *create_fault(const pbr_lod_desc *d, const struct lod_kind *kind) {
    if (d->flags & ~(uint32_t)PBR_LOD_NORMAL_FIELDS || d->reserved) return "unknown flags, or reserved is not 0";
    if (!kind) return "unknown kind";
    if (kind->of_mesh && !d->mesh) return "mesh is NULL";
    if (kind->of_mesh && d->points) return "points is given, but the kind is made of a mesh";
    if (!kind->of_mesh && !d->points) return "points is NULL";
    if (!kind->of_mesh && d->mesh) return "mesh is given, but the kind is made of points";
    return NULL;
}

pbr_result pbr_lod_create(pbr_instance *instance, const pbr_lod_desc *desc, pbr_lod **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!desc || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_create: %s is NULL", desc ? "out" : "desc");
    pbr_lod_desc d;
    pbr_result result = read_desc(instance, "pbr_lod_desc", desc, offsetof(pbr_lod_desc, leaf_points), &d, sizeof d);
    if (result != PBR_OK) return result;
    const struct lod_kind *kind = find_kind(d.kind);
    const char *fault = create_fault(&d, kind);
    if (fault) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_desc: %s", fault);
    if (d.flags & ~kind->flags)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "pbr_lod_desc: %s has no normal fields", kind->name);
    const struct progress progress = {d.progress, d.progress_user};
    pbr_lod *lod = lod_new(instance, kind);
    if (!lod) return PBR_ERROR_OUT_OF_MEMORY;
    return finish(lod, kind->build(lod, &d, &progress), out);
}

static const char *build_fault(const pbr_lod_build_desc *d, const char *path) {
    if (!path) return "path is NULL";
    if (d->flags & ~(uint32_t)PBR_LOD_BUILD_COLOURS) return "unknown flags";
    if (!find_kind(d->kind)) return "unknown kind";
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
    const struct lod_kind *kind = find_kind(d.kind);
    if (!kind->build_file)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "pbr_lod_build_file: %s is made in memory only (pbr_lod_create)", kind->name);
    return kind->build_file(instance, &d, path);
}

/* What a file holds: its kind of hierarchy, and in our container its section. */
static pbr_result recognise(pbr_instance *instance, const char *path, const struct source *file, const struct lod_kind **kind,
                            struct container_section *section) {
    const char *types[KINDS];
    size_t found = 0;
    for (size_t i = 0; i < KINDS; i++) types[i] = kinds[i]->section;
    *kind = &lod_kind_qsplat;
    *section = (struct container_section){.data = NULL};
    if (container_recognise(file->data, file->size)) {
        const pbr_result result = container_find(instance, path, file->data, file->size, types, KINDS, section, &found);
        *kind = kinds[found];
        return result;
    }
    if (qsplat_file_recognise(file->data, file->size)) return PBR_OK;
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: neither a .pbr file nor one of QSplat", path);
}

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
    const struct lod_kind *kind;
    struct container_section section;
    result = recognise(instance, path, &file, &kind, &section);
    pbr_lod *lod = result == PBR_OK ? lod_new(instance, kind) : NULL;
    if (!lod) {
        source_close(&file);
        return result == PBR_OK ? PBR_ERROR_OUT_OF_MEMORY : result;
    }
    lod->file = file;
    lod->file_format = section.data ? PBR_LOD_FILE_PBR : PBR_LOD_FILE_QS;
    return finish(lod, kind->parse(lod, path, section.data ? &section : NULL, &d), out);
}

pbr_result pbr_lod_save(const pbr_lod *lod, const char *path, uint32_t file_format, pbr_progress_fn progress, void *progress_user) {
    if (!lod) return PBR_ERROR_INVALID_ARGUMENT;
    const struct progress p = {progress, progress_user};
    if (!path) return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_save: path is NULL");
    if (file_format == PBR_LOD_FILE_PBR) return lod->kind->save_pbr(lod, path, &p);
    if (file_format == PBR_LOD_FILE_QS && lod->kind->save_qs) return lod->kind->save_qs(lod, path, &p);
    if (file_format == PBR_LOD_FILE_QS)
        return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: a .qs file cannot hold %s", path,
                       lod->kind->name);
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
    l->kind->release(l);
    source_close(&l->file);
    pbr_free(instance, l);
    instance_drop_child(instance);
}

pbr_result pbr_lod_get_info(const pbr_lod *lod, pbr_lod_info *info) {
    if (!lod || !info) return PBR_ERROR_INVALID_ARGUMENT;
    const struct lod_outline *outline = &lod->outline;
    pbr_lod_info i = {.struct_size = sizeof i,
                      .kind = lod->kind->kind,
                      .file_format = lod->file_format,
                      .point_count = outline->leaves,
                      .radius = outline->radius,
                      .bounding_radius = outline->bounding_radius,
                      .has_colours = outline->has_colours,
                      .is_mapped = lod->file.mapped,
                      .has_normal_fields = outline->has_fields};
    memcpy(i.centre, outline->centre, sizeof i.centre);
    lod->kind->info(lod, &i);
    return write_info(lod->instance, "pbr_lod_info", &i, sizeof i, info, offsetof(pbr_lod_info, triangle_count));
}

pbr_result pbr_lod_measure(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user, pbr_lod_statistics *statistics) {
    if (!lod || !statistics) return PBR_ERROR_INVALID_ARGUMENT;
    const struct progress p = {progress, progress_user};
    pbr_lod_statistics s = {.struct_size = sizeof s};
    const pbr_result result = lod->kind->measure(lod, &p, &s);
    return result == PBR_OK ? write_info(lod->instance, "pbr_lod_statistics", &s, sizeof s, statistics, sizeof s) : result;
}

pbr_result pbr_lod_to_points(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user, pbr_points **out) {
    if (out) *out = NULL;
    if (!lod) return PBR_ERROR_INVALID_ARGUMENT;
    if (!out) return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_lod_to_points: out is NULL");
    const struct progress p = {progress, progress_user};
    return lod->kind->to_points(lod, &p, out);
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
    return lod->outline.centre;
}

uint64_t lod_point_count(const pbr_lod *lod) {
    return lod->outline.leaves;
}

double lod_radius(const pbr_lod *lod) {
    return lod->outline.radius;
}

bool lod_has_colours(const pbr_lod *lod) {
    return lod->outline.has_colours;
}

bool lod_has_fields(const pbr_lod *lod) {
    return lod->outline.has_fields;
}

uint64_t lod_triangle_count(const pbr_lod *lod) {
    return lod->outline.triangles;
}

void lod_gather(const pbr_lod *lod, const struct cut *cut, struct splat *records, uint32_t (*triangles)[3]) {
    lod->kind->gather(lod, cut, records, triangles);
}

bool lod_can_be_cut(const pbr_lod *lod) {
    return lod->kind->cut != NULL;
}

pbr_result lod_cut(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                   struct cut *cut) {
    if (lod->kind->cut) return lod->kind->cut(lod, view, occlusion, cancel, cut);
    return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s has no cuts", lod->kind->name);
}
