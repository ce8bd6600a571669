/* A hierarchy to draw, and a camera around it. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_GL_BALL_H
#define PBR_TESTS_GL_BALL_H

#include "support.h"

#include <math.h>
#include <string.h>

enum { SIZE = 96, PIXELS = SIZE * SIZE, POINTS = 1500, TURNS = 12 };

/* A bumpy ball, so that no splats lie in one plane and no depths tie. Radii differ, and a few splats are as large as the ball. */
static inline pbr_result make_points(pbr_instance *instance, uint64_t seed, pbr_points **out) {
    static float positions[POINTS][3], normals[POINTS][3], radii[POINTS];
    for (int i = 0; i < POINTS; i++) {
        double direction[3], squared = 0;
        for (int k = 0; k < 3; k++) {
            direction[k] = random_between(&seed, -1, 1);
            squared += direction[k] * direction[k];
        }
        const double distance = random_between(&seed, 0.9, 1.1) / sqrt(squared);
        for (int k = 0; k < 3; k++) {
            positions[i][k] = (float)(direction[k] * distance);
            normals[i][k] = (float)(direction[k] + random_between(&seed, -0.2, 0.2));
        }
        radii[i] = (float)random_log(&seed, 0.02, i % 250 == 0 ? 1 : 0.1);
    }
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    desc.count = POINTS;
    desc.positions = desc.colours = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    return pbr_points_create(instance, &desc, out);
}

static inline pbr_result make_lod(pbr_instance *instance, uint64_t seed, pbr_lod **out) {
    pbr_points *points = NULL;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    *out = NULL;
    pbr_result result = make_points(instance, seed, &points);
    desc.points = points;
    if (result == PBR_OK) result = pbr_lod_create(instance, &desc, out);
    pbr_points_release(&points);
    return result;
}

static inline pbr_lod *lod_of(struct host *host, uint64_t seed) {
    pbr_lod *lod = NULL;
    if (make_lod(host->instance, seed, &lod) != PBR_OK) fail_msg("no hierarchy: %s", host->log);
    return lod;
}

/* From one of TURNS places around the ball. */
static inline pbr_frame make_frame(int turn) {
    pbr_frame frame = turned_frame(6.2831853 / TURNS * turn, 3.1, 0.5, 6, SIZE);
    frame.threshold = PBR_THRESHOLD_LEAVES;
    return frame;
}

#endif
