/* Which chunks of a sequential point tree a view needs, and how much of each. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_SPT_CUT_H
#define PBR_LOD_SPT_CUT_H

#include "draw_list.h"
#include "sight.h"
#include "spt.h"

enum { SPT_SIZES = 33, SPT_HEADS = 8 };

/* What a chunk's bounds do not tell, since they hold all splats of all levels, nor its table, which counts by SPT_STEP. */
struct spt_sizes {
    float reach;                      /* of entries' centres, from the chunk's; 0: all of this is not known */
    float largest[SPT_SIZES];         /* radius of entries with errors up to a bound: line i, of codes below 2^(i / 2) */
    struct spt_step heads[SPT_HEADS]; /* from entry 2^i on: the largest errors of parents, and distances */
};
void spt_measure_sizes(const struct spt_chunk *chunk, const struct spt_entry *entries, struct spt_sizes *out);

/* As spt_range, with what the sizes tell besides. */
void spt_cut_range(const struct spt_chunk *chunk, const struct spt_step *steps, const struct spt_sizes *sizes, double s,
                   double z_near, double z_far, uint32_t *first, uint32_t *end);

/* What spt_is_drawn asks of a view: z = w times `depth_per_w`. */
struct spt_scale {
    double depth_per_w;
    double s; /* infinite: the leaves */
};
struct spt_scale spt_scale_of(const struct cut_view *view, double radius);

/* Appends a range for each chunk that may touch the view: what the vertex stage is to ask about. Conservative, as cloud_cut is.
 * `sizes`: of each chunk; all zeros where they are not known. */
pbr_result spt_list(pbr_instance *instance, const struct spt *spt, const struct spt_sizes *sizes, const struct cut_view *view,
                    struct draw_list *list);

#endif
