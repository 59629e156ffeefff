# Installs the library (shared and static), its headers, the command, a pkg-config file and a CMake package.
install(TARGETS riffle_shared EXPORT riffleTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
        INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(TARGETS riffle_static EXPORT riffleStaticTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
set_target_properties(riffle_shared PROPERTIES EXPORT_NAME riffle)
if(TARGET riffle)
  install(TARGETS riffle RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
install(DIRECTORY include/riffle DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")

# find_package(riffle) brings riffle::riffle, the shared library, which needs nothing else;
# find_package(riffle COMPONENTS static) also riffle::riffle_static with all it is linked to.
set(RIFFLE_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/riffle)
install(EXPORT riffleTargets NAMESPACE riffle:: DESTINATION ${RIFFLE_CMAKE_DIR})
install(EXPORT riffleStaticTargets NAMESPACE riffle:: DESTINATION ${RIFFLE_CMAKE_DIR})
configure_package_config_file(cmake/riffleConfig.cmake.in ${CMAKE_BINARY_DIR}/riffleConfig.cmake
                              INSTALL_DESTINATION ${RIFFLE_CMAKE_DIR} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/riffleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/riffleConfig.cmake ${CMAKE_BINARY_DIR}/riffleConfigVersion.cmake
        DESTINATION ${RIFFLE_CMAKE_DIR})

set(RIFFLE_PC_REQUIRES "zlib libpng libjpeg expat OpenEXR kissfft-float")
if(NETCDF_FOUND)
  string(APPEND RIFFLE_PC_REQUIRES " netcdf")
endif()
# The prefix is given from where the file lies, so that the installed tree can be moved.
file(RELATIVE_PATH RIFFLE_PC_PREFIX /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" RIFFLE_PC_PREFIX "${RIFFLE_PC_PREFIX}")
configure_file(cmake/riffle.pc.in ${CMAKE_BINARY_DIR}/riffle.pc @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/riffle.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

if(BUILD_TESTING)
  set(install_tests ${CMAKE_SOURCE_DIR}/tests/install)
  add_test(NAME the_library_exports_what_its_headers_declare
           COMMAND bash ${install_tests}/check_symbols.sh ${CMAKE_SOURCE_DIR} $<TARGET_FILE:riffle_shared>
                   $<TARGET_FILE:riffle_static>)
  # A program without sanitizers cannot load a library with them.
  if(NOT RIFFLE_SANITIZE)
    foreach(way pkg_config find_package static)
      add_test(NAME a_program_builds_against_the_installed_library_by_${way}
               COMMAND bash ${install_tests}/check_install.sh ${way} ${CMAKE_BINARY_DIR} ${install_tests}
                       ${CMAKE_C_COMPILER})
      # Each of them writes the build folder's install_manifest.txt.
      set_tests_properties(a_program_builds_against_the_installed_library_by_${way} PROPERTIES RESOURCE_LOCK install)
    endforeach()
  endif()
endif()
