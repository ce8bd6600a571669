/* What hides: the depth of a picture that was drawn, as tiles that know their farthest pixel. Without GL.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_OCCLUDERS_H
#define PBR_LOD_OCCLUDERS_H

#include "core/instance.h"

enum { OCCLUDERS_TILE = 8 /* pixels */, OCCLUDERS_LEVELS = 16 };

/* Written once, by whom made it, then shared by threads. */
struct occluders {
    pbr_instance *instance;
    atomic_size_t references;
    uint64_t frame;                  /* serial number of the one that drew the picture */
    double jitter[2];                /* pixels that the picture is shifted */
    double view[16], projection[16]; /* of that frame; jitter excluded */
    int32_t size[2];                 /* pixels */
    double sign;                     /* -1 where less of clip z over w is farther, else 1 */
    double error;                    /* of what the depth buffer stores, in z over w */
    int32_t level_count;             /* level 0 are the tiles; each has half as many as the one before, of four times the size */
    int32_t columns[OCCLUDERS_LEVELS], rows[OCCLUDERS_LEVELS];
    float *levels[OCCLUDERS_LEVELS]; /* sign times z over w, of the farthest pixel; from the lowest row up */
    float values[];
};

/* What a cut asks of them. */
struct occlusion {
    struct occluders *by; /* NULL: nothing is hidden */
    double to_clip[16];   /* object space relative to the hierarchy's origin -> clip, as the picture was seen */
    double reach[2];      /* factors on a node's cube, across the view and along it: for what is drawn beyond */
    double parallel;      /* kinds parallel to the screen: pixels times w that a splat of radius 1 reaches; else 0 */
    double least;         /* the others: smallest radius, object units, over w */
    double pad;           /* and beyond that, pixels */
};

/* Room for a picture; the caller sets what it shows, the tiles, and calls occluders_finish. One reference. */
pbr_result occluders_create(pbr_instance *instance, int32_t width, int32_t height, struct occluders **out);
void occluders_finish(struct occluders *occluders);

/* NULL is allowed. */
struct occluders *occluders_retain(struct occluders *occluders);
void occluders_release(struct occluders **occluders);

/* Whether the cube around the sphere lies, all of it, behind what each pixel showed that it covers. False where the picture does
 * not tell. */
bool occluders_hide(const struct occlusion *occlusion, const float centre[3], double radius);

/* Whether what the one hides the other hides, too: they are of the same camera, and nothing in it is farther; of another jitter,
 * than it was within a tile. */
bool occluders_cover(const struct occluders *newer, const struct occluders *older);

bool occluders_share_camera(const struct occluders *a, const struct occluders *b);

#endif
