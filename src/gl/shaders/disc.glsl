// The disc of a splat as the screen sees it.
//
// Tangent vectors of the disc need not be chosen. Whatever orthonormal pair t, b spans the plane across the unit normal n, the sums
// over both of products of two linear forms A, B are A.t B.t + A.b B.b = A.B - (A.n)(B.n). With A and B the rows of the matrix to clip
// coordinates, these are the entries of the dual conic of the disc's outline (Sigg et al. 2006, "T D T^T"): no frame, no inverse.
// The rows are taken relative to the centre, so that nothing large cancels.

uniform mat4 u_projection;  // eye to clip, for splats without a normal
uniform mat3 u_ray;         // clip x, y, w to the direction of the ray there, up to its length and sign
uniform vec4 u_radius;      // x: scale; y, z: smallest and largest radius at w = 1, object units; w: largest stretch to eye space
uniform vec4 u_window;      // half the viewport's size; its centre in the window; pixels

// Added to the size of a point that holds an ellipse: rasterisers round sizes and place points on a grid of subpixels.
#define POINT_ROOM 0.125

// A splat's linear forms, across which its disc lies.
struct disc {
    vec3 normal;        // unit; as it is drawn
    float squared;      // radius squared, in the units of the rows
    vec3 x, y, z, w;    // change of window x, y (pixels), clip z / w, and of log w, per unit; in the space of `normal`
};

float on_disc(disc d, vec3 a, vec3 b) {
    return d.squared * (dot(a, b) - dot(a, d.normal) * dot(b, d.normal));
}

vec4 matrix_row(mat4 m, int i) {
    return vec4(m[0][i], m[1][i], m[2][i], m[3][i]);
}

float splat_radius(float w) {
    float radius = a_position_radius.w * u_radius.x;
    if (w > 0.0) radius = clamp(radius, u_radius.y * w, u_radius.z * w);
    return min(radius, 1e12); // squares and clip coordinates are to stay finite
}

// A disc that is nearly seen from its edge turns towards the ray. clip: the centre's; radius: object units.
void turn_from_edge(vec4 clip, float radius, inout disc d) {
    vec3 ray = u_ray * clip.xyw;
    float squared = dot(ray, ray), along = dot(d.normal, ray);
    if (along * along < KERNEL_EDGE_COSINE * KERNEL_EDGE_COSINE * squared) {
        float inverse = inversesqrt(squared), cosine = along * inverse;
        float per_pixel = max(2.0 * u_radius.x * clip.w / (radius * u_size.x), 0.0); // of the radius; before the eye
        float higher = min(min(KERNEL_EDGE_HIGHER * abs(cosine), KERNEL_EDGE_COSINE), abs(cosine) + KERNEL_EDGE_PIXELS * per_pixel);
        higher = cosine < 0.0 ? -higher : higher;
        vec3 across = (d.normal - cosine * inverse * ray) * inversesqrt(1.0 - cosine * cosine);
        d.normal = sqrt(1.0 - higher * higher) * across + higher * inverse * ray;
    }
}

// clip: the centre's, w not 0. ndc: clip / w.
disc make_disc(vec3 position, vec3 object_normal, vec4 clip, vec3 ndc) {
    disc d;
    float radius = splat_radius(clip.w);
    mat4 rows = to_clip();
    d.normal = object_normal;
    float squared = dot(object_normal, object_normal);
    if (squared == 0.0) {
        // Across the direction to the eye, and round there.
        rows = u_projection;
        vec3 eye_position = (to_eye() * vec4(position, 1.0)).xyz;
        d.normal = u_eye.xyz - eye_position * u_eye.w;
        squared = dot(d.normal, d.normal);
        radius *= u_radius.w;
    }
    d.normal *= inversesqrt(squared);
    d.squared = radius * radius;
    vec3 w = matrix_row(rows, 3).xyz;
    float inverse = 1.0 / clip.w;
    d.x = (matrix_row(rows, 0).xyz - ndc.x * w) * (u_window.x * inverse);
    d.y = (matrix_row(rows, 1).xyz - ndc.y * w) * (u_window.y * inverse);
    d.z = (matrix_row(rows, 2).xyz - ndc.z * w) * inverse;
    d.w = w * inverse;
    if (object_normal != vec3(0.0)) turn_from_edge(clip, radius, d);
    return d;
}

// The outline's ellipse {c + p : p^T S^-1 p <= 1}, c relative to the projected centre, pixels. S as (xx, xy, yy). For discs that lie
// wholly before the eye, spread < 1: the variance of log w over the disc.
void outline(disc d, float spread, out vec2 centre, out vec3 S) {
    float grow = 1.0 / (1.0 - spread);
    centre = -grow * vec2(on_disc(d, d.x, d.w), on_disc(d, d.y, d.w));
    S = grow * vec3(on_disc(d, d.x, d.x), on_disc(d, d.x, d.y), on_disc(d, d.y, d.y));
    S += vec3(centre.x * centre.x, centre.x * centre.y, centre.y * centre.y);
}

// Whether the ellipse of S around `middle`, window pixels, holds a pixel's centre. Most splats under a pixel do not, nor do those seen
// from their edge. Where its box holds more than one, it is not asked which of them the ellipse holds.
bool holds_a_pixel(vec2 middle, vec2 half_size, vec3 S) {
    vec2 first = ceil(middle - half_size - 0.5), last = floor(middle + half_size - 0.5), p = first + 0.5 - middle;
    bool misses = p.x * (S.z * p.x - 2.0 * S.y * p.y) + S.x * p.y * p.y > 1.001 * (S.x * S.z - S.y * S.y);
    return all(lessThanEqual(first, last)) && !(first == last && misses);
}

// Change per pixel, over the disc's plane, of something that is affine there in window coordinates and changes by `form` in space:
// form - g.x x - g.y y is across the plane.
vec2 change_per_pixel(disc d, vec3 form) {
    return vec2(dot(d.normal, cross(form, d.y)), dot(d.normal, cross(d.x, form))) / dot(d.normal, cross(d.x, d.y));
}

// Depth, z / w, is affine there for every projection (Guennebaud & Paulin 2003).
vec2 depth_gradient(disc d) {
    return change_per_pixel(d, d.z);
}

#if defined(QUADS) || defined(FIELD)
// Two unit vectors that span the plane across the unit vector n: those of disc_tangents in src/core/normal_field.h.
void tangents(vec3 n, out vec3 t, out vec3 b) {
    float s = n.z >= -0.7 ? 1.0 : -1.0, a = -1.0 / (s + n.z), c = n.x * n.y * a;
    t = vec3(1.0 + s * n.x * n.x * a, s * c, -s * n.x);
    b = vec3(c, s + n.y * n.y * a, -n.y);
}

// Those of the point's own normal, turned as the disc is.
void disc_axes(vec3 own, disc d, out vec3 t, out vec3 b) {
    vec3 both = own + d.normal;
    float inverse = 1.0 / (1.0 + dot(own, d.normal));
    tangents(own, t, b);
    t -= dot(t, d.normal) * inverse * both;
    b -= dot(b, d.normal) * inverse * both;
}
#endif

#ifdef QUADS
// Clip coordinates of a point of the disc's plane. corner: disc coordinates.
vec4 disc_corner(vec3 position, vec3 normal, disc d, vec2 corner) {
    vec3 t, b;
    bool faces_eye = dot(normal, normal) == 0.0;
    disc_axes(faces_eye ? d.normal : normalize(normal), d, t, b);
    vec3 centre = faces_eye ? (to_eye() * vec4(position, 1.0)).xyz : position;
    vec4 at = vec4(centre + sqrt(d.squared) * (corner.x * t + corner.y * b), 1.0);
    return faces_eye ? u_projection * at : to_clip() * at;
}
#endif
