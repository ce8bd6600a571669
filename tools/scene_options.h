/* What the commands that draw take alike: files, and how their points look from where. SPDX-License-Identifier: MIT */
#ifndef SCENE_OPTIONS_H
#define SCENE_OPTIONS_H

#include "headless.h"
#include "kinds.h"
#include "options.h"
#include "session.h"

enum { MOST_INPUTS = 256, POINT_COST_AUTO = -1 /* it is to be measured */ };

struct scene_options {
    const char *inputs[MOST_INPUTS];
    uint32_t input_count;
    uint32_t size[2], samples;
    uint32_t grid[2];                                 /* rows, columns of copies */
    uint32_t splat, blending, shading, colour_source; /* PBR_... */
    const char *scalar;                               /* with PBR_COLOUR_SCALAR */
    double view[3];                                   /* yaw and pitch in degrees, zoom */
    double centre[3];                                 /* what the view turns around, in the files' coordinates; with has_centre */
    double light[2]; /* yaw and pitch of the direction to the light, degrees; both 0: from the eye */
    bool has_centre, parallel, z_up, cull, occlusion;
    bool vertices; /* hierarchies over meshes are drawn as points, the meshes' vertices */
    enum headless_kind context;
    float background[4];                                       /* sRGB, straight alpha */
    double radius_scale, size_minimum, size_maximum, low_pass; /* 0 = libpbr's default */
    uint32_t lod;                                              /* LOD_... or PBR_LOD_... */
    double point_cost;                                         /* triangles, or: */
    double threshold;                                          /* pixels, 0 = the leaves; but see scene_options_threshold */
    double time_budget;                                        /* milliseconds, 0 = none */
};

/* Indices of the shared options in a command's rules; the command's own follow from SCENE_OPTION_COUNT. */
enum {
    SCENE_SIZE,
    SCENE_VIEW,
    SCENE_CENTRE,
    SCENE_LIGHT,
    SCENE_ORTHO,
    SCENE_UP,
    SCENE_GRID,
    SCENE_SPLAT,
    SCENE_BLEND,
    SCENE_SHADE,
    SCENE_COLOUR,
    SCENE_CULL,
    SCENE_OCCLUSION,
    SCENE_LOD,
    SCENE_VERTICES,
    SCENE_THRESHOLD,
    SCENE_POINT_COST,
    SCENE_TIME_BUDGET,
    SCENE_RADIUS_SCALE,
    SCENE_MIN_SIZE,
    SCENE_MAX_SIZE,
    SCENE_LOW_PASS,
    SCENE_BACKGROUND,
    SCENE_SAMPLES,
    SCENE_GL,
    SCENE_OPTION_COUNT
};

/* For the array of a command's rules. */
#define SCENE_OPTION_RULES                                                                                                         \
    [SCENE_SIZE] = {"--size", true}, [SCENE_VIEW] = {"--view", true}, [SCENE_CENTRE] = {"--centre", true},                         \
    [SCENE_LIGHT] = {"--light", true}, [SCENE_ORTHO] = {"--ortho", false}, [SCENE_UP] = {"--up", true},                            \
    [SCENE_GRID] = {"--grid", true}, [SCENE_SPLAT] = {"--splat", true}, [SCENE_BLEND] = {"--blend", true},                         \
    [SCENE_LOD] = {"--lod", true}, [SCENE_VERTICES] = {"--vertices", false}, [SCENE_THRESHOLD] = {"--threshold", true},            \
    [SCENE_POINT_COST] = {"--point-cost", true}, [SCENE_TIME_BUDGET] = {"--time-budget", true}, [SCENE_SHADE] = {"--shade", true}, \
    [SCENE_COLOUR] = {"--colour", true}, [SCENE_CULL] = {"--cull", false}, [SCENE_OCCLUSION] = {"--occlusion", false},             \
    [SCENE_RADIUS_SCALE] = {"--radius-scale", true}, [SCENE_MIN_SIZE] = {"--min-size", true},                                      \
    [SCENE_MAX_SIZE] = {"--max-size", true}, [SCENE_LOW_PASS] = {"--low-pass", true}, [SCENE_BACKGROUND] = {"--background", true}, \
    [SCENE_SAMPLES] = {"--samples", true}, [SCENE_GL] = {"--gl", true}

/* Their lines in a command's help, but --gl's, whose default differs. */
#define SCENE_OPTIONS_USAGE                                                                                                        \
    "  --size WxH            pixels; 1280x720\n"                                                                                   \
    "  --view YAW,PITCH,ZOOM degrees around the bounding sphere, and zoom 1 = it just fits; 30,20,1. Vertical field of view 50\n"  \
    "                        degrees\n"                                                                                            \
    "  --centre X,Y,Z        the point that is looked at, in the files' coordinates; the bounding sphere's centre\n"               \
    "  --light YAW,PITCH     where the light comes from, degrees to the right of the eye and above it; 0,0\n"                      \
    "  --ortho               parallel projection of the same height at the centre\n"                                               \
    "  --up y|z              which axis of the files points up; y\n"                                                               \
    "  --grid RxC            R rows and C columns of copies, side by side as seen by --view 0,0; 1x1. The view is around all\n"    \
    "                        of them\n"                                                                                            \
    "  --splat KIND          shape on the screen, one of" SPLAT_WORDS "; circle\n"                                                 \
    "  --blend HOW           how splats become a surface, one of" BLENDING_WORDS "; kind. fill: each pixel is the mean of the\n"   \
    "                        centres of circles, squares or ellipses around it\n"                                                  \
    "  --shade KIND          lighting where there are normals, one of" SHADING_WORDS "; phong\n"                                   \
    "  --colour SOURCE       one of" COLOUR_WORDS ", or scalar:NAME through a colour map; points\n"                                \
    "  --cull                drop splats and triangles that face away\n"                                                           \
    "  --occlusion           of hierarchies: what the last pictures hid is drawn coarsely\n"                                       \
    "  --lod HOW             levels of detail, one of" LOD_WORDS "; auto. none: all is drawn whole; auto: those that files\n"      \
    "                        have, .pbr and .qs; qsplat, spt, pop: hierarchies are built first, of points, or for pop of meshes\n" \
    "  --vertices            of hierarchies of kind pop: draw the mesh's vertices as points\n"                                     \
    "  --threshold PX        of hierarchies: splats that are no larger on the screen stand for all the finer ones below; 1. 0:\n"  \
    "                        the finest are drawn\n"                                                                               \
    "  --point-cost N        of hierarchies of triangles: what a splat costs, in triangles; nodes with fewer are drawn as these; " \
    "1\n"                                                                                                                          \
    "  --time-budget MS      a larger threshold is chosen while something moves, so that a frame takes no longer; 0: never.\n"     \
    "                        0; of pbr view 33\n"                                                                                  \
    "  --radius-scale F      factor on every radius\n"                                                                             \
    "  --min-size PX         smallest diameter on screen; 1 for circles and squares\n"                                             \
    "  --max-size PX         largest diameter on screen; no limit\n"                                                               \
    "  --low-pass V          ewa and ewa-max: variance of the low-pass filter, square pixels; 1\n"                                 \
    "  --background R,G,B[,A] sRGB, 0..1; 0.1,0.1,0.12\n"                                                                          \
    "  --samples N           multisampling; 1\n"

/* The defaults. */
struct scene_options scene_options_default(enum headless_kind context);

/* Walks on to the command's own next option, taking files and shared options on the way. OPTION_END at the end; OPTION_BAD with a
 * message that begins with the command's name. The strings are those of `argv`. */
int scene_options_next(struct session *session, const char *command, struct option_scan *scan, const struct option_rule *rules,
                       struct scene_options *options);

/* After the last option: a usage error with a message (false) if there is no file, or options contradict each other. */
bool scene_options_check(struct session *session, const char *command, const struct scene_options *options);

/* INPUT_... that the files are loaded with. */
unsigned scene_options_wanted(const struct scene_options *options);

/* With which hierarchies are drawn, pixels: 0, the leaves, if all is drawn whole. */
double scene_options_threshold(const struct scene_options *options);

/* PBR_BLEND_... with which the kind of splat is drawn: those that are blended already are never filled. */
uint32_t scene_options_blending(const struct scene_options *options);

#endif
