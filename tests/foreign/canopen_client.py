# SPDX-License-Identifier: MIT
"""python-canopen against the simulated drive and our client against python-canopen's server, over pipes.

usage: canopen_client.py CAN_PIPE EDS     (CAN_PIPE: the program of tests/support/can_pipe.c)
"""
import os
import queue
import subprocess
import sys
import threading
import time

import can
import canopen
from canopen.sdo import SdoAbortedError

from checks import check, failures

NODE = 5
TABLE = bytes((i * 91 + (i >> 7)) & 0xFF for i in range(8192))


class PipeBus(can.BusABC):
    """A bus with one participant: a process that speaks lines."""

    def __init__(self, arguments):
        self.process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self.frames = queue.Queue()
        self.answers = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        super().__init__(channel="pipe")

    def _read(self):
        for line in self.process.stdout:
            if line.startswith(" "):
                self.answers.put(line.strip())
                continue
            number, _, data = line.strip().partition("#")
            remote = data == "R"
            self.frames.put(can.Message(arbitration_id=int(number, 16), is_extended_id=False, is_remote_frame=remote,
                                        data=b"" if remote else bytes.fromhex(data)))

    def send(self, msg, timeout=None):
        data = "R" if msg.is_remote_frame else msg.data.hex().upper()
        self.process.stdin.write(f"{msg.arbitration_id:03X}#{data}\n")
        self.process.stdin.flush()

    def _recv_internal(self, timeout):
        try:
            return self.frames.get(timeout=timeout if timeout is not None else 3600), False
        except queue.Empty:
            return None, False

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.answers.get(timeout=60)

    def shutdown(self):
        super().shutdown()
        self.process.stdin.close()
        self.process.wait(timeout=10)


def connect(bus):
    network = canopen.Network(bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.05)
    return network


def every_variable(dictionary):
    for index in sorted(dictionary):
        entry = dictionary[index]
        if isinstance(entry, canopen.objectdictionary.ODVariable):
            yield entry
        else:
            for subindex in sorted(entry):
                yield entry[subindex]


def reads_what_the_sheet_says(node):
    """Every entry of the sheet answers, in its type's length, with its default value; nothing else is there."""
    compared = 0
    for variable in every_variable(node.object_dictionary):
        name = f"{variable.index:04X}:{variable.subindex}"
        if not variable.readable:
            continue
        try:
            raw = node.sdo.upload(variable.index, variable.subindex)
        except SdoAbortedError as error:
            check(False, f"{name} {variable.name}: {error}")
            continue
        compared += 1
        if variable.data_type in canopen.objectdictionary.NUMBER_TYPES:
            check(len(raw) == len(variable) // 8, f"{name}: {len(raw)} bytes, the sheet says {len(variable) // 8}")
        if variable.default is not None:
            value = variable.decode_raw(raw)
            check(value == variable.default, f"{name} {variable.name}: {value!r}, the sheet says {variable.default!r}")
    for variable in every_variable(node.object_dictionary):
        name = f"{variable.index:04X}:{variable.subindex}"
        if variable.writable or variable.data_type not in canopen.objectdictionary.NUMBER_TYPES:
            continue
        try:
            node.sdo.download(variable.index, variable.subindex, bytes(len(variable) // 8))
            check(False, f"{name}: written, the sheet says {variable.access_type}")
        except SdoAbortedError as error:
            check(error.code == 0x06010002, f"{name}: {error}")
    absent = 0
    for index in list(range(0x1000, 0x1A10)) + list(range(0x6000, 0x6600, 7)):
        if index in node.object_dictionary:
            continue
        absent += 1
        try:
            node.sdo.upload(index, 0)
            check(False, f"{index:04X} answers and is not in the sheet")
        except SdoAbortedError as error:
            check(error.code == 0x06020000, f"{index:04X}: {error}")
    print(f"sheet: {compared} entries read and compared, {absent} indices outside it are absent")
    check(compared > 150, "too few entries")


def carries_domains(node):
    """Segmented and block transfers of python-canopen's own client."""
    for size in (0, 1, 4, 5, 7, 8, 14, 100, 889, 890, 8192):
        data = TABLE[:size]
        if size > 0:
            node.sdo.download(0x2100, 0, data, force_segment=True)
            check(node.sdo.upload(0x2100, 0) == data, f"segmented, {size} bytes")
        if size < 1:
            continue
        with node.sdo.open(0x2100, 0, "wb", size=size, block_transfer=True) as file:
            file.write(data[::-1])
        with node.sdo.open(0x2100, 0, "rb", block_transfer=True) as file:
            got = file.read()
        check(got == data[::-1], f"block, {size} bytes: {len(got)} came")
    node.sdo.download(0x2101, 0, b"written by another")
    check(node.sdo.upload(0x2101, 0) == b"written by another", "string")
    started = time.monotonic()
    with node.sdo.open(0x2100, 0, "wb", size=8192, block_transfer=True) as file:
        file.write(TABLE)
    print(f"block download of 8192 bytes by python-canopen: {time.monotonic() - started:.3f} s")
    for size, code in ((16385, 0x06070012),):
        try:
            node.sdo.download(0x2100, 0, bytes(size), force_segment=True)
            check(False, f"{size} bytes fit")
        except SdoAbortedError as error:
            check(error.code == code, f"{size} bytes: {error}")


def serves(pipe):
    """Our client and python-canopen's server, which has segments but no blocks."""
    bus = PipeBus([pipe, "master", "9"])
    network = connect(bus)
    dictionary = canopen.ObjectDictionary()
    domain = canopen.objectdictionary.ODVariable("domain", 0x2100, 0)
    domain.data_type = canopen.objectdictionary.DOMAIN
    dictionary.add_object(domain)
    node = network.create_node(9, dictionary)
    for size in (1, 4, 5, 7, 8, 100, 1000):
        data = TABLE[3:3 + size]
        said = bus.ask(f"! 2100 0 {data.hex()}")
        check(said == "ok", f"our download of {size} bytes to python-canopen: {said}")
        check(bytes(node.sdo[0x2100].raw) == data, f"python-canopen got something else, {size} bytes")
        said = bus.ask("? 2100 0")
        check(said == data.hex().upper(), f"our upload of {size} bytes from python-canopen: {said[:60]}")
    check(bus.ask("? 2222 0") == "abort 06020000", "an absent object is not told as one")
    network.notifier.stop()
    bus.shutdown()


def main():
    pipe, sheet = sys.argv[1:]
    bus = PipeBus([pipe, "node"])
    network = connect(bus)
    node = network.add_node(NODE, sheet)
    node.sdo.RESPONSE_TIMEOUT = 5.0  # a loaded machine is no fault
    node.nmt.state = "PRE-OPERATIONAL"
    reads_what_the_sheet_says(node)
    carries_domains(node)
    node.tpdo.read()
    node.rpdo.read()
    check(len(node.tpdo) == 4 and len(node.rpdo) == 4, "four PDOs in each direction")
    network.notifier.stop()
    bus.shutdown()
    check(bus.process.returncode == 0, f"the node ended with {bus.process.returncode}")
    serves(pipe)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    os.environ.setdefault("PYTHONUNBUFFERED", "1")
    main()
