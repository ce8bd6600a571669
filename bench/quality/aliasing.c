/* How much of what a kind draws is finer than pixels, and so comes out as aliases. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>

#include "filter.h"
#include "parts.h"
#include "sheet.h"

enum { SHIFTS = 4, STRIPS = 3, STRIP_WIDTH = 256, STRIP_HEIGHT = 16 };

/* The eye over the floor: its height, how far down it looks and how high the picture is, degrees. */
static const double eye_height = 2, eye_pitch = 22, eye_field = 50;

/* How a row of the table is drawn: a method, or triangles with so many samples along a pixel's side. */
struct drawing {
    const char *name;
    const struct method *method; /* NULL: triangles */
    uint32_t samples;
};

struct strip {
    const char *name;
    double distance; /* along the floor, of its upper edge */
    uint32_t row;    /* of that edge, in the picture */
};

struct measuring {
    struct studio *studio;
    const struct model *model;
    struct view view;
    struct strip strips[STRIPS];
    double *fine; /* luminance of the picture SHIFTS times as fine along each side, rows from the top */
};

static uint32_t row_at(const struct view *view, double distance) {
    const double below = atan(eye_height / distance) - camera_radians(eye_pitch);
    return (uint32_t)(view->size[1] / 2.0 + view->camera.pixel_scale * tan(below));
}

/* Squares that a pixel at that distance is high. */
static double squares_high(const struct view *view, double distance) {
    return distance * distance / (view->camera.pixel_scale * eye_height);
}

static double squares_wide(const struct view *view, double distance) {
    return distance / view->camera.pixel_scale;
}

static bool draw(struct measuring *m, const struct drawing *drawing, const struct view *view, pbr_image *image) {
    if (drawing->method) return studio_draw(m->studio, m->model, drawing->method, view, image);
    return studio_draw_truth(m->studio, m->model, view, drawing->samples, PBR_COLOUR_POINTS, image);
}

/* Rec. 709's luminance. */
static double luminance(const float *rgba) {
    return 0.2126 * (double)rgba[0] + 0.7152 * (double)rgba[1] + 0.0722 * (double)rgba[2];
}

/* A pixel's value as a function of where the pixel is: the picture is shifted by parts of a pixel, and what all shifts have at the
 * pixels' centres makes one finer picture. */
static bool draw_fine(struct measuring *m, const struct drawing *drawing) {
    const size_t width = m->view.size[0], height = m->view.size[1];
    for (uint32_t shift = 0; shift < SHIFTS * SHIFTS; shift++) {
        const uint32_t right = shift % SHIFTS, down = shift / SHIFTS;
        struct view view = m->view;
        pbr_image image = PBR_IMAGE_INIT;
        view.jitter[0] = 0.5 - (right + 0.5) / SHIFTS;
        view.jitter[1] = (down + 0.5) / SHIFTS - 0.5;
        session_progress(&m->studio->session, drawing->name, (double)shift / (SHIFTS * SHIFTS));
        if (!draw(m, drawing, &view, &image)) return false;
        for (size_t y = 0; y < height; y++)
            for (size_t x = 0; x < width; x++)
                m->fine[(y * SHIFTS + down) * width * SHIFTS + x * SHIFTS + right] = luminance(image.rgba + 4 * (y * width + x));
        pbr_image_destroy(m->studio->session.instance, &image);
    }
    return true;
}

static bool measure_strip(const struct measuring *m, const struct strip *strip, struct spectrum *out) {
    const uint32_t columns = STRIP_WIDTH * SHIFTS, rows = STRIP_HEIGHT * SHIFTS;
    const size_t width = (size_t)m->view.size[0] * SHIFTS, left = (width - columns) / 2, top = (size_t)strip->row * SHIFTS;
    double *samples = calloc((size_t)columns * rows, sizeof *samples);
    bool done = samples != NULL;
    for (size_t y = 0; done && y < rows; y++)
        for (size_t x = 0; x < columns; x++) samples[y * columns + x] = m->fine[(top + y) * width + left + x];
    done = done && spectrum_measure(samples, columns, rows, SHIFTS, out);
    free(samples);
    return done;
}

static bool print_row(struct measuring *m, const struct drawing *drawing) {
    if (!draw_fine(m, drawing)) return false;
    printf("| %s |", drawing->name);
    for (int s = 0; s < STRIPS; s++) {
        struct spectrum spectrum;
        if (!measure_strip(m, &m->strips[s], &spectrum)) return false;
        printf(" %.2f %%, %.4f |", 100 * spectrum.share, spectrum.folded);
    }
    puts("");
    fflush(stdout);
    return true;
}

/* What one sees: the rows from the horizon on, as they are, twice as large. */
static bool write_strips(struct measuring *m, const struct plan *plan, const struct drawing *drawings, uint32_t count) {
    const uint32_t cell[2] = {320, 128}, corner[2] = {m->view.size[0] / 2 - 80, m->strips[0].row - 6};
    struct sheet sheet;
    uint32_t place = 0;
    bool done = sheet_create(&m->studio->session, 2, (count + 1) / 2, cell, &sheet);
    for (uint32_t d = 0; done && d < count; d++) {
        pbr_image image = PBR_IMAGE_INIT;
        done = draw(m, &drawings[d], &m->view, &image);
        if (done) sheet_place(&sheet, place % 2, place / 2, drawings[d].name, &image, corner, 2);
        place++;
        pbr_image_destroy(m->studio->session.instance, &image);
    }
    if (done) sheet.image.height = (place + 1) / 2 * cell[1]; /* rows of those that cannot be drawn */
    return sheet_write(&m->studio->session, &sheet, done ? plan->output : NULL, "quality-checkerboard.png") && done;
}

static bool measure_all(struct measuring *m, const struct plan *plan) {
    struct drawing drawings[2 + KINDS + 3] = {{"triangles, 1 x 1", NULL, 1}, {"triangles, 8 x 8", NULL, 8}};
    if (plan->is_quick) drawings[1] = (struct drawing){"triangles, 2 x 2", NULL, 2};
    uint32_t count = 2;
    for (int k = 0; k < KINDS; k++) drawings[count++] = (struct drawing){methods[k].name, &methods[k], 0};
    if (plan->output && !write_strips(m, plan, drawings, count)) return false;
    for (int k = METHOD_EWA_HALF; k <= METHOD_EWA_BOX; k++) drawings[count++] = (struct drawing){methods[k].name, &methods[k], 0};
    for (uint32_t d = 0; d < count; d++)
        if (!print_row(m, &drawings[d])) return false;
    puts("");
    return true;
}

static void print_head(const struct measuring *m) {
    printf("Picture %u x %u, strips of %d x %d pixels.\n\n|", (unsigned)m->view.size[0], (unsigned)m->view.size[1], STRIP_WIDTH,
           STRIP_HEIGHT);
    for (int s = 0; s < STRIPS; s++) printf(" | %s", m->strips[s].name);
    puts(" |\n|---|---|---|---|");
    printf("| a pixel at the strip's upper edge, wide x high, squares |");
    for (int s = 0; s < STRIPS; s++)
        printf(" %.2f x %.2f |", squares_wide(&m->view, m->strips[s].distance), squares_high(&m->view, m->strips[s].distance));
    puts("");
}

bool quality_aliasing(struct studio *studio, const struct plan *plan) {
    const double length = plan->is_quick ? 30 : 280, eye[3] = {0, eye_height, 0};
    const uint32_t size[2] = {plan->is_quick ? STRIP_WIDTH : 512, plan->is_quick ? 192 : 384};
    struct measuring m = {.studio = studio, .strips = {{.name = "horizon"}, {.name = "middle"}, {.name = "front"}}};
    struct model model;
    bool done = model_make_floor(studio, length, &model);
    m.model = &model;
    m.view = view_from("floor", eye, 0, eye_pitch, eye_field, 0.5, 2 * length, size);
    m.strips[0].distance = 0.9 * length;
    m.strips[1].distance = plan->is_quick ? 12 : 27;
    m.strips[2].distance = 3.3;
    for (int s = 0; s < STRIPS; s++) m.strips[s].row = row_at(&m.view, m.strips[s].distance);
    m.fine = calloc((size_t)size[0] * size[1], SHIFTS * SHIFTS * sizeof *m.fine);
    if (!m.fine) done = false;
    if (done) print_head(&m);
    done = done && measure_all(&m, plan);
    free(m.fine);
    model_release(&model);
    return done;
}
