#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Frames per second of processor time of master, node and in-process bus, for CiA 402 and for ODrive's CAN Simple.
# usage: ./run bench can-throughput [VIRTUAL SECONDS]
set -euo pipefail
cmake --build "$SERVOSCOPE_BUILD" --target can_throughput -- --quiet >&2
exec "$SERVOSCOPE_BUILD/bench/can_throughput" "$@"
