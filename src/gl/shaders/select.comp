// Copies the entries that are of the cut, in their order, and says how many they are, for the passes that draw them. A work group
// for each chunk; a tile of entries after the other: each invocation looks at some that follow one another, then all find out where
// to write by adding up what those before them keep.

layout(local_size_x = SELECT_INVOCATIONS) in;

const uint ENTRIES = 8u; // of an invocation
const uint WORDS = 5u;   // of an entry

layout(std430, binding = 0) readonly buffer Tree { uint tree[]; };
layout(std430, binding = 1) writeonly buffer Selected { uint selected[]; };
layout(std430, binding = 2) writeonly buffer Commands { uvec4 commands[]; }; // two for each chunk: as points, as quads

uniform vec4 u_rows[PAGE_CHUNKS];   // of the matrix to clip coordinates, the last one: w
uniform vec4 u_steps[PAGE_CHUNKS];
uniform uvec4 u_ranges[PAGE_CHUNKS]; // first entry of the tree's, how many, first of those selected, pair of commands

shared uint sums[SELECT_INVOCATIONS];

bool keeps(uint entry, vec4 row, vec4 steps) {
    uint at = WORDS * entry, xy = tree[at], z = tree[at + 1u] & 0xffffu, errors = tree[at + 4u];
    vec3 position = vec3(xy & 0xffffu, xy >> 16, z) * steps.x;
    return is_drawn(dot(row.xyz, position) + row.w, vec2(errors & 0xffffu, errors >> 16), float(tree[at + 3u] >> 24), steps);
}

void main() {
    uvec4 range = u_ranges[gl_WorkGroupID.x];
    vec4 row = u_rows[gl_WorkGroupID.x], steps = u_steps[gl_WorkGroupID.x];
    uint me = gl_LocalInvocationID.x, written = range.z;
    for (uint tile = 0u; tile < range.y; tile += ENTRIES * uint(SELECT_INVOCATIONS)) {
        uint first = tile + ENTRIES * me, kept = 0u;
        for (uint i = 0u; i < ENTRIES; i++)
            if (first + i < range.y && keeps(range.x + first + i, row, steps)) kept |= 1u << i;
        sums[me] = uint(bitCount(kept));
        barrier();
        for (uint apart = 1u; apart < uint(SELECT_INVOCATIONS); apart *= 2u) {
            uint before = me >= apart ? sums[me - apart] : 0u;
            barrier();
            sums[me] += before;
            barrier();
        }
        uint to = written + sums[me] - uint(bitCount(kept));
        for (uint i = 0u; i < ENTRIES; i++) {
            if ((kept & 1u << i) == 0u) continue;
            for (uint word = 0u; word < WORDS; word++) selected[WORDS * to + word] = tree[WORDS * (range.x + first + i) + word];
            to++;
        }
        written += sums[SELECT_INVOCATIONS - 1];
        barrier();
    }
    if (me != 0u) return;
    uint count = written - range.z;
    commands[2u * range.w] = uvec4(count, 1u, range.z, 0u);
    commands[2u * range.w + 1u] = uvec4(4u, count, 0u, 0u);
}
