"""A folder of recordings with one effect hidden, as blind.py and reliability.py take it.

answers.json ({case: {"hidden": {"effect": ...}, "start_effects": [...]}}) and a folder a case with rig.toml, run.csv and perhaps
run2.csv. The answers are read only to choose the start model and to fill in the truth beside what the program says."""
import json
import subprocess
import time
from pathlib import Path

VERDICTS = {"nothing-missing": "nothing", "unknown-effect": "unknown"}


def answers(folder):
    return sorted(json.loads((folder / "answers.json").read_text()).items())


def imported(program, folder, case, work):
    """The recordings of a case, imported."""
    recordings = []
    for csv in sorted((folder / case).glob("run*.csv")):
        recordings.append(f"{work}/{case}-{csv.stem}.mcap")
        rig = str(folder / case / "rig.toml")
        subprocess.run([program, "import", str(csv), "--rig", rig, "-o", recordings[-1]], check=True, capture_output=True)
    return recordings


def diagnose(program, folder, case, answer, work):
    """What the program says of a case, and the seconds that it took."""
    recordings = imported(program, folder, case, work)
    start = ",".join(answer["start_effects"]) or "none"
    began = time.time()
    run = subprocess.run([program, "diagnose", *recordings, "--effects", start, "--json"], capture_output=True, text=True)
    for recording in recordings:
        Path(recording).unlink()
    if run.returncode != 0:
        raise SystemExit(f"{case}: {run.stderr.strip()}")
    return json.loads(run.stdout), time.time() - began


def answer_of(said):
    """The verdict, or the most probable effect where one is missing."""
    return VERDICTS.get(said["verdict"]) or said["candidates"][0]["effect"]
