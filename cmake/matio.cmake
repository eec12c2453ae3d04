# SPDX-License-Identifier: MIT
# MATLAB files: which files of lab/record/matio are built. The library itself is loaded by name when the first such file is asked
# for, so only its header and that name are needed here: matio_files, matio_library ("" without it), MATIO_INCLUDE_DIRS.
set(SERVOSCOPE_MATIO AUTO CACHE STRING "MATLAB files through matio: ON, OFF or AUTO (where it is found)")
set_property(CACHE SERVOSCOPE_MATIO PROPERTY STRINGS AUTO ON OFF)

set(matio_library "")
if(SERVOSCOPE_MATIO STREQUAL "ON")
  pkg_check_modules(MATIO REQUIRED matio)
elseif(NOT SERVOSCOPE_MATIO STREQUAL "OFF")
  pkg_check_modules(MATIO QUIET matio)
endif()
if(MATIO_FOUND AND NOT SERVOSCOPE_MATIO STREQUAL "OFF")
  # The name with its ABI number (libmatio.so.11): the one without is only there where its headers are.
  find_library(MATIO_FILE matio HINTS ${MATIO_LIBRARY_DIRS})
  get_filename_component(matio_real "${MATIO_FILE}" REALPATH)
  get_filename_component(matio_library "${matio_real}" NAME)
  string(REGEX REPLACE "(\\.so\\.[0-9]+).*" "\\1" matio_library "${matio_library}")
endif()

set(matio_files ${PROJECT_SOURCE_DIR}/lab/record/matio/mat_absent.c)
if(matio_library)
  file(GLOB matio_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/lab/record/matio/*.c)
  list(FILTER matio_files EXCLUDE REGEX mat_absent)
endif()
message(STATUS "MATLAB files: ${matio_library}")
