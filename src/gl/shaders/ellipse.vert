// Ellipses: discs in space, projected exactly. As GL points that hold the ellipse's box, where its pixels and their depths are
// found from window coordinates; or, with QUADS, as the disc's square in space, which the rasteriser clips and interpolates: for
// splats that reach through the plane of the eye, out of the view, or over the size of points.

flat out vec4 v_colour;
#ifdef QUADS
out vec2 v_disc; // disc coordinates; the outline is at length 1
#else
flat out vec2 v_centre; // of the ellipse, window pixels
flat out vec3 v_conic;  // inside: (x, y)^T (x y; y z) (x, y) <= 1
flat out vec3 v_depth;  // clip z / w at the centre, change per pixel
#endif

void reject() {
    gl_Position = rejected_position();
    v_colour = vec4(0.0);
#ifdef QUADS
    v_disc = vec2(0.0);
#else
    gl_PointSize = 1.0;
    v_centre = vec2(-1e6);
    v_conic = vec3(1.0, 0.0, 1.0);
    v_depth = vec3(0.0);
#endif
}

// Whether a GL point can draw the splat: it lies before the plane of the eye, the middle of its box is in the view, and it is not
// too large. `margin` makes the quads' answer a little stricter than the points': what is drawn twice is drawn alike.
bool is_point(float w, float spread, vec2 middle, float size, float margin) {
    vec2 limit = u_window.xy * margin;
    return w > 0.0 && spread < 0.9 * margin && all(lessThan(abs(middle), limit)) && size < u_size.w * margin;
}

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
    vec2 centre;
    vec3 S;
    outline(d, spread, centre, S);
    vec2 half_size = sqrt(max(S.xz, 0.0));
    vec2 middle = ndc.xy * u_window.xy + centre; // from the viewport's centre
    float size = 2.0 * max(half_size.x, half_size.y) + POINT_ROOM;

#ifdef QUADS
    bool drawn = !is_point(clip.w, spread, middle, size, 0.9999);
#else
    bool drawn = is_point(clip.w, spread, middle, size, 1.0);
    middle += u_window.zw;
    float determinant = S.x * S.z - S.y * S.y;
    drawn = drawn && determinant > 0.0 && holds_a_pixel(middle, half_size, S);
#endif
    if (!drawn || clipped_away(position) || is_back_face(position, normal)) {
        reject();
        return;
    }
    v_colour = colour_splat(position, normal);
#ifdef QUADS
    // A little more than the disc, which touches the square's sides.
    v_disc = quad_corner() * 1.001;
    gl_Position = disc_corner(position, normal, d, v_disc);
#else
    vec2 gradient = depth_gradient(d);
    v_centre = middle;
    v_conic = vec3(S.z, -S.y, S.x) / determinant;
    v_depth = vec3(ndc.z + dot(gradient, centre), gradient);
    gl_Position = vec4((middle - u_window.zw) / u_window.xy, 0.5, 1.0); // each fragment has its own depth
    gl_PointSize = size;
#endif
}
