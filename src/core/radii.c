/* Splat radii from the spacing of the points.
 *
 * With d the distance to the k-th neighbour, a disc of area pi d^2 on the surface holds about k points, so the local spacing (the
 * side of the square that is one point's share) is s = d sqrt(pi / k), and the radius is s. Why not less: on an exact square grid
 * the discs close at 1/sqrt(2) of its spacing, and there s is at least 0.886 of the grid's spacing (k = 4, 8, 20; more between
 * full shells), so even the worst k leaves a quarter to spare; uneven samples need it. (test: estimated_radii_close_...)
 *
 * Isolated points have no surface to close, and their discs would float before it as balloons: no radius is more than
 * NEIGHBOUR_LIMIT times that of a witness, the point's neighbour of middle rank, which lies on the surface if there is one near;
 * and none is more than OUTLIER_LIMIT times the median. Scans' density falls off smoothly, so neighbours on a surface differ by
 * less. Points that coincide with all k neighbours tell nothing and get the smallest positive radius of the set.
 * SPDX-License-Identifier: MIT */
#include "radii.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "neighbours.h"

enum { DEFAULT_NEIGHBOURS = 8, NEIGHBOUR_LIMIT = 2, OUTLIER_LIMIT = 8, BINS = 1 << 16 };

struct estimate {
    float *spacings;     /* per point */
    uint32_t *witnesses; /* per point: itself if it has no neighbour */
};

static void estimate_one(void *user, uint64_t point, uint32_t found, const double *squared_distances, const uint64_t *indices) {
    const double pi = 3.14159265358979323846;
    const struct estimate *estimate = user;
    double s = found > 0 ? sqrt(squared_distances[found - 1] * pi / found) : 0;
    estimate->spacings[point] = s < FLT_MAX ? (float)s : FLT_MAX;
    estimate->witnesses[point] = found > 0 ? (uint32_t)indices[found / 2] : (uint32_t)point;
}

static uint32_t bits_of(float v) {
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits;
}

/* The bin that holds the `rank`-th count; `rank` becomes the rank within it. */
static uint32_t find_bin(const uint64_t *bins, uint64_t *rank) {
    uint32_t bin = 0;
    for (; bin + 1 < BINS && *rank >= bins[bin]; bin++) *rank -= bins[bin];
    return bin;
}

/* The median of the positive values, 0 if there is none. Positive floats order as their bits do: two histograms of 16 bits find it.
 */
static pbr_result positive_median(pbr_instance *instance, const float *values, uint64_t count, float *out) {
    uint64_t *bins = pbr_allocate(instance, BINS, sizeof *bins), positive = 0;
    *out = 0;
    if (!bins) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < count; i++)
        if (values[i] > 0) {
            bins[bits_of(values[i]) >> 16]++;
            positive++;
        }
    if (positive > 0) {
        uint64_t rank = positive / 2;
        uint32_t high = find_bin(bins, &rank);
        memset(bins, 0, BINS * sizeof *bins);
        for (uint64_t i = 0; i < count; i++)
            if (values[i] > 0 && bits_of(values[i]) >> 16 == high) bins[bits_of(values[i]) & 0xffff]++;
        uint32_t bits = high << 16 | find_bin(bins, &rank);
        memcpy(out, &bits, sizeof bits);
    }
    pbr_free(instance, bins);
    return PBR_OK;
}

/* Caps outliers, fills in for coincident points, applies the factor. */
static pbr_result settle(const pbr_points *points, float scale, float *radii) {
    float median, smallest = INFINITY;
    pbr_result result = positive_median(points->instance, radii, points->count, &median);
    if (result != PBR_OK) return result;
    for (uint64_t i = 0; i < points->count; i++)
        if (radii[i] > 0 && radii[i] < smallest) smallest = radii[i];
    if (!isfinite(smallest)) smallest = 0;
    double most = fmin((double)OUTLIER_LIMIT * median, FLT_MAX);
    for (uint64_t i = 0; i < points->count; i++) {
        double r = radii[i] > 0 ? fmin(radii[i], most) : smallest;
        radii[i] = (float)fmin(r * scale, FLT_MAX);
    }
    return PBR_OK;
}

static void take_the_witnesses_word(const struct estimate *estimate, uint64_t count, float *out) {
    for (uint64_t i = 0; i < count; i++) {
        const float witness = estimate->spacings[estimate->witnesses[i]];
        /* A witness that coincides with its own neighbours knows no spacing. */
        out[i] = witness > 0 ? fminf(estimate->spacings[i], NEIGHBOUR_LIMIT * witness) : estimate->spacings[i];
    }
}

pbr_result radii_estimate(const pbr_points *points, uint32_t neighbours, float scale, const struct progress *progress, float *out) {
    pbr_instance *instance = points->instance;
    struct kd_tree *tree = NULL;
    struct estimate estimate = {.spacings = pbr_allocate(instance, points->count, sizeof *estimate.spacings)};
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    if (!estimate.spacings) goto cleanup;
    estimate.witnesses = pbr_allocate(instance, points->count, sizeof *estimate.witnesses);
    if (!estimate.witnesses) goto cleanup;
    result = kd_tree_create(points, progress, &tree);
    if (result == PBR_OK)
        result = kd_tree_for_each(tree, neighbours ? neighbours : DEFAULT_NEIGHBOURS, progress, estimate_one, &estimate);
    if (result != PBR_OK) goto cleanup;
    take_the_witnesses_word(&estimate, points->count, out);
    result = settle(points, scale > 0 ? scale : 1, out);
cleanup:
    kd_tree_destroy(points, tree);
    pbr_free(instance, estimate.spacings);
    pbr_free(instance, estimate.witnesses);
    return result;
}
