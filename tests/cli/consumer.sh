#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A firmware project takes lib/ in by add_subdirectory, find_package, pkg-config, a copied pair of files, as a Zephyr module or by
# PlatformIO: C only, no other library, and the same program runs with each.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
source=$SERVOSCOPE_SOURCE
program=$source/tests/support/consumer.c
warnings=(-Wall -Wextra -Wpedantic -Wshadow -Wundef -Wconversion -Wsign-conversion -Werror)
strict=("${warnings[@]}" -Wstrict-prototypes -Wmissing-prototypes)

quietly() {
    "$@" >"$folder/log" 2>&1 || {
        cat "$folder/log" >&2
        echo "FAILED: $*" >&2
        exit 1
    }
}

project() { # project NAME: the CMakeLists.txt of a consumer, which follows on standard input
    mkdir -p "$folder/$1"
    {
        printf 'cmake_minimum_required(VERSION 3.22)\nproject(consumer LANGUAGES C)\n'
        cat
        printf 'add_executable(consumer %s)\ntarget_link_libraries(consumer PRIVATE servoscope::lib)\n' "$program"
        printf 'target_compile_options(consumer PRIVATE -Wall -Wextra -Wpedantic -Werror)\n'
    } >"$folder/$1/CMakeLists.txt"
    quietly cmake -S "$folder/$1" -B "$folder/$1/build" -G Ninja "-DCMAKE_PREFIX_PATH=$folder/moved"
    quietly cmake --build "$folder/$1/build"
    "$folder/$1/build/consumer"
}

# add_subdirectory: nothing of ours is left in the consumer's project but targets of our name.
project subdirectory <<END
set(CMAKE_DISABLE_FIND_PACKAGE_ZLIB ON)
set(flags_before "\${CMAKE_C_FLAGS}")
add_subdirectory($source servoscope)
get_directory_property(options COMPILE_OPTIONS)
get_directory_property(definitions COMPILE_DEFINITIONS)
get_property(tests GLOBAL PROPERTY CTEST_TARGETS_ADDED)
if(options OR definitions OR tests OR CMAKE_C_STANDARD OR CMAKE_EXPORT_COMPILE_COMMANDS
   OR NOT flags_before STREQUAL CMAKE_C_FLAGS OR DEFINED CACHE{BUILD_TESTING})
  message(FATAL_ERROR "servoscope has left options, definitions, a standard or tests in its user's project")
endif()
get_directory_property(targets DIRECTORY $source BUILDSYSTEM_TARGETS)
foreach(target \${targets})
  if(NOT target MATCHES "^servoscope_")
    message(FATAL_ERROR "target \${target}: expected a name that begins with servoscope_")
  endif()
endforeach()
END
if ls "$folder"/subdirectory/build/servoscope/libservoscope_sim* 2>/dev/null; then
    echo "expected the host side to stay out of a consumer's build" >&2
    exit 1
fi
quietly cmake --install "$folder/subdirectory/build" --prefix "$folder/nothing"
if [ -e "$folder/nothing" ]; then
    echo "expected nothing of servoscope to be installed with its user" >&2
    exit 1
fi

# find_package and pkg-config, of an installed tree that was moved.
quietly cmake -S "$source" -B "$folder/library" -G Ninja -DSERVOSCOPE_HOST=OFF -DCMAKE_INSTALL_PREFIX="$folder/installed"
quietly cmake --build "$folder/library" --target install
mv "$folder/installed" "$folder/moved"
project package <<'END'
find_package(servoscope 0.1 REQUIRED)
END
for header in frf/kernel.h frf/dft_integer.h guard/latch.h; do
    if [ -e "$folder/moved/include/servoscope/$header" ]; then
        echo "expected the internal header $header not to be installed" >&2
        exit 1
    fi
done
PKG_CONFIG_PATH=$(dirname "$(find "$folder/moved" -name servoscope.pc)")
export PKG_CONFIG_PATH
read -ra flags < <(pkg-config --cflags --libs servoscope)
quietly cc -std=c99 "${strict[@]}" "$program" "${flags[@]}" -o "$folder/with-pkg-config"
"$folder/with-pkg-config"
quietly c++ -std=c++14 "${warnings[@]}" -x c++ "$program" -x none "${flags[@]}" -o "$folder/with-pkg-config-c++"
"$folder/with-pkg-config-c++"

# Two files a module, as C99 and as C++.
for modules in msgen frf guard 'msgen frf guard'; do
    read -ra names <<<"$modules"
    pair=servoscope_${modules// /_}
    quietly "$source/scripts/amalgamate" --output "$folder/pair" "${names[@]}"
    define=-DONE_PAIR_OF_FILES="\"$pair.h\""
    quietly cc -std=c99 "${strict[@]}" "$define" -I "$folder/pair" "$program" "$folder/pair/$pair.c" -lm -o "$folder/$pair"
    "$folder/$pair"
    quietly c++ -std=c++14 "${warnings[@]}" "$define" -I "$folder/pair" -x c++ "$program" "$folder/pair/$pair.c" -lm \
        -o "$folder/$pair-c++"
    "$folder/$pair-c++"
done

# Zephyr's own functions stand for plain CMake ones: what its build would be told is what is built.
project zephyr <<END
set(CONFIG_SERVOSCOPE ON)
set(CONFIG_SERVOSCOPE_REAL_BITS 32)
set(CONFIG_SERVOSCOPE_FRF_CHANNELS_MAX 2)
function(zephyr_library_named name)
  add_library(\${name} STATIC)
  add_library(servoscope::lib ALIAS \${name})
  target_link_libraries(\${name} PUBLIC m)
endfunction()
function(zephyr_library_sources)
  target_sources(servoscope PRIVATE \${ARGN})
endfunction()
function(zephyr_include_directories)
  target_include_directories(servoscope PUBLIC \${ARGN})
endfunction()
function(zephyr_compile_definitions)
  target_compile_definitions(servoscope PUBLIC \${ARGN})
endfunction()
add_subdirectory($source/zephyr zephyr)
END

# What PlatformIO would compile, with its flags, from the files it would pack; the version is the project's.
python3 - "$source" >"$folder/platformio" <<'END'
import glob, json, os, re, sys
root = sys.argv[1]
with open(os.path.join(root, "library.json"), encoding="utf-8") as file:
    library = json.load(file)
with open(os.path.join(root, "CMakeLists.txt"), encoding="utf-8") as file:
    version = re.search(r"project\(servoscope VERSION (\S+)", file.read())[1]
assert library["version"] == version, f'library.json: version {library["version"]}, expected {version}'
build = library["build"]
for name in library["export"]["include"] + [os.path.join(build["includeDir"], header) for header in library["headers"]]:
    assert os.path.exists(os.path.join(root, name)), f"library.json: {name} is not there"
(selected,) = build["srcFilter"]
print(*build["flags"], *sorted(glob.glob(selected[2:-1], root_dir=os.path.join(root, build["srcDir"]))))
END
read -ra parts <"$folder/platformio"
files=("${parts[@]:1}")
(cd "$source" && quietly cc -std=c99 "${parts[0]}" "${strict[@]}" "$program" "${files[@]/#/lib/}" -lm -o "$folder/with-platformio")
"$folder/with-platformio"
