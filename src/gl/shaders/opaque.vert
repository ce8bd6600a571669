// Opaque screen-parallel splats (square, circle), as GL points or, with QUADS, as instanced triangle strips of four corners.
// The two paths share every formula, so that no seam shows where one takes over.

#ifdef CLIP_PLANES
uniform int u_clip_plane_count;
uniform vec4 u_clip_plane[8]; // chunk space
#endif

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

bool clipped_away(vec3 position) {
#ifdef CLIP_PLANES
    for (int i = 0; i < u_clip_plane_count; i++)
        if (dot(u_clip_plane[i], vec4(position, 1.0)) < 0.0) return true;
#endif
    return false;
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
    if (!drawn || clipped_away(position)) {
        reject();
        return;
    }

#if defined(LIT) || defined(CULL) || defined(COLOUR_DEPTH)
    vec3 eye_position = (u_to_eye * vec4(position, 1.0)).xyz;
#else
    vec3 eye_position = vec3(0.0);
#endif
#if defined(LIT) || defined(CULL) || defined(COLOUR_NORMAL)
    vec3 object_normal = splat_normal();
#else
    vec3 object_normal = vec3(0.0);
#endif
    vec3 colour = splat_colour(object_normal, -eye_position.z);
#if defined(LIT) || defined(CULL)
    vec3 normal = u_normal_to_eye * object_normal;
    vec3 view = u_eye.xyz - eye_position * u_eye.w;
    float facing = dot(normal, view);
#ifdef CULL
    if (facing < 0.0) {
        reject();
        return;
    }
#endif
#ifdef LIT
    float squared = dot(normal, normal);
    if (squared > 0.0) {
        normal *= (facing < 0.0 ? -1.0 : 1.0) * inversesqrt(squared);
        colour = shade(colour, eye_position, normal, normalize(view));
    }
#endif
#endif
    v_colour = encode(colour);

#ifdef QUADS
    vec2 corner = vec2((gl_VertexID & 1) == 0 ? -1.0 : 1.0, (gl_VertexID & 2) == 0 ? -1.0 : 1.0);
#ifdef CIRCLE
    v_disc = corner;
#endif
    clip.xy += corner * size * u_pixel;
#else
    gl_PointSize = size / clip.w;
#endif
    gl_Position = clip;
}
