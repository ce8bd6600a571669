/* The colour map that is used where none is given: from dark blue to yellow, ever lighter. Only numbers. SPDX-License-Identifier:
 * MIT */
#ifndef PBR_CORE_COLOUR_MAP_H
#define PBR_CORE_COLOUR_MAP_H

enum { COLOUR_MAP_SIZE = 8 };

/* Linear light, evenly spaced. */
static const float colour_map[COLOUR_MAP_SIZE][3] = {{0.012f, 0.006f, 0.08f}, {0.017f, 0.044f, 0.26f}, {0.012f, 0.15f, 0.33f},
                                                     {0.02f, 0.31f, 0.26f},   {0.11f, 0.5f, 0.13f},    {0.42f, 0.67f, 0.06f},
                                                     {0.9f, 0.78f, 0.12f},    {1, 0.9f, 0.42f}};

#endif
