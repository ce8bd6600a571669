// Gaussian and EWA splats in their two passes, and the marks of filled ellipses. As GL points that hold the footprint's box; with
// QUADS, for splats that points cannot draw, as that box, or, where a splat reaches through the plane of the eye, as the disc's
// square in space.
//
// What splats cover, and the visibility pass draws, is the projected disc, of all kinds. Where they have weights is exp(-2 q)
// within q <= 1: gaussian, q a quadratic form of the distance from the projected centre, of the projected disc's inverse, corrected
// for perspective; ewa, around the outline's middle, of the inverse of the outline's with the low-pass added (Zwicker et al. 2001);
// ewa-max, the lesser of the gaussian's and the low-pass's own (Botsch et al. 2005).

flat out vec2 v_centre; // projected; ewa: the outline's middle; window pixels
flat out vec3 v_conic;  // q = (x, y)^T (x y; y z) (x, y) from there
flat out vec3 v_depth;  // clip z / w there, change per pixel
#ifndef EWA
flat out vec4 v_nearer; // of 1 / w, relative to the centre's: change per pixel; least and most on the disc
#endif
flat out vec2 v_reach; // the disc's depths: the middle less the centre's, and how far they reach from the middle
#if defined(EWA) || defined(EWA_MAX)
uniform float u_low_pass; // as a squared reach, pixels
#define BLURRED
#endif
#ifdef PASS_VISIBILITY
flat out float v_back; // change of clip z / w by moving back, at the centre; or, in space, of clip z
#ifdef FILL
flat out vec4 v_colour; // and the radius in pixels
#endif
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
#ifndef EWA
    v_nearer = vec4(0.0);
#endif
    v_reach = vec2(0.0);
#ifdef PASS_VISIBILITY
    v_back = 0.0;
#endif
#if defined(FILL) || !defined(PASS_VISIBILITY)
    v_colour = vec4(0.0);
#endif
#ifndef PASS_VISIBILITY
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
// The normal's change over the disc (Botsch et al. 2004). d.normal: unit, and the axes u, v of the disc along its own tangents, turned
// with it.
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
    disc_axes(n, d, t, b);
    mat2 J = radius * mat2(dot(d.x, t), dot(d.y, t), dot(d.x, b), dot(d.y, b)); // columns: pixels per u, per v
    mat2 inverted = mat2(J[1][1], -J[0][1], -J[1][0], J[0][0]) / (J[0][0] * J[1][1] - J[1][0] * J[0][1]);
    v_to_disc = vec4(inverted[0], inverted[1]);
}
#endif

void main() {
    vec3 position = a_position_radius.xyz;
    vec4 clip = to_clip() * vec4(position, 1.0);
    if (!is_selected(clip.w)) {
        reject();
        return;
    }
    vec3 ndc = clip.xyz / clip.w;
    vec3 normal = splat_normal();
    disc d = make_disc(position, normal, clip, ndc);
    float spread = on_disc(d, d.w, d.w);
    vec3 V = vec3(on_disc(d, d.x, d.x), on_disc(d, d.x, d.y), on_disc(d, d.y, d.y));
    float determinant = V.x * V.z - V.y * V.y;
    float reach = splat_radius(clip.w) * u_radius.w;
#ifdef BLURRED
    bool in_space = !is_blurred(clip, reach);
#else
    bool in_space = !(clip.w > 0.0 && spread < 0.9);
#endif
    vec2 middle;
    vec3 S;
    outline(d, spread, middle, S);
    bool drawn = in_space || determinant > 0.0; // of each pass: what covers a pixel has a weight there
#ifdef EWA
    float height = max(S.x * S.z - S.y * S.y, 0.0);
    S += vec3(u_low_pass, 0.0, u_low_pass);
    V = S;
    determinant = V.x * V.z - V.y * V.y;
    height = in_space ? 1.0 : max(sqrt(height / determinant), KERNEL_LEAST_HEIGHT);
    vec2 half_size = sqrt(V.xz), at = middle; // of the quadratic form, from the projected centre
#else
    vec2 half_size = sqrt(max(S.xz, 0.0));
    const vec2 at = vec2(0.0);
    const float height = 1.0;
#endif
#ifdef EWA_MAX
    vec2 low = min(middle - half_size, -sqrt(u_low_pass)), high = max(middle + half_size, sqrt(u_low_pass));
    middle = 0.5 * (low + high);
    half_size = 0.5 * (high - low);
#endif
    vec2 projected = ndc.xy * u_window.xy; // from the viewport's centre
    middle += projected;
    float size = 2.0 * max(half_size.x, half_size.y) + POINT_ROOM;
    bool is_point = !in_space && all(lessThan(abs(middle), u_window.xy)) && size < u_size.w;
#ifdef QUADS
    drawn = drawn && !is_point;
#else
    drawn = drawn && is_point;
#ifdef EWA_MAX
    S = 2.0 * vec3(half_size.x * half_size.x, 0.0, half_size.y * half_size.y); // around the box, which holds two shapes
#endif
    drawn = drawn && holds_a_pixel(middle + u_window.zw, half_size, S);
#endif
    if (!drawn || clipped_away(position) || is_back_face(position, normal)) {
        reject();
        return;
    }
    v_centre = projected + at + u_window.zw;
    v_conic = vec3(V.z, -V.y, V.x) / determinant;
    v_depth = vec3(ndc.z, depth_gradient(d));
    // As the outline's middle and half size, of depth.
    float grow = 1.0 / (1.0 - spread), shift = -grow * on_disc(d, d.z, d.w);
    v_reach = vec2(shift, sqrt(max(grow * on_disc(d, d.z, d.z) + shift * shift, 0.0)));
#ifdef EWA
    v_depth.x += shift;
    v_reach.x = 0.0;
#else
    v_nearer = vec4(change_per_pixel(d, -d.w), 1.0 / (1.0 + sqrt(spread)), 1.0 / (1.0 - sqrt(spread)));
#endif
#ifdef PASS_VISIBILITY
    v_back = back_times_w(position, normal, clip, reach) * (in_space ? 1.0 : 1.0 / clip.w);
#ifdef FILL
    v_colour = vec4(colour_splat(position, normal).rgb, clip.w > 0.0 ? min(reach / (u_back.z * clip.w), 1e4) : 1e4);
#endif
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
    if (in_space) gl_Position = disc_corner(position, normal, d, v_disc);
    else gl_Position = vec4((middle + v_disc * half_size) / u_window.xy, 0.5, 1.0);
#else
    gl_Position = vec4(middle / u_window.xy, 0.5, 1.0); // each fragment has its own depth
    gl_PointSize = size;
#endif
}
