// Triangles of meshes, among splats: the vertices are records as splats are; what splats have once varies over the triangle, and
// each pixel is lit. docs/pop.md.

invariant gl_Position; // all passes are to agree
#if defined(FILL) || !defined(PASS_VISIBILITY)
centroid out vec3 v_colour; // linear
#endif
#ifdef PASS_VISIBILITY
out float v_back; // change of clip z by moving back
#endif
#if defined(LIT) || defined(DEFERRED)
centroid out vec3 v_normal; // eye space
#endif
#if defined(LIT) || defined(COLOUR_DEPTH)
centroid out vec3 v_eye_position;
#endif
#ifdef CLIP_PLANES
out vec3 v_position;
#endif

void main() {
    vec3 position = a_position_radius.xyz, normal = splat_normal();
    vec4 clip = to_clip() * vec4(position, 1.0);
    gl_Position = clip;
#if defined(LIT) || defined(COLOUR_DEPTH)
    v_eye_position = (to_eye() * vec4(position, 1.0)).xyz;
#endif
#if defined(FILL) || !defined(PASS_VISIBILITY)
#ifdef COLOUR_DEPTH
    v_colour = vec3(0.0); // a map bends: each pixel looks up its own
#else
    v_colour = splat_colour(normal, 0.0);
#endif
#endif
#ifdef PASS_VISIBILITY
    // As a splat of the triangle's size, but none is larger than splats around it are.
    float reach = min(a_position_radius.w * u_radius.x, u_radius.z * max(clip.w, 0.0)) * u_radius.w;
    v_back = back_times_w(position, normal, clip, reach);
#endif
#if defined(LIT) || defined(DEFERRED)
    v_normal = unit_normal(normal);
#endif
#ifdef CLIP_PLANES
    v_position = position;
#endif
}
