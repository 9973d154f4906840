"""The encoders of frames, Arduino's (compiled here) and Python's, against the recorder's decoder: every number, every time, every gap."""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_bridges import BRIDGES, HERE, PROGRAM, rig  # noqa: E402

RATE_HZ = 5000
SENDS = """
import sys
sys.path.insert(0, sys.argv[1])
from frames import Sender
sender = Sender(3, 4200.0, 32767.0)
for block in range(300):
    first = 42 * block
    values = [[float(0x0101 * (c + 1)) if scan // 1000 % 2 else float((s * scan + 32768) % 65536 - 32768)
               for c, s in enumerate((1, 3, -7))] for scan in range(first, first + 42)]
    sender.send(first, [v for row in values for v in row])
"""


def board(channel, scan):
    return scan * (1, 3, 7)[channel] % 1024


def count(channel, scan):
    if scan // 1000 % 2:
        return 0x0101 * (channel + 1)
    return ((1, 3, -7)[channel] * scan + 32768) % 65536 - 32768


class Encoders(unittest.TestCase):
    def recorded(self, command, rate_hz, count=count):
        """The summary of a command, and the scans that its recording holds, each with its own value at its own time."""
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "rig.toml").write_text(rig(command))
            done = subprocess.run(
                [PROGRAM, "record", "--json", "--rig", folder / "rig.toml", "-o", folder / "run.mcap"], capture_output=True, text=True
            )
            self.assertIn(done.returncode, (0, 3), done.stderr)
            subprocess.run([PROGRAM, "export", folder / "run.mcap", "-o", folder / "run.csv"], check=True, capture_output=True)
            with open(folder / "run.csv") as lines:
                _, *rows = [row for row in csv.reader(lines) if not row[0].startswith("#")]
            scans = []
            # an empty row marks a gap
            for row in (row for row in rows if "" not in row[1:]):
                scan = round(float(row[0]) * rate_hz)
                self.assertAlmostEqual(float(row[0]), scan / rate_hz, delta=2e-6)
                self.assertEqual([float(cell) for cell in row[1:]], [count(channel, scan) for channel in range(3)], f"scan {scan}")
                scans.append(scan)
            return json.loads(done.stdout), scans

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.host, cls.sketch = (str(pathlib.Path(cls.folder.name) / name) for name in ("host", "sketch"))
        compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
        assert compiler, "a C++ compiler is missing"
        strict = ["-std=c++11", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion"]
        for program in (cls.host, cls.sketch):
            source = HERE / (pathlib.Path(program).name + ".cpp")
            subprocess.run([compiler, *strict, "-x", "c++", str(source), "-o", program], check=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_arduino_every_scan_arrives(self):
        summary, scans = self.recorded([self.host, "42", "70001"], RATE_HZ)
        device = summary["devices"][0]
        self.assertEqual((device["bad_frames"], device["lost_frames"], device["frames"]), (0, 0, 1667))
        self.assertEqual(scans, list(range(70001)))

    def test_arduino_scans_that_fell_out_are_gaps(self):
        lost = [(500, 3), (1500, 42), (3000, 1000), (4999, 50)]
        summary, scans = self.recorded([self.host, "42", "9000", *(str(n) for pair in lost for n in pair)], RATE_HZ)
        self.assertEqual(scans, [s for s in range(9000) if not any(first <= s < first + n for first, n in lost)])
        self.assertEqual([sensor["gaps"] for sensor in summary["sensors"]], [4] * 3)
        self.assertEqual(summary["devices"][0]["bad_frames"], 0)

    def test_arduino_the_sequence_wraps(self):
        summary, scans = self.recorded([self.host, "1", "66000"], RATE_HZ)
        device = summary["devices"][0]
        self.assertEqual((device["bad_frames"], device["lost_frames"], device["frames"]), (0, 0, 66000))
        self.assertEqual(scans, list(range(66000)))

    def test_arduino_the_sketch_keeps_its_pace_and_what_it_missed_is_a_gap(self):
        summary, scans = self.recorded([self.sketch], 1000, board)
        missing = sorted(set(range(scans[-1] + 1)) - set(scans))
        self.assertIn(len(missing), (54, 55))
        self.assertEqual(missing, list(range(missing[0], missing[0] + len(missing))), "in one piece")
        self.assertEqual([sensor["gaps"] for sensor in summary["sensors"]], [1] * 3)
        self.assertGreaterEqual(scans[-1], 1998, "through the moment at which micros() begins anew")

    def test_python_every_scan_arrives(self):
        script = pathlib.Path(self.folder.name) / "sends.py"
        script.write_text(SENDS)
        summary, scans = self.recorded([sys.executable, str(script), str(BRIDGES)], 4200)
        device = summary["devices"][0]
        self.assertEqual((device["bad_frames"], device["lost_frames"], device["frames"]), (0, 0, 300))
        self.assertEqual(scans, list(range(42 * 300)))


if __name__ == "__main__":
    unittest.main()
