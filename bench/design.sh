#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What each method makes of the first paper's testbed (1 Nm, 0.05 m/s on a pulley of 0.0159 m, 0.00516 kg m2, 0.5..100 Hz), at
# the samples and for every instant, with the processor time of the optimiser.
# usage: ./run bench design [OPTION...]   (options are handed on to servoscope design)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

limits=(--rate 1000 --period 2000 --lines linear:0.5:100:0.5 --limit-torque 1 --limit-velocity 3.1446540880503147
    --inertia 0.00516)
printf '%-12s %-11s %12s %16s %8s %8s\n' method grid 'torque [Nm]' 'every t [Nm]' crest 'cpu [s]'
for grid in samples continuous; do
    for method in newman schroeder 'clip --keep all' mca fast; do
        # shellcheck disable=SC2086
        "$SERVOSCOPE" design "${limits[@]}" --grid "$grid" --method $method --json "$@" --out "$folder/table" >"$folder/json" ||
            continue
        python3 - "$folder/json" "$method" "$grid" <<'END'
import json
import sys

with open(sys.argv[1], encoding="utf-8") as file:
    result = json.load(file)
print(f"{sys.argv[2].split()[0]:12s} {sys.argv[3]:11s} {result['effective_torque_Nm']:12.4f} "
      f"{result['effective_torque_continuous_Nm']:16.4f} {result['crest_factor']:8.3f} {result['cpu_s']:8.3f}")
END
    done
done
