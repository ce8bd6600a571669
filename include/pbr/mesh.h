/* SPDX-License-Identifier: MIT */
/** @file mesh.h
 * Indexed triangle meshes: the source of point sets, and of hierarchies. Immutable and reference counted.
 */
#ifndef PBR_MESH_H
#define PBR_MESH_H

#include <pbr/points.h>

PBR_BEGIN_DECLS

/** An immutable triangle mesh, reference counted; any number of threads may use one at once. */
typedef struct pbr_mesh pbr_mesh;

/** What #pbr_mesh_create needs. */
typedef struct pbr_mesh_desc {
    size_t struct_size;
    uint64_t vertex_count;   /**< At most #PBR_MAX_POINTS. */
    pbr_attribute positions; /**< As in #pbr_points_desc. */
    double origin[3];        /**< Likewise. */
    pbr_attribute normals;   /**< Optional, per vertex. Absent: averaged from the faces, weighted by the corner's angle. */
    pbr_attribute colours;   /**< Optional, per vertex, as in #pbr_points_desc. */
    const void *indices;     /**< 3 per triangle. */
    uint32_t index_format;   /**< #PBR_FORMAT_UINT16 or #PBR_FORMAT_UINT32. */
    uint32_t flags;          /**< Must be 0. */
    uint64_t triangle_count; /**< 0 is allowed. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user;     /**< First argument of `progress`. */
    const pbr_scalar *scalars; /**< Optional, per vertex, as in #pbr_points_desc; handed on to the points made from the mesh. */
    uint32_t scalar_count;   /**< At most #PBR_MAX_SCALARS. */
    uint32_t reserved;       /**< Must be 0. */
} pbr_mesh_desc;

#define PBR_MESH_DESC_INIT PBR_SIZED(pbr_mesh_desc)

/** What a mesh holds. Set `struct_size` before the call (#PBR_MESH_INFO_INIT). */
typedef struct pbr_mesh_info {
    size_t struct_size;
    uint64_t vertex_count;           /**< Vertices held: all that were given. */
    uint64_t triangle_count;         /**< Triangles held. */
    uint64_t dropped_triangle_count; /**< Triangles of the input that used a vertex with a non-finite coordinate. */
    uint64_t unreferenced_count;     /**< Vertices that no triangle uses. */
    uint64_t degenerate_count;       /**< Triangles kept that have no area. */
    double minimum[3];               /**< Box around the referenced vertices, object space; zeros when empty. */
    double maximum[3];               /**< Likewise. */
    int32_t has_normals;             /**< Given (1) or averaged from faces (0). */
    int32_t has_colours;             /**< 1: given. */
    uint64_t memory_bytes;           /**< Heap bytes the mesh occupies. */
} pbr_mesh_info;

#define PBR_MESH_INFO_INIT PBR_SIZED(pbr_mesh_info)

/**
 * Copies a mesh. Triangles with a vertex whose coordinates are not finite are dropped and counted.
 * @param instance  Outlives the mesh.
 * @param desc      Arrays are only read during the call.
 * @param out       Receives the mesh with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT (an index at or past `vertex_count` among others), #PBR_ERROR_LIMIT,
 *         #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_mesh_create(pbr_instance *instance, const pbr_mesh_desc *desc, pbr_mesh **out);

/**
 * Adds a reference.
 * @param mesh  NULL is allowed.
 * @return `mesh`. Any thread; no context. Since 0.1.
 */
PBR_API pbr_mesh *pbr_mesh_retain(pbr_mesh *mesh);

/**
 * Drops a reference, freeing the mesh with the last one, and sets `*mesh` to NULL.
 * @param mesh  NULL and a pointer to NULL are allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_mesh_release(pbr_mesh **mesh);

/**
 * Describes a mesh.
 * @param mesh  Is only read.
 * @param info  `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_mesh_get_info(const pbr_mesh *mesh, pbr_mesh_info *info);

/** What #pbr_mesh_copy copies where; NULL arrays are skipped. Colours that the mesh lacks must be NULL. */
typedef struct pbr_mesh_copy_desc {
    size_t struct_size;
    uint64_t first_vertex;   /**< Vertices [first_vertex, first_vertex + vertex_count). */
    uint64_t vertex_count;   /**< See `first_vertex`. */
    uint64_t first_triangle; /**< Triangles [first_triangle, first_triangle + triangle_count). */
    uint64_t triangle_count; /**< See `first_triangle`. */
    double *positions;       /**< vertex_count x 3, object space (origin added); of one that is not finite, some place that is. */
    float *normals;          /**< vertex_count x 3, unit or zero; given, or averaged from the faces. */
    uint8_t *colours;        /**< vertex_count x 4, sRGB and linear alpha. */
    uint32_t *triangles;     /**< triangle_count x 3. */
} pbr_mesh_copy_desc;

#define PBR_MESH_COPY_DESC_INIT PBR_SIZED(pbr_mesh_copy_desc)

/**
 * Copies vertices and triangles out.
 * @param mesh  Is only read.
 * @param desc  Where to; the arrays are the caller's.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT (a range outside the mesh, colours that it lacks).
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_mesh_copy(const pbr_mesh *mesh, const pbr_mesh_copy_desc *desc);

/** What #pbr_mesh_to_points needs. */
typedef struct pbr_mesh_to_points_desc {
    size_t struct_size;
    float radius_scale; /**< Factor on the radii, 0 = 1. */
    uint32_t flags;     /**< Must be 0. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user; /**< First argument of `progress`. */
} pbr_mesh_to_points_desc;

#define PBR_MESH_TO_POINTS_DESC_INIT PBR_SIZED(pbr_mesh_to_points_desc)

/**
 * One point per referenced vertex, in the order of the vertices, with the mesh's normals and colours. A vertex's radius is the
 * largest, over its triangles, of the smallest radius at which three equal discs around the corners cover the triangle: the
 * circumradius of an acute triangle; for an obtuse one with longest side AB, max(b / (2 cos A), a / (2 cos B)). Discs across vertex
 * normals do not lie in the triangle: where none of the three normals is more than 50 degrees off it, the radius grows, to first
 * order in their tilt, to what hides the triangle from all directions up to 75 degrees off its normal, but to no more than 1.3
 * times the smallest circle around the corners and to no more than thrice the mean over the triangles.
 * @param mesh  May be released afterwards; its instance outlives the points.
 * @param desc  NULL = defaults.
 * @param out   Receives the points with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_mesh_to_points(const pbr_mesh *mesh, const pbr_mesh_to_points_desc *desc, pbr_points **out);

PBR_END_DECLS
#endif
