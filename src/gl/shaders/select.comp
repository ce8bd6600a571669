// Copies the entries that are of the cut, in their order, and says how many they are, for the passes that draw them. A work group
// for each chunk, a tile of entries after the other: a tile has rows of one entry for each invocation, so that neighbours read, and
// write, what lies side by side. What each row keeps before an invocation's entry is added up for all rows at once.

layout(local_size_x = SELECT_INVOCATIONS) in;

const uint ROWS = 8u;
const uint WORDS = 5u; // of an entry

layout(std430, binding = STORAGE_TREE) readonly buffer Tree { uint tree[]; };
layout(std430, binding = STORAGE_COPIES) writeonly buffer Selected { uint selected[]; };
layout(std430, binding = STORAGE_COMMANDS) writeonly buffer Commands { uvec4 commands[]; }; // two for each chunk: as points, as quads

uniform vec4 u_rows[PAGE_CHUNKS];   // of the matrix to clip coordinates, the last one: w
uniform vec4 u_steps[PAGE_CHUNKS];
uniform uvec4 u_ranges[PAGE_CHUNKS]; // first entry of the tree's, how many, first of those selected, pair of commands

shared uvec4 sums[SELECT_INVOCATIONS]; // of the rows, 16 bits each

uint of_row(uvec4 rows, uint row) {
    return rows[row >> 1] >> (16u * (row & 1u)) & 0xffffu;
}

bool keeps(uint entry, vec4 row, vec4 steps) {
    uint at = WORDS * entry, xy = tree[at], z = tree[at + 1u] & 0xffffu, errors = tree[at + 4u];
    vec3 position = vec3(xy & 0xffffu, xy >> 16, z) * steps.x;
    return is_drawn(dot(row.xyz, position) + row.w, vec2(errors & 0xffffu, errors >> 16), float(tree[at + 3u] >> 24), steps);
}

void main() {
    uvec4 range = u_ranges[gl_WorkGroupID.x];
    vec4 row_of_w = u_rows[gl_WorkGroupID.x], steps = u_steps[gl_WorkGroupID.x];
    uint me = gl_LocalInvocationID.x, width = uint(SELECT_INVOCATIONS), to = range.z;
    for (uint tile = 0u; tile < range.y; tile += ROWS * width) {
        uvec4 kept = uvec4(0u);
        for (uint row = 0u; row < ROWS; row++) {
            uint entry = tile + row * width + me;
            if (entry < range.y && keeps(range.x + entry, row_of_w, steps)) kept[row >> 1] |= 1u << (16u * (row & 1u));
        }
        sums[me] = kept;
        barrier();
        for (uint apart = 1u; apart < width; apart *= 2u) {
            uvec4 before = me >= apart ? sums[me - apart] : uvec4(0u);
            barrier();
            sums[me] += before;
            barrier();
        }
        uvec4 own = sums[me], all = sums[SELECT_INVOCATIONS - 1];
        for (uint row = 0u; row < ROWS; row++) {
            if (of_row(kept, row) != 0u) {
                uint from = WORDS * (range.x + tile + row * width + me), at = WORDS * (to + of_row(own, row) - 1u);
                for (uint word = 0u; word < WORDS; word++) selected[at + word] = tree[from + word];
            }
            to += of_row(all, row);
        }
        barrier();
    }
    if (me != 0u) return;
    uint count = to - range.z;
    commands[2u * range.w] = uvec4(count, 1u, range.z, 0u);
    commands[2u * range.w + 1u] = uvec4(4u, count, 0u, 0u);
}
