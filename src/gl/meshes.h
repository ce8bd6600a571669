/* GPU copies of the meshes that hierarchies stand on: vertices as splat records, and, where all triangles are drawn, these. The
 * renderer holds a reference on each hierarchy until the copy is dropped. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_MESHES_H
#define PBR_GL_MESHES_H

#include "drawable.h"
#include "lod/pop.h"

struct mesh_copy {
    pbr_lod *lod;          /* held */
    const struct pop *pop; /* its */
    struct drawable vertices;
    GLuint triangles; /* element buffer of all, in the hierarchy's order; 0: not there */
    uint64_t bytes;
    uint64_t last_frame, triangles_frame; /* serial numbers of the last frames that drew it, and all triangles of it */
};

struct meshes {
    struct mesh_copy **entries;
    size_t count, capacity;
};

/* The copy of a hierarchy's vertices, made if there is none, `with_triangles` or as it is. Else as residents_acquire. */
pbr_result meshes_acquire(pbr_renderer *renderer, const pbr_lod *lod, bool with_triangles, struct mesh_copy **out,
                          GLenum *host_error);

/* Bytes that it would send. */
uint64_t meshes_missing(const pbr_renderer *renderer, const pbr_lod *lod, bool with_triangles);

/* Lets all triangles go before the current frame is over, if it needs the room; who wants them acquires them again. */
void meshes_release_triangles(pbr_renderer *renderer, const pbr_lod *lod);

/* Marks the copy, if there is one, as used by `frame`, `with_triangles` or without. */
void meshes_touch(struct meshes *meshes, const pbr_lod *lod, bool with_triangles, uint64_t frame);

/* Drops the copy of a hierarchy's mesh, or all for NULL. */
void meshes_evict(pbr_renderer *renderer, const pbr_lod *lod);

/* What was drawn longest ago, and not by `frame`; NULL: there is none. */
struct mesh_copy *meshes_oldest(const struct meshes *meshes, uint64_t frame);

/* Of copies with triangles the one of which all were drawn longest ago, and not by `frame`; NULL: there is none. */
struct mesh_copy *meshes_oldest_triangles(const struct meshes *meshes, uint64_t frame);
void meshes_drop_triangles(pbr_renderer *renderer, struct mesh_copy *copy);

/* Names of GL objects held. */
uint64_t meshes_object_count(const struct meshes *meshes);

#endif
