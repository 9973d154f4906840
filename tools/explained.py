"""How often `explain` finds where a forcing is that no effect of the catalogue describes, and what it looks like.

explained.py PROGRAM FOLDER...: the tables of docs/src/measured/explained.md

FOLDER as `hidden_effects SEED COUNT FOLDER forcings` (or `nothing`) of tools/hidden writes it. The place is right where the most probable one is the true
one (a place along the pipe within two of its standard errors or 5% of the pipe's length); the waveform is compared with the true one by their
correlation over the record. A forcing that leaves the sensors within LEAST times the noise of what they would show without it is not judged."""
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from hidden_folder import answers, imported

LEAST = 1.0
STRONG = 5.0


def correlation(found, truth):
    """Of the recovered waveform with the true one, read at its times."""
    t, value = np.array(found["time_s"]), np.array(found["value"])
    true = np.interp(t, truth["time_s"], truth["value"])
    if true.std() == 0 or value.std() == 0:
        return 0.0
    return float(np.corrcoef(value, true)[0, 1])


def is_there(found, truth, length_m):
    if found["where"] != truth["where"]:
        return False
    if truth["position_m"] is None:
        return True
    return abs(found["position_m"] - truth["position_m"]) < max(2 * found["position_error_m"], 0.05 * length_m)


def length_of(folder, case):
    text = (folder / case / "rig.toml").read_text()
    return float(text.split("length_m = ")[1].split()[0])


program, folders = sys.argv[1], [Path(f) for f in sys.argv[2:]]
rows, silent, nothing, seconds = [], 0, [], []
for folder in folders:
    with tempfile.TemporaryDirectory() as work:
        for case, answer in answers(folder):
            recordings = imported(program, folder, case, work)
            start = ",".join(answer["start_effects"]) or "none"
            began = time.time()
            run = subprocess.run([program, "explain", *recordings, "--effects", start, "--json"], capture_output=True, text=True)
            seconds.append(time.time() - began)
            if run.returncode != 0:
                print(f"{folder.name}/{case}: {run.stderr.strip()}")
                continue
            found = json.loads(run.stdout)["explanations"]
            truth, kind = answer["forcing"], answer["hidden"]["effect"]
            if truth is None:
                nothing.append(bool(found))
                print(f"{folder.name}/{case} {kind}: {found[0]['says'] if found else '-'}", flush=True)
                continue
            strengths = {Path(r).stem.split("-")[-1]: truth["runs"][Path(r).stem.split("-")[-1]] for r in recordings}
            strength = max(s["strength"] for s in strengths.values())
            if strength < LEAST:
                print(f"{folder.name}/{case} {kind}: too weak ({strength:.1f})", flush=True)
                continue
            best = found[0] if found else None
            right = best is not None and is_there(best, truth, length_of(folder, case))
            there = next((f for f in found if is_there(f, truth, length_of(folder, case))), None)
            among, like = there is not None, 0.0
            if there:
                like = correlation(there, truth["runs"][there["run"].rsplit(".", 1)[0].split("-")[-1]])
            tone = (best or {}).get("pulsation")
            hz = tone["frequency_hz"] / truth["frequency_hz"] - 1 if right and tone and truth["frequency_hz"] else None
            rows.append((kind, strength, right, like, hz, among))
            place = f"{truth['where']} {truth['position_m'] or ''}"
            print(f"{folder.name}/{case} {kind} at {place}, {strength:.0f} x noise: {'right' if right else 'among' if among else 'WRONG'} {like:.3f} "
                  f"{'' if hz is None else f'{100 * hz:+.2f}%'} {seconds[-1]:.1f} s | "
                  + " / ".join(f"{f['says']} ({f['probability']:.2f})" for f in found), flush=True)

print("\n| forcing | judged | right place | right place among those shown | strong | waveform alike (0.9) of strong |\n| --- | --- | --- | --- | --- | --- |")
for kind in [*sorted({r[0] for r in rows}), None]:
    own = [r for r in rows if kind in (None, r[0])]
    strong = [r for r in own if r[1] >= STRONG]
    print(f"| {kind or 'all'} | {len(own)} | {sum(r[2] for r in own)} | {sum(r[5] for r in own)} | {len(strong)} | {sum(r[3] >= 0.9 for r in strong)} |")
tones = [r for r in rows if r[0] == "pulsation"]
print(f"\nPulsations named with a frequency within 1%: {sum(r[4] is not None and abs(r[4]) < 0.01 for r in tones)} of {len(tones)}.")
print(f"Something shown where nothing is hidden: {sum(nothing)} of {len(nothing)}.")
print(f"Seconds, calibration included: {np.median(seconds):.1f} median, {max(seconds):.1f} worst.")
