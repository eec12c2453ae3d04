#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The first paper's experiments (its figures 7, 8 and 9) on the simulated drive, through the program itself: what standard
# clipping, MCA, L-infinity and fast give at equal limits, with good and poor sensors and on a drive that changes meanwhile, beside
# what their effective values promise. Prints tables, writes a page; exit status 1 if a figure is outside what is required.
# usage: ./run bench excitation [PAGE.html [RECORDINGS [SEED]]]   (default build/bench/excitation.html, 6 recordings, seed 1)
set -euo pipefail
: "${SERVOSCOPE:?run this as ./run bench excitation}"
cmake --build "$SERVOSCOPE_BUILD" --target excitation -- --quiet >&2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$SERVOSCOPE_BUILD/bench/excitation" "$SERVOSCOPE" "$folder" "${1:-$SERVOSCOPE_BUILD/excitation.html}" "${@:2}"
