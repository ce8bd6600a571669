// Gaussian and EWA splats in their two passes. As GL points that hold the footprint's box; with QUADS, for splats that points cannot
// draw, as that box, or, where a splat reaches through the plane of the eye, as the disc's square in space.
//
// Both kinds are exp(-2 q) within q <= 1, q a quadratic form of the distance from the projected centre: of the projected disc's
// inverse, corrected for perspective (gaussian), or of the inverse of that with the low-pass added (ewa; Zwicker et al. 2001). What
// an ewa splat covers is smaller: else surfaces would grow by two pixels and hide what they border on.

uniform vec2 u_back;   // x: change of clip z by moving back, see back_times_w; y: 1 in a perspective projection
uniform vec4 u_filter; // x: change of w per eye unit; y: the low-pass's reach in eye units at w = 1; z, w: clip z / w is z -+ w

flat out vec2 v_centre; // projected, window pixels
flat out vec3 v_conic;  // q = (x, y)^T (x y; y z) (x, y)
flat out vec3 v_depth;  // clip z / w at the centre, change per pixel
#ifdef EWA
flat out float v_reach; // the disc's depths are this near to its centre's
#else
flat out vec2 v_nearer; // change per pixel of 1 / w, relative to the centre's
#endif
#ifdef PASS_VISIBILITY
flat out float v_back; // change of clip z / w by moving back, at the centre; or, in space, of clip z
#else
flat out vec4 v_colour; // premultiplied by the kernel's height
#ifdef DEFERRED
flat out vec3 v_normal; // likewise; eye space
#endif
#ifdef FIELD
flat out vec3 v_normal_u, v_normal_v; // its change per disc coordinate
flat out vec4 v_to_disc;              // window pixels from the centre to disc coordinates, before perspective: two columns
#endif
#endif
#ifdef QUADS
out vec2 v_disc;          // disc coordinates
flat out float v_in_space; // 1: the square in space, 0: the box on the screen
#endif

void reject() {
    gl_Position = rejected_position();
    v_centre = vec2(-1e6);
    v_conic = vec3(1.0, 0.0, 1.0);
    v_depth = vec3(0.0);
#ifdef EWA
    v_reach = 0.0;
#else
    v_nearer = vec2(0.0);
#endif
#ifdef PASS_VISIBILITY
    v_back = 0.0;
#else
    v_colour = vec4(0.0);
#ifdef DEFERRED
    v_normal = vec3(0.0);
#endif
#ifdef FIELD
    v_normal_u = v_normal_v = vec3(0.0);
    v_to_disc = vec4(0.0);
#endif
#endif
#ifdef QUADS
    v_disc = vec2(0.0);
    v_in_space = 0.0;
#else
    gl_PointSize = 1.0;
#endif
}

#ifdef FIELD
// The normal's change over the disc (Botsch et al. 2004). d.normal: unit, and the axes u, v of the disc along its tangents.
void set_field(vec3 object_normal, disc d, float height) {
    v_normal_u = v_normal_v = vec3(0.0);
    v_to_disc = vec4(0.0);
    if (dot(object_normal, object_normal) == 0.0) return;
    vec3 t, b, n = normalize(object_normal);
    tangents(n, t, b);
    float radius = sqrt(d.squared);
    // u and v count in the point's own radius; what is drawn may be another.
    float drawn = a_position_radius.w > 0.0 ? radius / a_position_radius.w : 0.0;
    vec4 field = a_field * (drawn / 16384.0);
    vec3 normal = u_normal_to_eye * n;
    float scale = height * inversesqrt(dot(normal, normal)); // as of v_normal
    v_normal_u = scale * (u_normal_to_eye * (field.x * t + field.y * b));
    v_normal_v = scale * (u_normal_to_eye * (field.z * t + field.w * b));
    mat2 J = radius * mat2(dot(d.x, t), dot(d.y, t), dot(d.x, b), dot(d.y, b)); // columns: pixels per u, per v
    mat2 inverted = mat2(J[1][1], -J[0][1], -J[1][0], J[0][0]) / (J[0][0] * J[1][1] - J[1][0] * J[0][1]);
    v_to_disc = vec4(inverted[0], inverted[1]);
}
#endif

// How far back a splat lets others be seen with it, as a change of clip z: docs/splats.md, "Layers". reach: the splat's
// radius in eye space, blurred by the low-pass where that is.
float back_times_w(vec3 position, vec3 object_normal, float reach) {
    vec3 eye_position = (u_to_eye * vec4(position, 1.0)).xyz;
    vec3 view = u_eye.xyz - eye_position * u_eye.w;
    vec3 normal = u_normal_to_eye * object_normal;
    float squared = dot(normal, normal);
    float cosine = squared > 0.0 ? abs(dot(normal, view)) * inversesqrt(squared * dot(view, view)) : 1.0;
    float epsilon = KERNEL_EPSILON * reach * min(1.0 / cosine, KERNEL_MOST_SLOPE);
    // Perspective: away from the eye by the factor 1 + epsilon / z.
    return u_back.x * (u_back.y > 0.0 ? epsilon / (max(view.z, reach) + epsilon) : epsilon);
}

void main() {
    vec3 position = a_position_radius.xyz;
    vec4 clip = u_to_clip * vec4(position, 1.0);
    vec3 ndc = clip.xyz / clip.w;
    vec3 normal = splat_normal();
    disc d = make_disc(position, normal, clip, ndc);
    float spread = on_disc(d, d.w, d.w);
    vec3 V = vec3(on_disc(d, d.x, d.x), on_disc(d, d.x, d.y), on_disc(d, d.y, d.y));
    float determinant = V.x * V.z - V.y * V.y;
    float reach = splat_radius(clip.w) * u_radius.w;
#ifdef EWA
#ifdef PASS_VISIBILITY
    const float blur = KERNEL_LEAST_COVER * KERNEL_LEAST_COVER;
#else
    const float blur = KERNEL_SIGMAS * KERNEL_SIGMAS * KERNEL_LOW_PASS;
#endif
    bool in_space = !(clip.w > 0.0 && reach * u_filter.x < clip.w * KERNEL_NEAR_RADIUS);
    float height = max(determinant, 0.0);
    V += vec3(blur, 0.0, blur);
    determinant = V.x * V.z - V.y * V.y;
    height = in_space ? 1.0 : sqrt(height / determinant);
    vec2 middle = vec2(0.0), half_size = sqrt(V.xz);
    bool drawn = in_space || (abs(clip.z - u_filter.z * clip.w) <= u_filter.w * clip.w && height > 0.0);
    if (!in_space) reach = length(vec2(reach, clip.w * u_filter.y));
#else
    bool in_space = !(clip.w > 0.0 && spread < 0.9);
    vec2 middle;
    vec3 S;
    outline(d, spread, middle, S);
    vec2 half_size = sqrt(max(S.xz, 0.0));
    bool drawn = in_space || determinant > 0.0;
    const float height = 1.0;
#endif
    vec2 projected = ndc.xy * u_window.xy; // from the viewport's centre
    middle += projected;
    float size = 2.0 * max(half_size.x, half_size.y) + POINT_ROOM;
    bool is_point = !in_space && all(lessThan(abs(middle), u_window.xy)) && size < u_size.w;
#ifdef QUADS
    drawn = drawn && !is_point;
#else
    drawn = drawn && is_point;
    vec2 first = ceil(middle + u_window.zw - half_size - 0.5), last = floor(middle + u_window.zw + half_size - 0.5);
    drawn = drawn && all(lessThanEqual(first, last)); // else it lies between the pixels' centres
#endif
    if (!drawn || clipped_away(position) || is_back_face(position, normal)) {
        reject();
        return;
    }
    vec2 gradient = depth_gradient(d);
    v_centre = projected + u_window.zw;
    v_conic = vec3(V.z, -V.y, V.x) / determinant;
    v_depth = vec3(ndc.z, gradient);
#ifdef EWA
    v_reach = sqrt(max(on_disc(d, d.z, d.z), 0.0));
#else
    v_nearer = change_per_pixel(d, -d.w);
#endif
#ifdef PASS_VISIBILITY
    v_back = back_times_w(position, normal, reach) * (in_space ? 1.0 : 1.0 / clip.w);
#else
    v_colour = vec4(colour_splat(position, normal).rgb * height, height);
#ifdef DEFERRED
    v_normal = unit_normal(normal) * height;
#endif
#ifdef FIELD
    set_field(normal, d, height);
#endif
#endif
#ifdef QUADS
    v_in_space = in_space ? 1.0 : 0.0;
    v_disc = quad_corner() * 1.001;
    if (in_space) gl_Position = disc_corner(position, normal, splat_radius(clip.w), v_disc);
    else gl_Position = vec4((middle + v_disc * half_size) / u_window.xy, 0.5, 1.0);
#else
    gl_Position = vec4(middle / u_window.xy, 0.5, 1.0); // each fragment has its own depth
    gl_PointSize = size;
#endif
}
