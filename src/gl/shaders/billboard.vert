// Opaque screen-parallel splats (square, circle), as GL points or, with QUADS, as instanced triangle strips of four corners.
// The two paths share every formula, so that no seam shows where one takes over.

invariant gl_Position; // both programs are to agree on what the other one draws
flat out vec4 v_colour;
#if defined(QUADS) && defined(CIRCLE)
out vec2 v_disc; // -1..1 across the splat
#endif

// Outside the view volume for certain, also with a point's size: x > w.
void reject() {
    gl_Position = vec4(2.0, 0.0, 0.0, 1.0);
#ifndef QUADS
    gl_PointSize = 1.0;
#endif
    v_colour = vec4(0.0);
#if defined(QUADS) && defined(CIRCLE)
    v_disc = vec2(0.0);
#endif
}

void main() {
    vec3 position = a_position_radius.xyz;
    vec4 clip = u_to_clip * vec4(position, 1.0);
    float size = splat_size_times_w(clip.w);

    // A point is dropped with its centre and capped in size. Quads take those, and a margin more: a splat drawn twice is
    // drawn alike, a splat drawn never is a hole.
    bool drawn = clip.w > 0.0;
#ifdef QUADS
    float inside = clip.w * 0.9999;
    drawn = drawn && (size > u_size.w * inside || abs(clip.x) > inside || abs(clip.y) > inside);
#else
    drawn = drawn && size <= u_size.w * clip.w;
#endif
#if defined(LIT) || defined(CULL) || defined(COLOUR_NORMAL)
    vec3 normal = splat_normal();
#else
    vec3 normal = vec3(0.0);
#endif
    if (!drawn || clipped_away(position) || is_back_face(position, normal)) {
        reject();
        return;
    }
    v_colour = colour_splat(position, normal);

#ifdef QUADS
    vec2 corner = quad_corner();
#ifdef CIRCLE
    v_disc = corner;
#endif
    clip.xy += corner * size * u_pixel;
#else
    gl_PointSize = size / clip.w;
#endif
    gl_Position = clip;
}
