/* Which point cost draws a hierarchy over a mesh in the least time, by trying. Without GL or a clock of its own.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_BALANCE_H
#define PBR_LOD_BALANCE_H

#include <pbr/base.h>
#include <stdint.h>

/* Draws with this point cost: seconds, and how many splats there were. */
typedef pbr_result balance_draw(void *user, float point_cost, double *seconds, uint64_t *splats);

/* The cost with which drawing takes least, 1 where none is clearly faster; an error of `draw` ends it. It is tried at most
 * BALANCE_TRIES times. */
pbr_result balance_find(balance_draw *draw, void *user, float *point_cost);

enum { BALANCE_TRIES = 10 };

#endif
