# Writes OUTPUT, a C file that holds the shader files INPUTS (a list) as the table that src/gl/shaders.h declares.
# SPDX-License-Identifier: MIT
#
#   cmake -DOUTPUT=shaders.c "-DINPUTS=a.vert;b.frag" -P embed_shaders.cmake
#
# The text is read as hexadecimal, since CMake's lists and strings give ; [ ] \ and " meanings of their own, and written as
# characters, since a compiler need not take string literals longer than 4095 bytes.

set(texts "")
set(table "")
set(count 0)
foreach(input IN LISTS INPUTS)
    get_filename_component(name "${input}" NAME)
    file(READ "${input}" bytes HEX)
    string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${bytes}")
    string(REPLACE "'\\x0a'," "'\\n',\n    " bytes "${bytes}") # one line of C for each line of GLSL
    string(APPEND texts "static const char text_${count}[] = { /* ${name} */\n    ${bytes}0};\n\n")
    string(APPEND table "    {\"${name}\", text_${count}},\n")
    math(EXPR count "${count} + 1")
endforeach()

file(WRITE "${OUTPUT}" "/* The files of src/gl/shaders, written by cmake/embed_shaders.cmake. */
#include \"gl/shaders.h\"

${texts}const struct shader_file shader_files[] = {
${table}};

const size_t shader_file_count = ${count};
")
