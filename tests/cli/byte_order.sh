#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# lib/ on a big-endian 64-bit machine (s390x, under QEMU) and a 32-bit one (x86): every integer result is the host's, bit for bit,
# and the tests of its integer parts pass there. Also without a long multiply, the way of a Cortex-M0.
# usage: byte_order.sh [TEST...]   (unit tests to run there; all of lib/ takes two minutes)
set -euo pipefail
: "${SERVOSCOPE_SOURCE:?}" "${UNITY_ROOT:=$SERVOSCOPE_SOURCE/.cache/unity}"
[ $# -gt 0 ] || set -- crc guard guard_conditions msgen_table
[ "$*" != all ] || set -- crc guard guard_conditions msgen_table msgen_player frf_dft frf_exact frf_block frf_statistics
for tool in s390x-linux-gnu-gcc i686-linux-gnu-gcc qemu-s390x; do
    if ! command -v "$tool" >/dev/null; then
        echo "$tool is not here; left out" >&2
        exit 77
    fi
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$SERVOSCOPE_SOURCE"
flags=(-std=c11 -D_POSIX_C_SOURCE=200809L -DUNITY_INCLUDE_DOUBLE -DUNITY_SUPPORT_64 -Ilib -I. -I"$UNITY_ROOT")
sources=(lib/*/*.c)

build() { # build COMPILER NAME FLAGS...: the library and the program of all integer results
    local compiler=$1 name=$2
    shift 2
    mkdir -p "$folder/$name"
    (cd "$folder/$name" && "$compiler" "${flags[@]/#-Ilib/-I$SERVOSCOPE_SOURCE/lib}" "$@" -c "${sources[@]/#/$SERVOSCOPE_SOURCE/}")
    "$compiler" "${flags[@]}" "$@" tests/support/bit_exact.c "$folder/$name"/*.o -lm -o "$folder/$name/bit_exact"
}

run() { # run NAME PROGRAM
    case $1:$(uname -m) in
    s390x:*) qemu-s390x "$2" ;;
    i686:x86_64 | i686:i?86) "$2" ;;
    i686:*) qemu-i386 "$2" ;;
    *) "$2" ;;
    esac
}

build cc host -O2
run host "$folder/host/bit_exact" >"$folder/expected"
build cc host-without-long-multiply -O1 -DSERVOSCOPE_FRF_LONG_MULTIPLY=0
build s390x-linux-gnu-gcc s390x -O1 -static
build i686-linux-gnu-gcc i686 -O1 -static
for name in host-without-long-multiply s390x i686; do
    run "$name" "$folder/$name/bit_exact" >"$folder/$name.txt"
    if ! diff "$folder/expected" "$folder/$name.txt"; then
        echo "$name: expected the host's results (<)" >&2
        exit 1
    fi
done
for name in s390x i686; do
    for test in "$@"; do
        "$name-linux-gnu-gcc" "${flags[@]}" -O1 -static "tests/unit/test_$test.c" "$UNITY_ROOT/unity.c" "$folder/$name"/*.o -lm \
            -o "$folder/$name/$test"
        run "$name" "$folder/$name/$test" >"$folder/log" || {
            cat "$folder/log" >&2
            echo "unit/$test fails on $name" >&2
            exit 1
        }
    done
done
echo "byte order and word size: $(wc -l <"$folder/expected") results the same on s390x, 32-bit x86 and without a long multiply; $# tests"
