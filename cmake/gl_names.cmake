# Writes a C header that lists the OpenGL functions of the baseline versions, from the Khronos headers: what the GL tests let through when
# they pretend to be a context of exactly OpenGL 3.3 or OpenGL ES 3.0. SPDX-License-Identifier: MIT
#
# In CMakeLists.txt:
#   find_path(PBR_GL_HEADERS GL/glcorearb.h REQUIRED)
#   find_path(PBR_GLES_HEADERS GLES3/gl3.h REQUIRED)
#   set(PBR_GL_NAMES_H ${CMAKE_CURRENT_BINARY_DIR}/generated/gl_names.h)
#   add_custom_command(OUTPUT ${PBR_GL_NAMES_H}
#     COMMAND ${CMAKE_COMMAND} -DOUTPUT=${PBR_GL_NAMES_H} -DCORE=${PBR_GL_HEADERS}/GL/glcorearb.h -DCOMPATIBILITY=${PBR_GL_HEADERS}/GL/gl.h
#       -DES=${PBR_GLES_HEADERS}/GLES3/gl3.h -P ${CMAKE_CURRENT_SOURCE_DIR}/cmake/gl_names.cmake
#     DEPENDS cmake/gl_names.cmake VERBATIM)
cmake_minimum_required(VERSION 3.21)
cmake_policy(SET CMP0007 NEW)

# Adds the functions that `file` declares to the list `names`; with `newest`, only those in sections GL_VERSION_x_y up to it.
macro(collect names file newest)
  file(STRINGS ${file} lines REGEX "^(#ifndef GL_|GLAPI |GL_APICALL )")
  set(in_section TRUE)
  foreach(line IN LISTS lines)
    if(line MATCHES "^#ifndef GL_VERSION_([0-9])_([0-9])")
      set(version "${CMAKE_MATCH_1}.${CMAKE_MATCH_2}")
      if("${newest}" STREQUAL "" OR NOT version VERSION_GREATER "${newest}")
        set(in_section TRUE)
      else()
        set(in_section FALSE)
      endif()
    elseif(line MATCHES "^#ifndef GL_")
      if(NOT "${newest}" STREQUAL "")
        set(in_section FALSE) # an extension's section
      endif()
    elseif(in_section AND line MATCHES "(gl[A-Z][A-Za-z0-9_]*) *\\(" AND NOT CMAKE_MATCH_1 MATCHES "(ARB|EXT|MESA)$")
      string(REGEX MATCH "gl[A-Z][A-Za-z0-9_]*" name "${line}")
      list(APPEND ${names} ${name})
    endif()
  endforeach()
endmacro()

# A sorted array of the names, and NULL: the tests search it by halves.
function(append_array output array names)
  list(REMOVE_DUPLICATES names)
  list(SORT names COMPARE STRING CASE SENSITIVE)
  list(LENGTH names count)
  if(count LESS 200)
    message(FATAL_ERROR "found only ${count} functions for ${array}: have the headers changed their layout?")
  endif()
  list(TRANSFORM names REPLACE "(.+)" "    \"\\1\",")
  list(JOIN names "\n" body)
  set(${output} "${${output}}static const char *const ${array}[] = {\n${body}\n};\n" PARENT_SCOPE)
endfunction()

set(core)
collect(core ${CORE} 3.3)
set(compatibility ${core})
collect(compatibility ${COMPATIBILITY} "")
set(es)
collect(es ${ES} "")

set(text "/* Made by gl_names.cmake from the system's OpenGL headers. */\n")
append_array(text core_33_names "${core}")
append_array(text compatibility_33_names "${compatibility}")
append_array(text es_30_names "${es}")
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "${text}" @ONLY)
