/* Colours of vertices, averaged from what their triangles are painted with.
 *
 * With f the hat function of a vertex v (1 there, linear to 0 at the other corners), its colour is the sum over its triangles T of
 * area(T) mean_T(f c), over the same of f. The map from a triangle to its picture is affine, so the means are taken in the picture:
 * of rows of samples, a texel apart or less. A bound on the samples in all makes them sparser where triangles hold more texels.
 * Colours come times their alpha and are divided by the alpha's mean, so that what is transparent has no say.
 * SPDX-License-Identifier: MIT */
#include "paint.h"

#include <math.h>
#include <string.h>

#include "texture.h"

enum { MOST_SAMPLES = 1 << 28, MOST_OF_TRIANGLE = 1 << 16, LEAST_OF_TRIANGLE = 16, STEP = 1 << 14 };
enum { LEAST_ROWS = 4 }; /* of a long triangle, however thin, as rows near its long side alone reach its ends */

struct job {
    struct reader *reader;
    struct arrays *arrays;
    const uint32_t (*triangles)[3];
    const struct patch *patches;
    size_t count;
    uint32_t *order;   /* triangles by paint */
    size_t *begins;    /* of each paint's in `order`, and an end */
    double (*sums)[4]; /* of each vertex: colour times alpha, alpha */
    double samples;    /* of a triangle, at most */
    uint64_t bare;     /* triangles without paint */
};

/* ---- triangles by paint ---- */

static pbr_result sort_by_paint(struct job *job, uint32_t paint_count) {
    pbr_instance *instance = job->reader->instance;
    job->order = pbr_allocate(instance, job->count, sizeof *job->order);
    job->begins = pbr_allocate(instance, (size_t)paint_count + 2, sizeof *job->begins);
    if (!job->order || !job->begins) return PBR_ERROR_OUT_OF_MEMORY;
    memset(job->begins, 0, ((size_t)paint_count + 2) * sizeof *job->begins);
    /* Counts two places on, so that after the sums each place is where the next triangle goes, and in the end where they begin. */
    for (size_t i = 0; i < job->count; i++) {
        if (job->patches[i].paint == PAINT_NONE) job->bare++;
        else job->begins[job->patches[i].paint + 2]++;
    }
    for (uint32_t k = 2; k < paint_count + 2; k++) job->begins[k] += job->begins[k - 1];
    for (size_t i = 0; i < job->count; i++)
        if (job->patches[i].paint != PAINT_NONE) job->order[job->begins[job->patches[i].paint + 1]++] = (uint32_t)i;
    return PBR_OK;
}

/* ---- one triangle ---- */

static void read_position(const struct job *job, uint32_t vertex, double out[3]) {
    const pbr_attribute *positions = &job->arrays->positions;
    const unsigned char *from = (const unsigned char *)positions->data + positions->stride * vertex;
    float narrow[3];
    if (positions->format == PBR_FORMAT_FLOAT64) {
        memcpy(out, from, 3 * sizeof *out);
        return;
    }
    memcpy(narrow, from, sizeof narrow);
    for (int k = 0; k < 3; k++) out[k] = narrow[k];
}

/* 0 where a corner is not finite. */
static double area_of(const struct job *job, const uint32_t corners[3]) {
    double p[3][3], a[3], b[3];
    for (int i = 0; i < 3; i++) read_position(job, corners[i], p[i]);
    for (int k = 0; k < 3; k++) {
        a[k] = p[1][k] - p[0][k];
        b[k] = p[2][k] - p[0][k];
    }
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    double area = 0.5 * sqrt(x * x + y * y + z * z);
    return isfinite(area) ? area : 0;
}

/* Sums over the samples of a triangle, by its corners. */
struct means {
    double colours[3][4];
    double weights[3];
};

static void add_means(struct job *job, const uint32_t corners[3], double area, const struct means *means) {
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4 && means->weights[i] > 0; k++)
            job->sums[corners[i]][k] += area * means->colours[i][k] / means->weights[i];
}

/* The texel of a coordinate in pictures; 1 is the end of the first, not the begin of the second. */
static size_t texel_of(double at, uint32_t size) {
    double part = at - floor(at);
    if (part == 0 && at > 0) part = 1;
    size_t texel = (size_t)(part * size);
    return texel < size ? texel : size - 1;
}

static void add_sample(const struct texture *texture, const double at[3][2], const double hats[3], double weight,
                       struct means *means) {
    double u = hats[0] * at[0][0] + hats[1] * at[1][0] + hats[2] * at[2][0];
    double v = hats[0] * at[0][1] + hats[1] * at[1][1] + hats[2] * at[2][1];
    const unsigned char *texel =
        texture->texels + 4 * (texel_of(1 - v, texture->height) * texture->width + texel_of(u, texture->width));
    double alpha = weight * texel[3] / 255;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) means->colours[i][k] += alpha * hats[i] * (double)texture->linear[texel[k]];
        means->colours[i][3] += alpha * hats[i];
        means->weights[i] += weight * hats[i];
    }
}

/* Rows parallel to the side from corner `a` to the next, of samples in the middle of equal parts. `length` is the side's and
 * `height` the triangle's above it, in texels. */
static void sample_rows(const struct texture *texture, const double at[3][2], int a, double length, double height,
                        struct means *means) {
    int b = (a + 1) % 3, c = (a + 2) % 3, rows = (int)ceil(fmax(height, 1));
    for (int j = 0; j < rows; j++) {
        double hats[3], up = (j + 0.5) / rows, wide = 1 - up;
        int columns = (int)ceil(fmax(wide * length, 1));
        hats[c] = up;
        for (int i = 0; i < columns; i++) {
            hats[b] = wide * (i + 0.5) / columns;
            hats[a] = wide - hats[b];
            add_sample(texture, at, hats, wide / columns, means);
        }
    }
}

static void sample_triangle(const struct job *job, const struct texture *texture, const struct patch *patch, struct means *means) {
    double at[3][2], longest = 0;
    int a = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 2; k++) at[i][k] = patch->at[i][k];
    for (int i = 0; i < 3; i++) {
        double length = hypot((at[(i + 1) % 3][0] - at[i][0]) * texture->width, (at[(i + 1) % 3][1] - at[i][1]) * texture->height);
        if (!isfinite(length)) return;
        if (length > longest) a = i;
        longest = fmax(longest, length);
    }
    double twice = fabs((at[1][0] - at[0][0]) * (at[2][1] - at[0][1]) - (at[2][0] - at[0][0]) * (at[1][1] - at[0][1])) *
                   texture->width * texture->height;
    double length = fmax(longest, 1), height = fmax(twice / length, fmin(length, LEAST_ROWS));
    double sparser = sqrt(fmax(length * height / job->samples, 1));
    height = fmax(height / sparser, 1);
    sample_rows(texture, (const double(*)[2])at, a, fmin(length / sparser, job->samples / height), height, means);
}

/* ---- all ---- */

static void add_triangle(struct job *job, uint32_t triangle, const struct texture *texture, const struct paint *paint) {
    const uint32_t *corners = job->triangles[triangle];
    struct means means = {0};
    double area = area_of(job, corners);
    if (texture->texels) {
        sample_triangle(job, texture, &job->patches[triangle], &means);
    } else if (paint->has_colour) {
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) means.colours[i][k] = (double)paint->colour[k];
            means.colours[i][3] = means.weights[i] = 1;
        }
    }
    job->bare += means.weights[0] == 0;
    add_means(job, corners, area, &means);
}

static pbr_result add_paint(struct job *job, uint32_t index, const struct paint *paint, uint64_t *texels_left) {
    struct texture texture = {0};
    pbr_result result = PBR_OK;
    if (job->begins[index] == job->begins[index + 1]) return PBR_OK;
    if (paint->picture.length > 0)
        result = texture_read(job->reader, paint->picture.text, paint->picture.length, texels_left, &texture);
    for (size_t i = job->begins[index]; i < job->begins[index + 1] && result == PBR_OK; i++) {
        add_triangle(job, job->order[i], &texture, paint);
        if (i % STEP == 0) result = reader_progress(job->reader, job->reader->size);
    }
    texture_free(job->reader->instance, &texture);
    return result;
}

/* Vertices without a colour, where others have one, are white. */
static pbr_result make_colours(struct job *job) {
    struct arrays *arrays = job->arrays;
    bool any = false;
    for (uint64_t i = 0; i < arrays->count; i++) any |= job->sums[i][3] > 0;
    if (!any) return PBR_OK;
    if (job->bare)
        reader_warn(job->reader, 1, "%llu of %llu triangles have neither texture nor colour", (unsigned long long)job->bare,
                    (unsigned long long)job->count);
    pbr_result result = arrays_make(arrays, arrays->count, PBR_FORMAT_FLOAT32, 3, &arrays->colours);
    if (result != PBR_OK) return result;
    float *to = arrays->blocks[arrays->block_count - 1];
    for (uint64_t i = 0; i < arrays->count; i++)
        for (int k = 0; k < 3; k++) *to++ = job->sums[i][3] > 0 ? (float)(job->sums[i][k] / job->sums[i][3]) : 1;
    return PBR_OK;
}

pbr_result paint_vertices(struct reader *reader, struct arrays *arrays, const uint32_t (*triangles)[3], const struct patch *patches,
                          size_t count, const struct paint *paints, uint32_t paint_count) {
    struct job job = {.reader = reader, .arrays = arrays, .triangles = triangles, .patches = patches, .count = count};
    uint64_t texels_left = TEXTURE_MOST_TEXELS;
    if (count == 0 || paint_count == 0 || arrays->count == 0) return PBR_OK;
    job.samples = fmin(fmax((double)MOST_SAMPLES / (double)count, LEAST_OF_TRIANGLE), MOST_OF_TRIANGLE);
    job.sums = pbr_allocate(reader->instance, arrays->count, sizeof *job.sums);
    pbr_result result = job.sums ? sort_by_paint(&job, paint_count) : PBR_ERROR_OUT_OF_MEMORY;
    if (job.sums) memset(job.sums, 0, arrays->count * sizeof *job.sums);
    for (uint32_t i = 0; i < paint_count && result == PBR_OK; i++) result = add_paint(&job, i, &paints[i], &texels_left);
    if (result == PBR_OK) result = make_colours(&job);
    pbr_free(reader->instance, job.sums);
    pbr_free(reader->instance, job.order);
    pbr_free(reader->instance, job.begins);
    return result;
}
