/* SPDX-License-Identifier: MIT */
/** @file renderer.h
 * The renderer: libpbr's OpenGL objects in one context of the host's. And the view: what one camera remembers.
 *
 * Every function here that says "context" needs the context that was current at #pbr_renderer_create to be current on the
 * calling thread. A renderer and its views are used by one thread at a time; different renderers never meet.
 */
#ifndef PBR_RENDERER_H
#define PBR_RENDERER_H

#include <pbr/lod.h>

PBR_BEGIN_DECLS

/** Programs, and copies of what is drawn, in one OpenGL context. */
typedef struct pbr_renderer pbr_renderer;
/** What one camera remembers between its frames. */
typedef struct pbr_view pbr_view;

/** Flags of #pbr_renderer_desc. */
enum {
    /**
     * Do not query and restore the host's OpenGL state, for a host that resets state itself. The picture does not change.
     * After a call the following are left at libpbr's values: program, vertex array, GL_ARRAY_BUFFER binding, draw framebuffer binding,
     * draw buffers of the target; viewport 0, scissor box and test 0, depth range 0, depth test, function and mask, depth clamp and bounds;
     * blending, its functions and equations, and colour mask of draw buffers 0 and 1; the active texture unit, and of units 0 to 2
     * the 2D texture and the sampler; with #PBR_FRAME_OCCLUSION read framebuffer and pixel pack buffer bindings, and pixel pack
     * parameters; with blended or filled sequential point trees the bindings of GL_DRAW_INDIRECT_BUFFER and GL_SHADER_STORAGE_BUFFER, and of
     * the latter also indices 0 to 2; stencil test, culling, polygon mode, offset and smoothing, logic op, dither, sRGB encoding;
     * multisampling, sample coverage, mask, shading, alpha to coverage and to one; primitive restart, rasterizer discard, program point size, point fade threshold, clip distances and clip control; and in compatibility contexts alpha
     * test, point sprite, point smoothing, polygon stipple, two-sided vertex colours and fragment colour clamping.
     */
    PBR_RENDERER_KEEP_NO_STATE = 1u << 0
};

/** What #pbr_renderer_create needs. */
typedef struct pbr_renderer_desc {
    size_t struct_size;
    /** Address of an OpenGL function of the current context, or NULL if it has none of that name. It is called only during
     * #pbr_renderer_create, and only for functions of versions and extensions that the context reports. NULL = libepoxy. */
    void *(*get_proc_address)(void *user, const char *name);
    void *get_proc_address_user; /**< First argument of `get_proc_address`. */
    uint64_t gpu_memory_budget; /**< Bytes of GPU memory for copies of points and cuts, 0 = no limit. When a frame needs more, what was
                                     drawn longest ago is dropped; what a frame itself draws must fit. */
    float point_size_limit;     /**< Largest diameter in pixels drawn as an OpenGL point, 0 = the context's own. Larger splats
                                     are drawn as quads, without a visible difference. */
    uint32_t flags;             /**< PBR_RENDERER_... */
} pbr_renderer_desc;

#define PBR_RENDERER_DESC_INIT PBR_SIZED(pbr_renderer_desc)

/** What a renderer found and holds. Set `struct_size` before the call (#PBR_RENDERER_INFO_INIT). */
typedef struct pbr_renderer_info {
    size_t struct_size;
    uint32_t gl_version;          /**< 10 x major + minor: 33, 45; ES: 30, 32. */
    int32_t is_es;                /**< OpenGL ES. */
    int32_t is_compatibility;     /**< A compatibility profile. */
    int32_t has_clip_control;     /**< 0..1 clip depth keeps its precision; without it is converted. */
    float point_size_limit;       /**< Pixels; see #pbr_renderer_desc. */
    uint32_t max_lights;          /**< Per frame. */
    uint32_t max_clip_planes;     /**< Per item. */
    uint32_t max_items;           /**< Per frame. */
    uint32_t max_transforms;      /**< Per item. */
    uint64_t max_points;          /**< Per point set. */
    uint32_t max_viewport[2];     /**< Pixels. */
    uint64_t gpu_memory_budget;   /**< Bytes; UINT64_MAX = no limit. */
    uint64_t gpu_memory_bytes;    /**< Bytes held now. */
    uint64_t gpu_object_count;    /**< Names of GL objects held now. */
} pbr_renderer_info;

#define PBR_RENDERER_INFO_INIT PBR_SIZED(pbr_renderer_info)

/**
 * Creates a renderer for the current context: OpenGL 3.3 or later (core or compatibility), or OpenGL ES 3.0 or later. Changes no
 * GL state. Programs are compiled later, when a combination is first drawn or by #pbr_prepare.
 * @param instance  Outlives the renderer.
 * @param desc      NULL = defaults.
 * @param out       Receives the renderer, or NULL on error. The caller owns it.
 * @return #PBR_OK; #PBR_ERROR_CONTEXT if no context is current (with a `get_proc_address` of the host's only if its glGetString
 *         returns NULL then); #PBR_ERROR_UNSUPPORTED if the context lacks a function or
 *         version, named in the log; #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_OUT_OF_MEMORY.
 * Context. Since 0.1.
 */
PBR_API pbr_result pbr_renderer_create(pbr_instance *instance, const pbr_renderer_desc *desc, pbr_renderer **out);

/**
 * Frees the renderer and its GL objects, and sets `*renderer` to NULL.
 * @param renderer  NULL and a pointer to NULL are allowed.
 * @return #PBR_OK; #PBR_ERROR_BUSY if views made from it live on: then nothing is destroyed.
 * Context, unless abandoned. Since 0.1.
 */
PBR_API pbr_result pbr_renderer_destroy(pbr_renderer **renderer);

/**
 * Tells that the context is lost or gone: from now on no call makes a GL call; drawing returns #PBR_ERROR_CONTEXT. Destroy
 * views and renderer as usual, with no context.
 * @param renderer  NULL is allowed.
 * No context; one thread at a time per renderer. Since 0.1.
 */
PBR_API void pbr_renderer_abandon(pbr_renderer *renderer);

/**
 * Drops the GPU copy of a point set and the reference that the renderer holds on it. Drawing it again uploads it again.
 * @param renderer  NULL is allowed.
 * @param points    NULL = every point set, every hierarchy, and the targets of blended splats. One that the renderer does not hold is
 *                  allowed.
 * Context, unless abandoned. Since 0.1.
 */
PBR_API void pbr_renderer_evict(pbr_renderer *renderer, const pbr_points *points);

/**
 * Drops all cuts of a hierarchy, with their GPU copies, that the renderer's views hold, and their references on it. Drawing it again
 * cuts it again.
 * @param renderer  NULL is allowed.
 * @param lod       NULL = every hierarchy. One that no view holds is allowed.
 * Context, unless abandoned. Since 0.1.
 */
PBR_API void pbr_renderer_evict_lod(pbr_renderer *renderer, const pbr_lod *lod);

/**
 * Describes a renderer.
 * @param renderer  Is only read.
 * @param info      `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. No context; one thread at a time per renderer. Since 0.1.
 */
PBR_API pbr_result pbr_renderer_get_info(const pbr_renderer *renderer, pbr_renderer_info *info);

/** What #pbr_view_create needs. */
typedef struct pbr_view_desc {
    size_t struct_size;
    uint32_t flags;    /**< Must be 0. */
    uint32_t reserved; /**< Must be 0. */
} pbr_view_desc;

#define PBR_VIEW_DESC_INIT PBR_SIZED(pbr_view_desc)

/**
 * Creates what one camera remembers between its frames. Each eye of a stereo pair, each shadow map, each mirror uses its own.
 * @param renderer  Outlives the view.
 * @param desc      NULL = defaults.
 * @param out       Receives the view, or NULL on error. The caller owns it.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CONTEXT (abandoned).
 * Context. Since 0.1.
 */
PBR_API pbr_result pbr_view_create(pbr_renderer *renderer, const pbr_view_desc *desc, pbr_view **out);

/**
 * Destroys a view and sets `*view` to NULL.
 * @param view  NULL and a pointer to NULL are allowed.
 * Context, unless abandoned. Since 0.1.
 */
PBR_API void pbr_view_destroy(pbr_view **view);

PBR_END_DECLS
#endif
