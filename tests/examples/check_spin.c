/* Looks at three pictures of an example host in a window: its first frame twice, and a later one.
 *
 *     check_spin FIRST.ppm AGAIN.ppm LATER.ppm
 *
 * Both examples turn points about the vertical axis through a flat convex piece of the host's, whose greys no splat has; points
 * well above it are orange, those well below blue, and the eye is above. So it is known what may hide what.
 *
 * SPDX-License-Identifier: MIT */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum kind { BACKGROUND, HOST, ABOVE, BELOW, OTHER, KINDS };

struct picture {
    int width, height;
    uint8_t *pixels;
};

static int failures;

static void expect(int holds, const char *what) {
    if (holds) return;
    fprintf(stderr, "check_spin: %s\n", what);
    failures++;
}

static struct picture read_picture(const char *path) {
    struct picture p = {0};
    FILE *file = fopen(path, "rb");
    if (!file || fscanf(file, "P6 %d %d 255", &p.width, &p.height) != 2 || fgetc(file) != '\n' || p.width < 1 || p.height < 1 ||
        p.width > 10000 || p.height > 10000) {
        fprintf(stderr, "check_spin: %s is no picture\n", path);
        exit(EXIT_FAILURE);
    }
    const size_t size = 3 * (size_t)p.width * (size_t)p.height;
    p.pixels = malloc(size);
    if (!p.pixels || fread(p.pixels, 1, size, file) != size || fgetc(file) != EOF) {
        fprintf(stderr, "check_spin: %s is cut short or too long\n", path);
        exit(EXIT_FAILURE);
    }
    fclose(file);
    return p;
}

/* The first pixel is background. Shading scales a colour, so hues are told apart by ratios. */
static enum kind classify(const struct picture *p, size_t at) {
    const uint8_t *c = p->pixels + 3 * at;
    if (!memcmp(c, p->pixels, 3)) return BACKGROUND;
    if (c[0] > 150 && abs(c[0] - c[1]) <= 2 && abs(c[1] - c[2]) <= 2) return HOST;
    if (2 * c[0] > 3 * c[2]) return ABOVE;
    if (2 * c[2] > 3 * c[0]) return BELOW;
    return OTHER;
}

/* Pixels of a kind that have the host's on both sides in their row: inside its outline, which is convex. */
static void count_row(const struct picture *p, int y, size_t all[KINDS], size_t inside[KINDS]) {
    const size_t row = (size_t)y * (size_t)p->width;
    size_t since[KINDS] = {0}; /* seen since the host's last pixel */
    int begun = 0;
    for (size_t x = 0; x < (size_t)p->width; x++) {
        const enum kind kind = classify(p, row + x);
        all[kind]++;
        since[kind]++;
        if (kind != HOST) continue;
        for (int k = 0; k < KINDS; k++) inside[k] += begun ? since[k] : 0;
        memset(since, 0, sizeof since);
        begun = 1;
    }
}

static void check_occlusion(const struct picture *p) {
    const size_t pixels = (size_t)p->width * (size_t)p->height, some = pixels / 500;
    size_t all[KINDS] = {0}, inside[KINDS] = {0};
    for (int y = 0; y < p->height; y++) count_row(p, y, all, inside);
    printf("of %zu pixels: background %zu, host %zu, above %zu, below %zu; within the host's outline: above %zu, below %zu\n",
           pixels, all[BACKGROUND], all[HOST], all[ABOVE], all[BELOW], inside[ABOVE], inside[BELOW]);
    expect(all[BACKGROUND] > some, "no background");
    expect(all[HOST] > some, "nothing of the host's");
    expect(all[ABOVE] > some && all[BELOW] > some, "no splats on one side");
    expect(inside[ABOVE] > some, "splats do not hide the host's geometry");
    expect(inside[BELOW] == 0, "the host's geometry does not hide splats");
}

/* A step in the turning moves points and nothing else. */
static void check_motion(const struct picture *a, const struct picture *b) {
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    size_t changed = 0, moved = 0;
    for (size_t i = 0; i < pixels; i++) {
        const enum kind from = classify(a, i), to = classify(b, i);
        changed += memcmp(a->pixels + 3 * i, b->pixels + 3 * i, 3) != 0;
        moved += (from == HOST && to == BACKGROUND) || (from == BACKGROUND && to == HOST);
    }
    printf("from first to later: %zu pixels changed, %zu between host and background\n", changed, moved);
    expect(changed > pixels / 100, "nothing turns");
    /* Multisampling may mix a grey where three things meet. */
    expect(moved <= pixels / 10000, "the host's geometry moves");
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: %s FIRST.ppm AGAIN.ppm LATER.ppm\n", argv[0]);
        return 2;
    }
    struct picture p[3];
    for (int i = 0; i < 3; i++) p[i] = read_picture(argv[i + 1]);
    for (int i = 1; i < 3; i++) expect(p[i].width == p[0].width && p[i].height == p[0].height, "pictures of different sizes");
    if (!failures) {
        check_occlusion(&p[0]);
        check_occlusion(&p[2]);
        check_motion(&p[0], &p[2]);
        expect(!memcmp(p[0].pixels, p[1].pixels, 3 * (size_t)p[0].width * (size_t)p[0].height), "the same frame differs");
    }
    for (int i = 0; i < 3; i++) free(p[i].pixels);
    return failures ? EXIT_FAILURE : EXIT_SUCCESS;
}
