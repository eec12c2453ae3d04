#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Figures 2 to 5 of the first paper: effective value and crest factor of every method at eight corner frequencies of three
# kinds, beside a reference implementation of the same equations. Prints tables, writes plots, and fails if MCA is not where
# the equations put it or the default method falls behind L-infinity. Takes some minutes.
# usage: ./run bench design-figures [PAGE.html]   (default build/bench/design-figures.html)
set -euo pipefail
cmake --build "$SERVOSCOPE_BUILD" --target design_figures -- --quiet >&2
exec "$SERVOSCOPE_BUILD/bench/design_figures" "${1:-$SERVOSCOPE_BUILD/design-figures.html}"
