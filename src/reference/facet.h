/* One triangle on the screen: which pixels it may touch, and where a pixel's ray meets it. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_FACET_H
#define PBR_REFERENCE_FACET_H

#include "scene.h"

/* A mesh's arrays. */
struct model {
    double (*positions)[3];
    float (*normals)[3];
    uint8_t (*colours)[4]; /* NULL if it has none */
    uint32_t (*triangles)[3];
};

/* By corner k. In the plane of the triangle, its points are the sums of corners weighted by coordinates that sum to 1. */
struct facet {
    const struct scene_item *item;
    const uint32_t *corners;                /* vertices */
    double points[3][3];                    /* eye space */
    double w[3], near[3], far[3], along[3]; /* of the lens's rows (along: its axis) */
    double planes[PBR_MAX_CLIP_PLANES][3];  /* of the item's clip planes */
    double edges[3][3];     /* edge[0] x + edge[1] y + edge[2]: proportional to the corner's coordinate at the pixel (x, y) */
    double low[2], high[2]; /* pixels; may be infinite */
    int32_t box[4];
};

/* Where a ray meets it. */
struct meeting {
    double coordinates[3], distance;
};

/* False if it touches no pixel. */
bool facet_place(const struct scene *scene, const struct walk *at, const struct model *model, struct facet *out);

/* At a point of the window. A point on an edge is in one of the triangles on both sides, a point on a corner in one of those
 * around. */
bool facet_meet(const struct facet *facet, double x, double y, struct meeting *out);

#endif
