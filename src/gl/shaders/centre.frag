// A sample: summed up with the pixel's others.

flat in vec4 v_colour;
layout(location = 0) out vec4 o_sum;

void main() {
    o_sum = v_colour;
    gl_FragDepth = within_clear(gl_FragCoord.z); // as marks are
}
