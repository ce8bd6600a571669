/* Blended kinds: what lies on one surface is blended with known weights, what lies behind it is hidden.
 * SPDX-License-Identifier: MIT */
#include "support.h"

static const double origin[3];

static double gaussian_weight(const struct surfel_data *disc, int x, int y) {
    double along[3];
    pixel_ray(32, x, y, along);
    const double rho = cast(origin, along, disc).rho;
    return rho <= 1 ? exp(-2 * rho * rho) : 0;
}

static void expect_colour(const struct stage *stage, int x, int y, const double wanted[3], double tolerance) {
    for (int k = 0; k < 3; k++) assert_true(fabs((double)colour_at(stage, x, y)[k] - wanted[k]) < tolerance);
}

/* Colours of 0 and 1 are held exactly by 8-bit sRGB. */
static void splats_of_one_plane_are_blended_by_their_weights(void **state) {
    struct surfel_data discs[] = {{{-0.3, 0, -2}, {0, 0, 1}, 1, {1, 0, 0}},
                                  {{0.4, 0.1, -2}, {0, 0, 1}, 1.1f, {0, 1, 0}},
                                  {{0, -0.5, -2}, {0, 0, 1}, 0.9f, {0, 0, 1}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (int tilted = 0; tilted < 2; tilted++) {
        for (int i = 0; i < 3 && tilted; i++) { /* the plane z = -2 + 0.75 x */
            discs[i].position[2] += 0.75 * discs[i].position[0];
            discs[i].normal[0] = -0.6;
            discs[i].normal[2] = 0.8;
        }
        pbr_points *points = make_points(stage.instance, discs, 3);
        const pbr_item item = plain_item(points, PBR_SPLAT_GAUSSIAN);
        draw(&stage, &item, 1);
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double wanted[3], sum = 0;
                for (int k = 0; k < 3; k++) sum += wanted[k] = gaussian_weight(&discs[k], x, y);
                if (!is_covered(&stage, x, y)) continue;
                for (int k = 0; k < 3; k++) wanted[k] /= sum;
                bool at_rim = false; /* where the stored normal's rounding decides */
                for (int k = 0; k < 3; k++) at_rim |= fabs(log(fmax(wanted[k] * sum, 1e-9)) + 2) < 2e-3;
                if (!at_rim) expect_colour(&stage, x, y, wanted, 1e-3);
                assert_true(colour_at(&stage, x, y)[3] == 1);
            }
        pbr_points_release(&points);
    }
    stage_close(&stage);
}

/* The share of the second of two splats at the picture's middle; the first lies at a distance of 4. */
static double share_behind(struct stage *stage, const struct surfel_data discs[2], uint32_t splat, float low_pass) {
    pbr_points *points = make_points(stage->instance, discs, 2);
    pbr_item item = plain_item(points, splat);
    item.low_pass = low_pass;
    draw(stage, &item, 1);
    pbr_points_release(&points);
    return (double)colour_at(stage, 32, 32)[1];
}

/* epsilon is half a radius, divided by the cosine, but by no less than 1/4. ewa's and ewa-max's radius is the one that the low-pass
 * leads to. */
static void a_surface_reaches_as_far_back_as_epsilon(void **state) {
    static const struct {
        double normal[3];
        double slope;
    } tilts[] = {{{0, 0, 1}, 1}, {{0, 0.8, 0.6}, 1 / 0.6}, {{0, 0.995, 0.099874922}, 4}, {{0, 0, 0}, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    stage.frame.jitter[0] = stage.frame.jitter[1] = 0.5;
    for (uint32_t splat = PBR_SPLAT_GAUSSIAN; splat <= PBR_SPLAT_EWA_MAX; splat++)
        for (size_t i = 0; i < COUNT(tilts); i++)
            for (int parallel = 0; parallel < 2; parallel++) {
                const double low_pass = parallel ? 9 : 1;
                if (parallel) look_parallel(&stage, 64);
                else look(&stage, 64 * 4);
                struct surfel_data discs[] = {{{0, 0, -4}, {0}, 0.2f, {1, 0, 0}}, {{0, 0, 0}, {0, 0, 1}, 3, {0, 1, 0}}};
                memcpy(discs[0].normal, tilts[i].normal, sizeof discs[0].normal);
                const double radius = splat == PBR_SPLAT_GAUSSIAN ? 0.2 : hypot(0.2, 2 * sqrt(low_pass) / 64),
                             reach = radius / 2 * tilts[i].slope;
                for (int side = 0; side < 2; side++) {
                    discs[1].position[2] = -4 - reach * (side ? 1.002 : 0.998);
                    const double share = share_behind(&stage, discs, splat, (float)low_pass);
                    if (side) assert_true(share == 0);
                    else assert_true(share > 0.1);
                }
            }
    stage_close(&stage);
}

/* The nearer one is thin, the farther one's own reach is so long that it comes first only where nothing is before it. */
static void what_is_behind_shows_only_beside(void **state) {
    const struct surfel_data discs[] = {{{0, 0, -4}, {0, 0, 1}, 1, {1, 0, 0}}, {{0, 0, -6}, {0, 0, 1}, 4, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    for (uint32_t splat = PBR_SPLAT_GAUSSIAN; splat <= PBR_SPLAT_EWA_MAX; splat++) {
        share_behind(&stage, discs, splat, 0);
        for (int x = 0; x < SIZE; x++) {
            const double away = fabs(x + 0.5 - 32);
            if (away < 7.9) assert_true(colour_at(&stage, x, 32)[1] == 0 && fabs(depth_at(&stage, x, 32) - 4) < 1e-5);
            if (away > 8.1 && away < 21)
                assert_true(colour_at(&stage, x, 32)[1] > 0.5f && fabs(depth_at(&stage, x, 32) - 6) < 1e-5);
        }
    }
    stage_close(&stage);
}

/* A floor whose centre is behind the eye reaches back from where it is seen, too. */
static void a_surface_around_the_eye_is_blended_before_it(void **state) {
    const struct surfel_data discs[] = {{{0, -1, 1}, {0, 1, 0}, 6, {1, 0, 0}}, {{0, -1.02, -5}, {0, 1, 0}, 4.5f, {0, 1, 0}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    share_behind(&stage, discs, PBR_SPLAT_GAUSSIAN, 0);
    assert_true(colour_at(&stage, 32, 8)[0] > 0.2f && colour_at(&stage, 32, 8)[1] > 0.2f);
    stage_close(&stage);
}

/* Two discs of one layer with a third, nearer than the second, between them, of any kind that is not blended with them. */
static void a_layer_is_blended_across_what_lies_within_it(void **state) {
    const struct surfel_data discs[] = {{{0, 0, -4}, {0, 0, 1}, 0.5f, {1, 0, 0}}, {{0, 0, -4.1}, {0, 0, 1}, 0.5f, {0, 1, 0}}};
    const struct surfel_data between = {{0, 0, -4.05}, {0, 0, 1}, 0.5f, {0, 0, 1}};
    static const struct {
        uint32_t splat, shading;
    } others[] = {{PBR_SPLAT_SQUARE, PBR_SHADE_NONE},       {PBR_SPLAT_ELLIPSE, PBR_SHADE_NONE},
                  {PBR_SPLAT_GAUSSIAN, PBR_SHADE_DEFERRED}, {PBR_SPLAT_EWA, PBR_SHADE_PHONG_FIELD},
                  {PBR_SPLAT_EWA_MAX, PBR_SHADE_DEFERRED},  {PBR_SPLAT_GAUSSIAN, PBR_SHADE_PHONG}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points = make_points(stage.instance, discs, 2), *other = make_points(stage.instance, &between, 1);
    for (size_t i = 0; i < 2 * COUNT(others); i++) {
        pbr_item items[2];
        items[i % 2] = plain_item(points, PBR_SPLAT_GAUSSIAN);
        items[!(i % 2)] = plain_item(other, others[i / 2].splat);
        items[!(i % 2)].shading = others[i / 2].shading;
        items[!(i % 2)].material = (pbr_material){1, 0, 0, 1};
        draw(&stage, items, 2);
        const float *c = colour_at(&stage, 32, 32);
        const bool joins = i / 2 == 5;
        assert_true(c[0] > 0.3f && c[1] > 0.3f && (joins ? c[2] > 0.3f : c[2] == 0));
    }
    pbr_points_release(&points);
    pbr_points_release(&other);
    stage_close(&stage);
}

/* Opaque kinds and layers hide each other by depth, in whatever order the items come. */
static void layers_and_opaque_splats_hide_each_other(void **state) {
    const struct surfel_data near = {{0, 0, -4}, {0, 0, 1}, 1, {1, 0, 0}}, far = {{0, 0, -6}, {0, 0, 1}, 4, {0, 1, 0}};
    static const uint32_t kinds[] = {PBR_SPLAT_SQUARE, PBR_SPLAT_ELLIPSE, PBR_SPLAT_GAUSSIAN, PBR_SPLAT_EWA, PBR_SPLAT_EWA_MAX};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    pbr_points *points[] = {make_points(stage.instance, &near, 1), make_points(stage.instance, &far, 1)};
    for (size_t i = 0; i < 50; i++) {
        const bool swapped = i / 25;
        pbr_item items[2];
        items[swapped] = plain_item(points[0], kinds[i % 5]);
        items[!swapped] = plain_item(points[1], kinds[i / 5 % 5]);
        draw(&stage, items, 2);
        expect_colour(&stage, 32, 32, (const double[]){1, 0, 0}, 1e-9);
        expect_colour(&stage, 32 + 15, 32, (const double[]){0, 1, 0}, 1e-9);
    }
    pbr_points_release(&points[0]);
    pbr_points_release(&points[1]);
    stage_close(&stage);
}

/* Phong for one white directional light from the eye and white ambient light; everything unit. */
static double phong(const pbr_material *m, double albedo, const double normal[3], const double to_eye[3]) {
    const double light[3] = {0, 0, 1}, facing = dot(normal, to_eye);
    double mirrored[3];
    for (int k = 0; k < 3; k++) mirrored[k] = 2 * facing * normal[k] - to_eye[k];
    return albedo * ((double)m->ambient + (double)m->diffuse * fmax(0, dot(normal, light))) +
           (double)m->specular * pow(fmax(0, dot(mirrored, light)), (double)m->shininess);
}

static const pbr_material shiny = {0.2f, 0.5f, 0.25f, 10};

/* Once a splat at its centre, or once a pixel where its ray meets the disc. */
static void light_is_phongs(void **state) {
    struct surfel_data disc = {{0.5, 0.2, -3}, {0.3, -0.2, 1}, 1, {1, 1, 1}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    unit(disc.normal);
    pbr_points *points = make_points(stage.instance, &disc, 1);
    for (int deferred = 0; deferred < 2; deferred++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
            pbr_item item = plain_item(points, splat);
            item.shading = deferred ? PBR_SHADE_DEFERRED : PBR_SHADE_PHONG;
            item.material = shiny;
            draw(&stage, &item, 1);
            int covered = 0;
            for (int y = 0; y < SIZE; y++)
                for (int x = 0; x < SIZE; x++) {
                    double along[3], to_eye[3];
                    pixel_ray(32, x, y, along);
                    const double t = cast(origin, along, &disc).t;
                    const bool by_pixel = deferred && splat >= PBR_SPLAT_GAUSSIAN;
                    if (!is_covered(&stage, x, y)) continue;
                    for (int k = 0; k < 3; k++) to_eye[k] = by_pixel ? -t * along[k] : -disc.position[k];
                    unit(to_eye);
                    const double wanted = phong(&shiny, 1, disc.normal, to_eye);
                    expect_colour(&stage, x, y, (const double[]){wanted, wanted, wanted}, 2e-4);
                    covered++;
                }
            assert_true(covered > 100);
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

static void both_sides_are_lit_and_points_without_normals_are_not(void **state) {
    struct surfel_data discs[] = {{{-0.5, 0, -3}, {-0.3, 0.2, -1}, 0.4f, {1, 1, 1}}, {{0.5, 0, -3}, {0, 0, 0}, 0.4f, {1, 1, 1}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    unit(discs[0].normal);
    pbr_points *points = make_points(stage.instance, discs, 2);
    for (uint32_t shading = PBR_SHADE_PHONG; shading <= PBR_SHADE_PHONG_FIELD; shading++)
        for (uint32_t splat = PBR_SPLAT_CIRCLE; splat <= PBR_SPLAT_EWA_MAX; splat++) {
            if (shading == PBR_SHADE_NONE) continue;
            pbr_item item = plain_item(points, splat);
            item.shading = shading;
            item.material = (pbr_material){0.2f, 0.5f, 0, 1};
            draw(&stage, &item, 1);
            const double lit = 0.2 - 0.5 * discs[0].normal[2];
            expect_colour(&stage, 26, 32, (const double[]){lit, lit, lit}, 2e-4);
            expect_colour(&stage, 37, 32, (const double[]){1, 1, 1}, 1e-6);
            item.flags = PBR_ITEM_CULL_BACK_FACES;
            draw(&stage, &item, 1);
            assert_false(is_covered(&stage, 26, 32));
            assert_true(is_covered(&stage, 37, 32));
        }
    pbr_points_release(&points);
    stage_close(&stage);
}

/* Deferred: two crossing discs that blend are lit as one with the mean of their normals; of another material, the nearer is seen
 * alone. */
static void deferred_normals_are_blended_within_a_material(void **state) {
    struct surfel_data discs[] = {{{0, 0, -3}, {0.4, 0, 1}, 1, {1, 1, 1}}, {{0, 0, -3.01}, {0, 0.6, 1}, 1, {1, 1, 1}}};
    struct stage stage;
    (void)state;
    stage_open(&stage, 1);
    stage.frame.jitter[0] = stage.frame.jitter[1] = 0.5;
    for (int i = 0; i < 2; i++) unit(discs[i].normal);
    pbr_points *points[] = {make_points(stage.instance, &discs[0], 1), make_points(stage.instance, &discs[1], 1)};
    pbr_item items[] = {plain_item(points[0], PBR_SPLAT_GAUSSIAN), plain_item(points[1], PBR_SPLAT_EWA)};
    for (int apart = 0; apart < 2; apart++) {
        double normal[3];
        for (int i = 0; i < 2; i++) {
            items[i].shading = PBR_SHADE_DEFERRED;
            items[i].material = (pbr_material){0, apart && i ? 0.5f : 1, 0, 1};
        }
        draw(&stage, items, 2);
        for (int k = 0; k < 3; k++) normal[k] = discs[0].normal[k] + (apart ? 0 : discs[1].normal[k]);
        unit(normal);
        /* The low-pass takes some per cent of the second one's weight. */
        const double tolerance = apart ? 2e-4 : 5e-3;
        expect_colour(&stage, 32, 32, (const double[]){normal[2], normal[2], normal[2]}, tolerance);
    }
    pbr_points_release(&points[0]);
    pbr_points_release(&points[1]);
    stage_close(&stage);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(splats_of_one_plane_are_blended_by_their_weights),
        cmocka_unit_test(a_surface_reaches_as_far_back_as_epsilon),
        cmocka_unit_test(what_is_behind_shows_only_beside),
        cmocka_unit_test(a_surface_around_the_eye_is_blended_before_it),
        cmocka_unit_test(a_layer_is_blended_across_what_lies_within_it),
        cmocka_unit_test(layers_and_opaque_splats_hide_each_other),
        cmocka_unit_test(light_is_phongs),
        cmocka_unit_test(both_sides_are_lit_and_points_without_normals_are_not),
        cmocka_unit_test(deferred_normals_are_blended_within_a_material),
    };
    return cmocka_run_group_tests_name("layers", tests, NULL, NULL);
}
