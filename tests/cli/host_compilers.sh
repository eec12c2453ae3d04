#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The host side, tests and benchmarks included, by clang without one warning; and for 32-bit x86, where the README's example gives
# what it gives here and tests of numbers, files, transforms and the simulated drive pass.
set -euo pipefail
source=$SERVOSCOPE_SOURCE
clang=$(command -v clang-14 || command -v clang || true)
[ -n "$clang" ] || {
    echo "clang is not here; left out" >&2
    exit 77
}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

configure() { # configure BUILD OPTIONS...
    local build=$1
    shift
    cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSERVOSCOPE_WERROR=ON -DUNITY_ROOT="$UNITY_ROOT" "$@" \
        >"$folder/log" 2>&1 || {
        tail -n 20 "$folder/log" >&2
        exit 1
    }
}

run() { # run COMMAND...: quiet unless it fails
    "$@" >"$folder/log" 2>&1 || {
        grep -E 'error|FAIL' "$folder/log" >&2 || tail -n 20 "$folder/log" >&2
        exit 1
    }
}

# -fsyntax-only leaves no objects, so each command of the build is run by itself.
configure "$folder/64" -DCMAKE_C_COMPILER="$clang" -DCMAKE_CXX_COMPILER="${clang/clang/clang++}"
python3 - "$folder/64/compile_commands.json" <<'END'
import concurrent.futures
import json
import os
import subprocess
import sys

with open(sys.argv[1], encoding="utf-8") as file:
    entries = {entry["file"]: entry for entry in json.load(file)}


def check(entry):
    command = entry["command"].split(" -o ")[0] + " -fsyntax-only " + entry["file"]
    return subprocess.run(command, shell=True, cwd=entry["directory"], capture_output=True, text=True)


with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
    failed = [done.stderr for done in pool.map(check, entries.values()) if done.returncode]
print("".join(failed[:5]), file=sys.stderr, end="")
print(f"{len(entries)} files by clang, {len(failed)} with warnings")
sys.exit(1 if failed or len(entries) < 400 else 0)
END

"$source/scripts/get-i386" >/dev/null || {
    echo "the 32-bit libraries are not to be had; left out" >&2
    exit 77
}
configure "$folder/32" -DCMAKE_TOOLCHAIN_FILE="$source/cmake/toolchains/i686-linux.cmake" -DCMAKE_C_FLAGS_RELEASE=-O1 \
    -DCMAKE_CXX_FLAGS_RELEASE=-O1
tests=(unit/run_file unit/run_stream unit/fft unit/frf_exact unit/statistics unit/simulated_drive unit/inproc_bus unit/modbus_map
    fault/table_file)
run cmake --build "$folder/32" -j "$(nproc)" --target servoscope $(printf 'test_%s ' "${tests[@]//\//_}")
run ctest --test-dir "$folder/32" --output-on-failure --no-tests=error -R "^($(IFS='|' && echo "${tests[*]}"))\$"
SERVOSCOPE=$folder/32/servoscope run bash "$source/tests/cli/readme.sh"
echo "${#tests[@]} tests and the README's example in 32 bits"
