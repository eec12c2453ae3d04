#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The diagnosis of a real positioning axis (EMPS) without a model: what a rigid body without friction misses, fitted on one
# recording and judged on another. usage: emps_diagnosis.sh PROGRAM
# Bands: the published least-squares figures (M 95.11 kg, Fv 203.5 N s/m, Fc 20.39 N) with a tenth either way for friction and
# 2 % for the mass, because one-step prediction errors weigh frequencies by their noise and least squares does not.
set -euo pipefail
data=${SERVOSCOPE_DATA:-}/emps
if [ -z "${SERVOSCOPE_DATA:-}" ] || [ ! -d "$data" ]; then
    echo "skipped: no data"
    exit 77
fi
"$1" diagnose "$data/DATA_EMPS.csv" --validate "$data/DATA_EMPS_PULSES.csv" \
    --map force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m,time_s=t_s \
    --json-out d.json --extended m.json --report r.html --quiet
python3 - <<'CHECK'
import json

d, m = json.load(open("d.json")), json.load(open("m.json"))
found = {c["id"]: c for c in d["causes"] + d["candidates"]}
for c in d["causes"] + d["candidates"]:
    kind = "cause" if c in d["causes"] else "candidate"
    print(f"{kind:9} {c['evidence']:10.0f} nats  {c['says']}")
for figure in ("nominal", "refitted", "extended"):
    print(f"{figure:9} error on PULSES {100 * d[figure]['validation_nrmse']:.2f} %")
print(f"noise     {100 * d['noise_floor_nrmse']:.2f} %; {d['motion_from']}")
mass = m.get("motor_mass_kg", 0) + m["mass_kg"]
print(f"mass {mass:.2f} kg; verdict {d['verdict']}: {d.get('unexplained')}")


def within(what, value, paper, share):
    assert abs(value - paper) <= share * paper, f"{what}: {value}, published {paper}, within {share:.0%}"


named = [c["id"] for c in d["causes"]]
assert "viscous_friction" in named and "coulomb_friction" in named, named
within("viscous friction", found["viscous_friction"]["parameters"]["viscous_friction_Ns_per_m"]["value"], 203.5, 0.1)
within("Coulomb friction", found["coulomb_friction"]["parameters"]["coulomb_friction_N"]["value"], 20.39, 0.1)
within("mass", mass, 95.11, 0.02)
assert "asymmetric_friction" in found or "load_bias" in found, list(found)
assert d["extended"]["validation_nrmse"] < 0.25 * d["nominal"]["validation_nrmse"]
assert d["verdict"] != "no_discrepancy"
CHECK
