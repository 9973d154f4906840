"""Diagnose a folder of recordings with one effect hidden, and print the result as a Markdown table.

blind.py PROGRAM FOLDER: the table of docs/src/measured/blind.md

FOLDER as hidden_folder.py says."""
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hidden_folder import answer_of, answers, imported


def diagnose(program, folder, case, answer, work):
    """What the program says of a case, and the seconds that it took."""
    recordings = imported(program, folder, case, work)
    start = ",".join(answer["start_effects"]) or "none"
    began = time.time()
    run = subprocess.run([program, "diagnose", *recordings, "--effects", start, "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"{case}: {run.stderr.strip()}")
    return json.loads(run.stdout), time.time() - began


program, folder = sys.argv[1], Path(sys.argv[2])
cases = answers(folder)

print("| case | start model | hidden | answer | probability | error before, x noise | after, x noise | s |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
right, seconds = 0, []
with tempfile.TemporaryDirectory() as work:
    for case, answer in cases:
        found, took = diagnose(program, folder, case, answer, work)
        seconds.append(took)
        best = found["candidates"][0] if found["candidates"] else None
        said = answer_of(found)
        truth = answer["hidden"]["effect"]
        right += said == truth
        noise = found["start"]["noise_m"]
        missing = found["verdict"] == "missing-effect"
        after = f"{best['rmse_m'] / noise:.2f}" if missing else ""
        mark = said if said == truth else f"**{said}**"
        print(f"| {case} | {', '.join(answer['start_effects']) or 'base'} | {truth} | {mark} | {found['probability']:.2f} "
              f"| {found['start']['rmse_m'] / noise:.2f} | {after} | {took:.1f} |", flush=True)
print(f"\n{right} of {len(cases)} right; {statistics.median(seconds):.1f} s median, {max(seconds):.1f} s worst, whole process.")
