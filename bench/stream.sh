#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Recordings of any length in bounded memory: `servoscope frf` on 10^7 rows (or as many as named), from a file, from a gzipped one and
# through a pipe, beside reading the bytes alone (disk or page cache), unpacking alone, parsing alone, and pandas reading the same file. What takes as long as the whole is what bounds it. Required: under 100 MiB, results of file and pipe the same.
# usage: ./run bench stream [ROWS] [DIGITS]    (default 10000000 17; 100000000 is 6 GB in build/; pandas comes into a venv there)
set -euo pipefail
cd "$(dirname "$0")/.."
: "${SERVOSCOPE_BUILD:?run this as ./run bench stream}" "${SERVOSCOPE:?run this as ./run bench stream}"
rows=${1:-10000000}
digits=${2:-17}
limit_mib=100
folder=$SERVOSCOPE_BUILD/stream
mkdir -p "$folder"
trap 'rm -rf "$folder"' EXIT

cmake --build "$SERVOSCOPE_BUILD" --target stream servoscope -- --quiet >&2
stream=$SERVOSCOPE_BUILD/bench/stream
venv=$SERVOSCOPE_BUILD/venv-pandas
if ! "$venv/bin/python" -c 'import pandas' 2>/dev/null; then
    { python3 -m venv "$venv" && "$venv/bin/pip" --quiet --disable-pip-version-check install pandas; } >&2 || true
fi
run=$folder/run.csv
"$stream" write "$rows" "$digits" >"$run"
bytes=$(stat -c %s "$run")
times=$folder/times
exec 3>"$times"
timed() { "$stream" run "$1" "$bytes" "$rows" "${@:2}"; }

echo "$rows rows of 3 columns, $digits digits, $bytes bytes; periods of 2000 samples, 400 lines"
printf '%-34s %9s %9s %11s %8s %9s\n' '' 'wall s' 'cpu s' 'Mrows/s' 'MB/s' 'peak MiB'
timed 'bytes alone (cat)' cat "$run" >/dev/null
"$stream" run 'bytes alone (cat), again' "$bytes" "$rows" sh -c "cat '$run' >/dev/null"
timed 'parser alone' "$stream" parse "$run"
timed 'servoscope frf' "$SERVOSCOPE" frf "$run" --out "$folder/file.csv" --quiet
if [ "$rows" -le 20000000 ]; then
    gzip -1 -k "$run"
    timed 'unpacking alone (gzip -dc)' sh -c "gzip -dc '$run.gz' >/dev/null"
    timed 'servoscope frf, .csv.gz' "$SERVOSCOPE" frf "$run.gz" --out "$folder/gz.csv" --quiet
fi
timed 'servoscope frf, through a pipe' sh -c "cat '$run' | '$SERVOSCOPE' frf /dev/stdin --out '$folder/pipe.csv' --quiet"
if [ "$rows" -le 20000000 ] && "$venv/bin/python" -c 'import pandas' 2>/dev/null; then
    timed 'pandas.read_csv' "$venv/bin/python" -c "import pandas; pandas.read_csv('$run', comment='#')"
fi
exec 3>&-
cmp "$folder/file.csv" "$folder/pipe.csv"
python3 - "$times" "$limit_mib" <<'EOF'
import json
import sys

times = {row["label"]: row for row in map(json.loads, open(sys.argv[1], encoding="utf-8"))}
frf, parser, cat = times["servoscope frf"], times["parser alone"], times["bytes alone (cat), again"]
print(f"of servoscope frf's {frf['wall_s']:.2f} s: reading {cat['wall_s'] / frf['wall_s']:.0%}, parser with reading "
      f"{parser['wall_s'] / frf['wall_s']:.0%}, transforms and sums the rest")
bound = "the disk" if cat["wall_s"] > 0.7 * frf["wall_s"] else "the parser" if parser["wall_s"] > 0.5 * frf["wall_s"] else \
    "the transforms"
print(f"bound by: {bound}")
most = max(row["memory_mib"] for label, row in times.items() if label.startswith("servoscope"))
print(f"peak memory {most:.1f} MiB, required: under {sys.argv[2]}")
sys.exit(most >= float(sys.argv[2]))
EOF
