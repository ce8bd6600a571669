/* What a PLY property's name means. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PLY_H
#define PBR_IO_PLY_H

#include <stdbool.h>

/* Whether a vertex property of this name is more than a number: a coordinate, part of a normal or colour, a radius. */
bool ply_is_role(const char *name);

#endif
