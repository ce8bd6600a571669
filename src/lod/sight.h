/* What a view sees of object space: planes that tell what may touch the picture, and what GL points cannot draw. Without GL.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_SIGHT_H
#define PBR_LOD_SIGHT_H

#include <stdbool.h>

/* How far a view may move away from the one that a cut was made for, and still find all it sees in it. Zero: not at all. */
struct cut_guard {
    double turn;      /* eye space turns by so many radians, */
    double move;      /* and then moves by so many of its units */
    double eye;       /* object units that the eye moves; of a parallel projection: change of its direction */
    double jitter[2]; /* pixels that the picture is shifted */
};

/* What decides a cut. */
struct cut_view {
    double to_clip[16];                /* object space relative to the points' origin -> clip, jitter included */
    double size_per_radius;            /* diameter in pixels of a splat of radius 1 at w = 1 */
    double size_minimum, size_maximum; /* diameters, pixels */
    double point_limit;                /* largest diameter of a GL point */
    double viewport[2];                /* pixels */
    bool zero_to_one;                  /* clip depth 0..w */
    bool culls;                        /* back faces are dropped: those of normals n at p with n.(eye - p) < 0 */
    double eye[4]; /* object space relative to the points' origin, homogeneous; w = 0: the direction to it. All 0:
                      not known. Without culls of hierarchies only */
    /* Splats that are discs in space, not parallel to the screen: */
    bool discs;
    double projection[16];   /* eye -> clip, jitter included */
    double reach_per_radius; /* eye units that a splat of radius 1 reaches from its centre at most */
    double spread;           /* pixels that a splat reaches beyond its disc on each side; points draw those between near and far */
    double largest_spread;   /* of log w over a disc, its square: points draw those below */
    /* Hierarchies: */
    double
        node_size_per_radius; /* diameter in pixels of a node of radius 1 at w = 1: as size_per_radius, without the item's scale */
    double threshold;         /* pixels: nodes that are no larger are drawn as one splat; 0 = the leaves */
    double edge;              /* pixels: nor are QSplat's inner nodes larger that are seen nearly from the edge; 0: they may be */
    double point_cost;        /* of those over meshes: nodes under which fewer triangles are drawn as these */
    double to_eye[16];        /* object space relative to the points' origin -> eye */
    struct cut_guard guard;
};

enum { OUTSIDE_TESTS = 7, INSIDE_TESTS = 6 };

/* value(p) = normal . p + offset, affine in object space. */
struct affine {
    double normal[3], offset, slope; /* slope = |normal| */
};

struct sight {
    /* A block is outside if one of these, and the same with `wider`, is below 0 in all of its sphere, with room for the splats. */
    struct affine outside[OUTSIDE_TESTS], wider[OUTSIDE_TESTS];
    double per_radius[OUTSIDE_TESTS]; /* added per unit of splat radius */
    /* Every splat is drawn by a point if all of these are above 0 in all of its sphere: the sides, and for splats that spread near
     * and far. */
    struct affine inside[INSIDE_TESTS];
    double inside_per_radius[INSIDE_TESTS], inside_per_w[INSIDE_TESTS];
    int inside_count;
    struct affine rows[4]; /* x, y, z, w */
    double size_slope;     /* discs: pixels x w of a diameter per eye unit, at most, within the view */
    double w_slope;        /* discs: w per eye unit */
    double radius_per_w;   /* discs: smallest radius, eye units, at w = 1 */
    double w_kept, w_lost; /* with a guard: of a w no less is left than w_kept w - w_lost */
};

/* Plain arithmetic; any matrices. */
void sight_prepare(const struct cut_view *view, struct sight *sight);

/* Whether a cut made for one view holds all that another sees, by the former's guard; whatever their thresholds. `radius`: of a
 * sphere around the origin, object space, in whose cube all splats' centres lie. */
bool cut_view_covers(const struct cut_view *made, const struct cut_view *now, double radius);

/* Gives `now`, which must have none but for jitter, a guard for so many more frames of the motion that led to it from the last view:
 * fewer where they would make the picture much larger, none if there is no motion or it is too fast for that. `nearness`: the mean
 * of 1 / w of what is drawn. Returns how many. */
double cut_view_foresee(const struct cut_view *last, double radius, double nearness, int frames, struct cut_view *now);

#endif
