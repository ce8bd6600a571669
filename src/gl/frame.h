/* A frame's camera, lights and fixed state, checked and brought into the form that drawing needs. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_FRAME_H
#define PBR_GL_FRAME_H

#include <pbr/render.h>

#include "state.h"

struct frame_setup {
    double view[16];
    double projection[16];  /* with jitter, lower-left origin, and -w..w depth unless wanted.clip_zero_to_one */
    double still[16];       /* the same without jitter */
    double jitter[2];       /* pixels */
    double eye[4];          /* eye space, homogeneous: centre of projection, or direction towards it with w = 0 */
    double threshold;       /* diameter in pixels of nodes of hierarchies that are drawn as one splat; 0: the leaves */
    double edge;            /* the largest of them, pixels, where their discs may nearly be seen from the edge */
    double time_budget;     /* seconds; 0: none */
    double pixels_per_unit; /* across the view axis at w = 1, the larger of both axes */
    struct state_wanted wanted;
    bool several_samples; /* a pixel, of what is drawn to */
    bool occludes;        /* what earlier pictures hid is drawn coarsely */
    bool waits;           /* hierarchies are cut for this very view before they are drawn */
    bool empty;           /* the bound viewport has no area: nothing is drawn */
    uint32_t encoding;    /* PBR_ENCODING_... */
    int32_t light_count;
    float light_vectors[PBR_MAX_LIGHTS][4];
    float light_colours[PBR_MAX_LIGHTS][3];
    float ambient[3];
};

/* Makes no GL call, but for asking the bound viewport where the frame gives none. */
pbr_result frame_setup(pbr_instance *instance, const struct gl *gl, const pbr_frame *frame, struct frame_setup *out);

/* Asks what the bound draw framebuffer stores. *encode: the shaders have to encode sRGB; *framebuffer_srgb: GL does. */
pbr_result frame_target(pbr_instance *instance, const struct gl *gl, const struct frame_setup *setup, GLenum first_draw_buffer,
                        bool *encode, bool *framebuffer_srgb, bool *several_samples);

#endif
