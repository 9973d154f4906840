#!/usr/bin/env python3
"""CPU time of a step and peak memory of networks of more and more nodes: a grid of streets, with loops everywhere.

A square of junctions, each with a pipe to its neighbours on the right and above, a reservoir at one corner and the valve that closes at the other.
Lengths, diameters and demands differ from pipe to pipe.

    python3 tools/peers/grid_network.py target/release/surgescope [NODES ...]
"""

import math
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

STEPS = (50, 550)


def rig(side: int, seed: int = 1) -> str:
    """A rig file of `side` times `side` junctions."""
    chance = random.Random(seed)
    out = ['name = "grid"\n[fluid]\nname = "water"\ntemperature_degC = 20.0\n']
    out.append('[[node]]\nname = "in"\nkind = "reservoir"\nhead_m = 80.0\n[[node]]\nname = "valve"\nkind = "valve"\nclosing_time_s = 0.2\n')
    pipes = [("in", "0,0", 100, 1000), (f"{side - 1},{side - 1}", "valve", 100, 300)]
    for x in range(side):
        for y in range(side):
            demand = chance.uniform(0, 2 / side)
            out.append(f'[[node]]\nname = "{x},{y}"\nkind = "junction"\ndemand_m3_h = {demand:.6f}\n')
            for right, up in [(x + 1, y), (x, y + 1)]:
                if right < side and up < side:
                    pipes.append((f"{x},{y}", f"{right},{up}", chance.uniform(80, 120), chance.choice([200, 250, 300])))
    for k, (start, end, length, diameter) in enumerate(pipes):
        out.append(
            f'[[pipe]]\nname = "p{k}"\nfrom = "{start}"\nto = "{end}"\nlength_m = {length:.3f}\ninner_diameter_mm = {diameter}\n'
            'wall_thickness_mm = 8\nmaterial = "steel"\nwave_speed_m_s = 1200\nfriction_factor = 0.02\n'
        )
    out.append('[[sensor]]\nname = "P1"\nkind = "pressure"\nnode = "valve"\nunit = "m(H2O)"\n')
    return "".join(out)


def run(program: str, folder: Path, side: int, steps: int) -> tuple[float, float]:
    """The whole process's CPU seconds, which other work on the machine hardly changes, and its peak memory in MB."""
    dt = 100.0 / 1200 / 2
    command = [program, "simulate", "--rig", "rig.toml", "--overwrite", "-o", "out.csv", "--duration", str(steps * dt), "--set", "initial_velocity_m_s=0.3"]
    command += ["valve_head_m=60", f"reaches={2 * (2 * side + 1)}"]
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)}: failed")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    program = str(Path(sys.argv[1]).resolve())
    print("| junctions | pipes | a step, µs | a step and junction, ns | whole process of 50 steps, s | peak memory, MB |")
    print("| --- | --- | --- | --- | --- | --- |")
    for nodes in [int(n) for n in sys.argv[2:]] or [1000, 10_000, 100_000, 1_000_000]:
        side = round(math.sqrt(nodes))
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            (folder / "rig.toml").write_text(rig(side))
            few, _ = run(program, folder, side, STEPS[0])
            many, peak = run(program, folder, side, STEPS[1])
        step = (many - few) / (STEPS[1] - STEPS[0])
        print(f"| {side * side} | {2 * side * (side - 1) + 2} | {step * 1e6:.3g} | {step * 1e9 / side**2:.3g} | {few:.3g} | {peak:.4g} |", flush=True)


if __name__ == "__main__":
    main()
