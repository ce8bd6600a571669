// Clip planes: of splats those are dropped whose centres lie beyond, of triangles the parts that do.

#ifdef CLIP_PLANES
uniform int u_clip_plane_count;
uniform vec4 u_clip_plane[8]; // chunk space; of sequences without the last coordinates, which depend on the chunk
#endif

#ifdef CLIP_PLANES
float plane_offset(int i) {
#ifdef SEQUENCE
    return u_plane_offsets[2 * DRAW + i / 4][i % 4];
#else
    return u_clip_plane[i].w;
#endif
}
#endif

bool clipped_away(vec3 position) {
#ifdef CLIP_PLANES
    for (int i = 0; i < u_clip_plane_count; i++)
        if (dot(u_clip_plane[i].xyz, position) + plane_offset(i) < 0.0) return true;
#endif
    return false;
}
