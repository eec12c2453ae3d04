#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Side by side, in one run: what each method makes of the first paper's testbed (1 Nm, 0.05 m/s on a pulley of 0.0159 m,
0.00516 kg m2, 200 lines 0.5 to 100 Hz) at the samples and for every instant, with processor time and ratios; a general
optimiser on the same problem; and how time and memory grow with the number of lines.

Processor times are the optimiser's, all threads added; short runs are repeated and the median is shown.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

TESTBED = ["--rate", "1000", "--period", "2000", "--lines", "linear:0.5:100:0.5", "--limit-torque", "1", "--inertia", "0.00516",
           "--limit-velocity-m-per-s", "0.05", "--pulley-radius", "0.0159"]
METHODS = [("newman", ["--method", "newman"]), ("schroeder", ["--method", "schroeder"]),
           ("clip", ["--method", "clip", "--keep", "all"]), ("mca", ["--method", "mca"]), ("linf", ["--method", "linf"]),
           ("fast, 1 start", ["--method", "fast", "--starts", "1"]), ("fast", ["--method", "fast"])]
SHORT_S, REPEATS, RESOLVED_S = 0.5, 5, 1e-3
# Lines and samples of a period; about 13 samples per period of the highest line.
GROWTH = [(100, 2**11), (1000, 2**14), (10000, 2**17)]
LINF_LINES_MAX = 100  # beyond it takes hours


class Failed(Exception):
    pass


def run(command):
    """Runs a command; returns its stdout, wall-clock seconds and peak memory in MB."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        begun = time.monotonic()
        process = subprocess.Popen(command, stdout=out, stderr=err)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall_s = time.monotonic() - begun
        out.seek(0)
        err.seek(0)
        if process.returncode != 0:
            raise Failed(err.read().decode().strip() or f"exit status {process.returncode}")
        return out.read().decode(), wall_s, usage.ru_maxrss / 1024


def design(program, prefix, options):
    text, wall_s, memory_mb = run([program, "design", "--json", "--out", prefix] + options)
    return dict(json.loads(text), wall_s=wall_s, memory_mb=memory_mb)


def design_repeated(program, prefix, options):
    results = [design(program, prefix, options)]
    while results[0]["cpu_s"] < SHORT_S and len(results) < REPEATS:
        results.append(design(program, prefix, options))
    return dict(results[0], cpu_s=statistics.median(result["cpu_s"] for result in results))


def ratio(a, b):
    """Of processor times; what the clock cannot resolve has none."""
    if not (a > RESOLVED_S and b > RESOLVED_S):
        return "-"
    return f"{a / b:.0f}" if a > 100 * b else f"{a / b:.2f}"


def compare(program, prefix, grid, scipy, extra):
    """One grid: the methods, then scipy where there is one for this grid."""
    print(f"\ntestbed, limits hold {'at the samples' if grid == 'samples' else 'at every instant'}")
    print(f"{'method':14s} {'torque [Nm]':>12s} {'every t [Nm]':>13s} {'crest':>6s} {'cpu [s]':>9s} {'cpu / mca':>10s} "
          f"{'scipy / cpu':>12s}")
    mca_s = None
    for name, options in METHODS:
        try:
            result = design_repeated(program, prefix, TESTBED + ["--grid", grid] + options + extra)
        except Failed as failure:
            print(f"{name:14s} {failure}")
            continue
        mca_s = result["cpu_s"] if name == "mca" else mca_s
        print(f"{name:14s} {result['effective_torque_Nm']:12.4f} {result['effective_torque_continuous_Nm']:13.4f} "
              f"{result['crest_factor']:6.3f} {result['cpu_s']:9.4f} {ratio(result['cpu_s'], mca_s) if mca_s else '':>10s} "
              f"{ratio(scipy['cpu_s'], result['cpu_s']) if scipy else '':>12s}".rstrip(), flush=True)
    if scipy:
        print(f"{'scipy trf':14s} {scipy['effective_torque_Nm']:12.4f} {'':13s} {'':6s} {scipy['cpu_s']:9.4f} "
              f"{ratio(scipy['cpu_s'], mca_s) if mca_s else '':>10s}")


def grow(program, prefix, extra):
    """1 Hz to K Hz, the velocity limiting the lowest tenth of them."""
    # A process counts the memory of the one that started it, from before it became itself.
    _, _, floor_mb = run(["true"])
    print("\ngrowth, limits hold at the samples; memory is the whole program's peak")
    print(f"{'lines':>6s} {'samples':>8s} {'method':14s} {'torque [Nm]':>12s} {'cpu [s]':>9s} {'wall [s]':>9s} {'memory [MB]':>12s}")
    for lines, samples in GROWTH:
        velocity = 1 / 0.00516 / (2 * 3.141592653589793 * 0.1 * lines)
        options = ["--rate", str(samples), "--period", str(samples), "--lines", f"linear:1:{lines}:1", "--limit-torque", "1",
                   "--limit-velocity", repr(velocity), "--inertia", "0.00516", "--grid", "samples"]
        for name, method in METHODS[3:]:
            if name == "linf" and lines > LINF_LINES_MAX:
                continue
            try:
                result = design(program, prefix, options + method + extra)
            except Failed as failure:
                print(f"{lines:6d} {samples:8d} {name:14s} {failure}")
                continue
            memory = f"{result['memory_mb']:.1f}" if result["memory_mb"] > 1.05 * floor_mb else f"< {floor_mb:.0f}"
            print(f"{lines:6d} {samples:8d} {name:14s} {result['effective_torque_Nm']:12.4f} {result['cpu_s']:9.3f} "
                  f"{result['wall_s']:9.3f} {memory:>12s}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True, help="servoscope")
    parser.add_argument("--scipy", help="a Python that has numpy and scipy; without it that row is left out")
    parser.add_argument("--part", choices=["testbed", "growth"], help="only this part")
    arguments, extra = parser.parse_known_args()
    scipy = None
    with tempfile.TemporaryDirectory() as folder:
        prefix = os.path.join(folder, "table")
        if arguments.part != "growth":
            if arguments.scipy:
                print("scipy's least_squares on the same problem: a minute or more ...", file=sys.stderr)
                text, _, _ = run([arguments.scipy, os.path.join(os.path.dirname(os.path.abspath(__file__)), "design_scipy.py")])
                scipy = json.loads(text)
            compare(arguments.program, prefix, "samples", scipy, extra)
            compare(arguments.program, prefix, "continuous", None, extra)
        if arguments.part != "testbed":
            grow(arguments.program, prefix, extra)


if __name__ == "__main__":
    try:
        main()
    except Failed as failure:
        sys.exit(f"bench design: {failure}")
