/* libpbr in an SDL2 window: a superellipsoid of points turns on its corner, sunk to the middle in a board that the host draws.
 * libpbr comes first and finds OpenGL by itself; the board is hidden by what libpbr left in the depth buffer. Orange is above it,
 * blue below.
 *
 *     sdl2_spin [--frames N [--picture OUT.ppm]]
 *
 * It runs until the window is closed or Escape is pressed; with --frames, for N frames that are 1/60 s apart. --picture writes the
 * last.
 *
 * SPDX-License-Identifier: MIT */
#include <epoxy/gl.h>
#include <math.h>
#include <pbr/pbr.h>
#include <SDL.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 120000 };
static const double pi = 3.14159265358979323846;

/* x^4 + y^4 + z^4 = 1, where rays from the centre along an even spiral meet it. What the neighbours' gaps are, libpbr finds out. */
static pbr_result create_body(pbr_instance *instance, pbr_points **out) {
    static float positions[POINTS][3], normals[POINTS][3], colours[POINTS][3];
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    for (int i = 0; i < POINTS; i++) {
        double z = 1 - (2.0 * i + 1) / POINTS, r = sqrt(1 - z * z), turn = i * pi * (3 - sqrt(5));
        double ray[3] = {r * cos(turn), r * sin(turn), z}, sum = 0, up = 0;
        for (int k = 0; k < 3; k++) sum += pow(ray[k], 4);
        for (int k = 0; k < 3; k++) {
            double at = ray[k] / sqrt(sqrt(sum));
            positions[i][k] = (float)at;
            normals[i][k] = (float)(at * at * at); /* the gradient */
            up += at / sqrt(3);                    /* the corner (1, 1, 1) will point up */
        }
        float mix = (float)fmax(0, fmin(1, 0.5 + 5 * up));
        const float low[3] = {0.03f, 0.10f, 0.80f}, high[3] = {0.90f, 0.22f, 0.03f}; /* linear, as floats are */
        for (int k = 0; k < 3; k++) colours[i][k] = low[k] + mix * (high[k] - low[k]);
    }
    desc.count = POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_FLOAT32, 3};
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    return pbr_points_create(instance, &desc, out);
}

/* The board: a square at z = 0, its corners on the axes, without a vertex buffer. Its greys are sRGB values, which libpbr too
 * stores in a window (PBR_ENCODING_AUTO). */
static const char *const board_text[2] = {
    "#version 330\n"
    "uniform mat4 view, projection;\n"
    "centroid out vec2 place;\n"
    "void main() {\n"
    "    place = 4.0 * vec2(gl_VertexID / 2, gl_VertexID % 2) - 2.0;\n"
    "    gl_Position = projection * view * vec4(0.44 * (place.x + place.y), 0.44 * (place.y - place.x), 0.0, 1.0);\n"
    "}\n",
    "#version 330\n"
    "centroid in vec2 place;\n"
    "out vec4 colour;\n"
    "void main() {\n"
    "    ivec2 tile = ivec2(floor(3.0 * place));\n"
    "    colour = vec4(vec3((tile.x + tile.y) % 2 == 0 ? 0.75 : 0.63), 1.0);\n"
    "}\n"};

static GLuint create_board(void) {
    GLuint program = glCreateProgram(), vertex_array;
    GLint linked = 0;
    for (int i = 0; i < 2; i++) {
        GLuint shader = glCreateShader(i ? GL_FRAGMENT_SHADER : GL_VERTEX_SHADER);
        glShaderSource(shader, 1, &board_text[i], NULL);
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

static void draw_board(GLuint program, const pbr_frame *frame) {
    GLfloat matrices[2][16];
    for (int i = 0; i < 16; i++) {
        matrices[0][i] = (GLfloat)frame->view[i];
        matrices[1][i] = (GLfloat)frame->projection[i];
    }
    glUseProgram(program);
    glUniformMatrix4fv(glGetUniformLocation(program, "view"), 1, GL_FALSE, matrices[0]);
    glUniformMatrix4fv(glGetUniformLocation(program, "projection"), 1, GL_FALSE, matrices[1]);
    glEnable(GL_DEPTH_TEST);
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
}

/* A whole frame, the body turned by `angle`. World z points up; the eye is 6 away and looks down on the board. */
static pbr_result draw(pbr_view *view, const pbr_points *points, GLuint board, int width, int height, double angle) {
    const double near = 1, far = 30, scale = 2.6, tilt = 1;
    const double world_to_eye[16] = {1, 0, 0, 0, 0, cos(tilt), -sin(tilt), 0, 0, sin(tilt), cos(tilt), 0, 0, 0, -6, 1};
    /* Columns: where the body's axes go when its corner stands up, turned about z. */
    double turned[16] = {[15] = 1};
    for (int k = 0; k < 3; k++) {
        double around = angle + 2 * pi * k / 3;
        turned[4 * k] = sqrt(2.0 / 3) * cos(around);
        turned[4 * k + 1] = sqrt(2.0 / 3) * sin(around);
        turned[4 * k + 2] = sqrt(1.0 / 3);
    }
    pbr_light light = PBR_LIGHT_INIT;
    pbr_frame frame = PBR_FRAME_INIT;
    pbr_item item = PBR_ITEM_INIT;
    light.space = PBR_SPACE_WORLD;
    light.vector[0] = -0.7;
    light.vector[1] = -1.5;
    light.vector[2] = 1;
    for (int k = 0; k < 3; k++) light.colour[k] = frame.ambient[k] = 1;
    frame.lights = &light;
    frame.light_count = 1;
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
    pbr_result result = pbr_render(view, &frame, &item, 1, NULL);
    draw_board(board, &frame);
    return result;
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

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "libpbr: %s (%s)\n", text, pbr_result_name(code));
}

static int asked_to_close(void) {
    SDL_Event event;
    int closed = 0;
    while (SDL_PollEvent(&event))
        closed |= event.type == SDL_QUIT || (event.type == SDL_KEYDOWN && event.key.keysym.sym == SDLK_ESCAPE);
    return closed;
}

/* From the window's context to its end. NULL, or what went wrong. `frames` 0: until closed. */
static const char *run(SDL_Window *window, long frames, const char *picture) {
    pbr_instance_desc instance_desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    pbr_points *points = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;

    SDL_GL_SetSwapInterval(1);
    GLuint board = create_board();
    const char *failure = board ? NULL : "the host's own program failed";
    instance_desc.log = print_message;
    pbr_result result = pbr_instance_create(&instance_desc, &instance);
    if (result == PBR_OK) result = create_body(instance, &points);
    if (result == PBR_OK) result = pbr_renderer_create(instance, NULL, &renderer);
    if (result == PBR_OK) result = pbr_view_create(renderer, NULL, &view);

    for (long i = 1; result == PBR_OK && !asked_to_close() && (i <= frames || !frames); i++) {
        int width, height;
        SDL_GL_GetDrawableSize(window, &width, &height); /* pixels; the window's own size may be in larger units */
        double seconds = frames ? (double)i / 60 : SDL_GetTicks() / 1000.0;
        if (width && height) result = draw(view, points, board, width, height, 0.7 * seconds);
        if (picture && i == frames && !write_picture(picture, width, height)) failure = "cannot write the picture";
        SDL_GL_SwapWindow(window);
    }

    pbr_view_destroy(&view);
    pbr_renderer_destroy(&renderer); /* while its context is current; the points may go at any time after */
    pbr_points_release(&points);
    pbr_instance_destroy(&instance);
    if (glGetError() != GL_NO_ERROR) failure = "a GL error was raised";
    return result == PBR_OK ? failure : "libpbr could not draw";
}

/* SDL takes the number of samples literally: where there are none so many, without. */
static SDL_GLContext open_window(SDL_Window **window) {
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_CORE);
    SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 24);
    for (int samples = 4; samples >= 0; samples -= 4) {
        SDL_GL_SetAttribute(SDL_GL_MULTISAMPLEBUFFERS, samples > 0);
        SDL_GL_SetAttribute(SDL_GL_MULTISAMPLESAMPLES, samples);
        *window = SDL_CreateWindow("libpbr", SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED, 960, 720,
                                   SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI);
        SDL_GLContext context = *window ? SDL_GL_CreateContext(*window) : NULL;
        if (context) return context;
        SDL_DestroyWindow(*window);
    }
    return NULL;
}

int main(int argc, char **argv) {
    const char *picture = NULL, *failure = NULL;
    SDL_Window *window = NULL;
    SDL_GLContext context = NULL;
    long frames = 0;
    for (int i = 1; i < argc; i += 2) {
        if (i + 1 < argc && !strcmp(argv[i], "--picture")) picture = argv[i + 1];
        else if (i + 1 < argc && !strcmp(argv[i], "--frames") && (frames = strtol(argv[i + 1], NULL, 10)) > 0) continue;
        else return fprintf(stderr, "usage: %s [--frames N [--picture OUT.ppm]]\n", argv[0]), 2;
    }
    if (picture && !frames) return fprintf(stderr, "%s: --picture needs --frames\n", argv[0]), 2;
    if (SDL_Init(SDL_INIT_VIDEO) == 0) context = open_window(&window);
    failure = context ? run(window, frames, picture) : SDL_GetError();
    if (failure) fprintf(stderr, "%s: %s\n", argv[0], failure);
    if (context) SDL_GL_DeleteContext(context);
    if (context) SDL_DestroyWindow(window);
    SDL_Quit();
    return failure ? EXIT_FAILURE : EXIT_SUCCESS;
}
