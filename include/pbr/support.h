/* SPDX-License-Identifier: MIT */
/** @file support.h
 * What a library built on libpbr needs from an instance (libpbr-io is one): its memory, log and threads; and what it shares of the work. The instance is required
 * everywhere.
 */
#ifndef PBR_SUPPORT_H
#define PBR_SUPPORT_H

#include <pbr/points.h>

PBR_BEGIN_DECLS

/**
 * Allocates `count` elements of `size` bytes, zeroed, aligned for any type and at least 16 bytes.
 * @param instance  Whose allocator is asked.
 * @param count     Elements.
 * @param size      Bytes of each.
 * @return NULL if `count * size` overflows or the allocator has none; the failure is logged. A pointer to free if the product is 0.
 * Any thread; no context. Since 0.1.
 */
PBR_API void *pbr_allocate(pbr_instance *instance, size_t count, size_t size);

/**
 * The same memory resized to `count` elements, old content kept, new content zeroed; may move.
 * @param instance   The one that `memory` is from.
 * @param memory     From #pbr_allocate, or NULL.
 * @param old_count  Elements it has now.
 * @param count      Elements it is to have.
 * @param size       Bytes of each.
 * @return NULL as #pbr_allocate, and then `memory` is unchanged. Any thread; no context. Since 0.1.
 */
PBR_API void *pbr_reallocate(pbr_instance *instance, void *memory, size_t old_count, size_t count, size_t size);

/**
 * Frees what #pbr_allocate returned.
 * @param instance  The one that `memory` is from.
 * @param memory    NULL is allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_free(pbr_instance *instance, void *memory);

/**
 * Sends one formatted line (cut at 511 bytes, control characters replaced) to the instance's log callback.
 * @param instance  Whose callback; without one nothing happens.
 * @param level     PBR_LOG_...
 * @param code      The result that the message explains, or #PBR_OK.
 * @param format    As printf's, with the arguments after it; in the locale of the host.
 * @return `code`, so that an error can be logged and returned in one statement. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_log(pbr_instance *instance, int32_t level, pbr_result code, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 4, 5)))
#endif
    ;

/**
 * How many threads a call may use.
 * @param instance  Is only read.
 * @return At least 1: the caller's is included. Any thread; no context. Since 0.1.
 */
PBR_API uint32_t pbr_instance_threads(const pbr_instance *instance);

/**
 * Works on the items [begin, end). May be called on several threads at once.
 * @param user   The pointer given to #pbr_parallel.
 * @param begin  First item.
 * @param end    One past the last.
 * @return An error ends the whole loop early.
 */
typedef pbr_result (*pbr_range_fn)(void *user, size_t begin, size_t end);

/**
 * Calls `work` over [0, count) in pieces of at most `grain` items, on the instance's threads; returns when all is done.
 * Where threads cannot be started it goes on with fewer. Pieces are handed out in order.
 * @param instance  Whose number of threads, 64 at most.
 * @param count     Items.
 * @param grain     Items of a piece; 0 = 1.
 * @param work      Called until all is done or it fails.
 * @param user      First argument of `work`.
 * @return The first error of `work`, or #PBR_OK. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_parallel(pbr_instance *instance, size_t count, size_t grain, pbr_range_fn work, void *user);

/**
 * Fits to each point the linear field of normals that #PBR_SHADE_PHONG_FIELD draws it with (Botsch, Spernat, Kobbelt 2004): four numbers,
 * in units of 1/16384, along tangents that follow from the normal.
 * @param points         Points without normals or radii get zeros.
 * @param progress       May be NULL; returning 0 cancels.
 * @param progress_user  First argument of `progress`.
 * @param fields         Receives 4 numbers for each point, in the points' order.
 * @return #PBR_OK, #PBR_ERROR_CANCELLED, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_points_fit_fields(const pbr_points *points, pbr_progress_fn progress, void *progress_user, int16_t *fields);

PBR_END_DECLS
#endif
