#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What each rule for the start of a table (--start none, paper, bank, model:FILE) leaves of the transient of a drive at rest, in
# torque mode and in cascade, over fresh random drives and designs, beside the reference's figures. Exit status 1 if the bank's
# or the known drive's mean is beyond its bound. The seed comes last.
# usage: ./run bench start [--draws N] [--seed S]   (5 draws of 6 designs x 24 drives, seed from the clock)
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --build "$SERVOSCOPE_BUILD" --target start_study -- --quiet >&2
exec "$SERVOSCOPE_BUILD/bench/start_study" "$@"
