#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A firmware project takes lib/ in by add_subdirectory: C only, no other library, none of our targets beyond the library's.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat >"$folder/CMakeLists.txt" <<END
cmake_minimum_required(VERSION 3.22)
project(consumer LANGUAGES C)
set(CMAKE_DISABLE_FIND_PACKAGE_ZLIB ON)
add_subdirectory($SERVOSCOPE_SOURCE servoscope)
add_executable(consumer main.c)
target_compile_options(consumer PRIVATE -Wall -Wextra -Wpedantic -Werror)
target_link_libraries(consumer PRIVATE servoscope::lib)
END
cat >"$folder/main.c" <<'END'
#include "core/crc32.h"
#include "frf/dft.h"
#include "guard/guard.h"
#include "msgen/player.h"

int main(void)
{
    return 0;
}
END
cmake -S "$folder" -B "$folder/build" -G Ninja >"$folder/log" 2>&1 || {
    cat "$folder/log" >&2
    exit 1
}
cmake --build "$folder/build" >"$folder/log" 2>&1 || {
    cat "$folder/log" >&2
    exit 1
}
"$folder/build/consumer"
if ls "$folder"/build/servoscope/libservoscope_sim* 2>/dev/null; then
    echo "expected the host side to stay out of a consumer's build" >&2
    exit 1
fi
