#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What firmware/firmware.sh has built and run, as a table against firmware/ceilings.txt: instructions of each call, flash and RAM
of each object and image, stack of each public function of lib/. Fails above a ceiling, on recursion, on a heap, on floating point
in the integer image of a Cortex-M0, and where the measured frequency response is not the simulated drive's.

usage: report.py FOLDER [--accept] [--document] [--ceilings FILE] CORE...
  --accept    writes the measured numbers to firmware/ceilings.txt
  --document  writes the tables of docs/firmware.md
"""
import argparse
import cmath
import fnmatch
import math
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DEFAULT_CEILINGS = ROOT / "firmware/ceilings.txt"
ALL_CORES = ["cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7"]
ROOMS = ["core", "msgen", "frf", "guard"]
# Of the compiler that the ceilings are from. Another one counts otherwise: its numbers are shown, and only that they are there
# is required.
PINNED = "12.2"
HEAP = re.compile(r"^_?(malloc|calloc|realloc|free|sbrk)(_r)?$")
FLOAT = re.compile(r"^__aeabi_([df]|[iul]+2[df]|[df]2)|^__(add|sub|mul|div|fix|float)[a-z]*[sd]f")
# Of the sample path in integers: no floating point in these objects, whatever a program links beside them.
INTEGER = re.compile(r"lib/(frf/(dft(?!.*f32)|block(_kernel)?\.c)|msgen/player\.c|guard/(guard|latch)\.c|core/)")
FRAME = {"cortex-m0": 32, "cortex-m3": 32, "cortex-m4f": 104, "cortex-m7": 104}  # what an exception pushes


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


class Figures(dict):
    """(kind, name) -> {core: value}"""

    def put(self, kind, name, core, value):
        self.setdefault((kind, name), {})[core] = int(value)


def counts(folder, core, figures):
    for line in (folder / core / "count.txt").read_text(encoding="utf-8").splitlines():
        name, value = line.split()
        figures.put("instructions", name, core, value)


def sizes(folder, core, figures):
    """text and constants of each object of lib/; whatever it would occupy in RAM; the images in whole."""
    for room in ROOMS:
        for path in sorted((folder / core).glob(f"CMakeFiles/servoscope_{room}.dir/lib/{room}/*.c.obj")):
            text, data, bss = map(int, run("arm-none-eabi-size", path).splitlines()[1].split()[:3])
            name = f"lib/{room}/{path.name[:-4]}"
            if text + data > 0:
                figures.put("flash", name, core, text + data)
            figures.put("ram", "lib/ (static)", core, figures.get(("ram", "lib/ (static)"), {}).get(core, 0) + data + bss)
    for path in sorted((folder / core / "firmware").glob("*.elf")):
        if path.stem != "count":
            text, data, bss = map(int, run("arm-none-eabi-size", path).splitlines()[1].split()[:3])
            figures.put("flash", path.stem, core, text + data)
            figures.put("ram", path.stem, core, data + bss)


def read_callgraph(folder, core, image):
    """Stack of each function and whom it calls, from the compiler's .ci files of the library and of one image; functions of one
    file have its name before theirs."""
    stack, calls = {}, {}
    for path in sorted((folder / core).rglob("*.ci")):
        if "/firmware/CMakeFiles/" in str(path) and not re.search(rf"/({image}|firmware_protocols)\.dir/", str(path)):
            continue
        text = path.read_text(encoding="utf-8").replace(f"{ROOT}/", "")
        for title, label in re.findall(r'node: { title: "([^"]*)" label: "([^"]*)"', text):
            size = re.search(r"(\d+) bytes \((\w[\w,]*)\)", label)
            if size:
                if size.group(2) not in ("static", "dynamic,bounded"):
                    raise SystemExit(f"report: {title}: stack of unbounded size")
                stack[title] = int(size.group(1))
                calls.setdefault(title, set())
        for caller, callee in re.findall(r'edge: { sourcename: "([^"]*)" targetname: "([^"]*)"', text):
            calls.setdefault(caller, set()).add(callee)
    return stack, calls


PUSH = re.compile(r"\t(?:push|stmdb\s+sp!,|stmfd\s+sp!,)\S*\s*\{([^}]*)\}|\tvpush\s*\{([^}]*)\}|\tsub(?:\.w)?\s+sp, (?:sp, )?#(\d+)"
                  r"|\tstr\S*\s.*\[sp, #-(\d+)\]!")


def registers(text, prefix):
    count = 0
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        count += int(last.lstrip(prefix)) - int(first.lstrip(prefix)) + 1 if last else 1
    return count


def read_disassembly(path, stack, calls):
    """The same of what no .ci file says, the compiler's and C library's functions and assembly: pushes added up, whatever their
    order, which is never too little."""
    for block in re.split(r"\n\n", run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", path)):
        head = re.search(r"^[0-9a-f]+ <(\S+)>:", block, re.M)
        if not head or head.group(1) in stack:
            continue
        name, size = head.group(1), 0
        for match in PUSH.finditer(block):
            pushed, vector, less, stored = match.groups()
            size += 4 * registers(pushed, "r") if pushed else 8 * registers(vector, "d") if vector else int(less or stored)
        stack[name] = size
        targets = re.findall(r"\tb[a-z.]*\s+[0-9a-f]+ <([^>+]+)>", block)
        calls.setdefault(name, set()).update(target for target in targets if target != name)
    by_address = {}
    for line in run("arm-none-eabi-nm", path).splitlines():
        address, kind, name = (line.split() + ["", ""])[:3]
        if kind in "tTwW":
            by_address.setdefault(address, []).append(name)
    for names in by_address.values():  # of a function with several names the disassembly has one
        known = [name for name in names if name in stack]
        for name in names:
            if known and name not in stack:
                stack[name] = 0
                calls[name] = {known[0]}


def add_indirect_calls(stack, calls):
    """Puts those that firmware/indirect-calls.txt lists in place of calls through a pointer; returns the callers in drivers/ that
    it does not list."""
    listed, unknown = {}, []
    for line in (ROOT / "firmware/indirect-calls.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            caller, _, callees = line.partition(": ")
            listed[caller] = callees.split()
    ours = re.compile(r"(core|msgen|frf|guard|sample_path|results|axis|can_door|modbus_door|board)_|(lib|firmware)/|main$")
    for caller, callees in calls.items():
        if "__indirect_call" in callees:
            callees.discard("__indirect_call")
            if caller not in listed:
                if ours.match(caller):
                    raise SystemExit(f"report: {caller} calls through a pointer; expected it in firmware/indirect-calls.txt")
                unknown.append(caller)
            for pattern in listed.get(caller, []):
                callees.update(name for name in stack if fnmatch.fnmatchcase(name, pattern))
    return unknown


def deepest(name, stack, calls, linked, done, path=()):
    """Bytes of stack from this call down. What the linker has left out is called by nobody."""
    if name in path:
        raise SystemExit("report: recursion: " + " -> ".join(path[path.index(name):] + (name,)))
    if name not in done:
        if name not in stack and name not in linked:
            return 0
        if name not in stack:
            raise SystemExit(f"report: {name}, called by {path[-1] if path else 'nobody'}: nothing says how much stack it takes")
        below = [deepest(callee, stack, calls, linked, done, path + (name,)) for callee in sorted(calls.get(name, ()))]
        done[name] = stack[name] + max(below, default=0)
    return done[name]


def public_functions():
    names = set()
    for room in ROOMS:
        for path in (ROOT / "lib" / room).glob("*.h"):
            text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.S)
            names.update(re.findall(rf"^(?!static|typedef|#)[\w ]+[ *](\w+)\([^;{{]*\);", text, re.M))
    return names


def stacks(folder, core, figures):
    """Of every public function of lib/, and of each image's main loop and interrupt. What is not in the image is not weighed."""
    public, weighed, unknown = public_functions(), set(), []
    for image in ("count", "stream", "example"):
        path = folder / core / "firmware" / f"{image}.elf"
        if not path.exists():
            continue
        stack, calls = read_callgraph(folder, core, image)
        read_disassembly(path, stack, calls)
        unknown += add_indirect_calls(stack, calls)
        linked = {line.split()[-1] for line in run("arm-none-eabi-nm", path).splitlines() if line.strip()}
        done = {}
        for name in sorted(linked & set(stack)):
            deepest(name, stack, calls, linked, done)
        for name in sorted(public & linked & set(done)):
            figures.put("stack", name, core, max(done[name], figures.get(("stack", name), {}).get(core, 0)))
        weighed.update(done)
        if image != "count":
            interrupt = deepest("board_sample_interrupt", stack, calls, linked, done)
            figures.put("stack", f"{image}: main loop", core, done["main"])
            figures.put("stack", f"{image}: interrupt, its frame included", core, interrupt + FRAME[core])
            toolchain = (ROOT / f"cmake/toolchains/{core}.cmake").read_text(encoding="utf-8")
            room = int(re.search(r"FIRMWARE_STACK (\d+)", toolchain).group(1))
            if done["main"] + interrupt + FRAME[core] > room:
                raise SystemExit(f"report: {core}: {image}: main loop and interrupt need {done['main'] + interrupt + FRAME[core]} bytes "
                                 f"of stack, the linker leaves {room}")
    return len(weighed), sorted(set(unknown))


def check_symbols(folder, core):
    failures = []
    for image in sorted((folder / core / "firmware").glob("*.elf")):
        names = [line.split()[-1] for line in run("arm-none-eabi-nm", image).splitlines() if line.strip()]
        failures += [f"{core}: {image.stem}: {name}: expected no heap" for name in names if HEAP.match(name)]
        if core == "cortex-m0" and image.stem == "stream":
            failures += [f"{core}: {image.stem}: {name}: expected no floating point" for name in names if FLOAT.match(name)]
    objects = [(path, f"lib/{path.parent.name}/{path.name[:-4]}") for path in sorted((folder / core).rglob("lib/*/*.c.obj"))]
    integer = [(path, name) for path, name in objects if INTEGER.match(name)]
    if core == "cortex-m0":
        for path, name in integer:
            symbols = [line.split()[-1] for line in run("arm-none-eabi-nm", "--undefined-only", path).splitlines() if line.strip()]
            failures += [f"{core}: {name}: {symbol}: expected no floating point" for symbol in symbols if FLOAT.match(symbol)]
        if len(integer) < 20:
            failures.append(f"{core}: {len(integer)} objects of the integer sample path, expected 20 and more")
    return failures


# ---- The frequency response against the simulated drive's own equations

def belt_constants():
    text = (ROOT / "firmware/belt.h").read_text(encoding="utf-8")
    return {name: float(value) for name, value in re.findall(r"#define BELT_(\w+)\s+([0-9.]+)[fu]", text)}


def belt_response(frequency_hz):
    """From the torque that has acted since the last sample to the speed at the sample: z C (z I - A)^-1 B, A and B by moving the
    drive from each state of 1, as firmware/belt.c moves it."""
    k = belt_constants()
    step = k["SAMPLE_S"] / k["SUBSTEPS"]

    def move(state, torque):
        position, velocity, load_position, load_velocity = state
        for _ in range(int(k["SUBSTEPS"])):
            belt = (k["STIFFNESS_NM_PER_RAD"] * (position - load_position)
                    + k["DAMPING_NMS_PER_RAD"] * (velocity - load_velocity))
            motor, load = torque - belt - k["FRICTION_NMS_PER_RAD"] * velocity, belt - k["FRICTION_NMS_PER_RAD"] * load_velocity
            velocity += step / k["MOTOR_INERTIA_KGM2"] * motor
            load_velocity += step / k["LOAD_INERTIA_KGM2"] * load
            position += step * velocity
            load_position += step * load_velocity
        return [position, velocity, load_position, load_velocity]

    columns = [move([float(i == j) for i in range(4)], 0.0) for j in range(4)]
    drive = move([0.0] * 4, 1.0)
    z = cmath.exp(2j * math.pi * frequency_hz * k["SAMPLE_S"])
    rows = [[(z if i == j else 0) - columns[j][i] for j in range(4)] + [drive[i]] for i in range(4)]
    for i in range(4):
        pivot = max(range(i, 4), key=lambda r: abs(rows[r][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for r in range(4):
            if r != i:
                factor = rows[r][i] / rows[i][i]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i])]
    return z * rows[1][4] / rows[1][1]


# Of the response: what single precision, converters of 16 bits and, at low frequencies, what is left of the start transient do.
RESPONSE_TOLERANCE = 1e-3


def check_response(folder, core):
    path = folder / core / "example.txt"
    if not path.exists():
        return [], None
    worst, failures = 0.0, []
    for line in path.read_text(encoding="utf-8").splitlines():
        if re.match(r"^\d+ ", line) and len(line.split()) == 5:
            frequency, real, imaginary, _, valid = map(float, line.split())
            expected = belt_response(frequency)
            error = abs(complex(real, imaginary) - expected) / abs(expected)
            worst = max(worst, error)
            if not (valid == 1 and error <= RESPONSE_TOLERANCE):
                failures.append(f"{core}: {frequency:g} Hz: {real} {imaginary}: expected {expected:.4f} within {RESPONSE_TOLERANCE:.2%}")
    return failures if worst > 0 else [f"{core}: no frequency response in {path}"], worst


# ---- Ceilings

def read_ceilings(path):
    ceilings = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            if line and not line.startswith("#"):
                kind, name, *values = re.split(r"\s{2,}", line.strip())
                ceilings[kind, name] = {core: int(value) for core, value in zip(ALL_CORES, values) if value != "-"}
    return ceilings


def write_ceilings(path, figures, version):
    lines = ["# SPDX-License-Identifier: MIT",
             "# What the library may cost on a Cortex-M; ./run firmware compares, and writes this with --accept.",
             f"# arm-none-eabi-gcc {version}, -O2. Instructions of a call (the most of all calls; 'mean' over a period), bytes of flash",
             "# and RAM, bytes of stack from a call down. A count may be off by 2 instructions. The example, which holds the protocols",
             "# too, is given a tenth of room.",
             f"# {'kind':12}  {'name':58}" + "".join(f"  {core:>10}" for core in ALL_CORES)]
    for (kind, name), values in figures.items():
        allowed = {core: -(-value * 11 // 2560) * 256 if name.startswith("example") else value for core, value in values.items()}
        lines.append(f"{kind:14}  {name:58}" + "".join(f"  {allowed.get(core, '-'):>10}" for core in ALL_CORES))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def slack(kind):
    """The counter's resolution."""
    return 2 if kind == "instructions" else 0


def compare(figures, ceilings, cores, gated):
    failures, last = [], None
    print(f"\n{'':58}" + "".join(f"{core:>20}" for core in cores))
    for (kind, name), values in figures.items():
        if kind != last:
            print(f"{kind}" + (" of a call, the most" if kind == "instructions" else ", bytes"))
            last = kind
        row = f"  {name:56}"
        for core in cores:
            value, ceiling = values.get(core), ceilings.get((kind, name), {}).get(core)
            if value is None:
                row += f"{'-':>20}"
                continue
            change = "no ceiling" if ceiling is None else "=" if value == ceiling else f"{value - ceiling:+d}"
            row += f"{f'{value} ({change})':>20}"
            if gated and (ceiling is None or value > ceiling + slack(kind)):
                failures.append(f"{core}: {kind}: {name}: {value}: expected at most {ceiling}")
        print(row)
    missing = [f"{core}: {kind}: {name}: has a ceiling, but was not measured" for (kind, name), values in ceilings.items()
               for core in cores if core in values and core not in figures.get((kind, name), {})]
    return failures + missing


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("cores", nargs="+")
    parser.add_argument("--accept", action="store_true")
    parser.add_argument("--ceilings", type=pathlib.Path, default=DEFAULT_CEILINGS)
    parser.add_argument("--document", action="store_true")
    arguments = parser.parse_args()
    figures, failures = Figures(), []
    version = run("arm-none-eabi-gcc", "-dumpfullversion").strip()
    for part in (counts, sizes):
        for core in arguments.cores:
            part(arguments.folder, core, figures)
    for core in arguments.cores:
        functions, unknown = stacks(arguments.folder, core, figures)
        failures += check_symbols(arguments.folder, core)
        problems, worst = check_response(arguments.folder, core)
        failures += problems
        print(f"{core}: {functions} functions, none recursive; no heap; " +
              ("no floating point" if worst is None else f"frequency response within {worst:.2%} of the drive's equations"))
        if unknown:
            print(f"{core}: calls through pointers that are not followed: {', '.join(unknown)}")
    figures = Figures(sorted(figures.items(), key=lambda item: ("instructions", "flash", "ram", "stack").index(item[0][0])))
    gated = version.startswith(PINNED) and not arguments.accept
    failures += compare(figures, read_ceilings(arguments.ceilings), arguments.cores, gated)
    if arguments.accept:
        write_ceilings(arguments.ceilings, figures, version)
    if not version.startswith(PINNED):
        print(f"\nThe ceilings are of gcc {PINNED}, this is {version}: shown, not enforced.")
    if arguments.document:
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(ROOT / "firmware"))
        import document
        document.write(figures)
    for failure in failures:
        print(f"FAILED: {failure}", file=sys.stderr)
    if failures:
        print("What is meant to cost more: ./run firmware --accept", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
