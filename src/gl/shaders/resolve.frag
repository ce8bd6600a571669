// Blended splats into the host's target: the mean colour of the front layer, at its true depth.

#ifdef GL_ES
precision highp sampler2D;
precision highp usampler2D;
#endif

uniform sampler2D u_colours; // sums of weight x colour, of weights
uniform usampler2D u_front;  // window depth, as bits; all ones = nothing
#ifdef DEFERRED
uniform sampler2D u_second; // sums of weight x normal
uniform mat4 u_to_eye;       // window x, y, depth to eye space, homogeneous
uniform vec4 u_eye;          // as in splat.glsl
#endif
uniform vec2 u_corner;       // of the sums' first pixel, window pixels
layout(location = 0) out vec4 o_colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy - u_corner);
    uint front = texelFetch(u_front, at, 0).r;
    vec4 sum = texelFetch(u_colours, at, 0);
    if (front == 0xffffffffu || !(sum.a > 0.0)) discard;
    vec3 colour = sum.rgb / sum.a;
#ifdef DEFERRED
    vec3 normal = texelFetch(u_second, at, 0).xyz;
    float squared = dot(normal, normal);
    if (squared > 0.0) {
        vec4 position = u_to_eye * vec4(gl_FragCoord.xy, uintBitsToFloat(front), 1.0);
        position.xyz /= position.w;
        vec3 view = u_eye.xyz - position.xyz * u_eye.w;
        /* Turned here and not before: the normals around a silhouette, turned one by one, would add up to one that faces the eye. */
        normal *= (dot(normal, view) < 0.0 ? -1.0 : 1.0) * inversesqrt(squared);
        colour = shade(colour, position.xyz, normal, normalize(view));
    }
#endif
#ifdef ENCODE_SRGB
    colour = srgb_from_linear(colour);
#endif
    o_colour = vec4(colour, 1.0);
    gl_FragDepth = uintBitsToFloat(front);
}
