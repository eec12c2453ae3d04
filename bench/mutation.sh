#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# How many small changes of lib/guard and lib/frf their tests notice; docs/testing.md explains those that they do not.
# usage: ./run bench mutation [ARGUMENT...]     (scripts/mutate ARGUMENT...; without: all of guard, 400 of frf, about 20 minutes)
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 0 ] || exec scripts/mutate "$@"
scripts/mutate guard
scripts/mutate --sample 400 frf
