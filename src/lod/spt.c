/* Sequential point trees as they are used: ranges, and what can be asked of all entries. SPDX-License-Identifier: MIT */
#include "spt.h"

#include <math.h>
#include <string.h>

void spt_free(pbr_instance *instance, struct spt *spt) {
    for (uint32_t i = 0; spt->owns && i < spt->chunk_count; i++) {
        pbr_free(instance, (void *)(uintptr_t)spt->entries[i]);
        pbr_free(instance, (void *)(uintptr_t)spt->steps[i]);
        if (spt->fields) pbr_free(instance, (void *)(uintptr_t)spt->fields[i]);
    }
    pbr_free(instance, spt->chunks);
    pbr_free(instance, (void *)spt->entries);
    pbr_free(instance, (void *)spt->steps);
    pbr_free(instance, (void *)spt->fields);
    *spt = (struct spt){0};
}

/* ---- Ranges ---- */

/* The test computes in float, with some roundings in either side, and leaves depths room. */
static const double ROUNDING = 4 * (double)SPT_DEPTH_ROOM;

bool spt_step_ends(const struct spt_step *step, double s, double z_near) {
    return (s * (double)step->error + (double)step->distance) * (1 + ROUNDING) <= z_near;
}

/* Whether nothing up to the step's end is drawn: nothing is fine enough. Leaves are. */
static bool begins_after(const struct spt_step *step, double s, double z_far) {
    return step->least > 0 && s * (double)step->least * (1 - ROUNDING) > z_far;
}

void spt_range(const struct spt_chunk *chunk, const struct spt_step *steps, double s, double z_near, double z_far, uint32_t *first,
               uint32_t *end) {
    uint32_t low = 0, high = spt_step_count(chunk);
    const uint32_t count = high;
    while (low < high && !isinf(s)) { /* low ends where the first step is that ends the prefix */
        const uint32_t middle = low + (high - low) / 2;
        if (spt_step_ends(&steps[middle], s, z_near)) high = middle;
        else low = middle + 1;
    }
    *end = high < count ? high * SPT_STEP : chunk->count;
    low = 0;
    high = spt_step_count(chunk);
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (begins_after(&steps[middle], s, z_far)) low = middle + 1;
        else high = middle;
    }
    *first = low < count ? low * SPT_STEP : chunk->count;
    if (*first > *end) *first = *end;
}

/* ---- All entries ---- */

pbr_result spt_measure(const struct spt *spt, const struct progress *progress, pbr_lod_statistics *statistics) {
    double radii = 0;
    pbr_result result = progress_report(progress, "counting nodes", 0);
    for (uint32_t c = 0; c < spt->chunk_count && result == PBR_OK; c++) {
        const struct spt_chunk *chunk = &spt->chunks[c];
        for (uint32_t i = 0; i < chunk->count; i++) {
            const struct spt_entry *entry = &spt->entries[c][i];
            statistics->nodes++;
            if (entry->error != 0) continue;
            statistics->leaves++;
            radii += (double)spt_decode_radius(chunk, entry);
        }
        if (chunk->levels > statistics->levels) statistics->levels = chunk->levels;
        result = progress_report(progress, "counting nodes", (c + 1.0) / spt->chunk_count);
    }
    if (statistics->leaves > 0) statistics->leaf_radius_mean = radii / (double)statistics->leaves;
    return result;
}

struct leaf_arrays {
    double (*positions)[3];
    float (*normals)[3], *radii;
    uint8_t (*colours)[4];
    size_t count;
};

static void copy_leaf(const struct spt_chunk *chunk, const struct spt_entry *entry, struct leaf_arrays *leaves) {
    const size_t i = leaves->count++;
    float p[3];
    spt_decode_position(chunk, entry, p);
    for (int k = 0; k < 3; k++) leaves->positions[i][k] = chunk->origin[k] + (double)p[k];
    leaves->radii[i] = spt_decode_radius(chunk, entry);
    if (leaves->normals) splat_decode_normal(entry->normal, leaves->normals[i]);
    if (!leaves->colours) return;
    memcpy(leaves->colours[i], entry->colour, sizeof entry->colour);
    leaves->colours[i][3] = 255;
}

/* A damaged file may have other leaves than its chunks say: no more are taken. */
static pbr_result copy_leaves(const struct spt *spt, const struct progress *progress, struct leaf_arrays *leaves) {
    pbr_result result = progress_report(progress, "reading leaves", 0);
    for (uint32_t c = 0; c < spt->chunk_count && result == PBR_OK; c++) {
        const struct spt_chunk *chunk = &spt->chunks[c];
        for (uint32_t i = 0; i < chunk->count && leaves->count < spt->leaves; i++)
            if (spt->entries[c][i].error == 0) copy_leaf(chunk, &spt->entries[c][i], leaves);
        result = progress_report(progress, "reading leaves", (c + 1.0) / spt->chunk_count);
    }
    return result;
}

static pbr_result make_points(pbr_instance *instance, const struct spt *spt, const struct leaf_arrays *leaves, pbr_points **out) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = leaves->count;
    desc.positions = (pbr_attribute){leaves->positions, 0, PBR_FORMAT_FLOAT64, 3};
    memcpy(desc.origin, spt->centre, sizeof desc.origin);
    desc.radii = (pbr_attribute){leaves->radii, 0, PBR_FORMAT_FLOAT32, 1};
    if (leaves->normals) desc.normals = (pbr_attribute){leaves->normals, 0, PBR_FORMAT_FLOAT32, 3};
    if (leaves->colours) desc.colours = (pbr_attribute){leaves->colours, 0, PBR_FORMAT_UINT8, 4};
    return pbr_points_create(instance, &desc, out);
}

pbr_result spt_to_points(pbr_instance *instance, const struct spt *spt, const struct progress *progress, pbr_points **out) {
    if (spt->leaves > PBR_MAX_POINTS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_lod_to_points: %llu leaves, the limit of a point set is %llu",
                       (unsigned long long)spt->leaves, (unsigned long long)PBR_MAX_POINTS);
    const size_t count = (size_t)spt->leaves;
    struct leaf_arrays leaves = {.positions = pbr_allocate(instance, count, sizeof *leaves.positions),
                                 .radii = pbr_allocate(instance, count, sizeof *leaves.radii)};
    bool done = leaves.positions && leaves.radii;
    if (done && spt->has_normals) done = (leaves.normals = pbr_allocate(instance, count, sizeof *leaves.normals)) != NULL;
    if (done && spt->has_colours) done = (leaves.colours = pbr_allocate(instance, count, sizeof *leaves.colours)) != NULL;
    pbr_result result = done ? copy_leaves(spt, progress, &leaves) : PBR_ERROR_OUT_OF_MEMORY;
    if (result == PBR_OK) result = make_points(instance, spt, &leaves, out);
    pbr_free(instance, leaves.positions);
    pbr_free(instance, leaves.normals);
    pbr_free(instance, leaves.radii);
    pbr_free(instance, leaves.colours);
    return result;
}
