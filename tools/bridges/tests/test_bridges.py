"""The bridges against fakes of the vendors' modules that deliver, lag, overrun and disconnect: every scan that is sent is right and at its
time, and every one that is not is a gap. Once by a decoder of this file, written from the guide, once through `surgescope record`.

    python3 -m unittest discover tools/bridges/tests        # SURGESCOPE names the program; without it, target/debug/surgescope
"""
import ast
import csv
import importlib.machinery
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
BRIDGES = HERE.parent
FAKES = HERE / "fakes"
PROGRAM = os.environ.get("SURGESCOPE", str(BRIDGES.parents[1] / "target/debug/surgescope"))
sys.path.insert(0, str(FAKES))
from fake_device import FULL_SCALE_V, count  # noqa: E402

RATE_HZ = 2000
CHANNELS = 3
ARGUMENTS = {
    "labjack_ljm.py": ["--channels", "AIN0,AIN1,AIN2"],
    "ni_daqmx.py": ["--channels", "Dev1/ai0,Dev1/ai1,Dev1/ai2"],
    "mcc_uldaq.py": ["--channels", "0,1,2"],
}


def words(bridge):
    return [sys.executable, str(BRIDGES / bridge), *ARGUMENTS[bridge], "--rate", str(RATE_HZ), "--range", str(FULL_SCALE_V)]


def environment(script):
    return {**os.environ, "PYTHONPATH": str(FAKES), "FAKE": json.dumps(script)}


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def uncobs(piece):
    out, at = bytearray(), 0
    while at < len(piece):
        code = piece[at]
        out += piece[at + 1:at + code]
        at += code
        if code < 255 and at < len(piece):
            out.append(0)
    return bytes(out)


def decoded(stream):
    """Sequence, time of the first sample in us, period in ns and rows of each frame."""
    *pieces, rest = stream.split(b"\0")
    assert rest == b"", "the stream ends within a frame"
    for piece in pieces:
        body = uncobs(piece)
        assert struct.unpack("<H", body[-2:])[0] == crc16(body[:-2]), "a wrong check sum"
        version, channels, sequence, first_us, period_ns, samples = struct.unpack_from("<BBHQIH", body)
        assert (version, channels) == (1, CHANNELS) and len(body) == 20 + 2 * samples * channels
        counts = struct.unpack_from(f"<{samples * channels}h", body, 18)
        yield sequence, first_us, period_ns, [counts[i:i + channels] for i in range(0, len(counts), channels)]


class Bridges(unittest.TestCase):
    def listened(self, bridge, script, seconds):
        """What a bridge sends for some seconds from its first word on, or until it ends: the numbers of its scans, their gaps, its words and its exit code."""
        process = subprocess.Popen(words(bridge), env=environment(script), stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0)
        # it reads its modules first, which takes as long as it takes
        first_words = process.stderr.readline()
        try:
            stream, said = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGTERM)
            stream, said = process.communicate(timeout=10)
        said = first_words + said
        scans, gaps, before = [], [], None
        for sequence, first_us, period_ns, rows in decoded(stream):
            self.assertEqual(period_ns, 1e9 / RATE_HZ)
            first = first_us * RATE_HZ / 1e6
            self.assertEqual(first, int(first))
            if before is not None:
                next_sequence, next_scan = before
                is_gap = first > next_scan
                self.assertGreaterEqual(first, next_scan)
                # by no more frames than are missing, or the stamp would seem to be set back
                self.assertEqual((sequence - next_sequence) % 65536, (first - next_scan) // (RATE_HZ // 100))
                if is_gap:
                    gaps.append((next_scan, int(first)))
            for i, row in enumerate(rows):
                self.assertEqual(list(row), [count(channel, int(first) + i) for channel in range(CHANNELS)], f"scan {first + i}")
                scans.append(int(first) + i)
            before = (sequence + 1, int(first) + len(rows))
        return scans, gaps, said.decode(), process.returncode

    def test_every_scan_is_sent_with_its_value_at_its_time(self):
        for bridge in ARGUMENTS:
            with self.subTest(bridge):
                scans, gaps, said, code = self.listened(bridge, {}, 2.0)
                self.assertEqual((gaps, code), ([], 0), said)
                self.assertEqual(scans, list(range(len(scans))))
                self.assertGreater(len(scans), 1.5 * RATE_HZ, said)
                self.assertIn("scale = (sensor's unit per volt) x 0.000305185", said)

    def test_scans_that_the_device_skipped_are_gaps(self):
        # LJM fills what the device could not send with dummies, here within a read, across two and at the end of one
        skipped = [[230, 7], [590, 20], [795, 5]]
        scans, gaps, said, code = self.listened("labjack_ljm.py", {"skip": skipped}, 1.0)
        self.assertEqual(gaps, [(first, first + n) for first, n in skipped], said)
        self.assertEqual(code, 0)
        self.assertIn("7 scans lost before scan 237", said)

    def test_a_computer_that_stood_still_longer_than_the_buffer_leaves_a_gap(self):
        for bridge in ["ni_daqmx.py", "mcc_uldaq.py"]:
            with self.subTest(bridge):
                jump = 15 * RATE_HZ
                scans, gaps, said, code = self.listened(bridge, {"jump": [1000, jump]}, 1.5)
                self.assertEqual((len(gaps), code), (1, 0), said)
                begin, end = gaps[0]
                self.assertLess(begin, 1100)
                self.assertLessEqual(end, 1100 + jump)
                self.assertGreater(scans[-1], jump + 1500, "it goes on")
                self.assertIn("too slow", said)

    def test_a_computer_that_lags_within_the_buffer_loses_nothing(self):
        for bridge in ARGUMENTS:
            with self.subTest(bridge):
                scans, gaps, said, code = self.listened(bridge, {"jump": [1000, 2 * RATE_HZ]}, 1.5)
                self.assertEqual((gaps, code), ([], 0), said)
                self.assertEqual(scans, list(range(len(scans))))
                self.assertGreater(len(scans), 2 * RATE_HZ + 1500)
        self.assertIn("over a second of scans waits", self.listened("labjack_ljm.py", {"jump": [1000, 3 * RATE_HZ]}, 1.5)[2])

    def test_a_sample_clock_that_pauses_costs_nothing(self):
        scans, gaps, said, code = self.listened("ni_daqmx.py", {"pause": [1010, 1.5]}, 2.8)
        self.assertEqual((gaps, code), ([], 0), said)
        self.assertEqual(scans, list(range(len(scans))))
        self.assertGreater(len(scans), 1300)

    def test_what_ends_the_acquisition_is_said_and_everything_before_is_sent(self):
        for bridge, code, named in [
            ("labjack_ljm.py", 1301, "1301"),
            ("labjack_ljm.py", 1239, "1239"),
            ("ni_daqmx.py", -200361, "-200361"),
            ("ni_daqmx.py", -88709, "-88709"),
            ("mcc_uldaq.py", 18, "OVERRUN"),
            ("mcc_uldaq.py", 8, "DEAD_DEV"),
        ]:
            with self.subTest(f"{bridge} {code}"):
                scans, gaps, said, exit_code = self.listened(bridge, {"fail": [1200, code]}, 10)
                self.assertEqual((gaps, exit_code), ([], 1), said)
                self.assertIn(named, said)
                self.assertNotIn("Traceback", said)
                # what was under way: a read of LJM's is 40 scans
                self.assertGreaterEqual(len(scans), 1200 - 60)
                self.assertEqual(scans, list(range(len(scans))))

    def test_what_is_asked_wrongly_is_refused(self):
        for bridge, more, named in [
            ("ni_daqmx.py", ["--channels", "Dev9/ai0"], "-200220"),
            ("mcc_uldaq.py", ["--channels", "0,2"], "neighbours"),
            ("mcc_uldaq.py", ["--range", "7"], "no range of the library"),
            ("mcc_uldaq.py", ["--device", "X"], "FAKE-1608 01F4A2B3"),
            ("labjack_ljm.py", ["--rate", "0"], "must be above 0"),
        ]:
            with self.subTest(f"{bridge} {more}"):
                done = subprocess.run(words(bridge) + more, env=environment({}), capture_output=True, text=True, timeout=20)
                self.assertNotEqual(done.returncode, 0)
                self.assertIn(named, done.stderr)
                self.assertEqual(done.stdout, "")

    def test_through_the_recorder_what_is_lost_is_a_gap_and_what_died_comes_back(self):
        """Each fails in its way once, and is started again by the recorder."""
        for bridge, script in [
            ("labjack_ljm.py", {"skip": [[230, 7]], "fail": [2000, 1303]}),
            ("ni_daqmx.py", {"jump": [500, 15 * RATE_HZ], "fail": [500 + 16 * RATE_HZ, -201003]}),
            ("mcc_uldaq.py", {"fail": [2000, 7]}),
        ]:
            with self.subTest(bridge), tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                script["once"] = str(folder / "once")
                (folder / "rig.toml").write_text(rig(words(bridge)))
                recorded = subprocess.run(
                    [PROGRAM, "record", "--json", "--rig", folder / "rig.toml", "-o", folder / "run.mcap", "--duration", "22" if "jump" in script else "4"],
                    env=environment(script), capture_output=True, text=True, timeout=120,
                )
                self.assertEqual(recorded.returncode, 3, recorded.stderr)
                summary = json.loads(recorded.stdout)
                device = summary["devices"][0]
                self.assertEqual((device["restarts"], device["bad_frames"]), (1, 0), device)
                lost = ("skip" in script) + ("jump" in script)
                self.assertEqual([sensor["gaps"] for sensor in summary["sensors"]], [1 + lost] * CHANNELS)
                subprocess.run([PROGRAM, "export", folder / "run.mcap", "-o", folder / "run.csv"], check=True, capture_output=True)
                lives = self.lives(folder / "run.csv")
                self.assertEqual(lives, 2)

    def lives(self, path):
        """How often the device began anew in a table whose every row must show the scan that its time says."""
        with open(path) as lines:
            heading, *rows = [row for row in csv.reader(lines) if not row[0].startswith("#")]
        self.assertEqual(heading[:2], ["time_s", "P0"])
        lives, zero_s = 0, None
        for row in rows:
            if "" in row[1:1 + CHANNELS]:
                continue
            time_s, counts = float(row[0]), [round(float(cell)) for cell in row[1:1 + CHANNELS]]
            if counts == [0] * CHANNELS:
                lives, zero_s = lives + 1, time_s
            scan = round((time_s - zero_s) * RATE_HZ)
            self.assertEqual(counts, [count(channel, scan) for channel in range(CHANNELS)], f"at {time_s} s")
            self.assertAlmostEqual(time_s - zero_s, scan / RATE_HZ, delta=2e-6)
        return lives


def rig(command):
    sensors = "".join(
        f'[[sensor]]\nname = "P{channel}"\nkind = "pressure"\nposition_m = 40.0\nunit = "kPa"\ndevice = "daq"\nchannel = {channel}\n'
        for channel in range(CHANNELS)
    )
    return (
        'name = "bench"\n[fluid]\nname = "water"\ntemperature_degC = 20.0\n[[pipe]]\nname = "main"\nlength_m = 40.0\n'
        'inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = "HDPE"\n[upstream]\nkind = "reservoir"\n'
        f'[downstream]\nkind = "valve"\nclosing_time_s = 0.1\n{sensors}'
        f'[[device]]\nname = "daq"\nprotocol = "frames"\ncommand = {json.dumps(command)}\n'
    )


class Fakes(unittest.TestCase):
    """The fakes have the vendors' own functions, their parameters and their numbers: `pip install labjack-ljm nidaqmx uldaq numpy`."""

    def test_functions_take_what_the_vendors_take(self):
        for fake, package, real, names in [
            ("labjack/ljm/__init__.py", "labjack", "ljm/ljm.py", ["openS", "close", "eWriteName", "namesToAddresses", "eStreamStart", "eStreamRead", "eStreamStop"]),
            ("nidaqmx/__init__.py", "nidaqmx", "task/collections/_ai_channel_collection.py", ["add_ai_voltage_chan"]),
            ("nidaqmx/__init__.py", "nidaqmx", "task/_timing.py", ["cfg_samp_clk_timing"]),
            ("nidaqmx/stream_readers.py", "nidaqmx", "stream_readers/_analog_multi_channel_reader.py", ["read_many_sample"]),
            ("nidaqmx/errors.py", "nidaqmx", "errors.py", ["DaqReadError.__init__", "DaqError.__init__"]),
            ("uldaq/__init__.py", "uldaq", "ai_device.py", ["a_in_scan", "get_scan_status", "scan_stop"]),
            ("uldaq/__init__.py", "uldaq", "daq_device.py", ["connect", "disconnect", "release", "get_ai_device"]),
            ("uldaq/__init__.py", "uldaq", "buffer_management.py", ["create_float_buffer"]),
            ("uldaq/__init__.py", "uldaq", "daq_device_discovery.py", ["get_daq_device_inventory"]),
        ]:
            ours, theirs = functions(FAKES / fake), functions(installed(package) / real)
            for name in names:
                with self.subTest(f"{package}: {name}"):
                    self.assertEqual(ours[name], theirs[name])

    def test_properties_and_numbers_are_the_vendors(self):
        stream = functions(installed("nidaqmx") / "task/_in_stream.py")
        for name in ["overwrite", "relative_to", "offset", "curr_read_pos", "input_buf_size"]:
            self.assertIn(name, stream)
        for fake, package, real in [
            ("labjack/ljm/errorcodes.py", "labjack", "ljm/errorcodes.py"),
            ("labjack/ljm/constants.py", "labjack", "ljm/constants.py"),
            ("nidaqmx/constants.py", "nidaqmx", "constants.py"),
            ("uldaq/__init__.py", "uldaq", "ul_enums.py"),
        ]:
            theirs = numbers(installed(package) / real)
            for name, value in numbers(FAKES / fake).items():
                with self.subTest(f"{package}: {name}"):
                    # a mask of several is written as a sum in the vendor's file
                    self.assertIn(theirs[name], (value, "a sum"))
        codes = numbers(installed("nidaqmx") / "error_codes.py")
        self.assertEqual(codes["DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE"], -200279)
        self.assertEqual(codes["DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE"], -200284)


def installed(package):
    """The folder of a vendor's package, which is not run: it wants its driver."""
    path = [entry for entry in sys.path if entry != str(FAKES)]
    spec = importlib.machinery.PathFinder.find_spec(package, path)
    assert spec is not None, f"the package {package} is not installed"
    return pathlib.Path(next(iter(spec.submodule_search_locations)))


def functions(path):
    """Names of a file's functions with their parameters; constructors by their class, too."""
    found = {}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef):
            inner = [item for item in node.body if isinstance(item, ast.FunctionDef)]
            found.update({f"{node.name}.{item.name}": [a.arg for a in item.args.args] for item in inner})
        if isinstance(node, ast.FunctionDef):
            found.setdefault(node.name, [a.arg for a in node.args.args])
    return found


def numbers(path):
    """The whole numbers that a file names, those of a class by its name."""
    def value(node):
        if isinstance(node, ast.Tuple) and len(node.elts) == 1:
            node = node.elts[0]
        try:
            return ast.literal_eval(node)
        except ValueError:
            shift = isinstance(node, ast.BinOp) and isinstance(node.op, ast.LShift)
            return node.left.value << node.right.value if shift else "a sum"

    tree, found = ast.parse(path.read_text()), {}
    for prefix, body in [("", tree.body), *((f"{node.name}.", node.body) for node in tree.body if isinstance(node, ast.ClassDef))]:
        for node in body:
            if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
                found.setdefault(prefix + node.targets[0].id, value(node.value))
    return {name: number for name, number in found.items() if isinstance(number, int) or number == "a sum"}


if __name__ == "__main__":
    unittest.main()
