# SPDX-License-Identifier: MIT
"""The figures that are promised of a design, from the files it writes. Columns: what, band, measured, good or not."""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy

INERTIA_KGM2, TORQUE_NM, SPEED_RAD_PER_S = 0.00516, 1.0, 0.05 / 0.0159
TESTBED = ["--rate", "1000", "--period", "2000", "--lines", "linear:0.5:100:0.5", "--limit-torque", "1", "--inertia",
           str(INERTIA_KGM2), "--limit-velocity-m-per-s", "0.05", "--pulley-radius", "0.0159"]
FLAT = ["--rate", "1000", "--period", "2000", "--lines", "linear:0.5:100:0.5", "--limit-torque", "1", "--inertia", "0.005"]
MANY = ["--rate", "4096", "--period", "4096", "--lines", "linear:1:815:1", "--limit-torque", "1", "--inertia", "0.005"]
OVERSAMPLING = 64


class Bench:
    def __init__(self, program, folder):
        self.program, self.folder, self.missed = program, folder, 0

    def design(self, options):
        """Runs one design; its JSON, for what no file holds (processor time)."""
        command = [self.program, "design", "--json", "--out", str(self.folder / "d")] + options
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    def columns(self, name="d"):
        """The columns of the CSV and its excited bins."""
        bins, names, rows = None, None, []
        for line in (self.folder / f"{name}.csv").read_text().splitlines():
            if line.startswith("# excited_bins:"):
                bins = numpy.array(json.loads(line.split(":", 1)[1]))
            elif not line.startswith("#"):
                if names is None:
                    names = line.split(",")
                else:
                    rows.append([float(cell) for cell in line.split(",")])
        return dict(zip(names, numpy.array(rows).T)), bins

    def row(self, what, band, values, good, unit="Nm"):
        text = f"{min(values):.4f}" if len(values) == 1 else f"{min(values):.4f} .. {max(values):.4f} ({len(values)} seeds)"
        self.missed += not good
        print(f"{what:46s} {band:24s} {text + ' ' + unit:34s} {'good' if good else 'MISSED'}", flush=True)


def rms(x):
    return float(numpy.sqrt(numpy.mean(x**2)))


def between(x):
    """Largest absolute value on 64 times as many points."""
    return float(numpy.abs(numpy.fft.irfft(numpy.fft.rfft(x), OVERSAMPLING * len(x)) * OVERSAMPLING).max())


def effective_within(bench, options, oversampled):
    """Effective torque of a testbed design, NaN if it leaves a limit or its columns do not belong together."""
    bench.design(TESTBED + options)
    data, bins = bench.columns()
    torque, speed = data["torque_Nm"], data["velocity_rad_per_s"]
    largest = between if oversampled else (lambda x: float(numpy.abs(x).max()))
    omega = 2 * numpy.pi * numpy.arange(len(torque) // 2 + 1) * 1000 / len(torque)
    position = numpy.fft.rfft(data["position_rad"])
    derived = numpy.fft.irfft(-omega**2 * position) * INERTIA_KGM2
    others = numpy.delete(numpy.abs(position), bins)
    tolerance = 1e-6
    sound = (numpy.abs(derived - torque).max() < tolerance and others.max() < tolerance * numpy.abs(position).max()
             and largest(torque) <= TORQUE_NM + tolerance and largest(speed) <= SPEED_RAD_PER_S * (1 + tolerance))
    return rms(torque) if sound else float("nan")


def testbed(bench, seed):
    samples = ["--grid", "samples"]
    for what, options, low, high in (("standard clipping, keep all", ["--method", "clip", "--keep", "all"], 0.631, 0.635),
                                     ("modified clipping", ["--method", "mca"], 0.6924, 0.6944),
                                     ("L-infinity", ["--method", "linf"], 0.718, 0.727)):
        value = effective_within(bench, samples + options, False)
        bench.row(what + ", samples", f"{low} .. {high}", [value], low <= value <= high)
    value = effective_within(bench, samples + ["--starts", "1"], False)
    bench.row("fast, one start, samples", "at least 0.7195", [value], value >= 0.7195)
    values = [effective_within(bench, samples + ["--seed", str(seed + i)], False) for i in range(9)]
    bench.row("fast, default, samples", "worst at least 0.7235", values, min(values) >= 0.7235)
    values = [effective_within(bench, ["--seed", str(seed + i)], True) for i in range(5)]
    bench.row(f"fast, default, continuous ({OVERSAMPLING}x within)", "worst at least 0.7150", values, min(values) >= 0.7150)


def tolerance(bench, seed):
    values, spreads = [], []
    for i in range(3):
        values.append(effective_within(bench, ["--grid", "samples", "--amplitude-tolerance", "1", "--seed", str(seed + i)], False))
        data, bins = bench.columns()
        found = numpy.abs(numpy.fft.rfft(data["torque_Nm"]))[bins] * 2 / len(data["torque_Nm"])
        omega = 2 * numpy.pi * bins * 0.5
        alone = numpy.minimum(SPEED_RAD_PER_S * omega * INERTIA_KGM2, TORQUE_NM)
        spreads.append(20 * numpy.log10((found / alone).max() / (found / alone).min()))
    bench.row("amplitudes within 1 dB, samples", "at least 0.756", values, min(values) >= 0.756)
    bench.row("  their spread about the prescribed ones", "at most 2", spreads, max(spreads) <= 2 + 1e-6, "dB")


def crest(bench, options, oversampled):
    said = bench.design(options)
    torque = bench.columns()[0]["torque_Nm"]
    return (between(torque) if oversampled else float(numpy.abs(torque).max())) / rms(torque), said["cpu_s"]


def flat(bench):
    value, _ = crest(bench, FLAT + ["--grid", "samples"], False)
    bench.row("flat, 200 lines, crest factor at the samples", "at most 1.372", [value], value <= 1.372, "")
    value, _ = crest(bench, FLAT, True)
    bench.row("flat, 200 lines, true crest factor", "at most 1.386", [value], value <= 1.386, "")
    value, cpu_s = crest(bench, MANY + ["--grid", "samples"], False)
    bench.row("flat, lines 1..815 of N = 4096, samples", "at most 1.328", [value], value <= 1.328, "")
    bench.row("  processor time", "under 0.5 (aim)", [cpu_s], cpu_s < 0.5, "s")


def sequences(bench):
    values = []
    for lines, period in ((250, 5000), (500, 5000), (1000, 10000), (2000, 20000)):
        bench.design(["--rate", str(period), "--period", str(period), "--lines", f"linear:1:{lines}:1", "--method", "schroeder",
                      "--amplitude", "flat", "--limit-torque", "1", "--inertia", "0.005", "--grid", "samples"])
        data, bins = bench.columns()
        amplitude = numpy.abs(numpy.fft.rfft(data["torque_Nm"]))[bins].mean() * 2 / period
        values.append(between(data["torque_Nm"]) / (amplitude * numpy.sqrt(lines)))
    bench.row("Schroeder, peak over sqrt(N)", "1.17 .. 1.21", values, all(1.17 <= v <= 1.21 for v in values), "(N = 250 .. 2000)")
    bench.design(["--rate", "500", "--period", "5000", "--lines", "octaves:0.1:25:0.1", "--limit-torque", "1", "--inertia", "1"])
    hits = 0
    for segment in json.loads((bench.folder / "d.json").read_text())["segments"]:
        text = json.dumps(segment)
        for file in sorted(bench.folder.glob("d-*.csv")):
            if f'"{file.stem}.mst"' in text:
                _, bins = bench.columns(file.stem)
                band = set(bins.tolist())
                products = {2 * a for a in band} | {3 * a for a in band}
                products |= {a + b for a in band for b in band} | {a - b for a in band for b in band}
                hits += len(products & band)
    bench.row("octaves: harmonics, second order in band", "none", [float(hits)], hits == 0, "")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    parser.add_argument("--seed", type=int, default=1, help="first of the seeds")
    parser.add_argument("--budget", action="store_true", help="a minute of starts too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(arguments.program, pathlib.Path(folder))
        testbed(bench, arguments.seed)
        if arguments.budget:
            value = effective_within(bench, ["--grid", "samples", "--time-budget", "60"], False)
            bench.row("fast --time-budget 60, samples", "0.7285 (aim)", [value], value >= 0.7285)
        tolerance(bench, arguments.seed)
        flat(bench)
        sequences(bench)
    print(f"{bench.missed} outside their band")
    return 1 if bench.missed else 0


if __name__ == "__main__":
    sys.exit(main())
