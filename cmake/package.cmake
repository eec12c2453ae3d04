# SPDX-License-Identifier: MIT
# What others find: find_package(servoscope) and pkg-config, with lib/ alone. Included by the root's CMakeLists.txt.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/servoscope)
install(TARGETS servoscope_core servoscope_msgen servoscope_frf servoscope_guard servoscope_lib EXPORT servoscope
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT servoscope NAMESPACE servoscope:: FILE servoscope-targets.cmake DESTINATION ${package_dir})

# A header that calls itself internal stays out.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/lib ${PROJECT_SOURCE_DIR}/lib/*.h)
foreach(header ${headers})
  file(STRINGS ${PROJECT_SOURCE_DIR}/lib/${header} internal REGEX "not for applications|not a header of its own" LIMIT_COUNT 1)
  if(NOT internal)
    get_filename_component(folder ${header} DIRECTORY)
    install(FILES ${PROJECT_SOURCE_DIR}/lib/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/servoscope/${folder})
  endif()
endforeach()

set(package_build ${PROJECT_BINARY_DIR}/package)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/servoscope-config.cmake.in ${package_build}/servoscope-config.cmake
  INSTALL_DESTINATION ${package_dir})
# While the first number is 0, a new second number may change interfaces.
write_basic_package_version_file(${package_build}/servoscope-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${package_build}/servoscope-config.cmake ${package_build}/servoscope-config-version.cmake
  DESTINATION ${package_dir})

# From where the file lies, so that an installed tree can be moved.
file(RELATIVE_PATH package_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(${PROJECT_SOURCE_DIR}/cmake/servoscope.pc.in ${package_build}/servoscope.pc @ONLY)
install(FILES ${package_build}/servoscope.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
