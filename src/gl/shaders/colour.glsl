// Colours of splats: source, Phong lighting (Phong 1975) in linear light, encoding for the target.

uniform vec4 u_colour;     // linear, for points without colours
#if defined(COLOUR_SCALAR) || defined(COLOUR_DEPTH)
uniform vec3 u_map[32];    // linear
uniform vec4 u_map_range;  // x: value of the first entry; y: entries - 1 over the range; z: entries - 1
#endif
#ifdef LIT
#ifndef ONE_LIGHT
uniform int u_light_count;
#endif
uniform vec4 u_light_vector[8]; // eye space; w = 0: unit vector towards the light, w = 1: its position
uniform vec3 u_light_colour[8];
uniform vec3 u_ambient;    // times the material's coefficient
uniform vec3 u_material;   // diffuse, specular, shininess
#endif

// sRGB (IEC 61966-2-1) with its power functions replaced by polynomials, minimax in steps of 8-bit sRGB: at most 0.052 steps off in
// decoding and 0.083 in encoding, so that any 8-bit colour survives both. Powers cost many times more.
vec3 linear_from_srgb(vec3 c) {
    vec3 power = (((-0.11679047 * c + 0.52651537) * c + 0.56036692) * c + 0.02840554) * c + 0.00104619;
    return mix(c / 12.92, power, greaterThan(c, vec3(0.04045)));
}

vec3 srgb_from_linear(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    vec3 t = sqrt(c);
    vec3 power = ((((0.51735632 * t - 1.62383950) * t + 2.03179131) * t - 1.40284895) * t + 1.51797526) * t - 0.04011128;
    return mix(c * 12.92, power, greaterThan(c, vec3(0.0031308)));
}

#if defined(COLOUR_SCALAR) || defined(COLOUR_DEPTH)
vec3 map_colour(float value) {
    float t = value > u_map_range.x ? min((value - u_map_range.x) * u_map_range.y, u_map_range.z) : 0.0;
    int i = clamp(int(t), 0, int(u_map_range.z) - 1);
    return mix(u_map[i], u_map[i + 1], t - float(i));
}
#endif

// Where the colour is stored in sRGB and nothing is to be computed with it, it goes to an sRGB target as it is.
#if defined(COLOUR_POINTS) && !defined(LIT) && defined(ENCODE_SRGB)
#define COLOUR_AS_STORED
#endif

vec3 splat_colour(vec3 object_normal, float eye_distance) {
#if defined(COLOUR_AS_STORED)
    return a_colour.rgb;
#elif defined(COLOUR_POINTS)
    return linear_from_srgb(a_colour.rgb);
#elif defined(COLOUR_NORMAL)
    return linear_from_srgb(normalize(object_normal) * 0.5 + 0.5);
#elif defined(COLOUR_SCALAR)
    // isnan() may be optimised away.
    return (floatBitsToUint(a_scalar) & 0x7fffffffu) > 0x7f800000u ? u_colour.rgb : map_colour(a_scalar);
#elif defined(COLOUR_DEPTH)
    return map_colour(eye_distance);
#else
    return u_colour.rgb;
#endif
}

#ifdef LIT
struct surface {
    vec3 position; // eye space, as all of it
    vec3 normal;   // unit, on the viewer's side
    vec3 mirrored; // the direction to the eye, mirrored at the normal
};

void add_light(int i, surface s, inout vec3 diffuse, inout vec3 specular) {
    vec3 light = u_light_vector[i].xyz;
    if (u_light_vector[i].w != 0.0) light = normalize(light - s.position);
    float cosine = dot(s.normal, light);
    if (!(cosine > 0.0)) return; // also where the light is at the splat
    diffuse += u_material.x * cosine * u_light_colour[i];
    specular += pow(max(dot(s.mirrored, light), 1e-6), u_material.z) * u_light_colour[i];
}

// view: unit, towards the eye.
vec3 shade(vec3 albedo, vec3 position, vec3 normal, vec3 view) {
    surface s = surface(position, normal, 2.0 * dot(normal, view) * normal - view);
    vec3 diffuse = u_ambient, specular = vec3(0.0);
#ifdef ONE_LIGHT
    add_light(0, s, diffuse, specular); // a loop over one light costs a tenth of the frame on a software rasteriser
#else
    for (int i = 0; i < u_light_count; i++) add_light(i, s, diffuse, specular);
#endif
    return albedo * diffuse + u_material.y * specular;
}
#endif

vec4 encode(vec3 colour) {
#if defined(ENCODE_SRGB) && !defined(COLOUR_AS_STORED)
    return vec4(srgb_from_linear(colour), 1.0);
#else
    return vec4(colour, 1.0);
#endif
}
