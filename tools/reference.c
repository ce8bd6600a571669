/* libpbr-io's reference renderer, and what a target's clear colour is to OpenGL. SPDX-License-Identifier: MIT */
#include "reference.h"

#include <math.h>

static double linear_from_srgb(double c) {
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static void lay_over(const float background[4], pbr_image *image) {
    double behind[4];
    for (int k = 0; k < 4; k++) behind[k] = (double)background[3] * (k < 3 ? linear_from_srgb((double)background[k]) : 1);
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        float *pixel = image->rgba + 4 * i;
        const double through = 1 - (double)pixel[3];
        for (int k = 0; k < 4; k++) pixel[k] = (float)((double)pixel[k] + through * behind[k]);
    }
}

static bool find_meshes(struct session *session, const struct scene *scene, const pbr_mesh **meshes) {
    for (uint32_t i = 0; i < scene->input_count; i++) {
        meshes[i] = scene->inputs[i].surface;
        if (meshes[i]) continue;
        session_fail(session, "%s: %s", scene->inputs[i].path,
                     scene->inputs[i].lod_kind == PBR_LOD_POP
                         ? "of a hierarchy, triangles are not drawn so; the mesh's own file's are"
                         : "has no triangles to draw");
        return false;
    }
    return true;
}

bool reference_draw(struct session *session, const struct scene *scene, const pbr_frame *frame, uint32_t samples,
                    const float background[4], pbr_image *image) {
    const pbr_mesh *meshes[MOST_INPUTS];
    pbr_reference_desc desc = PBR_REFERENCE_DESC_INIT;
    pbr_frame sized = *frame;
    const unsigned errors = atomic_load(&session->errors);
    if (samples > 0 && !find_meshes(session, scene, meshes)) return false;
    desc.progress = session_progress;
    desc.progress_user = session;
    for (int k = 0; k < 2; k++) sized.viewport[2 + k] = (int32_t)scene->options->size[k];
    const pbr_result result =
        samples > 0 ? pbr_ground_truth(session->instance, &sized, scene->items, meshes, scene->input_count, samples, &desc, image)
                    : pbr_reference_render(session->instance, &sized, scene->items, scene->input_count, &desc, image);
    session_progress_end(session);
    if (result == PBR_OK) lay_over(background, image);
    return session_check(session, result, errors, "render");
}
