"""How far located effects are found from where they are, over the bound that the Jacobian sets (Cramér & Rao), and count.

located.py FOLDER...: a table of docs/src/measured/reliability.md

FOLDER as reliability.py leaves it, on rig files that are right: its answers in said.jsonl. The hidden scheme puts an effect at the nearest of its
NODES + 1 nodes, which is the truth here. Effects that were named and fitted count."""
import json
import sys
import tomllib
from pathlib import Path

from hidden_folder import answer_of, answers

NODES = 400
PLACES = {"leak": "leak_position_m", "blockage": "blockage_position_m", "side-branch": "branch_position_m"}

ratios = {}
for folder in map(Path, sys.argv[1:]):
    truths = dict(answers(folder))
    for line in (folder / "said.jsonl").read_text().splitlines():
        one = json.loads(line)
        said, truth = one["said"], one["truth"]
        if truth not in PLACES or said["verdict"] != "missing-effect" or answer_of(said) != truth:
            continue
        length_m = tomllib.loads((folder / one["case"] / "rig.toml").read_text())["pipe"][0]["length_m"]
        asked_m = float(truths[one["case"]]["hidden"]["what"].split("(")[1].split(",")[0])
        true_m = round(asked_m / length_m * NODES) * length_m / NODES
        found = (said["pair"] or said["candidates"][0])["parameters"]
        for p in found:
            if p["name"] == PLACES[truth] and p["standard_error"]:
                ratios.setdefault(truth, []).append(((p["value"] - true_m) / p["standard_error"], p["value"] - true_m))

print("| effect | cases | error over its bound, rms | within 2 | within 3 | largest error, m |")
print("| --- | --- | --- | --- | --- | --- |")
every = [r for own in ratios.values() for r in own]
for name, own in [*sorted(ratios.items()), ("all", every)]:
    size = [abs(r) for r, _ in own]
    rms = (sum(s * s for s in size) / max(len(size), 1)) ** 0.5
    print(f"| {name} | {len(own)} | {rms:.1f} | {sum(s <= 2 for s in size)} | {sum(s <= 3 for s in size)} | {max((abs(e) for _, e in own), default=0):.2f} |")
