// Splats that are filled between, into the host's target: the Gaussian mean of the samples around each pixel that a splat marks.
// docs/splats.md, "Filling holes" (Pfister et al. 2000).

#ifdef GL_ES
precision highp sampler2D;
precision highp usampler2D;
#endif

uniform sampler2D u_colours; // sums of the samples' colours, their number
uniform usampler2D u_front;  // window depth as it is and moved back, as bits; all ones = nothing
uniform sampler2D u_second;  // the front splat's colour, its radius in pixels
uniform vec3 u_box;          // of the picture, from the targets' corner: pixels; z: 1, or -1 where farther is less
uniform vec2 u_corner;       // of the targets' first pixel, window pixels
layout(location = 0) out vec4 o_colour;

// Whether the extents of two pixels overlap. x: front, y: moved back, which within_clear() may have left before the front.
bool overlap(vec2 a, vec2 b) {
    vec2 ends = vec2(a.y, b.y) * u_box.z, fronts = min(vec2(a.x, b.x) * u_box.z, ends);
    return max(fronts.x, fronts.y) <= min(ends.x, ends.y);
}

// False where nothing is.
bool find_extent(ivec2 at, out vec2 extent) {
    uvec2 front = texelFetch(u_front, at, 0).rg;
    extent = uintBitsToFloat(front);
    return front.x != 0xffffffffu;
}

vec4 gather(ivec2 at, vec2 extent, float radius) {
    int reach = int(radius);
    ivec2 low = max(at - reach, ivec2(0)), high = min(at + reach, ivec2(u_box.xy) - 1);
    float squared = radius * radius, narrow = 2.0 / max(squared, 1.0);
    vec4 sum = vec4(0.0);
    for (int y = low.y; y <= high.y; y++)
        for (int x = low.x; x <= high.x; x++) {
            vec4 samples = texelFetch(u_colours, ivec2(x, y), 0);
            vec2 from = vec2(x - at.x, y - at.y), other;
            float distance = dot(from, from);
            if (samples.a == 0.0 || distance > squared || !find_extent(ivec2(x, y), other) || !overlap(extent, other)) continue;
            sum += exp(-narrow * distance) * samples;
        }
    return sum;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy - u_corner);
    vec2 extent;
    if (!find_extent(at, extent)) discard;
    vec4 mark = texelFetch(u_second, at, 0);
    vec3 colour = mark.rgb;
    if (mark.a > 0.0 && mark.a <= KERNEL_MOST_FILLED) { // 0: a triangle
        vec4 sum = gather(at, extent, mark.a);
        if (sum.a > 0.0) colour = sum.rgb / sum.a;
    }
#ifdef ENCODE_SRGB
    colour = srgb_from_linear(colour);
#endif
    o_colour = vec4(colour, 1.0);
    gl_FragDepth = extent.x;
}
