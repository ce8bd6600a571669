// What the vertex stages of all kinds share: which splats are not drawn, and the colour of those that are.

#if !defined(QUADS) && !defined(SQUARE)
uniform vec4 u_rejected; // may be in the view's corner
#endif

// Where a splat goes that is not drawn. What fragments there still are must show nothing.
vec4 rejected_position() {
#if defined(QUADS) || defined(SQUARE)
    return vec4(2.0, 0.0, 0.0, 1.0); // outside the view volume for certain, also with a point's size: x > w
#else
    return u_rejected;
#endif
}

// Where back faces are dropped: is it one?
bool is_back_face(vec3 position, vec3 object_normal) {
#ifdef CULL
    vec3 eye_position = (to_eye() * vec4(position, 1.0)).xyz;
    return dot(u_normal_to_eye * object_normal, u_eye.xyz - eye_position * u_eye.w) < 0.0;
#else
    return false;
#endif
}

#if defined(DEFERRED) || defined(TRIANGLES)
// In eye space; zero where there is none.
vec3 unit_normal(vec3 object_normal) {
    vec3 normal = u_normal_to_eye * object_normal;
    float squared = dot(normal, normal);
    return squared > 0.0 ? normal * inversesqrt(squared) : vec3(0.0);
}
#endif

// The colour once a splat, encoded for the target.
vec4 colour_splat(vec3 position, vec3 object_normal) {
#if defined(LIT) || defined(COLOUR_DEPTH)
    vec3 eye_position = (to_eye() * vec4(position, 1.0)).xyz;
#else
    vec3 eye_position = vec3(0.0);
#endif
    vec3 colour = splat_colour(object_normal, -eye_position.z);
#ifdef LIT
    vec3 normal = u_normal_to_eye * object_normal;
    vec3 view = u_eye.xyz - eye_position * u_eye.w;
    float squared = dot(normal, normal);
    if (squared > 0.0) {
        normal *= (dot(normal, view) < 0.0 ? -1.0 : 1.0) * inversesqrt(squared);
        colour = shade(colour, eye_position, normal, normalize(view));
    }
#endif
    return encode(colour);
}
