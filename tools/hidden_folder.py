"""A folder of recordings with one effect hidden, as blind.py and reliability.py take it.

answers.json ({case: {"hidden": {"effect": ...}, "start_effects": [...]}}) and a folder a case with rig.toml, run.csv and perhaps
run2.csv. The answers are read only to choose the start model and to fill in the truth beside what the program says."""
import json
import subprocess
from pathlib import Path

VERDICTS = {"nothing-missing": "nothing", "unknown-effect": "unknown"}


def answers(folder):
    return sorted(json.loads((folder / "answers.json").read_text()).items())


def imported(program, folder, case, work):
    """The recordings of a case, imported by this program: one that another has left would be read in its place. The same table gives the same file."""
    recordings = []
    Path(work).mkdir(parents=True, exist_ok=True)
    for csv in sorted((folder / case).glob("run*.csv")):
        recordings.append(f"{work}/{case}-{csv.stem}.mcap")
        Path(recordings[-1]).unlink(missing_ok=True)
        rig = str(folder / case / "rig.toml")
        subprocess.run([program, "import", str(csv), "--rig", rig, "-o", recordings[-1]], check=True, capture_output=True)
    return recordings


def answer_of(said):
    """The verdict, or the most probable effect where one is missing."""
    return VERDICTS.get(said["verdict"]) or said["candidates"][0]["effect"]
