/* What the cut of a hierarchy of balls asks of each node, as floats: whether it is outside, or faces away, with all that is below,
 * and whether GL points can draw it. Shared by the kinds that make cuts. Without GL. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_QUESTION_H
#define PBR_LOD_QUESTION_H

#include <float.h>
#include <math.h>

#include "core/kernel.h"
#include "sight.h"

/* A plane as floats, over what a node bounds: value + reach r is the largest there, or value - reach r - per_w w the least. */
struct side {
    float normal[3], offset, reach, own_reach, per_w;
};

enum { BETWEEN_MOST = 16 }; /* pixels: larger discs are not asked whether they hold a pixel's centre */

/* Relative to the hierarchy's centre. */
struct question {
    struct side outside[OUTSIDE_TESTS], wider[OUTSIDE_TESTS], inside[INSIDE_TESTS], w;
    int inside_count;
    float error;           /* of a plane's value */
    float size, threshold; /* a node is small enough if size r <= threshold w; threshold -1: none is */
    float edge;            /* likewise, where its disc may nearly be seen from the edge */
    float point_cost;      /* as in the view */
    float point;           /* GL points draw splats of r <= point w, if they are inside; of w so much is certain: */
    float w_kept, w_lost;
    float w_least; /* what is nearer counts as being there: with a guard that may be behind the eye now */
    bool culls;
    float eye[4], eye_room; /* which may move so far */
    float corner;           /* how far from a node's centre what it bounds may be, in its radii */
    struct pixels {
        bool are_known;      /* else no splat is said to lie between them */
        struct side rows[2]; /* clip x, y */
        float half[2];       /* of the viewport */
        float scale, least;  /* radius of the disc that a splat is drawn as: per its own, and at least at w = 1 */
        float w_slope;
    } pixels;
};

/* How a node of radius r bounds what is below it: the centres of splats lie in the cube around its ball; or balls and triangles, in
 * the ball. */
enum question_bound { BOUND_CUBE, BOUND_BALL };

/* radius: of a ball around the hierarchy's centre that holds all centres. */
void question_ask(const struct cut_view *view, double radius, enum question_bound bound, struct question *q);

static inline float side_value(const struct side *s, const float p[3]) {
    return s->normal[0] * p[0] + s->normal[1] * p[1] + s->normal[2] * p[2] + s->offset;
}

/* Whether a disc is seen so nearly from its edge that it may be drawn higher. */
static inline bool question_may_turn(const struct question *q, const float centre[3], const float normal[3]) {
    float squared = 0, along = 0;
    for (int k = 0; k < 3; k++) {
        const float to_eye = q->eye[k] - centre[k] * q->eye[3];
        squared += to_eye * to_eye;
        along += to_eye * normal[k];
    }
    return !(along * along > 1.01f * (float)(KERNEL_EDGE_COSINE * KERNEL_EDGE_COSINE) * squared);
}

/* Whether the disc of a splat holds no pixel's centre. axis: its normal, unit; zero: any, but it has one. x / w changes within the
 * disc, of radius R, by d.f / (w + d.w), f = x - (x / w) w of the rows of the matrix x and w, and d.f is R sqrt(f^2 - (f.n)^2) at
 * most; f is across the ray, so f.n shrinks by sqrt(1 - KERNEL_EDGE_COSINE^2) at most where the disc turns from its edge. Asked of
 * small discs only: few others hold none, and the errors of that root and of the record's normal grow with them. */
static inline bool question_is_between_pixels(const struct question *q, const float centre[3], float radius, const float *axis,
                                              float w) {
    const struct pixels *pixels = &q->pixels;
    const float own = pixels->scale * radius, least = pixels->least * w, reach = own > least ? own : least;
    if (!pixels->are_known || !(q->size * reach < BETWEEN_MOST * w)) return false;
    const float inverse = 1 / w, nearest = 1 - reach * pixels->w_slope * inverse; /* of w */
    const float kept = question_may_turn(q, centre, axis) ? 1 - (float)(KERNEL_EDGE_COSINE * KERNEL_EDGE_COSINE) : 1;
    bool is_between = false;
    for (int i = 0; i < 2; i++) {
        const float *row = pixels->rows[i].normal, half = pixels->half[i], scale = reach * half * inverse;
        const float at = side_value(&pixels->rows[i], centre) * inverse;
        float squared = 0, along = 0; /* pixels */
        for (int k = 0; k < 3; k++) {
            const float change = scale * (row[k] - at * q->w.normal[k]);
            squared += change * change;
            along += change * axis[k];
        }
        /* To the nearest pixel's centre, found without a call: no coordinate is below -1/2. */
        const float middle = (at + 1) * half - 0.5f, off = middle - ((float)(int)(middle + 1.5f) - 1);
        const float gap = (fabsf(off) - 1.0f / 64) * nearest - 2 * half * q->error * inverse;
        is_between |= (gap > 0) & (gap * gap > squared - kept * along * along);
    }
    return is_between;
}

/* Which way normals in a cone around a node's are turned, seen from what it bounds: the largest and the least n.v there, v to the
 * eye. */
struct facing {
    float most, least;
};

/* axis: unit, or zero, of which nothing is known; cosine, sine: of the cone's half angle t. The largest n.v over the cone, v at an
 * angle a to the axis, is |v| cos(a - t); within the node v changes by its radius times `corner`. */
static inline struct facing question_facing(const struct question *q, const float axis[3], float cosine, float sine,
                                            const float centre[3], float radius) {
    double along = 0, squared = 0; /* squares of small or large units leave the range of floats */
    for (int k = 0; k < 3; k++) {
        const double to_eye = (double)(q->eye[k] - centre[k] * q->eye[3]);
        along += to_eye * (double)axis[k];
        squared += to_eye * to_eye;
    }
    const bool known = axis[0] != 0 || axis[1] != 0 || axis[2] != 0;
    const float across = (float)sqrt(fmax(squared - along * along, 0)), room = known ? 1e-4f * (float)sqrt(squared) : FLT_MAX;
    const float reach = q->corner * radius * fabsf(q->eye[3]) + room + q->eye_room;
    return (struct facing){(float)along * cosine + across * sine + reach, (float)along * cosine - across * sine - reach};
}

/* The normal of a disc that stands for normals that point anywhere: it must not be seen from its edge. Where n, unit or zero, is
 * farther than 60 degrees from the direction of the eye, or of its opposite, it is turned until it is not; than 45, where the disc
 * is more than 12 pixels large, and stands for a whole limb. (Tried: 45 for all closes nothing more, and costs 1 dB at 8 pixels.)
 * Returns false, with `turned` undefined, where it need not be. */
static inline bool question_turn_to_eye(const struct question *q, const float n[3], const float centre[3], float radius,
                                        float turned[3]) {
    const float *eye = q->eye, w = side_value(&q->w, centre);
    const float least = q->size * radius > 12 * (w > q->w_least ? w : q->w_least) ? 0.70711f : 0.5f; /* cosines */
    float to_eye[3], squared = 0, along = 0, across = 0;
    for (int k = 0; k < 3; k++) {
        to_eye[k] = eye[k] - centre[k] * eye[3];
        squared += to_eye[k] * to_eye[k];
        along += to_eye[k] * n[k];
    }
    const float distance = sqrtf(squared);
    along /= distance;
    if (!(fabsf(along) < least) || (n[0] == 0 && n[1] == 0 && n[2] == 0)) return false; /* or there is no eye */
    for (int k = 0; k < 3; k++) {
        turned[k] = n[k] - along * to_eye[k] / distance;
        across += turned[k] * turned[k];
    }
    const float side = sqrtf((1 - least * least) / across), front = along < 0 ? -least : least;
    for (int k = 0; k < 3; k++) turned[k] = side * turned[k] + front * to_eye[k] / distance;
    return true;
}

#endif
