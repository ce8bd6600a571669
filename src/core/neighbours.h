/* k nearest neighbours by a k-d tree (Friedman, Bentley, Finkel 1977). SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_NEIGHBOURS_H
#define PBR_CORE_NEIGHBOURS_H

#include "points.h"

enum { NEIGHBOURS_MOST = 32 };

struct kd_tree;

/* Builds a tree over the points' positions; it refers to `points`, which must outlive it. O(n log n), parallel. */
pbr_result kd_tree_create(const pbr_points *points, const struct progress *progress, struct kd_tree **out);
void kd_tree_destroy(const pbr_points *points, struct kd_tree *tree);

/* The k nearest points to `position` (relative to the points' origin), nearest first; `skip` (UINT64_MAX: none) is left out.
 * Of several as far as the k-th, any may be among them. Returns how many were found: less than k only if there are not so many.
 * squared_distances and indices hold k. */
uint32_t kd_tree_nearest(const struct kd_tree *tree, const double position[3], uint32_t k, uint64_t skip, double *squared_distances,
                         uint64_t *indices);

/* Calls back for every point with its k nearest neighbours, in the tree's own order (good for the cache), on several threads. */
typedef void (*neighbours_fn)(void *user, uint64_t point, uint32_t found, const double *squared_distances, const uint64_t *indices);
pbr_result kd_tree_for_each(const struct kd_tree *tree, uint32_t k, const struct progress *progress, neighbours_fn visit,
                            void *user);

#endif
