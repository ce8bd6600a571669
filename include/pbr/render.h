/* SPDX-License-Identifier: MIT */
/** @file render.h
 * Drawing one frame: camera and target (#pbr_frame), what to draw (#pbr_item), and the call.
 *
 * ## What pbr_render promises the host
 *
 * 1. Every piece of GL state is as it was, after success and after any error.
 * 2. The picture does not depend on that state: everything that matters is in #pbr_frame and #pbr_item.
 * 3. Splats and the host's geometry hide each other through the host's depth buffer, also on multisampled targets.
 * 4. It raises no GL error, and asks for errors only in a frame that allocates GPU memory; an error of the host's that is found then
 *    is handed over in #pbr_stats.
 * 5. It does not print, abort, raise or handle signals, change the locale, or keep global state.
 * 6. In steady state it allocates no heap memory, creates no GL object, compiles no shader and waits for no GPU work, nor for the
 *    refinement thread (one a renderer, from the first frame that draws a hierarchy without #PBR_FRAME_WAIT to the renderer's end, which
 *    blocks every signal; none where the instance's `thread_count` is 1: every frame waits then). While a camera
 *    moves before hierarchies, it makes a fence (a sync object) for each frame and cut, and tests it without waiting; memory for their
 *    nodes only grows, by an eighth or more, when there are more of them in view than ever before.
 *
 * Written exceptions:
 * - Active, unpaused transform feedback cannot be drawn under: end or pause it first. Where the context can tell (OpenGL 4.0,
 *   ES 3.0) the call returns #PBR_ERROR_INVALID_ARGUMENT; on OpenGL 3.3 it is the host's duty.
 * - Active conditional rendering applies to libpbr's draws: they may be dropped.
 * - Queries that run go on and count libpbr's work.
 * - In compatibility contexts: an open display list, and the selection and feedback render modes, are the host's to end first.
 * - An object that the host deleted while it was bound stays deleted: its binding is left at 0.
 * - Where #PBR_TARGET_BOUND is asked and the bound framebuffer is incomplete, nothing is drawn (#PBR_ERROR_GL).
 * - In contexts of OpenGL 4.0 and later the subroutine uniforms of the host's program get their defaults when it is put back, as at
 *   every glUseProgram.
 * - The window-space state of extensions that are not in OpenGL 4.6 or ES 3.2 (conservative rasterisation, viewport swizzles,
 *   shading rate) is neither saved nor overridden, and so are switches that an extension brings to a version without
 *   them (sample shading before OpenGL 4.0 and ES 3.2, polygon modes on ES). GL_AMD_depth_clamp_separate's halves are one switch. Where indexed state came as an extension to an older version (viewport arrays
 *   before OpenGL 4.1 and on ES, indexed blending before ES 3.2), all indices get index 0's viewport, scissor, blend
 *   switch, functions and equations, and colour mask back.
 */
#ifndef PBR_RENDER_H
#define PBR_RENDER_H

#include <pbr/lod.h>
#include <pbr/renderer.h>

PBR_BEGIN_DECLS

#define PBR_MAX_LIGHTS 8            /**< Lights of a frame. */
#define PBR_MAX_CLIP_PLANES 8       /**< Clip planes of an item. */
#define PBR_MAX_ITEMS 65536         /**< Items of a frame. */
#define PBR_MAX_TRANSFORMS 1048576  /**< Transforms of an item. */

/** Which framebuffer is drawn to. */
enum {
    PBR_TARGET_BOUND = 0,      /**< The one bound to GL_DRAW_FRAMEBUFFER. */
    PBR_TARGET_FRAMEBUFFER = 1 /**< The name in #pbr_frame::framebuffer; 0 is the window's. */
};

/** How colours are stored in the target. */
enum {
    PBR_ENCODING_AUTO = 0,  /**< sRGB for normalised integer formats, linear for floating-point formats. */
    PBR_ENCODING_SRGB = 1,  /**< sRGB; an sRGB format's own conversion is used where there is one. */
    PBR_ENCODING_LINEAR = 2 /**< Linear; an sRGB format's conversion is switched off if the context can. */
};

/** Flags of #pbr_frame. */
enum {
    PBR_FRAME_REVERSED_Z = 1u << 0,       /**< Nearer is larger in window depth. */
    PBR_FRAME_CLIP_ZERO_TO_ONE = 1u << 1, /**< The projection's clip depth is 0..w, not -w..w. */
    PBR_FRAME_CLIP_UPPER_LEFT = 1u << 2,  /**< As glClipControl(GL_UPPER_LEFT): clip y points down the window. */
    PBR_FRAME_NO_DEPTH_TEST = 1u << 3,    /**< Neither test nor write depth. */
    PBR_FRAME_NO_DEPTH_WRITE = 1u << 4,   /**< Test, but do not write. */
    PBR_FRAME_SCISSOR = 1u << 5,          /**< Draw only inside #pbr_frame::scissor. */
    PBR_FRAME_WAIT = 1u << 6,             /**< Cut hierarchies for just this view before they are drawn, on the calling thread and the
                                               instance's, as long as that takes. Else a thread of the renderer's and the instance's cut them, coarse to
                                               fine, and the frame draws the newest cut that is finished: of a hierarchy that is new,
                                               nothing at first. Where another cut has taken the GPU memory of what was shown, the frame
                                               waits all the same. Where the budget has no room for a finer cut, one frame returns
                                               #PBR_ERROR_OUT_OF_GPU_MEMORY; the next ones draw what was shown before, and are not final. */
    PBR_FRAME_OCCLUSION = 1u << 7         /**< Draw nodes of QSplat trees that lie behind what an earlier picture of the view showed as one
                                               splat each, however large; the host's geometry hides, too, if it was drawn before. Nothing is missing: what
                                               comes into sight is coarse until that is known (some frames later, without waiting; while the camera moves,
                                               until the next cut) and it is cut again. Frames that wait use pictures of the same camera and items only.
                                               After its own geometry changed, the host is to draw a few frames more, whatever `is_final` says; that may turn
                                               0 once at rest, too. Each frame copies the target's depth, and counts in queries: the flag is without effect on
                                               targets with several samples or no depth, and where depth is not both tested, by the usual function, and
                                               written. It pays where much is behind something: docs/qsplat.md. */
};

/** What a light is. */
enum {
    PBR_LIGHT_DIRECTIONAL = 0, /**< `vector` points from the surface towards the light; any length but 0. */
    PBR_LIGHT_POINT = 1        /**< `vector` is a position; no attenuation. */
};
/** In which space a light's `vector` is. */
enum {
    PBR_SPACE_EYE = 0,  /**< Moves with the camera. */
    PBR_SPACE_WORLD = 1 /**< Stands in the world. */
};

/** One light. */
typedef struct pbr_light {
    size_t struct_size;
    uint32_t kind;   /**< PBR_LIGHT_... */
    uint32_t space;  /**< PBR_SPACE_... of `vector`. */
    double vector[3]; /**< Direction or position, by `kind`. */
    float colour[3]; /**< Linear intensity of the diffuse and specular terms. */
    float reserved;  /**< Must be 0. */
} pbr_light;

#define PBR_LIGHT_INIT PBR_SIZED(pbr_light)

/** As #pbr_frame::threshold: hierarchies are drawn by their leaves. */
#define PBR_THRESHOLD_LEAVES (-1.0f)

/** Camera, target and light of one frame. */
typedef struct pbr_frame {
    size_t struct_size;
    double view[16];        /**< World to eye, affine. All zero = identity. */
    double projection[16];  /**< Eye to clip: any invertible projection, jitter excluded. Required. */
    int32_t viewport[4];    /**< x, y, width, height in pixels. Width and height 0 = the viewport bound in GL (where
                                 that has no area, nothing is drawn). */
    int32_t scissor[4];     /**< With #PBR_FRAME_SCISSOR; x, y, width, height in window pixels. */
    double jitter[2];       /**< Sub-pixel shift of the picture to the right and up, in pixels; restarts no refinement. */
    float depth_range[2];   /**< Window depth of the near and far clip values, as glDepthRange. Both 0 = 0 and 1. */
    uint32_t target;        /**< PBR_TARGET_... */
    uint32_t framebuffer;   /**< With #PBR_TARGET_FRAMEBUFFER: a framebuffer name. */
    uint32_t encoding;      /**< PBR_ENCODING_... */
    uint32_t depth_function; /**< GL_LESS, GL_GEQUAL, ... for splats against the target's depth. 0 = GL_LESS, or GL_GREATER when reversed. */
    uint32_t flags;         /**< PBR_FRAME_... */
    uint32_t light_count;   /**< At most #PBR_MAX_LIGHTS. */
    const pbr_light *lights; /**< NULL with `light_count` 0 = one white directional light from the eye. */
    float ambient[3];       /**< Linear ambient light. All 0 with no lights given = 1; with lights given it is taken as it is. */
    float threshold;        /**< Pixels: a node of a hierarchy whose diameter on screen is no larger is drawn as one splat, and what is
                                 below it is not looked at. `radius_scale` does not count. In a final picture inner nodes of
                                 #PBR_LOD_QSPLAT trees whose discs may be seen from the edge, or nearly so, are 7 pixels at most:
                                 outlines stay closed. 0 = 1; #PBR_THRESHOLD_LEAVES. */
    double time_budget;     /**< Seconds that drawing may take while something moves before hierarchies: coarser thresholds are chosen by
                                 what earlier frames of the view took, 64 pixels at most. When everything rests, frames get finer again, to
                                 `threshold`. 0 = every frame at `threshold`; without effect on #PBR_THRESHOLD_LEAVES. */
} pbr_frame;

#define PBR_FRAME_INIT PBR_SIZED(pbr_frame)

/**
 * Shape of a splat on the screen; docs/splats.md has the formulas. r: the radius in eye units, z: the distance along the view axis,
 * f: the focal length in pixels (the larger of both axes). Circle and square are parallel to the screen: a surface that faces the
 * eye away from the view axis is seen stretched by 1 / cos of the angle to the axis, which radii that just close it do not cover;
 * `radius_scale` does. The other kinds are the discs themselves, projected exactly, each pixel with its own depth; but those that
 * are nearly seen from their edge, in object space at more than 82 degrees, are drawn up to half as high again, by two pixels at
 * most. Points without normals face the eye.
 */
enum {
    PBR_SPLAT_CIRCLE = 0,   /**< Disc of diameter 2 r f / z pixels, parallel to the screen, at its centre's depth. */
    PBR_SPLAT_SQUARE = 1,   /**< Square of that side. The fastest kind. */
    PBR_SPLAT_ELLIPSE = 2,  /**< The disc of radius r across the normal (Zwicker et al. 2004, Sigg et al. 2006). Opaque. */
    PBR_SPLAT_GAUSSIAN = 3, /**< The same, blended over the surface with Gaussian weights, r = 2 sigma (Botsch & Kobbelt 2003). */
    PBR_SPLAT_EWA = 4,      /**< The Gaussian convolved with the screen's low-pass: no aliasing (Zwicker et al. 2001). */
    PBR_SPLAT_EWA_MAX = 5   /**< The larger of the Gaussian and the low-pass instead of their convolution (Botsch et al. 2005). */
};

/** How splats become a surface. */
enum {
    PBR_BLEND_KIND = 0, /**< As the kind has it: the nearest is seen of circle, square and ellipse; the others are blended. */
    PBR_BLEND_FILL = 1  /**< Circle, square and ellipse mark what they hide, their centres bring colours, and each pixel takes the
                             Gaussian mean of the centres within the splats' radius around it (Pfister et al. 2000). For splats up to
                             a radius of 16 pixels; larger ones are seen as they are. Lit once a splat. */
};

/** Lighting. */
enum {
    PBR_SHADE_PHONG = 0,      /**< Phong (1975), once a splat, where there are normals; otherwise unlit. */
    PBR_SHADE_NONE = 1,       /**< The colour as it is. */
    PBR_SHADE_DEFERRED = 2,   /**< Blended kinds: normals and colours are blended, then lit once a pixel; opaque kinds as PHONG. */
    PBR_SHADE_PHONG_FIELD = 3 /**< The same with a normal that varies over each splat (Botsch et al. 2004), fitted to its neighbours'
                                   when the points are first drawn so: seconds for a million points, 8 bytes each on the GPU. Of hierarchies
                                   those that were built with #PBR_LOD_NORMAL_FIELDS have it; the others are as DEFERRED. */
};

/** Where a splat's colour comes from. */
enum {
    PBR_COLOUR_POINTS = 0,  /**< The points' colours; `pbr_item::colour` where they have none. */
    PBR_COLOUR_CONSTANT = 1, /**< `pbr_item::colour`. */
    PBR_COLOUR_SCALAR = 2,  /**< `scalar_index` through the colour map; points with a NaN value take `colour`. */
    PBR_COLOUR_NORMAL = 3,  /**< Object-space normal, (n + 1) / 2, taken as sRGB; `colour` where there is none. */
    PBR_COLOUR_DEPTH = 4,   /**< Distance along the view axis through the colour map, over `scalar_range` (world units). */
    PBR_COLOUR_PRIMITIVE = 5 /**< Splats red, triangles blue: what a hierarchy over a mesh draws as which (Benda 2005). */
};

/** Flags of #pbr_item. */
enum {
    PBR_ITEM_CULL_BACK_FACES = 1u << 0, /**< Drop splats whose normal points away from the eye; else both sides are lit. Of a
                                             QSplat tree's inner nodes those under which all normals do, and of POP
                                             hierarchies' nodes and triangles those of which all vertices' normals do. */
    PBR_ITEM_HIDDEN = 1u << 1           /**< Skip this item; what it holds on the GPU stays unless the frame needs the budget. */
};

/** Phong's coefficients. All zero = ambient 0.1, diffuse 0.9, specular 0.15, shininess 32. */
typedef struct pbr_material {
    float ambient;   /**< Of #pbr_frame::ambient. */
    float diffuse;   /**< Of the lights' colours. */
    float specular;  /**< Of white highlights. */
    float shininess; /**< Exponent. */
} pbr_material;

/** One thing to draw: a point set or a hierarchy, once or many times. */
typedef struct pbr_item {
    size_t struct_size;
    uint64_t id;              /**< The host's own number, the same in every frame: per-view memory is keyed by it. */
    const pbr_points *points; /**< What is drawn, unless `lod` is. Held by the renderer until evicted. */
    const double *transforms; /**< `transform_count` object-to-world matrices, affine. NULL with count 0 = one identity. */
    uint32_t transform_count; /**< At most #PBR_MAX_TRANSFORMS. */
    uint32_t splat;           /**< PBR_SPLAT_... */
    uint32_t shading;         /**< PBR_SHADE_... */
    uint32_t colour_source;   /**< PBR_COLOUR_... */
    uint32_t flags;           /**< PBR_ITEM_... */
    float radius_scale;       /**< Factor on every radius, 0 = 1. */
    float size_minimum;       /**< Smallest diameter on screen, pixels; 0 = the least that always covers a pixel centre:
                                   1 for squares and circles; none for the kinds that lie in space. Of those it is the
                                   diameter of the disc seen face on. */
    float size_maximum;       /**< Largest diameter on screen, likewise; 0 = no limit. No square or circle is smaller than the
                                   context's smallest point, 1 pixel as a rule. */
    float colour[4];          /**< Linear colour where points have none. All 0 = 0.8 grey. */
    pbr_material material;    /**< Unused where nothing is lit. */
    uint32_t scalar_index;    /**< With #PBR_COLOUR_SCALAR. */
    uint32_t colour_map_size; /**< Entries of `colour_map`, 2..32; 0 with NULL = the built-in map (dark blue to yellow). */
    const float *colour_map;  /**< Linear RGB triples, evenly spaced over `scalar_range` and interpolated. */
    float scalar_range[2];    /**< Values at the map's ends. Both 0 = the attribute's own range (for depth: the item's). */
    const double *clip_planes; /**< `clip_plane_count` x (a, b, c, d), world space: a splat is drawn iff its centre has
                                    a x + b y + c z + d >= 0 for all, a triangle where its points have. A box is six planes. */
    uint32_t clip_plane_count; /**< At most #PBR_MAX_CLIP_PLANES. */
    uint32_t blending;        /**< PBR_BLEND_... */
    float low_pass;           /**< ewa and ewa-max: variance of the screen's low-pass filter, square pixels, at most 16; 0 = 1. Less is
                                   sharper and lets finer detail than the pixels' alias: docs/quality.md has figures. */
    float point_cost;         /**< Of hierarchies over meshes: what a splat costs, in triangles; nodes under which there are fewer are drawn as
                                   these, however small, but for the root. 0 = 1, as Benda has it: each triangle under the threshold is a splat.
                                   #pbr_renderer_measure_point_cost finds one. */
    const pbr_lod *lod;       /**< A hierarchy, instead of `points`: exactly one of both is given. QSplat trees and POP hierarchies are cut for each transform by
                                   themselves; the view holds it, its cuts and their copies on the GPU until 64 of its frames have not named
                                   the item's `id` with it, or it is evicted. A sequential point tree is sent to the GPU, chunks in view first,
                                   and held by the renderer until it is evicted (its chunks make room where the budget needs it). There are no scalars
                                   (#PBR_COLOUR_SCALAR is refused). */
} pbr_item;

#define PBR_ITEM_INIT PBR_SIZED(pbr_item)

/** What a frame did. Set `struct_size` before the call (#PBR_STATS_INIT). */
typedef struct pbr_stats {
    size_t struct_size;
    uint64_t points;          /**< Points, or leaves of hierarchies, of all items and transforms that are not hidden. */
    uint64_t splats_drawn;    /**< Splats handed to OpenGL. The vertex stage may still drop some (back faces, clip planes). Of a
                                   hierarchy's cut for the frame's very view those between the pixels are not. */
    uint64_t splats_as_quads; /**< Of these, how many were also offered to the quad path. */
    uint64_t splats_culled;   /**< Points in blocks, or nodes of hierarchies, outside the view or, where back faces are dropped, facing
                                   away; what is below such a node is not counted. */
    uint64_t nodes_visited;   /**< Blocks, nodes of hierarchies, or chunks of sequential point trees, tested against the view by this call, or for cuts that it took over from
                                   the refinement thread: none of a hierarchy whose view is the last frame's. */
    uint64_t draw_calls;      /**< Of OpenGL. */
    uint64_t upload_bytes;    /**< Bytes sent to the GPU by this call, uniforms excluded. */
    uint64_t gpu_memory_bytes; /**< Bytes that the renderer holds after the call. */
    double cut_seconds;       /**< Time spent deciding what to draw, likewise. */
    uint32_t host_gl_error;   /**< A GL error that the host had left behind, found while allocating; else 0. */
    uint32_t programs_compiled; /**< By this call. */
    int32_t is_final;         /**< 1: the same frame again would give the same picture. 0: hierarchies are being refined, or sent; draw on. Where the
                                   camera outran the last cut, such a picture lacks what came into view since, and may cut splats off at its
                                   border. */
    uint32_t buffers_orphaned; /**< Copies of cuts that got new GPU memory since the GPU still read what was to be replaced. */
    uint64_t nodes_damaged;   /**< Groups of nodes that lie outside their hierarchy's file: they, and what is below them, are missing. */
    double frame_seconds;     /**< With #pbr_frame::time_budget: what an earlier frame took, if that became known now; else 0. By the GPU's
                                   clock, or on the calling thread where that is longer or the context has no timestamps. */
    float threshold;          /**< Pixels: that of the coarsest cut that was drawn; 0 where all were of leaves, or there was none. */
    uint32_t reserved;        /**< 0. */
    uint64_t nodes_hidden;    /**< With #PBR_FRAME_OCCLUSION: nodes that were drawn as one splat since they were hidden. */
    uint64_t triangles_drawn; /**< Triangles of hierarchies over meshes, handed to OpenGL. */
} pbr_stats;

#define PBR_STATS_INIT PBR_SIZED(pbr_stats)

/**
 * Draws items. See the promises at the top of this header. Output is premultiplied alpha; opaque splats write alpha 1.
 * @param view        The camera's memory; decides the renderer.
 * @param frame       Read during the call only.
 * @param items       `item_count` items, read during the call only; NULL with 0.
 * @param item_count  At most #PBR_MAX_ITEMS.
 * @param stats       May be NULL. Written also on error, as far as the call came.
 * @return #PBR_OK; #PBR_ERROR_INVALID_ARGUMENT (nothing was drawn), #PBR_ERROR_LIMIT (likewise; also for more than 2^31 - 1 splats of
 *         one hierarchy in view), #PBR_ERROR_OUT_OF_MEMORY,
 *         #PBR_ERROR_OUT_OF_GPU_MEMORY (nothing was drawn), #PBR_ERROR_UNSUPPORTED (a target of integers or of several views; blended
 *         kinds and filled items where no half floats can be drawn to; linear
 *         values in an sRGB target where the context cannot switch the conversion off), #PBR_ERROR_GL (an incomplete target, a
 *         shader that the driver refuses), #PBR_ERROR_CONTEXT (abandoned).
 * Context; one thread at a time per renderer. Since 0.1.
 */
PBR_API pbr_result pbr_render(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats);

/**
 * Does ahead of time what the first #pbr_render with these arguments would do besides drawing: compiles programs, uploads
 * points, cuts hierarchies. Draws nothing, and keeps the same promises about GL state.
 * @param view        As #pbr_render, all of them.
 * @param frame       Its target decides on programs, too.
 * @param items       Hidden ones are passed over.
 * @param item_count  At most #PBR_MAX_ITEMS.
 * @param stats       May be NULL. What is drawn stays 0.
 * @return As #pbr_render. Context; one thread at a time per renderer. Since 0.1.
 */
PBR_API pbr_result pbr_prepare(pbr_view *view, const pbr_frame *frame, const pbr_item *items, size_t item_count, pbr_stats *stats);

/**
 * Finds the #pbr_item::point_cost with which an item is drawn fastest on this GPU, by a camera that rests here: a host may do so once, where
 * it is usually looked at from, or where much of it has changed. Draws the item with up to 10 costs, 4 frames each, in a view of its own,
 * waits for the GPU each time, and takes the least time (of Cohen, Aliaga, Zhang 2001 the choice, between points and triangles, by what
 * they take). It draws to the frame's target, which is to be cleared before, as for any frame, and after; each frame has a fortieth of the
 * depth range, so that a depth buffer of 16 bits tells little apart.
 * @param renderer    Its programs for the item are compiled, if they were not, and its copy of the mesh stays.
 * @param frame       As #pbr_render has it, but that it waits, and draws at its threshold whatever its time budget.
 * @param item        Over a #PBR_LOD_POP hierarchy, not hidden; its own point cost does not count.
 * @param point_cost  Receives 1 where no other is clearly faster, or 2, 8, 32, ... Larger ones draw more triangles: where these do not fit
 *                    into the renderer's budget, which is logged, the best of those that did.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, or as #pbr_render; then `point_cost` is left as it is.
 * Context; one thread at a time per renderer. Since 0.1.
 */
PBR_API pbr_result pbr_renderer_measure_point_cost(pbr_renderer *renderer, const pbr_frame *frame, const pbr_item *item,
                                                   float *point_cost);

PBR_END_DECLS
#endif
