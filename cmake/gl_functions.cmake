# Writes a C header that lists the functions of OpenGL's versions with their parameters, from the Khronos header: what bench_trees puts
# between libpbr and the driver.
#
#   cmake -DOUTPUT=gl_functions.h -DCORE=.../GL/glcorearb.h -P gl_functions.cmake
#
# Each line is one of
#   WORK(name, (parameters), (arguments))            draws, computes or copies; returns nothing
#   STATE(name, (parameters), (arguments))           returns nothing either
#   ASKS(name, (parameters), (arguments))            writes what it tells to where a pointer says
#   RETURNS(type, name, (parameters), (arguments))
# SPDX-License-Identifier: MIT
cmake_minimum_required(VERSION 3.21)
cmake_policy(SET CMP0007 NEW)

set(work "^((Multi)?Draw(Arrays|Elements|RangeElements|TransformFeedback)|Clear$|Clear(Named)?(Buffer|Framebuffer|Tex)|Dispatch|Blit|Copy|Tex(Sub)?Image|(Named)?Buffer(Sub)?Data)")
set(asks "^(Get|Gen|Create|Read)")
file(STRINGS ${CORE} lines REGEX "^(#ifndef GL_|GLAPI )")
set(in_version FALSE)
set(text "/* Made by gl_functions.cmake from the system's OpenGL header. */\n")
set(count 0)
foreach(line IN LISTS lines)
    if(line MATCHES "^#ifndef GL_VERSION_[0-9]")
        set(in_version TRUE)
    elseif(line MATCHES "^#ifndef GL_")
        set(in_version FALSE) # an extension's
    elseif(in_version AND line MATCHES "^GLAPI (.*)APIENTRY gl([A-Za-z0-9_]+) \\((.*)\\)")
        string(STRIP "${CMAKE_MATCH_1}" type)
        set(name ${CMAKE_MATCH_2})
        set(parameters "${CMAKE_MATCH_3}")
        set(arguments)
        if(NOT parameters STREQUAL "void")
            string(REPLACE "," ";" arguments "${parameters}")
            list(TRANSFORM arguments REPLACE ".*[ *]([A-Za-z0-9_]+)$" "\\1")
        endif()
        list(JOIN arguments ", " arguments)
        if(NOT type STREQUAL "void")
            string(APPEND text "RETURNS(${type}, ${name}, (${parameters}), (${arguments}))\n")
        elseif(name MATCHES "${asks}")
            string(APPEND text "ASKS(${name}, (${parameters}), (${arguments}))\n")
        elseif(name MATCHES "${work}")
            string(APPEND text "WORK(${name}, (${parameters}), (${arguments}))\n")
        else()
            string(APPEND text "STATE(${name}, (${parameters}), (${arguments}))\n")
        endif()
        math(EXPR count "${count} + 1")
    endif()
endforeach()
if(count LESS 500)
    message(FATAL_ERROR "found only ${count} functions: has the header changed its layout?")
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "${text}" @ONLY)
