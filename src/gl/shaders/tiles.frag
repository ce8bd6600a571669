// The farthest depth of each tile of a picture, two by two tiles a texel: x and y of the lower row, z and w of the upper.

#ifdef GL_ES
precision highp sampler2D;
#endif

uniform sampler2D u_front;  // window depth
uniform vec3 u_box;         // the picture's size in pixels; -1 where less is farther, else 1
layout(location = 0) out uvec4 o_tiles;

const int TILE = 8;

uint farthest(ivec2 tile) {
    ivec2 begin = tile * TILE, end = min(begin + TILE, ivec2(u_box.xy));
    float most = u_box.z < 0.0 ? 1.0 : 0.0; // past the picture's border
    for (int y = begin.y; y < end.y; y++)
        for (int x = begin.x; x < end.x; x++) {
            float depth = texelFetch(u_front, ivec2(x, y), 0).r;
            most = u_box.z < 0.0 ? min(most, depth) : max(most, depth);
        }
    return floatBitsToUint(most);
}

void main() {
    ivec2 tile = 2 * ivec2(gl_FragCoord.xy);
    o_tiles = uvec4(farthest(tile), farthest(tile + ivec2(1, 0)), farthest(tile + ivec2(0, 1)), farthest(tile + ivec2(1, 1)));
}
