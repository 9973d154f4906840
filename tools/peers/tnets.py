#!/usr/bin/env python3
"""surgescope, TSNet and PTSNet on TSNet's bigger examples, in one run: Tnet2, whose pump shuts down, and Tnet3, where a pipe bursts.

Each network goes through `rig new`. Then the rig gets what TSNet computes with: its changed wave speeds, its friction factors of the steady flow, its valves
(K 0.2), its pumps' parabolas, demands that follow the pressure. Compared are the heads at TSNet's steps over 20 s. PTSNet 0.1.10 runs the Tnet3 of its own
examples; it is timed alone, and it wants numpy below 1.24.

    git clone https://github.com/glorialulu/TSNet
    cargo build --release && tools/peers/tnets.py --networks TSNet/examples/networks [--program FILE] [--venvs FOLDER]

Exits with 1 where heads differ by more than 0.5% of their range, or surgescope is less than 1000 times as fast as TSNet, or 20 times as PTSNet.
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from compare import PEERS, argument_parser, venv

HERE = Path(__file__).resolve().parent
WAVE_SPEED_M_S = 1200.0
DURATION_S = 20.0
# surgescope's gravity, and TSNet's.
G, G_TSNET = 9.81, 9.8
VALVE_K = 0.2
MOST_SHARE = 5e-3
PTSNET = ["ptsnet==0.1.10", "numpy==1.23.5", "wntr==1.2.0", "pandas<2", "networkx<3", "setuptools<70", "tqdm", "numba", "h5py", "mpi4py", "mpich", "six", "matplotlib"]

CASES = [
    {
        "name": "Tnet2",
        "words": "a pump runs down in 1 s",
        "event": ["pump_shut_off", "PUMP2", [1, 1, 0, 1]],
        "engine": "DD",
        # Nothing is drawn off at this dead end, where the rig has its valve.
        "end": "181",
        # The junction behind the pump is the pump's node in the rig.
        "nodes": ["10", "101", "103", "JUNCTION-105"],
        "called": {"10": "PUMP2"},
    },
    {
        "name": "Tnet3",
        "words": "a burst opens in 1 s",
        "event": ["add_burst", "JUNCTION-20", 1, 1, 0.01],
        "engine": "PDD",
        "end": "JUNCTION-7",
        "nodes": ["JUNCTION-20", "JUNCTION-22", "JUNCTION-8", "JUNCTION-16", "JUNCTION-90"],
    },
]


def imported(program: Path, inp: Path, end: str) -> dict:
    """The rig that `rig new` makes of a network whose flow could be shut off at a dead end."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Path(folder) / "rig.toml"
        command = [program, "rig", "new", inp, "-o", rig, "--yes", "--valve", end, "--closing-time-s", "1", "--material", "steel"]
        run = subprocess.run([*command, "--wall-thickness-mm", "6"], capture_output=True, text=True)
        if run.returncode:
            sys.exit(run.stderr)
        return tomllib.loads(rig.read_text())


def as_tsnet(rig: dict, peer: dict, case: dict) -> None:
    """Gives the rig what TSNet computes with."""
    for pipe in rig["pipe"]:
        of = peer["pipes"][pipe["name"].removesuffix(" behind")]
        pipe["friction_factor"] = of["friction_factor"] * G / G_TSNET
    for node in rig["node"]:
        name = node["name"]
        # Flow at 1 m as area times discharge coefficient.
        cda = lambda flow: flow / math.sqrt(2 * G) * 1e6
        if demand := peer["demands"].get(name, 0.0):
            node.pop("demand_m3_h", None)
            node["cda_mm2"] = cda(demand)
        if case["event"][:2] == ["add_burst", name]:
            start, grows, most = case["event"][2:]
            whole = demand + most
            node |= {"cda_mm2": cda(whole), "opening": [[start, demand / whole], [start + grows, 1.0]]}
        if name in peer["valves"]:
            end = peer["valves"][name]
            area = next(p["area_m2"] for p in peer["pipes"].values() if end in p["ends"])
            node["cda_mm2"] = area * 1e6 * math.sqrt(1 / VALVE_K)
        if name in peer["pumps"]:
            a, b, c, flow = peer["pumps"][name]
            points = [0.0, max(flow, 0.01), 1.5 * max(flow, 0.01)]
            # Where it would take head, TSNet lets water pass it.
            node["bypass"] = "check-valve"
            node["curve_m3_h_m"] = [[q * 3600, a * q * q + b * q + c] for q in points]
            if case["event"][:2] == ["pump_shut_off", name]:
                runs_down, start, _, _ = case["event"][2]
                node["speed"] = [[start, 1.0], [start + runs_down, 1e-4]]


def speeds(rig: dict, peer: dict) -> dict:
    """TSNet's wave speeds, as settings: a rig file takes no wave speed beyond that of water, and some of these are."""
    return {f"wave_speed_m_s[{p['name']}]": peer["pipes"][p["name"].removesuffix(" behind")]["wave_speed_m_s"] for p in rig["pipe"]}


def written(rig: dict, nodes: dict) -> str:
    """The rig file, with a sensor of the head at each of the nodes, by their names in the rig."""
    head = {"kind": "pressure", "unit": "m(H2O)", "elevation_m": 0.0}
    rig["sensor"] = [{"name": name, "node": node, **head} for name, node in nodes.items()]
    tables = [json.dumps("name") + " = " + json.dumps(rig["name"])]
    for kind in ["fluid", "node", "pipe", "sensor"]:
        for table in rig[kind] if isinstance(rig[kind], list) else [rig[kind]]:
            head = f"[[{kind}]]" if isinstance(rig[kind], list) else f"[{kind}]"
            tables.append("\n".join([head, *(f"{key} = {json.dumps(value)}" for key, value in table.items())]))
    return "\n\n".join(tables) + "\n"


def surgescope(program: Path, text: str, given: dict, dt_s: float, duration_s: float, turns: int = 5) -> tuple:
    """Best seconds of the solve, its step, and the head at each sensor at the peer's steps."""
    with tempfile.TemporaryDirectory() as folder:
        rig, out = Path(folder) / "rig.toml", Path(folder) / "out.csv"
        rig.write_text(text)
        settings = {"initial_velocity_m_s": 0.0, **given}

        def run() -> dict:
            command = [program, "simulate", "--rig", rig, "--valve", "flow-ramp", "--json", "-o", out, "--csv-times", repr(dt_s)]
            command += ["--duration", repr(duration_s), "--set", *(f"{name}={value!r}" for name, value in settings.items())]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                sys.exit(done.stderr)
            return json.loads(done.stdout)

        # On the peer's step.
        first = run()
        settings["reaches"] = round(first["reaches"] * first["time_step_s"] / dt_s)
        answers = [run() for _ in range(turns)]
        rows = list(csv.DictReader(out.open()))
    best = min(answers, key=lambda answer: answer["seconds"])
    return best["seconds"], best["time_step_s"], {key: [float(row[key]) for row in rows] for key in rows[0]}


def in_peer(python: Path, script: str, case: dict) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        environment = {"HOME": folder, "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
        command = [python.absolute(), HERE / script]
        run = subprocess.run(command, input=json.dumps(case), capture_output=True, text=True, cwd=folder, env=environment)
    if run.returncode:
        sys.exit(run.stderr)
    return json.loads(run.stdout.splitlines()[-1])


def main() -> int:
    parser = argument_parser(__doc__)
    parser.add_argument("--networks", type=Path, required=True, help="TSNet's folder examples/networks")
    args = parser.parse_args()
    tsnet = venv(args.venvs / "TSNet", PEERS["TSNet"]["packages"])
    failed, seconds = False, {}
    print("| network | node | range, m | difference, RMS, m | share of the range | TSNet, s | surgescope, s | times |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for case in CASES:
        inp = args.networks / f"{case['name']}.inp"
        asked = {**case, "nodes": [*case["nodes"], case["end"]], "inp": inp.read_text()}
        peer = in_peer(tsnet, "tnet_case.py", {**asked, "wave_speed_m_s": WAVE_SPEED_M_S, "duration_s": DURATION_S})
        rig = imported(args.program, inp, case["end"])
        as_tsnet(rig, peer, case)
        text, dt_s = written(rig, {n: case.get("called", {}).get(n, n) for n in case["nodes"]}), peer["dt_s"]
        given = {"valve_head_m": peer["heads_m"][case["end"]][0], **speeds(rig, peer)}
        steps = len(peer["heads_m"][case["end"]])
        own_s, _, heads = surgescope(args.program, text, given, dt_s, (steps - 1) * dt_s)
        times = peer["seconds"] / own_s
        for node in case["nodes"]:
            theirs = peer["heads_m"][node]
            pairs = list(zip(heads[node], theirs))
            rms = math.sqrt(sum((a - b) ** 2 for a, b in pairs) / len(pairs))
            reach = max(theirs) - min(theirs)
            print(f"| {case['name']}: {case['words']} | {node} | {reach:.2f} | {rms:.3f} | {100 * rms / reach:.2f} % | {peer['seconds']:.1f} | {own_s:.2g} | {times:.0f} |")
            failed |= rms > MOST_SHARE * reach
        failed |= times < 1000

    # PTSNet chooses its step: the same for both.
    ptsnet = venv(args.venvs / "PTSNet", PTSNET)
    peer = in_peer(ptsnet, "ptsnet_case.py", {"duration_s": DURATION_S, "dt_s": 0.0125, "wave_speed_m_s": WAVE_SPEED_M_S, "burst": ["JUNCTION-20", 0.01, 1, 2]})
    own_s, own_dt_s, _ = surgescope(args.program, text, {"valve_head_m": given["valve_head_m"], "wave_speed_m_s": WAVE_SPEED_M_S}, peer["dt_s"], DURATION_S)
    print(f"\nPTSNet {peer['version']}, its Tnet3, {peer['points']} points, {peer['steps']} steps of {peer['dt_s']:.5f} s: {peer['seconds']:.3f} s")
    print(f"surgescope, steps of {own_dt_s:.5f} s: {own_s:.4f} s, {peer['seconds'] / own_s:.0f} times as fast")
    return int(failed or peer["seconds"] < 20 * own_s)


if __name__ == "__main__":
    sys.exit(main())
