// Square and circle: the colour was computed for the whole splat; a circle drops what lies outside it.

flat in vec4 v_colour;
#if defined(QUADS) && defined(CIRCLE)
in vec2 v_disc;
#endif

layout(location = 0) out vec4 o_colour;

void main() {
#ifdef CIRCLE
#ifdef QUADS
    vec2 disc = v_disc;
#else
    vec2 disc = gl_PointCoord * 2.0 - 1.0;
#endif
    if (dot(disc, disc) > 1.0) discard;
#endif
    o_colour = v_colour;
}
