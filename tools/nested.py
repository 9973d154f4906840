"""Whether a model that contains another ever ends worse: random recordings, random models, one more effect, and count.

nested.py PROGRAM COUNT SEED FOLDER...: a line of docs/src/measured/reliability.md

FOLDER as hidden_folder.py says. The smaller model holds the start effects and up to one other; each bigger one, of up to eight, one more.
Each is calibrated from the signals alone, on at most 64 reaches. What is compared is what a fit minimises, `cost`. Worse is more than a thousandth
above, in the root of it. Counted apart are effects that the smaller model is not quite contained in (APART): unsteady friction's prior makes it
costly to vanish, the least gas is seen near vacuum, and with cavities no head is below that of vapour. The work is a campaign in
FOLDER/nested-COUNT-SEED of the first FOLDER: one that is cut off goes on."""
import json
import random
import shutil
import subprocess
import sys
from pathlib import Path

from hidden_folder import answers, imported
from planned import done

WORSE = 1.001
EFFECTS = ["unsteady-friction", "entrained-gas", "vapour-cavity", "leak", "blockage", "section-change", "valve-law", "valve-seat-leak", "supply-drift",
           "inlet-jet", "air-pocket", "moving-valve", "side-branch", "sensor-lag@P1", "sensor-lag@P2", "clock-skew@P2", "sensor-gain@P2"]

APART = {"unsteady-friction", "entrained-gas", "vapour-cavity"}

program, count, seed, folders = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), [Path(f).resolve() for f in sys.argv[4:]]
BIGGER = 8
drawn = random.Random(seed)
cases = [(folder, case, answer) for folder in folders for case, answer in answers(folder)]
place = folders[0] / f"nested-{count}-{seed}"
catalogue = json.loads(subprocess.run([program, "effects", "--json"], check=True, capture_output=True, text=True).stdout)["effects"]
excluded = {(effect["name"], other["name"]) for effect in catalogue for other in effect["excludes"]}


def beginning(folder, case):
    """The beginning of the case's first recording: many models are fitted, and the property is theirs, not the record's."""
    short = place / "beginnings" / folder.name / case
    if not (short / "run.csv").exists():
        short.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / case / "rig.toml", short)
        head, *rows = (folder / case / "run.csv").read_text().splitlines(keepends=True)
        until_s = 2.0 + 0.2 * float(rows[-1].split(",")[0])
        (short / "run.csv").write_text(head + "".join(row for row in rows if float(row.split(",")[0]) < until_s))
    return imported(program, short.parent, case, place / "recordings" / folder.name)


def draw():
    case = drawn.choice(cases)
    start = [f"{e}:2" if e == "viscoelastic-wall" else e for e in case[2]["start_effects"]]
    others = [e for e in EFFECTS if e not in start]
    drawn.shuffle(others)
    beside = drawn.randint(0, 1)
    return case, start + others[:beside], others[beside : beside + BIGGER]


def refused(model):
    """Whether effects of a model exclude each other."""
    names = [effect.split(":")[0].split("@")[0] for effect in model]
    return any((one, other) in excluded for one in names for other in names)


draws = [draw() for _ in range(-(-count // BIGGER))]
plans = []
for (folder, case, _), smaller, more in draws:
    models = [model or ["none"] for model in [smaller, *([*smaller, effect] for effect in more)] if not refused(model)]
    if models:
        plans.append({"name": f"{folder.name}/{case}", "recordings": beginning(folder, case), "effects": models})
fits = done(program, place, plans, {"most_reaches": 64}, may_fail=True, kind="calibrate")
cost = {(task["case"], *task["effects"]): fit["cost"] for task, fit, _ in fits if fit}
pairs = [(f"{folder.name}/{case}", smaller, effect) for (folder, case, _), smaller, more in draws for effect in more][:count]
results = [(case, smaller, effect, cost.get((case, *smaller)), cost.get((case, *smaller, effect))) for case, smaller, effect in pairs]
compared = [r for r in results if r[3] is not None and r[4] is not None]
worse = [r for r in compared if r[4] > WORSE**2 * r[3]]
print(f"{len(results) - len(compared)} of {len(results)} pairs of models refused.")
for what, is_it in [("can vanish", lambda r: r[2] not in APART), ("is counted apart", lambda r: r[2] in APART)]:
    print(f"{sum(map(is_it, worse))} of {sum(map(is_it, compared))} end worse whose effect {what}.")
for case, smaller, more, first, second in sorted(worse, key=lambda r: r[3] / r[4]):
    print(f"{case}: {','.join(smaller) or 'none'} leaves a misfit of {first:.6g}, with {more} {second:.6g}")
