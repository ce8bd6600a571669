/* Choosing a point cost. SPDX-License-Identifier: MIT
 *
 * A cost decides from which level on nodes are splats (pop_cut.c). Those of level 0 stand for one triangle, those of level l for at
 * most 4^l, and for more than half as many in the mean: so 1, 2, 8, 32, ... leave out one level after the other. Let a splat take s
 * and a triangle t. Leaving out a level, n nodes of k triangles each, changes a frame by n (k t - s). Since k grows with the level,
 * times fall while k t < s, and rise from there on: the first that is clearly above the least ends the search. Where few nodes are
 * left out times hardly change, so that not falling does not. */
#include "balance.h"

#include <math.h>

/* Less is taken for noise. */
static const double CLEARLY = 1.0 / 32, SLOWER = 1.0 / 8;

pbr_result balance_find(balance_draw *draw, void *user, float *point_cost) {
    double best = INFINITY, least = INFINITY;
    uint64_t splats = 1;
    *point_cost = 1;
    for (int i = 0; i < BALANCE_TRIES && splats > 0; i++) {
        const float cost = i == 0 ? 1 : ldexpf(1, 2 * i - 1);
        double seconds;
        const pbr_result result = draw(user, cost, &seconds, &splats);
        if (result != PBR_OK) return result;
        if (seconds < best * (1 - CLEARLY)) best = seconds, *point_cost = cost;
        least = fmin(least, seconds);
        if (seconds > least * (1 + SLOWER)) break;
    }
    return PBR_OK;
}
