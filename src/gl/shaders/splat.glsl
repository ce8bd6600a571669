// The splat record (src/core/splat.h) as the vertex stage sees it, and the uniforms that place it. Every pass includes this file.

layout(location = 0) in vec4 a_position_radius; // object space, relative to the chunk's origin; object units
layout(location = 1) in vec2 a_normal;          // octahedral (Meyer 2010); (-1, -1) = none
layout(location = 2) in vec4 a_colour;          // sRGB, linear alpha
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
