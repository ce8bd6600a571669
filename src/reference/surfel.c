/* docs/splats.md: the splat in eye space, and the kinds. SPDX-License-Identifier: MIT */
#include "surfel.h"

#include "shade.h"

static bool is_billboard(uint32_t kind) {
    return kind <= PBR_SPLAT_SQUARE;
}

/* By a low-pass of the screen. */
static bool is_filtered(uint32_t kind) {
    return kind == PBR_SPLAT_EWA || kind == PBR_SPLAT_EWA_MAX;
}

/* ---- the splat in eye space ---- */

static bool passes_planes(const pbr_item *item, const struct placement *placement, const double position[3]) {
    double world[3];
    if (item->clip_plane_count == 0) return true;
    mat_point(placement->world, position, world);
    for (uint32_t i = 0; i < item->clip_plane_count; i++)
        if (!(row_point(item->clip_planes + (size_t)4 * i, world) >= 0)) return false;
    return true;
}

/* Unit, or 0. False if the splat is dropped as facing away. */
static bool find_normal(const struct placement *placement, const pbr_item *item, const float normal[3], const double to_eye[3],
                        double out[3]) {
    const double object[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
    mat_direction(placement->normal, object, out);
    vec_normalise(out);
    return vec_dot(out, to_eye) >= 0 || !(item->flags & PBR_ITEM_CULL_BACK_FACES);
}

/* Its diameter in pixels held between the item's sizes. OpenGL's points, which squares and circles are, are no smaller than 1. */
static double hold_size(const pbr_item *item, double pixels) {
    const double least = is_billboard(item->splat) ? 1 : 0, low = item->size_minimum > 0 ? (double)item->size_minimum : least;
    pixels = fmax(pixels, low);
    if (item->size_maximum > 0) pixels = fmin(pixels, (double)item->size_maximum);
    return is_billboard(item->splat) ? fmax(pixels, 1) : pixels;
}

/* The radius in object units, and across the largest stretch in eye units. */
struct radii {
    double object, eye;
};

static struct radii find_radii(const struct lens *lens, const pbr_item *item, const struct placement *placement, float radius,
                               double w) {
    struct radii r = {(double)radius * (double)item->radius_scale, 0};
    r.eye = r.object * placement->stretch;
    if (!(w > 0)) return r;
    const double pixels = 2 * r.eye * lens->focal / w, held = hold_size(item, pixels);
    if (held == pixels) return r;
    r.eye = held * w / (2 * lens->focal);
    if (placement->stretch > 0) r.object = r.eye / placement->stretch;
    return r;
}

/* Two unit vectors that with n, unit, are at right angles to each other. */
static void find_tangents(const double n[3], double a[3], double b[3]) {
    const int least = fabs(n[0]) < fabs(n[1]) ? fabs(n[0]) < fabs(n[2]) ? 0 : 2 : fabs(n[1]) < fabs(n[2]) ? 1 : 2;
    double axis[3] = {0, 0, 0};
    axis[least] = 1;
    vec_cross(n, axis, a);
    vec_normalise(a);
    vec_cross(n, a, b);
}

/* A disc of the normal n that is nearly seen from its edge turns towards the eye, with its axes, in the plane of n and the ray, in
 * object space. placement->normal holds cofactors, so that its transpose takes the ray there. pixels: the radius; not above 0:
 * behind the eye. */
static void turn_from_edge(const struct placement *placement, const double to_eye[3], double pixels, const double n[3], double a[3],
                           double b[3]) {
    double ray[3], turned[3];
    for (int k = 0; k < 3; k++) ray[k] = vec_dot(placement->normal + 4 * k, to_eye);
    if (!vec_normalise(ray)) return;
    const double cosine = vec_dot(n, ray), across = sqrt(1 - cosine * cosine);
    if (!(fabs(cosine) < KERNEL_EDGE_COSINE) || !(pixels > 0)) return;
    const double most = fmin(KERNEL_EDGE_HIGHER * fabs(cosine), KERNEL_EDGE_COSINE);
    const double wanted = copysign(fmin(most, fabs(cosine) + KERNEL_EDGE_PIXELS / pixels), cosine);
    for (int k = 0; k < 3; k++) turned[k] = sqrt(1 - wanted * wanted) / across * (n[k] - cosine * ray[k]) + wanted * ray[k];
    const double share = 1 / (1 + vec_dot(n, turned)), along_a = share * vec_dot(a, turned), along_b = share * vec_dot(b, turned);
    for (int k = 0; k < 3; k++) {
        a[k] -= along_a * (n[k] + turned[k]);
        b[k] -= along_b * (n[k] + turned[k]);
    }
}

/* The disc's axes: with a normal across it in object space, then transformed; without, across the direction to the eye. */
static void find_axes(const struct placement *placement, const float normal[3], const double to_eye[3], struct radii r,
                      double pixels, struct surfel *out) {
    double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]}, a[3], b[3];
    if (vec_normalise(n)) {
        disc_tangents(n, a, b); /* those that fields of normals count along */
        turn_from_edge(placement, to_eye, pixels, n, a, b);
        mat_direction(placement->eye, a, out->a);
        mat_direction(placement->eye, b, out->b);
        for (int k = 0; k < 3; k++) {
            out->a[k] *= r.object;
            out->b[k] *= r.object;
        }
        return;
    }
    find_tangents(to_eye, out->a, out->b);
    for (int k = 0; k < 3; k++) {
        out->a[k] *= r.eye;
        out->b[k] *= r.eye;
    }
}

/* n + u A + v B, made unit at its centre, in eye space (Botsch et al. 2004). `drawn`: the radius in object units. */
static void find_field(const struct placement *placement, const struct sample *sample, double drawn, struct surfel *out) {
    double n[3] = {(double)sample->normal[0], (double)sample->normal[1], (double)sample->normal[2]}, in_eye[3], t[3], b[3];
    double along_u[2], along_v[2];
    for (int k = 0; k < 3; k++) out->turn_u[k] = out->turn_v[k] = 0;
    if (!sample->field || !vec_normalise(n)) return;
    disc_tangents(n, t, b);
    normal_field_decode(sample->field, along_u, along_v);
    mat_direction(placement->normal, n, in_eye);
    const double length = sqrt(vec_dot(in_eye, in_eye)), larger = sample->radius > 0 ? drawn / (double)sample->radius : 0;
    double object_u[3], object_v[3];
    for (int k = 0; k < 3; k++) {
        object_u[k] = larger * (along_u[0] * t[k] + along_u[1] * b[k]) / length;
        object_v[k] = larger * (along_v[0] * t[k] + along_v[1] * b[k]) / length;
    }
    mat_direction(placement->normal, object_u, out->turn_u);
    mat_direction(placement->normal, object_v, out->turn_v);
}

static void on_disc(const double row[4], const struct surfel *surfel, double out[3]) {
    out[0] = row_direction(row, surfel->a);
    out[1] = row_direction(row, surfel->b);
    out[2] = row_point(row, surfel->centre);
}

static void find_rows(const struct lens *lens, struct surfel *surfel) {
    on_disc(lens->x, surfel, surfel->x);
    on_disc(lens->y, surfel, surfel->y);
    on_disc(lens->w, surfel, surfel->w);
    on_disc(lens->depth, surfel, surfel->depth);
    on_disc(lens->near, surfel, surfel->near);
    on_disc(lens->far, surfel, surfel->far);
    on_disc(lens->axis, surfel, surfel->along);
    surfel->distance = surfel->along[2];
    surfel->window[0] = surfel->x[2] / surfel->w[2];
    surfel->window[1] = surfel->y[2] / surfel->w[2];
}

static bool centre_is_in_view(const struct surfel *surfel) {
    return surfel->w[2] > 0 && surfel->near[2] >= 0 && surfel->far[2] >= 0;
}

/* ---- ewa (Zwicker et al. 2001), ewa-max (Botsch et al. 2005) ---- */

/* The derivative of the window position with respect to u, v, at the centre. */
static void find_derivative(const struct surfel *surfel, double j[2][2]) {
    for (int k = 0; k < 2; k++) {
        j[0][k] = (surfel->x[k] - surfel->window[0] * surfel->w[k]) / surfel->w[2];
        j[1][k] = (surfel->y[k] - surfel->window[1] * surfel->w[k]) / surfel->w[2];
    }
}

/* The ellipse of the disc's outline on the screen by the products of its rows under diag(1, 1, -1) (Sigg et al. 2006), for two of
 * the window's coordinates that are 0 at the centre, `a` and `b` (times w): the middle's `a`, and the matrix's entry for both. */
static double find_entry(const struct surfel *surfel, const double a[2], const double b[2], double *middle) {
    const double *w = surfel->w, ww = w[0] * w[0] + w[1] * w[1] - w[2] * w[2];
    *middle = (a[0] * w[0] + a[1] * w[1]) / ww;
    return *middle * (b[0] * w[0] + b[1] * w[1]) / ww - (a[0] * b[0] + a[1] * b[1]) / ww;
}

/* What is affine on the disc, times w, less its value at the centre. */
static void less_centre(const struct surfel *surfel, const double row[3], double out[2]) {
    for (int k = 0; k < 2; k++) out[k] = row[k] - row[2] / surfel->w[2] * surfel->w[k];
}

/* False if the disc's plane is seen edge on. `j`: as find_derivative gives it. */
static bool linearise(struct surfel *surfel, double j[2][2]) {
    const double det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
    double along[2];
    less_centre(surfel, surfel->depth, along);
    surfel->reach = sqrt(fmax(find_entry(surfel, along, along, &surfel->shift), 0));
    surfel->to_disc[0][0] = j[1][1] / det;
    surfel->to_disc[0][1] = -j[0][1] / det;
    surfel->to_disc[1][0] = -j[1][0] / det;
    surfel->to_disc[1][1] = j[0][0] / det;
    for (int k = 0; k < 2; k++)
        surfel->slope[k] = (along[0] * surfel->to_disc[0][k] + along[1] * surfel->to_disc[1][k]) / surfel->w[2];
    return fabs(det) > 0 && isfinite(surfel->slope[0]) && isfinite(surfel->slope[1]);
}

/* False if the splat has no weight. `low`, `high`: of the box of what the filter reaches. */
static bool filter(struct surfel *surfel, double low[2], double high[2]) {
    const double added = KERNEL_SIGMAS * KERNEL_SIGMAS * (double)surfel->item->desc.low_pass;
    double j[2][2], x[2], y[2], unused, xx = 0, xy = 0, yy = 0, before = 1;
    find_derivative(surfel, j);
    if (!linearise(surfel, j)) return false;
    surfel->middle[0] = surfel->middle[1] = 0;
    if (surfel->kind == PBR_SPLAT_EWA) {
        less_centre(surfel, surfel->x, x);
        less_centre(surfel, surfel->y, y);
        xx = find_entry(surfel, x, x, &surfel->middle[0]);
        yy = find_entry(surfel, y, y, &surfel->middle[1]);
        xy = find_entry(surfel, x, y, &unused);
        before = fmax(xx * yy - xy * xy, 0);
    }
    xx += added;
    yy += added;
    const double after = xx * yy - xy * xy;
    surfel->filter[0] = yy / after;
    surfel->filter[1] = -xy / after;
    surfel->filter[2] = xx / after;
    surfel->peak = surfel->kind == PBR_SPLAT_EWA ? fmax(sqrt(before / after), KERNEL_LEAST_HEIGHT) : 1;
    for (int k = 0; k < 2; k++) {
        surfel->middle[k] += surfel->window[k];
        low[k] = surfel->middle[k] - sqrt(k == 0 ? xx : yy);
        high[k] = surfel->middle[k] + sqrt(k == 0 ? xx : yy);
    }
    return surfel->kind != PBR_SPLAT_EWA || before > 0;
}

/* ---- bounds ---- */

/* The largest value on the disc of what is affine there. */
static double most(const double row[3]) {
    return row[2] + hypot(row[0], row[1]);
}

/* Where x / w has its extremes over the unit disc, from its centre's: the roots of the quadratic that the rows' products under
 * diag(1, 1, -1) make (Sigg et al. 2006). Without bounds where the disc comes near w = 0. */
static void find_extremes(const double x[3], const double w[3], double centre, double *low, double *high) {
    const double shifted[2] = {x[0] - centre * w[0], x[1] - centre * w[1]};
    const double ww = w[0] * w[0] + w[1] * w[1] - w[2] * w[2], xw = shifted[0] * w[0] + shifted[1] * w[1];
    const double root = sqrt(xw * xw - ww * (shifted[0] * shifted[0] + shifted[1] * shifted[1]));
    const bool in_front = w[2] > 0 && ww < -1e-9 * w[2] * w[2];
    *low = in_front ? centre + (xw + root) / ww : -INFINITY;
    *high = in_front ? centre + (xw - root) / ww : INFINITY;
}

/* The rectangle of the window around the disc. False if all of it is behind the eye or a plane. */
static bool bound_disc(const struct surfel *surfel, double low[2], double high[2]) {
    if (!(most(surfel->w) > 0) || most(surfel->near) < 0 || most(surfel->far) < 0) return false;
    find_extremes(surfel->x, surfel->w, surfel->window[0], &low[0], &high[0]);
    find_extremes(surfel->y, surfel->w, surfel->window[1], &low[1], &high[1]);
    return true;
}

/* `from`, `to`: a rectangle of the window that a filter reaches. */
static bool find_box(const struct lens *lens, const double from[2], const double to[2], struct surfel *surfel) {
    double low[2], high[2];
    if (!is_billboard(surfel->kind) && !bound_disc(surfel, low, high)) return false;
    for (int k = 0; k < 2 && is_billboard(surfel->kind); k++) {
        low[k] = surfel->window[k] - surfel->radius;
        high[k] = surfel->window[k] + surfel->radius;
    }
    for (int k = 0; k < 2 && is_filtered(surfel->kind); k++) {
        low[k] = fmin(low[k], from[k]);
        high[k] = fmax(high[k], to[k]);
    }
    return lens_pixels(lens, low, high, surfel->box);
}

/* Of a splat whose centre is in view. False if that is in no pixel. */
static bool find_home(const struct lens *lens, struct surfel *surfel) {
    for (int k = 0; k < 2; k++) {
        const double at = floor(surfel->window[k]);
        if (!(at >= lens->box[k] && at < lens->box[2 + k])) return false;
        surfel->home[k] = (int32_t)at;
    }
    return true;
}

/* The box is to hold the home, too, which the splat need not cover. `is_seen`: there is a box yet. */
static void widen_box(struct surfel *surfel, bool is_seen) {
    for (int k = 0; k < 2; k++) {
        const int32_t home = surfel->home[k];
        if (!is_seen || home < surfel->box[k]) surfel->box[k] = home;
        if (!is_seen || home >= surfel->box[2 + k]) surfel->box[2 + k] = home + 1;
    }
}

/* ---- the whole ---- */

/* Near splats need no low-pass, and their linearisation fails. */
static uint32_t find_kind(const struct lens *lens, const struct surfel *surfel, double radius) {
    const uint32_t wanted = surfel->item->desc.splat;
    const bool is_near = !lens->is_parallel && radius >= KERNEL_NEAR_RADIUS * surfel->distance;
    return is_filtered(wanted) && (is_near || !centre_is_in_view(surfel)) ? PBR_SPLAT_GAUSSIAN : wanted;
}

/* epsilon, or in perspective its part of the distance. */
static double find_set_back(const struct lens *lens, const struct surfel *surfel, double radius, double cosine) {
    const double blur = KERNEL_SIGMAS * sqrt((double)surfel->item->desc.low_pass) * surfel->w[2] / lens->focal;
    const double reach = is_filtered(surfel->kind)    ? hypot(radius, blur)
                         : is_billboard(surfel->kind) ? KERNEL_FILL_REACH * radius
                                                      : radius;
    const double slope = cosine * KERNEL_MOST_SLOPE > 1 ? 1 / cosine : KERNEL_MOST_SLOPE, epsilon = KERNEL_EPSILON * reach * slope;
    return lens->is_parallel ? epsilon : epsilon / fmax(surfel->distance, reach);
}

bool surfel_place(const struct scene *scene, const struct walk *at, const struct sample *sample, struct surfel *out) {
    const struct scene_item *item = at->item;
    const struct placement *placement = &at->placement;
    const struct lens *lens = &scene->lens;
    double to_eye[3], from[2], to[2];
    out->item = item;
    out->home[0] = out->home[1] = -1;
    if (!passes_planes(&item->desc, placement, sample->position)) return false;
    mat_point(placement->eye, sample->position, out->centre);
    lens_to_eye(lens, out->centre, to_eye);
    if (!find_normal(placement, &item->desc, sample->normal, to_eye, out->normal)) return false;
    const double w = row_point(lens->w, out->centre);
    const struct radii r = find_radii(lens, &item->desc, placement, sample->radius, w);
    find_axes(placement, sample->normal, to_eye, r, r.eye * lens->focal / w, out);
    find_field(placement, sample, r.object, out);
    find_rows(lens, out);
    out->kind = find_kind(lens, out, r.eye);
    out->radius = r.eye * lens->focal / w;
    if (is_billboard(out->kind) && !centre_is_in_view(out)) return false;
    if (is_filtered(out->kind) && !filter(out, from, to)) return false;
    const bool has_normal = vec_dot(out->normal, out->normal) > 0;
    out->set_back = find_set_back(lens, out, r.eye, has_normal ? fabs(vec_dot(out->normal, to_eye)) : 1);
    const bool is_seen = find_box(lens, from, to, out);
    if (item->desc.blending != PBR_BLEND_FILL || !centre_is_in_view(out) || !find_home(lens, out)) return is_seen;
    widen_box(out, is_seen);
    return true;
}

void surfel_shade(const struct scene *scene, const struct sample *sample, struct surfel *surfel) {
    const struct scene_item *item = surfel->item;
    const double normal[3] = {(double)sample->normal[0], (double)sample->normal[1], (double)sample->normal[2]};
    const struct colouring from = {item->info.has_colours ? sample->colour : NULL, normal, (double)sample->scalar,
                                   surfel->distance};
    const uint32_t shading = item->desc.shading;
    const bool waits = shading >= PBR_SHADE_DEFERRED && item->desc.splat >= PBR_SPLAT_GAUSSIAN;
    double albedo[3];
    shade_albedo(item, &from, albedo);
    if (shading == PBR_SHADE_NONE || waits) memcpy(surfel->colour, albedo, sizeof albedo);
    else shade_phong(scene, &item->desc.material, albedo, surfel->centre, surfel->normal, surfel->colour);
}

/* ---- at a pixel ---- */

/* Where the pixel's ray meets the disc's plane: it lies in two planes, whose rows on the disc are `right` and `up`. Returns rho^2,
 * infinite where they do not meet before the eye. */
static double meet_plane(const struct surfel *surfel, double x, double y, struct fragment *out) {
    double right[3], up[3], at[3];
    for (int k = 0; k < 3; k++) {
        right[k] = surfel->x[k] - x * surfel->w[k];
        up[k] = surfel->y[k] - y * surfel->w[k];
    }
    vec_cross(right, up, at);
    const double on[3] = {out->u = at[0] / at[2], out->v = at[1] / at[2], 1}, w = vec_dot(surfel->w, on);
    const double squared = out->u * out->u + out->v * out->v;
    out->distance = vec_dot(surfel->along, on);
    out->depth = vec_dot(surfel->depth, on) / w;
    out->covers = w > 0 && vec_dot(surfel->near, on) >= 0 && vec_dot(surfel->far, on) >= 0 && squared <= 1;
    return w > 0 && !isnan(squared) ? squared : INFINITY;
}

/* Squares side by side share no pixel. The smallest circles fill their square, so that they cover one, too. */
static bool cover_billboard(const struct surfel *surfel, double dx, double dy, struct fragment *out) {
    const double half = surfel->radius, squared = fmax(half * half, 0.5);
    out->distance = surfel->distance;
    out->depth = surfel->depth[2] / surfel->w[2];
    out->weight = 1;
    out->covers = dx >= -half && dx < half && dy >= -half && dy < half;
    if (surfel->kind == PBR_SPLAT_CIRCLE) out->covers &= dx * dx + dy * dy <= squared;
    return out->covers;
}

static bool cover_disc(const struct surfel *surfel, double x, double y, struct fragment *out) {
    const double squared = meet_plane(surfel, x, y, out);
    out->weight = surfel->kind == PBR_SPLAT_GAUSSIAN ? surfel_weight(squared) : 1;
    return out->covers;
}

/* Beyond the disc it is at the plane's depth, held to what the disc reaches. False if there is none between the planes. */
static bool extend(const struct lens *lens, const struct surfel *surfel, double x, double y, struct fragment *out) {
    const double change = surfel->slope[0] * (x - surfel->window[0]) + surfel->slope[1] * (y - surfel->window[1]);
    double point[3];
    out->depth = surfel->depth[2] / surfel->w[2] + fmin(fmax(change, surfel->shift - surfel->reach), surfel->shift + surfel->reach);
    if (!lens_unproject(lens, x, y, out->depth, point)) return false;
    out->distance = row_point(lens->axis, point);
    return row_point(lens->near, point) >= 0 && row_point(lens->far, point) >= 0;
}

/* A weight that is 0 in double is none. */
static bool weigh(const struct lens *lens, const struct surfel *surfel, double x, double y, struct fragment *out) {
    const double dx = x - surfel->middle[0], dy = y - surfel->middle[1], *form = surfel->filter;
    const double filtered = form[0] * dx * dx + 2 * form[1] * dx * dy + form[2] * dy * dy, met = meet_plane(surfel, x, y, out);
    const double squared = surfel->kind == PBR_SPLAT_EWA_MAX ? fmin(met, filtered) : filtered;
    out->weight = squared <= 1 ? surfel->peak * surfel_weight(squared) : 0;
    if (surfel->kind == PBR_SPLAT_EWA) {
        out->u = surfel->to_disc[0][0] * dx + surfel->to_disc[0][1] * dy;
        out->v = surfel->to_disc[1][0] * dx + surfel->to_disc[1][1] * dy;
    } else if (isinf(met)) {
        out->u = out->v = 0; /* infinitely far beyond the rim the normal is the centre's again */
    }
    return out->covers || (out->weight > 0 && extend(lens, surfel, x, y, out));
}

bool surfel_fragment(const struct lens *lens, const struct surfel *surfel, double x, double y, struct fragment *out) {
    *out = (struct fragment){.surfel = surfel};
    if (is_filtered(surfel->kind)) return weigh(lens, surfel, x, y, out);
    if (!is_billboard(surfel->kind)) return cover_disc(surfel, x, y, out);
    return cover_billboard(surfel, x - surfel->window[0], y - surfel->window[1], out);
}
