// Square and circle: the colour was computed for the whole splat; a circle drops what lies outside it. Marks, of splats that are
// filled between, give the front's depth, and the colour with the radius in pixels.

flat in vec4 v_colour;
#ifdef CIRCLE
flat in float v_rim;
#ifdef QUADS
in vec2 v_disc;
#endif
#endif

#ifdef PASS_VISIBILITY
flat in vec2 v_depths; // clip z / w as it is, and moved back
uniform vec4 u_depth;  // window depth = x * (clip z / w) + y
layout(location = 0) out uvec2 o_front; // window depth of the nearest, as it is and moved back, as bits
layout(location = 1) out vec4 o_mark;
#else
layout(location = 0) out vec4 o_colour;
#endif

void main() {
#ifdef CIRCLE
#ifdef QUADS
    vec2 disc = v_disc;
#else
    vec2 disc = gl_PointCoord * 2.0 - 1.0;
#endif
    if (dot(disc, disc) > v_rim) discard;
#endif
#ifdef PASS_VISIBILITY
    vec2 window = u_depth.x * v_depths + u_depth.y;
    gl_FragDepth = within_clear(window.y);
    o_front = floatBitsToUint(vec2(window.x, gl_FragDepth));
    o_mark = v_colour;
#else
    o_colour = v_colour;
#endif
}
