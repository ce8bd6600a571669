/* POP as a kind of hierarchy. SPDX-License-Identifier: MIT */
#include <string.h>

#include "container.h"
#include "core/mesh.h"
#include "cut.h"
#include "lod.h"
#include "pop_cut.h"

static pbr_result build(pbr_lod *lod, const pbr_lod_desc *desc, const struct progress *progress) {
    if (desc->mesh->instance != lod->instance)
        return pbr_log(lod->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_lod_desc: mesh was made from another instance");
    return pop_build(desc->mesh, progress, &lod->pop);
}

static pbr_result parse(pbr_lod *lod, const char *path, const struct container_section *section, const pbr_lod_open_desc *desc) {
    (void)desc; /* nothing is given back: vertices and triangles were read, nodes are where the view needs them */
    return pop_section_parse(lod->instance, path, section->data, section->size, &lod->pop);
}

static pbr_result save_pbr(const pbr_lod *lod, const char *path, const struct progress *progress) {
    return pop_section_write(lod->instance, path, &lod->pop, progress);
}

static void release(pbr_lod *lod) {
    pop_free(lod->instance, &lod->pop);
}

static void outline(const pbr_lod *lod, struct lod_outline *out) {
    const struct pop *pop = &lod->pop;
    const uint64_t count = pop->shape.level_count > 0 ? pop->shape.levels[0].count : 0;
    *out = (struct lod_outline){
        .radius = pop->radius, .bounding_radius = pop->span, .leaves = count, .triangles = count, .has_colours = pop->has_colours};
    memcpy(out->centre, pop->centre, sizeof out->centre);
}

static void info(const pbr_lod *lod, pbr_lod_info *i) {
    const struct pop *pop = &lod->pop;
    const uint64_t bytes = pop->vertex_count * sizeof *pop->vertices + lod->outline.triangles * sizeof *pop->triangles +
                           pop->shape.nodes * sizeof *pop->nodes;
    i->triangle_count = lod->outline.triangles;
    i->vertex_count = pop->vertex_count;
    i->data_bytes = lod->file.data ? lod->file.size : bytes;
    i->memory_bytes = sizeof *lod + (lod->file.mapped ? 0 : i->data_bytes);
}

static pbr_result measure(const pbr_lod *lod, const struct progress *progress, pbr_lod_statistics *statistics) {
    return pop_measure(&lod->pop, progress, statistics);
}

static pbr_result to_points(const pbr_lod *lod, const struct progress *progress, pbr_points **out) {
    return pop_to_points(lod->instance, &lod->pop, progress, out);
}

static pbr_result cut(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                      struct cut *out) {
    (void)occlusion; /* what hides makes nothing coarser */
    if (!out->front) out->front = pbr_allocate(lod->instance, 1, sizeof *out->front);
    if (!out->front) return PBR_ERROR_OUT_OF_MEMORY;
    struct pop_cut *front = out->front;
    const pbr_result result = pop_cut_update(lod->instance, &lod->pop, view, cancel, front);
    out->points_only = (size_t)front->counts[POP_POINT];
    out->count = out->points_only + (size_t)front->counts[POP_QUAD];
    out->triangle_count = (size_t)front->counts[POP_TRIANGLE];
    out->culled = front->counts[POP_CULLED];
    out->visited = front->visited;
    out->nearness = pop_cut_nearness(&lod->pop, front);
    return result;
}

static void gather(const pbr_lod *lod, const struct cut *cut, struct splat *records, uint32_t (*triangles)[3]) {
    if (cut->front) pop_cut_gather(&lod->pop, cut->front, records, triangles);
}

const struct lod_kind lod_kind_pop = {.kind = PBR_LOD_POP,
                                      .name = "a POP hierarchy",
                                      .section = POP_SECTION,
                                      .of_mesh = true,
                                      .build = build,
                                      .parse = parse,
                                      .save_pbr = save_pbr,
                                      .release = release,
                                      .outline = outline,
                                      .info = info,
                                      .measure = measure,
                                      .to_points = to_points,
                                      .cut = cut,
                                      .gather = gather};
