#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Hides effects with fresh seeds in data of a drive that shares no code with the program, has the program diagnose them, and
# prints the rates. The seed comes last, for --seed; exit status 1 if a rate is beyond its bound.
# usage: ./run bench hidden [--cases N] [OPTION...]   (hidden_cases --help lists them)
set -euo pipefail
exec "$SERVOSCOPE_BUILD/tests/truth/hidden_cases" --program "$SERVOSCOPE" --fresh --jobs "$(nproc)" --min-unknown 0.6 "$@"
