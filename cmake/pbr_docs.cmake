# The manual as pages, out of the headers and the guides, in docs/html of the build folder: the target docs, where there is Doxygen.
# SPDX-License-Identifier: MIT
find_program(PBR_DOXYGEN doxygen DOC "Makes the manual's pages")
if(PBR_DOXYGEN)
    configure_file(docs/Doxyfile.in ${PROJECT_BINARY_DIR}/Doxyfile @ONLY)
    add_custom_target(docs
        COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/docs
        COMMAND ${PBR_DOXYGEN} ${PROJECT_BINARY_DIR}/Doxyfile
        WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
        COMMENT "Making docs/html/index.html"
        VERBATIM)
endif()
