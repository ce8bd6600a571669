/* docs/splats.md: layers. SPDX-License-Identifier: MIT */
#include "layers.h"

#include "shade.h"
#include "sort.h"

static uint32_t layer_of(const struct fragment *fragment) {
    return fragment->surfel->item->layer;
}

static double moved_back(const struct lens *lens, const struct fragment *fragment) {
    const double set_back = fragment->surfel->set_back;
    return lens->is_parallel ? fragment->distance + set_back : fragment->distance * (1 + set_back);
}

/* By layer, then nearest first; of equal ones the first item's, transform's, point's. */
static int compare(const void *a, const void *b) {
    const struct fragment *p = a, *q = b;
    if (layer_of(p) != layer_of(q)) return layer_of(p) < layer_of(q) ? -1 : 1;
    if (p->distance != q->distance) return p->distance < q->distance ? -1 : 1;
    return (p->surfel->number > q->surfel->number) - (p->surfel->number < q->surfel->number);
}

/* ---- one layer, its fragments sorted ---- */

/* Among those that cover the pixel, the nearest once moved back; NULL if there is none. */
static const struct fragment *find_front(const struct lens *lens, const struct fragment *fragments, size_t count) {
    const struct fragment *front = NULL;
    for (size_t i = 0; i < count; i++) {
        if (!fragments[i].covers) continue;
        if (!front || moved_back(lens, &fragments[i]) < moved_back(lens, front)) front = &fragments[i];
    }
    return front;
}

static size_t count_visible(const struct fragment *fragments, size_t count, double farthest) {
    size_t visible = 0;
    while (visible < count && fragments[visible].distance <= farthest) visible++;
    return visible;
}

/* Unit, or 0. Beyond the rim, where only the low-pass reaches, it goes back to the centre's. */
static void find_normal(const struct fragment *fragment, double out[3]) {
    const struct surfel *surfel = fragment->surfel;
    const double beyond = fmax(1, fragment->u * fragment->u + fragment->v * fragment->v);
    for (int k = 0; k < 3; k++)
        out[k] = surfel->normal[k] + (fragment->u * surfel->turn_u[k] + fragment->v * surfel->turn_v[k]) / beyond;
    vec_normalise(out);
}

/* False if nothing has a weight. */
static bool blend(const struct fragment *visible, size_t count, double colour[3], double normal[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++) colour[k] = normal[k] = 0;
    for (size_t i = 0; i < count; i++) {
        double own[3];
        find_normal(&visible[i], own);
        sum += visible[i].weight;
        for (int k = 0; k < 3; k++) {
            colour[k] += visible[i].weight * visible[i].surfel->colour[k];
            normal[k] += visible[i].weight * own[k];
        }
    }
    for (int k = 0; k < 3; k++) colour[k] /= sum;
    vec_normalise(normal);
    return sum > 0;
}

static void lay_over(const double colour[3], const struct fragment *front, struct pixel *pixel) {
    for (int k = 0; k < 3; k++) pixel->rgba[k] = colour[k];
    pixel->rgba[3] = 1;
    pixel->distance = front->distance;
    pixel->is_mark_seen = front == pixel->mark;
}

static void add_layer(const struct scene *scene, double x, double y, const struct fragment *fragments, size_t count,
                      struct pixel *pixel) {
    const struct fragment *front = find_front(&scene->lens, fragments, count);
    double colour[3], normal[3], point[3];
    if (!front) return;
    const pbr_item *item = &front->surfel->item->desc;
    const double farthest = fmax(moved_back(&scene->lens, front), front->distance); /* where the former is past a double */
    if (item->blending == PBR_BLEND_FILL) {
        pixel->mark = front;
        pixel->mark_end = farthest;
    }
    if (!(front->distance < pixel->distance)) return;
    if (front == pixel->mark) {
        lay_over(front->surfel->colour, front, pixel);
        return;
    }
    if (!blend(fragments, count_visible(fragments, count, farthest), colour, normal)) return;
    if (item->shading >= PBR_SHADE_DEFERRED && lens_unproject(&scene->lens, x, y, front->depth, point))
        shade_phong(scene, &item->material, colour, point, normal, colour);
    lay_over(colour, front, pixel);
}

/* ---- all ---- */

void layers_resolve(const struct scene *scene, double x, double y, struct fragment *fragments, size_t count, struct pixel *pixel) {
    *pixel = (struct pixel){.distance = INFINITY};
    if (count == 0) return;
    sort_in_place(fragments, count, sizeof *fragments, compare);
    size_t begin = 0, end;
    if (layer_of(fragments) == 0) lay_over(fragments->surfel->colour, fragments, pixel);
    while (begin < count && layer_of(&fragments[begin]) == 0) begin++;
    for (; begin < count; begin = end) {
        for (end = begin; end < count && layer_of(&fragments[end]) == layer_of(&fragments[begin]);) end++;
        add_layer(scene, x, y, fragments + begin, end - begin, pixel);
    }
}
