/* What is drawn: the points or the hierarchies of several files, as scene_options say, around one sphere. World coordinates are the
 * files', turned so that y is up. No OpenGL. SPDX-License-Identifier: MIT */
#ifndef SCENE_H
#define SCENE_H

#include "camera.h"
#include "input.h"
#include "scene_options.h"

/* Zero at the start, but for the options. */
struct scene {
    const struct scene_options *options; /* read at every call: they may change in between */
    uint32_t input_count;                /* of each of these: */
    struct input inputs[MOST_INPUTS];
    pbr_points_info infos[MOST_INPUTS];
    pbr_item items[MOST_INPUTS];
    double (*transforms)[16]; /* of every item: one, identity or z up; with a grid one a copy */
    uint32_t transform_count;
    struct sphere sphere;  /* around all copies, world */
    double largest_radius; /* of a splat, before radius_scale */
    double measured_cost;  /* of a splat, in triangles; 0 = not measured */
};

/* Takes an input over. */
void scene_add(struct scene *scene, struct input *input);
/* Releases the last one. */
void scene_drop(struct scene *scene);
/* Index of an input's scalar attribute, or -1. */
int scene_find_scalar(const struct input *input, const char *name);
/* True if the input has the scalar attribute that the options ask for, if any. Else a message. */
bool scene_check_scalar(const struct scene_options *options, struct session *session, const struct input *input);

/* Places the copies after inputs were added. False with a message if memory is short. */
bool scene_arrange(struct scene *scene, struct session *session);

/* Makes points of the vertices of hierarchies over meshes, if the options draw these so and it was not done yet. False with a
 * message if memory is short. */
bool scene_find_vertices(struct scene *scene, struct session *session);

/* Makes the items what the options say now. Inputs without the scalar attribute that is asked for keep their own colours. */
void scene_style(struct scene *scene);

/* The first hierarchy over a mesh that is drawn as such, or NULL. */
const pbr_item *scene_mesh_item(const struct scene *scene);
/* What --point-cost auto asks for, of that one, by drawing it to the frame's target. False with a message. */
bool scene_measure_point_cost(struct scene *scene, struct session *session, pbr_renderer *renderer, const pbr_frame *frame);
/* As asked for, or measured. */
double scene_point_cost(const struct scene *scene);

/* What --view says, turned by `turn` degrees of yaw, around --centre or the sphere's. `size`: the picture, pixels. */
struct camera scene_camera(const struct scene *scene, double turn, const uint32_t size[2]);
/* A point in the files' coordinates, in the world and back. */
void scene_to_world(const struct scene_options *options, const double point[3], double world[3]);
void scene_from_world(const struct scene_options *options, const double world[3], double point[3]);
/* What the camera looks at, world. */
void scene_centre(const struct scene *scene, double centre[3]);

/* `light` receives the light if it is not libpbr's own, from the eye; it is to live as long as the frame. */
pbr_frame scene_frame(const struct scene_options *options, const struct camera *camera, pbr_light *light);

/* PBR_LOD_... of the first hierarchy that is drawn as such; LOD_NONE: there is none. */
uint32_t scene_hierarchy(const struct scene *scene);
uint64_t scene_point_count(const struct scene *scene);    /* of all copies */
uint64_t scene_triangle_count(const struct scene *scene); /* likewise, of the meshes that the points were made of */

void scene_release(struct scene *scene);

#endif
