#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Hides effects with fresh seeds in data of a drive that shares no code with the program, has the program diagnose them, and
# prints what was called what, detection beside Neyman and Pearson's limit, and the rates beside what is required of them.
# Every failure comes with the line that replays it. Exit status 1 if a rate is beyond its bound.
# 400 cases (150 without an effect, 140 with one, 60 with two or three, 50 with one that no catalogue has); any first part
# of them is a fair sample: --minutes M stops there.
# usage: ./run bench diagnosis [--minutes M] [--cases N] [--seed S] [--jobs N] [--kind KIND] [--size clear|moderate|faint]
#                              [--only clean|single|combination|unknown] [OPTION...]   (hidden_cases --help lists them)
set -euo pipefail
exec "$SERVOSCOPE_BUILD/tests/truth/hidden_cases" --program "$SERVOSCOPE" --cases 400 --fresh --jobs "$(nproc)" "$@"
