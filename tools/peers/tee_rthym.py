#!/usr/bin/env python3
"""surgescope and rthym-moc on a tee, in one run: a reservoir, a branch with a dead end, and a flow that is shut off at the end of the run.

Lengths are whole steps of rthym-moc's wave speed, so that neither program adjusts anything. Friction factors have the loss of Hazen and Williams at the flow
before the closure. Compared are the heads at the valve, the tee and the dead end over 10 s.

    cargo build --release && tools/peers/tee_rthym.py [--program FILE] [--venvs FOLDER]

Exits with 1 where heads differ by more than 1% of their range.
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

DT_S = 0.01
# rthym-moc's wave speed of a pipe without elasticity: 4000 ft/s.
WAVE_SPEED_M_S = 4000 * 0.3048
G = 9.81
HAZEN_WILLIAMS = 140.0
HEAD_M = 120.0
FLOW_M3_S = 0.06
CLOSING_STEPS = 20
DURATION_S = 10.0
# from, to, reaches, diameter (m), share of the flow
PIPES = {"main": ("R", "T", 50, 0.5, 1), "run": ("T", "V", 25, 0.4, 1), "branch": ("T", "E", 20, 0.3, 0)}
NODES = {"V": "valve", "T": "tee", "E": "dead end"}
MOST_SHARE = 1e-2


def length_m(pipe: str) -> float:
    return PIPES[pipe][2] * WAVE_SPEED_M_S * DT_S


def loss_m(pipe: str) -> float:
    """Of Hazen and Williams."""
    return 10.667 * length_m(pipe) * (FLOW_M3_S / HAZEN_WILLIAMS) ** 1.852 / PIPES[pipe][3] ** 4.871


def in_rthym() -> None:
    """Prints the heads at the nodes; run in a venv that has rthym-moc."""
    import numpy
    import rthym_moc

    solver = rthym_moc.MOCSolver()
    tee = HEAD_M - loss_m("main")
    solver.add_node(rthym_moc.node_si("R", "PressureBoundary", head_m=HEAD_M))
    for name, head in {"T": tee, "E": tee, "V": tee - loss_m("run")}.items():
        solver.add_node(rthym_moc.node_si(name, "Junction", head_m=head, demand_m3s=FLOW_M3_S if name == "V" else 0.0))
    for name, (start, end, _, diameter, share) in PIPES.items():
        size = {"length_m": length_m(name), "diameter_mm": diameter * 1e3, "roughness": HAZEN_WILLIAMS}
        solver.add_pipe(rthym_moc.pipe_si(name, start, end, flow_m3s=share * FLOW_M3_S, **size))
    ramp = [(i * DT_S, FLOW_M3_S * 0.5 * (1 + math.cos(math.pi * i / CLOSING_STEPS))) for i in range(CLOSING_STEPS + 1)]
    rthym_moc.set_demand_schedule_si(solver, "V", ramp)
    # Steady friction only: k_bru = 0, and a filter of one step.
    results = solver.run(total_time=DURATION_S, dt=DT_S, usf_tau=DT_S, k_bru=0.0)
    heads = {name: (numpy.asarray(results["node_head"][name]) * 0.3048).tolist() for name in NODES}
    json.dump({"version": rthym_moc.__version__, "heads_m": heads}, sys.stdout)


def rig() -> str:
    text = 'name = "tee"\n[fluid]\nname = "water"\ntemperature_degC = 20.0\n'
    for name, kind in {"R": "reservoir", "T": "junction", "E": "dead-end", "V": "valve"}.items():
        text += f'[[node]]\nname = "{name}"\nkind = "{kind}"\n' + ("closing_time_s = 0.2\n" if name == "V" else "")
    for name, (start, end, _, diameter, share) in PIPES.items():
        velocity = FLOW_M3_S / (math.pi / 4 * diameter**2)
        factor = loss_m(name) * 2 * G * diameter / (length_m(name) * velocity**2)
        text += f'[[pipe]]\nname = "{name}"\nfrom = "{start}"\nto = "{end}"\nlength_m = {length_m(name)!r}\ninner_diameter_mm = {diameter * 1e3}\n'
        text += f'wall_thickness_mm = 10\nmaterial = "steel"\nwave_speed_m_s = {WAVE_SPEED_M_S!r}\nfriction_factor = {factor!r}\n'
    for name in NODES:
        text += f'[[sensor]]\nname = "{name}"\nkind = "pressure"\nnode = "{name}"\nunit = "m(H2O)"\n'
    return text


def main() -> int:
    from compare import PEERS, arguments, venv

    args = arguments(__doc__)
    python = venv(args.venvs / "rthym-moc", PEERS["rthym-moc"]["packages"])
    run = subprocess.run([python.absolute(), __file__, "--in-rthym"], capture_output=True, text=True)
    if run.returncode:
        sys.exit(run.stderr)
    peer = json.loads(run.stdout)
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "rig.toml", Path(folder) / "out.csv"
        file.write_text(rig())
        settings = {
            "initial_velocity_m_s": FLOW_M3_S / (math.pi / 4 * PIPES["run"][3] ** 2),
            "valve_head_m": HEAD_M - loss_m("main") - loss_m("run"),
            "closing_time_s": CLOSING_STEPS * DT_S,
            "reaches": PIPES["main"][2] + PIPES["run"][2],
        }
        command = [args.program, "simulate", "--rig", file, "--valve", "flow-ramp", "-o", out, "--csv-times", repr(DT_S)]
        command += ["--duration", repr(DURATION_S - DT_S), "--set", *(f"{name}={value!r}" for name, value in settings.items())]
        subprocess.run(command, check=True, capture_output=True)
        rows = list(csv.DictReader(out.open()))
    print(f"rthym-moc {peer['version']}\n\n| node | range, m | difference, RMS, m | share of the range |\n| --- | --- | --- | --- |")
    failed = False
    for name, words in NODES.items():
        theirs = peer["heads_m"][name]
        pairs = list(zip((float(row[name]) for row in rows), theirs))
        rms = math.sqrt(sum((a - b) ** 2 for a, b in pairs) / len(pairs))
        reach = max(theirs) - min(theirs)
        print(f"| {words} | {reach:.2f} | {rms:.3f} | {100 * rms / reach:.2f} % |")
        failed |= rms > MOST_SHARE * reach
    return int(failed)


if __name__ == "__main__":
    sys.exit(in_rthym() if "--in-rthym" in sys.argv else main())
