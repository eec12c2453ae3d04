#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# README.md's example runs as printed and gives what the text beside it says.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$SERVOSCOPE_SOURCE/scripts/readme-example" --run
python3 - <<'END'
import json
import os
import re

for name in ("excitation.mst", "excitation.csv", "excitation.h", "run.csv", "validation.csv", "frf.csv", "report.html", "extended.json"):
    assert os.path.getsize(name) > 0, f"{name}: expected a file that is not empty"
with open("diagnosis.json", encoding="utf-8") as file:
    diagnosis = json.load(file)
assert diagnosis["verdict"] == "explained", diagnosis["verdict"]
causes = {cause["id"]: cause["parameters"] for cause in diagnosis["causes"]}
assert list(causes) == ["cogging"], causes
amplitude, periods = causes["cogging"]["amplitude_Nm"], causes["cogging"]["periods_per_rev"]
# Five standard deviations: chance breaks this less than once in a million seeds, and the seed is fixed.
assert abs(amplitude["value"] - 0.05) <= 5 * amplitude["std"] + 1e-12, amplitude
assert round(periods["value"]) == 12, periods
assert amplitude["std"] < 0.005, amplitude
gain = diagnosis["nominal"]["validation_nrmse"] / diagnosis["extended"]["validation_nrmse"]
assert gain > 1.1, f"validation_nrmse: expected the extended model to be better, gain {gain:.3f}"
with open("extended.json", encoding="utf-8") as file:
    assert "cogging" in json.load(file)["effects"]
# What README.md quotes. A twentieth: other processors round otherwise, and a drive that sticks and slips shows it.
with open(os.path.join(os.environ["SERVOSCOPE_SOURCE"], "README.md"), encoding="utf-8") as file:
    readme = " ".join(file.read().split())
assert diagnosis["headline"] in readme, diagnosis["headline"]
for words in ("as given is off by", "numbers refitted", "with the cause", "The noise alone makes"):
    quoted, said = (float(re.search(words + r" ([0-9.]+) %", text).group(1)) for text in (readme, diagnosis["gain"]))
    assert abs(said - quoted) <= 0.05 * quoted, f"{words}: README.md says {quoted} %, the program {said} %"
END
test "$(wc -l <"$SERVOSCOPE_SOURCE/README.md")" -lt 250
