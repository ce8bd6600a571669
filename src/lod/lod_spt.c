/* Sequential point trees as a kind of hierarchy. SPDX-License-Identifier: MIT */
#include <string.h>

#include "container.h"
#include "lod.h"

static pbr_result build(pbr_lod *lod, const pbr_lod_desc *desc, const struct progress *progress) {
    const uint32_t leaf_points = desc->leaf_points ? desc->leaf_points : 1;
    if (leaf_points > SPT_LEAF_POINTS_MOST)
        return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_lod_desc: leaf_points is %u, the limit is %d",
                       (unsigned)leaf_points, SPT_LEAF_POINTS_MOST);
    return spt_build(lod->instance, desc->points, leaf_points, (desc->flags & PBR_LOD_NORMAL_FIELDS) != 0, progress, &lod->spt);
}

static pbr_result parse(pbr_lod *lod, const char *path, const struct container_section *section, const pbr_lod_open_desc *desc) {
    (void)desc; /* all of it goes to the GPU: nothing to keep resident */
    return spt_section_parse(lod->instance, path, section->data, section->size, &lod->spt);
}

static pbr_result save_pbr(const pbr_lod *lod, const char *path, const struct progress *progress) {
    return spt_section_write(lod->instance, path, &lod->spt, progress);
}

static void release(pbr_lod *lod) {
    spt_free(lod->instance, &lod->spt);
}

static void outline(const pbr_lod *lod, struct lod_outline *out) {
    const struct spt *spt = &lod->spt;
    *out = (struct lod_outline){.radius = spt->radius,
                                .bounding_radius = spt->span,
                                .leaves = spt->leaves,
                                .has_colours = spt->has_colours,
                                .has_fields = spt->fields != NULL};
    memcpy(out->centre, spt->centre, sizeof out->centre);
}

static void info(const pbr_lod *lod, pbr_lod_info *i) {
    const struct spt *spt = &lod->spt;
    uint64_t steps = 0;
    for (uint32_t c = 0; c < spt->chunk_count; c++) steps += spt_step_count(&spt->chunks[c]);
    const size_t fields = spt->fields ? sizeof *spt->fields : 0;
    const uint64_t chunks = spt->chunk_count * (uint64_t)(sizeof *spt->chunks + sizeof *spt->entries + sizeof *spt->steps + fields);
    const uint64_t entry_bytes = sizeof(struct spt_entry) + (spt->fields ? sizeof(struct normal_field) : 0);
    const uint64_t bytes = spt->count * entry_bytes + steps * sizeof(struct spt_step);
    i->data_bytes = lod->file.data ? lod->file.size : bytes;
    i->memory_bytes = sizeof *lod + chunks + (lod->file.mapped ? 0 : i->data_bytes);
}

static pbr_result measure(const pbr_lod *lod, const struct progress *progress, pbr_lod_statistics *statistics) {
    return spt_measure(&lod->spt, progress, statistics);
}

static pbr_result to_points(const pbr_lod *lod, const struct progress *progress, pbr_points **out) {
    return spt_to_points(lod->instance, &lod->spt, progress, out);
}

const struct lod_kind lod_kind_spt = {.kind = PBR_LOD_SPT,
                                      .name = "a sequential point tree",
                                      .section = SPT_SECTION,
                                      .flags = PBR_LOD_NORMAL_FIELDS,
                                      .build = build,
                                      .parse = parse,
                                      .save_pbr = save_pbr,
                                      .release = release,
                                      .outline = outline,
                                      .info = info,
                                      .measure = measure,
                                      .to_points = to_points};
