#!/usr/bin/env python3
"""Runs what a rig computer runs, kills it at random moments, starts it again, and checks that all that was recorded is whole.

    python3 -m venv venv && venv/bin/pip install mcap
    venv/bin/python tools/rig-computer/check.py target/debug/surgescope [KILLS] [SEED]

A device on a pseudo-terminal sends a pressure and the number of its row at 1 kHz for ever; every four seconds its valve closes. `record` and
`surgescope watch` run as their units start them. Half of the kills (SIGKILL) fall into a shot. In the end no recording may lack its end,
no sample may be wrong or out of place, no row may be missing without a gap, and a shot that was cut off may lack no more than
0.1 s before the kill. A disk that is nearly full is refused in words. Exit code 0 when all holds, 1 with what does not.
"""

import math
import os
import pty
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty
from pathlib import Path

from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

HERE = Path(__file__).resolve().parent
CLOSES_EVERY_S = 4.0
PRE_S, POST_S = 0.5, 2.0

RIG = """name = "bench"
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
closing_time_s = 0.05
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 40.0
unit = "kPa"
device = "daq"
channel = 0
[[sensor]]
name = "ROW"
kind = "temperature"
position_m = 0.0
unit = "degC"
device = "daq"
channel = 1
[[device]]
name = "daq"
port = "%s"
baud = 921600
protocol = "lines"
"""


def expect(condition, message):
    if not condition:
        sys.exit(message)


def pressure(row):
    """300 kPa, and after each closure a wave that dies out."""
    since_s = (row / 1000) % CLOSES_EVERY_S - 1
    wave = 0 if since_s < 0 else min(1, since_s / 0.05) * 250 * math.exp(-3 * since_s) * math.cos(7 * max(0, since_s - 0.05))
    return round(300 + wave, 4)


class Device(threading.Thread):
    """Sends its rows as time goes by, whether anybody reads or not."""

    def __init__(self):
        super().__init__(daemon=True)
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(slave)
        self.started = time.monotonic()

    def row_now(self):
        return int((time.monotonic() - self.started) * 1000)

    def run(self):
        row = 0
        while True:
            until = self.row_now()
            lines = "".join(f"{row * 1000},{pressure(row)},{row}\n" for row in range(row, until))
            row = until
            try:
                os.write(self.master, lines.encode())
            except BlockingIOError:
                pass
            time.sleep(0.01)


class Service:
    """A command that is started again after each end, as systemd does it."""

    def __init__(self, command, environment, log):
        self.command, self.environment, self.log = command, environment, log
        self.over = threading.Event()
        self.process, self.starts = None, 0
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.over.is_set():
            self.process = subprocess.Popen(self.command, env=self.environment, stdout=self.log, stderr=self.log, start_new_session=True)
            self.starts += 1
            self.process.wait()
            self.over.wait(0.2)

    def kill(self, how=signal.SIGKILL):
        try:
            os.killpg(self.process.pid, how)
        except ProcessLookupError:
            pass

    def stop(self):
        self.over.set()
        self.kill(signal.SIGTERM)
        self.thread.join(60)
        expect(not self.thread.is_alive(), f"{self.command[0]} does not end")


def samples(path):
    """{sensor: [(time, value)]} and the gaps of a recording, times in ns."""
    topics, values, gaps = {}, {"/P1": [], "/ROW": []}, 0
    with open(path, "rb") as file:
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                topic = topics[record.channel_id]
                if topic in values:
                    values[topic].append((record.log_time, memoryview(record.data[1:9]).cast("d")[0]))
                else:
                    gaps += 1
    return values, gaps


def check(path):
    """Every sample is the one that the device sent at its time. Returns the first and last row."""
    values, gaps = samples(path)
    rows = values["/ROW"]
    expect(rows, f"{path.name} is empty")
    by_time = dict(values["/P1"])
    holes = 0
    for (time_ns, row), (before_ns, before) in zip(rows[1:], rows):
        expect(time_ns - before_ns == (row - before) * 1_000_000, f"{path.name}: row {row} after {before} lies {time_ns - before_ns} ns after it")
        holes += row != before + 1
    for time_ns, row in rows:
        value = by_time.get(time_ns)
        expect(value is None or value == pressure(int(row)), f"{path.name}: row {row} is {value}, not {pressure(int(row))}")
    missing = len(rows) - sum(time_ns in by_time for time_ns, _ in rows)
    expect(missing <= 10, f"{path.name}: P1 lacks {missing} samples")
    expect(holes <= gaps, f"{path.name}: {holes} holes, {gaps} gaps")
    return int(rows[0][1]), int(rows[-1][1])


def main():
    program = os.path.abspath(sys.argv[1])
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    random.seed(seed)
    with tempfile.TemporaryDirectory() as work:
        folder, rig, log = Path(work, "runs"), Path(work, "rig.toml"), open(Path(work, "log"), "w+")
        device = Device()
        rig.write_text(RIG % device.path)
        environment = os.environ | {
            "SURGESCOPE": program, "RIG": str(rig), "TRIGGER": "slope=400", "PRE": str(PRE_S), "POST": str(POST_S), "FOLDER": str(folder),
            "LEAST_MB": "1", "CLOCK_WAIT": "0", "MORE": "",
        }
        full = subprocess.run([HERE / "record"], env=environment | {"LEAST_MB": "1000000000"}, capture_output=True, text=True)
        expect(full.returncode == 1 and "a recording needs 1000000000 MB" in full.stderr, f"a full disk: {full}")

        device.start()
        recorder = Service([HERE / "record"], environment, log)
        time.sleep(1)
        watch = Service([program, "watch", folder], environment, log)
        killed_rows = []
        for kill in range(kills):
            into_shot = kill % 2 == 0
            # the valve closes 1 s after each whole multiple of the period
            phase_s = 1 + random.uniform(0.2, POST_S - 0.2) if into_shot else random.uniform(0, CLOSES_EVERY_S)
            wait_s = (phase_s - (device.row_now() / 1000) % CLOSES_EVERY_S) % CLOSES_EVERY_S
            time.sleep(wait_s + CLOSES_EVERY_S * into_shot)
            killed_rows.append(device.row_now())
            recorder.kill()
            if kill % 3 == 0:
                watch.kill()
        time.sleep(CLOSES_EVERY_S + POST_S + 2)
        recorder.stop()
        watch.stop()
        code = subprocess.run([program, "recover", folder], stdout=log, stderr=log).returncode
        expect(code in (0, 3), f"recover ended with {code}")

        whole, cut, worst_s = 0, 0, 0.0
        log.seek(0)
        said = log.read()
        for path in sorted(folder.glob("*.mcap")):
            first, last = check(path)
            if not path.name.endswith("-recovered.mcap"):
                whole += 1
                continue
            cut += 1
            lost_s = min(row - last for row in killed_rows if row >= last) / 1000
            worst_s = max(worst_s, lost_s)
        for path in folder.glob("*.torn"):
            saved = path.with_name(path.name.removesuffix(".mcap.torn") + "-recovered.mcap")
            expect(saved.exists() or path.stat().st_size == 0, f"nothing was saved of {path.name}")
        print(f"{kills} kills of the recorder, {recorder.starts} starts; {watch.starts} starts of the watch")
        print(f"{whole} shots whole, {cut} cut off by a kill and recovered; every sample right, every hole a gap")
        print(f"before a kill at most {worst_s * 1000:.0f} ms are gone")
        expect(whole >= 1 and cut >= kills // 4, f"the kills met too few shots:\n{said[-3000:]}")
        # An idle machine loses a hundredth of this; on a loaded one the recorder itself waits for its turn.
        expect(worst_s <= 1.0, f"{worst_s} s are gone before a kill")
        expect("panicked" not in said, said[-3000:])
        verdicts = len(list(folder.glob("*.fit.toml")))
        print(f"{verdicts} recordings have a fit")
        expect(verdicts >= 1, f"the watch fitted nothing:\n{said[-3000:]}")


if __name__ == "__main__":
    main()
