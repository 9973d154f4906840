"""Diagnose recordings with two or three effects hidden at once until nothing is missing, and count.

together.py PROGRAM FOLDER COUNT: tables of docs/src/measured/reliability.md

FOLDER as `hidden_effects SEED N FOLDER --pairs` or `--triples` writes it. A recording counts where each effect can be seen beside the others:
fitted without it, the model leaves SEEN times the noise. The first COUNT such recordings are taken. Answers are kept in
FOLDER/together.jsonl, so that a run that is cut off goes on."""
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hidden_folder import answers, imported

SEEN = 3.0


def base(label):
    return label.split(":")[0].split("@")[0].split("/")[0]


def left(program, recordings, effects):
    """Error over noise of the model with these effects."""
    run = subprocess.run([program, "calibrate", *recordings, "--effects", ",".join(effects) or "none", "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    fit = json.loads(run.stdout)
    return fit["rmse_m"] / fit["noise_m"]


def said_of(program, recordings, answer):
    start = answer["start_effects"]
    hidden = answer["hidden"]["effects"]
    seen = float("inf")
    for lacking in hidden:
        seen = min(seen, left(program, recordings, [*start, *(e for e in hidden if e != lacking)]))
        if seen < SEEN:
            return {"seen": seen}
    began = time.time()
    run = subprocess.run([program, "diagnose", *recordings, "--effects", ",".join(start) or "none", "--until-done", "--json"],
                         capture_output=True, text=True)
    if run.returncode != 0:
        return {"seen": seen, "error": run.stderr.strip()}
    found = json.loads(run.stdout)
    final = [base(e) for e in found["start"]["effects"]]
    return {"seen": seen, "s": time.time() - began, "added": [e for e in final if e not in start], "verdict": found["verdict"],
            "over_noise": found["start"]["rmse_m"] / found["start"]["noise_m"]}


program, folder, count = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
kept = folder / "together.jsonl"
said = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
known = {s["case"] for s in said}
with tempfile.TemporaryDirectory() as work, kept.open("a") as out:
    for case, answer in answers(folder):
        if case in known or sum("added" in s or "error" in s for s in said) >= count:
            continue
        recordings = imported(program, folder, case, work)
        said.append({"case": case, "hidden": answer["hidden"]["effects"], **said_of(program, recordings, answer)})
        print(json.dumps(said[-1]), file=out, flush=True)

taken = [s for s in said if "added" in s or "error" in s]
ALL, SOME = "all, nothing else", "some, nothing else"
tally = {ALL: 0, SOME: 0, "none": 0, "one that is not there": 0, "refused": 0}
print("| hidden | added | error over noise | verdict on the rest |")
print("| --- | --- | --- | --- |")
for s in taken:
    if "error" in s:
        tally["refused"] += 1
        print(f"| {', '.join(s['hidden'])} | {s['error']} | | |")
        continue
    right = [e for e in s["added"] if e in s["hidden"]]
    verdict = ("one that is not there" if len(right) < len(s["added"]) else
               ALL if len(right) == len(s["hidden"]) else SOME if right else "none")
    tally[verdict] += 1
    if verdict != ALL:
        print(f"| {', '.join(s['hidden'])} | {', '.join(s['added']) or 'none'} | {s['over_noise']:.2f} | {s['verdict']} |")
seconds = sorted(s["s"] for s in taken if "s" in s)
print(f"\n{len(taken)} recordings: " + "; ".join(f"{name} {n}" for name, n in tally.items())
      + f". {seconds[len(seconds) // 2]:.1f} s median, {seconds[-1]:.1f} s worst.")
