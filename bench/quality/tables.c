/* Every kind of splat, near, far and grazing, against its reference and against the triangles. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "comparison.h"
#include "filter.h"
#include "parts.h"
#include "sheet.h"
#include "srgb.h"

enum { SCENES = 5, VIEWS = 4, FINE = 4 };

/* How near two pictures are over those pixels only that the Gaussian filter sees triangles all around. */
struct filtered {
    double box, gaussian;               /* PSNR, dB, against the triangles through either filter; NaN: not drawn */
    double box_inside, gaussian_inside; /* the same over these pixels */
};

struct result {
    double truth, reference; /* PSNR, dB; NaN: not drawn */
    uint64_t only[2];        /* pixels covered in the drawing only, in the reference only */
    struct filtered filtered;
};

struct row {
    const char *scene, *view;
    struct result results[METHODS];
};

struct tables {
    struct studio *studio;
    const struct plan *plan;
    struct row rows[SCENES * VIEWS];
    uint32_t row_count;
};

/* What a view is judged by. */
struct truth {
    pbr_image box, gaussian;
    uint8_t *whole; /* one byte a pixel, as filter_gaussian has it */
};

/* ---- Measuring ---- */

/* As tools/comparison.h has it, over the pixels of the mask; NULL = all. */
static double masked_psnr(const pbr_image *a, const pbr_image *b, const uint8_t *mask) {
    double sum = 0, count = 0;
    for (size_t i = 0; i < (size_t)a->width * a->height; i++) {
        if (mask && !mask[i]) continue;
        for (size_t k = 0; k < 3; k++) {
            const double d = (double)srgb_from_linear(a->rgba[4 * i + k]) - (double)srgb_from_linear(b->rgba[4 * i + k]);
            sum += d * d;
        }
        count += 3;
    }
    return -10 * log10(sum / count);
}

static bool compare(struct studio *studio, const pbr_image *a, const pbr_image *b, struct comparison *comparison) {
    static const float black[3] = {0, 0, 0};
    pbr_image pictures[2] = {*a, *b};
    const unsigned errors = atomic_load(&studio->session.errors);
    return session_check(&studio->session, comparison_make(studio->session.instance, pictures, black, 16, comparison), errors,
                         "compare");
}

static void release_truth(struct studio *studio, struct truth *truth) {
    pbr_image_destroy(studio->session.instance, &truth->box);
    pbr_image_destroy(studio->session.instance, &truth->gaussian);
    free(truth->whole);
}

static bool make_truth(struct studio *studio, const struct model *model, const struct view *view, struct truth *truth) {
    struct view fine = *view;
    pbr_image picture = PBR_IMAGE_INIT;
    *truth = (struct truth){PBR_IMAGE_INIT, PBR_IMAGE_INIT, calloc((size_t)view->size[0] * view->size[1], 1)};
    for (int k = 0; k < 2; k++) fine.size[k] *= FINE;
    bool done = truth->whole && studio_draw_truth(studio, model, view, 8, PBR_COLOUR_POINTS, &truth->box) &&
                studio_draw_truth(studio, model, &fine, 2, PBR_COLOUR_POINTS, &picture);
    done = done && filter_gaussian(studio->session.instance, &picture, FINE, &truth->gaussian, truth->whole) == PBR_OK;
    pbr_image_destroy(studio->session.instance, &picture);
    return done;
}

static bool is_measured(const struct model *model, int m) {
    return m < KINDS || m >= METHOD_EWA_HALF || !strcmp(model->name, "dragon");
}

static bool measure_reference(struct studio *studio, const struct model *model, const struct method *method,
                              const struct view *view, const pbr_image *picture, struct result *result) {
    struct comparison comparison;
    pbr_image reference = PBR_IMAGE_INIT;
    if (method->low_pass > 0) return true;
    const bool done =
        studio_draw_reference(studio, model, method, view, &reference) && compare(studio, picture, &reference, &comparison);
    pbr_image_destroy(studio->session.instance, &reference);
    if (!done) return false;
    result->reference = comparison_psnr(&comparison);
    memcpy(result->only, comparison.covered_only, sizeof result->only);
    return true;
}

static bool measure_method(struct studio *studio, const struct model *model, const struct method *method, const struct view *view,
                           const struct truth *truth, pbr_image *picture, struct result *result) {
    if (!studio_draw(studio, model, method, view, picture)) return false;
    result->filtered =
        (struct filtered){masked_psnr(picture, &truth->box, NULL), masked_psnr(picture, &truth->gaussian, NULL),
                          masked_psnr(picture, &truth->box, truth->whole), masked_psnr(picture, &truth->gaussian, truth->whole)};
    result->truth = result->filtered.box;
    return measure_reference(studio, model, method, view, picture, result);
}

/* ---- One view ---- */

/* The middle of the picture; of the checkerboard the part below the horizon. */
static void choose_crop(const struct model *model, const struct view *view, uint32_t cell[2], uint32_t corner[2]) {
    for (int k = 0; k < 2; k++) {
        cell[k] = view->size[k] / 2;
        corner[k] = view->size[k] / 4;
    }
    if (!model->is_lit) corner[1] = view->size[1] / 16;
}

static void fill_in(struct row *row) {
    for (int m = 0; m < METHODS; m++) row->results[m] = (struct result){NAN, NAN, {0, 0}, {NAN, NAN, NAN, NAN}};
}

static bool measure_view(struct tables *tables, const struct model *model, const struct view *view) {
    struct studio *studio = tables->studio;
    struct row *row = &tables->rows[tables->row_count++];
    struct truth truth;
    struct sheet sheet = {PBR_IMAGE_INIT, {0, 0}};
    uint32_t cell[2], corner[2];
    char name[64];
    choose_crop(model, view, cell, corner);
    row->scene = model->name;
    row->view = view->name;
    fill_in(row);
    snprintf(name, sizeof name, "%s-%s.png", model->name, view->name);
    bool done = make_truth(studio, model, view, &truth) && sheet_create(&studio->session, KINDS + 1, 2, cell, &sheet);
    if (done) sheet_place(&sheet, KINDS, 0, "triangles, 8 x 8", &truth.box, corner, 1);
    if (done) sheet_place_difference(&sheet, KINDS, 1, "Gaussian - box, x 4", &truth.gaussian, &truth.box, corner);
    for (int m = 0; done && m < METHODS; m++) {
        pbr_image picture = PBR_IMAGE_INIT;
        if (!is_measured(model, m)) continue;
        session_progress(&studio->session, name, (double)m / METHODS);
        done = measure_method(studio, model, &methods[m], view, &truth, &picture, &row->results[m]);
        if (done && m < KINDS) {
            sheet_place(&sheet, (uint32_t)m, 0, methods[m].name, &picture, corner, 1);
            sheet_place_difference(&sheet, (uint32_t)m, 1, "difference x 4", &picture, &truth.box, corner);
        }
        pbr_image_destroy(studio->session.instance, &picture);
    }
    release_truth(studio, &truth);
    return sheet_write(&studio->session, &sheet, done ? tables->plan->output : NULL, name) && done;
}

/* ---- Scenes ---- */

static bool measure_scan(struct tables *tables, struct model *model, bool is_read, const double views[VIEWS][3]) {
    static const char *const names[VIEWS] = {"near", "whole", "far", "grazing"};
    const uint32_t size[2] = {tables->plan->is_quick ? 160 : 800, tables->plan->is_quick ? 120 : 600};
    bool done = is_read;
    for (int v = 0; done && v < VIEWS; v++) {
        const struct view view = view_around(names[v], model, views[v][0], views[v][1], views[v][2], size);
        done = measure_view(tables, model, &view);
    }
    model_release(model);
    return done;
}

static bool measure_floor(struct tables *tables) {
    static const char *const names[VIEWS] = {"near", "whole", "far", "grazing"};
    static const double heights[VIEWS] = {1, 4, 16, 0.7}, pitches[VIEWS] = {30, 22, 22, 8};
    const uint32_t size[2] = {800, 600};
    struct model model;
    bool done = model_make_floor(tables->studio, 280, &model);
    for (int v = 0; done && v < VIEWS; v++) {
        const double eye[3] = {0, heights[v], 0};
        const struct view view = view_from(names[v], eye, 0, pitches[v], 50, 0.2, 500, size);
        done = measure_view(tables, &model, &view);
    }
    model_release(&model);
    return done;
}

static bool measure_scenes(struct tables *tables) {
    static const char *const scans[3][2] = {{"dragon", "dragon_vrip.ply"}, {"horse", "horse.ply"}, {"bunny", "bunny_colour.ply"}};
    /* Yaw, pitch, zoom. The horse stands with z up and is seen from a side of its. */
    static const double views[3][VIEWS][3] = {{{30, 20, 2}, {30, 20, 1}, {30, 20, 0.3}, {85, 5, 1.5}},
                                              {{60, 20, 2}, {60, 20, 1}, {60, 20, 0.3}, {0, -60, 1.5}},
                                              {{20, 20, 2}, {20, 20, 1}, {20, 20, 0.3}, {100, 60, 1.5}}};
    static const double terrain[VIEWS][3] = {{30, 35, 2}, {30, 35, 1}, {30, 35, 0.3}, {30, 7, 1.6}};
    struct studio *studio = tables->studio;
    struct model model;
    if (tables->plan->is_quick) {
        const bool is_made = model_synthesise(studio, SURFACE_TORUS, 8000, &model);
        return measure_scan(tables, &model, is_made, views[0]);
    }
    for (int s = 0; s < 3; s++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/meshes/%s", tables->plan->data, scans[s][1]);
        const bool is_read = model_read(studio, scans[s][0], path, &model);
        if (!measure_scan(tables, &model, is_read, views[s])) return false;
    }
    const bool is_made = model_synthesise(studio, SURFACE_TERRAIN, 980000, &model);
    return measure_scan(tables, &model, is_made, terrain) && measure_floor(tables);
}

/* ---- Printing ---- */

static void print_number(double number) {
    if (isnan(number)) printf(" - |");
    else printf(" %.1f |", number);
}

static void print_row_name(const struct row *row) {
    printf("| %s, %s |", row->scene, row->view);
}

/* Of the kinds' columns, and of one more. */
static void print_head(const char *last) {
    printf("| |");
    for (int m = 0; m < KINDS; m++) printf(" %s |", methods[m].name);
    printf("%s\n|---|", last);
    for (int m = 0; m < KINDS; m++) printf("---|");
    puts(*last ? "---|" : "");
}

/* The pairs of neighbours in the expected order that are the other way round by more than 0.05 dB, which the table does not show.
 */
static void print_ranks(const struct row *row) {
    bool any = false;
    for (int m = METHOD_SQUARE; m < METHOD_EWA; m++) {
        const double a = row->results[m].truth, b = row->results[m + 1].truth;
        if (!(a > b + 0.05)) continue;
        printf("%s%s > %s", any ? "; " : " ", methods[m].name, methods[m + 1].name);
        any = true;
    }
    puts(any ? " |" : " yes |");
}

static void print_truth(const struct tables *tables) {
    puts("### Against the triangles (PSNR, dB)\n");
    print_head(" in order? |");
    for (uint32_t r = 0; r < tables->row_count; r++) {
        print_row_name(&tables->rows[r]);
        for (int m = 0; m < KINDS; m++) print_number(tables->rows[r].results[m].truth);
        print_ranks(&tables->rows[r]);
    }
    puts("");
}

static void print_references(const struct tables *tables) {
    puts("### Against the reference of the same kind (PSNR, dB; pixels covered in one of the two only)\n");
    print_head("");
    for (uint32_t r = 0; r < tables->row_count; r++) {
        print_row_name(&tables->rows[r]);
        for (int m = 0; m < KINDS; m++) {
            const struct result *result = &tables->rows[r].results[m];
            if (isnan(result->reference)) printf(" - |");
            else printf(" %.1f; %llu |", result->reference, (unsigned long long)(result->only[0] + result->only[1]));
        }
        puts("");
    }
    puts("");
}

static void print_shading(const struct tables *tables) {
    const int order[] = {METHOD_GAUSSIAN, METHOD_GAUSSIAN_DEFERRED, METHOD_GAUSSIAN_FIELD,
                         METHOD_EWA,      METHOD_EWA_DEFERRED,      METHOD_EWA_FIELD};
    puts("### Shading, dragon (PSNR against the triangles; against the reference, dB)\n");
    printf("| |");
    for (int i = 0; i < 6; i++) printf(" %s |", methods[order[i]].name);
    puts("\n|---|---|---|---|---|---|---|");
    for (uint32_t r = 0; r < tables->row_count; r++) {
        const struct row *row = &tables->rows[r];
        if (strcmp(row->scene, "dragon")) continue;
        print_row_name(row);
        for (int i = 0; i < 6; i++) {
            const struct result *result = &row->results[order[i]];
            if (isnan(result->truth)) printf(" - |");
            else printf(" %.1f; %.1f |", result->truth, result->reference);
        }
        puts("");
    }
    puts("");
}

static void print_filters(const struct tables *tables) {
    const int boxes[] = {METHOD_GAUSSIAN, METHOD_EWA, METHOD_EWA_HALF, METHOD_EWA_THIRD, METHOD_EWA_BOX};
    puts("### Against the triangles through either filter (PSNR, dB: inside; in brackets the whole picture)\n");
    printf("| |");
    for (int i = 0; i < 5; i++) printf(" %s, box |", methods[boxes[i]].name);
    for (int i = 0; i < 2; i++) printf(" %s, Gaussian |", methods[boxes[i]].name);
    puts("\n|---|---|---|---|---|---|---|---|");
    for (uint32_t r = 0; r < tables->row_count; r++) {
        print_row_name(&tables->rows[r]);
        for (int i = 0; i < 7; i++) {
            const struct filtered *f = &tables->rows[r].results[boxes[i % 5]].filtered;
            const double inside = i < 5 ? f->box_inside : f->gaussian_inside, all = i < 5 ? f->box : f->gaussian;
            if (isnan(all)) printf(" - |");
            else printf(" %.1f (%.1f) |", inside, all);
        }
        puts("");
    }
    puts("");
}

bool quality_tables(struct studio *studio, const struct plan *plan) {
    static struct tables tables;
    tables = (struct tables){.studio = studio, .plan = plan};
    if (!measure_scenes(&tables)) return false;
    session_progress_end(&studio->session);
    print_truth(&tables);
    print_references(&tables);
    if (!plan->is_quick) print_shading(&tables);
    print_filters(&tables);
    return true;
}
