/* One input file, as it was read and as what is drawn of it: points, or a hierarchy. SPDX-License-Identifier: MIT */
#ifndef INPUT_H
#define INPUT_H

#include <pbr/io.h>
#include <pbr/lod.h>

#include "session.h"

/* What is wanted of a file besides what is drawn of it anyway: the points of a file of points or of a mesh, the hierarchy of a
 * hierarchy's file. */
enum {
    INPUT_SURFACE = 1u << 0, /* the mesh */
    INPUT_BUILD = 1u << 1,   /* a hierarchy, built of the points, which go, or of the mesh */
    INPUT_LEAVES = 1u << 2,  /* a hierarchy's leaves, as points beside it */
    INPUT_FIELDS = 1u << 3,  /* a sequential point tree is built with normal fields */
    INPUT_KIND_SHIFT = 8     /* PBR_LOD_...: a hierarchy is to be of this kind; 0: any, and a QSplat tree is built */
};

struct input {
    const char *path;
    uint64_t vertex_count, face_count; /* of the file */
    uint32_t format, warning_count;
    char encoding[32];
    bool is_mesh;
    const char *radii;  /* "given", "estimated" or "from faces" */
    pbr_mesh_info mesh; /* zeros for a file without triangles; of a hierarchy's file there is their number */
    pbr_lod *lod;       /* NULL: points are drawn */
    uint32_t lod_kind;  /* PBR_LOD_... */
    pbr_points *points; /* NULL where there is a hierarchy, but for its leaves */
    pbr_mesh *surface;  /* that the points were made of, if it is kept */
    /* Of the points that were read, also where they went into a hierarchy: the same view shows either. Of a hierarchy's file what
     * there is to know without reading it all: the box is its sphere's. */
    pbr_points_info info;
    double load_ms, build_ms; /* reading, and making points of a mesh; building a hierarchy */
};

/* Is it a file of a hierarchy? */
bool input_is_hierarchy(const char *path);

/* `wanted`: INPUT_... False with a message, or without one if `progress` cancelled it. `input` is to be released either way. */
bool input_load(struct session *session, const char *path, unsigned wanted, pbr_progress_fn progress, void *user,
                struct input *input);
/* The input, which owns from now on what `from` owned. */
struct input input_move(struct input *from);
void input_release(struct input *input);

#endif
