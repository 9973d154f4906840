"""Tnet3 of PTSNet's examples, with a burst; prints JSON. Run by tnets.py in a venv of its own."""

import contextlib
import importlib.metadata
import json
import sys
import time
import warnings
from pathlib import Path

warnings.filterwarnings("ignore")
import ptsnet  # noqa: E402
from ptsnet.simulation.sim import PTSNETSimulation  # noqa: E402

case = json.load(sys.stdin)
with contextlib.redirect_stdout(sys.stderr):
    network = Path(ptsnet.__file__).parent / "examples" / "TNET3.inp"
    settings = {"time_step": case["dt_s"], "duration": case["duration_s"], "default_wave_speed": case["wave_speed_m_s"], "save_results": False}
    best = None
    for turn in range(3):
        simulation = PTSNETSimulation(workspace_name=f"turn{turn}", inpfile=str(network), settings=settings)
        simulation.add_burst(*case["burst"])
        simulation.initialize()
        start = time.perf_counter()
        simulation.run()
        seconds = time.perf_counter() - start
        best = seconds if best is None else min(best, seconds)
answer = {
    "version": importlib.metadata.version("ptsnet"),
    "seconds": best,
    "dt_s": float(simulation.settings.time_step),
    "steps": int(simulation.settings.time_steps),
    "points": int(simulation.num_points),
}
print(json.dumps(answer))
