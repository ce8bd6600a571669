/* The texts of src/gl/shaders, embedded at build time by cmake/embed_shaders.cmake. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_SHADERS_H
#define PBR_GL_SHADERS_H

#include <stddef.h>

struct shader_file {
    const char *name; /* "splat.vert" */
    const char *text; /* NUL-terminated */
};

extern const struct shader_file shader_files[];
extern const size_t shader_file_count;

#endif
