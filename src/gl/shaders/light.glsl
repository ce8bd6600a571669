// Lighting (Phong 1975), in linear light and eye space.

#ifdef LIT
#ifndef ONE_LIGHT
uniform int u_light_count;
#endif
uniform vec4 u_light_vector[8]; // eye space; w = 0: unit vector towards the light, w = 1: its position
uniform vec3 u_light_colour[8];
uniform vec3 u_ambient;    // times the material's coefficient
uniform vec3 u_material;   // diffuse, specular, shininess

struct surface {
    vec3 position; // eye space, as all of it
    vec3 normal;   // unit, on the viewer's side
    vec3 mirrored; // the direction to the eye, mirrored at the normal
};

void add_light(int i, surface s, inout vec3 diffuse, inout vec3 specular) {
    vec3 light = u_light_vector[i].xyz;
    if (u_light_vector[i].w != 0.0) light = normalize(light - s.position);
    float cosine = dot(s.normal, light);
    if (!(cosine > 0.0)) return; // also where the light is at the splat
    diffuse += u_material.x * cosine * u_light_colour[i];
    specular += pow(max(dot(s.mirrored, light), 1e-6), u_material.z) * u_light_colour[i];
}

// view: unit, towards the eye.
vec3 shade(vec3 albedo, vec3 position, vec3 normal, vec3 view) {
    surface s = surface(position, normal, 2.0 * dot(normal, view) * normal - view);
    vec3 diffuse = u_ambient, specular = vec3(0.0);
#ifdef ONE_LIGHT
    add_light(0, s, diffuse, specular); // a loop over one light costs a tenth of the frame on a software rasteriser
#else
    for (int i = 0; i < u_light_count; i++) add_light(i, s, diffuse, specular);
#endif
    return albedo * diffuse + u_material.y * specular;
}
#endif
