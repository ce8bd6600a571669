// The splat record (src/core/splat.h) as the vertex stage sees it, and the uniforms that place it. Every pass includes this file.

layout(location = 1) in vec2 a_normal;          // octahedral (Meyer 2010); (-1, -1) = none
#ifdef SEQUENCE
// An entry of a sequential point tree (src/lod/spt.h), as codes.
layout(location = 0) in vec4 a_codes;           // position, radius
layout(location = 2) in vec4 a_colour_distance; // sRGB in 255ths; the code of the distance to the parent
layout(location = 5) in vec2 a_errors;          // own, the parent's
uniform vec4 u_steps; // of positions, radii and errors; the largest distance
uniform vec2 u_cut;   // depth per w; s, below 0: the leaves
#define a_position_radius (a_codes * u_steps.xxxy)
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
uniform mat4 u_to_eye;    // chunk to eye
uniform mat3 u_normal_to_eye; // cofactors of the model-view matrix, signed by its determinant: the inverse transpose up to a factor
uniform vec4 u_eye;       // eye space, homogeneous: the centre of projection, or the direction towards it with w = 0
uniform vec4 u_size;      // x: pixels of a unit radius at w = 1, as a diameter; y, z: smallest and largest diameter; w: largest point
uniform vec2 u_pixel;     // clip units of half a pixel at w = 1

// Whether the splat is of the cut: spt_is_drawn of src/lod/spt.h.
bool is_selected(float w) {
#ifdef SEQUENCE
    if (u_cut.y < 0.0) return a_errors.x == 0.0;
    float z = w * u_cut.x, room = a_colour_distance.a > 0.0 ? exp2(-20.0) * z : 0.0;
    float distance = a_colour_distance.a > 0.0 ? u_steps.w * exp2((a_colour_distance.a - 255.0) / 16.0) : 0.0;
    bool is_fine = a_errors.x == 0.0 || u_cut.y * (a_errors.x * u_steps.z) <= z;
    bool is_root = a_errors.y == 65535.0; // of its chunk: no parent stands for it
    return is_fine && (is_root || z - room < u_cut.y * (a_errors.y * u_steps.z) + distance);
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
