/* One OpenGL context as libpbr sees it: its functions, version and limits, found once when a renderer is made.
 *
 * Every GL call goes through this table: (*gl->DrawArrays)(...). An entry points to a function pointer, the renderer's own where
 * the host gave get_proc_address, else libepoxy's, which resolves itself at its first call. An entry that the context's version or
 * extensions do not promise is NULL; those of the baseline never are. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_CONTEXT_H
#define PBR_GL_CONTEXT_H

#include <epoxy/gl.h>
#include <pbr/renderer.h>

#include "core/instance.h"

/* F(name, type, first version of desktop OpenGL that has it, first of OpenGL ES, extension that brings it earlier on the desktop);
 * 0 = never. Up to 33 and 30 they are required. */
#define GL_FUNCTIONS(F)                                                                                                            \
    F(ActiveTexture, ACTIVETEXTURE, 13, 20, NULL)                                                                                  \
    F(AttachShader, ATTACHSHADER, 20, 20, NULL)                                                                                    \
    F(BindBuffer, BINDBUFFER, 15, 20, NULL)                                                                                        \
    F(BindBufferBase, BINDBUFFERBASE, 30, 30, NULL)                                                                                \
    F(BindBufferRange, BINDBUFFERRANGE, 30, 30, NULL)                                                                              \
    F(BindFramebuffer, BINDFRAMEBUFFER, 30, 20, NULL)                                                                              \
    F(BindSampler, BINDSAMPLER, 33, 30, NULL)                                                                                      \
    F(BindTexture, BINDTEXTURE, 11, 20, NULL)                                                                                      \
    F(BindVertexArray, BINDVERTEXARRAY, 30, 30, NULL)                                                                              \
    F(BlendEquation, BLENDEQUATION, 14, 20, NULL)                                                                                  \
    F(BlendEquationi, BLENDEQUATIONI, 40, 32, NULL)                                                                                \
    F(BlendEquationSeparate, BLENDEQUATIONSEPARATE, 20, 20, NULL)                                                                  \
    F(BlendEquationSeparatei, BLENDEQUATIONSEPARATEI, 40, 32, NULL)                                                                \
    F(BlendFuncSeparate, BLENDFUNCSEPARATE, 14, 20, NULL)                                                                          \
    F(BlendFuncSeparatei, BLENDFUNCSEPARATEI, 40, 32, NULL)                                                                        \
    F(BlitFramebuffer, BLITFRAMEBUFFER, 30, 30, NULL)                                                                              \
    F(BufferData, BUFFERDATA, 15, 20, NULL)                                                                                        \
    F(BufferSubData, BUFFERSUBDATA, 15, 20, NULL)                                                                                  \
    F(CheckFramebufferStatus, CHECKFRAMEBUFFERSTATUS, 30, 20, NULL)                                                                \
    F(ClampColor, CLAMPCOLOR, 30, 0, NULL)                                                                                         \
    F(ClearBufferfv, CLEARBUFFERFV, 30, 30, NULL)                                                                                  \
    F(ClearBufferuiv, CLEARBUFFERUIV, 30, 30, NULL)                                                                                \
    F(ClientWaitSync, CLIENTWAITSYNC, 32, 30, NULL)                                                                                \
    F(ClipControl, CLIPCONTROL, 45, 0, "GL_ARB_clip_control")                                                                      \
    F(ColorMask, COLORMASK, 10, 20, NULL)                                                                                          \
    F(ColorMaski, COLORMASKI, 30, 32, NULL)                                                                                        \
    F(CompileShader, COMPILESHADER, 20, 20, NULL)                                                                                  \
    F(CreateProgram, CREATEPROGRAM, 20, 20, NULL)                                                                                  \
    F(CreateShader, CREATESHADER, 20, 20, NULL)                                                                                    \
    F(DeleteBuffers, DELETEBUFFERS, 15, 20, NULL)                                                                                  \
    F(DeleteFramebuffers, DELETEFRAMEBUFFERS, 30, 20, NULL)                                                                        \
    F(DeleteProgram, DELETEPROGRAM, 20, 20, NULL)                                                                                  \
    F(DeleteQueries, DELETEQUERIES, 15, 0, NULL)                                                                                   \
    F(DeleteShader, DELETESHADER, 20, 20, NULL)                                                                                    \
    F(DeleteSync, DELETESYNC, 32, 30, NULL)                                                                                        \
    F(DeleteTextures, DELETETEXTURES, 11, 20, NULL)                                                                                \
    F(DeleteVertexArrays, DELETEVERTEXARRAYS, 30, 30, NULL)                                                                        \
    F(DepthFunc, DEPTHFUNC, 10, 20, NULL)                                                                                          \
    F(DepthMask, DEPTHMASK, 10, 20, NULL)                                                                                          \
    F(DepthRange, DEPTHRANGE, 10, 0, NULL)                                                                                         \
    F(DepthRangeIndexed, DEPTHRANGEINDEXED, 41, 0, NULL)                                                                           \
    F(DepthRangef, DEPTHRANGEF, 41, 20, NULL)                                                                                      \
    F(Disable, DISABLE, 10, 20, NULL)                                                                                              \
    F(DisableVertexAttribArray, DISABLEVERTEXATTRIBARRAY, 20, 20, NULL)                                                            \
    F(Disablei, DISABLEI, 30, 32, NULL)                                                                                            \
    F(DispatchCompute, DISPATCHCOMPUTE, 43, 31, NULL)                                                                              \
    F(DrawArrays, DRAWARRAYS, 11, 20, NULL)                                                                                        \
    F(DrawArraysIndirect, DRAWARRAYSINDIRECT, 40, 31, NULL)                                                                        \
    F(DrawArraysInstanced, DRAWARRAYSINSTANCED, 31, 30, NULL)                                                                      \
    F(DrawBuffers, DRAWBUFFERS, 20, 30, NULL)                                                                                      \
    F(DrawElements, DRAWELEMENTS, 11, 20, NULL)                                                                                    \
    F(Enable, ENABLE, 10, 20, NULL)                                                                                                \
    F(EnableVertexAttribArray, ENABLEVERTEXATTRIBARRAY, 20, 20, NULL)                                                              \
    F(Enablei, ENABLEI, 30, 32, NULL)                                                                                              \
    F(FenceSync, FENCESYNC, 32, 30, NULL)                                                                                          \
    F(Finish, FINISH, 10, 20, NULL)                                                                                                \
    F(FramebufferTexture2D, FRAMEBUFFERTEXTURE2D, 30, 20, NULL)                                                                    \
    F(GenBuffers, GENBUFFERS, 15, 20, NULL)                                                                                        \
    F(GenFramebuffers, GENFRAMEBUFFERS, 30, 20, NULL)                                                                              \
    F(GenQueries, GENQUERIES, 15, 0, NULL)                                                                                         \
    F(GenTextures, GENTEXTURES, 11, 20, NULL)                                                                                      \
    F(GenVertexArrays, GENVERTEXARRAYS, 30, 30, NULL)                                                                              \
    F(GetBooleani_v, GETBOOLEANI_V, 30, 31, NULL)                                                                                  \
    F(GetBooleanv, GETBOOLEANV, 10, 20, NULL)                                                                                      \
    F(GetDoublev, GETDOUBLEV, 10, 0, NULL)                                                                                         \
    F(GetError, GETERROR, 10, 20, NULL)                                                                                            \
    F(GetFloatv, GETFLOATV, 10, 20, NULL)                                                                                          \
    F(GetFramebufferAttachmentParameteriv, GETFRAMEBUFFERATTACHMENTPARAMETERIV, 30, 20, NULL)                                      \
    F(GetInteger64v, GETINTEGER64V, 32, 30, NULL)                                                                                  \
    F(GetIntegeri_v, GETINTEGERI_V, 30, 30, NULL)                                                                                  \
    F(GetInteger64i_v, GETINTEGER64I_V, 32, 30, NULL)                                                                              \
    F(GetIntegerv, GETINTEGERV, 10, 20, NULL)                                                                                      \
    F(GetProgramInfoLog, GETPROGRAMINFOLOG, 20, 20, NULL)                                                                          \
    F(GetProgramiv, GETPROGRAMIV, 20, 20, NULL)                                                                                    \
    F(GetQueryObjectui64v, GETQUERYOBJECTUI64V, 33, 0, NULL)                                                                       \
    F(GetQueryObjectuiv, GETQUERYOBJECTUIV, 15, 0, NULL)                                                                           \
    F(GetQueryiv, GETQUERYIV, 15, 0, NULL)                                                                                         \
    F(GetShaderInfoLog, GETSHADERINFOLOG, 20, 20, NULL)                                                                            \
    F(GetShaderiv, GETSHADERIV, 20, 20, NULL)                                                                                      \
    F(GetString, GETSTRING, 10, 20, NULL)                                                                                          \
    F(GetStringi, GETSTRINGI, 30, 30, NULL)                                                                                        \
    F(GetUniformLocation, GETUNIFORMLOCATION, 20, 20, NULL)                                                                        \
    F(IsBuffer, ISBUFFER, 15, 20, NULL)                                                                                            \
    F(IsEnabled, ISENABLED, 10, 20, NULL)                                                                                          \
    F(IsEnabledi, ISENABLEDI, 30, 32, NULL)                                                                                        \
    F(IsFramebuffer, ISFRAMEBUFFER, 30, 20, NULL)                                                                                  \
    F(IsProgram, ISPROGRAM, 20, 20, NULL)                                                                                          \
    F(IsSampler, ISSAMPLER, 33, 30, NULL)                                                                                          \
    F(IsTexture, ISTEXTURE, 11, 20, NULL)                                                                                          \
    F(LinkProgram, LINKPROGRAM, 20, 20, NULL)                                                                                      \
    F(MapBufferRange, MAPBUFFERRANGE, 30, 30, NULL)                                                                                \
    F(MemoryBarrier, MEMORYBARRIER, 42, 31, NULL)                                                                                  \
    F(MultiDrawArrays, MULTIDRAWARRAYS, 14, 0, NULL)                                                                               \
    F(MultiDrawArraysIndirect, MULTIDRAWARRAYSINDIRECT, 43, 0, NULL)                                                               \
    F(PixelStorei, PIXELSTOREI, 10, 20, NULL)                                                                                      \
    F(PointParameterf, POINTPARAMETERF, 14, 0, NULL)                                                                               \
    F(PolygonMode, POLYGONMODE, 10, 0, NULL)                                                                                       \
    F(QueryCounter, QUERYCOUNTER, 33, 0, NULL)                                                                                     \
    F(ReadBuffer, READBUFFER, 10, 30, NULL)                                                                                        \
    F(ReadPixels, READPIXELS, 10, 20, NULL)                                                                                        \
    F(Scissor, SCISSOR, 10, 20, NULL)                                                                                              \
    F(ScissorIndexed, SCISSORINDEXED, 41, 0, NULL)                                                                                 \
    F(ShaderSource, SHADERSOURCE, 20, 20, NULL)                                                                                    \
    F(TexImage2D, TEXIMAGE2D, 10, 20, NULL)                                                                                        \
    F(TexParameteri, TEXPARAMETERI, 10, 20, NULL)                                                                                  \
    F(Uniform1f, UNIFORM1F, 20, 20, NULL)                                                                                          \
    F(Uniform1i, UNIFORM1I, 20, 20, NULL)                                                                                          \
    F(Uniform2f, UNIFORM2F, 20, 20, NULL)                                                                                          \
    F(Uniform3fv, UNIFORM3FV, 20, 20, NULL)                                                                                        \
    F(Uniform4fv, UNIFORM4FV, 20, 20, NULL)                                                                                        \
    F(Uniform4uiv, UNIFORM4UIV, 30, 30, NULL)                                                                                      \
    F(UniformMatrix3fv, UNIFORMMATRIX3FV, 20, 20, NULL)                                                                            \
    F(UniformMatrix4fv, UNIFORMMATRIX4FV, 20, 20, NULL)                                                                            \
    F(UnmapBuffer, UNMAPBUFFER, 15, 30, NULL)                                                                                      \
    F(UseProgram, USEPROGRAM, 20, 20, NULL)                                                                                        \
    F(VertexAttribDivisor, VERTEXATTRIBDIVISOR, 33, 30, NULL)                                                                      \
    F(VertexAttribPointer, VERTEXATTRIBPOINTER, 20, 20, NULL)                                                                      \
    F(Viewport, VIEWPORT, 10, 20, NULL)                                                                                            \
    F(ViewportIndexedf, VIEWPORTINDEXEDF, 41, 0, NULL)

struct gl_pointers {
#define F(name, type, desktop, es, extension) PFNGL##type##PROC name;
    GL_FUNCTIONS(F)
#undef F
};

struct gl {
    int version; /* 10 * major + minor */
    bool es, compatibility;
    bool has_srgb_control;   /* GL_FRAMEBUFFER_SRGB can be switched */
    bool has_clip_distances; /* GL_CLIP_DISTANCEi can be enabled */
    bool has_depth_clamp;
    bool has_depth_bounds;
    bool has_transform_feedback_query;
    bool has_multiview;
    bool has_float_targets;                   /* half-float colours can be drawn to and blended */
    bool has_float_blend;                     /* 32-bit floats, too */
    bool has_query_buffer;                    /* GL_QUERY_BUFFER can be bound, and results go there */
    bool has_draw_ids;                        /* shaders know which of the draws of one call they work for */
    bool has_selection;                       /* compute shaders, and draws whose counts they write */
    uint64_t most_storage_bytes;              /* of a buffer that those see */
    uint32_t largest_index;                   /* of a vertex */
    int timestamp_bits;                       /* of glQueryCounter; 0: there is none */
    float point_size_least, point_size_limit; /* diameters of GL points, pixels */
    int max_viewport[2];
    int max_draw_buffers;
    int max_clip_distances;
    struct gl_pointers own; /* what the entries point to if the host gave get_proc_address */
#define F(name, type, desktop, es, extension) PFNGL##type##PROC const *name;
    GL_FUNCTIONS(F)
#undef F
};

/* Fills the table for the current context. Logs what is missing. Changes no GL state and raises no GL error. */
pbr_result gl_load(pbr_instance *instance, const pbr_renderer_desc *desc, struct gl *gl);

/* Takes every pending GL error off; returns the first, or 0. */
GLenum gl_drain_errors(const struct gl *gl);

/* One level, unfiltered, of anything. It is left bound; the buffer that pixels are unpacked from must be none. */
GLuint gl_make_texture(const struct gl *gl, GLenum internal, GLenum format, GLenum type, GLsizei width, GLsizei height);

#endif
