#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What Zephyr's build reads of this repository, read with the tools that it uses: module.yml by PyYAML against the documented keys,
# Kconfig by kconfiglib, CMake with the values that Kconfig gives (Zephyr's own functions are stood for by plain ones: the tree itself
# is in no package registry). West takes the repository as a project of a manifest.
set -euo pipefail
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python_with zephyr west,kconfiglib,yaml west==1.5.0 kconfiglib==14.1.0 PyYAML==6.0.3
cd "$folder"
quietly() {
    "$@" >log 2>&1 || {
        cat log >&2
        echo "FAILED: $*" >&2
        exit 1
    }
}
expect() { # expect FILE LINE
    grep -qxF -- "$2" "$1" || {
        cat "$1" >&2
        echo "$1: expected the line $2" >&2
        exit 1
    }
}

cat >module.py <<'END'
import pathlib
import sys

import yaml

# "Modules", "Module yaml file description" of Zephyr's documentation.
DOCUMENTED = {"name": str, "build": dict, "tests": list, "samples": list, "boards": list, "blobs": list, "security": dict}
BUILD = {"cmake": str, "kconfig": str, "cmake-ext": bool, "kconfig-ext": bool, "depends": list, "settings": dict}
root = pathlib.Path(sys.argv[1])
module = yaml.safe_load((root / "zephyr/module.yml").read_text(encoding="utf-8"))
for keys, known in ((module, DOCUMENTED), (module["build"], BUILD)):
    for key, value in keys.items():
        if not (key in known and isinstance(value, known[key])):
            sys.exit(f"zephyr/module.yml: {key}: {value!r}: expected one of {', '.join(known)}, of its type")
for key, path in (("cmake", "CMakeLists.txt"), ("kconfig", "")):
    if not (root / module["build"][key] / path).is_file():
        sys.exit(f"zephyr/module.yml: {key}: {module['build'][key]}: expected a file there")
END
quietly "$venv/bin/python" module.py "$SERVOSCOPE_SOURCE"
mkdir -p broken/zephyr
sed 's/kconfig:/kconfigs:/' "$SERVOSCOPE_SOURCE/zephyr/module.yml" >broken/zephyr/module.yml
if "$venv/bin/python" module.py broken 2>/dev/null; then
    echo "expected a key that Zephyr does not know to be refused" >&2
    exit 1
fi

# The boards' own symbols, which Zephyr has; a part with a single-precision FPU gets 32 bits.
cat >Kconfig <<END
config CPU_HAS_FPU
    bool "FPU"
config CPU_HAS_FPU_DOUBLE_PRECISION
    bool "FPU of doubles"
source "$SERVOSCOPE_SOURCE/zephyr/Kconfig"
END
cat >configure.py <<'END'
import sys

import kconfiglib

kconfig = kconfiglib.Kconfig("Kconfig", warn_to_stderr=False)
for assignment in sys.argv[2:]:
    name, value = assignment.split("=")
    kconfig.syms[name].set_value(value)
values = {symbol.name: symbol.str_value for symbol in kconfig.unique_defined_syms}
if kconfig.warnings:  # out of range, not known: told when a value is looked at
    sys.exit("\n".join(kconfig.warnings))
with open(sys.argv[1], "w", encoding="utf-8") as file:
    for name, value in values.items():
        if value not in ("", "n"):
            file.write(f"set(CONFIG_{name} {value})\n")
END
configure() { # configure FILE SYMBOL=VALUE...
    quietly "$venv/bin/python" configure.py "$@"
}
configure fpu.cmake SERVOSCOPE=y CPU_HAS_FPU=y SERVOSCOPE_FRF_CHANNELS_MAX=2
expect fpu.cmake 'set(CONFIG_SERVOSCOPE_REAL_BITS 32)'
expect fpu.cmake 'set(CONFIG_SERVOSCOPE_FRF_CHANNELS_MAX 2)'
configure plain.cmake SERVOSCOPE=y
expect plain.cmake 'set(CONFIG_SERVOSCOPE_REAL_BITS 64)'
configure double.cmake SERVOSCOPE=y CPU_HAS_FPU=y CPU_HAS_FPU_DOUBLE_PRECISION=y
expect double.cmake 'set(CONFIG_SERVOSCOPE_REAL_BITS 64)'
configure without.cmake CPU_HAS_FPU=y
if grep SERVOSCOPE without.cmake >&2; then
    echo "expected nothing of servoscope where it is not chosen" >&2
    exit 1
fi
if "$venv/bin/python" configure.py range.cmake SERVOSCOPE=y SERVOSCOPE_FRF_CHANNELS_MAX=9 2>/dev/null; then
    echo "expected 9 channels to be out of range" >&2
    exit 1
fi

cat >CMakeLists.txt <<END
cmake_minimum_required(VERSION 3.22)
project(zephyr_module LANGUAGES C)
include(\${CHOSEN})
function(zephyr_library_named name)
  add_library(\${name} STATIC)
  target_compile_options(\${name} PRIVATE -std=c99 -ffreestanding -Wall -Wextra -Werror)
endfunction()
function(zephyr_library_sources)
  target_sources(servoscope PRIVATE \${ARGN})
endfunction()
add_library(zephyr_interface INTERFACE)
function(zephyr_include_directories)
  include_directories(\${ARGN})
  target_include_directories(zephyr_interface INTERFACE \${ARGN})
endfunction()
function(zephyr_compile_definitions)
  add_compile_definitions(\${ARGN})
  target_compile_definitions(zephyr_interface INTERFACE \${ARGN})
endfunction()
add_subdirectory($SERVOSCOPE_SOURCE/zephyr servoscope)
if(TARGET servoscope)
  # In Zephyr what a module asks of all units holds for its own library too.
  target_link_libraries(servoscope PRIVATE zephyr_interface)
  add_executable(program $SERVOSCOPE_SOURCE/tests/support/consumer.c)
  target_link_libraries(program PRIVATE zephyr_interface servoscope m)
endif()
END
for chosen in fpu plain without; do
    quietly cmake -S . -B "$chosen" -G Ninja "-DCHOSEN=$folder/$chosen.cmake"
    quietly cmake --build "$chosen"
    [ "$chosen" = without ] || "$chosen/program"
done
if [ -n "$(find without -name '*.a')" ]; then
    echo "expected nothing to be built where servoscope is not chosen" >&2
    exit 1
fi

# As a project in a workspace: west finds it by its manifest.
mkdir -p workspace/app workspace/modules
cat >workspace/app/west.yml <<END
manifest:
  projects:
    - name: servoscope
      url: file://$folder/nowhere
      path: modules/servoscope
  self:
    path: app
END
ln -s "$SERVOSCOPE_SOURCE" workspace/modules/servoscope
(cd workspace/app && quietly "$venv/bin/west" init -l .)
(cd workspace && "$venv/bin/west" list --format '{name} {path}') >listed
expect listed 'servoscope modules/servoscope'
