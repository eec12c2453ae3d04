#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every figure that is promised of a design, judged from the written files alone: CSV in, own spectra and oversampling by numpy
# (in a virtual environment under build/), nothing shared with the designer. Exits 1 if a figure is outside its band.
# usage: ./run bench design-required [--seed FIRST] [--budget]   (--budget: a minute of starts too)
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$SERVOSCOPE_BUILD/venv-scipy
if ! "$venv/bin/python" -c 'import numpy' 2>/dev/null; then
    { python3 -m venv "$venv" && "$venv/bin/pip" --quiet install numpy scipy; } >&2
fi
exec "$venv/bin/python" bench/design_required.py --program "$SERVOSCOPE" "$@"
