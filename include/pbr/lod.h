/* SPDX-License-Identifier: MIT */
/** @file lod.h
 * Hierarchies: surfaces at every level of detail. Built once from points, stored in files, mapped ever after. Immutable and reference
 * counted; any number of renderers and threads may use one at once. No OpenGL.
 */
#ifndef PBR_LOD_H
#define PBR_LOD_H

#include <pbr/mesh.h>

PBR_BEGIN_DECLS

/** An immutable hierarchy, reference counted. */
typedef struct pbr_lod pbr_lod;

/** Which hierarchy. */
enum {
    /** Tree of bounding spheres, 32 bits a node, 48 with colours (Rusinkiewicz & Levoy 2000). */
    PBR_LOD_QSPLAT = 1,
    /** Sequential point tree: nodes in an order of which a view needs a part, sent to the GPU once, 20 bytes each (Dachsbacher, Vogelgsang,
     * Stamminger 2003). docs/spt.md. */
    PBR_LOD_SPT = 2,
    /** POP: over a triangle mesh, whose triangles are drawn where points would be too large (Chen & Nguyen 2001; Benda 2005). docs/pop.md. */
    PBR_LOD_POP = 3
};

/** In which form a hierarchy is stored. */
enum {
    PBR_LOD_FILE_NONE = 0, /**< In memory only. */
    PBR_LOD_FILE_PBR = 1,  /**< libpbr's own container: any size, double origin. docs/qsplat.md, docs/spt.md and docs/pop.md have the layout. */
    PBR_LOD_FILE_QS = 2    /**< QSplat version 11, as the original program reads and writes it: up to 2 GiB, float origin; of
                                #PBR_LOD_QSPLAT only. */
};

/** Flags of #pbr_lod_desc. */
enum {
    /** Of #PBR_LOD_SPT: with a linear field of normals for each node, 8 bytes more, which #PBR_SHADE_PHONG_FIELD draws it with (Botsch, Spernat,
     * Kobbelt 2004). To fit them to the points' neighbours takes several times as long as all else. Points without normals have none. */
    PBR_LOD_NORMAL_FIELDS = 1u << 0
};

/** What #pbr_lod_create needs. */
typedef struct pbr_lod_desc {
    size_t struct_size;
    uint32_t kind;            /**< PBR_LOD_...; 0 = #PBR_LOD_QSPLAT. */
    uint32_t flags;           /**< PBR_LOD_NORMAL_FIELDS or 0. */
    const pbr_points *points; /**< With radii that close the surface, or holes open. Only read during the call. NULL for #PBR_LOD_POP. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user;      /**< First argument of `progress`. */
    uint32_t leaf_points;     /**< Of #PBR_LOD_SPT: cells of so many points are divided no further, 0 = 1; at most 16. */
    uint32_t reserved;        /**< Must be 0. */
    const pbr_mesh *mesh;     /**< Of #PBR_LOD_POP; NULL for the others. Its vertices are copied. */
} pbr_lod_desc;

#define PBR_LOD_DESC_INIT PBR_SIZED(pbr_lod_desc)

/** Flags of #pbr_lod_open_desc. */
enum {
    /** Read the file into memory instead of mapping it. A mapped file that somebody shortens ends the process with SIGBUS when its lost part is
     * read; libpbr has no signal handlers. */
    PBR_LOD_OPEN_READ = 1u << 0
};

/** What #pbr_lod_open may be told. */
typedef struct pbr_lod_open_desc {
    size_t struct_size;
    uint32_t flags;    /**< PBR_LOD_OPEN_... */
    uint32_t reserved; /**< Must be 0. */
    uint64_t resident_bytes; /**< Of a mapped file, about how much may be in the process' memory at a time: what has not been looked at for long is
                                  given back to the system. 0 = 128 MiB; at least 4 MiB are taken. */
} pbr_lod_open_desc;

#define PBR_LOD_OPEN_DESC_INIT PBR_SIZED(pbr_lod_open_desc)

/** What a hierarchy holds. Set `struct_size` before the call (#PBR_LOD_INFO_INIT). */
typedef struct pbr_lod_info {
    size_t struct_size;
    uint32_t kind;         /**< PBR_LOD_... */
    uint32_t file_format;  /**< PBR_LOD_FILE_... it was opened from. */
    uint64_t point_count;  /**< Leaves. */
    double centre[3];      /**< Of a sphere around all splats, object space. */
    double radius;         /**< Of that sphere; 0 when empty. */
    double bounding_radius; /**< Distance of the farthest point from the centre, as in #pbr_points_info; of a QSplat file: `radius`. */
    int32_t has_colours;   /**< 1: there are colours. */
    int32_t is_mapped;     /**< 1: a mapped file. */
    uint64_t data_bytes;   /**< Bytes of the hierarchy, in memory or mapped. */
    uint64_t memory_bytes; /**< Heap bytes it occupies. */
    uint64_t resident_bytes; /**< Of a mapped file that is larger than #pbr_lod_open_desc::resident_bytes: how much of it is in the process'
                                  memory now; else 0. */
    int32_t has_normal_fields; /**< 1: built with #PBR_LOD_NORMAL_FIELDS, of points with normals. */
    int32_t reserved;      /**< 0. */
    uint64_t triangle_count; /**< Of #PBR_LOD_POP: triangles, one a leaf; else 0. */
    uint64_t vertex_count;   /**< Of #PBR_LOD_POP: vertices, of which #pbr_lod_to_points makes points; else 0. */
} pbr_lod_info;

#define PBR_LOD_INFO_INIT PBR_SIZED(pbr_lod_info)

/** Most levels that #pbr_lod_measure tells apart. */
#define PBR_LOD_LEVELS 64

/** What #pbr_lod_measure finds. A sequential point tree does not tell which node is whose child: of it there are nodes, leaves,
 * levels (the deepest chunk's) and leaf_radius_mean; all else is 0. Set `struct_size` before the call (#PBR_LOD_STATISTICS_INIT). */
typedef struct pbr_lod_statistics {
    size_t struct_size;
    uint64_t nodes;               /**< All, the root and the leaves included. */
    uint64_t leaves;              /**< Nodes without children. */
    uint64_t levels;              /**< Of the deepest leaf; the root is level 0. */
    uint64_t level_nodes[PBR_LOD_LEVELS]; /**< Nodes of each level; the last one counts all below, too. */
    uint64_t children[5];         /**< Inner nodes with so many children. */
    uint64_t cones[4];            /**< Nodes whose normal cone has a half angle of sine 1/16, 4/16, 9/16, 16/16. */
    double leaf_radius_mean;      /**< Object units. */
    double overhang_mean;         /**< How far children reach out of their parent's sphere, in its radii: mean over nodes, */
    double overhang_largest;      /**< and largest. */
    uint64_t damaged;             /**< Groups of siblings that lie outside the file; what is below them is missing. */
} pbr_lod_statistics;

#define PBR_LOD_STATISTICS_INIT PBR_SIZED(pbr_lod_statistics)

/**
 * Builds a hierarchy in memory.
 * @param instance  Outlives the hierarchy.
 * @param desc      What of. Points without normals or radii get none: such splats face the eye, or are drawn at the smallest size.
 * @param out       Receives the hierarchy with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_UNSUPPORTED (a flag that is not of this kind), #PBR_ERROR_LIMIT,
 *         #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_create(pbr_instance *instance, const pbr_lod_desc *desc, pbr_lod **out);

/** Where a #pbr_lod_source_fn puts points. All arrays are `count` long, and its to fill. */
typedef struct pbr_lod_batch {
    size_t struct_size;
    double *positions; /**< count x 3, object space. Points with a coordinate that is not finite, or not a float's, are left out. */
    float *normals;    /**< count x 3, any length; come as zeros, which mean none. */
    uint8_t *colours;  /**< count x 4, sRGB and unused alpha; NULL without #PBR_LOD_BUILD_COLOURS. */
    float *radii;      /**< count, object units; come as zeros. */
} pbr_lod_batch;

/**
 * Delivers points [first, first + count) of a source.
 * @param user   `source_user` of the descriptor.
 * @param first  Counts from 0.
 * @param count  At most 65,536.
 * @param batch  Where to.
 * @return #PBR_OK, or an error that ends the building and is returned from it.
 * Called on several threads at once, in any order, and two or three times for each range: with the same points each time.
 */
typedef pbr_result (*pbr_lod_source_fn)(void *user, uint64_t first, uint64_t count, const pbr_lod_batch *batch);

/** Flags of #pbr_lod_build_desc. */
enum {
    PBR_LOD_BUILD_COLOURS = 1u << 0 /**< The source has colours. */
};

/** What #pbr_lod_build_file needs. */
typedef struct pbr_lod_build_desc {
    size_t struct_size;
    uint32_t kind;            /**< PBR_LOD_...; 0 = #PBR_LOD_QSPLAT. */
    uint32_t flags;           /**< PBR_LOD_BUILD_... */
    uint64_t point_count;     /**< Of the source; at least 1, at most 2^44. */
    pbr_lod_source_fn source; /**< Required. */
    void *source_user;        /**< First argument of `source`. */
    double minimum[3];        /**< A box around all points, object space. Both corners 0 = the source is read once more to find it. */
    double maximum[3];        /**< Likewise. */
    uint64_t memory_bytes;    /**< How much memory to get along with, 0 = 1 GiB; at least 32 MiB are taken. More makes fewer and larger pieces. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user;      /**< First argument of `progress`. */
} pbr_lod_build_desc;

#define PBR_LOD_BUILD_DESC_INIT PBR_SIZED(pbr_lod_build_desc)

/**
 * Builds a hierarchy of any number of points straight into a .pbr file, in bounded memory. Beside the file a temporary one takes 20 bytes a
 * point; it has no name and is gone whatever happens. The file appears under its name when it is complete.
 * @param instance  Is only used.
 * @param desc      What of.
 * @param path      As #pbr_lod_save.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_UNSUPPORTED (#PBR_LOD_SPT), #PBR_ERROR_LIMIT, #PBR_ERROR_IO,
 *         #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED, or what the source returned. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_build_file(pbr_instance *instance, const pbr_lod_build_desc *desc, const char *path);

/**
 * Opens a hierarchy's file, of either format: the content decides. Takes no longer for a large file than for a small one, when mapped. Header and
 * sections are checked now; a damaged node of a QSplat tree is noticed, and left out, when a view comes to it.
 * @param instance  Outlives the hierarchy.
 * @param path      UTF-8, or whatever the system takes.
 * @param desc      NULL = defaults.
 * @param out       Receives the hierarchy with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_IO, #PBR_ERROR_FORMAT, #PBR_ERROR_UNSUPPORTED, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_OUT_OF_MEMORY.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_open(pbr_instance *instance, const char *path, const pbr_lod_open_desc *desc, pbr_lod **out);

/**
 * Writes a hierarchy to a file, which appears under its name only when it is complete; one of that name is replaced then.
 * @param lod            Is only read.
 * @param path           As #pbr_lod_open. May be the file that `lod` is mapped from.
 * @param file_format    #PBR_LOD_FILE_PBR, or #PBR_LOD_FILE_QS of a #PBR_LOD_QSPLAT.
 * @param progress       May be NULL; returning 0 cancels.
 * @param progress_user  First argument of `progress`.
 * @return #PBR_OK, #PBR_ERROR_IO, #PBR_ERROR_LIMIT (too large for QSplat 11), #PBR_ERROR_FORMAT (a damaged hierarchy), #PBR_ERROR_CANCELLED,
 *         #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_OUT_OF_MEMORY.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_save(const pbr_lod *lod, const char *path, uint32_t file_format, pbr_progress_fn progress,
                                void *progress_user);

/**
 * Adds a reference.
 * @param lod  NULL is allowed.
 * @return `lod`. Any thread; no context. Since 0.1.
 */
PBR_API pbr_lod *pbr_lod_retain(pbr_lod *lod);

/**
 * Drops a reference, freeing the hierarchy with the last one, and sets `*lod` to NULL.
 * @param lod  NULL and a pointer to NULL are allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_lod_release(pbr_lod **lod);

/**
 * Describes a hierarchy, in no time.
 * @param lod   Is only read.
 * @param info  `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_get_info(const pbr_lod *lod, pbr_lod_info *info);

/**
 * Walks over all of a hierarchy and counts.
 * @param lod            Is only read.
 * @param progress       May be NULL; returning 0 cancels.
 * @param progress_user  First argument of `progress`.
 * @param statistics     `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_CANCELLED, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_INVALID_ARGUMENT.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_measure(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user,
                                   pbr_lod_statistics *statistics);

/**
 * The leaves as a point set, as the hierarchy has them: quantised. Of #PBR_LOD_POP the mesh's vertices, with the mean radius of the balls around
 * their triangles.
 * @param lod            Is only read.
 * @param progress       May be NULL; returning 0 cancels.
 * @param progress_user  First argument of `progress`.
 * @param out            Receives the points with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_LIMIT (more than #PBR_MAX_POINTS), #PBR_ERROR_CANCELLED, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_INVALID_ARGUMENT.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_lod_to_points(const pbr_lod *lod, pbr_progress_fn progress, void *progress_user, pbr_points **out);

PBR_END_DECLS
#endif
