#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Every option of every subcommand once with a value that is right, and with every kind of value that is wrong.

usage: option_table.py PROGRAM   in a folder with model.json, table.mst, run.csv, frf.csv, drive.json

A wrong value has to end with status 2 (1 where it is the name of a file that is not there), one line on standard error that begins with
the subcommand and holds the option's name (or the file's) and the value, nothing on standard output, and no file.
A subcommand that takes an option that the table below does not know fails the test: the help is what says which there are.
"""
import concurrent.futures
import os
import subprocess
import sys
import tempfile

program = os.path.abspath(sys.argv[1])
failures = []

TEXT = ["text", "nan", "inf", "1e999", "0x10", "1,5", "1 2"]  # no number, for any option that takes one


def number(good, *bad):
    return {"good": good, "bad": TEXT + list(bad)}


def positive(good, *bad):
    return number(good, "0", "-1", *bad)


def integer(good, *bad):
    return number(good, "1.5", "99999999999999999999", *bad)


def choice(good, *bad):
    return {"good": good, "bad": ["nonsense", "1", *bad]}


def spec(good, *bad):
    return {"good": good, "bad": list(bad)}


def source(good):  # a file that is read: one that is not there, and a folder
    return {"good": good, "bad": [], "no_file": ["missing.file", "."]}


def result(good):  # a file that is written: a folder, one that is not there, a device that takes nothing
    return {"good": good, "bad": [], "no_file": [".", "nowhere/x.csv", "/dev/full"]}


flag = {"good": None, "bad": []}
anything = {"good": "x", "bad": []}

playing = {
    "table": source("table.mst"), "periods": integer("2", "0", "-1", "1000001"), "settle": integer("0", "-1", "1000001"),
    "mode": choice("cascade"), "fade": integer("100", "-1", "99999999"), "limit-position": positive("3"), "limit-velocity": positive("30"),
    "limit-torque": positive("5"), "out": result("ok-run.csv"), "report": result("ok.html"),
}
LINEAR = {"rate": "1000", "period": "500", "lines": "quasilog:6:100:1.3", "limit-force-n": "1", "mass": "1", "method": "newman", "out": "ok"}
SERVED = {"model": "model.json", "for": "0.05"}
# A run of each subcommand that is complete: its operands and options; an option that is tried takes the place of its own here.
table = {
    "completion": {"operands": ["bash"], "base": {}, "options": {}, "no_json": True},
    "convert": {"operands": ["run.csv", "ok.uff"], "base": {}, "options": {
        "to": choice("uff"), "out": result(None), "map": spec("torque_Nm=torque_Nm", "nonsense", "torque=a", "torque_Nm=", "torque_Nm=a*0",
                                                              "torque_Nm=a*x", ("torque_Nm=a,torque_Nm=b", "'torque_Nm=b': the name is mapped twice")),
        "rate": positive("1000"), "function": integer(None, "0", "-1", "1000001")}},
    "demo": {"operands": [], "base": {}, "options": {"seed": integer(None, "-1"), "out": {"good": None, "bad": [], "no_file": ["run.csv"]}}},
    "design": {"operands": [], "base": {"rate": "1000", "period": "500", "lines": "quasilog:6:100:1.3", "limit-torque": "1", "inertia": "0.005",
                                        "method": "newman", "out": "ok"}, "options": {
        "rate": {"good": "1000", "bad": TEXT + ["0", "-1", "1/0", "1/", "1e12"]}, "period": integer("500", "0", "3", "2000000", "-5"),
        "lines": spec("odd:2:100:2", "nonsense", "linear", "linear:1", "linear:0:100:2", "linear:100:2:2", "linear:2:100:x", "linear:2:1e9:2",
                      "quasilog:2:100:1", ("list:missing.file", "missing.file: cannot be opened", 1)),
        "inputs": integer("1", "0", "-1", "17"), "limit-position": positive("3"), "limit-velocity": positive("3"),
        "limit-acceleration": positive("300"), "limit-torque": positive("1"), "inertia": positive("0.005"),
        "limit-position-m": positive(None), "limit-velocity-m-per-s": positive(None), "limit-acceleration-m-per-s2": positive(None),
        "limit-force-n": positive(None), "mass": positive(None), "pulley-radius": positive(None), "minimum-effective": positive("0.01"),
        "amplitude": spec("flat", ("nonsense", "nonsense", 1), "d-optimal:model.json", "d-optimal:model.json,2", ("d-optimal:missing.file,0.1", "missing.file: cannot be read", 1)),
        "amplitude-tolerance": number(None, "-1"), "method": choice("random"), "keep": choice(None), "iterations": integer(None, "0", "-1"),
        "starts": integer(None, "0", "-1"), "time-budget": positive(None), "threads": integer("1", "0", "-1"), "grid": choice("samples"),
        "seed": integer("2", "-1"), "start": {"good": "none", "bad": ["nonsense", ("model:missing.file", "missing.file: cannot be read", 1)]}, "mode": choice("torque"),
        "stroke": spec("1:2", "nonsense", "1", "1:0", "0:2", "nan:2", "1:1.5", "1:2:3"), "stroke-m": {**spec(None, "nonsense", "1", "1:0", "0:2", "nan:2"), "instead": LINEAR},
        "bias-velocity": number("0.1"), "bias-velocity-m-per-s": number(None), "periods": integer("10", "0", "-1"),
        "settle-time": number("1", "-1"), "predict": source("model.json"), "report": result("ok.html"),
        "dft-header": spec("block", "nonsense"),
        "separate": {**spec(None, "nonsense", "load_bias", ("load_bias,nonsense", "'nonsense'")), "with": ["--model", "model.json"]}, "model": source(None), "nats": positive(None), "out": {
            "good": "ok", "bad": [], "no_file": ["nowhere/x"]}}},
    "diagnose": {"operands": ["run.csv"], "base": {}, "options": {
        "validate": {**source("run2.csv"), "list": True}, "model": source("model.json"), "json-out": result("ok.json"), "report": result("ok.html"),
        "extended": result("ok.json"), "map": spec("torque_Nm=torque_Nm", "nonsense", "torque=a", "torque_Nm=a*0"), "rate": positive("1000")}},
    "doctor": {"operands": [], "base": {}, "options": {}},
    "drive": {"operands": [], "base": {"model": "model.json", "modbus": "tcp::0", "for": "0.05"}, "options": {
        "model": source("model.json"), "can": {"good": None, "bad": [], "no_file": ["none0"], "instead": SERVED}, "modbus": spec("tcp::0", "nonsense", "tcp:", "tcp:x:y"),
        "odrive": {"good": None, "bad": [], "no_file": ["none0"], "instead": SERVED}, "node": integer("3", "0", "128", "-1"), "for": positive("0.05"),
        "latch-delay": number(None, "-1", "1e9"), "reply-delay": number(None, "-1", "1e9"), "clock-drift": number(None, "1e9"),
        "period-tolerance": positive(None), "faults": spec(None, "nonsense", "drop", "drop:zz", "encoder-stuck:-1")}},
    "frf": {"operands": ["run.csv"], "base": {"out": "ok-frf.csv"}, "options": {
        "out": result("ok-frf.csv"), "method": choice("hann"), "domain": {"good": "discrete", "bad": ["nonsense"], "with": ["--method", "parametric"]},
        "delay-free": {**flag, "with": ["--method", "parametric"]}, "model-out": {**result("ok.json"), "with": ["--method", "parametric"]},
        "settle": {"good": "auto", "bad": ["nonsense", "-1", "1.5", "nan", "1e999"]}, "input": {"good": "torque_Nm", "bad": [], "no_file": ["nonsense"]},
        "output": {"good": "velocity_rad_per_s", "bad": [], "no_file": ["nonsense"]},
        "reference": {"good": "torque_ref_Nm", "bad": [], "no_file": ["nonsense"], "with": ["--method", "indirect"]},
        "order": {"good": "2", "bad": ["nonsense", "-1", "1.5", "nan", "1000"], "with": ["--method", "lpm"]},
        "half-width": {**integer("8", "0", "-1"), "with": ["--method", "lpm"]}, "segment": {**integer(None, "0", "-1", "3"), "with": ["--method", "lpm"]},
        "period": integer("500", "0", "-1", "2"), "lines": spec("odd:2:100:2", "nonsense", "linear:0:100:2", "linear:2:100:x"),
        "map": spec("torque_Nm=torque_Nm", "nonsense", "torque=a", "torque_Nm=a*0"), "rate": positive("1000"), "design": source(None),
        "hold": choice("band-limited"), "delay": number("0.001", "-1", "1e9"), "report": result("ok.html"), "compare": {**source("frf.csv"), "list": True}}},
    "manual": {"operands": ["frf"], "base": {}, "options": {}, "no_json": True},
    "measure": {"operands": [], "base": {"drive": "sim:model.json", "table": "table.mst", "periods": "2", "out": "ok-run.csv"}, "options": {
        "drive": {"good": "sim:model.json", "bad": ["nonsense", "can:", ("can:none0?node=0", "node=0: expected a whole number"), ("can:none0?bit=1", "'bit' is nothing that"),
                                                      ("modbus-tcp:x", "'x': expected HOST:PORT"), "slcan:"],
                  "no_file": ["sim:missing.file", "can:none0"]}, **playing}},
    "simulate": {"operands": [], "base": {"model": "model.json", "table": "table.mst", "periods": "2", "out": "ok-run.csv"}, "options": {
        "model": source("model.json"), "seed": integer("2", "-1"), **playing}},
    "tune": {"operands": ["frf.csv"], "base": {"bandwidth": "10"}, "options": {
        "bandwidth": positive("10"), "controller": choice("p"), "damping": number("0.9", "-1", "0", "11"), "delay": number("1", "-1", "101"),
        "rate": positive("1000"), "loop-delay": number("0", "-1", "2"), "weighting": choice("flat"),
        "corner": {**positive(None), "with": ["--controller", "pid"]},
        "notch": {"good": None, "bad": ["nonsense", "0:0.1", "10:-1", "10", "nan:0.1"], "with": ["--controller", "pi+notch"]},
        "biquad": {"good": None, "bad": ["nonsense", "0:0.1:1:1", "10:1"], "with": ["--controller", "pi+biquad"]},
        "out": result("ok.json"), "report": result("ok.html")}},
}


def offered():
    """Options of each subcommand, as the completion for fish has them."""
    lines = subprocess.run([program, "completion", "fish"], capture_output=True, text=True, check=True).stdout.splitlines()
    options = {}
    for line in lines:
        if "__fish_use_subcommand" in line:
            options.setdefault(line.split(" -a ")[1].split()[0], set())
        if " -l " in line:
            name = line.split("__fish_seen_subcommand_from ")[1].split("'")[0]
            options.setdefault(name, set()).add(line.split(" -l ")[1].split()[0])
    return {name: taken - {"json", "quiet", "help"} for name, taken in options.items()}


def words(subcommand, option=None, value=None, form="apart"):
    """A command line that is complete, with one option in the place of its own."""
    entry = table[subcommand]
    line = [program, subcommand]
    operands = list(entry["operands"])
    if subcommand == "convert" and option == "out":
        operands = operands[:1]
    line += operands
    for name, own in entry["options"].get(option, {}).get("instead", entry["base"]).items():
        if name != option:
            line += ["--" + name, own]
    if option:
        if form == "empty":
            line += ["--" + option + "="]
        elif value is None:
            line += ["--" + option]
        else:
            line += ["--" + option + "=" + value] if value.startswith("-") else ["--" + option, value]
        line += [word for word in entry["options"][option].get("with", [])]
        if form == "missing":  # nothing may stand behind it
            line = [word for word in line if word != "--" + option] + ["--" + option]
    return line


def refuse(subcommand, option, value, statuses, form="apart", say=None):
    line = words(subcommand, option, value, form)
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL)
    shown = " ".join(line[1:])
    wrong = []
    if done.returncode not in statuses:
        wrong.append(f"status {done.returncode}, expected {statuses}")
    if done.stdout:
        wrong.append(f"standard output: {done.stdout[:80]!r}")
    if done.stderr.count("\n") != 1 or not done.stderr.startswith(f"servoscope {subcommand}: "):
        wrong.append(f"not one line: {done.stderr!r}")
    names = say or [option, option.split("-")[0] + " "]
    if not any(name in done.stderr for name in names):
        wrong.append(f"none of {names} in {done.stderr!r}")
    if value and form == "apart" and not say and value not in done.stderr:
        wrong.append(f"no value '{value}' in {done.stderr!r}")
    return f"{shown}: {'; '.join(wrong)}" if wrong else None


def accept(line):
    done = subprocess.run(line, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL)
    return f"{' '.join(line[1:])}: status {done.returncode}: {done.stderr}" if done.returncode else None


def listing():
    return {name: os.stat(name).st_mtime_ns for name in os.listdir(".")}


def jobs(subcommand):
    for option, how in table[subcommand]["options"].items():
        if how is flag or how.get("good", "") is None and not how["bad"] and "no_file" not in how:
            continue
        if "delay-free" == option:
            continue
        yield (refuse, subcommand, option, None, [2], "missing")
        yield (refuse, subcommand, option, None, [2], "empty")
        for bad in how["bad"]:
            value, *said = bad if isinstance(bad, tuple) else (bad,)
            yield (refuse, subcommand, option, value, said[1:] or [2], "apart", said[:1] or None)
        for value in how.get("no_file", []):
            yield (refuse, subcommand, option, value, [1, 2], "apart", [value.removeprefix("sim:"), "none0"])


def good_lines(subcommand):
    yield words(subcommand)
    for option, how in table[subcommand]["options"].items():
        if how.get("good") or "delay-free" == option:
            yield words(subcommand, option, how["good"])


def twice(subcommand, option, how):
    line = words(subcommand, option, how["good"]) + ["--" + option] + ([how["good"]] if how["good"] else [])
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL)
    if done.returncode != 2 or f"--{option} is given twice" not in done.stderr:
        return f"{' '.join(line[1:])}: status {done.returncode}: {done.stderr}"
    return None


known = offered()
assert set(known) == set(table), set(known) ^ set(table)
for subcommand, options in known.items():
    if options != set(table[subcommand]["options"]):
        failures.append(f"{subcommand}: the table and the help differ in {options ^ set(table[subcommand]['options'])}")
tried = 0
with concurrent.futures.ThreadPoolExecutor(2) as pool:
    before = listing()
    results = []
    for subcommand in table:
        for job in jobs(subcommand):
            results.append(pool.submit(*job))
        for option, how in table[subcommand]["options"].items():
            if how.get("good") and not how.get("list"):
                results.append(pool.submit(twice, subcommand, option, how))
    for one in results:
        tried += 1
        failures += [one.result()] if one.result() else []
    left = {name for name, time in listing().items() if before.get(name) != time}
    if left:
        failures.append(f"wrong values left behind or touched {sorted(left)}")
    good = [pool.submit(accept, line) for subcommand in table if subcommand != "demo" for line in good_lines(subcommand)]
    for one in good:
        failures += [one.result()] if one.result() else []
print(f"{sum(map(len, known.values()))} options, {tried} wrong command lines, {len(good)} right ones")
for failure in failures:
    print("FAILED:", failure, file=sys.stderr)
sys.exit(1 if failures else 0)
