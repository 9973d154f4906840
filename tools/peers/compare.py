#!/usr/bin/env python3
"""surgescope's solver beside two published ones, on the same pipe, in one run.

One elastic pipe of 1000 reaches with steady friction, a reservoir, a flow that is shut off within 20 steps. Each peer gets a
virtual environment of its own (kept in a folder, so a second run needs no network). All three must see the same first peak;
printed is the time a node and step takes each. Timed is the solve alone, without start-up, on one thread. The three take turns,
and each counts its best one: what else runs on the machine slows a turn, nothing speeds one up.

    cargo build --release && tools/peers/compare.py [--venvs FOLDER]

Exits with 1 where the peaks differ by more than 1% of the rise, or a ratio falls under its bar (3 for rthym-moc, 1000 for TSNet).
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
GRAVITY = 9.81
REACHES = 1000
LENGTH_M = 1000.0
DIAMETER_M = 0.5
VELOCITY_M_S = 0.3
SUPPLY_HEAD_M = 120.0
TURNS = 15
HAZEN_WILLIAMS = 140.0
# rthym-moc's wave speed of a pipe without elasticity: 4000 ft/s.
WAVE_SPEED_M_S = 4000 * 0.3048

PEERS = {
    "rthym-moc": {"packages": ["rthym-moc==0.4.1"], "script": "rthym_case.py", "bar": 3.0},
    "TSNet": {"packages": ["tsnet==0.3.1", "numpy<2", "six"], "script": "tsnet_case.py", "bar": 1000.0},
}


def the_case() -> dict:
    flow = VELOCITY_M_S * math.pi / 4 * DIAMETER_M**2
    loss = 10.667 * LENGTH_M * (flow / HAZEN_WILLIAMS) ** 1.852 / DIAMETER_M**4.871
    return {
        "length_m": LENGTH_M,
        "diameter_m": DIAMETER_M,
        "hazen_williams": HAZEN_WILLIAMS,
        "friction_factor": loss * 2 * GRAVITY * DIAMETER_M / (LENGTH_M * VELOCITY_M_S**2),
        "velocity_m_s": VELOCITY_M_S,
        "flow_m3_s": flow,
        "supply_head_m": SUPPLY_HEAD_M,
        "valve_head_m": SUPPLY_HEAD_M - loss,
        "wave_speed_m_s": WAVE_SPEED_M_S,
        "reaches": REACHES,
        "dt_s": LENGTH_M / WAVE_SPEED_M_S / REACHES,
        "closing_steps": 20,
        # The first plateau lasts 2L/a: 2000 steps.
        "peak_steps": 1500,
        "steps": {"surgescope": 5000, "rthym-moc": 3000, "TSNet": 50},
    }


def surgescope(program: Path, case: dict, steps: int) -> dict:
    """One simulation: seconds of the solve and the first peak."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Path(folder) / "rig.toml"
        rig.write_text(
            f"""name = "peers"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = {case["length_m"]}
inner_diameter_mm = {case["diameter_m"] * 1e3}
wall_thickness_mm = 10.0
material = "steel"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
[[sensor]]
name = "P1"
kind = "pressure"
position_m = {case["length_m"]}
unit = "m(H2O)"
"""
        )
        out = Path(folder) / "out.csv"
        settings = {
            "wave_speed_m_s": case["wave_speed_m_s"],
            "friction_factor": case["friction_factor"],
            "initial_velocity_m_s": case["velocity_m_s"],
            "valve_head_m": case["valve_head_m"],
            "closing_time_s": case["closing_steps"] * case["dt_s"],
            "reaches": case["reaches"],
        }
        command = [program, "simulate", "--rig", rig, "--valve", "flow-ramp", "--json", "-o", out]
        command += ["--duration", str(steps * case["dt_s"]), "--set", *(f"{n}={v!r}" for n, v in settings.items())]
        answer = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        heads = [float(line.split(",")[1]) for line in out.read_text().splitlines()[1:]]
    return {
        "seconds": answer["seconds"],
        "first_head_m": heads[0],
        "peak_m": max(heads[: case["peak_steps"]]),
        "version": subprocess.run([program, "--version"], capture_output=True, text=True).stdout.split()[-1],
    }


def venv(folder: Path, packages: list[str]) -> Path:
    """The Python of a virtual environment with these packages, made if it is not there."""
    python = folder / "bin" / "python"
    done = folder / "installed.txt"
    if not (done.exists() and done.read_text() == "\n".join(packages)):
        subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages], check=True)
        done.write_text("\n".join(packages))
    return python


def argument_parser(doc: str) -> argparse.ArgumentParser:
    """Options that name the program and the folder of the peers."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    root = HERE.parent.parent
    parser.add_argument("--program", type=Path, default=root / "target/release/surgescope")
    parser.add_argument("--venvs", type=Path, default=root / "target/peers", help="where the peers are installed")
    return parser


def arguments(doc: str) -> argparse.Namespace:
    """The program and the folder of the peers, from the command line."""
    parser = argument_parser(doc)
    args = parser.parse_args()
    if not args.program.exists():
        parser.error(f"{args.program} is not there: cargo build --release")
    return args


def main() -> int:
    args = arguments(__doc__)

    case = the_case()
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    pythons = {name: venv(args.venvs / name, peer["packages"]) for name, peer in PEERS.items()}
    results: dict = {}
    for turn in range(TURNS):
        # A simulation that sees the first peak takes TSNet seconds: once is enough.
        asked = json.dumps({**case, "with_peak": turn == 0})
        answers = {"surgescope": surgescope(args.program, case, case["steps"]["surgescope"])}
        for name, peer in PEERS.items():
            command = [pythons[name].absolute(), HERE / peer["script"]]
            # TSNet's EPANET leaves files where it runs.
            with tempfile.TemporaryDirectory() as folder:
                run = subprocess.run(
                    command, input=asked, capture_output=True, text=True, env=one_thread, cwd=folder
                )
            if run.returncode != 0:
                print(run.stderr, file=sys.stderr)
                return 1
            answers[name] = json.loads(run.stdout)
        for name, answer in answers.items():
            best = results.setdefault(name, answer)
            best["seconds"] = min(best["seconds"], answer["seconds"])

    failed = False
    per_node = {n: r["seconds"] / (case["steps"][n] * (REACHES + 1)) for n, r in results.items()}
    rise = results["surgescope"]["peak_m"] - results["surgescope"]["first_head_m"]
    print(f"{REACHES} reaches, steady friction, one thread\n")
    print("| solver | first peak, m | time a node and step, ns | surgescope is faster by | bar |")
    print("| --- | --- | --- | --- | --- |")
    for name, result in results.items():
        ratio, bar = per_node[name] / per_node["surgescope"], PEERS.get(name, {}).get("bar")
        faster = "" if bar is None else f"{ratio:.1f}" if ratio < 100 else f"{ratio:.0f}"
        needed = f"{bar:g}" if bar else ""
        print(f"| {name} {result['version']} | {result['peak_m']:.3f} | {per_node[name] * 1e9:.3g} | {faster} | {needed} |")
        if abs(result["peak_m"] - results["surgescope"]["peak_m"]) > 0.01 * rise:
            print(f"{name}: the first peak is off by more than 1% of the rise of {rise:.2f} m", file=sys.stderr)
            failed = True
        if bar and ratio < bar:
            print(f"{name}: under its bar of {bar:g}", file=sys.stderr)
            failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
