# SPDX-License-Identifier: MIT
# The host side: everything above lib/. Included by the root's CMakeLists.txt, so that paths and scope are the root's.
enable_language(CXX)
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)

find_package(ZLIB REQUIRED)
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(CJSON REQUIRED IMPORTED_TARGET libcjson)
pkg_check_modules(LAPACKE REQUIRED IMPORTED_TARGET lapacke)
pkg_check_modules(OPENBLAS REQUIRED IMPORTED_TARGET openblas)
pkg_check_modules(MODBUS REQUIRED IMPORTED_TARGET libmodbus)

servoscope_room(drivers drivers LINKS servoscope_lib)
file(GLOB profile_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/drivers/can/profiles/*.c)
servoscope_registry(${PROJECT_BINARY_DIR}/generated/profiles.c "struct cia402_profile" cia402_profile_ cia402_profiles
  "drivers/can/cia402_profile.h" ${profile_files})
servoscope_room(can drivers/can EXTRA ${profile_files} ${PROJECT_BINARY_DIR}/generated/profiles.c
  LINKS servoscope_drivers servoscope_lib)
servoscope_room(modbus drivers/modbus LINKS servoscope_drivers servoscope_lib)
servoscope_room(ports ports LINKS servoscope_can servoscope_modbus PkgConfig::MODBUS)

file(GLOB effect_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/sim/effects/*.c)
servoscope_registry(${PROJECT_BINARY_DIR}/generated/effects.c "struct sim_effect" sim_effect_ sim_effects "sim/effect.h"
  ${effect_files})
servoscope_room(sim sim EXTRA ${effect_files} ${PROJECT_BINARY_DIR}/generated/effects.c LINKS servoscope_core m)
servoscope_room(node sim/node LINKS servoscope_sim servoscope_can servoscope_modbus servoscope_lib)

servoscope_room(page lab/page LINKS m)
servoscope_room(numeric lab/numeric EXTRA ${PROJECT_SOURCE_DIR}/lab/numeric/fft.cpp
  ${PROJECT_SOURCE_DIR}/lab/numeric/fft_portable.cpp ${PROJECT_SOURCE_DIR}/lab/numeric/fft_avx2.cpp
  LINKS PkgConfig::LAPACKE PkgConfig::OPENBLAS m)
# The innermost loops of a transform are nine tenths of every design's time, and twenty times slower without inlining and
# with every access checked; tests/unit/test_fft.c guards the borders of their buffers.
set_source_files_properties(lab/numeric/fft_portable.cpp lab/numeric/fft_avx2.cpp
  PROPERTIES COMPILE_OPTIONS "-O3;-fno-sanitize=all")

file(GLOB format_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/lab/record/format_*.c)
servoscope_registry(${PROJECT_BINARY_DIR}/generated/formats.c "struct record_format" record_ record_formats
  "lab/record/format.h" ${format_files})
include(cmake/matio.cmake)
servoscope_room(record lab/record EXTRA ${PROJECT_BINARY_DIR}/generated/formats.c ${matio_files}
  LINKS servoscope_sim servoscope_lib servoscope_page PkgConfig::CJSON ZLIB::ZLIB m ${CMAKE_DL_LIBS})
if(matio_library)
  target_include_directories(servoscope_record SYSTEM PRIVATE ${MATIO_INCLUDE_DIRS})
  target_compile_definitions(servoscope_record PRIVATE SERVOSCOPE_MATIO_LIBRARY="${matio_library}")
endif()
servoscope_room(measure lab/measure
  LINKS servoscope_record servoscope_drivers servoscope_lib servoscope_page servoscope_numeric)
servoscope_room(estimate lab/estimate LINKS servoscope_numeric servoscope_record servoscope_page)
servoscope_room(design lab/design
  LINKS servoscope_numeric servoscope_record servoscope_sim servoscope_page Threads::Threads)
servoscope_room(diagnose lab/diagnose
  LINKS servoscope_sim servoscope_estimate servoscope_numeric servoscope_record servoscope_page)
servoscope_room(experiment lab/experiment LINKS servoscope_design servoscope_diagnose servoscope_numeric servoscope_page)
servoscope_room(tune lab/tune LINKS servoscope_estimate servoscope_numeric servoscope_record servoscope_page)

file(GLOB command_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tools/servoscope/cmd_*.c)
file(GLOB tool_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tools/servoscope/*.c)
servoscope_registry(${PROJECT_BINARY_DIR}/generated/commands.c "struct command" command_ commands
  "tools/servoscope/command.h" ${command_files})
add_executable(servoscope ${tool_files} ${PROJECT_BINARY_DIR}/generated/commands.c)
get_property(rooms GLOBAL PROPERTY servoscope_rooms)
target_include_directories(servoscope PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/lib)
target_compile_definitions(servoscope PRIVATE SERVOSCOPE_VERSION="${PROJECT_VERSION}")
target_link_libraries(servoscope PRIVATE ${rooms} Threads::Threads servoscope_warnings servoscope_host)
set_target_properties(servoscope PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
if(matio_library)
  target_compile_definitions(servoscope PRIVATE SERVOSCOPE_MATIO_LIBRARY="${matio_library}")
endif()
install(TARGETS servoscope)
include(cmake/manuals.cmake)
