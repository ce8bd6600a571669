/* The host that the snippets of the documentation are parts of: `check snippets` puts each fragment into a function of its own
 * behind this header. A fragment may use what is declared here, and functions that the same document defined before.
 * SPDX-License-Identifier: MIT */
#ifndef HOST_H
#define HOST_H

#include <epoxy/gl.h> /* before EGL's headers, which define the same basic types */

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <math.h>
#include <pbr/image.h>
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <pbr/support.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* All made for the first fragment of a document, and NULL for one that begins with making them itself. What a document leaves is
 * destroyed after its last fragment; a fragment whose own objects are left makes that fail. */
extern pbr_instance *instance;
extern pbr_points *points; /* three, without colours, within a unit of the origin */
extern pbr_renderer *renderer;
extern pbr_view *view;
extern double world_to_eye[16]; /* the eye stands a few units before the points */
extern int width, height;       /* of the framebuffer, pixels */
extern GLuint framebuffer;      /* 8-bit RGBA and 32-bit depth; bound, viewport and all */

struct snippet {
    const char *place; /* "docs/embedding.md:12"; NULL ends the list */
    void (*run)(void);
};
extern const struct snippet snippets[];
extern const int snippets_make_instance; /* the document calls pbr_instance_create */

#endif
