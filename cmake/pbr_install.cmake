# What `cmake --install` puts where. Everything may be moved afterwards as a whole.
# SPDX-License-Identifier: MIT
include(CMakePackageConfigHelpers)

set(libraries pbr)
if(TARGET pbr-io)
    list(APPEND libraries pbr-io)
endif()
set(PBR_HAS_STATIC TRUE)
if(BUILD_SHARED_LIBS)
    set(PBR_HAS_STATIC ${PBR_INSTALL_STATIC})
    if(PBR_INSTALL_STATIC)
        foreach(library IN LISTS libraries)
            list(APPEND static_libraries ${library}-static)
        endforeach()
    endif()
endif()
install(TARGETS ${libraries} ${static_libraries} EXPORT pbrTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/pbr DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN *.h)

if(TARGET pbr-tool)
    # The command finds the libraries beside it wherever the prefix is moved.
    file(RELATIVE_PATH from_bin_to_lib ${CMAKE_INSTALL_FULL_BINDIR} ${CMAKE_INSTALL_FULL_LIBDIR})
    set_target_properties(pbr-tool PROPERTIES INSTALL_RPATH "$ORIGIN/${from_bin_to_lib}")
    install(TARGETS pbr-tool RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
    install(FILES docs/pbr.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
    install(FILES completions/pbr.bash DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/bash-completion/completions RENAME pbr)
endif()

# libpbr-io finds libpbr beside it.
if(TARGET pbr-io AND BUILD_SHARED_LIBS)
    set_target_properties(pbr-io PROPERTIES INSTALL_RPATH "$ORIGIN")
endif()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/pbr)
configure_package_config_file(cmake/pbrConfig.cmake.in ${PROJECT_BINARY_DIR}/pbrConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/pbrConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/pbrConfig.cmake ${PROJECT_BINARY_DIR}/pbrConfigVersion.cmake DESTINATION ${package_dir})
install(EXPORT pbrTargets NAMESPACE pbr:: DESTINATION ${package_dir})

# pkg-config: what a shared library hides from its users, a static one leaves to them.
file(RELATIVE_PATH PBR_PC_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" PBR_PC_PREFIX "${PBR_PC_PREFIX}")
if(BUILD_SHARED_LIBS)
    set(PBR_PC_REQUIRES Requires.private)
else()
    set(PBR_PC_REQUIRES Requires)
    set(PBR_PC_CFLAGS " -DPBR_STATIC")
    set(PBR_PC_LIBS " -pthread -lm")
    set(PBR_PC_IO_LIBS " -lOpenEXRCore -lm")
endif()
if(PBR_HAS_JPEG)
    set(PBR_PC_JPEG ", libjpeg")
endif()
foreach(library IN LISTS libraries)
    configure_file(pkgconfig/${library}.pc.in ${PROJECT_BINARY_DIR}/${library}.pc @ONLY)
    install(FILES ${PROJECT_BINARY_DIR}/${library}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endforeach()
