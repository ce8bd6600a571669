/* Choosing a point cost. SPDX-License-Identifier: MIT
 *
 * A cost decides from which level on nodes are splats (pop_cut.c). Those of level 0 stand for one triangle, those of level l for at
 * most 4^l, and for more than half as many in the mean: so 1, 2, 8, 32, ... leave out one level after the other. Let a splat take s
 * and a triangle t. Leaving out a level, n nodes of k triangles each, changes a frame by n (k t - s). Since k grows with the level,
 * times fall while k t < s, and rise from there on: the first that is clearly above the least ends the search. Where few nodes are
 * left out times hardly change, so that not falling does not. */
#include "balance.h"

#include <math.h>
#include <stdbool.h>

/* Of the least time: what a larger cost has to gain, and what takes so much longer that the search ends. */
static const double GAIN = 1.0 / 32, LOSS = 1.0 / 8;
/* Where a cost leaves out few splats more, of all that is drawn, times differ by chance, up to so much: the smaller cost, which
 * draws fewer triangles where all is small, is taken. */
static const double FEW = 1.0 / 32, CHANCE = 1.0 / 4;

static bool differ_by_few(const struct balance_sample *a, const struct balance_sample *b) {
    return (double)a->splats - (double)b->splats <= FEW * ((double)a->splats + (double)a->triangles);
}

/* What may be of a larger cost alone. */
static bool does_not_fit(pbr_result result) {
    return result == PBR_ERROR_OUT_OF_GPU_MEMORY || result == PBR_ERROR_OUT_OF_MEMORY || result == PBR_ERROR_LIMIT;
}

static float cost_of(int i) {
    return i == 0 ? 1 : ldexpf(1, 2 * i - 1);
}

pbr_result balance_find(balance_draw *draw, void *user, float *point_cost) {
    struct balance_sample samples[BALANCE_TRIES];
    double least = INFINITY;
    int best = 0;
    for (int i = 0; i < BALANCE_TRIES; i++) {
        const pbr_result result = draw(user, cost_of(i), &samples[i]);
        if (i > 0 && does_not_fit(result)) break;
        if (result != PBR_OK) return result;
        if (samples[i].seconds < samples[best].seconds * (1 - GAIN)) best = i;
        least = fmin(least, samples[i].seconds);
        if (samples[i].splats == 0 || samples[i].seconds > least * (1 + LOSS)) break;
    }
    const double most = samples[best].seconds * (1 + CHANCE);
    while (best > 0 && samples[best - 1].seconds <= most && differ_by_few(&samples[best - 1], &samples[best])) best--;
    *point_cost = cost_of(best);
    return PBR_OK;
}
