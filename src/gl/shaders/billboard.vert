// Opaque screen-parallel splats (square, circle), as GL points or, with QUADS, as instanced triangle strips of four corners.
// The two paths share every formula, so that no seam shows where one takes over.

invariant gl_Position; // both programs are to agree on what the other one draws
flat out vec4 v_colour; // of marks: linear, and the radius in pixels
#ifdef PASS_VISIBILITY
flat out vec2 v_depths; // clip z / w as it is, and moved back
#endif
#ifdef CIRCLE
flat out float v_rim; // 1, or more where a circle under sqrt 2 pixels would miss the pixels' centres: its square's corners then;
                      // below 0: of none of its pixels
#ifdef QUADS
out vec2 v_disc; // -1..1 across the splat
#endif
#endif

void reject() {
    gl_Position = rejected_position();
#ifndef QUADS
    gl_PointSize = 1.0;
#endif
    v_colour = vec4(0.0);
#ifdef PASS_VISIBILITY
    v_depths = vec2(0.0);
#endif
#ifdef CIRCLE
    v_rim = -1.0;
#ifdef QUADS
    v_disc = vec2(0.0);
#endif
#endif
}

void main() {
    vec3 position = a_position_radius.xyz;
    vec4 clip = to_clip() * vec4(position, 1.0);
    float size = splat_size_times_w(clip.w);

    // A point is dropped with its centre and capped in size. Quads take those, and a margin more: a splat drawn twice is
    // drawn alike, a splat drawn never is a hole.
    bool drawn = clip.w > 0.0 && is_selected(clip.w);
#ifdef QUADS
    float inside = clip.w * 0.9999;
    drawn = drawn && (size > u_size.w * inside || abs(clip.x) > inside || abs(clip.y) > inside);
#else
    drawn = drawn && size <= u_size.w * clip.w && abs(clip.x) <= clip.w && abs(clip.y) <= clip.w;
#endif
#if defined(LIT) || defined(CULL) || defined(COLOUR_NORMAL) || defined(PASS_VISIBILITY)
    vec3 normal = splat_normal();
#else
    vec3 normal = vec3(0.0);
#endif
    if (!drawn || clipped_away(position) || is_back_face(position, normal)) {
        reject();
        return;
    }
    v_colour = colour_splat(position, normal);
#ifdef PASS_VISIBILITY
    v_colour.a = 0.5 * size / clip.w;
    v_depths = vec2(clip.z, clip.z + back_times_w(position, normal, clip, KERNEL_FILL_REACH * 0.5 * size * u_back.z)) / clip.w;
#endif
#ifdef CIRCLE
    v_rim = max(1.0, 2.0 * clip.w * clip.w / (size * size));
#endif

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
