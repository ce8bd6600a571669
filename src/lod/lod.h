/* The inside of a hierarchy, and what every kind of hierarchy can do. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_LOD_H
#define PBR_LOD_LOD_H

#include "core/file.h"
#include "pop.h"
#include "qsplat.h"
#include "spt.h"

/* What is said of all kinds alike. */
struct lod_outline {
    double centre[3];       /* object space */
    double radius;          /* of a sphere around all splats */
    double bounding_radius; /* farthest point */
    uint64_t leaves, triangles;
    bool has_colours;
    bool has_fields; /* for normals that vary over splats */
};

/* Immutable once created. */
struct pbr_lod {
    pbr_instance *instance;
    atomic_size_t references;
    const struct lod_kind *kind;
    struct lod_outline outline;
    uint32_t file_format;
    struct source file; /* opened from, or empty */
    /* PBR_LOD_QSPLAT: */
    struct qsplat_blob built;
    struct qsplat tree;
    /* PBR_LOD_SPT: */
    struct spt spt;
    /* PBR_LOD_POP: */
    struct pop pop;
};

struct cut;
struct cut_view;
struct occlusion;
struct container_section;

/* NULL: the kind cannot do it. Errors are logged. The lod that is made is zero but for instance, kind and file. */
struct lod_kind {
    uint32_t kind; /* PBR_LOD_... */
    const char *name;
    const char *section; /* its type in our container */
    bool of_mesh;        /* else it is made of points */
    uint32_t flags;      /* of pbr_lod_desc */
    pbr_result (*build)(pbr_lod *lod, const pbr_lod_desc *desc, const struct progress *progress);
    pbr_result (*build_file)(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path);
    /* section: NULL in a file of QSplat. */
    pbr_result (*parse)(pbr_lod *lod, const char *path, const struct container_section *section, const pbr_lod_open_desc *desc);
    pbr_result (*save_pbr)(const pbr_lod *lod, const char *path, const struct progress *progress);
    pbr_result (*save_qs)(const pbr_lod *lod, const char *path, const struct progress *progress);
    void (*release)(pbr_lod *lod); /* also where making it failed */
    void (*outline)(const pbr_lod *lod, struct lod_outline *out);
    /* data_bytes and memory_bytes, and what else the outline lacks. */
    void (*info)(const pbr_lod *lod, pbr_lod_info *info);
    pbr_result (*measure)(const pbr_lod *lod, const struct progress *progress, pbr_lod_statistics *statistics);
    pbr_result (*to_points)(const pbr_lod *lod, const struct progress *progress, pbr_points **out);
    pbr_result (*cut)(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                      struct cut *cut);
    void (*gather)(const pbr_lod *lod, const struct cut *cut, struct splat *records, uint32_t (*triangles)[3]);
};

extern const struct lod_kind lod_kind_qsplat, lod_kind_spt, lod_kind_pop;

/* Of points: their squares are floats. */
#define LOD_EXTENT_MOST 1e18

/* Where positions are relative to, and the longest side of the box; an error where floats cannot hold it. */
pbr_result lod_choose_centre(pbr_instance *instance, const double minimum[3], const double maximum[3], double centre[3],
                             double *extent);

#endif
