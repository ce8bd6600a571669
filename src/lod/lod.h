/* The inside of a hierarchy. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_LOD_H
#define PBR_LOD_LOD_H

#include "core/file.h"
#include "qsplat.h"

/* Immutable once created. */
struct pbr_lod {
    pbr_instance *instance;
    atomic_size_t references;
    uint32_t file_format;
    struct source file; /* opened from; or: */
    struct qsplat_blob built;
    struct qsplat tree;
};

/* Of points: their squares are floats. */
#define LOD_EXTENT_MOST 1e18

/* Where positions are relative to, and the longest side of the box; an error where floats cannot hold it. */
pbr_result lod_choose_centre(pbr_instance *instance, const double minimum[3], const double maximum[3], double centre[3],
                             double *extent);

#endif
