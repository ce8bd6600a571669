// The splat record (src/core/splat.h) as the vertex stage sees it, and the uniforms that place it. Every pass includes this file.

layout(location = 1) in vec2 a_normal;          // octahedral (Meyer 2010); (-1, -1) = none
#ifdef SEQUENCE
// An entry of a sequential point tree (src/lod/spt.h), as codes.
layout(location = 0) in vec4 a_codes;           // position, radius
layout(location = 2) in vec4 a_colour_distance; // sRGB in 255ths; the code of the distance to the parent
layout(location = 5) in vec2 a_errors;          // own, the parent's
// Of each chunk that a call draws: where it lies and how its entries are decoded.
#ifdef MULTI_DRAW
#define DRAW gl_DrawIDARB
#else
#define DRAW 0
#endif
uniform vec4 u_clip_origins[PAGE_CHUNKS]; // its origin in clip coordinates and in eye space
uniform vec4 u_eye_origins[PAGE_CHUNKS];
uniform vec4 u_plane_offsets[2 * PAGE_CHUNKS]; // last coordinates of clip planes, relative to it
uniform vec4 u_steps[PAGE_CHUNKS];             // of positions, radii and errors; the largest distance
#define a_position_radius (a_codes * u_steps[DRAW].xxxy)
#define a_colour vec4(a_colour_distance.rgb / 255.0, 1.0)
#else
layout(location = 0) in vec4 a_position_radius; // object space, relative to the chunk's origin; object units
layout(location = 2) in vec4 a_colour;          // sRGB, linear alpha
#endif
#ifdef COLOUR_SCALAR
layout(location = 3) in float a_scalar;
#endif
#ifdef FIELD
layout(location = 4) in vec4 a_field; // struct normal_field (src/core/normal_field.h), whole numbers
#endif

uniform mat4 u_to_clip;   // chunk to clip, jitter included
uniform mat4 u_to_eye;    // chunk to eye; of sequences both without the origin
uniform mat3 u_normal_to_eye; // cofactors of the model-view matrix, signed by its determinant: the inverse transpose up to a factor
uniform vec4 u_eye;       // eye space, homogeneous: the centre of projection, or the direction towards it with w = 0
uniform vec4 u_size;      // x: pixels of a unit radius at w = 1, as a diameter; y, z: smallest and largest diameter; w: largest point
uniform vec2 u_pixel;     // clip units of half a pixel at w = 1

mat4 to_clip() {
#ifdef SEQUENCE
    return mat4(u_to_clip[0], u_to_clip[1], u_to_clip[2], u_clip_origins[DRAW]);
#else
    return u_to_clip;
#endif
}

mat4 to_eye() {
#ifdef SEQUENCE
    return mat4(u_to_eye[0], u_to_eye[1], u_to_eye[2], u_eye_origins[DRAW]);
#else
    return u_to_eye;
#endif
}

// Whether the splat is of the cut.
bool is_selected(float w) {
#ifdef SEQUENCE
    return is_drawn(w, a_errors, a_colour_distance.a, u_steps[DRAW]);
#else
    return true;
#endif
}

// Any length from 1/sqrt 3 to 1, or zero for "none".
vec3 splat_normal() {
    vec2 v = max(a_normal, vec2(-1.0));
    if (v.x + v.y <= -2.0) return vec3(0.0);
    vec3 n = vec3(v, 1.0 - abs(v.x) - abs(v.y));
    float fold = max(-n.z, 0.0);
    n.x += n.x >= 0.0 ? -fold : fold;
    n.y += n.y >= 0.0 ? -fold : fold;
    return n;
}

// Diameter in pixels times w, so that nothing is divided by a w near 0. Screen-parallel kinds.
float splat_size_times_w(float w) {
    return clamp(a_position_radius.w * u_size.x, u_size.y * w, u_size.z * w);
}

#ifdef QUADS
// Of four vertices of a triangle strip: -1..1.
vec2 quad_corner() {
    return vec2((gl_VertexID & 1) == 0 ? -1.0 : 1.0, (gl_VertexID & 2) == 0 ? -1.0 : 1.0);
}
#endif
