/* Triangles in homogeneous coordinates (Olano & Greer 1997): nothing is clipped, whatever is behind the eye.
 * SPDX-License-Identifier: MIT */
#include "facet.h"

static bool is_before(const double a[3], const double b[3]) {
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k]) return a[k] < b[k];
    return false;
}

/* The line through two corners (x, y, w). Of the same two in the other order it is the same, to the bit, but for its sign: a
 * compiler may fuse a product with the sum, which would break that if the order were the caller's. */
static void find_edge(const double a[3], const double b[3], double out[3]) {
    const bool ordered = is_before(a, b);
    vec_cross(ordered ? a : b, ordered ? b : a, out);
    for (int k = 0; k < 3 && !ordered; k++) out[k] = -out[k];
}

static double largest(const double values[3]) {
    return fmax(values[0], fmax(values[1], values[2]));
}

/* Bounds of the corners' pixels, if all are in front of the eye. */
static bool find_box(const struct lens *lens, double corners[3][3], struct facet *out) {
    const bool in_front = out->w[0] > 0 && out->w[1] > 0 && out->w[2] > 0;
    for (int k = 0; k < 2; k++) {
        double below[3], above[3];
        out->low[k] = in_front ? INFINITY : -INFINITY;
        out->high[k] = -out->low[k];
        for (int i = 0; i < 3; i++) {
            below[i] = corners[i][k] - lens->box[k] * corners[i][2];
            above[i] = lens->box[2 + k] * corners[i][2] - corners[i][k];
            if (!in_front) continue;
            out->low[k] = fmin(out->low[k], corners[i][k] / corners[i][2]);
            out->high[k] = fmax(out->high[k], corners[i][k] / corners[i][2]);
        }
        if (largest(below) < 0 || largest(above) < 0) return false;
    }
    /* Samples lie up to half a pixel beside the pixel's centre. */
    const double low[2] = {out->low[0] - 0.5, out->low[1] - 0.5}, high[2] = {out->high[0] + 0.5, out->high[1] + 0.5};
    return lens_pixels(lens, low, high, out->box);
}

bool facet_place(const struct scene *scene, const struct walk *at, const struct model *model, struct facet *out) {
    const struct scene_item *item = at->item;
    const struct lens *lens = &scene->lens;
    double corners[3][3];
    out->item = item;
    out->corners = model->triangles[at->index];
    for (int i = 0; i < 3; i++) {
        const double *position = model->positions[out->corners[i]];
        double *eye = out->points[i], world[3];
        mat_point(at->placement.eye, position, eye);
        mat_point(at->placement.world, position, world);
        corners[i][0] = row_point(lens->x, eye);
        corners[i][1] = row_point(lens->y, eye);
        corners[i][2] = out->w[i] = row_point(lens->w, eye);
        out->near[i] = row_point(lens->near, eye);
        out->far[i] = row_point(lens->far, eye);
        out->along[i] = row_point(lens->axis, eye);
        for (uint32_t p = 0; p < item->desc.clip_plane_count; p++)
            out->planes[p][i] = row_point(item->desc.clip_planes + (size_t)4 * p, world);
    }
    if (!(largest(out->w) > 0) || largest(out->near) < 0 || largest(out->far) < 0) return false;
    for (int i = 0; i < 3; i++) find_edge(corners[(i + 1) % 3], corners[(i + 2) % 3], out->edges[i]);
    return find_box(lens, corners, out);
}

/* On the edge itself it is the sign that it has a little above, or if it is vertical a little to the right. */
static bool is_positive(const double edge[3], double value) {
    if (value != 0) return value > 0;
    return edge[1] != 0 ? edge[1] > 0 : edge[0] > 0;
}

bool facet_meet(const struct facet *facet, double x, double y, struct meeting *out) {
    double values[3], sum = 0;
    int positive = 0;
    for (int i = 0; i < 3; i++) {
        const double *edge = facet->edges[i];
        values[i] = edge[0] * x + edge[1] * y + edge[2];
        positive += is_positive(edge, values[i]);
        sum += values[i];
    }
    if ((positive != 0 && positive != 3) || sum == 0) return false;
    for (int i = 0; i < 3; i++) out->coordinates[i] = values[i] / sum;
    out->distance = vec_dot(facet->along, out->coordinates);
    for (uint32_t p = 0; p < facet->item->desc.clip_plane_count; p++)
        if (!(vec_dot(facet->planes[p], out->coordinates) >= 0)) return false;
    return vec_dot(facet->w, out->coordinates) > 0 && vec_dot(facet->near, out->coordinates) >= 0 &&
           vec_dot(facet->far, out->coordinates) >= 0;
}
