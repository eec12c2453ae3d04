#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every method on the first paper's testbed, with scipy's least_squares(method='trf') on the same problem beside them (numpy and
# scipy go into a virtual environment under build/), then growth up to 10 000 lines: effective value, processor time, memory.
# usage: ./run bench design [--part testbed|growth] [OPTION...]   (other options are handed on to servoscope design)
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$SERVOSCOPE_BUILD/venv-scipy
scipy=(--scipy "$venv/bin/python")
if ! "$venv/bin/python" -c 'import numpy, scipy' 2>/dev/null; then
    if ! { python3 -m venv "$venv" && "$venv/bin/pip" --quiet install numpy scipy; } >&2; then
        printf 'bench design: numpy and scipy could not be installed; their row is left out\n' >&2
        scipy=()
    fi
fi
exec python3 bench/design.py --program "$SERVOSCOPE" "${scipy[@]}" "$@"
