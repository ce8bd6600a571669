// Whether an entry of a sequential point tree is of the cut: spt_is_drawn of src/lod/spt.h.

uniform vec2 u_cut; // depth per w; s, -1: the leaves, -2: all

// errors: codes, own and the parent's; distance: the code of that to the parent; steps: as u_steps of splat.glsl.
bool is_drawn(float w, vec2 errors, float distance, vec4 steps) {
    if (u_cut.y < 0.0) return u_cut.y < -1.0 || errors.x == 0.0;
    float z = w * u_cut.x, room = distance > 0.0 ? exp2(-20.0) * z : 0.0;
    float apart = distance > 0.0 ? steps.w * exp2((distance - 255.0) / 16.0) : 0.0;
    bool is_fine = errors.x == 0.0 || u_cut.y * (errors.x * steps.z) <= z;
    bool is_root = errors.y == 65535.0; // of its chunk: no parent stands for it
    return is_fine && (is_root || z - room < u_cut.y * (errors.y * steps.z) + apart);
}
