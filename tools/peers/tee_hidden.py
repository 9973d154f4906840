"""A leak or a blockage hidden on one of the three pipes of a tee, by a scheme that shares nothing with the solver: does `diagnose` find effect and pipe?

    python3 tools/peers/tee_hidden.py target/debug/surgescope 20 SEED

The scheme is the textbook's explicit method of characteristics (Wylie & Streeter 1993, ch. 3) with friction at the foot of each characteristic, on a grid that
divides all three pipes; noise of 1 cm is added. It prints a line a case, and how many had the right effect, the right pipe, and the place within 1 m.
"""

import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

G = 9.80665
DX = 1.0
A = 1200.0
PIPES = {"main": (180, 0.05), "run": (96, 0.05), "branch": (67, 0.04)}
FACTOR = 0.024

RIG = """name = "tee"
[fluid]
name = "water"
temperature_degC = 20.0
[[node]]
name = "tank"
kind = "reservoir"
[[node]]
name = "tee"
kind = "junction"
[[node]]
name = "valve"
kind = "valve"
closing_time_s = 0.04
[[node]]
name = "end"
kind = "dead-end"
"""


def rig():
    text = RIG
    for name, ends in {"main": ("tank", "tee"), "run": ("tee", "valve"), "branch": ("tee", "end")}.items():
        length, diameter = PIPES[name]
        text += f"""[[pipe]]
name = "{name}"
from = "{ends[0]}"
to = "{ends[1]}"
length_m = {length}.0
inner_diameter_mm = {diameter * 1e3}
wall_thickness_mm = 2.0
material = "copper"
wave_speed_m_s = {A}
friction_factor = {FACTOR}
"""
    for name, place in {"P1": 'node = "valve"', "P2": 'pipe = "main"\nposition_m = 60.0', "P3": 'node = "end"'}.items():
        text += f'[[sensor]]\nname = "{name}"\nkind = "pressure"\n{place}\nunit = "m(H2O)"\n'
    return text + '[[sensor]]\nname = "Q1"\nkind = "flow"\npipe = "main"\nposition_m = 0.0\nunit = "m3/h"\n'


def simulate(effect, pipe, place, strength, velocity, seed):
    """Times and rows of heads at the valve, on the main and at the dead end, and of the flow from the tank, m and m3/s."""
    dt = DX / A
    area = {p: math.pi / 4 * d * d for p, (_, d) in PIPES.items()}
    z = {p: A / (G * area[p]) for p in PIPES}
    r = {p: FACTOR * DX / (2 * G * d * area[p] ** 2) for p, (_, d) in PIPES.items()}
    # steady flows and heads back from the valve, a few rounds for the leak
    valve_head, q0 = 40.0, velocity * area["run"]
    leak = 0.0
    for _ in range(60):
        flow = {"run": [q0] * 97, "main": [q0] * 181, "branch": [0.0] * 68}
        if effect == "leak":
            upstream = {"run": ["main"], "branch": ["main"], "main": []}[pipe]
            for p in upstream:
                flow[p] = [q + leak for q in flow[p]]
            for i in range(place):
                flow[pipe][i] += leak
        head = {p: [0.0] * (n + 1) for p, (n, _) in PIPES.items()}

        def back(p, end):
            head[p][-1] = end
            for i in range(len(head[p]) - 2, -1, -1):
                head[p][i] = head[p][i + 1] + r[p] * flow[p][i] * abs(flow[p][i])
                if effect == "blockage" and p == pipe and i + 1 == place:
                    head[p][i] += strength / (2 * G * area[p] ** 2) * flow[p][i] * abs(flow[p][i])
            return head[p][0]

        tee = back("run", valve_head)
        tank = back("main", tee)
        head["branch"][0] = tee
        for i in range(1, 68):
            head["branch"][i] = head["branch"][i - 1] - r["branch"] * flow["branch"][i - 1] * abs(flow["branch"][i - 1])
        if effect == "leak":
            leak = strength * 1e-6 * math.sqrt(2 * G * head[pipe][place])
    # Heads and flows; at the place of the effect the flow before and behind it differ, or the head.
    left_q = {p: list(q) for p, q in flow.items()}
    right_q = {p: list(q) for p, q in flow.items()}
    if effect == "leak":
        left_q[pipe][place] = right_q[pipe][place] + leak
    left_h = {p: list(h) for p, h in head.items()}
    right_h = {p: list(h) for p, h in head.items()}
    if effect == "blockage":
        k = strength / (2 * G * area[pipe] ** 2)
        left_h[pipe][place] = right_h[pipe][place] + k * q0 * abs(q0) * (0 if pipe == "branch" else 1)
    noise = random.Random(seed)
    rows, steps = [], int(3.0 / dt)
    before = int(0.3 / dt)

    def row(t):
        shown = [left_h["run"][-1], left_h["main"][60], left_h["branch"][-1]]
        rows.append([t] + [h + noise.gauss(0, 0.01) for h in shown] + [right_q["main"][0] * 3600 * (1 + noise.gauss(0, 0.002))])

    for i in range(before):
        row(i * dt)
    for step in range(1, steps):
        t = step * dt
        nl_h, nr_h = {p: list(h) for p, h in left_h.items()}, {p: list(h) for p, h in right_h.items()}
        nl_q, nr_q = {p: list(q) for p, q in left_q.items()}, {p: list(q) for p, q in right_q.items()}

        def cp(p, i):
            q = right_q[p][i - 1]
            return right_h[p][i - 1] + z[p] * q - r[p] * q * abs(q)

        def cm(p, i):
            q = left_q[p][i + 1]
            return left_h[p][i + 1] - z[p] * q + r[p] * q * abs(q)

        for p, (n, _) in PIPES.items():
            for i in range(1, n):
                a, b = cp(p, i), cm(p, i)
                h, q = 0.5 * (a + b), 0.5 * (a - b) / z[p]
                nl_h[p][i] = nr_h[p][i] = h
                nl_q[p][i] = nr_q[p][i] = q
                if p == pipe and i == place and effect == "leak":
                    # h + z/2 c sqrt(h) = mean of the characteristics
                    c = 0.5 * z[p] * strength * 1e-6 * math.sqrt(2 * G)
                    root = 0.5 * (-c + math.sqrt(c * c + 4 * max(h, 0.0)))
                    h = root * root if h > 0 else h
                    nl_h[p][i] = nr_h[p][i] = h
                    nl_q[p][i], nr_q[p][i] = (a - h) / z[p], (h - b) / z[p]
                if p == pipe and i == place and effect == "blockage":
                    k = strength / (2 * G * area[p] ** 2)
                    d = a - b
                    q = math.copysign(2 * abs(d) / (2 * z[p] + math.sqrt(4 * z[p] ** 2 + 4 * k * abs(d))), d)
                    nl_h[p][i], nr_h[p][i] = a - z[p] * q, b + z[p] * q
                    nl_q[p][i] = nr_q[p][i] = q
        nr_h["main"][0] = tank
        nr_q["main"][0] = (tank - cm("main", 0)) / z["main"]
        arrived = [(cp("main", 180), z["main"]), (cm("run", 0), z["run"]), (cm("branch", 0), z["branch"])]
        tee = sum(e / y for e, y in arrived) / sum(1 / y for _, y in arrived)
        nl_h["main"][-1] = nr_h["run"][0] = nr_h["branch"][0] = tee
        nl_q["main"][-1] = (arrived[0][0] - tee) / z["main"]
        nr_q["run"][0] = (tee - arrived[1][0]) / z["run"]
        nr_q["branch"][0] = (tee - arrived[2][0]) / z["branch"]
        nl_h["branch"][-1], nl_q["branch"][-1] = cp("branch", 67), 0.0
        a, opening = cp("run", 96), max(0.0, 1 - t / 0.04)
        c = opening * q0 / math.sqrt(valve_head)
        q = math.copysign(2 * abs(a) * c / (z["run"] * c + math.sqrt((z["run"] * c) ** 2 + 4 * abs(a))), a) if c > 0 else 0.0
        nl_h["run"][-1], nl_q["run"][-1] = a - z["run"] * q, q
        left_h, right_h, left_q, right_q = nl_h, nr_h, nl_q, nr_q
        row((before + step) * dt)
    return rows


def main():
    program, cases, seed = Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3])
    chance = random.Random(seed)
    effects = pipes = places = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        (folder / "tee.toml").write_text(rig())
        for case in range(cases):
            pipe = ["main", "run", "branch"][case % 3]
            # No water flows past a dead end, so that a blockage there costs next to nothing: a leak there, else either.
            effect = "leak" if pipe == "branch" else chance.choice(["leak", "blockage"])
            place = chance.randint(5, PIPES[pipe][0] - 5)
            strength = chance.uniform(1.5, 6.0) if effect == "leak" else chance.uniform(80, 400)
            rows = simulate(effect, pipe, place, strength, chance.uniform(0.1, 0.25), seed + case)
            lines = ["time_s,P1,P2,P3,Q1"] + [",".join(f"{v:.9g}" for v in row) for row in rows]
            (folder / "case.csv").write_text("\n".join(lines) + "\n")
            run = lambda *words: subprocess.run([program, *words], cwd=folder, capture_output=True, text=True)
            run("import", "case.csv", "--rig", "tee.toml", "--yes", "-o", f"case{case}.mcap")
            answer = json.loads(run("diagnose", f"case{case}.mcap", "--json").stdout or "{}")
            best = (answer.get("candidates") or [{}])[0]
            label = best.get("form") or best.get("label") or best.get("effect", "none")
            values = {p["name"]: p["value"] for p in best.get("parameters", [])}
            found_m = next((v for n, v in values.items() if n.endswith("position_m")), math.nan)
            right = label.split("@")[0] == effect
            right_pipe = right and label.endswith(f"@{pipe}")
            effects, pipes = effects + right, pipes + right_pipe
            places += right_pipe and abs(found_m - place) < 1.0
            print(f"{effect}@{pipe} at {place} m ({strength:.3g}): {answer.get('verdict')}, {label} at {found_m:.2f} m")
    print(f"right effect {effects}, right pipe {pipes}, place within 1 m {places} of {cases}")


if __name__ == "__main__":
    main()
