/* Normal fields against closed forms. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/matrix.h"
#include "core/normal_field.h"
#include "core/splat.h"

#define OCT_ERROR 6.5e-5    /* rad, of a decoded normal: splat.h */
#define DAMPING (1.0 / 512) /* as normal_field.c states */

/* What octahedral normals, each wrong by e, add at the rim. With M = sum w x x^T, the field is r/h sum w y x^T (M + DAMPING)^-1,
 * and y is wrong by at most 2e (a neighbour's normal and the point's own). By Cauchy and Schwarz that is 2e sqrt(sum w / m), m the
 * smallest eigenvalue of M. Around points of these tests sum w < 9 m and m > 0.4; evenly spread ones have 4 m, and 0.7. */
#define NOISE (6 * OCT_ERROR)
#define DAMPED (DAMPING / 0.4) /* the part of the field that damping takes off is DAMPING / (m + DAMPING) */

enum { MOST_POINTS = 20000 };

static double positions[MOST_POINTS][3], normals[MOST_POINTS][3];
static float radii[MOST_POINTS];
static struct normal_field fields[MOST_POINTS];

static pbr_points *make_points(pbr_instance *instance, uint64_t count) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT64, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

static pbr_points *fit(pbr_instance *instance, uint64_t count, uint32_t neighbours) {
    pbr_points *points = make_points(instance, count);
    memset(fields, 0x55, sizeof fields);
    assert_int_equal(normal_field_fit(points, neighbours, NULL, fields), PBR_OK);
    return points;
}

static void find_frame(const pbr_points *points, uint64_t i, double n[3], double t[3], double b[3]) {
    float decoded[3];
    splat_decode_normal(points->normals[i], decoded);
    for (int k = 0; k < 3; k++) n[k] = (double)decoded[k];
    disc_tangents(n, t, b);
}

/* By how much the field changes the normal at `offset` radii from the point, object space. */
static void change_at(const pbr_points *points, uint64_t i, const double offset[3], double out[3]) {
    double n[3], t[3], b[3], fa[2], fb[2];
    find_frame(points, i, n, t, b);
    normal_field_decode(&fields[i], fa, fb);
    const double u = dot3(offset, t), v = dot3(offset, b);
    for (int k = 0; k < 3; k++) out[k] = (u * fa[0] + v * fb[0]) * t[k] + (u * fa[1] + v * fb[1]) * b[k];
}

static double distance(const double a[3], const double b[3]) {
    const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return length3(d);
}

static double angle_between(const double a[3], const double b[3]) {
    double cross[3];
    cross3(a, b, cross);
    return atan2(length3(cross), dot3(a, b));
}

/* The most by which a field changes a normal, over the rim. */
static double largest_change(const struct normal_field *field) {
    double a[2], b[2];
    normal_field_decode(field, a, b);
    const double sum = dot3((double[]){a[0], a[1], 0}, (double[]){a[0], a[1], 0}) + b[0] * b[0] + b[1] * b[1];
    const double determinant = a[0] * b[1] - a[1] * b[0];
    return sqrt((sum + sqrt(fmax(0, sum * sum - 4 * determinant * determinant))) / 2);
}

static bool is_zero(const struct normal_field *field) {
    return field->a[0] == 0 && field->a[1] == 0 && field->b[0] == 0 && field->b[1] == 0;
}

/* ---- Surfaces ---- */

/* Evenly along a spiral around the origin; normals point outwards (side 1) or inwards (-1). */
static void sample_sphere(uint64_t first, uint64_t count, double radius, double side, float splat) {
    for (uint64_t i = 0; i < count; i++) {
        const double z = 1 - (2 * (double)i + 1) / (double)count, a = 2.399963229728653 * (double)i, r = sqrt(1 - z * z);
        const double n[3] = {r * cos(a), r * sin(a), z};
        for (int k = 0; k < 3; k++) {
            positions[first + i][k] = radius * n[k];
            normals[first + i][k] = side * n[k];
        }
        radii[first + i] = splat;
    }
}

static double sphere_spacing(uint64_t count) {
    return sqrt(4 * 3.14159265358979 / (double)count); /* in radii of the sphere */
}

/* A square of side x side samples at spacing 1 in the plane z = 0, each moved by up to `jitter`. */
static void sample_plane(uint64_t first, int side, double jitter) {
    uint64_t random = 5;
    for (int i = 0; i < side * side; i++) {
        double *p = positions[first + (uint64_t)i];
        p[0] = i % side + jitter * (2 * uniform(&random) - 1);
        p[1] = (double)(i / side) + jitter * (2 * uniform(&random) - 1);
        p[2] = 0;
        memcpy(normals[first + (uint64_t)i], (double[]){0, 0, 1}, sizeof *normals);
        radii[first + (uint64_t)i] = 1;
    }
}

/* A graph z = (x^2 - y^2 + x y) / 60 over a jittered grid around 0, normals disturbed by up to `noise`. */
static void sample_bowl(int side, double noise) {
    uint64_t random = 8;
    sample_plane(0, side, 0.3);
    for (int i = 0; i < side * side; i++) {
        double *p = positions[i];
        p[0] -= side / 2.0;
        p[1] -= side / 2.0;
        p[2] = (p[0] * p[0] - p[1] * p[1] + p[0] * p[1]) / 60;
        normals[i][0] = -(2 * p[0] + p[1]) / 60 + noise * (2 * uniform(&random) - 1);
        normals[i][1] = (2 * p[1] - p[0]) / 60 + noise * (2 * uniform(&random) - 1);
    }
}

/* Some rotation, its rows orthonormal. */
static const double turned[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}};

static void rotate(const double v[3], double out[3]) {
    for (int k = 0; k < 3; k++) out[k] = dot3(turned[k], v);
}

static void rotate_all(uint64_t count, const double moved[3]) {
    for (uint64_t i = 0; i < count; i++) {
        double p[3], n[3];
        rotate(positions[i], p);
        rotate(normals[i], n);
        for (int k = 0; k < 3; k++) positions[i][k] = p[k] + moved[k];
        memcpy(normals[i], n, sizeof n);
    }
}

/* ---- What it reproduces ---- */

/* The largest angle, over the discs, between the field and the sphere's normal at its point nearest to that of the disc. */
static double sphere_error(const pbr_points *points, uint64_t first, uint64_t count, double side) {
    double worst = 0;
    for (uint64_t i = first; i < first + count; i++)
        for (int s = 0; s < 24; s++) {
            double n[3], t[3], b[3], offset[3], found[3], expected[3];
            const double rho = s % 3 / 2.0, u = rho * cos(0.7 * s), v = rho * sin(0.7 * s);
            find_frame(points, i, n, t, b);
            for (int k = 0; k < 3; k++) offset[k] = u * t[k] + v * b[k];
            change_at(points, i, offset, found);
            for (int k = 0; k < 3; k++) {
                found[k] += n[k];
                expected[k] = side * (positions[i][k] + (double)radii[i] * offset[k]);
            }
            worst = fmax(worst, angle_between(found, expected));
        }
    return worst;
}

/* Exact but for the damping, and for what two roundings of normals and one of the field do. */
static double sphere_bound(double splat, double radius) {
    return DAMPED * splat / radius + NOISE + OCT_ERROR + NORMAL_FIELD_UNIT;
}

static void spheres_are_reproduced_over_the_whole_disc(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const uint64_t counts[] = {200, 1000, 15000};
    for (int i = 0; i < 18; i++) {
        const uint64_t count = counts[i % 3];
        const double side = i / 3 % 2 ? -1 : 1, radius = i % 2 ? 1000 : 0.1, factors[] = {0.1, 1, 1.5};
        const double splat = factors[i / 6] * sphere_spacing(count);
        sample_sphere(0, count, radius, side, (float)(splat * radius));
        pbr_points *points = fit(instance, count, 0);
        const double error = sphere_error(points, 0, count, side), bound = sphere_bound(splat, 1);
        if (side > 0) print_message("r / R %.4f: constant %.5f, field %.5f, bound %.5f rad\n", splat, atan(splat), error, bound);
        assert_true(error <= bound);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

static void cylinders_turn_in_one_direction_only(void **state) {
    (void)state;
    enum { AROUND = 60, ALONG = 40, POINTS = AROUND * ALONG };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double step = 6.283185307179586 / AROUND, axis[3] = {turned[0][2], turned[1][2], turned[2][2]}, none[3] = {0, 0, 0};
    uint64_t random = 3;
    for (int i = 0; i < POINTS; i++) {
        const double angle = step * (i % AROUND + 0.3 * uniform(&random)),
                     z = step * ((double)(i / AROUND) + 0.3 * uniform(&random));
        memcpy(positions[i], (double[]){cos(angle), sin(angle), z}, sizeof *positions);
        memcpy(normals[i], (double[]){cos(angle), sin(angle), 0}, sizeof *normals);
        radii[i] = (float)step;
    }
    rotate_all(POINTS, none);
    pbr_points *points = fit(instance, POINTS, 0);
    for (uint64_t i = 0; i < POINTS; i++) {
        double around[3], found[3], expected[3];
        change_at(points, i, axis, found);
        assert_true(length3(found) <= NOISE + NORMAL_FIELD_UNIT);
        cross3(axis, normals[i], around);
        change_at(points, i, around, found);
        for (int k = 0; k < 3; k++) expected[k] = around[k] * step;
        assert_true(distance(found, expected) <= sphere_bound(step, 1));
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void planes_have_a_zero_field(void **state) {
    (void)state;
    enum { SIDE = 30 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0, SIDE, 0.4);
    rotate_all(SIDE * SIDE, (double[]){5, 6, 7});
    pbr_points *points = fit(instance, SIDE * SIDE, 0);
    for (int i = 0; i < SIDE * SIDE; i++) assert_true(is_zero(&fields[i]));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* z = c (x^2 - y^2) / 2: the normal turns towards -x along x and towards y along y. */
static void saddles_turn_both_ways(void **state) {
    (void)state;
    enum { SIDE = 21, POINTS = SIDE * SIDE };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double c = 0.05;
    sample_plane(0, SIDE, 0);
    for (int i = 0; i < POINTS; i++) {
        double *p = positions[i];
        p[0] -= SIDE / 2;
        p[1] -= SIDE / 2;
        p[2] = c * (p[0] * p[0] - p[1] * p[1]) / 2;
        normals[i][0] = -c * p[0];
        normals[i][1] = c * p[1];
    }
    pbr_points *points = fit(instance, POINTS, 0);
    for (int k = 0; k < 2; k++) {
        double along[3] = {k == 0, k == 1, 0}, found[3], expected[3] = {k == 0 ? -c : 0, k == 1 ? c : 0, 0};
        change_at(points, POINTS / 2, along, found);
        /* Neighbours are at most 2 away: there y is less than its linear part by the factor 1 / sqrt(1 + 4 c^2). */
        assert_true(distance(found, expected) <= c * (DAMPED + 2 * c * c) + NOISE + NORMAL_FIELD_UNIT);
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static double noisy_plane_error(pbr_instance *instance, uint32_t neighbours) {
    enum { SIDE = 60 };
    uint64_t random = 77;
    double sum = 0;
    sample_plane(0, SIDE, 0.3);
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int k = 0; k < 2; k++) normals[i][k] = 0.1 * (uniform(&random) + uniform(&random) - 1);
    pbr_points *points = fit(instance, SIDE * SIDE, neighbours);
    for (int i = 0; i < SIDE * SIDE; i++) sum += largest_change(&fields[i]) * largest_change(&fields[i]);
    pbr_points_release(&points);
    return sqrt(sum / (SIDE * SIDE));
}

/* k neighbours reach as far as sqrt k spacings, and average k errors: a slope's error falls as 1 / k. Half of that is asked for,
 * and as little noise at the rim as a constant normal has. */
static void noise_averages_out_with_more_neighbours(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double few = noisy_plane_error(instance, 4), some = noisy_plane_error(instance, 12),
                 many = noisy_plane_error(instance, 32);
    print_message("4 neighbours: %.4f, 12: %.4f, 32: %.4f\n", few, some, many);
    assert_true(some < few / 1.5 && many < some / 1.33);
    assert_true(is_zero(&fields[0]) == false && some < 0.1 / sqrt(3));
    assert_true(noisy_plane_error(instance, 0) == some);
    host_stop(&host, instance);
}

/* ---- What does not count ---- */

static void back_of_a_thin_plate_does_not_count(void **state) {
    (void)state;
    enum { POINTS = 3000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double spacing = sphere_spacing(POINTS), inner = 1 - spacing / 4;
    sample_sphere(0, POINTS, 1, 1, (float)spacing);
    sample_sphere(POINTS, POINTS, inner, -1, (float)spacing);
    rotate_all(POINTS, (double[]){0, 0, 0}); /* so that the samples of the two do not face each other */
    pbr_points *points = fit(instance, 2 * POINTS, 24);
    assert_true(sphere_error(points, 0, POINTS, 1) <= sphere_bound(spacing, 1));
    assert_true(sphere_error(points, POINTS, POINTS, -1) <= sphere_bound(spacing, inner));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void sheets_above_do_not_count(void **state) {
    (void)state;
    enum { SIDE = 30, POINTS = SIDE * SIDE };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0, SIDE, 0.3);
    sample_plane(POINTS, SIDE, 0);
    for (int i = POINTS; i < 2 * POINTS; i++) {
        positions[i][2] = 1.5;
        normals[i][0] = 0.5;
    }
    pbr_points *points = fit(instance, 2 * POINTS, 24);
    for (int i = 0; i < POINTS; i++) assert_true(is_zero(&fields[i]));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* Eight points of a sphere, then nothing for ten times as far: there stand points of the same plane that would turn it the other
 * way.
 */
static void neighbours_far_beyond_the_others_do_not_count(void **state) {
    (void)state;
    enum { NEAR = 8, FAR = 4 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (int i = 0; i < 1 + NEAR + FAR; i++) {
        const bool is_far = i > NEAR;
        const double angle = i * 3.14159265358979 / (is_far ? 2 : 4), tilt = i == 0 ? 0 : is_far ? -1 : 0.1, reach = sin(tilt);
        memcpy(positions[i], (double[]){reach * cos(angle), reach * sin(angle), cos(tilt)}, sizeof *positions);
        memcpy(normals[i], positions[i], sizeof *normals);
        if (is_far) memcpy(positions[i], (double[]){-reach * cos(angle), -reach * sin(angle), 1}, sizeof *positions);
        radii[i] = 0.1f;
    }
    pbr_points *points = fit(instance, 1 + NEAR + FAR, 0);
    assert_true(sphere_error(points, 0, 1, 1) <= sphere_bound(0.1, 1));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void points_without_a_normal_or_radius_get_none_and_do_not_disturb(void **state) {
    (void)state;
    enum { POINTS = 2000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double spacing = sphere_spacing(POINTS);
    sample_sphere(0, POINTS, 1, 1, (float)spacing);
    for (int i = 0; i < POINTS; i += 5) memset(normals[i], 0, sizeof *normals);
    for (int i = 1; i < POINTS; i += 5) radii[i] = i % 2 ? 0 : NAN;
    pbr_points *points = fit(instance, POINTS, 0);
    for (uint64_t i = 0; i < POINTS; i++)
        if (i % 5 < 2) assert_true(is_zero(&fields[i]));
        else assert_true(sphere_error(points, i, 1, 1) <= sphere_bound(spacing, 1));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void sets_without_normals_or_radii_get_none(void **state) {
    (void)state;
    enum { POINTS = 100 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_sphere(0, POINTS, 1, 1, 0.3f);
    for (int missing = 0; missing < 2; missing++) {
        pbr_points_desc desc = PBR_POINTS_DESC_INIT;
        pbr_points *points;
        desc.count = POINTS;
        desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT64, 3};
        if (missing == 0) desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
        else desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT64, 3};
        assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
        memset(fields, 0x55, sizeof fields);
        assert_int_equal(normal_field_fit(points, 0, NULL, fields), PBR_OK);
        for (int i = 0; i < POINTS; i++) assert_true(is_zero(&fields[i]));
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

/* ---- Degenerate neighbourhoods ---- */

/* Samples along a circle of radius 10 about the y axis, 0.1 apart, each given `copies` times; the surface across is not known. */
static void sample_line(uint64_t count, uint64_t copies) {
    for (uint64_t i = 0; i < count * copies; i++) {
        const double a = 0.1 * (double)(i / copies);
        memcpy(positions[i], (double[]){10 * sin(a), 0, 10 * cos(a)}, sizeof *positions);
        memcpy(normals[i], (double[]){sin(a), 0, cos(a)}, sizeof *normals);
        radii[i] = 1;
    }
}

static void check_line(const pbr_points *points, uint64_t i) {
    const double across[3] = {0, 1, 0};
    double along[3], found[3];
    change_at(points, i, across, found);
    assert_true(length3(found) <= NORMAL_FIELD_UNIT);
    cross3(across, normals[i], along);
    change_at(points, i, along, found);
    /* A single neighbour has the weight exp(-2): the damping counts for more. */
    assert_true(fabs(dot3(found, along) - 0.1) <= 0.1 * DAMPING / exp(-2) + NOISE + NORMAL_FIELD_UNIT);
    assert_true(fabs(dot3(found, across)) <= NOISE + NORMAL_FIELD_UNIT);
}

static void lines_turn_along_themselves_only(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    for (uint64_t count = 0; count < 20; count++)
        for (uint64_t copies = 1; copies <= 8; copies += 7) { /* of eight, most of the neighbours coincide with the point */
            sample_line(count, copies);
            pbr_points *points = fit(instance, count * copies, 0);
            for (uint64_t i = 0; i < count * copies; i++)
                if (count == 1) assert_true(is_zero(&fields[i]));
                else check_line(points, i);
            pbr_points_release(&points);
        }
    host_stop(&host, instance);
}

static void coincident_points_get_none(void **state) {
    (void)state;
    enum { POINTS = 100 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_sphere(0, POINTS, 1, 1, 0.3f);
    memset(positions, 0, sizeof positions);
    pbr_points *points = fit(instance, POINTS, 0);
    for (int i = 0; i < POINTS; i++) assert_true(is_zero(&fields[i]));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void twice_given_points_change_nothing(void **state) {
    (void)state;
    enum { POINTS = 1000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    const double spacing = sphere_spacing(POINTS);
    sample_sphere(0, POINTS, 1, 1, (float)spacing);
    sample_sphere(POINTS, POINTS, 1, 1, (float)spacing);
    pbr_points *points = fit(instance, 2 * POINTS, 24);
    assert_true(sphere_error(points, 0, 2 * POINTS, 1) <= sphere_bound(spacing, 1));
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* On a sphere a third as large as its splats, normals would turn by 72 degrees to the rim. */
static void normals_turn_by_sixty_degrees_at_most(void **state) {
    (void)state;
    enum { POINTS = 2000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_sphere(0, POINTS, 1, 1, 3);
    for (int i = 0; i < POINTS; i++) radii[i] = 3;
    pbr_points *points = fit(instance, POINTS, 32);
    for (int i = 0; i < POINTS; i++) {
        assert_true(largest_change(&fields[i]) <= NORMAL_FIELD_MOST + NORMAL_FIELD_UNIT);
        assert_true(largest_change(&fields[i]) >= NORMAL_FIELD_MOST - NORMAL_FIELD_UNIT);
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* A number of any magnitude that a float holds. */
static double wild(uint64_t *random) {
    return (uniform(random) < 0.5 ? -1 : 1) * pow(10, -44 + 82 * uniform(random));
}

static void nothing_makes_a_field_large(void **state) {
    (void)state;
    enum { POINTS = 4000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    uint64_t random = 12;
    for (int round = 0; round < 6; round++) {
        for (int i = 0; i < POINTS; i++) {
            for (int k = 0; k < 3; k++) {
                positions[i][k] = round % 3 == 0 ? wild(&random) : round % 3 == 1 ? floor(4 * uniform(&random)) : k * wild(&random);
                normals[i][k] = uniform(&random) - 0.5;
            }
            radii[i] = i % 4 == 0 ? 0 : round < 3 ? (float)fabs(wild(&random)) : (float)uniform(&random);
        }
        pbr_points *points = make_points(instance, POINTS);
        assert_int_equal(normal_field_fit(points, 1 + 6 * (uint32_t)round, NULL, fields), PBR_OK);
        for (int i = 0; i < POINTS; i++) assert_true(largest_change(&fields[i]) <= NORMAL_FIELD_MOST + NORMAL_FIELD_UNIT);
        pbr_points_release(&points);
    }
    host_stop(&host, instance);
}

/* ---- Invariants ---- */

static void fields_turn_with_the_object(void **state) {
    (void)state;
    enum { SIDE = 40, POINTS = SIDE * SIDE };
    static double before[POINTS][3][3];
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_bowl(SIDE, 0.1);
    pbr_points *points = fit(instance, POINTS, 0);
    for (uint64_t i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) change_at(points, i, (double[]){k == 0, k == 1, k == 2}, before[i][k]);
    pbr_points_release(&points);
    rotate_all(POINTS, (double[]){500000, 5400000, 300});
    points = fit(instance, POINTS, 0);
    for (uint64_t i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++) {
            double along[3], found[3], expected[3];
            rotate((double[]){k == 0, k == 1, k == 2}, along);
            change_at(points, i, along, found);
            rotate(before[i][k], expected);
            assert_true(distance(found, expected) <= 2 * (NOISE + NORMAL_FIELD_UNIT)); /* both are rounded */
        }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void units_of_length_do_not_matter(void **state) {
    (void)state;
    enum { SIDE = 30, POINTS = SIDE * SIDE };
    static struct normal_field before[POINTS];
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_bowl(SIDE, 0.1);
    pbr_points *points = fit(instance, POINTS, 0);
    memcpy(before, fields, sizeof before);
    pbr_points_release(&points);
    for (int i = 0; i < POINTS; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] *= 4096;
        radii[i] *= 4096;
    }
    points = fit(instance, POINTS, 0);
    assert_memory_equal(before, fields, sizeof before);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static void any_number_of_threads_gives_the_same_field(void **state) {
    (void)state;
    enum { SIDE = 140, POINTS = SIDE * SIDE };
    static struct normal_field one[POINTS];
    sample_bowl(SIDE, 0.1);
    for (uint32_t threads = 1; threads <= 4; threads += 3) {
        struct host host;
        pbr_instance *instance = host_start(&host, threads);
        pbr_points *points = fit(instance, POINTS, 0);
        if (threads == 1) memcpy(one, fields, sizeof one);
        else assert_memory_equal(one, fields, sizeof one);
        pbr_points_release(&points);
        host_stop(&host, instance);
    }
}

static pbr_result fit_again(pbr_instance *instance, void *user) {
    (void)instance;
    return normal_field_fit(user, 0, NULL, fields);
}

static void failing_allocations_leave_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_plane(0, 60, 0.3);
    pbr_points *points = fit(instance, 3600, 0);
    fail_every_allocation(&host, instance, fit_again, points);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static int count_down(void *user, const char *stage, double fraction) {
    int *left = user;
    assert_true(stage[0] != 0 && fraction >= 0 && fraction <= 1);
    return --*left != 0;
}

static void host_can_cancel_at_every_report(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    sample_bowl(100, 0);
    pbr_points *points = make_points(instance, 10000);
    const long live = atomic_load(&host.live);
    for (int n = 1, left = 0; left <= 0; n++) {
        left = n;
        const struct progress progress = {count_down, &left};
        const pbr_result result = normal_field_fit(points, 0, &progress, fields);
        assert_int_equal(result, left == 0 ? PBR_ERROR_CANCELLED : PBR_OK);
        assert_int_equal(atomic_load(&host.live), live);
        assert_true(n < 100 && (n > 3 || left == 0));
    }
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* ---- Storage ---- */

static void stored_fields_turn_normals_by_a_unit_at_most(void **state) {
    (void)state;
    uint64_t random = 4;
    double worst = 0;
    assert_int_equal(sizeof(struct normal_field), 8);
    for (int i = 0; i < 300000; i++) {
        const double size = 1.7 * uniform(&random), p = 7 * uniform(&random), q = 7 * uniform(&random),
                     second = 2 * uniform(&random) - 1;
        /* Rotation by p, stretches 1 and `second`, rotation by q: all matrices whose larger stretch is `size`. */
        const double a[2] = {size * (cos(p) * cos(q) - second * sin(p) * sin(q)),
                             size * (sin(p) * cos(q) + second * cos(p) * sin(q))};
        const double b[2] = {-size * (cos(p) * sin(q) + second * sin(p) * cos(q)),
                             size * (second * cos(p) * cos(q) - sin(p) * sin(q))};
        struct normal_field field;
        double fa[2], fb[2];
        normal_field_encode(a, b, &field);
        normal_field_decode(&field, fa, fb);
        for (int s = 0; s < 4; s++) {
            const double u = cos(0.8 * s), v = sin(0.8 * s);
            const double exact[3] = {u * a[0] + v * b[0], u * a[1] + v * b[1], 1};
            const double stored[3] = {u * fa[0] + v * fb[0], u * fa[1] + v * fb[1], 1};
            worst = fmax(worst, angle_between(exact, stored));
        }
    }
    print_message("largest storage error: %.3e rad\n", worst);
    assert_true(worst <= NORMAL_FIELD_UNIT && worst > 0.7 * NORMAL_FIELD_UNIT);
}

static void too_large_fields_shrink_and_keep_their_shape(void **state) {
    (void)state;
    const double a[2] = {30, 40}, b[2] = {-4, 3}, sizes[] = {1e-3, 1, 1e200};
    for (size_t i = 0; i < COUNT(sizes); i++) {
        struct normal_field field;
        double fa[2], fb[2];
        const double given = 50 * sizes[i],
                     kept = fmin(given, NORMAL_FIELD_MOST) / given * sizes[i]; /* a and b are at right angles */
        normal_field_encode((double[]){a[0] * sizes[i], a[1] * sizes[i]}, (double[]){b[0] * sizes[i], b[1] * sizes[i]}, &field);
        normal_field_decode(&field, fa, fb);
        for (int k = 0; k < 2; k++) {
            assert_true(fabs(fa[k] - a[k] * kept) <= 0.50001 * NORMAL_FIELD_UNIT);
            assert_true(fabs(fb[k] - b[k] * kept) <= 0.50001 * NORMAL_FIELD_UNIT);
        }
    }
}

static void tangents_are_a_right_handed_frame_everywhere(void **state) {
    (void)state;
    uint64_t random = 9;
    for (int i = 0; i < 100000; i++) {
        const double z = i < 4 ? (double[]){1, -1, 0.0, -0.0}[i] : 2 * uniform(&random) - 1, r = sqrt(1 - z * z), angle = 0.1 * i;
        double n[3] = {r * cos(angle), r * sin(angle), z}, t[3], b[3], cross[3];
        disc_tangents(n, t, b);
        cross3(t, b, cross);
        assert_true(fabs(length3(t) - 1) < 1e-12 && fabs(length3(b) - 1) < 1e-12 && distance(cross, n) < 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_are_reproduced_over_the_whole_disc),
        cmocka_unit_test(cylinders_turn_in_one_direction_only),
        cmocka_unit_test(planes_have_a_zero_field),
        cmocka_unit_test(saddles_turn_both_ways),
        cmocka_unit_test(noise_averages_out_with_more_neighbours),
        cmocka_unit_test(back_of_a_thin_plate_does_not_count),
        cmocka_unit_test(sheets_above_do_not_count),
        cmocka_unit_test(neighbours_far_beyond_the_others_do_not_count),
        cmocka_unit_test(points_without_a_normal_or_radius_get_none_and_do_not_disturb),
        cmocka_unit_test(sets_without_normals_or_radii_get_none),
        cmocka_unit_test(lines_turn_along_themselves_only),
        cmocka_unit_test(coincident_points_get_none),
        cmocka_unit_test(twice_given_points_change_nothing),
        cmocka_unit_test(normals_turn_by_sixty_degrees_at_most),
        cmocka_unit_test(nothing_makes_a_field_large),
        cmocka_unit_test(fields_turn_with_the_object),
        cmocka_unit_test(units_of_length_do_not_matter),
        cmocka_unit_test(any_number_of_threads_gives_the_same_field),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
        cmocka_unit_test(host_can_cancel_at_every_report),
        cmocka_unit_test(stored_fields_turn_normals_by_a_unit_at_most),
        cmocka_unit_test(too_large_fields_shrink_and_keep_their_shape),
        cmocka_unit_test(tangents_are_a_right_handed_frame_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
