"""The case of compare.py in TSNet; prints JSON. Run by compare.py in a venv of its own."""

import contextlib
import importlib.metadata
import json
import sys
import tempfile
import time
import warnings
from pathlib import Path

warnings.filterwarnings("ignore")
import tsnet  # noqa: E402

# A valve at the pipe's end, behind it a reservoir so low that the valve's own loss carries the rest of the head.
NETWORK = """[JUNCTIONS]
 A 0 0
[RESERVOIRS]
 R {supply_head_m}
 D 0
[PIPES]
 P R A {length_m} {diameter_mm} {hazen_williams} 0 Open
[VALVES]
 V A D {diameter_mm} TCV {valve_loss} 0
[OPTIONS]
 Units LPS
 Headloss H-W
[TIMES]
 Duration 0
[END]
"""


def run(case: dict, steps: int) -> tuple[float, object]:
    """Seconds of the solve and the solved network."""
    velocity = case["velocity_m_s"]
    text = NETWORK.format(
        **case,
        diameter_mm=case["diameter_m"] * 1e3,
        valve_loss=case["valve_head_m"] * 2 * 9.81 / velocity**2,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.inp"
        path.write_text(text)
        model = tsnet.network.TransientModel(str(path))
        model.set_wavespeed(case["wave_speed_m_s"])
        dt = case["dt_s"]
        model.set_time((steps + 0.5) * dt, dt)
        closing = case["closing_steps"] * dt
        model.valve_closure("V", [closing, 0.0, 0.0, 1])
        model = tsnet.simulation.Initializer(model, 0.0, "DD")
        start = time.perf_counter()
        model = tsnet.simulation.MOCSimulator(model, str(Path(folder) / "results"), "steady")
        seconds = time.perf_counter() - start
    return seconds, model


case = json.load(sys.stdin)
with contextlib.redirect_stdout(sys.stderr):
    answer = {"version": importlib.metadata.version("tsnet"), "seconds": run(case, case["steps"]["TSNet"])[0]}
    if case["with_peak"]:
        _, model = run(case, case["peak_steps"])
        heads = model.get_link("P").end_node_head
        answer |= {"first_head_m": float(heads[0]), "peak_m": float(heads.max())}
json.dump(answer, sys.stdout)
