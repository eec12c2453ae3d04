#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Speed of method mean and method lpm beside numpy on the same data, and whether both say the same.
# Mean: numpy's rfft over periods, means and covariances. LPM: one least squares (numpy.linalg.lstsq) per line, as textbooks
# write it; and, for the record, one matrix product for all lines at once. From rows in memory to the response, processor time.
# Last the parametric fit beside scipy's.
# usage: ./run bench estimate   (numpy comes into a virtual environment of its own, in the build folder)
set -euo pipefail
cd "$(dirname "$0")/.."
: "${SERVOSCOPE_BUILD:?run this as ./run bench estimate}"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cmake --build "$SERVOSCOPE_BUILD" --target estimate_speed -- --quiet >&2
venv=$SERVOSCOPE_BUILD/venv-numpy
if ! "$venv/bin/python" -c 'import numpy' 2>/dev/null; then
    { python3 -m venv "$venv" && "$venv/bin/pip" --quiet --disable-pip-version-check install numpy; } >&2
fi
# Freed memory stays with the process, for both: else the kernel's clearing of pages is most of what scatters.
export MALLOC_MMAP_THRESHOLD_=1000000000 MALLOC_TRIM_THRESHOLD_=1000000000
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# By turns, because a machine is not equally fast from minute to minute; the best of each counts.
for round in 1 2 3; do
    "$SERVOSCOPE_BUILD/bench/estimate_speed" "$folder" >"$folder/times-$round"
    "$venv/bin/python" bench/estimate_numpy.py "$folder" "$round"
done
# The parametric fit beside scipy's least_squares.
bench/quasilog.sh --speed
