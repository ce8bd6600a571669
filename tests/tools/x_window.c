/* What a window manager does to a window, and what stands in it; xdotool does the rest.
 *
 *     x_window close WINDOW               asks it to close, as its title bar's button does
 *     x_window iconify|restore WINDOW     tells it that it is an icon, or no longer
 *     x_window picture WINDOW FILE.png    what it shows
 *     x_window scale FACTOR               the scale of the screen for windows that open later
 *
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <pbr/image.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <X11/Xutil.h>

static int fail(const char *what) {
    fprintf(stderr, "x_window: %s\n", what);
    return EXIT_FAILURE;
}

static int close_window(Display *display, Window window) {
    XEvent event = {.xclient = {.type = ClientMessage, .window = window, .format = 32}};
    event.xclient.message_type = XInternAtom(display, "WM_PROTOCOLS", False);
    event.xclient.data.l[0] = (long)XInternAtom(display, "WM_DELETE_WINDOW", False);
    event.xclient.data.l[1] = CurrentTime;
    return XSendEvent(display, window, False, NoEventMask, &event) ? EXIT_SUCCESS : fail("no event can be sent");
}

/* ICCCM 4.1.3.1: the window manager's own property. */
static int set_state(Display *display, Window window, long state) {
    const long values[2] = {state, None};
    Atom name = XInternAtom(display, "WM_STATE", False);
    XChangeProperty(display, window, name, name, 32, PropModeReplace, (const unsigned char *)values, 2);
    return EXIT_SUCCESS;
}

static float linear_from_srgb(float c) {
    return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}

static int write_picture(Display *display, Window window, const char *path) {
    XWindowAttributes attributes;
    pbr_instance *instance = NULL;
    pbr_image image = PBR_IMAGE_INIT;
    if (!XGetWindowAttributes(display, window, &attributes)) return fail("no such window");
    const uint32_t width = (uint32_t)attributes.width, height = (uint32_t)attributes.height;
    XImage *pixels = XGetImage(display, window, 0, 0, width, height, AllPlanes, ZPixmap);
    if (!pixels || pixels->red_mask != 0xff0000 || pixels->green_mask != 0xff00 || pixels->blue_mask != 0xff)
        return fail("no picture of 8 bits a channel");
    if (pbr_instance_create(NULL, &instance) || pbr_image_create(instance, width, height, 0, &image)) return fail("no memory");
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            unsigned long pixel = XGetPixel(pixels, (int)x, (int)y);
            float *rgba = image.rgba + 4 * ((size_t)y * width + x);
            for (int k = 0; k < 3; k++) rgba[k] = linear_from_srgb((float)(pixel >> (16 - 8 * k) & 0xff) / 255);
            rgba[3] = 1;
        }
    int status = pbr_image_write(instance, &image, path) == PBR_OK ? EXIT_SUCCESS : fail("the picture cannot be written");
    XDestroyImage(pixels);
    pbr_image_destroy(instance, &image);
    pbr_instance_destroy(&instance);
    return status;
}

/* As a desktop's settings say it to all programs. */
static int set_scale(Display *display, double scale) {
    char text[64];
    int length = snprintf(text, sizeof text, "Xft.dpi:\t%.0f\n", 96 * scale);
    XChangeProperty(display, DefaultRootWindow(display), XA_RESOURCE_MANAGER, XA_STRING, 8, PropModeReplace,
                    (const unsigned char *)text, length);
    return EXIT_SUCCESS;
}

static int run(Display *display, int argc, char **argv) {
    Window window = argc > 2 ? strtoul(argv[2], NULL, 0) : None;
    if (argc == 3 && !strcmp(argv[1], "close")) return close_window(display, window);
    if (argc == 3 && !strcmp(argv[1], "iconify")) return set_state(display, window, IconicState);
    if (argc == 3 && !strcmp(argv[1], "restore")) return set_state(display, window, NormalState);
    if (argc == 4 && !strcmp(argv[1], "picture")) return write_picture(display, window, argv[3]);
    if (argc == 3 && !strcmp(argv[1], "scale")) return set_scale(display, atof(argv[2]));
    return fail("what?");
}

int main(int argc, char **argv) {
    Display *display = XOpenDisplay(NULL);
    if (!display) return fail("no display");
    int status = run(display, argc, argv);
    XSync(display, False);
    XCloseDisplay(display);
    return status;
}
