#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Drives drawn at random (rigid, two and three masses, with and without delay), identified without being told orders or delay:
# how often the model has the drive's poles, how often the truth lies within its 95 % circle and within 1.96 standard deviations.
# usage: ./run bench parametric [PLANTS [SEED [FILE]]]   (300 plants and seed 1; a fresh seed: ./run bench parametric 300 $RANDOM;
# FILE: what became of each)
set -euo pipefail
cd "$(dirname "$0")/.."
: "${SERVOSCOPE_BUILD:?run this as ./run bench parametric}"
cmake --build "$SERVOSCOPE_BUILD" --target parametric -- --quiet >&2
exec "$SERVOSCOPE_BUILD/bench/parametric" "$@"
