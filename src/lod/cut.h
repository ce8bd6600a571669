/* The cut of a hierarchy: the nodes that a view is to draw, as splat records. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_CUT_H
#define PBR_LOD_CUT_H

#include <pbr/lod.h>

#include "core/instance.h"
#include "core/splat.h"
#include "occluders.h"
#include "sight.h"

/* Zero at the start; kept from frame to frame, so that a steady state allocates nothing. One thread at a time. */
struct cut {
    size_t count;       /* of splats */
    size_t points_only; /* GL points can draw the first so many for certain; of the rest, in the sense of draw_range.quads, not */
    size_t between;     /* the last of these: no pixel's centre is in their discs, if the view is the very one that was asked for
                           and has no jitter */
    uint64_t visited;   /* nodes looked at */
    uint64_t culled;    /* of them: outside the view, or facing away, with all that is below */
    uint64_t hidden;    /* of them: larger than the threshold, but hidden, and drawn all the same */
    double nearness;    /* mean of 1 / w of the splats' centres before the eye; w as in the view */
    uint64_t damaged;   /* groups of siblings outside the file: left out with all that is below */
    size_t triangle_count; /* of hierarchies over meshes: leaves that are drawn as triangles */
    /* Records as they were found, not yet in order: */
    struct cut_part *parts;
    size_t part_count, part_capacity;
    struct splat *blocks;
    uint32_t *next_blocks, block_count;
    /* Of POP hierarchies, which start from the last cut: */
    struct pop_cut *front;
};

/* Where the records, and the view's to_clip and eye, are relative to; object space. */
const double *lod_origin(const pbr_lod *lod);
/* Leaves. */
uint64_t lod_point_count(const pbr_lod *lod);
/* Of a sphere around all splats, whose centre is the origin. */
double lod_radius(const pbr_lod *lod);
bool lod_has_colours(const pbr_lod *lod);
bool lod_has_fields(const pbr_lod *lod);

/* Whether lod_cut() is for it. */
bool lod_can_be_cut(const pbr_lod *lod);

/* Triangles that cuts may draw: 0 of hierarchies that do not stand on meshes. */
uint64_t lod_triangle_count(const pbr_lod *lod);

/* Replaces the cut by that of the view, in an order that depends on nothing else. With a guard it holds what all views see that may
 * come of it, and of points_only GL points can draw all in each. Works on the instance's threads. Conservative as
 * cloud_cut: a splat that covers a pixel is never left out, except below damaged nodes. With view->culls leaves that face away are
 * left out, exactly but for rounding, and nodes whose leaves all do. The vertex stage is not to ask again: an inner node's mean
 * normal may face away while a part of it does not. `occlusion`: what hides, or NULL:
 * inner nodes that are hidden are drawn as one splat each, however large. `cancel`: ends it early with PBR_ERROR_CANCELLED, and the
 * cut empty; may be NULL. */
pbr_result lod_cut(const pbr_lod *lod, const struct cut_view *view, const struct occlusion *occlusion, const atomic_bool *cancel,
                   struct cut *cut);

/* Of a QSplat tree: writes the cut's records, in order: `count` of them, relative to lod_origin(). On the instance's threads where
 * there are many. */
void cut_gather(pbr_instance *instance, const struct cut *cut, struct splat *out);

/* As cut_gather, of any kind; and the corners of the cut's triangles, as indices of vertices: `triangle_count` of them. */
void lod_gather(const pbr_lod *lod, const struct cut *cut, struct splat *records, uint32_t (*triangles)[3]);

void cut_free(pbr_instance *instance, struct cut *cut);

#endif
