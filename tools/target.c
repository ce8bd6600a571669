/* Framebuffer objects and reading them back. SPDX-License-Identifier: MIT */
#include "target.h"

#include <math.h>
#include <pbr/support.h>
#include <string.h>

static float linear_from_srgb(float c) {
    return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}

/* The driver draws to this combination. */
static bool is_complete(void) {
    return glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE && glGetError() == GL_NO_ERROR;
}

static void attach_renderbuffer(const struct target *target, GLenum point, GLuint renderbuffer, GLenum format, GLsizei samples) {
    glBindRenderbuffer(GL_RENDERBUFFER, renderbuffer);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, (GLsizei)target->size[0], (GLsizei)target->size[1]);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, point, GL_RENDERBUFFER, renderbuffer);
}

static void attach_texture(const struct target *target, GLenum format) {
    glBindTexture(GL_TEXTURE_2D, target->texture);
    glTexImage2D(GL_TEXTURE_2D, 0, (GLint)format, (GLsizei)target->size[0], (GLsizei)target->size[1], 0, GL_RGBA,
                 target->is_float ? GL_FLOAT : GL_UNSIGNED_BYTE, NULL);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target->texture, 0);
}

const char *target_create(struct target *target, const uint32_t size[2], uint32_t samples, bool is_float, bool is_es) {
    GLint most_size = 0, most_texture = 0, most_samples = 0, most_viewport[2] = {0, 0};
    const bool multisampled = samples > 1;
    const GLenum colour = is_float ? GL_RGBA32F : GL_SRGB8_ALPHA8, depth = GL_DEPTH_COMPONENT32F;
    *target = (struct target){.size = {size[0], size[1]}, .is_es = is_es, .is_float = is_float};
    glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &most_size);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most_texture);
    glGetIntegerv(GL_MAX_SAMPLES, &most_samples);
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, most_viewport);
    for (int i = 0; i < 2; i++)
        if (size[i] > (uint32_t)most_size || size[i] > (uint32_t)most_texture || size[i] > (uint32_t)most_viewport[i])
            return "--size: the picture is larger than this OpenGL context can draw";
    if (multisampled && samples > (uint32_t)most_samples) return "--samples: more than this OpenGL context can draw";
    glGenFramebuffers(1, &target->resolved);
    glGenTextures(1, &target->texture);
    glGenRenderbuffers(3, target->renderbuffers);
    target->framebuffer = target->resolved;
    glBindFramebuffer(GL_FRAMEBUFFER, target->resolved);
    attach_texture(target, colour);
    attach_renderbuffer(target, GL_DEPTH_ATTACHMENT, target->renderbuffers[0], depth, 0);
    if (!is_complete())
        return is_float ? "this OpenGL context cannot draw to 32-bit float pictures: write a .png or use another --gl"
                        : "this OpenGL context cannot draw to such a picture";
    if (!multisampled) return NULL;
    glGenFramebuffers(1, &target->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    attach_renderbuffer(target, GL_COLOR_ATTACHMENT0, target->renderbuffers[1], colour, (GLsizei)samples);
    attach_renderbuffer(target, GL_DEPTH_ATTACHMENT, target->renderbuffers[2], depth, (GLsizei)samples);
    return is_complete() ? NULL : "this OpenGL context cannot draw to such a picture with --samples";
}

void target_destroy(struct target *target) {
    if (target->resolved != target->framebuffer) glDeleteFramebuffers(1, &target->resolved);
    glDeleteFramebuffers(1, &target->framebuffer);
    glDeleteTextures(1, &target->texture);
    glDeleteRenderbuffers(3, target->renderbuffers);
    *target = (struct target){0};
}

void target_clear(const struct target *target, const float background[4]) {
    float premultiplied[4];
    for (int i = 0; i < 3; i++) premultiplied[i] = linear_from_srgb(background[i]) * background[3];
    premultiplied[3] = background[3];
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    glViewport(0, 0, (GLsizei)target->size[0], (GLsizei)target->size[1]);
    glDepthMask(GL_TRUE);
    if (!target->is_es) glEnable(GL_FRAMEBUFFER_SRGB);
    glClearColor(premultiplied[0], premultiplied[1], premultiplied[2], premultiplied[3]);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

static void resolve(const struct target *target, bool with_depth) {
    const GLint width = (GLint)target->size[0], height = (GLint)target->size[1];
    if (target->resolved == target->framebuffer) return;
    if (!target->is_es) glEnable(GL_FRAMEBUFFER_SRGB); /* samples are averaged in linear light */
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->framebuffer);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target->resolved);
    glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    if (with_depth) glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_DEPTH_BUFFER_BIT, GL_NEAREST);
}

void target_resolve(const struct target *target) {
    resolve(target, false);
}

/* One picture row; GL's rows go up, the picture's down. */
static void read_row(const struct target *target, uint32_t row, const float linear[256], uint8_t *bytes, float *rgba) {
    const GLint y = (GLint)(target->size[1] - 1 - row);
    const size_t width = target->size[0];
    if (target->is_float) {
        glReadPixels(0, y, (GLsizei)width, 1, GL_RGBA, GL_FLOAT, rgba);
        return;
    }
    glReadPixels(0, y, (GLsizei)width, 1, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
    for (size_t i = 0; i < 4 * width; i++) rgba[i] = i % 4 == 3 ? (float)bytes[i] / 255 : linear[bytes[i]];
}

pbr_result target_read(const struct target *target, pbr_instance *instance, double (*distance)(const void *user, double depth),
                       const void *user, pbr_image *image) {
    const size_t width = target->size[0], height = target->size[1];
    const bool with_depth = distance && !target->is_es;
    float linear[256];
    uint8_t *bytes = pbr_allocate(instance, width, 4);
    pbr_result result =
        bytes ? pbr_image_create(instance, target->size[0], target->size[1], with_depth, image) : PBR_ERROR_OUT_OF_MEMORY;
    if (result != PBR_OK) goto cleanup;
    for (int i = 0; i < 256; i++) linear[i] = linear_from_srgb((float)i / 255);
    resolve(target, with_depth);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->resolved);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    for (uint32_t row = 0; row < height; row++) {
        read_row(target, row, linear, bytes, image->rgba + 4 * width * row);
        if (!with_depth) continue;
        float *depth = image->depth + width * row;
        glReadPixels(0, (GLint)(height - 1 - row), (GLsizei)width, 1, GL_DEPTH_COMPONENT, GL_FLOAT, depth);
        for (size_t i = 0; i < width; i++) depth[i] = (float)distance(user, depth[i]);
    }
cleanup:
    pbr_free(instance, bytes);
    return result;
}
