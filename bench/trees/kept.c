/* Counting by libpbr's own parts. SPDX-License-Identifier: MIT */
#include "kept.h"

#include <pbr/support.h>
#include <stdlib.h>
#include <string.h>

#include "core/matrix.h"
#include "lod/lod.h"
#include "lod/spt_cut.h"

/* As placement_view makes it of ellipses that are not moved otherwise. */
static struct cut_view view_of(const struct spt *spt, const struct camera *camera, const double model[16], const uint32_t size[2],
                               double threshold) {
    struct cut_view view;
    double to_eye[16];
    memset(&view, 0, sizeof view);
    matrix_multiply(camera->view, model, to_eye);
    matrix_translate(to_eye, spt->centre, view.to_eye);
    memcpy(view.projection, camera->projection, sizeof view.projection);
    matrix_multiply(view.projection, view.to_eye, view.to_clip);
    for (int k = 0; k < 2; k++) view.viewport[k] = size[k], view.guard.jitter[k] = 1;
    view.node_size_per_radius = 2 * camera->pixel_scale;
    view.size_per_radius = view.node_size_per_radius;
    view.size_maximum = 1e18;
    view.point_limit = 255;
    view.discs = true;
    view.reach_per_radius = 1;
    view.largest_spread = 0.8;
    view.threshold = threshold;
    return view;
}

static void count_chunk(const struct spt *spt, const struct draw_range *range, const struct cut_view *view, struct spt_scale scale,
                        struct kept *out) {
    const struct spt_chunk *chunk = &spt->chunks[range->chunk];
    double to_clip[16];
    matrix_translate(view->to_clip, chunk->origin, to_clip);
    out->chunks++;
    out->handed += range->count;
    for (uint32_t i = 0; i < chunk->count; i++) {
        const struct spt_entry *entry = &spt->entries[range->chunk][i];
        float at[3];
        spt_decode_position(chunk, entry, at);
        const double w = to_clip[3] * (double)at[0] + to_clip[7] * (double)at[1] + to_clip[11] * (double)at[2] + to_clip[15];
        const float e = spt_decode_error(chunk, entry->error), E = spt_decode_error(chunk, entry->parent_error);
        const float z = (float)(w * scale.depth_per_w), s = (float)scale.s;
        if (!spt_is_drawn(e, E, spt_decode_distance(chunk, entry->distance), s, z)) continue;
        if (i < range->first || i - range->first >= range->count) {
            out->missed++;
            continue;
        }
        out->kept++;
        out->twice += !spt_is_drawn(e, E, 0, s, z);
    }
}

bool kept_count(pbr_instance *instance, const pbr_lod *tree, const struct camera *camera, const double model[16],
                const uint32_t size[2], double threshold, struct kept *out) {
    const struct spt *spt = &tree->spt;
    const struct cut_view view = view_of(spt, camera, model, size, threshold);
    struct spt_sizes *sizes = calloc(spt->chunk_count + 1, sizeof *sizes);
    struct draw_list list = {0};
    *out = (struct kept){0};
    if (sizes)
        for (uint32_t i = 0; i < spt->chunk_count; i++) spt_measure_sizes(&spt->chunks[i], spt->entries[i], &sizes[i]);
    const bool listed = sizes && spt_list(instance, spt, sizes, &view, &list) == PBR_OK;
    for (size_t i = 0; listed && i < list.count; i++)
        count_chunk(spt, &list.ranges[i], &view, spt_scale_of(&view, spt->radius), out);
    pbr_free(instance, list.ranges);
    free(sizes);
    return listed;
}
