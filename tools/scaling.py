"""Time commands on recordings of more and more samples, and check that the time grows no faster than their number.

scaling.py PROGRAM [MOST]: prints a Markdown table; MOST is the largest power of ten, 7 by default. Recordings of three pressure sensors at 10 kHz
are simulated; the samples counted are those of all sensors. It fails where the time of `inspect` grows with a power of the number above 1.15."""
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = ["inspect", "calibrate", "diagnose"]


def rig():
    """The rig of the demonstration with its pressure sensors alone."""
    text = (ROOT / "rigs" / "demo-hdpe.toml").read_text()
    parts = re.split(r"(?m)^(?=\[\[sensor\]\])", text)
    sensors = [part for part in parts[1:] if 'kind = "pressure"' in part.split("[[device]]")[0]]
    devices = "".join(part[part.index("[[device]]"):] for part in parts[1:] if "[[device]]" in part)
    head = parts[0]
    return head + "".join(part.split("[[device]]")[0] for part in sensors) + devices


def run(*command):
    """Seconds and largest memory, MiB, of a command; the better of two times where it is quick."""
    best, memory = math.inf, 0
    for _ in range(2):
        began = time.time()
        process = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        error = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        if os.waitstatus_to_exitcode(status) not in (0, 1):
            raise SystemExit(f"{command}: {error.decode()}")
        best, memory = min(best, time.time() - began), max(memory, usage.ru_maxrss / 1024)
        if best > 2:
            break
    return best, memory


def main():
    program, most = Path(sys.argv[1]).resolve(), float(sys.argv[2]) if len(sys.argv) > 2 else 7
    print("| samples | " + " | ".join(f"{c}, s; MiB" for c in COMMANDS) + " | page, MB | samples in memory, MiB |")
    print("| --- " * (len(COMMANDS) + 3) + "|")
    seen = []
    with tempfile.TemporaryDirectory() as work:
        work = Path(work)
        (work / "rig.toml").write_text(rig())
        for power in [p / 2 for p in range(10, int(2 * most) + 1)]:
            seconds = 10**power / 3 / 1e4
            recording, page = work / "run.mcap", work / "page.html"
            recording.unlink(missing_ok=True)
            made = subprocess.run([program, "record", "--rig", work / "rig.toml", "--simulate", "--speed", "0", "--rate", "10000", "--duration",
                                   f"{max(seconds, 3):.3f}", "--effects", "unsteady-friction", "-o", recording], capture_output=True, text=True)
            if made.returncode not in (0, 3):
                raise SystemExit(made.stderr)
            samples = 3e4 * max(seconds, 3)
            cells = []
            for command in COMMANDS:
                took, memory = run(program, command, recording, *(["--report", page] if command == "diagnose" else []))
                cells.append(f"{took:.2f}; {memory:.0f}")
                if command == "inspect":
                    seen.append((math.log10(samples), math.log10(took)))
            print(f"| {samples:.3g} | " + " | ".join(cells) + f" | {page.stat().st_size / 1e6:.2f} | {samples * 16 / 2**20:.0f} |", flush=True)
    # starting the program takes its own time: the larger half shows the growth
    points = seen[len(seen) // 2:]
    x, y = (sum(p[i] for p in points) / len(points) for i in (0, 1))
    power = sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points)
    print(f"\nThe time of `inspect` grows with the power {power:.2f} of the number of samples.")
    if power > 1.15:
        raise SystemExit("faster than in proportion")


main()
