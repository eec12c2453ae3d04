#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A null modem of two ptys: makes links to them at the two paths given, passes bytes on until it is ended.

usage: pty_pair.py LINK LINK
"""
import os
import select
import sys
import tty

ends = []
for link in sys.argv[1:3]:
    master, slave = os.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), link)
    ends.append(master)
while True:
    for ready in select.select(ends, [], [])[0]:
        other = ends[1] if ready == ends[0] else ends[0]
        os.write(other, os.read(ready, 4096))
