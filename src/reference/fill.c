/* docs/splats.md: filling holes (Pfister et al. 2000). SPDX-License-Identifier: MIT */
#include "fill.h"

enum { REPORTS = 32 };

pbr_result fill_open(const struct scene *scene, struct fill *fill) {
    const size_t pixels = (size_t)scene->lens.width * (size_t)scene->lens.height;
    fill->pixels = NULL;
    if (!scene->is_filled) return PBR_OK;
    fill->pixels = pbr_allocate(scene->instance, pixels, sizeof *fill->pixels);
    return fill->pixels ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

void fill_close(const struct scene *scene, struct fill *fill) {
    pbr_free(scene->instance, fill->pixels);
    fill->pixels = NULL;
}

/* ---- marks and samples ---- */

static void add_sample(const struct surfel *surfel, struct fill_pixel *to) {
    if (!(surfel->distance <= to->extent[1])) return;
    for (int k = 0; k < 3; k++) to->sum[k] += surfel->colour[k];
    to->samples++;
}

void fill_add(struct fill *fill, size_t at, int32_t x, int32_t y, const struct pixel *pixel, const struct surfel *const *surfels,
              size_t count) {
    if (!pixel->mark) return;
    struct fill_pixel *to = &fill->pixels[at];
    *to = (struct fill_pixel){
        .is_seen = pixel->is_mark_seen, .extent = {pixel->mark->distance, pixel->mark_end}, .radius = pixel->mark->surfel->radius};
    for (size_t i = 0; i < count; i++)
        if (surfels[i]->home[0] == x && surfels[i]->home[1] == y) add_sample(surfels[i], to);
}

/* ---- means ---- */

struct gathering {
    const struct fill *fill;
    pbr_image *image;
    size_t first; /* row of those being worked on */
};

static bool overlap(const double a[2], const double b[2]) {
    return a[0] <= b[1] && b[0] <= a[1];
}

/* A radius is negative where the centre of the splat is behind the eye. */
static bool is_averaged(const struct fill_pixel *pixel) {
    return pixel->is_seen && pixel->radius >= 0 && pixel->radius <= KERNEL_MOST_FILLED;
}

/* The columns, or rows, around `at` that a radius reaches. */
static size_t reach_down(size_t at, size_t reach) {
    return at > reach ? at - reach : 0;
}
static size_t reach_up(size_t at, size_t reach, size_t count) {
    return count - at > reach ? at + reach : count - 1;
}

/* Of the samples around the pixel, in rows from the top. False if there are none. */
static bool find_mean(const struct gathering *at, size_t x, size_t row, double mean[3]) {
    const size_t width = at->image->width, height = at->image->height;
    const struct fill_pixel *own = &at->fill->pixels[row * width + x];
    const size_t reach = (size_t)own->radius;
    double sum = 0;
    for (int k = 0; k < 3; k++) mean[k] = 0;
    for (size_t v = reach_down(row, reach); v <= reach_up(row, reach, height); v++)
        for (size_t u = reach_down(x, reach); u <= reach_up(x, reach, width); u++) {
            const struct fill_pixel *from = &at->fill->pixels[v * width + u];
            const double d = hypot((double)u - (double)x, (double)v - (double)row), away = d > 0 ? d / own->radius : 0;
            if (from->samples == 0 || away > 1 || !overlap(from->extent, own->extent)) continue;
            const double weight = surfel_weight(away * away);
            for (int k = 0; k < 3; k++) mean[k] += weight * from->sum[k];
            sum += weight * from->samples;
        }
    for (int k = 0; k < 3; k++) mean[k] /= sum;
    return sum > 0;
}

static pbr_result resolve_rows(void *user, size_t begin, size_t end) {
    const struct gathering *at = user;
    const size_t width = at->image->width;
    for (size_t row = at->first + begin; row < at->first + end; row++)
        for (size_t x = 0; x < width; x++) {
            const struct fill_pixel *own = &at->fill->pixels[row * width + x];
            float *rgba = at->image->rgba + 4 * (row * width + x);
            double mean[3];
            if (!is_averaged(own) || !find_mean(at, x, row, mean)) continue;
            for (int k = 0; k < 3; k++) rgba[k] = (float)mean[k];
        }
    return PBR_OK;
}

static bool report(const struct scene *scene, double fraction) {
    return !scene->desc.progress || scene->desc.progress(scene->desc.progress_user, "filling", fraction);
}

pbr_result fill_resolve(const struct scene *scene, const struct fill *fill, pbr_image *image) {
    struct gathering gathering = {fill, image, 0};
    const size_t height = image->height, slice = height / REPORTS + 1;
    if (!fill->pixels) return PBR_OK;
    for (; gathering.first < height; gathering.first += slice) {
        const size_t rest = height - gathering.first;
        if (!report(scene, (double)gathering.first / (double)height)) return PBR_ERROR_CANCELLED;
        const pbr_result result = pbr_parallel(scene->instance, rest < slice ? rest : slice, 1, resolve_rows, &gathering);
        if (result != PBR_OK) return result;
    }
    return report(scene, 1) ? PBR_OK : PBR_ERROR_CANCELLED;
}
