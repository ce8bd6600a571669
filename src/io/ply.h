/* PLY files. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_PLY_H
#define PBR_IO_PLY_H

#include "reader.h"

/* Reads a whole file (one that ply_recognise knows) and makes its points or mesh. */
pbr_result ply_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

/* Whether a vertex property of this name is more than a number: a coordinate, part of a normal or colour, a radius. */
bool ply_is_role(const char *name);

#endif
