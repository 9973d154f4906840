"""Whether a model that contains another ever ends worse: random recordings, random models, one more effect, and count.

nested.py PROGRAM COUNT SEED FOLDER...: a line of docs/src/measured/reliability.md

FOLDER as hidden_folder.py says. The smaller model holds the start effects and up to one other; each bigger one, of up to eight, one more.
Each is calibrated from the signals alone, on at most 64 reaches. What is compared is what a fit minimises, `cost`. Worse is more than a thousandth
above, in the root of it. Counted apart are effects that the smaller model is not quite contained in (APART): unsteady friction's prior makes it
costly to vanish, the least gas is seen near vacuum, and with cavities no head is below that of vapour. Each pair goes to the standard error output as it ends."""
import json
import random
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hidden_folder import answers, imported

WORSE = 1.001
EFFECTS = ["unsteady-friction", "entrained-gas", "vapour-cavity", "leak", "blockage", "section-change", "valve-law", "valve-seat-leak", "supply-drift",
           "air-pocket", "moving-valve", "side-branch", "sensor-lag@P1", "sensor-lag@P2", "clock-skew@P2", "sensor-gain@P2"]

APART = {"unsteady-friction", "entrained-gas", "vapour-cavity"}

program, count, seed, folders = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), [Path(f) for f in sys.argv[4:]]
BIGGER = 8
drawn = random.Random(seed)
cases = [(folder, case, answer) for folder in folders for case, answer in answers(folder)]


def beginning(folder, case, work):
    """A folder with the beginning of the case's first recording: many models are fitted, and the property is theirs, not the record's."""
    short = Path(work) / case
    short.mkdir()
    shutil.copy(folder / case / "rig.toml", short)
    head, *rows = (folder / case / "run.csv").read_text().splitlines(keepends=True)
    until_s = 2.0 + 0.2 * float(rows[-1].split(",")[0])
    (short / "run.csv").write_text(head + "".join(row for row in rows if float(row.split(",")[0]) < until_s))
    return Path(work)


def calibrated(recordings, effects):
    """What the fit minimised, or none where the program refuses the model."""
    run = subprocess.run([program, "calibrate", *recordings, "--effects", ",".join(effects) or "none", "--most-reaches", "64", "--json"],
                         capture_output=True, text=True)
    return json.loads(run.stdout)["cost"] if run.returncode == 0 else None


def tried(one):
    (folder, case, _), smaller, more = one
    with tempfile.TemporaryDirectory() as work:
        recordings = imported(program, beginning(folder, case, work), case, work)[:1]
        first = calibrated(recordings, smaller)
        results = [(f"{folder.name}/{case}", smaller, effect, first, calibrated(recordings, [*smaller, effect])) for effect in more]
    for result in results:
        print(json.dumps(result), file=sys.stderr, flush=True)
    return results


def draw():
    case = drawn.choice(cases)
    start = [f"{e}:2" if e == "viscoelastic-wall" else e for e in case[2]["start_effects"]]
    others = [e for e in EFFECTS if e not in start]
    drawn.shuffle(others)
    beside = drawn.randint(0, 1)
    return case, start + others[:beside], others[beside : beside + BIGGER]


with ThreadPoolExecutor(2) as pool:
    results = [result for results in pool.map(tried, [draw() for _ in range(-(-count // BIGGER))]) for result in results][:count]
compared = [r for r in results if r[3] is not None and r[4] is not None]
worse = [r for r in compared if r[4] > WORSE**2 * r[3]]
print(f"{len(results) - len(compared)} of {len(results)} pairs of models refused.")
for what, is_it in [("can vanish", lambda r: r[2] not in APART), ("is counted apart", lambda r: r[2] in APART)]:
    print(f"{sum(map(is_it, worse))} of {sum(map(is_it, compared))} end worse whose effect {what}.")
for case, smaller, more, first, second in sorted(worse, key=lambda r: r[3] / r[4]):
    print(f"{case}: {','.join(smaller) or 'none'} leaves a misfit of {first:.6g}, with {more} {second:.6g}")
