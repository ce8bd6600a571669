/* libpbr in a GLFW window: a torus knot of points turns on its axis, through a plate that the host draws. libpbr comes second, with
 * the OpenGL functions that GLFW finds. Orange is above the plate and blue below: the depth buffer decides what is seen of either.
 *
 *     glfw_spin [--frames N [--picture OUT.ppm]]
 *
 * It runs until the window is closed or Escape is pressed; with --frames, for N frames that are 1/60 s apart. --picture writes the
 * last.
 *
 * SPDX-License-Identifier: MIT */
#define GLFW_INCLUDE_NONE
#include <epoxy/gl.h>
#include <GLFW/glfw3.h>
#include <math.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ALONG = 1400, ACROSS = 120, POINTS = ALONG * ACROSS };
static const double pi = 3.14159265358979323846;

struct surfel {
    float position[3], normal[3];
    uint8_t colour[3];
};

/* A tube around the (2,3) knot on the torus of radii 2 and 1. The torus's normal, `out`, is at right angles to the curve. */
static void compute_knot(struct surfel *surfels) {
    for (int i = 0; i < POINTS; i++) {
        double t = 2 * pi * (i / ACROSS) / ALONG, v = 2 * pi * (i % ACROSS) / ACROSS, r = 2 + cos(3 * t);
        double x = cos(2 * t), y = sin(2 * t), centre[3] = {r * x, r * y, sin(3 * t)};
        double out[3] = {cos(3 * t) * x, cos(3 * t) * y, sin(3 * t)}, speed = sqrt(9 + 4 * r * r);
        double along[3] = {-3 * out[2] * x - 2 * r * y, -3 * out[2] * y + 2 * r * x, 3 * cos(3 * t)};
        for (int k = 0; k < 3; k++) {
            int l = (k + 1) % 3, m = (k + 2) % 3;
            double aside = (along[l] * out[m] - along[m] * out[l]) / speed, normal = cos(v) * out[k] + sin(v) * aside;
            surfels[i].normal[k] = (float)normal;
            surfels[i].position[k] = (float)(centre[k] + 0.45 * normal);
        }
        double height = fmax(-1, fmin(1, 3 * surfels[i].position[2]));
        surfels[i].colour[0] = (uint8_t)(140 + 105 * height);
        surfels[i].colour[1] = (uint8_t)(105 + 25 * height);
        surfels[i].colour[2] = (uint8_t)(140 - 90 * height);
    }
}

static pbr_result create_knot(pbr_instance *instance, pbr_points **out) {
    static struct surfel surfels[POINTS];
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    compute_knot(surfels);
    desc.count = POINTS;
    desc.positions = (pbr_attribute){surfels->position, sizeof *surfels, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){surfels->normal, sizeof *surfels, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){surfels->colour, sizeof *surfels, PBR_FORMAT_UINT8, 3};
    desc.radius = 0.028f; /* gaps of at most 0.037 x 0.024: half a diagonal is 0.022 */
    return pbr_points_create(instance, &desc, out);
}

/* The plate: a disc of radius 2.2 at z = 0, without a vertex buffer. Its greys are sRGB values, which libpbr too stores in a window
 * (PBR_ENCODING_AUTO). */
static const char *const plate_text[2] = {
    "#version 330\n"
    "uniform mat4 view, projection;\n"
    "out vec2 place;\n"
    "void main() {\n"
    "    float turn = 6.2831853 * float(gl_VertexID) / 128.0;\n"
    "    place = 2.2 * vec2(cos(turn), sin(turn));\n"
    "    gl_Position = projection * view * vec4(place, 0.0, 1.0);\n"
    "}\n",
    "#version 330\n"
    "in vec2 place;\n"
    "out vec4 colour;\n"
    "void main() { colour = vec4(vec3(fract(2.5 * length(place)) < 0.5 ? 0.72 : 0.64), 1.0); }\n"};

static GLuint create_plate(void) {
    GLuint program = glCreateProgram(), vertex_array;
    GLint linked = 0;
    for (int i = 0; i < 2; i++) {
        GLuint shader = glCreateShader(i ? GL_FRAGMENT_SHADER : GL_VERTEX_SHADER);
        glShaderSource(shader, 1, &plate_text[i], NULL);
        glCompileShader(shader);
        glAttachShader(program, shader);
        glDeleteShader(shader);
    }
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    glGenVertexArrays(1, &vertex_array); /* a core context draws nothing without one */
    glBindVertexArray(vertex_array);
    return linked ? program : 0;
}

static void draw_plate(GLuint program, const pbr_frame *frame) {
    GLfloat matrices[2][16];
    for (int i = 0; i < 16; i++) {
        matrices[0][i] = (GLfloat)frame->view[i];
        matrices[1][i] = (GLfloat)frame->projection[i];
    }
    glUseProgram(program);
    glUniformMatrix4fv(glGetUniformLocation(program, "view"), 1, GL_FALSE, matrices[0]);
    glUniformMatrix4fv(glGetUniformLocation(program, "projection"), 1, GL_FALSE, matrices[1]);
    glEnable(GL_DEPTH_TEST);
    glDrawArrays(GL_TRIANGLE_FAN, 0, 128);
}

/* A whole frame, the knot turned by `angle`. World z points up; the eye is 9 away and looks down on the plate. */
static pbr_result draw(pbr_view *view, const pbr_points *points, GLuint plate, int width, int height, double angle) {
    const double near = 1, far = 30, scale = 2.2, tilt = 0.75, c = cos(angle), s = sin(angle);
    const double world_to_eye[16] = {1, 0, 0, 0, 0, cos(tilt), -sin(tilt), 0, 0, sin(tilt), cos(tilt), 0, 0, 0, -9, 1};
    const double turned[16] = {c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    pbr_frame frame = PBR_FRAME_INIT; /* lit from the eye */
    pbr_item item = PBR_ITEM_INIT;
    memcpy(frame.view, world_to_eye, sizeof world_to_eye);
    frame.projection[0] = scale * height / width;
    frame.projection[5] = scale;
    frame.projection[10] = (far + near) / (near - far);
    frame.projection[11] = -1;
    frame.projection[14] = 2 * far * near / (near - far);
    item.points = points;
    item.transforms = turned;
    item.transform_count = 1;

    glViewport(0, 0, width, height); /* the frame's own, left 0, means this one */
    glClearColor(0.10f, 0.11f, 0.14f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    draw_plate(plate, &frame);
    return pbr_render(view, &frame, &item, 1, NULL);
}

static int write_picture(const char *path, int width, int height) {
    const size_t row = 3 * (size_t)width;
    uint8_t *pixels = malloc(row * (size_t)height);
    FILE *file = pixels ? fopen(path, "wb") : NULL;
    if (!file) return free(pixels), 0;
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, pixels);
    fprintf(file, "P6\n%d %d\n255\n", width, height);
    for (int y = height - 1; y >= 0; y--) fwrite(pixels + row * (size_t)y, 1, row, file);
    free(pixels);
    int failed = ferror(file);
    return fclose(file) == 0 && !failed;
}

/* Where libpbr explains what went wrong. It prints nothing itself. */
static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "libpbr: %s (%s)\n", text, pbr_result_name(code));
}

static void print_glfw_error(int code, const char *text) {
    fprintf(stderr, "GLFW: %s (0x%x)\n", text, (unsigned)code);
}

static void *find_function(void *user, const char *name) {
    (void)user;
    GLFWglproc function = glfwGetProcAddress(name);
    void *address;
    memcpy(&address, &function, sizeof address); /* C has no cast between the two */
    return address;
}

/* From the window's context to its end. NULL, or what went wrong. `frames` 0: until closed. */
static const char *run(GLFWwindow *window, long frames, const char *picture) {
    pbr_instance_desc instance_desc = PBR_INSTANCE_DESC_INIT;
    pbr_renderer_desc renderer_desc = PBR_RENDERER_DESC_INIT;
    pbr_instance *instance = NULL;
    pbr_points *points = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;

    glfwMakeContextCurrent(window);
    glfwSwapInterval(1);
    glfwSetInputMode(window, GLFW_STICKY_KEYS, GLFW_TRUE); /* also a key that goes down and up within a frame */
    GLuint plate = create_plate();
    const char *failure = plate ? NULL : "the host's own program failed";
    instance_desc.log = print_message;
    renderer_desc.get_proc_address = find_function;
    pbr_result result = pbr_instance_create(&instance_desc, &instance);
    if (result == PBR_OK) result = create_knot(instance, &points);
    if (result == PBR_OK) result = pbr_renderer_create(instance, &renderer_desc, &renderer);
    if (result == PBR_OK) result = pbr_view_create(renderer, NULL, &view);

    for (long i = 1; result == PBR_OK && !glfwWindowShouldClose(window) && (i <= frames || !frames); i++) {
        int width, height;
        glfwGetFramebufferSize(window, &width, &height); /* pixels; the window's own size may be in larger units */
        if (width && height) result = draw(view, points, plate, width, height, 0.7 * (frames ? (double)i / 60 : glfwGetTime()));
        if (picture && i == frames && !write_picture(picture, width, height)) failure = "cannot write the picture";
        glfwSwapBuffers(window);
        glfwPollEvents();
        if (glfwGetKey(window, GLFW_KEY_ESCAPE)) glfwSetWindowShouldClose(window, GLFW_TRUE);
    }

    pbr_view_destroy(&view);
    pbr_renderer_destroy(&renderer); /* while its context is current; the points may go at any time after */
    pbr_points_release(&points);
    pbr_instance_destroy(&instance);
    if (glGetError() != GL_NO_ERROR) failure = "a GL error was raised";
    return result == PBR_OK ? failure : "libpbr could not draw";
}

int main(int argc, char **argv) {
    const char *picture = NULL, *failure = "no window with an OpenGL 3.3 context";
    long frames = 0;
    for (int i = 1; i < argc; i += 2) {
        if (i + 1 < argc && !strcmp(argv[i], "--picture")) picture = argv[i + 1];
        else if (i + 1 < argc && !strcmp(argv[i], "--frames") && (frames = strtol(argv[i + 1], NULL, 10)) > 0) continue;
        else return fprintf(stderr, "usage: %s [--frames N [--picture OUT.ppm]]\n", argv[0]), 2;
    }
    if (picture && !frames) return fprintf(stderr, "%s: --picture needs --frames\n", argv[0]), 2;
    glfwSetErrorCallback(print_glfw_error);
    if (!glfwInit()) return EXIT_FAILURE;
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_SAMPLES, 4); /* or as many as there are */
    GLFWwindow *window = glfwCreateWindow(960, 720, "libpbr", NULL, NULL);
    if (window) failure = run(window, frames, picture);
    if (failure) fprintf(stderr, "%s: %s\n", argv[0], failure);
    glfwTerminate();
    return failure ? EXIT_FAILURE : EXIT_SUCCESS;
}
