// A triangle over all of the viewport.

void main() {
    vec2 at = vec2((gl_VertexID & 1) == 0 ? -1.0 : 3.0, (gl_VertexID & 2) == 0 ? -1.0 : 3.0);
    gl_Position = vec4(at, 0.5, 1.0);
}
