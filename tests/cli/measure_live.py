#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The live view of measure, seen by a terminal: a pseudo-terminal of 80 by 24 and just enough of an emulator to tell what stands on it.

usage: measure_live.py shown|dumb|narrow|absent -- COMMAND...

Presses Ctrl-C once the view stands there, or after ABSENT_S if nothing must, and prints what is left on the screen.
"""
import fcntl
import os
import pty
import re
import select
import struct
import sys
import termios
import time

PATIENCE_S = 60
# The view would come after a second.
ABSENT_S = 2.5


class Screen:
    """Characters, CR, LF, cursor up, erase to the end of line and screen; anything else is an error."""

    def __init__(self, columns, rows):
        self.columns, self.rows, self.x, self.y = columns, rows, 0, 0
        self.lines = [""] * rows

    def put(self, character):
        if self.x == self.columns:
            self.x = 0
            self.feed()
        line = self.lines[self.y].ljust(self.x)
        self.lines[self.y] = line[:self.x] + character + line[self.x + 1:]
        self.x += 1

    def feed(self):
        self.y += 1
        if self.y == self.rows:
            self.lines = self.lines[1:] + [""]
            self.y -= 1

    def write(self, text):
        for part in re.findall(r"\x1b\[\d*[A-Za-z]|.", text, re.S):
            if part == "\r":
                self.x = 0
            elif part == "\n":
                self.feed()
            elif part == "\x1b[K":
                self.lines[self.y] = self.lines[self.y][:self.x]
            elif part == "\x1b[J":
                self.lines[self.y:] = [self.lines[self.y][:self.x]] + [""] * (self.rows - self.y - 1)
            elif part.startswith("\x1b[") and part.endswith("A"):
                self.y = max(0, self.y - int(part[2:-1]))
            elif part.isprintable():
                self.put(part)
            else:
                sys.exit(f"unexpected on the terminal: {part!r}")

    def text(self):
        return "\n".join(line.rstrip() for line in self.lines).rstrip("\n")


def main():
    how, command = sys.argv[1], sys.argv[3:]
    rows = 4 if how == "narrow" else 24
    pid, master = pty.fork()
    if pid == 0:
        os.environ["TERM"] = "dumb" if how == "dumb" else "xterm"
        fcntl.ioctl(2, termios.TIOCSWINSZ, struct.pack("HHHH", rows, 80, 0, 0))
        os.execv(command[0], command)
    screen, seen, pressed, started = Screen(80, rows), "", False, time.monotonic()
    sought = r"samples/s, +\d+ s left" if how in ("dumb", "narrow") else r"speed over torque in period \d+(?s:.*)Hz +2 +4(?s:.*)dB +\d"
    while time.monotonic() < started + PATIENCE_S:
        if how == "absent" and not pressed and time.monotonic() > started + ABSENT_S:
            if seen:
                sys.exit(f"expected nothing on the screen:\n{screen.text()}")
            pressed = True
            os.write(master, b"\x03")
        if not select.select([master], [], [], 0.2)[0]:
            continue
        try:
            part = os.read(master, 65536).decode()
        except OSError:
            break
        seen += part
        screen.write(part)
        if how != "absent" and not pressed and re.search(sought, screen.text()):
            pressed = True
            view = screen.text()
            if how == "shown":
                for expected in (r"^\[#*\.*\] +[\d.]+ %  \d+ samples/s, \d+ s left$", r"^  torque +peak [\d.]+ Nm, table 0\.\d+, \d+ % of the limit$",
                                 r"^  speed +peak [\d.]+ rad/s, table [\d.]+, no limit$", r"^  samples +\d+ kept, 0 lost, 0 late$"):
                    if not re.search(expected, view, re.M):
                        sys.exit(f"no '{expected}' on the screen:\n{view}")
            os.write(master, b"\x03")
    else:
        sys.exit(f"no end and no view within {PATIENCE_S} s:\n{screen.text()}")
    os.waitpid(pid, 0)
    if how in ("dumb", "narrow") and "\x1b" in seen:
        sys.exit("escape sequences for a terminal that knows none, or has no room")
    print(screen.text().replace("^C", ""))


if __name__ == "__main__":
    main()
