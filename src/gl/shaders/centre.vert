// Splats that are filled between bring their colours by the pixels that hold their centres.

uniform vec4 u_window; // half the viewport's size; its centre in the window; pixels
flat out vec4 v_colour; // and 1, to count

void main() {
    vec3 position = a_position_radius.xyz;
    vec4 clip = to_clip() * vec4(position, 1.0);
    vec3 normal = splat_normal();
    gl_PointSize = 1.0;
    if (!(clip.w > 0.0) || !is_selected(clip.w) || clipped_away(position) || is_back_face(position, normal)) {
        gl_Position = rejected_position();
        v_colour = vec4(0.0); // adds nothing
        return;
    }
    v_colour = colour_splat(position, normal);
    vec3 ndc = clip.xyz / clip.w;
    vec2 pixel = floor(ndc.xy * u_window.xy + u_window.zw) + 0.5;
    gl_Position = vec4((pixel - u_window.zw) / u_window.xy, ndc.z, 1.0);
}
