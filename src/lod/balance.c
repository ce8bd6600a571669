/* Choosing a point cost. SPDX-License-Identifier: MIT
 *
 * A cost decides from which level on nodes are splats (pop_cut.c). Those of level 0 stand for one triangle, those of level l for at
 * most 4^l, and for more than half as many in the mean: so 1, 2, 8, 32, ... leave out one level after the other. Let a splat take s
 * and a triangle t. Leaving out a level, n nodes of k triangles each, changes a frame by n (k t - s). Since k grows with the level,
 * times fall while k t < s, and rise from there on: the first that is clearly above the least ends the search. Where few nodes are
 * left out times hardly change, so that not falling does not. */
#include "balance.h"

#include <math.h>

/* Of the best time: what another cost has to gain; and how, where it leaves out few splats, of all that is drawn, and times differ
 * by chance. */
static const double GAIN = 1.0 / 32, GAIN_OF_FEW = 1.0 / 4, FEW = 1.0 / 32;
/* Of the least time: what takes so much longer ends the search. */
static const double LOSS = 1.0 / 8;

pbr_result balance_find(balance_draw *draw, void *user, float *point_cost) {
    struct balance_sample best, now;
    pbr_result result = draw(user, 1, &best);
    if (result != PBR_OK) return result;
    double least = best.seconds;
    *point_cost = 1;
    now = best;
    for (int i = 1; i < BALANCE_TRIES && now.splats > 0 && now.seconds <= least * (1 + LOSS); i++) {
        const float cost = ldexpf(1, 2 * i - 1);
        if (draw(user, cost, &now) != PBR_OK) break;
        const double changed = (double)best.splats - (double)now.splats, drawn = (double)best.splats + (double)best.triangles;
        if (now.seconds < best.seconds * (1 - (changed > FEW * drawn ? GAIN : GAIN_OF_FEW))) best = now, *point_cost = cost;
        least = fmin(least, now.seconds);
    }
    return PBR_OK;
}
