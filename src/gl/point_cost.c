/* What a splat costs, in triangles (Cohen, Aliaga, Zhang 2001 choose between the two by it): a mesh is drawn as the one and as the
 * other, and timed. SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/render.h>
#include <string.h>

#include "core/mesh.h"
#include "lod/lod.h"
#include "renderer.h"

/* Squares in two each, whose balls are as large as the splats: of a side of size / sqrt 2. */
enum {
    SIDE = 128,
    VERTICES = (SIDE + 1) * (SIDE + 1),
    TRIANGLES = 2 * SIDE * SIDE,
    MOST_PIXELS = 1024,
    ROUNDS = 5,
    MOST_COPIES = 16
};

struct arrays {
    float positions[VERTICES][3], normals[VERTICES][3];
    uint32_t triangles[TRIANGLES][3];
};

static void fill(struct arrays *arrays) {
    for (uint32_t i = 0; i < VERTICES; i++) {
        const float position[3] = {(float)(i % (SIDE + 1)), (float)(i / (SIDE + 1)), 0}, normal[3] = {0, 0, 1};
        memcpy(arrays->positions[i], position, sizeof position);
        memcpy(arrays->normals[i], normal, sizeof normal);
    }
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        const uint32_t corner = i / SIDE * (SIDE + 1) + i % SIDE, above = corner + SIDE + 1;
        const uint32_t halves[2][3] = {{corner, corner + 1, above}, {corner + 1, above + 1, above}};
        memcpy(arrays->triangles[2 * i], halves, sizeof halves);
    }
}

static pbr_result make_hierarchy(pbr_instance *instance, pbr_lod **out) {
    pbr_mesh_desc desc = PBR_MESH_DESC_INIT;
    pbr_lod_desc lod = PBR_LOD_DESC_INIT;
    pbr_mesh *mesh = NULL;
    struct arrays *arrays = pbr_allocate(instance, 1, sizeof *arrays);
    if (!arrays) return PBR_ERROR_OUT_OF_MEMORY;
    fill(arrays);
    desc.vertex_count = VERTICES;
    desc.positions = (pbr_attribute){arrays->positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){arrays->normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.indices = arrays->triangles;
    desc.index_format = PBR_FORMAT_UINT32;
    desc.triangle_count = TRIANGLES;
    pbr_result result = pbr_mesh_create(instance, &desc, &mesh);
    pbr_free(instance, arrays);
    lod.kind = PBR_LOD_POP;
    lod.mesh = mesh;
    if (result == PBR_OK) result = pbr_lod_create(instance, &lod, out);
    pbr_mesh_release(&mesh);
    return result;
}

/* Pixels a unit: at the size, or as much of it as the target holds. */
static pbr_frame make_frame(GLuint framebuffer, double scale) {
    pbr_frame frame = PBR_FRAME_INIT;
    const double projection[16] = {2 * scale / MOST_PIXELS, 0, 0, 0, 0, 2 * scale / MOST_PIXELS, 0, 0, 0, 0, -1, 0, -1, -1, 0, 1};
    memcpy(frame.projection, projection, sizeof projection);
    for (int k = 0; k < 4; k++) frame.view[5 * k] = 1;
    frame.target = PBR_TARGET_FRAMEBUFFER;
    frame.framebuffer = framebuffer;
    frame.viewport[2] = frame.viewport[3] = MOST_PIXELS;
    frame.flags = PBR_FRAME_WAIT;
    return frame;
}

/* The quickest of some frames, to the end of the GPU's work; the first one compiles and sends. */
static pbr_result time_frames(pbr_view *view, const pbr_frame *frame, const pbr_item *item, pbr_stats *stats, double *seconds) {
    const struct gl *gl = &view->renderer->gl;
    pbr_result result = PBR_OK;
    *seconds = INFINITY;
    for (int round = 0; round <= ROUNDS && result == PBR_OK; round++) {
        (*gl->Finish)();
        const double start = renderer_seconds();
        result = pbr_render(view, frame, item, 1, stats);
        (*gl->Finish)();
        if (round > 0) *seconds = fmin(*seconds, renderer_seconds() - start);
    }
    return result;
}

/* Seconds of a frame that has the mesh out of view, and what it takes longer where it is seen as triangles, or as splats; each. */
struct times {
    double nothing, triangles, splats, per_triangle, per_splat;
};

static pbr_result time_copies(pbr_view *view, pbr_frame frame, pbr_item *item, double leaf_size, struct times *out) {
    pbr_stats nothing = PBR_STATS_INIT, triangles = PBR_STATS_INIT, splats = PBR_STATS_INIT;
    pbr_frame away = frame;
    away.view[12] = 1e6;
    frame.threshold = PBR_THRESHOLD_LEAVES;
    pbr_result result = time_frames(view, &away, item, &nothing, &out->nothing);
    if (result == PBR_OK) result = time_frames(view, &frame, item, &triangles, &out->triangles);
    frame.threshold = (float)(1.2 * leaf_size); /* leaves, or two that share a ball */
    if (result == PBR_OK) result = time_frames(view, &frame, item, &splats, &out->splats);
    if (result != PBR_OK) return result;
    if (triangles.triangles_drawn == 0 || splats.splats_drawn == 0 || splats.triangles_drawn > 0)
        return pbr_log(view->renderer->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "pbr_renderer_measure_point_cost: the mesh is not drawn as it is to be");
    out->triangles -= out->nothing;
    out->splats -= out->nothing;
    out->per_triangle = out->triangles / (double)triangles.triangles_drawn;
    out->per_splat = out->splats / (double)splats.splats_drawn;
    return PBR_OK;
}

static pbr_result measure(pbr_view *view, const pbr_lod *lod, GLuint framebuffer, uint32_t splat, double size, float *point_cost) {
    const double scale = fmin(size / sqrt(2.0), (double)MOST_PIXELS / (SIDE + 4));
    const pbr_frame frame = make_frame(framebuffer, scale);
    double matrices[MOST_COPIES][16] = {{0}};
    struct times times = {0};
    pbr_item item = PBR_ITEM_INIT;
    pbr_result result = PBR_OK;
    for (int i = 0; i < MOST_COPIES; i++)
        for (int k = 0; k < 4; k++) matrices[i][5 * k] = 1;
    item.lod = lod;
    item.splat = splat;
    item.transforms = matrices[0];
    /* As often as it takes to stand out. */
    bool stands_out = false;
    for (item.transform_count = 1; item.transform_count <= MOST_COPIES && result == PBR_OK && !stands_out;
         item.transform_count *= 4) {
        result = time_copies(view, frame, &item, scale * sqrt(2.0), &times);
        stands_out = fmin(times.triangles, times.splats) > fmax(times.nothing / 4, 2e-4);
    }
    if (result != PBR_OK) return result;
    if (!stands_out && !(fmin(times.triangles, times.splats) > times.nothing / 16))
        return pbr_log(view->renderer->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "pbr_renderer_measure_point_cost: what the mesh costs does not stand out of what a frame does");
    *point_cost = (float)(times.per_splat / times.per_triangle);
    return PBR_OK;
}

/* Without depth, so that nothing has to be cleared. */
static pbr_result make_target(pbr_renderer *renderer, GLuint *texture, GLuint *framebuffer) {
    const struct gl *gl = &renderer->gl;
    GLint bound[3];
    const GLenum pending = gl_drain_errors(gl);
    if (pending != GL_NO_ERROR)
        pbr_log(renderer->instance, PBR_LOG_WARNING, PBR_OK,
                "pbr_renderer_measure_point_cost: the host had left GL error 0x%04x, which is taken off", (unsigned)pending);
    (*gl->GetIntegerv)(GL_TEXTURE_BINDING_2D, &bound[0]);
    (*gl->GetIntegerv)(GL_PIXEL_UNPACK_BUFFER_BINDING, &bound[1]);
    (*gl->GetIntegerv)(GL_DRAW_FRAMEBUFFER_BINDING, &bound[2]);
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, 0);
    *texture = gl_make_texture(gl, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, MOST_PIXELS, MOST_PIXELS);
    (*gl->GenFramebuffers)(1, framebuffer);
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, *framebuffer);
    (*gl->FramebufferTexture2D)(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, *texture, 0);
    const GLenum status = (*gl->CheckFramebufferStatus)(GL_DRAW_FRAMEBUFFER), error = gl_drain_errors(gl);
    (*gl->BindTexture)(GL_TEXTURE_2D, (GLuint)bound[0]);
    (*gl->BindBuffer)(GL_PIXEL_UNPACK_BUFFER, (GLuint)bound[1]);
    (*gl->BindFramebuffer)(GL_DRAW_FRAMEBUFFER, (GLuint)bound[2]);
    if (error == GL_NO_ERROR && status == GL_FRAMEBUFFER_COMPLETE) return PBR_OK;
    return pbr_log(renderer->instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_GPU_MEMORY,
                   "pbr_renderer_measure_point_cost: OpenGL refuses a target of %d x %d pixels (error 0x%04x)", MOST_PIXELS,
                   MOST_PIXELS, (unsigned)error);
}

pbr_result pbr_renderer_measure_point_cost(pbr_renderer *renderer, uint32_t splat, float size, float *point_cost) {
    if (!renderer) return PBR_ERROR_INVALID_ARGUMENT;
    pbr_instance *instance = renderer->instance;
    if (!point_cost || splat > PBR_SPLAT_EWA_MAX || !(size > 0) || !isfinite(size))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_renderer_measure_point_cost: splat is unknown, size is not a size, or point_cost is NULL");
    if (renderer->abandoned)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_CONTEXT, "pbr_renderer_measure_point_cost: the renderer was abandoned");
    const struct gl *gl = &renderer->gl;
    pbr_lod *lod = NULL;
    pbr_view *view = NULL;
    GLuint texture = 0, framebuffer = 0;
    const bool had_targets = renderer->targets.depth != 0;
    pbr_result result = make_hierarchy(instance, &lod);
    if (result == PBR_OK) result = pbr_view_create(renderer, NULL, &view);
    if (result == PBR_OK) result = make_target(renderer, &texture, &framebuffer);
    if (result == PBR_OK) result = measure(view, lod, framebuffer, splat, (double)size, point_cost);
    if (lod) pbr_renderer_evict_lod(renderer, lod);
    pbr_view_destroy(&view);
    pbr_lod_release(&lod);
    (*gl->DeleteFramebuffers)(1, &framebuffer);
    (*gl->DeleteTextures)(1, &texture);
    if (!had_targets) targets_free(gl, &renderer->targets);
    return result;
}
