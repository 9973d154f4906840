"""How far located effects are found from where they are, over the bound that the Jacobian sets (Cramér & Rao), and count.

located.py PROGRAM FOLDER...: a table of docs/src/measured/reliability.md

FOLDER as hidden_folder.py says, on rig files that are right. Each recording is calibrated with the start effects and the one that is hidden. The hidden
scheme puts a leak and a branch at the nearest of its NODES + 1 nodes, and a blockage in the middle of the reach behind it, which is the truth here. An
effect without which the model leaves less than SEEN times what it leaves with it cannot be placed and does not count. Fits are kept in FOLDER/located.jsonl."""
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from hidden_folder import answers, imported

NODES = 400
SEEN = 1.1
PLACES = {"leak": "leak_position_m", "blockage": "blockage_position_m", "side-branch": "branch_position_m"}


def calibrated(program, recordings, effects):
    words = [program, "calibrate", *recordings, "--effects", ",".join(effects) or "none", "--against", "none", "--json"]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def placed(program, folder, case, answer, work):
    """Where the effect is and where it was found, m, the standard error of the place, and how visible it is."""
    effect, start = answer["hidden"]["effect"], answer["start_effects"]
    recordings = imported(program, folder, case, work)
    without, found = calibrated(program, recordings, start), calibrated(program, recordings, [*start, effect])
    length_m = tomllib.loads((folder / case / "rig.toml").read_text())["pipe"][0]["length_m"]
    asked_m = float(answer["hidden"]["what"].split("(")[1].split(",")[0])
    reach_m = length_m / NODES
    true_m = round(asked_m / reach_m) * reach_m + (0.5 * reach_m if effect == "blockage" else 0)
    place = next(p for p in found["parameters"] if p["name"] == PLACES[effect])
    return {"case": case, "effect": effect, "true_m": true_m, "found_m": place["value"], "error_m": place["standard_error"],
            "at_bound": place["at_bound"], "seen": without["rmse_m"] / found["rmse_m"]}


program, kept = sys.argv[1], []
for folder in map(Path, sys.argv[2:]):
    file = folder / "located.jsonl"
    known = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {one["case"] for one in known}
    with tempfile.TemporaryDirectory() as work, file.open("a") as out:
        for case, answer in answers(folder):
            if answer["hidden"]["effect"] in PLACES and case not in done:
                known.append(placed(program, folder, case, answer, work))
                print(json.dumps(known[-1]), file=out, flush=True)
    kept += known

seen = [one for one in kept if one["seen"] >= SEEN]
print("| effect | cases | no optimum, or at a bound | error over its bound, rms | median | within 2 | within 3 | largest error of these, m |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
for name in [*sorted({one["effect"] for one in seen}), "all"]:
    own = [one for one in seen if name in (one["effect"], "all")]
    good = [one for one in own if one["error_m"] and not one["at_bound"]]
    size = sorted(abs(one["found_m"] - one["true_m"]) / one["error_m"] for one in good)
    rms = (sum(s * s for s in size) / max(len(size), 1)) ** 0.5
    worst = max((abs(one["found_m"] - one["true_m"]) for one in good), default=0)
    print(f"| {name} | {len(own)} | {len(own) - len(good)} | {rms:.1f} | {size[len(size) // 2]:.1f} | {sum(s <= 2 for s in size)} | {sum(s <= 3 for s in size)} | {worst:.2f} |")
