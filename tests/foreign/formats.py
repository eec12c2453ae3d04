#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""servoscope convert against the libraries of others, both ways: scipy (MATLAB 5), h5py (MATLAB 7.3), pyuff (dataset 58).

usage: foreign_formats.py PROGRAM   in a folder with run.csv and frf.csv
"""
import csv
import subprocess
import sys

import h5py
import numpy as np
import pyuff
import scipy.io

digits_13 = 1e-12  # a universal file in text has so many


def convert(*arguments):
    done = subprocess.run([sys.argv[1], "convert", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, (arguments, done.stderr)
    return done.stdout


def read(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {name: np.array([float(row[name]) if row[name] else np.nan for row in rows]) for name in rows[0]}


run, frf = read("run.csv"), read("frf.csv")
response = frf["real"] + 1j * frf["imag"]

# Ours, read by others: to the bit where the format holds all bits.
convert("run.csv", "run.mat")
seen = scipy.io.loadmat("run.mat", squeeze_me=True)
for name, values in run.items():
    assert np.array_equal(seen[name], values), name
assert float(seen["servoscope"]["sample_rate_hz"]) == 1000
convert("frf.csv", "frf.mat")
seen = scipy.io.loadmat("frf.mat", squeeze_me=True)["frf"]
assert np.array_equal(seen["response"].item(), response) and np.array_equal(seen["frequency_hz"].item(), frf["frequency_hz"])
convert("run.csv", "run73.mat", "--to", "mat73")
with h5py.File("run73.mat") as file:
    for name, values in run.items():
        assert np.array_equal(np.array(file[name]).ravel(), values), name
convert("frf.csv", "frf73.mat", "--to", "mat73")
with h5py.File("frf73.mat") as file:
    seen = np.array(file["frf/response"]).ravel()
    assert np.array_equal(seen["real"] + 1j * seen["imag"], response)
for form, tolerance in ("uff", digits_13), ("uff58b", 0.0):
    convert("run.csv", "run.uff", "--to", form)
    seen = {s["id1"].strip(): s for s in pyuff.UFF("run.uff").read_sets() if s["type"] == 58}
    for name, values in run.items():
        assert np.allclose(seen[name]["data"], values, rtol=tolerance, atol=0.0), (form, name)
    convert("frf.csv", "frf.uff", "--to", form)
    first = next(s for s in pyuff.UFF("frf.uff").read_sets() if s["type"] == 58)
    assert first["func_type"] == 4 and np.allclose(first["data"], response, rtol=tolerance, atol=0.0), form

# Others', read by us.
t = np.arange(200) * 1e-3
for packed in False, True:
    scipy.io.savemat("theirs.mat", {"t": t, "iq": np.sin(t), "log": {"speed": np.cos(t), "pos": np.single(t)}, "data": np.c_[t, t**2],
                                    "counts": np.arange(200, dtype=np.int32), "note": "text", "cplx": 1j * t}, do_compression=packed)
    said = convert("theirs.mat", "theirs.csv", "--map", "time_s=t,torque_Nm=iq*0.5,velocity_rad_per_s=log.speed,position_rad=data:2")
    assert "lost: variable cplx" in said and "lost: variable note" in said, said
    seen = read("theirs.csv")
    assert np.array_equal(seen["torque_Nm"], 0.5 * np.sin(t)) and np.array_equal(seen["velocity_rad_per_s"], np.cos(t))
    assert np.array_equal(seen["position_rad"], t**2)


def matlab_class(item, name):
    """As MATLAB writes it: text that ends with its last letter."""
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(name))
    attribute = h5py.h5a.create(item.id, b"MATLAB_class", kind, h5py.h5s.create(h5py.h5s.SCALAR))
    attribute.write(np.array(name.encode(), dtype=f"S{len(name)}"), mtype=kind)


with h5py.File("theirs73.mat", "w", userblock_size=512) as file:
    for name, values in {"t": t, "iq": np.sin(t)}.items():
        matlab_class(file.create_dataset(name, data=values[None, :]), "double")
    group = file.create_group("log")
    matlab_class(group, "struct")
    matlab_class(group.create_dataset("pos", data=t[None, :] ** 2, chunks=(1, 50), compression="gzip"), "double")
with open("theirs73.mat", "r+b") as file:
    file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
convert("theirs73.mat", "theirs.csv", "--map", "time_s=t,torque_Nm=iq,position_rad=log.pos")
seen = read("theirs.csv")
assert np.array_equal(seen["torque_Nm"], np.sin(t)) and np.array_equal(seen["position_rad"], t**2)


def dataset58(kind, data, x, name, units, **axes):
    return {"type": 58, "binary": 0, "func_type": kind, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "data": data, "x": x,
            "id1": name, "id2": "NONE", "id3": "NONE", "id4": "NONE", "id5": "NONE", "ver_num": 0, "load_case_id": 0,
            "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 17 if kind == 1 else 18,
            "ordinate_spec_data_type": axes.get("spec", 0), "orddenom_spec_data_type": axes.get("denominator", 0),
            "z_axis_spec_data_type": 0, "abscissa_axis_units_lab": "s" if kind == 1 else "Hz", "ordinate_axis_units_lab": units,
            "orddenom_axis_units_lab": axes.get("denominator_units", "NONE"), "z_axis_axis_units_lab": "NONE", "z_axis_value": 0,
            "abscissa_min": float(x[0]), "abscissa_inc": float(x[1] - x[0]), "num_pts": len(x), "ord_data_type": 6 if np.iscomplexobj(data) else 4}


# pyuff writes its text with 12 digits.
pyuff.UFF("theirs.uff").write_sets([dataset58(1, np.sin(t), t, "torque", "Nm"), dataset58(1, 60.0 * np.cos(t), t, "speed", "rpm")], "overwrite")
said = convert("theirs.uff", "theirs.csv")
assert "velocity_rad_per_s is speed [rpm] times 0.10472" in said, said
seen = read("theirs.csv")
assert np.max(np.abs(seen["torque_Nm"] - np.sin(t))) < 1e-11
assert np.max(np.abs(seen["velocity_rad_per_s"] - 2 * np.pi * np.cos(t))) < 1e-10
f = np.arange(1.0, 101.0)
pyuff.UFF("theirs-frf.uff").write_sets([dataset58(4, 1 / (1 + 1j * f), f, "G", "m/s", spec=11, denominator=13, denominator_units="N")], "overwrite")
assert "from force_N to velocity_m_per_s" in convert("theirs-frf.uff", "theirs.csv")
seen = read("theirs.csv")
assert np.max(np.abs(seen["real"] + 1j * seen["imag"] - 1 / (1 + 1j * f))) < 1e-11
print("scipy", scipy.__version__, "h5py", h5py.__version__, "pyuff", pyuff.__version__ if hasattr(pyuff, "__version__") else "")
