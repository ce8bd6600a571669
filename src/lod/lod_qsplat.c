/* QSplat trees as a kind of hierarchy. SPDX-License-Identifier: MIT */
#include <string.h>

#include "container.h"
#include "cut.h"
#include "lod.h"

static pbr_result make_codes(pbr_lod *lod, bool own) {
    lod->tree.codes = pbr_allocate(lod->instance, 1, sizeof *lod->tree.codes);
    if (!lod->tree.codes) return PBR_ERROR_OUT_OF_MEMORY;
    qsplat_codes_make(own, lod->tree.codes);
    return PBR_OK;
}

static pbr_result build(pbr_lod *lod, const pbr_lod_desc *desc, const struct progress *progress) {
    const pbr_result result = make_codes(lod, true);
    return result == PBR_OK ? qsplat_build(lod->instance, desc->points, progress, &lod->tree, &lod->built) : result;
}

static pbr_result build_file(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path) {
    struct qsplat_codes *codes = pbr_allocate(instance, 1, sizeof *codes);
    if (!codes) return PBR_ERROR_OUT_OF_MEMORY;
    qsplat_codes_make(true, codes);
    const pbr_result result = qsplat_stream(instance, desc, path, codes);
    pbr_free(instance, codes);
    return result;
}

static const uint64_t RESIDENT_DEFAULT = UINT64_C(128) << 20;

static pbr_result parse(pbr_lod *lod, const char *path, const struct container_section *section, const pbr_lod_open_desc *desc) {
    const struct source *file = &lod->file;
    pbr_result result = section ? qsplat_section_parse(lod->instance, path, section->data, section->size, &lod->tree)
                                : qsplat_file_parse(lod->instance, path, file->data, file->size, &lod->tree);
    if (result == PBR_OK) result = make_codes(lod, lod->tree.own);
    if (result != PBR_OK) return result;
    source_read_at_random(file);
    const uint64_t budget = desc->resident_bytes > 0 ? desc->resident_bytes : RESIDENT_DEFAULT;
    if (!file->mapped || file->size <= budget) return PBR_OK; /* all of it may be there */
    lod->tree.residency = residency_create(lod->instance, file->data, file->size, budget);
    return lod->tree.residency ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

static pbr_result save_pbr(const pbr_lod *lod, const char *path, const struct progress *progress) {
    return qsplat_section_write(lod->instance, path, &lod->tree, progress);
}

static pbr_result save_qs(const pbr_lod *lod, const char *path, const struct progress *progress) {
    return qsplat_file_write(lod->instance, path, &lod->tree, progress);
}

static void release(pbr_lod *lod) {
    residency_free(lod->instance, lod->tree.residency);
    pbr_free(lod->instance, lod->built.nodes);
    pbr_free(lod->instance, lod->built.links);
    pbr_free(lod->instance, lod->tree.codes);
}

static void outline(const pbr_lod *lod, struct lod_outline *out) {
    const struct qsplat *tree = &lod->tree;
    *out = (struct lod_outline){.radius = (double)tree->radius,
                                .bounding_radius = (double)tree->span,
                                .leaves = tree->leaves,
                                .has_colours = tree->has_colours};
    memcpy(out->centre, tree->centre, sizeof out->centre);
}

static void info(const pbr_lod *lod, pbr_lod_info *i) {
    const struct qsplat *tree = &lod->tree;
    i->data_bytes = lod->file.data ? lod->file.size : tree->size + 8 * tree->link_count;
    i->memory_bytes = sizeof *lod + sizeof *tree->codes + (lod->file.mapped ? 0 : i->data_bytes);
    if (!tree->residency) return;
    i->resident_bytes = residency_bytes(tree->residency);
    i->memory_bytes += sizeof *tree->residency + tree->residency->chunk_count;
}

static pbr_result measure(const pbr_lod *lod, const struct progress *progress, pbr_lod_statistics *statistics) {
    return qsplat_measure(lod->instance, &lod->tree, progress, statistics);
}

static pbr_result to_points(const pbr_lod *lod, const struct progress *progress, pbr_points **out) {
    return qsplat_to_points(lod->instance, &lod->tree, progress, out);
}

static pbr_result cut(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                      struct cut *out) {
    return qsplat_cut(lod->instance, &lod->tree, view, occlusion, cancel, out);
}

static void gather(const pbr_lod *lod, const struct cut *cut, struct splat *records, uint32_t (*triangles)[3]) {
    (void)triangles; /* it has none */
    cut_gather(lod->instance, cut, records);
}

const struct lod_kind lod_kind_qsplat = {.kind = PBR_LOD_QSPLAT,
                                         .name = "a QSplat hierarchy",
                                         .section = QSPLAT_SECTION,
                                         .build = build,
                                         .build_file = build_file,
                                         .parse = parse,
                                         .save_pbr = save_pbr,
                                         .save_qs = save_qs,
                                         .release = release,
                                         .outline = outline,
                                         .info = info,
                                         .measure = measure,
                                         .to_points = to_points,
                                         .cut = cut,
                                         .gather = gather};
