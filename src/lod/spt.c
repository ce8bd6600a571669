/* Sequential point trees as they are used: ranges, and what can be asked of all entries. SPDX-License-Identifier: MIT */
#include "spt.h"

#include <math.h>
#include <string.h>

void spt_free(pbr_instance *instance, struct spt *spt) {
    for (uint32_t i = 0; spt->owns && i < spt->chunk_count; i++) {
        pbr_free(instance, (void *)(uintptr_t)spt->entries[i]);
        pbr_free(instance, (void *)(uintptr_t)spt->steps[i]);
    }
    pbr_free(instance, spt->chunks);
    pbr_free(instance, (void *)spt->entries);
    pbr_free(instance, (void *)spt->steps);
    *spt = (struct spt){0};
}

/* ---- Ranges ---- */

/* The test computes in float, with some roundings in either side, and leaves depths room. */
static const double ROUNDING = 4 * (double)SPT_DEPTH_ROOM;

/* Whether nothing from the step's first entry on is drawn: all parents are fine enough. */
static bool ends_before(const struct spt_step *step, double s, double z_near) {
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
        if (ends_before(&steps[middle], s, z_near)) high = middle;
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
