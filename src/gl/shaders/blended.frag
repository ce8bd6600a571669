// Gaussian and EWA splats: the kernel, and the depth of the disc's plane; in the visibility pass, and of marks, the disc alone.

flat in vec2 v_centre;
flat in vec3 v_conic;
flat in vec3 v_depth;
#ifndef EWA
flat in vec4 v_nearer;
#endif
flat in vec2 v_reach;
#ifdef EWA_MAX
uniform float u_low_pass; // as a squared reach, pixels
#endif
#ifdef PASS_VISIBILITY
flat in float v_back;
#ifdef FILL
flat in vec4 v_colour; // and the radius in pixels
#endif
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
layout(location = 0) out uvec2 o_front; // window depth of the nearest, as it is and moved back, as bits
#ifdef FILL
layout(location = 1) out vec4 o_mark;
#endif
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
#else
    // Within the disc's own, as depth below: else a disc seen from the edge, whose change is rounding, covers all of its box.
    float nearer = clamp(1.0 + dot(v_nearer.xy, p), v_nearer.z, v_nearer.w);
    q /= nearer * nearer;
#endif
    // Within the disc's depths: beyond its rim, and where it is seen from the edge and the plane's gradient is rounding. The kinds'
    // passes differ in how they round: what one has in front, the other must not have behind all that it keeps.
    float change = v_reach.x + clamp(dot(v_depth.yz, p) - v_reach.x, -v_reach.y, v_reach.y);
#ifdef EWA_MAX
    q = min(q, dot(p, p) / u_low_pass);
#endif
    float depth = v_depth.x + change;
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
    gl_FragDepth = within_clear(window + u_depth.x * v_back * nearer);
    o_front = floatBitsToUint(vec2(window, gl_FragDepth));
#ifdef FILL
    o_mark = v_colour;
#endif
#else
    float weight = exp(-0.5 * KERNEL_SIGMAS * KERNEL_SIGMAS * q);
    o_sum = v_colour * weight;
#ifdef DEFERRED
    vec3 normal = v_normal;
#ifdef FIELD
    vec2 at = v_to_disc.xy * p.x + v_to_disc.zw * p.y;
#ifndef EWA
    float on_plane = 1.0 + dot(v_nearer.xy, p);
    at = on_plane > 0.0 ? at / on_plane : vec2(0.0); // the centre's normal where the ray misses the plane
#endif
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
