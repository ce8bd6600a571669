/* The instance's inside, and how children keep it alive. SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_INSTANCE_H
#define PBR_CORE_INSTANCE_H

#include <pbr/support.h>
#include <stdatomic.h>
#include <stdbool.h>

struct pbr_instance {
    pbr_instance_desc desc;
    atomic_size_t children; /* points, meshes, renderers alive */
};

static inline void instance_add_child(pbr_instance *instance) {
    atomic_fetch_add(&instance->children, 1);
}
static inline void instance_drop_child(pbr_instance *instance) {
    atomic_fetch_sub(&instance->children, 1);
}

/* As pbr_allocate, but not zeroed: for large arrays that are written before they are read. Zeroing memory that the process has had
 * before is a pass of its own, on one thread. */
void *allocate_unset(pbr_instance *instance, size_t count, size_t size);

/* Copies a caller's sized structure into `out`, this version's structure of `size` bytes: missing members become 0. `minimum` is
 * the size of the structure's first released version. NULL `in` gives all defaults. Errors are logged under `name`. */
pbr_result read_desc(pbr_instance *instance, const char *name, const void *in, size_t minimum, void *out, size_t size);

/* Copies this version's output structure of `size` bytes (struct_size first) into the caller's, as much as it holds. Errors are
 * logged under `name`. */
pbr_result write_info(pbr_instance *instance, const char *name, const void *info, size_t size, void *out, size_t minimum);

/* Progress and cancellation of long work. */
struct progress {
    pbr_progress_fn report; /* may be NULL */
    void *user;
};

/* PBR_OK, or PBR_ERROR_CANCELLED when the host asked to stop. */
static inline pbr_result progress_report(const struct progress *progress, const char *stage, double fraction) {
    if (!progress || !progress->report) return PBR_OK;
    return progress->report(progress->user, stage, fraction) ? PBR_OK : PBR_ERROR_CANCELLED;
}

/* The same between a stage's beginning and its end, a few dozen times at most. *told: the fraction told last, 0 at first. */
static inline pbr_result progress_report_some(const struct progress *progress, const char *stage, double fraction, double *told) {
    enum { REPORTS = 32 };
    if (fraction - *told < 1.0 / REPORTS) return PBR_OK;
    *told = fraction;
    return progress_report(progress, stage, fraction);
}

/* As pbr_parallel. The calling thread, on which alone the host is told, reports 0 and 1, and between the pieces that come to it, a
 * few dozen times at most: the host can cancel there. */
pbr_result parallel_reporting(pbr_instance *instance, size_t count, size_t grain, pbr_range_fn work, void *user,
                              const struct progress *progress, const char *stage);

#endif
