"""Diagnose a folder of recordings with one effect hidden, and print the result as a Markdown table.

blind.py PROGRAM FOLDER > tools/blind.md

FOLDER has answers.json ({case: {"hidden": {"effect": ...}, "start_effects": [...], "noise_m": ...}}) and a folder a case with rig.toml, run.csv
and perhaps run2.csv. The answers are read only to fill in the truth beside what the program says."""
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

program, folder = sys.argv[1], Path(sys.argv[2])
answers = json.loads((folder / "answers.json").read_text())
VERDICTS = {"nothing-missing": "nothing", "unknown-effect": "unknown"}


def diagnose(case, answer, work):
    recordings = []
    for csv in sorted((folder / case).glob("run*.csv")):
        recordings.append(f"{work}/{case}-{csv.stem}.mcap")
        rig = str(folder / case / "rig.toml")
        subprocess.run([program, "import", str(csv), "--rig", rig, "-o", recordings[-1]], check=True, capture_output=True)
    start = ",".join(answer["start_effects"]) or "none"
    began = time.time()
    run = subprocess.run([program, "diagnose", *recordings, "--effects", start, "--json"], capture_output=True, text=True)
    return json.loads(run.stdout), time.time() - began


print("| case | start model | hidden | answer | probability | error before, x noise | after, x noise | s |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
right, seconds = 0, []
with tempfile.TemporaryDirectory() as work:
    for case, answer in sorted(answers.items()):
        found, took = diagnose(case, answer, work)
        seconds.append(took)
        best = found["candidates"][0] if found["candidates"] else None
        said = VERDICTS.get(found["verdict"], best and best["effect"])
        truth = answer["hidden"]["effect"]
        right += said == truth
        noise = found["start"]["noise_m"]
        missing = found["verdict"] == "missing-effect"
        probability, after = (f"{best['probability']:.2f}", f"{best['rmse_m'] / noise:.2f}") if missing else ("", "")
        mark = said if said == truth else f"**{said}**"
        print(f"| {case} | {', '.join(answer['start_effects']) or 'base'} | {truth} | {mark} | {probability} "
              f"| {found['start']['rmse_m'] / noise:.2f} | {after} | {took:.1f} |", flush=True)
print(f"\n{right} of {len(answers)} right; {statistics.median(seconds):.1f} s median, {max(seconds):.1f} s worst, whole process.")
