/* From an item's transform and the frame's camera to matrices and cut views. SPDX-License-Identifier: MIT */
#include "placement.h"

#include <string.h>

#include "core/kernel.h"
#include "core/matrix.h"

void placement_make(const struct prepared_item *prepared, const struct frame_setup *setup, uint32_t transform,
                    struct placement *out) {
    double to_eye[16], affine[16];
    out->prepared = prepared;
    out->setup = setup;
    memcpy(affine, prepared->item.transforms + 16 * (size_t)transform, sizeof affine);
    matrix_make_affine(affine);
    matrix_multiply(setup->view, affine, to_eye);
    matrix_translate(to_eye, prepared->origin, out->to_eye);
    matrix_translate(affine, prepared->origin, out->to_world);
    matrix_multiply(setup->projection, out->to_eye, out->to_clip);
    out->stretch = matrix_largest_stretch(to_eye);
}

double placement_size_per_radius(const struct placement *placement) {
    return 2 * placement->setup->pixels_per_unit * placement->stretch * placement->prepared->item.radius_scale;
}

void placement_view(const struct placement *placement, const struct gl *gl, enum pass pass, struct cut_view *out) {
    const struct prepared_item *prepared = placement->prepared;
    const struct frame_setup *setup = placement->setup;
    const pbr_item *item = &prepared->item;
    memset(out, 0, sizeof *out);
    memcpy(out->to_clip, placement->to_clip, sizeof out->to_clip);
    memcpy(out->projection, setup->projection, sizeof out->projection);
    out->size_per_radius = placement_size_per_radius(placement);
    out->size_minimum = item->size_minimum;
    out->size_maximum = item->size_maximum;
    out->point_limit = gl->point_size_limit;
    out->viewport[0] = setup->wanted.viewport[2];
    out->viewport[1] = setup->wanted.viewport[3];
    out->zero_to_one = setup->wanted.clip_zero_to_one;
    out->discs = splat_is_disc(item->splat);
    out->reach_per_radius = placement->stretch * item->radius_scale;
    out->largest_spread = 0.8;
    if (splat_is_blurred(item->splat) && pass == PASS_ACCUMULATION) { /* what they cover is their disc */
        out->spread = KERNEL_SIGMAS * sqrt((double)item->low_pass);
        out->largest_spread = 0.99 * KERNEL_NEAR_RADIUS * KERNEL_NEAR_RADIUS;
    }
    double from_eye[16];
    const bool has_eye = (prepared->culls || item->lod) && matrix_inverse(placement->to_eye, from_eye);
    out->culls = prepared->culls && has_eye;
    for (int r = 0; r < 4 && has_eye; r++)
        for (int c = 0; c < 4; c++) out->eye[r] += from_eye[4 * c + r] * setup->eye[c];
    if (!item->lod) return;
    /* Pictures with jitter and without show the same cut, which has room for either: they may alternate. */
    memcpy(out->projection, setup->still, sizeof out->projection);
    matrix_multiply(setup->still, placement->to_eye, out->to_clip);
    memcpy(out->to_eye, placement->to_eye, sizeof out->to_eye);
    for (int k = 0; k < 2; k++) out->guard.jitter[k] = fmax(ceil(fabs(setup->jitter[k])), 1);
    out->node_size_per_radius = 2 * setup->pixels_per_unit * placement->stretch;
    out->threshold = setup->threshold;
    out->edge = setup->edge;
    out->point_cost = (double)item->point_cost;
}
