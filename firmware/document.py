# SPDX-License-Identifier: MIT
"""The tables of docs/firmware.md from what firmware/report.py has measured: between the marks that name them."""
import pathlib
import re

PAGE = pathlib.Path(__file__).resolve().parent.parent / "docs/firmware.md"
CLOCK_HZ = 168e6
# Of the block DFT's inner loop by the core's manual, zero wait states: 3 loads of 4 words, 5 cycles each, and 8 rounding
# multiply-accumulates, 1 each, are 23 cycles in 11 instructions. Taken for all code.
CYCLES_PER_INSTRUCTION = 23 / 11
BINS, CHANNELS, RATES_HZ = (32, 64, 200), (1, 2, 3), (8000, 16000)
# CMSIS-DSP, real FFT of one block, arm-none-eabi-gcc 12.2 -O2, counted in the same way.
FFT = {"f32": {512: 24218, 1024: 44687, 2048: 108296, 4096: 229521},
       "q31": {512: 37239, 1024: 87278, 2048: 170300, 4096: 391781},
       "q15": {512: 18450, 1024: 44540, 2048: 84059, 4096: 198779}}
FFT_BYTES = {"f32": 4, "q31": 4, "q15": 2}
CORE = "cortex-m4f"
LISTED = ("guard_step", "guard_clip_torque", "msgen_player_step/whole-period", "msgen_player_step",
          "frf_block_add_i16/spread-mean/32-bins/2-channels", "frf_block_add_i16/spread-longest/32-bins/2-channels",
          "frf_block_add_i16/in-blocks-mean/32-bins/2-channels", "frf_block_add_i16/at-once-longest/32-bins/2-channels",
          "frf_dft_add_i16/q15/32-bins/2-channels", "frf_dft_add_i16/q31/32-bins/2-channels", "frf_block_latest",
          "frf_block_sums", "core_crc32/1024-bytes")


def instructions(figures, name, core=CORE):
    return figures["instructions", name][core]


def block(figures, what, bins, channels):
    return instructions(figures, f"frf_block_add_i16/{what}/{bins}-bins/{channels}-channel{'s' if channels > 1 else ''}")


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "|".join("---" if i == 0 else "---:" for i in range(len(head))) + "|"]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def counted(figures):
    cores = ("cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7")
    rows = [[f"`{name}`"] + [figures["instructions", name].get(core, "") for core in cores] for name in LISTED]
    return table(["instructions of a call", "M0", "M3", "M4F", "M7"], rows)


def memory(figures):
    rows = [[f"`{name}`"] + [figures["flash", name].get(core, "") for core in ("cortex-m0", "cortex-m4f")]
            for kind, name in figures if kind == "flash" and name.startswith("lib/")]
    stack = [[f"`{name}`", *(figures["stack", name].get(core, "") for core in ("cortex-m0", "cortex-m4f"))]
             for name in ("frf_block_add_i16", "frf_dft_add_i16", "guard_step", "msgen_player_step", "msgen_table_open",
                          "frf_statistics_add", "frf_block_build")]
    images = [[kind, name, *(figures[kind, name].get(core, "") for core in ("cortex-m0", "cortex-m4f"))]
              for kind, name in figures if kind in ("flash", "ram") and name in ("stream", "example")]
    return (table(["flash, bytes", "M0", "M4F"], rows) + "\n\n" + table(["stack from the call down, bytes", "M0", "M4F"], stack)
            + "\n\n" + table(["bytes of", "image", "M0", "M4F"], images))


# Of the exact DFT's tables: bytes of an entry, and what tests/unit require of the worst bin at N = 2000, 16384, 65536, dB.
ENTRY_BYTES = {"q15": 2, "q23": 4, "q31": 4, "f32": 4}
SAMPLES = (2000, 16384, 65536)
REQUIRED_DB = {"q15": "100 / 108 / 115", "q23": "141 / 156 / 163", "q31": "190 / 200 / 205", "f32": "125 / 118 / 115"}
REQUIRED_TWO_LEVEL_DB = {**REQUIRED_DB, "q31": "183 / 186 / 189"}


def table_bytes(kind, number, samples):
    """Of lib/frf/twiddle.h's macros, N being a multiple of 4."""
    if kind == "full":
        return samples * 5 // 4 * ENTRY_BYTES[number]
    if kind == "quarter":
        return (samples // 4 + 1) * ENTRY_BYTES[number]
    bits = next(bits for bits, least in ((8, 32768), (7, 8192), (6, 2048), (5, 1024)) if samples >= least)
    return 8 * -(-samples // 2 ** bits) + (4 if number == "q15" else 8) * 2 ** bits


def twiddles(figures):
    """A sample, bin and channel of 32 bins and two channels, fed in blocks; all of the kernel's object."""
    rows = []
    for number in ("q15", "q23", "q31", "f32"):
        for kind in ("full", "quarter", "two-level"):
            row = [f"{number}, {kind}"] + [table_bytes(kind, number, samples) for samples in SAMPLES]
            name = "lib/frf/dft_" + (number if kind == "full" else f"{kind.replace('-', '_')}_{number}") + ".c"
            row += [figures["flash", name].get(core, "") for core in ("cortex-m0", "cortex-m4f")]
            for core in ("cortex-m0", "cortex-m4f"):
                each = {what: instructions(figures, f"frf_dft_add/{number}/{kind}/{what}/32-bins/2-channels", core) / 64
                        for what in ("in-blocks-mean", "a-frame")}
                row.append(f"{each['in-blocks-mean']:.1f} / {each['a-frame']:.1f}")
            rows.append(row + [(REQUIRED_TWO_LEVEL_DB if kind == "two-level" else REQUIRED_DB)[number]])
    return table(["factors, table", "bytes at N = 2000", "16384", "65536", "code M0", "code M4F", "instructions M0", "M4F",
                  "worst bin at least, dB"], rows)


def headroom(figures):
    """Guard, clip, player and DFT: everything of the library in the interrupt."""
    shared = sum(instructions(figures, name) for name in ("guard_step", "guard_clip_torque", "msgen_player_step/whole-period"))
    rows = []
    for bins in BINS:
        for channels in CHANNELS:
            mean = shared + block(figures, "spread-mean", bins, channels)
            longest = shared + block(figures, "spread-longest", bins, channels)
            row = [bins, channels, mean]
            row += [f"{100 * mean * CYCLES_PER_INSTRUCTION * rate / CLOCK_HZ:.1f} %" for rate in RATES_HZ]
            longest_us = longest * CYCLES_PER_INSTRUCTION / CLOCK_HZ * 1e6
            row += [f"{longest_us:.1f}"] + [f"{100 * longest_us * rate / 1e6:.0f} %" for rate in RATES_HZ]
            rows.append(row)
    return table(["bins", "channels", "instructions a sample", "load, 8 kHz", "load, 16 kHz", "longest call, µs", "of a period, 8 kHz",
                  "of a period, 16 kHz"], rows)


LINES = (("", "any, L = 32"), ("any-cut/", "the same, N no whole blocks"),
         ("below-0.1/", "below 0.1 of the sample rate, L = 64"), ("below-0.02/", "below 0.02 of it, L = 128"),
         ("odd/", "odd, folded, L = 32"))


def spread(figures):
    """A call per frame, the work spread: mean, longest, and what that is of the mean."""
    rows = []
    for name, words in LINES:
        for channels in CHANNELS:
            row = [words, channels]
            for bins in BINS:
                what = f"{name}{bins}-bins/{channels}-channel{'s' if channels > 1 else ''}"
                mean, longest, percent = (instructions(figures, f"frf_block_add_i16/spread-{kind}/{what}")
                                          for kind in ("mean", "longest", "longest-percent-of-mean"))
                row.append(f"{mean} / {longest} ({percent / 100:.2f})")
            rows.append(row)
    return table(["lines", "channels"] + [f"{bins} bins" for bins in BINS], rows)


def line_through(figures, what):
    """Instructions per sample and channel as a + b K, from the fewest and the most bins with two channels."""
    first, last = (block(figures, what, bins, 2) / 2 for bins in (BINS[0], BINS[-1]))
    slope = (last - first) / (BINS[-1] - BINS[0])
    return first - slope * BINS[0], slope


def break_even(a, b, per_sample):
    bins = (per_sample - a) / b
    return "never" if bins < 1 else f"{bins:.0f}"


def fft(figures):
    spread, blocks = line_through(figures, "spread-mean"), line_through(figures, "in-blocks-mean")
    rows = []
    for number, costs in FFT.items():
        for samples, cost in costs.items():
            burst_us = cost * CYCLES_PER_INSTRUCTION / CLOCK_HZ * 1e6
            ram = 2 * samples * FFT_BYTES[number] / 1024
            rows.append([f"{number}, N = {samples}", f"{cost / samples:.1f}", f"{burst_us:.0f}", f"{burst_us * 8e-3:.1f}",
                         f"{ram:g} KiB", break_even(*blocks, cost / samples), break_even(*spread, cost / samples)])
    own = [f"The block DFT costs {blocks[0]:.0f} + {blocks[1]:.2f} K instructions a sample and channel fed in blocks of 32, "
           f"{spread[0]:.0f} + {spread[1]:.2f} K fed sample by sample and spread (L = 32, any lines, two channels, K bins).", ""]
    return "\n".join(own) + "\n" + table(["block FFT", "instructions a sample", "burst, µs", "burst, samples of 8 kHz", "RAM a channel",
                                          "DFT in blocks is cheaper up to K", "DFT spread is cheaper up to K"], rows)


def write(figures):
    text = PAGE.read_text(encoding="utf-8")
    for name, make in (("counted", counted), ("twiddles", twiddles), ("memory", memory), ("headroom", headroom), ("spread", spread),
                       ("fft", fft)):
        mark = re.compile(rf"(<!-- {name}: .*?-->\n).*?(<!-- end -->)", re.S)
        if not mark.search(text):
            raise SystemExit(f"document: {PAGE.name}: no place for the table '{name}'")
        text = mark.sub(lambda match, made=make(figures): match.group(1) + "\n" + made + "\n\n" + match.group(2), text)
    PAGE.write_text(text, encoding="utf-8")
