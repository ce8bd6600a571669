// Layers: how far a splat lets others be seen with it. docs/splats.md, "Layers".

uniform vec3 u_back;   // x: change of clip z by moving back, see back_times_w; y: 1 in a perspective projection; z: eye units of a
                       // pixel at w = 1
uniform vec4 u_filter; // x: change of w per eye unit; y: the low-pass's reach in eye units at w = 1, 0 of kinds without;
                       // z, w: clip z / w is z -+ w

// Whether the low-pass applies, where the kind has one: not to splats that are too near to be linearised, or cut by the near or far
// plane.
bool is_blurred(vec4 clip, float reach) {
    return clip.w > 0.0 && reach * u_filter.x < clip.w * KERNEL_NEAR_RADIUS &&
           abs(clip.z - u_filter.z * clip.w) <= u_filter.w * clip.w;
}

// As a change of clip z. reach: the splat's radius in eye space, before the low-pass.
float back_times_w(vec3 position, vec3 object_normal, vec4 clip, float reach) {
    vec3 eye_position = (to_eye() * vec4(position, 1.0)).xyz;
    vec3 view = u_eye.xyz - eye_position * u_eye.w;
    vec3 normal = u_normal_to_eye * object_normal;
    float squared = dot(normal, normal);
    float cosine = squared > 0.0 ? abs(dot(normal, view)) * inversesqrt(squared * dot(view, view)) : 1.0;
    if (is_blurred(clip, reach)) reach = length(vec2(reach, clip.w * u_filter.y));
    float epsilon = KERNEL_EPSILON * reach * min(1.0 / cosine, KERNEL_MOST_SLOPE);
    // Perspective: away from the eye by the factor 1 + epsilon / z.
    return u_back.x * (u_back.y > 0.0 ? epsilon / max(max(view.z, reach) + epsilon, 1e-30) : epsilon);
}
