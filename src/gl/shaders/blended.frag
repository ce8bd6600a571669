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
#endif
#ifdef QUADS
in vec2 v_disc;
flat in float v_in_space;
#endif
uniform vec4 u_depth;

#ifdef PASS_VISIBILITY
layout(location = 0) out uint o_front; // window depth of the nearest, as bits
#else
layout(location = 0) out vec4 o_sum;
#ifdef DEFERRED
layout(location = 1) out vec4 o_normal;
#endif
#endif

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
#ifdef QUADS
    if (v_in_space > 0.5) {
        q = dot(v_disc, v_disc);
        depth = gl_FragCoord.z;
        nearer = gl_FragCoord.w;
    }
#endif
    if (q > 1.0 || depth < u_depth.z || depth > u_depth.w) discard;
#ifdef PASS_VISIBILITY
    o_front = floatBitsToUint(depth);
    gl_FragDepth = depth + v_back * nearer;
#else
    float weight = exp(-0.5 * KERNEL_SIGMAS * KERNEL_SIGMAS * q);
    o_sum = v_colour * weight;
#ifdef DEFERRED
    o_normal = vec4(v_normal * weight, 0.0);
#endif
    gl_FragDepth = depth;
#endif
}
