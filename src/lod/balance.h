/* Which point cost draws a hierarchy over a mesh in the least time, by trying. Without GL or a clock of its own.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_BALANCE_H
#define PBR_LOD_BALANCE_H

#include <pbr/base.h>
#include <stdint.h>

/* A frame: what it took, and of what. */
struct balance_sample {
    double seconds;
    uint64_t splats, triangles;
};

/* Draws with this point cost. */
typedef pbr_result balance_draw(void *user, float point_cost, struct balance_sample *out);

/* The cost with which drawing takes least, of those that hardly differ the smallest; after at most BALANCE_TRIES tries. That a
 * larger one than the first does not fit into memory ends the search. After an error `point_cost` is as it was. */
pbr_result balance_find(balance_draw *draw, void *user, float *point_cost);

enum { BALANCE_TRIES = 10 };

#endif
