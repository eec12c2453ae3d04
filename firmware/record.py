#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A recording (run.csv) as a C header of int16 frames: torque, velocity, in counts of the example's converters.
usage: record.py RUN.csv >recording.h"""
import csv
import sys

SCALES = (("torque_Nm", 16384.0), ("velocity_rad_per_s", 8192.0))
PER_LINE = 8

with open(sys.argv[1], encoding="utf-8") as file:
    rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
frames = [[max(-32768, min(32767, round(float(row[name]) * scale))) for name, scale in SCALES] for row in rows]
print("/* Made by firmware/record.py. */\n#ifndef RECORDING_H\n#define RECORDING_H\n\n#include <stdint.h>\n")
print(f"#define RECORDING_FRAMES {len(frames)}u\n\nstatic const int16_t recording_frames[{2 * len(frames)}] = {{")
for start in range(0, len(frames), PER_LINE):
    print("    " + " ".join(f"{torque},{velocity}," for torque, velocity in frames[start:start + PER_LINE]))
print("};\n\n#endif")
