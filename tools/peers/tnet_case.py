"""The network of tnet.py in TSNet; prints JSON. Run by tnet.py in a venv of its own."""

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

case = json.load(sys.stdin)
with contextlib.redirect_stdout(sys.stderr), tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "net.inp"
    path.write_text(case["inp"])
    model = tsnet.network.TransientModel(str(path))
    model.set_wavespeed(case["wave_speed_m_s"])
    model.set_time(case["duration_s"], case["dt_s"])
    # Closing time, start, relative opening at the end, power of its fall.
    model.valve_closure("VALVE", [case["closing_time_s"], model.time_step, 0.0, 1])
    model = tsnet.simulation.Initializer(model, 0.0, "DD")
    start = time.perf_counter()
    model = tsnet.simulation.MOCSimulator(model, str(Path(folder) / "results"), "steady")
    answer = {
        "version": importlib.metadata.version("tsnet"),
        "seconds": time.perf_counter() - start,
        "dt_s": float(model.time_step),
        # As TSNet computes with them: the wave speed that fits its step, and Darcy's factor of the steady flow.
        "pipes": {
            name: {
                "wave_speed_m_s": float(pipe.wavev),
                "friction_factor": float(pipe.roughness),
                "velocity_m_s": float(pipe.start_node_velocity[0]),
                "end_head_m": float(pipe.end_node_head[0]),
            }
            for name, pipe in model.pipes()
        },
        "heads_m": {name: [float(h) for h in model.get_node(name).head] for name in case["nodes"]},
    }
json.dump(answer, sys.stdout)
