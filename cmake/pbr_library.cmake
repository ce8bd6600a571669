# pbr_library(NAME SOURCES file... [PUBLIC library...] PRIVATE library...): the library NAME, shared or static by
# BUILD_SHARED_LIBS; from the same objects NAME-static, and NAME-testing, which tests link since the others hide what they reach for.
# SPDX-License-Identifier: MIT

find_program(PBR_OBJCOPY NAMES objcopy llvm-objcopy REQUIRED DOC "Hides the static libraries' internal names")

# Objects of a static library share their names with the whole program. All of them become one, in which only pbr_* is left.
function(pbr_merge_objects name)
    set(merged ${PROJECT_BINARY_DIR}/${name}-merged.o)
    add_custom_command(OUTPUT ${merged}
        COMMAND ${CMAKE_C_COMPILER} -r -nostdlib -o ${merged} $<TARGET_OBJECTS:${name}-objects>
        COMMAND ${PBR_OBJCOPY} --wildcard "--keep-global-symbol=pbr_*" ${merged}
        DEPENDS ${name}-objects $<TARGET_OBJECTS:${name}-objects>
        COMMAND_EXPAND_LISTS VERBATIM)
    set(${name}_merged ${merged} PARENT_SCOPE)
endfunction()

# One of the libraries, from the objects compiled by pbr_library.
function(pbr_link_library target name kind)
    if(kind STREQUAL "STATIC")
        pbr_merge_objects(${name})
        add_library(${target} STATIC ${${name}_merged})
        set_source_files_properties(${${name}_merged} PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
    else()
        add_library(${target} ${kind} $<TARGET_OBJECTS:${name}-objects>)
    endif()
    set_target_properties(${target} PROPERTIES
        OUTPUT_NAME ${name}
        VERSION ${PROJECT_VERSION}
        SOVERSION 0 # of the binary interface, see docs/abi.md; not the release's number
        LINKER_LANGUAGE C)
    target_include_directories(${target} PUBLIC
        $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
endfunction()

function(pbr_library name)
    cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})

    add_library(${name}-objects OBJECT ${arg_SOURCES})
    set_target_properties(${name}-objects PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_include_directories(${name}-objects PRIVATE ${PROJECT_SOURCE_DIR}/include ${PROJECT_SOURCE_DIR}/src)
    target_link_libraries(${name}-objects PRIVATE pbr_options ${arg_PRIVATE})

    if(BUILD_SHARED_LIBS)
        pbr_link_library(${name} ${name} SHARED)
        set(map ${PROJECT_SOURCE_DIR}/cmake/${name}.map)
        target_link_options(${name} PRIVATE -Wl,--version-script=${map})
        # Clang leaves the sanitizers' own functions to the program.
        if(NOT (CMAKE_C_COMPILER_ID MATCHES Clang AND CMAKE_C_FLAGS MATCHES -fsanitize))
            target_link_options(${name} PRIVATE -Wl,--no-undefined)
        endif()
        set_target_properties(${name} PROPERTIES LINK_DEPENDS ${map})
        target_link_libraries(${name} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})

        pbr_link_library(${name}-static ${name} STATIC)
        list(TRANSFORM arg_PUBLIC APPEND -static)
        target_link_libraries(${name}-static PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
        if(NOT PBR_INSTALL_STATIC)
            set_target_properties(${name}-static PROPERTIES EXCLUDE_FROM_ALL ON)
        endif()
    else()
        # Nothing is shown to others, also not by a plug-in that links the library.
        target_compile_definitions(${name}-objects PRIVATE PBR_STATIC)
        pbr_link_library(${name} ${name} STATIC)
        target_compile_definitions(${name} PUBLIC PBR_STATIC)
        target_link_libraries(${name} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
        add_library(${name}-static ALIAS ${name})
    endif()

    if(PBR_BUILD_TESTS)
        add_library(${name}-testing STATIC $<TARGET_OBJECTS:${name}-objects>)
        set_target_properties(${name}-testing PROPERTIES LINKER_LANGUAGE C)
        target_include_directories(${name}-testing PUBLIC ${PROJECT_SOURCE_DIR}/include)
        list(TRANSFORM arg_PUBLIC REPLACE "^(pbr(-io)?)(-static)?$" "\\1-testing")
        target_link_libraries(${name}-testing PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
    endif()

    string(REPLACE "pbr-" "" short ${name})
    add_library(pbr::${short} ALIAS ${name})
    set_target_properties(${name} PROPERTIES EXPORT_NAME ${short})
    if(BUILD_SHARED_LIBS)
        add_library(pbr::${short}-static ALIAS ${name}-static)
        set_target_properties(${name}-static PROPERTIES EXPORT_NAME ${short}-static)
    endif()
endfunction()
