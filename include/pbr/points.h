/* SPDX-License-Identifier: MIT */
/** @file points.h
 * Point sets: surfels with position, and optionally normal, colour, radius and scalars. Immutable and reference counted;
 * any number of renderers and threads may use one at once.
 */
#ifndef PBR_POINTS_H
#define PBR_POINTS_H

#include <pbr/instance.h>

PBR_BEGIN_DECLS

/** An immutable point set, reference counted. */
typedef struct pbr_points pbr_points;

/** Most scalar attributes of a point set. */
#define PBR_MAX_SCALARS 32
/** Most points of one set. Larger surfaces are for hierarchies. */
#define PBR_MAX_POINTS UINT64_C(4294967294)

/** A named number per point: intensity, confidence, class, time. */
typedef struct pbr_scalar {
    const char *name;     /**< UTF-8, at most 63 bytes are kept; not kept by reference. */
    pbr_attribute values; /**< One component of any format, taken as a number (not normalised). */
} pbr_scalar;

/** Flags of #pbr_points_desc. */
enum {
    /** Without `radii`: estimate them from the spacing of each point's nearest neighbours (see `radius_neighbours`). */
    PBR_POINTS_ESTIMATE_RADII = 1u << 0
};

/** What #pbr_points_create needs. All attribute arrays have `count` elements. */
typedef struct pbr_points_desc {
    size_t struct_size;
    uint64_t count;          /**< 0 is allowed. At most #PBR_MAX_POINTS. */
    pbr_attribute positions; /**< 3 components, FLOAT32 or FLOAT64, object units. Required unless `count` is 0. */
    double origin[3];        /**< Added to every position, in double: a point's object position is `origin + positions[i]`. */
    /** 3 components: FLOAT32, FLOAT64, or INT8, INT16 (signed normalised). Need not be unit length; a zero or non-finite normal
     * means "no direction": that point is drawn unlit and never culled as back-facing. */
    pbr_attribute normals;
    /** 3 or 4 components: UINT8, UINT16 (sRGB, normalised), FLOAT32 or FLOAT64 (linear). Stored as 8-bit sRGB, linear
     * 8-bit alpha; values outside 0..1 are clamped. */
    pbr_attribute colours;
    /** 1 component, FLOAT32 or FLOAT64, object units. Negative or non-finite radii count as 0 (drawn at the minimum size). */
    pbr_attribute radii;
    const pbr_scalar *scalars; /**< `scalar_count` of them; this array's layout is final. */
    uint32_t scalar_count;     /**< At most #PBR_MAX_SCALARS. */
    uint32_t flags;            /**< PBR_POINTS_... */
    float radius;              /**< Radius of every point when `radii` is absent and nothing is estimated; object units. */
    uint32_t radius_neighbours; /**< For the estimate: how many nearest neighbours, 0 = 8, at most 32. */
    float radius_scale;        /**< For the estimate: factor on the result, 0 = 1. */
    uint32_t reserved;         /**< Must be 0. */
    pbr_progress_fn progress;  /**< May be NULL. */
    void *progress_user;       /**< First argument of `progress`. */
} pbr_points_desc;

#define PBR_POINTS_DESC_INIT PBR_SIZED(pbr_points_desc)

/** What a point set holds. Set `struct_size` before the call (#PBR_POINTS_INFO_INIT). */
typedef struct pbr_points_info {
    size_t struct_size;
    uint64_t count;         /**< Points held. */
    uint64_t dropped_count; /**< Points of the input that had a non-finite coordinate and were dropped. */
    double origin[3];       /**< Positions are held relative to this. */
    double minimum[3];      /**< Box around the positions (radii excluded), object space; zeros when empty. */
    double maximum[3];      /**< Likewise. */
    double centre[3];       /**< Bounding sphere of the positions: the box's centre ... */
    double bounding_radius; /**< ... and the distance of the farthest position from it. */
    float radius_minimum;   /**< Over the points' radii; zeros when empty. */
    float radius_mean;      /**< Likewise. */
    float radius_maximum;   /**< Likewise. */
    int32_t has_normals;    /**< 1: there are normals. */
    int32_t has_colours;    /**< 1: there are colours. */
    int32_t has_radii;      /**< 1: there are radii, given, constant or estimated. */
    uint32_t scalar_count;  /**< Scalar attributes. */
    uint64_t memory_bytes;  /**< Heap bytes the set occupies. */
} pbr_points_info;

#define PBR_POINTS_INFO_INIT PBR_SIZED(pbr_points_info)

/**
 * Copies attributes into a point set. The order of the points is kept; points with a non-finite coordinate are dropped and
 * counted.
 * @param instance  Outlives the set.
 * @param desc      Arrays are only read during the call.
 * @param out       Receives the set with one reference, or NULL on error.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_LIMIT, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED.
 * Coordinates beyond a float's range (3.4e38) count as non-finite. A stride shorter than its element is refused.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_points_create(pbr_instance *instance, const pbr_points_desc *desc, pbr_points **out);

/**
 * Adds a reference.
 * @param points  NULL is allowed.
 * @return `points`. Any thread; no context. Since 0.1.
 */
PBR_API pbr_points *pbr_points_retain(pbr_points *points);

/**
 * Drops a reference, freeing the set with the last one, and sets `*points` to NULL. A renderer that drew the set holds a reference
 * of its own until it evicts it.
 * @param points  NULL and a pointer to NULL are allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_points_release(pbr_points **points);

/**
 * Describes a set.
 * @param points  Is only read.
 * @param info    `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_points_get_info(const pbr_points *points, pbr_points_info *info);

/**
 * Name of a scalar attribute.
 * @param points  Is only read. NULL is allowed.
 * @param index   Counts from 0.
 * @return UTF-8, valid as long as the set; NULL if `index` is out of range. Any thread; no context. Since 0.1.
 */
PBR_API const char *pbr_points_scalar_name(const pbr_points *points, uint32_t index);

/** Where #pbr_points_copy writes; NULL members are skipped. An attribute that the set lacks must be NULL. */
typedef struct pbr_points_copy_desc {
    size_t struct_size;
    double *positions;  /**< count x 3, object space (origin added). */
    float *normals;     /**< count x 3, unit or zero. */
    uint8_t *colours;   /**< count x 4, sRGB and linear alpha. */
    float *radii;       /**< count, object units. */
    float *scalar;      /**< count, of attribute `scalar_index`. */
    uint32_t scalar_index; /**< Counts from 0. */
    uint32_t reserved;  /**< Must be 0. */
} pbr_points_copy_desc;

#define PBR_POINTS_COPY_DESC_INIT PBR_SIZED(pbr_points_copy_desc)

/**
 * Copies points [first, first + count) out.
 * @param points  Is only read.
 * @param first   Counts from 0.
 * @param count   Points.
 * @param desc    Where to; the arrays are the caller's.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT (a range outside the set, an attribute that it lacks).
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_points_copy(const pbr_points *points, uint64_t first, uint64_t count, const pbr_points_copy_desc *desc);

PBR_END_DECLS
#endif
