/* Hidden or not, by a pyramid of farthest depths (Greene, Kass & Miller 1993). SPDX-License-Identifier: MIT */
#include "occluders.h"

#include <math.h>
#include <string.h>

#include "core/matrix.h"

static int32_t half(int32_t n) {
    return (n + 1) / 2;
}

pbr_result occluders_create(pbr_instance *instance, int32_t width, int32_t height, struct occluders **out) {
    int32_t columns = (width - 1) / OCCLUDERS_TILE + 1, rows = (height - 1) / OCCLUDERS_TILE + 1, count = 0;
    size_t total = 0;
    *out = NULL;
    for (int32_t c = columns, r = rows;; c = half(c), r = half(r)) {
        total += (size_t)c * (size_t)r;
        count++;
        if ((c == 1 && r == 1) || count == OCCLUDERS_LEVELS) break;
    }
    struct occluders *o = pbr_allocate(instance, 1, sizeof *o + total * sizeof(float));
    if (!o) return PBR_ERROR_OUT_OF_MEMORY;
    o->instance = instance;
    atomic_init(&o->references, 1);
    o->size[0] = width;
    o->size[1] = height;
    o->level_count = count;
    float *at = o->values;
    for (int32_t i = 0; i < count; i++) {
        o->levels[i] = at;
        o->columns[i] = columns;
        o->rows[i] = rows;
        at += (size_t)columns * (size_t)rows;
        columns = half(columns);
        rows = half(rows);
    }
    *out = o;
    return PBR_OK;
}

void occluders_finish(struct occluders *o) {
    for (int32_t l = 1; l < o->level_count; l++) {
        const float *from = o->levels[l - 1];
        const int32_t columns = o->columns[l - 1], rows = o->rows[l - 1];
        for (int32_t r = 0; r < o->rows[l]; r++)
            for (int32_t c = 0; c < o->columns[l]; c++) {
                const int32_t c1 = 2 * c + 1 < columns ? 2 * c + 1 : 2 * c, r1 = 2 * r + 1 < rows ? 2 * r + 1 : 2 * r;
                const float low = fmaxf(from[2 * r * columns + 2 * c], from[2 * r * columns + c1]);
                const float high = fmaxf(from[r1 * columns + 2 * c], from[r1 * columns + c1]);
                o->levels[l][r * o->columns[l] + c] = fmaxf(low, high);
            }
    }
}

struct occluders *occluders_retain(struct occluders *o) {
    if (o) atomic_fetch_add_explicit(&o->references, 1, memory_order_relaxed);
    return o;
}

void occluders_release(struct occluders **out) {
    struct occluders *o = *out;
    *out = NULL;
    if (o && atomic_fetch_sub_explicit(&o->references, 1, memory_order_acq_rel) == 1) pbr_free(o->instance, o);
}

static double row_at(const double m[16], int i, const float p[3], double slope[3]) {
    for (int k = 0; k < 3; k++) slope[k] = m[4 * k + i];
    return slope[0] * (double)p[0] + slope[1] * (double)p[1] + slope[2] * (double)p[2] + m[12 + i];
}

/* How much a form changes within the cube around a sphere of radius 1: there lies all that is below a node. */
static double within_cube(const double slope[3]) {
    return fabs(slope[0]) + fabs(slope[1]) + fabs(slope[2]);
}

/* First and last pixel that the sphere covers along an axis, if the picture has all of them. `nearest` and `farthest`: w. */
static bool find_pixels(double value, double reach, double nearest, double farthest, double pad, int32_t size, int32_t out[2]) {
    const double low = value - reach, high = value + reach, pixels = size / 2.0;
    const double first = pixels + pixels * (low < 0 ? low / nearest : low / farthest) - pad;
    const double last = pixels + pixels * (high > 0 ? high / nearest : high / farthest) + pad;
    if (!(first >= 0 && last < (double)size)) return false;
    out[0] = (int32_t)first;
    out[1] = (int32_t)last;
    return true;
}

static double farthest_within(const struct occluders *o, const int32_t x[2], const int32_t y[2]) {
    enum { MANY = 8 }; /* tiles in a row; or the next level's are asked */
    int32_t l = 0, x0 = x[0] / OCCLUDERS_TILE, x1 = x[1] / OCCLUDERS_TILE, y0 = y[0] / OCCLUDERS_TILE, y1 = y[1] / OCCLUDERS_TILE;
    for (; (x1 - x0 >= MANY || y1 - y0 >= MANY) && l + 1 < o->level_count; l++) x0 /= 2, x1 /= 2, y0 /= 2, y1 /= 2;
    float farthest = -INFINITY;
    for (int32_t r = y0; r <= y1; r++)
        for (int32_t c = x0; c <= x1; c++) farthest = fmaxf(farthest, o->levels[l][r * o->columns[l] + c]);
    return (double)farthest;
}

/* sign z - t w is affine in space, and above 0 behind what has a depth of t. */
bool occluders_hide(const struct occlusion *occlusion, const float centre[3], double radius) {
    const struct occluders *o = occlusion->by;
    const double *m = occlusion->to_clip, across = occlusion->reach[0] * radius;
    double slopes[4][3], values[4], behind[3];
    int32_t pixels[2][2];
    for (int i = 0; i < 4; i++) values[i] = row_at(m, i, centre, slopes[i]);
    const double along = occlusion->reach[1] * radius + occlusion->least * fabs(values[3]);
    const double span = fmax(across, along) * within_cube(slopes[3]), nearest = values[3] - span, farthest = values[3] + span;
    if (!(nearest > 0)) return false;
    for (int i = 0; i < 2; i++) {
        /* A splat parallel to the screen is as wide where its sphere looks narrower. */
        const double drawn = occlusion->parallel * radius * 2 / o->size[i], beyond = fmax(drawn - radius * length3(slopes[i]), 0);
        if (!find_pixels(values[i], across * within_cube(slopes[i]) + beyond, nearest, farthest, occlusion->pad, o->size[i],
                         pixels[i]))
            return false;
    }
    const double depth = farthest_within(o, pixels[0], pixels[1]) + o->error;
    for (int k = 0; k < 3; k++) behind[k] = o->sign * slopes[2][k] - depth * slopes[3][k];
    return o->sign * values[2] - depth * values[3] > along * within_cube(behind);
}

bool occluders_share_camera(const struct occluders *a, const struct occluders *b) {
    return memcmp(a->view, b->view, sizeof a->view) == 0 && memcmp(a->projection, b->projection, sizeof a->projection) == 0 &&
           a->size[0] == b->size[0] && a->size[1] == b->size[1] && a->sign == b->sign;
}

/* Of a tile and those around it. */
static float farthest_around(const struct occluders *o, int32_t c, int32_t r) {
    float farthest = -INFINITY;
    for (int32_t y = r > 0 ? r - 1 : 0; y <= r + 1 && y < o->rows[0]; y++)
        for (int32_t x = c > 0 ? c - 1 : 0; x <= c + 1 && x < o->columns[0]; x++)
            farthest = fmaxf(farthest, o->levels[0][y * o->columns[0] + x]);
    return farthest;
}

bool occluders_cover(const struct occluders *newer, const struct occluders *older) {
    if (newer == older) return true;
    if (!occluders_share_camera(newer, older)) return false;
    const bool same = memcmp(newer->jitter, older->jitter, sizeof newer->jitter) == 0;
    int32_t farther = 0;
    for (int32_t r = 0; r < newer->rows[0]; r++)
        for (int32_t c = 0; c < newer->columns[0]; c++) {
            const int32_t i = r * newer->columns[0] + c;
            farther += newer->levels[0][i] > (same ? older->levels[0][i] : farthest_around(older, c, r));
        }
    return farther == 0;
}
