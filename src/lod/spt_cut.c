/* Culling chunks, and finding their ranges. SPDX-License-Identifier: MIT */
#include "spt_cut.h"

#include <float.h>
#include <math.h>

#include "cloud.h"
#include "core/matrix.h"

/* The first line whose bound, 2^(line / 2), is above the code. */
static int line_of(uint32_t code) {
    int line = 0;
    for (uint64_t bound = 1; line + 1 < SPT_SIZES && (uint64_t)code * code >= bound; bound *= 2) line++; /* squared */
    return line;
}

/* Whatever the entries' order: files may be damaged. */
static void measure_heads(const struct spt_chunk *chunk, const struct spt_entry *entries, struct spt_step heads[SPT_HEADS]) {
    uint16_t error = 0;
    uint8_t distance = 0;
    int head = SPT_HEADS - 1;
    for (uint32_t i = chunk->count; i-- > 1;) {
        if (entries[i].parent_error > error) error = entries[i].parent_error;
        if (entries[i].distance > distance) distance = entries[i].distance;
        while (head > 0 && i < UINT32_C(1) << head) head--;
        if (i == UINT32_C(1) << head)
            heads[head] =
                (struct spt_step){.error = spt_decode_error(chunk, error), .distance = spt_decode_distance(chunk, distance)};
    }
}

void spt_measure_sizes(const struct spt_chunk *chunk, const struct spt_entry *entries, struct spt_sizes *out) {
    uint16_t radii[SPT_SIZES] = {0};
    float farthest = 0;
    for (uint32_t i = 0; i < chunk->count; i++) {
        uint16_t *radius = &radii[line_of(entries[i].error)];
        float at[3], squared = 0;
        if (entries[i].radius > *radius) *radius = entries[i].radius;
        spt_decode_position(chunk, &entries[i], at);
        for (int k = 0; k < 3; k++) squared += (at[k] - chunk->centre[k]) * (at[k] - chunk->centre[k]);
        farthest = fmaxf(farthest, squared);
    }
    out->reach = sqrtf(farthest) * (1 + 1e-5f) + FLT_MIN;
    for (int line = 0; line < SPT_SIZES; line++) {
        if (line > 0 && radii[line - 1] > radii[line]) radii[line] = radii[line - 1];
        out->largest[line] = (float)radii[line] * chunk->radius_step;
    }
    measure_heads(chunk, entries, out->heads);
}

/* A projection without depth: z is so large that D does not count. */
struct spt_scale spt_scale_of(const struct cut_view *view, double radius) {
    struct sight sight;
    sight_prepare(view, &sight);
    const double slope = sight.rows[3].slope, depth_per_w = slope > 0 ? 1 / slope : fmax(radius, 1e-30) * 0x1p24;
    const double pixels = view->node_size_per_radius / 2;
    return (struct spt_scale){depth_per_w, view->threshold > 0 ? pixels * depth_per_w / view->threshold : INFINITY};
}

/* Of what may be drawn. */
static double largest_radius(const struct spt_chunk *chunk, const struct spt_sizes *sizes, double s, double z_far) {
    if (sizes->reach == 0) return (double)chunk->radius;
    const double code = isinf(s) ? 0 : ceil(z_far / (s * (double)chunk->error_step)) + 1;
    const int line = code < SPT_CODES ? line_of((uint32_t)fmax(code, 0)) : SPT_SIZES - 1;
    return (double)sizes->largest[line];
}

void spt_cut_range(const struct spt_chunk *chunk, const struct spt_step *steps, const struct spt_sizes *sizes, double s,
                   double z_near, double z_far, uint32_t *first, uint32_t *end) {
    spt_range(chunk, steps, s, z_near, z_far, first, end);
    if (sizes->reach == 0 || isinf(s) || *end > SPT_STEP) return;
    /* Within the table's first line: from afar that is most of what would be handed over. */
    for (int head = 0; head < SPT_HEADS && UINT32_C(1) << head < *end; head++)
        if (spt_step_ends(&sizes->heads[head], s, z_near)) *end = UINT32_C(1) << head;
    if (*first > *end) *first = *end;
}

pbr_result spt_list(pbr_instance *instance, const struct spt *spt, const struct spt_sizes *sizes, const struct cut_view *view,
                    struct draw_list *list) {
    struct sight sight;
    sight_prepare(view, &sight);
    const struct spt_scale scale = spt_scale_of(view, spt->radius);
    for (uint32_t i = 0; i < spt->chunk_count; i++) {
        const struct spt_chunk *chunk = &spt->chunks[i];
        struct block block = {.chunk = i, .count = chunk->count, .cone = chunk->cone};
        block.radius = sizes[i].reach > 0 ? sizes[i].reach : chunk->radius;
        struct chunk place = {0};
        for (int k = 0; k < 3; k++) {
            place.origin[k] = chunk->origin[k];
            block.centre[k] = chunk->origin[k] + (double)chunk->centre[k];
            block.axis[k] = chunk->axis[k];
        }
        const double w = dot3(sight.rows[3].normal, block.centre) + sight.rows[3].offset;
        const double reach = sight.rows[3].slope * (double)block.radius + 1e-6 * fabs(w); /* and what floats may be off */
        const double z_near = (w - reach) * scale.depth_per_w, z_far = (w + reach) * scale.depth_per_w;
        block.largest_splat = (float)largest_radius(chunk, &sizes[i], scale.s, z_far);
        list->visited++;
        const enum cloud_where where = cloud_classify(&sight, view, &block, &place);
        uint32_t first = 0, end = 0;
        if (where != CLOUD_OUTSIDE) spt_cut_range(chunk, spt->steps[i], &sizes[i], scale.s, fmax(z_near, 0), z_far, &first, &end);
        list->culled += chunk->count - (end - first);
        if (end == first) continue;
        const pbr_result result =
            draw_list_add(instance, list, (struct draw_range){i, first, end - first, where == CLOUD_NEEDS_QUADS});
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}
