/* Checking a frame and deriving what drawing needs from it. SPDX-License-Identifier: MIT */
#include "frame.h"

#include <string.h>

#include "core/matrix.h"

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static pbr_result invalid(pbr_instance *instance, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "pbr_frame: %s", what);
}

static bool is_zero(const double m[16]) {
    for (int i = 0; i < 16; i++)
        if (m[i] != 0) return false;
    return true;
}

/* The point that rows x, y and w of a projection send to (0, 0, 0): their generalised cross product. It is the centre of
 * projection, or the direction of projection of a parallel one, without assuming either. */
static void null_vector(const double p[16], double out[4]) {
    static const int rows[3] = {0, 1, 3};
    for (int k = 0; k < 4; k++) {
        double minor[3][3];
        for (int r = 0; r < 3; r++)
            for (int c = 0, column = 0; c < 4; c++)
                if (c != k) minor[r][column++] = p[4 * c + rows[r]];
        double normal[3];
        cross3(minor[1], minor[2], normal);
        out[k] = (k & 1 ? -1 : 1) * dot3(minor[0], normal);
    }
}

static pbr_result find_eye(pbr_instance *instance, struct frame_setup *out, bool reversed) {
    double *e = out->eye;
    null_vector(out->projection, e);
    double length = length3(e);
    if (!(length > 0) && e[3] == 0) return invalid(instance, "projection is singular");
    if (fabs(e[3]) > 1e-12 * length) {
        for (int k = 0; k < 4; k++) e[k] /= e[3];
        return PBR_OK;
    }
    /* Towards the viewer depth decreases, or increases when reversed. */
    double depth = 0;
    for (int k = 0; k < 3; k++) depth += out->projection[4 * k + 2] * e[k];
    double sign = (depth > 0) != reversed ? -1 : 1;
    for (int k = 0; k < 3; k++) e[k] *= sign / length;
    e[3] = 0;
    return PBR_OK;
}

/* How fast row i of the projection grows, per unit across the view axis: along it w changes too. Nothing says that the axis is z.
 */
static double growth_across(const double p[16], int i) {
    const double row[3] = {p[i], p[4 + i], p[8 + i]}, w[3] = {p[3], p[7], p[11]};
    const double squared = dot3(w, w), along = squared > 0 ? dot3(row, w) / squared : 0;
    const double across[3] = {row[0] - along * w[0], row[1] - along * w[1], row[2] - along * w[2]};
    return squared > 0 ? length3(across) : hypot(row[0], row[1]);
}

static pbr_result set_up_camera(pbr_instance *instance, const struct gl *gl, const pbr_frame *frame, struct frame_setup *out) {
    memcpy(out->view, is_zero(frame->view) ? identity : frame->view, sizeof out->view);
    memcpy(out->projection, frame->projection, sizeof out->projection);
    double *p = out->projection;
    if (!matrix_is_finite(out->view) || !matrix_make_affine(out->view))
        return invalid(instance, "view is not a finite affine matrix");
    if (!matrix_is_finite(p)) return invalid(instance, "projection has a value that is not finite");
    /* Where depth grows towards the eye in window space; a reversed depth range turns that around in clip space. */
    const bool reversed = ((frame->flags & PBR_FRAME_REVERSED_Z) != 0) != (out->wanted.depth_range[0] > out->wanted.depth_range[1]);
    pbr_result result = find_eye(instance, out, reversed);
    if (result != PBR_OK) return result;

    const double width = out->wanted.viewport[2], height = out->wanted.viewport[3];
    out->pixels_per_unit = fmax(width * growth_across(p, 0), height * growth_across(p, 1)) / 2;
    if (!isfinite(frame->jitter[0]) || !isfinite(frame->jitter[1])) return invalid(instance, "jitter is not finite");
    for (int c = 0; c < 4; c++) {
        if (frame->flags & PBR_FRAME_CLIP_UPPER_LEFT) p[4 * c + 1] = -p[4 * c + 1];
        /* Without glClipControl 0..w becomes -w..w, with the same window depth. */
        if (frame->flags & PBR_FRAME_CLIP_ZERO_TO_ONE && !gl->ClipControl) p[4 * c + 2] = 2 * p[4 * c + 2] - p[4 * c + 3];
    }
    memcpy(out->still, p, sizeof out->still);
    memcpy(out->jitter, frame->jitter, sizeof out->jitter);
    for (int c = 0; c < 4; c++) {
        p[4 * c] += 2 * frame->jitter[0] / width * p[4 * c + 3];
        p[4 * c + 1] += 2 * frame->jitter[1] / height * p[4 * c + 3];
    }
    out->wanted.clip_zero_to_one = frame->flags & PBR_FRAME_CLIP_ZERO_TO_ONE && gl->ClipControl;
    return PBR_OK;
}

static int32_t clamp_to(int64_t v, int64_t low, int64_t high) {
    return (int32_t)(v < low ? low : v > high ? high : v);
}

static pbr_result set_up_viewport(pbr_instance *instance, const struct gl *gl, const pbr_frame *frame, struct frame_setup *out) {
    struct state_wanted *wanted = &out->wanted;
    memcpy(wanted->viewport, frame->viewport, sizeof wanted->viewport);
    GLint *v = wanted->viewport;
    if (v[2] == 0 && v[3] == 0) {
        (*gl->GetIntegerv)(GL_VIEWPORT, v);
        /* A minimised window's. */
        out->empty = v[2] == 0 || v[3] == 0;
        if (out->empty) v[2] = v[3] = 1;
    }
    if (v[2] <= 0 || v[3] <= 0) return invalid(instance, "viewport has no area");
    if (v[2] > gl->max_viewport[0] || v[3] > gl->max_viewport[1])
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_frame: viewport %d x %d, the context's limit is %d x %d",
                       (int)v[2], (int)v[3], gl->max_viewport[0], gl->max_viewport[1]);
    /* Wide points spill over the viewport's edge, so the scissor always stands at it. */
    memcpy(wanted->scissor, v, sizeof wanted->scissor);
    if (!(frame->flags & PBR_FRAME_SCISSOR)) return PBR_OK;
    if (frame->scissor[2] < 0 || frame->scissor[3] < 0) return invalid(instance, "scissor has a negative size");
    for (int i = 0; i < 2; i++) {
        int64_t end = (int64_t)v[i] + v[i + 2];
        int32_t low = clamp_to(frame->scissor[i], v[i], end);
        int32_t high = clamp_to((int64_t)frame->scissor[i] + frame->scissor[i + 2], low, end);
        wanted->scissor[i] = low;
        wanted->scissor[i + 2] = high - low;
    }
    return PBR_OK;
}

static pbr_result set_up_depth(pbr_instance *instance, const pbr_frame *frame, struct state_wanted *wanted) {
    const bool reversed = frame->flags & PBR_FRAME_REVERSED_Z;
    wanted->depth_function = frame->depth_function ? frame->depth_function : reversed ? GL_GREATER : GL_LESS;
    if (wanted->depth_function < GL_NEVER || wanted->depth_function > GL_ALWAYS)
        return invalid(instance, "depth_function is none of OpenGL's");
    const bool given = frame->depth_range[0] != 0 || frame->depth_range[1] != 0;
    wanted->depth_range[0] = given ? frame->depth_range[0] : 0;
    wanted->depth_range[1] = given ? frame->depth_range[1] : 1;
    for (int i = 0; i < 2; i++)
        if (!(wanted->depth_range[i] >= 0 && wanted->depth_range[i] <= 1))
            return invalid(instance, "depth_range is not within 0..1");
    wanted->reversed = reversed;
    wanted->depth_test = !(frame->flags & PBR_FRAME_NO_DEPTH_TEST);
    wanted->depth_write = !(frame->flags & (PBR_FRAME_NO_DEPTH_TEST | PBR_FRAME_NO_DEPTH_WRITE));
    return PBR_OK;
}

static pbr_result set_up_light(pbr_instance *instance, const struct frame_setup *setup, const pbr_light *light, float vector[4],
                               float colour[3]) {
    if (light->kind > PBR_LIGHT_POINT || light->space > PBR_SPACE_WORLD || light->reserved != 0)
        return invalid(instance, "a light's kind or space is unknown, or its reserved member is not 0");
    const double *v = setup->view;
    const double w = light->kind == PBR_LIGHT_POINT;
    double eye[3];
    for (int k = 0; k < 3; k++) {
        eye[k] = light->vector[k];
        if (light->space == PBR_SPACE_WORLD)
            eye[k] = v[k] * light->vector[0] + v[4 + k] * light->vector[1] + v[8 + k] * light->vector[2] + w * v[12 + k];
        if (!isfinite(eye[k]) || !isfinite(light->colour[k])) return invalid(instance, "a light has a value that is not finite");
    }
    const double length = length3(eye);
    if (w == 0 && !(length > 0)) return invalid(instance, "a directional light's vector is 0");
    for (int k = 0; k < 3; k++) {
        vector[k] = (float)(w != 0 ? eye[k] : eye[k] / length);
        colour[k] = light->colour[k];
    }
    vector[3] = (float)w;
    return PBR_OK;
}

static pbr_result set_up_lights(pbr_instance *instance, const pbr_frame *frame, struct frame_setup *out) {
    if (frame->light_count > PBR_MAX_LIGHTS)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_frame: %u lights, the limit is %d",
                       (unsigned)frame->light_count, PBR_MAX_LIGHTS);
    if (!frame->lights != !frame->light_count) return invalid(instance, "lights and light_count do not agree");
    for (int k = 0; k < 3; k++)
        if (!isfinite(frame->ambient[k])) return invalid(instance, "ambient is not finite");
    memcpy(out->ambient, frame->ambient, sizeof out->ambient);
    out->light_count = (int32_t)frame->light_count;
    if (!frame->lights) {
        static const float from_the_eye[4] = {0, 0, 1, 0};
        out->light_count = 1;
        memcpy(out->light_vectors[0], from_the_eye, sizeof from_the_eye);
        for (int k = 0; k < 3; k++) out->light_colours[0][k] = 1;
        if (frame->ambient[0] == 0 && frame->ambient[1] == 0 && frame->ambient[2] == 0)
            for (int k = 0; k < 3; k++) out->ambient[k] = 1;
        return PBR_OK;
    }
    const char *at = (const char *)frame->lights;
    for (uint32_t i = 0; i < frame->light_count; i++, at += frame->lights->struct_size) {
        pbr_light light;
        size_t size;
        memcpy(&size, at, sizeof size);
        if (size != frame->lights->struct_size) return invalid(instance, "a light's struct_size differs from the first one's");
        pbr_result result = read_desc(instance, "pbr_light", at, sizeof light, &light, sizeof light);
        if (result == PBR_OK) result = set_up_light(instance, out, &light, out->light_vectors[i], out->light_colours[i]);
        if (result != PBR_OK) return result;
    }
    return PBR_OK;
}

pbr_result frame_setup(pbr_instance *instance, const struct gl *gl, const pbr_frame *frame, struct frame_setup *out) {
    pbr_frame f;
    pbr_result result = read_desc(instance, "pbr_frame", frame, sizeof f, &f, sizeof f);
    if (result != PBR_OK) return result;
    const uint32_t known = PBR_FRAME_REVERSED_Z | PBR_FRAME_CLIP_ZERO_TO_ONE | PBR_FRAME_CLIP_UPPER_LEFT | PBR_FRAME_NO_DEPTH_TEST |
                           PBR_FRAME_NO_DEPTH_WRITE | PBR_FRAME_SCISSOR | PBR_FRAME_WAIT | PBR_FRAME_OCCLUSION;
    if (f.flags & ~known || f.target > PBR_TARGET_FRAMEBUFFER || f.encoding > PBR_ENCODING_LINEAR)
        return invalid(instance, "flags, target or encoding is unknown");
    if (!isfinite(f.threshold) || (f.threshold < 0 && f.threshold != PBR_THRESHOLD_LEAVES))
        return invalid(instance, "threshold is neither PBR_THRESHOLD_LEAVES nor a size in pixels");
    if (!isfinite(f.time_budget) || f.time_budget < 0) return invalid(instance, "time_budget is negative or not finite");
    /* With 8 and discs that are seen right from the edge single pixels of closed models are open (docs/qsplat.md). */
    *out = (struct frame_setup){.edge = 7,
                                .encoding = f.encoding,
                                .waits = (f.flags & PBR_FRAME_WAIT) != 0,
                                .occludes = (f.flags & PBR_FRAME_OCCLUSION) != 0};
    if (f.threshold >= 0) {
        out->threshold = f.threshold > 0 ? (double)f.threshold : 1;
        out->time_budget = f.time_budget;
    }
    out->wanted.bind_framebuffer = f.target == PBR_TARGET_FRAMEBUFFER;
    out->wanted.framebuffer = f.framebuffer;
    result = set_up_viewport(instance, gl, &f, out);
    if (result == PBR_OK) result = set_up_depth(instance, &f, &out->wanted);
    if (result == PBR_OK) result = set_up_camera(instance, gl, &f, out);
    if (result == PBR_OK) result = set_up_lights(instance, &f, out);
    return result;
}

pbr_result frame_target(pbr_instance *instance, const struct gl *gl, const struct frame_setup *setup, GLenum first_draw_buffer,
                        bool *encode, bool *framebuffer_srgb, bool *several_samples) {
    GLint samples = 0;
    *encode = *framebuffer_srgb = *several_samples = false;
    GLenum status = (*gl->CheckFramebufferStatus)(GL_DRAW_FRAMEBUFFER);
    if (status != GL_FRAMEBUFFER_COMPLETE)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_GL, "the framebuffer to draw to is incomplete (status 0x%04x)",
                       (unsigned)status);
    (*gl->GetIntegerv)(GL_SAMPLES, &samples);
    *several_samples = samples > 0;
    if (first_draw_buffer == GL_NONE) return PBR_OK;
    /* The window's buffers have other names as draw buffers than as attachments. */
    GLenum attachment = first_draw_buffer;
    if (!gl->es && (attachment == GL_BACK || attachment == GL_FRONT_AND_BACK)) attachment = GL_BACK_LEFT;
    if (!gl->es && (attachment == GL_FRONT || attachment == GL_LEFT)) attachment = GL_FRONT_LEFT;
    if (!gl->es && attachment == GL_RIGHT) attachment = GL_FRONT_RIGHT;

    GLint object = GL_NONE, coding = GL_LINEAR, type = GL_UNSIGNED_NORMALIZED;
    (*gl->GetFramebufferAttachmentParameteriv)(GL_DRAW_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE, &object);
    if (object == GL_NONE) return PBR_OK;
    GLint views = 0;
    if (gl->has_multiview && object == GL_TEXTURE)
        (*gl->GetFramebufferAttachmentParameteriv)(GL_DRAW_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_TEXTURE_NUM_VIEWS_OVR,
                                                   &views);
    if (views > 1)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "the framebuffer to draw to has %d views (OVR_multiview); draw each eye by itself", (int)views);
    (*gl->GetFramebufferAttachmentParameteriv)(GL_DRAW_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_COLOR_ENCODING, &coding);
    (*gl->GetFramebufferAttachmentParameteriv)(GL_DRAW_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE, &type);
    if (type == GL_INT || type == GL_UNSIGNED_INT)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "the framebuffer to draw to stores integers, not colours");
    const bool wants_srgb = setup->encoding == PBR_ENCODING_SRGB || (setup->encoding == PBR_ENCODING_AUTO && type != GL_FLOAT);
    if (coding == GL_SRGB) {
        if (!wants_srgb && !gl->has_srgb_control)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                           "linear values cannot be stored in an sRGB framebuffer here: GL_EXT_sRGB_write_control is missing");
        *framebuffer_srgb = wants_srgb;
    } else {
        *encode = wants_srgb;
    }
    return PBR_OK;
}
