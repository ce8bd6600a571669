// Colours of splats and triangles: where they come from, and how they go to the target.

uniform vec4 u_colour;     // linear, for points without colours
#if defined(COLOUR_SCALAR) || defined(COLOUR_DEPTH)
uniform vec3 u_map[32];    // linear
uniform vec4 u_map_range;  // x: value of the first entry; y: entries - 1 over the range; z: entries - 1
#endif

// Minimax in steps of 8-bit sRGB, at most 0.052 off; see encode.glsl.
vec3 linear_from_srgb(vec3 c) {
    vec3 power = (((-0.11679047 * c + 0.52651537) * c + 0.56036692) * c + 0.02840554) * c + 0.00104619;
    return mix(c / 12.92, power, greaterThan(c, vec3(0.04045)));
}

#if defined(COLOUR_SCALAR) || defined(COLOUR_DEPTH)
vec3 map_colour(float value) {
    float t = value > u_map_range.x ? min((value - u_map_range.x) * u_map_range.y, u_map_range.z) : 0.0;
    int i = clamp(int(t), 0, int(u_map_range.z) - 1);
    return mix(u_map[i], u_map[i + 1], t - float(i));
}
#endif

// Where the colour is stored in sRGB and nothing is to be computed with it, it goes to an sRGB target as it is.
#if defined(COLOUR_POINTS) && !defined(LIT) && defined(ENCODE_SRGB) && !defined(TRIANGLES)
#define COLOUR_AS_STORED
#endif

#ifdef VERTEX_STAGE
vec3 splat_colour(vec3 object_normal, float eye_distance) {
#if defined(COLOUR_AS_STORED)
    return a_colour.rgb;
#elif defined(COLOUR_POINTS)
    return linear_from_srgb(a_colour.rgb);
#elif defined(COLOUR_NORMAL)
    float squared = dot(object_normal, object_normal);
    return squared > 0.0 ? linear_from_srgb(object_normal * inversesqrt(squared) * 0.5 + 0.5) : u_colour.rgb;
#elif defined(COLOUR_SCALAR)
    // isnan() may be optimised away.
    return (floatBitsToUint(a_scalar) & 0x7fffffffu) > 0x7f800000u ? u_colour.rgb : map_colour(a_scalar);
#elif defined(COLOUR_DEPTH)
    return map_colour(eye_distance);
#elif defined(COLOUR_PRIMITIVE)
#ifdef TRIANGLES
    return vec3(0.02, 0.1, 1.0);
#else
    return vec3(1.0, 0.05, 0.02);
#endif
#else
    return u_colour.rgb;
#endif
}
#endif

vec4 encode(vec3 colour) {
#if defined(ENCODE_SRGB) && !defined(COLOUR_AS_STORED)
    return vec4(srgb_from_linear(colour), 1.0);
#else
    return vec4(colour, 1.0);
#endif
}
