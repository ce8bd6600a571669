# Writes OUTPUT, a C file that holds the bytes of INPUT as `const unsigned char NAME[]` and their count as `const size_t NAME_size`.
# SPDX-License-Identifier: MIT
#
#   cmake -DOUTPUT=font.c -DINPUT=font.ttf -DNAME=font -P embed_file.cmake

get_filename_component(name "${INPUT}" NAME)
file(READ "${INPUT}" bytes HEX)
string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
file(WRITE "${OUTPUT}" "/* The bytes of ${name}, written by cmake/embed_file.cmake. */
#include <stddef.h>

extern const unsigned char ${NAME}[];
extern const size_t ${NAME}_size;

const unsigned char ${NAME}[] = {${bytes}};
const size_t ${NAME}_size = sizeof ${NAME};
")
