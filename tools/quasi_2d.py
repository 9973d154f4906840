"""What each friction model in one dimension misses against quasi-2D runs, and what a diagnosis says of their records.

quasi_2d.py PROGRAM: the table of docs/src/measured/quasi_2d.md

One pipe for each Reynolds number, closed within a quarter of the pipe's travel time. Heads are compared at the valve over ten periods;
an error is the root mean square over the Joukowsky head. Records have the noise of `simulate`: 0.1% of the Joukowsky head."""
import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

RIG = """name = "re-{re:.0e}"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = {length_m}
inner_diameter_mm = {diameter_mm}
wall_thickness_mm = {wall_mm}
material = "steel"
wave_speed_m_s = 1200.0
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = {closing_s}
[[sensor]]
name = "P1"
kind = "pressure"
position_m = {length_m}
unit = "kPa"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = {half_m}
unit = "kPa"
[[sensor]]
name = "Q1"
kind = "flow"
unit = "L/s"
[[sensor]]
name = "T1"
kind = "temperature"
unit = "degC"
"""
# Water of 20 degC.
VISCOSITY_M2_S, DENSITY_KG_M3, WAVE_SPEED_M_S = 1.003e-6, 998.2, 1200.0
# Reynolds number, diameter in mm, length in m.
PIPES = [(1e3, 10.0, 50.0), (5e3, 20.0, 50.0), (1e4, 20.0, 50.0), (1e5, 100.0, 200.0), (1e6, 500.0, 1000.0)]
MODELS = {"quasi-steady": ["--effects", "none"], "Brunone": ["--effects", "unsteady-friction/brunone"], "history": ["--effects", "unsteady-friction"]}


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode > 1:
        raise SystemExit(" ".join(command) + "\n" + done.stderr)
    return done.stdout


def heads(program, rig, model, common, folder):
    path = folder / "heads.csv"
    run(program, "simulate", "--rig", str(rig), *model, *common, "-o", str(path), "--overwrite")
    with path.open() as file:
        return [float(row["P1"]) * 1e3 / (DENSITY_KG_M3 * 9.81) for row in csv.DictReader(file)]


def row(program, reynolds, diameter_mm, length_m, folder):
    velocity = reynolds * VISCOSITY_M2_S / (diameter_mm / 1e3)
    travel_s = length_m / WAVE_SPEED_M_S
    rig = folder / "rig.toml"
    rig.write_text(RIG.format(re=reynolds, diameter_mm=diameter_mm, wall_mm=diameter_mm / 10, length_m=length_m, half_m=length_m / 2,
                              closing_s=0.25 * travel_s))
    joukowsky_m = WAVE_SPEED_M_S * velocity / 9.81
    setting = ["--set", f"initial_velocity_m_s={velocity}", f"valve_head_m={2 * joukowsky_m + 20}"]
    common = [*setting, "--duration", str(40 * travel_s), "--csv-times", str(travel_s / 50)]
    truth = heads(program, rig, ["--solver", "quasi-2d"], common, folder)
    missed = []
    for model in MODELS.values():
        own = heads(program, rig, model, common, folder)
        missed.append((sum((a - b) ** 2 for a, b in zip(own, truth)) / len(truth)) ** 0.5 / joukowsky_m)
    record = folder / f"re-{reynolds:.0e}.mcap"
    record.unlink(missing_ok=True)
    run(program, "simulate", "--rig", str(rig), "--solver", "quasi-2d", *setting, "--seed", "1", "-o", str(record))
    found = json.loads(run(program, "diagnose", str(record), "--json"))
    best = found["candidates"][0] if found.get("candidates") else {}
    return missed, found["verdict"], best.get("effect", ""), best.get("probability", 0.0), found["start"]["rmse_m"] / found["start"]["noise_m"]


program = sys.argv[1]
print("| Re | " + " | ".join(MODELS) + " | verdict | first candidate | probability | base model, error over noise |")
print("| --- " * (len(MODELS) + 5) + "|")
with tempfile.TemporaryDirectory() as work:
    for pipe in PIPES:
        missed, verdict, effect, probability, over = row(program, *pipe, Path(work))
        errors = " | ".join(f"{100 * m:.2f}%" for m in missed)
        print(f"| {pipe[0]:.0e} | {errors} | {verdict} | {effect} | {probability:.2f} | {over:.1f} |", flush=True)
