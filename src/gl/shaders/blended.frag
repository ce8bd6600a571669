// Gaussian and EWA splats: the kernel, and the depth of the disc's plane.

flat in vec2 v_centre;
flat in vec3 v_conic;
flat in vec3 v_depth;
#ifdef EWA
flat in float v_reach;
#else
flat in vec2 v_nearer;
#endif
#ifdef PASS_VISIBILITY
flat in float v_back;
#else
flat in vec4 v_colour;
#ifdef DEFERRED
flat in vec3 v_normal;
#endif
#ifdef FIELD
flat in vec3 v_normal_u, v_normal_v;
flat in vec4 v_to_disc;
#endif
#endif
#ifdef QUADS
in vec2 v_disc;
flat in float v_in_space;
#endif
uniform vec4 u_depth; // window depth = x * (clip z / w) + y; z, w: the clip depths of the near and far planes

#ifdef PASS_VISIBILITY
layout(location = 0) out uint o_front; // window depth of the nearest, as bits
#else
layout(location = 0) out vec4 o_sum;
#ifdef DEFERRED
layout(location = 1) out vec4 o_normal;
#endif
#endif

// Depth is cleared to 1, or to 0 where nearer is larger; what is moved back past that, or lies there, is still to be before it.
float within_clear(float window) {
    return clamp(window, 1e-30, 0.99999994);
}

void main() {
    vec2 p = gl_FragCoord.xy - v_centre;
    float q = p.x * (v_conic.x * p.x + 2.0 * v_conic.y * p.y) + v_conic.z * p.y * p.y;
#ifdef EWA
    float nearer = 1.0;
    float depth = v_depth.x + clamp(dot(v_depth.yz, p), -v_reach, v_reach);
#else
    float nearer = 1.0 + dot(v_nearer, p);
    q /= nearer * nearer;
    float depth = v_depth.x + dot(v_depth.yz, p);
#endif
    float window = u_depth.x * depth + u_depth.y;
#ifdef QUADS
    if (v_in_space > 0.5) {
        q = dot(v_disc, v_disc);
        window = gl_FragCoord.z;
        depth = u_depth.z; // the planes have cut it already
        nearer = gl_FragCoord.w;
    }
#endif
    if (q > 1.0 || depth < u_depth.z || depth > u_depth.w) discard;
#ifdef PASS_VISIBILITY
    o_front = floatBitsToUint(window);
    gl_FragDepth = within_clear(window + u_depth.x * v_back * nearer);
#else
    float weight = exp(-0.5 * KERNEL_SIGMAS * KERNEL_SIGMAS * q);
    o_sum = v_colour * weight;
#ifdef DEFERRED
    vec3 normal = v_normal;
#ifdef FIELD
    vec2 at = (v_to_disc.xy * p.x + v_to_disc.zw * p.y) / nearer;
#ifdef QUADS
    if (v_in_space > 0.5) at = v_disc;
#endif
    at /= max(1.0, dot(at, at)); // what only the low-pass reaches goes back to the centre's
    // Unit at each pixel, with the weight that the splat's normal has at its centre.
    vec3 field = normal + at.x * v_normal_u + at.y * v_normal_v;
    float squared = dot(field, field);
    normal = squared > 0.0 ? field * (v_colour.a * inversesqrt(squared)) : normal;
#endif
    o_normal = vec4(normal * weight, 0.0);
#endif
    gl_FragDepth = within_clear(window);
#endif
}
