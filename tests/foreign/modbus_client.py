#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A foreign Modbus client (pymodbus) that measures with a drive by its registers alone, as docs/modbus.md describes them: uploads
a table, verifies, arms, runs it, reads the spectra of each period and of all, and compares them. Prints the response as JSON.

usage: modbus_client.py (tcp HOST PORT | rtu DEVICE) SLAVE TABLE.mst PERIODS
"""
import json
import struct
import sys
import time

from pymodbus import ModbusException
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

OPEN_UPLOAD, VERIFY, ARM, START = 1, 2, 3, 4
UPLOADING, VERIFIED, ARMED, DONE, FAULT = 1, 2, 3, 6, 15
MEAN = 0xFFFFFFFF


def words_of_u32(value):
    return [value >> 16, value & 0xFFFF]


def words_of_f32(value):
    return words_of_u32(struct.unpack(">I", struct.pack(">f", value))[0])


def u32(words):
    return words[0] << 16 | words[1]


def f32(words):
    return struct.unpack(">f", struct.pack(">I", u32(words)))[0]


class Drive:
    def __init__(self, client, slave):
        self.client, self.slave, self.sequence = client, slave, 0

    def read(self, address, count, inputs=False):
        function = self.client.read_input_registers if inputs else self.client.read_holding_registers
        reply = function(address, count=count, device_id=self.slave)
        assert not reply.isError(), (address, count, reply)
        return reply.registers

    def write(self, address, words, exception=None):
        reply = self.client.write_registers(address, words, device_id=self.slave)
        if exception is None:
            assert not reply.isError(), (address, words, reply)
        else:
            assert reply.isError() and reply.exception_code == exception, (address, words, reply, exception)

    def command(self, code, key=0, exception=None):
        sequence = (self.read(0x21, 1)[0] + 1) & 0xFFFF
        self.write(0x10, [code, key, sequence], exception)
        acknowledged, result = self.read(0x21, 2)
        assert acknowledged == sequence, (acknowledged, sequence)
        return result

    def state(self):
        return self.read(0x20, 1)[0]

    def upload(self, table):
        assert len(table) % 2 == 0
        words = struct.unpack(f">{len(table) // 2}H", table)
        for offset in range(0, len(words), 120):
            self.write(0x100, words_of_u32(offset) + list(words[offset:offset + 120]))

    def window(self, period, first):
        """One transaction: function 23 writes the selection and reads the window."""
        select = words_of_u32(period) + [first, self.sequence]
        reply = self.client.readwrite_registers(read_address=0x210, read_count=120, write_address=0x200, values=select,
                                                device_id=self.slave)
        assert not reply.isError(), reply
        head, words = reply.registers[:8], reply.registers[8:]
        assert head[0] == self.sequence and u32(head[2:4]) == period and head[4] == first, head
        return head, words

    def spectrum(self, period, bins):
        """List of bins, each a list of floats, and the number of periods in it."""
        self.sequence = (self.sequence + 1) & 0xFFFF
        size = 16 if period == MEAN else 8
        records, count = [], 0
        while len(records) < bins:
            head, words = self.window(period, len(records))
            assert head[1] == 0, f"period {period}: validity {head[1]:#x}"
            count = u32(head[6:8])
            for i in range(head[5]):
                at = words[size * i:size * (i + 1)]
                records.append([f32(at[2 * k:2 * k + 2]) for k in range(size // 2)])
        return records, count


def connect(arguments):
    if arguments[0] == "tcp":
        return ModbusTcpClient(arguments[1], port=int(arguments[2]), timeout=2), arguments[3:]
    # A pty has no parity, and pyserial insists on what it is told.
    return ModbusSerialClient(arguments[1], baudrate=115200, parity="N", timeout=2), arguments[2:]


def check_identity(drive):
    assert drive.read(0, 1)[0] == 0x4D53
    assert drive.read(2, 4) == drive.read(2, 4, inputs=True) == [0x0102, 0x0304, 0x3F80, 0x0000]
    assert f32(drive.read(4, 2)) == 1.0


def check_refusals(drive):
    """What a drive at rest must not do."""
    assert drive.command(START, 0xA5A5, exception=3) == 2
    assert drive.command(ARM, 0xA5A5, exception=3) == 2
    assert drive.command(99, exception=3) == 1
    drive.write(0x0000, [1], exception=2)
    drive.write(0x0013, [1], exception=2)
    drive.write(0x0048, [1], exception=3)
    reply = drive.client.read_holding_registers(0x13, count=1, device_id=drive.slave)
    assert reply.isError() and reply.exception_code == 2, reply
    try:
        reply = drive.client.read_coils(0, count=1, device_id=drive.slave)
        assert reply.isError() and reply.exception_code == 1, reply
    except ModbusException as error:
        raise AssertionError("a function that is not there is not answered") from error


def run(drive, table, periods):
    name = struct.unpack("<I", table[52:56])[0]
    setup = (words_of_u32(len(table)) + words_of_u32(name) + [0, 1, 3, 0] + words_of_u32(1) + words_of_u32(periods) +
             words_of_u32(400) + words_of_u32(400) + words_of_f32(5.0))
    assert drive.command(OPEN_UPLOAD) == 0 and drive.state() == UPLOADING
    drive.write(0x40, setup)
    assert drive.read(0x40, len(setup)) == setup
    damaged = bytearray(table)
    damaged[-1] ^= 1
    drive.upload(bytes(damaged))
    assert drive.command(VERIFY, exception=3) == 0x10000 - 15 and drive.state() == UPLOADING
    drive.upload(table)
    assert drive.command(VERIFY) == 0 and drive.state() == VERIFIED and u32(drive.read(0x38, 2)) == name
    assert drive.command(ARM, exception=3) == 3
    assert drive.command(ARM, 0xA5A5) == 0 and drive.state() == ARMED
    assert drive.command(START, 0xA5A5) == 0
    until = time.monotonic() + 60
    while drive.state() not in (DONE, FAULT):
        drive.write(0x1F, [1])  # sign of life
        assert time.monotonic() < until, "the run does not end"
        time.sleep(0.1)
    assert drive.state() == DONE and u32(drive.read(0x28, 2)) == periods


def main():
    client, rest = connect(sys.argv[1:])
    slave, periods = int(rest[0]), int(rest[2])
    with open(rest[1], "rb") as file:
        table = file.read()
    assert client.connect()
    drive = Drive(client, slave)
    check_identity(drive)
    check_refusals(drive)
    run(drive, table, periods)
    bins = u32(drive.read(0x3C, 2))
    mean, count = drive.spectrum(MEAN, bins)
    assert count == periods
    singles = [drive.spectrum(p, bins)[0] for p in range(periods)]
    drive.write(0x80, [0])
    rate, samples, lines = f32(drive.read(0x3E, 2)), u32(drive.read(0x3A, 2)), drive.read(0x81, min(bins, 120))
    response = []
    for b in range(min(bins, 120)):
        for k in range(4):  # the mean is that of the periods, in single precision
            average = sum(single[b][k] for single in singles) / periods
            assert abs(average - mean[b][k]) <= 1e-5 * max(abs(value) for value in mean[b][:4]) + 1e-9, (b, k, average, mean[b])
        u, y = complex(*mean[b][0:2]), complex(*mean[b][2:4])
        g = y / u
        variance = mean[b][5] + abs(g) ** 2 * mean[b][4] - 2 * (g.conjugate() * complex(*mean[b][6:8])).real
        response.append([lines[b] * rate / samples, g.real, g.imag, (max(variance, 0) / periods) ** 0.5 / abs(u)])
    client.close()
    print(json.dumps(response))


if __name__ == "__main__":
    main()
