/* An engine with habits of its own, and libpbr in the middle of its frame: the host draws its ground with its own program, vertex
 * array, texture, scissor, blending and culling into a multisampled sRGB framebuffer; libpbr adds a cloud; the host goes on drawing
 * a ring around and through the cloud WITHOUT setting any state again. With --check it fails if a GL error was raised or state that
 * it relies on changed.
 *
 *     engine_mix PICTURE.ppm [--check]
 *
 * SPDX-License-Identifier: MIT */
#include <epoxy/gl.h> /* before EGL's headers, which define the same basic types */

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <math.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 960, HEIGHT = 540, BORDER = 20, SAMPLES = 4, AROUND = 96, ACROSS = 32, CLOUD_POINTS = 150000 };
static const double pi = 3.14159265358979323846;

struct vertex {
    float position[3], normal[3], texcoord[2];
};

/* The host's own GL objects. */
struct host {
    GLuint program, texture, sampler, vertex_array, buffers[2];
    GLuint framebuffer, resolved, renderbuffers[3];
    GLint matrix_location;
    float matrix[16]; /* world to clip, column-major */
    GLsizei ground_indices, ring_indices;
};

/* The two matrices of the frame, as the host keeps them for everyone. */
struct camera {
    double view[16], projection[16];
};

static const char vertex_text[] = "#version 330\n"
                                  "layout(location = 0) in vec3 position;\n"
                                  "layout(location = 1) in vec3 normal;\n"
                                  "layout(location = 2) in vec2 texcoord;\n"
                                  "uniform mat4 matrix;\n"
                                  "out vec3 n;\n"
                                  "out vec2 t;\n"
                                  "void main() { gl_Position = matrix * vec4(position, 1.0); n = normal; t = texcoord; }\n";
static const char fragment_text[] = "#version 330\n"
                                    "in vec3 n;\n"
                                    "in vec2 t;\n"
                                    "uniform sampler2D image;\n"
                                    "out vec4 colour;\n"
                                    "void main() {\n"
                                    "    float light = 0.15 + 0.85 * max(dot(normalize(n), normalize(vec3(0.4, 0.8, 0.5))), 0.0);\n"
                                    "    colour = vec4(texture(image, t).rgb * light, 1.0);\n"
                                    "}\n";

static GLuint compile(GLenum stage, const char *text) {
    GLuint shader = glCreateShader(stage);
    glShaderSource(shader, 1, &text, NULL);
    glCompileShader(shader);
    return shader;
}

static int create_program(struct host *host) {
    GLuint shaders[2] = {compile(GL_VERTEX_SHADER, vertex_text), compile(GL_FRAGMENT_SHADER, fragment_text)};
    GLint linked = 0;
    host->program = glCreateProgram();
    for (int i = 0; i < 2; i++) glAttachShader(host->program, shaders[i]);
    glLinkProgram(host->program);
    for (int i = 0; i < 2; i++) glDeleteShader(shaders[i]);
    glGetProgramiv(host->program, GL_LINK_STATUS, &linked);
    host->matrix_location = glGetUniformLocation(host->program, "matrix");
    return linked;
}

static void create_texture(struct host *host) {
    const uint8_t checks[2][2][4] = {{{200, 190, 170, 255}, {90, 110, 120, 255}}, {{90, 110, 120, 255}, {200, 190, 170, 255}}};
    glGenTextures(1, &host->texture);
    glBindTexture(GL_TEXTURE_2D, host->texture);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_SRGB8_ALPHA8, 2, 2, 0, GL_RGBA, GL_UNSIGNED_BYTE, checks);
    glGenSamplers(1, &host->sampler);
    glSamplerParameteri(host->sampler, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glSamplerParameteri(host->sampler, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

/* A ground quad, then a ring (a torus lying in the xz plane) that the cloud cuts through. */
static void create_meshes(struct host *host) {
    static struct vertex vertices[4 + AROUND * ACROSS];
    static uint16_t indices[6 + 6 * AROUND * ACROSS];
    static const uint16_t quad[6] = {0, 1, 2, 2, 1, 3};
    for (int i = 0; i < 4; i++)
        vertices[i] = (struct vertex){{i / 2 ? 3.0f : -3.0f, -1, i % 2 ? 3.0f : -3.0f}, {0, 1, 0}, {i / 2 ? 6 : 0, i % 2 ? 6 : 0}};
    memcpy(indices, quad, sizeof quad);
    for (int i = 0; i < AROUND * ACROSS; i++) {
        int a = i / ACROSS, b = i % ACROSS, next_a = (a + 1) % AROUND, next_b = (b + 1) % ACROSS;
        double u = 2 * pi * a / AROUND, v = 2 * pi * b / ACROSS, normal[3] = {cos(u) * cos(v), sin(v), sin(u) * cos(v)};
        struct vertex *out = &vertices[4 + i];
        for (int k = 0; k < 3; k++) out->normal[k] = (float)normal[k];
        out->position[0] = (float)(0.95 * cos(u) + 0.18 * normal[0]);
        out->position[1] = (float)(0.18 * normal[1]);
        out->position[2] = (float)(0.95 * sin(u) + 0.18 * normal[2]);
        out->texcoord[0] = (float)(u * 4);
        out->texcoord[1] = (float)v;
        int corners[6] = {
            i, a * ACROSS + next_b, next_a * ACROSS + b, next_a * ACROSS + b, a * ACROSS + next_b, next_a * ACROSS + next_b};
        for (int k = 0; k < 6; k++) indices[6 + 6 * i + k] = (uint16_t)(4 + corners[k]);
    }
    host->ground_indices = 6;
    host->ring_indices = 6 * AROUND * ACROSS;
    glGenVertexArrays(1, &host->vertex_array);
    glBindVertexArray(host->vertex_array);
    glGenBuffers(2, host->buffers);
    glBindBuffer(GL_ARRAY_BUFFER, host->buffers[0]);
    glBufferData(GL_ARRAY_BUFFER, sizeof vertices, vertices, GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, host->buffers[1]);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, sizeof indices, indices, GL_STATIC_DRAW);
    const size_t offsets[3] = {offsetof(struct vertex, position), offsetof(struct vertex, normal),
                               offsetof(struct vertex, texcoord)};
    for (GLuint i = 0; i < 3; i++) {
        glVertexAttribPointer(i, i == 2 ? 2 : 3, GL_FLOAT, GL_FALSE, sizeof(struct vertex), (const void *)offsets[i]);
        glEnableVertexAttribArray(i);
    }
}

static int create_framebuffers(struct host *host) {
    const GLenum formats[3] = {GL_SRGB8_ALPHA8, GL_DEPTH24_STENCIL8, GL_SRGB8_ALPHA8};
    int complete = 1;
    glGenFramebuffers(1, &host->framebuffer);
    glGenFramebuffers(1, &host->resolved);
    glGenRenderbuffers(3, host->renderbuffers);
    for (int i = 2; i >= 0; i--) {
        glBindFramebuffer(GL_FRAMEBUFFER, i == 2 ? host->resolved : host->framebuffer);
        glBindRenderbuffer(GL_RENDERBUFFER, host->renderbuffers[i]);
        glRenderbufferStorageMultisample(GL_RENDERBUFFER, i == 2 ? 0 : SAMPLES, formats[i], WIDTH, HEIGHT);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, i == 1 ? GL_DEPTH_STENCIL_ATTACHMENT : GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                                  host->renderbuffers[i]);
        if (i != 1) complete &= i == 0 || glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    }
    return complete && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

/* The eye at (0, 1.7, 4.2), looking a little down; 45 degrees. */
static void aim(struct host *host, struct camera *camera) {
    const double near = 0.5, far = 20, scale = 1 / tan(pi / 8), tilt = 0.38, eye[3] = {0, 1.7, 4.2};
    const double view[16] = {1,
                             0,
                             0,
                             0,
                             0,
                             cos(tilt),
                             sin(tilt),
                             0,
                             0,
                             -sin(tilt),
                             cos(tilt),
                             0,
                             0,
                             -cos(tilt) * eye[1] + sin(tilt) * eye[2],
                             -sin(tilt) * eye[1] - cos(tilt) * eye[2],
                             1};
    const double projection[16] = {[0] = scale * HEIGHT / WIDTH,
                                   [5] = scale,
                                   [10] = (far + near) / (near - far),
                                   [11] = -1,
                                   [14] = 2 * far * near / (near - far)};
    memcpy(camera->view, view, sizeof view);
    memcpy(camera->projection, projection, sizeof projection);
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++) {
            double sum = 0;
            for (int k = 0; k < 4; k++) sum += projection[4 * k + r] * view[4 * c + k];
            host->matrix[4 * c + r] = (float)sum;
        }
}

/* Everything the host sets, once, for the whole frame; some of it would spoil a guest that trusted defaults. */
static void begin_frame(const struct host *host) {
    glBindFramebuffer(GL_FRAMEBUFFER, host->framebuffer);
    glViewport(0, 0, WIDTH, HEIGHT);
    glEnable(GL_FRAMEBUFFER_SRGB);
    glEnable(GL_MULTISAMPLE);
    glClearColor(0.30f, 0.42f, 0.60f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT);
    glEnable(GL_SCISSOR_TEST);
    glScissor(BORDER, BORDER, WIDTH - 2 * BORDER, HEIGHT - 2 * BORDER);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LEQUAL);
    glEnable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    glEnable(GL_PRIMITIVE_RESTART);
    glPrimitiveRestartIndex(7);
    glPrimitiveRestartIndex(0xffff);
    glActiveTexture(GL_TEXTURE3);
    glBindTexture(GL_TEXTURE_2D, host->texture);
    glBindSampler(3, host->sampler);
    glUseProgram(host->program);
    glUniform1i(glGetUniformLocation(host->program, "image"), 3);
    glUniformMatrix4fv(host->matrix_location, 1, GL_FALSE, host->matrix);
    glBindVertexArray(host->vertex_array);
}

static void draw_ground(const struct host *host) {
    glDrawElements(GL_TRIANGLES, host->ground_indices, GL_UNSIGNED_SHORT, NULL);
}

static void draw_ring(const struct host *host) {
    glDrawElements(GL_TRIANGLES, host->ring_indices, GL_UNSIGNED_SHORT, (const void *)(host->ground_indices * sizeof(uint16_t)));
}

/* A bumpy ball, evenly sampled along a spiral; it reaches through the ring and a little into the ground. */
static pbr_result create_cloud(pbr_instance *instance, pbr_points **out) {
    static float positions[CLOUD_POINTS][3], normals[CLOUD_POINTS][3];
    static uint8_t colours[CLOUD_POINTS][3];
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    for (int i = 0; i < CLOUD_POINTS; i++) {
        double y = 1 - (2.0 * i + 1) / CLOUD_POINTS, r = sqrt(1 - y * y), turn = i * pi * (3 - sqrt(5));
        double n[3] = {r * cos(turn), y, r * sin(turn)}, bump = sin(9 * n[0]) * sin(9 * n[1]) * sin(9 * n[2]);
        for (int k = 0; k < 3; k++) {
            /* The bumps are shallow: the sphere's normal, tilted against their slope, is close enough here. */
            double slope = 9 * cos(9 * n[k]) * sin(9 * n[(k + 1) % 3]) * sin(9 * n[(k + 2) % 3]);
            positions[i][k] = (float)(n[k] * (1 + 0.06 * bump));
            normals[i][k] = (float)(n[k] * 1.2 - 0.06 * slope);
        }
        colours[i][0] = (uint8_t)(200 + 50 * bump);
        colours[i][1] = (uint8_t)(120 + 60 * bump);
        colours[i][2] = 60;
    }
    desc.count = CLOUD_POINTS;
    desc.positions = (pbr_attribute){positions, 0, PBR_FORMAT_FLOAT32, 3};
    desc.normals = (pbr_attribute){normals, 0, PBR_FORMAT_FLOAT32, 3};
    desc.colours = (pbr_attribute){colours, 0, PBR_FORMAT_UINT8, 3};
    desc.flags = PBR_POINTS_ESTIMATE_RADII;
    return pbr_points_create(instance, &desc, out);
}

/* The guest's part of the frame. The host's scissor is the host's: what should clip libpbr is said in pbr_frame. */
static pbr_result draw_cloud(pbr_view *view, const pbr_points *points, const struct camera *camera) {
    pbr_frame frame = PBR_FRAME_INIT;
    pbr_item item = PBR_ITEM_INIT;
    pbr_light light = PBR_LIGHT_INIT;
    const double towards_light[3] = {0.4, 0.8, 0.5};
    memcpy(frame.view, camera->view, sizeof frame.view);
    memcpy(frame.projection, camera->projection, sizeof frame.projection);
    frame.flags = PBR_FRAME_SCISSOR;
    frame.scissor[0] = frame.scissor[1] = BORDER;
    frame.scissor[2] = WIDTH - 2 * BORDER;
    frame.scissor[3] = HEIGHT - 2 * BORDER;
    light.space = PBR_SPACE_WORLD;
    memcpy(light.vector, towards_light, sizeof light.vector);
    light.colour[0] = light.colour[1] = light.colour[2] = 1;
    frame.lights = &light;
    frame.light_count = 1;
    frame.ambient[0] = frame.ambient[1] = frame.ambient[2] = 1;
    item.points = points;
    return pbr_render(view, &frame, &item, 1, NULL);
}

/* What draw_ring() relies on, as one list of numbers. */
enum { RELIED_ON = 29 };
static void read_state(GLint state[RELIED_ON]) {
    static const GLenum integers[] = {GL_CURRENT_PROGRAM,
                                      GL_VERTEX_ARRAY_BINDING,
                                      GL_ARRAY_BUFFER_BINDING,
                                      GL_DRAW_FRAMEBUFFER_BINDING,
                                      GL_READ_FRAMEBUFFER_BINDING,
                                      GL_ACTIVE_TEXTURE,
                                      GL_TEXTURE_BINDING_2D,
                                      GL_SAMPLER_BINDING,
                                      GL_BLEND_SRC_RGB,
                                      GL_BLEND_DST_RGB,
                                      GL_DEPTH_FUNC,
                                      GL_CULL_FACE_MODE,
                                      GL_PRIMITIVE_RESTART_INDEX};
    static const GLenum switches[] = {GL_SCISSOR_TEST,      GL_DEPTH_TEST,       GL_CULL_FACE,   GL_BLEND,
                                      GL_PRIMITIVE_RESTART, GL_FRAMEBUFFER_SRGB, GL_MULTISAMPLE, GL_PROGRAM_POINT_SIZE};
    int count = 0;
    for (size_t i = 0; i < sizeof integers / sizeof integers[0]; i++) glGetIntegerv(integers[i], &state[count++]);
    for (size_t i = 0; i < sizeof switches / sizeof switches[0]; i++) state[count++] = glIsEnabled(switches[i]);
    glGetIntegerv(GL_VIEWPORT, &state[count]);
    glGetIntegerv(GL_SCISSOR_BOX, &state[count + 4]);
}

static int write_picture(const struct host *host, const char *path) {
    static uint8_t pixels[HEIGHT][WIDTH][3];
    FILE *file = fopen(path, "wb");
    if (!file) return 0;
    glDisable(GL_SCISSOR_TEST);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, host->resolved);
    glBlitFramebuffer(0, 0, WIDTH, HEIGHT, 0, 0, WIDTH, HEIGHT, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, host->resolved);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, WIDTH, HEIGHT, GL_RGB, GL_UNSIGNED_BYTE, pixels);
    fprintf(file, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
    for (int y = HEIGHT - 1; y >= 0; y--) fwrite(pixels[y], 1, sizeof pixels[y], file);
    int failed = ferror(file);
    return fclose(file) == 0 && !failed;
}

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    if (level <= PBR_LOG_WARNING) fprintf(stderr, "libpbr: %s (%s)\n", text, pbr_result_name(code));
}

/* One frame. NULL, or what went wrong. */
static const char *run(pbr_instance *instance, const char *path, int check) {
    struct host host = {0};
    struct camera camera;
    GLint before[RELIED_ON], after[RELIED_ON];
    pbr_points *points = NULL;
    pbr_renderer *renderer = NULL;
    pbr_view *view = NULL;
    const char *failure = NULL;

    if (!create_program(&host) || !create_framebuffers(&host)) return "the host's own program or framebuffer failed";
    create_texture(&host);
    create_meshes(&host);
    aim(&host, &camera);
    pbr_result result = create_cloud(instance, &points);
    if (result == PBR_OK) result = pbr_renderer_create(instance, NULL, &renderer);
    if (result == PBR_OK) result = pbr_view_create(renderer, NULL, &view);

    if (result == PBR_OK) {
        begin_frame(&host);
        draw_ground(&host);
        read_state(before);
        result = draw_cloud(view, points, &camera);
        read_state(after);
        draw_ring(&host);
        if (check && memcmp(before, after, sizeof before)) failure = "libpbr changed state that the host relies on";
        if (check && !failure && glGetError() != GL_NO_ERROR) failure = "a GL error was raised";
        if (!write_picture(&host, path) && !failure) failure = "cannot write the picture";
    }
    if (result != PBR_OK) failure = pbr_result_name(result);

    pbr_view_destroy(&view);
    pbr_renderer_destroy(&renderer);
    pbr_points_release(&points);
    return failure;
}

static EGLContext open_context(EGLDisplay *display) {
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
    *display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (*display == EGL_NO_DISPLAY || !eglInitialize(*display, NULL, NULL) || !eglBindAPI(EGL_OPENGL_API)) return EGL_NO_CONTEXT;
    EGLContext context = eglCreateContext(*display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, version);
    return context && eglMakeCurrent(*display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) ? context : EGL_NO_CONTEXT;
}

int main(int argc, char **argv) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = NULL;
    EGLDisplay display;
    int check = argc == 3 && !strcmp(argv[2], "--check");
    if (argc < 2 || (argc == 3 && !check) || argc > 3) {
        fprintf(stderr, "usage: %s PICTURE.ppm [--check]\n", argv[0]);
        return 2;
    }
    desc.log = print_message;
    const char *failure = open_context(&display) ? NULL : "no OpenGL 3.3 context without a window";
    if (!failure && pbr_instance_create(&desc, &instance) != PBR_OK) failure = "libpbr could not start";
    if (!failure) failure = run(instance, argv[1], check);
    if (failure) fprintf(stderr, "%s: %s\n", argv[0], failure);
    pbr_instance_destroy(&instance);
    if (display != EGL_NO_DISPLAY) eglTerminate(display);
    return failure ? EXIT_FAILURE : EXIT_SUCCESS;
}
