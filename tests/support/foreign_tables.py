#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tables as loggers, scopes and spreadsheets export them, one recording in each: 200 rows at 1 kHz.

Writes NAME.csv for every case into the current folder and cases.txt: one line "NAME|ARGUMENTS|PARTS" each. PARTS are what the program
has to say, separated by "&&"; a case whose PARTS begin with "refuse " is to be refused with the rest. What is not refused holds
time_s, torque_Nm and position_rad of `expected`, to the digits that were written.
"""
import codecs
import datetime
import gzip
import json
import math

ROWS = 200
torque = [round(1.5 * math.sin(0.1 * k), 4) for k in range(ROWS)]
angle = [round(90.0 * math.sin(0.05 * k + 1), 3) for k in range(ROWS)]
time = [round(0.001 * k, 6) for k in range(ROWS)]
cases = []


def comma(x):
    return str(x).replace(".", ",")


def case(name, text, parts, arguments="", encoding="utf-8", lost=()):
    """lost: rows that are to be marked."""
    data = text if isinstance(text, bytes) else text.encode(encoding)
    with open(name + ".csv", "wb") as file:
        file.write(data)
    cases.append((name, arguments, parts, list(lost)))


def table(names, rows, separator=";", end="\n", before="", after=""):
    return before + end.join(separator.join(r) for r in [names] + rows) + end + after


def plain(number=str, unit_ms=False):
    return [[number(round(1000 * t, 3) if unit_ms else t), number(m), number(a)] for t, m, a in zip(time, torque, angle)]


names = ["Zeit [s]", "Moment [Nm]", "Lage [°]"]
case("semicolon_comma", table(names, plain(comma)), "cells between semicolons, decimal comma&&time_s is Zeit in s")
case("bom_crlf", codecs.BOM_UTF8 + table(names, plain(comma), end="\r\n").encode(), "times 0.0174533")
case("utf16_le", codecs.BOM_UTF16_LE + table(names, plain(comma), "\t", "\r\n").encode("utf-16-le"), "characters are UTF-16&&tabs")
case("utf16_be", codecs.BOM_UTF16_BE + table(names, plain(), ",").encode("utf-16-be"), "characters are UTF-16&&commas, decimal point")
case("utf16_no_mark", table(names, plain(comma)).encode("utf-16-le"), "characters are UTF-16")
case("latin1", table(["Zeit [s]", "Moment [Nm]", "Lage [°]"], plain(comma)), "characters are Windows-1252", encoding="latin-1")
case("old_mac", table(names, plain(comma), end="\r"), "semicolons, decimal comma")
case("quoted", table(['"Time (s)"', '"Torque, motor (Nm)"', '"Position, motor (deg)"'],
                     [[f'"{c}"' for c in row] for row in plain()], ","), "cells between commas, decimal point")
case("quoted_commas", table(['"Zeit [s]"', '"Moment [Nm]"', '"Lage [°]"'], [[f'"{c}"' for c in row] for row in plain(comma)], ","),
     "cells between commas, decimal comma")
case("two_line_names", table(['"Time\n[s]"', '"Torque\n[Nm]"', '"Angle\r\n[deg]"'], plain(), ","), "names in line 1")
case("units_row", table(["Time", "Torque", "Angle"], [["(ms)", "(Nm)", "(deg)"], ["", "", ""]] + plain(unit_ms=True), ","),
     "units behind it&&time_s is Time in ms")
case("units_unknown", table(["t", "M", "phi", "flow"], [["s", "Nm", "°", "furlong/h"]] + [r + ["7"] for r in plain()], "\t"),
     "units behind it&&flow [furlong/h] under its own name")
case("milliseconds", table(["time_ms", "torque_Nm", "angle_deg"], plain(unit_ms=True), ";"), "time_s is time_ms, in the unit of its name")
case("microseconds", table(["Timestamp (µs)", "M (Nm)", "phi (°)"],
                           [[str(1000 * k), str(torque[k]), str(angle[k])] for k in range(ROWS)], ","), "time_s is Timestamp in")
start = datetime.datetime(2026, 2, 28, 23, 59, 59, 900000)
stamps = [start + datetime.timedelta(microseconds=1000 * k) for k in range(ROWS)]
case("iso", table(["Timestamp", "M [Nm]", "phi [deg]"], [[s.isoformat(timespec="milliseconds") + "Z", str(m), str(a)]
                                                       for s, m, a in zip(stamps, torque, angle)], ","),
     "time_s is Timestamp, from its first time on")
case("german_stamps", table(["Datum/Zeit", "M [Nm]", "phi [°]"], [[s.strftime("%d.%m.%Y %H:%M:%S,") + f"{s.microsecond // 1000:03}", comma(m),
                                                                   comma(a)] for s, m, a in zip(stamps, torque, angle)]),
     "decimal comma&&time_s is Datum/Zeit")
case("midnight", table(["Uhrzeit", "M [Nm]", "phi [°]"], [[s.strftime("%H:%M:%S.%f"), str(m), str(a)]
                                                        for s, m, a in zip(stamps, torque, angle)]), "time_s is Uhrzeit")
case("date_and_clock", table(["Date", "Time", "M [Nm]", "phi [°]"], [[s.strftime("%Y-%m-%d"), s.strftime("%H:%M:%S.%f"), str(m), str(a)]
                                                                    for s, m, a in zip(stamps, torque, angle)], "\t"),
     "lost: column 1, Date: holds no numbers&&time_s is Time")
case("coarse_stamps", table(["Time", "M [Nm]", "phi [°]"], [[s.strftime("%H:%M:%S"), str(m), str(a)]
                                                          for s, m, a in zip(stamps, torque, angle)]),
     "refuse two rows have the same time, which is coarser than the samples: expected --rate HZ")
case("ticks", table(["Time [ticks]", "M [Nm]", "phi [°]"], plain()), "refuse which is no unit that is known: expected --map time_s=")


def grouped(x, mark, decimal):
    whole, _, part = f"{abs(x):,.3f}".partition(".")
    return ("-" if x < 0 else "") + whole.replace(",", mark) + decimal + part


def with_encoder(mark, decimal):
    write = (lambda x: str(x)) if decimal == "." else comma
    return [[write(t), write(m), write(a), grouped(12345.678 * (k + 1), mark, decimal)] for k, (t, m, a) in enumerate(zip(time, torque, angle))]


for name, mark, decimal in ("german", ".", ","), ("english", ",", "."), ("swiss", "'", "."), ("french", "\u202f", ","):
    case("thousands_" + name, table(names + ["Geber"], with_encoder(mark, decimal)), "Geber under its own name")
case("thousands_unproven", table(names + ["Geber"], [[comma(t), comma(m), comma(a), "12.345"] for t, m, a in zip(time, torque, angle)]),
     "refuse '12.345' may be thousands or decimals")
case("comma_both", table(["t", "M"], [[comma(t) + ("" if t % 1 else ",0"), comma(m)] for t, m in zip(time[1:], torque[1:])], ","),
     "refuse decimal commas cannot be told")
case("preamble", table(names, plain(comma), before="Logger 3000; Version 2,1\nOperator: me\n# remark: cold\n\n"),
     "kept: 3 lines in front of the names&&names in line 5")
case("sep_line", table(names, plain(comma), before="sep=;\n"), "names in line 2")
case("trailing", table(names + [""], [r + [""] for r in plain(comma)]), "semicolons, decimal comma")
case("footer", table(names, plain(comma), after="\nMax;1,5\nEnd of recording\n"), "lost: 2 lines behind the values, the first is line 203")
case("blank_lines", table(names, plain(comma)[:100], after="\n\n") + "\n".join(";".join(r) for r in plain(comma)[100:]) + "\n", "decimal comma")
case("two_tables", table(names, plain(comma)[:100]) + table(names, plain(comma)[100:]), "refuse line 103 goes on with values: expected one table")
text = plain(comma)
text[50][1] = text[51][1] = ""
text[52][2] = "NaN"
text[120] = ["", "", ""]
case("holes", table(names, [r for k, r in enumerate(text) if k != 120]), "refuse 1 sample is missing")
case("marked_holes", table(names, [[t, m, a] if k != 120 else [comma(time[k]), "", ""] for k, (t, m, a) in enumerate(text)]),
     "kept: 4 rows with an empty cell, the first is row 51 at 0.05 s (Moment [Nm]): marked as lost with valid 0", lost=[50, 51, 52, 120])
case("no_end", table(names, [r if k < 190 else [r[0], "", r[2]] for k, r in enumerate(plain(comma))]),
     "lost: the last 10 rows, from row 191 on: Moment [Nm] has no value in them")
case("slow_column", table(names + ["Temp [V]"], [r + [comma(k) if k % 10 == 0 else ""] for k, r in enumerate(plain(comma))]),
     "Temp [V] under its own name: 180 of its 200 cells are empty")
case("states", table(names + ["State", "OK"], [r + ["RUN" if k else "IDLE", "TRUE"] for k, r in enumerate(plain(comma))]),
     "lost: column 4, State: holds no numbers but 'IDLE' and the like")
case("names_twice", table(["t [s]", "Value [Nm]", "Value [Nm]", "phi [°]"], [[t, m, "0", a] for t, m, a in plain()]),
     "another column Value as Value_2 [Nm]", arguments="--map torque_Nm=Value,position_rad=phi")
case("hash_names", "# made by numpy\n# t_s M_Nm phi_deg\n" + "".join(f"{t:.18e} {m:.18e} {a:.18e}\n" for t, m, a in zip(time, torque, angle)),
     "cells between blanks, decimal point, names in line 2")
case("fixed_width", "      time_s      M_Nm     phi_deg\n" + "".join(f"{t:12.6f}{m:10.4f}{a:12.3f}\n" for t, m, a in zip(time, torque, angle)),
     "cells between blanks")
case("no_names", "".join(";".join(r) + "\n" for r in plain(comma)), "no names: columns are called column_1",
     arguments="--map time_s=column_1,torque_Nm=column_2,position_rad=column_3*0.017453292519943295")
case("fortran", table(["t_s", "M_Nm", "phi_deg"], [[f"{x:.10E}".replace("E", "D") for x in r] for r in zip(time, torque, angle)]),
     "semicolons")
case("minus_sign", table(names, [[c.replace("-", "\u2212") for c in r] for r in plain(comma)]), "decimal comma")
case("stiffness", table(["t [s]", "M [Nm]", "phi [deg]", "k [N/m]", "I [A rms]", "a [m/s^2]"], [r + ["1", "2", "3"] for r in plain()]),
     "k [N/m] under its own name&&I [A rms] under its own name&&a [m/s^2] under its own name")
case("channel_numbers", table(["1", "2", "3"], [names] + plain(comma)), "names in line 2")
case("bars", table(["t_s", "M_Nm", "phi_deg"], plain(), "|"), "cells between bars")
case("lvm", table(["X_Value", "M [Nm]", "phi [deg]", "Comment"], [r + [""] for r in plain(comma)], "\t",
                  before="LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n\t\n"),
     "time_s is X_Value")
case("zipped", gzip.compress(table(names, plain(comma)).encode("utf-16")), "characters are UTF-16")
case("zipped_cut", gzip.compress(table(names, plain(comma)).encode())[:-30], "refuse the gzip file is cut off")
case("binary", b"\x01\x00\x02;1;2\n" + bytes(range(256)), "refuse holds neither a run nor a frequency response")

with open("cases.txt", "w") as file:
    for name, arguments, parts, lost in cases:
        print(name, arguments, parts, sep="|", file=file)
with open("expected.json", "w") as file:
    json.dump({"time_s": time, "torque_Nm": torque, "position_rad": [math.radians(a) for a in angle],
               "lost": {name: lost for name, _, _, lost in cases}}, file)
