#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Runs the demo with seeds 1..N (10 if not said) and prints for each the last lines it says and the seconds it took.
# usage: ./run bench demo [N [FIRST]]
set -euo pipefail
count=${1:-10}
first=${2:-1}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for seed in $(seq "$first" $((first + count - 1))); do
    rm -rf servoscope-demo
    start=$(date +%s.%N)
    status=0
    "$SERVOSCOPE" demo --seed "$seed" >out 2>err || status=$?
    printf '== seed %s: exit %s, %.1f s\n' "$seed" "$status" "$(awk -v a="$start" -v b="$(date +%s.%N)" 'BEGIN { print b - a }')"
    tail -n 6 out | sed 's/^/   /'
    [ "$status" -eq 0 ] || tail -n 3 err | sed 's/^/   /'
done
