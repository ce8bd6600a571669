/* The names of what a scene can be asked for: what --splat and --lod take, what the viewer's keys go through, and what both
 * tell. A new kind is one line here. SPDX-License-Identifier: MIT */
#ifndef KINDS_H
#define KINDS_H

#include <pbr/lod.h>
#include <pbr/render.h>
#include <stdbool.h>

#define SPLAT_KINDS(KIND)                                                                                                          \
    KIND(PBR_SPLAT_CIRCLE, "circle")                                                                                               \
    KIND(PBR_SPLAT_SQUARE, "square")                                                                                               \
    KIND(PBR_SPLAT_ELLIPSE, "ellipse")                                                                                             \
    KIND(PBR_SPLAT_GAUSSIAN, "gaussian")                                                                                           \
    KIND(PBR_SPLAT_EWA, "ewa")                                                                                                     \
    KIND(PBR_SPLAT_EWA_MAX, "ewa-max")

#define BLENDING_KINDS(KIND)                                                                                                       \
    KIND(PBR_BLEND_KIND, "kind")                                                                                                   \
    KIND(PBR_BLEND_FILL, "fill")

#define SHADING_KINDS(KIND)                                                                                                        \
    KIND(PBR_SHADE_PHONG, "phong")                                                                                                 \
    KIND(PBR_SHADE_NONE, "none")                                                                                                   \
    KIND(PBR_SHADE_DEFERRED, "deferred")                                                                                           \
    KIND(PBR_SHADE_PHONG_FIELD, "phong-field")

/* Besides scalar attributes, which have names of their own. */
#define COLOUR_KINDS(KIND)                                                                                                         \
    KIND(PBR_COLOUR_POINTS, "points")                                                                                              \
    KIND(PBR_COLOUR_NORMAL, "normal")                                                                                              \
    KIND(PBR_COLOUR_DEPTH, "depth")                                                                                                \
    KIND(PBR_COLOUR_PRIMITIVE, "primitive")

/* Which levels of detail are drawn: none, those of hierarchies' files, or those of a kind of hierarchy that is built of points. */
enum { LOD_NONE = 0, LOD_AUTO = 1000 /* above every PBR_LOD_... */ };
#define LOD_KINDS(KIND)                                                                                                            \
    KIND(LOD_NONE, "none")                                                                                                         \
    KIND(LOD_AUTO, "auto")                                                                                                         \
    KIND(PBR_LOD_QSPLAT, "qsplat")                                                                                                 \
    KIND(PBR_LOD_SPT, "spt")                                                                                                       \
    KIND(PBR_LOD_POP, "pop")

/* As literals: " circle square". */
#define KIND_WORD(value, name) " " name
#define SPLAT_WORDS SPLAT_KINDS(KIND_WORD)
#define SHADING_WORDS SHADING_KINDS(KIND_WORD)
#define BLENDING_WORDS BLENDING_KINDS(KIND_WORD)
#define COLOUR_WORDS COLOUR_KINDS(KIND_WORD)
#define LOD_WORDS LOD_KINDS(KIND_WORD)

struct kind {
    uint32_t value;   /* PBR_... */
    const char *name; /* NULL ends a list */
};

extern const struct kind splat_kinds[], blending_kinds[], shading_kinds[], colour_kinds[], lod_kinds[];

/* "unknown" for a value that is in no line. */
const char *kind_name(const struct kind *kinds, uint32_t value);
bool kind_parse(const struct kind *kinds, const char *name, uint32_t *value);
uint32_t kind_count(const struct kind *kinds);
/* The value in the next line, after the last the first. */
uint32_t kind_after(const struct kind *kinds, uint32_t value);

#endif
