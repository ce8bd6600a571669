// Triangles among splats. Where these are blended, a triangle weighs as much as a splat at its centre, so that a splat which reaches
// over its border fades into it.

#if defined(FILL) || !defined(PASS_VISIBILITY)
centroid in vec3 v_colour;
#endif
#ifdef PASS_VISIBILITY
in float v_back;
uniform vec4 u_depth; // window depth = x * (clip z / w) + y
layout(location = 0) out uvec2 o_front; // window depth of the nearest, as it is and moved back, as bits
#ifdef FILL
layout(location = 1) out vec4 o_mark;
#endif
#else
layout(location = 0) out vec4 o_colour;
#endif
#if defined(LIT) || defined(DEFERRED)
centroid in vec3 v_normal;
#endif
#ifdef DEFERRED
layout(location = 1) out vec4 o_normal;
#endif
#ifdef LIT
uniform vec4 u_eye; // as in splat.glsl
#endif
#if defined(LIT) || defined(COLOUR_DEPTH)
centroid in vec3 v_eye_position;
#endif
#ifdef CLIP_PLANES
in vec3 v_position;
#endif

#if defined(FILL) || !defined(PASS_VISIBILITY)
vec3 colour_pixel() {
#ifdef COLOUR_DEPTH
    vec3 colour = map_colour(-v_eye_position.z);
#else
    vec3 colour = v_colour;
#endif
#ifdef LIT
    vec3 view = u_eye.xyz - v_eye_position * u_eye.w;
    float squared = dot(v_normal, v_normal);
    if (squared > 0.0) {
        vec3 normal = v_normal * ((dot(v_normal, view) < 0.0 ? -1.0 : 1.0) * inversesqrt(squared));
        colour = shade(colour, v_eye_position, normal, normalize(view));
    }
#endif
    return colour;
}
#endif

void main() {
#ifdef CLIP_PLANES
    if (clipped_away(v_position)) discard;
#endif
#ifdef PASS_VISIBILITY
    gl_FragDepth = within_clear(gl_FragCoord.z + u_depth.x * v_back * gl_FragCoord.w);
    o_front = floatBitsToUint(vec2(gl_FragCoord.z, gl_FragDepth));
#ifdef FILL
    o_mark = vec4(colour_pixel(), 0.0); // as it is: there is nothing to fill
#endif
#else
    o_colour = encode(colour_pixel());
#ifdef PASS_ACCUMULATION
    gl_FragDepth = within_clear(gl_FragCoord.z);
#endif
#endif
#ifdef DEFERRED
    float squared = dot(v_normal, v_normal);
    o_normal = vec4(squared > 0.0 ? v_normal * inversesqrt(squared) : vec3(0.0), 0.0);
#endif
}
