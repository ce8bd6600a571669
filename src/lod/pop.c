/* POP hierarchies as they are: what can be asked of all of one. SPDX-License-Identifier: MIT */
#include "pop.h"

#include <string.h>

#include "core/points.h"

void pop_free(pbr_instance *instance, struct pop *pop) {
    if (pop->owns) {
        pbr_free(instance, (void *)(uintptr_t)pop->nodes);
        pbr_free(instance, (void *)(uintptr_t)pop->triangles);
        pbr_free(instance, (void *)(uintptr_t)pop->vertices);
    }
    *pop = (struct pop){0};
}

/* Level 0 of the hierarchy is the deepest. */
pbr_result pop_measure(const struct pop *pop, const struct progress *progress, pbr_lod_statistics *statistics) {
    const struct pop_shape *shape = &pop->shape;
    double radii = 0;
    pbr_result result = progress_report(progress, "counting nodes", 0);
    statistics->nodes = shape->nodes;
    if (shape->level_count == 0 || result != PBR_OK) return result;
    statistics->leaves = shape->levels[0].count;
    statistics->levels = shape->level_count - 1;
    for (uint32_t level = 0; level < shape->level_count; level++) {
        statistics->level_nodes[shape->level_count - 1 - level] = shape->levels[level].count;
        for (uint64_t i = 0; i < shape->levels[level].count; i++) {
            const struct pop_node *node = pop_node_at(pop, level, i);
            uint64_t first;
            statistics->cones[pop_cone(node)]++;
            if (level > 0) statistics->children[pop_children(shape, level, i, &first)]++;
            else radii += (double)pop_decode_ball(pop, node).radius;
        }
        result = progress_report(progress, "counting nodes", (level + 1.0) / shape->level_count);
        if (result != PBR_OK) return result;
    }
    statistics->leaf_radius_mean = radii / (double)statistics->leaves;
    return PBR_OK;
}

pbr_result pop_to_points(pbr_instance *instance, const struct pop *pop, const struct progress *progress, pbr_points **out) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    const size_t count = (size_t)pop->vertex_count;
    const struct splat *vertices = pop->vertices;
    float(*normals)[3] = pbr_allocate(instance, count > 0 ? count : 1, sizeof *normals);
    if (!normals) return PBR_ERROR_OUT_OF_MEMORY;
    bool has_normals = false;
    for (size_t i = 0; i < count; i++) {
        splat_decode_normal(vertices[i].normal, normals[i]);
        has_normals = has_normals || normals[i][0] != 0 || normals[i][1] != 0 || normals[i][2] != 0;
    }
    desc.count = count;
    memcpy(desc.origin, pop->centre, sizeof desc.origin);
    if (count > 0) {
        desc.positions = (pbr_attribute){vertices->position, sizeof *vertices, PBR_FORMAT_FLOAT32, 3};
        desc.radii = (pbr_attribute){&vertices->radius, sizeof *vertices, PBR_FORMAT_FLOAT32, 1};
        if (has_normals) desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
        if (pop->has_colours) desc.colours = (pbr_attribute){vertices->colour, sizeof *vertices, PBR_FORMAT_UINT8, 4};
    }
    desc.progress = progress ? progress->report : NULL;
    desc.progress_user = progress ? progress->user : NULL;
    const pbr_result result = pbr_points_create(instance, &desc, out);
    pbr_free(instance, normals);
    return result;
}
