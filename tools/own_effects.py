"""How often `diagnose` finds effects that the catalogue lacks, with their files in `effects/` beside the rig.

A relief valve, a check valve with a spring and a supply with two modes are simulated by a scheme that shares nothing with the solver (leapfrog in
time, staggered in space), with noise, and imported. Prints one line a draw, and how many were named.

    python3 tools/own_effects.py target/release/surgescope --draws 20 --seed 1
"""
import argparse
import json
import pathlib
import random
import subprocess
import tempfile

import numpy as np

G = 9.80665
RIG = """name = "hidden"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = {length}
inner_diameter_mm = 50.0
wall_thickness_mm = 3.0
material = "steel"
friction_factor = 0.02
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = {closing}
[[sensor]]
name = "P1"
kind = "pressure"
position_m = {length}
unit = "m(H2O)"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = {middle}
unit = "m(H2O)"
[[sensor]]
name = "Q1"
kind = "flow"
position_m = {length}
unit = "L/s"
"""
FILES = {
    "relief-valve": """name = "relief-valve"
says = "A relief valve that opens above a set head."
at = "node"
gives = "flow_out_m3_s"
law = "if(H > set_head_m, cda_mm2 * 1e-6 * sqrt(2 * g * (H - set_head_m)), 0)"
[parameter.set_head_m]
unit = "m"
start = 60
bounds = [35, 250]
[parameter.cda_mm2]
unit = "mm²"
start = 10
bounds = [0, 400]
vanishes_at = 0
""",
    "spring-check": """name = "spring-check"
says = "A check valve whose spring closes it as the flow falls."
at = "node"
gives = "head_loss_m"
law = "loss_m * Q * abs(Q) / Q0^2 / max(opening, 0.05)^2"
[parameter.loss_m]
unit = "m"
start = 1
bounds = [0, 30]
vanishes_at = 0
[parameter.spring_time_s]
unit = "s"
start = 0.1
bounds = [0.01, 2]
scale = "log"
[state.opening]
start = 1
rate = "(min(max(Q / Q0, 0), 1) - opening) / spring_time_s"
""",
    "two-mode-supply": """name = "two-mode-supply"
says = "A supply that swings and settles at another head."
at = "supply"
gives = "head_m"
law = "H + swing_m * (exp(-t / 1.5) * sin(2 * pi * frequency_Hz * t) + settled_share * (1 - exp(-t / 0.8)))"
[parameter.swing_m]
unit = "m"
start = 0.5
bounds = [-10, 10]
vanishes_at = 0
[parameter.frequency_Hz]
unit = "Hz"
start = 0.6
bounds = [0.1, 3]
scale = "log"
[parameter.settled_share]
unit = "1"
start = 0.3
bounds = [-3, 3]
""",
}


def simulate(kind, rng, length, speed, velocity, head, closing, duration=4.0):
    """Heads at the valve and in the middle every 2 ms, and what was hidden."""
    area = np.pi / 4 * 0.05**2
    n = 300
    dx = length / n
    dt = 0.95 * dx / speed
    q0 = velocity * area
    slope = 0.02 * velocity**2 / (2 * G * 0.05)
    rise = speed * velocity / G
    at = rng.uniform(0.25, 0.75)
    node = round(at * n)
    h = head + slope * length * (1 - np.arange(n + 1) / n)
    truth = {"position_m": node * dx}
    loss = tau = 0.0
    if kind == "relief-valve":
        set_head = float(h[0] + rng.uniform(0.2, 0.5) * rise)
        c = rng.uniform(10, 40) * 1e-6 * np.sqrt(2 * G)
        truth |= {"set_head_m": set_head, "cda_mm2": c / np.sqrt(2 * G) * 1e6}
    elif kind == "spring-check":
        loss, tau = rng.uniform(0.3, 2.0), rng.uniform(0.05, 0.4)
        # The loss sits where the flow is, half a cell further.
        truth = {"position_m": (node + 0.5) * dx, "loss_m": loss, "spring_time_s": tau}
        h[: node + 1] += loss
    else:
        swing, frequency, share = rng.uniform(0.4, 2.0), rng.uniform(0.3, 1.5), rng.uniform(-0.6, 0.6)
        truth = {"swing_m": swing, "frequency_Hz": frequency, "settled_share": share}
    supply = h[0]
    q = np.full(n, q0)
    opening = 1.0
    k = speed**2 / (G * area) * dt / dx
    every = 0.002
    times, out, t = [], [], -0.3
    while t < duration:
        if t >= len(times) * every - 0.3:
            times.append(t), out.append((h[-1], h[n // 2], 1e3 * q[-1]))
        friction = 0.02 * q * np.abs(q) / (2 * 0.05 * area)
        q = q - dt * (G * area * np.diff(h) / dx + friction)
        if kind == "spring-check":
            # x² from the flow, the loss over one cell: u + b u|u| = known
            b = dt * G * area / dx * loss / q0**2 / max(opening, 0.05) ** 2
            known = q[node]
            q[node] = 2 * known / (1 + np.sqrt(1 + 4 * b * abs(known)))
            if t >= 0:
                opening += dt / tau * (min(max(q[node] / q0, 0), 1) - opening)
        t += dt
        h[1:-1] -= k * np.diff(q)
        if kind == "relief-valve" and h[node] > set_head:
            y = 0.5 * (-k * c + np.sqrt((k * c) ** 2 + 4 * (h[node] - set_head)))
            h[node] = set_head + y * y
        h[0] = supply
        if kind == "two-mode-supply" and t > 0:
            h[0] += swing * (np.exp(-t / 1.5) * np.sin(2 * np.pi * frequency * t) + share * (1 - np.exp(-t / 0.8)))
        root = max(0.0, 1 - max(t, 0) / closing) * q0 / np.sqrt(head)
        known = h[-1] + 2 * k * q[-1]
        # h + 2 k root √h = known
        y = 0.5 * (-2 * k * root + np.sqrt((2 * k * root) ** 2 + 4 * max(known, 0))) if root else 0
        h[-1] = y * y if root else known
    return np.array(times) + 0.3, np.array(out), truth


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=FILES, action="append")
    args = parser.parse_args()
    program = pathlib.Path(args.program).resolve()
    for kind in args.kind or FILES:
        found = 0
        for draw in range(args.draws):
            rng = random.Random(f"{kind}{args.seed}{draw}")
            length, speed, velocity = rng.uniform(60, 200), rng.uniform(1000, 1300), rng.uniform(0.12, 0.27)
            head, closing = rng.uniform(38, 50), rng.uniform(0.08, 0.2)
            time, seen, truth = simulate(kind, rng, length, speed, velocity, head, closing)
            noise = np.random.default_rng(draw).normal(0, [0.1, 0.1, 0.01], seen.shape)
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                (folder / "effects").mkdir()
                (folder / "effects" / f"{kind}.toml").write_text(FILES[kind])
                rig = RIG.format(length=length, middle=length / 2, closing=closing)
                (folder / "rig.toml").write_text(rig)
                rows = [f"{t:.5f},{a:.4f},{b:.4f},{c:.4f}" for t, (a, b, c) in zip(time, seen + noise)]
                (folder / "run.csv").write_text("time_s,P1,P2,Q1\n" + "\n".join(rows) + "\n")
                subprocess.run([program, "import", "run.csv", "--rig", "rig.toml", "-o", "run.mcap"], cwd=folder, check=True, capture_output=True)
                answer = subprocess.run([program, "diagnose", "run.mcap", "--json"], cwd=folder, capture_output=True, text=True)
            if answer.returncode not in (0, 1):
                print(kind, draw, answer.stderr.strip()[-300:])
                continue
            answer = json.loads(answer.stdout)
            best = answer["candidates"][0] if answer["candidates"] else {"effect": "-", "probability": 0, "parameters": []}
            named = answer["verdict"] == "missing-effect" and best["effect"] == kind
            found += named
            values = {p["name"]: round(p["value"], 3) for p in best["parameters"]}
            print(kind, draw, answer["verdict"], best["effect"], round(best["probability"], 3), values, "hidden", {k: round(v, 3) for k, v in truth.items()}, flush=True)
        print(f"{kind}: named in {found} of {args.draws}", flush=True)


main()
