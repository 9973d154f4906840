"""Whether a model that contains another ever ends worse: random recordings, random models, one more effect, and count.

nested.py PROGRAM COUNT SEED FOLDER...: a line of docs/src/measured/reliability.md

FOLDER as hidden_folder.py says. The smaller model holds the start effects and up to one other; the bigger one more. Each is calibrated from
the signals alone, on at most 64 reaches. What is compared is what a fit minimises: the error over the noise of the sensors, rms over all samples.
Worse is more than a thousandth above."""
import json
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hidden_folder import answers, imported

WORSE = 1.001
EFFECTS = ["unsteady-friction", "entrained-gas", "vapour-cavity", "leak", "blockage", "section-change", "valve-law", "valve-seat-leak", "supply-drift",
           "air-pocket", "moving-valve", "side-branch", "sensor-lag@P1", "sensor-lag@P2", "clock-skew@P2", "sensor-gain@P2"]

program, count, seed, folders = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), [Path(f) for f in sys.argv[4:]]
drawn = random.Random(seed)
cases = [(folder, case, answer) for folder in folders for case, answer in answers(folder)]


def calibrated(recordings, effects):
    """Error over noise of the fit, or none where the program refuses the model."""
    run = subprocess.run([program, "calibrate", *recordings, "--effects", ",".join(effects) or "none", "--most-reaches", "64", "--json"],
                         capture_output=True, text=True)
    if run.returncode != 0:
        return None
    sensors = [sensor for run in json.loads(run.stdout)["runs"] for sensor in run["sensors"]]
    square = sum(s["samples"] * (s["rmse_m"] / s["noise_m"]) ** 2 for s in sensors)
    return (square / sum(s["samples"] for s in sensors)) ** 0.5


def tried(one):
    (folder, case, _), smaller, more = one
    with tempfile.TemporaryDirectory() as work:
        recordings = imported(program, folder, case, work)[:1]
        first, second = calibrated(recordings, smaller), calibrated(recordings, [*smaller, more])
    return f"{folder.name}/{case}", smaller, more, first, second


def draw():
    case = drawn.choice(cases)
    start = [f"{e}:2" if e == "viscoelastic-wall" else e for e in case[2]["start_effects"]]
    others = [e for e in EFFECTS if e not in start]
    drawn.shuffle(others)
    return case, start + others[: drawn.randint(0, 1)], others[2]


with ThreadPoolExecutor(2) as pool:
    results = list(pool.map(tried, [draw() for _ in range(count)]))
compared = [r for r in results if r[3] is not None and r[4] is not None]
worse = [r for r in compared if r[4] > WORSE * r[3]]
print(f"{len(compared)} pairs of models ({len(results) - len(compared)} refused), {len(worse)} end worse.")
for case, smaller, more, first, second in sorted(worse, key=lambda r: r[3] / r[4]):
    print(f"{case}: {','.join(smaller) or 'none'} leaves {first:.4g} x the noise, with {more} {second:.4g}")
