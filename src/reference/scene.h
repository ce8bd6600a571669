/* A frame and its items, checked, with defaults filled in and everything in eye space. SPDX-License-Identifier: MIT */
#ifndef PBR_REFERENCE_SCENE_H
#define PBR_REFERENCE_SCENE_H

#include <pbr/reference.h>
#include <pbr/support.h>

#include "lens.h"

struct scene_light {
    bool is_point;
    double vector[3]; /* eye space; of a directional light unit */
    double colour[3];
};

/* One item. */
struct scene_item {
    pbr_item desc;        /* defaults filled in, but for what depends on the splat's kind */
    pbr_points_info info; /* of an item with points */
    const pbr_mesh *mesh;
    uint64_t elements;           /* points or triangles; 0 if hidden */
    uint64_t first;              /* number of its first element in the scene: they count by item, then transform, then element */
    double range[2];             /* of the colour map */
    struct normal_field *fields; /* of an item that is shaded by them, in the points' order; else NULL */
    uint32_t layer; /* items of equal numbers are blended or filled together; they count from 1 by first item; 0: just opaque */
};

/* One transform of an item. */
struct placement {
    double world[16], eye[16]; /* object to world, to eye */
    double normal[16];         /* object to eye normals, but for their length */
    double stretch;            /* the largest, object to eye */
};

struct scene {
    pbr_instance *instance;
    const char *caller; /* for messages */
    pbr_frame frame;
    pbr_reference_desc desc;
    struct lens lens;
    double view[16];
    struct scene_light lights[PBR_MAX_LIGHTS];
    uint32_t light_count;
    double ambient[3];
    struct scene_item *items;
    size_t item_count;
    uint32_t layer_count;
    bool is_filled; /* any item is */
    uint64_t count; /* elements of all items and transforms */
};

/* Checks everything. `meshes` NULL: items have points. The scene is to be closed after success only. */
pbr_result scene_open(pbr_instance *instance, const char *caller, const pbr_frame *frame, const pbr_item *items,
                      const pbr_mesh *const *meshes, size_t count, const pbr_reference_desc *desc, struct scene *scene);
void scene_close(struct scene *scene);

/* One element, and where it is; to begin with zero. */
struct walk {
    const struct scene_item *item;
    uint64_t transform, index; /* of the item's */
    struct placement placement;
};

/* Goes to an element by its number. Quick from one to another of the same transform. */
void scene_walk(const struct scene *scene, uint64_t number, struct walk *walk);

void scene_place(const struct scene *scene, const struct scene_item *item, uint64_t transform, struct placement *out);

#endif
