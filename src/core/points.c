/* Point sets: copying the host's attributes into the library's compact arrays. SPDX-License-Identifier: MIT */
#include "points.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "attribute.h"
#include "colour.h"
#include "matrix.h"
#include "minmax.h"
#include "radii.h"
#include "splat.h"

enum {
    PIECES = 64, /* of a reduction: each thread writes its own slot, and the sum does not depend on the number of threads */
    GRAIN = 1 << 14
};

enum {
    FLOATS = 1u << PBR_FORMAT_FLOAT32 | 1u << PBR_FORMAT_FLOAT64,
    NORMAL_FORMATS = FLOATS | 1u << PBR_FORMAT_INT8 | 1u << PBR_FORMAT_INT16,
    COLOUR_FORMATS = FLOATS | 1u << PBR_FORMAT_UINT8 | 1u << PBR_FORMAT_UINT16,
    ANY_FORMAT = 0x1fe
};

static size_t piece_size(uint64_t count) {
    size_t even = (size_t)(count / PIECES + 1);
    return even < GRAIN ? GRAIN : even;
}

void box_origin(const double minimum[3], const double maximum[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        double extent = maximum[k] - minimum[k], centre = minimum[k] + extent / 2;
        int exponent;
        frexp(extent, &exponent);
        double quantum = ldexp(1, exponent - 9);
        if (!(fabs(centre) > 2 * extent)) out[k] = 0;
        else if (extent > 0 && quantum > 0) out[k] = rint(centre / quantum) * quantum;
        else out[k] = centre;
    }
}

/* ---- Looking at the input ---- */

struct box {
    uint64_t count;
    double minimum[3], maximum[3];
};

static void box_clear(struct box *box) {
    box->count = 0;
    for (int k = 0; k < 3; k++) {
        box->minimum[k] = INFINITY;
        box->maximum[k] = -INFINITY;
    }
}

static void box_add(struct box *box, const double low[3], const double high[3], uint64_t count) {
    box->count += count;
    for (int k = 0; k < 3; k++) {
        box->minimum[k] = lesser(low[k], box->minimum[k]);
        box->maximum[k] = larger(high[k], box->maximum[k]);
    }
}

static void box_merge(const struct box *pieces, struct box *out) {
    box_clear(out);
    for (int i = 0; i < PIECES; i++)
        if (pieces[i].count > 0) box_add(out, pieces[i].minimum, pieces[i].maximum, pieces[i].count);
    if (out->count == 0)
        for (int k = 0; k < 3; k++) out->minimum[k] = out->maximum[k] = 0;
}

struct survey {
    const pbr_attribute *positions;
    size_t piece;
    struct box boxes[PIECES];
};

static pbr_result survey_range(void *user, size_t begin, size_t end) {
    struct survey *survey = user;
    struct box *box = &survey->boxes[begin / survey->piece];
    box_clear(box);
    for (size_t i = begin; i < end; i++) {
        double p[3];
        if (attribute_read_position(survey->positions, i, p)) box_add(box, p, p, 1);
    }
    return PBR_OK;
}

/* Box around the points that have finite coordinates, and how many they are. */
static pbr_result survey_positions(pbr_instance *instance, const pbr_points_desc *desc, struct box *out) {
    struct survey survey = {.positions = &desc->positions, .piece = piece_size(desc->count)};
    pbr_result result = pbr_parallel(instance, (size_t)desc->count, survey.piece, survey_range, &survey);
    if (result == PBR_OK) box_merge(survey.boxes, out);
    return result;
}

static pbr_result check_numbers(pbr_instance *instance, const pbr_points_desc *desc) {
    const char *wrong = NULL;
    for (int k = 0; k < 3; k++)
        if (!isfinite(desc->origin[k])) wrong = "origin is not finite";
    if (desc->flags & ~(uint32_t)PBR_POINTS_ESTIMATE_RADII) wrong = "flags has an unknown bit";
    if (!(desc->radius >= 0 && desc->radius <= FLT_MAX)) wrong = "radius is negative or not finite";
    if (!(desc->radius_scale >= 0 && desc->radius_scale <= FLT_MAX)) wrong = "radius_scale is negative or not finite";
    if (desc->radius_neighbours > 32) wrong = "radius_neighbours is more than 32";
    if (desc->scalar_count > 0 && !desc->scalars) wrong = "scalars is NULL, but scalar_count is not 0";
    if (desc->reserved != 0) wrong = "reserved is not 0";
    if (wrong) return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_points_desc: %s", wrong);
    if (desc->count > PBR_MAX_POINTS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_points_desc: %llu points, the limit is %llu",
                       (unsigned long long)desc->count, (unsigned long long)PBR_MAX_POINTS);
    if (desc->scalar_count > PBR_MAX_SCALARS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_points_desc: %u scalars, the limit is %d",
                       (unsigned)desc->scalar_count, PBR_MAX_SCALARS);
    return PBR_OK;
}

static pbr_result check_attributes(pbr_instance *instance, pbr_points_desc *desc, pbr_attribute scalars[PBR_MAX_SCALARS]) {
    uint64_t n = desc->count;
    pbr_result result = attribute_check(instance, "positions", &desc->positions, n, FLOATS, 3, 3, n > 0);
    if (result == PBR_OK) result = attribute_check(instance, "normals", &desc->normals, n, NORMAL_FORMATS, 3, 3, false);
    if (result == PBR_OK) result = attribute_check(instance, "colours", &desc->colours, n, COLOUR_FORMATS, 3, 4, false);
    if (result == PBR_OK) result = attribute_check(instance, "radii", &desc->radii, n, FLOATS, 1, 1, false);
    for (uint32_t s = 0; result == PBR_OK && s < desc->scalar_count; s++) {
        if (!desc->scalars[s].name)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_points_desc: scalar %u has no name",
                           (unsigned)s);
        scalars[s] = desc->scalars[s].values;
        result = attribute_check(instance, "scalar", &scalars[s], n, ANY_FORMAT, 1, 1, n > 0);
    }
    return result;
}

/* ---- Memory ---- */

/* Which arrays a set has. */
struct layout {
    bool wide, normals, colours, radii;
    uint32_t scalar_count;
};

static void destroy(pbr_points *points) {
    if (!points) return;
    pbr_instance *instance = points->instance;
    for (uint32_t s = 0; points->scalars && s < points->scalar_count; s++) pbr_free(instance, points->scalars[s].values);
    pbr_free(instance, points->scalars);
    pbr_free(instance, points->narrow);
    pbr_free(instance, points->wide);
    pbr_free(instance, points->normals);
    pbr_free(instance, points->colours);
    pbr_free(instance, points->radii);
    pbr_free(instance, points);
    instance_drop_child(instance);
}

static bool allocate_scalars(pbr_points *points, uint32_t scalar_count) {
    if (scalar_count == 0) return true;
    points->scalars = pbr_allocate(points->instance, scalar_count, sizeof *points->scalars);
    if (!points->scalars) return false;
    points->scalar_count = scalar_count;
    for (uint32_t s = 0; s < scalar_count; s++) {
        points->scalars[s].values = pbr_allocate(points->instance, (size_t)points->count, sizeof(float));
        if (!points->scalars[s].values) return false;
    }
    return true;
}

static pbr_points *allocate(pbr_instance *instance, uint64_t count, const struct layout *layout) {
    pbr_points *points = pbr_allocate(instance, 1, sizeof *points);
    if (!points) return NULL;
    points->instance = instance;
    atomic_init(&points->references, 1);
    instance_add_child(instance);
    points->count = count;
    size_t n = (size_t)count;
    bool complete = true;
    if (layout->wide) complete = (points->wide = allocate_unset(instance, n, sizeof *points->wide)) != NULL;
    else complete = (points->narrow = allocate_unset(instance, n, sizeof *points->narrow)) != NULL;
    if (complete && layout->normals) complete = (points->normals = allocate_unset(instance, n, sizeof *points->normals)) != NULL;
    if (complete && layout->colours) complete = (points->colours = allocate_unset(instance, n, sizeof *points->colours)) != NULL;
    if (complete && layout->radii) complete = (points->radii = pbr_allocate(instance, n, sizeof *points->radii)) != NULL;
    if (complete && allocate_scalars(points, layout->scalar_count)) return points;
    destroy(points);
    return NULL;
}

static uint64_t memory_bytes(const pbr_points *points) {
    uint64_t each = points->wide ? sizeof *points->wide : sizeof *points->narrow;
    if (points->normals) each += sizeof *points->normals;
    if (points->colours) each += sizeof *points->colours;
    if (points->radii) each += sizeof *points->radii;
    each += points->scalar_count * sizeof(float);
    return sizeof *points + points->scalar_count * sizeof *points->scalars + points->count * each;
}

/* ---- Filling ---- */

struct fill {
    pbr_points *points;
    const pbr_points_desc *desc;
    const pbr_attribute *scalars;
    const uint32_t *kept; /* input index of each point, or NULL: the same */
    double shift[3];      /* subtracted from every position */
    bool constant_radius;
};

static void fill_position(const struct fill *fill, size_t i, uint64_t from) {
    double p[3];
    const bool is_place = attribute_read_position(&fill->desc->positions, from, p); /* else (0, 0, 0) */
    for (int k = 0; k < 3; k++)
        if (fill->points->wide) fill->points->wide[i][k] = is_place ? p[k] - fill->shift[k] : 0;
        else fill->points->narrow[i][k] = is_place ? (float)p[k] : 0;
}

/* Scaled by its largest component first: a double normal may be too long or too short for float. */
static void fill_normal(const pbr_attribute *normals, uint64_t from, int16_t out[2]) {
    double n[3], largest = 0;
    float unit[3] = {0, 0, 0};
    attribute_read(normals, from, n);
    /* Signed normalised integers: the lowest value means -1, as the one above it does (OpenGL 4.2 and later). */
    double lowest = normals->format == PBR_FORMAT_INT8 ? -INT8_MAX : normals->format == PBR_FORMAT_INT16 ? -INT16_MAX : -INFINITY;
    bool finite = true;
    for (int k = 0; k < 3; k++) {
        finite = finite && isfinite(n[k]);
        n[k] = fmax(n[k], lowest);
        largest = fmax(largest, fabs(n[k]));
    }
    if (finite && largest > 0)
        for (int k = 0; k < 3; k++) unit[k] = (float)(n[k] / largest);
    splat_encode_normal(unit, out);
}

static void fill_colour(const pbr_attribute *colours, uint64_t from, uint8_t out[4]) {
    double c[4];
    attribute_read(colours, from, c);
    out[3] = 255;
    for (uint32_t k = 0; k < colours->components; k++) {
        if (colours->format == PBR_FORMAT_UINT8) out[k] = (uint8_t)c[k];
        else if (colours->format == PBR_FORMAT_UINT16) out[k] = (uint8_t)(((uint32_t)c[k] + 128) / 257);
        else out[k] = unorm8(k < 3 ? srgb_from_linear((float)c[k]) : (float)c[k]);
    }
}

static float clean_radius(double r) {
    return r > 0 && r <= FLT_MAX ? (float)r : 0;
}

static pbr_result fill_range(void *user, size_t begin, size_t end) {
    const struct fill *fill = user;
    const pbr_points_desc *desc = fill->desc;
    pbr_points *points = fill->points;
    for (size_t i = begin; i < end; i++) {
        uint64_t from = fill->kept ? fill->kept[i] : i;
        double value;
        fill_position(fill, i, from);
        if (points->normals) fill_normal(&desc->normals, from, points->normals[i]);
        if (points->colours) fill_colour(&desc->colours, from, points->colours[i]);
        if (desc->radii.data) {
            attribute_read(&desc->radii, from, &value);
            points->radii[i] = clean_radius(value);
        } else if (fill->constant_radius) points->radii[i] = desc->radius;
        for (uint32_t s = 0; s < points->scalar_count; s++) {
            attribute_read(&fill->scalars[s], from, &value);
            points->scalars[s].values[i] = (float)value;
        }
    }
    return PBR_OK;
}

/* The input indices of the points with finite coordinates, as many as were counted: it may be others by now, and fewer or more. */
static uint32_t *list_kept(pbr_instance *instance, const pbr_points_desc *desc, uint64_t count) {
    uint32_t *kept = pbr_allocate(instance, (size_t)count, sizeof *kept);
    uint64_t n = 0;
    double p[3];
    for (uint64_t i = 0; kept && i < desc->count && n < count; i++)
        if (attribute_read_position(&desc->positions, i, p)) kept[n++] = (uint32_t)i;
    return kept;
}

/* At most 63 bytes, cut between characters. */
static void copy_name(const char *name, char out[64]) {
    size_t length = strnlen(name, 64);
    if (length > 63)
        for (length = 63; length > 0 && ((unsigned char)name[length] & 0xc0) == 0x80;) length--;
    memcpy(out, name, length);
    out[length] = 0;
}

static void scalar_range(struct scalar *scalar, uint64_t count) {
    float low = INFINITY, high = -INFINITY;
    for (uint64_t i = 0; i < count; i++) {
        float v = scalar->values[i];
        if (!isfinite(v)) continue;
        if (v < low) low = v;
        if (v > high) high = v;
    }
    scalar->minimum = low <= high ? low : 0;
    scalar->maximum = low <= high ? high : 0;
}

/* ---- What is known of a filled set ---- */

struct measure {
    const pbr_points *points;
    size_t piece;
    double centre[3], rounding; /* the largest shift of a coordinate by rounding to float */
    float smallest;             /* radius that is not 0; 0 if there is none */
    struct {
        struct box box;
        double rounding;
        double squared_radius;
        double radius_sum;
        float radius_minimum, radius_maximum, radius_positive; /* the last: the least that is not 0 */
    } pieces[PIECES];
};

static pbr_result measure_box(void *user, size_t begin, size_t end) {
    struct measure *measure = user;
    struct box box;
    double rounding = 0;
    box_clear(&box);
    for (size_t i = begin; i < end; i++) {
        double p[3];
        points_position(measure->points, i, p);
        box_add(&box, p, p, 1);
        for (int k = 0; k < 3; k++) rounding = larger(fabs((double)(float)p[k] - p[k]), rounding);
    }
    measure->pieces[begin / measure->piece].box = box;
    measure->pieces[begin / measure->piece].rounding = rounding;
    return PBR_OK;
}

static pbr_result measure_radius(void *user, size_t begin, size_t end) {
    struct measure *measure = user;
    double largest = 0;
    for (size_t i = begin; i < end; i++) {
        double p[3];
        points_position(measure->points, i, p);
        for (int k = 0; k < 3; k++) p[k] -= measure->centre[k];
        largest = larger(dot3(p, p), largest);
    }
    measure->pieces[begin / measure->piece].squared_radius = largest;
    return PBR_OK;
}

static pbr_result measure_radii(void *user, size_t begin, size_t end) {
    struct measure *measure = user;
    float low = INFINITY, high = 0, positive = INFINITY;
    double sum = 0;
    for (size_t i = begin; i < end; i++) {
        const float r = measure->points->radii[i];
        sum += (double)r;
        low = lesserf(r, low);
        high = largerf(r, high);
        positive = r > 0 && r < positive ? r : positive;
    }
    const size_t piece = begin / measure->piece;
    measure->pieces[piece].radius_sum = sum;
    measure->pieces[piece].radius_minimum = low;
    measure->pieces[piece].radius_maximum = high;
    measure->pieces[piece].radius_positive = positive;
    return PBR_OK;
}

static pbr_result make_narrow(pbr_points *points) {
    points->narrow = allocate_unset(points->instance, (size_t)points->count, sizeof *points->narrow);
    if (!points->narrow) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < points->count; i++)
        for (int k = 0; k < 3; k++) points->narrow[i][k] = (float)points->wide[i][k];
    pbr_free(points->instance, points->wide);
    points->wide = NULL;
    for (int k = 0; k < 3; k++) {
        points->minimum[k] = (float)points->minimum[k];
        points->maximum[k] = (float)points->maximum[k];
    }
    return PBR_OK;
}

static pbr_result find_box(pbr_points *points, struct measure *measure) {
    struct box box;
    const pbr_result result = pbr_parallel(points->instance, (size_t)points->count, measure->piece, measure_box, measure);
    box_clear(&box);
    for (int i = 0; i < PIECES; i++) {
        if (measure->pieces[i].box.count == 0) continue;
        box_add(&box, measure->pieces[i].box.minimum, measure->pieces[i].box.maximum, measure->pieces[i].box.count);
        measure->rounding = larger(measure->pieces[i].rounding, measure->rounding);
    }
    for (int k = 0; k < 3 && box.count > 0; k++) {
        points->minimum[k] = box.minimum[k];
        points->maximum[k] = box.maximum[k];
    }
    return result;
}

static pbr_result find_radii(pbr_points *points, struct measure *measure) {
    if (!points->radii || points->count == 0) return PBR_OK;
    const pbr_result result = pbr_parallel(points->instance, (size_t)points->count, measure->piece, measure_radii, measure);
    float low = INFINITY, high = 0, positive = INFINITY;
    double sum = 0;
    for (size_t i = 0; i * measure->piece < points->count; i++) {
        low = lesserf(measure->pieces[i].radius_minimum, low);
        high = largerf(measure->pieces[i].radius_maximum, high);
        positive = lesserf(measure->pieces[i].radius_positive, positive);
        sum += measure->pieces[i].radius_sum;
    }
    points->radius_minimum = low;
    points->radius_mean = (float)(sum / (double)points->count);
    points->radius_maximum = high;
    measure->smallest = isfinite(positive) ? positive : 0;
    return result;
}

/* Everything that follows from the arrays: bounds, statistics, and whether float positions will do. Without radii there is no
 * measure of what may be lost, and only positions that float holds exactly are narrowed. */
static pbr_result finish(pbr_points *points) {
    const size_t n = (size_t)points->count;
    struct measure measure = {.points = points, .piece = piece_size(n)};
    double squared = 0;
    pbr_result result = find_radii(points, &measure);
    if (result == PBR_OK) result = find_box(points, &measure);
    if (result == PBR_OK && points->wide && measure.rounding <= measure.smallest * POSITION_TOLERANCE) result = make_narrow(points);
    if (result != PBR_OK) return result;
    for (int k = 0; k < 3; k++) measure.centre[k] = (points->minimum[k] + points->maximum[k]) / 2;
    result = pbr_parallel(points->instance, n, measure.piece, measure_radius, &measure);
    for (int i = 0; i < PIECES; i++) squared = larger(measure.pieces[i].squared_radius, squared);
    points->bounding_radius = sqrt(squared);
    for (uint32_t s = 0; s < points->scalar_count; s++) scalar_range(&points->scalars[s], points->count);
    points->memory_bytes = memory_bytes(points);
    return result;
}

/* ---- Creating ---- */

/* Allocates and fills; the radii are estimated later, when positions are there. */
static pbr_result copy_attributes(pbr_instance *instance, const pbr_points_desc *desc, const pbr_attribute *scalars, bool keep_all,
                                  pbr_points **out) {
    struct box box = {0};
    uint32_t *kept = NULL;
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    bool estimate = !desc->radii.data && desc->flags & PBR_POINTS_ESTIMATE_RADII;
    struct layout layout = {.wide = desc->count > 0 && desc->positions.format == PBR_FORMAT_FLOAT64,
                            .normals = desc->normals.data,
                            .colours = desc->colours.data,
                            .radii = desc->radii.data || estimate || desc->radius > 0,
                            .scalar_count = desc->scalar_count};
    struct fill fill = {.desc = desc, .scalars = scalars, .constant_radius = layout.radii && !estimate};
    pbr_result surveyed = survey_positions(instance, desc, &box);
    if (surveyed != PBR_OK) return surveyed;
    uint64_t count = keep_all ? desc->count : box.count;
    if (count < desc->count && !(kept = list_kept(instance, desc, count))) goto cleanup;
    fill.kept = kept;
    fill.points = *out = allocate(instance, count, &layout);
    if (!fill.points) goto cleanup;
    fill.points->dropped = desc->count - box.count;
    if (layout.wide) box_origin(box.minimum, box.maximum, fill.shift);
    for (int k = 0; k < 3; k++) fill.points->origin[k] = desc->origin[k] + fill.shift[k];
    for (uint32_t s = 0; s < desc->scalar_count; s++) copy_name(desc->scalars[s].name, fill.points->scalars[s].name);
    result = pbr_parallel(instance, (size_t)count, GRAIN, fill_range, &fill);
cleanup:
    pbr_free(instance, kept);
    return result;
}

pbr_result points_create(pbr_instance *instance, const pbr_points_desc *desc, bool keep_all, pbr_points **out) {
    pbr_points_desc d;
    pbr_attribute scalars[PBR_MAX_SCALARS];
    pbr_points *points = NULL;
    pbr_result result = read_desc(instance, "pbr_points_desc", desc, sizeof d, &d, sizeof d);
    if (result == PBR_OK) result = check_numbers(instance, &d);
    if (result == PBR_OK) result = check_attributes(instance, &d, scalars);
    if (result != PBR_OK) goto cleanup;
    struct progress progress = {d.progress, d.progress_user};
    result = progress_report(&progress, "copying points", 0);
    if (result == PBR_OK) result = copy_attributes(instance, &d, scalars, keep_all, &points);
    if (result == PBR_OK) result = progress_report(&progress, "copying points", 1);
    if (result == PBR_OK && !d.radii.data && d.flags & PBR_POINTS_ESTIMATE_RADII)
        result = radii_estimate(points, d.radius_neighbours, d.radius_scale, &progress, points->radii);
    if (result == PBR_OK) result = finish(points);
cleanup:
    if (result != PBR_OK) {
        destroy(points);
        points = NULL;
    }
    *out = points;
    return result;
}

pbr_result pbr_points_create(pbr_instance *instance, const pbr_points_desc *desc, pbr_points **out) {
    if (out) *out = NULL;
    if (!instance) return PBR_ERROR_INVALID_ARGUMENT;
    if (!desc || !out)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_points_create: %s is NULL", desc ? "out" : "desc");
    return points_create(instance, desc, false, out);
}

struct selection {
    const pbr_points *source;
    const uint32_t *chosen;
    const float *radii;
    pbr_points *points;
};

static pbr_result select_range(void *user, size_t begin, size_t end) {
    const struct selection *selection = user;
    const pbr_points *source = selection->source;
    pbr_points *points = selection->points;
    for (size_t i = begin; i < end; i++) {
        uint32_t from = selection->chosen[i];
        if (points->wide) memcpy(points->wide[i], source->wide[from], sizeof points->wide[i]);
        else memcpy(points->narrow[i], source->narrow[from], sizeof points->narrow[i]);
        if (points->normals) memcpy(points->normals[i], source->normals[from], sizeof points->normals[i]);
        if (points->colours) memcpy(points->colours[i], source->colours[from], sizeof points->colours[i]);
        for (uint32_t s = 0; s < points->scalar_count; s++) points->scalars[s].values[i] = source->scalars[s].values[from];
        points->radii[i] = selection->radii[i];
    }
    return PBR_OK;
}

pbr_result points_select(const pbr_points *source, const uint32_t *chosen, uint64_t count, const float *radii, pbr_points **out) {
    struct layout layout = {.wide = source->wide,
                            .normals = source->normals,
                            .colours = source->colours,
                            .radii = true,
                            .scalar_count = source->scalar_count};
    pbr_points *points = allocate(source->instance, count, &layout);
    *out = NULL;
    if (!points) return PBR_ERROR_OUT_OF_MEMORY;
    struct selection selection = {.source = source, .chosen = chosen, .radii = radii, .points = points};
    memcpy(points->origin, source->origin, sizeof points->origin);
    for (uint32_t s = 0; s < points->scalar_count; s++)
        memcpy(points->scalars[s].name, source->scalars[s].name, sizeof points->scalars[s].name);
    pbr_result result = pbr_parallel(source->instance, (size_t)count, GRAIN, select_range, &selection);
    if (result == PBR_OK) result = finish(points);
    if (result == PBR_OK) *out = points;
    else destroy(points);
    return result;
}

pbr_points *pbr_points_retain(pbr_points *points) {
    if (points) atomic_fetch_add(&points->references, 1);
    return points;
}

void pbr_points_release(pbr_points **points) {
    if (!points || !*points) return;
    if (atomic_fetch_sub(&(*points)->references, 1) == 1) destroy(*points);
    *points = NULL;
}

/* ---- Reading back ---- */

pbr_result pbr_points_get_info(const pbr_points *points, pbr_points_info *info) {
    if (!points || !info) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_points_info i = {.struct_size = sizeof i,
                         .count = points->count,
                         .dropped_count = points->dropped,
                         .bounding_radius = points->bounding_radius,
                         .radius_minimum = points->radius_minimum,
                         .radius_mean = points->radius_mean,
                         .radius_maximum = points->radius_maximum,
                         .has_normals = points->normals != NULL,
                         .has_colours = points->colours != NULL,
                         .has_radii = points->radii != NULL,
                         .scalar_count = points->scalar_count,
                         .memory_bytes = points->memory_bytes};
    for (int k = 0; k < 3; k++) {
        i.origin[k] = points->origin[k];
        if (points->count == 0) continue;
        i.minimum[k] = points->origin[k] + points->minimum[k];
        i.maximum[k] = points->origin[k] + points->maximum[k];
        i.centre[k] = points->origin[k] + (points->minimum[k] + points->maximum[k]) / 2;
    }
    return write_info(points->instance, "pbr_points_info", &i, sizeof i, info, sizeof i);
}

const char *pbr_points_scalar_name(const pbr_points *points, uint32_t index) {
    return points && index < points->scalar_count ? points->scalars[index].name : NULL;
}

static const char *copy_fault(const pbr_points *points, uint64_t first, uint64_t count, const pbr_points_copy_desc *desc) {
    if (first > points->count || count > points->count - first) return "the range is outside the set";
    if (desc->normals && !points->normals) return "the set has no normals";
    if (desc->colours && !points->colours) return "the set has no colours";
    if (desc->radii && !points->radii) return "the set has no radii";
    if (desc->scalar && desc->scalar_index >= points->scalar_count) return "the set has no such scalar";
    return desc->reserved != 0 ? "reserved is not 0" : NULL;
}

pbr_result pbr_points_copy(const pbr_points *points, uint64_t first, uint64_t count, const pbr_points_copy_desc *desc) {
    if (!points) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_points_copy_desc d;
    if (!desc) return pbr_log(points->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_points_copy: desc is NULL");
    pbr_result result = read_desc(points->instance, "pbr_points_copy_desc", desc, sizeof d, &d, sizeof d);
    if (result != PBR_OK) return result;
    const char *fault = copy_fault(points, first, count, &d);
    if (fault) return pbr_log(points->instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_points_copy: %s", fault);
    for (uint64_t i = 0; d.positions && i < count; i++) {
        double p[3];
        points_position(points, first + i, p);
        for (int k = 0; k < 3; k++) d.positions[3 * i + k] = points->origin[k] + p[k];
    }
    for (uint64_t i = 0; d.normals && i < count; i++) splat_decode_normal(points->normals[first + i], d.normals + 3 * i);
    if (count == 0) return PBR_OK;
    if (d.colours) memcpy(d.colours, points->colours[first], (size_t)count * sizeof *points->colours);
    if (d.radii) memcpy(d.radii, points->radii + first, (size_t)count * sizeof *points->radii);
    if (d.scalar) memcpy(d.scalar, points->scalars[d.scalar_index].values + first, (size_t)count * sizeof *d.scalar);
    return PBR_OK;
}
