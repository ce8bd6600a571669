/* Pixels that a closed surface fills and a drawing leaves empty. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "parts.h"
#include "sheet.h"

enum { SIDE = 512, VIEWS = 50, INSIDE_VIEWS = 10 };

/* What a kind left out, over all views of a model. */
struct tally {
    uint64_t holes;
    uint32_t views;    /* that have some */
    double zooms[2];   /* least and largest of these */
    double slope;      /* sum over the holes of the cosine between the surface's normal and the view axis */
    uint64_t worst;    /* in one view ... */
    struct view view;  /* ... this one ... */
    uint32_t place[2]; /* ... at this pixel, from the upper left */
};

struct hunt {
    struct studio *studio;
    const struct plan *plan;
    struct model *model;
    uint64_t random, pixels; /* state of the generator; pixels that must be filled, over all views */
    struct tally tallies[KINDS];
};

/* SplitMix64 (Steele, Lea & Flood 2014), as a number of 0..1. */
static double draw_number(uint64_t *state) {
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ z >> 31) >> 11) / 9007199254740992.0;
}

/* The triangles fill the pixel and its eight neighbours. */
static bool must_be_filled(const pbr_image *truth, uint32_t x, uint32_t y) {
    for (uint32_t i = 0; i < 9; i++) {
        const size_t at = (size_t)(y + i / 3 - 1) * truth->width + x + i % 3 - 1;
        if (truth->rgba[4 * at + 3] < 1) return false;
    }
    return true;
}

/* Of the unit normal's picture, (n + 1) / 2 in sRGB; the view axis is the third row of the view matrix. */
static double cosine_to_axis(const pbr_image *normals, const struct view *view, size_t at) {
    double sum = 0, length = 0;
    for (size_t k = 0; k < 3; k++) {
        const double c = (double)normals->rgba[4 * at + k];
        const double n = 2 * (c <= 0.0031308 ? 12.92 * c : 1.055 * pow(c, 1 / 2.4) - 0.055) - 1;
        sum += n * view->camera.view[4 * k + 2];
        length += n * n;
    }
    return length > 0 ? fabs(sum) / sqrt(length) : 1;
}

static void count_holes(const pbr_image *truth, const pbr_image *picture, const struct view *view, double zoom,
                        struct tally *tally) {
    uint64_t holes = 0;
    uint32_t place[2] = {0, 0};
    for (uint32_t y = 1; y + 1 < truth->height; y++)
        for (uint32_t x = 1; x + 1 < truth->width; x++) {
            const size_t at = (size_t)y * truth->width + x;
            if (picture->rgba[4 * at + 3] > 0 || !must_be_filled(truth, x, y)) continue;
            holes++;
            tally->slope += cosine_to_axis(truth, view, at);
            memcpy(place, (uint32_t[2]){x, y}, sizeof place);
        }
    if (holes == 0) return;
    tally->zooms[0] = tally->views ? fmin(tally->zooms[0], zoom) : zoom;
    tally->zooms[1] = tally->views ? fmax(tally->zooms[1], zoom) : zoom;
    tally->holes += holes;
    tally->views++;
    if (holes <= tally->worst) return;
    tally->worst = holes;
    tally->view = *view;
    memcpy(tally->place, place, sizeof place);
}

/* Coverage of the triangles, and their normals as colours. */
static bool hunt_view(struct hunt *hunt, const struct view *view, double zoom) {
    struct studio *studio = hunt->studio;
    pbr_image truth = PBR_IMAGE_INIT;
    bool done = studio_draw_truth(studio, hunt->model, view, 4, PBR_COLOUR_NORMAL, &truth);
    for (uint32_t y = 1; done && y + 1 < truth.height; y++)
        for (uint32_t x = 1; x + 1 < truth.width; x++) hunt->pixels += must_be_filled(&truth, x, y);
    for (int m = 0; done && m < KINDS; m++) {
        pbr_image picture = PBR_IMAGE_INIT;
        done = studio_draw(studio, hunt->model, &methods[m], view, &picture);
        if (done) count_holes(&truth, &picture, view, zoom, &hunt->tallies[m]);
        pbr_image_destroy(studio->session.instance, &picture);
    }
    pbr_image_destroy(studio->session.instance, &truth);
    return done;
}

static bool hunt_around(struct hunt *hunt) {
    const uint32_t side = hunt->plan->is_quick ? SIDE / 4 : SIDE, size[2] = {side, side}, count = hunt->plan->is_quick ? 4 : VIEWS;
    for (uint32_t v = 0; v < count; v++) {
        const double yaw = 360 * draw_number(&hunt->random);
        const double pitch = asin(2 * draw_number(&hunt->random) - 1) / camera_radians(1);
        const double zoom = 0.3 * pow(2.2 / 0.3, draw_number(&hunt->random)); /* beyond 2.36 the eye is within the model's sphere */
        const struct view view = view_around(hunt->model->name, hunt->model, yaw, pitch, zoom, size);
        session_progress(&hunt->studio->session, hunt->model->name, (double)v / count);
        if (!hunt_view(hunt, &view, zoom)) return false;
    }
    return true;
}

static bool hunt_inside(struct hunt *hunt, const double eye[3]) {
    const uint32_t side = hunt->plan->is_quick ? SIDE / 4 : SIDE, size[2] = {side, side};
    const double radius = hunt->model->sphere.radius, field = 100;
    for (uint32_t v = 0; v < (hunt->plan->is_quick ? 2 : INSIDE_VIEWS); v++) {
        const double yaw = 360 * draw_number(&hunt->random);
        const double pitch = asin(2 * draw_number(&hunt->random) - 1) / camera_radians(1);
        const struct view view = view_from(hunt->model->name, eye, yaw, pitch, field, radius / 1000, 3 * radius, size);
        if (!hunt_view(hunt, &view, 0)) return false;
    }
    return true;
}

/* ---- Output ---- */

/* The worst place, 64 x 64 pixels, four times as large, the same by the reference, and with triangles. */
static bool write_crop(struct hunt *hunt, int m, const char *where) {
    const uint32_t cell[2] = {256, 256}, side = hunt->tallies[m].view.size[0];
    const struct tally *tally = &hunt->tallies[m];
    struct studio *studio = hunt->studio;
    pbr_image pictures[3] = {PBR_IMAGE_INIT, PBR_IMAGE_INIT, PBR_IMAGE_INIT};
    struct sheet sheet = {PBR_IMAGE_INIT, {0, 0}};
    uint32_t corner[2];
    char name[128];
    for (int k = 0; k < 2; k++)
        corner[k] = tally->place[k] < 32 ? 0 : tally->place[k] > side - 32 ? side - 64 : tally->place[k] - 32;
    snprintf(name, sizeof name, "holes-%s-%s-%s.png", hunt->model->name, where, methods[m].name);
    for (char *c = name; *c; c++)
        if (*c == ' ' || *c == ',') *c = '-';
    bool done = studio_draw(studio, hunt->model, &methods[m], &tally->view, &pictures[0]) &&
                studio_draw_truth(studio, hunt->model, &tally->view, 4, PBR_COLOUR_POINTS, &pictures[2]) &&
                sheet_create(&studio->session, 3, 1, cell, &sheet);
    if (done && studio_draw_reference(studio, hunt->model, &methods[m], &tally->view, &pictures[1]))
        sheet_place(&sheet, 1, 0, "reference", &pictures[1], corner, 4);
    if (done) {
        sheet_place(&sheet, 0, 0, methods[m].name, &pictures[0], corner, 4);
        sheet_place(&sheet, 2, 0, "triangles", &pictures[2], corner, 4);
    }
    for (int i = 0; i < 3; i++) pbr_image_destroy(studio->session.instance, &pictures[i]);
    return sheet_write(&studio->session, &sheet, done ? hunt->plan->output : NULL, name) && done;
}

static bool print_row(struct hunt *hunt, const char *where) {
    session_progress_end(&hunt->studio->session);
    printf("| %s, %s | %.2f |", hunt->model->name, where, 1e-6 * (double)hunt->pixels);
    for (int m = 0; m < KINDS; m++) {
        const struct tally *t = &hunt->tallies[m];
        if (t->holes == 0) printf(" 0 |");
        else if (t->zooms[1] > 0)
            printf(" %llu (%u; %.2f to %.2f; %.2f) |", (unsigned long long)t->holes, (unsigned)t->views, t->zooms[0], t->zooms[1],
                   t->slope / (double)t->holes);
        else printf(" %llu (%u; %.2f) |", (unsigned long long)t->holes, (unsigned)t->views, t->slope / (double)t->holes);
    }
    puts("");
    fflush(stdout);
    for (int m = 0; hunt->plan->output && m < KINDS; m++)
        if (hunt->tallies[m].holes > 0 && !write_crop(hunt, m, where)) return false;
    return true;
}

static bool hunt_model(struct studio *studio, const struct plan *plan, struct model *model, bool is_made, const double *eye) {
    struct hunt hunt = {.studio = studio, .plan = plan, .model = model, .random = 1};
    model->is_lit = false;
    bool done = is_made && hunt_around(&hunt) && print_row(&hunt, "outside");
    if (done && eye) {
        hunt = (struct hunt){.studio = studio, .plan = plan, .model = model, .random = 2};
        done = hunt_inside(&hunt, eye) && print_row(&hunt, "inside");
    }
    model_release(model);
    return done;
}

bool quality_holes(struct studio *studio, const struct plan *plan) {
    static const struct scan {
        const char *name, *file;
        bool has_inside;
        double inside[3];
    } scans[] = {{"horse", "horse.ply", true, {0, 0, 0}},
                 {"dragon", "dragon_vrip.ply", false, {0}},
                 {"bunny", "bunny_colour.ply", false, {0}}};
    static const double centre[3] = {0, 0, 0}, in_tube[3] = {1, 0, 0};
    struct model model;
    printf("| | pixels, millions |");
    for (int m = 0; m < KINDS; m++) printf(" %s |", methods[m].name);
    printf("\n|---|---|");
    for (int m = 0; m < KINDS; m++) printf("---|");
    puts("");
    bool is_made = model_synthesise(studio, SURFACE_SPHERE, 20000, &model);
    if (!hunt_model(studio, plan, &model, is_made, centre)) return false;
    is_made = model_synthesise(studio, SURFACE_TORUS, 20000, &model);
    if (!hunt_model(studio, plan, &model, is_made, in_tube)) return false;
    for (size_t s = 0; !plan->is_quick && s < sizeof scans / sizeof scans[0]; s++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/meshes/%s", plan->data, scans[s].file);
        is_made = model_read(studio, scans[s].name, path, &model);
        if (!hunt_model(studio, plan, &model, is_made, scans[s].has_inside ? scans[s].inside : NULL)) return false;
    }
    puts("");
    return true;
}
