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

#endif
