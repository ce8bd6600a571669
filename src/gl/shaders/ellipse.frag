// Ellipses: the pixels whose centres see the disc, at the depth where they see it.

flat in vec4 v_colour;
#ifdef QUADS
in vec2 v_disc;
#else
flat in vec2 v_centre;
flat in vec3 v_conic;
flat in vec3 v_depth;
uniform vec4 u_depth; // window depth = x * (clip z / w) + y; z, w: the clip depths of the near and far planes
#endif

layout(location = 0) out vec4 o_colour;

void main() {
#ifdef QUADS
    if (dot(v_disc, v_disc) > 1.0) discard;
#else
    vec2 p = gl_FragCoord.xy - v_centre;
    float depth = v_depth.x + dot(v_depth.yz, p);
    if (p.x * (v_conic.x * p.x + 2.0 * v_conic.y * p.y) + v_conic.z * p.y * p.y > 1.0 || depth < u_depth.z || depth > u_depth.w)
        discard;
    gl_FragDepth = u_depth.x * depth + u_depth.y;
#endif
    o_colour = v_colour;
}
