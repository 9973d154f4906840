#!/usr/bin/env python3
"""surgescope and TSNet on a network of loops, in one run: TSNet's first example, Tnet1.

Nine pipes, three loops, a reservoir, and a valve behind N7 that shuts off 100 L/s within two steps. TSNet changes
wave speeds until its step divides every pipe. Compared are the heads at three nodes over 10 s: once with TSNet's changed wave speeds in both programs, and once with
the true ones in surgescope, which shows what the change costs. Friction factors, initial flow and head are those of TSNet's steady state.

    cargo build --release && tools/peers/tnet.py [--program FILE] [--venvs FOLDER]

Exits with 1 where the heads differ by more than 0.1% of their range with the same wave speeds.
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from compare import PEERS, arguments, venv

HERE = Path(__file__).resolve().parent
# name, from, to, length (m), diameter (mm), Hazen-Williams coefficient
PIPES = [
    ("P1", "R1", "N3", 610, 900, 92),
    ("P2", "N3", "N4", 914, 750, 107),
    ("P3", "N3", "N2", 610, 600, 98),
    ("P4", "N4", "N6", 457, 450, 105),
    ("P5", "N4", "N2", 549, 450, 100),
    ("P6", "N5", "N2", 671, 750, 93),
    ("P7", "N5", "N7", 610, 900, 105),
    ("P8", "N6", "N5", 457, 600, 105),
    ("P9", "N2", "N6", 488, 450, 140),
]
JUNCTIONS = ["N2", "N3", "N4", "N5", "N6"]
NODES = ["N7", "N2", "N6"]
WAVE_SPEED_M_S = 1200.0
DURATION_S = 10.0
STEP_S = 0.01
# The shortest way from the reservoir to the valve.
WAY = ["P1", "P3", "P6", "P7"]
MOST_SHARE = 1e-3


def inp() -> str:
    """The network as EPANET has it: what the valve passes is drawn off behind it."""
    junctions = "".join(f" {name} 0 0\n" for name in [*JUNCTIONS, "N7"])
    pipes = "".join(f" {n} {a} {b} {l} {d} {c} 0 Open\n" for n, a, b, l, d, c in PIPES)
    return (
        f"[JUNCTIONS]\n{junctions} N8 0 100\n[RESERVOIRS]\n R1 191\n[PIPES]\n{pipes}[VALVES]\n VALVE N7 N8 184 FCV 10000 0\n"
        "[OPTIONS]\n Units LPS\n Headloss H-W\n[TIMES]\n Duration 0\n[END]\n"
    )


def rig(pipes: dict, changed: bool) -> str:
    text = 'name = "Tnet1"\n[fluid]\nname = "water"\ntemperature_degC = 20.0\n'
    text += '[[node]]\nname = "R1"\nkind = "reservoir"\n[[node]]\nname = "N7"\nkind = "valve"\nclosing_time_s = 0.02\n'
    text += "".join(f'[[node]]\nname = "{name}"\nkind = "junction"\n' for name in JUNCTIONS)
    for name, start, end, length, diameter, _ in PIPES:
        wave_speed = pipes[name]["wave_speed_m_s"] if changed else WAVE_SPEED_M_S
        text += (
            f'[[pipe]]\nname = "{name}"\nfrom = "{start}"\nto = "{end}"\nlength_m = {length}\ninner_diameter_mm = {diameter}\nwall_thickness_mm = 10\n'
            f'material = "steel"\nwave_speed_m_s = {wave_speed}\nfriction_factor = {pipes[name]["friction_factor"]}\n'
        )
    for name in NODES:
        text += f'[[sensor]]\nname = "{name}"\nkind = "pressure"\nnode = "{name}"\nunit = "m(H2O)"\n'
    return text


def surgescope(program: Path, peer: dict, changed: bool) -> tuple[float, dict]:
    """Seconds of the solve, and the heads at TSNet's steps."""
    at_valve = peer["pipes"]["P7"]
    lengths = {pipe[0]: pipe[3] for pipe in PIPES}
    way_s = sum(lengths[p] / peer["pipes"][p]["wave_speed_m_s"] for p in WAY)
    settings = {
        "initial_velocity_m_s": at_valve["velocity_m_s"],
        "valve_head_m": at_valve["end_head_m"],
        "closing_time_s": 2 * peer["dt_s"],
        "reaches": round(way_s / peer["dt_s"]),
    }
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "rig.toml", Path(folder) / "out.csv"
        file.write_text(rig(peer["pipes"], changed))
        command = [program, "simulate", "--rig", file, "--valve", "flow-ramp", "--json", "-o", out]
        command += ["--duration", str(DURATION_S - peer["dt_s"]), "--csv-times", repr(peer["dt_s"])]
        command += ["--set", *(f"{name}={value!r}" for name, value in settings.items())]
        runs = [json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout) for _ in range(5)]
        rows = list(csv.DictReader(out.open()))
    return min(run["seconds"] for run in runs), {name: [float(row[name]) for row in rows] for name in NODES}


def main() -> int:
    args = arguments(__doc__)
    python = venv(args.venvs / "TSNet", PEERS["TSNet"]["packages"])
    case = {"inp": inp(), "wave_speed_m_s": WAVE_SPEED_M_S, "duration_s": DURATION_S, "dt_s": STEP_S, "nodes": NODES}
    # Closing time, start, relative opening at the end, power of its fall.
    case |= {"event": ["valve_closure", "VALVE", [2 * STEP_S, "step", 0.0, 1]], "engine": "DD"}
    with tempfile.TemporaryDirectory() as folder:
        command = [python.absolute(), HERE / "tnet_case.py"]
        run = subprocess.run(command, input=json.dumps(case), capture_output=True, text=True, cwd=folder)
    if run.returncode != 0:
        print(run.stderr, file=sys.stderr)
        return 1
    peer = json.loads(run.stdout)

    failed = False
    print(f"TSNet {peer['version']}: {peer['seconds']:.2f} s\n")
    print("| wave speeds | node | range, m | difference, RMS, m | share of the range | surgescope, s |")
    print("| --- | --- | --- | --- | --- | --- |")
    for words, changed in [("changed, as TSNet's", True), ("as they are", False)]:
        seconds, heads = surgescope(args.program, peer, changed)
        for name in NODES:
            # TSNet's valve begins to move with its second step.
            theirs = peer["heads_m"][name][1:]
            pairs = list(zip(heads[name], theirs))
            rms = math.sqrt(sum((a - b) ** 2 for a, b in pairs) / len(pairs))
            reach = max(theirs) - min(theirs)
            print(f"| {words} | {name} | {reach:.2f} | {rms:.3f} | {100 * rms / reach:.2f}% | {seconds:.2g} |")
            if changed and rms > MOST_SHARE * reach:
                print(f"{name}: more than {100 * MOST_SHARE:g}% of the range", file=sys.stderr)
                failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
