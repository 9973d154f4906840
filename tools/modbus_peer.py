#!/usr/bin/env python3
"""Records from a Modbus RTU slave that is not ours, whose answers come about when their time-out ends.

    python3 -m venv venv && venv/bin/pip install pymodbus pyserial
    venv/bin/python tools/modbus_peer.py target/release/surgescope 10000

A pymodbus server answers on one pseudo-terminal, `surgescope record` asks on another, bytes are carried between the two. Six sensors lie in
requests of the same shape (two registers of one kind each, not neighbours), so that a late answer to one would fit the next; three of them in
each of two slaves that share the line. Register `a` of slave `u` always holds `1000 u + a`: a value names the register that it is of. Each answer is held
back at random for 0 to 1.5 time-outs. Four such pairs run side by side.
Exit code 0 when every recorded value stands under its own sensor's name.
"""

import asyncio
import concurrent.futures
import csv
import itertools
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
import tty

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

PAIRS = 4
TIMEOUT_S = 0.03
INTERVAL_S = 0.001
UNITS = (7, 8)
ADDRESSES = (10, 20, 30)
RIG = """name = "peer"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 40.0
inner_diameter_mm = 50.6
wall_thickness_mm = 6.2
material = "HDPE"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
"""
SLAVE = """[[device]]
name = "plc{unit}"
port = "{port}"
baud = 115200
protocol = "modbus-rtu"
unit_id = {unit}
poll_interval_s = {interval}
timeout_s = {timeout}
"""
SENSOR = """[[sensor]]
name = "P{unit}_{address}"
kind = "pressure"
position_m = 10.0
unit = "kPa"
device = "plc{unit}"
channel = {address}
register_kind = "holding"
encoding = "u32"
"""


def carry(source, target):
    """Carries bytes from one pseudo-terminal to the other until one is closed."""
    try:
        while data := os.read(source, 256):
            os.write(target, data)
    except OSError:
        pass


def line():
    """Two ports, joined by a wire."""
    (near, near_port), (far, far_port) = os.openpty(), os.openpty()
    for port in (near_port, far_port):
        tty.setraw(port)
    for source, target in ((near, far), (far, near)):
        threading.Thread(target=carry, args=(source, target), daemon=True).start()
    return os.ttyname(near_port), os.ttyname(far_port)


def serve(port, delays):
    """A pymodbus server whose answers are held back; it answers in order, as slaves do."""

    def hold_back(sending, data):
        if sending:
            time.sleep(delays.uniform(0.0, 1.5) * TIMEOUT_S)
        return data

    async def run():
        def slave(unit):
            registers = [1000 * unit + address for address in range(100)]
            return SimDevice(unit, simdata=[SimData(0, values=registers, datatype=DataType.REGISTERS)])

        slaves = [slave(unit) for unit in UNITS]
        server = ModbusSerialServer(slaves, framer=FramerType.RTU, port=port, baudrate=115200, trace_packet=hold_back)
        await server.serve_forever()

    threading.Thread(target=lambda: asyncio.run(run()), daemon=True).start()


def record(program, polls, seed):
    """Records until about so many polls were made; what the recorder counted, and how many values were right and wrong."""
    recorder_port, slave_port = line()
    serve(slave_port, random.Random(seed))
    with tempfile.TemporaryDirectory() as folder:
        rig, log, table = (os.path.join(folder, name) for name in ("rig.toml", "run.mcap", "run.csv"))
        with open(rig, "w", encoding="utf-8") as file:
            file.write(RIG)
            for unit in UNITS:
                file.write(SLAVE.format(unit=unit, port=recorder_port, interval=INTERVAL_S, timeout=TIMEOUT_S))
                file.write("".join(SENSOR.format(unit=unit, address=address) for address in ADDRESSES))
        recorder = subprocess.Popen(
            [program, "record", "--json", "--silence", "60", "--rig", rig, "-o", log],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        # A poll takes a time-out and a half: an answer comes after three quarters of one, a missing one costs two to three.
        time.sleep(polls * TIMEOUT_S * 1.7)
        recorder.terminate()
        summary = json.loads(recorder.communicate()[0])
        subprocess.run([program, "export", log, "-o", table], check=True, stdout=subprocess.DEVNULL)
        wrong = right = 0
        with open(table, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(line for line in file if not line.startswith("#")):
                for unit, address in itertools.product(UNITS, ADDRESSES):
                    text = row[f"P{unit}_{address}"]
                    # The registers a and a + 1, most significant word first.
                    first = 1000 * unit + address
                    expected = first << 16 | first + 1
                    right += bool(text) and float(text) == expected
                    if text and float(text) != expected:
                        wrong += 1
                        print(f"P{unit}_{address} at {row['time_s']} s: {text} for {expected}", file=sys.stderr)
    return summary["devices"], right, wrong


def main(program, polls):
    with concurrent.futures.ThreadPoolExecutor(PAIRS) as pool:
        results = list(pool.map(lambda seed: record(program, polls / PAIRS, seed), range(PAIRS)))
    answered, missed, bad, late = (
        sum(device[key] for devices, _, _ in results for device in devices) for key in ("frames", "lost_frames", "bad_frames", "late_answers")
    )
    right, wrong = (sum(result[place] for result in results) for place in (1, 2))
    polled = answered + missed
    print(f"{polled} polls: {answered} answered, {missed} missed, {bad} bad; {late} answers came late")
    print(f"{right} values recorded right, {wrong} wrong")
    return 0 if wrong == 0 and right > 0 and late > 0 and polled >= polls else 1


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
