"""What Python costs: a call of `simulate` over the library's own, `simulate_many` on two threads over one. Prints three lines.

    cargo build -p surgescope-tools --bin simulate_call
    python bars.py ../../../target/debug/simulate_call
"""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import surgescope as ss

HOME = Path(__file__).resolve().parents[3]
CALLS = 3000
ROWS = 1000


def main(library: str) -> None:
    rig = ss.Rig.load(HOME / "rigs" / "demo-hdpe.toml")
    times_s = np.arange(10) * 0.001
    taken_us = []
    for _ in range(CALLS):
        start = time.perf_counter()
        ss.simulate(rig, set={"reaches": 8}, times_s=times_s)
        taken_us.append((time.perf_counter() - start) * 1e6)
    own_us = float(subprocess.run([library], check=True, capture_output=True, text=True).stdout)
    call_us = float(np.median(taken_us))
    print(f"a call of simulate: {call_us:.0f} us, the library {own_us:.0f} us, over it {call_us - own_us:.0f} us")
    table = {"J1_per_GPa": np.linspace(0.05, 0.2, ROWS)}
    long_s = np.linspace(0.0, 5.0, 500)
    taken_s = []
    for threads in (1, 2):
        start = time.perf_counter()
        ss.simulate_many(rig, ["viscoelastic-wall:1"], table, set={"tau1_s": 0.05}, times_s=long_s, threads=threads)
        taken_s.append(time.perf_counter() - start)
    print(f"simulate_many, {ROWS} rows: {taken_s[0]:.2f} s on one thread, {taken_s[1]:.2f} s on two: {taken_s[0] / taken_s[1]:.2f} times as fast")


if __name__ == "__main__":
    main(sys.argv[1])
